//! The lights of a scene in their order, each with its author's constraints on its variables.

use std::collections::{HashMap, HashSet};

use super::{
    emitters::Emitters,
    lights::{is_laid_over, punctual},
    source::Source,
};
use crate::{
    files::number::{Number, Numbers},
    import::{
        error::ImportError,
        imported::{ImportedLight, MAX_LIGHT_NAME, printable_name},
        sidecar::{LightSpec, Sidecar},
    },
    light::{Light, LightColor, Shape},
    lighting::MAX_RADIANCE,
    math::{blackbody::TEMPERATURES, luminance},
    scene::{Material, Mesh},
    variables::{FreeKinds, LightConstraints},
};

impl Source<'_> {
    /// The lights of the scene file that the sidecar does not replace, the sidecar's in their
    /// order, then the materials that emit and that no light of the sidecar stands for.
    pub fn lights(
        &self,
        sidecar: &Sidecar,
        imported: &[ImportedLight],
        mesh: &Mesh,
        materials: &[Material],
        warnings: &mut Vec<String>,
    ) -> Result<Vec<(Light, LightConstraints)>, ImportError> {
        let mut names = self.light_names(sidecar)?;
        let mut lights = Vec::new();
        let from_file = || LightConstraints {
            free: sidecar.free.clone().unwrap_or_else(FreeKinds::all),
            is_from_file: true,
            ..LightConstraints::default()
        };
        let mut own: HashMap<&str, &ImportedLight> = HashMap::new();
        for l in imported {
            if names.insert(l.name.clone()) {
                let light = punctual(l);
                self.check_radiance(&light)?;
                lights.push((light, from_file()));
            } else {
                own.insert(&l.name, l);
            }
        }
        let mut numbers = HashMap::new();
        let mut emitters = Emitters::new(mesh, materials);
        for l in &sidecar.lights {
            let own = own.get(l.name.as_str()).copied();
            if let (Some(own), Some(kind)) = (own, l.kind)
                && !is_laid_over(kind, own)
            {
                let file = self.scene_path.display();
                warnings.push(format!("{file}: light `{}` is replaced by that of the sidecar", l.name));
            }
            lights.push((self.light(l, own, &mut emitters, warnings)?, self.light_constraints(sidecar, l)?));
        }
        for m in emitters.unclaimed() {
            let Some(shape) = emitters.mesh_light(m) else { continue };
            let name = unused_name(&materials[m].name, &mut names, &mut numbers);
            let tint = materials[m].emission_tint();
            let light = Light {
                name,
                shape: Shape::Mesh(shape),
                color: tint / luminance(tint),
                picture_color: LightColor::Recorded,
                temperature: None,
                radiance: luminance(tint),
                size: 1.0,
                camera_visible: true,
                occludes: false,
            };
            self.check_radiance(&light)?;
            lights.push((light, from_file()));
        }
        Ok(lights)
    }

    /// Checks the radiance of a light of the scene file, or of one of its materials.
    fn check_radiance(&self, light: &Light) -> Result<(), ImportError> {
        if (0.0..=MAX_RADIANCE).contains(&light.radiance) {
            return Ok(());
        }
        let got = Number(light.radiance);
        let message = format!("its radiance must be >= 0 and at most {MAX_RADIANCE:e}, got {got}");
        Err(ImportError::Key { path: self.scene_path.to_path_buf(), key: light.name.clone(), message })
    }

    /// Names of the sidecar's lights, which become those of EXR parts and must be unique.
    fn light_names(&self, sidecar: &Sidecar) -> Result<HashSet<String>, ImportError> {
        let mut names = HashSet::new();
        for (i, l) in sidecar.lights.iter().enumerate() {
            let is_printable = l.name.chars().all(|c| c == ' ' || c.is_ascii_graphic());
            if l.name.trim().is_empty() || l.name.len() > MAX_LIGHT_NAME || !is_printable {
                let message = format!("must be 1 to {MAX_LIGHT_NAME} ASCII characters, got {:?}", l.name);
                return Err(self.error(format!("lights[{}].name", i + 1), message));
            }
            if !names.insert(l.name.clone()) {
                return Err(self.error(format!("lights.{}", l.name), "two lights have this name"));
            }
        }
        Ok(names)
    }

    fn size_range(&self, light: &str, range: [f64; 2]) -> Result<[f32; 2], ImportError> {
        let [lo, hi] = range;
        let key = format!("lights.{light}.size_range");
        if !(lo > 0.0 && lo <= hi) {
            return Err(self.error(key, format!("must be 0 < min <= max, got {}", Numbers(&range))));
        }
        Ok([self.positive(&key, lo)?, self.positive(&key, hi)?])
    }

    fn temperature_range(&self, light: &str, range: [f64; 2]) -> Result<[f32; 2], ImportError> {
        let ([lo, hi], [least, most]) = (range, TEMPERATURES);
        if !(least <= lo && lo <= hi && hi <= most) {
            let key = format!("lights.{light}.color_temperature_range");
            let message = format!("must be {least} <= min <= max <= {most} K, got {}", Numbers(&range));
            return Err(self.error(key, message));
        }
        Ok(range.map(|v| v as f32))
    }

    fn radiance_max(&self, light: &str, max: f64) -> Result<f32, ImportError> {
        let key = format!("lights.{light}.radiance_max");
        self.positive(&key, max).and_then(|_| self.radiance(&key, max))
    }

    fn light_constraints(&self, sidecar: &Sidecar, l: &LightSpec) -> Result<LightConstraints, ImportError> {
        let size_range = l.size_range.map(|range| self.size_range(&l.name, range)).transpose()?;
        let radiance_max = l.radiance_max.map(|max| self.radiance_max(&l.name, max)).transpose()?;
        if l.occludes && (l.size_range.is_some() || l.free.as_ref().is_some_and(|f| f.contains("size"))) {
            let key = format!("lights.{}.occludes", l.name);
            return Err(self.error(key, "a light that stops rays has no free size"));
        }
        let of_all = sidecar.free.clone().unwrap_or_else(FreeKinds::all);
        let free = l.free.as_ref().map_or_else(|| of_all.clone(), |f| of_all.intersection(f));
        let temperature_range =
            l.color_temperature_range.map(|range| self.temperature_range(&l.name, range)).transpose()?;
        Ok(LightConstraints {
            free,
            size_range,
            radiance_max,
            temperature_range,
            is_from_file: false,
            stays: !l.movable,
        })
    }
}

/// A name for the light of a material: printable, and different from the names in use, to which it is
/// added. `numbers` are the last ones behind each name.
fn unused_name(material: &str, used: &mut HashSet<String>, numbers: &mut HashMap<String, usize>) -> String {
    let printable = printable_name(material);
    let base = if printable.trim().is_empty() { "emitter".to_owned() } else { printable };
    let mut name = base.clone();
    let n = numbers.entry(base.clone()).or_insert(1);
    while !used.insert(name.clone()) {
        *n += 1;
        name = format!("{base} {n}");
    }
    name
}
