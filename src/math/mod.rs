//! Mathematics that every other module builds on: colour and display encoding, frames, bounds,
//! densities, warps, discrete distributions, hashing and statistics.

pub mod blackbody;
pub mod bounds;
pub mod display;
pub mod distribution;
pub mod frame;
pub mod hash;
pub mod measure;
pub mod node_rgb;
pub mod offset;
pub mod oklab;
pub mod pdf;
pub mod primaries;
pub mod rgb;
pub mod sequence;
pub mod stats;
pub mod view;
pub mod warp;

pub use bounds::Bounds;
pub use distribution::Discrete;
pub use frame::Frame;
pub use measure::Measure;
pub use node_rgb::NodeRgb;
pub use offset::offset;
pub use pdf::{AreaPdf, LEAST_DISTANCE2, Pmf, SolidAnglePdf, distance2};
pub use rgb::{Rgb, luminance};
pub use view::ViewTransform;

/// The largest `f32` below one: uniform variates lie in `[0, ONE_MINUS_EPSILON]`.
pub const ONE_MINUS_EPSILON: f32 = 1.0 - f32::EPSILON / 2.0;
