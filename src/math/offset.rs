//! Points moved clear of the surface that they lie on.

use glam::Vec3;

/// Moves `p` along the unit vector `n` by at least `distance`, of the same unit as `p`.
///
/// Each coordinate is rounded away from the surface, so that a distance below the spacing of numbers
/// near `p` still moves it \[PBRT4\] 6.8.6.
#[must_use]
pub fn offset(p: Vec3, n: Vec3, distance: f32) -> Vec3 {
    let away = |moved: f32, n: f32| {
        if n > 0.0 {
            moved.next_up()
        } else if n < 0.0 {
            moved.next_down()
        } else {
            moved
        }
    };
    let moved = p + n * distance;
    Vec3::new(away(moved.x, n.x), away(moved.y, n.y), away(moved.z, n.z))
}
