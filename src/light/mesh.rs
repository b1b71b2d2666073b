//! Emissive triangles of the scene.

use std::{f32::consts::PI, fmt::Debug, sync::Arc};

use glam::{Vec2, Vec3};

use super::{Crossing, LightLeSample, LightLiSample, LightPoint};
use crate::math::{AreaPdf, Discrete, Frame, Rgb, SolidAnglePdf, luminance, offset, sequence::r2, warp};

/// Emission and opacity over a surface, by texture coordinates.
pub trait EmissionProfile: Debug + Send + Sync {
    /// Factor on the light's radiance at texture coordinates `uv`.
    fn emission(&self, uv: Vec2) -> Rgb;
    /// Opacity at `uv`, by which light from a sampled point is multiplied: a ray may pass a surface that
    /// is partly transparent, but a sampled point always lies on it.
    fn opacity(&self, uv: Vec2) -> f32;
}

/// A triangle that emits from its front, the side from which its corners run
/// anticlockwise.
#[derive(Clone, Copy, Debug)]
pub struct EmissiveTriangle {
    /// Index of the triangle in the scene.
    pub prim: u32,
    /// Corners, metres.
    pub corners: [Vec3; 3],
    /// Texture coordinates of the corners.
    pub uvs: [Vec2; 3],
    /// Distance above the triangle at which a ray must start to be clear of it, metres.
    pub clearance: f32,
}

impl EmissiveTriangle {
    fn area_normal(&self) -> Vec3 {
        let [a, b, c] = self.corners;
        0.5 * (b - a).cross(c - a)
    }

    fn uv(&self, b: Vec3) -> Vec2 {
        self.uvs[0] * b.x + self.uvs[1] * b.y + self.uvs[2] * b.z
    }
}

/// A light made of triangles, chosen by area times emission.
#[derive(Clone, Debug)]
pub struct MeshLight {
    triangles: Vec<EmissiveTriangle>,
    normals: Vec<Vec3>,
    /// Distribution from which triangles are chosen.
    choice: Discrete,
    /// Area density of a point per triangle, m⁻².
    densities: Vec<f32>,
    profile: Option<Arc<dyn EmissionProfile>>,
    two_sided: bool,
    power: Rgb,
}

/// Points of a triangle at which its emission is looked up to choose triangles by it: more would cost
/// time when a scene is loaded, fewer miss the details of an image, which costs noise.
const N_PROBES: u32 = 16;
/// Least weight with which a triangle is chosen, relative to its share of the area: the points looked
/// up may miss the little that it emits, and a rare choice of it would then be very bright.
const MIN_WEIGHT: f32 = 0.05;

impl MeshLight {
    /// A light of `triangles` in the order of their `prim`, whose emission is 1 without `profile`;
    /// `None` if it has no area.
    #[must_use]
    pub fn new(
        triangles: Vec<EmissiveTriangle>,
        profile: Option<Arc<dyn EmissionProfile>>,
        two_sided: bool,
    ) -> Option<Self> {
        debug_assert!(triangles.is_sorted_by_key(|t| t.prim));
        let mean = |t: &EmissiveTriangle| {
            let Some(profile) = &profile else { return Rgb::ONE };
            let probe = |i: u32| {
                let [x, y] = r2(i).map(|v| v as f32);
                profile.emission(t.uv(warp::square_to_triangle(Vec2::new(x, y))))
            };
            (0..N_PROBES).map(probe).sum::<Rgb>() / N_PROBES as f32
        };
        let areas: Vec<f32> = triangles.iter().map(|t| t.area_normal().length()).collect();
        let means: Vec<Rgb> = triangles.iter().map(mean).collect();
        let total_area: f32 = areas.iter().sum();
        let power: Rgb = areas.iter().zip(&means).map(|(a, m)| *m * *a).sum();
        if !(total_area > 0.0 && total_area.is_finite()) {
            return None;
        }
        let brightness = luminance(power) / total_area;
        let weights: Vec<f64> = areas
            .iter()
            .zip(&means)
            .map(|(a, m)| {
                let relative = if brightness > 0.0 { luminance(*m) / brightness } else { 1.0 };
                f64::from(a * relative.max(MIN_WEIGHT))
            })
            .collect();
        let choice = Discrete::new(&weights)?;
        let density = |(i, &area): (usize, &f32)| if area > 0.0 { choice.pmf(i) / area } else { 0.0 };
        let densities = areas.iter().enumerate().map(density).collect();
        let normals = triangles.iter().map(|t| t.area_normal().normalize_or_zero()).collect();
        let sides = if two_sided { 2.0 } else { 1.0 };
        Some(Self { triangles, normals, choice, densities, profile, two_sided, power: power * PI * sides })
    }

    /// Whether both sides of the triangles emit.
    #[must_use]
    pub fn two_sided(&self) -> bool {
        self.two_sided
    }

    /// Indices in the scene of its triangles, ascending.
    pub fn prims(&self) -> impl Iterator<Item = u32> {
        self.triangles.iter().map(|t| t.prim)
    }

    fn emission(&self, uv: Vec2) -> Rgb {
        self.profile.as_ref().map_or(Rgb::ONE, |p| p.emission(uv))
    }

    /// A point with its triangle and emission, as a connection sees it.
    fn sample(&self, u: Vec2) -> (u32, Vec3, Rgb) {
        let (i, again) = self.choice.sample(u.x).unwrap_or_default();
        let b = warp::square_to_triangle(Vec2::new(again, u.y));
        let t = &self.triangles[i];
        let uv = t.uv(b);
        let opacity = self.profile.as_ref().map_or(1.0, |p| p.opacity(uv));
        let p = t.corners[0] * b.x + t.corners[1] * b.y + t.corners[2] * b.z;
        (i as u32, p, self.emission(uv) * opacity)
    }

    /// The point `p` of triangle `element` seen along `to_light`, on the side seen.
    fn point(&self, element: u32, p: Vec3, to_light: Vec3) -> Option<LightPoint> {
        let n = self.normals[element as usize];
        let cos = -n.dot(to_light);
        if cos == 0.0 || (cos < 0.0 && !self.two_sided) {
            return None;
        }
        Some(LightPoint { p, n: if cos < 0.0 { -n } else { n }, rho: 0.0, element })
    }

    fn clear(&self, at: &LightPoint) -> Vec3 {
        offset(at.p, at.n, self.triangles[at.element as usize].clearance)
    }

    pub(super) fn crossing(&self, prim: u32, p: Vec3, uv: Vec2, dir: Vec3, t: f32) -> Option<Crossing> {
        let element = self.triangles.binary_search_by_key(&prim, |t| t.prim).ok()? as u32;
        let at = self.point(element, p, dir)?;
        Some(Crossing { t, at, radiance: self.emission(uv) })
    }

    pub(super) fn pdf_pos(&self, element: u32) -> AreaPdf {
        AreaPdf(self.densities[element as usize])
    }

    pub(super) fn pdf_dir(&self, n: Vec3, dir: Vec3) -> SolidAnglePdf {
        let pdf = warp::cosine_hemisphere_pdf(n.dot(dir));
        SolidAnglePdf(if self.two_sided { 0.5 * pdf.0 } else { pdf.0 })
    }

    pub(super) fn sample_li(&self, reference: Vec3, u: Vec2) -> Option<LightLiSample> {
        let (element, p, radiance) = self.sample(u);
        let d = p - reference;
        let d2 = d.length_squared();
        if d2 <= 0.0 || radiance == Rgb::ZERO {
            return None;
        }
        let wi = d / d2.sqrt();
        let at = self.point(element, p, wi)?;
        let pdf = self.pdf_pos(element).to_solid_angle(d2, at.n.dot(wi));
        Some(LightLiSample { radiance, wi, pdf, at: LightPoint { p: self.clear(&at), ..at } })
    }

    pub(super) fn sample_le(&self, u_pos: Vec2, u_dir: Vec2) -> Option<LightLeSample> {
        let (element, p, radiance) = self.sample(u_pos);
        let front = self.normals[element as usize];
        let (n, u_dir) = match (self.two_sided, u_dir.x < 0.5) {
            (false, _) => (front, u_dir),
            (true, true) => (front, Vec2::new(2.0 * u_dir.x, u_dir.y)),
            (true, false) => (-front, Vec2::new(2.0 * u_dir.x - 1.0, u_dir.y)),
        };
        let dir = Frame::from_normal(n).to_world(warp::square_to_cosine_hemisphere(u_dir));
        let pdf_dir = self.pdf_dir(n, dir);
        let at = LightPoint { p, n, rho: 0.0, element };
        (pdf_dir.0 > 0.0 && radiance != Rgb::ZERO).then(|| LightLeSample {
            radiance,
            at: LightPoint { p: self.clear(&at), ..at },
            dir,
            pdf_pos: self.pdf_pos(element),
            pdf_dir,
        })
    }

    /// Power at unit radiance, W.
    pub(super) fn power(&self) -> Rgb {
        self.power
    }
}
