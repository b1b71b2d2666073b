//! What the numbers of a picture mean: from samples to linear Rec.709.

use glam::{DMat3, DVec3};

use super::primaries::{self, Chromaticities};
use crate::math::display::eotf_srgb;

/// From an encoded sample to linear light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Transfer {
    /// None: samples are proportional to light.
    Linear,
    /// IEC 61966-2-1.
    Srgb,
    /// Light is the sample to this power.
    Power(f64),
    /// The camera curve of Rec.709, Rec.601 and Rec.2020.
    Bt709,
}

impl Transfer {
    /// Linear light of a sample; curves are continued to negative values by symmetry.
    #[must_use]
    pub fn decode(self, v: f64) -> f64 {
        let magnitude = v.abs();
        let light = match self {
            Self::Linear => return v,
            Self::Srgb => eotf_srgb(magnitude),
            Self::Power(exponent) => magnitude.powf(exponent),
            Self::Bt709 if magnitude < 0.081 => magnitude / 4.5,
            Self::Bt709 => ((magnitude + 0.099) / 1.099).powf(1.0 / 0.45),
        };
        light.copysign(v)
    }
}

/// How samples become linear Rec.709.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Colour {
    /// Decodes each channel.
    pub transfer: Transfer,
    /// Factor on each decoded channel.
    pub gain: [f64; 3],
    /// To Rec.709, where the primaries are others.
    pub matrix: Option<DMat3>,
}

impl Colour {
    /// Rec.709 behind a transfer function.
    #[must_use]
    pub const fn rec709(transfer: Transfer) -> Self {
        Self { transfer, gain: [1.0; 3], matrix: None }
    }

    /// The primaries of a file; `None` when they are those of no device.
    #[must_use]
    pub fn with_primaries(self, chromaticities: Chromaticities) -> Option<Self> {
        if chromaticities.is_rec709() {
            return Some(Self { matrix: None, ..self });
        }
        Some(Self { matrix: Some(chromaticities.to_rec709()?), ..self })
    }

    /// Whether a table of sRGB, or nothing at all, decodes it.
    #[must_use]
    pub fn is_plain(&self) -> bool {
        self.gain == [1.0; 3]
            && self.matrix.is_none()
            && matches!(self.transfer, Transfer::Linear | Transfer::Srgb)
    }

    /// Linear Rec.709 of decoded channels.
    #[must_use]
    pub fn mix(&self, decoded: [f64; 3]) -> [f64; 3] {
        if self.gain == [1.0; 3] && self.matrix.is_none() {
            return decoded;
        }
        let light = DVec3::from_array(decoded) * DVec3::from_array(self.gain);
        self.matrix.map_or(light, |m| m * light).to_array()
    }
}

/// The colour space of a name by the *Color Interop Forum*, such as `lin_ap1_scene`, or of those
/// that OpenImageIO wrote before; `None` when the name says nothing.
///
/// # Errors
/// With the name, when it says something that is not known here.
pub fn interop_space(name: &str) -> Result<Option<Colour>, String> {
    let lower = name.to_lowercase();
    match lower.as_str() {
        "data" | "raw" | "unknown" | "" => return Ok(None),
        "linear" | "lin_srgb" | "lin_rec709" | "linear rec.709" => {
            return Ok(Some(Colour::rec709(Transfer::Linear)));
        }
        "srgb" | "srgb_rec709" => return Ok(Some(Colour::rec709(Transfer::Srgb))),
        "acescg" => return Ok(Colour::rec709(Transfer::Linear).with_primaries(primaries::AP1)),
        _ => {}
    }
    let mut words = lower.trim_end_matches("_scene").trim_end_matches("_display").splitn(2, '_');
    let transfer = match words.next() {
        Some("lin") => Transfer::Linear,
        Some("srgb" | "srgbe") => Transfer::Srgb,
        Some("g18") => Transfer::Power(1.8),
        Some("g22") => Transfer::Power(2.2),
        Some("g24") => Transfer::Power(2.4),
        Some("g26") => Transfer::Power(2.6),
        _ => return Err(name.to_owned()),
    };
    let chromaticities = match words.next() {
        Some("rec709") => primaries::REC709,
        Some("rec2020") => primaries::REC2020,
        Some("p3d65") => primaries::P3_D65,
        Some("adobergb") => primaries::ADOBE_RGB,
        Some("ap0") => primaries::AP0,
        Some("ap1") => primaries::AP1,
        Some("xyzd65" | "ciexyzd65") => {
            return Ok(Some(Colour { matrix: primaries::xyz_to_rec709(), ..Colour::rec709(transfer) }));
        }
        _ => return Err(name.to_owned()),
    };
    Ok(Colour::rec709(transfer).with_primaries(chromaticities))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curves_are_continuous_and_odd() {
        for transfer in [Transfer::Linear, Transfer::Srgb, Transfer::Power(2.2), Transfer::Bt709] {
            assert!((transfer.decode(1.0) - 1.0).abs() < 1e-12 && transfer.decode(0.0) == 0.0);
            let mut before = 0.0;
            for i in 1..=2000 {
                let light = transfer.decode(f64::from(i) / 1000.0);
                assert!(light > before && light - before < 0.01, "{transfer:?} {i}");
                assert_eq!(transfer.decode(-f64::from(i) / 1000.0), -light);
                before = light;
            }
        }
    }

    #[test]
    fn names_of_colour_spaces_are_understood_or_refused() {
        let display = interop_space("srgb_rec709_display").unwrap().unwrap();
        assert_eq!(display, Colour::rec709(Transfer::Srgb));
        assert!(display.is_plain());
        let acescg = interop_space("lin_ap1_scene").unwrap().unwrap();
        assert_eq!((acescg.transfer, acescg.matrix), (Transfer::Linear, primaries::AP1.to_rec709()));
        assert_eq!(interop_space("lin_rec709_scene"), Ok(Some(Colour::rec709(Transfer::Linear))));
        assert!(interop_space("lin_rec2020_scene").unwrap().unwrap().matrix.is_some());
        assert_eq!(interop_space("data"), Ok(None));
        for strange in ["pq_rec2020_display", "hlg_rec2020_display", "lin_mine_scene", "ocio:filmic"] {
            assert_eq!(interop_space(strange), Err(strange.to_owned()));
        }
    }

    #[test]
    fn xyz_is_adapted_from_d65_and_gives_white() {
        let xyz = interop_space("lin_ciexyzd65_scene").unwrap().unwrap();
        let [x, y] = [0.3127, 0.3290];
        let white = xyz.mix([x / y, 1.0, (1.0 - x - y) / y]);
        assert!(white.iter().all(|v| (v - 1.0).abs() < 1e-9), "{white:?}");
    }
}
