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
    set::{Place, Set},
};
use crate::{
    light::{Light, Outline},
    math::warp::square_to_sphere_octahedral,
};

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

/// Distances of the shells on which a light of the scene may stand, over its own.
const MOVED: [f32; 3] = [0.6, 1.0, 1.6];
/// Cosine of the angle from a light's axis within which the subject's middle must be for it to be a light of the
/// subject.
const FACING: f32 = 0.5;

/// A flat light of the scene as a lamp that faces where it faces now: the point of its axis nearest to the
/// subject's middle or, away from that, what it lights there; `None` for one that cannot be moved.
#[must_use]
pub fn of_light(set: &Set, light: &Light) -> Option<Lamp> {
    let lamp = Lamp::of_light(light, 1.0)?;
    let to_subject = set.center - lamp.position;
    let along = to_subject.dot(lamp.axis());
    let distance = if along > FACING * to_subject.length() {
        along
    } else {
        set.first_surface(lamp.position, lamp.axis()).unwrap_or(set.radius)
    };
    Lamp::of_light(light, distance)
}

/// Places all around the subject to which a lamp may be moved, facing the same point.
#[must_use]
pub fn moved(set: &Set, lamp: &Lamp) -> Vec<Lamp> {
    let present = lamp.position.distance(set.center);
    let mut lamps = Vec::new();
    for dir in cells(CELLS) {
        for distance in MOVED.map(|factor| factor * present) {
            let Some(position) = set.before_walls(dir, distance) else { continue };
            let there = Lamp { position, ..*lamp };
            if set.allows(&there) && serves(set, &there) {
                lamps.push(there);
            }
        }
    }
    lamps
}

/// Small moves of a lamp by `step`, degrees: around the subject, nearer and farther, with another aim; a lamp that
/// is not the scene's own also with another size or beam.
#[must_use]
pub fn near(set: &Set, lamp: &Lamp, step: f32) -> Vec<Lamp> {
    let place = set.place(lamp.position);
    let share = step.to_radians();
    let at = |azimuth: f32, elevation: f32, distance: f32| {
        let place = Place {
            azimuth: place.azimuth + azimuth / place.elevation.to_radians().cos().max(0.2),
            elevation: (place.elevation + elevation).min(90.0),
            distance: place.distance * distance,
        };
        Lamp { position: set.point(place), ..*lamp }
    };
    let mut lamps = vec![
        at(step, 0.0, 1.0),
        at(-step, 0.0, 1.0),
        at(0.0, step, 1.0),
        at(0.0, -step, 1.0),
        at(0.0, 0.0, 1.0 + 1.5 * share),
        at(0.0, 0.0, 1.0 / (1.0 + 1.5 * share)),
    ];
    let frame = lamp.planar().frame;
    for aside in [frame.s, -frame.s, frame.t, -frame.t] {
        lamps.push(Lamp { look_at: lamp.look_at + aside * (1.5 * share * set.radius), ..*lamp });
    }
    if lamp.of.is_none() {
        let factor = 1.0 + 3.0 * share;
        lamps.extend([lamp.scaled(factor), lamp.scaled(1.0 / factor)]);
        let narrow = (set.radius / place.distance).min(1.0).asin().to_degrees();
        let beams = match lamp.beam {
            None => vec![Some(Beam { angle: narrow, softness: SOFTNESS })],
            Some(beam) => {
                let wide = (beam.angle * (1.0 + 1.5 * share)).min(80.0);
                let others = [wide, beam.angle / (1.0 + 1.5 * share)];
                others.into_iter().map(|angle| Some(Beam { angle, ..beam })).chain([None]).collect()
            }
        };
        // What has a beam is round.
        let outline = |beam: Option<Beam>| if beam.is_some() { round(lamp.outline) } else { lamp.outline };
        lamps.extend(beams.into_iter().map(|beam| Lamp { beam, outline: outline(beam), ..*lamp }));
    }
    lamps.retain(|lamp| set.allows(lamp) && serves(set, lamp));
    lamps
}

/// A disk of the area of an outline.
fn round(outline: Outline) -> Outline {
    match outline {
        Outline::Rectangle { a, b } => Outline::Disk { r: (4.0 * a * b / std::f32::consts::PI).sqrt() },
        disk @ Outline::Disk { .. } => disk,
    }
}

/// Whether a lamp sees the subject, or what it is aimed at.
fn serves(set: &Set, lamp: &Lamp) -> bool {
    set.sees_subject(lamp.position) || set.sees(lamp.position, lamp.look_at)
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
        Lamp::new(position, set.center, outline)
    };
    around(set, CELLS, &SHELLS).into_iter().map(lamp).filter(|lamp| set.allows(lamp)).collect()
}

fn beams(set: &Set) -> Vec<Lamp> {
    let centres = around(set, BEAM_CELLS, &SHELLS[1..]);
    let lamp = |position: Vec3| {
        let distance = position.distance(set.center);
        let seen = (set.radius / distance).min(1.0).asin().to_degrees();
        let lamp = Lamp::new(position, set.center, Outline::Disk { r: BEAM_EXTENT * distance });
        BEAM_WIDTHS.map(|width| Lamp { beam: Some(Beam { angle: width * seen, softness: SOFTNESS }), ..lamp })
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
                let lamp = Lamp::new(aim + dir * distance, aim, outline);
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
