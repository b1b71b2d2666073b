//! Vertices of subpaths.

use glam::Vec3;

use crate::{
    bsdf::{Scattering, TransportMode},
    light::{LightId, LightPoint},
    math::NodeRgb,
    scene::SurfaceInteraction,
};

/// What a vertex lies on.
#[derive(Clone, Copy, Debug)]
pub enum VertexKind<'a> {
    /// A point of the lens.
    Camera,
    /// The origin of a light subpath.
    Light(LightId),
    /// A surface.
    Surface(SurfaceInteraction<'a>),
}

/// A vertex of a camera or light subpath.
#[derive(Clone, Copy, Debug)]
pub struct Vertex<'a, const N: usize = 1> {
    /// What it lies on.
    pub kind: VertexKind<'a>,
    /// Position, metres.
    pub p: Vec3,
    /// Unit direction toward the previous vertex of the subpath.
    pub wo: Vec3,
    /// Throughput from the subpath's start up to this vertex, its own
    /// scattering not included.
    pub beta: NodeRgb<N>,
    /// Light of a light subpath.
    pub light: LightId,
    /// Origin of a light subpath.
    pub at: LightPoint,
    /// Density with which the subpath's own sampling made this vertex, m⁻²
    /// (for `y_0` with the light's selection probability).
    pub pdf_fwd: f64,
    /// Whether the direction onward was drawn from a delta lobe.
    pub delta: bool,
    /// Weight recurrence, see [`super::weight`].
    pub mis: super::weight::Partial,
}

impl<'a, const N: usize> Vertex<'a, N> {
    /// Geometric normal; `None` where there is no surface (lens, light).
    #[must_use]
    pub fn surface(&self) -> Option<&SurfaceInteraction<'a>> {
        match &self.kind {
            VertexKind::Surface(si) => Some(si),
            _ => None,
        }
    }

    /// |cos| between the surface and `w`; 1 where there is none.
    #[must_use]
    pub fn abs_cos(&self, w: Vec3) -> f32 {
        self.surface().map_or(1.0, |si| si.ng.dot(w).abs())
    }

    /// Whether a connection may end here.
    #[must_use]
    pub fn connectible(&self) -> bool {
        self.surface().is_some_and(|si| si.bsdf.has_non_delta())
    }

    /// Scattering between the previous vertex and `wi`; none where there is no surface.
    #[must_use]
    pub fn scatter(&self, wi: Vec3, mode: TransportMode) -> Scattering {
        self.surface().map_or(Scattering::ZERO, |si| si.scatter(self.wo, wi, mode))
    }
}
