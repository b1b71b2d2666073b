//! The scattering models without light between facets, as other renderers have them,
//! and how much darker these are under a white sky.
//!
//! An albedo under a white sky is the mean of the directional albedo over projected
//! solid angle: what a surface under a sky of radiance 1 shows on average.

use std::f32::consts::PI;

use glam::{Vec2, Vec3};

use super::{
    Affine, Blend, Bsdf, CoatPoint, Conductor, Thin, conductor, fresnel, interface, microfacet::Ggx,
    reflect_about, table::Table,
};
use crate::math::Rgb;

impl Bsdf<'_> {
    /// Albedo under a white sky; of glass, reflected and transmitted light from outside together.
    /// Tints of glass and of a metal's edge are left out.
    #[must_use]
    pub fn white_sky_albedo(&self) -> Affine {
        match self {
            Self::Diffuse(b) => Affine::body(b.albedo),
            Self::Conductor(b) => metal(b),
            Self::Plastic(b) => coated(&b.coat, b.albedo),
            Self::Dielectric(_) => Affine::coat(Rgb::ONE),
            Self::Thin(b) => sheet(b),
            Self::Blend(b) => mixture(b, &metal, &coated),
        }
    }

    /// Albedo under a white sky of the nearest model of single scattering: GGX with Schlick's or a dielectric's
    /// reflectance, and below a coat a base of the same albedo seen through the transmittance of
    /// one facet on both ways (Mitsuba's `roughplastic` with `nonlinear = false`, its internal
    /// reflectance integrated exactly). It takes some ten milliseconds.
    #[must_use]
    pub fn single_scattering_albedo(&self) -> Affine {
        match self {
            Self::Diffuse(_) => self.white_sky_albedo(),
            Self::Conductor(b) => single_metal(b),
            Self::Plastic(b) => single_coated(&b.coat, b.albedo),
            Self::Dielectric(b) => Affine::coat(Rgb::splat(1.0 - b.average_loss())),
            Self::Thin(b) => sheet(b) * (1.0 - b.facets.map_or(0.0, |f| f.average_loss())),
            Self::Blend(b) => mixture(b, &single_metal, &single_coated),
        }
    }
}

/// What a sheet reflects and passes together.
fn sheet(b: &Thin) -> Affine {
    Affine::coat(Rgb::splat(b.average) + b.tint * (1.0 - b.average))
}

fn mixture(
    b: &Blend,
    metal: &dyn Fn(&Conductor) -> Affine,
    coated: &dyn Fn(&CoatPoint, Rgb) -> Affine,
) -> Affine {
    let coat = b.layer.coat().map_or(Affine::ZERO, |c| coated(c, b.color) * b.specular);
    let base = Affine::body(b.color * (1.0 - b.specular)) + coat;
    base * (1.0 - b.metallic)
        + metal(&Conductor::new(b.color, b.sampling_color, b.layer.facets())) * b.metallic
}

fn metal(b: &Conductor) -> Affine {
    let between =
        b.facets.map_or(Affine::ZERO, |f| conductor::returned(b.f0, Rgb::ONE, &f) * f.average_loss());
    single_metal(b) + between
}

fn single_metal(b: &Conductor) -> Affine {
    let Some(facets) = b.facets else {
        return Affine { coat: Rgb::splat(1.0 / 21.0), body: b.f0 * (20.0 / 21.0) };
    };
    // Schlick's reflectance is f0 + (1 − f0) g, whose g at f0 = 0.
    let grazing = Table::new(facets.ggx, |ggx, cos| {
        interface::mean(ggx, cos, |wo, wm| {
            let g = fresnel::schlick(Rgb::ZERO, wo.dot(wm)).coat.x;
            g * (1.0 - ggx.shadowing(reflect_about(wo, wm), wm))
        })
    });
    let grazing = grazing.row(facets.ggx.alpha()).average;
    let body = b.f0 * (1.0 - facets.average_loss() - grazing);
    Affine { coat: Rgb::splat(grazing), body }
}

fn coated(coat: &CoatPoint, albedo: Rgb) -> Affine {
    let average = coat.average_transmittance();
    Affine { coat: Rgb::splat(1.0 - average), body: albedo * average }
}

fn single_coated(coat: &CoatPoint, albedo: Rgb) -> Affine {
    let (Some(facets), eta) = (coat.facets(), coat.eta) else { return coated(coat, albedo) };
    let ggx = facets.ggx;
    let average = |f: &(dyn Fn(Ggx, f32) -> f32 + Sync)| Table::new(ggx, f).row(ggx.alpha()).average;
    let reflected = average(&|ggx, cos| interface::reflectance(ggx, cos, eta));
    let transmitted = 1.0 - reflected - average(&|ggx, cos| interface::dielectric_loss(ggx, cos, eta));
    let internal = average(&|ggx, cos| interface::reflectance(ggx, cos, 1.0 / eta));
    let base = transmitted * transmitted / (eta * eta * (1.0 - internal));
    Affine { coat: Rgb::splat(reflected), body: albedo * base }
}

/// Directional reflectance of a coat of relative IOR `eta` from inside, at
/// cosine `mu`; `ggx` `None` is smooth.
///
/// Total reflection begins at a line across the square of visible normals, on
/// which a fixed grid errs alike at every `mu`: the `i`-th evaluation of a sum
/// therefore uses a grid moved by the `i`-th point of the R2 sequence.
#[must_use]
pub fn internal_reflectance(eta: f32, ggx: Option<Ggx>, mu: f32, i: u32) -> f32 {
    /// Inverse of the plastic number, whose powers generate the sequence.
    const STEP: f64 = 0.754_877_666_246_692_8;
    /// Points per dimension of the square of visible normals.
    const N: u32 = 48;
    let Some(ggx) = ggx else { return fresnel::dielectric(mu, 1.0 / eta).0 };
    let point = |k: u32, step: f64| {
        let shift = (0.5 + f64::from(i) * step).fract() as f32;
        (k as f32 + shift) / N as f32
    };
    let wo = Vec3::new((1.0 - mu * mu).max(0.0).sqrt(), 0.0, mu);
    let wh = ggx.stretched(wo);
    let directions = (0..N).map(|k| Vec2::from_angle(2.0 * PI * point(k, STEP))).collect::<Vec<_>>();
    let mut sum = 0.0;
    for k in 0..N {
        // Facets seen edge-on lie at v = 0.
        let v = point(k, STEP * STEP);
        for &direction in &directions {
            let wm = ggx.wm_towards(wh, direction, 1.0 - v * v);
            let r = fresnel::dielectric(wo.dot(wm), 1.0 / eta).0;
            sum += f64::from(2.0 * v * r * (1.0 - ggx.shadowing(reflect_about(wo, wm), wm)));
        }
    }
    (sum / f64::from(N * N)) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_internal_reflectance_does_not_depend_on_the_grid() {
        for (eta, alpha) in [(1.5, 0.04), (1.5, 0.1), (1.3, 0.04)] {
            let ggx = Ggx::new(alpha);
            let mean = |n: u32, grids: u32| {
                let term = |k: u32| {
                    let mu = ((k / grids) as f32 + 0.5) / n as f32;
                    f64::from(2.0 * mu * internal_reflectance(eta, Some(ggx), mu, k))
                };
                (0..n * grids).map(term).sum::<f64>() / f64::from(n * grids)
            };
            let table = Table::new(ggx, |ggx, cos| interface::reflectance(ggx, cos, 1.0 / eta));
            let table = f64::from(table.row(alpha).average);
            let (coarse, fine) = (mean(512, 1), mean(256, 8));
            // 1 / (1 − R) is the brightness of the base.
            for r in [coarse, table] {
                let error = (1.0 - fine) / (1.0 - r) - 1.0;
                assert!(error.abs() < 6e-4, "{eta} {alpha}: {error}");
            }
        }
    }
}
