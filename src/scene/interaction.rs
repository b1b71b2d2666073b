//! A point of a surface, ready to scatter light.

use glam::{DVec3, Vec2, Vec3};

use super::lean;
use crate::{
    bsdf::{Affine, Bsdf, Scattering, TransportMode, adjoint_cosine},
    math::{Frame, SolidAnglePdf, offset},
};

/// A point of a surface with its normals and its BSDF.
#[derive(Clone, Copy, Debug)]
pub struct SurfaceInteraction<'a> {
    /// Position, metres.
    pub p: Vec3,
    /// Height above the triangle, metres, from which on a ray that starts near the point is clear of the
    /// triangle.
    pub clearance: f32,
    /// Unit geometric normal, in the hemisphere of the shading normal.
    pub ng: Vec3,
    /// Shading frame: +z is the shading normal, tilted where the material has a relief.
    pub frame: Frame,
    /// Unit shading normal before a relief tilted it; `None` without relief.
    pub untilted: Option<Vec3>,
    /// BSDF at the point, for the base colour at value 1 of the background.
    pub bsdf: Bsdf<'a>,
    /// Whether the background's value scales the base colour.
    pub is_background: bool,
    /// Index of the triangle.
    pub triangle: u32,
}

/// A direction sampled at a [`SurfaceInteraction`].
#[derive(Clone, Copy, Debug)]
pub struct ScatterSample {
    /// Unit direction, world space.
    pub wi: Vec3,
    /// BSDF times cosine over density, adjoint correction included.
    pub weight: Affine,
    /// Density of `wi` given `wo`; for a delta lobe the probability of the lobe.
    pub pdf: SolidAnglePdf,
    /// Density of `wo` given `wi`, the reverse choice; for a delta lobe the probability of the lobe.
    pub pdf_rev: SolidAnglePdf,
    /// Whether the direction came from a delta lobe, a perfect mirror or refraction.
    pub delta: bool,
}

impl SurfaceInteraction<'_> {
    /// The shading frame bent for a camera subpath that leaves along `to_camera` ([`lean`]); `None` where
    /// it need not be.
    fn bent(&self, to_camera: Vec3) -> Option<Frame> {
        // A relief is left as it is: a slope of it that leans away from the viewer is dark.
        if self.untilted.is_some() {
            return None;
        }
        // A surface seen from behind is turned over as a whole.
        let side = 1.0_f32.copysign(self.ng.dot(to_camera));
        let reflects = !matches!(self.bsdf, Bsdf::Diffuse(_));
        lean::bent(self.frame.n * side, self.ng * side, to_camera, reflects)
            .map(|n| Frame::from_normal(n * side))
    }

    /// Whether the shading normal is bent for a camera subpath that leaves along `to_camera`. What a delta lobe
    /// then sends there no light subpath finds.
    #[must_use]
    pub fn is_bent(&self, to_camera: Vec3) -> bool {
        self.bent(to_camera).is_some()
    }

    /// Whether the directions to the camera and to the light are on the same side of the surface with and
    /// without its relief and, where nothing is transmitted, of the triangle itself; `frame` is that of the
    /// camera's direction, in which the surface scatters. One that is not takes no part in scattering,
    /// whichever end of the path it belongs to: so no light passes an opaque surface, and both modes of
    /// transport agree.
    fn is_consistent(&self, to_camera: Vec3, to_light: Vec3, frame: &Frame) -> bool {
        let agree = |w: Vec3, a: Vec3, b: Vec3| a.dot(w) * b.dot(w) > 0.0;
        let both = |a: Vec3, b: Vec3| agree(to_camera, a, b) && agree(to_light, a, b);
        self.untilted.is_none_or(|n| both(n, self.frame.n))
            && (self.bsdf.transmits() || both(self.ng, frame.n))
    }

    /// BSDF without cosine and densities, in a frame.
    fn evaluate(&self, frame: &Frame, wo: Vec3, wi: Vec3, mode: TransportMode) -> Scattering {
        self.bsdf.evaluate(frame.to_local(wo), frame.to_local(wi), mode)
    }

    /// BSDF times cosine about `wi`, adjoint correction included, and the densities with which
    /// [`Self::sample`] draws either direction given the other; world directions.
    ///
    /// The value is that in the frame bent for the camera's direction, in both modes of transport. A light
    /// subpath does not know that direction before it is drawn, and draws it in the frame as it is.
    #[must_use]
    pub fn scatter(&self, wo: Vec3, wi: Vec3, mode: TransportMode) -> Scattering {
        let (to_camera, to_light) = match mode {
            TransportMode::Radiance => (wo, wi),
            TransportMode::Importance => (wi, wo),
        };
        let bent = self.bent(to_camera);
        let frame = bent.unwrap_or(self.frame);
        if !self.is_consistent(to_camera, to_light, &frame) {
            return Scattering::ZERO;
        }
        let s = self.evaluate(&frame, wo, wi, mode);
        let value = s.value * adjoint_cosine(wo, wi, frame.n, self.ng, mode);
        if bent.is_none() {
            return Scattering { value, ..s };
        }
        let from_light = self.evaluate(&self.frame, wo, wi, mode);
        match mode {
            TransportMode::Radiance => Scattering { value, pdf: s.pdf, pdf_rev: from_light.pdf_rev },
            TransportMode::Importance => Scattering { value, pdf: from_light.pdf, pdf_rev: s.pdf_rev },
        }
    }

    /// Samples a direction; `uc` chooses the lobe, `u` the direction, both in [0, 1). `None` where the
    /// surface scatters nothing that way.
    #[must_use]
    pub fn sample(&self, wo: Vec3, uc: f32, u: Vec2, mode: TransportMode) -> Option<ScatterSample> {
        let is_camera = mode == TransportMode::Radiance;
        let bent = if is_camera { self.bent(wo) } else { None };
        let drawn_in = bent.unwrap_or(self.frame);
        let s = self.bsdf.sample(drawn_in.to_local(wo), uc, u, mode).filter(|s| s.pdf.0 > 0.0)?;
        let wi = drawn_in.to_world(s.wi);
        let (bent, to_camera, to_light) = if is_camera { (bent, wo, wi) } else { (self.bent(wi), wi, wo) };
        let frame = bent.unwrap_or(self.frame);
        if !self.is_consistent(to_camera, to_light, &frame) {
            return None;
        }
        let weight = s.f * (adjoint_cosine(wo, wi, frame.n, self.ng, mode) / s.pdf.0);
        let whole = ScatterSample { wi, weight, pdf: s.pdf, pdf_rev: s.pdf_rev, delta: s.delta };
        match (bent, is_camera) {
            (None, _) => Some(whole),
            // Bent, many directions toward the camera have one mirror direction: no light subpath finds them.
            (Some(_), true) if s.delta => Some(ScatterSample { pdf_rev: SolidAnglePdf(0.0), ..whole }),
            (Some(_), false) if s.delta => None,
            (Some(_), true) => {
                Some(ScatterSample { pdf_rev: self.evaluate(&self.frame, wo, wi, mode).pdf_rev, ..whole })
            }
            (Some(frame), false) => {
                let there = self.evaluate(&frame, wo, wi, mode);
                let value = there.value * adjoint_cosine(wo, wi, frame.n, self.ng, mode);
                Some(ScatterSample { weight: value * (1.0 / s.pdf.0), pdf_rev: there.pdf_rev, ..whole })
            }
        }
    }

    /// Origin of a ray that leaves along `w`, clear of the surface on the side of `w`.
    #[must_use]
    pub fn spawn_origin(&self, w: Vec3) -> Vec3 {
        let n = if w.dot(self.ng) < 0.0 { -self.ng } else { self.ng };
        offset(self.p, n, self.clearance)
    }
}

/// Height above a triangle, metres, from which on a ray that starts near the rounded point `p` of its
/// plane is clear of it.
///
/// The coordinates of `p` are off by half a unit in the last place each \[PBRT4\] 6.8.5. Embree takes
/// corners relative to the ray's origin, so that what it makes of the height is off by the triangle's
/// extent, not by its place: with E the sides of the bounding box, n the unit normal and A the area by
/// up to (Σ E·|n| + 3 E_x E_y E_z / A) half epsilons, of which random triangles, slivers among them,
/// reached a quarter. Twice as much is taken. What lies along the axes is exact, of any size; but a ray
/// that starts at no height at all meets its own triangle, hence [`LEAST_CLEARANCE`].
pub(super) fn clearance_at(corners: [Vec3; 3], p: Vec3) -> f32 {
    let n = face_normal64(corners);
    clearance(corners, n, n.length(), p)
}

/// Least clearance over the largest side of a triangle's bounding box, epsilons: above zero, and so far from
/// it that its product with the triangle's area does not underflow.
const LEAST_CLEARANCE: f64 = 1.0 / 1024.0;

/// [`clearance_at`] with the normal `n` of length `twice_area`.
fn clearance(corners: [Vec3; 3], n: DVec3, twice_area: f64, p: Vec3) -> f32 {
    let [a, b, c] = corners;
    let extent = (a.max(b).max(c) - a.min(b).min(c)).as_dvec3();
    let of_query = extent.dot(n.abs()) + 6.0 * extent.x * extent.y * extent.z;
    let of_point = 0.5 * p.abs().as_dvec3().dot(n.abs());
    let least = LEAST_CLEARANCE * extent.max_element();
    let epsilons = if twice_area > 0.0 {
        ((of_query + of_point) / twice_area).max(least)
    } else {
        f64::from(p.abs().max_element()) + extent.max_element()
    };
    (f64::from(f32::EPSILON) * epsilons) as f32
}

/// Height above a triangle, metres, at which a ray that starts at any point of it is clear of it.
#[must_use]
pub fn clearance_of(corners: [Vec3; 3]) -> f32 {
    let [a, b, c] = corners;
    clearance_at(corners, a.abs().max(b.abs()).max(c.abs()))
}

/// A point of a triangle that is interpolated so that it is off by one rounding of each coordinate, the
/// unit normal, and the point's [`clearance_at`].
pub(super) fn point_of(corners: [Vec3; 3], u: f32, v: f32) -> (Vec3, Option<Vec3>, f32) {
    let [a, b, c] = corners.map(|c| c.as_dvec3());
    let p = (a + (b - a) * f64::from(u) + (c - a) * f64::from(v)).as_vec3();
    let n = (b - a).cross(c - a);
    let twice_area = n.length();
    let ng = (twice_area > 0.0).then(|| (n / twice_area).as_vec3());
    (p, ng, clearance(corners, n, twice_area, p))
}

fn face_normal64(corners: [Vec3; 3]) -> DVec3 {
    let [a, b, c] = corners.map(|c| c.as_dvec3());
    (b - a).cross(c - a)
}
