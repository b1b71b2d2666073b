//! Vertices of subpaths.

use glam::Vec3;

use crate::{
    bsdf::{Scattering, TransportMode},
    light::{LightId, LightPoint},
    math::NodeRgb,
    scene::SurfaceInteraction,
};

/// Place of a vertex: lens, light or surface.
#[derive(Clone, Copy, Debug)]
pub enum VertexKind<'a> {
    /// A point of the lens.
    Camera,
    /// Origin of a light subpath on a light.
    Light(LightId),
    /// A surface.
    Surface(SurfaceInteraction<'a>),
}

/// A vertex of a camera or light subpath.
#[derive(Clone, Copy, Debug)]
pub struct Vertex<'a, const N: usize = 1> {
    /// Place of the vertex.
    pub kind: VertexKind<'a>,
    /// Position, metres.
    pub p: Vec3,
    /// Unit direction toward the previous vertex of the subpath; zero at the first.
    pub wo: Vec3,
    /// Throughput from the start of the subpath up to this vertex, without scattering at the vertex.
    pub beta: NodeRgb<N>,
    /// Light on which a light subpath begins.
    pub light: LightId,
    /// Point on which a light subpath begins.
    pub at: LightPoint,
    /// Density with which the subpath's own sampling made this vertex, m⁻²; for `y_0` with the light's
    /// selection probability.
    pub pdf_fwd: f64,
    /// Whether the direction to the next vertex was drawn from a delta lobe.
    pub delta: bool,
    /// Sums of the weights' recurrence, see [`super::weight`].
    pub mis: super::weight::Partial,
}

impl<'a, const N: usize> Vertex<'a, N> {
    /// Surface on which the vertex lies; `None` for a vertex on the lens or on a light.
    #[must_use]
    pub fn surface(&self) -> Option<&SurfaceInteraction<'a>> {
        match &self.kind {
            VertexKind::Surface(si) => Some(si),
            _ => None,
        }
    }

    /// |cos| between the geometric normal and unit `w`; 1 where there is no surface.
    #[must_use]
    pub fn abs_cos(&self, w: Vec3) -> f32 {
        self.surface().map_or(1.0, |si| si.ng.dot(w).abs())
    }

    /// Whether a connection may end at the vertex: only on a surface that does more than scatter by delta
    /// lobes.
    #[must_use]
    pub fn connectible(&self) -> bool {
        self.surface().is_some_and(|si| si.bsdf.has_non_delta())
    }

    /// Scattering function and densities between the previous vertex and unit `wi`; zero where there is
    /// no surface.
    #[must_use]
    pub fn scatter(&self, wi: Vec3, mode: TransportMode) -> Scattering {
        self.surface().map_or(Scattering::ZERO, |si| si.scatter(self.wo, wi, mode))
    }
}
