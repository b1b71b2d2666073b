//! Piles the fruit: bodies sink under gravity until their contacts hold them.
//!
//! Position-based and quasi-static: every step moves each body a little down, then pushes
//! overlapping bodies apart. Bodies translate only; their rotation is chosen by hand, as if
//! friction allowed no rolling.

use glam::{DQuat, DVec3};

use super::mesh::Mesh;

/// Cells of the polar angle in the profile of a star-shaped body, of 3.75° each.
const CELLS: usize = 48;
/// Points of a skin that are tested against other bodies, about.
const FEELERS: usize = 300;

/// Collision shape in a body's own coordinates.
#[derive(Clone)]
pub enum Shape {
    /// Distance from the centre as a function of the angle from +y, and points of the skin.
    Star {
        /// Radii at equal steps of the polar angle from 0 to π.
        radii: Vec<f64>,
        /// Points tested against other bodies.
        points: Vec<DVec3>,
    },
    /// Union of balls (centre, radius).
    Balls(Vec<(DVec3, f64)>),
}

impl Shape {
    /// A mesh that is star-shaped about its origin and nearly rotationally symmetric.
    pub fn star(mesh: &Mesh) -> Self {
        let mut sums = vec![(0.0, 0.0); CELLS + 1];
        for p in &mesh.positions {
            let cell = p.y.atan2(p.x.hypot(p.z));
            let cell = (0.5 - cell / std::f64::consts::PI) * CELLS as f64;
            let sum = &mut sums[cell.round() as usize];
            *sum = (sum.0 + p.length(), sum.1 + 1.0);
        }
        let known: Vec<(usize, f64)> =
            sums.iter().enumerate().filter(|(_, s)| s.1 > 0.0).map(|(i, s)| (i, s.0 / s.1)).collect();
        let nearest = |i: usize| known.iter().min_by_key(|k| k.0.abs_diff(i)).map_or(0.0, |k| k.1);
        let radii = (0..=CELLS).map(nearest).collect();
        let stride = mesh.positions.len() / FEELERS + 1;
        Self::Star { radii, points: mesh.positions.iter().copied().step_by(stride).collect() }
    }

    /// Signed distance at `p` (negative inside) and the direction out.
    fn distance(&self, p: DVec3) -> (f64, DVec3) {
        match self {
            Self::Star { radii, .. } => {
                let (length, axial) = (p.length().max(1e-9), p.x.hypot(p.z));
                let last = radii.len() - 1;
                let x = (0.5 - p.y.atan2(axial) / std::f64::consts::PI) * last as f64;
                let i = (x as usize).min(last - 1);
                let slope = (radii[i + 1] - radii[i]) * last as f64 / std::f64::consts::PI;
                let radius = radii[i] + (radii[i + 1] - radii[i]) * (x - i as f64);
                // Along the skin the radius changes by `slope` a radian.
                let radial = p / length;
                let down =
                    DVec3::new(radial.x * radial.y, -axial / length * (axial / length), radial.z * radial.y)
                        .normalize_or_zero();
                let normal = (radial - down * (slope / radius)).normalize();
                ((length - radius) * normal.dot(radial), normal)
            }
            Self::Balls(balls) => balls
                .iter()
                .map(|&(c, r)| ((p - c).length() - r, (p - c).normalize_or(DVec3::Y)))
                .min_by(|a, b| a.0.total_cmp(&b.0))
                .unwrap_or((f64::INFINITY, DVec3::Y)),
        }
    }

    /// Whether a ball at `p`, in world space, would touch the shape so placed.
    pub fn touches(&self, position: DVec3, rotation: DQuat, p: DVec3, radius: f64) -> bool {
        self.distance(rotation.inverse() * (p - position)).0 < radius
    }

    /// Balls that cover the skin: points of radius 0, or the balls themselves.
    fn feelers(&self) -> Vec<(DVec3, f64)> {
        match self {
            Self::Star { points, .. } => points.iter().map(|&p| (p, 0.0)).collect(),
            Self::Balls(balls) => balls.clone(),
        }
    }
}

/// A rigid body that is piled.
pub struct Body {
    /// Position of the body's origin, metres.
    pub position: DVec3,
    /// Rotation from the body's to world coordinates, which does not change.
    pub rotation: DQuat,
    /// Collision shape in the body's coordinates.
    pub shape: Shape,
    /// Inverse of the mass, dimensionless; a body of mobility 0 stays where it is.
    pub mobility: f64,
}

/// Keeps the origins of two bodies no farther apart than `length`.
pub struct Link {
    /// Indices of the two bodies.
    pub ends: [usize; 2],
    /// Largest distance of their origins, metres.
    pub length: f64,
}

/// A fixed obstacle: signed distance and direction out.
pub type Obstacle<'a> = dyn Fn(DVec3) -> (f64, DVec3) + 'a;

/// Deepest overlap of a body's feelers with a shape: depth, metres, and direction that frees the body.
fn overlap<'a>(
    feelers: impl Iterator<Item = &'a (DVec3, f64)>,
    distance: impl Fn(DVec3) -> (f64, DVec3),
) -> Option<(f64, DVec3)> {
    feelers
        .map(|&(p, r)| {
            let (d, out) = distance(p);
            (r - d, out)
        })
        .filter(|o| o.0 > 0.0)
        .max_by(|a, b| a.0.total_cmp(&b.0))
}

/// Distance by which bodies sink in a step, metres: a fourteenth of the smallest grape's radius, so
/// that none passes through another.
const FALL: f64 = 0.0006;
/// Passes over all contacts in a step: more leave smaller overlaps in a deep pile, for as much more time.
const ITERATIONS: usize = 4;

/// Lets the bodies sink for `steps` steps, the last quarter ever more slowly.
pub fn settle(bodies: &mut [Body], links: &[Link], obstacles: &[&Obstacle], steps: usize) {
    let local: Vec<Vec<(DVec3, f64)>> = bodies.iter().map(|b| b.shape.feelers()).collect();
    let turned: Vec<Vec<(DVec3, f64)>> = bodies
        .iter()
        .zip(&local)
        .map(|(b, l)| l.iter().map(|&(p, r)| (b.rotation * p, r)).collect())
        .collect();
    let reach: Vec<f64> =
        local.iter().map(|l| l.iter().map(|&(p, r)| p.length() + r).fold(0.0, f64::max)).collect();
    for step in 0..steps {
        let left = (steps - step) as f64 / steps as f64;
        let fall = FALL * (4.0 * left).min(1.0);
        bodies.iter_mut().filter(|b| b.mobility > 0.0).for_each(|b| b.position.y -= fall);
        for _ in 0..ITERATIONS {
            for link in links {
                let [a, b] = link.ends;
                let d = bodies[b].position - bodies[a].position;
                let excess = d.length() - link.length;
                if excess > 0.0 {
                    push(bodies, a, b, d.normalize() * excess);
                }
            }
            for a in 0..bodies.len() {
                for b in 0..bodies.len() {
                    if a != b {
                        separate(bodies, a, b, &turned[a], &reach);
                    }
                }
                if bodies[a].mobility == 0.0 {
                    continue;
                }
                for obstacle in obstacles {
                    let at = bodies[a].position;
                    if let Some((depth, out)) = overlap(turned[a].iter(), |p| obstacle(p + at)) {
                        bodies[a].position += out * depth;
                    }
                }
            }
        }
    }
}

/// Pushes two bodies apart by the deepest overlap of the feelers of `a`, turned to world axes, with `b`.
fn separate(bodies: &mut [Body], a: usize, b: usize, feelers: &[(DVec3, f64)], reach: &[f64]) {
    let near = reach[a] + reach[b];
    let still = bodies[a].mobility + bodies[b].mobility == 0.0;
    if still || bodies[a].position.distance_squared(bodies[b].position) > near * near {
        return;
    }
    // Balls against balls need one direction only.
    if b < a && matches!((&bodies[a].shape, &bodies[b].shape), (Shape::Balls(_), Shape::Balls(_))) {
        return;
    }
    let (offset, back) = (bodies[a].position - bodies[b].position, bodies[b].rotation.inverse());
    let close = feelers.iter().filter(|&&(p, r)| (p + offset).length_squared() < (reach[b] + r).powi(2));
    let field = |p: DVec3| {
        let (d, out) = bodies[b].shape.distance(back * (p + offset));
        (d, bodies[b].rotation * out)
    };
    if let Some((depth, out)) = overlap(close, field) {
        push(bodies, b, a, -out * depth);
    }
}

/// Moves `a` by its share of `d` and `b` by its share of −`d`.
fn push(bodies: &mut [Body], a: usize, b: usize, d: DVec3) {
    let (ma, mb) = (bodies[a].mobility, bodies[b].mobility);
    if ma + mb > 0.0 {
        bodies[a].position += d * (ma / (ma + mb));
        bodies[b].position -= d * (mb / (ma + mb));
    }
}
