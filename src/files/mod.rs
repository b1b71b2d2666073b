//! Files that users write and read: encodings, TOML with helpful errors, atomic writing.

pub mod atomic;
mod nearest;
pub mod text;
pub mod toml_file;

pub use atomic::write_atomically;
pub use nearest::{did_you_mean, nearest};
