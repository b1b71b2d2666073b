//! Lamps that the exporter of a scene file dropped.

use std::path::Path;

use glam::DVec3;

use crate::import::{
    imported::{Imported, LostLamp, printable_name},
    sidecar::Sidecar,
};

/// Names listed, at most.
const MAX_LISTED: usize = 3;
/// Largest distance between a node and the light of the sidecar that stands for it, metres: coordinates are
/// printed to a millimetre.
const SAME_PLACE: f64 = 2e-3;

/// Says which nodes of the scene file hold nothing and may have been lamps, and how to add these, but for those
/// in the place of which the sidecar has a light.
pub fn lost_lamps(path: &Path, sidecar: &Sidecar, imported: &Imported) -> Option<String> {
    let is_told = |lamp: &LostLamp| {
        sidecar.lights.iter().any(|light| {
            let is_there = |p: [f64; 3]| DVec3::from(p).distance(lamp.position) < SAME_PLACE;
            light.name == printable_name(&lamp.name) || light.position.is_some_and(is_there)
        })
    };
    let lamps: Vec<&LostLamp> = imported.lost_lamps.iter().filter(|lamp| !is_told(lamp)).collect();
    let first = lamps.first()?;
    let listed: Vec<String> = lamps.iter().take(MAX_LISTED).map(|lamp| format!("`{}`", lamp.name)).collect();
    let mut names = listed.join(", ");
    if lamps.len() > MAX_LISTED {
        names += &format!(" and {} more", lamps.len() - MAX_LISTED);
    }
    let (nodes, hold, they) = match lamps.len() {
        1 => ("node", "holds", "it was a lamp"),
        _ => ("nodes", "hold", "they were lamps"),
    };
    let exporter = match imported.is_of_blender {
        true => "Blender exports no area lights",
        false => "glTF has no area lights",
    };
    let [position, look_at] =
        [first.position, first.look_at].map(|DVec3 { x, y, z }| format!("[{x:.3}, {y:.3}, {z:.3}]"));
    Some(format!(
        "{}: {nodes} {names} {hold} nothing, and {exporter}: if {they}, add [[lights]] to the sidecar, name = {:?}, type = \
         \"rectangle\", position = {position}, look_at = {look_at}, half_extents = [0.5, 0.5], radiance = 10.0 (USD would keep \
         lamps, but is not read yet)",
        path.display(),
        printable_name(&first.name),
    ))
}
