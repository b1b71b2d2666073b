//! One light at several sizes and fluxes, from one transport basis.
//!
//! At equal flux a larger light has a lower radiance: what changes along a column of the
//! figure is the softness of the shadows, along a row the brightness.

use std::f64::consts::PI;

use glam::UVec2;

use super::{
    canvas::displayed,
    grid::{Cell, Grid, Row},
};
use crate::{
    integrator::{Integrator, Observer, RenderError, aov},
    light::{Light, Outline, Shape, SizeDensity},
    math::display::LuminanceMode,
    params::survey::{self, SurveyError},
    sampler::SamplerKind,
    scene::Scene,
    transport::{Knots, Layout, LightingPoint, SizeBins, Source, TransportBasis, ValueNodes},
};

/// Sizes, as shares of the largest.
const SIZES: [f64; 4] = [0.05, 0.1, 0.2, 0.4];
/// Fluxes, in stops from the one that lights the object well.
const STOPS: [f64; 5] = [-3.0, -2.0, -1.0, 0.0, 1.0];
/// Display luminance of a well lit object; the target of both looks.
const WELL_LIT: f64 = 0.47;
/// Knots of the size.
const KNOTS: usize = 32;

/// The grid cannot be made.
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

/// How the pictures are taken.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// Of each picture, pixels.
    pub size: UVec2,
    /// Samples per pixel of the basis.
    pub spp: u32,
    /// Light transport.
    pub integrator: Integrator,
    /// Sample sequences.
    pub sampler: SamplerKind,
    /// Seed of the basis.
    pub seed: u64,
}

/// Surface that emits, m², times π: the flux at radiance 1, W; and the extent in words.
/// At size 1.
fn emission(light: &Light) -> Option<f64> {
    match &light.shape {
        Shape::Planar(p) if p.cone.is_none() => Some(
            PI * match p.outline {
                Outline::Rectangle { a, b } => 4.0 * f64::from(a) * f64::from(b),
                Outline::Disk { r } => PI * f64::from(r).powi(2),
            },
        ),
        Shape::Sphere(s) => Some(PI * 4.0 * PI * f64::from(s.radius).powi(2)),
        _ => None,
    }
}

/// Extent of a light of a size, in words.
fn extent(light: &Light, size: f64) -> String {
    let cm = |half: f32| {
        let full = 200.0 * f64::from(half) * size;
        if full < 10.0 { format!("{full:.1}") } else { format!("{full:.0}") }
    };
    match &light.shape {
        Shape::Planar(p) => match p.outline {
            Outline::Rectangle { a, b } => format!("{} × {} cm", cm(a), cm(b)),
            Outline::Disk { r } => format!("⌀ {} cm", cm(r)),
        },
        Shape::Sphere(s) => format!("⌀ {} cm", cm(s.radius)),
        _ => String::new(),
    }
}

/// Renders one basis of the scene under the light called `key`, else its first that has a
/// size, and lays out its pictures.
///
/// # Errors
/// When no light has a size, or the render fails.
pub fn grid(scene: &mut Scene, settings: &Settings, observer: &impl Observer) -> Result<Grid, FluxError> {
    scene.camera.resize(settings.size);
    let (sizes, _) = survey::fit_sizes(scene, settings.size)?;
    let suits = |l: &usize| sizes[*l].is_some() && emission(&scene.lights[*l]).is_some();
    let all = 0..scene.lights.len();
    let light = all
        .clone()
        .filter(suits)
        .find(|&l| scene.lights[l].name == "key")
        .or_else(|| all.clone().find(suits));
    let light = light.ok_or(FluxError::NoLight)?;
    let [least, largest] = sizes[light].ok_or(FluxError::NoLight)?;
    let unit = emission(&scene.lights[light]).ok_or(FluxError::NoLight)?;

    let bins = scene.lights.iter().enumerate().map(|(l, other)| {
        if l == light {
            SizeBins::Free(Knots::geometric(f64::from(least), f64::from(largest), KNOTS))
        } else {
            SizeBins::Fixed(other.size)
        }
    });
    let value = f64::from(scene.background_value());
    let layout = Layout::new(settings.size, bins.collect(), ValueNodes::new(value, 1));
    scene.lights[light].size_density = SizeDensity::AnySize { least, extent: largest };
    let mut basis = TransportBasis::new(layout, 1);
    let source =
        Source { scene, integrator: &settings.integrator, sampler: settings.sampler, seed: settings.seed };
    basis.render(source, settings.spp, observer)?;

    let exposure = f64::from(scene.exposure);
    let lighting = |flux: f64, size: f64| {
        let mut x = LightingPoint {
            radiance: vec![0.0; scene.lights.len()],
            size: scene.lights.iter().map(|l| f64::from(l.size)).collect(),
            value,
        };
        x.radiance[light] = flux / (unit * size * size);
        x.size[light] = size;
        x
    };
    let size_of = |share: f64| share * f64::from(largest);
    let mask = aov::trace(scene).mask;
    let linear = basis.picture(&lighting(1.0, size_of(SIZES[1])));
    let on_object: Vec<f64> = linear
        .rgb
        .iter()
        .zip(&mask)
        .filter_map(|(c, m)| m.then(|| crate::math::display::luminance(*c)))
        .collect();
    let name = &scene.lights[light].name;
    let well = well_lit(&on_object, exposure).ok_or_else(|| FluxError::Dark { light: name.clone() })?;

    let rows = SIZES.iter().map(|&share| Row {
        name: extent(&scene.lights[light], size_of(share)),
        cells: STOPS
            .iter()
            .map(|stop| Cell {
                picture: displayed(&basis.picture(&lighting(well * stop.exp2(), size_of(share))), exposure),
                caption: Vec::new(),
            })
            .collect(),
    });
    let watts = |flux: f64| {
        let decimals = if flux < 0.1 {
            3
        } else if flux < 1.0 {
            2
        } else {
            1
        };
        format!("{flux:.decimals$} W")
    };
    Ok(Grid {
        rows: rows.collect(),
        columns: STOPS.iter().map(|stop| watts(well * stop.exp2())).collect(),
        axes: Some([format!("flux of the light “{name}”"), "its size".to_owned()]),
    })
}

/// The gain at which the mean display luminance is [`WELL_LIT`].
fn well_lit(luminance: &[f64], exposure: f64) -> Option<f64> {
    if luminance.iter().sum::<f64>() <= 0.0 {
        return None;
    }
    let mean = |gain: f64| {
        let sum: f64 = luminance.iter().map(|y| LuminanceMode::Srgb.encode(gain * y, exposure)).sum();
        sum / luminance.len() as f64
    };
    let (mut lo, mut hi) = (-60.0_f64, 60.0_f64);
    for _ in 0..60 {
        let middle = 0.5 * (lo + hi);
        if mean(middle.exp2()) < WELL_LIT { lo = middle } else { hi = middle }
    }
    Some(hi.exp2())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_well_lit_gain_brings_the_mean_there() {
        let y = [0.2, 0.4, 0.1];
        let gain = well_lit(&y, 2.0).unwrap();
        let mean = y.iter().map(|y| LuminanceMode::Srgb.encode(gain * y, 2.0)).sum::<f64>() / 3.0;
        assert!((mean - WELL_LIT).abs() < 1e-9);
        assert_eq!(well_lit(&[0.0], 1.0), None);
    }
}
