//! Directives and parameters of pbrt's files.

use std::fmt::Display;

use crate::math::Rgb;

/// A parameter with one value.
pub(super) fn param(kind: &str, name: &str, value: impl Display) -> String {
    format!("\"{kind} {name}\" [ {value} ]")
}

/// A colour.
pub(super) fn rgb(name: &str, value: Rgb) -> String {
    format!("\"rgb {name}\" [ {} ]", numbers(&value.to_array()))
}

/// Numbers with blanks between them.
pub(super) fn numbers(values: &[f32]) -> String {
    values.iter().map(f32::to_string).collect::<Vec<_>>().join(" ")
}

/// A name as a part of a comment or a string: without quotes and line breaks.
pub(super) fn quoted(name: &str) -> String {
    name.chars().map(|c| if c == '"' || c == '\\' || c.is_control() { '_' } else { c }).collect()
}

/// A name as a part of a file's name.
pub(super) fn plain(name: &str) -> String {
    name.chars().map(|c| if c.is_ascii_alphanumeric() || c == '_' || c == '-' { c } else { '_' }).collect()
}
