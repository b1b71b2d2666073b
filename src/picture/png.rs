//! What the chunks of a PNG say about its colours.

use std::io::{BufRead, Seek, SeekFrom};

use png::{CodingIndependentCodePoints, Decoder, Info, Limits};

use super::budget::METADATA_BUDGET;
use super::primaries::{self, Chromaticities};
use super::raster::About;
use super::{Colour, Fault, Format, Note, Transfer};

/// The gAMA values that stand for sRGB: 1/2.2 in five digits, as \[PNG3\] 11.3.2.3 has writers put
/// it beside the chunk sRGB for readers that do not know that.
const SRGB_GAMMA: std::ops::RangeInclusive<u32> = 45_450..=45_460;

/// What the chunks before the pixels say, in the order of precedence of \[PNG3\] 4.3: cICP, iCCP
/// (which the caller reads), sRGB, then gAMA and cHRM.
pub(super) fn about(source: &mut (impl BufRead + Seek + ?Sized), plain: About) -> Result<About, Fault> {
    source.seek(SeekFrom::Start(0))?;
    let mut decoder = Decoder::new_with_limits(source, Limits { bytes: METADATA_BUDGET as usize });
    decoder.set_ignore_text_chunk(true);
    let reader = decoder.read_info().map_err(|e| Fault::decode(Format::Png, e))?;
    let info = reader.info();
    let further = info.animation_control.is_some().then_some(Note::FurtherPages);
    let plain = About { notes: further.into_iter().collect(), ..plain };
    if let Some(points) = info.coding_independent_code_points {
        return Ok(About { colour: coded(points)?, asks_profile: false, ..plain });
    }
    let (colour, note) = if info.srgb.is_some() { (plain.colour, None) } else { stated(info, plain.colour) };
    let notes = plain.notes.into_iter().chain(note).collect();
    Ok(About { colour, notes, ..plain })
}

/// The colours of gAMA and cHRM.
fn stated(info: &Info, plain: Colour) -> (Colour, Option<Note>) {
    let mut colour = plain;
    if let Some(gamma) = info.gama_chunk.map(png::ScaledFloat::into_scaled)
        && !SRGB_GAMMA.contains(&gamma)
    {
        colour.transfer = match gamma {
            100_000 => Transfer::Linear,
            _ => Transfer::Power(100_000.0 / f64::from(gamma)),
        };
    }
    let Some(c) = info.chrm_chunk else { return (colour, None) };
    let value = |v: png::ScaledFloat| f64::from(v.into_scaled()) / 100_000.0;
    let [red, green, blue, white] = [c.red, c.green, c.blue, c.white].map(|(x, y)| [value(x), value(y)]);
    match colour.with_primaries(Chromaticities { red, green, blue, white }) {
        Some(colour) => (colour, None),
        None => (colour, Some(Note::ChromaticitiesIgnored)),
    }
}

/// The colours of cICP, by the tables of \[H273\].
fn coded(points: CodingIndependentCodePoints) -> Result<Colour, Fault> {
    let unsupported = |what: String| {
        Err(Fault::Unsupported { what, cure: "save it as sRGB, or as EXR with linear colours" })
    };
    let chromaticities = match points.color_primaries {
        // 2 is unspecified.
        1 | 2 => primaries::REC709,
        5 => primaries::REC601_625,
        6 | 7 => primaries::REC601_525,
        9 => primaries::REC2020,
        11 => primaries::P3_DCI,
        12 => primaries::P3_D65,
        n => return unsupported(format!("its cICP chunk names the primaries {n}, which are not known")),
    };
    let transfer = match points.transfer_function {
        2 | 13 => Transfer::Srgb,
        1 | 6 | 14 | 15 => Transfer::Bt709,
        4 => Transfer::Power(2.2),
        5 => Transfer::Power(2.8),
        8 => Transfer::Linear,
        16 => return unsupported("its cICP chunk says that it is coded for HDR displays (PQ)".into()),
        18 => return unsupported("its cICP chunk says that it is coded for HDR displays (HLG)".into()),
        n => {
            return unsupported(format!(
                "its cICP chunk names the transfer function {n}, which is not known"
            ));
        }
    };
    if points.matrix_coefficients != 0 || !points.is_video_full_range_image {
        return unsupported("its cICP chunk says that its colours are coded as video".into());
    }
    match Colour::rec709(transfer).with_primaries(chromaticities) {
        Some(colour) => Ok(colour),
        None => unsupported("its primaries are those of no device".into()),
    }
}
