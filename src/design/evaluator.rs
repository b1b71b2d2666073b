//! f_q of a lighting from the basis, freed of noise bias, with its exact gradient.

use crate::{
    math::display::LuminanceMode,
    objective::{JackknifeEstimate, Objective, ObjectiveError, Ramp, Smoothing},
    params::{ParamVector, VariableKind},
    transport::{LightingPoint, Recombination, TransportBasis},
};

/// f_q as a function of the variables.
#[derive(Clone, Copy, Debug)]
pub struct Evaluator<'a> {
    /// Light transport.
    pub basis: &'a TransportBasis,
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
}

impl Evaluator<'_> {
    /// The lighting of values `x`.
    #[must_use]
    pub fn lighting(&self, x: &[f64]) -> LightingPoint {
        self.variables.lighting(self.fixed.clone(), x)
    }

    /// Images of the replicates, encoded for the display: the mean and the means
    /// that leave one out.
    fn images(&self, r: &Recombination, scratch: &mut Scratch) {
        let n = self.basis.layout().n_pixels();
        let count = self.basis.n_replicates();
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
        let Scratch { replicates, mean, linear, display, slopes, .. } = scratch;
        let share = 1.0 / count as f64;
        for (i, y) in replicates.iter_mut().enumerate() {
            self.basis.luminance(i, r, y);
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
        let x = self.variables.decode(u);
        let recombination = Recombination::new(self.basis.layout(), &self.lighting(&x));
        self.images(&recombination, scratch);
        let one_out: Vec<&[f64]> = scratch.display[1..].iter().map(Vec::as_slice).collect();
        let Some(gradient) = gradient else {
            let f =
                self.objective.evaluate_jackknife_smooth(&scratch.display[0], &one_out, smoothing, None)?;
            return Ok(f.f_q);
        };
        let adjoints = Some((scratch.adjoint.as_mut_slice(), scratch.adjoints.as_mut_slice()));
        let f =
            self.objective.evaluate_jackknife_smooth(&scratch.display[0], &one_out, smoothing, adjoints)?;
        // Back from the display to each replicate: it is part of the mean, and of
        // every mean that leaves out another.
        let count = self.basis.n_replicates() as f64;
        for p in 0..scratch.mean.len() {
            let full = scratch.adjoint[p] * scratch.slopes[0][p] / count;
            let mut total = 0.0;
            for (a, s) in scratch.adjoints.iter_mut().zip(&scratch.slopes[1..]) {
                a[p] *= s[p];
                total += a[p];
            }
            for a in &mut scratch.adjoints {
                a[p] = full + (total - a[p]) / (count - 1.0);
            }
        }
        let by_lighting = self.basis.pull_back(&recombination, &scratch.adjoints);
        for ((v, &u), g) in self.variables.variables.iter().zip(u).zip(gradient) {
            let slope = match v.kind {
                VariableKind::Radiance(l) => by_lighting.radiance[l],
                VariableKind::Size(l) => by_lighting.size[l],
                VariableKind::Background => by_lighting.value,
            };
            *g = slope * v.slope(u);
        }
        Ok(f.f_q)
    }

    /// f_q at `u`, unsmoothed, freed of noise bias, with its error.
    ///
    /// # Errors
    /// With fewer than two replicates.
    pub fn estimate(&self, u: &[f64], scratch: &mut Scratch) -> Result<JackknifeEstimate, ObjectiveError> {
        let x = self.variables.decode(u);
        self.images(&Recombination::new(self.basis.layout(), &self.lighting(&x)), scratch);
        let mut statistics = scratch.display.iter().map(|l| self.objective.statistics(l, Ramp::Linear));
        let full = statistics.next().ok_or(ObjectiveError::TooFewReplicates { replicates: 0 })?;
        let one_out: Vec<_> = statistics.collect();
        self.objective.jackknife(&full, &one_out, &Smoothing::NONE)
    }
}
