//! f_q of a lighting from the basis, freed of noise bias, with its exact gradient.

use std::collections::BTreeMap;

use rayon::prelude::*;

use crate::{
    lighting::Lighting,
    math::display::LuminanceMode,
    objective::{
        JackknifeEstimate, Jackknifed, Objective, ObjectiveError, Replicates, Residuals, Smoothing,
        Statistics,
    },
    optim::Moduli,
    transport::{LightingGradient, Linearised, Recombination, Tables, Tangents, TransportBasis},
    variables::ParamVector,
};

/// Points whose pictures are recombined at a time: their images stay in the caches.
const TOGETHER: usize = 4;

/// f_q as a function of the variables.
#[derive(Clone, Copy, Debug)]
pub struct Evaluator<'a> {
    /// Light transport.
    pub basis: &'a TransportBasis,
    /// The same in fewer replicates, see [`TransportBasis::halves`]: what descends needs no
    /// error.
    pub halves: &'a TransportBasis,
    /// What is asked of the picture.
    pub objective: &'a Objective,
    /// What varies.
    pub variables: &'a ParamVector,
    /// The lighting where nothing varies.
    pub fixed: &'a Lighting,
    /// Measure of luminance.
    pub luminance: LuminanceMode,
    /// Least size per light within which enough samples lie, see [`Self::lower_bounds`]; empty where
    /// any size may be asked for.
    pub least_sizes: &'a [f64],
}

/// Images of an evaluation, reused from one to the next.
#[derive(Debug, Default)]
pub struct Scratch<'a> {
    near: Near<'a>,
    /// Linear luminance by replicate, later its adjoint.
    replicates: Vec<Vec<f64>>,
    mean: Vec<f64>,
    /// Mean with a replicate left out.
    linear: Vec<f64>,
    /// Display luminance and its slope: of the mean, and with each replicate left out.
    display: Vec<Vec<f64>>,
    slopes: Vec<Vec<f64>>,
    adjoint: Vec<f64>,
    /// By what is differentiated, then by replicate.
    adjoints: Vec<Vec<Vec<f64>>>,
    /// Derivatives of the replicates.
    tangents: Vec<Tangents>,
}

impl Scratch<'_> {
    /// Of evaluations that follow each other, of which many may have the same value of the
    /// background. Which they are must not be left to chance: what is found depends on them by
    /// rounding.
    #[must_use]
    pub fn of_descent() -> Self {
        Self { near: Near { follows: true, ..Near::default() }, ..Self::default() }
    }
}

/// What serves evaluations of the same value of the background.
#[derive(Debug, Default)]
struct Near<'a> {
    /// Whether there will be such.
    follows: bool,
    /// The last value.
    last: Option<f64>,
    linearised: Option<Linearised<'a>>,
}

impl<'a> Near<'a> {
    /// The tables for `x`: `whole`, or what that is around a value that was there before.
    fn tables(&mut self, whole: &'a TransportBasis, x: &Lighting) -> &dyn Tables {
        let again = self.last.replace(x.value) == Some(x.value);
        if !again || !self.follows || whole.layout().nodes.len() <= 2 {
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
    /// The lighting of values `x`.
    #[must_use]
    pub fn lighting(&self, x: &[f64]) -> Lighting {
        self.variables.lighting(self.fixed.clone(), x)
    }

    /// Lower bound per variable, in the unit cube, below which too few samples fall inside the light
    /// for a reliable estimate: most pixels then know nothing of it, and no comparison of replicates
    /// reveals that.
    #[must_use]
    pub fn lower_bounds(&self) -> Vec<f64> {
        let variables = self.variables.variables.iter();
        variables.map(|v| v.encode(v.least_sampled(self.least_sizes))).collect()
    }

    /// Images of the replicates, encoded for the display: the mean and the means
    /// that leave one out; with their derivatives if wanted.
    fn images(&self, x: &Lighting, differentiate: bool, scratch: &mut Scratch<'a>) {
        let n = self.halves.layout().n_pixels();
        let count = self.halves.n_replicates();
        scratch.replicates.resize_with(count, Vec::new);
        scratch.replicates.iter_mut().for_each(|i| i.resize(n, 0.0));
        for images in [&mut scratch.display, &mut scratch.slopes] {
            images.resize_with(count + 1, Vec::new);
            images.iter_mut().for_each(|i| i.resize(n, 0.0));
        }
        scratch.mean.clear();
        scratch.mean.resize(n, 0.0);
        scratch.linear.resize(n, 0.0);
        scratch.adjoint.resize(n, 0.0);
        scratch.tangents.resize_with(count, Tangents::default);
        let Scratch { near, replicates, mean, linear, display, slopes, tangents, .. } = scratch;
        let share = 1.0 / count as f64;
        let tables = near.tables(self.halves, x);
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
            self.luminance.encode_all(y, x.exposure, l, slope);
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

    /// Smoothed f_q at `u` in the unit cube, freed of noise bias; `gradient`, if
    /// given, receives its derivatives.
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
        let z = self.measure(u, smoothing, gradient.is_some(), scratch)?;
        let (evaluation, dz) = self.objective.terms_with_gradient(&z.corrected, smoothing);
        if let Some(gradient) = gradient {
            self.pull_back(u, &z, &[dz], smoothing, scratch, [gradient].into_iter())?;
        }
        Ok(evaluation.f_q)
    }

    /// As [`Self::evaluate`], but the terms before their moduli are taken, into `out`.
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

    fn measure(
        &self,
        u: &[f64],
        smoothing: &Smoothing,
        differentiate: bool,
        scratch: &mut Scratch<'a>,
    ) -> Result<Jackknifed, ObjectiveError> {
        let x = self.variables.decode(u);
        self.images(&self.lighting(&x), differentiate, scratch);
        let one_out: Vec<&[f64]> = scratch.display[1..].iter().map(Vec::as_slice).collect();
        self.objective.jackknifed(&scratch.display[0], &one_out, smoothing.ramp)
    }

    /// Carries gradients `dz` in the statistics `z` of the images in `scratch` back to the
    /// variables.
    fn pull_back<'g>(
        &self,
        u: &[f64],
        z: &Jackknifed,
        dz: &[Statistics],
        smoothing: &Smoothing,
        scratch: &mut Scratch<'a>,
        gradients: impl Iterator<Item = &'g mut [f64]>,
    ) -> Result<(), ObjectiveError> {
        let Scratch { display, slopes, adjoint: common, adjoints, tangents, .. } = scratch;
        let one_out: Vec<&[f64]> = display[1..].iter().map(Vec::as_slice).collect();
        let layout = self.halves.layout();
        adjoints.resize_with(dz.len().max(adjoints.len()), Vec::new);
        for (dz, adjoints) in dz.iter().zip(&mut *adjoints) {
            adjoints.resize_with(one_out.len(), Vec::new);
            adjoints.iter_mut().for_each(|image| image.resize(layout.n_pixels(), 0.0));
            let out = (common.as_mut_slice(), adjoints.as_mut_slice());
            self.objective.adjoints((&display[0], &one_out), z, dz, smoothing.ramp, out)?;
            // Back from the display to each replicate: it is part of the mean, and of
            // every mean that leaves out another.
            let count = one_out.len() as f64;
            let rest = 1.0 / (count - 1.0);
            common.iter_mut().zip(&slopes[0]).for_each(|(a, s)| *a *= s / count);
            for (adjoint, slopes) in adjoints.iter_mut().zip(&slopes[1..]) {
                for ((a, s), all) in adjoint.iter_mut().zip(slopes).zip(common.iter_mut()) {
                    *a *= s * rest;
                    *all += *a;
                }
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
        for (by_lighting, gradient) in by_lighting.iter().zip(gradients) {
            self.variables.pull_back(u, by_lighting, gradient);
        }
        Ok(())
    }

    /// f_q at `u`, unsmoothed, freed of noise bias, with its error from as many
    /// labellings of the replicates.
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
            let images = linear(tables, &of);
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

    fn replicates<'l>(&self, linear: &'l [Vec<f64>], x: &Lighting) -> Replicates<'l> {
        Replicates { linear, luminance: self.luminance, exposure: x.exposure }
    }

    /// By how much [`Self::residuals`] at `u` are less than all replicates tell to the second order
    /// of the jackknife: what the halves leave of the noise's bias, and a little of its chance.
    ///
    /// # Errors
    /// With fewer than two replicates.
    pub fn defects(
        &self,
        u: &[f64],
        smoothing: &Smoothing,
        scratch: &mut Scratch<'a>,
    ) -> Result<Vec<f64>, ObjectiveError> {
        if self.basis.n_replicates() < 3 {
            return Ok(vec![0.0; self.objective.scalars().count()]);
        }
        let told = self.measure(u, smoothing, false, scratch)?.corrected;
        let x = self.lighting(&self.variables.decode(u));
        let linear = linear(self.basis, &[&x]).remove(0);
        let known = self.replicates(&linear, &x).second_order(self.objective, smoothing.ramp);
        let [known, told] = [known, told].map(|z| self.objective.residuals(&z, smoothing).scalars);
        let pairs = known.iter().flatten().zip(told.iter().flatten());
        Ok(pairs.map(|(known, told)| known.value - told.value).collect())
    }
}

/// Linear luminance of all replicates of each of some lightings.
fn linear(tables: &dyn Tables, lightings: &[&Lighting]) -> Vec<Vec<Vec<f64>>> {
    let of: Vec<Recombination> = lightings.iter().map(|x| Recombination::new(tables.layout(), x)).collect();
    let of: Vec<&Recombination> = of.iter().collect();
    let (n, n_replicates) = (tables.layout().n_pixels(), tables.n_replicates());
    let mut images = vec![vec![vec![0.0; n]; n_replicates]; lightings.len()];
    for i in 0..n_replicates {
        let mut out: Vec<&mut [f64]> = images.iter_mut().map(|of| of[i].as_mut_slice()).collect();
        tables.luminances(i, &of, &mut out);
    }
    images
}
