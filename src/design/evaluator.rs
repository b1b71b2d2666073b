//! f_q of a lighting from the basis, freed of noise bias, with its exact gradient.

use rayon::prelude::*;

use crate::{
    math::display::LuminanceMode,
    objective::{
        JackknifeEstimate, Jackknifed, N_SCALARS, Objective, ObjectiveError, Replicates, Residuals,
        Smoothing, Statistics,
    },
    optim::Moduli,
    params::{ParamVector, VariableKind},
    transport::{LightingGradient, LightingPoint, Recombination, Tangents, TransportBasis},
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
    pub fixed: &'a LightingPoint,
    /// Measure of luminance.
    pub luminance: LuminanceMode,
    /// Factor on luminance.
    pub exposure: f64,
}

/// Images of an evaluation, reused from one to the next.
#[derive(Debug, Default)]
pub struct Scratch {
    /// Linear luminance by replicate, later its adjoint.
    replicates: Vec<Vec<f64>>,
    mean: Vec<f64>,
    /// Mean with a replicate left out.
    linear: Vec<f64>,
    /// Display luminance and its slope: of the mean, and with each replicate left out.
    display: Vec<Vec<f64>>,
    slopes: Vec<Vec<f64>>,
    adjoint: Vec<f64>,
    adjoints: Vec<Vec<f64>>,
    /// Derivatives of the replicates.
    tangents: Vec<Tangents>,
}

impl Evaluator<'_> {
    /// The lighting of values `x`.
    #[must_use]
    pub fn lighting(&self, x: &[f64]) -> LightingPoint {
        self.variables.lighting(self.fixed.clone(), x)
    }

    /// Images of the replicates, encoded for the display: the mean and the means
    /// that leave one out; with their derivatives if wanted.
    fn images(&self, x: &LightingPoint, differentiate: bool, scratch: &mut Scratch) {
        let n = self.halves.layout().n_pixels();
        let count = self.halves.n_replicates();
        for images in [&mut scratch.replicates, &mut scratch.adjoints] {
            images.resize_with(count, Vec::new);
            images.iter_mut().for_each(|i| i.resize(n, 0.0));
        }
        for images in [&mut scratch.display, &mut scratch.slopes] {
            images.resize_with(count + 1, Vec::new);
            images.iter_mut().for_each(|i| i.resize(n, 0.0));
        }
        scratch.mean.clear();
        scratch.mean.resize(n, 0.0);
        scratch.linear.resize(n, 0.0);
        scratch.adjoint.resize(n, 0.0);
        scratch.tangents.resize_with(count, Tangents::default);
        let Scratch { replicates, mean, linear, display, slopes, tangents, .. } = scratch;
        let share = 1.0 / count as f64;
        let r = Recombination::new(self.halves.layout(), x);
        for (i, (y, tangents)) in replicates.iter_mut().zip(tangents).enumerate() {
            if differentiate {
                self.halves.differentiate(i, &r, y, tangents);
            } else {
                self.halves.luminance(i, &r, y);
            }
            for (m, y) in mean.iter_mut().zip(&*y) {
                *m += share * y;
            }
        }
        let encode = |y: &[f64], l: &mut [f64], slope: &mut [f64]| {
            self.luminance.encode_all(y, self.exposure, l, slope);
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
        scratch: &mut Scratch,
    ) -> Result<f64, ObjectiveError> {
        let z = self.measure(u, smoothing, gradient.is_some(), scratch)?;
        let (evaluation, dz) = self.objective.terms_with_gradient(&z.corrected, smoothing);
        if let Some(gradient) = gradient {
            self.pull_back(u, &z, &dz, smoothing, scratch, gradient)?;
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
        scratch: &mut Scratch,
    ) -> Result<(), ObjectiveError> {
        let z = self.measure(u, smoothing, true, scratch)?;
        let Residuals { scalars, hist } = self.objective.residuals(&z.corrected, smoothing);
        out.rest = hist.value;
        self.pull_back(u, &z, &hist.by_statistics, smoothing, scratch, &mut out.rest_gradient)?;
        for (i, residual) in scalars.iter().enumerate() {
            out.residuals[i] = residual.value;
            self.pull_back(u, &z, &residual.by_statistics, smoothing, scratch, out.gradient_of(i))?;
        }
        Ok(())
    }

    fn measure(
        &self,
        u: &[f64],
        smoothing: &Smoothing,
        differentiate: bool,
        scratch: &mut Scratch,
    ) -> Result<Jackknifed, ObjectiveError> {
        let x = self.variables.decode(u);
        self.images(&self.lighting(&x), differentiate, scratch);
        let one_out: Vec<&[f64]> = scratch.display[1..].iter().map(Vec::as_slice).collect();
        self.objective.jackknifed(&scratch.display[0], &one_out, smoothing.ramp)
    }

    /// Carries a gradient `dz` in the statistics `z` of the images in `scratch` back to the
    /// variables.
    fn pull_back(
        &self,
        u: &[f64],
        z: &Jackknifed,
        dz: &Statistics,
        smoothing: &Smoothing,
        scratch: &mut Scratch,
        gradient: &mut [f64],
    ) -> Result<(), ObjectiveError> {
        let Scratch { display, slopes, adjoint: common, adjoints, tangents, .. } = scratch;
        let one_out: Vec<&[f64]> = display[1..].iter().map(Vec::as_slice).collect();
        let out = (common.as_mut_slice(), adjoints.as_mut_slice());
        self.objective.adjoints((&display[0], &one_out), z, dz, smoothing.ramp, out)?;
        // Back from the display to each replicate: it is part of the mean, and of
        // every mean that leaves out another.
        let count = self.halves.n_replicates() as f64;
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
        let mut by_lighting = LightingGradient::zero(self.halves.layout().lights.len());
        for (tangents, adjoint) in tangents.iter().zip(&*adjoints) {
            tangents.pull_back(adjoint, &mut by_lighting);
        }
        for ((v, &u), g) in self.variables.variables.iter().zip(u).zip(gradient) {
            let slope = match v.kind {
                VariableKind::Radiance(l) => by_lighting.radiance[l],
                VariableKind::Size(l) => by_lighting.size[l],
                VariableKind::Background => by_lighting.value,
            };
            *g = slope * v.slope(u);
        }
        Ok(())
    }

    /// f_q at `u`, unsmoothed, freed of noise bias, with its error from as many
    /// labellings of the replicates.
    ///
    /// # Errors
    /// With fewer than two replicates.
    pub fn estimate(&self, u: &[f64], labellings: usize) -> Result<JackknifeEstimate, ObjectiveError> {
        Ok(self.estimate_each(&[u], labellings)?.remove(0))
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
        let parts = points.par_chunks(TOGETHER).map(|part| self.estimate_each(part, labellings));
        Ok(parts.collect::<Result<Vec<_>, _>>()?.into_iter().flatten().collect())
    }

    fn estimate_each(
        &self,
        points: &[&[f64]],
        labellings: usize,
    ) -> Result<Vec<JackknifeEstimate>, ObjectiveError> {
        self.linear(points).iter().map(|of| self.replicates(of).measure(self.objective, labellings)).collect()
    }

    /// Linear luminance of all replicates at each of some points.
    fn linear(&self, points: &[&[f64]]) -> Vec<Vec<Vec<f64>>> {
        let lighting = |u: &&[f64]| self.lighting(&self.variables.decode(u));
        let lightings: Vec<Recombination> =
            points.iter().map(|u| Recombination::new(self.basis.layout(), &lighting(u))).collect();
        let lightings: Vec<&Recombination> = lightings.iter().collect();
        let (n, n_replicates) = (self.basis.layout().n_pixels(), self.basis.n_replicates());
        let mut images = vec![vec![vec![0.0; n]; n_replicates]; points.len()];
        for i in 0..n_replicates {
            let mut out: Vec<&mut [f64]> = images.iter_mut().map(|of| of[i].as_mut_slice()).collect();
            self.basis.luminances(i, &lightings, &mut out);
        }
        images
    }

    fn replicates<'l>(&self, linear: &'l [Vec<f64>]) -> Replicates<'l> {
        Replicates { linear, luminance: self.luminance, exposure: self.exposure }
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
        scratch: &mut Scratch,
    ) -> Result<[f64; N_SCALARS], ObjectiveError> {
        if self.basis.n_replicates() < 3 {
            return Ok([0.0; N_SCALARS]);
        }
        let told = self.measure(u, smoothing, false, scratch)?.corrected;
        let linear = self.linear(&[u]).remove(0);
        let known = self.replicates(&linear).second_order(self.objective, smoothing.ramp);
        let [known, told] = [known, told].map(|z| self.objective.residuals(&z, smoothing).scalars);
        Ok(std::array::from_fn(|i| known[i].value - told[i].value))
    }
}
