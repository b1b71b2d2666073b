//! The picture of an EXR file: which layer, and what its numbers mean.

use std::io::{Read, Seek};

use image::metadata::Orientation;

use super::colour::interop_space;
use super::exr::{Colours, ExrFault, ExrFile, Layer, Part};
use super::{Alpha, Colour, Fault, Note, Picture, Purpose, Reading, Samples, Source, Transfer};
use crate::math::display::LUMINANCE_WEIGHTS;

/// Reads the chosen layer; of a mask the channel of that name or the only one. With a picture that
/// is read for its light comes, where it is asked for, the mask that the file may have.
pub(super) fn read_exr(source: Box<dyn Source + '_>, reading: &Reading) -> Result<Picture, Fault> {
    let mut file = ExrFile::open(source)?;
    let purpose = reading.purpose;
    if let Some([part, channel]) = single_channel(&file, purpose) {
        let samples = file.read(part, &[channel], reading.kept)?;
        let size = file.parts()[part].display.size.map(|n| n as usize);
        let colour = Colour::rec709(Transfer::Linear);
        return Ok(Picture::new(size, 1, Samples::F32(samples), colour, Orientation::NoTransforms));
    }
    let layer = file.layer(reading.layer).map_err(|fault| match fault {
        ExrFault::NoPicture(names) if purpose == Purpose::Mask => ExrFault::NoMask(names),
        other => other,
    })?;
    let mut picture = layer_picture(&mut file, &layer, reading)?;
    if purpose == Purpose::Light {
        picture.attribute = file.attribute().map(str::to_owned);
        if reading.own_mask
            && let Some([part, channel]) = file.mask_channel()
            && file.parts()[part].display.size == file.parts()[layer.part].display.size
        {
            picture.mask = Some(file.read(part, &[channel], LIGHT + reading.kept)?);
        }
        // They are of the picture itself.
        if reading.own_replicates
            && layer.part == 0
            && file.attribute().is_some()
            && let Some((part, channels)) = file.replicates()
            && file.parts()[part].display.size == file.parts()[0].display.size
        {
            let (channels, n) = (channels.concat(), channels[0].len());
            let all = channels.len();
            let samples = file.read(part, &channels, LIGHT + reading.kept + all * MEASURED)?;
            let planes = |r: usize| (r * n..(r + 1) * n).flat_map(|c| samples.iter().skip(c).step_by(all));
            picture.replicates = (0..all / n).map(|r| planes(r).copied().collect()).collect();
        }
    }
    let is_choice = reading.layer.is_none() && file.attribute().is_none() && file.layers().len() > 1;
    if is_choice && purpose.honours_metadata() {
        let others = file.layers().iter().filter(|l| **l != layer).map(|l| l.name.clone()).collect();
        picture.notes.push(Note::Layer { taken: layer.name, others });
    }
    Ok(picture)
}

/// Bytes of a pixel of a picture that is read for its light.
const LIGHT: usize = 12;
/// Bytes of a pixel of a replicate that is taken apart and measured.
const MEASURED: usize = 12;

/// The channel that is all that counts of a file, where it is not a picture's.
fn single_channel(file: &ExrFile<impl Read + Seek>, purpose: Purpose) -> Option<[usize; 2]> {
    let has_picture = !file.layers().is_empty();
    match purpose {
        Purpose::Light => None,
        Purpose::Texture | Purpose::RawTexture => file.only_channel().filter(|_| !has_picture),
        Purpose::Mask => {
            let alpha = || file.alpha_channel().filter(|_| !has_picture);
            file.mask_channel().or_else(|| file.only_channel()).or_else(alpha)
        }
    }
}

fn layer_picture(
    file: &mut ExrFile<impl Read + Seek>,
    layer: &Layer,
    reading: &Reading,
) -> Result<Picture, Fault> {
    let part = file.parts()[layer.part].clone();
    let (colour, note) = match reading.purpose.honours_metadata() {
        true => colour(&part)?,
        false => (Colour::rec709(Transfer::Linear), None),
    };
    if part.is_cube_map && reading.purpose == Purpose::Light {
        return Err(Fault::Unsupported {
            what: "it shows the six sides of a cube (envmap)".into(),
            cure: "convert it to latitude and longitude",
        });
    }
    let mut channels = layer.colours.indices().to_vec();
    // Before black, what is transparent has been left out already.
    channels.extend(layer.alpha.filter(|_| reading.purpose != Purpose::Light));
    let mut samples = file.read(layer.part, &channels, reading.kept)?;
    if matches!(layer.colours, Colours::Chroma(_)) {
        let weights = part.chromaticities.map_or(LUMINANCE_WEIGHTS, |c| c.luminance_weights());
        for pixel in samples.chunks_exact_mut(channels.len()) {
            from_chroma(pixel, weights);
        }
    }
    let size = part.display.size.map(|n| n as usize);
    let samples = Samples::F32(samples);
    let mut picture = Picture::new(size, channels.len(), samples, colour, Orientation::NoTransforms);
    picture.alpha = Alpha::Premultiplied;
    picture.notes.extend(note);
    if reading.purpose.honours_metadata() {
        picture.notes.extend(lone_channel(&part, layer));
        picture.notes.extend(part.pixel_aspect.and_then(|ratio| Note::of_aspect(ratio.recip())));
    }
    Ok(picture)
}

/// What to say of a channel that is read as grey whatever its name.
fn lone_channel(part: &Part, layer: &Layer) -> Option<Note> {
    let Colours::Grey(c) = layer.colours else { return None };
    let name = &part.channels[c].name;
    let is_red_or_green = name.ends_with(['R', 'G']);
    is_red_or_green.then(|| Note::OnlyChannel(name.clone()))
}

/// What the header says of the colours: a named colour space, else chromaticities.
fn colour(part: &Part) -> Result<(Colour, Option<Note>), Fault> {
    let named = part.color_space.as_deref().map_or(Ok(None), interop_space);
    let named = named.map_err(|name| Fault::Unsupported {
        what: format!("its colour space `{name}` is not known"),
        cure: "save it with linear Rec.709 colours (lin_rec709_scene)",
    })?;
    let plain = Colour::rec709(Transfer::Linear);
    Ok(match (named, part.chromaticities) {
        (Some(named), _) => (named, None),
        (None, None) => (plain, None),
        (None, Some(stated)) => match plain.with_primaries(stated) {
            Some(stated) => (stated, None),
            None => (plain, Some(Note::ChromaticitiesIgnored)),
        },
    })
}

/// R, G, B in the place of Y, (R − Y)/Y and (B − Y)/Y, \[OpenEXR\] *Luminance/Chroma Images*.
fn from_chroma(pixel: &mut [f32], [red, green, blue]: [f64; 3]) {
    let [y, ry, by] = [pixel[0], pixel[1], pixel[2]].map(f64::from);
    let (r, b) = ((ry + 1.0) * y, (by + 1.0) * y);
    let g = (y - r * red - b * blue) / green;
    pixel[..3].copy_from_slice(&[r as f32, g as f32, b as f32]);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::display::luminance;

    #[test]
    fn chroma_keeps_the_luminance() {
        let mut pixel = [0.4, 0.5, -0.25, 1.0];
        from_chroma(&mut pixel, LUMINANCE_WEIGHTS);
        assert!((luminance([pixel[0], pixel[1], pixel[2]]) - 0.4).abs() < 1e-7);
        assert!((pixel[0] - 0.6).abs() < 1e-6 && (pixel[2] - 0.3).abs() < 1e-6 && pixel[3] == 1.0);
    }
}
