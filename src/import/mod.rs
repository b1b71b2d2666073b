//! Import: readers of OBJ, MTL, glTF and sidecars, and the staging of scenes without a sidecar.
//!
//! Every reader of a scene file fills an [`Imported`](imported::Imported); the [`builder`] merges it
//! with the sidecar, checks both, and builds the [`Scene`](crate::scene::Scene).

pub mod axes;
pub mod backdrop;
pub mod budget;
pub mod builder;
pub mod error;
mod find;
pub mod gltf;
pub mod imported;
pub mod left_out;
pub mod mtl;
pub mod mtl_params;
pub mod obj;
pub mod origin;
pub mod radiance_map;
mod range;
pub mod sheets;
pub mod sidecar;
pub mod stage;
pub mod warnings;
pub mod wavefront;

pub use builder::{LoadOptions, Loaded, load, load_with};
pub use error::ImportError;
pub use find::find;
