//! Coordinates for descents: a light keeps its flux when its size changes.
//!
//! A larger light of the same flux hardly changes anything but the edges of shadows, so f_q has
//! a long curved valley along `L s² = const` for every light. With `L₀ = L (s/s₀)²` in the place
//! of L it is straight and lies along an axis. s₀ is the size where a descent begins: there
//! both coordinates are the same.

use crate::params::{ParamVector, VariableKind};

/// A light of which radiance and size are free.
struct Pair {
    radiance: usize,
    size: usize,
    /// s₀.
    origin: f64,
}

/// Coordinates around a point of the unit cube.
pub(super) struct Coordinates<'a> {
    variables: &'a ParamVector,
    pairs: Vec<Pair>,
}

impl<'a> Coordinates<'a> {
    pub fn around(u: &[f64], variables: &'a ParamVector) -> Self {
        let of = |kind| variables.variables.iter().position(|v| v.kind == kind);
        let pairs = variables.variables.iter().enumerate().filter_map(|(radiance, v)| {
            let VariableKind::Radiance(light) = v.kind else { return None };
            let size = of(VariableKind::Size(light))?;
            Some(Pair { radiance, size, origin: variables.variables[size].decode(u[size]) })
        });
        Self { pairs: pairs.collect(), variables }
    }

    /// The point of the unit cube; a radiance that would be above its bound is on it.
    pub fn to_cube(&self, y: &[f64]) -> Vec<f64> {
        let mut u = y.to_vec();
        for pair in &self.pairs {
            let of = &self.variables.variables[pair.radiance];
            let size = self.variables.variables[pair.size].decode(y[pair.size]);
            let radiance = of.decode(y[pair.radiance]) * (pair.origin / size).powi(2);
            u[pair.radiance] = of.encode(radiance.min(of.upper)).clamp(0.0, 1.0);
        }
        u
    }

    /// Turns derivatives by `u = to_cube(y)` into such by `y`.
    pub fn pull_back(&self, y: &[f64], u: &[f64], gradient: &mut [f64]) {
        for pair in &self.pairs {
            let [of, size] = [pair.radiance, pair.size].map(|i| &self.variables.variables[i]);
            let s = size.decode(y[pair.size]);
            let ratio = (pair.origin / s).powi(2);
            let radiance = of.decode(y[pair.radiance]) * ratio;
            if radiance > of.upper {
                gradient[pair.radiance] = 0.0;
                continue;
            }
            let by_radiance = gradient[pair.radiance] / of.slope(u[pair.radiance]);
            gradient[pair.radiance] = by_radiance * ratio * of.slope(y[pair.radiance]);
            gradient[pair.size] -= by_radiance * 2.0 * radiance / s * size.slope(y[pair.size]);
        }
    }
}
