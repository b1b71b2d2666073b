//! Pictures of a run as EXR: part `rgb` (the beauty), `luminance` (`l`, as
//! displayed), `mask` (1 on the main object), `albedo`, `normal`, `depth`,
//! `light.NAME` for the share of each light, `replicates` (linear luminance
//! of each replicate, with its red and blue for a view that needs colour) where f_q is measured on those, and `denoised` with
//! `denoised.light.NAME` where noise was removed.

use serde_json::Value;

use crate::{
    film::{
        Picture,
        exr::{ExrImage, ExrPart},
        image_file::{LinearImage, mask_part},
    },
    integrator::aov::Aovs,
    math::{Measure, measure::PLANES},
};

/// Assembles the EXR of a picture with its auxiliary pictures and a part for each light; `attribute`
/// becomes the `lightopt` attribute.
#[must_use]
pub fn exr(
    picture: &Picture,
    aovs: &Aovs,
    light_names: &[&str],
    exposure: f64,
    measure: Measure,
    attribute: Value,
) -> ExrImage {
    let display = measure.of_luminance().encode_image(&picture.rgb, exposure);
    let mut parts = vec![
        ExrPart::rgb("rgb", &picture.rgb),
        ExrPart::single("luminance", "l", display.iter().map(|&l| l as f32).collect()),
        mask_part(&aovs.mask),
        ExrPart::rgb("albedo", &aovs.albedo),
        ExrPart::triple("normal", ["X", "Y", "Z"], &aovs.normal),
        ExrPart::single("depth", "Z", aovs.depth.clone()),
    ];
    parts.extend(light_names.iter().zip(&picture.lights).map(|(n, l)| ExrPart::rgb(format!("light.{n}"), l)));
    ExrImage { width: picture.width, height: picture.height, parts, lightopt: Some(attribute) }
}

/// The part that holds the planes of each replicate of a picture: linear luminance in the channels `Y0`,
/// `Y1` …, and where the view needs colour, red and blue in `R0`, `B0`, `R1` …
#[must_use]
pub fn replicates(planes: impl IntoIterator<Item = Vec<f32>>, measure: Measure) -> ExrPart {
    let of_replicate = |(r, planes): (usize, Vec<f32>)| {
        let n = (planes.len() / measure.n_planes()).max(1);
        let named = PLANES.iter().zip(planes.chunks(n));
        named.map(|(name, plane)| (format!("{name}{r}"), plane.to_vec())).collect::<Vec<_>>()
    };
    let channels = planes.into_iter().enumerate().flat_map(of_replicate).collect();
    ExrPart { name: "replicates".into(), channels }
}

/// The parts that hold a denoised picture and its lights: `denoised` and `denoised.light.NAME`.
#[must_use]
pub fn denoised(picture: &Picture, light_names: &[&str]) -> Vec<ExrPart> {
    let lights = light_names.iter().zip(&picture.lights);
    std::iter::once(ExrPart::rgb("denoised", &picture.rgb))
        .chain(lights.map(|(name, light)| ExrPart::rgb(format!("denoised.light.{name}"), light)))
        .collect()
}

/// Radiance of a picture without its parts, to be written as PNG.
#[must_use]
pub fn beauty(picture: &Picture) -> LinearImage {
    LinearImage { width: picture.width, height: picture.height, rgb: picture.rgb.clone() }
}
