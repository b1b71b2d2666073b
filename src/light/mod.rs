//! Light sources that can be resized for free.
//!
//! A light of size `s` emits along a ray exactly when the ray's **size
//! coordinate** `ρ ≤ s`: the rays of a small light are a subset of the rays of
//! the same light grown. A light is therefore sampled at its `extent` (the
//! largest size of interest) and every contribution carries its ρ.
//!
//! Lights do not block rays. Emission is given for unit radiance: `radiance`
//! fields of samples hold the light's colour (luminance 1) times its profile,
//! and films multiply the radiance in.
//!
//! | light | ρ of a ray |
//! | --- | --- |
//! | rectangle | `max(\|u\|/a, \|v\|/b)` where the ray meets its plane |
//! | disk, spot | distance from the centre there, over R |
//! | sphere | distance of closest approach to the centre, over R |
//! | point | 0 |

mod planar;
mod size;
mod sphere;

use glam::{Vec2, Vec3};

use crate::math::{AreaPdf, Frame, Pmf, Rgb, SolidAnglePdf, luminance, warp};

pub use planar::{Cone, Outline, Planar};
pub use size::SizeDensity;
pub use sphere::Sphere;

/// Index of a light in its scene.
pub type LightId = u32;

/// The closed set of emitter shapes.
#[derive(Clone, Debug)]
pub enum Shape {
    /// One-sided rectangle or disk, with an optional cone (a spot).
    Planar(Planar),
    /// Sphere emitting outward.
    Sphere(Sphere),
    /// Isotropic point; its radiance is an intensity, W·sr⁻¹.
    Point(Vec3),
}

/// A light source.
#[derive(Clone, Debug)]
pub struct Light {
    /// Unique name.
    pub name: String,
    /// Geometry at unit size.
    pub shape: Shape,
    /// Linear Rec.709 colour of luminance 1.
    pub color: Rgb,
    /// Radiance L (W·m⁻²·sr⁻¹ per unit of `color`; W·sr⁻¹ for a point).
    pub radiance: f32,
    /// Present size s, multiplies the shape's unit extents.
    pub size: f32,
    /// Distribution of ρ when the light is sampled; its extent is at least `size`.
    pub size_density: SizeDensity,
    /// Whether one-edge paths (light straight to camera) are seen.
    pub camera_visible: bool,
}

/// A light met by a ray before its first surface.
#[derive(Clone, Copy, Debug)]
pub struct Crossing {
    /// Ray parameter.
    pub t: f32,
    /// The point, on the light at its extent.
    pub p: Vec3,
    /// Unit normal of the emitting side there.
    pub n: Vec3,
    /// Size coordinate of the ray.
    pub rho: f32,
    /// Unit radiance times colour and profile toward the ray's origin.
    pub radiance: Rgb,
}

/// A light point sampled as seen from a reference point.
#[derive(Clone, Copy, Debug)]
pub struct LightLiSample {
    /// Emitted toward the reference point for L = 1, W·sr⁻¹·m⁻²; for a point
    /// light the intensity over the squared distance.
    pub radiance: Rgb,
    /// Unit direction from the reference point to the light.
    pub wi: Vec3,
    /// Per unit solid angle at the reference point, without the selection
    /// [`Pmf`]; 1 for a point light.
    pub pdf: SolidAnglePdf,
    /// Point on the light.
    pub p: Vec3,
    /// Unit normal there; zero for a point light.
    pub n: Vec3,
    /// Size coordinate.
    pub rho: f32,
}

/// A sampled emission: the first edge of a light subpath.
#[derive(Clone, Copy, Debug)]
pub struct LightLeSample {
    /// Emitted along `dir` for L = 1.
    pub radiance: Rgb,
    /// Point on the light.
    pub p: Vec3,
    /// Unit normal there; zero for a point light.
    pub n: Vec3,
    /// Unit direction of emission.
    pub dir: Vec3,
    /// Size coordinate.
    pub rho: f32,
    /// Density of `p`; 1 for a point light.
    pub pdf_pos: AreaPdf,
    /// Density of `dir` given `p`.
    pub pdf_dir: SolidAnglePdf,
}

impl Light {
    /// Whether the light is a single position: no ray can hit it.
    #[must_use]
    pub fn is_delta(&self) -> bool {
        matches!(self.shape, Shape::Point(_))
    }

    /// Whether the light has a size that can vary.
    #[must_use]
    pub fn has_size(&self) -> bool {
        !self.is_delta()
    }

    /// Where the ray from `org` along unit `dir` crosses the emitting side
    /// within `(0, t_max)`, at the light's extent.
    #[must_use]
    pub fn crossing(&self, org: Vec3, dir: Vec3, t_max: f32) -> Option<Crossing> {
        let extent = self.size_density.extent();
        let mut c = match &self.shape {
            Shape::Planar(s) => s.crossing(org, dir, t_max, extent),
            Shape::Sphere(s) => s.crossing(org, dir, t_max, extent),
            Shape::Point(_) => None,
        }?;
        c.radiance *= self.color;
        Some(c)
    }

    /// Samples a point on the light as seen from `reference`; `None` when it
    /// cannot reach it.
    #[must_use]
    pub fn sample_li(&self, reference: Vec3, u: Vec2) -> Option<LightLiSample> {
        let mut s = match &self.shape {
            Shape::Planar(s) => s.sample_li(reference, &self.size_density, u),
            Shape::Sphere(s) => s.sample_li(reference, &self.size_density, u),
            Shape::Point(p) => {
                let d = *p - reference;
                let d2 = d.length_squared();
                (d2 > 0.0).then(|| LightLiSample {
                    radiance: Rgb::splat(1.0 / d2),
                    wi: d / d2.sqrt(),
                    pdf: SolidAnglePdf(1.0),
                    p: *p,
                    n: Vec3::ZERO,
                    rho: 0.0,
                })
            }
        }?;
        s.radiance *= self.color;
        Some(s)
    }

    /// Density with which [`Self::sample_li`] draws the point `c` from
    /// `reference`, per unit solid angle there, without the selection [`Pmf`].
    #[must_use]
    pub fn pdf_li(&self, reference: Vec3, c: &Crossing) -> SolidAnglePdf {
        match &self.shape {
            Shape::Planar(s) => {
                let d = c.p - reference;
                s.pdf_pos(&self.size_density, c.rho)
                    .to_solid_angle(d.length_squared(), c.n.dot(d.normalize()))
            }
            Shape::Sphere(s) => s.pdf_li(reference, &self.size_density, c.rho),
            Shape::Point(_) => SolidAnglePdf(0.0),
        }
    }

    /// Samples a point and a direction of emission.
    #[must_use]
    pub fn sample_le(&self, u_pos: Vec2, u_dir: Vec2) -> Option<LightLeSample> {
        let mut s = match &self.shape {
            Shape::Planar(s) => s.sample_le(&self.size_density, u_pos, u_dir),
            Shape::Sphere(s) => s.sample_le(&self.size_density, u_pos, u_dir),
            Shape::Point(p) => Some(LightLeSample {
                radiance: Rgb::ONE,
                p: *p,
                n: Vec3::ZERO,
                dir: warp::square_to_sphere(u_dir),
                rho: 0.0,
                pdf_pos: AreaPdf(1.0),
                pdf_dir: warp::UNIFORM_SPHERE_PDF,
            }),
        }?;
        s.radiance *= self.color;
        Some(s)
    }

    /// Densities with which [`Self::sample_le`] draws the point `p` (normal
    /// `n`) and the direction `dir` with size coordinate `rho`.
    #[must_use]
    pub fn pdf_le(&self, n: Vec3, dir: Vec3, rho: f32) -> (AreaPdf, SolidAnglePdf) {
        match &self.shape {
            Shape::Planar(s) => (s.pdf_pos(&self.size_density, rho), s.pdf_dir(dir)),
            Shape::Sphere(s) => s.pdf_le(&self.size_density, n, dir, rho),
            Shape::Point(_) => (AreaPdf(1.0), warp::UNIFORM_SPHERE_PDF),
        }
    }

    /// Power emitted for unit radiance at size `s`, luminance-weighted, W.
    #[must_use]
    pub fn unit_power(&self, s: f32) -> f32 {
        luminance(self.color)
            * match &self.shape {
                Shape::Planar(p) => p.power(s),
                Shape::Sphere(p) => p.power(s),
                Shape::Point(_) => 4.0 * std::f32::consts::PI,
            }
    }
}

/// Chooses lights: a fixed probability each, never dependent on the free variables.
#[derive(Clone, Debug, Default)]
pub struct LightSampler {
    pmf: Vec<f32>,
    cdf: Vec<f32>,
}

impl LightSampler {
    /// Probabilities proportional to `weights` (all positive).
    #[must_use]
    pub fn new(weights: &[f32]) -> Self {
        let total: f32 = weights.iter().sum();
        let pmf: Vec<f32> = weights.iter().map(|w| w / total).collect();
        let cdf = pmf
            .iter()
            .scan(0.0, |acc, p| {
                *acc += p;
                Some(*acc)
            })
            .collect();
        Self { pmf, cdf }
    }

    /// Chooses a light by `u` in [0, 1); `None` without lights.
    #[must_use]
    pub fn sample(&self, u: f32) -> Option<(LightId, Pmf)> {
        let last = self.cdf.len().checked_sub(1)?;
        let i = self.cdf.partition_point(|&c| c <= u).min(last);
        Some((i as LightId, Pmf(self.pmf[i])))
    }

    /// Probability of choosing light `i`.
    #[must_use]
    pub fn pmf(&self, i: LightId) -> Pmf {
        Pmf(self.pmf[i as usize])
    }
}

/// Frame of a planar light: +z along `normal`, x as close to horizontal as
/// `up` allows.
#[must_use]
pub fn look_frame(normal: Vec3, up: Vec3) -> Frame {
    let n = normal.normalize();
    let s = up.cross(n);
    if s.length_squared() < 1e-12 {
        return Frame::from_normal(n);
    }
    let s = s.normalize();
    Frame { s, t: n.cross(s), n }
}
