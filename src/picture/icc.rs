//! Colour profiles: a curve for each channel and the light of the primaries, or a curve of grey.
//!
//! Light is taken from the primaries that the profile names, and not clipped: what no display of sRGB shows keeps
//! its luminance. Profiles that are tables (of printers, and of some displays) are not read.
//!
//! # References
//! \[ICC\] 8.3.3 and 8.3.4 (three components, monochrome), 10.6 and 10.18 (curves), `profileDescriptionTag`.

use glam::{DMat3, DVec3};
use moxcms::{ColorProfile, DataColorSpace, ToneReprCurve};

use super::primaries::d50_to_rec709;

/// What a profile says of the numbers of a picture.
#[derive(Clone, Debug)]
pub struct Profile {
    /// Curves of red, green and blue, or of all three.
    curves: Vec<Curve>,
    /// From linear channels to Rec.709.
    pub matrix: DMat3,
    /// Whether the curve gives the lightness L* of CIE, of which 1 is white, and not light.
    is_lightness: bool,
}

impl Profile {
    /// Reads a profile of pictures of colours, or of grey ones; `None` where it is damaged, of other pictures, or a
    /// table.
    #[must_use]
    pub fn read(bytes: &[u8], is_grey: bool) -> Option<Self> {
        let profile = ColorProfile::new_from_slice(bytes).ok()?;
        if is_grey && profile.color_space == DataColorSpace::Gray {
            // Grey is the white of the profile, whatever that is. [ICC] 8.3.4: the curve leads to the
            // connection space, which may be L*a*b*.
            let is_lightness = match profile.pcs {
                DataColorSpace::Xyz => false,
                DataColorSpace::Lab => true,
                _ => return None,
            };
            let curves = vec![Curve::of(&profile.gray_trc?)?];
            return Some(Self { curves, matrix: DMat3::IDENTITY, is_lightness });
        }
        if profile.color_space != DataColorSpace::Rgb || profile.pcs != DataColorSpace::Xyz {
            return None;
        }
        let curves = [&profile.red_trc, &profile.green_trc, &profile.blue_trc];
        let curves = curves.into_iter().map(|curve| Curve::of(curve.as_ref()?)).collect::<Option<_>>()?;
        let colorants = [profile.red_colorant, profile.green_colorant, profile.blue_colorant];
        let [red, green, blue] = colorants.map(|c| DVec3::new(c.x, c.y, c.z));
        let colorants = DMat3::from_cols(red, green, blue);
        let is_sound = colorants.is_finite() && colorants.determinant().abs() > 1e-6;
        is_sound.then(|| Some(Self { curves, matrix: d50_to_rec709()? * colorants, is_lightness: false }))?
    }

    /// Number of curves: 1 or 3.
    #[must_use]
    pub fn n_curves(&self) -> usize {
        self.curves.len()
    }

    /// Linear light of a sample of a channel.
    #[must_use]
    pub fn decode(&self, channel: usize, v: f64) -> f64 {
        let decoded = self.curves[channel.min(self.curves.len() - 1)].decode(v);
        if self.is_lightness { luminance_of(decoded) } else { decoded }
    }
}

/// Luminance of a lightness L* of CIE, both 1 for white.
fn luminance_of(lightness: f64) -> f64 {
    // [CIE15] 8.2.1.1: L* = 116·f(Y) − 16, f the cubic root above (24/116)³ and a line below.
    let f = (100.0 * lightness + 16.0) / 116.0;
    if f > 24.0 / 116.0 { f.powi(3) } else { (f - 16.0 / 116.0) * 108.0 / 841.0 }
}

/// From a sample to light.
#[derive(Clone, Debug)]
enum Curve {
    /// \[ICC\] 10.18, by its parameters g, a, b, c, d, e, f: `(a·v + b)^g + e` from d on, `c·v + f` below.
    Parametric([f64; 7]),
    /// Light at even distances, of which 1 is the largest.
    Table(Vec<f64>),
}

impl Curve {
    /// `None` where the number of its parameters is not known, or one is no number.
    fn of(curve: &ToneReprCurve) -> Option<Self> {
        let power = |g: f64| Self::Parametric([g, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        Some(match curve {
            ToneReprCurve::Lut(values) => match values.as_slice() {
                [] => power(1.0),
                // A fixed-point number with 8 bits behind the point.
                [g] => power(f64::from(*g) / 256.0),
                values => Self::Table(values.iter().map(|&v| f64::from(v) / 65_535.0).collect()),
            },
            ToneReprCurve::Parametric(p) => {
                let p: Vec<f64> = p.iter().map(|&v| f64::from(v)).collect();
                if !p.iter().all(|v| v.is_finite()) {
                    return None;
                }
                // [ICC] table 68: below d of the shorter kinds the curve is flat.
                match p[..] {
                    [g] => power(g),
                    [g, a, b] if a != 0.0 => Self::Parametric([g, a, b, 0.0, -b / a, 0.0, 0.0]),
                    [g, a, b, c] if a != 0.0 => Self::Parametric([g, a, b, 0.0, -b / a, c, c]),
                    [g, a, b, c, d] => Self::Parametric([g, a, b, c, d, 0.0, 0.0]),
                    [g, a, b, c, d, e, f] => Self::Parametric([g, a, b, c, d, e, f]),
                    _ => return None,
                }
            }
        })
    }

    fn decode(&self, v: f64) -> f64 {
        match self {
            Self::Parametric([g, a, b, c, d, e, f]) => {
                if v >= *d {
                    (a * v + b).max(0.0).powf(*g) + e
                } else {
                    c * v + f
                }
            }
            Self::Table(values) => {
                let place = v.clamp(0.0, 1.0) * (values.len() - 1) as f64;
                let below = (place as usize).min(values.len() - 2);
                values[below] + (place - below as f64) * (values[below + 1] - values[below])
            }
        }
    }
}

/// How an ICC profile describes itself, in English where it has a choice.
#[must_use]
pub fn description(profile: &[u8]) -> Option<String> {
    let count = be_u32(profile, 128)? as usize;
    let tag = profile.get(132..)?.chunks_exact(12).take(count).find(|tag| tag.starts_with(b"desc"))?;
    let (offset, size) = (be_u32(tag, 4)? as usize, be_u32(tag, 8)? as usize);
    let data = profile.get(offset..offset.checked_add(size)?)?;
    let text = match data.get(..4)? {
        // [ICC] textDescriptionType of version 2
        b"desc" => {
            let length = be_u32(data, 8)? as usize;
            String::from_utf8_lossy(data.get(12..12_usize.checked_add(length)?)?).into_owned()
        }
        // [ICC] multiLocalizedUnicodeType of version 4
        b"mluc" => {
            let count = be_u32(data, 8)? as usize;
            let records = || data.get(16..).unwrap_or_default().chunks_exact(12).take(count);
            let record = records().find(|r| r.starts_with(b"en")).or_else(|| records().next())?;
            let (length, offset) = (be_u32(record, 4)? as usize, be_u32(record, 8)? as usize);
            let units = data.get(offset..offset.checked_add(length)?)?.as_chunks().0;
            let units: Vec<u16> = units.iter().map(|&unit| u16::from_be_bytes(unit)).collect();
            String::from_utf16_lossy(&units)
        }
        _ => return None,
    };
    let shown: String = text.trim_matches('\0').chars().filter(|c| !c.is_control()).take(80).collect();
    (!shown.is_empty()).then_some(shown)
}

fn be_u32(bytes: &[u8], at: usize) -> Option<u32> {
    bytes.get(at..)?.first_chunk().map(|&b| u32::from_be_bytes(b))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn profile(desc: &[u8]) -> Vec<u8> {
        let mut profile = vec![0; 128];
        profile.extend(1_u32.to_be_bytes());
        profile.extend(b"desc");
        profile.extend(144_u32.to_be_bytes());
        profile.extend((desc.len() as u32).to_be_bytes());
        profile.extend(desc);
        profile
    }

    #[test]
    fn both_versions_of_profiles_tell_their_name() {
        let two = profile(b"desc\0\0\0\0\0\0\0\x08eciRGB\n\0");
        assert_eq!(description(&two).as_deref(), Some("eciRGB"));
        let mut text =
            b"mluc\0\0\0\0\0\0\0\x02\0\0\0\x0cdeDE\0\0\0\x02\0\0\0\x28enUS\0\0\0\x04\0\0\0\x2a".to_vec();
        text.extend("xP3".encode_utf16().flat_map(u16::to_be_bytes));
        assert_eq!(description(&profile(&text)).as_deref(), Some("P3"));
    }

    #[test]
    fn curves_are_those_of_the_formulas() {
        let srgb = Curve::of(&ToneReprCurve::Parametric(vec![
            2.4,
            1.0 / 1.055,
            0.055 / 1.055,
            1.0 / 12.92,
            0.04045,
        ]));
        for i in 0..=100 {
            let v = f64::from(i) / 100.0;
            let light = srgb.as_ref().unwrap().decode(v);
            assert!((light - crate::math::display::eotf_srgb(v)).abs() < 1e-6, "{v} {light}");
        }
        let gamma = Curve::of(&ToneReprCurve::Lut(vec![563])).unwrap();
        assert!((gamma.decode(0.5) - 0.5_f64.powf(563.0 / 256.0)).abs() < 1e-12);
        let table = Curve::of(&ToneReprCurve::Lut(vec![0, 13_107, 65_535])).unwrap();
        assert!((table.decode(0.75) - 0.6).abs() < 1e-9 && table.decode(2.0) == 1.0);
        assert!((Curve::of(&ToneReprCurve::Lut(vec![])).unwrap().decode(0.3) - 0.3).abs() < 1e-12);
        assert!(Curve::of(&ToneReprCurve::Parametric(vec![1.0; 6])).is_none());
    }

    /// Values of L* and Y of the CIE's own table of greys, and both ends.
    #[test]
    fn a_grey_profile_may_be_of_lightness() {
        for (lightness, luminance) in [(0.0, 0.0), (8.0, 0.008_856), (50.0, 0.184_187), (100.0, 1.0)] {
            let found = luminance_of(lightness / 100.0);
            assert!((found - luminance).abs() < 1e-6, "{lightness}: {found}");
        }
        let mut profile = ColorProfile::new_gray_with_gamma(1.0);
        for (pcs, wanted) in [(DataColorSpace::Xyz, 0.5), (DataColorSpace::Lab, 0.184_187)] {
            profile.pcs = pcs;
            let read = Profile::read(&profile.encode().unwrap(), true).unwrap();
            assert!((read.decode(0, 0.5) - wanted).abs() < 1e-5, "{pcs:?} {}", read.decode(0, 0.5));
        }
    }

    /// Profiles that the crate writes, held against the primaries that they stand for.
    #[test]
    fn primaries_are_those_of_the_space() {
        let spaces = [
            (ColorProfile::new_display_p3(), crate::math::primaries::P3_D65),
            (ColorProfile::new_adobe_rgb(), crate::math::primaries::ADOBE_RGB),
            (ColorProfile::new_bt2020(), crate::math::primaries::REC2020),
        ];
        for (profile, space) in spaces {
            let read = Profile::read(&profile.encode().unwrap(), false).unwrap();
            let wanted = space.to_rec709().unwrap();
            assert!((read.matrix - wanted).abs_diff_eq(DMat3::ZERO, 1e-3), "{} {wanted}", read.matrix);
        }
    }

    #[test]
    fn broken_profiles_are_not_read() {
        let whole = ColorProfile::new_display_p3().encode().unwrap();
        assert!(Profile::read(&whole, false).is_some() && Profile::read(&whole, true).is_some());
        for n in (0..whole.len()).step_by(7) {
            let mut cut = whole[..n].to_vec();
            let _ = Profile::read(&cut, false);
            cut.resize(whole.len(), 0xff);
            let _ = Profile::read(&cut, false);
        }
        assert!(Profile::read(b"", false).is_none());
    }

    #[test]
    fn broken_profiles_have_no_name() {
        let whole = profile(b"desc\0\0\0\0\0\0\0\x03abc");
        for n in 0..whole.len() {
            assert_eq!(description(&whole[..n]), None, "{n}");
        }
        assert_eq!(description(&profile(b"desc\0\0\0\0\xff\xff\xff\xffabc")), None);
    }
}
