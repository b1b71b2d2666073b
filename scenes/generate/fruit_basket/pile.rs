//! Positions of the fruit: placed by hand, then settled under gravity.

use glam::{DQuat, DVec3};

use super::fruit::{self, CRIMSON, Fruit, GALA, GREEN, PEAR, RED, RIPE, Ramp};
use super::mesh::{Material, Mesh};
use super::random::Rng;
use super::settle::{Body, Link, Shape, settle};
use super::stage::table_height;
use super::wicker;

/// A named object of the scene.
pub struct Object {
    /// Name in the OBJ file.
    pub name: String,
    /// Surface in world space, metres.
    pub mesh: Mesh,
}

/// Steps in which the fruit settle; one that nothing holds sinks by 0.22 m.
const FRUIT_STEPS: usize = 420;
/// Steps in which the grapes settle on the fruit; one that nothing holds sinks by 0.16 m.
const GRAPE_STEPS: usize = 300;
/// Step by which the stalk is let down onto the fruit, metres.
const DROP_STEP: f64 = 0.0005;
/// Clearance of the stalk's pinned end above the fruit, metres: nearly a grape's diameter.
const STALK_CLEARANCE: f64 = 0.017;

/// Rotation that turns the stem from +y toward `stem`, after a rotation by `spin`, radians, about it.
fn tilted(stem: [f64; 3], spin: f64) -> DQuat {
    DQuat::from_rotation_arc(DVec3::Y, DVec3::from_array(stem).normalize()) * DQuat::from_rotation_y(spin)
}

/// Signed distance, metres, from the basket's wall, rim and base, and the direction out.
fn basket_distance(p: DVec3) -> (f64, DVec3) {
    let axial = p.x.hypot(p.z);
    let outward = DVec3::new(p.x, 0.0, p.z) / axial.max(1e-9);
    let mut profile = vec![(0.0, wicker::FLOOR - wicker::WALL), (0.105, wicker::FLOOR - wicker::WALL)];
    profile.extend(wicker::wall_profile());
    let mut best = (f64::INFINITY, DVec3::Y);
    let mut consider = |x: f64, y: f64, thickness: f64| {
        let (dx, dy) = (axial - x, p.y - y);
        let d = dx.hypot(dy) - thickness;
        if d < best.0 {
            best = (d, (outward * dx + DVec3::Y * dy).normalize_or(DVec3::Y));
        }
    };
    for pair in profile.windows(2) {
        let ((x0, y0), (x1, y1)) = (pair[0], pair[1]);
        let (ex, ey) = (x1 - x0, y1 - y0);
        let t = (((axial - x0) * ex + (p.y - y0) * ey) / (ex * ex + ey * ey)).clamp(0.0, 1.0);
        consider(x0 + ex * t, y0 + ey * t, wicker::WALL);
    }
    consider(wicker::RIM_RADIUS, wicker::RIM_HEIGHT, wicker::RIM_THICKNESS);
    best
}

/// Signed distance, metres, from the table's top, and the direction out.
fn table_distance(p: DVec3) -> (f64, DVec3) {
    (p.y - table_height(p.x, p.z), DVec3::Y)
}

/// A fruit placed by hand: kind, start, metres, direction of its stem, rotation about the stem, radians.
type Placement = (Kind, [f64; 3], [f64; 3], f64);

#[derive(Clone, Copy)]
enum Kind {
    /// Radius, metres, and skin.
    Apple(f64, Ramp),
    /// Height, metres, and skin.
    Pear(f64, Ramp),
    /// Radius, metres, cells an edge (see [`Mesh::star`]) and skin.
    Orange(f64, i32, Material),
    /// Number in the hand.
    Bananas(usize),
}

impl Kind {
    /// The kind's name and a fruit of it; a hidden apple has fewer vertices.
    fn build(self, hidden: bool, rng: &mut Rng) -> (&'static str, Fruit) {
        match self {
            Self::Apple(r, skin) => ("apple", fruit::apple(r, if hidden { 16 } else { 30 }, &skin, rng)),
            Self::Pear(size, skin) => ("pear", fruit::pear(size, &skin, rng)),
            Self::Orange(r, n, skin) => ("orange", fruit::orange(r, n, skin, rng)),
            Self::Bananas(count) => ("bananas", fruit::bananas(count, rng)),
        }
    }
}

/// Lowest layer, of which little is seen.
const BOTTOM: &[Placement] = &[
    (Kind::Orange(0.037, 10, "orange_1"), [0.000, 0.095, 0.000], [0.0, 1.0, 0.0], 0.0),
    (Kind::Apple(0.038, GREEN), [0.086, 0.095, 0.000], [0.5, 1.0, 0.2], 0.4),
    (Kind::Orange(0.038, 10, "orange_2"), [0.043, 0.095, 0.075], [0.1, 1.0, 0.5], 1.0),
    (Kind::Apple(0.039, RED), [-0.043, 0.095, 0.075], [-0.3, 1.0, 0.4], 2.0),
    (Kind::Orange(0.038, 10, "orange_1"), [-0.086, 0.095, 0.000], [-0.4, 1.0, 0.2], 3.0),
    (Kind::Apple(0.038, CRIMSON), [-0.043, 0.095, -0.075], [-0.2, 1.0, -0.3], 4.0),
    (Kind::Apple(0.038, GALA), [0.043, 0.095, -0.075], [0.2, 1.0, -0.3], 5.0),
];

/// Fruit above the rim and beside the basket.
const TOP: &[Placement] = &[
    (Kind::Apple(0.0415, RED), [0.016, 0.172, 0.090], [0.15, 0.85, 0.55], 0.3),
    (Kind::Orange(0.0395, 28, "orange_1"), [0.088, 0.165, 0.062], [0.50, 0.75, 0.55], 1.2),
    (Kind::Apple(0.0380, GREEN), [-0.074, 0.165, 0.074], [-0.35, 0.85, 0.45], 2.2),
    (Kind::Pear(0.100, RIPE), [-0.112, 0.168, -0.010], [-0.50, 0.85, 0.15], 0.5),
    (Kind::Apple(0.0375, CRIMSON), [-0.055, 0.168, -0.085], [-0.3, 0.9, 0.1], 1.5),
    (Kind::Orange(0.0370, 18, "orange_2"), [0.030, 0.168, -0.095], [0.1, 0.9, 0.3], 2.5),
    (Kind::Apple(0.0385, GALA), [0.112, 0.165, -0.025], [0.45, 0.85, 0.2], 3.1),
    (Kind::Orange(0.0375, 18, "orange_2"), [0.000, 0.175, 0.012], [0.2, 0.9, 0.5], 2.9),
    (Kind::Pear(0.098, PEAR), [-0.040, 0.240, 0.020], [-0.22, 0.95, 0.20], 4.1),
    (Kind::Apple(0.0380, RED), [-0.030, 0.235, -0.060], [-0.1, 0.9, 0.35], 2.4),
    (Kind::Bananas(4), [0.055, 0.300, -0.030], [-0.10, 1.0, 0.42], 0.35),
    (Kind::Apple(0.0390, GALA), [-0.172, 0.045, 0.135], [-0.25, 0.85, 0.50], 0.9),
    (Kind::Orange(0.0390, 28, "orange_2"), [0.142, 0.045, 0.165], [0.35, 0.70, 0.60], 0.2),
    (Kind::Pear(0.096, PEAR), [0.205, 0.040, 0.085], [0.90, 0.05, -0.35], 2.0),
];

/// Nodes of the grapes' stalk, metres, from its pinned end on the pile over the rim and down.
const STALK: &[[f64; 3]] = &[
    [-0.030, 0.240, 0.095],
    [-0.042, 0.222, 0.112],
    [-0.053, 0.205, 0.131],
    [-0.063, 0.186, 0.150],
    [-0.071, 0.164, 0.169],
    [-0.077, 0.141, 0.186],
    [-0.081, 0.118, 0.199],
];
/// Number of grapes at each node of the stalk: a bunch is fullest below its shoulder.
const GRAPES_A_NODE: [usize; 7] = [8, 12, 13, 15, 14, 9, 4];
/// Skins of the grapes.
const GRAPE_SKINS: [Material; 3] = ["grape_1", "grape_2", "grape_3"];

/// Piles everything and returns the fruit in world space, the basket first.
pub fn pile(rng: &mut Rng) -> Vec<Object> {
    let mut objects = vec![Object { name: "basket".into(), mesh: wicker::basket(rng) }];
    let (mut bodies, meshes) = placed_fruit(rng);
    settle(&mut bodies, &[], &[&basket_distance, &table_distance], FRUIT_STEPS);

    // The fruit stay; the grapes come to lie on them.
    bodies.iter_mut().for_each(|b| b.mobility = 0.0);
    let bunch = Bunch::hang(&mut bodies, rng);
    settle(&mut bodies, &bunch.links, &[&basket_distance, &table_distance], GRAPE_STEPS);

    let mut counts = std::collections::BTreeMap::new();
    for (body, (kind, mesh)) in bodies.iter().zip(meshes) {
        let n = counts.entry(kind).and_modify(|n| *n += 1).or_insert(1);
        let name = if kind == "bananas" { kind.into() } else { format!("{kind}_{n}") };
        objects.push(Object { name, mesh: mesh.placed(body.rotation, body.position) });
    }
    objects.push(Object { name: "grapes".into(), mesh: bunch.mesh(&bodies, rng) });
    objects.extend(strays(rng));
    objects
}

/// The fruit where they start: bodies, and for each the name of its kind and its surface.
fn placed_fruit(rng: &mut Rng) -> (Vec<Body>, Vec<(&'static str, Mesh)>) {
    let placements = BOTTOM.iter().map(|p| (true, p)).chain(TOP.iter().map(|p| (false, p)));
    let place = |(hidden, &(kind, at, stem, spin)): (bool, &Placement)| {
        let (name, fruit) = kind.build(hidden, rng);
        let body = Body {
            position: DVec3::from_array(at),
            rotation: tilted(stem, spin),
            shape: fruit.shape,
            mobility: 1.0,
        };
        (body, (name, fruit.mesh))
    };
    placements.map(place).unzip()
}

/// The bunch of grapes: which of the bodies are the nodes of its stalk and its grapes.
struct Bunch {
    /// Index of the body that is the first node of the stalk.
    first_node: usize,
    /// Index of the body that is the first grape.
    first_grape: usize,
    /// Radius of each grape, metres.
    radii: Vec<f64>,
    /// Links along the stalk, then one from its node to each grape.
    links: Vec<Link>,
}

impl Bunch {
    /// Adds the bunch to the bodies, its pinned end just above the fruit.
    fn hang(bodies: &mut Vec<Body>, rng: &mut Rng) -> Self {
        // The pinned end of the stalk starts in the air: let it down onto the fruit.
        let mut drop = 0.0;
        let free = |drop: f64| {
            let p = DVec3::from_array(STALK[0]) - DVec3::Y * drop;
            let touches = |b: &Body| b.shape.touches(b.position, b.rotation, p, STALK_CLEARANCE);
            p.y > wicker::RIM_HEIGHT && !bodies.iter().any(touches)
        };
        while free(drop) {
            drop += DROP_STEP;
        }
        let first_node = bodies.len();
        let mut links = Vec::new();
        for (i, &at) in STALK.iter().enumerate() {
            let position = DVec3::from_array(at) - DVec3::Y * drop;
            bodies.push(ball(position, 0.0035, if i == 0 { 0.0 } else { 4.0 }));
            if i > 0 {
                let length = DVec3::from_array(at).distance(DVec3::from_array(STALK[i - 1]));
                links.push(Link { ends: [first_node + i - 1, first_node + i], length });
            }
        }
        let first_grape = bodies.len();
        let mut radii = Vec::new();
        for (node, &count) in GRAPES_A_NODE.iter().enumerate() {
            for _ in 0..count {
                let r = rng.range(0.0086, 0.0106);
                let offset = rng.direction() * rng.range(0.012, 0.032) + DVec3::Y * (0.014 - drop);
                let length = r + rng.range(0.006, 0.021);
                links.push(Link { ends: [first_node + node, bodies.len()], length });
                bodies.push(ball(DVec3::from_array(STALK[node]) + offset, r, 1.0));
                radii.push(r);
            }
        }
        Self { first_node, first_grape, radii, links }
    }

    /// Surface of stalk, grapes and pedicels where the bodies have settled.
    fn mesh(&self, bodies: &[Body], rng: &mut Rng) -> Mesh {
        let stalk: Vec<DVec3> =
            bodies[self.first_node..self.first_grape].iter().map(|b| b.position).collect();
        let mut cluster = stalk_mesh(&stalk);
        for (i, (body, &r)) in bodies[self.first_grape..].iter().zip(&self.radii).enumerate() {
            let anchor = self.links[STALK.len() - 1 + i].ends[0];
            let toward = (bodies[anchor].position - body.position).normalize_or(DVec3::Y);
            let turn = DQuat::from_rotation_arc(DVec3::Y, toward);
            let skin = GRAPE_SKINS[(rng.range(0.0, 3.0)) as usize];
            cluster.append(fruit::grape(r, skin).placed(turn, body.position));
            let pedicel = [body.position + toward * r * 0.9, bodies[anchor].position];
            if pedicel[0].distance(pedicel[1]) > 0.002 {
                cluster.append(Mesh::tube(&pedicel, 5, |_| 0.0007, "grape_stem"));
            }
        }
        cluster
    }
}

/// A ball at a position, of a radius, metres, and a mobility.
fn ball(position: DVec3, radius: f64, mobility: f64) -> Body {
    let shape = Shape::Balls(vec![(DVec3::ZERO, radius)]);
    Body { position, rotation: DQuat::IDENTITY, shape, mobility }
}

/// The main stalk with its woody end.
fn stalk_mesh(nodes: &[DVec3]) -> Mesh {
    let along = (nodes[0] - nodes[1]).normalize();
    let end = nodes[0] + (along + DVec3::Y * 0.5).normalize() * 0.022;
    let mut path = vec![end];
    path.extend_from_slice(nodes);
    let mut mesh = Mesh::tube(&path, 7, |i| 0.0021 - 0.00012 * i as f64, "grape_stem");
    let across = along.cross(DVec3::Y).normalize() * 0.011;
    mesh.append(Mesh::tube(&[end - across, end, end + across], 7, |_| 0.0024, "stem"));
    mesh
}

/// Single grapes and leaves lying on the table.
fn strays(rng: &mut Rng) -> Vec<Object> {
    let mut objects = Vec::new();
    for (i, (x, z)) in [(-0.128, 0.190), (-0.020, 0.225), (0.050, 0.212)].into_iter().enumerate() {
        let r = rng.range(0.0092, 0.0106);
        let at = DVec3::new(x, table_height(x, z) + r * 0.985, z);
        let lying = tilted([rng.range(-1.0, 1.0), 0.08, rng.range(0.2, 1.0)], 0.0);
        objects.push(Object {
            name: format!("grape_{}", i + 1),
            mesh: fruit::grape(r, GRAPE_SKINS[i]).placed(lying, at),
        });
    }
    for (i, (x, z, yaw, length)) in
        [(0.085, 0.200, 3.5, 0.066), (0.090, 0.206, -0.6, 0.056)].into_iter().enumerate()
    {
        let at = DVec3::new(x, table_height(x, z) + 0.006, z);
        let leaf = fruit::leaf(length, 0.06, if i == 0 { "leaf_1" } else { "leaf_2" });
        objects.push(Object {
            name: format!("leaf_{}", i + 1),
            mesh: leaf.placed(DQuat::from_rotation_y(yaw), at),
        });
    }
    objects
}
