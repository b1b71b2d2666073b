//! Triangle meshes as binary PLY files, one for each material.

use std::io::{self, Write};

use glam::{Vec2, Vec3};

use crate::scene::{Mesh, mesh::face_normal};

/// The triangles of one material, with vertices of their own.
#[derive(Debug, Default)]
pub(super) struct Part {
    /// Position (metres), unit normal and texture coordinates (v up) of each vertex.
    vertices: Vec<(Vec3, Vec3, Vec2)>,
    /// Indices of the corners of each triangle, anticlockwise seen from the front.
    triangles: Vec<[u32; 3]>,
}

impl Part {
    /// Collects the triangles of one material.
    ///
    /// A vertex without a normal gets the normal of its triangle, with which our
    /// renderer shades when none of the corners has one.
    pub(super) fn of_material(mesh: &Mesh, material: u32) -> Self {
        // No index is as large: meshes have fewer vertices.
        const UNSEEN: u32 = u32::MAX;
        let mut place = vec![UNSEEN; mesh.positions.len()];
        let mut part = Self::default();
        for (t, corners) in mesh.indices.iter().enumerate().filter(|(t, _)| mesh.materials[*t] == material) {
            part.triangles.push(corners.map(|i| {
                let i = i as usize;
                let next = part.vertices.len() as u32;
                if mesh.normals[i] == Vec3::ZERO {
                    let n = face_normal(mesh.corners(t)).normalize_or(Vec3::Y);
                    part.vertices.push((mesh.positions[i], n, mesh.uvs[i]));
                    return next;
                }
                if place[i] == UNSEEN {
                    place[i] = next;
                    part.vertices.push((mesh.positions[i], mesh.normals[i], mesh.uvs[i]));
                }
                place[i]
            }));
        }
        part
    }

    /// Whether every vertex has the normal of its triangles, on their front.
    pub(super) fn is_flat(&self) -> bool {
        // Within 1.4 milliradians: normals that a file gives with three digits are as close.
        self.triangles.iter().all(|t| {
            let n = self.normal(t);
            t.iter().all(|&i| self.vertices[i as usize].1.dot(n) > 1.0 - 1e-6)
        })
    }

    /// Unit normal on the front of a triangle; zero for one without area.
    fn normal(&self, triangle: &[u32; 3]) -> Vec3 {
        face_normal(triangle.map(|i| self.vertices[i as usize].0)).normalize_or_zero()
    }

    /// Number of triangles.
    pub(super) fn len(&self) -> usize {
        self.triangles.len()
    }

    /// Derivatives of the position by u and v (up) over a triangle, metres; `None` where
    /// texture coordinates do not span it.
    fn derivatives(&self, triangle: &[u32; 3]) -> Option<[Vec3; 2]> {
        let [(a, _, ua), (b, _, ub), (c, _, uc)] = triangle.map(|i| self.vertices[i as usize]);
        let (p, q) = (ub - ua, uc - ua);
        let determinant = p.perp_dot(q);
        let d =
            [((b - a) * q.y - (c - a) * p.y) / determinant, ((c - a) * p.x - (b - a) * q.x) / determinant];
        Some(d).filter(|d| d.iter().all(|v| v.is_finite()))
    }

    /// Number of triangles on which images appear mirrored.
    pub(super) fn mirrored(&self) -> usize {
        let is_mirrored = |t: &&[u32; 3]| {
            self.derivatives(t).is_some_and(|[du, dv]| du.cross(dv).dot(self.vertices[t[0] as usize].1) < 0.0)
        };
        self.triangles.iter().filter(is_mirrored).count()
    }

    /// Smallest and largest width of an image on any triangle, metres.
    pub(super) fn widths(&self) -> [f32; 2] {
        let widths = self.triangles.iter().filter_map(|t| Some(self.derivatives(t)?[0].length()));
        widths.fold([f32::INFINITY, 0.0], |[lo, hi], w| [lo.min(w), hi.max(w)])
    }

    /// Largest absolute coordinate of any vertex, metres.
    pub(super) fn reach(&self) -> f32 {
        self.vertices.iter().map(|v| v.0.abs().max_element()).fold(0.0, f32::max)
    }

    /// The surface moved by `distance` (metres) along its vertex normals, toward its
    /// front: the side from which corners run anticlockwise.
    pub(super) fn moved(&self, distance: f32) -> Self {
        let mut front = vec![1.0_f32; self.vertices.len()];
        for t in &self.triangles {
            let n = self.normal(t);
            for &i in t {
                front[i as usize] = self.vertices[i as usize].1.dot(n).signum();
            }
        }
        let moved = |(&(p, n, uv), front): (&(Vec3, Vec3, Vec2), &f32)| (p + n * (distance * front), n, uv);
        Self {
            vertices: self.vertices.iter().zip(&front).map(moved).collect(),
            triangles: self.triangles.clone(),
        }
    }

    /// The same surface with front and back exchanged.
    pub(super) fn turned(self) -> Self {
        Self { triangles: self.triangles.iter().map(|&[a, b, c]| [a, c, b]).collect(), ..self }
    }

    /// Position (metres), unit normal and texture coordinates (v up) of each vertex.
    pub(super) fn vertices(&self) -> &[(Vec3, Vec3, Vec2)] {
        &self.vertices
    }

    /// Indices of the corners of each triangle, anticlockwise seen from the front.
    pub(super) fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Whether no triangle has the material.
    pub(super) fn is_empty(&self) -> bool {
        self.triangles.is_empty()
    }

    /// Writes the part as binary little-endian PLY 1.0.
    pub(super) fn write(&self, out: &mut impl Write) -> io::Result<()> {
        write!(out, "ply\nformat binary_little_endian 1.0\nelement vertex {}\n", self.vertices.len())?;
        for name in ["x", "y", "z", "nx", "ny", "nz", "u", "v"] {
            writeln!(out, "property float {name}")?;
        }
        write!(out, "element face {}\nproperty list uchar int vertex_indices\n", self.triangles.len())?;
        out.write_all(b"end_header\n")?;
        for (p, n, uv) in &self.vertices {
            for x in [p.x, p.y, p.z, n.x, n.y, n.z, uv.x, uv.y] {
                out.write_all(&x.to_le_bytes())?;
            }
        }
        for t in &self.triangles {
            out.write_all(&[3])?;
            for i in t {
                out.write_all(&i.to_le_bytes())?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_holds_its_own_vertices_once_and_no_vertex_lacks_a_normal() {
        let mesh = Mesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z, Vec3::ONE],
            normals: vec![Vec3::Z, Vec3::Z, Vec3::Z, Vec3::ZERO, Vec3::Z],
            uvs: vec![Vec2::ZERO; 5],
            indices: vec![[0, 1, 2], [0, 2, 4], [0, 1, 3]],
            materials: vec![0, 0, 1],
            objects: vec![0; 3],
            ..Mesh::default()
        };
        let part = Part::of_material(&mesh, 0);
        assert_eq!(part.triangles, [[0, 1, 2], [0, 2, 3]]);
        assert_eq!(part.vertices.len(), 4);
        let part = Part::of_material(&mesh, 1);
        assert_eq!(part.vertices[2], (Vec3::Z, Vec3::NEG_Y, Vec2::ZERO));
        assert!(Part::of_material(&mesh, 2).is_empty());
    }

    #[test]
    fn a_surface_is_moved_toward_its_front_whichever_way_its_normals_look() {
        let part = Part {
            vertices: [Vec3::ZERO, Vec3::X, Vec3::Y].map(|p| (p, Vec3::NEG_Z, Vec2::ZERO)).to_vec(),
            triangles: vec![[0, 1, 2]],
        };
        assert!(!part.is_flat());
        let moved = part.moved(0.5);
        assert!(moved.vertices.iter().all(|v| v.0.z == 0.5));
        assert_eq!(moved.turned().normal(&[0, 2, 1]), Vec3::NEG_Z);
    }
}
