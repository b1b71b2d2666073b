//! Automatic, aesthetics-driven lighting design with global illumination.

pub mod embree;
pub mod math;
pub mod objective;
pub mod optim;
