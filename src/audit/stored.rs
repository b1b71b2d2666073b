//! Description of the scene of a stored basis: enough to light it again and to vary it without the
//! scene's files.

use base64::prelude::{BASE64_STANDARD, Engine};
use serde::{Deserialize, Serialize};

use crate::{
    integrator::aov::{Aovs, Features},
    lighting::Lighting,
    math::{Measure, Rgb, ViewTransform, display::LuminanceMode},
    objective::{Objective, ObjectiveError, Target},
    scene::Scene,
    transport::{Brought, Layout, TransportBasis},
    variables::{ParamVector, Scale, Tie, Variable, VariableKind},
};

/// Description of the scene of a stored basis.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct About {
    /// Name of the scene.
    pub scene: String,
    /// Names of the lights, in the scene's order.
    pub lights: Vec<String>,
    /// Lighting of everything that is not set otherwise.
    #[serde(flatten)]
    pub fixed: Lighting,
    /// How luminance is measured behind the view.
    pub luminance: LuminanceMode,
    /// View through which pictures are seen; `srgb` in bases of earlier versions.
    #[serde(default)]
    pub view: ViewTransform,
    /// Mask of the main object, row by row, as lengths of runs of pixels off and on it in turn.
    pub mask: Vec<usize>,
    /// Variables of the run that rendered the basis.
    pub variables: Vec<StoredVariable>,
    /// Radiances that follow others.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub ties: Vec<Tie>,
    /// Power of each light at radiance 1 and size 1, W, and whether it grows with the square of the size; empty in
    /// bases of earlier versions.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub watts: Vec<(f64, bool)>,
    /// Whether each light is recorded white and with its colour, so that it may be seen in any; empty where none is.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub white: Vec<bool>,
    /// What the camera sees, by which pictures are denoised; `None` in bases of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub features: Option<StoredFeatures>,
}

/// What the camera sees in each pixel, row by row: seven little-endian f32, in Base64.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(transparent)]
pub struct StoredFeatures(String);

impl StoredFeatures {
    /// Numbers of a pixel: albedo, normal, disparity.
    const NUMBERS: usize = 7;

    /// Features as they are stored.
    #[must_use]
    pub fn new(features: &Features) -> Self {
        let Features { albedo, normal, disparity, .. } = features;
        let pixels = albedo.iter().zip(normal).zip(disparity);
        let numbers = pixels.flat_map(|((a, n), d)| a.iter().chain(n).chain([d]));
        Self(BASE64_STANDARD.encode(numbers.flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>()))
    }

    /// The features of a picture of this size; `None` where they are not of as many pixels, or no numbers.
    #[must_use]
    pub fn read(&self, [width, height]: [usize; 2]) -> Option<Features> {
        let bytes = BASE64_STANDARD.decode(&self.0).ok()?;
        let numbers: Vec<f32> = bytes.as_chunks().0.iter().map(|b| f32::from_le_bytes(*b)).collect();
        if bytes.len() != 4 * Self::NUMBERS * width * height || !numbers.iter().all(|v| v.is_finite()) {
            return None;
        }
        let pixels = numbers.as_chunks::<{ Self::NUMBERS }>().0;
        Some(Features {
            width,
            height,
            albedo: pixels.iter().map(|&[r, g, b, ..]| [r, g, b]).collect(),
            normal: pixels.iter().map(|&[_, _, _, x, y, z, _]| [x, y, z]).collect(),
            disparity: pixels.iter().map(|p| p[Self::NUMBERS - 1]).collect(),
        })
    }
}

/// A variable as it is stored, by its name.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct StoredVariable {
    /// `LIGHT.radiance`, `GROUP.radiance`, `LIGHT.size`, `background.value` and the like.
    pub name: String,
    /// Name of the light whose variable it is, where the variable is that of a group.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub light: Option<String>,
    /// Lower bound of the value.
    pub lower: f64,
    /// Upper bound of the value.
    pub upper: f64,
    /// Value at the neutral start.
    pub initial: f64,
    /// Map from the optimiser's unit interval.
    pub scale: Scale,
}

impl StoredVariable {
    /// Kind of the variable, and the index of its light in `lights`.
    fn of(&self, lights: &[String]) -> Option<(VariableKind, usize)> {
        let name = match (&self.light, self.name.rsplit_once('.')) {
            (Some(light), Some((_, suffix))) => format!("{light}.{suffix}"),
            _ => self.name.clone(),
        };
        VariableKind::of_name(&name, lights)
    }
}

/// Lengths of runs of pixels off and on the object in turn.
#[must_use]
pub fn runs(mask: &[bool]) -> Vec<usize> {
    let mut runs = Vec::new();
    let (mut on, mut run) = (false, 0);
    for &m in mask {
        if m != on {
            runs.push(run);
            (on, run) = (m, 0);
        }
        run += 1;
    }
    runs.push(run);
    runs
}

impl About {
    /// Index of the light whose radiance is the variable of a group of this name.
    #[must_use]
    pub fn group(&self, name: &str) -> Option<usize> {
        let is_group = |v: &&StoredVariable| {
            v.light.is_some() && v.name.rsplit_once('.').is_some_and(|(group, _)| group == name)
        };
        let (_, leader) = self.variables.iter().find(is_group)?.of(&self.lights)?;
        Some(leader)
    }

    /// Description of a scene, the lighting of what does not vary, and the variables, without features.
    #[must_use]
    pub fn new(
        scene: &Scene,
        fixed: &Lighting,
        aovs: &Aovs,
        variables: &ParamVector,
        measure: Measure,
    ) -> Self {
        Self {
            scene: scene.name.clone(),
            lights: scene.light_names().into_iter().map(str::to_owned).collect(),
            fixed: fixed.clone(),
            luminance: measure.luminance,
            view: measure.view,
            mask: runs(&aovs.mask),
            variables: variables
                .variables
                .iter()
                .map(|v| StoredVariable {
                    name: v.name.clone(),
                    light: Some(scene.lights[v.light].name.clone())
                        .filter(|light| v.kind.is_of_light() && v.kind.variable_name(light) != v.name),
                    lower: v.lower,
                    upper: v.upper,
                    initial: v.initial,
                    scale: v.scale,
                })
                .collect(),
            ties: variables.ties.clone(),
            white: Vec::new(),
            watts: scene
                .lights
                .iter()
                .map(|l| (f64::from(l.unit_power(if l.has_size() { 1.0 } else { l.size })), l.has_size()))
                .collect(),
            features: None,
        }
    }

    /// Whether the description fits the basis with which it was stored.
    #[must_use]
    pub fn fits(&self, basis: &TransportBasis) -> bool {
        let layout = basis.layout();
        let n = layout.lights.len();
        [self.lights.len(), self.fixed.radiance.len(), self.fixed.size.len()] == [n; 3]
            && [0, n].contains(&self.fixed.color.len())
            && [0, n].contains(&self.white.len())
            && [0, n].contains(&self.watts.len())
            && (self.white.is_empty() || layout.planes > 1)
            && self.mask.iter().try_fold(0_usize, |sum, &n| sum.checked_add(n)) == Some(layout.n_pixels())
            && self.variables.iter().all(|v| v.of(&self.lights).is_some())
            && self.ties.iter().all(|t| {
                let is_sound = t.brought.as_ref().is_none_or(|of| of.iter().all(Brought::is_sound));
                t.light < n && t.leader < n && t.factor.is_finite() && is_sound
            })
    }

    /// The same description, of a basis with the colour of its replicates, in which lights that are recorded white
    /// may be seen in any colour.
    #[must_use]
    pub fn with_colors(self, scene: &Scene, layout: &Layout) -> Self {
        if layout.planes == 1 {
            return self;
        }
        Self { white: scene.lights.iter().map(|light| light.color == Rgb::ONE).collect(), ..self }
    }

    /// Measure of luminance of the run that rendered the basis.
    #[must_use]
    pub fn measure(&self) -> Measure {
        Measure { view: self.view, luminance: self.luminance, color: false }
    }

    /// Mask of the main object, row by row from the top.
    #[must_use]
    pub fn mask(&self) -> Vec<bool> {
        self.mask.iter().enumerate().flat_map(|(i, &n)| std::iter::repeat_n(i % 2 == 1, n)).collect()
    }

    /// Variables of the run that rendered the basis; their units are not stored.
    #[must_use]
    pub fn variables(&self) -> ParamVector {
        let variables = self.variables.iter().filter_map(|v| {
            let (kind, light) = v.of(&self.lights)?;
            let StoredVariable { ref name, lower, upper, initial, scale, .. } = *v;
            Some(Variable { name: name.clone(), unit: "", lower, upper, initial, scale, kind, light })
        });
        ParamVector { variables: variables.collect(), ties: self.ties.clone() }
    }

    /// Lighting at the neutral start of the variables.
    #[must_use]
    pub fn lighting(&self) -> Lighting {
        let variables = self.variables();
        let initial: Vec<f64> = variables.variables.iter().map(|v| v.initial).collect();
        variables.lighting(self.fixed.clone(), &initial)
    }

    /// Objective of a target for the pictures of the basis.
    ///
    /// # Errors
    /// As [`Objective::new`].
    pub fn objective(&self, target: &Target, basis: &TransportBasis) -> Result<Objective, ObjectiveError> {
        let size = basis.layout().size;
        Objective::new(target, size.x as usize, size.y as usize, &self.mask())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::{SizeBins, ValueNodes};

    #[test]
    fn features_come_back_exactly_and_those_of_another_size_do_not() {
        let features = Features {
            width: 2,
            height: 1,
            albedo: vec![[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]],
            normal: vec![[0.0, 1.0, 0.0], [0.6, 0.0, 0.8]],
            disparity: vec![0.25, 0.0],
        };
        let stored = StoredFeatures::new(&features);
        assert_eq!(format!("{:?}", stored.read([2, 1])), format!("{:?}", Some(&features)));
        assert!(stored.read([1, 1]).is_none() && stored.read([2, 2]).is_none());
        assert!(StoredFeatures("not Base64".into()).read([2, 1]).is_none());
        let nan = Features { disparity: vec![f32::NAN; 2], ..features };
        assert!(StoredFeatures::new(&nan).read([2, 1]).is_none());
    }

    #[test]
    fn a_mask_whose_lengths_wrap_around_does_not_fit() {
        let layout = Layout::new((3, 2).into(), vec![SizeBins::Fixed(1.0)], ValueNodes::new(1.0, 1));
        let basis = TransportBasis::new(layout, 1);
        let fixed =
            Lighting { radiance: vec![1.0], size: vec![1.0], value: 1.0, exposure: 1.0, color: Vec::new() };
        let about = |mask: &[usize]| About {
            scene: String::new(),
            lights: vec!["key".into()],
            fixed: fixed.clone(),
            luminance: LuminanceMode::Srgb,
            view: ViewTransform::Srgb,
            mask: mask.into(),
            variables: Vec::new(),
            ties: Vec::new(),
            white: Vec::new(),
            watts: Vec::new(),
            features: None,
        };
        assert!(about(&[2, 4]).fits(&basis));
        assert!(!about(&[2, 3]).fits(&basis));
        assert!(!about(&[usize::MAX, 7]).fits(&basis));
    }
}
