//! Tests that judge noise by statistics: fixed seeds, level 0.01 with Šidák
//! correction.
#![allow(missing_docs, clippy::unwrap_used)]

mod basis;
mod basket;
mod bsdf;
mod colors;
mod gradient;
mod growing;
mod light;
mod mitsuba;
mod noise;
mod opaque;
mod pilot;
mod render_errors;
mod rig;
mod spawn;
mod surroundings;
mod transport;
mod weights;

#[path = "../support/mod.rs"]
mod support;
