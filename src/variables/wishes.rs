//! What a scene's author wishes of the variables.

use serde::{Deserialize, Serialize};

use super::VariableKind;

/// Kinds of variables that may vary.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct FreeKinds(pub Vec<VariableKind>);

impl Default for FreeKinds {
    /// All of them.
    fn default() -> Self {
        Self(VariableKind::all().collect())
    }
}

impl FreeKinds {
    /// The kinds of some keywords; words that name none are left out.
    #[must_use]
    pub fn named(keywords: &[&str]) -> Self {
        Self(keywords.iter().filter_map(|word| VariableKind::named(word)).collect())
    }

    /// Whether the kind of a keyword may vary.
    #[must_use]
    pub fn contains(&self, keyword: &str) -> bool {
        self.0.iter().any(|kind| kind.keyword() == keyword)
    }

    /// The kinds that are in both.
    #[must_use]
    pub fn intersection(&self, other: &Self) -> Self {
        Self(self.0.iter().copied().filter(|kind| other.0.contains(kind)).collect())
    }
}

/// Bounds and freedom of the variables, as the scene's author wants them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Wishes {
    /// What may vary at all.
    pub free: FreeKinds,
    /// Wishes per light, in the scene's order.
    pub lights: Vec<LightWishes>,
    /// Bounds of the background's value.
    pub value_range: Option<[f32; 2]>,
}

/// What the author wishes of a light.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LightWishes {
    /// What may vary of it.
    pub free: FreeKinds,
    /// Bounds of the size.
    pub size_range: Option<[f32; 2]>,
    /// Upper bound of the radiance.
    pub radiance_max: Option<f32>,
    /// Whether the scene file happens to have the light and the sidecar does not name it: it may
    /// then light nothing.
    pub is_from_file: bool,
}
