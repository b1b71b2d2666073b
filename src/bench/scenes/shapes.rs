//! Simple shapes as the text of a Wavefront OBJ.

use std::{
    f32::consts::{PI, TAU},
    fmt::Write as _,
};

use glam::{Quat, Vec3};

/// Shapes with smooth normals where they are round, as objects of an OBJ.
#[derive(Default)]
pub struct Shapes {
    text: String,
    n_vertices: usize,
}

impl Shapes {
    /// Begins an object of this material, or goes on with one of that name.
    pub fn object(&mut self, name: &str, material: &str) -> &mut Self {
        // Writing to a String does not fail.
        let _ = writeln!(self.text, "o {name}\nusemtl {material}");
        self
    }

    /// The text of the OBJ.
    pub fn obj(&self) -> &str {
        &self.text
    }

    /// A vertex with its normal; returns its number.
    fn vertex(&mut self, p: Vec3, n: Vec3) -> usize {
        let _ =
            writeln!(self.text, "v {:.5} {:.5} {:.5}\nvn {:.4} {:.4} {:.4}", p.x, p.y, p.z, n.x, n.y, n.z);
        self.n_vertices += 1;
        self.n_vertices
    }

    fn face(&mut self, corners: &[usize]) {
        self.text.push('f');
        for c in corners {
            let _ = write!(self.text, " {c}//{c}");
        }
        self.text.push('\n');
    }

    /// The parallelogram p + u a + v b, its front along a × b.
    pub fn quad(&mut self, p: Vec3, a: Vec3, b: Vec3) {
        let n = a.cross(b).normalize();
        let corners = [p, p + a, p + a + b, p + b].map(|corner| self.vertex(corner, n));
        self.face(&corners);
    }

    /// A box on the ground whose floor is centred at a point, of full extents, turned about the vertical by an
    /// angle in radians.
    pub fn turned_box(&mut self, floor: Vec3, half: Vec3, angle: f32) {
        let turn = Quat::from_rotation_y(angle);
        let (x, z) = (turn * Vec3::X * half.x, turn * Vec3::Z * half.z);
        let y = Vec3::Y * half.y;
        for (p, a, b) in [
            (floor - x - z, y, 2.0 * x),
            (floor + x + z, y, -2.0 * x),
            (floor - x + z, y, -2.0 * z),
            (floor + x - z, y, 2.0 * z),
            (floor - x + z + y, 2.0 * x, -2.0 * z),
            (floor - x - z, 2.0 * x, 2.0 * z),
        ] {
            self.quad(p, a, b);
        }
    }

    /// A sheet of `rows` by `columns` quads through the points of a function, with smooth normals.
    pub fn sheet(&mut self, rows: usize, columns: usize, point: impl Fn(usize, usize) -> Vec3) {
        let normal = |i: usize, j: usize| {
            let along = |a: usize, b: usize, most: usize| (a.saturating_sub(1), (b + 1).min(most));
            let ((i0, i1), (j0, j1)) = (along(i, i, rows), along(j, j, columns));
            let cross = (point(i1, j) - point(i0, j)).cross(point(i, j1) - point(i, j0));
            -cross.normalize_or(Vec3::NEG_Y)
        };
        let ids: Vec<Vec<usize>> = (0..=rows)
            .map(|i| (0..=columns).map(|j| self.vertex(point(i, j), normal(i, j))).collect())
            .collect();
        for (above, below) in ids.iter().zip(&ids[1..]) {
            for j in 0..columns {
                self.face(&[above[j], above[j + 1], below[j + 1], below[j]]);
            }
        }
    }

    /// A profile of points (distance from the axis, height) turned about the vertical through `base`, with
    /// smooth normals to the right of the profile's direction.
    pub fn lathe(&mut self, base: Vec3, profile: &[[f32; 2]], columns: usize) {
        let normals: Vec<[f32; 2]> = (0..profile.len())
            .map(|i| {
                let [a, b] = [profile[i.saturating_sub(1)], profile[(i + 1).min(profile.len() - 1)]];
                let (r, y) = (b[0] - a[0], b[1] - a[1]);
                let length = r.hypot(y);
                [y / length, -r / length]
            })
            .collect();
        let ids: Vec<Vec<usize>> = profile
            .iter()
            .zip(&normals)
            .map(|([r, y], [nr, ny])| {
                let at = |j: usize| TAU * j as f32 / columns as f32;
                let around = |j: usize| Vec3::new(at(j).cos(), 0.0, at(j).sin());
                let vertex = |s: &mut Self, j| {
                    s.vertex(base + around(j) * *r + Vec3::Y * *y, around(j) * *nr + Vec3::Y * *ny)
                };
                (0..columns).map(|j| vertex(self, j)).collect()
            })
            .collect();
        for (below, above) in ids.iter().zip(&ids[1..]) {
            for j in 0..columns {
                let next = (j + 1) % columns;
                self.face(&[below[j], above[j], above[next], below[next]]);
            }
        }
    }

    /// A sphere of `rows` rows.
    pub fn sphere(&mut self, center: Vec3, radius: f32, rows: usize) {
        let direction = |i: usize, j: usize| {
            let (theta, phi) = (PI * i as f32 / rows as f32, PI * j as f32 / rows as f32);
            Vec3::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin())
        };
        let mut vertex = |i, j| self.vertex(center + radius * direction(i, j), direction(i, j));
        let [top, bottom] = [vertex(0, 0), vertex(rows, 0)];
        let rings: Vec<Vec<usize>> =
            (1..rows).map(|i| (0..2 * rows).map(|j| vertex(i, j)).collect()).collect();
        let columns = 2 * rows;
        for j in 0..columns {
            let next = (j + 1) % columns;
            self.face(&[top, rings[0][next], rings[0][j]]);
            for (above, below) in rings.iter().zip(&rings[1..]) {
                self.face(&[above[j], above[next], below[next], below[j]]);
            }
            let last = &rings[rows - 2];
            self.face(&[bottom, last[j], last[next]]);
        }
    }
}
