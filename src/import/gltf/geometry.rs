//! Triangles of primitives.

use glam::{Mat3, Mat4, Vec2, Vec3};
use gltf_json::{
    Accessor, Index,
    mesh::{Mode, Primitive, Semantic},
    validation::Checked,
};

use super::{
    Reader,
    file::{DRACO, not_read},
    material::Placement,
};
use crate::{
    import::ImportError,
    scene::mesh::{face_normal, is_proper},
};

/// How far texture coordinates may leave the unit square unnoticed.
const UV_TOLERANCE: f32 = 1e-3;
/// Vertex colours from here on count as white.
const WHITE: f64 = 0.999;

/// Where a primitive stands.
pub enum Pose {
    /// All vertices alike.
    Rigid(Mat4),
    /// Vertices by their weights of joints.
    Skinned(Vec<Mat4>),
}

/// A primitive in its own coordinates, morphed.
pub struct Shape {
    positions: Vec<Vec3>,
    normals: Option<Vec<Vec3>>,
    /// Texture coordinates, v up.
    uvs: Vec<Vec2>,
    triangles: Vec<[u32; 3]>,
    /// Joints of each vertex with their weights.
    bones: Vec<Vec<(usize, f32)>>,
    /// Strips and fans have degenerate triangles by design.
    is_strip: bool,
}

fn vectors(elements: Vec<[f64; 3]>) -> Vec<Vec3> {
    elements.into_iter().map(|e| Vec3::from_array(e.map(|v| v as f32))).collect()
}

impl Reader<'_> {
    /// Reads a primitive and its material; `None` when it has no triangles.
    pub fn read_primitive(
        &mut self,
        key: &str,
        primitive: &Primitive,
        weights: &[f32],
    ) -> Result<Option<(Shape, u32)>, ImportError> {
        let file = self.file;
        let attribute = |semantic| primitive.attributes.get(&Checked::Valid(semantic)).copied();
        let Checked::Valid(mode) = primitive.mode else {
            return Err(file.error(format!("{key}.mode"), "must be 0 to 6"));
        };
        if matches!(mode, Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip) {
            self.notes.add(format!("{}: points and lines are left out", file.path.display()));
            return Ok(None);
        }
        let Some(accessor) = attribute(Semantic::Positions) else { return Ok(None) };
        let is_draco = primitive.extensions.as_ref().is_some_and(|e| e.others.contains_key(DRACO));
        if is_draco && file.get(key, accessor)?.buffer_view.is_none() {
            return Err(file.error(key, format!("is compressed by {DRACO}, {}", not_read(DRACO))));
        }
        let mut positions = vectors(file.elements(key, accessor)?);
        let n = positions.len();
        let same_length = |name: &str, len: usize| {
            if len == n {
                return Ok(());
            }
            let message = format!("must have one element a vertex, {n}; it has {len}");
            Err(file.error(format!("{key}.attributes.{name}"), message))
        };
        let mut normals = match attribute(Semantic::Normals) {
            None => None,
            Some(a) => Some(vectors(file.elements(key, a)?)),
        };
        same_length("NORMAL", normals.as_ref().map_or(n, Vec::len))?;
        for (target, &weight) in primitive.targets.iter().flatten().zip(weights).filter(|(_, w)| **w != 0.0) {
            let add = |to: &mut [Vec3], accessor: Option<Index<Accessor>>| {
                let Some(accessor) = accessor else { return Ok(()) };
                let deltas = vectors(file.elements(key, accessor)?);
                same_length("targets", deltas.len())?;
                to.iter_mut().zip(deltas).for_each(|(v, d)| *v += weight * d);
                Ok::<_, ImportError>(())
            };
            add(&mut positions, target.positions)?;
            if let Some(normals) = &mut normals {
                add(normals, target.normals)?;
            }
        }
        let triangles = self.read_triangles(key, primitive, mode, n)?;
        if triangles.is_empty() {
            return Ok(None);
        }
        let material = self.materials.id(&format!("{key}.material"), primitive.material, &mut self.notes)?;
        let uvs = match self.materials.placement(material) {
            None => vec![Vec2::ZERO; n],
            Some(placement) => {
                let uvs = match attribute(Semantic::TexCoords(placement.set)) {
                    None => None,
                    Some(a) => Some(file.elements::<2>(key, a)?),
                };
                same_length("TEXCOORD", uvs.as_ref().map_or(n, Vec::len))?;
                self.layout(material, &placement, uvs).unwrap_or_else(|| vec![Vec2::ZERO; n])
            }
        };
        let mut bones = Vec::new();
        for set in 0.. {
            let (Some(j), Some(w)) = (attribute(Semantic::Joints(set)), attribute(Semantic::Weights(set)))
            else {
                break;
            };
            let (joints, weights) = (file.elements::<4>(key, j)?, file.elements::<4>(key, w)?);
            same_length("JOINTS", joints.len())?;
            same_length("WEIGHTS", weights.len())?;
            bones.resize(n, Vec::new());
            for ((bone, joints), weights) in bones.iter_mut().zip(joints).zip(weights) {
                let used = joints.iter().zip(weights).filter(|(_, w)| *w > 0.0);
                bone.extend(used.map(|(&j, w)| (j as usize, w as f32)));
            }
        }
        self.note_colors(key, primitive)?;
        let is_strip = mode != Mode::Triangles;
        Ok(Some((Shape { positions, normals, uvs, triangles, bones, is_strip }, material)))
    }

    fn read_triangles(
        &self,
        key: &str,
        primitive: &Primitive,
        mode: Mode,
        n: usize,
    ) -> Result<Vec<[u32; 3]>, ImportError> {
        let indices: Vec<u32> = match primitive.indices {
            Some(accessor) => {
                let key = format!("{key}.indices");
                let indices = self.file.elements::<1>(&key, accessor)?;
                if let Some([wrong]) = indices.iter().find(|[i]| !(*i >= 0.0 && *i < n as f64)) {
                    let message = format!("vertex {wrong} does not exist: there are {n}, from 0");
                    return Err(self.file.error(key, message));
                }
                indices.into_iter().map(|[i]| i as u32).collect()
            }
            None => (0..u32::try_from(n).unwrap_or(u32::MAX)).collect(),
        };
        let windows = indices.windows(3).enumerate();
        Ok(match (mode, &indices[..]) {
            // glTF 2.0 section 3.7.2.1.
            (Mode::TriangleStrip, _) => windows
                .map(|(i, t)| if i % 2 == 0 { [t[0], t[1], t[2]] } else { [t[0], t[2], t[1]] })
                .collect(),
            (Mode::TriangleFan, [hub, rim @ ..]) => rim.windows(2).map(|r| [r[0], r[1], *hub]).collect(),
            _ => indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect(),
        })
    }

    /// Texture coordinates as the material's images lie, v up.
    fn layout(
        &mut self,
        material: u32,
        placement: &Placement,
        uvs: Option<Vec<[f64; 2]>>,
    ) -> Option<Vec<Vec2>> {
        let name = &self.materials.list[material as usize].0;
        let Some(uvs) = uvs else {
            self.notes.add(format!(
                "material `{name}`: a mesh lacks TEXCOORD_{}, which its images need",
                placement.set
            ));
            return None;
        };
        let uvs = uvs.into_iter().map(|uv| {
            let uv = placement.apply(Vec2::from_array(uv.map(|v| v as f32)));
            if uv.is_finite() { uv } else { Vec2::ZERO }
        });
        let uvs: Vec<Vec2> = uvs.collect();
        let is_outside = |uv: &Vec2| (*uv - 0.5).abs().max_element() > 0.5 + UV_TOLERANCE;
        if !placement.repeats && uvs.iter().any(is_outside) {
            self.notes
                .add(format!("material `{name}`: its images repeat; clamping and mirroring are not read"));
        }
        Some(uvs.into_iter().map(|uv| Vec2::new(uv.x, 1.0 - uv.y)).collect())
    }

    fn note_colors(&mut self, key: &str, primitive: &Primitive) -> Result<(), ImportError> {
        let Some(&accessor) = primitive.attributes.get(&Checked::Valid(Semantic::Colors(0))) else {
            return Ok(());
        };
        let is_white = match self.file.elements::<3>(key, accessor) {
            Ok(colors) => colors.iter().flatten().all(|v| *v >= WHITE),
            Err(_) => self.file.elements::<4>(key, accessor)?.iter().flatten().all(|v| *v >= WHITE),
        };
        if !is_white {
            self.notes.add(format!("{}: vertex colours are ignored", self.file.path.display()));
        }
        Ok(())
    }

    /// Adds a primitive to the mesh.
    pub fn place(
        &mut self,
        key: &str,
        shape: &Shape,
        pose: &Pose,
        material: u32,
        part: u32,
    ) -> Result<(), ImportError> {
        let file = self.file;
        let n = shape.positions.len();
        let most = self.mesh.positions.len() + n + 3 * shape.triangles.len();
        if u32::try_from(most).is_err() {
            return Err(file.error(key, "the scene has more vertices than this program can number, 2³²"));
        }
        let worlds: Vec<Mat4> = match pose {
            Pose::Rigid(world) => vec![*world],
            Pose::Skinned(_) if shape.bones.is_empty() => {
                return Err(file.error(format!("{key}.attributes"), "a skin needs JOINTS_0 and WEIGHTS_0"));
            }
            Pose::Skinned(joints) => {
                let blend = |bone: &Vec<(usize, f32)>| {
                    let total: f32 = bone.iter().map(|b| b.1).sum();
                    let mut sum = Mat4::ZERO;
                    for &(joint, weight) in bone {
                        let matrix = joints.get(joint).ok_or_else(|| {
                            let message =
                                format!("joint {joint} does not exist: the skin has {}", joints.len());
                            file.error(format!("{key}.attributes.JOINTS_0"), message)
                        })?;
                        sum += *matrix * (weight / total);
                    }
                    Ok(if bone.is_empty() { Mat4::IDENTITY } else { sum })
                };
                shape.bones.iter().map(blend).collect::<Result<_, ImportError>>()?
            }
        };
        let world = |i: usize| &worlds[i.min(worlds.len() - 1)];
        let positions: Vec<Vec3> =
            shape.positions.iter().enumerate().map(|(i, p)| world(i).transform_point3(*p)).collect();
        let flips = worlds.first().is_some_and(|w| Mat3::from_mat4(*w).determinant() < 0.0);
        let mesh = &mut self.mesh;
        let base = mesh.positions.len();
        // Absent normals are zero until their faces are known.
        let mut normals = vec![Vec3::ZERO; n];
        if let Some(given) = &shape.normals {
            for (i, (to, normal)) in normals.iter_mut().zip(given).enumerate() {
                let moved = normal_matrix(world(i)) * *normal;
                *to = moved.try_normalize().unwrap_or(Vec3::ZERO);
            }
            mesh.positions.extend(&positions);
            mesh.normals.extend(&normals);
            mesh.uvs.extend(&shape.uvs);
        }
        for &[a, b, c] in &shape.triangles {
            let corners = if flips { [a, c, b] } else { [a, b, c] }.map(|i| i as usize);
            let points = corners.map(|i| positions[i]);
            if !is_proper(points) {
                self.n_degenerate += usize::from(!shape.is_strip);
                continue;
            }
            let face = face_normal(points).normalize_or(Vec3::Y);
            let triangle = corners.map(|i| {
                if normals[i] != Vec3::ZERO {
                    return (base + i) as u32;
                }
                mesh.positions.push(positions[i]);
                mesh.normals.push(face);
                mesh.uvs.push(shape.uvs[i]);
                (mesh.positions.len() - 1) as u32
            });
            mesh.indices.push(triangle);
            mesh.materials.push(material);
            mesh.objects.push(part);
        }
        Ok(())
    }
}

/// Matrix of normals: the cofactors, which also exist where the inverse does
/// not, with the sign of the inverse transpose.
fn normal_matrix(world: &Mat4) -> Mat3 {
    let m = Mat3::from_mat4(*world);
    let cofactors =
        Mat3::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis));
    if m.determinant() < 0.0 { -cofactors } else { cofactors }
}
