//! Fresnel reflectance.

use super::Affine;
use crate::math::Rgb;

/// Unpolarised reflectance of a smooth dielectric interface and the signed
/// cosine of the refracted direction.
///
/// * `cos_i`: cosine on the incident side; negative means from inside
/// * `eta`: IOR inside over IOR outside
///
/// Returns `(1, 0)` at total internal reflection. \[Walter07\] eq. 22.
#[must_use]
pub fn dielectric(cos_i: f32, eta: f32) -> (f32, f32) {
    let cos_i = cos_i.clamp(-1.0, 1.0);
    let eta_it = if cos_i < 0.0 { 1.0 / eta } else { eta };
    let c = cos_i.abs();
    let sin2_t = (1.0 - c * c) / (eta_it * eta_it);
    if sin2_t >= 1.0 {
        return (1.0, 0.0);
    }
    let cos_t = (1.0 - sin2_t).sqrt();
    let r_s = (c - eta_it * cos_t) / (c + eta_it * cos_t);
    let r_p = (eta_it * c - cos_t) / (eta_it * c + cos_t);
    (0.5 * (r_s * r_s + r_p * r_p), -cos_t.copysign(cos_i))
}

/// Schlick's approximation, affine in `f0`. \[Schlick94\] eq. 15.
#[must_use]
pub fn schlick(f0: Rgb, cos_theta: f32) -> Affine {
    let m = (1.0 - cos_theta).clamp(0.0, 1.0);
    let m2 = m * m;
    let grazing = m2 * m2 * m;
    Affine { coat: Rgb::splat(grazing), body: f0 * (1.0 - grazing) }
}

/// Mean of [`schlick`]'s reflectance over projected solid angle, 2 ∫ F(μ) μ dμ.
#[must_use]
pub fn schlick_average(f0: Rgb) -> Rgb {
    (f0 * 20.0 + 1.0) / 21.0
}

/// Cosine of incidence at which [`tinted`] metals have their edge tint, 82 degrees.
const EDGE: f32 = 1.0 / 7.0;

/// Reflectance of a metal whose reflectance at 82 degrees is `edge` times [`schlick`]'s, at a factor 0 and 1 on
/// `f0` (0 the coat, 1 both) and affine between. \[Kutz21\], the model "F82"; what would be below 0 is 0.
#[must_use]
pub fn tinted(f0: Rgb, edge: Rgb, cos_theta: f32) -> Affine {
    let schlick_at = |c| schlick(f0, c);
    if edge == Rgb::ONE {
        return schlick_at(cos_theta);
    }
    let c = cos_theta.clamp(0.0, 1.0);
    let bump = |c: f32| c * (1.0 - c).powi(6);
    affine(schlick_at(c), schlick_at(EDGE), (Rgb::ONE - edge) * (bump(c) / bump(EDGE)))
}

/// `of` less `share` of `at_edge`, at the factors 0 and 1 not below 0.
fn affine(of: Affine, at_edge: Affine, share: Rgb) -> Affine {
    let at = |v| (of.at(v) - at_edge.at(v) * share).max(Rgb::ZERO);
    let whole = at(1.0);
    // The factor may exceed 1: nothing may fall with it.
    let coat = at(0.0).min(whole);
    Affine { coat, body: whole - coat }
}

/// Mean of [`tinted`]'s reflectance over projected solid angle, 2 ∫ F(μ) μ dμ, of which nothing is below 0.
#[must_use]
pub fn tinted_average(f0: Rgb, edge: Rgb) -> Rgb {
    // 2 ∫ μ² (1 − μ)⁶ dμ = 1/126.
    let bump = 1.0 / (126.0 * EDGE * (1.0 - EDGE).powi(6));
    (schlick_average(f0) - (Rgb::ONE - edge) * schlick(f0, EDGE).at(1.0) * bump).max(Rgb::ZERO)
}

/// Mean of [`dielectric`]'s reflectance over projected solid angle, from outside.
///
/// From inside it is 1 − (1 − F)/η², for as much light passes one way as the other.
#[must_use]
pub fn dielectric_average(eta: f32) -> f32 {
    /// Error 1e-6.
    const N: u32 = 512;
    // With μ = x² the steep grazing end gets more of the midpoints.
    let term = |i: u32| {
        let x = (f64::from(i) + 0.5) / f64::from(N);
        4.0 * x.powi(3) * f64::from(dielectric((x * x) as f32, eta).0)
    };
    ((0..N).map(term).sum::<f64>() / f64::from(N)) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_metal_has_its_tint_at_82_degrees_and_the_mean_of_its_reflectance() {
        let (f0, edge) = (Rgb::new(0.9, 0.6, 0.3), Rgb::new(0.7, 0.4, 1.0));
        let plain = schlick(f0, EDGE).at(1.0);
        assert!((tinted(f0, edge, EDGE).at(1.0) - edge * plain).abs().max_element() < 1e-6);
        for c in [0.0, 1.0] {
            assert!((tinted(f0, edge, c).at(1.0) - schlick(f0, c).at(1.0)).abs().max_element() < 1e-6);
        }
        assert_eq!(tinted(f0, Rgb::ONE, 0.3), schlick(f0, 0.3));
        let n = 1000;
        let nodes = (0..n).map(|i| (i as f32 + 0.5) / n as f32);
        let mean: Rgb = nodes.map(|c| tinted(f0, edge, c).at(1.0) * (2.0 * c / n as f32)).sum();
        assert!((mean - tinted_average(f0, edge)).abs().max_element() < 1e-5);
        // Black at normal incidence the formula is below 0 elsewhere.
        for c in [0.02, 0.05, EDGE, 0.5, 0.9] {
            let Affine { coat, body } = tinted(Rgb::splat(0.5), Rgb::ZERO, c);
            assert!(coat.min_element() >= 0.0 && body.min_element() >= 0.0, "{c}");
        }
    }

    #[test]
    fn known_values() {
        assert!((dielectric(1.0, 1.5).0 - 0.04).abs() < 1e-6);
        assert!((dielectric(-1.0, 1.5).0 - 0.04).abs() < 1e-6);
        assert!((dielectric(1e-6, 1.5).0 - 1.0).abs() < 1e-4);
        assert_eq!(dielectric(-0.5, 1.5), (1.0, 0.0));
        // Brewster's angle: the p component vanishes.
        let c = (1.0_f32 / (1.0 + 1.5 * 1.5)).sqrt();
        let r_s = ((1.0 - 2.25_f32) / (1.0 + 2.25)).powi(2);
        assert!((dielectric(c, 1.5).0 - 0.5 * r_s).abs() < 1e-6);
    }

    #[test]
    fn reflectance_is_the_same_from_both_sides_of_a_refraction() {
        for i in 1..20 {
            let (r, cos_t) = dielectric(i as f32 / 20.0, 1.33);
            let (back, cos_i) = dielectric(cos_t, 1.33);
            assert!((r - back).abs() < 1e-5);
            assert!((cos_i - i as f32 / 20.0).abs() < 1e-5);
        }
    }

    #[test]
    fn averages_are_those_of_the_formulas() {
        let average = |f: &dyn Fn(f32) -> f32| {
            let n = 1 << 16;
            (0..n)
                .map(|i| (f64::from(i) + 0.5) / f64::from(n))
                .map(|mu| 2.0 * mu * f64::from(f(mu as f32)) / f64::from(n))
                .sum::<f64>() as f32
        };
        for eta in [1.01, 1.3, 1.5, 2.5] {
            let (outside, inside) = (average(&|c| dielectric(c, eta).0), average(&|c| dielectric(-c, eta).0));
            let f = dielectric_average(eta);
            assert!((f - outside).abs() < 2e-6, "{eta}: {f} {outside}");
            assert!((1.0 - (1.0 - f) / (eta * eta) - inside).abs() < 2e-6, "{eta}: {inside}");
        }
        let f0 = Rgb::new(0.9, 0.3, 0.0);
        assert!((schlick_average(f0).y - average(&|c| schlick(f0, c).at(1.0).y)).abs() < 1e-6);
    }
}
