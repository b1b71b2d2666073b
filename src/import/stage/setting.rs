//! What a subject stands on and in: floors, walls, rooms, backdrops and landscapes.
//!
//! They are judged by where their triangles lie, never by the side that these face: modelling tools
//! shade both sides, and a room made from their own box faces outward. The thresholds are dimensionless
//! and chosen as those of [`super::subject`].

use std::f32::consts::{PI, TAU};

use glam::{Mat3, Vec3};

use crate::{
    embree::{Accel, EmbreeError, Ray, TriangleMesh},
    math::Bounds,
    scene::mesh::{Mesh, face_normal},
};

/// Largest thickness of a panel over its largest extent: a table top is one, a box is none.
/// Interval 0.026 to 0.49.
const PANEL_THICKNESS: f32 = 0.04;
/// Least extents of a floor or wall along its plane, over those of the scene: a rug or a table top that
/// spans less is furniture. Interval 0.02 to 0.99.
const PANEL_SPAN: f32 = 0.6;
/// Largest distance of a floor, wall or ceiling from the scene's bounding box, over the box's extent:
/// skirting boards and lamps reach beyond a room by less. Interval 0.001 to 1.8.
pub const PANEL_GAP: f32 = 0.05;
/// Largest vertical component of the normal of a panel that stands upright, a wall: it leans by 17°. Of one
/// that lies, a floor, the vertical component is at least the cosine of that angle, 0.95.
const LEANING: f32 = 0.3;
/// Least share of a wall's area that stands upright: the edges of a thin one do not.
const WALL_SHARE: f32 = 0.9;
/// Least angle over which a screen reaches around a subject, radians: 60°, a flat one as wide as it is far.
const AROUND: f32 = PI / 3.0;
/// Least horizontal extents of a room or a backdrop, over those of the scene: only what stands outside
/// may reach farther. Interval 0.03 to 0.95.
const ROOM_SPAN: f32 = 0.9;
/// Largest distance of a room's walls from the scene's bounding box, over the box's extent: the reveal of
/// a window or door. Interval 0.0006 to 0.71.
const BOUNDARY: f32 = 0.02;
/// Least share of a room's area that lies on the scene's bounding box: the rest is what is modelled with
/// it. Interval 0.02 to 0.98.
const ROOM_SHARE: f32 = 0.7;
/// Least share of a room's area on the scene's bounding box where its walls are so thick that their inner sides
/// do not lie there: the outer sides of a room of 4 x 5 x 3 m with walls of 30 cm are 0.57 of its area.
const SHELL_SHARE: f32 = 0.4;
/// Least horizontal extents of the inner side of a room's thick walls, over those of the scene: walls of 30 cm
/// leave 0.7 of a room 2 m wide.
const SHELL_SPAN: f32 = 0.7;
/// Least horizontal extents of a backdrop or a landscape, over those of all else: it shows on both sides
/// of the subject. Interval 0.04 to 3.1.
const ENCLOSING_SPAN: f32 = 1.5;
/// Least share of the area of a backdrop or a landscape that is seen from the middle of all else or from
/// above: of a box beside others half is. Interval 0.51 to 1.
const ENCLOSING_SHARE: f32 = 0.8;
/// Triangles of a backdrop or landscape whose sight is tested, at most: the standard error of the share is
/// then √(0.8·0.2/4096) = 0.006.
const MAX_RAYS: usize = 4096;
/// Share of a ray's length at its end that is not tested: the triangle itself lies there.
const END_MARGIN: f32 = 1e-3;
/// Squarings of the matrix of a piece's normals: they raise the ratio of its eigenvalues to the power 64,
/// so that normals which lean by at most a tenth are outweighed to the precision of f32.
const SQUARINGS: usize = 6;

/// An object or group, or a connected part of a mesh that has only one.
#[derive(Debug)]
pub struct Piece {
    /// Indices of its triangles.
    pub triangles: Vec<usize>,
    /// Its bounding box.
    pub bounds: Bounds,
    /// The plane of a thin piece; `None` for a solid one.
    sheet: Option<Sheet>,
    /// Share of its area that stands upright.
    upright_share: f32,
    /// Whether one sees through all of it.
    is_clear: bool,
}

/// The plane of a thin piece.
#[derive(Clone, Copy, Debug)]
struct Sheet {
    /// Unit normal, of either sign.
    normal: Vec3,
    /// Extent along the normal, metres.
    thickness: f32,
}

impl Piece {
    /// The piece of some triangles, at least one. `is_clear` is said of each material.
    pub fn new(mesh: &Mesh, triangles: Vec<usize>, is_clear: &[bool]) -> Self {
        let corners = || triangles.iter().flat_map(|&t| mesh.corners(t));
        let bounds = Bounds::of(corners());
        let normal = main_normal(triangles.iter().map(|&t| face_normal(mesh.corners(t))));
        let [lo, hi] = interval(corners().map(|p| (p - bounds.lo).dot(normal)));
        let sheet = Sheet { normal, thickness: hi - lo };
        let is_thin = sheet.thickness <= PANEL_THICKNESS * bounds.extent().max_element();
        let is_clear = triangles.iter().all(|&t| is_clear[mesh.materials[t] as usize]);
        let leans = |corners: [Vec3; 3]| face_normal(corners).normalize_or_zero().y.abs();
        let (upright, total) = shares(mesh, triangles.iter().copied(), |c| leans(c) <= LEANING);
        let upright_share = if total > 0.0 { upright / total } else { 0.0 };
        Self { sheet: is_thin.then_some(sheet), bounds, upright_share, is_clear, triangles }
    }

    /// Whether the piece is a panel that stands upright.
    pub fn is_upright(&self) -> bool {
        self.sheet.is_some_and(|s| s.normal.y.abs() <= LEANING)
    }

    /// Whether the piece is a panel that lies.
    fn is_level(&self) -> bool {
        self.sheet.is_some_and(|s| s.normal.y * s.normal.y >= 1.0 - LEANING * LEANING)
    }

    /// Whether the piece is upright as walls are, flat or not.
    pub fn may_be_wall(&self) -> bool {
        self.upright_share >= WALL_SHARE
    }

    /// Whether the piece is a wall behind or before a subject: at least as wide and as high, and a panel on
    /// one side of which all of the subject stands, its middle not beside the panel, or an open screen that
    /// the subject faces.
    ///
    /// # Errors
    /// When a triangle's coordinates are not finite or too large for Embree.
    pub fn backs(&self, mesh: &Mesh, subject: &[&Self]) -> Result<bool, EmbreeError> {
        let bounds = bounds_of(subject);
        if self.bounds.extent().y < bounds.extent().y || self.bounds.lo.y >= bounds.hi.y {
            return Ok(false);
        }
        match self.sheet {
            Some(sheet) => Ok(self.is_panel_behind(mesh, sheet, subject)),
            None => self.is_screen_around(mesh, &bounds),
        }
    }

    fn is_panel_behind(&self, mesh: &Mesh, Sheet { normal, thickness }: Sheet, subject: &[&Self]) -> bool {
        let across = Vec3::Y.cross(normal).normalize_or_zero();
        // Exact for a panel, whose box has it as a diagonal.
        let [from, to] = along(&self.bounds, across);
        let [left, right] = along(&bounds_of(subject), across);
        if !(from..=to).contains(&(0.5 * (left + right))) || to - from < right - left {
            return false;
        }
        let plane = self.bounds.center().dot(normal);
        let corners = subject.iter().flat_map(|p| &p.triangles).flat_map(|&t| mesh.corners(t));
        let [near, far] = interval(corners.map(|p| p.dot(normal) - plane));
        let gap = 0.5 * thickness + PANEL_GAP * (far - near);
        near >= -gap || far <= gap
    }

    /// Whether the piece reaches around a subject, and its middle sees most of it: an open surface.
    fn is_screen_around(&self, mesh: &Mesh, subject: &Bounds) -> Result<bool, EmbreeError> {
        let (own, middle) = (self.bounds.extent(), subject.center());
        let azimuths = self.triangles.iter().flat_map(|&t| mesh.corners(t)).map(|p| p - middle);
        let is_narrow = own.x.max(own.z) < subject.extent().x.max(subject.extent().z);
        if is_narrow || covered(azimuths.map(|d| d.z.atan2(d.x)).collect()) < AROUND {
            return Ok(false);
        }
        Ok(self.seen_share(mesh, &self.accel(mesh)?, &[middle]) >= ENCLOSING_SHARE)
    }

    /// The piece alone, for rays.
    fn accel(&self, mesh: &Mesh) -> Result<Accel, EmbreeError> {
        let indices: Vec<[u32; 3]> = self.triangles.iter().map(|&t| mesh.indices[t]).collect();
        Accel::build(&[TriangleMesh { positions: &mesh.positions, indices: &indices }])
    }

    /// Share of the piece's area that is seen from one of the `eyes`; `accel` is the piece alone.
    fn seen_share(&self, mesh: &Mesh, accel: &Accel, eyes: &[Vec3]) -> f32 {
        let is_seen = |corners| eyes.iter().any(|&eye| is_seen(accel, eye, corners));
        let (seen, total) = shares(mesh, self.sample(), is_seen);
        seen / total
    }

    /// Whether the horizontal extents of the piece are at least a share of the scene's.
    fn spans(&self, scene: &Bounds, share: f32) -> bool {
        let (extent, whole) = (self.bounds.extent(), scene.extent());
        extent.x >= share * whole.x && extent.z >= share * whole.z
    }

    /// Whether the piece is a floor, a wall or a ceiling at the edge of the scene.
    fn is_panel(&self, scene: &Bounds) -> bool {
        let (extent, whole) = (self.bounds.extent(), scene.extent());
        let Some(axis) = (0..3).find(|&a| extent[a] <= PANEL_THICKNESS * extent.max_element()) else {
            return false;
        };
        let gap = (self.bounds.lo[axis] - scene.lo[axis]).min(scene.hi[axis] - self.bounds.hi[axis]);
        (0..3).filter(|&a| a != axis).all(|a| extent[a] >= PANEL_SPAN * whole[a])
            && gap <= PANEL_GAP * whole[axis]
    }

    /// Whether the piece is a floor: it lies, is wide enough, and nothing but walls reaches below it.
    fn is_ground(&self, pieces: &[&Self], scene: &Bounds) -> bool {
        let least = self.bounds.lo.y - PANEL_GAP * scene.extent().y;
        self.is_level()
            && self.spans(scene, PANEL_SPAN)
            && pieces.iter().all(|p| p.is_upright() || p.bounds.lo.y >= least)
    }

    /// Whether the piece is a room: most of it lies on the scene's boundary, or, where its walls are thick, also
    /// faces the middle of the others, which it holds.
    fn is_room(&self, mesh: &Mesh, pieces: &[&Self], scene: &Bounds) -> Result<bool, EmbreeError> {
        if self.is_clear || self.sheet.is_some() || !self.spans(scene, ROOM_SPAN) {
            return Ok(false);
        }
        let tolerance = BOUNDARY * scene.extent();
        let lies_on_boundary = |corners: [Vec3; 3]| {
            (0..3).any(|a| {
                corners.iter().all(|c| c[a] - scene.lo[a] <= tolerance[a])
                    || corners.iter().all(|c| scene.hi[a] - c[a] <= tolerance[a])
            })
        };
        let (on, total) = shares(mesh, self.triangles.iter().copied(), lies_on_boundary);
        if on >= ROOM_SHARE * total {
            return Ok(true);
        }
        let inner = bounds_of(&self.others(pieces));
        if on < SHELL_SHARE * total || self.bounds.extent().y < ROOM_SPAN * scene.extent().y {
            return Ok(false);
        }
        let accel = self.accel(mesh)?;
        // A crate is open at its top alone.
        let far = scene.extent().length();
        let hits =
            |dir: Vec3| accel.occluded(&Ray { org: inner.center(), dir: dir * far, t_min: 0.0, t_max: 1.0 });
        if !hits(Vec3::Y) && [Vec3::X, Vec3::NEG_X, Vec3::Z, Vec3::NEG_Z].into_iter().all(hits) {
            return Ok(false);
        }
        let is_of_room = |corners| lies_on_boundary(corners) || is_seen(&accel, inner.center(), corners);
        let (of_room, total) = shares(mesh, self.sample(), is_of_room);
        Ok(of_room >= ROOM_SHARE * total)
    }

    /// The pieces without this one.
    fn others<'a>(&self, pieces: &[&'a Self]) -> Vec<&'a Self> {
        pieces.iter().filter(|p| !std::ptr::eq(**p, self)).copied().collect()
    }

    /// Triangles of which sight is tested: as many as give a good estimate.
    fn sample(&self) -> impl Iterator<Item = usize> {
        self.triangles.iter().copied().step_by(self.triangles.len().div_ceil(MAX_RAYS).max(1))
    }

    /// Whether the piece is the cove of a backdrop that is modelled apart: an open surface that joins a floor or
    /// a wall, spans the scene in one direction, and is seen from the middle of `others`.
    fn is_cove(
        &self,
        mesh: &Mesh,
        panels: &[&Self],
        others: &[&Self],
        scene: &Bounds,
    ) -> Result<bool, EmbreeError> {
        let share = self.bounds.extent() / scene.extent();
        let gap = PANEL_GAP * scene.extent().min_element();
        let joins = |p: &&Self| p.bounds.touches(&self.bounds, gap);
        if self.is_clear
            || self.sheet.is_some()
            || share.x.max(share.z) < PANEL_SPAN
            || others.is_empty()
            || !panels.iter().any(joins)
        {
            return Ok(false);
        }
        let middle = bounds_of(others).center();
        let azimuths = self.triangles.iter().flat_map(|&t| mesh.corners(t)).map(|p| p - middle);
        Ok(covered(azimuths.map(|d| d.z.atan2(d.x)).collect()) >= AROUND
            && self.seen_share(mesh, &self.accel(mesh)?, &[middle]) >= ENCLOSING_SHARE)
    }

    /// Whether the piece reaches under the others, and surrounds them at a distance, as a backdrop or a
    /// landscape does.
    fn encloses(&self, mesh: &Mesh, pieces: &[&Self], scene: &Bounds) -> Result<bool, EmbreeError> {
        if self.is_clear || !self.spans(scene, ROOM_SPAN) {
            return Ok(false);
        }
        let inner = bounds_of(&self.others(pieces));
        let room = self.bounds.extent() / inner.extent();
        if room.x < ENCLOSING_SPAN || room.z < ENCLOSING_SPAN {
            return Ok(false);
        }
        let accel = self.accel(mesh)?;
        let middle = inner.center();
        let down = Vec3::NEG_Y * (middle.y - scene.lo.y + scene.extent().y);
        if !accel.occluded(&Ray { org: middle, dir: down, t_min: 0.0, t_max: 1.0 }) {
            return Ok(false);
        }
        let eyes = [middle, Vec3::new(middle.x, scene.hi.y, middle.z)];
        Ok(self.seen_share(mesh, &accel, &eyes) >= ENCLOSING_SHARE)
    }
}

/// Whether the middle of a triangle is seen from a point among the triangles of `accel`.
fn is_seen(accel: &Accel, eye: Vec3, corners: [Vec3; 3]) -> bool {
    let target = (corners[0] + corners[1] + corners[2]) / 3.0;
    !accel.occluded(&Ray { org: eye, dir: target - eye, t_min: 0.0, t_max: 1.0 - END_MARGIN })
}

/// The direction, of either sign, of most of the area that has these normals, each as long as its
/// triangle is large: the main eigenvector of the sum of n nᵀ/|n|. The y axis without any area.
fn main_normal(normals: impl Iterator<Item = Vec3>) -> Vec3 {
    let outer = |n: Vec3| Mat3::from_cols(n * n.x, n * n.y, n * n.z) * (1.0 / n.length());
    let mut m = normals.filter(|n| n.length() > 0.0).fold(Mat3::ZERO, |sum, n| sum + outer(n));
    for _ in 0..SQUARINGS {
        let trace = m.x_axis.x + m.y_axis.y + m.z_axis.z;
        if !(trace > 0.0 && trace.is_finite()) {
            return Vec3::Y;
        }
        m *= 1.0 / trace;
        m *= m;
    }
    let longest = [m.x_axis, m.y_axis, m.z_axis].into_iter().max_by(|a, b| a.length().total_cmp(&b.length()));
    longest.and_then(Vec3::try_normalize).unwrap_or(Vec3::Y)
}

/// Angle over which directions spread, radians: all around but for the widest gap between two.
fn covered(mut azimuths: Vec<f32>) -> f32 {
    azimuths.sort_by(f32::total_cmp);
    let (Some(first), Some(last)) = (azimuths.first(), azimuths.last()) else { return 0.0 };
    let around = first + TAU - last;
    TAU - azimuths.windows(2).map(|w| w[1] - w[0]).fold(around, f32::max)
}

/// Least and largest of some numbers.
fn interval(values: impl Iterator<Item = f32>) -> [f32; 2] {
    values.fold([f32::INFINITY, f32::NEG_INFINITY], |[lo, hi], v| [lo.min(v), hi.max(v)])
}

/// The interval of a box along a unit vector.
fn along(b: &Bounds, axis: Vec3) -> [f32; 2] {
    let (middle, half) = (b.center().dot(axis), 0.5 * b.extent().dot(axis.abs()));
    [middle - half, middle + half]
}

/// Area of the triangles for which `counts` holds, and of all.
fn shares(
    mesh: &Mesh,
    triangles: impl Iterator<Item = usize>,
    counts: impl Fn([Vec3; 3]) -> bool,
) -> (f32, f32) {
    triangles.map(|t| mesh.corners(t)).fold((0.0, 0.0), |(counted, total), corners| {
        let area = 0.5 * face_normal(corners).length();
        (counted + if counts(corners) { area } else { 0.0 }, total + area)
    })
}

/// The bounding box of some pieces; empty without any.
pub fn bounds_of(pieces: &[&Piece]) -> Bounds {
    pieces.iter().map(|p| p.bounds).reduce(Bounds::union).unwrap_or(Bounds::of([]))
}

/// The pieces of a scene, told into those that hold or surround and what is left.
pub struct Setting<'a> {
    /// Bounding box of all pieces.
    pub scene: Bounds,
    /// Floors, walls at the edge of the scene and ceilings.
    panels: Vec<&'a Piece>,
    /// Rooms that are one piece.
    rooms: Vec<&'a Piece>,
    /// Backdrops and landscapes under and around the rest.
    pub surroundings: Vec<&'a Piece>,
    /// All else.
    pub inner: Vec<&'a Piece>,
}

impl<'a> Setting<'a> {
    /// Tells the pieces of a mesh apart.
    ///
    /// # Errors
    /// When a triangle's coordinates are not finite or too large for Embree.
    pub fn new(mesh: &Mesh, pieces: &[&'a Piece]) -> Result<Self, EmbreeError> {
        let scene = bounds_of(pieces);
        let mut out = Self { scene, panels: vec![], rooms: vec![], surroundings: vec![], inner: vec![] };
        for &p in pieces {
            let kind = if p.encloses(mesh, pieces, &scene)? {
                &mut out.surroundings
            } else if p.is_panel(&scene) || p.is_ground(pieces, &scene) {
                &mut out.panels
            } else if p.is_room(mesh, pieces, &scene)? {
                &mut out.rooms
            } else {
                &mut out.inner
            };
            kind.push(p);
        }
        out.move_inner_shell(mesh)?;
        out.move_coves(mesh)?;
        Ok(out)
    }

    /// Takes the inner side of a room's thick walls, where it is a piece of its own, out of what is left.
    fn move_inner_shell(&mut self, mesh: &Mesh) -> Result<(), EmbreeError> {
        if self.rooms.is_empty() {
            return Ok(());
        }
        let bounds = bounds_of(&self.inner);
        let holds = |p: &Piece| {
            let others = p.others(&self.inner);
            !others.is_empty()
                && p.bounds.union(bounds_of(&others)) == p.bounds
                && p.spans(&self.scene, SHELL_SPAN)
        };
        let Some(i) = self.inner.iter().position(|p| holds(p)) else { return Ok(()) };
        if self.inner[i].is_room(mesh, &self.inner, &bounds)? {
            self.rooms.push(self.inner.remove(i));
        }
        Ok(())
    }

    /// Takes the coves out of what is left: they join a floor, or a wall that stands on one.
    fn move_coves(&mut self, mesh: &Mesh) -> Result<(), EmbreeError> {
        let walls = self.inner.iter().filter(|p| p.may_be_wall());
        let panels: Vec<&Piece> = self.panels.iter().chain(walls).copied().collect();
        let solids: Vec<&Piece> = self.inner.iter().filter(|p| !p.may_be_wall()).copied().collect();
        for &piece in &solids {
            if piece.is_cove(mesh, &panels, &piece.others(&solids), &self.scene)? {
                self.inner.retain(|p| !std::ptr::eq(*p, piece));
                self.panels.push(piece);
            }
        }
        Ok(())
    }

    /// Heights of what is wide and low enough to stand on, metres.
    pub fn floors(&self) -> impl Iterator<Item = f32> {
        let lowest = self.scene.lo.y + PANEL_GAP * self.scene.extent().y;
        let is_low = move |p: &Piece| p.bounds.lo.y <= lowest;
        let is_floor = move |p: &Piece| {
            p.spans(&self.scene, PANEL_SPAN) && (is_low(p) || p.is_ground(&self.inner, &self.scene))
        };
        let panels = self.panels.iter().filter(move |p| is_floor(p)).map(|p| p.bounds.hi.y);
        panels.chain(
            self.rooms.iter().filter(move |p| is_low(p)).chain(&self.surroundings).map(|p| p.bounds.lo.y),
        )
    }

    /// Whether a subject stands in every room, and is no part of its walls, as a door is.
    pub fn is_within_rooms(&self, subject: &Bounds) -> bool {
        self.rooms.iter().all(|room| {
            let margin = PANEL_GAP * room.bounds.extent();
            [0, 2].into_iter().all(|a| {
                subject.hi[a] > room.bounds.lo[a] + margin[a] && subject.lo[a] < room.bounds.hi[a] - margin[a]
            })
        })
    }
}
