//! Triangle meshes with smooth normals, and the ways the scene builds them.

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use glam::{DQuat, DVec3};

/// Name of a material in the MTL file.
pub type Material = &'static str;

/// Triangles with one normal a vertex and one material a triangle.
#[derive(Clone, Default)]
pub struct Mesh {
    /// Vertex positions, metres.
    pub positions: Vec<DVec3>,
    /// Unit vertex normals, outward.
    pub normals: Vec<DVec3>,
    /// Vertex indices, counter-clockwise from outside.
    pub triangles: Vec<[usize; 3]>,
    /// Material of each triangle.
    pub materials: Vec<Material>,
}

/// How the first and the last ring of a [`Mesh::skin`] are closed.
pub enum Ends {
    /// The last ring joins the first: a torus.
    Joined,
    /// A fan from each end ring to a point: a sphere.
    Points(DVec3, DVec3),
}

impl Mesh {
    /// Smooth closed surface over rings of equally many points each.
    pub fn skin(rings: &[Vec<DVec3>], ends: Ends, material: Material) -> Self {
        let (rows, columns) = (rings.len(), rings[0].len());
        let mut mesh = Self { positions: rings.concat(), ..Self::default() };
        let at = |i: usize, j: usize| (i % rows) * columns + j % columns;
        let strips = if matches!(ends, Ends::Joined) { rows } else { rows - 1 };
        for i in 0..strips {
            for j in 0..columns {
                mesh.quad([at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)]);
            }
        }
        if let Ends::Points(first, last) = ends {
            let pole = mesh.positions.len();
            mesh.positions.extend([first, last]);
            for j in 0..columns {
                mesh.triangles.push([pole, at(0, j + 1), at(0, j)]);
                mesh.triangles.push([pole + 1, at(rows - 1, j), at(rows - 1, j + 1)]);
            }
        }
        mesh.finish(material)
    }

    /// Closed tube along `path`; `section(i, angle)` gives the offsets along the side and the
    /// other normal. `side` hints where the first of them points. Open paths end in a point
    /// a little beyond their last station.
    pub fn sweep(
        path: &[DVec3],
        side: impl Fn(usize) -> DVec3,
        around: usize,
        joined: bool,
        section: impl Fn(usize, f64) -> (f64, f64),
        material: Material,
    ) -> Self {
        let n = path.len();
        let tangent = |i: usize| {
            let (before, after) = match (joined, i) {
                (true, _) => ((i + n - 1) % n, (i + 1) % n),
                (false, _) => (i.saturating_sub(1), (i + 1).min(n - 1)),
            };
            (path[after] - path[before]).normalize()
        };
        let rings: Vec<Vec<DVec3>> = (0..n)
            .map(|i| {
                let t = tangent(i);
                let a = side(i).reject_from_normalized(t).normalize();
                let b = t.cross(a);
                (0..around)
                    .map(|j| {
                        let (u, v) = section(i, TAU * j as f64 / around as f64);
                        path[i] + a * u + b * v
                    })
                    .collect()
            })
            .collect();
        if joined {
            return Self::skin(&rings, Ends::Joined, material);
        }
        let tip = |i: usize| {
            let r = section(i, 0.0).0.abs().min(section(i, TAU / 4.0).1.abs());
            tangent(i) * r * 0.35
        };
        Self::skin(&rings, Ends::Points(path[0] - tip(0), path[n - 1] + tip(n - 1)), material)
    }

    /// Round tube of constant or varying radius; see [`Mesh::sweep`].
    pub fn tube(path: &[DVec3], around: usize, radius: impl Fn(usize) -> f64, material: Material) -> Self {
        let along = (path[path.len() - 1] - path[0]).normalize_or(DVec3::Y);
        let side = along.any_orthonormal_vector();
        Self::sweep(
            path,
            |_| side,
            around,
            false,
            |i, a| (radius(i) * a.cos(), radius(i) * a.sin()),
            material,
        )
    }

    /// Star-shaped closed surface `direction → distance`, tessellated evenly as a cube whose
    /// edges have `n` cells.
    pub fn star(n: i32, radius: impl Fn(DVec3) -> f64, material: Material) -> Self {
        let mut mesh = Self::default();
        let mut known = BTreeMap::new();
        for axis in 0..3 {
            for sign in [-1, 1] {
                let mut corner = |u: i32, v: i32| {
                    let mut lattice = [0; 3];
                    lattice[axis] = sign * n;
                    lattice[(axis + 1) % 3] = sign * (2 * u - n);
                    lattice[(axis + 2) % 3] = 2 * v - n;
                    *known.entry(lattice).or_insert_with(|| {
                        // Equal angles instead of equal lengths: cells of nearly the same size.
                        let even = |c: i32| (f64::from(c) / f64::from(n) * TAU / 8.0).tan();
                        let d = DVec3::new(even(lattice[0]), even(lattice[1]), even(lattice[2])).normalize();
                        mesh.positions.push(d * radius(d));
                        mesh.positions.len() - 1
                    })
                };
                let mut quads = Vec::new();
                for (u, v) in (0..n).flat_map(|u| (0..n).map(move |v| (u, v))) {
                    quads.push([corner(u, v), corner(u + 1, v), corner(u + 1, v + 1), corner(u, v + 1)]);
                }
                quads.into_iter().for_each(|q| mesh.quad(q));
            }
        }
        mesh.finish(material)
    }

    /// Rectangular patch with normals of its own, so that it meets other patches in a crease. The
    /// front is the side from which `(i, j)` run counter-clockwise.
    pub fn patch(n: usize, m: usize, f: impl Fn(usize, usize) -> DVec3, material: Material) -> Self {
        let grid = (0..=n).flat_map(|i| (0..=m).map(move |j| (i, j)));
        let positions = grid.map(|(i, j)| f(i, j)).collect();
        let mut mesh = Self { positions, ..Self::default() };
        let at = |i: usize, j: usize| i * (m + 1) + j;
        for (i, j) in (0..n).flat_map(|i| (0..m).map(move |j| (i, j))) {
            mesh.quad([at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
        mesh.materials = vec![material; mesh.triangles.len()];
        mesh.smooth();
        mesh
    }

    /// Flat polygon around its centroid, facing the side from which `border` is counter-clockwise.
    pub fn fan(border: &[DVec3], material: Material) -> Self {
        let n = border.len();
        let mut mesh = Self {
            positions: border.to_vec(),
            triangles: (0..n).map(|i| [i, (i + 1) % n, n]).collect(),
            materials: vec![material; n],
            ..Self::default()
        };
        mesh.positions.push(border.iter().sum::<DVec3>() / n as f64);
        mesh.smooth();
        mesh
    }

    fn quad(&mut self, [a, b, c, d]: [usize; 4]) {
        self.triangles.push([a, b, c]);
        self.triangles.push([a, c, d]);
    }

    /// Sets the material, turns the closed surface outward and computes its normals.
    fn finish(mut self, material: Material) -> Self {
        self.materials = vec![material; self.triangles.len()];
        let p = &self.positions;
        let volume: f64 = self.triangles.iter().map(|&[a, b, c]| p[a].dot(p[b].cross(p[c]))).sum();
        if volume < 0.0 {
            self.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        }
        self.smooth();
        self
    }

    /// Vertex normals: face normals weighted by the angle at the vertex (Thürmer, Wüthrich 1998).
    fn smooth(&mut self) {
        let mut normals = vec![DVec3::ZERO; self.positions.len()];
        for t in &self.triangles {
            let [a, b, c] = t.map(|i| self.positions[i]);
            let face = (b - a).cross(c - a).normalize_or_zero();
            for (k, (p, q, r)) in [(a, b, c), (b, c, a), (c, a, b)].into_iter().enumerate() {
                normals[t[k]] += face * (q - p).angle_between(r - p);
            }
        }
        self.normals = normals.into_iter().map(|n| n.normalize_or(DVec3::Y)).collect();
    }

    /// Gives every triangle the material that `f` finds for its centroid.
    pub fn paint(&mut self, f: impl Fn(DVec3) -> Material) {
        for (t, m) in self.triangles.iter().zip(&mut self.materials) {
            *m = f(t.iter().map(|&i| self.positions[i]).sum::<DVec3>() / 3.0);
        }
    }

    /// Moves the mesh rigidly: rotation about the origin, then translation.
    pub fn placed(mut self, rotation: DQuat, position: DVec3) -> Self {
        self.positions.iter_mut().for_each(|p| *p = rotation * *p + position);
        self.normals.iter_mut().for_each(|n| *n = rotation * *n);
        self
    }

    /// Adds another mesh; the surfaces stay separate.
    pub fn append(&mut self, other: Self) {
        let first = self.positions.len();
        self.positions.extend(other.positions);
        self.normals.extend(other.normals);
        self.triangles.extend(other.triangles.iter().map(|t| t.map(|i| i + first)));
        self.materials.extend(other.materials);
    }
}
