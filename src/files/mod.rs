//! Files that users write and read: what a scene may name, encodings, TOML with helpful errors, numbers in
//! messages, CSV, atomic writing.

pub mod atomic;
pub mod csv_file;
mod nearest;
pub mod number;
pub mod parts;
pub mod reach;
pub mod text;
pub mod toml_file;

pub use atomic::write_atomically;
pub use nearest::{did_you_mean, nearest};
