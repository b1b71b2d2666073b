//! Staging: camera, backdrop and lights for a scene that comes without.
//!
//! | what | how |
//! | --- | --- |
//! | main object | without a floor everything; on one, or in a room, the largest group of touching objects |
//! | unit of an OBJ | metres up to a size of 20, centimetres up to 1000, millimetres beyond |
//! | camera | a normal lens, three-quarter view from the right of +z, looking a little down, headroom |
//! | backdrop | floor, cove and wall, if there is no floor |
//! | lights | key, fill and rim, by the size of the main object |
//!
//! The result is the text of a sidecar: what is staged in memory is read as a user's would be.

mod frame;
mod obstacles;
pub mod pieces;
mod rig;
mod text;

use glam::{Vec2, Vec3};

use self::{frame::View, obstacles::Obstacles, pieces::Subject, rig::StagedLight};
use super::{
    axes,
    backdrop::Sweep,
    imported::{Imported, ImportedCamera},
    sidecar::UpAxis,
};
use crate::{
    embree::EmbreeError,
    math::{Bounds, Rgb},
    scene::Mesh,
};

/// Degrees to the right of +z from which a subject is seen.
const AZIMUTH: f32 = 30.0;
/// Others, tried in this order where the subject is hidden.
const OTHER_AZIMUTHS: [f32; 11] = [-30.0, 0.0, 60.0, -60.0, 90.0, -90.0, 120.0, -120.0, 150.0, -150.0, 180.0];
/// Share of the subject that the camera must see.
const VISIBLE: f32 = 0.9;
/// Share of the free distance at which a camera is placed before a wall.
const CLEARANCE: f32 = 0.95;
/// Largest size of a subject in metres and in centimetres.
const LARGEST: [f32; 2] = [20.0, 1000.0];
/// Width of the picture of an imported camera, pixels.
const CAMERA_WIDTH: u32 = 640;

/// What a user decides.
#[derive(Clone, Debug, Default)]
pub struct StageOptions {
    /// Patterns of the objects that are the main object; empty: it is found.
    pub main_object: Vec<String>,
    /// Which way is up in an OBJ.
    pub up_axis: UpAxis,
    /// Degrees to the right of +z from which the main object is seen.
    pub view: Option<f32>,
}

/// A sidecar and what was guessed for it.
#[derive(Clone, Debug)]
pub struct Staging {
    /// TOML.
    pub text: String,
    /// What was guessed, in words.
    pub summary: String,
}

/// All that a sidecar says of a staged scene.
#[derive(Debug)]
struct Plan<'a> {
    file: &'a str,
    scale: Option<f32>,
    up_axis: UpAxis,
    view: Option<View>,
    main: Main,
    backdrop: Option<Sweep>,
    lights: Vec<StagedLight>,
    subject: Bounds,
}

/// How a sidecar names the main object.
#[derive(Debug, PartialEq)]
enum Main {
    Objects(Vec<String>),
    Inside(Bounds),
}

/// Whether a scene file needs no staging: it has a camera and light.
#[must_use]
pub fn is_complete(imported: &Imported) -> bool {
    let shines = || imported.materials.iter().any(|(_, m)| m.emission != Rgb::ZERO);
    imported.camera.is_some() && (!imported.lights.is_empty() || shines())
}

/// Stages a scene file called `file`, as it was read: what it lacks of camera and lights.
///
/// `named` says which triangles are of the objects that the options name.
///
/// # Errors
/// When the triangles are broken.
pub fn stage(
    file: &str,
    is_obj: bool,
    imported: &Imported,
    named: Option<Vec<bool>>,
    options: &StageOptions,
) -> Result<Staging, EmbreeError> {
    let mut mesh = imported.mesh.clone();
    axes::place(&mut mesh, 1.0, options.up_axis);
    let subject = match named {
        Some(is_main) => Subject { has_floor: pieces::has_floor(&mesh, &is_main), is_main },
        None => pieces::find(&mesh),
    };
    let size = bounds(&mesh, &subject.is_main).extent();
    let scale = if is_obj { unit(size.max_element()) } else { ("metres", 1.0) };
    mesh.positions.iter_mut().for_each(|p| *p *= scale.1);
    let main = match options.main_object.is_empty() {
        true => main(&mesh, &subject.is_main, imported),
        false => Main::Objects(options.main_object.clone()),
    };
    let plan = plan(file, is_obj.then_some(scale.1), &mesh, &subject, main, imported, options)?;
    let unit = match is_obj {
        true => format!("{} units high, taken as {}; ", text::plain(size.y), scale.0),
        false => String::new(),
    };
    Ok(Staging { text: text::sidecar(&plan), summary: format!("{unit}{}", text::in_words(&plan)) })
}

fn plan<'a>(
    file: &'a str,
    scale: Option<f32>,
    mesh: &Mesh,
    subject: &Subject,
    main: Main,
    imported: &Imported,
    options: &StageOptions,
) -> Result<Plan<'a>, EmbreeError> {
    let obstacles = Obstacles::new(mesh, &subject.is_main)?;
    let around = bounds(mesh, &subject.is_main);
    let (view, is_own) = match &imported.camera {
        Some(camera) => (imported_view(camera), true),
        None => (view(mesh, &subject.is_main, &obstacles, options.view), false),
    };
    let floor = Bounds::of(mesh.indices.iter().flatten().map(|&i| mesh.positions[i as usize])).lo.y;
    let needs_backdrop = !is_own && !subject.has_floor;
    let is_lit = !imported.lights.is_empty();
    Ok(Plan {
        file,
        scale,
        up_axis: options.up_axis,
        view: (!is_own).then_some(view),
        main,
        backdrop: needs_backdrop.then(|| rig::backdrop(&around, floor, &view)),
        lights: if is_lit { Vec::new() } else { rig::lights(&around, &view, &obstacles) },
        subject: around,
    })
}

/// Points of the triangles that are selected.
fn points(mesh: &Mesh, is_main: &[bool]) -> Vec<Vec3> {
    let selected = mesh.indices.iter().zip(is_main).filter(|(_, is_main)| **is_main);
    selected.flat_map(|(t, _)| t.map(|i| mesh.positions[i as usize])).collect()
}

fn bounds(mesh: &Mesh, is_main: &[bool]) -> Bounds {
    Bounds::of(points(mesh, is_main))
}

/// The unit of a file whose subject has this largest extent: its name and metres.
fn unit(extent: f32) -> (&'static str, f32) {
    match extent {
        e if e <= LARGEST[0] => ("metres", 1.0),
        e if e <= LARGEST[1] => ("centimetres", 0.01),
        _ => ("millimetres", 0.001),
    }
}

/// The names that select what is main and nothing else, or its box.
fn main(mesh: &Mesh, is_main: &[bool], imported: &Imported) -> Main {
    if is_main.iter().all(|m| *m) {
        return Main::Objects(vec!["*".into()]);
    }
    let mut state = vec![[false; 2]; imported.parts.len()];
    for (&o, &m) in mesh.objects.iter().zip(is_main) {
        state[o as usize][usize::from(m)] = true;
    }
    // A name will do that no triangle beside the subject has.
    let others = || imported.parts.iter().zip(&state).filter(|(_, s)| s[0]).flat_map(|(p, _)| p.names());
    let mut names: Vec<String> = Vec::new();
    for (part, _) in imported.parts.iter().zip(&state).filter(|(_, s)| s[1]) {
        let own = part.names().find(|n| !n.ends_with('*') && !others().any(|o| o == *n));
        match own {
            Some(name) if names.iter().any(|n| n == name) => {}
            Some(name) => names.push(name.to_owned()),
            None => return Main::Inside(bounds(mesh, is_main)),
        }
    }
    Main::Objects(names)
}

/// The camera from the first side from which the subject is seen, else from that from
/// which most of it is, moved forward to where nothing hides its middle.
fn view(mesh: &Mesh, is_main: &[bool], obstacles: &Obstacles, azimuth: Option<f32>) -> View {
    let points = points(mesh, is_main);
    let others: &[f32] = if azimuth.is_some() { &[] } else { &OTHER_AZIMUTHS };
    let mut best: Option<(f32, View)> = None;
    for a in std::iter::once(azimuth.unwrap_or(AZIMUTH)).chain(others.iter().copied()) {
        let view = frame::frame(&points, a);
        let share = obstacles.visible_share(&points, view.eye);
        if share >= VISIBLE {
            return view;
        }
        if best.is_none_or(|(most, _)| share > most) {
            best = Some((share, view));
        }
    }
    let view = best.map_or_else(|| frame::frame(&points, AZIMUTH), |(_, view)| view);
    match obstacles.free_share(view.look_at, view.eye) {
        free if free < 1.0 => {
            frame::from_nearer(&points, view, CLEARANCE * free * view.eye.distance(view.look_at))
        }
        _ => view,
    }
}

fn imported_view(camera: &ImportedCamera) -> View {
    let aspect = Vec2::new(camera.aspect.unwrap_or(4.0 / 3.0), 1.0);
    let height = (CAMERA_WIDTH as f32 / aspect.x).round().max(1.0) as u32;
    View { eye: camera.position, look_at: camera.look_at, vfov: camera.vfov, size: [CAMERA_WIDTH, height] }
}
