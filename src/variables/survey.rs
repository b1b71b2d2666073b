//! Survey of a scene: bounds and starts of the free variables by stated formulas, from the geometry and
//! from one render of each light alone (the pre-computation step of \[PG14\]).
//!
//! * sizes: [`super::bounds`], widened to a light's own size if that is smaller, narrowed by the
//!   sidecar's `size_range`;
//! * background: `v ≥ 0.05`, and `v·albedo ≤ 0.95` for every background
//!   material (never above [`MAX_VALUE`]), or the sidecar's `value_range`;
//! * `L_max`: `HEADROOM` = 4 times the radiance at which the light alone, at its
//!   initial size, shows what it lights at [`BRIGHT`]: the mean of display
//!   luminance, each pixel weighted by the luminance it receives;
//! * neutral start: every light contributes the same mean luminance, and
//!   together they bring the picture's mean display luminance to [`START`];
//! * matched starts: the object's mean display luminance is the target's, by
//!   all lights alike or by one light alone, and the background's value is
//!   what brings the background nearest to its own target.

use rayon::prelude::*;

use super::{
    BasisRanges, Bond, Constraints, Followed, FreeKinds, Limits, MatchedStart, Owner, ParamVector, Range,
    SizeBounds, SurveyedScene, Tie, Variable, VariableKind, bounds,
    color::{Channel, Temperature},
    radiance::Radiance,
    size::Size,
};
use crate::{
    film::Picture, integrator::View, lighting::Lighting, math::Measure, scene::Scene, transport::Brought,
};

/// Display luminance at which what a light lights is taken to be white: a mean of 1 would need pixels
/// that all clip.
pub const BRIGHT: f64 = 0.9;
/// Mean display luminance at the neutral start: between the means that high-key and low-key ask for, so
/// that neither look begins far away. Set by reasoning.
pub const START: f64 = 0.35;
/// Distance of a matched start from every bound, in the optimiser's units: a search that begins on a
/// bound is slow to leave it; the farther from it, the less the start is matched.
pub const OFF_BOUND: f64 = 0.04;
/// Lower bound of the background's value: under its key light alone it gives the fruit basket a
/// background of mean .085 behind an object of mean .54, about as black as paper gets.
pub const MIN_VALUE: f32 = 0.05;
/// Upper bound of the albedo of a background material after the value is applied: above it light would
/// bounce so often that pictures are slow and noisy, and at 1 it would not decay at all.
pub const MAX_ALBEDO: f32 = 0.95;
/// Upper bound of the background's value: dark materials, which could otherwise become white, get two
/// stops brighter at most. Set by reasoning.
pub const MAX_VALUE: f32 = 4.0;

/// Size up to which a light is taken to touch a surface: for a lamp of half-extent 1 m a tenth of a
/// millimetre is left, which is no lamp any more.
const MIN_SIZE: f32 = 1e-4;

/// Halvings of the range 2⁻⁶⁰ to 2⁶⁰ of the exponent in which a gain is sought: 120/2²⁷ of a stop, a
/// relative error of 6·10⁻⁷ of the gain.
const BISECTIONS: u32 = 27;

/// The variables of a scene cannot be made.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum SurveyError {
    #[error("the scene has no lights; add [[lights]] to its sidecar, or a material that emits")]
    NoLights,
    #[error(
        "nothing is free: allow radiance, size, color, background or exposure with --free, or `free` in the sidecar"
    )]
    NothingFree,
    #[error("light `{light}` does not light the picture; move it or turn it")]
    LightsNothing { light: String },
    #[error("light `{light}` brings no light to the main object, so that `{other}` has no ratio to it")]
    BringsNothing { light: String, other: String },
    #[error("light `{light}`: `color` and `color_rgb` are free; give one of them")]
    TwoColours { light: String },
    #[error("light `{light}` is within {distance:.1e} m of a surface at any size; move it away")]
    NoRoom { light: String, distance: f32 },
}

/// A scene's lighting, brought within the bounds that its geometry and materials set.
#[derive(Clone, Debug)]
pub struct Fitted {
    /// The author's lighting with every size within its bounds, and the background's value at 1, or at its
    /// upper bound where that is smaller or the only value.
    pub lighting: Lighting,
    /// Least and largest size of each light; `None` for a light without size.
    pub sizes: Vec<SizeBounds>,
    /// Least and largest value of the background; `None` without background.
    pub value_range: Option<[f32; 2]>,
    /// Sentences about changes to the author's sizes, for the user.
    pub notes: Vec<String>,
}

impl Fitted {
    /// Brings the size of every light within the bounds that the geometry, the camera of the view and the
    /// scene's author set.
    ///
    /// # Errors
    /// When there are no lights, or a light touches a surface at any size.
    pub fn new(view: View, authored: &Lighting, constraints: &Constraints) -> Result<Self, SurveyError> {
        if view.scene.lights.is_empty() {
            return Err(SurveyError::NoLights);
        }
        Self::of_any(view, authored, constraints)
    }

    /// As [`Self::new`], also for a scene without lights, which lamps are to be added to.
    ///
    /// # Errors
    /// When a light touches a surface at any size.
    pub fn of_any(view: View, authored: &Lighting, constraints: &Constraints) -> Result<Self, SurveyError> {
        let scene = view.scene;
        let found: Vec<SizeBounds> =
            scene.lights.par_iter().map(|light| bounds::size_range(view, light)).collect();
        let value_range = value_range(scene, constraints.value_range);
        let value = value_range.map_or(1.0, |[least, largest]| match least < largest {
            true => 1.0_f32.min(largest),
            false => largest,
        });
        let mut fitted = Self {
            lighting: Lighting { value: f64::from(value), ..authored.clone() },
            sizes: Vec::new(),
            value_range,
            notes: Vec::new(),
        };
        for (i, found) in found.into_iter().enumerate() {
            let range = found.map(|found| fitted.fit_size(scene, i, found, constraints.lights[i].size_range));
            fitted.sizes.push(range.transpose()?);
        }
        Ok(fitted)
    }

    /// Brings the size of light `i` within the bounds [lo, hi] of the geometry and those that the author
    /// wants, and returns the bounds of both.
    fn fit_size(
        &mut self,
        scene: &Scene,
        i: usize,
        [lo, hi]: [f32; 2],
        wanted: Option<[f32; 2]>,
    ) -> Result<[f32; 2], SurveyError> {
        let name = &scene.lights[i].name;
        if hi.is_nan() || hi <= MIN_SIZE {
            let extent = scene.lights[i].resizable().map_or(1.0, |shape| shape.outline().extent());
            return Err(SurveyError::NoRoom { light: name.clone(), distance: hi * extent });
        }
        let before = self.lighting.size[i] as f32;
        let range = match wanted {
            // A lamp that is small on purpose may stay so.
            None => [lo.min(before), hi],
            Some([a, b]) if b <= hi => [a, b],
            Some([a, b]) => {
                self.notes.push(format!(
                    "light `{name}`: size {b} cuts geometry or covers the main object; at most {hi:.3}"
                ));
                [a.min(hi), hi]
            }
        };
        let size = before.clamp(range[0], range[1]);
        if size != before {
            self.notes.push(format!("light `{name}`: size {before} set to {size:.3}"));
        }
        self.lighting.size[i] = f64::from(size);
        Ok(range)
    }

    /// Bounds that geometry and materials set on the variables.
    fn limits(&self) -> Limits<'_> {
        Limits { sizes: &self.sizes, value: self.value_range }
    }

    /// Ranges that a transport basis must hold, so that every variable that is `free` in a run and for the
    /// scene's author may take all of its values.
    #[must_use]
    pub fn basis_ranges(&self, constraints: &Constraints, free: &FreeKinds) -> BasisRanges {
        let mut ranges =
            BasisRanges { sizes: vec![None; self.sizes.len()], largest_value: None, colors: false };
        for kind in VariableKind::all() {
            for light in
                owners(kind, self.sizes.len()).filter(|&light| is_free(kind, light, constraints, free))
            {
                kind.open(self.limits(), light, &mut ranges);
            }
        }
        ranges
    }

    /// Upper bound of the background's value; 1 without background.
    #[must_use]
    pub fn largest_value(&self) -> f32 {
        self.value_range.map_or(1.0, |[_, largest]| largest)
    }
}

/// Indices of the lights that may have a variable of a kind, of `n` of them; 0 where the scene has
/// it.
fn owners(kind: VariableKind, n: usize) -> std::ops::Range<usize> {
    match kind.owner() {
        Owner::Light => 0..n,
        Owner::Scene(_) => 0..1,
    }
}

/// Whether the variable of a kind that a light has, or the scene, is `free` in a run and in the
/// constraints of the scene's author.
fn is_free(kind: VariableKind, light: usize, constraints: &Constraints, free: &FreeKinds) -> bool {
    let keyword = kind.keyword();
    free.contains(keyword)
        && match kind.owner() {
            Owner::Light => constraints.lights[light].free.contains(keyword),
            Owner::Scene(_) => true,
        }
}

/// Bounds of the background's value: those that are `wanted`, else by the formulas of this module;
/// `None` without background.
fn value_range(scene: &Scene, wanted: Option<[f32; 2]>) -> Option<[f32; 2]> {
    let brightest = scene.background_albedo();
    if brightest <= 0.0 {
        return None;
    }
    let cap = (1.0 / brightest).min(MAX_VALUE);
    Some(match wanted {
        Some([lo, hi]) => [lo.min(cap), hi.min(cap)],
        None => [MIN_VALUE, (MAX_ALBEDO / brightest).clamp(1.0, cap.max(1.0)).min(cap)],
    })
}

/// Gain at which the mean display luminance of the pixels of `planes`, see [`Measure::planes`], each weighted
/// by `weight` of its linear luminance, is `target`; by bisection in the exponent.
#[must_use]
pub fn gain_for(
    planes: &[f64],
    weight: impl Fn(f64) -> f64,
    target: f64,
    exposure: f64,
    measure: Measure,
) -> f64 {
    let n = planes.len() / measure.n_planes();
    let measure = measure.of_luminance();
    let planes = &planes[..n * measure.n_planes()];
    let weights: Vec<f64> = planes[..n].iter().map(|&y| weight(y)).collect();
    let total: f64 = weights.iter().sum();
    let (mut shown, mut slopes) = (vec![0.0; n], vec![0.0; planes.len()]);
    let mut display = |gain: f64| {
        measure.encode_all(planes, exposure * gain, &mut shown, &mut slopes);
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

/// Brightness of the picture of each light alone, from which bounds and starts follow.
#[derive(Clone, Debug)]
pub struct Survey<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Lighting of the scene within its bounds.
    pub fitted: &'a Fitted,
    /// Constraints that the scene's author sets.
    pub constraints: &'a Constraints,
    /// Kinds of variables that are free in the run.
    pub free: &'a FreeKinds,
    /// Measure of luminance.
    pub measure: Measure,
    /// Planes of the picture of each light alone at radiance 1.
    images: Vec<Vec<f64>>,
    /// Mean linear luminance of the picture of each light alone at radiance 1.
    pub means: Vec<f64>,
    /// The same over the main object.
    brought: Vec<f64>,
    /// What each light brings to the main object by its size; `None` where that is not known, and the sizes of lights in
    /// a ratio are not free.
    by_size: Option<Vec<Brought>>,
    /// Radiance of each light at which it alone shows what it lights at [`BRIGHT`].
    pub bright: Vec<f64>,
    /// Mean linear luminance that every light contributes at the neutral start.
    gain: f64,
}

impl<'a> Survey<'a> {
    /// Survey of the picture `unit`, a render with every light at radiance 1 and its fitted size, whose main
    /// object is in the mask.
    #[must_use]
    pub fn new(
        scene: &'a Scene,
        fitted: &'a Fitted,
        constraints: &'a Constraints,
        free: &'a FreeKinds,
        measure: Measure,
        (unit, mask): (&Picture, &[bool]),
    ) -> Self {
        let exposure = fitted.lighting.exposure;
        let images: Vec<Vec<f64>> = unit.lights.iter().map(|light| measure.planes(light)).collect();
        let n = unit.rgb.len();
        let means: Vec<f64> = images.iter().map(|y| y[..n].iter().sum::<f64>() / n as f64).collect();
        let n_object = mask.iter().filter(|&&m| m).count().max(1) as f64;
        let on_object = |y: &Vec<f64>| y.iter().zip(mask).filter(|(_, m)| **m).map(|(y, _)| y).sum::<f64>();
        let brought = images.iter().map(|y| on_object(y) / n_object).collect();
        let alike: Vec<f64> = (0..n * measure.n_planes())
            .map(|p| images.iter().zip(&means).filter(|(_, m)| **m > 0.0).map(|(y, m)| y[p] / m).sum())
            .collect();
        let gain = gain_for(&alike, |_| 1.0, START, exposure, measure);
        let bright = images.par_iter().map(|image| gain_for(image, |y| y, BRIGHT, exposure, measure));
        let bright = bright.collect();
        let by_size = None;
        Self { scene, fitted, constraints, free, measure, images, means, brought, by_size, bright, gain }
    }

    /// The same survey where it is known what each light brings to the main object by its size.
    #[must_use]
    pub fn with_brought(self, brought: Vec<Brought>) -> Self {
        Self { by_size: Some(brought), ..self }
    }

    /// Whether the size of a light must stay as it is, because a ratio to what it brings there is kept.
    fn keeps_size(&self, light: usize) -> bool {
        let in_ratio =
            |bond: &Bond| bond.of == Followed::Brought && (bond.light == light || bond.leader == light);
        self.by_size.is_none() && self.constraints.bonds.iter().any(in_ratio)
    }

    /// Results from which the ranges of the variables follow.
    fn surveyed(&self) -> SurveyedScene<'_> {
        SurveyedScene {
            limits: self.fitted.limits(),
            sizes: &self.fitted.lighting.size,
            units: self.scene.lights.iter().map(|light| light.unit()).collect(),
            radiance_max: self.constraints.lights.iter().map(|light| light.radiance_max).collect(),
            bright: &self.bright,
            neutral: self.means.iter().map(|mean| self.gain / mean).collect(),
            exposure: self.fitted.lighting.exposure,
            colors: (0..self.scene.lights.len()).map(|l| self.fitted.lighting.color_of(l)).collect(),
            temperature_range: self.constraints.lights.iter().map(|light| light.temperature_range).collect(),
        }
    }

    /// Variable of a kind that a light, or the scene, has; `None` if it is not free.
    fn variable(&self, scene: &SurveyedScene, kind: VariableKind, light: usize) -> Option<Variable> {
        if !is_free(kind, light, self.constraints, self.free) {
            return None;
        }
        if kind.keyword() == Size::KEYWORD && self.keeps_size(light) {
            return None;
        }
        // Where both bounds are the same nothing is free.
        let range = kind.range(scene, light).filter(|range| range.lower < range.upper)?;
        let Range { unit, lower, upper, initial, scale } = range;
        let group = self.constraints.groups.iter().find(|(_, leader)| *leader == light);
        let group = group.filter(|_| kind.keyword() == Radiance::KEYWORD).map(|(name, _)| name);
        let name = kind.variable_name(group.unwrap_or(&self.scene.lights[light].name));
        Some(Variable { name, unit, lower, upper, initial, scale, kind, light })
    }

    /// Free variables of the run.
    ///
    /// # Errors
    /// When a light of the sidecar, or every light, lights no pixel, or nothing is free.
    pub fn variables(&self) -> Result<ParamVector, SurveyError> {
        let Self { scene, means, constraints, .. } = self;
        // One that the scene file happens to have is left as it is, unless there is no other.
        let is_needed = |i: usize| !constraints.lights[i].is_from_file || means.iter().all(|&m| m <= 0.0);
        if let Some(i) = (0..means.len()).find(|&i| means[i] <= 0.0 && is_needed(i)) {
            return Err(SurveyError::LightsNothing { light: scene.lights[i].name.clone() });
        }
        let is_free = |kind: &str, l: usize| {
            VariableKind::named(kind).is_some_and(|kind| is_free(kind, l, constraints, self.free))
        };
        if let Some(l) =
            (0..means.len()).find(|&l| is_free(Temperature::KEYWORD, l) && is_free(Channel::KEYWORD, l))
        {
            return Err(SurveyError::TwoColours { light: scene.lights[l].name.clone() });
        }
        let surveyed = self.surveyed();
        let mut variables = Vec::new();
        for light in (0..means.len()).filter(|&l| means[l] > 0.0) {
            let of_light = VariableKind::all().filter(|kind| kind.owner() == Owner::Light);
            variables.extend(of_light.filter_map(|kind| self.variable(&surveyed, kind, light)));
        }
        let of_scene = VariableKind::all().filter(|kind| kind.owner() != Owner::Light);
        variables.extend(of_scene.filter_map(|kind| self.variable(&surveyed, kind, 0)));
        if variables.is_empty() {
            return Err(SurveyError::NothingFree);
        }
        Ok(ParamVector { variables, ties: self.ties()? })
    }

    /// Ties of the radiances of lights that follow others: where they follow what a light brings to the main
    /// object, by what each brings at radiance 1.
    fn ties(&self) -> Result<Vec<Tie>, SurveyError> {
        let name = |light: usize| self.scene.lights[light].name.clone();
        let brought = |light: usize, other: usize| match self.brought[light] {
            mean if mean > 0.0 => Ok(mean),
            _ => Err(SurveyError::BringsNothing { light: name(light), other: name(other) }),
        };
        let tie = |bond: &Bond| {
            let Bond { light, leader, factor, .. } = *bond;
            Ok(match bond.of {
                Followed::Radiance => Tie { light, leader, factor, brought: None },
                Followed::Brought => {
                    let [of_leader, of_light] = [brought(leader, light)?, brought(light, leader)?];
                    match &self.by_size {
                        Some(by_size) => {
                            let by_size = [leader, light].map(|l| by_size[l].clone());
                            Tie { light, leader, factor, brought: Some(Box::new(by_size)) }
                        }
                        None => Tie { light, leader, factor: factor * of_leader / of_light, brought: None },
                    }
                }
            })
        };
        self.constraints.bonds.iter().map(tie).collect()
    }

    /// Starts of a search, as points of the unit cube with their names: the neutral start first, then
    /// those matched to a target.
    ///
    /// * `mask`: main object, over the pixels of the render surveyed
    /// * `targets`: mean display luminance wanted of the object and of the background
    #[must_use]
    pub fn starts(
        &self,
        mask: &[bool],
        variables: &ParamVector,
        targets: [f64; 2],
    ) -> Vec<(String, Vec<f64>)> {
        let lights: Vec<usize> = (0..self.images.len()).filter(|&l| self.means[l] > 0.0).collect();
        let alone = lights.iter().map(|&l| (format!("`{}` alone", self.scene.lights[l].name), vec![l]));
        let matched: Vec<(String, Vec<usize>)> =
            std::iter::once(("all lights alike, matched".to_owned(), lights.clone())).chain(alone).collect();
        let first = ("all lights alike".to_owned(), variables.start());
        let matched = matched.into_par_iter().map(|(name, lit)| {
            let start = self.matched(&lit, mask, targets);
            let at = |v: &Variable| v.encode(v.matched_start(&start)).clamp(OFF_BOUND, 1.0 - OFF_BOUND);
            (name, variables.variables.iter().map(at).collect())
        });
        std::iter::once(first).chain(matched.collect::<Vec<_>>()).collect()
    }

    /// Start at which the lights `lit`, contributing alike, give the object of `mask` its target mean.
    fn matched<'l>(
        &self,
        lit: &'l [usize],
        mask: &[bool],
        [t_object, t_background]: [f64; 2],
    ) -> MatchedStart<'l> {
        let total: Vec<f64> = (0..mask.len() * self.measure.n_planes())
            .map(|p| lit.iter().map(|&l| self.images[l][p] / self.means[l]).sum())
            .collect();
        let of = |main: bool| -> Vec<f64> {
            total.iter().zip(mask.iter().cycle()).filter(|(_, m)| **m == main).map(|(y, _)| *y).collect()
        };
        let gain_to = |image: &[f64], target| {
            gain_for(image, |_| 1.0, target, self.fitted.lighting.exposure, self.measure)
        };
        let gain = gain_to(&of(true), t_object);
        // The background's luminance is about proportional to its value.
        let value = gain_to(&of(false), t_background) / gain;
        MatchedStart { lit, radiance: self.means.iter().map(|m| gain / m).collect(), value }
    }
}
