//! Pictures of a report: as they stand in a page, and the sheet of the lightings to choose from.

use std::{fs, io::Cursor, path::Path};

use base64::prelude::{BASE64_STANDARD, Engine};
use image::{RgbImage, codecs::jpeg::JpegEncoder, imageops::FilterType};
use serde_json::{Value, json};

use super::ReportError;
use crate::{
    audit::{CONTACT, RESULT, pick_stem, write_whole},
    canvas::{Anchor, Canvas, FAINT, INK, text},
    film::exr::{ExrImage, read_exr},
    math::ViewTransform,
    objective::Statistics,
};

/// Longest side of a picture in a page, pixels: more than a browser shows, and four looks of it are 4 MB.
const LONGEST: u32 = 1920;
/// Quality of a JPEG in a page: from 90 on its blocks are not seen; a picture of 640 × 480 has 80 kB.
const QUALITY: u8 = 92;

/// A PNG as it stands in a page, with its size; null where there is none.
///
/// # Errors
/// When it is no picture.
pub fn embedded(path: &Path) -> Result<Value, ReportError> {
    let Some(picture) = opened(path)? else { return Ok(Value::Null) };
    let longest = picture.width().max(picture.height());
    let picture = if longest > LONGEST {
        let [w, h] = [picture.width(), picture.height()]
            .map(|n| (u64::from(n) * u64::from(LONGEST)).div_ceil(u64::from(longest)) as u32);
        image::imageops::resize(&picture, w, h, FilterType::CatmullRom)
    } else {
        picture
    };
    let src = jpeg(&picture, path)?;
    Ok(json!({"src": src, "width": picture.width(), "height": picture.height()}))
}

/// A picture of a run; `None` where there is none yet.
fn opened(path: &Path) -> Result<Option<RgbImage>, ReportError> {
    if !path.is_file() {
        return Ok(None);
    }
    let bytes = fs::read(path).map_err(|source| ReportError::Read { path: path.into(), source })?;
    let picture = image::load_from_memory(&bytes)
        .map_err(|source| ReportError::Picture { path: path.into(), source })?;
    Ok(Some(picture.into_rgb8()))
}

/// A picture as a data URL.
fn jpeg(picture: &RgbImage, path: &Path) -> Result<String, ReportError> {
    let mut bytes = Cursor::new(Vec::new());
    JpegEncoder::new_with_quality(&mut bytes, QUALITY)
        .encode_image(picture)
        .map_err(|source| ReportError::Picture { path: path.into(), source })?;
    Ok(format!("data:image/jpeg;base64,{}", BASE64_STANDARD.encode(bytes.into_inner())))
}

/// The picture of a step of a search as a data URL; `None` where its file is not there.
///
/// # Errors
/// When it cannot be read.
pub fn iteration(path: &Path) -> Result<Option<String>, ReportError> {
    if !path.is_file() {
        return Ok(None);
    }
    let exr = read_exr(path)?;
    let Some(rgb) = exr.beauty() else { return Ok(None) };
    let stored = exr.lightopt.as_ref();
    let exposure = stored.and_then(|s| s["exposure"].as_f64()).unwrap_or(1.0);
    let view = stored.and_then(|s| serde_json::from_value(s["view"].clone()).ok());
    let view: ViewTransform = view.unwrap_or_default();
    let picture = RgbImage::from_fn(exr.width as u32, exr.height as u32, |x, y| {
        let codes = view.encode(rgb[y as usize * exr.width + x as usize], exposure);
        image::Rgb(codes.map(|code| (255.0 * code).round() as u8))
    });
    jpeg(&picture, path).map(Some)
}

/// Cumulated histograms of the first and the last step of a search; null where it has none.
///
/// # Errors
/// When a picture cannot be read.
pub fn histograms(run: &Path) -> Result<Value, ReportError> {
    let path = |i: usize| run.join(format!("iter_{i:04}.exr"));
    let Some(last) = (0..).take_while(|&i| path(i).is_file()).last() else { return Ok(Value::Null) };
    let of = |i: usize| Ok::<_, ReportError>(cumulated(&read_exr(&path(i))?));
    Ok(json!({"initial": of(0)?, "final": of(last)?}))
}

/// The cumulated histogram of a picture that has its display luminance.
fn cumulated(exr: &ExrImage) -> Option<Vec<f64>> {
    let l = exr.part("luminance")?.channel("l")?;
    let l: Vec<f64> = l.iter().map(|&l| f64::from(l)).collect();
    let is_whole = !l.is_empty() && l.len() == exr.width * exr.height;
    is_whole.then(|| Statistics::measure_whole(&l, exr.width, exr.height).cumulated().to_vec())
}

/// Pictures of the sheet side by side.
const COLUMNS: u32 = 4;
/// Width of each, pixels.
const TILE: u32 = 256;
/// Space around pictures and below them for a line of words, pixels.
const GAP: u32 = 16;
/// Height of that line, pixels.
const LINE: u32 = 30;

/// Draws the lightings that a run offers with their numbers and f_q, and writes the sheet; does nothing where there is
/// no choice.
///
/// # Errors
/// When the record or a picture cannot be read, or the sheet not be written.
pub fn contact_sheet(run: &Path) -> Result<(), ReportError> {
    let path = run.join(RESULT);
    if !path.is_file() {
        return Ok(());
    }
    let record = fs::read(&path).map_err(|source| ReportError::Read { path: path.clone(), source })?;
    let result: Value =
        serde_json::from_slice(&record).map_err(|e| ReportError::Record { path, message: e.to_string() })?;
    let Some(others) = result["picks"]["each"].as_array().filter(|each| !each.is_empty()) else {
        return Ok(());
    };
    let mut tiles = Vec::new();
    for (i, f_q) in std::iter::once(&result["f_q"]).chain(others.iter().map(|pick| &pick["f_q"])).enumerate()
    {
        let name = if i == 0 { "found".to_owned() } else { pick_stem(i + 1) };
        let Some(picture) = opened(&run.join(format!("{name}.png")))? else { return Ok(()) };
        let height = (TILE * picture.height()).div_ceil(picture.width().max(1)).max(1);
        let picture = image::imageops::resize(&picture, TILE, height, FilterType::CatmullRom);
        tiles.push((picture, format!("{}", i + 1), format!("f_q {:.3}", f_q.as_f64().unwrap_or(f64::NAN))));
    }
    let height = tiles.iter().map(|(picture, _, _)| picture.height()).max().unwrap_or(1);
    let columns = COLUMNS.min(tiles.len() as u32);
    let rows = (tiles.len() as u32).div_ceil(columns);
    let place = |i: usize| {
        let (column, row) = (i as u32 % columns, i as u32 / columns);
        (GAP + column * (TILE + GAP), GAP + row * (height + LINE + GAP))
    };
    let size = (GAP + columns * (TILE + GAP), GAP + rows * (height + LINE + GAP));
    let mut canvas = Canvas::drawn(size, |area| {
        for (i, (_, number, f_q)) in tiles.iter().enumerate() {
            let (x, y) = place(i);
            let [left, right, middle] = [x, x + TILE, y + height + LINE / 2].map(|v| v as i32);
            text(area, number, (left, middle), 16, INK, Anchor::Left)?;
            text(area, f_q, (right, middle), 15, FAINT, Anchor::Right)?;
        }
        Ok(())
    })?;
    for (i, (picture, _, _)) in tiles.iter().enumerate() {
        let (x, y) = place(i);
        canvas.paste(picture, x, y);
    }
    write_whole(&run.join(CONTACT), canvas.png()?)?;
    Ok(())
}
