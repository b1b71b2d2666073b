//! Lightings to choose from: nearly as good as the best one, and different to look at.
//!
//! The ends of the search, and of more descents from starts that it passed over, are measured on the whole
//! picture. Of those whose f_q is within [`WITHIN`] of the best, the one that differs most from all that are
//! taken already is taken next, until none differs by [`DIFFERENT`] any more. Those are rendered together, for
//! their small pictures and for their f_q: the samples of the basis are aimed at the best lights, so that few show
//! small lights elsewhere, and what is sought on them is low by what their noise pretends there.

use std::ops::Range;

use rayon::prelude::*;
use serde_json::{Value, json};

use super::{
    RunError, RunReport,
    evaluator::Evaluator,
    growing::Wanted,
    pictures::widened,
    search::{self, Trial},
    seeds::{Purpose, seed_for},
    setup::Setup,
};
use crate::{
    audit::{MAX_PICKS, pick_stem, picture},
    film::image_file::LinearImage,
    integrator::RenderError,
    lighting::{Lighting, SamplingPlan},
    math::Measure,
    objective::{JackknifeEstimate, LABELLINGS, Objective, Replicates},
    optim::OptimError,
    transport::{Recombination, Tables, TransportBasis},
};

/// Distance from the best f_q within which a lighting is nearly as good: a mean luminance that misses its
/// target by a fifth of the largest miss costs as much.
pub const WITHIN: f64 = 0.1;
/// Root mean square of the difference of two small pictures, in display luminance from 0 to 1, from which they
/// are seen to differ: a twenty-fifth of the way from black to white everywhere. Set by looking. Where a look asks for
/// colours, those count beside it: a and b of Oklab, in which such a step is about as large as one of luminance.
pub const DIFFERENT: f64 = 0.04;
/// Starts that descend beside those of the search, best first: twice as many as the search itself has. With 48 the
/// fruit basket offered as many lightings as may be.
const MORE_STARTS: usize = 32;

/// Samples per pixel of their small pictures: denoised, those of the fruit basket then show no grain, and take two
/// seconds for four of them.
const SPP: u32 = 32;

/// A lighting to choose.
#[derive(Clone, Debug)]
pub struct Alternative {
    /// Point of the unit cube.
    pub u: Vec<f64>,
    /// f_q there, with its error.
    pub estimate: JackknifeEstimate,
    /// Least difference of its small picture from one of a better lighting that may be chosen, a root mean square
    /// of display luminance from 0 to 1.
    pub distance: f64,
}

/// What lightings are sought on.
pub struct Ground<'e, 'a> {
    /// f_q of the whole picture.
    pub whole: &'e Evaluator<'a>,
    /// f_q of the reduced picture.
    pub reduced: &'e Evaluator<'a>,
}

impl Ground<'_, '_> {
    /// Lightings that differ from the best one and from each other; none when it is cancelled on the way. `best` is the best one, with its f_q.
    ///
    /// # Errors
    /// When NLopt fails.
    pub fn find(
        &self,
        trials: &[Trial],
        (best, f_q): (&[f64], f64),
        cancelled: &(impl Fn() -> bool + Sync),
    ) -> Result<Vec<Alternative>, OptimError> {
        let mut order: Vec<&Trial> = trials.iter().filter(|t| t.end.is_none()).collect();
        order.sort_by(|a, b| a.screened.total_cmp(&b.screened));
        let starts = order.into_iter().take(MORE_STARTS);
        let descended = starts.collect::<Vec<_>>().into_par_iter();
        let more = descended.map(|t| search::descend(self.reduced, &t.start, cancelled));
        let more = more.collect::<Result<Vec<_>, OptimError>>()?;
        if cancelled() {
            return Ok(Vec::new());
        }
        let ends = trials.iter().filter(|t| !t.leads).filter_map(|t| {
            let polished = t.polished.as_ref().map(|p| &p.u);
            polished.or(t.end.as_ref()).cloned()
        });
        let lower = self.whole.lower_bounds();
        let points: Vec<Vec<f64>> = ends.chain(more).map(|u| not_below(u, &lower)).collect();
        let of: Vec<&[f64]> = points.iter().map(Vec::as_slice).collect();
        let estimates = self.whole.estimates(&of, 1).map_err(|_| OptimError::NothingEvaluated)?;
        // What is not known to that distance may not be so near.
        let is_good = |e: &JackknifeEstimate| e.evaluation.f_q <= f_q + WITHIN && e.error_bound() <= WITHIN;
        let good = points.iter().zip(estimates).filter(|(_, e)| is_good(e));
        let good: Vec<(&Vec<f64>, JackknifeEstimate)> = good.collect();
        let pictures: Vec<[Vec<f64>; 2]> = good.par_iter().map(|(u, _)| self.small(u)).collect();
        let taken = farthest(&self.small(best), &pictures, self.reduced.basis.layout().n_pixels());
        let alternative = |(i, distance): (usize, f64)| Alternative {
            u: good[i].0.clone(),
            estimate: good[i].1.clone(),
            distance,
        };
        Ok(taken.into_iter().map(alternative).collect())
    }

    /// What is shown of the reduced picture of a point, by each half of the samples.
    fn small(&self, u: &[f64]) -> [Vec<f64>; 2] {
        let Evaluator { basis, variables, measure, .. } = *self.reduced;
        let x = self.reduced.lighting(&variables.decode(u));
        let (n, half) = (basis.n_replicates(), basis.n_replicates() / 2);
        [0..half.max(1), half.min(n - 1)..n].map(|replicates| shown(basis, &x, replicates, measure))
    }
}

/// Display luminance of the picture of a lighting, the mean over some of the replicates, and its chroma where that is
/// measured.
fn shown(basis: &TransportBasis, x: &Lighting, replicates: Range<usize>, measure: Measure) -> Vec<f64> {
    let recombination = Recombination::new(basis.layout(), x);
    let n = basis.layout().n_pixels();
    let mut mean = vec![0.0; n * measure.n_planes()];
    let mut one = mean.clone();
    let share = 1.0 / replicates.len().max(1) as f64;
    for replicate in replicates {
        basis.luminance(replicate, &recombination, &mut one);
        mean.iter_mut().zip(&one).for_each(|(mean, v)| *mean += share * v);
    }
    let (mut shown, mut slopes) =
        (vec![0.0; n * measure.n_shown()], vec![0.0; mean.len() * measure.n_shown()]);
    measure.encode_all(&mean, x.exposure, &mut shown, &mut slopes);
    shown
}

/// A point with no coordinate below a bound.
fn not_below(u: Vec<f64>, lower: &[f64]) -> Vec<f64> {
    u.into_iter().zip(lower).map(|(u, lower)| u.max(*lower)).collect()
}

/// Indices of pictures of `n_pixels`, each the farthest from the `first` one and from those taken before, with its
/// distance from the nearest of them; as many as differ, and fewer than may be offered. Each picture is given twice,
/// by halves of the samples: their noise differs, so that products of the differences have none in the mean.
fn farthest(first: &[Vec<f64>; 2], pictures: &[[Vec<f64>; 2]], n_pixels: usize) -> Vec<(usize, f64)> {
    let distance = |a: &[Vec<f64>; 2], b: &[Vec<f64>; 2]| {
        let each = a[0].iter().zip(&b[0]).zip(a[1].iter().zip(&b[1]));
        let square: f64 = each.map(|((a0, b0), (a1, b1))| (a0 - b0) * (a1 - b1)).sum();
        (square.max(0.0) / n_pixels.max(1) as f64).sqrt()
    };
    let mut nearest: Vec<f64> = pictures.iter().map(|p| distance(p, first)).collect();
    let mut taken = Vec::new();
    while taken.len() + 1 < MAX_PICKS {
        let Some((i, &far)) = nearest.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1)) else { break };
        if far < DIFFERENT {
            break;
        }
        taken.push((i, far));
        for (near, picture) in nearest.iter_mut().zip(pictures) {
            *near = near.min(distance(picture, &pictures[i]));
        }
    }
    taken
}

/// Lightings that were found, with f_q of new samples and their small pictures: those whose f_q is within the `limit`,
/// from the least on; none when it is cancelled on the way. As many as may be are rendered together.
///
/// # Errors
/// When a render fails.
pub(super) fn measured(
    found: Vec<Alternative>,
    limit: f64,
    objective: &Objective,
    setup: Setup,
    cancelled: &(impl Fn() -> bool + Sync),
) -> Result<Vec<(Alternative, LinearImage)>, RunError> {
    let even = vec![1.0; setup.scene.lights.len()];
    let mut seen = Vec::new();
    for group in found.chunks(SamplingPlan::MAX_TOGETHER) {
        let lightings: Vec<Lighting> = group.iter().map(|a| setup.lighting(&a.u)).collect();
        let each: Vec<&Lighting> = lightings.iter().collect();
        let weighted: Vec<(&Lighting, &[f32])> = lightings.iter().map(|x| (x, even.as_slice())).collect();
        let plan = SamplingPlan::for_pictures(&weighted);
        let seed = seed_for(setup.options.seed, Purpose::Choices);
        let wanted = Wanted { view: setup.view(), lightings: &each, plan: &plan, seed, spp: SPP };
        let grown = match setup.renderer().grow(&wanted, &cancelled, &()) {
            Err(RenderError::Cancelled) => return Ok(Vec::new()),
            other => other?,
        };
        if cancelled() {
            return Ok(Vec::new());
        }
        for (k, (alternative, x)) in group.iter().zip(&lightings).enumerate() {
            let measure = setup.options.measure;
            let linear = grown.planes(k, measure).map(widened);
            let replicates = Replicates { linear: &linear, measure, exposure: x.exposure };
            let estimate = replicates.measure(objective, LABELLINGS)?;
            if estimate.evaluation.f_q <= limit {
                let denoised = setup.features.map(|features| grown.denoised(k, features));
                let shown = picture::beauty(&denoised.unwrap_or_else(|| grown.picture(k)));
                seen.push((Alternative { estimate, ..alternative.clone() }, shown));
            }
        }
    }
    seen.sort_by(|(a, _), (b, _)| a.estimate.evaluation.f_q.total_cmp(&b.estimate.evaluation.f_q));
    Ok(seen)
}

/// What is said of the lightings to choose from in `result.json`.
pub(super) fn to_json(report: &RunReport, setup: Setup) -> Value {
    let each = report.alternatives.iter().enumerate().map(|(i, a)| {
        json!({
            "lights": format!("{}.toml", pick_stem(i + 2)),
            "f_q": a.estimate.evaluation.f_q,
            "f_q_error": a.estimate.error_bar(),
            "terms": a.estimate.evaluation.terms_json(),
            "distance": a.distance,
            "lighting": setup.lighting(&a.u),
        })
    });
    json!({"within": WITHIN, "different": DIFFERENT, "each": each.collect::<Vec<_>>()})
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_farthest_is_taken_until_none_differs() {
        let flat = |l: f64| [vec![l; 6], vec![l; 6]];
        let pictures = [flat(0.5), flat(0.52), flat(0.9), flat(0.58), flat(0.1)];
        let far = farthest(&flat(0.5), &pictures, 6);
        let mut taken: Vec<usize> = far.iter().map(|(i, _)| *i).collect();
        taken.sort_unstable();
        // .52 looks like .5, and so does .5 itself.
        assert_eq!(taken, [2, 3, 4]);
        assert!((far[2].1 - 0.08).abs() < 1e-12 && far.iter().all(|(_, d)| *d >= DIFFERENT));
    }

    #[test]
    fn no_more_are_taken_than_may_be_offered() {
        let flat = |l: f64| [vec![l; 4], vec![l; 4]];
        let pictures: Vec<[Vec<f64>; 2]> = (0..40).map(|i| flat(f64::from(i) / 8.0)).collect();
        assert_eq!(farthest(&flat(0.0), &pictures, 4).len(), MAX_PICKS - 1);
    }

    #[test]
    fn noise_makes_no_difference() {
        // Of one mean, with noise of .2 that halves do not share.
        let noisy = |sign: f64| {
            let half = |period: usize| {
                (0..64).map(|i| 0.5 + if (i / period).is_multiple_of(2) { sign } else { -sign }).collect()
            };
            [half(1), half(2)]
        };
        assert!(farthest(&noisy(0.1), &[noisy(-0.1)], 64).is_empty());
        let far =
            farthest(&noisy(0.1), &[noisy(-0.1).map(|half| half.iter().map(|l| l + 0.1).collect())], 64);
        assert!((far[0].1 - 0.1).abs() < 1e-12);
    }
}
