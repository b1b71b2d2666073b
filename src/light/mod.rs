//! Light sources that can be resized for free.
//!
//! A light of size `s` emits along a ray exactly when the ray's **size
//! coordinate** `ρ ≤ s`: the rays of a small light are a subset of the rays of
//! the same light grown. A light is therefore sampled up to the extent of a
//! [`SizeDensity`], and every contribution carries its ρ.
//!
//! Lights do not block rays, unless they are declared to. Emission is given for
//! unit radiance: `radiance` fields of samples hold the light's colour
//! (luminance 1) times its profile, and films multiply the radiance in.
//!
//! | light | ρ of a ray |
//! | --- | --- |
//! | rectangle | `max(\|u\|/a, \|v\|/b)` where the ray meets its plane |
//! | disk, spot | distance from the centre there, over R |
//! | sphere | distance of closest approach to the centre, over R |
//! | point, distant, environment, emissive mesh | 0 |
//!
//! A **light at infinity** (distant, environment) has no area: a point on it is
//! a direction, densities of such points are per unit solid angle, and those of
//! what it emits from there per unit area across the direction. With the edge to
//! it counted as one metre long and the cosine at it as 1 ([`Light::distance2`],
//! [`LightPoint::n`]), every conversion of densities keeps its form.

mod color;
mod environment;
mod mesh;
mod planar;
mod point;
mod resize;
mod sample;
mod size;
mod sphere;

use glam::{Vec2, Vec3};

use crate::math::{AreaPdf, Discrete, Frame, Pmf, Rgb, SolidAnglePdf, distance2, luminance, offset};

pub use color::LightColor;
pub use environment::{Distant, Environment, RadianceMap, Surroundings};
pub use mesh::{EmissionProfile, EmissiveTriangle, MeshLight};
pub use planar::{Cone, Edge, Planar};
pub use point::Point;
pub use resize::{Outline, Resizable};
pub use sample::{Crossing, LightLeSample, LightLiSample, LightPoint};
pub use size::SizeDensity;
pub use sphere::Sphere;

/// Luminous efficacy by which exporters turn watts into lumens, lm/W: that of light of 555 nm.
pub const LUMENS_PER_WATT: f32 = 683.0;

/// Index of a light among those of its scene.
pub type LightId = u32;

/// Closed set of emitter shapes.
#[derive(Clone, Debug)]
pub enum Shape {
    /// One-sided rectangle or disk, with an optional cone (a spot).
    Planar(Planar),
    /// Sphere emitting outward.
    Sphere(Sphere),
    /// Point, whose radiance is an intensity, W·sr⁻¹.
    Point(Point),
    /// Single direction at infinity, whose radiance is an irradiance across it, W·m⁻².
    Distant(Distant),
    /// All directions at infinity.
    Environment(Environment),
    /// Emissive triangles of the scene.
    Mesh(MeshLight),
}

/// A light source.
#[derive(Clone, Debug)]
pub struct Light {
    /// Name, unique in the scene.
    pub name: String,
    /// Geometry at unit size.
    pub shape: Shape,
    /// Linear Rec.709 colour of luminance 1 with which contributions are recorded.
    pub color: Rgb,
    /// Colour that the scene's author gave the light, where that is a factor of pictures: see
    /// [`Self::record_white`].
    pub picture_color: LightColor,
    /// Temperature, kelvin, and tint that the scene's author gave the light's colour by.
    pub temperature: Option<[f32; 2]>,
    /// Radiance L that the scene's author gave the light, W·m⁻²·sr⁻¹ per unit of `color` (a point:
    /// W·sr⁻¹, a distant light: W·m⁻²). In a picture the radiance is that of the picture's lighting.
    pub radiance: f32,
    /// Size s that the scene's author gave the light, a factor on the shape's unit extents. In a picture
    /// the size is that of the picture's lighting, except for a light that occludes.
    pub size: f32,
    /// Whether the camera sees the light itself, by paths of one edge.
    pub camera_visible: bool,
    /// Whether the light has a black body that stops rays, planar or spherical, of the author's size.
    pub occludes: bool,
}

impl Light {
    /// Records the light's contributions white, so that its colour is a factor of every picture, which may vary.
    pub fn record_white(&mut self) {
        if self.color == Rgb::ONE || self.picture_color != LightColor::Recorded {
            return;
        }
        self.picture_color = match self.temperature {
            Some([kelvin, tint]) => {
                LightColor::Temperature { kelvin: f64::from(kelvin), tint: f64::from(tint) }
            }
            None => LightColor::Rgb(self.color.to_array().map(f64::from)),
        };
        self.color = Rgb::ONE;
    }

    /// Whether the light is a single position or direction, which no ray can hit.
    #[must_use]
    pub fn is_delta(&self) -> bool {
        match self.shape {
            Shape::Point(_) | Shape::Distant(_) => true,
            Shape::Planar(_) | Shape::Sphere(_) | Shape::Environment(_) | Shape::Mesh(_) => false,
        }
    }

    /// Whether the light is infinitely far away.
    #[must_use]
    pub fn is_infinite(&self) -> bool {
        match self.shape {
            Shape::Distant(_) | Shape::Environment(_) => true,
            Shape::Planar(_) | Shape::Sphere(_) | Shape::Point(_) | Shape::Mesh(_) => false,
        }
    }

    /// Whether the light has a size that can vary.
    #[must_use]
    pub fn has_size(&self) -> bool {
        self.resizable().is_some()
    }

    /// The light's shape as one that can be resized; `None` for a light that has no size, or whose body
    /// of a fixed size stops rays.
    #[must_use]
    pub fn resizable(&self) -> Option<&dyn Resizable> {
        if self.occludes {
            return None;
        }
        match &self.shape {
            Shape::Planar(s) => Some(s),
            Shape::Sphere(s) => Some(s),
            Shape::Point(_) | Shape::Distant(_) | Shape::Environment(_) | Shape::Mesh(_) => None,
        }
    }

    /// Unit of the light's radiance, in ASCII.
    #[must_use]
    pub fn unit(&self) -> &'static str {
        match self.shape {
            Shape::Point(_) => "W/sr",
            Shape::Distant(_) => "W/m2",
            Shape::Planar(_) | Shape::Sphere(_) | Shape::Environment(_) | Shape::Mesh(_) => "W/m2/sr",
        }
    }

    /// Sets the bounding sphere of the scene for a light at infinity.
    pub fn surround(&mut self, scene: Surroundings) {
        match &mut self.shape {
            Shape::Distant(s) => s.scene = scene,
            Shape::Environment(s) => s.scene = scene,
            Shape::Planar(_) | Shape::Sphere(_) | Shape::Point(_) | Shape::Mesh(_) => {}
        }
    }

    /// Squared length of the edge between the light at `on_light` and `p`, m²;
    /// 1 for a light at infinity.
    #[must_use]
    pub fn distance2(&self, on_light: Vec3, p: Vec3) -> f32 {
        if self.is_infinite() { 1.0 } else { distance2(on_light, p) }
    }

    /// Crossing of the ray from `org` along unit `dir` with the emitting side of the light at size
    /// `extent` within `(0, t_max)`. An environment is crossed by infinite rays only, an emissive mesh
    /// never, for its triangles are surfaces.
    #[must_use]
    pub fn crossing(&self, org: Vec3, dir: Vec3, t_max: f32, extent: f32) -> Option<Crossing> {
        let mut c = match &self.shape {
            Shape::Planar(s) => s.crossing(org, dir, t_max, extent),
            Shape::Sphere(s) => s.crossing(org, dir, t_max, extent),
            Shape::Environment(s) => (t_max == f32::INFINITY).then(|| s.crossing(org, dir)),
            Shape::Point(_) | Shape::Distant(_) | Shape::Mesh(_) => None,
        }?;
        c.radiance *= self.color;
        Some(c)
    }

    /// Emission of an emissive mesh at the point `p` of its triangle `prim`, with texture coordinates
    /// `uv`, met by a ray along `dir` of length `t`; `None` from a side that does not emit.
    #[must_use]
    pub fn surface_crossing(&self, prim: u32, p: Vec3, uv: Vec2, dir: Vec3, t: f32) -> Option<Crossing> {
        let Shape::Mesh(s) = &self.shape else { return None };
        let mut c = s.crossing(prim, p, uv, dir, t)?;
        c.radiance *= self.color;
        Some(c)
    }

    /// Ray parameter at which the ray from `org` along unit `dir` meets the light's body within
    /// `(0, t_max)`; `None` for a light that does not stop rays.
    #[must_use]
    pub fn stop(&self, org: Vec3, dir: Vec3, t_max: f32) -> Option<f32> {
        if !self.occludes {
            return None;
        }
        let t = match &self.shape {
            Shape::Planar(s) => s.stop(org, dir, self.size),
            Shape::Sphere(s) => s.stop(org, dir, self.size),
            Shape::Point(_) | Shape::Distant(_) | Shape::Environment(_) | Shape::Mesh(_) => None,
        }?;
        (t > 0.0 && t < t_max).then_some(t)
    }

    /// The point `at` of the light moved toward where it emits, by `clearance`, metres, and by the bound of
    /// its own rounding. A point light and one at infinity have no surface to be clear of; a point of an
    /// emissive mesh is clear of it when it is sampled.
    #[must_use]
    pub fn clear(&self, at: &LightPoint, clearance: f32) -> Vec3 {
        match &self.shape {
            Shape::Planar(s) => offset(at.p, at.n, clearance + s.rounding(at.p)),
            Shape::Sphere(s) => offset(at.p, at.n, clearance + s.rounding(at.p)),
            Shape::Point(_) | Shape::Distant(_) | Shape::Environment(_) | Shape::Mesh(_) => at.p,
        }
    }

    /// Samples a point on the light as seen from `reference`, with a size coordinate drawn from `q`;
    /// `None` if the light cannot reach `reference`.
    #[must_use]
    pub fn sample_li(&self, q: &SizeDensity, reference: Vec3, u: Vec2) -> Option<LightLiSample> {
        let mut s = match &self.shape {
            Shape::Planar(s) => s.sample_li(reference, q, u),
            Shape::Sphere(s) => s.sample_li(reference, q, u),
            Shape::Point(s) => s.sample_li(reference),
            Shape::Distant(s) => Some(s.sample_li(reference)),
            Shape::Environment(s) => s.sample_li(reference, u),
            Shape::Mesh(s) => s.sample_li(reference, u),
        }?;
        s.radiance *= self.color;
        Some(s)
    }

    /// Density with which [`Self::sample_li`] draws the point `at` from
    /// `reference`, per unit solid angle there, without the selection [`Pmf`].
    #[must_use]
    pub fn pdf_li(&self, q: &SizeDensity, reference: Vec3, at: &LightPoint) -> SolidAnglePdf {
        let from_area = |pdf: AreaPdf| {
            // Of two coincident points any direction serves: the density is that of the least distance.
            let wi = (at.p - reference).try_normalize().unwrap_or(at.n);
            pdf.to_solid_angle(distance2(at.p, reference), at.n.dot(wi))
        };
        match &self.shape {
            Shape::Planar(s) => from_area(s.pdf_pos(q, at.rho)),
            Shape::Sphere(s) => s.pdf_li(reference, q, at.rho),
            Shape::Environment(s) => s.pdf(-at.n),
            Shape::Mesh(s) => from_area(s.pdf_pos(at.element)),
            Shape::Point(_) | Shape::Distant(_) => SolidAnglePdf(0.0),
        }
    }

    /// Samples a point on the light, with a size coordinate drawn from `q`, and a direction of emission.
    #[must_use]
    pub fn sample_le(&self, q: &SizeDensity, u_pos: Vec2, u_dir: Vec2) -> Option<LightLeSample> {
        let mut s = match &self.shape {
            Shape::Planar(s) => s.sample_le(q, u_pos, u_dir),
            Shape::Sphere(s) => s.sample_le(q, u_pos, u_dir),
            Shape::Point(s) => s.sample_le(u_dir),
            Shape::Distant(s) => Some(s.sample_le(u_dir)),
            Shape::Environment(s) => s.sample_le(u_pos, u_dir),
            Shape::Mesh(s) => s.sample_le(u_pos, u_dir),
        }?;
        s.radiance *= self.color;
        Some(s)
    }

    /// Densities with which [`Self::sample_le`] draws the point `at` and the
    /// direction `dir`.
    #[must_use]
    pub fn pdf_le(&self, q: &SizeDensity, at: &LightPoint, dir: Vec3) -> (AreaPdf, SolidAnglePdf) {
        match &self.shape {
            Shape::Planar(s) => (s.pdf_pos(q, at.rho), s.pdf_dir(dir)),
            Shape::Sphere(s) => s.pdf_le(q, at.n, dir, at.rho),
            Shape::Point(s) => (AreaPdf(1.0), s.pdf_dir(dir)),
            Shape::Distant(s) => (AreaPdf(1.0), SolidAnglePdf(s.scene.disk_pdf())),
            Shape::Environment(s) => (AreaPdf(s.pdf(-dir).0), SolidAnglePdf(s.scene.disk_pdf())),
            Shape::Mesh(s) => (s.pdf_pos(at.element), s.pdf_dir(at.n, dir)),
        }
    }

    /// Power emitted for unit radiance at size `s`, weighted by luminance, W; for a light at infinity
    /// the power that enters the scene's bounding sphere.
    #[must_use]
    pub fn unit_power(&self, s: f32) -> f32 {
        match &self.shape {
            Shape::Planar(p) => p.power(s) * luminance(self.color),
            Shape::Sphere(p) => p.power(s) * luminance(self.color),
            Shape::Point(p) => p.power() * luminance(self.color),
            Shape::Distant(p) => luminance(self.color) / p.scene.disk_pdf(),
            Shape::Environment(p) => luminance(self.color * p.power()),
            Shape::Mesh(p) => luminance(self.color * p.power()),
        }
    }
}

/// Distribution from which lights are chosen, independent of the free variables.
#[derive(Clone, Debug, Default)]
pub struct LightSampler(Discrete);

impl LightSampler {
    /// Probabilities proportional to `weights` (all positive).
    #[must_use]
    pub fn new(weights: &[f32]) -> Self {
        let weights: Vec<f64> = weights.iter().map(|&w| f64::from(w)).collect();
        Self(Discrete::new(&weights).unwrap_or_default())
    }

    /// Chooses a light by `u` in [0, 1), with its probability and what is left of `u`, again uniform in
    /// [0, 1); `None` without lights.
    #[must_use]
    pub fn sample(&self, u: f32) -> Option<(LightId, Pmf, f32)> {
        let (i, rest) = self.0.sample(u)?;
        Some((i as LightId, Pmf(self.0.pmf(i)), rest))
    }

    /// Probability of choosing light `i`.
    #[must_use]
    pub fn pmf(&self, i: LightId) -> Pmf {
        Pmf(self.0.pmf(i as usize))
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
