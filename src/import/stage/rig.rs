//! Three lights and a backdrop as a photographer places them.
//!
//! # References
//! \[Hunter15\] (key, fill and rim light; the seamless sweep).

use std::f32::consts::PI;

use glam::Vec3;

use super::{frame::View, obstacles::Obstacles};
use crate::{import::backdrop::Sweep, math::Bounds};

/// Outline of a planar light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightForm {
    /// Square (a softbox) of this half side, metres.
    Square(f32),
    /// Disk of this radius, metres.
    Disk(f32),
}

/// A planar light that faces the centre of the subject.
#[derive(Clone, Copy, Debug)]
pub struct StagedLight {
    /// Unique name in the sidecar.
    pub name: &'static str,
    /// What the light is for, for a comment in the sidecar.
    pub purpose: &'static str,
    /// Centre, metres.
    pub position: Vec3,
    /// Outline and extent.
    pub form: LightForm,
    /// Emitted radiance, W·m⁻²·sr⁻¹.
    pub radiance: f32,
}

/// A light's place relative to subject and camera. The subject's radius is half the diagonal of
/// its bounding box.
struct LightPlacement {
    name: &'static str,
    purpose: &'static str,
    /// Angle about the subject from the camera, degrees to the right in the picture.
    azimuth: f32,
    /// Elevation above the subject's centre, degrees.
    elevation: f32,
    /// Distance from the subject's centre, in radii of the subject.
    distance: f32,
    /// Half side or radius, in radii of the subject.
    extent: f32,
    /// Whether the light is a disk; otherwise it is a square.
    is_round: bool,
    /// Irradiance at the subject's centre of a surface that faces the light, W·m⁻².
    irradiance: f32,
}

/// Key, fill and rim light \[Hunter15\]. White shows as white at an irradiance of π: key and fill together
/// give 3.2 where both shine fully, and (2.6 + 0.6)/0.6 = 5.3 times as much as the fill in the key's shadow.
const RIG: [LightPlacement; 3] = [
    LightPlacement {
        name: "key",
        purpose: "a softbox as large as the subject, 45 degrees to the left and up",
        azimuth: -45.0,
        elevation: 45.0,
        distance: 3.0,
        extent: 0.7,
        is_round: false,
        irradiance: 2.6,
    },
    LightPlacement {
        name: "fill",
        purpose: "larger and weaker, from the right: it opens the key's shadows",
        azimuth: 50.0,
        elevation: 20.0,
        distance: 3.5,
        extent: 1.0,
        is_round: false,
        irradiance: 0.6,
    },
    LightPlacement {
        name: "rim",
        purpose: "high behind, out of the picture: it sets the subject off from the backdrop",
        azimuth: 155.0,
        elevation: 50.0,
        distance: 2.8,
        extent: 0.3,
        is_round: true,
        irradiance: 2.0,
    },
];

/// Elevation up to which a light is raised to leave the picture, degrees: above it a light is overhead,
/// and its azimuth says little.
const STEEPEST: f32 = 80.0;
/// Step by which a light is raised, degrees: at 3 radii a tenth of the subject's radius, less than the
/// extent of the smallest light.
const ELEVATION_STEP: f32 = 2.0;
/// Distance of a light over that of the wall behind it, both from the subject: the rest leaves room for
/// the light's own extent where the wall is not square to it.
const CLEARANCE: f32 = 0.85;
/// Least distance of a light over the wanted one, whatever stands there: a sidecar's light needs a
/// distance and an extent.
const LEAST_SHARE: f32 = 0.05;
/// Distance of the backdrop's wall behind the subject's centre, in radii of the subject. The key's shadow
/// ends within 1 + √2 = 2.4, and the rim light stands at 1.6: both before the wall.
const WALL_DISTANCE: f32 = 3.2;
/// Least height of the wall, in radii of the subject: above the fill raised to the steepest elevation,
/// 3.5·sin 80° + 1 = 4.4.
const WALL_HEIGHT: f32 = 4.5;
/// Width over height of the widest picture that the backdrop fills: that of CinemaScope, 2.39.
const WIDEST: f32 = 2.4;
/// Largest depth of a point of the wall along the optical axis over its horizontal distance from the
/// camera: cos 28° + ⅔·sin² 28°/cos 28° = 1.05 at the steepest elevation, rounded up.
const DEPTH_RATIO: f32 = 1.1;
/// Size of the backdrop over what the camera sees of it: a camera moved by a seventh of the picture still
/// sees no edge.
const SPARE: f32 = 1.15;

/// Half the diagonal of the subject's bounding box, metres.
pub fn radius(subject: &Bounds) -> f32 {
    0.5 * subject.extent().length()
}

/// Key, fill and rim light of a subject as seen by a camera.
pub fn lights(subject: &Bounds, view: &View, obstacles: &Obstacles) -> Vec<StagedLight> {
    RIG.iter().map(|placement| light(placement, subject, view, obstacles)).collect()
}

fn light(placement: &LightPlacement, subject: &Bounds, view: &View, obstacles: &Obstacles) -> StagedLight {
    let (center, r) = (subject.center(), radius(subject));
    let to_camera = level(view.eye - center);
    let right = Vec3::Y.cross(to_camera);
    let (sin, cos) = placement.azimuth.to_radians().sin_cos();
    let toward = to_camera * cos + right * sin;
    let at = |elevation: f32| {
        let (up, across) = elevation.to_radians().sin_cos();
        center + (toward * across + Vec3::Y * up) * placement.distance * r
    };
    let margin = 1.0 + placement.extent * r / (view.tangents().y * view.eye.distance(center));
    let is_seen = |p: Vec3| view.project(p).is_some_and(|q| q.abs().max_element() < margin);
    let mut elevation = placement.elevation;
    while elevation < STEEPEST && is_seen(at(elevation)) {
        elevation += ELEVATION_STEP;
    }
    let wanted = at(elevation);
    let free = obstacles.free_share(center, wanted);
    let share = if free < 1.0 { (CLEARANCE * free).max(LEAST_SHARE) } else { 1.0 };
    let (distance, extent) = (placement.distance * r * share, placement.extent * r * share);
    let area = if placement.is_round { PI * extent * extent } else { 4.0 * extent * extent };
    StagedLight {
        name: placement.name,
        purpose: placement.purpose,
        position: center + (wanted - center) * share,
        form: if placement.is_round { LightForm::Disk(extent) } else { LightForm::Square(extent) },
        radiance: placement.irradiance * distance * distance / area,
    }
}

/// The horizontal part of a direction, normalised; +z for a vertical one.
fn level(v: Vec3) -> Vec3 {
    Vec3::new(v.x, 0.0, v.z).normalize_or(Vec3::Z)
}

/// A backdrop at height `floor`, metres, that fills the picture and is open toward the camera.
pub fn backdrop(subject: &Bounds, floor: f32, view: &View) -> Sweep {
    let (center, r) = (subject.center(), radius(subject));
    let position = Vec3::new(center.x, floor, center.z);
    let to_camera = level(view.eye - center);
    let back = WALL_DISTANCE * r;
    let camera = (view.eye - position).dot(to_camera);
    let to_wall = camera + back;
    let axes = view.axes();
    let tangent = view.tangents().y;
    let top = axes.forward + axes.up * tangent;
    let top_at_wall = view.eye.y + top.y / -top.dot(to_camera).min(-1e-3) * to_wall - floor;
    let front = SPARE * camera + r;
    let height = (SPARE * top_at_wall + 0.5 * r).max(WALL_HEIGHT * r);
    Sweep {
        position,
        turn: to_camera.x.atan2(to_camera.z),
        front,
        back,
        width: 2.0 * SPARE * (tangent * WIDEST * to_wall * DEPTH_RATIO + r),
        height,
        radius: 0.5 * back.min(height),
    }
}
