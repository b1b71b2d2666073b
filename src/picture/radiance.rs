//! Radiance HDR: the decoder of the crate `image`, and what the header says of the numbers.
//!
//! # References
//! \[Radiance\] *Radiance File Formats*: EXPOSURE and COLORCORR are what pixels have been multiplied
//! with, all lines together.

use image::DynamicImage;
use image::codecs::hdr::{HdrDecoder, HdrMetadata};
use image::metadata::Orientation;

use super::budget;
use super::primaries::Chromaticities;
use super::{Colour, Fault, Format, Note, Picture, Reading, Samples, Source, Transfer};

/// Bytes of a pixel as decoded.
const PIXEL: u64 = 12;

/// Reads a picture.
pub(super) fn read(source: Box<dyn Source + '_>, reading: &Reading) -> Result<Picture, Fault> {
    let decode = |e: image::ImageError| match &e {
        image::ImageError::Unsupported(_) => Fault::Unsupported {
            what: format!("its rows or colours are stored in a rare way ({e})"),
            cure: "save it again with rows from the top (-Y +X) and as RGBE",
        },
        _ => Fault::decode(Format::Hdr, e),
    };
    // The lenient decoder knows files of other first lines than #?RADIANCE.
    let decoder = HdrDecoder::new_nonstrict(source).map_err(decode)?;
    let header = decoder.metadata();
    let size = [u64::from(header.width), u64::from(header.height)];
    budget::check(size, PIXEL + reading.kept as u64)?;
    let mut notes = Vec::new();
    let mut colour = Colour::rec709(Transfer::Linear);
    if reading.purpose.honours_metadata() {
        colour.gain = gain(&header)?;
        match primaries(&header)? {
            None => {}
            Some(stated) => match colour.with_primaries(stated) {
                Some(stated) => colour = stated,
                None => notes.push(Note::ChromaticitiesIgnored),
            },
        }
    }
    let samples = match DynamicImage::from_decoder(decoder).map_err(decode)? {
        DynamicImage::ImageRgb32F(image) => image.into_raw(),
        _ => return Err(Fault::decode(Format::Hdr, "its samples are of an unknown kind")),
    };
    let size = size.map(|n| n as usize);
    let mut picture = Picture::new(size, 3, Samples::F32(samples), colour, Orientation::NoTransforms);
    picture.notes = notes;
    Ok(picture)
}

/// Factor that undoes all EXPOSURE and COLORCORR lines.
fn gain(header: &HdrMetadata) -> Result<[f64; 3], Fault> {
    let mut product = [1.0; 3];
    for (key, value) in &header.custom_attributes {
        let factors = match key.as_str() {
            "EXPOSURE" => numbers::<1>(key, value)?.repeat(3),
            "COLORCORR" => numbers::<3>(key, value)?.to_vec(),
            _ => continue,
        };
        for (p, f) in product.iter_mut().zip(factors) {
            if f <= 0.0 {
                return Err(wrong(key, value));
            }
            *p *= f;
        }
    }
    let gain = product.map(f64::recip);
    if gain.iter().any(|g| !g.is_normal()) {
        return Err(wrong("EXPOSURE", &format!("{:e}", product[0])));
    }
    Ok(gain)
}

fn primaries(header: &HdrMetadata) -> Result<Option<Chromaticities>, Fault> {
    let line = header.custom_attributes.iter().rfind(|(key, _)| key == "PRIMARIES");
    let Some((key, value)) = line else { return Ok(None) };
    Ok(Some(Chromaticities::from_list(numbers(key, value)?)))
}

fn numbers<const N: usize>(key: &str, value: &str) -> Result<[f64; N], Fault> {
    let parsed: Option<Vec<f64>> = value.split_whitespace().map(|v| v.parse().ok()).collect();
    let finite = parsed.filter(|list| list.iter().all(|v| v.is_finite()));
    finite.and_then(|list| list.try_into().ok()).ok_or_else(|| wrong(key, value))
}

fn wrong(key: &str, value: &str) -> Fault {
    let shown: String = value.trim().chars().filter(|c| !c.is_control()).take(40).collect();
    Fault::decode(Format::Hdr, format!("{key}={shown} makes no sense"))
}
