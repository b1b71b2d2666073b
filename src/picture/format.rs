//! Formats of pictures, told apart by their content, or by the ending where the content has no
//! mark.

use std::io::{self, Read, Seek, SeekFrom};
use std::path::Path;

use super::exr;

/// A format that is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Windows bitmap.
    Bmp,
    /// OpenEXR.
    Exr,
    /// Radiance.
    Hdr,
    /// JPEG.
    Jpeg,
    /// PNG.
    Png,
    /// Truevision Targa.
    Tga,
    /// TIFF and BigTIFF.
    Tiff,
    /// WebP.
    WebP,
}

/// Last bytes of a Targa file of version 2.
pub const TGA_FOOTER: &[u8; 18] = b"TRUEVISION-XFILE.\0";

impl Format {
    /// Its name in messages.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Bmp => "BMP",
            Self::Exr => "EXR",
            Self::Hdr => "Radiance HDR",
            Self::Jpeg => "JPEG",
            Self::Png => "PNG",
            Self::Tga => "TGA",
            Self::Tiff => "TIFF",
            Self::WebP => "WebP",
        }
    }

    /// That of a file name's ending.
    #[must_use]
    pub fn of_ending(path: &Path) -> Option<Self> {
        let ending = path.extension()?.to_str()?.to_ascii_lowercase();
        Some(match ending.as_str() {
            "bmp" | "dib" => Self::Bmp,
            "exr" => Self::Exr,
            "hdr" | "pic" => Self::Hdr,
            "jpg" | "jpeg" | "jpe" | "jfif" => Self::Jpeg,
            "png" | "apng" => Self::Png,
            "tga" | "targa" | "icb" | "vda" | "vst" => Self::Tga,
            "tif" | "tiff" | "btf" => Self::Tiff,
            "webp" => Self::WebP,
            _ => return None,
        })
    }

    /// That of the first bytes of a file.
    #[must_use]
    pub fn of_start(start: &[u8]) -> Option<Self> {
        let marks: [(&[u8], Self); 10] = [
            (b"\x89PNG\r\n\x1a\n", Self::Png),
            (b"\xff\xd8\xff", Self::Jpeg),
            (&exr::MAGIC, Self::Exr),
            (b"#?RADIANCE", Self::Hdr),
            (b"#?RGBE", Self::Hdr),
            (b"II*\0", Self::Tiff),
            (b"MM\0*", Self::Tiff),
            (b"II+\0", Self::Tiff),
            (b"MM\0+", Self::Tiff),
            (b"BM", Self::Bmp),
        ];
        let is_webp = start.starts_with(b"RIFF") && start.get(8..12) == Some(b"WEBP");
        let marked = || marks.iter().find(|(mark, _)| start.starts_with(mark)).map(|&(_, format)| format);
        if is_webp { Some(Self::WebP) } else { marked() }
    }

    /// That of a file's content, else of its name; the source stands at its start afterwards.
    ///
    /// # Errors
    /// When the file cannot be read.
    pub fn of(source: &mut (impl Read + Seek + ?Sized), name: Option<&Path>) -> io::Result<Option<Self>> {
        let mut start = Vec::new();
        source.take(16).read_to_end(&mut start)?;
        let mut format = Self::of_start(&start);
        if format.is_none() && source.seek(SeekFrom::End(0))? >= TGA_FOOTER.len() as u64 {
            let mut end = [0; TGA_FOOTER.len()];
            source.seek(SeekFrom::End(-(TGA_FOOTER.len() as i64)))?;
            source.read_exact(&mut end)?;
            format = (&end == TGA_FOOTER).then_some(Self::Tga);
        }
        source.seek(SeekFrom::Start(0))?;
        // Of the others every file bears its mark, so that an ending without it says nothing.
        let unmarked = |format: &Self| matches!(format, Self::Tga | Self::Hdr);
        Ok(format.or_else(|| name.and_then(Self::of_ending).filter(unmarked)))
    }
}
