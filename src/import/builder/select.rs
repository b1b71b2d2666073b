//! Selections by name or place: the main object and the background.

use std::collections::HashSet;

use glam::{DVec3, Vec3};

use super::source::Source;
use crate::{
    import::{
        error::ImportError,
        imported::{Imported, Part},
        sidecar::{Selection, Sidecar},
        stage,
    },
    scene::{Material, Mesh},
};

/// Pattern that selects the whole file, objects without a name included.
const ALL: &str = "*";

impl Source<'_> {
    /// Indices of the names that match a pattern: a name, or a prefix and `*`. At least one does.
    fn matches<'n>(
        &self,
        key: &str,
        pattern: &str,
        names: impl Iterator<Item = &'n str> + Clone,
    ) -> Result<Vec<usize>, ImportError> {
        let is_match = |n: &str| match pattern.strip_suffix('*') {
            Some(start) => n.starts_with(start),
            None => n == pattern,
        };
        let found: Vec<usize> =
            names.clone().enumerate().filter(|(_, n)| is_match(n)).map(|(i, _)| i).collect();
        if found.is_empty() { Err(self.unknown_name(key, pattern, names)) } else { Ok(found) }
    }

    /// Whether each triangle of the scene file belongs to the main object.
    pub fn main_object(&self, sidecar: &Sidecar, imported: &mut Imported) -> Result<Vec<bool>, ImportError> {
        if let Some(selection) = &sidecar.main_object {
            return self.select_main("main_object.objects", selection, imported);
        }
        let (is_main, name) = stage::main_object(imported).map_err(|source| self.embree(source))?;
        let (scene, sidecar) = (self.scene_path.display(), self.sidecar_path.display());
        imported.warnings.push(format!(
            "{scene}: main object: {name}, found from its geometry; `[main_object]` in {sidecar} chooses another"
        ));
        Ok(is_main)
    }

    /// Whether each triangle is selected, at least one being so; `key` is where the objects were given.
    pub fn select_main(
        &self,
        key: &str,
        selection: &Selection,
        imported: &Imported,
    ) -> Result<Vec<bool>, ImportError> {
        let Imported { mesh, parts, materials, .. } = imported;
        let mut names: Vec<&str> = parts.iter().flat_map(Part::names).collect();
        names.sort_unstable();
        names.dedup();
        let mut main_object = vec![false; parts.len()];
        let mut main_material = vec![false; materials.len()];
        for pattern in &selection.objects {
            if pattern == ALL {
                main_object.fill(true);
                continue;
            }
            let found = self.matches(key, pattern, names.iter().copied())?;
            let found: HashSet<&str> = found.into_iter().map(|i| names[i]).collect();
            for (is_main, part) in main_object.iter_mut().zip(parts) {
                *is_main |= part.names().any(|n| found.contains(n));
            }
        }
        for pattern in &selection.materials {
            let names = materials.iter().map(|(name, _)| name.as_str());
            for i in self.matches("main_object.materials", pattern, names)? {
                main_material[i] = true;
            }
        }
        let is_inside = self.inside(selection)?;
        let is_main: Vec<bool> = (0..mesh.indices.len())
            .map(|t| {
                let (object, material) = (mesh.objects[t] as usize, mesh.materials[t] as usize);
                main_object[object]
                    || main_material[material]
                    || mesh.corners(t).iter().all(|&p| is_inside(p))
            })
            .collect();
        if !is_main.contains(&true) {
            let message = "names no triangle; give `objects`, `materials` or `inside`";
            return Err(self.error("main_object", message));
        }
        Ok(is_main)
    }

    /// The materials whose base colour the background's value scales: those that the sidecar names, else
    /// those of which the main object has no triangle; always without those that have no base colour.
    pub fn background(
        &self,
        sidecar: &Sidecar,
        mesh: &Mesh,
        is_main: &[bool],
        materials: &[Material],
    ) -> Result<Vec<usize>, ImportError> {
        let mut selected = vec![false; materials.len()];
        match &sidecar.background.materials {
            Some(patterns) => {
                let names = materials.iter().map(|m| m.name.as_str());
                for pattern in patterns {
                    for i in self.matches("background.materials", pattern, names.clone())? {
                        selected[i] = true;
                    }
                }
            }
            None => {
                for &m in &mesh.materials {
                    selected[m as usize] = true;
                }
                for (&m, _) in mesh.materials.iter().zip(is_main).filter(|(_, main)| **main) {
                    selected[m as usize] = false;
                }
            }
        }
        Ok((0..materials.len()).filter(|&i| selected[i] && materials[i].has_value()).collect())
    }

    /// Whether a point is in the box of a selection; never if it has none.
    fn inside(&self, selection: &Selection) -> Result<impl Fn(Vec3) -> bool + use<>, ImportError> {
        let given = selection.inside.map(|c| c.map(DVec3::from_array));
        if let Some([lo, hi]) = given
            && !lo.cmple(hi).all()
        {
            let message = format!("must be two corners, the lesser first, got {lo} and {hi}");
            return Err(self.error("main_object.inside", message));
        }
        let corners = given.map(|c| c.map(|corner| (corner - self.origin).as_vec3()));
        Ok(move |p: Vec3| corners.is_some_and(|[lo, hi]| p.cmpge(lo).all() && p.cmple(hi).all()))
    }
}
