//! Lighting design: from a scene and a target to the lights that meet it.
//!
//! One direction: survey (bounds and start) ─▶ optimisation at the working
//! size ─▶ check render ─▶ one render of all final pictures, all recorded in a run
//! directory per target. Optimisation is on the [transport basis](crate::transport), where
//! several targets share all renders, or in paper mode by finite differences of
//! fresh renders.
//! Every stage draws from seeds of its own, so that what is reported comes
//! from samples that chose nothing.

pub mod allotment;
pub mod alternatives;
pub mod attainable;
mod basis_search;
mod check;
mod coordinates;
mod deadline;
mod differences;
pub mod evaluator;
pub mod growing;
mod look;
pub mod manifest;
pub mod noise;
mod observer;
mod options;
mod outcome;
pub mod pareto;
mod pictures;
mod precision;
mod products;
pub mod render;
pub mod rig;
mod run;
mod search;
mod seeds;
mod setup;
mod small_copy;
mod working_basis;

pub use observer::{Progress, Reporter};
pub use options::{FinalPicture, Gradient, Job, RunError, RunOptions, RunReport, Subject};
pub use run::run;
