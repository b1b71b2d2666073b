//! Bindings of the C shim over Debian's Embree (3.13 or 4.x).
//!
//! The functions are described in `shim.h`; Embree's own structures, whose layout differs
//! between its versions, never reach Rust. Use the safe wrapper, `lightopt_embree::embree`.

#[allow(missing_docs, non_camel_case_types, clippy::undocumented_unsafe_blocks)] // generated
mod shim {
    include!(concat!(env!("OUT_DIR"), "/shim.rs"));
}

pub use shim::*;

/// Version of the Embree headers the shim was compiled against, e.g. `4.3.3`.
pub const HEADER_VERSION: &str = env!("EMBREE_VERSION");

#[cfg(test)]
mod tests {
    use super::*;
    use std::ffi::CStr;

    #[test]
    fn one_triangle_is_hit_and_shadows_what_is_behind_it() {
        let positions = [0.0_f32, 0.0, 1.0, 2.0, 0.0, 1.0, 0.0, 2.0, 1.0];
        let indices = [0_u32, 1, 2];
        let mut error = lo_error::default();
        // SAFETY: the pointers are valid for the stated lengths, indices are below 3, and
        // the accel is used only between its creation and its release.
        unsafe {
            let accel = lo_accel_new(lo_default_config(), &mut error);
            assert!(!accel.is_null(), "error {}", error.code);
            let added =
                lo_accel_add_triangles(accel, 7, positions.as_ptr(), 3, indices.as_ptr(), 1, &mut error);
            assert_eq!(added, 0);
            assert_eq!(lo_accel_commit(accel, &mut error), 0);

            let ray = lo_ray { org: [0.5, 1.0, 0.0], dir: [0.0, 0.0, 2.0], t_near: 0.0, t_far: 10.0 };
            let mut hit = lo_hit::default();
            assert!(lo_accel_intersect1(accel, &ray, &mut hit));
            // Embree divides by way of an approximate reciprocal: 1 ulp.
            for (got, expected) in [(hit.t, 0.5), (hit.u, 0.25), (hit.v, 0.5_f32)] {
                assert!((got - expected).abs() <= f32::EPSILON * expected, "{hit:?}");
            }
            assert_eq!((hit.geom, hit.prim), (7, 0));
            assert!(lo_accel_occluded1(accel, &ray));
            assert!(!lo_accel_occluded1(accel, &lo_ray { t_far: 0.4, ..ray }));
            lo_accel_free(accel);
        }
    }

    #[test]
    fn a_bad_configuration_is_refused_with_a_message() {
        let mut error = lo_error::default();
        // SAFETY: a NUL-terminated string and a valid error to write to.
        let accel = unsafe { lo_accel_new(c"threads=many".as_ptr(), &mut error) };
        assert!(accel.is_null());
        // SAFETY: the shim terminates its messages.
        let message = unsafe { CStr::from_ptr(error.message.as_ptr()) };
        assert!(error.code != 0 && !message.is_empty());
    }

    #[test]
    fn the_library_is_the_one_of_the_headers() {
        let mut error = lo_error::default();
        // SAFETY: as above; the accel is released once.
        let version = unsafe {
            let accel = lo_accel_new(lo_default_config(), &mut error);
            assert!(!accel.is_null(), "error {}", error.code);
            let version = lo_version(accel);
            lo_accel_free(accel);
            version
        };
        let (major, minor) = (version / 10_000, version / 100 % 100);
        assert!(HEADER_VERSION.starts_with(&format!("{major}.{minor}.")), "{version}");
    }
}
