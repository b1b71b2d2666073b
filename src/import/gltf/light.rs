//! `KHR_lights_punctual`.

use std::f32::consts::FRAC_PI_2;

use glam::{Mat4, Vec3};
use gltf_json::{
    Node,
    extensions::scene::khr_lights_punctual::{Light, Type},
    validation::Checked,
};

use super::file::File;
use crate::{
    import::{
        error::ImportError,
        imported::{ImportedLight, Punctual, UniqueNames, printable_name},
        range,
        warnings::Warnings,
    },
    light::{Cone, Edge, LUMENS_PER_WATT},
    math::Rgb,
};

/// Smallest outer cone angle, radians: a narrower cone's solid angle π·10⁻⁶ sr drowns in rounding.
const MIN_CONE_ANGLE: f32 = 1e-3;

/// The light of the node at `key`, if it has one; a dark light is left out with a warning.
///
/// # Errors
/// When the light does not exist or is of another type than the extension's.
pub fn read(
    file: &File,
    key: &str,
    node: &Node,
    world: &Mat4,
    names: &mut UniqueNames,
    warnings: &mut Warnings,
) -> Result<Option<ImportedLight>, ImportError> {
    let Some(extension) = node.extensions.as_ref().and_then(|e| e.khr_lights_punctual.as_ref()) else {
        return Ok(None);
    };
    let index = extension.light;
    let json = file.get(&format!("{key}.extensions.KHR_lights_punctual.light"), index)?;
    let given = json.name.as_ref().or(node.name.as_ref());
    let name = given.map_or_else(String::new, |n| printable_name(n.trim()));
    let name = if name.is_empty() { format!("light_{}", index.value()) } else { name };
    let warn = |message| warnings.about("light", &name, message);
    let Some(kind) = punctual(json, file.is_of_blender(), warn) else {
        let key = format!("extensions.KHR_lights_punctual.lights[{}].type", index.value());
        return Err(file.error(key, "must be point, spot or directional"));
    };
    let color = Rgb::from_array(json.color).max(Rgb::ZERO);
    let intensity = json.intensity / LUMENS_PER_WATT;
    if !(color.max_element() > 0.0 && color.is_finite() && intensity > 0.0 && intensity.is_finite()) {
        warnings.about("light", &name, "is left out: it is dark".into());
        return Ok(None);
    }
    Ok(Some(ImportedLight {
        name: names.take(name),
        kind,
        position: world.transform_point3(Vec3::ZERO),
        direction: world.transform_vector3(Vec3::NEG_Z).normalize_or(Vec3::NEG_Z),
        color,
        intensity,
    }))
}

/// The light's angular distribution; `None` for a type that the extension does not have.
fn punctual(json: &Light, is_blender: bool, mut warn: impl FnMut(String)) -> Option<Punctual> {
    match &json.type_ {
        Checked::Valid(Type::Point) => Some(Punctual::Point),
        Checked::Valid(Type::Directional) => Some(Punctual::Directional),
        Checked::Valid(Type::Spot) => {
            let spot = json.spot.clone().unwrap_or_default();
            let range = [MIN_CONE_ANGLE, FRAC_PI_2];
            let outer = range::clamped("outerConeAngle", spot.outer_cone_angle, range, &mut warn);
            let inner = range::clamped("innerConeAngle", spot.inner_cone_angle, [0.0, outer], &mut warn);
            Some(Punctual::Spot(if is_blender { blender_cone(inner, outer) } else { cone(inner, outer) }))
        }
        Checked::Invalid => None,
    }
}

/// The cone of half-angles `inner` and `outer`, radians, with the fall-off that
/// `KHR_lights_punctual` recommends.
fn cone(inner: f32, outer: f32) -> Cone {
    Cone { cos_inner: inner.cos(), cos_outer: outer.cos().max(0.0), edge: Edge::Squared }
}

/// The cone that Blender means: its exporter writes the share of the half-angle `outer` that is soft,
/// Blender renders the same share of 1 − cos(outer) as a smooth step.
fn blender_cone(inner: f32, outer: f32) -> Cone {
    let cos_outer = outer.cos().max(0.0);
    let blend = 1.0 - inner / outer;
    Cone { cos_inner: cos_outer + (1.0 - cos_outer) * blend, cos_outer, edge: Edge::Smooth }
}
