//! Points moved clear of the surface that they lie on.

use glam::Vec3;

/// Least distance, metres, that a coordinate of zero is moved. Ray queries take numbers below 10⁻³⁸ for zero,
/// also products of this distance with the area of a triangle: those with edges of 10⁻⁹ m are left out.
const LEAST: f32 = 1e-18;

/// Moves `p` along the unit vector `n` by at least `distance`, of the same unit as `p`.
///
/// Each coordinate is rounded away from the surface, so that a distance below the spacing of numbers
/// near `p` still moves it \[PBRT4\] 6.8.6; off a plane through the origin, where numbers lie as close as
/// one likes, by `LEAST`.
#[must_use]
pub fn offset(p: Vec3, n: Vec3, distance: f32) -> Vec3 {
    let away = |moved: f32, n: f32| {
        if n > 0.0 {
            moved.next_up().max(moved + LEAST)
        } else if n < 0.0 {
            moved.next_down().min(moved - LEAST)
        } else {
            moved
        }
    };
    let moved = p + n * distance;
    Vec3::new(away(moved.x, n.x), away(moved.y, n.y), away(moved.z, n.z))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_of_planes_through_the_origin_are_moved_by_more_than_a_denormal() {
        let moved = offset(Vec3::new(3.0, 0.0, -2.0), Vec3::Y, 0.0);
        assert_eq!(moved, Vec3::new(3.0, LEAST, -2.0));
        assert_eq!(offset(-moved, Vec3::NEG_Y, 0.0).y, -2.0 * LEAST);
        assert!(offset(Vec3::Y, Vec3::Y, 0.0).y == 1.0_f32.next_up());
    }
}
