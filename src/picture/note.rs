//! What is worth knowing about how a picture was read.

use std::fmt;

use super::exr::{listed, quoted};

/// A fact about a picture, without its name.
#[derive(Clone, Debug, PartialEq)]
pub enum Note {
    /// A colour profile, unless it is that of sRGB and the picture is taken so.
    IccIgnored {
        /// Name that the profile gives itself.
        profile: Option<String>,
        /// Whether nothing else says what the colours are.
        is_taken_as_srgb: bool,
    },
    /// One of several layers.
    Layer {
        /// Name of the layer that is read.
        taken: String,
        /// Names of the layers that are not read.
        others: Vec<String>,
    },
    /// Pictures behind the first.
    FurtherPages,
    /// Inks of an unknown printer.
    Cmyk,
    /// What brighter displays would show beyond white.
    GainMap,
    /// Chromaticities of no device.
    ChromaticitiesIgnored,
    /// A table that says how brightness is encoded.
    TransferIgnored,
    /// The only channel of an EXR, of a name that does not say grey.
    OnlyChannel(String),
    /// Pixels that are not square, by their height over their width.
    PixelAspect(f64),
}

impl Note {
    /// The note about pixels of a height over their width, when they are not square to 1 %.
    #[must_use]
    pub fn of_aspect(ratio: f64) -> Option<Self> {
        let is_odd = ratio.is_normal() && ratio > 0.0 && (ratio - 1.0).abs() > 1e-2;
        is_odd.then_some(Self::PixelAspect(ratio))
    }
}

impl fmt::Display for Note {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::IccIgnored { profile, is_taken_as_srgb } => {
                let name = profile.as_ref().map(|name| format!(" `{name}`")).unwrap_or_default();
                let instead = if *is_taken_as_srgb {
                    "its colours are taken as sRGB"
                } else {
                    "what else the file says of its colours counts"
                };
                write!(f, "its colour profile (ICC){name} is ignored; {instead}")
            }
            Self::Layer { taken, others } => {
                let others = listed(others.iter().map(String::as_str));
                write!(f, "of its layers {} is read, not {others}", quoted(taken))
            }
            Self::FurtherPages => write!(f, "only the first of its pictures is read"),
            Self::Cmyk => write!(f, "its CMYK colours are turned into RGB roughly, without a profile"),
            Self::GainMap => write!(f, "its gain map for brighter displays is ignored"),
            Self::ChromaticitiesIgnored => {
                write!(f, "its chromaticities are those of no device and are ignored")
            }
            Self::TransferIgnored => {
                write!(f, "its TransferFunction is ignored; what else the file says of its colours counts")
            }
            Self::OnlyChannel(name) => write!(f, "its only channel {} is read as grey", quoted(name)),
            Self::PixelAspect(ratio) => {
                write!(f, "its pixels are {ratio:.3} times as high as wide, and taken as square")
            }
        }
    }
}
