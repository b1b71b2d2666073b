//! What scattering functions return of the light.

use std::f64::consts::PI;

use glam::{DVec3, Vec2, Vec3};
use lightopt_embree::{
    bsdf::{
        Affine, Blend, Bsdf, Coat, Conductor, Diffuse, Facets, Glass, GlassTint, Layer, Plastic, Thin,
        TransportMode::{Importance, Radiance},
        microfacet::Ggx,
        thin::average_reflectance,
    },
    math::{
        Rgb,
        stats::{Moments, sidak_z},
    },
};

use super::{
    ANY_COAT, ANY_FACETS, COATS, ETA, MODES, blend, coat, delta_lobes, direction, directions,
    directions_of_glass, glass, keep, metal, partition, point, thin,
};
use crate::support::{quadrature::integrate_1d, random::Random};

/// Slopes from the smallest to the largest, and cosines.
const SLOPES: [f32; 9] = [1e-3, 3e-3, 0.01, 0.03, 0.1, 0.2, 0.35, 0.6, 1.0];
const COSINES: [f32; 6] = [0.05, 0.1, 0.2, 0.4, 0.7, 1.0];
/// How near to 1 an albedo must be that is 1.
const TOLERANCE: f64 = 2e-3;

fn at_cosine(cos: f32) -> Vec3 {
    Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos)
}

/// Directional albedo as energy of a model with facets of slope `alpha`, and with `eta` of
/// glass: what is independent of the base colour and what is proportional to it, first channel.
///
/// By quadrature of f·cos over directions about the mirror's and the refracted one and over the
/// sphere, however narrow the lobe: every direction counts by the density of all points there.
fn albedo(bsdf: &Bsdf, alpha: f32, eta: Option<f32>, wo: Vec3) -> [f64; 2] {
    let points = Points { ggx: Ggx::new(alpha), eta };
    let mut sum = [0.0; 2];
    for u in lattice(4181, 2584) {
        for wi in points.directions(wo, u).into_iter().flatten() {
            let f: Affine = bsdf.f(wo, wi, Importance);
            let weight = f64::from(wi.z.abs() / points.density(wo, wi)) / 4181.0;
            sum = [sum[0] + f64::from(f.coat.x) * weight, sum[1] + f64::from(f.body.x) * weight];
        }
    }
    sum
}

/// Where directions lie that are integrated over.
struct Points {
    ggx: Ggx,
    /// IOR inside over outside, where light passes.
    eta: Option<f32>,
}

impl Points {
    /// Mirrored and refracted at a facet, and on either side of the surface.
    fn directions(&self, wo: Vec3, u: Vec2) -> [Option<Vec3>; 4] {
        let wm = self.ggx.sample_wm(wo, u) * wo.z.signum();
        let c = wo.dot(wm);
        // Grazing directions get more points: μ = u².
        let mu = (u.x * u.x).max(1e-12);
        let (sin_phi, cos_phi) = (2.0 * PI as f32 * u.y).sin_cos();
        let sin = (1.0 - mu * mu).sqrt();
        let spread = Vec3::new(sin * cos_phi, sin * sin_phi, mu * wo.z.signum());
        let beyond = self.beyond(wo);
        let refracted = beyond.map(|e| (e, 1.0 - (1.0 - c * c) / (e * e))).filter(|(_, cos2)| *cos2 > 0.0);
        [
            Some(2.0 * c * wm - wo).filter(|w| w.z * wo.z > 0.0),
            refracted.map(|(e, cos2)| -wo / e + wm * (c / e - cos2.sqrt())).filter(|w| w.z * wo.z < 0.0),
            Some(spread),
            beyond.map(|_| Vec3::new(spread.x, spread.y, -spread.z)),
        ]
    }

    /// IOR beyond over that on the side of `wo`.
    fn beyond(&self, wo: Vec3) -> Option<f32> {
        self.eta.map(|eta| if wo.z > 0.0 { eta } else { 1.0 / eta })
    }

    /// Density of all points together.
    fn density(&self, wo: Vec3, wi: Vec3) -> f32 {
        let spread = 1.0 / (4.0 * PI as f32 * wi.z.abs().sqrt());
        if wo.z * wi.z > 0.0 {
            let [o, i] = [wo, wi].map(|w| w * wo.z.signum());
            return spread + self.ggx.reflection(o, i).pdf;
        }
        let eta = self.beyond(wo).unwrap();
        // [Walter07] eqs. 16 and 17
        let h = -(wo + wi * eta).normalize();
        let wm = if h.z * wo.z < 0.0 { -h } else { h };
        let (c_o, c_i) = (wo.dot(wm), wi.dot(wm));
        if c_o <= 0.0 || c_i >= 0.0 {
            return spread;
        }
        let up = wm * wo.z.signum();
        spread + self.ggx.pdf_wm(wo * wo.z.signum(), up).0 * c_i.abs() / (c_i + c_o / eta).powi(2)
    }
}

/// Points of the unit square; `n` and `step` are neighbours in Fibonacci's sequence.
fn lattice(n: u32, step: u32) -> impl Iterator<Item = Vec2> {
    let over_n = move |k: f64| (k / f64::from(n)) as f32;
    (0..n).map(move |k| Vec2::new(over_n(f64::from(k * step % n)), over_n(f64::from(k) + 0.5)))
}

/// Directional albedo as energy, by adaptive quadrature over directions.
fn integrated_albedo(bsdf: &Bsdf, wo: Vec3) -> [f64; 2] {
    let mut random = Random::new(&[20]);
    let cells = partition(&mut random, |r| bsdf.sample(wo, r.next(), r.next_2d(), Importance).map(|s| s.wi));
    let integrals = cells.integrals(&|x| {
        let wi = point(x);
        let f: Affine = bsdf.f(wo, wi, Importance);
        [f.coat, f.body].map(|f| f64::from(f.x * wi.z.abs()))
    });
    integrals.iter().fold([0.0; 2], |sum, c| [sum[0] + c[0], sum[1] + c[1]])
}

/// Asserts that a directional albedo is 1; how far it is from that.
fn assert_white(what: &str, wo: Vec3, albedo: f64) -> f64 {
    assert!((albedo - 1.0).abs() < TOLERANCE, "{what}, cos {}: {albedo}", wo.z);
    (albedo - 1.0).abs()
}

#[test]
fn a_white_base_is_white_under_any_coat() {
    let mut worst = [0.0_f64; 2];
    for eta in [1.1, 1.5, 2.5] {
        let any = Coat::rough(eta, ANY_FACETS.clone());
        for alpha in SLOPES {
            let one = coat(eta, Some(alpha));
            for (i, coat) in [one.at(alpha), any.at(alpha)].into_iter().enumerate() {
                let what = format!("coat {i}, IOR {eta}, alpha {alpha}");
                for wo in COSINES.map(at_cosine) {
                    let plastic = Plastic::new(Rgb::ONE, coat);
                    let [e, body] = albedo(&Bsdf::Plastic(plastic), alpha, None, wo);
                    worst[i] = worst[i].max(assert_white(&what, wo, e + body));
                    // a + (1 − a) E for another albedo a.
                    let grey = Bsdf::Plastic(Plastic { albedo: Rgb::splat(0.8), ..plastic });
                    let [coat, base] = albedo(&grey, alpha, None, wo);
                    assert!((coat + base - (0.8 + 0.2 * e)).abs() < TOLERANCE, "{what}, cos {}", wo.z);
                }
            }
        }
    }
    println!("worst {worst:.5?}");
}

#[test]
fn white_metal_is_white_at_any_roughness() {
    let mut worst = [0.0_f64; 2];
    for alpha in SLOPES {
        let varying = Bsdf::Conductor(Conductor::new(Rgb::ONE, 1.0, Some(ANY_FACETS.at(alpha))));
        for (i, bsdf) in [metal(Rgb::ONE, alpha), varying].into_iter().enumerate() {
            for wo in COSINES.map(at_cosine) {
                let [coat, body] = albedo(&bsdf, alpha, None, wo);
                let what = format!("metal {i}, alpha {alpha}");
                worst[i] = worst[i].max(assert_white(&what, wo, coat + body));
            }
        }
    }
    println!("worst {worst:.5?}");
}

#[test]
fn clear_glass_loses_nothing_at_any_roughness() {
    let mut worst = [0.0_f64; 2];
    for eta in [1.5, 2.5] {
        let any = Glass::of_any_slope(eta);
        for alpha in SLOPES {
            let one = Glass::rough(eta, alpha);
            for (i, glass) in [one.at(alpha), any.at(alpha)].into_iter().enumerate() {
                for wo in COSINES.map(at_cosine).into_iter().flat_map(|w| [w, -w]) {
                    let what = format!("glass {i}, IOR {eta}, alpha {alpha}");
                    let [energy, _] = albedo(&Bsdf::Dielectric(glass), alpha, Some(eta), wo);
                    worst[i] = worst[i].max(assert_white(&what, wo, energy));
                }
            }
        }
    }
    println!("worst {worst:.5?}");
}

#[test]
fn clear_sheets_lose_nothing_at_any_roughness() {
    for alpha in [0.03, 0.2, 1.0] {
        for wo in COSINES.map(at_cosine).into_iter().flat_map(|w| [w, -w]) {
            let [energy, _] = integrated_albedo(&thin(alpha, Rgb::ONE), wo);
            assert_white(&format!("sheet, alpha {alpha}"), wo, energy);
        }
    }
    // A smooth one in two directions alone.
    let average = average_reflectance(ETA);
    let smooth = Bsdf::Thin(Thin { eta: ETA, average, tint: Rgb::ONE, facets: None });
    for wo in COSINES.map(at_cosine) {
        let lobes = delta_lobes(&smooth, wo, Importance);
        assert_eq!(lobes.len(), 2);
        assert!((lobes.iter().map(|l| l.0).sum::<f64>() - 1.0).abs() < 1e-6, "{wo}");
    }
}

#[test]
fn white_mixtures_are_white_whatever_their_shares() {
    for alpha in [0.03, 0.2, 1.0] {
        let layer = Layer::Coat(ANY_COAT.at(alpha));
        for (metallic, specular) in [(0.0, 0.0), (0.0, 0.4), (0.3, 0.0), (0.3, 1.0), (0.5, 0.5), (1.0, 0.7)] {
            let bsdf = Bsdf::Blend(Blend::new(Rgb::ONE, metallic, specular, layer));
            for wo in COSINES.map(at_cosine) {
                let [coat, body] = albedo(&bsdf, alpha, None, wo);
                let what = format!("alpha {alpha}, metallic {metallic}, specular {specular}");
                assert_white(&what, wo, coat + body);
            }
        }
    }
}

#[test]
fn albedos_are_what_adaptive_quadrature_says() {
    let color = Rgb::new(0.8, 0.5, 0.2);
    for alpha in [0.1, 1.0] {
        for wo in [at_cosine(0.05), at_cosine(0.6)] {
            let cases = [
                ("plastic", Bsdf::Plastic(Plastic::new(color, ANY_COAT.at(alpha)))),
                ("metal", metal(color, alpha)),
                ("blend", blend(color, 0.3, Some(ANY_COAT.at(alpha)), Some(alpha))),
            ];
            for (what, bsdf) in cases {
                let (a, b) = (albedo(&bsdf, alpha, None, wo), integrated_albedo(&bsdf, wo));
                println!("{what} {alpha} {:.2}: {a:.5?} {b:.5?}", wo.z);
                assert!((0..2).all(|k| (a[k] - b[k]).abs() < 5e-4), "{what} {alpha} {}: {a:?} {b:?}", wo.z);
            }
            for (wo, glass) in [(wo, glass(alpha)), (-wo, glass(alpha))] {
                let [a, _] = integrated_albedo(&glass, wo);
                println!("glass {alpha} {:.2}: {a:.5}", wo.z);
                assert_white(&format!("glass {alpha}"), wo, a);
            }
        }
    }
}

#[test]
fn albedos_under_a_white_sky_are_means_of_directional_ones() {
    let color = Rgb::new(0.8, 0.5, 0.2);
    for alpha in [0.04, 0.25, 1.0] {
        for bsdf in [
            Bsdf::Plastic(Plastic::new(color, ANY_COAT.at(alpha))),
            metal(color, alpha),
            blend(color, 0.3, Some(ANY_COAT.at(alpha)), Some(alpha)),
        ] {
            let white = bsdf.white_sky_albedo();
            let [coat, body] = [0, 1].map(|k| {
                // 2 ∫ E(μ) μ dμ with μ = x².
                integrate_1d(0.0, 1.0, 4, |x| {
                    4.0 * x.powi(3) * albedo(&bsdf, alpha, None, at_cosine((x * x) as f32))[k]
                })
            });
            println!(
                "alpha {alpha}: {white:.4?}, {coat:.4} {body:.4}, single {:.4?}",
                bsdf.single_scattering_albedo()
            );
            assert!((coat - f64::from(white.coat.x)).abs() < 1e-3, "{coat} {white:?}");
            assert!((body - f64::from(white.body.x)).abs() < 1e-3, "{body} {white:?}");
            let lost = white.at(1.0).x - bsdf.single_scattering_albedo().at(1.0).x;
            assert!(lost > 0.0 && (lost > 0.3) == (alpha == 1.0), "{lost}");
        }
    }
}

#[test]
fn smooth_models_without_absorption_lose_nothing() {
    let mirror = Bsdf::Conductor(Conductor::new(Rgb::ONE, 1.0, None));
    let glass = Bsdf::Dielectric(keep(Glass::smooth(ETA)).at(0.0));
    for wo in [directions_of_glass(), vec![direction(89.99, 1.0), direction(90.01, 1.0)]].concat() {
        for mode in MODES {
            let m = delta_lobes(&mirror, wo, mode);
            assert_eq!(m.len(), 1);
            assert!((m[0].0 - 1.0).abs() < 1e-6 && m[0].1 == 1.0, "{wo}");
            assert_eq!(m[0].2, Vec3::new(-wo.x, -wo.y, wo.z));

            let lobes = delta_lobes(&glass, wo, mode);
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
            // Tinted, each lobe has its factor, and is chosen as before.
            let tint = GlassTint { reflected: Rgb::splat(0.25), transmitted: Rgb::splat(0.5) };
            let tinted = Bsdf::Dielectric(keep(Glass::smooth(ETA)).at(0.0).tinted(tint));
            for (a, b) in lobes.iter().zip(delta_lobes(&tinted, wo, mode)) {
                let factor = if wo.z * b.2.z > 0.0 { 0.25 } else { 0.5 };
                assert!((b.0 - factor * a.0).abs() < 1e-6 && (b.1, b.2) == (a.1, a.2), "{wo} {mode:?}");
            }
        }
    }
    // Diffuse under a smooth coat, also in part and with metal: the base returns all that enters.
    let plastic = Bsdf::Plastic(Plastic::new(Rgb::ONE, COATS[0].1.at(0.0)));
    let mixed = blend(Rgb::ONE, 0.3, Some(COATS[0].1.at(0.0)), None);
    for (wo, bsdf) in directions().into_iter().flat_map(|wo| [(wo, plastic), (wo, mixed)]) {
        let coat = delta_lobes(&bsdf, wo, Radiance).iter().map(|l| l.0).sum::<f64>();
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

/// Share of the light that GGX facets send into each other in one reflection, in f64, from
/// facets drawn by their area (\[Walter07\] eqs. 35, 36), not by visibility.
fn mirror_loss(alpha: f64, cos: f64, random: &mut Random, n: u32) -> Moments {
    let wo = DVec3::new((1.0 - cos * cos).max(0.0).sqrt(), 0.0, cos);
    let g1 = |w: DVec3| {
        let tan2 = (1.0 - w.z * w.z).max(0.0) / (w.z * w.z);
        2.0 / (1.0 + (1.0 + alpha * alpha * tan2).sqrt())
    };
    let mut m = Moments::default();
    for _ in 0..n {
        let (u, v) = (f64::from(random.next()), f64::from(random.next()));
        let tan = alpha * (u / (1.0 - u)).sqrt();
        let z = 1.0 / (1.0 + tan * tan).sqrt();
        let (sin_phi, cos_phi) = (2.0 * PI * v).sin_cos();
        let wm = DVec3::new(tan * z * cos_phi, tan * z * sin_phi, z);
        let c = wo.dot(wm);
        let wi = 2.0 * c * wm - wo;
        let passed = if wi.z > 0.0 { g1(wi) } else { 0.0 };
        m.push(if c > 0.0 { (1.0 - passed) * g1(wo) * c / (cos * z) } else { 0.0 });
    }
    m
}

#[test]
fn metal_returns_what_its_facets_send_into_each_other() {
    let cosines = [1.0, 0.7, 0.37, 0.14];
    let slopes = [0.05, 0.25, 0.8];
    let threshold = sidak_z(0.01, cosines.len() * slopes.len());
    let mut random = Random::new(&[6]);
    for alpha in slopes {
        let white = metal(Rgb::ONE, alpha);
        for cos in cosines {
            let wo = at_cosine(cos);
            // Across the plane of incidence, where the lobe of single facets is weak.
            let between = integrate_1d(0.0, 1.0, 16, |x| {
                let mu = x * x;
                let wi = Vec3::new(0.0, (1.0 - mu * mu).sqrt() as f32, mu as f32);
                let f = white.f(wo, wi, Radiance).at(1.0).x - Ggx::new(alpha).reflection(wo, wi).brdf;
                f64::from(f) * 2.0 * PI * mu * 2.0 * x
            });
            let m = mirror_loss(f64::from(alpha), f64::from(cos), &mut random, 1 << 17);
            let sd = m.variance_of_mean().sqrt();
            let z = (between - m.mean()) / sd;
            println!("alpha {alpha} cos {cos}: {:.5} ± {sd:.5}, {between:.5}, z {z:.2}", m.mean());
            assert!(z.abs() < threshold, "alpha {alpha} cos {cos}: {} ± {sd}, {between}", m.mean());
        }
    }
}

/// Scattering at factors on the base colour: exact for what has no metal.
#[test]
fn a_factor_on_the_base_colour_is_the_colour_with_that_factor() {
    let mut random = Random::new(&[7]);
    for _ in 0..10_000 {
        let (wo, wi) = (random.direction(), random.direction());
        let color = Rgb::new(random.next(), random.next(), random.next());
        let factor = random.next();
        // All select their lobes by the same brightness.
        let check = |v: f32, of: &dyn Fn(Rgb) -> Bsdf<'static>| {
            let (whole, scaled) = (of(color), of(color * v));
            let (a, b) = (whole.f(wo, wi, Radiance), scaled.f(wo, wi, Radiance));
            let largest = whole.f(wo, wi, Radiance).at(1.0).x.max(of(Rgb::ONE).f(wo, wi, Radiance).at(1.0).x);
            assert!((a.at(v) - b.at(1.0)).abs().max_element() <= 2e-6 * largest, "{a:?} {b:?}");
            assert_eq!(whole.pdf(wo, wi), scaled.pdf(wo, wi));
        };
        for (_, coat) in COATS.iter() {
            check(factor, &|albedo| {
                Bsdf::Plastic(Plastic { albedo, sampling_albedo: 0.7, coat: coat.at(0.0) })
            });
        }
        check(factor, &|albedo| Bsdf::Diffuse(Diffuse { albedo }));
        let (layer, facets) = (Layer::Coat(ANY_COAT.at(0.15)), Some(ANY_FACETS.at(0.15)));
        let mixed = |color, metallic| {
            Bsdf::Blend(Blend { color, sampling_color: 0.7, metallic, specular: 0.6, layer })
        };
        check(factor, &|color| mixed(color, 0.0));
        // Light between metal facets is exact at no colour at all; and at 1, where nothing is scaled.
        check(0.0, &|color| mixed(color, 0.3));
        check(0.0, &|f0| Bsdf::Conductor(Conductor::new(f0, 0.7, facets)));
    }
}

/// The table in the documentation of `bsdf::conductor`.
#[test]
fn a_background_metal_is_as_far_off_between_black_and_its_colour_as_is_documented() {
    let documented = [
        (0.3, [0.005, 0.003, 0.001]),
        (0.5, [0.029, 0.018, 0.007]),
        (0.7, [0.083, 0.048, 0.016]),
        (0.85, [0.147, 0.075, 0.022]),
        (1.0, [0.228, 0.099, 0.025]),
    ];
    for (roughness, documented) in documented {
        let alpha: f32 = roughness * roughness;
        let facets = keep(Facets::new(alpha));
        let metal = |f0: f32| Bsdf::Conductor(Conductor::new(Rgb::splat(f0), f0, Some(facets.at(alpha))));
        for (own, documented) in [1.0, 0.8, 0.5].into_iter().zip(documented) {
            let whole = metal(own).white_sky_albedo();
            let error = |v: f32| whole.at(v).x - metal(own * v).white_sky_albedo().at(1.0).x;
            let worst = (0..=20).map(|i| error(i as f32 / 20.0)).fold(0.0, f32::max);
            assert!((worst - documented).abs() < 6e-4, "roughness {roughness}, {own}: {worst}");
            assert!(error(0.0).abs() < 1e-6 && error(1.0).abs() < 1e-6 && error(1.0 / own) < 1e-6);
        }
    }
}
