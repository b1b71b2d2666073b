//! Places of lamps among which a rig is chosen.
//!
//! | family | lamps |
//! | --- | --- |
//! | subject | softboxes that face the subject, from cells of equal solid angle around it, at several distances |
//! | beam | round lamps there whose beam is about as wide as the subject |
//! | backdrop | softboxes around parts of the background that face these and spare the subject |

use glam::{Vec2, Vec3};

use super::{
    lamp::{Beam, Lamp},
    set::Set,
};
use crate::{light::Outline, math::warp::square_to_sphere_octahedral};

/// Cells along each side of the square that is mapped to the sphere: 256 cells are 13 degrees wide.
const CELLS: u32 = 16;
/// Cells along each side for beams, which need fewer: they are wider than the difference.
const BEAM_CELLS: u32 = 12;
/// Distances of the shells over the least distance allowed; those beyond the largest are left out. Set by
/// reasoning: a lamp at a third of the distance falls off over the subject, one far away hardly does.
const SHELLS: [f32; 2] = [1.4, 2.3];
/// Half side of a softbox over its distance: cells overlap a little.
const EXTENT: f32 = 0.14;
/// Radius of a round lamp with a beam over its distance.
const BEAM_EXTENT: f32 = 0.05;
/// Half-angles of the beams over that under which the lamp sees the subject's radius.
const BEAM_WIDTHS: [f32; 1] = [0.7];
/// Share of a beam's half-angle over which it fades: a grid's.
const SOFTNESS: f32 = 0.5;
/// Cells along each side around a part of the background.
const BACKDROP_CELLS: u32 = 12;
/// Distances of lamps from the background, in radii of the subject.
const BACKDROP_DISTANCES: [f32; 2] = [1.2, 2.5];
/// Cosine of the angle from the lamp's axis beyond which the subject counts as spared.
const SPARED: f32 = 0.1;

/// Directions through the middles of `side` x `side` cells of equal solid angle, +y through the middle.
fn cells(side: u32) -> impl Iterator<Item = Vec3> {
    (0..side * side).map(move |i| {
        let cell = Vec2::new((i % side) as f32, (i / side) as f32) + 0.5;
        let d = square_to_sphere_octahedral(cell / side as f32);
        Vec3::new(d.x, d.z, d.y)
    })
}

/// Lamps of all families that the set allows.
#[must_use]
pub fn all(set: &Set) -> Vec<Lamp> {
    let mut lamps = toward_subject(set);
    lamps.extend(beams(set));
    lamps.extend(toward_backdrop(set));
    lamps
}

/// Centres at which a lamp may stand around the subject, shell by shell; where a wall is in the way shells
/// coincide, and only the first is kept.
fn around(set: &Set, side: u32, shells: &[f32]) -> Vec<Vec3> {
    let [least, most] = set.distances();
    let mut centres = Vec::new();
    for dir in cells(side) {
        let mut last = 0.0;
        for distance in shells.iter().map(|s| s * least).filter(|&d| d <= most) {
            let Some(p) = set.before_walls(dir, distance) else { continue };
            let reached = p.distance(set.center);
            if reached > 1.15 * last && set.sees_subject(p) {
                centres.push(p);
                last = reached;
            }
        }
    }
    centres
}

fn toward_subject(set: &Set) -> Vec<Lamp> {
    let lamp = |position: Vec3| {
        let half = EXTENT * position.distance(set.center);
        let outline = Outline::Rectangle { a: half, b: half };
        Lamp { position, look_at: set.center, outline, beam: None }
    };
    around(set, CELLS, &SHELLS).into_iter().map(lamp).filter(|lamp| set.allows(lamp)).collect()
}

fn beams(set: &Set) -> Vec<Lamp> {
    let centres = around(set, BEAM_CELLS, &SHELLS[1..]);
    let lamp = |position: Vec3| {
        let distance = position.distance(set.center);
        let seen = (set.radius / distance).min(1.0).asin().to_degrees();
        BEAM_WIDTHS.map(|width| Lamp {
            position,
            look_at: set.center,
            outline: Outline::Disk { r: BEAM_EXTENT * distance },
            beam: Some(Beam { angle: width * seen, softness: SOFTNESS }),
        })
    };
    centres.into_iter().flat_map(lamp).filter(|lamp| set.allows(lamp)).collect()
}

fn toward_backdrop(set: &Set) -> Vec<Lamp> {
    let mut lamps = Vec::new();
    for (aim, normal) in set.aims() {
        for dir in cells(BACKDROP_CELLS).filter(|d| d.dot(normal) > 0.2) {
            for distance in BACKDROP_DISTANCES.map(|d| d * set.radius) {
                let half = 1.5 * EXTENT * distance;
                let outline = Outline::Rectangle { a: half, b: half };
                let lamp = Lamp { position: aim + dir * distance, look_at: aim, outline, beam: None };
                if spares_subject(set, &lamp) && set.allows(&lamp) && set.sees(lamp.position, aim) {
                    lamps.push(lamp);
                }
            }
        }
    }
    lamps
}

/// Whether a lamp without a beam hardly lights the subject.
fn spares_subject(set: &Set, lamp: &Lamp) -> bool {
    let to_subject = (set.center - lamp.position).normalize_or(Vec3::Y);
    lamp.axis().dot(to_subject) < SPARED
}
