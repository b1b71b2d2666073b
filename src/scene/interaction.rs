//! A point of a surface, ready to scatter light.

use glam::{Vec2, Vec3};

use super::lean;
use crate::{
    bsdf::{Affine, Bsdf, Scattering, TransportMode, adjoint_cosine},
    math::{Frame, SolidAnglePdf},
};

/// Units in the last place, of half an epsilon each, of the largest coordinate of a triangle: 7 for
/// the interpolated point, as many for the query, rounded up.
const ROUNDING_UNITS: f32 = 16.0;
/// Coordinates below it are offset by an absolute distance, metres \[Wachter19\].
const NEAR_ORIGIN: f32 = 1.0 / 32.0;
/// Offset of a coordinate near the origin, metres \[Wachter19\].
const OFFSET_NEAR_ORIGIN: f32 = 1.0 / 65536.0;
/// Offset of other coordinates, units in the last place \[Wachter19\].
const OFFSET_UNITS: f32 = 256.0;

/// A point of a surface with its normals and its BSDF.
#[derive(Clone, Copy, Debug)]
pub struct SurfaceInteraction<'a> {
    /// Position, metres.
    pub p: Vec3,
    /// Bound of the distance by which rounding may have put `p` off its triangle, metres.
    pub p_error: f32,
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
    /// without its relief; `frame` is that of the camera's direction. One that is not takes no part in
    /// scattering, whichever end of the path it belongs to: so nothing leaks through a closed surface, and
    /// both modes of transport agree.
    fn is_consistent(&self, to_camera: Vec3, to_light: Vec3, frame: &Frame) -> bool {
        self.untilted.is_none_or(|n| {
            n.dot(to_camera) * frame.n.dot(to_camera) > 0.0
                && n.dot(to_light) * self.frame.n.dot(to_light) > 0.0
        })
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
            (Some(_), false) => {
                let there = self.scatter(wo, wi, mode);
                let weight = there.value * (1.0 / s.pdf.0);
                Some(ScatterSample { weight, pdf_rev: there.pdf_rev, ..whole })
            }
        }
    }

    /// Origin of a ray that leaves along `w`, clear of the surface on the side of `w`.
    #[must_use]
    pub fn spawn_origin(&self, w: Vec3) -> Vec3 {
        let n = if w.dot(self.ng) < 0.0 { -self.ng } else { self.ng };
        offset_origin(self.p + n * self.p_error, n)
    }
}

/// Bound of the distance by which rounding may separate a triangle from a point interpolated on it
/// and from a ray that starts there, metres.
///
/// Both the interpolation and the ray's query, which takes corners relative to
/// the origin, round by the coordinates of the corners, however small those of
/// the point are. \[PBRT4\] 6.8.5 bounds the former by 7 units in the last place;
/// as many again for the latter.
pub(super) fn rounding_of(corners: [Vec3; 3]) -> f32 {
    ROUNDING_UNITS * (f32::EPSILON / 2.0) * largest_coordinate(corners)
}

fn largest_coordinate(corners: [Vec3; 3]) -> f32 {
    corners.iter().map(|c| c.abs().max_element()).fold(0.0, f32::max)
}

/// Distance from a triangle at which a ray that starts at any point of it is clear of it, metres.
pub fn clearance_of(corners: [Vec3; 3]) -> f32 {
    let offset = (OFFSET_UNITS * f32::EPSILON * largest_coordinate(corners)).max(OFFSET_NEAR_ORIGIN);
    rounding_of(corners) + offset
}

/// Moves `p` off its surface along `n` by a distance that scales with the
/// rounding error of `p`.
///
/// \[Wachter19\] listing 6-1: 256 units in the last place of each coordinate,
/// or an absolute distance near the origin, where these vanish.
#[must_use]
pub fn offset_origin(p: Vec3, n: Vec3) -> Vec3 {
    let offset = |p: f32, n: f32| {
        if p.abs() < NEAR_ORIGIN {
            p + OFFSET_NEAR_ORIGIN * n
        } else {
            let steps = (OFFSET_UNITS * n) as i32;
            f32::from_bits((p.to_bits() as i32 + if p < 0.0 { -steps } else { steps }) as u32)
        }
    };
    Vec3::new(offset(p.x, n.x), offset(p.y, n.y), offset(p.z, n.z))
}
