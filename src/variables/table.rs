//! The table of all kinds of variables.

use serde::{Deserialize, Deserializer, de::Error as _};

use super::{
    Kind, Owner, VariableKind,
    background::Background,
    color::{Channel, Temperature},
    exposure::Exposure,
    radiance::Radiance,
    size::Size,
};

/// All kinds of variables, in the order in which the variables of a light are listed.
pub static KINDS: [&dyn Kind; 8] =
    [&Radiance, &Size, &Temperature, &Channel(0), &Channel(1), &Channel(2), &Background, &Exposure];

/// Keywords of all kinds, in the order of [`KINDS`], each once.
const KEYWORDS: [&str; 6] = [
    Radiance::KEYWORD,
    Size::KEYWORD,
    Temperature::KEYWORD,
    Channel::KEYWORD,
    Background::KEYWORD,
    Exposure::KEYWORD,
];

impl VariableKind {
    /// All kinds of variables, in the order of [`KINDS`].
    pub fn all() -> impl Iterator<Item = Self> {
        KINDS.into_iter().map(Self)
    }

    /// The first kind with each keyword, in the order of [`KINDS`].
    pub fn words() -> impl Iterator<Item = Self> {
        KEYWORDS.iter().filter_map(|word| Self::named(word))
    }

    /// First kind with a keyword; `None` if there is none.
    #[must_use]
    pub fn named(keyword: &str) -> Option<Self> {
        Self::all().find(|kind| kind.keyword() == keyword)
    }

    /// Kind and light, by its index in `lights`, of the variable called `name`; the index is 0 for a
    /// variable of the scene. `None` if there is no such variable.
    #[must_use]
    pub fn of_name(name: &str, lights: &[String]) -> Option<(Self, usize)> {
        let (owner, suffix) = name.rsplit_once('.')?;
        let of_light = |kind: &Self| kind.owner() == Owner::Light && kind.suffix() == suffix;
        let of_scene = |kind: &Self| match kind.owner() {
            Owner::Scene(part) => part == owner && kind.suffix() == suffix,
            Owner::Light => false,
        };
        if let Some(kind) = Self::all().find(of_scene) {
            return Some((kind, 0));
        }
        Some((Self::all().find(of_light)?, lights.iter().position(|light| light == owner)?))
    }
}

impl<'de> Deserialize<'de> for VariableKind {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let word = String::deserialize(deserializer)?;
        Self::named(&word).ok_or_else(|| D::Error::unknown_variant(&word, &KEYWORDS))
    }
}
