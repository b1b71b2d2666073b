//! Why a picture cannot be read.

use std::io;
use std::path::PathBuf;

use thiserror::Error;

use super::budget::SizeError;
use super::exr::ExrFault;
use super::format::Format;

/// A picture file that cannot be read.
#[derive(Debug, Error)]
#[error("{path}: cannot {action}", path = .path.display(), action = .fault.action())]
pub struct PictureError {
    /// The file.
    pub path: PathBuf,
    /// What is wrong with the picture.
    #[source]
    pub fault: Fault,
}

/// What is wrong with a picture.
#[derive(Debug, Error)]
pub enum Fault {
    /// The file cannot be opened.
    #[error(transparent)]
    Open(io::Error),
    /// A folder, device or pipe.
    #[error("it is no regular file")]
    NoFile,
    /// The file cannot be read on.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// No format that is known.
    #[error("its content is in no known format (BMP, EXR, HDR, JPEG, PNG, TGA, TIFF, WebP)")]
    UnknownFormat,
    /// Another program's format.
    #[error("it is {0}, which is not read; save it as PNG, or as EXR with linear colours")]
    ForeignFormat(&'static str),
    /// Too large, or empty.
    #[error(transparent)]
    Size(#[from] SizeError),
    /// The decoder refuses.
    #[error("the {} is damaged or of a rare kind", format.name())]
    Decode {
        /// The format.
        format: Format,
        /// What the decoder says.
        #[source]
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// Something that is well-formed but not read.
    #[error("{what}; {cure}")]
    Unsupported {
        /// What the file has.
        what: String,
        /// What to do.
        cure: &'static str,
    },
    /// EXR trouble.
    #[error(transparent)]
    Exr(#[from] ExrFault),
    /// The attribute of our EXR files is no JSON.
    #[error("the attribute `lightopt` is not valid JSON")]
    Attribute(#[source] serde_json::Error),
}

impl Fault {
    /// A picture for print, of which light is asked: what CMYK shows is the affair of a profile that is a table;
    /// without it brightness is a guess.
    pub(super) fn print() -> Self {
        let what = "its colours are CMYK, for print".into();
        Self::Unsupported { what, cure: "convert it to sRGB by its profile" }
    }

    /// What cannot be done.
    fn action(&self) -> &'static str {
        match self {
            Self::Open(_) => "open the picture",
            _ => "read it as a picture",
        }
    }

    /// The decoder's words.
    pub(super) fn decode(
        format: Format,
        source: impl Into<Box<dyn std::error::Error + Send + Sync>>,
    ) -> Self {
        Self::Decode { format, source: source.into() }
    }
}
