//! The headers of an EXR file: what its parts hold, and where.
//!
//! Only what is needed is understood, so that a part of a kind or compression that cannot
//! be decoded does not stand in the way of one that can.
//!
//! # References
//! \[OpenEXR\] *Reading and Writing Image Files*, *OpenEXR File Layout*.

use std::io::{Read, Seek};

use exr::compression::Compression;
use exr::meta::attribute::SampleType;

use super::{ExrFault, stream::Stream};
use crate::picture::colour::interop_space;
use crate::picture::primaries::Chromaticities;

/// First bytes of every EXR file.
pub const MAGIC: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];

/// Longest attribute that is read, bytes: our own JSON of a thousand variables is a tenth of it.
const MAX_ATTRIBUTE: u64 = 1 << 24;

/// Flag of the version field: one part, in tiles.
const TILED: u32 = 1 << 9;
/// Flag of the version field: deep data.
const DEEP: u32 = 1 << 11;
/// Flag of the version field: several parts.
const MULTIPART: u32 = 1 << 12;

/// What the headers of a file say.
#[derive(Debug)]
pub struct Headers {
    /// Whether chunks begin with the number of their part.
    pub is_multipart: bool,
    /// At least one.
    pub parts: Vec<Part>,
}

/// One part of a file.
#[derive(Clone, Debug, Default)]
pub struct Part {
    /// Its name; empty where there is none.
    pub name: String,
    /// The view of a stereo picture that it belongs to.
    pub view: Option<String>,
    /// The views that the channel names of a single part tell apart, the default one first.
    pub views: Vec<String>,
    /// Whether pixels hold lists of samples by depth.
    pub is_deep: bool,
    /// Codec as the file numbers it.
    pub compression: u8,
    /// In the order of the file, which is that of their samples.
    pub channels: Vec<Channel>,
    /// Where there are samples.
    pub data: Window,
    /// What is shown.
    pub display: Window,
    /// Width and height of the tiles; `None` for scan lines.
    pub tile: Option<[usize; 2]>,
    /// Primaries and white, where stated.
    pub chromaticities: Option<Chromaticities>,
    /// Name of the colour space, where stated.
    pub color_space: Option<String>,
    /// Width over height of a pixel, where stated.
    pub pixel_aspect: Option<f64>,
    /// Whether it shows the six sides of a cube.
    pub is_cube_map: bool,
    /// Our attribute, `lightopt`.
    pub attribute: Option<String>,
    /// Number of chunks, where stated.
    pub(super) chunk_count: Option<usize>,
    /// Position of the table of chunk offsets, bytes from the start of the file.
    pub table: u64,
}

/// A channel of a part.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Channel {
    /// Full name, with the layer before the last dot.
    pub name: String,
    /// Type of the samples.
    pub kind: SampleType,
    /// Whether lossy codecs quantise it linearly.
    pub is_linear: bool,
    /// Distance of the samples in x and y, pixels.
    pub sampling: [usize; 2],
}

/// A rectangle of pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Window {
    /// Left column and top row.
    pub min: [i64; 2],
    /// Width and height.
    pub size: [u64; 2],
}

impl Channel {
    /// Bytes of a sample.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.kind.bytes_per_sample()
    }
}

impl Part {
    /// The codec, when it can be decoded.
    ///
    /// # Errors
    /// With its name otherwise.
    pub fn codec(&self) -> Result<Compression, ExrFault> {
        Ok(match self.compression {
            0 => Compression::Uncompressed,
            1 => Compression::RLE,
            2 => Compression::ZIP1,
            3 => Compression::ZIP16,
            4 => Compression::PIZ,
            5 => Compression::PXR24,
            6 => Compression::B44,
            7 => Compression::B44A,
            8 => Compression::DWAA(None),
            9 => Compression::DWAB(None),
            10 => return Err(ExrFault::Codec("HTJ2K256 (high-throughput JPEG 2000)".into())),
            11 => return Err(ExrFault::Codec("HTJ2K32 (high-throughput JPEG 2000)".into())),
            12 => return Err(ExrFault::Codec("LJ2K (JPEG 2000)".into())),
            13 => return Err(ExrFault::Codec("ZSTD".into())),
            n => return Err(ExrFault::Codec(format!("number {n}, which is unknown"))),
        })
    }

    /// Entries of the table of chunk offsets that belong to the full resolution, which come first.
    pub fn n_chunks(&self, codec: Compression) -> u64 {
        let [width, height] = self.data.size;
        match self.tile {
            Some([w, h]) => width.div_ceil(w as u64) * height.div_ceil(h as u64),
            None => height.div_ceil(codec.scan_lines_per_block() as u64),
        }
    }
}

impl Headers {
    /// Reads the headers of a file whose first bytes are [`MAGIC`].
    ///
    /// # Errors
    /// When they are no headers of version 2, or end too soon.
    pub fn read(stream: &mut Stream<impl Read + Seek>) -> Result<Self, ExrFault> {
        if stream.array()? != MAGIC {
            return Err(ExrFault::Damaged("it does not begin as an EXR file".into()));
        }
        let version = stream.u32()?;
        if version & 0xff != 2 {
            return Err(ExrFault::Damaged(format!("version {} is unknown", version & 0xff)));
        }
        let is_multipart = version & MULTIPART != 0;
        let mut parts = Vec::new();
        while let Some(part) = header(stream, version)? {
            parts.push(part);
            if !is_multipart {
                break;
            }
        }
        if parts.is_empty() {
            return Err(ExrFault::Damaged("it has no parts".into()));
        }
        let mut table = stream.position();
        for part in &mut parts {
            part.table = table;
            match part.chunk_count {
                Some(n) => table += 8 * n as u64,
                None if is_multipart => return Err(missing("chunkCount")),
                None => {}
            }
        }
        Ok(Self { is_multipart, parts })
    }
}

fn missing(attribute: &str) -> ExrFault {
    ExrFault::Damaged(format!("the attribute `{attribute}` is missing"))
}

/// Attributes that every header must have.
#[derive(Default)]
struct Required {
    channels: bool,
    compression: bool,
    data: bool,
    display: bool,
    /// From the attribute `type`.
    is_tiled: Option<bool>,
}

/// One header; `None` where another one could begin but the list ends.
fn header(stream: &mut Stream<impl Read + Seek>, version: u32) -> Result<Option<Part>, ExrFault> {
    let mut part = Part::default();
    let mut seen = Required::default();
    let mut is_first = true;
    loop {
        let name = stream.name()?;
        if name.is_empty() {
            break;
        }
        is_first = false;
        let kind = stream.name()?;
        let size = u64::from(stream.u32()?);
        let end = stream.end_after(size)?;
        attribute(stream, &mut part, &mut seen, (name.as_str(), kind.as_str(), size))?;
        stream.seek(end)?;
    }
    if is_first && version & MULTIPART != 0 {
        return Ok(None);
    }
    for (is_there, name) in [
        (seen.channels, "channels"),
        (seen.compression, "compression"),
        (seen.data, "dataWindow"),
        (seen.display, "displayWindow"),
    ] {
        if !is_there {
            return Err(missing(name));
        }
    }
    part.is_deep |= version & (MULTIPART | DEEP) == DEEP;
    match seen.is_tiled.unwrap_or(version & TILED != 0) {
        true if part.tile.is_none() => return Err(missing("tiles")),
        true => {}
        false => part.tile = None,
    }
    Ok(Some(part))
}

fn attribute(
    stream: &mut Stream<impl Read + Seek>,
    part: &mut Part,
    seen: &mut Required,
    (name, kind, size): (&str, &str, u64),
) -> Result<(), ExrFault> {
    match (name, kind) {
        ("channels", "chlist") => {
            part.channels = channels(stream)?;
            seen.channels = true;
        }
        ("compression", "compression") => {
            part.compression = stream.u8()?;
            seen.compression = true;
        }
        ("dataWindow", "box2i") => {
            part.data = window(stream)?;
            seen.data = true;
        }
        ("displayWindow", "box2i") => {
            part.display = window(stream)?;
            seen.display = true;
        }
        ("tiles", "tiledesc") => {
            let [x, y] = [stream.u32()?, stream.u32()?].map(|n| n as usize);
            if x == 0 || y == 0 {
                return Err(ExrFault::Damaged("its tiles have no size".into()));
            }
            part.tile = Some([x, y]);
        }
        ("type", "string") => {
            let kind = text(stream, size)?;
            part.is_deep = kind.starts_with("deep");
            seen.is_tiled = Some(kind.ends_with("tile") || kind == "tiledimage");
        }
        ("chunkCount", "int") => part.chunk_count = usize::try_from(stream.i32()?).ok(),
        ("name", "string") => part.name = text(stream, size)?,
        ("view", "string") => part.view = Some(text(stream, size)?),
        ("multiView", "stringvector") => part.views = texts(stream, size)?,
        ("chromaticities", "chromaticities") => {
            let mut v = [0.0; 8];
            for v in &mut v {
                *v = f64::from(stream.f32()?);
            }
            part.chromaticities = Some(Chromaticities::from_list(v));
        }
        ("pixelAspectRatio", "float") => part.pixel_aspect = Some(f64::from(stream.f32()?)),
        // [OpenEXR] ENVMAP_CUBE
        ("envmap", "envmap") => part.is_cube_map = stream.u8()? == 1,
        ("colorInteropID", "string") => part.color_space = Some(text(stream, size)?),
        ("oiio:ColorSpace", "string") if part.color_space.is_none() => {
            // A name that only its writer's configuration explains says nothing here.
            part.color_space = Some(text(stream, size)?).filter(|name| interop_space(name).is_ok());
        }
        (super::ATTRIBUTE, "string") => {
            part.attribute = Some(String::from_utf8_lossy(&raw_text(stream, size)?).into_owned());
        }
        _ => {}
    }
    Ok(())
}

fn channels(stream: &mut Stream<impl Read + Seek>) -> Result<Vec<Channel>, ExrFault> {
    let mut channels = Vec::new();
    loop {
        let name = stream.name()?;
        if name.is_empty() {
            return Ok(channels);
        }
        let kind = match stream.u32()? {
            0 => SampleType::U32,
            1 => SampleType::F16,
            2 => SampleType::F32,
            _ => return Err(ExrFault::Damaged(format!("channel `{name}` has an unknown type"))),
        };
        let [is_linear, ..] = stream.array::<4>()?;
        let sampling = [stream.u32()?, stream.u32()?].map(|n| n as usize);
        if sampling.contains(&0) {
            return Err(ExrFault::Damaged(format!("channel `{name}` has no sampling")));
        }
        channels.push(Channel { name, kind, is_linear: is_linear != 0, sampling });
    }
}

fn window(stream: &mut Stream<impl Read + Seek>) -> Result<Window, ExrFault> {
    let [x0, y0, x1, y1] = [stream.i32()?, stream.i32()?, stream.i32()?, stream.i32()?].map(i64::from);
    let size = |a: i64, b: i64| u64::try_from(b - a + 1).unwrap_or(0);
    Ok(Window { min: [x0, y0], size: [size(x0, x1), size(y0, y1)] })
}

fn text(stream: &mut Stream<impl Read + Seek>, size: u64) -> Result<String, ExrFault> {
    Ok(printable(&raw_text(stream, size)?))
}

fn raw_text(stream: &mut Stream<impl Read + Seek>, size: u64) -> Result<Vec<u8>, ExrFault> {
    if size > MAX_ATTRIBUTE {
        return Err(ExrFault::Damaged(format!("an attribute of {size} bytes")));
    }
    stream.bytes(size)
}

/// A list of texts, each with its length before it.
fn texts(stream: &mut Stream<impl Read + Seek>, size: u64) -> Result<Vec<String>, ExrFault> {
    let end = stream.position() + size;
    let mut list = Vec::new();
    while stream.position() + 4 <= end {
        let size = u64::from(stream.u32()?);
        if stream.position() + size > end {
            return Err(ExrFault::Damaged("a list of names is broken".into()));
        }
        list.push(text(stream, size)?);
    }
    Ok(list)
}

/// Bytes as text that can be shown in a message.
pub(super) fn printable(bytes: &[u8]) -> String {
    let text = String::from_utf8_lossy(bytes);
    text.chars().map(|c| if c.is_control() { char::REPLACEMENT_CHARACTER } else { c }).collect()
}
