//! Materials of the scene file with the sidecar's overrides.

use std::collections::HashSet;

use glam::DVec3;

use super::source::Source;
use crate::{
    files::number::{Number, Numbers},
    import::{
        error::ImportError,
        range::MAX_IOR,
        sidecar::{MaterialSpec, Sidecar},
        warnings::Warnings,
    },
    lighting::MAX_RADIANCE,
    scene::material::{Coats, Material, MaterialParams, Model},
};

/// What is said of a material whose shader is known neither from the scene file nor from the sidecar.
const LOST: &str = "its shader is lost in the file, taken as white diffuse: Blender exports only its Principled \
                    BSDF; [materials] in the sidecar can say more";

/// Warns of the materials of a scene file whose shader was dropped by the exporter, but for those of which
/// the sidecar gives the model.
pub fn lost_shaders(sidecar: &Sidecar, names: &[String]) -> Vec<String> {
    let is_told = |name: &str| sidecar.materials.get(name).is_some_and(|m| m.model.is_some());
    let mut warnings = Warnings::default();
    names.iter().filter(|name| !is_told(name)).for_each(|name| warnings.about("material", name, LOST.into()));
    warnings.into_lines()
}

impl Source<'_> {
    /// Builds the materials of the scene file, in their order.
    pub fn materials(
        &self,
        sidecar: &Sidecar,
        imported: Vec<(String, MaterialParams)>,
    ) -> Result<Vec<Material>, ImportError> {
        let known: HashSet<&str> = imported.iter().map(|(n, _)| n.as_str()).collect();
        for name in sidecar.materials.keys() {
            if !known.contains(name.as_str()) {
                let known = imported.iter().map(|(n, _)| n.as_str());
                return Err(self.unknown_name("materials", name, known));
            }
        }
        let mut coats = Coats::default();
        let build = |(name, params): (String, MaterialParams)| {
            let params = match sidecar.materials.get(&name) {
                Some(spec) => self.overridden(&name, params, spec)?,
                None => params,
            };
            Ok(Material::new(name, params, &mut coats))
        };
        imported.into_iter().map(build).collect()
    }

    fn overridden(
        &self,
        name: &str,
        mut params: MaterialParams,
        spec: &MaterialSpec,
    ) -> Result<MaterialParams, ImportError> {
        let key = |k: &str| format!("materials.{name}.{k}");
        if let Some(c) = spec.base_color {
            params.base_color = self.albedo(&key("base_color"), c)?;
        }
        let tint = &mut params.glass_tint;
        for (k, given, color) in [
            ("reflected", spec.reflected, &mut tint.reflected),
            ("transmitted", spec.transmitted, &mut tint.transmitted),
            ("edge_tint", spec.edge_tint, &mut params.edge_tint),
        ] {
            if let Some(c) = given {
                *color = self.albedo(&key(k), c)?;
            }
        }
        for (k, given, value) in [
            ("roughness", spec.roughness, &mut params.roughness),
            ("metallic", spec.metallic, &mut params.metallic),
            ("specular", spec.specular, &mut params.specular),
            ("opacity", spec.opacity, &mut params.opacity),
        ] {
            if let Some(v) = given {
                *value = self.fraction(&key(k), v)?;
            }
        }
        if let Some(e) = spec.emission {
            params.emission = DVec3::from_array(e).as_vec3();
            if !params.emission.to_array().iter().all(|v| (0.0..=MAX_RADIANCE).contains(v)) {
                let message =
                    format!("channels must be >= 0 and at most {MAX_RADIANCE:e}, got {}", Numbers(&e));
                return Err(self.error(key("emission"), message));
            }
        }
        if let Some(ior) = spec.ior {
            if !(ior > 1.0 && ior <= f64::from(MAX_IOR)) {
                return Err(self.error(key("ior"), format!("must be in (1, {MAX_IOR}], got {}", Number(ior))));
            }
            params.ior = ior as f32;
        }
        Ok(match spec.model {
            Some(model) => with_model(model, params, spec),
            None => params,
        })
    }
}

/// The parameters under a model that the sidecar names. It says what the surface is: glass is not
/// paint that lets rays through, nor part metal, unless the sidecar gives these shares too.
fn with_model(model: Model, params: MaterialParams, spec: &MaterialSpec) -> MaterialParams {
    let (opacity, opacity_map) =
        if model.transmits() { (1.0, None) } else { (params.opacity, params.opacity_map.clone()) };
    MaterialParams {
        model,
        metallic: spec.metallic.map_or(0.0, |v| v as f32),
        metallic_map: None,
        opacity: spec.opacity.map_or(opacity, |v| v as f32),
        opacity_map,
        ..params
    }
}
