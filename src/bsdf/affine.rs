//! Scattering as a function of the base colour's factor.

use std::ops::{Add, Mul};

use crate::math::Rgb;

/// `coat + v·body`: every scattering function is affine in the factor v on its
/// base colour (diffuse reflectance, metal reflectance at normal incidence).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Affine {
    /// What does not depend on the base colour.
    pub coat: Rgb,
    /// What is proportional to it, at factor 1.
    pub body: Rgb,
}

impl Affine {
    /// Zero.
    pub const ZERO: Self = Self { coat: Rgb::ZERO, body: Rgb::ZERO };

    /// Independent of the base colour.
    #[must_use]
    pub fn coat(coat: Rgb) -> Self {
        Self { coat, body: Rgb::ZERO }
    }

    /// Proportional to the base colour.
    #[must_use]
    pub fn body(body: Rgb) -> Self {
        Self { coat: Rgb::ZERO, body }
    }

    /// Value at the factor `v`.
    #[must_use]
    pub fn at(&self, v: f32) -> Rgb {
        self.coat + self.body * v
    }

    /// Whether it is zero at every factor.
    #[must_use]
    pub fn is_zero(&self) -> bool {
        *self == Self::ZERO
    }
}

impl Add for Affine {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self { coat: self.coat + other.coat, body: self.body + other.body }
    }
}

impl Mul<f32> for Affine {
    type Output = Self;
    fn mul(self, s: f32) -> Self {
        Self { coat: self.coat * s, body: self.body * s }
    }
}
