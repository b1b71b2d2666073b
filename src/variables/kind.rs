//! Kinds of variables, and the data from which their ranges and starts follow.

use std::fmt;

use serde::{Serialize, Serializer};

use super::{
    Range,
    color::{Channel, Temperature},
};
use crate::{light::LightColor, lighting::Lighting, transport::LightingGradient};

/// Owner of the variables of a kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Owner {
    /// Each light has one, under its own name.
    Light,
    /// The scene as a whole has one, named after this part of it.
    Scene(&'static str),
}

/// A kind of variable.
pub trait Kind: fmt::Debug + Sync {
    /// Word for the kind in `free` of a sidecar and after `--free`.
    fn keyword(&self) -> &'static str;

    /// Description of the kind in a few words, for `--help`.
    fn help(&self) -> &'static str;

    /// Owner of the variables of the kind.
    fn owner(&self) -> Owner;

    /// Last part of a variable's name, `OWNER.suffix`.
    fn suffix(&self) -> &'static str;

    /// Whether variables of the kind are free where nobody says what is.
    fn is_usual(&self) -> bool {
        true
    }

    /// Bounds, start and scale of the variable of a light, or of the scene (`light` is then 0), if it is
    /// free; `None` if it has no effect.
    fn range(&self, scene: &SurveyedScene, light: usize) -> Option<Range>;

    /// The variable's value in a lighting.
    fn value<'x>(&self, x: &'x mut Lighting, light: usize) -> &'x mut f64;

    /// Derivative by the variable's value of a number whose gradient by the lighting `x` is `gradient`.
    fn derivative(&self, gradient: &LightingGradient, x: &Lighting, light: usize) -> f64;

    /// Extends the ranges of a transport basis to all values that the free variable of a light, or of the
    /// scene (`light` is then 0), may take.
    fn open(&self, _limits: Limits, _light: usize, _ranges: &mut BasisRanges) {}

    /// Value of the variable of a light, or of the scene, at a start that is matched to a target.
    fn matched_start(&self, range: &Range, _light: usize, _start: &MatchedStart) -> f64 {
        range.initial
    }

    /// Power of the variable to which the flux of its light is proportional; `None` if the flux does not
    /// depend on it.
    fn flux_power(&self) -> Option<i32> {
        None
    }

    /// Whether values from the whole range of the variable are tried at constant flux, because f_q falls
    /// slowly but far along it and noise stops a descent.
    fn is_tried(&self) -> bool {
        false
    }

    /// Lower bound of the variable below which too few samples fall inside the light for a reliable
    /// estimate; `least_sizes` are the least sizes of each light within which enough samples fall, empty
    /// where every size has enough.
    fn least_sampled(&self, range: &Range, _light: usize, _least_sizes: &[f64]) -> f64 {
        range.lower
    }

    /// Advice to the user about an object that stays black, where the variable called `name` has the value
    /// `value`.
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

/// Results of the survey of a scene, from which the ranges of its variables follow. Vectors are by
/// light, in the scene's order.
#[derive(Clone, Debug)]
pub struct SurveyedScene<'a> {
    /// Bounds that geometry and materials set on the variables.
    pub limits: Limits<'a>,
    /// Size of each light, the author's brought within its bounds.
    pub sizes: &'a [f64],
    /// Unit of each light's radiance.
    pub units: Vec<&'static str>,
    /// Upper bound that the author sets on each light's radiance; `None` without one.
    pub radiance_max: Vec<Option<f32>>,
    /// Radiance of each light at which it alone shows what it lights at the display luminance
    /// [`BRIGHT`](super::survey::BRIGHT).
    pub bright: &'a [f64],
    /// Radiance of each light at the neutral start.
    pub neutral: Vec<f64>,
    /// Exposure that the author gave, or the command line.
    pub exposure: f64,
    /// Colour of each light at the neutral start.
    pub colors: Vec<LightColor>,
    /// Bounds that the author sets on the temperature of each light's colour; `None` without any.
    pub temperature_range: Vec<Option<[f32; 2]>>,
}

/// Ranges of sizes and of the background's value that a transport basis must hold.
#[derive(Clone, Debug)]
pub struct BasisRanges {
    /// Least and largest size of each light; `None` for a light whose size does not vary.
    pub sizes: Vec<SizeBounds>,
    /// Largest value of the background; `None` if that does not vary.
    pub largest_value: Option<f32>,
    /// Whether the colour of a light varies.
    pub colors: bool,
}

/// A start at which the main object has the mean luminance of a target.
#[derive(Clone, Debug)]
pub struct MatchedStart<'a> {
    /// Indices of the lights that shine.
    pub lit: &'a [usize],
    /// Radiance of each light at which it contributes the same mean luminance as the others of `lit`.
    pub radiance: Vec<f64>,
    /// Factor on the background's value that brings the background's mean luminance to its own target.
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
    /// Whether each light has a variable of this kind of its own.
    #[must_use]
    pub fn is_of_light(self) -> bool {
        self.owner() == Owner::Light
    }

    /// Whether the kind is a colour of a light.
    #[must_use]
    pub fn is_of_color(self) -> bool {
        [Temperature::KEYWORD, Channel::KEYWORD].contains(&self.keyword())
    }

    /// Name of the variable of this kind that a light, or the scene, has.
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
