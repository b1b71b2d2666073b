//! The pre-computation step: bounds and start of the free variables by stated
//! formulas, from the geometry and from one render of each light alone.
//!
//! * sizes: [`super::bounds`], narrowed by the sidecar's `size_range`;
//! * background: `v ≥ 0.05`, and `v·albedo ≤ 0.95` for every background
//!   material (never above [`MAX_VALUE`]), or the sidecar's `value_range`;
//! * `L_max`: [`HEADROOM`] times the radiance at which the light alone, at its
//!   initial size, shows what it lights at [`BRIGHT`]: the mean of display
//!   luminance, each pixel weighted by the luminance it receives;
//! * neutral start: every light contributes the same mean luminance, and
//!   together they bring the picture's mean display luminance to [`START`];
//! * matched starts: the object's mean display luminance is the target's, by
//!   all lights alike or by one light alone, and the background's value is
//!   what brings the background nearest to its own target.

use glam::UVec2;
use rayon::prelude::*;

use super::{ParamVector, Scale, Variable, VariableKind, bounds};
use crate::{
    film::Picture,
    math::display::{LuminanceMode, luminance},
    scene::{Scene, sidecar::FreeKind, sidecar::FreeVariables},
};

/// Display luminance of what a light lights when it is taken to be white.
pub const BRIGHT: f64 = 0.9;
/// `L_max` over the radiance that reaches [`BRIGHT`].
pub const HEADROOM: f64 = 4.0;
/// Mean display luminance of the start.
pub const START: f64 = 0.35;
/// Distance of a matched start from every bound, in the optimiser's units: a
/// search that begins on a bound is slow to leave it.
pub const OFF_BOUND: f64 = 0.04;
/// Least value factor of the background.
pub const MIN_VALUE: f32 = 0.05;
/// Largest albedo that a value factor may give a background material.
pub const MAX_ALBEDO: f32 = 0.95;
/// Largest value factor of the background.
pub const MAX_VALUE: f32 = 4.0;

/// Halvings of the exponent's range in which a gain is sought: to a millionth of it.
const BISECTIONS: u32 = 27;

/// A scene leaves nothing to optimise.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum SurveyError {
    #[error("the scene has no lights; add [[lights]] to its sidecar, or a material that emits")]
    NoLights,
    #[error("nothing is free: allow radiance, size or background with --free, or `free` in the sidecar")]
    NothingFree,
    #[error("light `{light}` does not light the picture; move it or turn it")]
    LightsNothing { light: String },
    #[error("light `{light}` is within {distance:.3} of a surface at any size; move it away")]
    NoRoom { light: String, distance: f32 },
}

/// Least and largest size of a light; `None` without size.
pub type SizeBounds = Option<[f32; 2]>;

/// Clears room for every light: narrows its size to what the geometry allows.
/// Returns the size bounds per light (`None` without size) and what changed,
/// in words.
///
/// # Errors
/// When there are no lights, or one touches a surface at any size.
pub fn fit_sizes(scene: &mut Scene, film: UVec2) -> Result<(Vec<SizeBounds>, Vec<String>), SurveyError> {
    if scene.lights.is_empty() {
        return Err(SurveyError::NoLights);
    }
    let mut notes = Vec::new();
    let mut ranges = Vec::new();
    let found: Vec<SizeBounds> =
        scene.lights.par_iter().map(|light| bounds::size_range(scene, light, film)).collect();
    for (i, found) in found.into_iter().enumerate() {
        let light = &scene.lights[i];
        let name = light.name.clone();
        let Some([lo, hi]) = found else {
            ranges.push(None);
            continue;
        };
        if hi.is_nan() || hi <= 1e-4 {
            return Err(SurveyError::NoRoom { light: name, distance: hi });
        }
        let range = match scene.light_bounds[i].size {
            None => [lo, hi],
            Some([a, b]) if b <= hi => [a, b],
            Some([a, b]) => {
                notes.push(format!(
                    "light `{name}`: size {b} cuts geometry or covers the main object; at most {hi:.3}"
                ));
                [a.min(hi), hi]
            }
        };
        let size = light.size.clamp(range[0], range[1]);
        if size != light.size {
            notes.push(format!("light `{name}`: size {} set to {size:.3}", light.size));
        }
        let radiance = light.radiance;
        scene.set_light(i, radiance, size);
        ranges.push(Some(range));
    }
    Ok((ranges, notes))
}

/// Bounds of the background's value factor; `None` without background.
#[must_use]
pub fn value_range(scene: &Scene) -> Option<[f32; 2]> {
    let brightest = scene.background_albedo();
    if brightest <= 0.0 {
        return None;
    }
    let cap = (1.0 / brightest).min(MAX_VALUE);
    Some(match scene.value_range {
        Some([lo, hi]) => [lo.min(cap), hi.min(cap)],
        None => [MIN_VALUE, (MAX_ALBEDO / brightest).clamp(1.0, cap.max(1.0)).min(cap)],
    })
}

/// The gain at which the mean display luminance of `y`, weighted by `weight`
/// of each value, is `target`; by bisection in the exponent.
fn gain_for(y: &[f64], weight: impl Fn(f64) -> f64, target: f64, exposure: f64, mode: LuminanceMode) -> f64 {
    let weights: Vec<f64> = y.iter().map(|&y| weight(y)).collect();
    let total: f64 = weights.iter().sum();
    let (mut shown, mut slopes) = (vec![0.0; y.len()], vec![0.0; y.len()]);
    let mut display = |gain: f64| {
        mode.encode_all(y, exposure * gain, &mut shown, &mut slopes);
        weights.iter().zip(&shown).map(|(w, l)| w * l).sum::<f64>() / total
    };
    let (mut lo, mut hi) = (-60.0_f64, 60.0_f64);
    for _ in 0..BISECTIONS {
        let mid = 0.5 * (lo + hi);
        if display(mid.exp2()) < target {
            lo = mid;
        } else {
            hi = mid;
        }
    }
    hi.exp2()
}

/// Display-referred brightness of a start in which all lights contribute alike.
struct Alike {
    images: Vec<Vec<f64>>,
    means: Vec<f64>,
    /// Radiance of light l: `gain / means[l]`.
    gain: f64,
}

impl Alike {
    fn new(scene: &Scene, unit: &Picture, mode: LuminanceMode) -> Self {
        let images: Vec<Vec<f64>> =
            unit.lights.iter().map(|l| l.iter().map(|&rgb| luminance(rgb)).collect()).collect();
        let means: Vec<f64> = images.iter().map(|y| y.iter().sum::<f64>() / y.len() as f64).collect();
        let alike: Vec<f64> = (0..unit.rgb.len())
            .map(|p| images.iter().zip(&means).filter(|(_, m)| **m > 0.0).map(|(y, m)| y[p] / m).sum())
            .collect();
        let gain = gain_for(&alike, |_| 1.0, START, f64::from(scene.exposure), mode);
        Self { images, means, gain }
    }
}

/// The variables of a run.
///
/// * `unit`: a render with every light at radiance 1 and its fitted size
/// * `sizes`, from [`fit_sizes`]
///
/// # Errors
/// When a light of the sidecar, or every light, reaches no pixel, or nothing is free.
pub fn variables(
    scene: &Scene,
    unit: &Picture,
    sizes: &[SizeBounds],
    free: &FreeVariables,
    mode: LuminanceMode,
) -> Result<ParamVector, SurveyError> {
    let e = f64::from(scene.exposure);
    let Alike { images, means, gain } = Alike::new(scene, unit, mode);
    // One that the scene file happens to have is left as it is, unless there is no other.
    let is_needed = |i: usize| !scene.light_bounds[i].is_from_file || means.iter().all(|&m| m <= 0.0);
    if let Some(i) = (0..means.len()).find(|&i| means[i] <= 0.0 && is_needed(i)) {
        return Err(SurveyError::LightsNothing { light: scene.lights[i].name.clone() });
    }
    let bright: Vec<f64> = images.par_iter().map(|image| gain_for(image, |y| y, BRIGHT, e, mode)).collect();
    let mut variables = Vec::new();
    for (i, light) in scene.lights.iter().enumerate() {
        let limits = &scene.light_bounds[i];
        if means[i] <= 0.0 {
            continue;
        }
        if free.contains(FreeKind::Radiance) && limits.radiance_free {
            let upper = limits.radiance_max.map_or(HEADROOM * bright[i], f64::from);
            variables.push(Variable {
                name: format!("{}.radiance", light.name),
                unit: light.unit(),
                lower: 0.0,
                upper,
                initial: (gain / means[i]).min(upper),
                scale: Scale::Perceptual,
                kind: VariableKind::Radiance(i),
            });
        }
        if let (true, true, Some([lo, hi])) = (free.contains(FreeKind::Size), limits.size_free, sizes[i]) {
            variables.push(Variable {
                name: format!("{}.size", light.name),
                unit: "1",
                lower: f64::from(lo),
                upper: f64::from(hi),
                initial: f64::from(light.size),
                scale: Scale::Logarithmic,
                kind: VariableKind::Size(i),
            });
        }
    }
    if let (true, Some([lo, hi])) = (free.contains(FreeKind::Background), value_range(scene)) {
        variables.push(Variable {
            name: "background.value".into(),
            unit: "1",
            lower: f64::from(lo),
            upper: f64::from(hi),
            initial: f64::from(1.0_f32.clamp(lo, hi)),
            scale: Scale::Perceptual,
            kind: VariableKind::Background,
        });
    }
    if variables.is_empty() {
        return Err(SurveyError::NothingFree);
    }
    Ok(ParamVector { variables })
}

/// Where a search may begin, in the optimiser's units, each with a name: the
/// neutral start first, then the matched ones.
///
/// * `mask`: the main object, over the pixels of `unit`
/// * `t_object`, `t_background`: target means of display luminance
#[must_use]
pub fn starts(
    scene: &Scene,
    unit: &Picture,
    mask: &[bool],
    variables: &ParamVector,
    [t_object, t_background]: [f64; 2],
    mode: LuminanceMode,
) -> Vec<(String, Vec<f64>)> {
    let e = f64::from(scene.exposure);
    let Alike { images, means, .. } = Alike::new(scene, unit, mode);
    let lights: Vec<usize> = (0..images.len()).filter(|&l| means[l] > 0.0).collect();
    let alone = lights.iter().map(|&l| (format!("`{}` alone", scene.lights[l].name), vec![l]));
    let matched: Vec<(String, Vec<usize>)> =
        std::iter::once(("all lights alike, matched".to_owned(), lights.clone())).chain(alone).collect();
    let start = |(name, lit): (String, Vec<usize>)| {
        let total: Vec<f64> =
            (0..mask.len()).map(|p| lit.iter().map(|&l| images[l][p] / means[l]).sum()).collect();
        let of = |main: bool| -> Vec<f64> {
            total.iter().zip(mask).filter(|(_, m)| **m == main).map(|(y, _)| *y).collect()
        };
        let gain = gain_for(&of(true), |_| 1.0, t_object, e, mode);
        // The background's luminance is about proportional to its value.
        let value = gain_for(&of(false), |_| 1.0, t_background, e, mode) / gain;
        let u = variables
            .variables
            .iter()
            .map(|v| match v.kind {
                VariableKind::Radiance(l) if lit.contains(&l) => v.encode(gain / means[l]),
                VariableKind::Radiance(_) => v.encode(0.0),
                VariableKind::Size(_) => v.encode(v.initial),
                VariableKind::Background => v.encode(value * v.initial),
            })
            .map(|u: f64| u.clamp(OFF_BOUND, 1.0 - OFF_BOUND))
            .collect();
        (name, u)
    };
    let first = ("all lights alike".to_owned(), variables.start());
    std::iter::once(first).chain(matched.into_par_iter().map(start).collect::<Vec<_>>()).collect()
}
