//! What lies between the vertices of a path: exact at both ends of every edge.
//!
//! Embree judges on which side of a triangle a ray's origin lies by the origin alone, so all rays from
//! one origin agree about it, and about a crossing near the origin to a rounding of the triangle's
//! extent. Far from the origin a crossing is as uncertain as the ray is long. Hence
//! * an edge is traced from both ends, each end by its own ray ([`Scene::transmittance`]);
//! * a point that was hit is looked back from ([`Scene::settle`]): if a surface lies between, rounding has
//!   put the point behind that surface, into the next wall of a corner for instance.
//!
//! A path is then a chain of points of which each sees the next, and the inside of a closed surface is
//! not left by rounding.

use glam::Vec3;
use rayon::prelude::*;

use super::{Edge, MAX_LAYERS, Scene, SurfaceHit, interaction, mesh::Mesh};
use crate::{
    embree::Ray,
    light::{Light, LightId, LightPoint, Shape},
    math::Bounds,
};

/// Share of an edge that is looked at from its far end. Where both rays meet, either is exact to some
/// millionths of the edge's length; a hundredth of that share is seen by both.
const SEAM: f32 = 1.0 / 16.0;
/// Factor on [`SEAM`] within which the far ray overlaps the near one.
const OVERLAP: f32 = 1.01;
/// Largest sine of the angle between a light and a triangle that lies in the same plane: some roundings of
/// the light's frame.
const PARALLEL: f32 = 1e-5;

impl Scene {
    /// Transmittance in [0, 1] of the open segment from `from` to `to`: the product of 1 − opacity over
    /// the surfaces between, 0 where a light but `except` blocks it. Both ends must already be clear of
    /// their own surfaces.
    #[must_use]
    pub fn transmittance(&self, from: Vec3, to: Vec3, except: Option<LightId>) -> f32 {
        let d = to - from;
        if self.n_occluders > 0 {
            let length = d.length();
            if self.first_occluder(from, d / length, length, except).is_some() {
                return 0.0;
            }
        }
        let near = Ray { org: from, dir: d, t_min: 0.0, t_max: 1.0 - SEAM };
        let far = Ray { org: to, dir: -d, t_min: 0.0, t_max: SEAM * OVERLAP };
        // In the open about a light nothing can be met from its end.
        let room = except.and_then(|id| self.light_rooms[id as usize]);
        let is_open = room.is_some_and(|(middle, r)| to.distance(middle) + far.t_max * d.length() < r);
        if !self.is_translucent {
            let is_blocked = self.accel.occluded(&near) || (!is_open && self.accel.occluded(&far));
            return if is_blocked { 0.0 } else { 1.0 };
        }
        let (passed, last) = self.passed(near, None);
        if passed > 0.0 && !is_open { passed * self.passed(far, last).0 } else { passed }
    }

    /// Product of 1 − opacity over the surfaces that a ray meets, and the last of them, which the ray from
    /// the other end does not count again: `counted`.
    fn passed(&self, ray: Ray, counted: Option<u32>) -> (f32, Option<u32>) {
        let dir = ray.dir.normalize_or_zero();
        let (mut passed, mut last) = (1.0, None);
        let mut rest = ray;
        for _ in 0..MAX_LAYERS {
            let Some(hit) = self.accel.intersect(&rest) else { return (passed, last) };
            if !self.may_pass(hit.prim) {
                return (0.0, None);
            }
            let hit = self.surface(&hit, dir, 1.0);
            if counted != Some(hit.si.triangle) {
                passed *= 1.0 - self.materials[hit.material as usize].opacity(hit.uv);
            }
            if passed <= 0.0 {
                return (0.0, None);
            }
            last = Some(hit.si.triangle);
            let org = hit.si.spawn_origin(dir);
            let t_max = ray.t_max - (org - ray.org).dot(dir) / ray.dir.length();
            if t_max <= 0.0 {
                return (passed, last);
            }
            rest = Ray { org, t_max, ..ray };
        }
        (0.0, None)
    }

    /// The end of an edge with a clearance from which the edge is seen, also where surfaces coincide;
    /// `None` where another surface hides it.
    pub(super) fn settle<'a>(&self, org: Vec3, dir: Vec3, hit: SurfaceHit<'a>) -> Option<SurfaceHit<'a>> {
        let mut hit = hit;
        let seen = org + dir * (hit.t * (1.0 - SEAM));
        // A surface that coincides with the one hit may need more room; more than one is not tried.
        for _ in 0..2 {
            let from = hit.si.spawn_origin(-dir);
            let Some(hidden_by) = self.first_opaque(from, seen - from) else { return Some(hit) };
            let room = interaction::clearance_at(self.mesh.corners(hidden_by as usize), hit.si.p);
            if room <= hit.si.clearance {
                return None;
            }
            hit.si.clearance += room;
        }
        None
    }

    /// The first triangle between `org` and `org + d` through which nothing ever passes.
    fn first_opaque(&self, org: Vec3, d: Vec3) -> Option<u32> {
        let mut ray = Ray { org, dir: d, t_min: 0.0, t_max: 1.0 };
        // Nearly always there is none, which the cheaper query tells.
        if !self.is_translucent && !self.accel.occluded(&ray) {
            return None;
        }
        for _ in 0..MAX_LAYERS {
            let hit = self.accel.intersect(&ray)?;
            if !self.may_pass(hit.prim) {
                return Some(hit.prim);
            }
            // Embree counts a hit at `t_min` itself.
            ray.t_min = hit.t.next_up();
        }
        None
    }

    /// Point at which rays to and from the point `at` of a light end and start: clear of the surfaces on
    /// which the light lies.
    #[must_use]
    pub fn light_end(&self, id: LightId, at: &LightPoint) -> Vec3 {
        self.lights[id as usize].clear(at, self.light_clearances[id as usize])
    }

    /// Ray parameter before which an edge must cross the light `id` for the crossing to count, metres.
    ///
    /// A panel that lies on a surface is crossed by the edges that end there, and one behind a surface is
    /// not, however near: the place of the end decides, not the rounded lengths of two rays.
    pub(super) fn crossing_limit(&self, edge: &Edge, id: LightId) -> f32 {
        if edge.blocked_by == Some(id) {
            // The body of the light lies where its crossing does.
            return edge.t_max * 1.0001;
        }
        match (&self.lights[id as usize].shape, &edge.hit) {
            (Shape::Planar(panel), Some(hit)) => {
                let height = (hit.si.p - panel.center).dot(panel.frame.n);
                let room = self.light_clearances[id as usize] + panel.rounding(hit.si.p);
                if height <= room { f32::INFINITY } else { 0.0 }
            }
            _ => edge.t_max,
        }
    }
}

/// Height above a panel at which rays are clear of the surfaces that lie in its plane, metres; 0 for other
/// lights, and where there are none.
pub(super) fn clearance_over(light: &Light, mesh: &Mesh) -> f32 {
    let Shape::Planar(panel) = &light.shape else { return 0.0 };
    let coincident = |corners: &[Vec3; 3]| {
        let [a, b, c] = corners.map(|c| c.as_dvec3());
        let Some(n) = (b - a).cross(c - a).try_normalize() else { return false };
        let height = (panel.center.as_dvec3() - a).dot(n).abs();
        let tilt = panel.frame.n.as_dvec3().cross(n).length();
        tilt <= f64::from(PARALLEL)
            && height <= f64::from(interaction::clearance_of(*corners) + panel.rounding(panel.center))
    };
    let corners = (0..mesh.indices.len()).into_par_iter().map(|triangle| mesh.corners(triangle));
    corners.filter(coincident).map(interaction::clearance_of).reduce(|| 0.0, f32::max)
}

/// Middle of a light and radius of a ball about it that no triangle enters, metres; `None` for a light at
/// infinity, where rays start outside of everything, and for an emissive mesh, whose triangles are surfaces. Of the
/// ball about a panel only the half before it counts, from `clearance` above it, where its rays start.
pub(super) fn room_about(light: &Light, clearance: f32, mesh: &Mesh) -> Option<(Vec3, f32)> {
    let middle = match &light.shape {
        Shape::Planar(s) => s.center,
        Shape::Sphere(s) => s.center,
        Shape::Point(s) => s.position,
        Shape::Distant(_) | Shape::Environment(_) | Shape::Mesh(_) => return None,
    };
    let is_behind = |corners: [Vec3; 3]| match &light.shape {
        Shape::Planar(s) => corners.iter().all(|c| (c - s.center).dot(s.frame.n) <= clearance),
        _ => false,
    };
    // The distance of its box is a lower bound of a triangle's.
    let distance = |corners: [Vec3; 3]| {
        let b = Bounds::of(corners);
        middle.clamp(b.lo, b.hi).distance(middle)
    };
    let corners = (0..mesh.indices.len()).into_par_iter().map(|triangle| mesh.corners(triangle));
    let each = corners.filter(|&corners| !is_behind(corners)).map(distance);
    let nearest = each.reduce(|| f32::MAX, f32::min);
    // What boxes, lengths and the sum of two of them round, and as much again.
    let rounding = 16.0 * f32::EPSILON * (middle.abs().max_element() + nearest);
    Some((middle, nearest * (1.0 - 1e-4) - rounding))
}
