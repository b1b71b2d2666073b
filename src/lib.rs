//! Automatic, aesthetics-driven lighting design with global illumination.

pub mod bsdf;
pub mod camera;
pub mod embree;
pub mod film;
pub mod integrator;
pub mod light;
pub mod math;
pub mod objective;
pub mod optim;
pub mod sampler;
pub mod scene;
pub mod toml_file;
