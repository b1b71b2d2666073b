//! Binary PLY of the triangles of one material.

use std::io::{self, Write};

use glam::{Vec2, Vec3};

use crate::scene::{Mesh, mesh::face_normal};

/// A part of a mesh with vertices of its own.
#[derive(Debug, Default)]
pub(super) struct Part {
    vertices: Vec<(Vec3, Vec3, Vec2)>,
    triangles: Vec<[u32; 3]>,
}

impl Part {
    /// The triangles of one material.
    ///
    /// A vertex without a normal gets that of its triangle, which is what our
    /// renderer shades with when none of the corners has one.
    pub(super) fn of_material(mesh: &Mesh, material: u32) -> Self {
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

    /// Whether the material is not used at all.
    pub(super) fn is_empty(&self) -> bool {
        self.triangles.is_empty()
    }

    /// Writes binary little-endian PLY 1.0.
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
        };
        let part = Part::of_material(&mesh, 0);
        assert_eq!(part.triangles, [[0, 1, 2], [0, 2, 3]]);
        assert_eq!(part.vertices.len(), 4);
        let part = Part::of_material(&mesh, 1);
        assert_eq!(part.vertices[2], (Vec3::Z, Vec3::NEG_Y, Vec2::ZERO));
        assert!(Part::of_material(&mesh, 2).is_empty());
    }
}
