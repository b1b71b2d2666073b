//! Wavefront OBJ and MTL, through `tobj`.
//!
//! # Mapping of MTL
//!
//! | MTL | meaning |
//! | --- | --- |
//! | `Kd`, `map_Kd` | base colour: linear Rec.709, times the sRGB-decoded image |
//! | `Pm` ≥ 0.5 | `conductor` with the base colour as reflectance at normal incidence |
//! | `illum` 4, 6, 7, 9 | `dielectric` (glass) of IOR `Ni` |
//! | `illum` 3 and black `Kd` | `conductor` with reflectance `Ks` |
//! | `Ks` > 0 | `plastic`: the base colour under a coat of IOR `Ni` (1.5 when absent or 1) |
//! | otherwise | `diffuse` |
//! | `Pr` | roughness; the GGX slope is `Pr²` |
//! | `Ns` | without `Pr`: slope `√(2/(Ns+2))` |
//!
//! `Ks` decides only whether there is a coat: its strength follows from the IOR.

use std::{
    collections::HashMap,
    path::{Path, PathBuf},
    sync::Arc,
};

use glam::{Vec2, Vec3};

use super::{
    builder::SceneError,
    material::{MaterialParams, Model},
    mesh::{Mesh, face_normal, smooth_normals},
    texture::Texture,
};
use crate::math::Rgb;

/// IOR of a coat or glass whose file does not say.
const DEFAULT_IOR: f32 = 1.5;
/// Roughness of a coat whose file does not say.
const DEFAULT_ROUGHNESS: f32 = 0.5;
/// Albedo of faces without a material.
const DEFAULT_ALBEDO: f32 = 0.8;

/// What an OBJ and its MTL hold.
#[derive(Debug)]
pub struct ObjScene {
    /// Triangles; their normals are final.
    pub mesh: Mesh,
    /// Object names, indexed by [`Mesh::objects`].
    pub objects: Vec<String>,
    /// Material names and parameters, indexed by [`Mesh::materials`].
    pub materials: Vec<(String, MaterialParams)>,
    /// Facts that a user should hear of.
    pub warnings: Vec<String>,
}

/// Reads an OBJ with its MTL and textures. `crease` is in radians.
///
/// # Errors
/// When the OBJ or a texture cannot be read, or no triangle is left.
pub fn load(path: &Path, crease: f32) -> Result<ObjScene, SceneError> {
    let options = tobj::LoadOptions {
        single_index: true,
        triangulate: true,
        ignore_points: true,
        ignore_lines: true,
        ..Default::default()
    };
    let (models, materials) = tobj::load_obj(path, &options)
        .map_err(|source| SceneError::Obj { path: path.to_path_buf(), source })?;
    let mut warnings = Vec::new();
    let materials = materials.unwrap_or_else(|e| {
        warnings.push(format!("{}: material library: {e}; using grey", path.display()));
        Vec::new()
    });
    let mut out = ObjScene { mesh: Mesh::default(), objects: Vec::new(), materials: Vec::new(), warnings };
    let dir = path.parent().unwrap_or(Path::new(""));
    let mut textures = HashMap::new();
    for m in &materials {
        let params = material_params(m, dir, &mut textures, &mut out.warnings)?;
        out.materials.push((m.name.clone(), params));
    }
    let default_material = out.materials.len() as u32;
    let mut dropped = 0_usize;
    for model in &models {
        let object = out.objects.iter().position(|o| *o == model.name).unwrap_or_else(|| {
            out.objects.push(model.name.clone());
            out.objects.len() - 1
        }) as u32;
        let material = model.mesh.material_id.map_or(default_material, |m| m as u32);
        dropped += append(&mut out.mesh, &model.mesh, object, material, crease);
    }
    if dropped > 0 {
        out.warnings.push(format!("{}: left out {dropped} degenerate triangles", path.display()));
    }
    if out.mesh.materials.contains(&default_material) {
        let grey = MaterialParams {
            model: Model::Diffuse,
            base_color: Rgb::splat(DEFAULT_ALBEDO),
            texture: None,
            roughness: DEFAULT_ROUGHNESS,
            ior: DEFAULT_IOR,
        };
        out.materials.push(("(none)".into(), grey));
    }
    if out.mesh.indices.is_empty() {
        return Err(SceneError::NoTriangles { path: path.to_path_buf() });
    }
    Ok(out)
}

/// Appends a model; returns how many triangles were degenerate and left out.
fn append(mesh: &mut Mesh, m: &tobj::Mesh, object: u32, material: u32, crease: f32) -> usize {
    let vec3s = |v: &[f32]| -> Vec<Vec3> { v.chunks_exact(3).map(Vec3::from_slice).collect() };
    let positions = vec3s(&m.positions);
    let normals = vec3s(&m.normals);
    let uvs: Vec<Vec2> = m.texcoords.chunks_exact(2).map(Vec2::from_slice).collect();
    let n_all = m.indices.len() / 3;
    let triangles: Vec<[u32; 3]> = m
        .indices
        .chunks_exact(3)
        .map(|t| [t[0], t[1], t[2]])
        .filter(|t| {
            let corners = t.map(|i| positions[i as usize]);
            let n = face_normal(corners);
            corners.iter().all(|c| c.is_finite()) && n.is_finite() && n.length_squared() > 0.0
        })
        .collect();
    let uv = |i: u32| uvs.get(i as usize).copied().filter(|u| u.is_finite()).unwrap_or(Vec2::ZERO);
    let base = mesh.positions.len() as u32;
    if normals.len() == positions.len() {
        mesh.positions.extend(positions.iter().map(|p| if p.is_finite() { *p } else { Vec3::ZERO }));
        mesh.normals.extend(normals.iter().map(|n| n.normalize_or_zero()));
        mesh.uvs.extend((0..positions.len() as u32).map(uv));
        mesh.indices.extend(triangles.iter().map(|t| t.map(|i| base + i)));
    } else {
        for (t, n) in triangles.iter().zip(smooth_normals(&positions, &triangles, crease)) {
            let first = mesh.positions.len() as u32;
            mesh.positions.extend(t.map(|i| positions[i as usize]));
            mesh.normals.extend(n);
            mesh.uvs.extend(t.map(uv));
            mesh.indices.push([first, first + 1, first + 2]);
        }
    }
    mesh.materials.extend(std::iter::repeat_n(material, triangles.len()));
    mesh.objects.extend(std::iter::repeat_n(object, triangles.len()));
    n_all - triangles.len()
}

fn material_params(
    m: &tobj::Material,
    dir: &Path,
    textures: &mut HashMap<PathBuf, Arc<Texture>>,
    warnings: &mut Vec<String>,
) -> Result<MaterialParams, SceneError> {
    let number =
        |key: &str| m.unknown_param.get(key).and_then(|v| v.split_whitespace().next()?.parse::<f32>().ok());
    let clamp = |key: &str, c: [f32; 3], warnings: &mut Vec<String>| {
        let c = Rgb::from_array(c);
        let clamped = c.clamp(Rgb::ZERO, Rgb::ONE);
        if clamped != c {
            warnings.push(format!("material `{}`: {key} {c} is outside [0, 1] and was clamped", m.name));
        }
        clamped
    };
    let specular = clamp("Ks", m.specular.unwrap_or_default(), warnings);
    let mut base_color = clamp("Kd", m.diffuse.unwrap_or([DEFAULT_ALBEDO; 3]), warnings);
    let texture = match &m.diffuse_texture {
        None => None,
        Some(name) => {
            let path = dir.join(name.replace('\\', "/"));
            if let Some(t) = textures.get(&path) {
                Some(t.clone())
            } else {
                let t = Arc::new(Texture::load(&path)?);
                textures.insert(path, t.clone());
                Some(t)
            }
        }
    };
    let illum = m.illumination_model.unwrap_or(2);
    let model = if number("Pm").is_some_and(|v| v >= 0.5) {
        Model::Conductor
    } else if matches!(illum, 4 | 6 | 7 | 9) {
        Model::Dielectric
    } else if illum == 3 && base_color.max_element() == 0.0 && specular.max_element() > 0.0 {
        base_color = specular;
        Model::Conductor
    } else if specular.max_element() > 0.0 {
        Model::Plastic
    } else {
        Model::Diffuse
    };
    let slope_from_ns = |ns: f32| (2.0 / (ns.max(0.0) + 2.0)).sqrt();
    let roughness = match (number("Pr"), m.shininess, model) {
        (Some(pr), _, _) => pr.clamp(0.0, 1.0),
        (None, _, Model::Dielectric) => 0.0,
        (None, Some(ns), _) => slope_from_ns(ns).sqrt(),
        (None, None, _) => DEFAULT_ROUGHNESS,
    };
    let ior = m.optical_density.filter(|&n| n > 1.0).unwrap_or(DEFAULT_IOR);
    Ok(MaterialParams { model, base_color, texture, roughness, ior })
}
