//! Tests of the program as its users meet it.

// Helpers outside #[test] functions may panic too.
#![allow(clippy::unwrap_used)]

mod aims;
mod basis;
mod bench;
mod colors;
mod denoise;
mod evaluate;
mod exchange;
mod export;
mod exporters;
mod exr_bytes;
mod far;
mod figures;
mod gltf;
mod known_optimum;
mod large;
mod limits;
mod loader;
mod photo;
mod picture_limits;
mod pictures;
mod reach;
mod reliability;
mod render;
mod report;
mod resume;
mod rig;
mod room;
mod run;
mod sidecar;
mod smooth_metal;
mod stage;
mod views;
mod white_sky;
