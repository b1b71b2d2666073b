//! The record of a run: files that appear whole or not at all.

pub mod atomic;
