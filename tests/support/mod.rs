//! Scenes and statistics that tests share.
#![allow(dead_code)]

pub mod compare;
pub mod scenes;
