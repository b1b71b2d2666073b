//! Wavefront OBJ and MTL, through `tobj`.
//!
//! What every key of an MTL means is listed in `docs/formats.md`; [`mtl`] reads it line by line and
//! [`mtl_params`] gives it that meaning.

use std::{
    collections::{HashMap, HashSet},
    path::Path,
};

use glam::{DVec2, DVec3, Vec2, Vec3};

use super::{
    error::ImportError,
    imported::{Imported, Part},
    left_out::LeftOut,
    mtl::{self, MtlMaterial, Origin},
    mtl_params::{self, grey},
    origin::Spread,
    sheets,
    warnings::Warnings,
    wavefront::{self, NormalizedObj, name_before_comment},
};
use crate::{
    files::{
        reach::{MAX_SCENE_BYTES, MAX_TEXT_BYTES, Reach, ReachError},
        text::decode,
    },
    scene::{
        material::MaterialParams,
        mesh::{Mesh, smooth_normals},
    },
};

/// Name of the material of faces without one.
const NO_NAME: &str = "(none)";

/// Reads an OBJ with its MTL and textures.
///
/// Edges between faces without normals are smooth where they bend by at most `crease`, radians. A
/// missing MTL is a warning: its materials are grey, but keep their names.
///
/// # Errors
/// When a file cannot be read, a line of the OBJ or an MTL is wrong, a texture cannot be decoded, or
/// no triangle of positive area is left.
pub fn load(path: &Path, crease: f32) -> Result<Imported, ImportError> {
    load_within(path, crease, &Reach::anywhere())
}

/// As [`load`], reading no file out of `reach`.
///
/// # Errors
/// Every error of [`load`]; also when the OBJ or an MTL names a file out of reach.
pub fn load_within(path: &Path, crease: f32, reach: &Reach) -> Result<Imported, ImportError> {
    let bytes = reach.read(path, MAX_SCENE_BYTES).map_err(ImportError::reading)?;
    let text = decode(&bytes);
    let is_of_blender = mtl::origin(&text) != Origin::Other;
    let plain = wavefront::normalize(&text).map_err(|e| ImportError::at(path, e))?;
    let mut warnings = Warnings::default();
    report(path, &plain, &mut warnings);
    let (library, ids) = material_library(path, &plain, reach, &mut warnings)?;
    let names = || ids.iter().enumerate().map(|(i, &m)| (i.to_string(), m)).collect();
    // `tobj` need only know the names.
    let named = |m: &MtlMaterial| tobj::Material { name: m.name.clone(), ..Default::default() };
    let all = || library.iter().map(named).collect::<Vec<_>>();
    let options = tobj::LoadOptions { single_index: true, triangulate: true, ..Default::default() };
    let mut reader = mtl_params::Reader::new(path, reach.clone(), warnings);
    let (models, materials) = rayon::join(
        || tobj::load_obj_buf(&mut plain.text.as_bytes(), &options, |_| Ok((all(), names()))),
        || reader.read(&library),
    );
    let (models, _) = models.map_err(|source| ImportError::Obj { path: path.into(), source })?;
    let mut materials = materials?;
    let mut warnings = reader.warnings;
    let default_material = materials.len() as u32;
    let mut raw = Mesh::default();
    let place = plain.out_of_range.map(|(line, vertex)| format!("in line {line}, vertex {vertex}"));
    let mut left_out = LeftOut { n_degenerate: plain.n_short, place, ..LeftOut::default() };
    let mut spread = Spread::default();
    for model in &models {
        spread.extend(model.mesh.positions.chunks_exact(3).map(DVec3::from_slice));
    }
    let origin = spread.origin();
    for model in &models {
        // Named so by `wavefront`; a file without faces has one model of another name.
        let Ok(part) = model.name.parse() else { continue };
        let material = model.mesh.material_id.map_or(default_material, |m| m as u32);
        append(&mut raw, &model.mesh, [part, material], origin, &mut left_out);
    }
    left_out.report(path, &mut warnings);
    if raw.materials.contains(&default_material) {
        materials.push((NO_NAME.into(), grey()));
    }
    if raw.indices.is_empty() {
        return Err(ImportError::NoTriangles { path: path.to_path_buf(), left_out });
    }
    let mut mesh = with_normals(&raw, &plain.parts, crease);
    let tinted = |m: usize, p: &mut MaterialParams| mtl_params::tint_sheet(&library[m], p);
    sheets::make_thin(&mut mesh, &mut materials, |m| m < library.len(), tinted, &mut warnings);
    for (m, (name, params)) in library.iter().zip(&mut materials) {
        if let Some(lost) = mtl_params::tint_body(m, params) {
            warnings.about("material", name, lost);
        }
    }
    let warnings = warnings.into_lines();
    Ok(Imported {
        mesh,
        origin,
        parts: plain.parts,
        materials,
        warnings,
        is_of_blender,
        ..Imported::default()
    })
}

/// Warns of what the text of an OBJ has that is left out.
fn report(path: &Path, plain: &NormalizedObj, warnings: &mut Warnings) {
    let file = path.display();
    for (line, keyword) in &plain.unsupported {
        warnings.add(format!("{file}:{line}: `{keyword}` is not supported and left out"));
    }
    for (line, what) in &plain.absent {
        warnings.add(format!("{file}:{line}: faces name {what}s, of which the file has none: left out"));
    }
    if let Some(line) = plain.colored {
        warnings.add(format!("{file}:{line}: vertex colours are ignored"));
    }
}

/// Materials by name, the last definition of a name.
#[derive(Default)]
struct Library {
    materials: Vec<MtlMaterial>,
    ids: HashMap<String, usize>,
}

impl Library {
    /// The library of definitions in their order.
    fn new(definitions: Vec<MtlMaterial>) -> Self {
        let last: HashMap<String, usize> =
            definitions.iter().enumerate().map(|(i, m)| (m.name.clone(), i)).collect();
        let mut library = Self::default();
        for (i, m) in definitions.into_iter().enumerate() {
            if last[&m.name] == i {
                library.put(m);
            }
        }
        library
    }

    /// Adds a material of a new name; returns its index.
    fn put(&mut self, m: MtlMaterial) -> usize {
        let id = self.materials.len();
        self.ids.insert(m.name.clone(), id);
        self.materials.push(m);
        id
    }

    /// Names without the comments behind them, where no `usemtl` has such a comment in its name and no
    /// material the name alone.
    fn cut_comments(&mut self, used: &[(usize, String)]) {
        let used: HashSet<&str> = used.iter().map(|(_, name)| name.as_str()).collect();
        for (id, m) in self.materials.iter_mut().enumerate() {
            let Some(name) = name_before_comment(&m.name).filter(|_| !used.contains(m.name.as_str())) else {
                continue;
            };
            if !self.ids.contains_key(name) {
                self.ids.remove(&m.name);
                m.name = name.to_owned();
                self.ids.insert(m.name.clone(), id);
            }
        }
    }

    /// The material that a `usemtl` names, a comment behind its name left out if need be.
    fn find(&self, name: &str) -> Option<usize> {
        let cut = || name_before_comment(name).and_then(|name| self.ids.get(name));
        self.ids.get(name).or_else(cut).copied()
    }
}

/// Reads all material libraries, and adds a grey material for every name that none defines. Returns the
/// materials, and the index of the one that each of [`NormalizedObj::materials`] is.
fn material_library(
    path: &Path,
    plain: &NormalizedObj,
    reach: &Reach,
    warnings: &mut Warnings,
) -> Result<(Vec<MtlMaterial>, Vec<usize>), ImportError> {
    let dir = path.parent().unwrap_or(Path::new(""));
    let mut definitions: Vec<MtlMaterial> = Vec::new();
    let mut is_missing = false;
    for (line, names) in &plain.libraries {
        let is_there = |name: &str| reach.has_file(&dir.join(name));
        let unquoted = |names: &str| names.trim_matches('"').replace('\\', "/");
        let names = name_before_comment(names).filter(|_| !is_there(&unquoted(names))).unwrap_or(names);
        // One name with spaces, or several names.
        let whole = unquoted(names);
        let words: Vec<String> = whole.split_whitespace().map(str::to_owned).collect();
        let is_several = words.iter().any(|w| is_there(w)) && !is_there(&whole);
        let files = if is_several { words } else { vec![whole] };
        let files = files.iter().filter(|f| !f.is_empty());
        for file in files.map(|f| dir.join(f)) {
            let bytes = match reach.read(&file, MAX_TEXT_BYTES) {
                Ok(bytes) => bytes,
                Err(ReachError::Io { source, .. }) => {
                    is_missing = true;
                    let (obj, mtl) = (path.display(), file.display());
                    warnings.add(format!("{obj}:{line}: material library {mtl}: {source}; using grey"));
                    continue;
                }
                Err(source) => {
                    return Err(ImportError::Reach { path: path.into(), key: "mtllib".into(), source });
                }
            };
            let directory = file.parent().unwrap_or(Path::new(""));
            let (materials, notes) =
                mtl::parse(&decode(&bytes), directory).map_err(|e| ImportError::at(&file, e))?;
            notes.into_iter().for_each(|n| warnings.add(format!("{}: {n}", file.display())));
            definitions.extend(materials);
        }
    }
    let mut library = Library::new(definitions);
    library.cut_comments(&plain.materials);
    let mut undefined: Vec<&(usize, String)> = Vec::new();
    let mut ids = Vec::with_capacity(plain.materials.len());
    for used in &plain.materials {
        ids.push(library.find(&used.1).unwrap_or_else(|| {
            undefined.push(used);
            library.put(MtlMaterial { name: used.1.clone(), ..Default::default() })
        }));
    }
    if let (Some((line, first)), false) = (undefined.first(), is_missing) {
        let (obj, more) = (path.display(), undefined.len() - 1);
        let others = if more == 0 { String::new() } else { format!(" nor {more} more") };
        warnings.add(format!("{obj}:{line}: no library defines material `{first}`{others}; using grey"));
    }
    Ok((library.materials, ids))
}

/// Appends the triangles of a model of a part and a material relative to `origin`, with zero for absent normals,
/// but for those that cannot be rendered, which are counted.
fn append(
    mesh: &mut Mesh,
    m: &tobj::Mesh,
    [part, material]: [u32; 2],
    origin: DVec3,
    left_out: &mut LeftOut,
) {
    let base = mesh.positions.len() as u32;
    let relative = |p: &[f64]| (DVec3::from_slice(p) - origin).as_vec3();
    mesh.positions.extend(m.positions.chunks_exact(3).map(relative));
    let normals = m.normals.chunks_exact(3).map(|n| DVec3::from_slice(n).as_vec3());
    mesh.normals.extend(normals.map(Vec3::normalize_or_zero));
    let uvs = m.texcoords.chunks_exact(2).map(|uv| DVec2::from_slice(uv).as_vec2());
    mesh.uvs.extend(uvs.map(|uv| if uv.is_finite() { uv } else { Vec2::ZERO }));
    let before = mesh.indices.len();
    for t in m.indices.chunks_exact(3) {
        let t = [t[0], t[1], t[2]].map(|i| base + i);
        if left_out.keeps(t.map(|i| mesh.positions[i as usize])) {
            mesh.indices.push(t);
        }
    }
    let n = mesh.indices.len() - before;
    mesh.materials.extend(std::iter::repeat_n(material, n));
    mesh.objects.extend(std::iter::repeat_n(part, n));
}

/// The mesh with all normals, and without vertices that no triangle uses.
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
