//! Free variables of a run, and their map from the unit cube to a lighting.

use std::borrow::Cow;

use serde::Serialize;

use super::{MatchedStart, Range, Scale, Tie, VariableKind, exposure::Exposure};
use crate::{
    lighting::Lighting,
    math::display::{eotf_srgb, eotf_srgb_derivative, oetf_srgb},
    transport::LightingGradient,
};

/// A free variable.
#[derive(Clone, Debug, Serialize)]
pub struct Variable {
    /// `LIGHT.radiance`, `LIGHT.size`, `background.value` or `camera.exposure`.
    pub name: String,
    /// Unit of the value.
    pub unit: &'static str,
    /// Lower bound of the value.
    pub lower: f64,
    /// Upper bound of the value.
    pub upper: f64,
    /// Value at the neutral start.
    pub initial: f64,
    /// Map from the optimiser's unit interval to the value.
    pub scale: Scale,
    /// Kind of the variable.
    #[serde(skip)]
    pub kind: VariableKind,
    /// Index of the light to which the variable belongs; 0 for a variable of the scene.
    #[serde(skip)]
    pub light: usize,
}

impl Variable {
    /// Value at `u ∈ [0, 1]`.
    #[must_use]
    pub fn decode(&self, u: f64) -> f64 {
        let t = match self.scale {
            Scale::Linear => u,
            Scale::Perceptual => eotf_srgb(u),
            Scale::Logarithmic => return self.lower * (self.upper / self.lower).powf(u),
            Scale::Reciprocal => return 1.0 / (1.0 / self.lower + self.reciprocals() * u),
        };
        self.lower + (self.upper - self.lower) * t
    }

    /// Derivative of [`Self::decode`] at `u`.
    #[must_use]
    pub fn slope(&self, u: f64) -> f64 {
        match self.scale {
            Scale::Linear => self.upper - self.lower,
            Scale::Perceptual => (self.upper - self.lower) * eotf_srgb_derivative(u),
            Scale::Logarithmic => self.decode(u) * self.ratio(),
            Scale::Reciprocal => -self.reciprocals() * self.decode(u).powi(2),
        }
    }

    fn ratio(&self) -> f64 {
        (self.upper / self.lower).ln()
    }

    fn reciprocals(&self) -> f64 {
        1.0 / self.upper - 1.0 / self.lower
    }

    /// Unit, bounds, start and scale.
    fn range(&self) -> Range {
        let Self { unit, lower, upper, initial, scale, .. } = *self;
        Range { unit, lower, upper, initial, scale }
    }

    /// Value at a start that is matched to a target.
    #[must_use]
    pub fn matched_start(&self, start: &MatchedStart) -> f64 {
        self.kind.matched_start(&self.range(), self.light, start)
    }

    /// Lower bound of the value below which too few samples fall inside the light for a reliable estimate;
    /// `least_sizes` are the least sizes of each light within which enough samples fall, empty where every
    /// size has enough.
    #[must_use]
    pub fn least_sampled(&self, least_sizes: &[f64]) -> f64 {
        self.kind.least_sampled(&self.range(), self.light, least_sizes)
    }

    /// Advice to the user about an object that stays black, where the variable has the value `value`.
    #[must_use]
    pub fn advice_for_darkness(&self, value: f64) -> Option<String> {
        self.kind.advice_for_darkness(&self.name, &self.range(), value)
    }

    /// `u` at which the variable has a value, cut to [0, 1]: the inverse of [`Self::decode`].
    #[must_use]
    pub fn encode(&self, value: f64) -> f64 {
        if self.upper <= self.lower {
            return 0.0;
        }
        let t = ((value - self.lower) / (self.upper - self.lower)).clamp(0.0, 1.0);
        match self.scale {
            Scale::Linear => t,
            Scale::Perceptual => oetf_srgb(t),
            Scale::Logarithmic => (value / self.lower).max(1.0).ln().min(self.ratio()) / self.ratio(),
            Scale::Reciprocal => ((1.0 / value - 1.0 / self.lower) / self.reciprocals()).clamp(0.0, 1.0),
        }
    }
}

/// All free variables of a run.
///
/// ```
/// use lightopt_embree::{
///     import,
///     lighting::Lighting,
///     variables::{ParamVector, Scale, Variable, VariableKind},
/// };
///
/// let scene = import::load("tests/mitsuba/scenes/cornell.obj".as_ref())?.scene;
/// let size = Variable {
///     name: "ceiling.size".into(),
///     unit: "1",
///     lower: 0.25,
///     upper: 4.0,
///     initial: 1.0,
///     scale: Scale::Logarithmic,
///     kind: VariableKind::named("size").expect("is a kind"),
///     light: 0,
/// };
/// let variables = ParamVector { variables: vec![size], ..ParamVector::default() };
///
/// // The optimiser works on the unit cube; half-way of a logarithmic scale is the geometric mean.
/// assert_eq!(variables.start(), [0.5]);
/// let lighting = variables.lighting(Lighting::authored(&scene), &variables.decode(&[1.0]));
/// assert!((lighting.size[0] - 4.0).abs() < 1e-12);
/// # Ok::<(), import::ImportError>(())
/// ```
#[derive(Clone, Debug, Default, Serialize)]
#[serde(transparent)]
pub struct ParamVector {
    /// Variables in the order of the optimiser's components.
    pub variables: Vec<Variable>,
    /// Radiances that follow others, leaders before their followers.
    #[serde(skip)]
    pub ties: Vec<Tie>,
}

impl ParamVector {
    /// Number of variables.
    #[must_use]
    pub fn len(&self) -> usize {
        self.variables.len()
    }

    /// Whether the exposure is among the variables.
    #[must_use]
    pub fn vary_exposure(&self) -> bool {
        self.variables.iter().any(|v| v.kind.keyword() == Exposure::KEYWORD)
    }

    /// Whether there are no variables.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.variables.is_empty()
    }

    /// Neutral start as a point of the unit cube.
    #[must_use]
    pub fn start(&self) -> Vec<f64> {
        self.variables.iter().map(|v| v.encode(v.initial)).collect()
    }

    /// Values at the point `u` of the unit cube.
    #[must_use]
    pub fn decode(&self, u: &[f64]) -> Vec<f64> {
        self.variables.iter().zip(u).map(|(v, &u)| v.decode(u)).collect()
    }

    /// Values by the names of the variables, in order.
    #[must_use]
    pub fn named(&self, values: &[f64]) -> serde_json::Map<String, serde_json::Value> {
        self.variables.iter().zip(values).map(|(v, &x)| (v.name.clone(), x.into())).collect()
    }

    /// The lighting `x` with the variables at `values`.
    #[must_use]
    pub fn lighting(&self, mut x: Lighting, values: &[f64]) -> Lighting {
        for (v, &value) in self.variables.iter().zip(values) {
            *v.kind.value(&mut x, v.light) = value;
        }
        for tie in &self.ties {
            x.radiance[tie.light] = tie.ratio(&x).0 * x.radiance[tie.leader];
        }
        x
    }

    /// Writes the gradient of a number by `u` to `gradient`, from its gradient by the lighting `x` at `u`.
    pub fn pull_back(&self, u: &[f64], x: &Lighting, by_lighting: &LightingGradient, gradient: &mut [f64]) {
        let mut carried = Cow::Borrowed(by_lighting);
        for tie in self.ties.iter().rev() {
            let (ratio, by_sizes) = tie.ratio(x);
            let by_follower = carried.radiance[tie.light];
            let to = carried.to_mut();
            to.radiance[tie.leader] += ratio * by_follower;
            for (light, by_size) in [tie.leader, tie.light].into_iter().zip(by_sizes) {
                to.size[light] += by_size * x.radiance[tie.leader] * by_follower;
            }
        }
        let by_lighting = &*carried;
        for ((v, &u), g) in self.variables.iter().zip(u).zip(gradient) {
            *g = v.kind.derivative(by_lighting, x, v.light) * v.slope(u);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The map from fewer variables to the radiances, and its transpose: the gradient of Σ c_l·L_l by the
    /// leader's radiance is that along all that follow it.
    #[test]
    fn ties_carry_values_forth_and_gradients_back() {
        let key = Variable {
            name: "key.radiance".into(),
            unit: "1",
            lower: 0.0,
            upper: 10.0,
            initial: 4.0,
            scale: Scale::Linear,
            kind: VariableKind::named("radiance").unwrap(),
            light: 0,
        };
        let tie = |light, leader, factor| Tie { light, leader, factor, brought: None };
        let v = ParamVector { variables: vec![key], ties: vec![tie(2, 0, 0.25), tie(1, 2, 0.5)] };
        let fixed = Lighting {
            radiance: vec![1.0; 4],
            size: vec![1.0; 4],
            value: 1.0,
            exposure: 1.0,
            color: Vec::new(),
        };
        let x = v.lighting(fixed, &[8.0]);
        assert_eq!(x.radiance, [8.0, 1.0, 2.0, 1.0]);
        let mut by_lighting = LightingGradient::zero(4);
        by_lighting.radiance = vec![1.0, 10.0, 100.0, 1000.0];
        let mut gradient = [0.0];
        v.pull_back(&[0.8], &x, &by_lighting, &mut gradient);
        assert!((gradient[0] - 10.0 * (1.0 + 0.125 * 10.0 + 0.25 * 100.0)).abs() < 1e-12);
    }

    #[test]
    fn scales_invert_and_a_light_that_is_off_can_come_on() {
        for (scale, lower) in [
            (Scale::Linear, 0.0),
            (Scale::Perceptual, 0.0),
            (Scale::Logarithmic, 0.5),
            (Scale::Reciprocal, 2.0),
        ] {
            let v = Variable {
                name: "a".into(),
                unit: "",
                lower,
                upper: 8.0,
                initial: 1.0,
                scale,
                kind: VariableKind::named("background").unwrap(),
                light: 0,
            };
            for i in 0..=10 {
                let u = f64::from(i) / 10.0;
                assert!((v.encode(v.decode(u)) - u).abs() < 1e-12);
            }
            assert!(v.decode(0.0) == lower && (v.decode(1.0) - 8.0).abs() < 1e-12);
            assert!((v.decode(1e-6) - lower) / 1e-6 > 0.05 * 8.0);
            for u in [0.01, 0.3, 0.8] {
                let difference = (v.decode(u + 1e-6) - v.decode(u - 1e-6)) / 2e-6;
                assert!((v.slope(u) / difference - 1.0).abs() < 1e-6, "{scale:?} {u}");
            }
        }
    }
}
