//! View transforms: what stands between linear light and the light of a display.
//!
//! A view makes display-linear Rec.709 in [0, 1] of a linear Rec.709 colour that is multiplied by the
//! exposure. The file of a picture then has `oetf_srgb` of it. Derivatives are exact, but for those of OpenColorIO,
//! which are differences; where a channel is clipped they are 0, and on an edge between two pieces those of one of them.

mod agx;
mod filmic;
mod lattice;
mod neutral;
mod ocio;
mod tables;

use std::{fmt, path::Path, sync::LazyLock};

use glam::{DMat3, DVec3};
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

pub use ocio::{OcioError, OcioView, PREFIX as OCIO};
pub use tables::Tables;

use super::display::{eotf_srgb, eotf_srgb_derivative, oetf_srgb};

/// Linear value of middle grey, about which the logarithms of [`ViewTransform::Agx`] and [`ViewTransform::Filmic`] count.
const MIDDLE_GREY: f64 = 0.18;

/// A view transform.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum ViewTransform {
    /// Light as it is, clipped: Blender's Standard.
    #[default]
    Srgb,
    /// Blender's AgX, its default since 4.0, without a look.
    Agx,
    /// Blender's Filmic, its default before, without a look.
    Filmic,
    /// Khronos' PBR Neutral.
    PbrNeutral,
    /// Light as the code value itself, clipped and not encoded: Blender's Raw.
    Linear,
    /// A view of a configuration of OpenColorIO.
    Ocio(&'static OcioView),
}

impl ViewTransform {
    /// All views that are the program's own.
    pub const ALL: [Self; 5] = [Self::Srgb, Self::Agx, Self::Filmic, Self::PbrNeutral, Self::Linear];

    /// Name on the command line, in sidecars and in records.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Srgb => "srgb",
            Self::Agx => "agx",
            Self::Filmic => "filmic",
            Self::PbrNeutral => "pbr-neutral",
            Self::Linear => "linear",
            Self::Ocio(view) => view.name(),
        }
    }

    /// The view of a name; `None` where there is none of its own. The path of a configuration is sought from
    /// `folder`.
    ///
    /// # Errors
    /// When the view is one of a configuration of OpenColorIO that cannot be read or has no such view.
    pub fn named(name: &str, folder: &Path) -> Result<Option<Self>, OcioError> {
        if name.starts_with(OCIO) {
            return OcioView::open(name, folder).map(|view| Some(Self::Ocio(view)));
        }
        Ok(Self::ALL.into_iter().find(|view| view.name() == name))
    }

    /// What it is, for the help.
    #[must_use]
    pub fn help(self) -> &'static str {
        match self {
            Self::Srgb => {
                "Light as it is, clipped at white: Blender's Standard, and what most renderers show"
            }
            Self::Agx => "Blender's AgX, its default since 4.0, with the look None",
            Self::Filmic => "Blender's Filmic, its default from 2.79 to 3.6, with the look None",
            Self::PbrNeutral => "PBR Neutral of Khronos, of many viewers of glTF",
            Self::Linear => "Light itself, not encoded and clipped at white: Blender's Raw",
            Self::Ocio(_) => "A view of a configuration of OpenColorIO",
        }
    }

    /// Display-linear Rec.709 in [0, 1] of a linear colour, with its derivatives by red, green and blue in the
    /// columns of the matrix. What is negative, or no number, counts as 0.
    #[must_use]
    pub fn display(self, rgb: DVec3) -> (DVec3, DMat3) {
        let lit = rgb.max(DVec3::ZERO);
        let (shown, mut slopes) = match self {
            Self::Srgb => (lit, DMat3::IDENTITY),
            Self::Agx => agx::display(lit),
            Self::Filmic => filmic::display(lit),
            Self::PbrNeutral => neutral::display(lit),
            Self::Linear => {
                let code = lit.min(DVec3::ONE).to_array();
                let slopes = DMat3::from_diagonal(DVec3::from_array(code.map(eotf_srgb_derivative)));
                (DVec3::from_array(code.map(eotf_srgb)), slopes)
            }
            Self::Ocio(view) => view.display(lit),
        };
        let is_clipped = |c: usize| shown[c] > 1.0 || (self == Self::Linear && lit[c] > 1.0);
        for (c, v) in rgb.to_array().into_iter().enumerate() {
            if v < 0.0 {
                *slopes.col_mut(c) = DVec3::ZERO;
            }
        }
        let kept = DVec3::from_array([0, 1, 2].map(|c| if is_clipped(c) { 0.0 } else { 1.0 }));
        (shown.clamp(DVec3::ZERO, DVec3::ONE), DMat3::from_diagonal(kept) * slopes)
    }

    /// The colour of [`Self::display`] alone, which is faster where derivatives are differences.
    #[must_use]
    pub fn shown(self, rgb: DVec3) -> DVec3 {
        match self {
            Self::Ocio(view) => DVec3::from_array(view.codes(rgb.max(DVec3::ZERO)).to_array().map(eotf_srgb)),
            _ => self.display(rgb).0,
        }
    }

    /// Code values in [0, 1] of a linear colour, as a file for a display of sRGB has them.
    #[must_use]
    pub fn encode(self, rgb: [f32; 3], exposure: f64) -> [f64; 3] {
        let light = rgb.map(|v| exposure * f64::from(v));
        match self {
            Self::Srgb => light.map(|v| oetf_srgb(v.clamp(0.0, 1.0))),
            Self::Linear => light.map(|v| v.clamp(0.0, 1.0)),
            Self::Ocio(view) => view.codes(DVec3::from_array(light).max(DVec3::ZERO)).to_array(),
            _ => self.display(DVec3::from_array(light)).0.to_array().map(oetf_srgb),
        }
    }
}

impl fmt::Display for ViewTransform {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl Serialize for ViewTransform {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

/// From its name; the path of a configuration is sought from the present directory.
impl<'de> Deserialize<'de> for ViewTransform {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        static NAMES: LazyLock<[&str; 5]> = LazyLock::new(|| ViewTransform::ALL.map(ViewTransform::name));
        let name = String::deserialize(deserializer)?;
        let view = Self::named(&name, Path::new("")).map_err(de::Error::custom)?;
        view.ok_or_else(|| de::Error::unknown_variant(&name, &*NAMES))
    }
}

#[cfg(test)]
mod tests;
