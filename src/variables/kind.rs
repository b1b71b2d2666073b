//! What a kind of variable is.

use std::fmt;

use serde::{Serialize, Serializer};

use super::Range;
use crate::{lighting::Lighting, transport::LightingGradient};

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

    /// Bounds, start and scale of the variable that a light has where it is free, or the scene
    /// (`light` is then 0); `None` where it has no effect.
    fn range(&self, scene: &SurveyedScene, light: usize) -> Option<Range>;

    /// The value in a lighting.
    fn value<'x>(&self, x: &'x mut Lighting, light: usize) -> &'x mut f64;

    /// Derivative by the value of a number whose gradient by the lighting is given.
    fn derivative(&self, gradient: &LightingGradient, light: usize) -> f64;

    /// Lets a transport basis hold all values that the free variable of a light may take, or that of
    /// the scene (`light` is then 0).
    fn open(&self, _limits: Limits, _light: usize, _ranges: &mut BasisRanges) {}

    /// The value of a light's variable at a start that is matched to a target.
    fn matched_start(&self, range: &Range, _light: usize, _start: &MatchedStart) -> f64 {
        range.initial
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

    /// Least value of a light's variable for which samples are enough, where `least_sizes` are the
    /// least sizes per light within which enough samples lie.
    fn least_sampled(&self, range: &Range, _light: usize, _least_sizes: &[f64]) -> f64 {
        range.lower
    }

    /// What a user may do about an object that stays black, where the variable called `name` stands
    /// at `value`.
    fn advice_for_darkness(&self, _name: &str, _range: &Range, _value: f64) -> Option<String> {
        None
    }
}

/// Least and largest size of a light; `None` for a light without size.
pub type SizeBounds = Option<[f32; 2]>;

/// Bounds that geometry and materials set on the variables.
#[derive(Clone, Copy, Debug)]
pub struct Limits<'a> {
    /// Least and largest size per light, in the scene's order.
    pub sizes: &'a [SizeBounds],
    /// Least and largest value of the background; `None` without background.
    pub value: Option<[f32; 2]>,
}

/// What the survey found of a scene, from which the ranges of its variables follow. Vectors are by
/// light, in the scene's order.
#[derive(Clone, Debug)]
pub struct SurveyedScene<'a> {
    /// Bounds that geometry and materials set.
    pub limits: Limits<'a>,
    /// The author's sizes brought within their bounds.
    pub sizes: &'a [f64],
    /// Unit of the radiance.
    pub units: Vec<&'static str>,
    /// Upper bound that the author sets on the radiance.
    pub radiance_max: Vec<Option<f32>>,
    /// Radiance at which the light alone shows what it lights at
    /// [`BRIGHT`](super::survey::BRIGHT).
    pub bright: &'a [f64],
    /// Radiance at the neutral start.
    pub neutral: Vec<f64>,
}

/// What a transport basis must hold beyond a single lighting.
#[derive(Clone, Debug)]
pub struct BasisRanges {
    /// Least and largest size per light whose size varies.
    pub sizes: Vec<SizeBounds>,
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

/// A reference to one of [`KINDS`](super::KINDS).
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
pub struct VariableKind(pub(super) &'static dyn Kind);

impl VariableKind {
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
