//! What a kind of variable is, and the table of all.

use std::fmt;

use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error as _};

use super::{
    Fitted, Range, Survey, Variable, Wishes, background::Background, radiance::Radiance, size::Size,
};
use crate::{lighting::Lighting, transport::LightingGradient};

/// All kinds, in the order in which the variables of a light are listed.
pub static KINDS: [&dyn Kind; 3] = [&Radiance, &Size, &Background];

/// Keywords of all kinds, in the order of [`KINDS`].
pub const KEYWORDS: [&str; 3] = [Radiance::KEYWORD, Size::KEYWORD, Background::KEYWORD];

/// What has a variable of a kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Owner {
    /// Each light, under its own name.
    Light,
    /// The scene as a whole; variables are then named after this part of it.
    Scene(&'static str),
}

/// A kind of variable.
pub trait Kind: fmt::Debug + Sync {
    /// The word for it in `free` of a sidecar and after `--free`.
    fn keyword(&self) -> &'static str;

    /// What it varies, in a few words for `--help`.
    fn help(&self) -> &'static str;

    /// Who has variables of this kind.
    fn owner(&self) -> Owner;

    /// The last part of a variable's name, `OWNER.suffix`.
    fn suffix(&self) -> &'static str;

    /// Bounds and start of the variable of a light, or of the scene (`light` is then 0); `None`
    /// where it is not free or has no effect.
    fn range(&self, survey: &Survey, light: usize) -> Option<Range>;

    /// The value in a lighting.
    fn value<'x>(&self, x: &'x mut Lighting, light: usize) -> &'x mut f64;

    /// Derivative by the value of a number whose gradient by the lighting is given.
    fn derivative(&self, gradient: &LightingGradient, light: usize) -> f64;

    /// Lets a transport basis hold all values that the variable may take.
    fn open(&self, _fitted: &Fitted, _wishes: &Wishes, _ranges: &mut BasisRanges) {}

    /// The value of variable `v` at a start that is matched to a target.
    fn matched_start(&self, v: &Variable, _start: &MatchedStart) -> f64 {
        v.initial
    }

    /// Power of the variable to which its light's flux is proportional; `None` for a variable that
    /// is no factor of it.
    fn flux_power(&self) -> Option<i32> {
        None
    }

    /// Whether f_q falls slowly but far along the variable, so that noise holds a descent: values
    /// from all of its range are then tried, at constant flux.
    fn is_tried(&self) -> bool {
        false
    }

    /// Least value of variable `v` for which samples are enough, where `least_sizes` are the least
    /// sizes per light within which enough samples lie.
    fn least_sampled(&self, v: &Variable, _least_sizes: &[f64]) -> f64 {
        v.lower
    }

    /// What a user may do about an object that stays black, where variable `v` stands at `value`.
    fn advice_for_darkness(&self, _v: &Variable, _value: f64) -> Option<String> {
        None
    }
}

/// What a transport basis must hold beyond a single lighting.
#[derive(Clone, Debug)]
pub struct BasisRanges {
    /// Least and largest size per light whose size varies.
    pub sizes: Vec<Option<[f32; 2]>>,
    /// Largest value of a background that varies.
    pub largest_value: Option<f32>,
}

/// A start at which the object has the brightness of a target.
#[derive(Clone, Debug)]
pub struct MatchedStart<'a> {
    /// Indices of the lights that shine.
    pub lit: &'a [usize],
    /// Radiance per light at which it brings the share of it that it shall bring.
    pub radiance: Vec<f64>,
    /// Factor on the background's value that brings the background nearest to its own target.
    pub value: f64,
}

/// A reference to one of [`KINDS`].
///
/// ```
/// use lightopt_embree::variables::VariableKind;
///
/// let lights = ["key".to_owned(), "rim".to_owned()];
/// let (kind, light) = VariableKind::of_name("rim.size", &lights).expect("a variable of a light");
/// assert_eq!((kind.keyword(), light), ("size", 1));
/// assert!(VariableKind::of_name("sun.size", &lights).is_none());
/// ```
#[derive(Clone, Copy)]
pub struct VariableKind(&'static dyn Kind);

impl VariableKind {
    /// All kinds.
    pub fn all() -> impl Iterator<Item = Self> {
        KINDS.into_iter().map(Self)
    }

    /// The kind of a keyword.
    #[must_use]
    pub fn named(keyword: &str) -> Option<Self> {
        Self::all().find(|kind| kind.keyword() == keyword)
    }

    /// The kind and the light's index that a variable's name means; the index is 0 for variables
    /// of the scene.
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

    /// The name of the variable that a light, or the scene, has of this kind.
    #[must_use]
    pub fn variable_name(self, light: &str) -> String {
        let owner = match self.owner() {
            Owner::Light => light,
            Owner::Scene(part) => part,
        };
        format!("{owner}.{}", self.suffix())
    }
}

impl std::ops::Deref for VariableKind {
    type Target = dyn Kind;
    fn deref(&self) -> &Self::Target {
        self.0
    }
}

impl PartialEq for VariableKind {
    fn eq(&self, other: &Self) -> bool {
        self.keyword() == other.keyword()
    }
}

impl Eq for VariableKind {}

impl fmt::Debug for VariableKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.keyword())
    }
}

impl Serialize for VariableKind {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.keyword())
    }
}

impl<'de> Deserialize<'de> for VariableKind {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let word = String::deserialize(deserializer)?;
        Self::named(&word).ok_or_else(|| D::Error::unknown_variant(&word, &KEYWORDS))
    }
}
