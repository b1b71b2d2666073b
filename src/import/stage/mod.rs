//! Staging: camera, backdrop and lights for a scene that comes without.
//!
//! | what | how |
//! | --- | --- |
//! | main object | without a floor everything; on one, or in a room, the largest group of touching objects |
//! | unit of an OBJ | metres up to a size of 20, centimetres up to 1000, millimetres beyond |
//! | camera | a normal lens, three-quarter view from the right of +z, or from where the scene's own backdrop fills the picture, looking a little down, headroom |
//! | backdrop | floor, cove and wall, if there is no floor |
//! | lights | key, fill and rim, by the size of the main object |
//!
//! The result is the text of a sidecar: what is staged in memory is read as a user's would be.

mod frame;
mod obstacles;
mod plan;
mod rig;
mod setting;
mod subject;
mod text;

use glam::Vec3;

use self::{
    frame::View,
    obstacles::Obstacles,
    plan::{MainObject, Plan},
    subject::Subject,
};
use super::{
    axes::{self, UpAxis},
    imported::{Imported, ImportedCamera},
    sidecar::DEFAULT_FILM,
};
use crate::{
    embree::EmbreeError,
    math::{Bounds, Rgb},
    scene::{Mesh, material::MaterialParams},
};

/// Azimuth from which a subject is seen, degrees to the right of +z: a three-quarter view shows front
/// and side of what faces +z, as glTF models do.
const AZIMUTH: f32 = 30.0;
/// Other azimuths, tried in this order where the subject is hidden or its backdrop does not fill the picture:
/// mirrored and frontal first, then away from the front in steps of 30°, about the width of the picture (34°).
const OTHER_AZIMUTHS: [f32; 13] =
    [-30.0, 15.0, -15.0, 0.0, 60.0, -60.0, 90.0, -90.0, 120.0, -120.0, 150.0, -150.0, 180.0];
/// Least share of the subject that the camera must see: five standard errors of the estimate below all of
/// it, so that only a real obstacle moves the camera.
const MIN_VISIBLE: f32 = 0.9;
/// Least share of the picture that a backdrop or a room must fill for a view to be preferred: all but a corner.
const MIN_FRAMED: f32 = 0.98;
/// Distance of the camera over that of the obstacle behind it, both from the subject: a twentieth keeps
/// the camera clear of it, more only widens the lens.
const CLEARANCE: f32 = 0.95;
/// Largest extent of a subject that is taken to be in metres: cars and small houses are below it; in
/// centimetres, what is larger than 0.2 m is above.
const MAX_METRES: f32 = 20.0;
/// Largest extent of a subject that is taken to be in centimetres, 10 m; in millimetres, what is larger
/// than 1 m is above.
const MAX_CENTIMETRES: f32 = 1000.0;

/// Opacity below which one sees through a surface: more passes than is stopped.
const MIN_OPACITY: f32 = 0.5;

/// What a user decides of a staging.
#[derive(Clone, Debug, Default)]
pub struct StageOptions {
    /// Patterns of the objects that are the main object; when empty, it is found from the geometry.
    pub main_object: Vec<String>,
    /// Axis of an OBJ that points up.
    pub up_axis: UpAxis,
    /// Azimuth from which the main object is seen, degrees to the right of +z; `None` for the first
    /// from which nothing hides it.
    pub view: Option<f32>,
}

/// A staged sidecar.
#[derive(Clone, Debug)]
pub struct Staging {
    /// The sidecar, TOML with comments.
    pub text: String,
    /// What was guessed, in words, on one line.
    pub summary: String,
}

/// Whether a scene file needs no staging: it has a camera, and is lit.
#[must_use]
pub fn is_complete(imported: &Imported) -> bool {
    imported.camera.is_some() && is_lit(imported)
}

/// Whether a scene file needs no staged lights: it has lights of its own, or a camera of its own and
/// materials that emit. Without a camera, what emits is taken for a part of the object, as a display is.
fn is_lit(imported: &Imported) -> bool {
    let emits = || imported.materials.iter().any(|(_, m)| m.emission != Rgb::ZERO);
    !imported.lights.is_empty() || imported.camera.is_some() && emits()
}

/// The triangles that are the main object of a scene file without a selection, found from the geometry,
/// and their names for messages. `imported` has its positions in metres, y up.
///
/// What the file's own camera does not see is not it: then everything is.
///
/// # Errors
/// When a triangle's coordinates are not finite or too large for Embree.
pub fn main_object(imported: &Imported) -> Result<(Vec<bool>, String), EmbreeError> {
    let mesh = &imported.mesh;
    let is_main = find(mesh, imported)?.is_main;
    let names = text::main_object_words(&selection(mesh, &is_main, imported));
    Ok((is_main, names))
}

/// The subject of a mesh with the materials and the camera of a scene file. What the camera does not see is
/// not it: then everything is.
fn find(mesh: &Mesh, imported: &Imported) -> Result<Subject, EmbreeError> {
    let is_clear = |m: &MaterialParams| m.model.transmits() || m.opacity < MIN_OPACITY;
    let is_clear: Vec<bool> = imported.materials.iter().map(|(_, m)| is_clear(m)).collect();
    let mut subject = subject::find(mesh, &is_clear)?;
    if let Some(camera) = &imported.camera {
        let obstacles = Obstacles::new(mesh, &subject.is_main)?;
        if obstacles.visible_share(&corners(mesh, &subject.is_main), camera.position) == 0.0 {
            subject.is_main.fill(true);
        }
    }
    Ok(subject)
}

/// Stages what the scene file `file` lacks of camera and lights; `imported` is as it was read.
///
/// `named` says whether each triangle belongs to the objects that the options name, if they do.
///
/// # Errors
/// When a triangle's coordinates are not finite or too large for Embree.
pub fn stage(
    file: &str,
    is_obj: bool,
    imported: &Imported,
    named: Option<Vec<bool>>,
    options: &StageOptions,
) -> Result<Staging, EmbreeError> {
    let mut mesh = imported.mesh.clone();
    axes::to_metres_y_up(&mut mesh, 1.0, options.up_axis);
    let subject = match named {
        Some(is_main) => Subject { has_floor: subject::has_floor(&mesh, &is_main), is_main },
        None => find(&mesh, imported)?,
    };
    let size = bounds(&mesh, &subject.is_main).extent();
    let (unit, scale) = if is_obj { unit(size.max_element()) } else { ("metres", 1.0) };
    mesh.positions.iter_mut().for_each(|p| *p *= scale as f32);
    let main_object = match options.main_object.is_empty() {
        true => selection(&mesh, &subject.is_main, imported),
        false => MainObject::Named(options.main_object.clone()),
    };
    let plan = plan(file, is_obj.then_some(scale), &mesh, &subject, main_object, imported, options)?;
    let units = match is_obj {
        true => format!("{} units high, taken as {unit}; ", text::three_digits(size.y)),
        false => String::new(),
    };
    Ok(Staging { text: text::sidecar(&plan), summary: format!("{units}{}", text::summary(&plan)) })
}

fn plan<'a>(
    file: &'a str,
    scale: Option<f64>,
    mesh: &Mesh,
    subject: &Subject,
    main_object: MainObject,
    imported: &Imported,
    options: &StageOptions,
) -> Result<Plan<'a>, EmbreeError> {
    let obstacles = Obstacles::new(mesh, &subject.is_main)?;
    let around = bounds(mesh, &subject.is_main);
    let (view, has_camera) = match &imported.camera {
        Some(camera) => (imported_view(camera), true),
        None => (view(mesh, &subject.is_main, &obstacles, options.view), false),
    };
    let floor = Bounds::of(mesh.indices.iter().flatten().map(|&i| mesh.positions[i as usize])).lo.y;
    let needs_backdrop = !has_camera && !subject.has_floor;
    let origin = axes::point_to_metres_y_up(imported.origin, scale.unwrap_or(1.0), options.up_axis);
    Ok(Plan {
        file,
        scale,
        up_axis: options.up_axis,
        origin,
        camera: (!has_camera).then_some(view),
        main_object,
        backdrop: needs_backdrop.then(|| rig::backdrop(&around, floor, &view)),
        lights: if is_lit(imported) { Vec::new() } else { rig::lights(&around, &view, &obstacles) },
        subject: around,
    })
}

/// Corners of the triangles that belong to the main object.
fn corners(mesh: &Mesh, is_main: &[bool]) -> Vec<Vec3> {
    let selected = mesh.indices.iter().zip(is_main).filter(|(_, is_main)| **is_main);
    selected.flat_map(|(t, _)| t.map(|i| mesh.positions[i as usize])).collect()
}

/// The bounding box of the main object.
pub(super) fn bounds(mesh: &Mesh, is_main: &[bool]) -> Bounds {
    Bounds::of(corners(mesh, is_main))
}

/// The likely unit of a file whose main object has this largest extent: name, and length in metres.
fn unit(extent: f32) -> (&'static str, f64) {
    match extent {
        e if e <= MAX_METRES => ("metres", 1.0),
        e if e <= MAX_CENTIMETRES => ("centimetres", 0.01),
        _ => ("millimetres", 0.001),
    }
}

/// A selection of exactly the triangles of the main object: by names that no other triangle has, or
/// else by their bounding box.
fn selection(mesh: &Mesh, is_main: &[bool], imported: &Imported) -> MainObject {
    if is_main.iter().all(|m| *m) {
        return MainObject::Named(vec!["*".into()]);
    }
    // Whether a part has triangles beside the main object, and in it.
    let mut has = vec![[false; 2]; imported.parts.len()];
    for (&o, &m) in mesh.objects.iter().zip(is_main) {
        has[o as usize][usize::from(m)] = true;
    }
    let others = || imported.parts.iter().zip(&has).filter(|(_, has)| has[0]).flat_map(|(p, _)| p.names());
    let mut names: Vec<String> = Vec::new();
    for (part, _) in imported.parts.iter().zip(&has).filter(|(_, has)| has[1]) {
        match part.names().find(|n| !n.ends_with('*') && !others().any(|o| o == *n)) {
            Some(name) if names.iter().any(|n| n == name) => {}
            Some(name) => names.push(name.to_owned()),
            None => return MainObject::Inside(bounds(mesh, is_main)),
        }
    }
    MainObject::Named(names)
}

/// The camera from the first azimuth from which the main object is visible, and what it stands in fills the picture
/// if it does so from any; else from the one from which most of the object is visible, moved forward to where
/// nothing hides its centre.
fn view(mesh: &Mesh, is_main: &[bool], obstacles: &Obstacles, azimuth: Option<f32>) -> View {
    let points = corners(mesh, is_main);
    let others: &[f32] = if azimuth.is_some() { &[] } else { &OTHER_AZIMUTHS };
    let mut best: Option<(f32, View)> = None;
    let mut first = None;
    for a in std::iter::once(azimuth.unwrap_or(AZIMUTH)).chain(others.iter().copied()) {
        let view = frame::frame(&points, a);
        let share = obstacles.visible_share(&points, view.eye);
        if share >= MIN_VISIBLE {
            if obstacles.is_empty() || obstacles.framed_share(&view) >= MIN_FRAMED {
                return view;
            }
            first.get_or_insert(view);
        }
        if best.is_none_or(|(most, _)| share > most) {
            best = Some((share, view));
        }
    }
    if let Some(view) = first {
        return view;
    }
    let view = best.map_or_else(|| frame::frame(&points, AZIMUTH), |(_, view)| view);
    match obstacles.free_share(view.look_at, view.eye) {
        free if free < 1.0 => {
            frame::from_nearer(&points, view, CLEARANCE * free * view.eye.distance(view.look_at))
        }
        _ => view,
    }
}

/// The view of a camera of the scene file, on a film of the default width.
fn imported_view(camera: &ImportedCamera) -> View {
    let [width, height] = DEFAULT_FILM.map(|n| n as f32);
    let aspect = camera.aspect.unwrap_or(width / height);
    let height = (width / aspect).round().max(1.0) as u32;
    View { eye: camera.position, look_at: camera.look_at, vfov: camera.vfov, size: [DEFAULT_FILM[0], height] }
}
