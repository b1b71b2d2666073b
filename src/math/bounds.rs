//! Axis-aligned boxes.

use glam::Vec3;

/// An axis-aligned box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Corner with the least coordinates.
    pub lo: Vec3,
    /// Corner with the largest coordinates.
    pub hi: Vec3,
}

impl Bounds {
    /// Smallest box that contains `points`; without points `lo` is +∞ and `hi` −∞.
    #[must_use]
    pub fn of(points: impl IntoIterator<Item = Vec3>) -> Self {
        let empty = Self { lo: Vec3::INFINITY, hi: Vec3::NEG_INFINITY };
        points.into_iter().fold(empty, |b, p| Self { lo: b.lo.min(p), hi: b.hi.max(p) })
    }

    /// Smallest box that contains both boxes.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self { lo: self.lo.min(other.lo), hi: self.hi.max(other.hi) }
    }

    /// Side lengths along x, y and z.
    #[must_use]
    pub fn extent(&self) -> Vec3 {
        self.hi - self.lo
    }

    /// Length of the diagonal.
    #[must_use]
    pub fn diagonal(&self) -> f32 {
        self.extent().length()
    }

    /// Midpoint.
    #[must_use]
    pub fn center(&self) -> Vec3 {
        0.5 * (self.lo + self.hi)
    }

    /// Whether two boxes overlap or lie at most `gap` apart in every direction.
    #[must_use]
    pub fn touches(&self, other: &Self, gap: f32) -> bool {
        (self.lo - gap).cmple(other.hi).all() && (other.lo - gap).cmple(self.hi).all()
    }
}
