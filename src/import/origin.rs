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

/// The same for a dense part of a scene, of which strays or a wide ground are no part: an `f32` then still resolves
/// 2⁻¹⁸ of its side, and a scene with a small dense thing away from its middle keeps its coordinates.
const DENSE_FAR: f64 = 64.0;
/// Points at most from which quartiles are taken: as many as make them good to a few hundredths of a side.
const MAX_SAMPLED: usize = 4096;

/// Where the points of a scene lie.
#[derive(Clone, Debug)]
pub struct Spread {
    lo: DVec3,
    hi: DVec3,
    sum: DVec3,
    n: u64,
    /// Every `stride`-th point.
    sampled: Vec<DVec3>,
    stride: u64,
}

impl Default for Spread {
    fn default() -> Self {
        let (lo, hi) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        Self { lo, hi, sum: DVec3::ZERO, n: 0, sampled: Vec::new(), stride: 1 }
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
            if self.n.is_multiple_of(self.stride) {
                self.sample(p);
            }
            self.n += 1;
        }
    }
}

impl Spread {
    fn sample(&mut self, p: DVec3) {
        self.sampled.push(p);
        if self.sampled.len() == MAX_SAMPLED {
            let mut i = 0;
            self.sampled.retain(|_| {
                i += 1;
                i % 2 == 1
            });
            self.stride *= 2;
        }
    }

    /// Quartiles of each coordinate: the first, the median, the third.
    fn quartiles(&self) -> [DVec3; 3] {
        let of = |axis: usize| {
            let mut values: Vec<f64> = self.sampled.iter().map(|p| p[axis]).collect();
            values.sort_by(f64::total_cmp);
            let last = values.len().saturating_sub(1);
            [1, 2, 3].map(|k| values.get(last * k / 4).copied().unwrap_or(0.0))
        };
        let [x, y, z] = [0, 1, 2].map(of);
        [0, 1, 2].map(|k| DVec3::new(x[k], y[k], z[k]))
    }

    /// Middle and largest side of the part of the scene that counts: of all, or of the dense part where this is
    /// small and far.
    fn part(&self) -> (DVec3, f64) {
        let whole = (self.sum / self.n.max(1) as f64, (self.hi - self.lo).max_element());
        let [first, median, third] = self.quartiles();
        let side = 2.0 * (third - first).max_element();
        let is_dense = side > 0.0 && median.abs().max_element() > DENSE_FAR * side;
        if self.has_far_middle() || !is_dense { whole } else { (median, side) }
    }

    /// Whether the middle of the whole scene is far from the origin.
    fn has_far_middle(&self) -> bool {
        let side = (self.hi - self.lo).max_element();
        self.n > 0 && (0.5 * (self.lo + self.hi)).abs().max_element() > FAR * side
    }

    /// Whether a point is so far from the origin, measured by the scene's size, that an `f32` is too coarse.
    #[must_use]
    pub fn is_far(&self, p: DVec3) -> bool {
        self.n > 0 && p.abs().max_element() > FAR * self.part().1
    }

    /// The point that becomes the scene's origin: zero for a scene that is near it. Otherwise the mean of
    /// the points, since details lie where they are dense, or the median of a scene that is dense in a small part
    /// and has points elsewhere, to a multiple of the largest power of two below the side of that part, so that
    /// short decimals stay short.
    #[must_use]
    pub fn origin(&self) -> DVec3 {
        let (middle, side) = self.part();
        if self.n == 0 || !(self.has_far_middle() || middle.abs().max_element() > DENSE_FAR * side) {
            return DVec3::ZERO;
        }
        let step = side.max(f64::from(f32::MIN_POSITIVE)).log2().floor().exp2();
        (middle / step).round() * step
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
        // A stray at the origin, or a ground that is much wider, is not what is looked at.
        let mut house: Vec<DVec3> = cube(DVec3::new(500_000.3, 0.0, 4_500_000.0)).repeat(4);
        house.push(DVec3::ZERO);
        house.extend([DVec3::new(2e5, 0.0, 4.2e6), DVec3::new(9e5, 0.0, 4.9e6)]);
        let moved = origin(&house);
        assert!((moved - DVec3::new(500_001.0, 0.0, 4.5e6)).abs().max_element() < 4.0, "{moved}");
        // As many points as are sampled, and more, have the same quartiles.
        assert_eq!(origin(&house.repeat(1000)), moved);
        // A small dense thing in a room near the origin leaves it where it is.
        let mut room = cube(DVec3::new(1.0, 0.8, 0.5)).map(|p| p * 0.1 + DVec3::ONE).repeat(100);
        room.extend([DVec3::splat(-5.0), DVec3::splat(5.0)]);
        assert_eq!(origin(&room), DVec3::ZERO);
        let broken = [DVec3::splat(f64::NAN), DVec3::splat(1e300), DVec3::ZERO, DVec3::ONE];
        assert_eq!(origin(&broken), DVec3::ZERO);
    }
}
