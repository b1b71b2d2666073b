//! The samples of chosen channels of a part, laid into the display window.
//!
//! The chunks that show in it are read one after another and decoded side by side, so that
//! little more of them than [`BATCH`] bytes is in memory beside the result.

use std::borrow::Cow;
use std::io::{Read, Seek};
use std::panic::{AssertUnwindSafe, catch_unwind};

use exr::compression::Compression;
use exr::math::RoundingMode;
use exr::meta::attribute::{
    ChannelDescription, IntegerBounds, LevelMode, LineOrder, SampleType, TileDescription,
};
use exr::meta::{BlockDescription, header::Header};
use exr::prelude::{SmallVec, Text, Vec2, f16};
use rayon::prelude::*;

use super::ExrFault;
use super::header::{Channel, Part};
use super::stream::Stream;
use crate::picture::budget;

/// Decoded bytes of the chunks that are handled together: enough to keep the threads busy,
/// little beside a picture.
const BATCH: u64 = 1 << 25;

/// Memory that decoding a chunk takes, in units of the decoded chunk: what is read, what is
/// decoded, and a codec's copy.
const COPIES: u64 = 3;

/// A rectangle of samples as the file stores it.
struct Chunk {
    /// Left column and top row from the corner of the data window.
    at: [u64; 2],
    /// Width and height.
    size: [u64; 2],
    bytes: Vec<u8>,
}

/// What is needed to decode the chunks of a part.
struct Decoder<'a> {
    part: &'a Part,
    /// The number that its chunks begin with, in a file of several parts.
    number: Option<usize>,
    codec: Compression,
    /// What the codec asks of the part.
    header: Header,
}

/// Reads the channels of the indices `wanted` as f32, interleaved, row by row over the display
/// window; 0 where there is no data. Channels that are stored more coarsely are interpolated
/// linearly.
///
/// * `number`: that of the part, in a file of several
/// * `kept`: bytes that the caller keeps of each pixel beside the result
///
/// # Errors
/// When chunks are missing or damaged, the codec is not known, or memory would not suffice.
pub fn read(
    stream: &mut Stream<impl Read + Seek>,
    part: &Part,
    number: Option<usize>,
    wanted: &[usize],
    kept: usize,
) -> Result<Vec<f32>, ExrFault> {
    let decoder = Decoder::new(part, number)?;
    let n_pixels = budget::check(part.display.size, (4 * wanted.len() + kept) as u64)?;
    let largest = decoder.n_bytes(0, decoder.chunk_size([0, 0]));
    budget::check_block(largest.saturating_mul(COPIES))?;
    let mut out = vec![0.0; n_pixels * wanted.len()];
    let offsets = decoder.offsets(stream)?;
    let mut shown = (0..).zip(offsets).filter(|&(i, _)| decoder.is_shown(i)).peekable();
    let (mut batch, mut n_batched) = (Vec::new(), 0);
    while let Some((i, offset)) = shown.next() {
        let chunk = decoder.chunk(stream, i, offset)?;
        n_batched += decoder.n_bytes(chunk.at[1], chunk.size);
        batch.push(chunk);
        if n_batched >= BATCH || shown.peek().is_none() {
            let chunks = std::mem::take(&mut batch);
            let decoded: Vec<_> = chunks.into_par_iter().map(|c| decoder.decode(c)).collect();
            for chunk in decoded {
                decoder.place(&chunk?, wanted, &mut out);
            }
            n_batched = 0;
        }
    }
    for (k, &c) in wanted.iter().enumerate() {
        spread(&mut out, [k, wanted.len()], part, part.channels[c].sampling);
    }
    Ok(out)
}

impl<'a> Decoder<'a> {
    fn new(part: &'a Part, number: Option<usize>) -> Result<Self, ExrFault> {
        if part.is_deep {
            return Err(ExrFault::Deep);
        }
        let codec = part.codec()?;
        let is_coarse = part.channels.iter().any(|c| c.sampling != [1, 1]);
        // The crate's decoder of B44 takes all channels for equally fine.
        if is_coarse && matches!(codec, Compression::B44 | Compression::B44A) {
            return Err(ExrFault::Sampling);
        }
        for channel in &part.channels {
            let fits = |k: usize| {
                let s = channel.sampling[k] as u64;
                s == 1
                    || part.tile.is_none()
                        && part.data.size[k].is_multiple_of(s)
                        && part.data.min[k].rem_euclid(s.cast_signed()) == 0
            };
            if !fits(0) || !fits(1) {
                let name = &channel.name;
                return Err(ExrFault::Damaged(format!(
                    "the sampling of channel `{name}` does not fit its size"
                )));
            }
        }
        let size = part.data.size.map(|n| n as usize);
        let blocks = part.tile.map_or(BlockDescription::ScanLines, |[w, h]| {
            BlockDescription::Tiles(TileDescription {
                tile_size: Vec2(w, h),
                level_mode: LevelMode::Singular,
                rounding_mode: RoundingMode::Down,
            })
        });
        let channels: SmallVec<_> = part.channels.iter().map(description).collect();
        let header = Header::new(Text::from("part"), Vec2(size[0], size[1]), channels).with_encoding(
            codec,
            blocks,
            LineOrder::Increasing,
        );
        Ok(Self { part, number, codec, header })
    }

    /// Places of the chunks in the file, in the order of rows, then columns.
    fn offsets(&self, stream: &mut Stream<impl Read + Seek>) -> Result<Vec<u64>, ExrFault> {
        stream.seek(self.part.table)?;
        let n_bytes = self.part.n_chunks(self.codec).checked_mul(8).ok_or(ExrFault::Incomplete)?;
        let table = stream.bytes(n_bytes)?;
        Ok(table.as_chunks().0.iter().map(|&entry| u64::from_le_bytes(entry)).collect())
    }

    /// Width and height of the chunk whose corner is at `at`.
    fn chunk_size(&self, at: [u64; 2]) -> [u64; 2] {
        let [width, height] = self.part.data.size;
        let [w, h] = match self.part.tile {
            Some(size) => size.map(|n| n as u64),
            None => [width, self.codec.scan_lines_per_block() as u64],
        };
        [w.min(width - at[0]), h.min(height - at[1])]
    }

    /// Corner of the i-th chunk.
    fn corner(&self, i: u64) -> [u64; 2] {
        match self.part.tile {
            Some([w, h]) => {
                let across = self.part.data.size[0].div_ceil(w as u64);
                [i % across * w as u64, i / across * h as u64]
            }
            None => [0, i * self.codec.scan_lines_per_block() as u64],
        }
    }

    /// Whether the i-th chunk has rows of the display window.
    fn is_shown(&self, i: u64) -> bool {
        let at = self.corner(i);
        let top = self.part.data.min[1] + at[1].cast_signed() - self.part.display.min[1];
        let bottom = top + self.chunk_size(at)[1].cast_signed();
        bottom > 0 && top < self.part.display.size[1].cast_signed()
    }

    /// Bytes of a decoded chunk whose top row is `top` rows below that of the data window.
    fn n_bytes(&self, top: u64, [width, height]: [u64; 2]) -> u64 {
        let of = |c: &Channel| {
            let [x, y] = c.sampling.map(|s| s as u64);
            let rows = (top + height).div_ceil(y) - top.div_ceil(y);
            (width / x * c.bytes() as u64).saturating_mul(rows)
        };
        self.part.channels.iter().map(of).fold(0, u64::saturating_add)
    }

    fn chunk(&self, stream: &mut Stream<impl Read + Seek>, i: u64, offset: u64) -> Result<Chunk, ExrFault> {
        if offset == 0 {
            return Err(ExrFault::Incomplete);
        }
        stream.seek(offset)?;
        let damaged = || ExrFault::Damaged(format!("chunk {i} is not where the file says"));
        if let Some(number) = self.number
            && usize::try_from(stream.i32()?) != Ok(number)
        {
            return Err(damaged());
        }
        let at = self.corner(i);
        let expected: Vec<i64> = match self.part.tile {
            Some([w, h]) => {
                vec![(at[0] / w as u64).cast_signed(), (at[1] / h as u64).cast_signed(), 0, 0]
            }
            None => vec![self.part.data.min[1] + at[1].cast_signed()],
        };
        for want in expected {
            if i64::from(stream.i32()?) != want {
                return Err(damaged());
            }
        }
        let size = self.chunk_size(at);
        let n_bytes = u64::from(stream.u32()?);
        // A chunk that would not shrink is stored as it is.
        if n_bytes > self.n_bytes(at[1], size) {
            return Err(damaged());
        }
        Ok(Chunk { at, size, bytes: stream.bytes(n_bytes)? })
    }

    fn decode(&self, chunk: Chunk) -> Result<Chunk, ExrFault> {
        let Chunk { at, size, bytes } = chunk;
        let damaged = || ExrFault::Damaged(format!("the rows from {} on cannot be decoded", at[1]));
        let (n_bytes, area) = (self.n_bytes(at[1], size), size[0] * size[1]);
        let mut header = Cow::Borrowed(&self.header);
        if self.part.channels.iter().any(|c| c.sampling != [1, 1]) {
            // The codecs take the size of a chunk from the bytes of a pixel.
            if !n_bytes.is_multiple_of(area) {
                return Err(ExrFault::Sampling);
            }
            header.to_mut().channels.bytes_per_pixel = (n_bytes / area) as usize;
        }
        if n_bytes == 0 {
            return Ok(Chunk { at, size, bytes: Vec::new() });
        }
        let position = at.map(i32::try_from);
        let [Ok(x), Ok(y)] = position else { return Err(damaged()) };
        let section = IntegerBounds::new(Vec2(x, y), Vec2(size[0] as usize, size[1] as usize));
        // The codecs index by numbers that the chunk holds, and panic where those are damaged.
        let decode = || self.codec.decompress_image_section_from_le(&header, bytes, section, false);
        let decoded = catch_unwind(AssertUnwindSafe(decode)).map_err(|_| damaged())?;
        let bytes = decoded.map_err(|_| damaged())?;
        if bytes.len() as u64 != n_bytes {
            return Err(damaged());
        }
        Ok(Chunk { at, size, bytes })
    }

    /// Copies the samples of the channels `wanted` to where the display window shows them.
    fn place(&self, chunk: &Chunk, wanted: &[usize], out: &mut [f32]) {
        let Part { channels, data, display, .. } = self.part;
        let [width, height] = display.size.map(u64::cast_signed);
        let left = data.min[0] + chunk.at[0].cast_signed() - display.min[0];
        let mut rest = chunk.bytes.as_slice();
        for row in chunk.at[1]..chunk.at[1] + chunk.size[1] {
            let y = data.min[1] + row.cast_signed() - display.min[1];
            for (c, channel) in channels.iter().enumerate() {
                let [step, step_y] = channel.sampling.map(|s| s as u64);
                if !row.is_multiple_of(step_y) {
                    continue;
                }
                let n = (chunk.size[0] / step) as usize;
                let (samples, others) = rest.split_at(n * channel.bytes());
                rest = others;
                let Some(k) = wanted.iter().position(|&w| w == c).filter(|_| (0..height).contains(&y)) else {
                    continue;
                };
                for (i, sample) in samples.chunks_exact(channel.bytes()).enumerate() {
                    let x = left + i as i64 * step.cast_signed();
                    if (0..width).contains(&x) {
                        out[(y * width + x) as usize * wanted.len() + k] = value(channel.kind, sample);
                    }
                }
            }
        }
    }
}

fn description(channel: &Channel) -> ChannelDescription {
    let [x, y] = channel.sampling;
    ChannelDescription {
        // `Text::from` panics beyond Latin-1, and the codecs look only at what follows the last dot.
        name: Text::from_slice_unchecked(channel.name.as_bytes()),
        sample_type: channel.kind,
        quantize_linearly: channel.is_linear,
        sampling: Vec2(x, y),
    }
}

/// A sample in the byte order of this machine.
fn value(kind: SampleType, bytes: &[u8]) -> f32 {
    match (kind, bytes) {
        (SampleType::F16, &[a, b]) => f16::from_ne_bytes([a, b]).to_f32(),
        (SampleType::F32, &[a, b, c, d]) => f32::from_ne_bytes([a, b, c, d]),
        (_, &[a, b, c, d]) => u32::from_ne_bytes([a, b, c, d]) as f32,
        _ => 0.0,
    }
}

/// Fills the pixels between those that have samples of the k-th of n channels.
fn spread(out: &mut [f32], [k, n]: [usize; 2], part: &Part, sampling: [usize; 2]) {
    let (data, display) = (&part.data, &part.display);
    let width = display.size[0].cast_signed();
    // What of the display window has data, from its corner, and the first and last sample there.
    let axis = |d: usize| {
        let step = sampling[d] as i64;
        let start = (data.min[d] - display.min[d]).max(0);
        let end =
            (data.min[d] - display.min[d] + data.size[d].cast_signed()).min(display.size[d].cast_signed());
        let phase = (-display.min[d]).rem_euclid(step);
        let first = start + (phase - start).rem_euclid(step);
        let last = end - 1 - (end - 1 - phase).rem_euclid(step);
        (step, start..end, first, last)
    };
    let ((step_x, columns, left, right), (step_y, rows, top, bottom)) = (axis(0), axis(1));
    if sampling == [1, 1] || left > right || top > bottom {
        return;
    }
    let index = |x: i64, y: i64| (y * width + x) as usize * n + k;
    // The samples before and after a pixel, and where it lies between them.
    let around = |v: i64, step: i64, first: i64, last: i64| {
        let before = v - (v - first).rem_euclid(step);
        let share = (v - before) as f32 / step as f32;
        (before.clamp(first, last), (before + step).clamp(first, last), share)
    };
    for y in (top..=bottom).step_by(step_y as usize) {
        for x in columns.clone() {
            let (a, b, share) = around(x, step_x, left, right);
            if share > 0.0 {
                let (a, b) = (out[index(a, y)], out[index(b, y)]);
                out[index(x, y)] = a + (b - a) * share;
            }
        }
    }
    for y in rows {
        let (a, b, share) = around(y, step_y, top, bottom);
        if share > 0.0 {
            for x in columns.clone() {
                let (a, b) = (out[index(x, a)], out[index(x, b)]);
                out[index(x, y)] = a + (b - a) * share;
            }
        }
    }
}
