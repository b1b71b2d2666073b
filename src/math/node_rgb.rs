//! Light at several values of the background at once.

use super::Rgb;

/// A colour at each node of the background's value; the first node is the
/// largest value, at which it is largest. With one node it is a plain colour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NodeRgb<const N: usize>(pub [Rgb; N]);

impl<const N: usize> NodeRgb<N> {
    /// One at every node.
    pub const ONE: Self = Self([Rgb::ONE; N]);

    /// The colour at the largest value.
    #[must_use]
    pub fn largest(&self) -> Rgb {
        self.0[0]
    }

    /// Whether it is zero at the largest value, and so everywhere.
    #[must_use]
    pub fn is_zero(&self) -> bool {
        self.0[0] == Rgb::ZERO
    }

    /// Product with a colour that does not depend on the value.
    #[must_use]
    pub fn times(self, c: Rgb) -> Self {
        Self(self.0.map(|v| v * c))
    }

    /// Product with a number.
    #[must_use]
    pub fn scaled(self, s: f32) -> Self {
        Self(self.0.map(|v| v * s))
    }

    /// Product node by node.
    #[must_use]
    pub fn product(mut self, other: &Self) -> Self {
        for (a, b) in self.0.iter_mut().zip(&other.0) {
            *a *= *b;
        }
        self
    }

    /// Whether all are finite and none negative.
    #[must_use]
    pub fn is_radiance(&self) -> bool {
        self.0.iter().all(|c| c.is_finite() && c.min_element() >= 0.0)
    }
}
