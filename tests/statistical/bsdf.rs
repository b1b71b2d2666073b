//! Scattering functions: sampling against density, energy and symmetry.

use std::{f64::consts::PI, sync::LazyLock};

use glam::{Vec2, Vec3};
use lightopt_embree::{
    bsdf::{
        Blend, Bsdf, Coat, CoatPoint, Conductor, Dielectric, Diffuse, Plastic,
        TransportMode::{self, Importance, Radiance},
        microfacet::Ggx,
    },
    math::{
        ONE_MINUS_EPSILON, Rgb, luminance,
        stats::{Moments, sidak_z},
    },
    scene::{
        Material,
        material::{Coats, MaterialParams, Model},
    },
};

use crate::support::{
    chi2::{Counts, Partition, Rect, sidak_level},
    quadrature::integrate_1d,
    random::Random,
    scenes::params,
};

/// Samples per model, direction and mode.
const N: u32 = 1 << 18;
/// Samples that shape the cells of a χ² test.
const N_PILOT: u32 = 1 << 14;
/// Levels of its k-d tree: 2 · 2⁷ cells at most.
const DEPTH: u32 = 7;
const MODES: [TransportMode; 2] = [Radiance, Importance];
const ETA: f32 = 1.5;

/// A model and the directions it is tested from.
struct Case {
    name: String,
    alpha: Option<f32>,
    bsdf: Bsdf<'static>,
    wo: Vec<Vec3>,
}

/// Coats: smooth and of three slopes.
static COATS: LazyLock<Vec<(Option<f32>, Coat)>> = LazyLock::new(|| {
    [None, Some(0.05), Some(0.25), Some(0.8)].map(|alpha| (alpha, Coat::new(ETA, alpha))).into()
});

/// A coat whose roughness varies.
static ANY_COAT: LazyLock<Coat> = LazyLock::new(|| Coat::of_any_roughness(ETA));

/// Where its slope is `alpha`.
fn any_coat(alpha: f32) -> CoatPoint<'static> {
    ANY_COAT.at(alpha)
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

/// From inside glass: the critical angle is 41.8°.
fn directions_inside() -> Vec<Vec3> {
    [0.0, 38.0, 41.5, 44.0, 85.0].map(|d| direction(180.0 - d, 0.7 + d)).into()
}

fn diffuse() -> Vec<Case> {
    let bsdf = Bsdf::Diffuse(Diffuse { albedo: Rgb::new(0.9, 0.5, 0.2) });
    vec![Case { name: "diffuse".into(), alpha: None, bsdf, wo: directions() }]
}

fn conductor() -> Vec<Case> {
    [0.02, 0.2, 1.0]
        .map(|alpha| Case {
            name: format!("conductor {alpha}"),
            alpha: Some(alpha),
            bsdf: Bsdf::Conductor(Conductor { f0: Rgb::new(0.95, 0.7, 0.3), ggx: Some(Ggx::new(alpha)) }),
            wo: directions(),
        })
        .into()
}

fn dielectric() -> Vec<Case> {
    [0.03, 0.25, 1.0]
        .map(|alpha| Case {
            name: format!("dielectric {alpha}"),
            alpha: Some(alpha),
            bsdf: Bsdf::Dielectric(Dielectric { eta: ETA, ggx: Some(Ggx::new(alpha)) }),
            wo: [directions(), directions_inside()].concat(),
        })
        .into()
}

fn plastic() -> Vec<Case> {
    COATS
        .iter()
        .map(|(alpha, coat)| Case {
            name: format!("plastic {alpha:?}"),
            alpha: *alpha,
            bsdf: Bsdf::Plastic(Plastic::new(Rgb::new(0.8, 0.4, 0.1), coat)),
            wo: directions(),
        })
        .collect()
}

/// Mixtures: smooth and rough, with and without coat, of one roughness and of any.
fn blend() -> Vec<Case> {
    let coated = COATS.iter().map(|(alpha, coat)| (*alpha, Some(coat.constant()), "coat"));
    let varying = [0.03, 0.15].map(|alpha| (Some(alpha), Some(any_coat(alpha)), "varying coat"));
    let bare = [None, Some(0.25)].map(|alpha| (alpha, None, "bare"));
    coated
        .chain(varying)
        .chain(bare)
        .map(|(alpha, coat, kind)| Case {
            name: format!("blend, {kind} {alpha:?}"),
            alpha,
            bsdf: blend_of(Rgb::new(0.8, 0.4, 0.1), 0.3, coat, alpha),
            wo: directions(),
        })
        .collect()
}

fn blend_of(color: Rgb, metallic: f32, coat: Option<CoatPoint<'_>>, alpha: Option<f32>) -> Bsdf<'_> {
    Bsdf::Blend(Blend::new(color, metallic, 0.6, coat, alpha.map(Ggx::new)))
}

fn all() -> Vec<Case> {
    [diffuse(), conductor(), dielectric(), plastic(), blend()].into_iter().flatten().collect()
}

/// Tests of one kind over all models.
fn n_tests() -> usize {
    all().iter().map(|c| c.wo.len() * MODES.len()).sum()
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

/// Samples every case and tests the counts against the density, and the mean
/// of f·cos/pdf against the integral of f·cos.
fn check(cases: &[Case]) {
    let (level, threshold) = (sidak_level(0.01, n_tests()), sidak_z(0.01, n_tests()));
    let mut failures = Vec::new();
    for (i, Case { name, bsdf, wo, .. }) in cases.iter().enumerate() {
        for (j, &wo) in wo.iter().enumerate() {
            let mut random = Random::new(&[1, i as u64, j as u64]);
            let partition = partition(&mut random, |r| {
                bsdf.sample(wo, r.next(), r.next_2d(), Radiance).filter(|s| !s.delta).map(|s| s.wi)
            });
            // Density, and f·cos in both modes.
            let integrals = partition.integrals(&|x| {
                let wi = point(x);
                let f = MODES.map(|m| f64::from(luminance(bsdf.f(wo, wi, m).at(1.0)) * wi.z.abs()));
                [f64::from(bsdf.pdf(wo, wi).0), f[0], f[1]]
            });
            let probabilities: Vec<f64> = integrals.iter().map(|c| c[0]).collect();
            for (m, mode) in MODES.into_iter().enumerate() {
                let mut counts = Counts::new(&partition);
                let (mut smooth, mut total) = (Moments::default(), Moments::default());
                for _ in 0..N {
                    let s = bsdf.sample(wo, random.next(), random.next_2d(), mode);
                    let weight =
                        s.map_or(0.0, |s| f64::from(luminance(s.f.at(1.0)) * s.wi.z.abs() / s.pdf.0));
                    assert!(weight.is_finite() && weight >= 0.0, "{name} {wo} {mode:?}: {s:?}");
                    total.push(weight);
                    match s {
                        Some(s) if !s.delta => {
                            assert_eq!(s.f, bsdf.f(wo, s.wi, mode), "{name} {wo} {mode:?}");
                            assert_eq!(s.pdf, bsdf.pdf(wo, s.wi), "{name} {wo} {mode:?}");
                            assert!(s.pdf.0 > 0.0);
                            assert!((s.wi.length() - 1.0).abs() < 1e-5);
                            counts.cells[partition.find(locate(s.wi))] += 1;
                            smooth.push(weight);
                        }
                        _ => {
                            counts.absorbed += 1;
                            smooth.push(0.0);
                        }
                    }
                }
                let p = counts.p_value(&probabilities);
                let albedo: f64 = integrals.iter().map(|c| c[1 + m]).sum();
                // A constant weight has no noise: what remains is the quadrature's error.
                let z = (smooth.mean() - albedo) / (smooth.variance_of_mean() + 1e-10).sqrt();
                println!(
                    "{name} wo.z {:.3} {mode:?}: p {p:.4}, ∫pdf {:.6}, albedo {albedo:.5}, z {z:.2}, with delta {:.5}",
                    wo.z,
                    probabilities.iter().sum::<f64>(),
                    total.mean()
                );
                if p < level {
                    failures.push(format!("{name} {wo} {mode:?}: p {p:.1e}"));
                }
                if z.abs() > threshold {
                    failures.push(format!(
                        "{name} {wo} {mode:?}: mean weight {} integral {albedo}, z {z:.2}",
                        smooth.mean()
                    ));
                }
                // Radiance grows by η² on the way out of glass; importance is energy.
                let gains = matches!(bsdf, Bsdf::Dielectric(_)) && mode == Radiance;
                let delta = total.mean() - smooth.mean();
                if !gains && albedo + delta > 1.0 + threshold * total.variance_of_mean().sqrt() + 1e-5 {
                    failures.push(format!("{name} {wo} {mode:?}: gains energy, {}", albedo + delta));
                }
            }
        }
    }
    assert!(failures.is_empty(), "{failures:#?}");
}

#[test]
fn diffuse_samples_follow_their_density() {
    check(&diffuse());
}

#[test]
fn conductor_samples_follow_their_density() {
    check(&conductor());
}

#[test]
fn dielectric_samples_follow_their_density() {
    check(&dielectric());
}

#[test]
fn plastic_samples_follow_their_density() {
    check(&plastic());
}

#[test]
fn blend_samples_follow_their_density() {
    check(&blend());
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
    let diffuse = diffuse().remove(0).bsdf;
    assert!(p_value_of(&diffuse, wo, |wi| diffuse.pdf(wo, wi).0) > level);
    // An exponent that is off by a twentieth, normalised.
    let exponent = 1.05_f32;
    let altered = |wi: Vec3| wi.z.max(0.0).powf(exponent) * (exponent + 1.0) / (2.0 * PI as f32);
    assert!(p_value_of(&diffuse, wo, altered) < level);

    let ggx = Ggx::new(0.25);
    let metal = Bsdf::Conductor(Conductor { f0: Rgb::ONE, ggx: Some(ggx) });
    assert!(p_value_of(&metal, wo, |wi| metal.pdf(wo, wi).0) > level);
    // The Jacobian of reflection with the wrong cosine.
    let jacobian = |wi: Vec3| metal.pdf(wo, wi).0 * wo.dot((wo + wi).normalize()) / wo.z;
    assert!(p_value_of(&metal, wo, jacobian) < level);
    // A slope that is off by a twentieth.
    let rougher = Bsdf::Conductor(Conductor { f0: Rgb::ONE, ggx: Some(Ggx::new(0.2625)) });
    assert!(p_value_of(&metal, wo, |wi| rougher.pdf(wo, wi).0) < level);

    let glass = Bsdf::Dielectric(Dielectric { eta: ETA, ggx: Some(ggx) });
    assert!(p_value_of(&glass, wo, |wi| glass.pdf(wo, wi).0) > level);
    // Refraction's Jacobian without its η².
    let refraction = |wi: Vec3| glass.pdf(wo, wi).0 / if wi.z < 0.0 { ETA * ETA } else { 1.0 };
    assert!(p_value_of(&glass, wo, refraction) < level);

    let (coat, color) = (Some(any_coat(0.25)), Rgb::new(0.8, 0.4, 0.1));
    let blend = blend_of(color, 0.3, coat, Some(0.25));
    assert!(p_value_of(&blend, wo, |wi| blend.pdf(wo, wi).0) > level);
    // Lobes chosen as if there were a little more metal.
    let metal = blend_of(color, 0.33, coat, Some(0.25));
    assert!(p_value_of(&blend, wo, |wi| metal.pdf(wo, wi).0) < level);
}

/// Weights f·cos/pdf of the lobes that `uc` = 0 and `uc` → 1 choose, with their probabilities.
fn lobes(bsdf: &Bsdf, wo: Vec3, mode: TransportMode) -> Vec<(f64, f64, Vec3)> {
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

#[test]
fn smooth_models_without_absorption_lose_nothing() {
    let mirror = Bsdf::Conductor(Conductor { f0: Rgb::ONE, ggx: None });
    let glass = Bsdf::Dielectric(Dielectric { eta: ETA, ggx: None });
    for wo in [directions(), directions_inside(), vec![direction(89.99, 1.0), direction(90.01, 1.0)]].concat()
    {
        for mode in MODES {
            let m = lobes(&mirror, wo, mode);
            assert_eq!(m.len(), 1);
            assert!((m[0].0 - 1.0).abs() < 1e-6 && m[0].1 == 1.0, "{wo}");
            assert_eq!(m[0].2, Vec3::new(-wo.x, -wo.y, wo.z));

            let lobes = lobes(&glass, wo, mode);
            let sum =
                |scale: &dyn Fn(Vec3) -> f64| lobes.iter().map(|&(f, _, wi)| f * scale(wi)).sum::<f64>();
            // Importance is energy. Radiance over η² is what a refraction keeps.
            let eta = |w: Vec3| f64::from(if w.z > 0.0 { 1.0 } else { ETA });
            let total = match mode {
                Importance => sum(&|_| 1.0),
                Radiance => sum(&|wi| (eta(wi) / eta(wo)).powi(2)),
            };
            assert!((total - 1.0).abs() < 1e-6, "{wo} {mode:?}: {total}");
            assert!((lobes.iter().map(|l| l.1).sum::<f64>() - 1.0).abs() < 1e-6);
        }
    }
    // Diffuse under a smooth coat, also in part and with metal: the base returns all that enters.
    let plastic = Bsdf::Plastic(Plastic::new(Rgb::ONE, &COATS[0].1));
    let blend = blend_of(Rgb::ONE, 0.3, Some(COATS[0].1.constant()), None);
    for (wo, bsdf) in directions().into_iter().flat_map(|wo| [(wo, plastic), (wo, blend)]) {
        let coat = lobes(&bsdf, wo, Radiance).iter().map(|l| l.0).sum::<f64>();
        let side = f64::from(wo.z.signum());
        let base = integrate_1d(0.0, 1.0, 64, |mu| {
            // The cosine is squared so that the grazing end, where R is steep, gets more nodes.
            let cos = mu * mu;
            let wi = Vec3::new((1.0 - cos * cos).sqrt() as f32, 0.0, (side * cos) as f32);
            f64::from(bsdf.f(wo, wi, Radiance).at(1.0).x) * cos * 2.0 * PI * 2.0 * mu
        });
        println!("smooth coat, albedo 1, wo.z {:.3}: {:.7}", wo.z, coat + base);
        assert!((coat + base - 1.0).abs() < 2e-6, "{wo}: {}", coat + base);
    }
}

#[test]
fn white_rough_models_gain_nothing() {
    // Scattering between facets is left out: they lose, they must not gain.
    let mut random = Random::new(&[8]);
    for alpha in [0.05, 0.3, 1.0] {
        let ggx = Some(Ggx::new(alpha));
        let mirror = Bsdf::Conductor(Conductor { f0: Rgb::ONE, ggx });
        let coat = Coat::new(ETA, Some(alpha));
        let white = Bsdf::Plastic(Plastic::new(Rgb::ONE, &coat));
        let varying = any_coat(alpha);
        let any = Bsdf::Plastic(Plastic { albedo: Rgb::ONE, sampling_albedo: 1.0, coat: varying });
        let blend = blend_of(Rgb::ONE, 0.3, Some(varying), Some(alpha));
        for wo in directions() {
            for bsdf in [&mirror, &white, &any, &blend] {
                let mut m = Moments::default();
                for _ in 0..N / 8 {
                    let s = bsdf.sample(wo, random.next(), random.next_2d(), Radiance);
                    m.push(s.map_or(0.0, |s| f64::from(s.f.at(1.0).x * s.wi.z.abs() / s.pdf.0)));
                }
                let bound = 1.0 + sidak_z(0.01, 60) * m.variance_of_mean().sqrt() + 1e-5;
                assert!(m.mean() <= bound, "alpha {alpha} {wo}: {}", m.mean());
            }
        }
    }
}

/// Two values of what should be one, as f32 arithmetic gives them.
fn assert_close(what: &str, a: f32, b: f32, relative: f32) {
    assert!((a - b).abs() <= relative * a.abs().max(b.abs()) + 1e-6, "{what}: {a} {b}");
}

#[test]
fn scattering_is_reciprocal_and_the_modes_are_adjoint() {
    for Case { name, alpha, bsdf, .. } in all() {
        let glass = matches!(bsdf, Bsdf::Dielectric(_));
        let mut random = Random::new(&[3]);
        let (mut n_reflected, mut n_transmitted) = (0, 0);
        for _ in 0..200_000 {
            // A pair that matters: one direction is sampled from the other.
            let wo = random.direction();
            let Some(s) = bsdf.sample(wo, random.next(), random.next_2d(), Radiance).filter(|s| !s.delta)
            else {
                continue;
            };
            let wi = s.wi;
            let eta = |w: Vec3| if w.z < 0.0 && glass { ETA } else { 1.0 };
            // Rounding of f32: a lobe of slope α sees that of the half vector over α; the cosine
            // past a refraction, a square root, has that of its square.
            let wm = (wo * eta(wo) + wi * eta(wi)).normalize();
            let cos = wo.dot(wm).abs().min(wi.dot(wm).abs());
            // Near total reflection dR/dcos θ is about 10 / cos θ_t, and cos θ is off by some 6e-7.
            let beyond = if wo.z < 0.0 && glass { ETA } else { 1.0 / ETA };
            let past = (1.0 - beyond * beyond * (1.0 - wo.dot(wm).powi(2))).abs().sqrt().max(1e-3);
            let tolerance = 2e-5 + 2e-6 / alpha.unwrap_or(1.0) + 1e-6 / (cos * cos) + 6e-6 / past;
            let what = format!("{name} {wo} {wi}, tolerance {tolerance}");
            let f = |a, b, mode| bsdf.f(a, b, mode).at(1.0).x;
            // f_I(a, b) holds light that arrives along a and leaves along b: f_R(b, a).
            assert_close(&what, f(wo, wi, Importance), f(wi, wo, Radiance), tolerance);
            if wo.z * wi.z > 0.0 {
                n_reflected += 1;
                assert_close(&what, f(wo, wi, Radiance), f(wi, wo, Radiance), tolerance);
                assert_eq!(f(wo, wi, Radiance), f(wo, wi, Importance));
            } else {
                n_transmitted += 1;
                // f/η² is symmetric, η on the side of the light. [Veach97] eq. 5.14
                let (a, b) = (f(wo, wi, Radiance) * eta(wi).powi(2), f(wi, wo, Radiance) * eta(wo).powi(2));
                assert_close(&what, a, b, tolerance);
            }
        }
        assert!(n_reflected > 10_000 && (n_transmitted > 10_000) == glass, "{name}");
    }
}

#[test]
fn smooth_refraction_is_adjoint() {
    let glass = Bsdf::Dielectric(Dielectric { eta: ETA, ggx: None });
    let mut random = Random::new(&[4]);
    let mut n = 0;
    for _ in 0..10_000 {
        let a = random.direction();
        let Some(&(forth, _, b)) = lobes(&glass, a, Importance).iter().find(|l| l.2.z * a.z < 0.0) else {
            continue;
        };
        let back = lobes(&glass, b, Radiance);
        let Some(&(back, _, c)) = back.iter().find(|l| l.2.z * b.z < 0.0) else { continue };
        n += 1;
        // Past a refraction the cosine, a square root, has the rounding of its square.
        let cos = a.z.abs().min(b.z.abs());
        if cos < 0.01 {
            continue;
        }
        assert!((a - c).length() < 1e-6 / cos, "{a} {c}");
        // f_I(a, b) = f_R(b, a) as distributions, over projected solid angle. With
        // η_a² |cos a| dω_a = η_b² |cos b| dω_b the weights differ by (η_b/η_a)².
        let eta = |w: Vec3| f64::from(if w.z > 0.0 { 1.0 } else { ETA });
        let ratio = forth * (eta(b) / eta(a)).powi(2) / back;
        assert!((ratio - 1.0).abs() < 1e-6 / f64::from(cos * cos), "{a}: {forth} {back}");
    }
    assert!(n > 5_000);
}

/// ∬ g(a) f_I(a, b) h(b) over projected solid angles, sampled from `a` in one
/// mode or from `b` in the other, is one number.
#[test]
fn sampling_in_both_modes_measures_one_operator() {
    let g = |a: Vec3| f64::from(1.0 + 0.7 * a.x + 0.6 * a.z + 0.5 * a.x * a.y);
    let h = |b: Vec3| f64::from(1.0 - 0.4 * b.y + 0.8 * b.x * b.z - 0.5 * b.z);
    let mut cases = all();
    cases.push(Case {
        name: "glass".into(),
        alpha: None,
        bsdf: Bsdf::Dielectric(Dielectric { eta: ETA, ggx: None }),
        wo: vec![],
    });
    cases.push(Case {
        name: "mirror".into(),
        alpha: None,
        bsdf: Bsdf::Conductor(Conductor { f0: Rgb::splat(0.5), ggx: None }),
        wo: vec![],
    });
    // The narrowest lobes, too narrow to be integrated as densities.
    let ggx = Some(Ggx::new(Ggx::MIN_ALPHA));
    cases.push(Case {
        name: "narrowest glass".into(),
        alpha: None,
        bsdf: Bsdf::Dielectric(Dielectric { eta: ETA, ggx }),
        wo: vec![],
    });
    cases.push(Case {
        name: "narrowest conductor".into(),
        alpha: None,
        bsdf: Bsdf::Conductor(Conductor { f0: Rgb::splat(0.5), ggx }),
        wo: vec![],
    });
    let threshold = sidak_z(0.01, cases.len());
    for Case { name, bsdf, .. } in cases {
        let mut random = Random::new(&[5]);
        let mut measure = |mode: TransportMode, from: &dyn Fn(Vec3) -> f64, to: &dyn Fn(Vec3) -> f64| {
            let mut m = Moments::default();
            for _ in 0..N {
                let w = random.direction();
                let s = bsdf.sample(w, random.next(), random.next_2d(), mode);
                m.push(s.map_or(0.0, |s| {
                    let scatter = f64::from(s.f.at(1.0).x * s.wi.z.abs() / s.pdf.0);
                    4.0 * PI * f64::from(w.z.abs()) * from(w) * to(s.wi) * scatter
                }));
            }
            m
        };
        let forth = measure(Importance, &g, &h);
        let back = measure(Radiance, &h, &g);
        let z = (forth.mean() - back.mean()) / (forth.variance_of_mean() + back.variance_of_mean()).sqrt();
        println!("{name}: {:.4} {:.4}, z {z:.2}", forth.mean(), back.mean());
        assert!(z.abs() < threshold, "{name}: {} {}", forth.mean(), back.mean());
    }
}

/// Transmittance of a GGX interface, in f64, from facets drawn by their area
/// (\[Walter07\] eqs. 35, 36), not by visibility. `eta` is the IOR beyond over this side's.
fn transmittance(alpha: f64, cos: f64, eta: f64, random: &mut Random, n: u32) -> Moments {
    let wo = glam::DVec3::new((1.0 - cos * cos).max(0.0).sqrt(), 0.0, cos);
    let g1 = |w: glam::DVec3| {
        let tan2 = (1.0 - w.z * w.z).max(0.0) / (w.z * w.z);
        2.0 / (1.0 + (1.0 + alpha * alpha * tan2).sqrt())
    };
    let mut m = Moments::default();
    for _ in 0..n {
        let (u, v) = (f64::from(random.next()), f64::from(random.next()));
        let tan = alpha * (u / (1.0 - u)).sqrt();
        let z = 1.0 / (1.0 + tan * tan).sqrt();
        let (sin_phi, cos_phi) = (2.0 * PI * v).sin_cos();
        let wm = glam::DVec3::new(tan * z * cos_phi, tan * z * sin_phi, z);
        let c = wo.dot(wm);
        let sin2_t = (1.0 - c * c) / (eta * eta);
        if c <= 0.0 || sin2_t >= 1.0 {
            m.push(0.0);
            continue;
        }
        let cos_t = (1.0 - sin2_t).sqrt();
        let wt = -wo / eta + wm * (c / eta - cos_t);
        let (rs, rp) = ((c - eta * cos_t) / (c + eta * cos_t), (eta * c - cos_t) / (eta * c + cos_t));
        let t = 1.0 - 0.5 * (rs * rs + rp * rp);
        m.push(if wt.z < 0.0 { t * g1(wo) * g1(wt) * c / (cos * z) } else { 0.0 });
    }
    m
}

#[test]
fn the_coat_transmits_what_its_facets_transmit() {
    let cosines = [1.0, 0.9, 0.7, 0.5, 0.37, 0.25, 0.14, 0.07];
    let threshold = sidak_z(0.01, cosines.len() * (COATS.len() - 1));
    let mut random = Random::new(&[6]);
    for (alpha, coat) in COATS.iter().filter_map(|(a, c)| Some((f64::from((*a)?), c))) {
        for cos in cosines {
            let m = transmittance(alpha, cos, f64::from(ETA), &mut random, 1 << 19);
            let table = f64::from(coat.transmittance(cos as f32));
            let sd = m.variance_of_mean().sqrt();
            let z = (table - m.mean()) / sd;
            println!("alpha {alpha:.2} cos {cos}: {:.5} ± {sd:.5}, table {table:.5}, z {z:.2}", m.mean());
            assert!(z.abs() < threshold, "alpha {alpha} cos {cos}: {} ± {sd}, table {table}", m.mean());
        }
    }
}

#[test]
fn a_factor_on_the_base_colour_is_the_colour_with_that_factor() {
    let mut random = Random::new(&[7]);
    for i in 0..10_000 {
        let (mut wo, mut wi) = (random.direction(), random.direction());
        if i == 0 {
            (wo, wi) = (direction(20.0, 0.0), direction(60.0, 1.0));
        }
        let color = Rgb::new(random.next(), random.next(), random.next());
        let v = random.next();
        // All select their lobes by the same brightness.
        let check = |of: &dyn Fn(Rgb) -> Bsdf<'static>| {
            let (whole, scaled) = (of(color), of(color * v));
            let (a, b) = (whole.f(wo, wi, Radiance), scaled.f(wo, wi, Radiance));
            let largest = whole.f(wo, wi, Radiance).at(1.0).x.max(of(Rgb::ONE).f(wo, wi, Radiance).at(1.0).x);
            assert!((a.at(v) - b.at(1.0)).abs().max_element() <= 2e-6 * largest, "{a:?} {b:?}");
            assert_eq!(whole.pdf(wo, wi), scaled.pdf(wo, wi));
        };
        for (_, coat) in COATS.iter() {
            check(&|albedo| Bsdf::Plastic(Plastic { albedo, sampling_albedo: 0.7, coat: coat.constant() }));
        }
        check(&|color| {
            let (ggx, coat) = (Some(Ggx::new(0.15)), Some(any_coat(0.15)));
            Bsdf::Blend(Blend { color, sampling_color: 0.7, metallic: 0.3, specular: 0.6, coat, ggx })
        });
        check(&|f0| Bsdf::Conductor(Conductor { f0, ggx: Some(Ggx::new(0.3)) }));
        check(&|albedo| Bsdf::Diffuse(Diffuse { albedo }));
        // Sampling a material follows its largest value alone.
        if i == 0 {
            for (metallic, specular) in [(0.0, 1.0), (0.3, 0.6)] {
                let params =
                    MaterialParams { metallic, specular, ..params(Model::Plastic, [0.6, 0.3, 0.1], 0.4) };
                let material = Material::new("varnish".into(), params, &mut Coats::default());
                let of = |largest: f32| material.bsdf(Vec2::ZERO, largest).pdf(wo, wi);
                assert_ne!(of(0.2), of(1.5));
            }
        }
    }
}
