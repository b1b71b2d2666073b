//! Nodes of the background's value.
//!
//! At every vertex on a background material the scattering function is affine in
//! the value v, so light along a path is a polynomial in v, of a degree below the
//! path's length. It is carried by its values at as many nodes as it has
//! coefficients, where products of polynomials are products of numbers:
//! v_k = v_max (1 + cos(πk/(n−1)))/2, the Chebyshev points with both ends. Between
//! the nodes Lagrange's formula is exact.

/// Nodes of the background's value at which light is carried; in a rendered basis the first is the
/// largest value.
#[derive(Clone, Debug, PartialEq)]
pub struct ValueNodes(Vec<f64>);

impl ValueNodes {
    /// `n` Chebyshev nodes on `[0, largest]`, the largest first; a single node is `largest`.
    #[must_use]
    pub fn new(largest: f64, n: usize) -> Self {
        let node = |k: usize| match n {
            1 => largest,
            _ => 0.5 * largest * (1.0 + (std::f64::consts::PI * k as f64 / (n - 1) as f64).cos()),
        };
        Self((0..n).map(node).collect())
    }

    /// Nodes at these values, which differ.
    #[must_use]
    pub(super) fn at(values: Vec<f64>) -> Self {
        Self(values)
    }

    /// Two nodes that represent a tangent at `value`: `value` and `value` + 1.
    #[must_use]
    pub(super) fn tangent(value: f64) -> Self {
        Self(vec![value, value + 1.0])
    }

    /// Number of nodes.
    #[must_use]
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Whether there are no nodes, which is never so.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Values at the nodes.
    #[must_use]
    pub fn values(&self) -> &[f64] {
        &self.0
    }

    /// Lagrange weights of the nodes at the value `v`, and their derivatives by v.
    #[must_use]
    pub fn weights(&self, v: f64) -> (Vec<f64>, Vec<f64>) {
        let n = self.0.len();
        let quotient = |k: usize, j: usize| (v - self.0[j]) / (self.0[k] - self.0[j]);
        let product = |k: usize, without: usize| -> f64 {
            (0..n).filter(|&j| j != k && j != without).map(|j| quotient(k, j)).product()
        };
        let value = (0..n).map(|k| product(k, k)).collect();
        let slope = (0..n)
            .map(|k| {
                let terms = (0..n).filter(|&i| i != k);
                terms.map(|i| product(k, i) / (self.0[k] - self.0[i])).sum()
            })
            .collect();
        (value, slope)
    }

    /// Coefficients of (v/v_max)^k, k ascending, of the polynomial with the values `values` at the
    /// nodes.
    #[must_use]
    pub fn coefficients(&self, values: &[f64]) -> Vec<f64> {
        let largest = self.0[0];
        let x: Vec<f64> = self.0.iter().map(|v| v / largest).collect();
        // Newton's divided differences, then expanded.
        let mut divided = values.to_vec();
        for order in 1..x.len() {
            for i in (order..x.len()).rev() {
                divided[i] = (divided[i] - divided[i - 1]) / (x[i] - x[i - order]);
            }
        }
        let mut out = vec![0.0; x.len()];
        for i in (0..x.len()).rev() {
            for k in (1..out.len()).rev() {
                out[k] = out[k - 1] - x[i] * out[k];
            }
            out[0] = divided[i] - x[i] * out[0];
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polynomials_are_exact_between_the_nodes() {
        for n in [1, 2, 5, 8, 12] {
            let nodes = ValueNodes::new(1.1, n);
            assert_eq!(nodes.values()[0], 1.1);
            let c: Vec<f64> = (0..n).map(|k| 1.0 / (1.0 + k as f64)).collect();
            let p = |v: f64| c.iter().rev().fold(0.0, |a, c| a * (v / 1.1) + c);
            let at_nodes: Vec<f64> = nodes.values().iter().map(|&v| p(v)).collect();
            for v in [0.0, 0.05, 0.4, 0.99, 1.1] {
                let (w, d) = nodes.weights(v);
                let dot = |w: &[f64]| w.iter().zip(&at_nodes).map(|(w, p)| w * p).sum::<f64>();
                assert!((dot(&w) - p(v)).abs() < 1e-12, "{n} {v}");
                let h = 1e-5;
                let slope = (p(v + h) - p(v - h)) / (2.0 * h);
                assert!((dot(&d) - slope).abs() < 1e-8, "{n} {v}: {} {slope}", dot(&d));
            }
            for (found, c) in nodes.coefficients(&at_nodes).iter().zip(&c) {
                assert!((found - c).abs() < 1e-9, "{n}");
            }
        }
    }
}
