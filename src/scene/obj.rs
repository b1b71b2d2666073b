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
//! Faces without a material, and materials that no library defines, are diffuse
//! grey of albedo 0.8. `Ke`, `d`, `Tr` and other maps are ignored with a warning.
//!
//! `Ks` decides only whether there is a coat: its strength follows from the IOR.

use std::{
    collections::HashMap,
    fs,
    path::{Path, PathBuf},
    sync::Arc,
};

use glam::{Vec2, Vec3};

use super::{
    builder::SceneError,
    imported::Imported,
    material::{MaterialParams, Model},
    mesh::{Mesh, face_normal, smooth_normals},
    texture::{Encoding, Texture},
    wavefront::{self, Part, PlainObj},
};
use crate::math::Rgb;

/// IOR of a coat or glass whose file does not say.
const DEFAULT_IOR: f32 = 1.5;
/// Roughness of a coat whose file does not say.
const DEFAULT_ROUGHNESS: f32 = 0.5;
/// Name of the material of faces without one.
const NO_NAME: &str = "(none)";
/// Albedo of faces without a material.
const DEFAULT_ALBEDO: f32 = 0.8;

/// Reads an OBJ with its MTL and textures. `crease` is in radians.
///
/// A missing MTL is a warning: its materials are grey, but keep their names.
///
/// # Errors
/// When the OBJ, an MTL or a texture cannot be understood, or no triangle is left.
pub fn load(path: &Path, crease: f32) -> Result<Imported, SceneError> {
    let bytes = fs::read(path).map_err(|source| SceneError::Read { path: path.into(), source })?;
    let plain =
        wavefront::plain_obj(&String::from_utf8_lossy(&bytes)).map_err(|e| SceneError::at(path, e))?;
    let mut warnings = Vec::new();
    for (line, keyword) in &plain.unsupported {
        warnings.push(format!("{}:{line}: `{keyword}` is not supported and left out", path.display()));
    }
    let library = material_library(path, &plain, &mut warnings)?;
    let names = || library.iter().enumerate().map(|(i, m)| (m.name.clone(), i)).collect();
    let options = tobj::LoadOptions { single_index: true, triangulate: true, ..Default::default() };
    let (models, _) =
        tobj::load_obj_buf(&mut plain.text.as_bytes(), &options, |_| Ok((library.clone(), names())))
            .map_err(|source| SceneError::Obj { path: path.into(), source })?;

    let dir = path.parent().unwrap_or(Path::new(""));
    let mut textures = HashMap::new();
    let mut materials = Vec::new();
    for m in &library {
        materials.push((m.name.clone(), material_params(m, dir, &mut textures, &mut warnings)?));
    }
    let default_material = materials.len() as u32;
    let mut raw = Mesh::default();
    let mut dropped = plain.n_short;
    for model in &models {
        // Named so by `wavefront`; a file without faces has one model of another name.
        let Ok(part) = model.name.parse() else { continue };
        let material = model.mesh.material_id.map_or(default_material, |m| m as u32);
        dropped += append(&mut raw, &model.mesh, part, material);
    }
    match dropped {
        0 => {}
        1 => warnings.push(format!("{}: left out 1 degenerate triangle", path.display())),
        n => warnings.push(format!("{}: left out {n} degenerate triangles", path.display())),
    }
    if raw.materials.contains(&default_material) {
        materials.push((NO_NAME.into(), grey()));
    }
    if raw.indices.is_empty() {
        return Err(SceneError::NoTriangles { path: path.to_path_buf() });
    }
    let mesh = with_normals(&raw, &plain.parts, crease);
    Ok(Imported { mesh, parts: plain.parts, materials, warnings, ..Imported::default() })
}

/// Reads all material libraries, and adds a grey material for every name that none defines.
fn material_library(
    path: &Path,
    plain: &PlainObj,
    warnings: &mut Vec<String>,
) -> Result<Vec<tobj::Material>, SceneError> {
    let dir = path.parent().unwrap_or(Path::new(""));
    let mut library: Vec<tobj::Material> = Vec::new();
    let mut is_missing = false;
    for (line, names) in &plain.libraries {
        // One name with spaces, or several names.
        let whole = names.trim_matches('"').replace('\\', "/");
        let files = if dir.join(&whole).is_file() {
            vec![whole]
        } else {
            whole.split_whitespace().map(str::to_owned).collect()
        };
        for file in files.iter().map(|f| dir.join(f)) {
            let bytes = match fs::read(&file) {
                Ok(bytes) => bytes,
                Err(e) => {
                    is_missing = true;
                    let (obj, mtl) = (path.display(), file.display());
                    warnings.push(format!("{obj}:{line}: material library {mtl}: {e}; using grey"));
                    continue;
                }
            };
            let (text, notes) = wavefront::plain_mtl(&String::from_utf8_lossy(&bytes))
                .map_err(|e| SceneError::at(&file, e))?;
            warnings.extend(notes.into_iter().map(|n| format!("{}: {n}", file.display())));
            let (materials, _) = tobj::load_mtl_buf(&mut text.as_bytes())
                .map_err(|source| SceneError::Obj { path: file.clone(), source })?;
            for m in materials {
                // The last definition of a name counts.
                library.retain(|known| known.name != m.name);
                library.push(m);
            }
        }
    }
    for (line, name) in &plain.materials {
        if !library.iter().any(|m| m.name == *name) {
            if !is_missing {
                let obj = path.display();
                warnings.push(format!("{obj}:{line}: no library defines material `{name}`; using grey"));
            }
            library.push(tobj::Material { name: name.clone(), ..Default::default() });
        }
    }
    Ok(library)
}

fn grey() -> MaterialParams {
    MaterialParams { base_color: Rgb::splat(DEFAULT_ALBEDO), ..MaterialParams::default() }
}

/// Appends a model, whose absent normals are zero; returns how many triangles
/// were degenerate and left out.
fn append(mesh: &mut Mesh, m: &tobj::Mesh, part: u32, material: u32) -> usize {
    let base = mesh.positions.len() as u32;
    mesh.positions.extend(m.positions.chunks_exact(3).map(Vec3::from_slice));
    mesh.normals.extend(m.normals.chunks_exact(3).map(|n| Vec3::from_slice(n).normalize_or_zero()));
    let uvs = m.texcoords.chunks_exact(2).map(Vec2::from_slice);
    mesh.uvs.extend(uvs.map(|uv| if uv.is_finite() { uv } else { Vec2::ZERO }));
    let before = mesh.indices.len();
    for t in m.indices.chunks_exact(3) {
        let t = [t[0], t[1], t[2]].map(|i| base + i);
        let corners = t.map(|i| mesh.positions[i as usize]);
        let n = face_normal(corners);
        if corners.iter().all(|c| c.is_finite()) && n.is_finite() && n.length_squared() > 0.0 {
            mesh.indices.push(t);
        }
    }
    let n = mesh.indices.len() - before;
    mesh.materials.extend(std::iter::repeat_n(material, n));
    mesh.objects.extend(std::iter::repeat_n(part, n));
    m.indices.len() / 3 - n
}

/// The mesh with every normal, and without vertices that no triangle uses.
///
/// Absent normals are smooth within an object, whatever its materials and
/// groups; in a file without objects, within a group.
fn with_normals(raw: &Mesh, parts: &[Part], crease: f32) -> Mesh {
    let mut smooth: HashMap<usize, [Vec3; 3]> = HashMap::new();
    let mut bodies: HashMap<Option<&str>, Vec<usize>> = HashMap::new();
    for (t, corners) in raw.indices.iter().enumerate() {
        if corners.iter().any(|&i| raw.normals[i as usize] == Vec3::ZERO) {
            bodies.entry(parts[raw.objects[t] as usize].names().next()).or_default().push(t);
        }
    }
    for triangles in bodies.values() {
        let indices: Vec<[u32; 3]> = triangles.iter().map(|&t| raw.indices[t]).collect();
        smooth.extend(triangles.iter().copied().zip(smooth_normals(&raw.positions, &indices, crease)));
    }
    let mut out = Mesh { materials: raw.materials.clone(), objects: raw.objects.clone(), ..Mesh::default() };
    let mut moved: Vec<Option<u32>> = vec![None; raw.positions.len()];
    for (t, corners) in raw.indices.iter().enumerate() {
        let mut k = 0;
        let triangle = corners.map(|i| {
            let i = i as usize;
            let given = raw.normals[i];
            let found = smooth.get(&t).map(|n| n[k]).filter(|_| given == Vec3::ZERO);
            k += 1;
            if let (None, Some(to)) = (found, moved[i]) {
                return to;
            }
            let to = out.positions.len() as u32;
            out.positions.push(raw.positions[i]);
            out.normals.push(found.unwrap_or(given));
            out.uvs.push(raw.uvs[i]);
            if found.is_none() {
                moved[i] = Some(to);
            }
            to
        });
        out.indices.push(triangle);
    }
    out
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
                let t = Arc::new(Texture::load(
                    &path,
                    Encoding::Srgb,
                    &format!("`map_Kd` of material `{}`", m.name),
                )?);
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
    Ok(MaterialParams { model, base_color, texture, roughness, ior, ..MaterialParams::default() })
}
