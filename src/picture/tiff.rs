//! TIFF and BigTIFF: the decoder of the crate `tiff`, whose samples are kept in the type that the
//! file gives them.

use image::metadata::Orientation;
use tiff::decoder::{BufferLayoutPreference, Decoder, DecodingResult, Limits, ifd::Value};
use tiff::tags::Tag;
use tiff::{ColorType, TiffError, TiffUnsupportedError};

use super::budget::{self, METADATA_BUDGET, PICTURE_BUDGET};
use super::primaries::Chromaticities;
use super::raster::Profiled;
use super::{Alpha, Colour, Fault, Format, Note, Picture, Purpose, Reading, Samples, Source, Transfer};

/// \[TIFF6\] section 20.
const WHITE_POINT: Tag = Tag::Unknown(318);
/// \[TIFF6\] section 20.
const PRIMARY_CHROMATICITIES: Tag = Tag::Unknown(319);
/// \[TIFF6\] section 21.
const YCBCR_COEFFICIENTS: Tag = Tag::Unknown(529);
/// Compression by JPEG within the file, by \[TIFFTN2\].
const JPEG: u16 = 7;

/// Version of the format of cameras' raw pictures that is built on TIFF.
const DNG_VERSION: Tag = Tag::Unknown(50_706);
/// Bit of NewSubfileType: a smaller version of another picture.
const PREVIEW: u32 = 1;
/// Bit of NewSubfileType: the transparency of another picture.
const TRANSPARENCY: u32 = 4;
/// \[TIFF6\] section 20.
const TRANSFER_FUNCTION: Tag = Tag::Unknown(301);

type TiffDecoder<'a> = Decoder<Box<dyn Source + 'a>>;

/// Reads the first picture of a file.
pub(super) fn read(source: Box<dyn Source + '_>, reading: &Reading) -> Result<Picture, Fault> {
    let mut limits = Limits::default();
    limits.decoding_buffer_size = PICTURE_BUDGET as usize;
    limits.intermediate_buffer_size = PICTURE_BUDGET as usize;
    limits.ifd_value_size = METADATA_BUDGET as usize;
    let mut decoder = Decoder::new(source).map_err(|e| refused(&e))?.with_limits(limits);
    find_main_picture(&mut decoder)?;
    let kind = Kind::of(&mut decoder)?;
    let is_cmyk = matches!(kind.colour, ColorType::CMYK(_) | ColorType::CMYKA(_));
    if is_cmyk && reading.purpose == Purpose::Light {
        return Err(Fault::print());
    }
    let (width, height) = decoder.dimensions().map_err(|e| refused(&e))?;
    let turn = match reading.purpose.is_upright() {
        true => orientation(&mut decoder),
        false => Orientation::NoTransforms,
    };
    let needed = kind.working(turn) + reading.kept as u64;
    budget::check([u64::from(width), u64::from(height)], needed)?;

    let mut result = DecodingResult::U8(Vec::new());
    let layout = decoder.read_image_to_buffer(&mut result).map_err(|e| refused(&e))?;
    let size = [width as usize, height as usize];
    let samples = kind.samples(result, &layout, size)?;
    let (channels, samples) = kind.colours(samples, &mut decoder);
    let transfer = if kind.is_float { Transfer::Linear } else { Transfer::Srgb };
    let (mut notes, mut profile) = (Vec::new(), None);
    let mut colour = Colour::rec709(transfer);
    if reading.purpose.honours_metadata() {
        match stated(&mut decoder, colour) {
            Some(stated) => colour = stated,
            None => notes.push(Note::ChromaticitiesIgnored),
        }
        match is_cmyk {
            true => notes.push(Note::Cmyk),
            false => profile = decoder.get_tag_u8_vec(Tag::IccProfile).ok(),
        }
        if decoder.find_tag(TRANSFER_FUNCTION).ok().flatten().is_some() {
            notes.push(Note::TransferIgnored);
        }
        if decoder.more_images() {
            notes.push(Note::FurtherPages);
        }
    }
    let profiled = Profiled::of(profile, &colour, channels);
    let mut picture = Picture::new(size, channels, samples, colour, turn);
    (picture.notes, picture.alpha) = (notes, kind.alpha);
    Ok(profiled.apply(picture))
}

/// Goes to the first picture that is neither a preview of another nor its mask.
fn find_main_picture(decoder: &mut TiffDecoder) -> Result<(), Fault> {
    if decoder.find_tag(DNG_VERSION).ok().flatten().is_some() {
        return unsupported("it is a camera's raw picture (DNG)");
    }
    loop {
        let kind = decoder.find_tag_unsigned::<u32>(Tag::NewSubfileType).ok().flatten();
        if kind.unwrap_or(0) & (PREVIEW | TRANSPARENCY) == 0 {
            return Ok(());
        }
        if !decoder.more_images() {
            break;
        }
        decoder.next_image().map_err(|e| refused(&e))?;
    }
    decoder.seek_to_image(0).map_err(|e| refused(&e))?;
    match decoder.find_tag(Tag::SubIfd).ok().flatten() {
        // So cameras have it, with a preview before the picture.
        Some(_) => unsupported("it shows a preview alone, and has its picture in a sub-directory (SubIFDs)"),
        None => Ok(()),
    }
}

/// What the samples of a file are.
struct Kind {
    colour: ColorType,
    /// Samples of a pixel that are used.
    used: usize,
    alpha: Alpha,
    is_planar: bool,
    is_jpeg: bool,
    is_float: bool,
}

impl Kind {
    fn of(decoder: &mut TiffDecoder) -> Result<Self, Fault> {
        let number = |decoder: &mut TiffDecoder, tag| decoder.find_tag_unsigned::<u16>(tag).ok().flatten();
        let photometric = number(decoder, Tag::PhotometricInterpretation);
        match photometric {
            Some(3) => return unsupported("its colours are numbers of a palette"),
            Some(8 | 10) => return unsupported("its colours are CIE L*a*b*"),
            Some(32_803 | 34_892) => return unsupported("it is a camera's raw picture"),
            _ => {}
        }
        if number(decoder, Tag::FillOrder) == Some(2) {
            return unsupported("its bits run backwards in their bytes (FillOrder 2)");
        }
        let formats = decoder.find_tag_unsigned_vec::<u16>(Tag::SampleFormat).ok().flatten();
        let formats = formats.unwrap_or_default();
        if formats.iter().any(|&f| f == 2 || f > 4) {
            return unsupported("its samples are signed integers or complex numbers");
        }
        let extra = decoder.find_tag_unsigned_vec::<u16>(Tag::ExtraSamples).ok().flatten();
        let extra = extra.and_then(|e| e.first().copied());
        let colour = decoder.colortype().map_err(|e| refused(&e))?;
        let is_planar = number(decoder, Tag::PlanarConfiguration) == Some(2);
        let tile = decoder.find_tag_unsigned::<u32>(Tag::TileLength).ok().flatten().filter(|&rows| rows > 0);
        let (_, height) = decoder.dimensions().map_err(|e| refused(&e))?;
        // The crate does not expect that planes end within a row of tiles.
        if is_planar && tile.is_some_and(|rows| height % rows != 0) {
            return unsupported("its channels lie apart, in tiles that reach below its lower edge");
        }
        let bits = colour.bit_depth();
        let n_samples = number(decoder, Tag::SamplesPerPixel).unwrap_or(1);
        let is_predicted = number(decoder, Tag::Predictor).is_some_and(|p| p > 1);
        // The crate leaves them out before it undoes the prediction, which then goes astray.
        if is_predicted && colour.num_samples() < n_samples {
            return unsupported("it has further channels, and is compressed with a predictor");
        }
        let used = match colour {
            ColorType::Gray(_) => 1,
            // Grey with further samples.
            ColorType::Multiband { .. } => 1 + usize::from(matches!(extra, Some(1 | 2))),
            ColorType::RGB(_) | ColorType::YCbCr(8) => 3,
            ColorType::RGBA(_) => 4,
            ColorType::CMYK(8 | 16) => 4,
            ColorType::CMYKA(8 | 16) => 5,
            _ => return unsupported(&format!("its colours are of a kind that is not known ({colour:?})")),
        };
        let is_packed = matches!(colour, ColorType::Gray(1 | 2 | 4));
        if !is_packed && !matches!(bits, 8 | 16 | 32 | 64) {
            return unsupported(&format!("its samples have {bits} bits"));
        }
        Ok(Self {
            colour,
            used,
            alpha: if extra == Some(1) { Alpha::Premultiplied } else { Alpha::Straight },
            is_planar,
            is_jpeg: number(decoder, Tag::Compression) == Some(JPEG),
            is_float: formats.first() == Some(&3),
        })
    }

    /// Bytes of each pixel that decoding takes.
    fn working(&self, turn: Orientation) -> u64 {
        let bits = u64::from(self.colour.bit_depth());
        let stored = u64::from(self.colour.num_samples()) * bits.div_ceil(8);
        let is_kept = matches!(bits, 8 | 16) && !self.is_float || bits == 32 && self.is_float;
        let is_same = is_kept && usize::from(self.colour.num_samples()) == self.used && !self.is_planar;
        let kept = self.used as u64 * if is_kept { bits / 8 } else { 4 };
        let copy = if is_same { 0 } else { kept };
        let turning = if turn == Orientation::NoTransforms { 0 } else { kept };
        let jpeg = if self.is_jpeg { stored } else { 0 };
        stored + jpeg.max(copy.max(turning))
    }

    /// The samples that are used, interleaved.
    fn samples(
        &self,
        result: DecodingResult,
        layout: &BufferLayoutPreference,
        size: [usize; 2],
    ) -> Result<Samples, Fault> {
        let n_pixels = size[0] * size[1];
        let used = [usize::from(self.colour.num_samples()), self.used, layout.planes];
        let found = match result {
            DecodingResult::U8(s) if matches!(self.colour, ColorType::Gray(1 | 2 | 4)) => {
                Some(Samples::U8(unpacked(&s, size, self.colour.bit_depth())))
            }
            DecodingResult::U8(s) => picked(s, used, n_pixels).map(Samples::U8),
            DecodingResult::U16(s) => picked(s, used, n_pixels).map(Samples::U16),
            DecodingResult::U32(s) => {
                floats(picked(s, used, n_pixels), |v| (f64::from(v) / f64::from(u32::MAX)) as f32)
            }
            DecodingResult::U64(s) => {
                floats(picked(s, used, n_pixels), |v| (v as f64 / u64::MAX as f64) as f32)
            }
            DecodingResult::F16(s) => floats(picked(s, used, n_pixels), |v| v.to_f32()),
            DecodingResult::F32(s) => picked(s, used, n_pixels).map(Samples::F32),
            DecodingResult::F64(s) => floats(picked(s, used, n_pixels), |v| v as f32),
            _ => return unsupported("its samples are signed integers"),
        };
        found.ok_or_else(|| Fault::decode(Format::Tiff, "its samples are incomplete"))
    }

    /// RGB of inks and of luminance with chroma.
    fn colours(&self, samples: Samples, decoder: &mut TiffDecoder) -> (usize, Samples) {
        match (self.colour, samples) {
            (ColorType::CMYK(_) | ColorType::CMYKA(_), Samples::U8(s)) => {
                (self.used - 1, Samples::U8(from_inks(&s, self.used, 255)))
            }
            (ColorType::CMYK(_) | ColorType::CMYKA(_), Samples::U16(s)) => {
                (self.used - 1, Samples::U16(from_inks(&s, self.used, 65_535)))
            }
            (ColorType::YCbCr(_), Samples::U8(mut s)) => {
                let weights =
                    rationals(decoder, YCBCR_COEFFICIENTS).and_then(|w| <[f64; 3]>::try_from(w).ok());
                from_chroma(&mut s, weights.unwrap_or([0.299, 0.587, 0.114]));
                (3, Samples::U8(s))
            }
            (_, samples) => (self.used, samples),
        }
    }
}

/// The first `used` of `from` samples of each pixel, which lie in planes or together; `None`
/// when there are too few.
fn picked<T: Copy>(samples: Vec<T>, [from, used, planes]: [usize; 3], n_pixels: usize) -> Option<Vec<T>> {
    if samples.len() < n_pixels * if planes > 1 { used } else { from } {
        return None;
    }
    if planes == 1 && from == used {
        return Some(samples);
    }
    let index = |pixel: usize, c: usize| if planes > 1 { c * n_pixels + pixel } else { pixel * from + c };
    let mut out = Vec::with_capacity(n_pixels * used);
    for pixel in 0..n_pixels {
        out.extend((0..used).map(|c| samples[index(pixel, c)]));
    }
    Some(out)
}

/// Samples of another type in floating point.
fn floats<T>(samples: Option<Vec<T>>, float: impl Fn(T) -> f32) -> Option<Samples> {
    samples.map(|s| Samples::F32(s.into_iter().map(float).collect()))
}

/// Grey of 1, 2 or 4 bits, whose rows begin with a byte, as 8 bits.
fn unpacked(samples: &[u8], [width, height]: [usize; 2], bits: u8) -> Vec<u8> {
    let per_byte = usize::from(8 / bits);
    let row = width.div_ceil(per_byte);
    let highest = u8::MAX >> (8 - bits);
    let mut out = Vec::with_capacity(width * height);
    for line in samples.chunks_exact(row).take(height) {
        out.extend((0..width).map(|x| {
            let shift = 8 - bits as usize * (x % per_byte + 1);
            (line[x / per_byte] >> shift & highest) * (255 / highest)
        }));
    }
    out
}

/// Red, green and blue that cyan, magenta, yellow and black leave of white; alpha stays.
fn from_inks<T: Copy + Into<u32> + TryFrom<u32> + Default>(samples: &[T], n: usize, white: u32) -> Vec<T> {
    let mut out = Vec::with_capacity(samples.len() / n * (n - 1));
    for pixel in samples.chunks_exact(n) {
        let black: u32 = pixel[3].into();
        out.extend(pixel[..3].iter().map(|&ink| {
            let light = u64::from(white - ink.into()) * u64::from(white - black);
            let light = (light + u64::from(white) / 2) / u64::from(white);
            u32::try_from(light).ok().and_then(|v| T::try_from(v).ok()).unwrap_or_default()
        }));
        out.extend_from_slice(&pixel[4..]);
    }
    out
}

/// RGB of Y, Cb and Cr of the full range, in place; \[TIFF6\] section 21.
fn from_chroma(samples: &mut [u8], [red, green, blue]: [f64; 3]) {
    for pixel in samples.as_chunks_mut::<3>().0 {
        let [y, cb, cr] = pixel.map(f64::from);
        let (cb, cr) = (cb - 128.0, cr - 128.0);
        let (r, b) = (y + cr * (2.0 - 2.0 * red), y + cb * (2.0 - 2.0 * blue));
        let g = (y - blue * b - red * r) / green;
        *pixel = [r, g, b].map(|v| v.round() as u8);
    }
}

fn orientation(decoder: &mut TiffDecoder) -> Orientation {
    let value = decoder.find_tag_unsigned::<u8>(Tag::Orientation).ok().flatten();
    value.and_then(Orientation::from_exif).unwrap_or(Orientation::NoTransforms)
}

/// The colours with the primaries and the white that the file states; `None` when they are those
/// of no device.
fn stated(decoder: &mut TiffDecoder, plain: Colour) -> Option<Colour> {
    let white = rationals(decoder, WHITE_POINT).and_then(|v| <[f64; 2]>::try_from(v).ok());
    let primaries = rationals(decoder, PRIMARY_CHROMATICITIES).and_then(|v| <[f64; 6]>::try_from(v).ok());
    let ([wx, wy], [rx, ry, gx, gy, bx, by]) = match (white, primaries) {
        (Some(white), Some(primaries)) => (white, primaries),
        _ => return Some(plain),
    };
    plain.with_primaries(Chromaticities::from_list([rx, ry, gx, gy, bx, by, wx, wy]))
}

fn rationals(decoder: &mut TiffDecoder, tag: Tag) -> Option<Vec<f64>> {
    let list = match decoder.find_tag(tag).ok()?? {
        Value::List(list) => list,
        only => vec![only],
    };
    let number = |v: &Value| match *v {
        Value::Rational(a, b) => Some(f64::from(a) / f64::from(b)),
        Value::Float(v) => Some(f64::from(v)),
        _ => None,
    };
    list.iter().map(number).collect()
}

fn refused(error: &TiffError) -> Fault {
    match error {
        // As the first picture in files of cameras; the crate refuses it before its other entries can be read.
        TiffError::UnsupportedError(TiffUnsupportedError::UnknownInterpretation) => Fault::Unsupported {
            what:
                "its samples are no colours, as in cameras' raw pictures (unknown PhotometricInterpretation)"
                    .into(),
            cure: CURE,
        },
        TiffError::UnsupportedError(what) => Fault::Unsupported { what: what.to_string(), cure: CURE },
        other => Fault::decode(Format::Tiff, other.to_string()),
    }
}

fn unsupported<T>(what: &str) -> Result<T, Fault> {
    Err(Fault::Unsupported { what: what.to_owned(), cure: CURE })
}

/// What to do about a TIFF of a rare kind.
const CURE: &str = "save it again as plain RGB TIFF of 8 or 16 bits or in floating point, or as PNG";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packed_grey_is_spread_over_8_bits() {
        assert_eq!(unpacked(&[0b1010_0000, 0b0100_0000], [3, 2], 1), [255, 0, 255, 0, 255, 0]);
        assert_eq!(unpacked(&[0b00_01_10_11], [4, 1], 2), [0, 85, 170, 255]);
        assert_eq!(unpacked(&[0xf0, 0x50], [3, 1], 4), [255, 0, 85]);
    }

    #[test]
    fn planes_and_further_samples_are_sorted_out() {
        assert_eq!(picked(vec![1, 2, 3, 4, 5, 6], [3, 3, 3], 2), Some(vec![1, 3, 5, 2, 4, 6]));
        assert_eq!(picked(vec![1, 2, 3, 4, 5, 6], [3, 2, 1], 2), Some(vec![1, 2, 4, 5]));
        assert_eq!(picked(vec![1, 2, 3, 4, 5], [3, 3, 1], 2), None);
    }

    #[test]
    fn inks_and_chroma_become_colours() {
        assert_eq!(from_inks(&[0_u8, 255, 0, 0, 7, 0, 0, 0, 255, 9], 5, 255), [255, 0, 255, 7, 0, 0, 0, 9]);
        let mut pixels = [76, 85, 255, 128, 128, 128];
        from_chroma(&mut pixels, [0.299, 0.587, 0.114]);
        assert_eq!(pixels, [254, 0, 0, 128, 128, 128]);
    }
}
