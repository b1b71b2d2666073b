//! One light at several sizes and fluxes, from one transport basis.
//!
//! At equal flux a larger light has a lower radiance: what changes along a column of the
//! figure is the softness of the shadows, along a row the brightness.

use glam::UVec2;
use serde_json::Value;

use super::grid::{Cell, Grid, Row};
use crate::{
    audit::products::Products,
    canvas::displayed,
    film::Picture,
    integrator::{Integrator, Observer, RenderError, View, aov},
    light::{Light, Outline, SizeDensity},
    lighting::{Lighting, SamplingPlan},
    math::{Measure, ViewTransform},
    sampler::SamplerKind,
    scene::Scene,
    transport::{Knots, Layout, SizeBins, Source, TransportBasis, ValueNodes},
    variables::{Constraints, Fitted, SurveyError, survey::gain_for},
};

/// Number of sizes, each twice the one before: as many rows as fit beside five columns.
const N_SIZES: usize = 4;
/// Index of the size at which the object is well lit at 0 stops.
const REFERENCE: usize = 1;
/// Fluxes in stops from the one that lights the object well: from too dark to too bright.
const STOPS: [f64; 5] = [-3.0, -2.0, -1.0, 0.0, 1.0];
/// Mean display luminance of a well lit object: t_meanObj of both looks in \[PG14\], table 1.
const WELL_LIT: f64 = 0.47;
/// Knots of the size: a single light needs little memory, and 32 knots feather its edge by less than a
/// tenth of its size where sizes span a factor of eight.
const KNOTS: usize = 32;

/// The grid of sizes and fluxes cannot be made.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum FluxError {
    #[error("the scene has no rectangle, disk or sphere whose size may vary")]
    NoLight,
    #[error("light `{light}` does not light the main object")]
    Dark { light: String },
    #[error(transparent)]
    Survey(#[from] SurveyError),
    #[error(transparent)]
    Render(#[from] RenderError),
}

/// Size, samples and integrator of the pictures.
#[derive(Clone, Copy, Debug)]
pub struct Settings<'a> {
    /// Size of each picture, pixels.
    pub size: UVec2,
    /// Samples per pixel of the basis.
    pub spp: u32,
    /// Integrator with its options.
    pub integrator: Integrator,
    /// Family of sample sequences.
    pub sampler: SamplerKind,
    /// Seed of the scrambles of the basis.
    pub seed: u64,
    /// View through which the pictures are seen.
    pub view: ViewTransform,
    /// Products, among which the basis is sought and kept.
    pub products: &'a Products,
}

/// Extent of a light at the size `size`, in words.
fn extent(light: &Light, size: f64) -> String {
    let cm = |half: f32| {
        let full = 200.0 * f64::from(half) * size;
        if full < 10.0 { format!("{full:.1}") } else { format!("{full:.0}") }
    };
    match light.resizable().map(|shape| shape.outline()) {
        Some(Outline::Rectangle { a, b }) => format!("{} × {} cm", cm(a), cm(b)),
        Some(Outline::Disk { r }) => format!("⌀ {} cm", cm(r)),
        None => String::new(),
    }
}

/// A basis of a scene in which one light's size is free.
struct OneLight {
    basis: TransportBasis,
    /// Index of the light.
    light: usize,
    /// Flux of the light at radiance 1 and size 1, W.
    unit: f64,
    /// Sizes of the light, ascending in equal ratios.
    sizes: [f64; N_SIZES],
    /// Lighting with all lights off, at their sizes within bounds.
    dark: Lighting,
}

impl OneLight {
    /// Renders the basis of the light called `key`, else of the first that has a size.
    fn render(
        view: View,
        constraints: &Constraints,
        settings: &Settings,
        observer: &impl Observer,
    ) -> Result<Self, FluxError> {
        let scene = view.scene;
        let authored = Lighting::authored(scene);
        let Fitted { lighting, sizes, .. } = Fitted::new(view, &authored, constraints)?;
        let suitable: Vec<(usize, f64, [f32; 2])> = scene
            .lights
            .iter()
            .zip(&sizes)
            .enumerate()
            .filter_map(|(l, (light, size))| Some((l, f64::from(light.unit_power(1.0)), (*size)?)))
            .collect();
        let key = suitable.iter().find(|s| scene.lights[s.0].name == "key");
        let &(light, unit, [least, most]) = key.or(suitable.first()).ok_or(FluxError::NoLight)?;
        let largest = most.min(least * 2_f32.powi(N_SIZES as i32 - 1));
        let bins = lighting.size.iter().enumerate().map(|(l, &size)| {
            if l == light {
                SizeBins::Free(Knots::geometric(f64::from(least), f64::from(largest), KNOTS))
            } else {
                SizeBins::Fixed(size as f32)
            }
        });
        let radiance = vec![0.0; scene.lights.len()];
        let dark = Lighting { radiance, value: authored.value, ..lighting.clone() };
        let layout = Layout::new(settings.size, bins.collect(), ValueNodes::new(dark.value, 1));
        let mut plan = SamplingPlan::uniform(&dark);
        plan.sizes[light] = SizeDensity::any_size([least, largest]);
        let Settings { integrator, sampler, seed, spp, products, .. } = *settings;
        let source = Source { view, plan: &plan, integrator: &integrator, sampler, seed };
        let words = format!("{:?} {layout:?} {plan:?} {integrator:?} {sampler:?} {spp}", view.camera);
        let key = Products::key(&words, &[scene.fingerprint(), seed]);
        let kept = products.path(key, "flux").and_then(|path| TransportBasis::load(&path).ok());
        let basis = match kept {
            Some((kept, _)) if *kept.layout() == layout => kept,
            _ => {
                let mut basis = TransportBasis::new(layout, 1);
                basis.render(source, spp, observer)?;
                let nobody = |_: &str| {};
                products.save_file(key, "flux", nobody, |path| basis.save_unsynced(path, &Value::Null));
                basis
            }
        };
        let step = (f64::from(largest) / f64::from(least)).powf(1.0 / (N_SIZES - 1) as f64);
        let sizes = std::array::from_fn(|i| f64::from(least) * step.powi(i as i32));
        Ok(Self { basis, light, unit, sizes, dark })
    }

    /// Picture of the light at a flux, W, and a size.
    fn picture(&self, flux: f64, size: f64) -> Picture {
        let mut x = self.dark.clone();
        x.radiance[self.light] = flux / (self.unit * size * size);
        x.size[self.light] = size;
        self.basis.picture(&x)
    }
}

/// Renders one basis of the scene under its light called `key`, else under the first that has a size,
/// and lays out pictures of it at several sizes and fluxes.
///
/// # Errors
/// When no light has a size, or the render fails.
pub fn grid(
    scene: &Scene,
    constraints: &Constraints,
    settings: &Settings,
    observer: &impl Observer,
) -> Result<Grid, FluxError> {
    let camera = scene.camera.resized(settings.size);
    let view = View { scene, camera: &camera };
    let one = OneLight::render(view, constraints, settings, observer)?;
    let light = &scene.lights[one.light];
    let mask = aov::trace(view, 1.0).mask;
    let reference = one.picture(1.0, one.sizes[REFERENCE]);
    let shown = reference.rgb.iter().zip(&mask).filter(|(_, on_object)| **on_object);
    let measure = Measure { view: settings.view, ..Measure::default() };
    let on_object = measure.planes(&shown.map(|(rgb, _)| *rgb).collect::<Vec<_>>());
    let well = well_lit(&on_object, one.dark.exposure, measure)
        .ok_or_else(|| FluxError::Dark { light: light.name.clone() })?;
    let fluxes = STOPS.map(|stop| well * stop.exp2());
    let cell = |flux: f64, size: f64| Cell {
        picture: displayed(&one.picture(flux, size), one.dark.exposure, settings.view),
        caption: Vec::new(),
    };
    let rows = one.sizes.iter().map(|&size| Row {
        name: extent(light, size),
        cells: fluxes.iter().map(|&flux| cell(flux, size)).collect(),
    });
    let decimals = if fluxes[0] < 0.1 { 3 } else { 1 };
    Ok(Grid {
        rows: rows.collect(),
        columns: fluxes.iter().map(|flux| format!("{flux:.decimals$} W")).collect(),
        axes: Some([format!("flux of the light “{}”", light.name), "its size".to_owned()]),
    })
}

/// Gain at which the mean display luminance of the linear planes of a picture is [`WELL_LIT`]; `None` if all
/// are 0.
fn well_lit(planes: &[f64], exposure: f64, measure: Measure) -> Option<f64> {
    let is_lit = planes.iter().sum::<f64>() > 0.0;
    is_lit.then(|| gain_for(planes, |_| 1.0, WELL_LIT, exposure, measure))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_well_lit_gain_brings_the_mean_there() {
        let y = [0.2, 0.4, 0.1];
        let gain = well_lit(&y, 2.0, Measure::default()).unwrap();
        let mean =
            y.iter().map(|y| crate::math::display::LuminanceMode::Srgb.encode(gain * y, 2.0)).sum::<f64>()
                / 3.0;
        assert!((mean - WELL_LIT).abs() < 1e-6);
        assert_eq!(well_lit(&[0.0], 1.0, Measure::default()), None);
    }
}
