//! f_q of a lighting from the basis, corrected for noise bias, with its exact gradient.

use std::collections::BTreeMap;

use rayon::prelude::*;

use crate::{
    lighting::Lighting,
    math::Measure,
    objective::{
        JackknifeEstimate, Jackknifed, Objective, ObjectiveError, Replicates, Residuals, Smoothing,
        Statistics,
    },
    optim::Moduli,
    transport::{LightingGradient, Linearised, Recombination, Tables, Tangents, TransportBasis},
    variables::ParamVector,
};

/// Number of pictures that are recombined together, so that a row of the tables is read from memory once
/// for all of them; more would not fit into the caches. With four, the record of a run is made in two
/// thirds of the time.
const TOGETHER: usize = 4;

/// f_q as a function of the variables, evaluated on a basis.
#[derive(Clone, Copy, Debug)]
pub struct Evaluator<'a> {
    /// Basis with all replicates, for estimates with their errors.
    pub basis: &'a TransportBasis,
    /// The same samples in two replicates, see [`TransportBasis::halves`], for descents, which need no
    /// errors.
    pub halves: &'a TransportBasis,
    /// Objective of the pictures.
    pub objective: &'a Objective,
    /// Free variables.
    pub variables: &'a ParamVector,
    /// Lighting of everything that does not vary.
    pub fixed: &'a Lighting,
    /// Measure of luminance, for which the bases have the planes.
    pub measure: Measure,
    /// Least size of each light within which enough samples fall, see [`Self::lower_bounds`]; empty where
    /// every size has enough.
    pub least_sizes: &'a [f64],
}

/// Images of an evaluation; their memory is reused from one evaluation to the next.
#[derive(Debug, Default)]
pub struct Scratch<'a> {
    /// Tables for the background's value of the last evaluations.
    value: ValueCache<'a>,
    /// Planes of each replicate.
    replicates: Vec<Vec<f64>>,
    /// Mean of the replicates.
    mean: Vec<f64>,
    /// Mean of all replicates but one.
    linear: Vec<f64>,
    /// Display luminance: of the mean, then of the mean without each replicate.
    display: Vec<Vec<f64>>,
    /// Derivatives of display luminance by each plane, in the same order.
    slopes: Vec<Vec<f64>>,
    /// Adjoint image of the mean.
    adjoint: Vec<f64>,
    /// Adjoint images, as `[function differentiated][replicate]`.
    adjoints: Vec<Vec<Vec<f64>>>,
    /// Derivatives of the planes of each replicate.
    tangents: Vec<Tangents>,
}

impl Scratch<'_> {
    /// Images of the evaluations of one descent, many of which may have the same value of the background
    /// and then share work. Which evaluations use the same images must not depend on threads: results
    /// depend on it by rounding.
    #[must_use]
    pub fn of_descent() -> Self {
        Self { value: ValueCache { is_descent: true, ..ValueCache::default() }, ..Self::default() }
    }
}

/// Tables for evaluations that share a value of the background.
#[derive(Debug, Default)]
struct ValueCache<'a> {
    /// Whether the evaluations are those of one descent.
    is_descent: bool,
    /// Value of the background in the last evaluation.
    last: Option<f64>,
    /// Basis linearised around a value that occurred twice in succession.
    linearised: Option<Linearised<'a>>,
}

impl<'a> ValueCache<'a> {
    /// Tables for the lighting `x`: those of `whole`, or those linearised around its value if that occurred
    /// before.
    fn tables(&mut self, whole: &'a TransportBasis, x: &Lighting) -> &dyn Tables {
        let again = self.last.replace(x.value) == Some(x.value);
        if !again || !self.is_descent || whole.layout().nodes.len() <= 2 {
            return whole;
        }
        if self.linearised.as_ref().is_none_or(|near| near.value() != x.value) {
            self.linearised = None;
        }
        let near = self.linearised.get_or_insert_with(|| Linearised::new(whole, x.value));
        near.prepare(x);
        near
    }
}

impl<'a> Evaluator<'a> {
    /// Lighting with the variables at the values `x`.
    #[must_use]
    pub fn lighting(&self, x: &[f64]) -> Lighting {
        self.variables.lighting(self.fixed.clone(), x)
    }

    /// Lower bound of each variable, in the unit cube, below which too few samples fall inside the light for
    /// a reliable estimate: most pixels then have no sample of it, and no comparison of replicates reveals
    /// that.
    #[must_use]
    pub fn lower_bounds(&self) -> Vec<f64> {
        let variables = self.variables.variables.iter();
        variables.map(|v| v.encode(v.least_sampled(self.least_sizes))).collect()
    }

    /// Makes the images of the lighting `x` in `scratch`: display luminance of the mean of the replicates
    /// and of the means without each of them, with their derivatives if wanted.
    fn images(&self, x: &Lighting, differentiate: bool, scratch: &mut Scratch<'a>) {
        let n = self.halves.layout().n_pixels();
        let n_linear = n * self.measure.n_planes();
        let count = self.halves.n_replicates();
        scratch.replicates.resize_with(count, Vec::new);
        scratch.replicates.iter_mut().for_each(|i| i.resize(n_linear, 0.0));
        let n_shown = self.measure.n_shown();
        for (images, n) in [(&mut scratch.display, n * n_shown), (&mut scratch.slopes, n_linear * n_shown)] {
            images.resize_with(count + 1, Vec::new);
            images.iter_mut().for_each(|i| i.resize(n, 0.0));
        }
        scratch.mean.clear();
        scratch.mean.resize(n_linear, 0.0);
        scratch.linear.resize(n_linear, 0.0);
        scratch.tangents.resize_with(count, Tangents::default);
        let Scratch { value, replicates, mean, linear, display, slopes, tangents, .. } = scratch;
        let share = 1.0 / count as f64;
        let tables = value.tables(self.halves, x);
        let r = Recombination::new(tables.layout(), x);
        for (i, (y, tangents)) in replicates.iter_mut().zip(tangents).enumerate() {
            if differentiate {
                tables.differentiate(i, &r, y, tangents);
            } else {
                tables.luminance(i, &r, y);
            }
            for (m, y) in mean.iter_mut().zip(&*y) {
                *m += share * y;
            }
        }
        let encode = |y: &[f64], l: &mut [f64], slope: &mut [f64]| {
            self.measure.encode_all(y, x.exposure, l, slope);
        };
        encode(mean, &mut display[0], &mut slopes[0]);
        let (rest, all) = (1.0 / (count as f64 - 1.0), count as f64);
        for (i, y) in replicates.iter().enumerate() {
            for ((left, &m), &y) in linear.iter_mut().zip(&*mean).zip(y) {
                *left = (all * m - y) * rest;
            }
            encode(linear, &mut display[i + 1], &mut slopes[i + 1]);
        }
    }

    /// Smoothed f_q at the point `u` of the unit cube, corrected for noise bias; its gradient by `u` is
    /// written to `gradient`, if given.
    ///
    /// # Errors
    /// With fewer than two replicates.
    pub fn evaluate(
        &self,
        u: &[f64],
        smoothing: &Smoothing,
        gradient: Option<&mut [f64]>,
        scratch: &mut Scratch<'a>,
    ) -> Result<f64, ObjectiveError> {
        self.prepare(u, gradient.is_some(), scratch);
        self.evaluate_prepared(u, smoothing, gradient, scratch)
    }

    /// Makes the images at the point `u` of the unit cube, for [`Self::evaluate_prepared`] by any objective.
    pub fn prepare(&self, u: &[f64], differentiate: bool, scratch: &mut Scratch<'a>) {
        self.images(&self.lighting(&self.variables.decode(u)), differentiate, scratch);
    }

    /// As [`Self::evaluate`], with the images in `scratch`, which are those of `u`.
    ///
    /// # Errors
    /// With fewer than two replicates.
    pub fn evaluate_prepared(
        &self,
        u: &[f64],
        smoothing: &Smoothing,
        gradient: Option<&mut [f64]>,
        scratch: &mut Scratch<'a>,
    ) -> Result<f64, ObjectiveError> {
        let z = self.jackknifed(smoothing, scratch)?;
        let (evaluation, dz) = self.objective.terms_with_gradient(&z.corrected, smoothing);
        if let Some(gradient) = gradient {
            self.pull_back(u, &z, &[dz], smoothing, scratch, [gradient].into_iter())?;
        }
        Ok(evaluation.f_q)
    }

    /// Writes the terms at the point `u` of the unit cube, before their moduli are taken, to `out`, with
    /// their gradients; they are corrected for noise bias.
    ///
    /// # Errors
    /// With fewer than two replicates.
    pub fn residuals(
        &self,
        u: &[f64],
        smoothing: &Smoothing,
        out: &mut Moduli,
        scratch: &mut Scratch<'a>,
    ) -> Result<(), ObjectiveError> {
        let z = self.measure(u, smoothing, true, scratch)?;
        let Residuals { scalars, distances } = self.objective.residuals(&z.corrected, smoothing);
        out.rest = distances.value;
        out.residuals = scalars.iter().flatten().map(|residual| residual.value).collect();
        let of_scalars = scalars.into_iter().flatten().map(|residual| residual.by_statistics);
        let dz: Vec<Statistics> = std::iter::once(distances.by_statistics).chain(of_scalars).collect();
        self.pull_back(u, &z, &dz, smoothing, scratch, out.gradients())
    }

    /// Statistics of the images at `u`, with those of their means without each replicate.
    fn measure(
        &self,
        u: &[f64],
        smoothing: &Smoothing,
        differentiate: bool,
        scratch: &mut Scratch<'a>,
    ) -> Result<Jackknifed, ObjectiveError> {
        self.prepare(u, differentiate, scratch);
        self.jackknifed(smoothing, scratch)
    }

    /// Statistics of the images in `scratch`.
    fn jackknifed(&self, smoothing: &Smoothing, scratch: &Scratch<'a>) -> Result<Jackknifed, ObjectiveError> {
        let one_out: Vec<&[f64]> = scratch.display[1..].iter().map(Vec::as_slice).collect();
        self.objective.jackknifed(&scratch.display[0], &one_out, smoothing.ramp)
    }

    /// Writes the gradient by `u` of each function to `gradients`, from its gradient `dz` by the statistics
    /// `z` of the images in `scratch`.
    fn pull_back<'g>(
        &self,
        u: &[f64],
        z: &Jackknifed,
        dz: &[Statistics],
        smoothing: &Smoothing,
        scratch: &mut Scratch<'a>,
        gradients: impl Iterator<Item = &'g mut [f64]>,
    ) -> Result<(), ObjectiveError> {
        let Scratch { replicates, display, slopes, adjoint: common, adjoints, tangents, .. } = scratch;
        let one_out: Vec<&[f64]> = display[1..].iter().map(Vec::as_slice).collect();
        let layout = self.halves.layout();
        adjoints.resize_with(dz.len().max(adjoints.len()), Vec::new);
        for (dz, adjoints) in dz.iter().zip(&mut *adjoints) {
            adjoints.resize_with(one_out.len(), Vec::new);
            for image in adjoints.iter_mut().chain([&mut *common]) {
                image.resize(layout.n_pixels() * self.measure.n_shown(), 0.0);
            }
            let out = (common.as_mut_slice(), adjoints.as_mut_slice());
            self.objective.adjoints((&display[0], &one_out), z, dz, smoothing.ramp, out)?;
            // Back from the display to each replicate: it is part of the mean, and of
            // every mean that leaves out another.
            let count = one_out.len() as f64;
            let rest = 1.0 / (count - 1.0);
            let (n, n_shown) = (layout.n_pixels(), self.measure.n_shown());
            to_planes(common, &slopes[0], (n, n_shown), |s| s / count);
            for (adjoint, slopes) in adjoints.iter_mut().zip(&slopes[1..]) {
                to_planes(adjoint, slopes, (n, n_shown), |s| s * rest);
                common.iter_mut().zip(adjoint).for_each(|(all, a)| *all += *a);
            }
            for adjoint in &mut *adjoints {
                adjoint.iter_mut().zip(&*common).for_each(|(a, all)| *a = all - *a);
            }
        }
        let mut by_lighting = vec![LightingGradient::zero(layout.lights.len()); dz.len()];
        for (replicate, tangents) in tangents.iter().enumerate() {
            let of_replicate: Vec<&[f64]> =
                adjoints[..dz.len()].iter().map(|of| of[replicate].as_slice()).collect();
            tangents.pull_back(&of_replicate, &mut by_lighting);
        }
        let x = self.lighting(&self.variables.decode(u));
        if self.variables.vary_exposure() {
            let exposure = x.exposure;
            for (by_lighting, adjoints) in by_lighting.iter_mut().zip(&*adjoints) {
                // Light enters as its product with the exposure.
                let dot = |(a, y): (&Vec<f64>, &Vec<f64>)| a.iter().zip(y).map(|(a, y)| a * y).sum::<f64>();
                by_lighting.exposure = adjoints.iter().zip(&*replicates).map(dot).sum::<f64>() / exposure;
            }
        }
        for (by_lighting, gradient) in by_lighting.iter().zip(gradients) {
            self.variables.pull_back(u, &x, by_lighting, gradient);
        }
        Ok(())
    }

    /// f_q at the point `u` of the unit cube, unsmoothed and corrected for noise bias, with its error from
    /// `labellings` relabellings of the replicates.
    ///
    /// # Errors
    /// With fewer than two replicates.
    pub fn estimate(&self, u: &[f64], labellings: usize) -> Result<JackknifeEstimate, ObjectiveError> {
        Ok(self.estimates(&[u], labellings)?.remove(0))
    }

    /// [`Self::estimate`] at many points, in parallel.
    ///
    /// # Errors
    /// With fewer than two replicates.
    pub fn estimates(
        &self,
        points: &[&[f64]],
        labellings: usize,
    ) -> Result<Vec<JackknifeEstimate>, ObjectiveError> {
        let lightings: Vec<Lighting> =
            points.iter().map(|u| self.lighting(&self.variables.decode(u))).collect();
        let mut by_value: BTreeMap<u64, Vec<usize>> = BTreeMap::new();
        for (i, x) in lightings.iter().enumerate() {
            by_value.entry(x.value.to_bits()).or_default().push(i);
        }
        let (alike, others): (Vec<_>, Vec<_>) = by_value.into_values().partition(|of| of.len() > TOGETHER);
        let others: Vec<usize> = others.concat();
        let linearised = alike.iter().map(|of| {
            let mut near = Linearised::new(self.basis, lightings[of[0]].value);
            of.iter().for_each(|&i| near.prepare(&lightings[i]));
            near
        });
        let linearised: Vec<Linearised> = linearised.collect();
        let tables = linearised.iter().map(|near| near as &dyn Tables).chain([self.basis as &dyn Tables]);
        let parts: Vec<(&dyn Tables, &[usize])> = tables
            .zip(alike.iter().chain([&others]))
            .flat_map(|(tables, of)| of.chunks(TOGETHER).map(move |part| (tables, part)))
            .collect();
        let measure = |&(tables, part): &(&dyn Tables, &[usize])| {
            let of: Vec<&Lighting> = part.iter().map(|&i| &lightings[i]).collect();
            let images = linear(tables, &of, self.measure.n_planes());
            let measured = images
                .iter()
                .zip(&of)
                .map(|(images, x)| self.replicates(images, x).measure(self.objective, labellings));
            part.iter().copied().zip(measured).map(|(i, e)| Ok((i, e?))).collect::<Result<Vec<_>, _>>()
        };
        let mut measured = parts.par_iter().map(measure).collect::<Result<Vec<_>, _>>()?.concat();
        measured.sort_by_key(|(i, _)| *i);
        Ok(measured.into_iter().map(|(_, e)| e).collect())
    }

    /// Replicates of a picture of the lighting `x`, from their planes.
    fn replicates<'l>(&self, linear: &'l [Vec<f64>], x: &Lighting) -> Replicates<'l> {
        Replicates { linear, measure: self.measure, exposure: x.exposure }
    }

    /// Corrections of [`Self::residuals`] at the point `u`: residuals of all replicates by the second-order
    /// jackknife minus those of the two halves by the first-order one. They remove what the halves leave of
    /// the bias by noise. Zero with fewer than three replicates.
    ///
    /// # Errors
    /// With fewer than two replicates.
    pub fn residual_corrections(
        &self,
        u: &[f64],
        smoothing: &Smoothing,
        scratch: &mut Scratch<'a>,
    ) -> Result<Vec<f64>, ObjectiveError> {
        if self.basis.n_replicates() < 3 {
            return Ok(vec![0.0; self.objective.scalars().count()]);
        }
        let halves = self.measure(u, smoothing, false, scratch)?.corrected;
        let x = self.lighting(&self.variables.decode(u));
        let linear = linear(self.basis, &[&x], self.measure.n_planes()).remove(0);
        let all = self.replicates(&linear, &x).second_order(self.objective, smoothing.ramp);
        let [all, halves] = [all, halves].map(|z| self.objective.residuals(&z, smoothing).scalars);
        let pairs = all.iter().flatten().zip(halves.iter().flatten());
        Ok(pairs.map(|(all, halves)| all.value - halves.value).collect())
    }
}

/// Carries an adjoint image of `n` pixels and `n_shown` planes back from the display to the planes of linear light:
/// each plane is the sum of those of the image times the `slopes` by that plane, as `factor` has them.
fn to_planes(
    adjoint: &mut Vec<f64>,
    slopes: &[f64],
    (n, n_shown): (usize, usize),
    factor: impl Fn(f64) -> f64,
) {
    let n_linear = slopes.len() / n_shown;
    if n_shown > 1 {
        let sum = |i: usize| -> f64 {
            (0..n_shown).map(|k| adjoint[k * n + i % n] * factor(slopes[k * n_linear + i])).sum()
        };
        *adjoint = (0..n_linear).map(sum).collect();
        return;
    }
    adjoint.resize(slopes.len(), 0.0);
    // The first plane last, which takes the place of the image.
    for (i, &slope) in slopes.iter().enumerate().rev() {
        adjoint[i] = adjoint[i % n] * factor(slope);
    }
}

/// Planes of some lightings, as `[lighting][replicate]`.
fn linear(tables: &dyn Tables, lightings: &[&Lighting], planes: usize) -> Vec<Vec<Vec<f64>>> {
    let of: Vec<Recombination> = lightings.iter().map(|x| Recombination::new(tables.layout(), x)).collect();
    let of: Vec<&Recombination> = of.iter().collect();
    let (n, n_replicates) = (planes * tables.layout().n_pixels(), tables.n_replicates());
    let mut images = vec![vec![vec![0.0; n]; n_replicates]; lightings.len()];
    for i in 0..n_replicates {
        let mut out: Vec<&mut [f64]> = images.iter_mut().map(|of| of[i].as_mut_slice()).collect();
        tables.luminances(i, &of, &mut out);
    }
    images
}
