//! Formats of pictures, told apart by their content, or by the ending where the content has no
//! mark.

use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

use super::{Fault, exr};

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
    /// Name of the format in messages.
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

    /// Format that the ending of a file's name stands for.
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

    /// Format whose mark the file begins with.
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

    /// Whether a file of this name is a picture, be it of a format that is read or of another.
    #[must_use]
    pub fn is_picture_ending(path: &Path) -> bool {
        let ending = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
        Self::of_ending(path).is_some() || FOREIGN_ENDINGS.contains(&ending.as_str())
    }

    /// Format of a file by its content, else by its name; the source stands at its start afterwards.
    ///
    /// # Errors
    /// When the file cannot be read, or is in no format that is known, or in one that is not read.
    pub fn of(source: &mut (impl Read + Seek + ?Sized), name: Option<&Path>) -> Result<Self, Fault> {
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
        let foreign = foreign(&start);
        if let Some(foreign) = foreign.filter(|what| format.is_none() || *what == RAW) {
            return Err(Fault::ForeignFormat(foreign));
        }
        // Of the others every file bears its mark, so that an ending without it says nothing.
        let unmarked = |format: &Self| matches!(format, Self::Tga | Self::Hdr);
        format.or_else(|| name.and_then(Self::of_ending).filter(unmarked)).ok_or(Fault::UnknownFormat)
    }
}

/// Endings of pictures in formats that are not read, cameras' raw ones among them.
const FOREIGN_ENDINGS: [&str; 30] = [
    "gif", "avif", "heic", "heif", "jxl", "jp2", "j2k", "jpf", "psd", "psb", "xcf", "kra", "dds", "ktx",
    "ktx2", "qoi", "ppm", "pgm", "pfm", "svg", "ico", "dng", "cr2", "cr3", "nef", "arw", "raf", "orf", "rw2",
    "pef",
];

/// What files of cameras are, some of which begin as TIFF does.
const RAW: &str = "a camera's raw picture";

/// What a file of another program is, by its first bytes.
fn foreign(start: &[u8]) -> Option<&'static str> {
    let marks: [(&[u8], &str); 21] = [
        (b"GIF8", "a GIF"),
        (b"\0\0\0\x0cJXL ", "a JPEG XL picture"),
        (b"\xff\x0a", "a JPEG XL picture"),
        (b"\0\0\0\x0cjP  ", "a JPEG 2000 picture"),
        (b"\xff\x4f\xff\x51", "a JPEG 2000 picture"),
        (b"8BPS", "a Photoshop file"),
        (b"gimp xcf", "a GIMP file"),
        (b"DDS ", "a DirectDraw surface"),
        (b"\xabKTX ", "a KTX texture"),
        (b"qoif", "a QOI picture"),
        (b"PF\n", "a portable float map"),
        (b"Pf\n", "a portable float map"),
        (b"%PDF", "a PDF document"),
        (b"<svg", "an SVG drawing"),
        (b"FUJIFILM", RAW),
        // Olympus, Panasonic and Sigma.
        (b"IIRO", RAW),
        (b"IIRS", RAW),
        (b"MMOR", RAW),
        (b"IIU\0", RAW),
        (b"FOVb", RAW),
        (b"\0\0\x01\0", "an icon (ICO)"),
    ];
    // [ISO/IEC 14496-12] the brand follows the length and the type of the first box.
    match start.get(4..12) {
        Some(b"ftypavif" | b"ftypavis") => return Some("an AVIF picture"),
        Some(b"ftypheic" | b"ftypheix" | b"ftyphevc" | b"ftypmif1" | b"ftypmsf1") => {
            return Some("a HEIF picture (HEIC)");
        }
        Some(b"ftypcrx ") => return Some(RAW),
        _ => {}
    }
    // Canon's mark, behind the head of a TIFF.
    if start.starts_with(b"II*\0") && start.get(8..10) == Some(b"CR") {
        return Some(RAW);
    }
    if let [b'P', b'1'..=b'7', space, ..] = start
        && space.is_ascii_whitespace()
    {
        return Some("a portable any-map (PNM)");
    }
    marks.iter().find(|(mark, _)| start.starts_with(mark)).map(|&(_, name)| name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Cursor;

    #[test]
    fn pictures_of_other_programs_are_called_by_their_names() {
        for (start, name) in [
            (&b"GIF89a"[..], "a GIF"),
            (b"\0\0\0\x1cftypavif\0\0\0\0", "an AVIF picture"),
            (b"\0\0\0\x18ftypheic\0\0\0\0", "a HEIF picture (HEIC)"),
            (b"\0\0\0\x0cJXL \r\n\x87\n", "a JPEG XL picture"),
            (b"8BPS\0\x01", "a Photoshop file"),
            (b"P6\n32 24", "a portable any-map (PNM)"),
            (b"II*\0\x10\0\0\0CR\x02\0", RAW),
            (b"IIU\0\x18\0\0\0", RAW),
        ] {
            let found = Format::of(&mut Cursor::new(start), Some(Path::new("a.tga")));
            assert!(matches!(found, Err(Fault::ForeignFormat(f)) if f == name), "{found:?}");
        }
        let text = Format::of(&mut Cursor::new(b"Pfui"), Some(Path::new("a.png")));
        assert!(matches!(text, Err(Fault::UnknownFormat)), "{text:?}");
        assert!(
            Format::is_picture_ending(Path::new("a.HEIC")) && !Format::is_picture_ending(Path::new("a.toml"))
        );
    }
}
