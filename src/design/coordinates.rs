//! Coordinates for descents, in which a light keeps its flux when its size changes.
//!
//! A larger light of the same flux hardly changes anything but the edges of shadows, so f_q has
//! a long curved valley along `L s² = const` for every light. With `L₀ = L (s/s₀)²` in the place
//! of L the valley is straight and lies along an axis. s₀ is the size at which a descent begins, where
//! the coordinates equal those of the unit cube.

use crate::variables::ParamVector;

/// Two free variables of a light: its flux is proportional to the first, and to a power of the second.
struct Pair {
    /// Index of the variable to which the flux is proportional.
    radiance: usize,
    /// Index of the variable to a power of which the flux is proportional.
    size: usize,
    /// Power of the second variable to which the flux is proportional.
    power: i32,
    /// Value s₀ of the second variable at which the coordinates equal those of the unit cube.
    origin: f64,
}

/// Coordinates around a point of the unit cube, in which lights keep their flux.
pub(super) struct Coordinates<'a> {
    variables: &'a ParamVector,
    pairs: Vec<Pair>,
}

impl<'a> Coordinates<'a> {
    /// Coordinates around the point `u`, which has the same coordinates as in the unit cube.
    pub fn around(u: &[f64], variables: &'a ParamVector) -> Self {
        let all = || variables.variables.iter().enumerate();
        let pairs = all().filter(|(_, v)| v.kind.flux_power() == Some(1) && v.upper > v.lower);
        let pairs = pairs.filter_map(|(radiance, of)| {
            let mut others = all().filter(|(i, v)| v.light == of.light && *i != radiance);
            let (size, power) = others.find_map(|(i, v)| Some((i, v.kind.flux_power()?)))?;
            Some(Pair { radiance, size, power, origin: variables.variables[size].decode(u[size]) })
        });
        Self { pairs: pairs.collect(), variables }
    }

    /// Point of the unit cube with the coordinates `y`; a radiance that would be above its bound is on it.
    pub fn to_cube(&self, y: &[f64]) -> Vec<f64> {
        let mut u = y.to_vec();
        for pair in &self.pairs {
            let of = &self.variables.variables[pair.radiance];
            let size = self.variables.variables[pair.size].decode(y[pair.size]);
            let radiance = of.decode(y[pair.radiance]) * (pair.origin / size).powi(pair.power);
            u[pair.radiance] = if radiance < of.upper { of.encode(radiance) } else { 1.0 };
        }
        u
    }

    /// The point `u` around which the coordinates lie, with components below `lower` raised to it at
    /// constant flux.
    pub fn not_below(&self, u: &[f64], lower: &[f64]) -> Vec<f64> {
        let y: Vec<f64> = u.iter().zip(lower).map(|(u, lower)| u.max(*lower)).collect();
        if y == u { y } else { self.to_cube(&y) }
    }

    /// Turns the gradient by `u = to_cube(y)` into that by `y`, in place.
    pub fn pull_back(&self, y: &[f64], u: &[f64], gradient: &mut [f64]) {
        for pair in &self.pairs {
            let [of, size] = [pair.radiance, pair.size].map(|i| &self.variables.variables[i]);
            let s = size.decode(y[pair.size]);
            let ratio = (pair.origin / s).powi(pair.power);
            let radiance = of.decode(y[pair.radiance]) * ratio;
            if radiance > of.upper {
                gradient[pair.radiance] = 0.0;
                continue;
            }
            let by_radiance = gradient[pair.radiance] / of.slope(u[pair.radiance]);
            gradient[pair.radiance] = by_radiance * ratio * of.slope(y[pair.radiance]);
            gradient[pair.size] -=
                by_radiance * f64::from(pair.power) * radiance / s * size.slope(y[pair.size]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::variables::{Scale, Variable, VariableKind};

    fn variables() -> ParamVector {
        let of = |lower, upper, scale, kind, light| Variable {
            name: format!("{light}.{kind}"),
            unit: "",
            lower,
            upper,
            initial: lower,
            scale,
            kind: VariableKind::named(kind).unwrap(),
            light,
        };
        ParamVector {
            ties: Vec::new(),
            variables: vec![
                of(0.0, 50.0, Scale::Perceptual, "radiance", 0),
                of(0.1, 4.0, Scale::Logarithmic, "size", 0),
                of(0.0, 9.0, Scale::Perceptual, "radiance", 1),
                of(0.0, 2.0, Scale::Perceptual, "background", 0),
            ],
        }
    }

    #[test]
    fn flux_stays_when_size_changes_and_bounds_hold() {
        let (variables, origin) = (variables(), [0.4, 0.6, 0.3, 0.2]);
        let c = Coordinates::around(&origin, &variables);
        let same = c.to_cube(&origin);
        assert!(same.iter().zip(&origin).all(|(a, b)| (a - b).abs() < 1e-12), "{same:?}");
        let flux = |u: &[f64]| {
            let x = variables.decode(u);
            x[0] * x[1] * x[1]
        };
        for size in [0.45, 0.5, 0.9, 1.0] {
            let u = c.to_cube(&[0.4, size, 0.3, 0.2]);
            assert!((flux(&u) / flux(&origin) - 1.0).abs() < 1e-9, "{size}");
            assert_eq!(u[1..], [size, 0.3, 0.2]);
        }
        assert_eq!(c.to_cube(&[0.9, 0.0, 0.3, 0.2])[0], 1.0);
        assert_eq!(c.not_below(&origin, &[0.0, 0.6, 0.0, 0.0]), origin);
        let raised = c.not_below(&origin, &[0.0, 0.7, 0.0, 0.0]);
        assert!(raised[1] == 0.7 && (flux(&raised) / flux(&origin) - 1.0).abs() < 1e-9, "{raised:?}");
    }

    #[test]
    fn derivatives_by_the_coordinates_agree_with_central_differences() {
        let (variables, origin) = (variables(), [0.4, 0.6, 0.3, 0.2]);
        let c = Coordinates::around(&origin, &variables);
        // Any smooth function of the cube.
        let f = |u: &[f64]| u[0] * u[0] * (1.0 + u[1]) + 3.0 * u[1] * u[2] + u[3] * u[0];
        let slopes =
            |u: &[f64]| [2.0 * u[0] * (1.0 + u[1]) + u[3], u[0] * u[0] + 3.0 * u[2], 3.0 * u[1], u[0]];
        for y in [origin, [0.3, 0.7, 0.5, 0.1], [0.02, 0.5, 0.9, 0.4], [0.95, 0.1, 0.5, 0.5]] {
            let u = c.to_cube(&y);
            let mut gradient = slopes(&u);
            c.pull_back(&y, &u, &mut gradient);
            for i in 0..y.len() {
                let at = |h: f64| {
                    let mut y = y;
                    y[i] += h;
                    f(&c.to_cube(&y))
                };
                let difference = (at(1e-6) - at(-1e-6)) / 2e-6;
                assert!((gradient[i] - difference).abs() < 1e-6, "{y:?} {i}: {} {difference}", gradient[i]);
            }
        }
    }
}
