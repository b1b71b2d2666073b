//! Constraints that a scene's author sets on the variables, in the sidecar.

use serde::{Deserialize, Serialize};

use super::{Bond, Movement, VariableKind};

/// Kinds of variables that are free.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct FreeKinds(pub Vec<VariableKind>);

impl Default for FreeKinds {
    /// All usual kinds are free.
    fn default() -> Self {
        Self(VariableKind::all().filter(|kind| kind.is_usual()).collect())
    }
}

impl FreeKinds {
    /// All kinds, each once.
    #[must_use]
    pub fn all() -> Self {
        Self(VariableKind::words().collect())
    }

    /// These kinds and those that are free in the other.
    #[must_use]
    pub fn union(mut self, other: &Self) -> Self {
        for kind in &other.0 {
            if !self.0.contains(kind) {
                self.0.push(*kind);
            }
        }
        self
    }

    /// The kinds of some keywords; words that name none are left out.
    #[must_use]
    pub fn named(keywords: &[&str]) -> Self {
        Self(keywords.iter().filter_map(|word| VariableKind::named(word)).collect())
    }

    /// Whether the kind with a keyword is free.
    #[must_use]
    pub fn contains(&self, keyword: &str) -> bool {
        self.0.iter().any(|kind| kind.keyword() == keyword)
    }

    /// Kinds that are free in both.
    #[must_use]
    pub fn intersection(&self, other: &Self) -> Self {
        Self(self.0.iter().copied().filter(|kind| other.0.contains(kind)).collect())
    }
}

/// Freedom and bounds of the variables, as the scene's author wants them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Constraints {
    /// Kinds of variables that are free in the scene.
    pub free: FreeKinds,
    /// Freedom and bounds of each light's variables, in the scene's order.
    pub lights: Vec<LightConstraints>,
    /// Bounds of the background's value; `None` for those that the materials set.
    pub value_range: Option<[f32; 2]>,
    /// Region in which lamps may be placed.
    pub movement: Movement,
    /// Lights that follow others, leaders before their followers.
    pub bonds: Vec<Bond>,
    /// Names of groups of lights, with the light whose radiance is the group's variable.
    pub groups: Vec<(String, usize)>,
}

/// Freedom and bounds of the variables of a light.
#[derive(Clone, Debug, PartialEq)]
pub struct LightConstraints {
    /// Kinds of variables that are free for the light.
    pub free: FreeKinds,
    /// Bounds of the size; `None` for those that the geometry sets.
    pub size_range: Option<[f32; 2]>,
    /// Bounds of the colour's temperature, kelvin; `None` for the usual ones.
    pub temperature_range: Option<[f32; 2]>,
    /// Upper bound of the radiance; `None` for that of the survey.
    pub radiance_max: Option<f32>,
    /// Whether the light comes from the scene file and the sidecar does not name it, so that it may light
    /// nothing of the picture.
    pub is_from_file: bool,
    /// Whether the light stays where it is, also where others may be moved.
    pub stays: bool,
}

impl Default for LightConstraints {
    /// Everything may be free, and lie where the survey finds.
    fn default() -> Self {
        Self {
            free: FreeKinds::all(),
            size_range: None,
            temperature_range: None,
            radiance_max: None,
            is_from_file: false,
            stays: false,
        }
    }
}

impl LightConstraints {
    /// Nothing of the light varies, and it stays where it is.
    pub fn keep(&mut self) {
        self.free = FreeKinds(Vec::new());
        self.stays = true;
    }
}
