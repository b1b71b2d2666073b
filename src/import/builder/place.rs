//! Placement of geometry: units and axes of an OBJ, and the backdrop.

use super::source::Source;
use crate::{
    files::number::Number,
    import::{
        axes::{point_to_metres_y_up, to_metres_y_up},
        backdrop::{self, Sweep},
        error::ImportError,
        imported::{Imported, Part},
        sidecar::{BackdropSpec, Sidecar},
    },
    math::Rgb,
    scene::material::MaterialParams,
};

impl Source<'_> {
    /// Converts an OBJ to metres, y up, by the sidecar's `scale` and `up_axis`.
    pub fn place(&self, sidecar: &Sidecar, imported: &mut Imported) -> Result<(), ImportError> {
        let given = [("scale", sidecar.scale.is_some()), ("up_axis", sidecar.up_axis.is_some())];
        if let (false, Some((key, _))) = (self.is_obj, given.iter().find(|(_, given)| *given)) {
            return Err(self.error(*key, "only for an OBJ: a glTF is in metres, y up"));
        }
        let scale = sidecar.scale.unwrap_or(1.0);
        self.positive("scale", scale)?;
        let up = sidecar.up_axis.unwrap_or_default();
        let n_lost = to_metres_y_up(&mut imported.mesh, scale, up);
        imported.origin = point_to_metres_y_up(imported.origin, scale, up);
        if imported.mesh.indices.is_empty() {
            let message = format!("no triangle is left of those that are {} as large", Number(scale));
            return Err(self.error("scale", message));
        }
        if n_lost > 0 {
            let file = self.scene_path.display();
            let triangles = if n_lost == 1 { "triangle that is" } else { "triangles that are" };
            let why = "too small or too far from the origin at this `scale`";
            imported.warnings.push(format!("{file}: left out {n_lost} {triangles} {why}"));
        }
        Ok(())
    }

    /// Adds the backdrop: its triangles, a part named `backdrop`, and a material of the first unused
    /// name among `backdrop`, `backdrop_` and so on.
    pub fn add_backdrop(&self, spec: &BackdropSpec, imported: &mut Imported) -> Result<(), ImportError> {
        let sweep = self.sweep(spec)?;
        let base_color = match spec.base_color {
            Some(color) => self.albedo("backdrop.base_color", color)?,
            None => Rgb::from_array(backdrop::BASE_COLOR),
        };
        let is_used = |name: &str| imported.materials.iter().any(|(n, _)| n == name);
        let mut name = backdrop::NAME.to_owned();
        while is_used(&name) {
            name.push('_');
        }
        let material = imported.materials.len() as u32;
        imported.materials.push((name, MaterialParams { base_color, ..MaterialParams::default() }));
        let object = imported.parts.len() as u32;
        imported.parts.push(Part { object: Some(backdrop::NAME.into()), groups: Vec::new() });
        sweep.append(&mut imported.mesh, material, object);
        Ok(())
    }

    fn sweep(&self, spec: &BackdropSpec) -> Result<Sweep, ImportError> {
        let position = self.point("backdrop.position", spec.position)?;
        let turn = self.turn("backdrop.turn", spec.turn)?;
        let [front, back, width, height] = [
            ("backdrop.front", spec.front),
            ("backdrop.back", spec.back),
            ("backdrop.width", spec.width),
            ("backdrop.height", spec.height),
        ]
        .map(|(key, value)| self.length(key, value));
        let (front, back, width, height) = (front?, back?, width?, height?);
        let largest = back.min(height);
        let radius = match spec.radius {
            None => 0.5 * largest,
            Some(radius) if radius as f32 > largest => {
                let message = format!("must be > 0 and at most `back` and `height`, got {}", Number(radius));
                return Err(self.error("backdrop.radius", message));
            }
            Some(radius) => self.length("backdrop.radius", radius)?,
        };
        Ok(Sweep { position, turn: turn.to_radians(), front, back, width, height, radius })
    }
}
