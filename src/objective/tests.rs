//! Tests of the whole objective: derivatives, exact values, smoothing, noise.

use super::palette::Palette;
use super::signature::{Shape, Signature};
use super::testing::{Rng, disk_mask};
use super::*;

const W: usize = 13;
const H: usize = 9;

/// A target that only weighs `term` (all terms as published for `None`); if the base has no goal for
/// it, 0.3 is wanted of a scalar term.
fn target_of(base: &str, term: Option<Term>) -> Target {
    let mut target = Target::resolve(base).unwrap();
    if let Some(term) = term {
        if !term.is_distance() {
            target.goals.entry(term).or_insert(Goal::Value(0.3));
        }
        if term == Term::Chroma {
            let of = with_chroma(&[0.0; 40], &mut Rng::new(1));
            let shares = Statistics::measure_whole(&of, 8, 5).palette();
            target.goals.insert(term, Goal::Palette(Palette::new("random", shares).unwrap()));
        }
        target.weights = [0.0; N_TERMS];
        target.weights[term as usize] = 1.0;
    }
    target
}

/// Moves pixels off the joints of the histogram ramps, where the second derivative jumps
/// and central differences are only first order.
fn off_joints(l: f64) -> f64 {
    let u = l * 256.0 - 0.5;
    if (u - u.round()).abs() < 0.01 && l > 0.0 && l < 1.0 { l + 0.02 / 256.0 } else { l }
}

/// A picture of display luminance with random chroma behind it, of which some lies beyond the bins.
fn with_chroma(l: &[f64], rng: &mut Rng) -> Vec<f64> {
    let mut shown = l.to_vec();
    shown.extend((0..2 * l.len()).map(|_| 0.1 * rng.normal()));
    shown
}

/// Random pictures of every awkward kind: plain, dark, with clipped pixels, black and
/// white in every second pixel.
fn pictures() -> Vec<(&'static str, Vec<f64>)> {
    let mut rng = Rng::new(7);
    let mut draw = |f: fn(usize, f64) -> f64| -> Vec<f64> {
        (0..W * H).map(|i| off_joints(f(i, rng.uniform()))).collect()
    };
    vec![
        ("plain", draw(|_, l| l)),
        ("dark", draw(|_, l| 0.05 * l * l)),
        ("clipped", draw(|_, l| (2.0 * l - 0.5).clamp(0.0, 1.0))),
        ("binary", draw(|i, l| if i % 2 == 0 { l.round() } else { l })),
    ]
}

/// Checks `adjoint` against five-point central differences of `f`, pixel by pixel, at
/// 1e-6 of the largest entry.
fn assert_adjoint(what: &str, l: &[f64], adjoint: &[f64], f: impl Fn(&[f64]) -> f64) {
    let h = 2e-6;
    let scale = adjoint.iter().fold(0.0_f64, |m, a| m.max(a.abs()));
    assert!(scale > 1e-6, "{what}: the adjoint is zero, nothing would be tested");
    let mut shifted = l.to_vec();
    for (i, &a) in adjoint.iter().enumerate() {
        let mut at = |step: f64| {
            shifted[i] = l[i] + step;
            let value = f(&shifted);
            shifted[i] = l[i];
            value
        };
        let fd = (8.0 * (at(h) - at(-h)) - (at(2.0 * h) - at(-2.0 * h))) / (12.0 * h);
        assert!((fd - a).abs() <= 1e-6 * scale, "{what}, pixel {i}: {a} against {fd} of {scale}");
    }
}

#[test]
fn adjoints_of_every_term_and_the_sum_agree_with_central_differences() {
    let mask = disk_mask(W, H);
    let terms = Term::ALL.map(Some).into_iter().chain([None]);
    for term in terms {
        for base in ["high-key", "low-key"] {
            let objective = Objective::new(&target_of(base, term), W, H, &mask).unwrap();
            for delta in [Smoothing::DELTA_FIRST, Smoothing::DELTA_LAST] {
                let smoothing = Smoothing::with_delta(delta);
                for (name, mut l) in pictures() {
                    if term.is_some_and(Term::is_of_color) {
                        l = with_chroma(&l, &mut Rng::new(5));
                    }
                    let mut adjoint = vec![f64::NAN; l.len()];
                    let value = objective.evaluate_smooth(&l, &smoothing, Some(&mut adjoint)).f_q;
                    let f = |l: &[f64]| objective.evaluate_smooth(l, &smoothing, None).f_q;
                    assert_eq!(value, f(&l));
                    let what = format!("{term:?} {base} {delta} {name}");
                    assert_adjoint(&what, &l, &adjoint, f);
                }
            }
        }
    }
}

/// Weights in the place of the mask: derivatives, and weights of 0 and 1 alone are that mask.
#[test]
fn adjoints_with_weights_agree_with_central_differences() {
    let mut rng = Rng::new(4);
    let weights: Vec<f64> = rng.image(W * H).iter().map(|w| (2.0 * w - 0.5).clamp(0.0, 1.0)).collect();
    for term in Term::ALL.map(Some).into_iter().chain([None]) {
        let target = target_of("low-key", term);
        let objective = Objective::weighted(&target, W, H, &weights).unwrap();
        let smoothing = Smoothing::with_delta(Smoothing::DELTA_LAST);
        for (name, mut l) in pictures() {
            if term.is_some_and(Term::is_of_color) {
                l = with_chroma(&l, &mut Rng::new(6));
            }
            let mut adjoint = vec![f64::NAN; l.len()];
            objective.evaluate_smooth(&l, &smoothing, Some(&mut adjoint));
            let f = |l: &[f64]| objective.evaluate_smooth(l, &smoothing, None).f_q;
            assert_adjoint(&format!("{term:?} {name}"), &l, &adjoint, f);
        }
    }
    let mask = disk_mask(W, H);
    let binary: Vec<f64> = mask.iter().map(|&on| f64::from(u8::from(on))).collect();
    let target = target_of("high-key", None);
    let by_mask = Objective::new(&target, W, H, &mask).unwrap();
    let by_weights = Objective::weighted(&target, W, H, &binary).unwrap();
    for (name, l) in pictures() {
        let (a, b) = (by_mask.evaluate(&l), by_weights.evaluate(&l));
        for (a, b) in a.terms().zip(b.terms()) {
            assert!((a.value - b.value).abs() < 1e-12, "{name} {}: {} {}", a.term.name(), a.value, b.value);
        }
    }
    assert_eq!(Objective::weighted(&target, W, H, &[0.0; W * H]).unwrap_err(), ObjectiveError::EmptyObject);
    assert_eq!(
        Objective::weighted(&target, W, H, &[1.0; W * H]).unwrap_err(),
        ObjectiveError::EmptyBackground
    );
}

#[test]
fn a_term_without_a_goal_is_not_listed_and_measured_only_where_others_read_it() {
    let mask = disk_mask(W, H);
    let all = target_of("low-key", None);
    let smoothing = Smoothing::with_delta(Smoothing::DELTA_LAST);
    for left_out in Term::standing() {
        let mut target = all.clone();
        target.goals.remove(&left_out);
        target.weights[left_out as usize] = 0.0;
        let objective = Objective::new(&target, W, H, &mask).unwrap();
        let whole = Objective::new(&all, W, H, &mask).unwrap();
        let (name, l) = pictures().remove(0);
        let (some, every) = (objective.evaluate(&l), whole.evaluate(&l));
        let rest: Vec<_> = every.terms().copied().filter(|t| t.term != left_out).collect();
        assert_eq!(some.terms().copied().collect::<Vec<_>>(), rest);
        assert!(objective.listed().eq(rest.iter().map(|t| t.term)));
        assert!((some.f_q - (every.f_q - every[left_out].contribution())).abs() < 1e-15);
        assert!(some.terms_json().get(left_out.name()).is_none());

        let z = objective.statistics(&l, Ramp::Linear);
        let is_read = Term::ALL.into_iter().any(|other| other.reads(left_out));
        assert_eq!(z[left_out].iter().any(|&z| z != 0.0), is_read, "{left_out:?}");
        let mut adjoint = vec![0.0; l.len()];
        objective.evaluate_smooth(&l, &smoothing, Some(&mut adjoint));
        let f = |l: &[f64]| objective.evaluate_smooth(l, &smoothing, None).f_q;
        assert_adjoint(&format!("without {left_out:?}, {name}"), &l, &adjoint, f);
    }
}

#[test]
fn a_flat_picture_has_a_finite_adjoint() {
    let objective = Objective::new(&target_of("low-key", None), W, H, &disk_mask(W, H)).unwrap();
    for smoothing in [Smoothing::with_delta(0.01), Smoothing::NONE] {
        for level in [0.0, 0.3, 1.0] {
            let mut adjoint = vec![0.0; W * H];
            objective.evaluate_smooth(&[level; W * H], &smoothing, Some(&mut adjoint));
            assert!(adjoint.iter().all(|a| a.is_finite()));
        }
    }
}

#[test]
fn adjoints_of_the_jackknife_agree_with_central_differences() {
    let objective = Objective::new(&target_of("high-key", None), W, H, &disk_mask(W, H)).unwrap();
    let smoothing = Smoothing::with_delta(0.02);
    let mut rng = Rng::new(11);
    let full: Vec<f64> = rng.image(W * H).into_iter().map(off_joints).collect();
    let ones: Vec<Vec<f64>> = (0..3)
        .map(|_| full.iter().map(|l| off_joints((l + 0.1 * rng.normal()).clamp(0.0, 1.0))).collect())
        .collect();
    let value = |full: &[f64], ones: &[Vec<f64>]| {
        let ones: Vec<&[f64]> = ones.iter().map(Vec::as_slice).collect();
        let z = objective.jackknifed(full, &ones, smoothing.ramp).unwrap();
        objective.terms(&z.corrected, &smoothing).f_q
    };
    let mut d_full = vec![0.0; W * H];
    let mut d_ones = vec![vec![0.0; W * H]; 3];
    let views: Vec<&[f64]> = ones.iter().map(Vec::as_slice).collect();
    let z = objective.jackknifed(&full, &views, smoothing.ramp).unwrap();
    let (_, dz) = objective.terms_with_gradient(&z.corrected, &smoothing);
    let out = (d_full.as_mut_slice(), d_ones.as_mut_slice());
    objective.adjoints((&full, &views), &z, &dz, smoothing.ramp, out).unwrap();
    assert_adjoint("full", &full, &d_full, |l| value(l, &ones));
    for r in 0..3 {
        assert_adjoint("one left out", &ones[r], &d_ones[r], |l| {
            let mut changed = ones.clone();
            changed[r] = l.to_vec();
            value(&full, &changed)
        });
    }
}

#[test]
fn residuals_are_the_terms_before_their_moduli_and_so_are_their_derivatives() {
    let objective = Objective::new(&target_of("low-key", None), W, H, &disk_mask(W, H)).unwrap();
    let smoothing = Smoothing::with_delta(Smoothing::DELTA_LAST);
    let l: Vec<f64> = Rng::new(5).image(W * H).into_iter().map(off_joints).collect();
    let at = |l: &[f64]| objective.residuals(&objective.statistics(l, smoothing.ramp), &smoothing);
    let z = objective.statistics(&l, smoothing.ramp);
    let Residuals { scalars, distances } = at(&l);
    let unsmoothed = Smoothing { delta: 0.0, ..smoothing };
    let sum = scalars.iter().flatten().map(|r| r.weight * r.value.abs()).sum::<f64>() + distances.value;
    assert!((sum - objective.terms(&z, &unsmoothed).f_q).abs() < 1e-14);
    assert_eq!(scalars.iter().flatten().count(), objective.scalar_weights().len());
    for term in objective.listed() {
        let of = |r: Residuals| r.scalars[term as usize].clone().unwrap_or(r.distances);
        let mut adjoint = vec![0.0; W * H];
        objective.add_adjoint(&l, &z, &of(at(&l)).by_statistics, 1.0, smoothing.ramp, &mut adjoint);
        assert_adjoint(term.name(), &l, &adjoint, |l| of(at(l)).value);
    }
}

#[test]
fn a_two_by_two_picture_agrees_with_the_hand() {
    // Object: left column 0.2, 0.6; background: right column 0.9, 0.5.
    let mask = [true, false, true, false];
    let l = [0.2, 0.9, 0.6, 0.5];
    let target = target_of("high-key", None);
    let e = Objective::new(&target, 2, 2, &mask).unwrap().evaluate(&l);
    let near = |term: Term, value: f64, f: f64| {
        let t = e[term];
        assert!((t.value - value).abs() < 1e-14 && (t.f - f).abs() < 1e-14, "{t:?}");
    };
    near(Term::MeanObj, 0.4, 0.07 / 0.53);
    near(Term::MeanBack, 0.7, 0.08 / 0.78);
    near(Term::VarObj, 0.2, 0.04 / 0.76);
    near(Term::VarBack, 0.2, 0.03 / 0.83);
    // Top left: gx = 3·0.7 − 0.1 = 2.0, gy = 3·0.4 − 0.4 = 0.8;
    // bottom left: gx = 0.7 − 3·0.1 = 0.4, gy = 3·0.4 − 0.4 = 0.8.
    let g = ((2.0_f64 * 2.0 + 0.8 * 0.8 + 0.4 * 0.4 + 0.8 * 0.8) / 2.0).sqrt();
    near(Term::Grad, g, (g - 0.39) / 0.61);
    let sum = 0.5 * e[Term::MeanObj].f
        + 0.5 * e[Term::MeanBack].f
        + 0.4 * e[Term::VarObj].f
        + 0.4 * e[Term::VarBack].f
        + 0.2 * e[Term::Grad].f
        + e[Term::Hist].f;
    assert!((e.f_q - sum).abs() < 1e-15);
}

#[test]
fn without_rounding_at_the_kinks_the_gap_is_at_most_two_delta() {
    let mask = disk_mask(W, H);
    for base in ["high-key", "low-key"] {
        let objective = Objective::new(&target_of(base, None), W, H, &mask).unwrap();
        for (name, l) in pictures() {
            let exact = objective.evaluate(&l).f_q;
            for delta in [0.05, 5e-3, 5e-4] {
                let only_h = Smoothing { delta, ..Smoothing::NONE };
                let gap = exact - objective.evaluate_smooth(&l, &only_h, None).f_q;
                // Residuals are well above δ here, so the gap nearly uses up its bound.
                assert!(gap <= 2.0 * delta && gap > 0.5 * delta, "{base} {name} {delta}: {gap}");
            }
            let limit = Smoothing { delta: 0.0, eta: 0.0, pixels: 1e-9, ramp: Ramp::Linear };
            let gap = exact - objective.evaluate_smooth(&l, &limit, None).f_q;
            assert!(gap.abs() < 1e-4, "{base} {name}: {gap}");
        }
    }
}

#[test]
fn at_working_size_all_smoothing_together_stays_near_two_delta() {
    let (w, h) = (128, 96);
    let mut rng = Rng::new(3);
    let l: Vec<f64> = (0..w * h)
        .map(|i| (0.3 + 0.4 * ((i % w) as f64 / 40.0).sin() + 0.05 * rng.normal()).clamp(0.0, 1.0))
        .collect();
    for base in ["high-key", "low-key"] {
        let objective = Objective::new(&target_of(base, None), w, h, &disk_mask(w, h)).unwrap();
        let exact = objective.evaluate(&l).f_q;
        for delta in [0.05, 5e-4] {
            let smooth = objective.evaluate_smooth(&l, &Smoothing::with_delta(delta), None).f_q;
            // 2δ of the moduli; η of three roots and one pixel's worth in the histogram.
            let allowed = 2.0 * delta + 1.4 * Smoothing::ETA + 2e-3;
            assert!((exact - smooth).abs() < allowed, "{base} {delta}: {exact} {smooth}");
        }
    }
}

#[test]
fn pixels_drawn_from_a_signature_leave_only_sampling_error() {
    let (w, h) = (128, 96);
    let n = (w * h) as f64;
    let mut rng = Rng::new(5);
    for name in ["high", "medium"] {
        let p = Signature::builtin(name).unwrap().cumulated();
        let mut target = target_of("high-key", Some(Term::Hist));
        let signature = Signature::new(name, Shape::Cumulated(p.to_vec())).unwrap();
        target.goals.insert(Term::Hist, Goal::Signature(signature));
        let objective = Objective::new(&target, w, h, &disk_mask(w, h)).unwrap();
        let draw = |u: f64| {
            let i = p.partition_point(|&p| p < u);
            let below = if i == 0 { 0.0 } else { p[i - 1] };
            (i as f64 + (u - below) / (p[i] - below)) / 256.0
        };
        // √q has variance (1−p)/4N, so E f² = Σ (1−p)/4N / Σ max(p, 1−p).
        let expected = p.iter().map(|p| (1.0 - p) / (4.0 * n)).sum::<f64>()
            / p.iter().map(|p| p.max(1.0 - p)).sum::<f64>();
        let runs: Vec<f64> = (0..64)
            .map(|_| {
                let l: Vec<f64> = (0..w * h).map(|_| draw(rng.uniform())).collect();
                objective.evaluate(&l).f_q.powi(2) / expected
            })
            .collect();
        let (mean, se) = mean_and_error(&runs);
        // Neighbouring q are strongly correlated, hence the wide spread of f² around 1.
        assert!(((mean - 1.0) / se).abs() < Z_TWO, "{name}: {mean} ± {se}");
        assert!(expected.sqrt() < 0.006, "{name}: {}", expected.sqrt());
    }
}

/// Two-sided α = 0.01 with Šidák correction for two tests.
const Z_TWO: f64 = 2.806;

fn mean_and_error(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / (n - 1.0);
    (mean, (variance / n).sqrt())
}

#[test]
fn no_spread_reaches_the_low_key_target() {
    let mask = disk_mask(W, H);
    let objective = Objective::new(&target_of("low-key", None), W, H, &mask).unwrap();
    // The widest spread there is: half the object black, half white.
    let n_obj = mask.iter().filter(|&&m| m).count();
    let mut seen = 0;
    let extreme: Vec<f64> = mask
        .iter()
        .map(|&m| {
            seen += usize::from(m);
            f64::from(u8::from(m && 2 * seen > n_obj))
        })
        .collect();
    let mut lowest = f64::INFINITY;
    for l in pictures().into_iter().map(|(_, l)| l).chain([extreme]) {
        let term = objective.evaluate(&l)[Term::VarObj];
        assert!(term.value <= 0.5 + 1e-15);
        assert!(term.f >= 0.13 / 0.63 - 1e-15); // 0.2063…
        lowest = lowest.min(term.f);
    }
    assert!(lowest < 0.21, "the bound is reached: {lowest}");
}

#[test]
fn sizes_and_masks_that_cannot_be_measured_are_refused() {
    let target = target_of("high-key", None);
    let new = |w, h, mask: &[bool]| Objective::new(&target, w, h, mask).unwrap_err();
    assert!(matches!(new(2, 2, &[true; 3]), ObjectiveError::MaskSize { mask: 3, .. }));
    assert_eq!(new(2, 1, &[true; 2]), ObjectiveError::EmptyBackground);
    assert_eq!(new(2, 1, &[false; 2]), ObjectiveError::EmptyObject);
    assert!(matches!(new(0, 1, &[]), ObjectiveError::EmptyPicture { .. }));
    let huge = new(usize::MAX, 2, &[true; 2]);
    assert!(matches!(huge, ObjectiveError::MaskSize { .. }));
}

#[test]
fn equal_replicates_give_the_plain_evaluation() {
    let objective = Objective::new(&target_of("low-key", None), W, H, &disk_mask(W, H)).unwrap();
    let l = &pictures()[0].1;
    let z = objective.statistics(l, Ramp::Linear);
    let estimate = objective.jackknife(&z, &[vec![z.clone(); 4]], &Smoothing::NONE).unwrap();
    assert!((estimate.evaluation.f_q - objective.evaluate(l).f_q).abs() < 1e-12);
    assert!(estimate.correction.abs() < 1e-12 && estimate.half_width < 1e-12);
    assert!(matches!(
        objective.jackknife(&z, &[vec![z.clone()]], &Smoothing::NONE),
        Err(ObjectiveError::TooFewReplicates { replicates: 1 })
    ));
}

#[test]
fn the_error_bar_is_students_times_the_delete_one_error() {
    let objective = Objective::new(&target_of("low-key", None), W, H, &disk_mask(W, H)).unwrap();
    let mut rng = Rng::new(9);
    let z: Vec<Statistics> = (0..4).map(|_| objective.statistics(&rng.image(W * H), Ramp::Linear)).collect();
    let e = objective.jackknife(&z[0], std::slice::from_ref(&z), &Smoothing::NONE).unwrap();
    let f: Vec<f64> = z.iter().map(|z| objective.terms(z, &Smoothing::NONE).f_q).collect();
    let (_, se_of_mean) = mean_and_error(&f);
    // √((R−1)/R Σ(f−f̄)²) = (R−1) · s/√R
    assert!((e.standard_error - 3.0 * se_of_mean).abs() < 1e-14);
    assert!((e.half_width - 3.182_446_305 * e.standard_error).abs() < 1e-8);
    assert!((e.correction - (e.naive - e.evaluation.f_q)).abs() < 1e-15);
    assert!((e.error_bound() - e.half_width - e.correction.abs()).abs() < 1e-15);
    let left = e.correction.abs() * (e.correction.abs() / 0.04).min(1.0);
    assert!((e.error_bar() - e.half_width - left).abs() < 1e-15);
}

/// `trials` noisy renders in R replicates of a smooth picture: naive and corrected
/// statistics of display luminance.
fn noisy_trials(
    objective: &Objective,
    y: &[f64],
    mode: LuminanceMode,
    noise: f64,
    trials: usize,
) -> Vec<(Statistics, Statistics)> {
    const R: usize = 4;
    let mut rng = Rng::new(21);
    let statistics = |y: &[f64]| {
        let l: Vec<f64> = y.iter().map(|&y| mode.encode(y, 1.0)).collect();
        objective.statistics(&l, Ramp::Linear)
    };
    (0..trials)
        .map(|_| {
            let replicates: Vec<Vec<f64>> =
                (0..R).map(|_| y.iter().map(|y| y * (1.0 + noise * rng.normal())).collect()).collect();
            let mean_without = |skip: usize| -> Vec<f64> {
                let n = (0..R).filter(|&r| r != skip).count() as f64;
                (0..y.len())
                    .map(|i| (0..R).filter(|&r| r != skip).map(|r| replicates[r][i]).sum::<f64>() / n)
                    .collect()
            };
            let full = statistics(&mean_without(R));
            let ones: Vec<Statistics> = (0..R).map(|r| statistics(&mean_without(r))).collect();
            let corrected = jackknife::corrected(&full, &[ones]).unwrap();
            (full, corrected)
        })
        .collect()
}

fn smooth_picture(w: usize, h: usize) -> Vec<f64> {
    (0..w * h)
        .map(|i| {
            let (x, y) = ((i % w) as f64 / w as f64, (i / w) as f64 / h as f64);
            0.4 + 0.15 * (6.0 * x).sin() * (4.0 * y).cos()
        })
        .collect()
}

#[test]
fn the_jackknife_removes_the_bias_of_spread_and_gradient() {
    let (w, h) = (48, 36);
    let y = smooth_picture(w, h);
    let objective = Objective::new(&target_of("high-key", None), w, h, &disk_mask(w, h)).unwrap();
    // Linear and unclamped, the statistics are quadratic in Ȳ and the jackknife is exact.
    let truth = objective.statistics(&y, Ramp::Linear);
    let trials = noisy_trials(&objective, &y, LuminanceMode::Linear, 0.15, 300);
    for measure in [Term::VarObj, Term::Grad].map(|term| move |z: &Statistics| z.scalar(term)) {
        let errors = |pick: fn(&(Statistics, Statistics)) -> &Statistics| {
            let e: Vec<f64> = trials.iter().map(|t| measure(pick(t)) - measure(&truth)).collect();
            let (mean, se) = mean_and_error(&e);
            mean / se
        };
        let naive = errors(|t| &t.0);
        let corrected = errors(|t| &t.1);
        assert!(naive > 10.0, "the naive estimate is biased: z = {naive}");
        assert!(corrected.abs() < Z_TWO, "the jackknife is not: z = {corrected}");
    }
    let deviation = |z: &Statistics| z.scalar(Term::VarObj).sqrt();
    let sigma: Vec<f64> = trials.iter().map(|t| deviation(&t.1) - deviation(&truth)).collect();
    let (mean, se) = mean_and_error(&sigma);
    assert!((mean / se).abs() < Z_TWO, "σ itself: z = {}", mean / se);
}

#[test]
fn the_jackknife_lowers_the_bias_of_encoded_f_q() {
    let (w, h) = (64, 48);
    let y = smooth_picture(w, h);
    for base in ["high-key", "low-key"] {
        let objective = Objective::new(&target_of(base, None), w, h, &disk_mask(w, h)).unwrap();
        let mode = LuminanceMode::Srgb;
        let l: Vec<f64> = y.iter().map(|&y| mode.encode(y, 1.0)).collect();
        let truth = objective.evaluate(&l).f_q;
        let f = |z: &Statistics| objective.terms(z, &Smoothing::NONE).f_q - truth;
        let trials = noisy_trials(&objective, &y, mode, 0.3, 60);
        let (naive, se) = mean_and_error(&trials.iter().map(|t| f(&t.0)).collect::<Vec<_>>());
        let (corrected, _) = mean_and_error(&trials.iter().map(|t| f(&t.1)).collect::<Vec<_>>());
        assert!((naive / se).abs() > 10.0, "{base}: {naive} ± {se}");
        assert!(corrected.abs() < 0.3 * naive.abs(), "{base}: {naive} against {corrected}");
    }
}

#[test]
fn an_evaluation_serialises_by_term_name() {
    let objective = Objective::new(&target_of("high-key", None), W, H, &disk_mask(W, H)).unwrap();
    let e = objective.evaluate(&pictures()[0].1);
    let json = serde_json::to_value(&e).unwrap();
    assert_eq!(json["f_q"].as_f64(), Some(e.f_q));
    for t in e.terms() {
        let entry = &json["terms"][t.term.name()];
        assert_eq!(entry["value"].as_f64(), Some(t.value));
        assert_eq!(entry["target"].as_f64(), Some(t.target));
        assert_eq!(entry["f"].as_f64(), Some(t.f));
        assert_eq!(entry["weight"].as_f64(), Some(t.weight));
    }
}
