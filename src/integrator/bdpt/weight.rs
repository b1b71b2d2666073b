//! Multiple importance sampling weights in constant time per connection.
//!
//! A path x_0 (light) … x_k (camera) can be made by the strategies s = 0..k.
//! With p→_i and p←_i the area densities of x_i when made from the light or
//! from the camera side, and h the heuristic's function, the weight of s is
//!
//! ```text
//! w_s = 1 / (1 + S_L + S_C)
//! S_C = r_{t-1} (c_{t-1} + r_{t-2} (c_{t-2} + … )),   r_i = h(p→(z_i) / p←(z_i))
//! ```
//!
//! and likewise S_L with the roles exchanged. c_i is 1 where the strategy with
//! i vertices on that side exists (neither end of its connection is a delta
//! scattering), else 0. Only r_{t-1} and one factor of r_{t-2}, the density of
//! the direction z_{t-1} → z_{t-2}, depend on the connection. The rest is
//! known when z_{t-1} is made and kept in its [`Partial`]:
//!
//! ```text
//! S_C = r_{t-1} (previous + h(pdf_rev(z_{t-1})) · geometry · inner)
//! ```
//!
//! Two terms differ from the textbook: a light point seen from a vertex
//! (s = 1) has another density than the origin of a light subpath, so c_1 on
//! the light side is h(p_nee/p_origin); and s = 0 exists wherever the light
//! can be crossed. Russian roulette is left out of all densities: any weights
//! that sum to one will do.
//!
//! # References
//! \[Veach97\] 10.2; \[vanAntwerpen11\] (recurrence).

use crate::integrator::Heuristic;

/// Sums over the strategies with fewer vertices on one side than a vertex v_j of a subpath has, as far
/// as they are known when v_j is made.
#[derive(Clone, Copy, Debug, Default)]
pub struct Partial {
    /// c_j, given that v_j itself is not delta: whether (and, next to a light,
    /// with which factor) the edge v_{j-1} v_j can be a connection.
    pub previous: f64,
    /// h(|cos θ_{j-1}| / (d² p_fwd(v_{j-1}))): turns the reverse density at
    /// v_j into r_{j-1}.
    pub geometry: f64,
    /// c_{j-1} + r_{j-2} (c_{j-2} + … ).
    pub inner: f64,
}

impl Partial {
    /// Sum over the strategies with fewer vertices on this side, divided by r_j, where `pdf_rev` is the
    /// density of v_j → v_{j-1} given the connection, sr⁻¹.
    #[must_use]
    pub fn close(&self, h: Heuristic, pdf_rev: f32) -> f64 {
        self.previous + h.apply(f64::from(pdf_rev)) * self.geometry * self.inner
    }

    /// Sums of v_{j+1}, sampled from v_j, without `geometry`, which needs the distance:
    /// * `pdf_rev`: density of v_j → v_{j-1} given v_{j+1}
    /// * `delta`: whether v_j scattered by a delta lobe
    #[must_use]
    pub fn extend(&self, h: Heuristic, pdf_rev: f32, delta: bool) -> Self {
        let c_j = if delta { 0.0 } else { self.previous };
        Self {
            previous: if delta { 0.0 } else { 1.0 },
            geometry: 0.0,
            inner: c_j + h.apply(f64::from(pdf_rev)) * self.geometry * self.inner,
        }
    }
}
