//! Shading normals that lean away from the viewer.
//!
//! Between the corners of a coarse mesh the interpolated normal may lean so far from the triangle's
//! own that the mirror direction of a viewer lies below the triangle: a metal would show nothing
//! there, brown or black speckle along every silhouette. Such a normal is bent back in the plane of both,
//! just enough that the mirror direction leaves the surface. The idea is that of Cycles
//! (Blender's renderer), whose function `ensure_valid_specular_reflection` does it.

use glam::Vec3;

/// Height of a bent mirror direction above the surface: the sine of half a degree.
const CLEARANCE: f32 = 0.01;
/// The same for a grazing viewer, as a share of the viewer's own height: below 1, so that the
/// triangle's own normal is never bent.
const CLEARANCE_OF_GRAZING: f32 = 0.9;

/// The shading normal `ns`, bent for the viewer along `w` above a triangle of normal `ng`; `None`
/// where it need not be.
///
/// All are unit vectors of world space, `ng` in the hemisphere of the viewer. With `reflects` the mirror
/// direction of `w` is kept above the triangle; else `w` itself is kept above the plane of `ns`.
pub(super) fn bent(ns: Vec3, ng: Vec3, w: Vec3, reflects: bool) -> Option<Vec3> {
    let (height, facing) = (w.dot(ng), w.dot(ns));
    let clearance = CLEARANCE.min(CLEARANCE_OF_GRAZING * height);
    let is_clear = facing > 0.0 && (!reflects || 2.0 * facing * ns.dot(ng) - height >= clearance);
    if is_clear || height <= 0.0 {
        return None;
    }
    // In the plane of both normals: ng is up, ns leans along x.
    let x = (ns - ng * ns.dot(ng)).try_normalize()?;
    let along = w.dot(x);
    // The viewer is at (along, height), and a vector of the same length at the least height that
    // leans as the normal does at (reach, clearance).
    let reach = (along * along + height * height - clearance * clearance).max(0.0).sqrt();
    Some(if reflects {
        // The normal is half-way between the viewer and the mirror direction. Where these lean to opposite
        // sides, `along + reach` would be a difference of nearly equal numbers.
        let lean = if along < 0.0 {
            (height - clearance) * (height + clearance) / (reach - along)
        } else {
            along + reach
        };
        (x * lean + ng * (height + clearance)).normalize_or(ng)
    } else {
        // The vector whose product with the viewer is `clearance` times its length.
        let (up, lean) = (height * clearance - along * reach, height * reach + along * clearance);
        (x * lean + ng * up).normalize_or(ng)
    })
}

#[cfg(test)]
mod tests {
    use glam::Vec2;

    use super::*;

    /// Unit vectors all over the sphere.
    fn directions() -> Vec<Vec3> {
        let golden = std::f32::consts::PI * (3.0 - 5.0_f32.sqrt());
        let direction = |i: u16| {
            let z = 1.0 - (f32::from(i) + 0.5) / 200.0;
            Vec2::from_angle(golden * f32::from(i)).extend(0.0) * (1.0 - z * z).sqrt() + Vec3::Z * z
        };
        (0..400).map(direction).collect()
    }

    fn mirrored(w: Vec3, n: Vec3) -> Vec3 {
        2.0 * w.dot(n) * n - w
    }

    /// Normals that lean from +z by less than a right angle, and viewers above the plane z = 0.
    fn check(reflects: bool, is_clear: impl Fn(Vec3, Vec3) -> bool, height: impl Fn(Vec3, Vec3) -> f32) {
        let (mut n_bent, mut n_kept) = (0, 0);
        let above: Vec<Vec3> = directions().into_iter().filter(|d| d.z > 0.0).collect();
        for &ns in &above {
            for &w in &above {
                let Some(n) = bent(ns, Vec3::Z, w, reflects) else {
                    n_kept += 1;
                    assert!(is_clear(w, ns), "{w} {ns}");
                    continue;
                };
                n_bent += 1;
                assert!(!is_clear(w, ns) && (n.length() - 1.0).abs() < 1e-5, "{w} {ns}");
                assert!(
                    (height(w, n) - CLEARANCE.min(0.9 * w.z)).abs() < 1e-5 && w.dot(n) > 0.0,
                    "{w} {ns} {n}"
                );
                // Between both normals, and so nearer to the triangle's.
                assert!(n.dot(ns.cross(Vec3::Z)).abs() < 1e-5, "{w} {ns} {n}");
                assert!(n.z > ns.z && n.truncate().dot(ns.truncate()) >= -1e-6, "{w} {ns} {n}");
            }
        }
        assert!(n_bent > 5000 && n_kept > 5000);
    }

    #[test]
    fn a_mirror_direction_is_kept_just_above_the_triangle() {
        let clear = |w: Vec3, n| w.dot(n) > 0.0 && mirrored(w, n).z >= CLEARANCE.min(0.9 * w.z);
        check(true, clear, |w, n| mirrored(w, n).z);
    }

    #[test]
    fn a_viewer_is_kept_just_above_the_shading_plane() {
        check(false, |w, n| w.dot(n) > 0.0, |w, n| w.dot(n));
    }
}
