//! Three lights and a backdrop as a photographer places them.
//!
//! # References
//! \[Hunter15\] (key, fill and rim light; the seamless sweep).

use std::f32::consts::PI;

use glam::Vec3;

use super::{super::backdrop::Sweep, frame::View, obstacles::Obstacles};
use crate::math::Bounds;

/// A light's shape; extents in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Form {
    /// Half side of a square.
    Softbox(f32),
    /// Radius.
    Disk(f32),
}

/// A light that looks at the subject.
#[derive(Clone, Copy, Debug)]
pub struct StagedLight {
    /// Name.
    pub name: &'static str,
    /// What it is for.
    pub purpose: &'static str,
    /// Centre, metres.
    pub position: Vec3,
    /// Shape.
    pub form: Form,
    /// W·m⁻²·sr⁻¹.
    pub radiance: f32,
}

/// How a light stands to subject and camera.
struct Place {
    name: &'static str,
    purpose: &'static str,
    /// Degrees from the camera, to the right in the picture.
    azimuth: f32,
    /// Degrees above the subject.
    elevation: f32,
    /// In radii of the subject.
    distance: f32,
    /// Half side or radius, in radii of the subject.
    extent: f32,
    is_round: bool,
    /// W·m⁻² at the subject. White that faces the light shows as white at π.
    irradiance: f32,
}

const RIG: [Place; 3] = [
    Place {
        name: "key",
        purpose: "a softbox as large as the subject, 45 degrees to the left and up",
        azimuth: -45.0,
        elevation: 45.0,
        distance: 3.0,
        extent: 0.7,
        is_round: false,
        irradiance: 2.6,
    },
    Place {
        name: "fill",
        purpose: "larger and weaker, from the right: it opens the key's shadows",
        azimuth: 50.0,
        elevation: 20.0,
        distance: 3.5,
        extent: 1.0,
        is_round: false,
        irradiance: 0.6,
    },
    Place {
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

/// Elevation above which a light is not raised to leave the picture, degrees.
const STEEPEST: f32 = 80.0;
/// Share of the free distance at which a light is placed before a wall.
const CLEARANCE: f32 = 0.85;
/// Least share, whatever stands there: a light has a distance and a size.
const LEAST_SHARE: f32 = 0.05;
/// Distance of the backdrop's wall behind the subject's middle, in radii of the subject.
const WALL_DISTANCE: f32 = 3.2;
/// Least height of the wall, in radii of the subject.
const WALL_HEIGHT: f32 = 4.5;
/// Widest picture whose sides the backdrop fills, width over height.
const WIDEST: f32 = 2.4;
/// Room that the backdrop has around what the camera sees of it.
const SPARE: f32 = 1.15;

/// Half the diagonal of a box.
pub fn radius(subject: &Bounds) -> f32 {
    0.5 * subject.extent().length()
}

/// The lights.
pub fn lights(subject: &Bounds, view: &View, obstacles: &Obstacles) -> Vec<StagedLight> {
    RIG.iter().map(|place| light(place, subject, view, obstacles)).collect()
}

fn light(place: &Place, subject: &Bounds, view: &View, obstacles: &Obstacles) -> StagedLight {
    let (center, r) = (subject.center(), radius(subject));
    let to_camera = level(view.eye - center);
    let right = Vec3::Y.cross(to_camera);
    let (sin, cos) = place.azimuth.to_radians().sin_cos();
    let toward = to_camera * cos + right * sin;
    let at = |elevation: f32| {
        let (up, across) = elevation.to_radians().sin_cos();
        center + (toward * across + Vec3::Y * up) * place.distance * r
    };
    let margin = 1.0 + place.extent * r / (view.tangents().y * view.eye.distance(center));
    let is_seen = |p: Vec3| view.project(p).is_some_and(|q| q.abs().max_element() < margin);
    let mut elevation = place.elevation;
    while elevation < STEEPEST && is_seen(at(elevation)) {
        elevation += 2.0;
    }
    let wanted = at(elevation);
    let free = obstacles.free_share(center, wanted);
    let share = if free < 1.0 { (CLEARANCE * free).max(LEAST_SHARE) } else { 1.0 };
    let (distance, extent) = (place.distance * r * share, place.extent * r * share);
    let area = if place.is_round { PI * extent * extent } else { 4.0 * extent * extent };
    StagedLight {
        name: place.name,
        purpose: place.purpose,
        position: center + (wanted - center) * share,
        form: if place.is_round { Form::Disk(extent) } else { Form::Softbox(extent) },
        radiance: place.irradiance * distance * distance / area,
    }
}

/// The horizontal part of a direction, of length 1; +z for one that has none.
fn level(v: Vec3) -> Vec3 {
    Vec3::new(v.x, 0.0, v.z).normalize_or(Vec3::Z)
}

/// The backdrop below everything, as large as the camera sees it and more.
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
        width: 2.0 * SPARE * (tangent * WIDEST * to_wall * 1.1 + r),
        height,
        radius: 0.5 * back.min(height),
    }
}
