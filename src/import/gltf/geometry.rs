//! Triangles of mesh primitives.

use glam::{Mat3, Mat4, Vec2, Vec3, Vec4};
use gltf_json::{
    Accessor, Index,
    mesh::{Mode, Primitive, Semantic},
    validation::Checked,
};

use super::{
    file::{DRACO, File, not_read},
    material::Materials,
    texture::UvMapping,
};
use crate::{
    import::{error::ImportError, left_out::LeftOut, warnings::Warnings},
    scene::mesh::{Mesh, face_normal},
};

/// Vertex colours from here on count as white: half a step of 8 bits is 0.002.
const WHITE: f64 = 0.999;

/// Transformation of a primitive to world space.
pub enum Pose {
    /// One transformation for all vertices.
    Rigid(Mat4),
    /// Joint matrices of a skin, blended at every vertex by its weights.
    Skinned(Vec<Mat4>),
}

/// A primitive in its own coordinates, morph targets applied.
pub struct PrimitiveMesh {
    /// Index of the material in [`Materials::list`].
    material: u32,
    positions: Vec<Vec3>,
    /// Unnormalised vertex normals; `None` for flat faces.
    normals: Option<Vec<Vec3>>,
    /// Vertex tangents with their handedness; `None` where the texture coordinates decide.
    tangents: Option<Vec<Vec4>>,
    /// Texture coordinates of the material's images, v up.
    uvs: Vec<Vec2>,
    triangles: Vec<[u32; 3]>,
    /// Joints of each vertex with their weights; empty without a skin.
    joint_weights: Vec<Vec<(usize, f32)>>,
    /// Whether triangles come from a strip or fan, which have degenerate ones by design.
    is_strip: bool,
}

fn vectors(elements: Vec<[f64; 3]>) -> Vec<Vec3> {
    elements.into_iter().map(|e| Vec3::from_array(e.map(|v| v as f32))).collect()
}

/// The vertex attributes of a primitive.
struct Attributes<'a> {
    file: &'a File,
    /// The primitive's key, for messages.
    key: &'a str,
    primitive: &'a Primitive,
    n_vertices: usize,
}

impl Attributes<'_> {
    /// Reads an attribute; `None` if the primitive lacks it. `name` is for messages.
    fn read<const N: usize>(
        &self,
        semantic: Semantic,
        name: &str,
    ) -> Result<Option<Vec<[f64; N]>>, ImportError> {
        let Some(&accessor) = self.primitive.attributes.get(&Checked::Valid(semantic)) else {
            return Ok(None);
        };
        let elements = self.file.elements::<N>(self.key, accessor)?;
        self.check_length(name, elements.len())?;
        Ok(Some(elements))
    }

    fn check_length(&self, name: &str, len: usize) -> Result<(), ImportError> {
        if len == self.n_vertices {
            return Ok(());
        }
        let message = format!("must have one element a vertex, {}; it has {len}", self.n_vertices);
        Err(self.file.error(format!("{}.attributes.{name}", self.key), message))
    }

    /// Adds the morph targets by their weights.
    fn morph(
        &self,
        weights: &[f32],
        positions: &mut [Vec3],
        mut normals: Option<&mut Vec<Vec3>>,
    ) -> Result<(), ImportError> {
        let targets = self.primitive.targets.iter().flatten().zip(weights);
        for (target, &weight) in targets.filter(|(_, w)| **w != 0.0) {
            let add = |to: &mut [Vec3], accessor: Option<Index<Accessor>>| {
                let Some(accessor) = accessor else { return Ok(()) };
                let deltas = vectors(self.file.elements(self.key, accessor)?);
                self.check_length("targets", deltas.len())?;
                to.iter_mut().zip(deltas).for_each(|(v, d)| *v += weight * d);
                Ok::<_, ImportError>(())
            };
            add(positions, target.positions)?;
            if let Some(normals) = &mut normals {
                add(normals, target.normals)?;
            }
        }
        Ok(())
    }

    /// The vertices of each triangle, glTF 2.0 section 3.7.2.1.
    fn triangles(&self, mode: Mode) -> Result<Vec<[u32; 3]>, ImportError> {
        let n = self.n_vertices;
        let indices: Vec<u32> = match self.primitive.indices {
            Some(accessor) => {
                let key = format!("{}.indices", self.key);
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
            (Mode::TriangleStrip, _) => windows
                .map(|(i, t)| if i % 2 == 0 { [t[0], t[1], t[2]] } else { [t[0], t[2], t[1]] })
                .collect(),
            (Mode::TriangleFan, [hub, rim @ ..]) => rim.windows(2).map(|r| [r[0], r[1], *hub]).collect(),
            _ => indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect(),
        })
    }

    /// Vertex tangents; without normals they do not count, glTF 2.0 section 3.7.2.1.
    fn tangents(&self, has_normals: bool) -> Result<Option<Vec<Vec4>>, ImportError> {
        let given = if has_normals { self.read::<4>(Semantic::Tangents, "TANGENT")? } else { None };
        Ok(given.map(|list| list.into_iter().map(|t| Vec4::from_array(t.map(|v| v as f32))).collect()))
    }

    /// Joints of each vertex with their positive weights, of all sets; empty without any.
    fn joint_weights(&self) -> Result<Vec<Vec<(usize, f32)>>, ImportError> {
        let mut out = Vec::new();
        for set in 0.. {
            let has = |semantic| self.primitive.attributes.contains_key(&Checked::Valid(semantic));
            if !has(Semantic::Joints(set)) || !has(Semantic::Weights(set)) {
                break;
            }
            let joints = self.read::<4>(Semantic::Joints(set), "JOINTS")?.unwrap_or_default();
            let weights = self.read::<4>(Semantic::Weights(set), "WEIGHTS")?.unwrap_or_default();
            out.resize(self.n_vertices, Vec::new());
            for ((vertex, joints), weights) in out.iter_mut().zip(joints).zip(weights) {
                let used = joints.iter().zip(weights).filter(|(_, w)| *w > 0.0);
                vertex.extend(used.map(|(&j, w)| (j as usize, w as f32)));
            }
        }
        Ok(out)
    }

    /// Whether all vertex colours are white, as without any.
    fn is_white(&self) -> Result<bool, ImportError> {
        let Some(&accessor) = self.primitive.attributes.get(&Checked::Valid(Semantic::Colors(0))) else {
            return Ok(true);
        };
        Ok(match self.file.elements::<3>(self.key, accessor) {
            Ok(colors) => colors.iter().flatten().all(|v| *v >= WHITE),
            Err(_) => self.file.elements::<4>(self.key, accessor)?.iter().flatten().all(|v| *v >= WHITE),
        })
    }
}

/// The triangles of a file as they are read and placed.
pub struct Geometry<'a> {
    file: &'a File,
    /// Materials that the triangles use.
    pub materials: Materials<'a>,
    /// Triangles in world space.
    pub mesh: Mesh,
    /// Triangles that cannot be rendered, but for those without area of strips and fans.
    pub left_out: LeftOut,
}

impl<'a> Geometry<'a> {
    /// The geometry of `file`, empty before primitives are placed.
    pub fn new(file: &'a File) -> Self {
        Self { file, materials: Materials::new(file), mesh: Mesh::default(), left_out: LeftOut::default() }
    }

    /// Reads a primitive and its material; `None` when it has no triangles. `weights` are those of its
    /// morph targets.
    ///
    /// # Errors
    /// When an accessor, the material or an image of it cannot be read.
    pub fn read_primitive(
        &mut self,
        key: &str,
        primitive: &Primitive,
        weights: &[f32],
        warnings: &mut Warnings,
    ) -> Result<Option<PrimitiveMesh>, ImportError> {
        let file = self.file;
        let Checked::Valid(mode) = primitive.mode else {
            return Err(file.error(format!("{key}.mode"), "must be 0 to 6"));
        };
        if matches!(mode, Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip) {
            warnings.add(format!("{}: points and lines are left out", file.path.display()));
            return Ok(None);
        }
        let Some(mut positions) = read_positions(file, key, primitive)? else { return Ok(None) };
        let attributes = Attributes { file, key, primitive, n_vertices: positions.len() };
        let mut normals = attributes.read(Semantic::Normals, "NORMAL")?.map(vectors);
        attributes.morph(weights, &mut positions, normals.as_mut())?;
        let tangents = attributes.tangents(normals.is_some())?;
        let triangles = attributes.triangles(mode)?;
        if triangles.is_empty() {
            return Ok(None);
        }
        let material = self.materials.id(&format!("{key}.material"), primitive.material, warnings)?;
        let uvs = self.uvs(&attributes, material, warnings)?;
        let joint_weights = attributes.joint_weights()?;
        if !attributes.is_white()? {
            warnings.add(format!("{}: vertex colours are ignored", file.path.display()));
        }
        let is_strip = mode != Mode::Triangles;
        Ok(Some(PrimitiveMesh {
            material,
            positions,
            normals,
            tangents,
            uvs,
            triangles,
            joint_weights,
            is_strip,
        }))
    }

    /// Texture coordinates where the material's images lie, v up; zero where it has none.
    fn uvs(
        &self,
        attributes: &Attributes,
        material: u32,
        warnings: &mut Warnings,
    ) -> Result<Vec<Vec2>, ImportError> {
        let zero = || vec![Vec2::ZERO; attributes.n_vertices];
        let Some(mapping) = self.materials.uv_mapping(material) else { return Ok(zero()) };
        let name = &self.materials.list[material as usize].0;
        let Some(uvs) = attributes.read::<2>(Semantic::TexCoords(mapping.set), "TEXCOORD")? else {
            let message = format!("a mesh lacks TEXCOORD_{}, which its images need", mapping.set);
            warnings.about("material", name, message);
            return Ok(zero());
        };
        Ok(mapped(&mapping, uvs))
    }

    /// Adds a primitive to the mesh as part `part`.
    ///
    /// # Errors
    /// When there are too many vertices, or the skin does not fit the primitive.
    pub fn place(
        &mut self,
        key: &str,
        primitive: &PrimitiveMesh,
        pose: &Pose,
        part: u32,
    ) -> Result<(), ImportError> {
        let n = primitive.positions.len();
        let most = self.mesh.positions.len() + n + 3 * primitive.triangles.len();
        if u32::try_from(most).is_err() {
            let message = "the scene has more vertices than this program can number, 2³²";
            return Err(self.file.error(key, message));
        }
        self.file.budget.place(primitive.triangles.len()).map_err(|e| self.file.error(key, e))?;
        let worlds = primitive.worlds(self.file, key, pose)?;
        let world = |i: usize| &worlds[i.min(worlds.len() - 1)];
        let positions: Vec<Vec3> =
            primitive.positions.iter().enumerate().map(|(i, p)| world(i).transform_point3(*p)).collect();
        let flips = worlds.first().is_some_and(|w| Mat3::from_mat4(*w).determinant() < 0.0);
        // Absent normals are zero until their faces are known.
        let mut normals = vec![Vec3::ZERO; n];
        if let Some(given) = &primitive.normals {
            for (i, (to, normal)) in normals.iter_mut().zip(given).enumerate() {
                let moved = normal_matrix(world(i)) * *normal;
                *to = moved.try_normalize().unwrap_or(Vec3::ZERO);
            }
        }
        let mut triangles: Vec<[usize; 3]> = Vec::with_capacity(primitive.triangles.len());
        let mut left_out = LeftOut::default();
        for &[a, b, c] in &primitive.triangles {
            let corners = if flips { [a, c, b] } else { [a, b, c] }.map(|i| i as usize);
            if left_out.keeps(corners.map(|i| positions[i])) {
                triangles.push(corners);
            }
        }
        if primitive.is_strip {
            left_out.n_degenerate = 0;
        }
        self.left_out.add(left_out, || format!("`{key}`"));
        let mesh = &mut self.mesh;
        // Primitives may share vertices of which each uses some: only those are kept.
        let mut ids = vec![None; n];
        triangles.iter().flatten().filter(|&&i| normals[i] != Vec3::ZERO).for_each(|&i| ids[i] = Some(0));
        for (i, id) in ids.iter_mut().enumerate().filter(|(_, id)| id.is_some()) {
            *id = Some(mesh.positions.len() as u32);
            mesh.positions.push(positions[i]);
            mesh.normals.push(normals[i]);
            mesh.uvs.push(primitive.uvs[i]);
            if let Some(tangents) = &primitive.tangents {
                // The vertices before have none.
                mesh.tangents.resize(mesh.positions.len() - 1, Vec4::ZERO);
                mesh.tangents.push(moved_tangent(world(i), tangents[i]));
            }
        }
        for corners in triangles {
            let face = face_normal(corners.map(|i| positions[i])).normalize_or(Vec3::Y);
            let triangle = corners.map(|i| {
                if let Some(id) = ids[i] {
                    return id;
                }
                mesh.positions.push(positions[i]);
                mesh.normals.push(face);
                mesh.uvs.push(primitive.uvs[i]);
                (mesh.positions.len() - 1) as u32
            });
            mesh.indices.push(triangle);
            mesh.materials.push(primitive.material);
            mesh.objects.push(part);
        }
        Ok(())
    }
}

/// A tangent with its handedness in world space, where a mirrored mesh has the other one; zero if it has
/// no direction.
fn moved_tangent(world: &Mat4, t: Vec4) -> Vec4 {
    let mirror = Mat3::from_mat4(*world).determinant().signum();
    let along = world.transform_vector3(t.truncate()).try_normalize();
    along.filter(|_| t.w.is_finite()).map_or(Vec4::ZERO, |v| v.extend(t.w.signum() * mirror))
}

/// Vertex positions; `None` if the primitive has none.
fn read_positions(file: &File, key: &str, primitive: &Primitive) -> Result<Option<Vec<Vec3>>, ImportError> {
    let Some(&accessor) = primitive.attributes.get(&Checked::Valid(Semantic::Positions)) else {
        return Ok(None);
    };
    let is_draco = primitive.extensions.as_ref().is_some_and(|e| e.others.contains_key(DRACO));
    if is_draco && file.get(key, accessor)?.buffer_view.is_none() {
        return Err(file.error(key, format!("is compressed by {DRACO}, {}", not_read(DRACO))));
    }
    Ok(Some(vectors(file.elements(key, accessor)?)))
}

/// Texture coordinates of a file, v down, as those of a material's images, v up.
fn mapped(mapping: &UvMapping, uvs: Vec<[f64; 2]>) -> Vec<Vec2> {
    let mapped = uvs.into_iter().map(|uv| {
        let uv = mapping.apply(Vec2::from_array(uv.map(|v| v as f32)));
        if uv.is_finite() { uv } else { Vec2::ZERO }
    });
    mapped.map(|uv| Vec2::new(uv.x, 1.0 - uv.y)).collect()
}

impl PrimitiveMesh {
    /// Transformations of the vertices to world space: one for all, or one each under a skin.
    fn worlds(&self, file: &File, key: &str, pose: &Pose) -> Result<Vec<Mat4>, ImportError> {
        let joints = match pose {
            Pose::Rigid(world) => return Ok(vec![*world]),
            Pose::Skinned(_) if self.joint_weights.is_empty() => {
                return Err(file.error(format!("{key}.attributes"), "a skin needs JOINTS_0 and WEIGHTS_0"));
            }
            Pose::Skinned(joints) => joints,
        };
        let blend = |vertex: &Vec<(usize, f32)>| {
            let total: f32 = vertex.iter().map(|b| b.1).sum();
            let mut sum = Mat4::ZERO;
            for &(joint, weight) in vertex {
                let matrix = joints.get(joint).ok_or_else(|| {
                    let message = format!("joint {joint} does not exist: the skin has {}", joints.len());
                    file.error(format!("{key}.attributes.JOINTS_0"), message)
                })?;
                sum += *matrix * (weight / total);
            }
            Ok(if vertex.is_empty() { Mat4::IDENTITY } else { sum })
        };
        self.joint_weights.iter().map(blend).collect()
    }
}

/// Matrix that transforms normals: the cofactors, which also exist where the inverse does not, with
/// the sign of the inverse transpose.
fn normal_matrix(world: &Mat4) -> Mat3 {
    let m = Mat3::from_mat4(*world);
    let cofactors =
        Mat3::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis));
    if m.determinant() < 0.0 { -cofactors } else { cofactors }
}
