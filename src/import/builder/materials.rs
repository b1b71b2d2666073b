//! Materials of the scene file with the sidecar's overrides.

use std::collections::HashSet;

use super::source::Source;
use crate::{
    import::{
        error::ImportError,
        sidecar::{MaterialSpec, Sidecar},
    },
    math::Rgb,
    scene::material::{Coats, Material, MaterialParams, Model},
};

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
            params.emission = Rgb::from_array(e);
            if !(params.emission.is_finite() && params.emission.min_element() >= 0.0) {
                return Err(self.error(key("emission"), format!("channels must be >= 0, got {e:?}")));
            }
        }
        if let Some(ior) = spec.ior {
            if !(ior > 1.0 && ior <= 4.0) {
                return Err(self.error(key("ior"), format!("must be in (1, 4], got {ior}")));
            }
            params.ior = ior;
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
        metallic: spec.metallic.unwrap_or(0.0),
        metallic_map: None,
        opacity: spec.opacity.unwrap_or(opacity),
        opacity_map,
        ..params
    }
}
