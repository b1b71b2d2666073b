//! The set: subject, backdrop, floor and camera, and where in it a lamp may stand.

use glam::{UVec2, Vec2, Vec3};

use super::lamp::Lamp;
use crate::{integrator::View, math::Bounds, variables::Movement};

/// Columns and rows of the grid of camera rays that look for subject and backdrop: 15 pixels of a picture of
/// 640 x 480 apart.
const LOOKS: UVec2 = UVec2::new(43, 32);
/// Points of the subject that a lamp must see a share of.
const SUBJECT_POINTS: usize = 16;
/// Share of these points that a lamp must see: a rim light sees the edge only.
const LEAST_SEEN: f32 = 0.25;
/// Surfaces of the main object that a ray from its middle passes, at most.
const MAX_SKINS: usize = 64;
/// Distance of a lamp over that of the wall behind it, both from the subject.
const BEFORE_WALL: f32 = 0.85;
/// Relative error of the distance at which a point that a lamp looks at counts as seen.
const SEEN: f32 = 0.02;

/// A place as a photographer says it, seen from the subject's middle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Angle about the subject, degrees to the right of the camera in the picture, in (-180, 180].
    pub azimuth: f32,
    /// Angle above the subject's middle, degrees.
    pub elevation: f32,
    /// Distance from the subject's middle, metres.
    pub distance: f32,
}

impl Place {
    /// The place of a point at `d` from the subject's middle, metres, where `right` and `front` are the horizontal
    /// unit vectors to the right in the picture and toward the camera.
    fn of(d: Vec3, right: Vec3, front: Vec3) -> Self {
        let distance = d.length();
        Self {
            azimuth: d.dot(right).atan2(d.dot(front)).to_degrees(),
            elevation: (d.y / distance.max(f32::MIN_POSITIVE)).clamp(-1.0, 1.0).asin().to_degrees(),
            distance,
        }
    }
}

/// Unit vector at the azimuth and the elevation of a [`Place`], degrees, where `right` and `front` are the horizontal
/// unit vectors to the right in the picture and toward the camera.
#[must_use]
pub fn direction([azimuth, elevation]: [f32; 2], right: Vec3, front: Vec3) -> Vec3 {
    let (sin, cos) = azimuth.to_radians().sin_cos();
    let (up, across) = elevation.to_radians().sin_cos();
    (front * cos + right * sin) * across + Vec3::Y * up
}

/// A scene as a set on which lamps are placed.
#[derive(Clone, Debug)]
pub struct Set<'a> {
    view: View<'a>,
    /// Middle of the subject, metres.
    pub center: Vec3,
    /// Radius of the subject, metres: half the diagonal of its box.
    pub radius: f32,
    /// Height of the floor, on which the subject stands, metres.
    pub floor: f32,
    /// Horizontal unit vector from the subject toward the camera.
    pub front: Vec3,
    /// Horizontal unit vector to the right in the picture.
    pub right: Vec3,
    /// Points of the subject that the camera sees.
    subject: Vec<Vec3>,
    /// Points of the background that the camera sees, with the normals on its side, left to right.
    backdrop: Vec<(Vec3, Vec3)>,
    movement: Movement,
}

/// What a plan of the set shows besides lamps.
#[derive(Clone, Debug)]
pub struct Ground {
    /// Middle of the subject, metres.
    pub center: Vec3,
    /// Radius of the subject, metres.
    pub radius: f32,
    /// Horizontal unit vector from the subject toward the camera.
    pub front: Vec3,
    /// Horizontal unit vector to the right in the picture.
    pub right: Vec3,
    /// Place of the camera, metres.
    pub eye: Vec3,
    /// Points of the background that the camera sees, metres.
    pub surfaces: Vec<Vec3>,
}

impl Ground {
    /// The place of a point.
    #[must_use]
    pub fn place(&self, p: Vec3) -> Place {
        Place::of(p - self.center, self.right, self.front)
    }
}

impl<'a> Set<'a> {
    /// What a plan of the set shows.
    #[must_use]
    pub fn ground(&self) -> Ground {
        Ground {
            center: self.center,
            radius: self.radius,
            front: self.front,
            right: self.right,
            eye: self.view.camera.position,
            surfaces: self.backdrop.iter().map(|p| p.0).collect(),
        }
    }

    /// The set of a view; `None` where the camera sees nothing of the main object.
    #[must_use]
    pub fn new(view: View<'a>, movement: Movement) -> Option<Self> {
        let (subject, mut backdrop) = look_around(view);
        if subject.is_empty() {
            return None;
        }
        let eye = view.camera.position;
        let mesh = &view.scene.mesh;
        let main = (0..mesh.indices.len()).filter(|&t| view.scene.is_main[t]).flat_map(|t| mesh.corners(t));
        let whole = Bounds::of(main);
        // Of a room that is all main object, the subject is what the camera sees of it.
        let bounds = match whole.center().distance(eye) > 0.5 * whole.diagonal() {
            true => whole,
            false => Bounds::of(subject.iter().copied()),
        };
        let center = bounds.center();
        let to_camera = eye - center;
        let front = Vec3::new(to_camera.x, 0.0, to_camera.z).normalize_or(Vec3::Z);
        let right = Vec3::Y.cross(front);
        backdrop.sort_by(|a, b| a.0.dot(right).total_cmp(&b.0.dot(right)));
        let step = (subject.len() / SUBJECT_POINTS).max(1);
        Some(Self {
            view,
            center,
            radius: 0.5 * bounds.diagonal(),
            floor: bounds.lo.y,
            front,
            right,
            subject: subject.into_iter().step_by(step).collect(),
            backdrop,
            movement,
        })
    }

    /// Least and largest distance of a lamp from the subject's middle, metres.
    #[must_use]
    pub fn distances(&self) -> [f32; 2] {
        self.movement.distance.unwrap_or(Movement::DISTANCE.map(|d| d * self.radius))
    }

    /// Unit vector from the subject's middle at two angles, degrees.
    #[must_use]
    pub fn direction(&self, azimuth: f32, elevation: f32) -> Vec3 {
        direction([azimuth, elevation], self.right, self.front)
    }

    /// The place of a point.
    #[must_use]
    pub fn place(&self, p: Vec3) -> Place {
        Place::of(p - self.center, self.right, self.front)
    }

    /// The point at a place.
    #[must_use]
    pub fn point(&self, place: Place) -> Vec3 {
        self.center + self.direction(place.azimuth, place.elevation) * place.distance
    }

    /// The place in a direction at a wanted distance from the subject, or nearer, before what stands there;
    /// `None` where there is no room.
    #[must_use]
    pub fn before_walls(&self, dir: Vec3, distance: f32) -> Option<Vec3> {
        let free = BEFORE_WALL * self.free_distance(dir);
        let distance = distance.min(free);
        (distance >= self.distances()[0]).then(|| self.center + dir * distance)
    }

    /// Distance from the subject's middle of the first surface in a direction that is not the subject's own,
    /// metres.
    fn free_distance(&self, dir: Vec3) -> f32 {
        let scene = self.view.scene;
        let mut from = self.center;
        for _ in 0..MAX_SKINS {
            let Some(hit) = scene.intersect(from, dir) else { return f32::INFINITY };
            if !scene.is_main[hit.si.triangle as usize] {
                return (hit.si.p - self.center).dot(dir);
            }
            from = hit.si.spawn_origin(dir);
        }
        f32::INFINITY
    }

    /// Points of the background on which lamps may be aimed, with their normals: its middle, left and right.
    #[must_use]
    pub fn aims(&self) -> Vec<(Vec3, Vec3)> {
        let behind = |p: Vec3| (self.center - p).dot(self.front) > 0.5 * self.radius;
        let far: Vec<(Vec3, Vec3)> = self.backdrop.iter().copied().filter(|&(p, _)| behind(p)).collect();
        let points = if far.is_empty() { &self.backdrop } else { &far };
        let n = points.len();
        let middle_of = |part: &[(Vec3, Vec3)]| {
            let mean = part.iter().map(|p| p.0).sum::<Vec3>() / part.len() as f32;
            part.iter().copied().min_by(|a, b| a.0.distance(mean).total_cmp(&b.0.distance(mean)))
        };
        let parts = [0..n, 0..n / 3, n - n / 3..n];
        let mut aims: Vec<(Vec3, Vec3)> = Vec::new();
        for aim in
            parts.into_iter().filter(|part| !part.is_empty()).filter_map(|part| middle_of(&points[part]))
        {
            if aims.iter().all(|a| a.0.distance(aim.0) > 0.5 * self.radius) {
                aims.push(aim);
            }
        }
        aims
    }

    /// Whether a lamp may stand where it does: within the region given, above the floor, clear of the subject
    /// and of all surfaces, and out of the picture.
    #[must_use]
    pub fn allows(&self, lamp: &Lamp) -> bool {
        self.is_in_region(lamp) && self.is_clear(lamp) && (self.movement.in_frame || !self.is_in_frame(lamp))
    }

    fn is_in_region(&self, lamp: &Lamp) -> bool {
        let within = |[lo, hi]: [f32; 2], value: f32| lo <= value && value <= hi;
        let m = &self.movement;
        let place = self.place(lamp.position);
        let height = lamp.position.y - self.floor;
        within(m.azimuth, place.azimuth)
            && within(m.elevation, place.elevation)
            && within(self.distances(), place.distance)
            && m.height.is_none_or(|range| within(range, height))
            && lamp.grid().all(|p| p.y > self.floor)
    }

    /// Whether nothing cuts a lamp or stands directly before it.
    fn is_clear(&self, lamp: &Lamp) -> bool {
        let clearance = self.movement.clearance.unwrap_or(Movement::CLEARANCE * self.radius);
        let ahead = lamp.axis() * clearance;
        let scene = self.view.scene;
        let apart = |p: Vec3| p.distance(self.center) > self.radius + clearance;
        let is_open = |a: Vec3, b: Vec3| scene.transmittance(a, b, None) > 0.5;
        lamp.grid().all(|p| apart(p) && is_open(lamp.position, p) && is_open(p, p + ahead))
    }

    /// Whether the camera would see a part of a lamp, from whichever side.
    #[must_use]
    pub fn is_in_frame(&self, lamp: &Lamp) -> bool {
        let View { scene, camera } = self.view;
        let is_seen = |p: Vec3| {
            camera.sample_wi(camera.position, p).is_some()
                && scene.transmittance(camera.position, p, None) > 0.0
        };
        lamp.grid().any(is_seen)
    }

    /// Whether a point sees enough of the subject.
    #[must_use]
    pub fn sees_subject(&self, p: Vec3) -> bool {
        let scene = self.view.scene;
        let sees = |&&q: &&Vec3| {
            let dir = (q - p).normalize_or(Vec3::Y);
            scene.intersect(p, dir).is_some_and(|hit| scene.is_main[hit.si.triangle as usize])
        };
        self.subject.iter().filter(sees).count() as f32 >= LEAST_SEEN * self.subject.len() as f32
    }

    /// Distance of the first surface along a ray with unit direction, metres.
    #[must_use]
    pub fn first_surface(&self, p: Vec3, dir: Vec3) -> Option<f32> {
        self.view.scene.intersect(p, dir).map(|hit| hit.t)
    }

    /// Whether the point `p` sees the point `aim` of a surface.
    #[must_use]
    pub fn sees(&self, p: Vec3, aim: Vec3) -> bool {
        let Some(dir) = (aim - p).try_normalize() else { return false };
        let distance = aim.distance(p);
        self.view.scene.intersect(p, dir).is_some_and(|hit| (hit.t - distance).abs() < SEEN * distance)
    }
}

/// Points of the main object and of everything else that the camera sees, the latter with their normals.
fn look_around(View { scene, camera }: View) -> (Vec<Vec3>, Vec<(Vec3, Vec3)>) {
    let (mut subject, mut backdrop) = (Vec::new(), Vec::new());
    for y in 0..LOOKS.y {
        for x in 0..LOOKS.x {
            let raster = (Vec2::new(x as f32, y as f32) + 0.5) / LOOKS.as_vec2() * camera.size().as_vec2();
            let dir = camera.direction(raster);
            let Some(hit) = scene.intersect(camera.position, dir) else { continue };
            if scene.is_main[hit.si.triangle as usize] {
                subject.push(hit.si.p);
            } else {
                let n = hit.si.ng;
                backdrop.push((hit.si.p, if n.dot(dir) < 0.0 { n } else { -n }));
            }
        }
    }
    (subject, backdrop)
}
