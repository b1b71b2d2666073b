//! What a stored basis says about its scene: enough to light it again and to
//! vary it without the scene's files.

use serde::{Deserialize, Serialize};

use crate::{
    integrator::aov::Aovs,
    lighting::Lighting,
    math::display::LuminanceMode,
    objective::{Objective, ObjectiveError, Target},
    scene::Scene,
    transport::TransportBasis,
    variables::{ParamVector, Scale, Variable, VariableKind},
};

/// About a stored basis.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct About {
    /// Name of the scene.
    pub scene: String,
    /// Names of the lights.
    pub lights: Vec<String>,
    /// The lighting of what is not set otherwise.
    #[serde(flatten)]
    pub fixed: Lighting,
    /// Measure of luminance.
    pub luminance: LuminanceMode,
    /// Lengths of runs of pixels off and on the main object, in turn.
    pub mask: Vec<usize>,
    /// What varied.
    pub variables: Vec<StoredVariable>,
}

/// A variable by name.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct StoredVariable {
    /// `LIGHT.radiance`, `LIGHT.size` or `background.value`.
    pub name: String,
    /// Least value.
    pub lower: f64,
    /// Largest value.
    pub upper: f64,
    /// Value at the start.
    pub initial: f64,
    /// Map from the optimiser's unit interval.
    pub scale: Scale,
}

impl About {
    /// About the basis of a scene.
    #[must_use]
    pub fn new(
        scene: &Scene,
        fixed: &Lighting,
        aovs: &Aovs,
        variables: &ParamVector,
        luminance: LuminanceMode,
    ) -> Self {
        let mut mask = Vec::new();
        let mut on = false;
        let mut run = 0;
        for &m in &aovs.mask {
            if m != on {
                mask.push(run);
                (on, run) = (m, 0);
            }
            run += 1;
        }
        mask.push(run);
        Self {
            scene: scene.name.clone(),
            lights: scene.light_names().into_iter().map(str::to_owned).collect(),
            fixed: fixed.clone(),
            luminance,
            mask,
            variables: variables
                .variables
                .iter()
                .map(|v| StoredVariable {
                    name: v.name.clone(),
                    lower: v.lower,
                    upper: v.upper,
                    initial: v.initial,
                    scale: v.scale,
                })
                .collect(),
        }
    }

    /// Whether it fits the basis that it came with.
    #[must_use]
    pub fn fits(&self, basis: &TransportBasis) -> bool {
        let layout = basis.layout();
        let n = layout.lights.len();
        [self.lights.len(), self.fixed.radiance.len(), self.fixed.size.len()] == [n; 3]
            && self.mask.iter().sum::<usize>() == layout.n_pixels()
            && self.variables.iter().all(|v| VariableKind::of_name(&v.name, &self.lights).is_some())
    }

    /// The pixels of the main object.
    #[must_use]
    pub fn mask(&self) -> Vec<bool> {
        self.mask.iter().enumerate().flat_map(|(i, &n)| std::iter::repeat_n(i % 2 == 1, n)).collect()
    }

    /// The variables.
    #[must_use]
    pub fn variables(&self) -> ParamVector {
        let variables = self.variables.iter().filter_map(|v| {
            let (kind, light) = VariableKind::of_name(&v.name, &self.lights)?;
            let StoredVariable { ref name, lower, upper, initial, scale } = *v;
            Some(Variable { name: name.clone(), unit: "", lower, upper, initial, scale, kind, light })
        });
        ParamVector { variables: variables.collect() }
    }

    /// The lighting of what is not set otherwise, at the start of the variables.
    #[must_use]
    pub fn lighting(&self) -> Lighting {
        let variables = self.variables();
        let initial: Vec<f64> = variables.variables.iter().map(|v| v.initial).collect();
        variables.lighting(self.fixed.clone(), &initial)
    }

    /// The objective of a target for its pictures.
    ///
    /// # Errors
    /// As [`Objective::new`].
    pub fn objective(&self, target: &Target, basis: &TransportBasis) -> Result<Objective, ObjectiveError> {
        let size = basis.layout().size;
        Objective::new(target, size.x as usize, size.y as usize, &self.mask())
    }
}
