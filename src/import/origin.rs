//! The origin of a scene that lies far from that of its file.
//!
//! A coordinate in metres of a map grid, 4,500,000.25, is off by a quarter metre as an `f32`. Positions
//! are therefore read as `f64` and, in a scene that is far from the origin, taken relative to a point
//! near it, [`Spread::origin`]; what goes out again is in the file's own coordinates.

use glam::DVec3;

use crate::embree::MAX_COORDINATE;

/// A scene is far from the origin when its centre is so many times its largest side away. An `f32` then
/// still resolves 2⁻²⁰ of the side, a hundredth of a pixel of the widest picture; a scene that is nearer
/// keeps its coordinates as they are.
const FAR: f64 = 8.0;

/// Where the points of a scene lie.
#[derive(Clone, Copy, Debug)]
pub struct Spread {
    lo: DVec3,
    hi: DVec3,
    sum: DVec3,
    n: u64,
}

impl Default for Spread {
    fn default() -> Self {
        Self { lo: DVec3::INFINITY, hi: DVec3::NEG_INFINITY, sum: DVec3::ZERO, n: 0 }
    }
}

impl Extend<DVec3> for Spread {
    /// Adds points; those that no scene can have are left out.
    fn extend<I: IntoIterator<Item = DVec3>>(&mut self, points: I) {
        let limit = DVec3::splat(f64::from(MAX_COORDINATE));
        for p in points.into_iter().filter(|p| p.abs().cmple(limit).all()) {
            self.lo = self.lo.min(p);
            self.hi = self.hi.max(p);
            self.sum += p;
            self.n += 1;
        }
    }
}

impl Spread {
    /// Whether a point is so far from the origin, measured by the scene's size, that an `f32` is too coarse.
    #[must_use]
    pub fn is_far(&self, p: DVec3) -> bool {
        self.n > 0 && p.abs().max_element() > FAR * (self.hi - self.lo).max_element()
    }

    /// The point that becomes the scene's origin: zero for a scene that is near it. Otherwise the mean of
    /// the points, since details lie where they are dense, to a multiple of the largest power of two below
    /// the scene's largest side, so that short decimals stay short.
    #[must_use]
    pub fn origin(&self) -> DVec3 {
        if !self.is_far(0.5 * (self.lo + self.hi)) {
            return DVec3::ZERO;
        }
        let side = (self.hi - self.lo).max_element();
        let step = side.max(f64::from(f32::MIN_POSITIVE)).log2().floor().exp2();
        (self.sum / self.n as f64 / step).round() * step
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn origin(points: &[DVec3]) -> DVec3 {
        let mut spread = Spread::default();
        spread.extend(points.iter().copied());
        spread.origin()
    }

    #[test]
    fn only_a_scene_far_from_the_origin_is_moved() {
        let cube = |at: DVec3| [at, at + DVec3::ONE, at + DVec3::new(3.0, 0.0, 1.0)];
        assert_eq!(origin(&[]), DVec3::ZERO);
        assert_eq!(origin(&cube(DVec3::ZERO)), DVec3::ZERO);
        assert_eq!(origin(&cube(DVec3::new(20.0, 0.0, -20.0))), DVec3::ZERO);
        assert_eq!(origin(&cube(DVec3::new(500_000.3, 0.0, 4_500_000.0))), DVec3::new(500_002.0, 0.0, 4.5e6));
        let broken = [DVec3::splat(f64::NAN), DVec3::splat(1e300), DVec3::ZERO, DVec3::ONE];
        assert_eq!(origin(&broken), DVec3::ZERO);
    }
}
