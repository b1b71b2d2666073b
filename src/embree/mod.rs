//! Ray queries against triangle meshes: a safe wrapper over Debian's Embree.
//!
//! [`Accel`] owns the device, the scene and every buffer, so that it has no lifetime and may
//! be shared between threads. Its tree is built by the calling thread alone, with the
//! instruction set pinned ([`isa`]): the same meshes give the same hits, ties between
//! coincident triangles included, however many threads the program has.
//!
//! Distances are in units of the ray direction's length, which need not be 1.
//!
//! A [`Tape`] holds queries that were made, to make them again without all that an integrator does
//! between them.

mod tape;

use std::ffi::CStr;
use std::mem::MaybeUninit;
use std::ptr::NonNull;
use std::sync::OnceLock;

use embree4_sys as sys;
use glam::Vec3;

use tape::Recorder;
pub use tape::Tape;

/// Why an [`Accel`] could not be built.
#[derive(Debug, thiserror::Error)]
pub enum EmbreeError {
    /// A triangle names a vertex that its mesh does not have.
    #[error(
        "mesh {mesh}, triangle {triangle}: vertex index {index} is out of range, \
         the mesh has {n_vertices} vertices"
    )]
    IndexOutOfRange {
        /// Position of the mesh in the slice given to [`Accel::build`].
        mesh: usize,
        /// Position of the triangle in its mesh.
        triangle: usize,
        /// Vertex index that is out of range.
        index: u32,
        /// Number of vertices of the mesh.
        n_vertices: usize,
    },

    /// A triangle's vertex is NaN, infinite, or so large that Embree would drop the triangle.
    #[error(
        "mesh {mesh}, triangle {triangle}: vertex {index} must have finite coordinates \
         of magnitude at most 1.8e18, got {position}"
    )]
    BadPosition {
        /// Position of the mesh in the slice given to [`Accel::build`].
        mesh: usize,
        /// Position of the triangle in its mesh.
        triangle: usize,
        /// Index of the vertex.
        index: u32,
        /// Position of the vertex, m.
        position: Vec3,
    },

    /// More meshes, or triangles in one mesh, than 32-bit identifiers can tell apart.
    #[error("{what}: at most {} are possible, got {count}", u32::MAX - 1)]
    TooMany {
        /// `meshes` or `triangles in a mesh`.
        what: &'static str,
        /// Number of them.
        count: usize,
    },

    /// Embree reports an error.
    #[error("Embree could not {step}: {message} (RTCError {code})")]
    Embree {
        /// Step that failed, such as `build the hierarchy`.
        step: &'static str,
        /// `RTCError` code.
        code: i32,
        /// Embree's description of the error.
        message: String,
    },
}

/// Indexed triangles, borrowed only while [`Accel::build`] copies them.
#[derive(Clone, Copy, Debug)]
pub struct TriangleMesh<'a> {
    /// Vertex positions, m.
    pub positions: &'a [Vec3],
    /// Vertices of each triangle, as indices into `positions`.
    pub indices: &'a [[u32; 3]],
}

/// The part `t_min <= t <= t_max` of the half-line `org + t dir`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Origin, m.
    pub org: Vec3,
    /// Direction, of any length.
    pub dir: Vec3,
    /// Start, inclusive: a ray that starts on a triangle meets it at 0; negative values count as 0.
    pub t_min: f32,
    /// End, inclusive; may be infinite.
    pub t_max: f32,
}

/// Intersection of a ray with a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Ray parameter of the point, in units of the length of `dir`.
    pub t: f32,
    /// Barycentric weight of the triangle's second vertex.
    pub u: f32,
    /// Barycentric weight of the triangle's third vertex.
    pub v: f32,
    /// Position of the mesh in the slice given to [`Accel::build`].
    pub mesh: u32,
    /// Position of the triangle in its mesh.
    pub prim: u32,
}

/// Bounding volume hierarchy over triangle meshes, with everything it needs.
#[derive(Debug)]
pub struct Accel {
    raw: NonNull<sys::lo_accel>,
    /// What queries are recorded by, where they are.
    recorder: Option<Recorder>,
}

// SAFETY: the handle is not bound to the thread that made it; Embree's objects are
// reference-counted atomically and freed once, by `drop`.
unsafe impl Send for Accel {}
// SAFETY: a committed scene is never modified again (there is no `&mut` method), and Embree
// documents `rtcIntersect1` and `rtcOccluded1` as thread-safe on it.
unsafe impl Sync for Accel {}

impl Drop for Accel {
    fn drop(&mut self) {
        // SAFETY: made by `lo_accel_new`, released only here.
        unsafe { sys::lo_accel_free(self.raw.as_ptr()) }
    }
}

impl Accel {
    /// Copies the meshes and builds the hierarchy over them, in the calling thread.
    ///
    /// Meshes without triangles, and no meshes at all, are allowed. Vertices that no triangle
    /// uses are not looked at.
    ///
    /// # Errors
    /// Indices out of range, coordinates that are not finite, or a refusal by Embree (in
    /// practice: out of memory).
    pub fn build(meshes: &[TriangleMesh]) -> Result<Self, EmbreeError> {
        // SAFETY: a static string.
        let config = unsafe { CStr::from_ptr(sys::lo_default_config()) };
        Self::build_with(config, meshes)
    }

    fn build_with(config: &CStr, meshes: &[TriangleMesh]) -> Result<Self, EmbreeError> {
        check_count("meshes", meshes.len())?;
        for (i, mesh) in meshes.iter().enumerate() {
            validate(i, mesh)?;
        }
        let accel = Self::new(config)?;
        for (id, mesh) in (0_u32..).zip(meshes) {
            accel.add(id, mesh)?;
        }
        let mut error = sys::lo_error::default();
        // SAFETY: `raw` is valid, and not shared before this function returns.
        let status = unsafe { sys::lo_accel_commit(accel.raw.as_ptr(), &mut error) };
        check("build the hierarchy", status, &error)?;
        Ok(accel)
    }

    fn new(config: &CStr) -> Result<Self, EmbreeError> {
        let mut error = sys::lo_error::default();
        // SAFETY: a NUL-terminated string and an error to write to; NULL is handled below.
        let raw = unsafe { sys::lo_accel_new(config.as_ptr(), &mut error) };
        NonNull::new(raw)
            .map(|raw| Accel { raw, recorder: None })
            .ok_or_else(|| embree_error("create a device", &error))
    }

    /// The mesh must have been validated.
    fn add(&self, id: u32, mesh: &TriangleMesh) -> Result<(), EmbreeError> {
        if mesh.indices.is_empty() {
            return Ok(());
        }
        // The shim reads three packed floats a vertex.
        const { assert!(size_of::<Vec3>() == 12 && align_of::<Vec3>() == 4) };
        let mut error = sys::lo_error::default();
        // SAFETY: both slices outlive the call, which copies them; every index is below
        // `positions.len()`; the scene is not committed yet, nor shared.
        let status = unsafe {
            sys::lo_accel_add_triangles(
                self.raw.as_ptr(),
                id,
                mesh.positions.as_ptr().cast(),
                mesh.positions.len(),
                mesh.indices.as_ptr().cast(),
                mesh.indices.len(),
                &mut error,
            )
        };
        check("add a mesh", status, &error)
    }

    /// The closest hit, if any. A ray with a coordinate that is not finite hits nothing.
    #[inline]
    #[must_use]
    pub fn intersect(&self, ray: &Ray) -> Option<Hit> {
        if let Some(recorder) = &self.recorder {
            recorder.add(ray, false);
        }
        let mut hit = MaybeUninit::<sys::lo_hit>::uninit();
        // SAFETY: `raw` is a committed scene; the shim checks the ray, and fills in the hit
        // whenever it returns true.
        let hit = unsafe {
            if !sys::lo_accel_intersect1(self.raw.as_ptr(), &ray.to_sys(), hit.as_mut_ptr()) {
                return None;
            }
            hit.assume_init()
        };
        Some(Hit { t: hit.t, u: hit.u, v: hit.v, mesh: hit.geom, prim: hit.prim })
    }

    /// Whether there is any hit. A ray with a coordinate that is not finite hits nothing.
    #[inline]
    #[must_use]
    pub fn occluded(&self, ray: &Ray) -> bool {
        if let Some(recorder) = &self.recorder {
            recorder.add(ray, true);
        }
        // SAFETY: `raw` is a committed scene; the shim checks the ray.
        unsafe { sys::lo_accel_occluded1(self.raw.as_ptr(), &ray.to_sys()) }
    }
}

impl Ray {
    #[inline]
    fn to_sys(self) -> sys::lo_ray {
        sys::lo_ray {
            org: self.org.to_array(),
            dir: self.dir.to_array(),
            t_near: self.t_min,
            t_far: self.t_max,
        }
    }
}

/// Version of the Embree library in use, e.g. `4.3.3`.
#[must_use]
pub fn version() -> String {
    static VERSION: OnceLock<String> = OnceLock::new();
    VERSION
        .get_or_init(|| match Accel::build(&[]) {
            Ok(accel) => {
                // SAFETY: `raw` is valid.
                let v = unsafe { sys::lo_version(accel.raw.as_ptr()) };
                format!("{}.{}.{}", v / 10_000, v / 100 % 100, v % 100)
            }
            // Without a device no ray is traced either: name what was compiled against.
            Err(_) => sys::HEADER_VERSION.to_owned(),
        })
        .clone()
}

/// Instruction set that Embree is pinned to on this machine: `avx2` or `sse4.2`.
///
/// Hits may differ in the last bit between the two, hence it belongs in manifests.
#[must_use]
pub fn isa() -> &'static str {
    // SAFETY: a static, NUL-terminated string.
    unsafe { CStr::from_ptr(sys::lo_isa()) }.to_str().unwrap_or("unknown")
}

/// Largest magnitude of a coordinate, m: Embree drops triangles beyond it.
pub const MAX_COORDINATE: f32 = sys::LO_MAX_COORDINATE;

fn validate(mesh_id: usize, mesh: &TriangleMesh) -> Result<(), EmbreeError> {
    check_count("triangles in a mesh", mesh.indices.len())?;
    let n_vertices = mesh.positions.len();
    for (triangle, indices) in mesh.indices.iter().enumerate() {
        for &index in indices {
            let Some(&position) = mesh.positions.get(index as usize) else {
                return Err(EmbreeError::IndexOutOfRange { mesh: mesh_id, triangle, index, n_vertices });
            };
            // Written so that NaN fails.
            let limit = Vec3::splat(MAX_COORDINATE);
            if !position.abs().cmple(limit).all() {
                return Err(EmbreeError::BadPosition { mesh: mesh_id, triangle, index, position });
            }
        }
    }
    Ok(())
}

fn check_count(what: &'static str, count: usize) -> Result<(), EmbreeError> {
    // u32::MAX itself is Embree's mark for "no hit".
    if count >= u32::MAX as usize {
        return Err(EmbreeError::TooMany { what, count });
    }
    Ok(())
}

fn check(step: &'static str, status: i32, error: &sys::lo_error) -> Result<(), EmbreeError> {
    if status == 0 { Ok(()) } else { Err(embree_error(step, error)) }
}

fn embree_error(step: &'static str, error: &sys::lo_error) -> EmbreeError {
    let bytes = error.message.map(|c| c as u8);
    let message = CStr::from_bytes_until_nul(&bytes)
        .map(|text| text.to_string_lossy().into_owned())
        .unwrap_or_default();
    EmbreeError::Embree { step, code: error.code, message }
}

#[cfg(test)]
mod tests;
