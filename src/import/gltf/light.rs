//! `KHR_lights_punctual`.

use std::f32::consts::FRAC_PI_2;

use glam::{Mat4, Vec3};
use gltf_json::{
    Node,
    extensions::scene::khr_lights_punctual::{Light, Type},
    validation::Checked,
};

use super::{
    file::File,
    warnings::{Warnings, unique},
};
use crate::{
    import::{
        error::ImportError,
        imported::{ImportedLight, Punctual, printable_name},
    },
    math::Rgb,
};

/// Luminous efficacy by which exporters turn watts into lumens, lm/W: that of light of 555 nm.
const LUMENS_PER_WATT: f32 = 683.0;
/// Smallest outer cone angle, radians: a narrower cone's solid angle π·10⁻⁶ sr drowns in rounding.
const MIN_CONE_ANGLE: f32 = 1e-3;

/// Adds the light of the node at `key`, if it has one; a dark light is left out with a warning.
///
/// # Errors
/// When the light does not exist or is of another type than the extension's.
pub fn read(
    file: &File,
    key: &str,
    node: &Node,
    world: &Mat4,
    lights: &mut Vec<ImportedLight>,
    warnings: &mut Warnings,
) -> Result<(), ImportError> {
    let Some(extension) = node.extensions.as_ref().and_then(|e| e.khr_lights_punctual.as_ref()) else {
        return Ok(());
    };
    let index = extension.light;
    let json = file.get(&format!("{key}.extensions.KHR_lights_punctual.light"), index)?;
    let given = json.name.as_ref().or(node.name.as_ref());
    let name = given.map_or_else(String::new, |n| printable_name(n.trim()));
    let name = if name.is_empty() { format!("light_{}", index.value()) } else { name };
    let taken: Vec<String> = lights.iter().map(|l| l.name.clone()).collect();
    let name = unique(name, &taken);
    let Some(kind) = punctual(json) else {
        let key = format!("extensions.KHR_lights_punctual.lights[{}].type", index.value());
        return Err(file.error(key, "must be point, spot or directional"));
    };
    let color = Rgb::from_array(json.color).max(Rgb::ZERO);
    let intensity = json.intensity / LUMENS_PER_WATT;
    if !(color.max_element() > 0.0 && color.is_finite() && intensity > 0.0 && intensity.is_finite()) {
        warnings.add(format!("light `{name}` is left out: it is dark"));
        return Ok(());
    }
    lights.push(ImportedLight {
        name,
        kind,
        position: world.transform_point3(Vec3::ZERO),
        direction: world.transform_vector3(Vec3::NEG_Z).normalize_or(Vec3::NEG_Z),
        color,
        intensity,
    });
    Ok(())
}

/// The light's angular distribution; `None` for a type that the extension does not have.
fn punctual(json: &Light) -> Option<Punctual> {
    match &json.type_ {
        Checked::Valid(Type::Point) => Some(Punctual::Point),
        Checked::Valid(Type::Directional) => Some(Punctual::Directional),
        Checked::Valid(Type::Spot) => {
            let spot = json.spot.clone().unwrap_or_default();
            let outer = spot.outer_cone_angle.clamp(MIN_CONE_ANGLE, FRAC_PI_2);
            Some(Punctual::Spot { inner: spot.inner_cone_angle.clamp(0.0, outer), outer })
        }
        Checked::Invalid => None,
    }
}
