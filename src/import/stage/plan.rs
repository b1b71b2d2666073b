//! A staged scene before it is written as a sidecar.

use glam::DVec3;

use super::{frame::View, rig::StagedLight};
use crate::{
    import::{axes::UpAxis, backdrop::Sweep},
    math::Bounds,
};

/// All that the sidecar of a staged scene says. Lengths are metres, y is up.
#[derive(Debug)]
pub struct Plan<'a> {
    /// Name of the scene file.
    pub file: &'a str,
    /// Metres per unit of an OBJ; `None` for a glTF, which is in metres.
    pub scale: Option<f64>,
    /// Axis of the file that points up.
    pub up_axis: UpAxis,
    /// Place of the plan's origin in the file's coordinates.
    pub origin: DVec3,
    /// Staged camera; `None` where the file has its own.
    pub camera: Option<View>,
    /// How the sidecar selects the main object.
    pub main_object: MainObject,
    /// Staged backdrop; `None` where the file has a floor or its own camera.
    pub backdrop: Option<Sweep>,
    /// Staged lights; none where the file has punctual lights.
    pub lights: Vec<StagedLight>,
    /// Bounding box of the main object.
    pub subject: Bounds,
}

/// Selection of the main object.
#[derive(Debug, PartialEq)]
pub enum MainObject {
    /// Names, or patterns, of objects and groups.
    Named(Vec<String>),
    /// The triangles inside a box, where no names tell them from the others.
    Inside(Bounds),
}
