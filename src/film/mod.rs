//! Pictures and the files they live in.

pub mod exr;
pub mod image_file;
