//! Scenes and statistics that tests share.
#![allow(dead_code)]

pub mod chi2;
pub mod compare;
pub mod quadrature;
pub mod random;
pub mod scenes;
pub mod verify;
