//! Scattering functions: sampling against density, energy and symmetry.

mod energy;
mod symmetry;

use std::{
    f64::consts::PI,
    sync::{Arc, LazyLock},
};

use glam::{Vec2, Vec3};
use lightopt_embree::{
    bsdf::{
        Blend, Bsdf, Coat, CoatPoint, Conductor, Diffuse, Facets, Glass, Layer, Plastic, Thin,
        TransportMode::{self, Importance, Radiance},
        microfacet::Ggx,
        thin::average_reflectance,
    },
    math::{
        ONE_MINUS_EPSILON, Rgb, luminance,
        stats::{Moments, sidak_z},
    },
};

use crate::support::{
    chi2::{Counts, Partition, Rect, sidak_level},
    random::Random,
};

/// Samples per model, direction and mode: as few as still reject every density of
/// [`wrong_densities_are_rejected`], slopes and exponents off by a twentieth among them.
const N: u32 = 1 << 17;
/// Samples that shape the cells of a χ² test.
const N_PILOT: u32 = 1 << 13;
/// Levels of its k-d tree: 2 · 2⁶ cells at most.
const DEPTH: u32 = 6;
const MODES: [TransportMode; 2] = [Radiance, Importance];
const ETA: f32 = 1.5;

/// A model and the directions it is tested from.
struct Case {
    name: String,
    alpha: Option<f32>,
    bsdf: Bsdf<'static>,
    wo: Vec<Vec3>,
}

impl Case {
    /// Modes of transport that differ: only refraction has two.
    fn modes(&self) -> &'static [TransportMode] {
        if matches!(self.bsdf, Bsdf::Dielectric(_)) { &MODES } else { &MODES[..1] }
    }
}

/// Every model with the directions it is tested from.
static CASES: LazyLock<Vec<Case>> = LazyLock::new(|| {
    let mut cases = vec![Case {
        name: "diffuse".into(),
        alpha: None,
        bsdf: Bsdf::Diffuse(Diffuse { albedo: Rgb::new(0.9, 0.5, 0.2) }),
        wo: directions(),
    }];
    cases.extend([0.02, 0.2, 1.0].map(conductor));
    cases.extend([0.03, 0.25, 1.0].map(dielectric));
    cases.extend(COATS.iter().map(|(alpha, coat)| Case {
        name: format!("plastic {alpha:?}"),
        alpha: *alpha,
        bsdf: Bsdf::Plastic(Plastic::new(Rgb::new(0.8, 0.4, 0.1), coat.at(0.0))),
        wo: directions(),
    }));
    cases.extend(blends());
    cases.extend([(0.03, Rgb::ONE), (0.25, Rgb::new(0.9, 0.4, 0.1)), (1.0, Rgb::ONE)].map(sheet));
    cases
});

/// Coats: smooth and of three slopes.
static COATS: LazyLock<Vec<(Option<f32>, Coat)>> =
    LazyLock::new(|| [None, Some(0.05), Some(0.25), Some(0.8)].map(|alpha| (alpha, coat(ETA, alpha))).into());

/// Facets and a coat whose roughness varies.
static ANY_FACETS: LazyLock<Arc<Facets>> = LazyLock::new(|| Arc::new(Facets::of_any_slope()));
static ANY_COAT: LazyLock<Coat> = LazyLock::new(|| Coat::rough(ETA, ANY_FACETS.clone()));

fn coat(eta: f32, alpha: Option<f32>) -> Coat {
    alpha.map_or_else(|| Coat::smooth(eta), |alpha| Coat::rough(eta, Arc::new(Facets::new(alpha))))
}

fn keep<T>(value: T) -> &'static T {
    Box::leak(Box::new(value))
}

fn direction(degrees: f32, phi: f32) -> Vec3 {
    let (sin, cos) = degrees.to_radians().sin_cos();
    Vec3::new(sin * phi.cos(), sin * phi.sin(), cos)
}

/// Five directions: along the normal, oblique, grazing and below the surface.
fn directions() -> Vec<Vec3> {
    vec![
        Vec3::Z,
        direction(35.0, 0.4),
        direction(72.0, 2.0),
        direction(88.5, -1.1),
        direction(180.0 - 50.0, 4.0),
    ]
}

/// Those, of which the last is totally reflected inside glass, and one from inside that is
/// refracted, just short of the critical angle of 41.8°.
fn directions_of_glass() -> Vec<Vec3> {
    [directions(), vec![direction(180.0 - 41.5, 42.2)]].concat()
}

/// Metal of slope `alpha`.
fn conductor(alpha: f32) -> Case {
    Case {
        name: format!("conductor {alpha}"),
        alpha: Some(alpha),
        bsdf: metal(Rgb::new(0.95, 0.7, 0.3), alpha),
        wo: directions(),
    }
}

fn metal(f0: Rgb, alpha: f32) -> Bsdf<'static> {
    Bsdf::Conductor(Conductor::new(f0, luminance(f0), Some(keep(Facets::new(alpha)).at(alpha))))
}

/// Glass of slope `alpha`.
fn dielectric(alpha: f32) -> Case {
    Case {
        name: format!("dielectric {alpha}"),
        alpha: Some(alpha),
        bsdf: glass(alpha),
        wo: directions_of_glass(),
    }
}

fn glass(alpha: f32) -> Bsdf<'static> {
    Bsdf::Dielectric(keep(Glass::rough(ETA, alpha)).at(alpha))
}

/// Mixtures: smooth and rough, with and without coat, of one roughness and of any.
fn blends() -> Vec<Case> {
    let coated = COATS.iter().map(|(alpha, coat)| (*alpha, Some(coat.at(0.0)), "coat"));
    let varying = [0.03, 0.15].map(|alpha| (Some(alpha), Some(ANY_COAT.at(alpha)), "varying coat"));
    let bare = [None, Some(0.25)].map(|alpha| (alpha, None, "bare"));
    coated
        .chain(varying)
        .chain(bare)
        .map(|(alpha, coat, kind)| Case {
            name: format!("blend, {kind} {alpha:?}"),
            alpha,
            bsdf: blend(Rgb::new(0.8, 0.4, 0.1), 0.3, coat, alpha),
            wo: directions(),
        })
        .collect()
}

fn blend<'a>(color: Rgb, metallic: f32, coat: Option<CoatPoint<'a>>, alpha: Option<f32>) -> Bsdf<'a> {
    let bare = || alpha.map_or(Layer::Bare, |alpha| Layer::Facets(ANY_FACETS.at(alpha)));
    Bsdf::Blend(Blend::new(color, metallic, 0.6, coat.map_or_else(bare, Layer::Coat)))
}

/// A sheet of glass of slope `alpha` and a tint.
fn sheet((alpha, tint): (f32, Rgb)) -> Case {
    Case { name: format!("sheet {alpha}"), alpha: Some(alpha), bsdf: thin(alpha, tint), wo: directions() }
}

fn thin(alpha: f32, tint: Rgb) -> Bsdf<'static> {
    let facets = Some(keep(Facets::new(alpha)).at(alpha));
    Bsdf::Thin(Thin { eta: ETA, average: average_reflectance(ETA), tint, facets })
}

/// Tests of one kind over all models.
fn n_tests() -> usize {
    CASES.iter().map(|c| c.wo.len() * c.modes().len()).sum()
}

/// Directions as a rectangle: (1 − cos θ, φ), whose area is solid angle. Near
/// the poles 1 − cos θ is taken from the sine, which has the digits.
fn domain() -> Rect {
    Rect { lo: [0.0, -PI], hi: [2.0, PI] }
}

fn locate(w: Vec3) -> [f64; 2] {
    let w = w.as_dvec3();
    let versine = (w.x * w.x + w.y * w.y) / (1.0 + w.z.abs());
    [if w.z > 0.0 { versine } else { 2.0 - versine }, w.y.atan2(w.x)]
}

fn point([h, phi]: [f64; 2]) -> Vec3 {
    let sin = (h * (2.0 - h)).max(0.0).sqrt();
    Vec3::new((sin * phi.cos()) as f32, (sin * phi.sin()) as f32, (1.0 - h) as f32)
}

/// Cells for the directions that `sample` draws, split at the horizon.
fn partition(random: &mut Random, mut sample: impl FnMut(&mut Random) -> Option<Vec3>) -> Partition {
    let pilot: Vec<_> = (0..N_PILOT).filter_map(|_| sample(random)).map(locate).collect();
    Partition::new(domain(), &pilot, DEPTH, &[(0, 1.0)])
}

/// What one mode of one direction of a case gave.
struct Sampled {
    counts: Counts,
    /// f·cos/pdf of lobes that are not delta, and of all.
    smooth: Moments,
    total: Moments,
}

/// Samples a case from a direction.
fn draw(case: &Case, wo: Vec3, mode: TransportMode, partition: &Partition, random: &mut Random) -> Sampled {
    let Case { name, bsdf, .. } = case;
    let mut out =
        Sampled { counts: Counts::new(partition), smooth: Moments::default(), total: Moments::default() };
    for i in 0..N {
        let s = bsdf.sample(wo, random.next(), random.next_2d(), mode);
        let weight = s.map_or(0.0, |s| f64::from(luminance(s.f.at(1.0)) * s.wi.z.abs() / s.pdf.0));
        assert!(weight.is_finite() && weight >= 0.0, "{name} {wo} {mode:?}: {s:?}");
        out.total.push(weight);
        match s {
            Some(s) if !s.delta => {
                if i % 16 == 0 {
                    let e = bsdf.evaluate(wo, s.wi, mode);
                    assert_eq!((s.f, s.pdf, s.pdf_rev), (e.value, e.pdf, e.pdf_rev), "{name} {wo} {mode:?}");
                    // Half vectors of exchanged directions round apart; a lobe of slope .03 has a thousand
                    // times that.
                    let reverse = bsdf.pdf(s.wi, wo).0;
                    assert!((s.pdf_rev.0 - reverse).abs() <= 1e-4 * reverse, "{name} {wo} {mode:?}");
                }
                assert!(s.pdf.0 > 0.0 && (s.wi.length() - 1.0).abs() < 1e-5);
                out.counts.cells[partition.find(locate(s.wi))] += 1;
                out.smooth.push(weight);
            }
            _ => {
                out.counts.absorbed += 1;
                out.smooth.push(0.0);
            }
        }
    }
    out
}

/// Samples a case and tests the counts against the density, and the mean of
/// f·cos/pdf against the integral of f·cos; what failed.
fn check(index: usize, case: &Case) -> Vec<String> {
    let (level, threshold) = (sidak_level(0.01, n_tests()), sidak_z(0.01, n_tests()));
    let mut failures = Vec::new();
    let Case { name, bsdf, .. } = case;
    for (j, &wo) in case.wo.iter().enumerate() {
        let mut random = Random::new(&[1, index as u64, j as u64]);
        let partition = partition(&mut random, |r| {
            bsdf.sample(wo, r.next(), r.next_2d(), Radiance).filter(|s| !s.delta).map(|s| s.wi)
        });
        // Density, and f·cos in both modes.
        let integrals = partition.integrals(&|x| {
            let wi = point(x);
            let s = bsdf.evaluate(wo, wi, Radiance);
            let other = if case.modes().len() > 1 { bsdf.f(wo, wi, Importance) } else { s.value };
            let [radiance, importance] =
                [s.value, other].map(|f| f64::from(luminance(f.at(1.0)) * wi.z.abs()));
            [f64::from(s.pdf.0), radiance, importance]
        });
        let probabilities: Vec<f64> = integrals.iter().map(|c| c[0]).collect();
        for (m, &mode) in case.modes().iter().enumerate() {
            let Sampled { counts, smooth, total } = draw(case, wo, mode, &partition, &mut random);
            let p = counts.p_value(&probabilities);
            let albedo: f64 = integrals.iter().map(|c| c[1 + m]).sum();
            // A constant weight has no noise: what remains is the quadrature's error.
            let z = (smooth.mean() - albedo) / (smooth.variance_of_mean() + 1e-10).sqrt();
            let what = format!("{name} wo.z {:.3} {mode:?}: p {p:.1e}, albedo {albedo:.5}, z {z:.2}", wo.z);
            println!("{what}, ∫pdf {:.6}, with delta {:.5}", probabilities.iter().sum::<f64>(), total.mean());
            // Radiance grows by η² on the way out of glass; importance is energy.
            let gains = matches!(bsdf, Bsdf::Dielectric(_)) && mode == Radiance;
            let delta = total.mean() - smooth.mean();
            let bound = 1.0 + threshold * total.variance_of_mean().sqrt() + 2e-3;
            if p < level || z.abs() > threshold || (!gains && albedo + delta > bound) {
                failures.push(what);
            }
        }
    }
    failures
}

fn check_all(kind: &str) {
    let cases = CASES.iter().enumerate().filter(|(_, c)| c.name.starts_with(kind));
    let failures: Vec<String> = cases.flat_map(|(i, case)| check(i, case)).collect();
    assert!(failures.is_empty(), "{failures:#?}");
}

#[test]
fn diffuse_samples_follow_their_density() {
    check_all("diffuse");
}

#[test]
fn conductor_samples_follow_their_density() {
    check_all("conductor");
}

#[test]
fn dielectric_samples_follow_their_density() {
    check_all("dielectric");
}

#[test]
fn plastic_samples_follow_their_density() {
    check_all("plastic");
}

#[test]
fn blend_samples_follow_their_density() {
    check_all("blend");
}

#[test]
fn samples_of_a_sheet_follow_their_density() {
    check_all("sheet");
}

/// Samples of `bsdf` against a density that is not theirs.
fn p_value_of(bsdf: &Bsdf, wo: Vec3, density: impl Fn(Vec3) -> f32) -> f64 {
    let mut random = Random::new(&[2]);
    let mut sample = |r: &mut Random| bsdf.sample(wo, r.next(), r.next_2d(), Radiance).map(|s| s.wi);
    let partition = partition(&mut random, &mut sample);
    let probabilities: Vec<f64> =
        partition.integrals(&|x| [f64::from(density(point(x)))]).iter().map(|c| c[0]).collect();
    let mut counts = Counts::new(&partition);
    for _ in 0..N {
        match sample(&mut random) {
            Some(wi) => counts.cells[partition.find(locate(wi))] += 1,
            None => counts.absorbed += 1,
        }
    }
    counts.p_value(&probabilities)
}

#[test]
fn wrong_densities_are_rejected() {
    let level = sidak_level(0.01, n_tests());
    let wo = direction(35.0, 0.4);
    let follows = |bsdf: &Bsdf, density: &dyn Fn(Vec3) -> f32| {
        let [own, other] = [p_value_of(bsdf, wo, |wi| bsdf.pdf(wo, wi).0), p_value_of(bsdf, wo, density)];
        println!("own density: p {own:.2}, the other: {other:.1e}");
        assert!(own > level, "{own}");
        other > level
    };
    // An exponent that is off by a twentieth, normalised.
    let exponent = 1.05_f32;
    let altered = |wi: Vec3| wi.z.max(0.0).powf(exponent) * (exponent + 1.0) / (2.0 * PI as f32);
    assert!(!follows(&CASES[0].bsdf, &altered));

    let white = metal(Rgb::ONE, 0.25);
    // The Jacobian of reflection with the wrong cosine.
    let jacobian = |wi: Vec3| white.pdf(wo, wi).0 * wo.dot((wo + wi).normalize()) / wo.z;
    assert!(!follows(&white, &jacobian));
    // A slope that is off by a twentieth.
    let rougher = metal(Rgb::ONE, 0.2625);
    assert!(!follows(&white, &|wi| rougher.pdf(wo, wi).0));
    // Light between facets left out, the rest chosen always.
    let single = |wi: Vec3| if wi.z > 0.0 { Ggx::new(0.25).reflection(wo, wi).pdf } else { 0.0 };
    assert!(!follows(&white, &single));

    let glass = glass(0.25);
    // Refraction's Jacobian without its η².
    let refraction = |wi: Vec3| glass.pdf(wo, wi).0 / if wi.z < 0.0 { ETA * ETA } else { 1.0 };
    assert!(!follows(&glass, &refraction));

    let (coat, color) = (Some(ANY_COAT.at(0.25)), Rgb::new(0.8, 0.4, 0.1));
    let blended = blend(color, 0.3, coat, Some(0.25));
    // Lobes chosen as if there were a little more metal.
    let more = blend(color, 0.33, coat, Some(0.25));
    assert!(!follows(&blended, &|wi| more.pdf(wo, wi).0));
}

/// Weights f·cos/pdf of the lobes that `uc` = 0 and `uc` → 1 choose, with their probabilities.
fn delta_lobes(bsdf: &Bsdf, wo: Vec3, mode: TransportMode) -> Vec<(f64, f64, Vec3)> {
    let mut out: Vec<(f64, f64, Vec3)> = Vec::new();
    for uc in [0.0, ONE_MINUS_EPSILON] {
        if let Some(s) = bsdf.sample(wo, uc, Vec2::splat(0.4), mode).filter(|s| s.delta) {
            let value = f64::from(s.f.at(1.0).x) * f64::from(s.wi.z.abs());
            if out.iter().all(|o| o.2 != s.wi) {
                out.push((value, f64::from(s.pdf.0), s.wi));
            }
        }
    }
    out
}
