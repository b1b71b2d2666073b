//! Reciprocity, and both modes of transport as one operator.

use std::f64::consts::PI;

use glam::Vec3;
use lightopt_embree::{
    bsdf::{
        Bsdf, Conductor, Facets, Glass, GlassTint,
        TransportMode::{self, Importance, Radiance},
        microfacet::Ggx,
    },
    math::{
        Rgb,
        stats::{Moments, sidak_z},
    },
};

use super::{CASES, Case, ETA, N, delta_lobes, keep, metal};
use crate::support::random::Random;

/// Two values of what should be one, as f32 arithmetic gives them.
fn assert_close(what: &str, a: f32, b: f32, relative: f32) {
    assert!((a - b).abs() <= relative * a.abs().max(b.abs()) + 1e-6, "{what}: {a} {b}");
}

#[test]
fn scattering_is_reciprocal_and_the_modes_are_adjoint() {
    for Case { name, alpha, bsdf, .. } in CASES.iter() {
        let glass = matches!(bsdf, Bsdf::Dielectric(_));
        let passes = glass || matches!(bsdf, Bsdf::Thin(_));
        let mut random = Random::new(&[3]);
        let (mut n_reflected, mut n_transmitted) = (0, 0);
        for _ in 0..30_000 {
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
            // A sheet turns what it reflects over.
            let is_turned = wo.z * wi.z < 0.0 && !glass;
            let seen = if is_turned { wi * Vec3::new(1.0, 1.0, -1.0) } else { wi };
            let wm = (wo * eta(wo) + seen * eta(wi)).normalize();
            let cos = wo.dot(wm).abs().min(seen.dot(wm).abs());
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
        assert!(n_reflected > 2_000 && (n_transmitted > 2_000) == passes, "{name}");
    }
}

fn smooth_glass() -> Bsdf<'static> {
    Bsdf::Dielectric(keep(Glass::smooth(ETA)).at(0.0))
}

#[test]
fn smooth_refraction_is_adjoint() {
    let glass = smooth_glass();
    let mut random = Random::new(&[4]);
    let mut n = 0;
    for _ in 0..10_000 {
        let a = random.direction();
        let Some(&(forth, _, b)) = delta_lobes(&glass, a, Importance).iter().find(|l| l.2.z * a.z < 0.0)
        else {
            continue;
        };
        let back = delta_lobes(&glass, b, Radiance);
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
    let mut cases: Vec<(&str, Bsdf)> = CASES.iter().map(|c| (c.name.as_str(), c.bsdf)).collect();
    cases.push(("glass", smooth_glass()));
    let tint = GlassTint { reflected: Rgb::splat(0.6), transmitted: Rgb::splat(0.8) };
    for (name, glass) in
        [("tinted glass", Glass::smooth(ETA)), ("tinted rough glass", Glass::rough(ETA, 0.3))]
    {
        cases.push((name, Bsdf::Dielectric(keep(glass).at(0.3).tinted(tint))));
    }
    let facets = Some(keep(Facets::new(0.3)).at(0.3));
    cases.push((
        "metal of a dark edge",
        Bsdf::Conductor(Conductor::tinted(Rgb::ONE, Rgb::splat(0.3), 1.0, facets)),
    ));
    cases.push(("mirror", Bsdf::Conductor(Conductor::new(Rgb::splat(0.5), 0.5, None))));
    // The narrowest lobes, too narrow to be integrated as densities.
    let narrowest = keep(Glass::rough(ETA, Ggx::MIN_ALPHA)).at(0.0);
    cases.push(("narrowest glass", Bsdf::Dielectric(narrowest)));
    cases.push(("narrowest conductor", metal(Rgb::splat(0.5), Ggx::MIN_ALPHA)));
    let threshold = sidak_z(0.01, cases.len());
    for (name, bsdf) in cases {
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
