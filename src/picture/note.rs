//! What is worth knowing about how a picture was read.

use std::fmt;

use super::exr::{listed, quoted};

/// A fact about a picture, without its name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Note {
    /// A colour profile, unless it is that of sRGB and the picture is taken so.
    IccIgnored {
        /// How it calls itself.
        profile: Option<String>,
        /// Whether nothing else says what the colours are.
        is_taken_as_srgb: bool,
    },
    /// One of several layers.
    Layer {
        /// The one that is read.
        taken: String,
        /// The others.
        others: Vec<String>,
    },
    /// Pictures behind the first.
    FurtherPages,
    /// Inks of an unknown printer.
    Cmyk,
    /// Chromaticities of no device.
    ChromaticitiesIgnored,
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
            Self::ChromaticitiesIgnored => {
                write!(f, "its chromaticities are those of no device and are ignored")
            }
        }
    }
}
