//! Triangles of a scene file that cannot be rendered.

use std::{fmt, path::Path};

use glam::Vec3;

use super::warnings::Warnings;
use crate::{
    embree::MAX_COORDINATE,
    scene::mesh::{is_in_range, is_proper},
};

/// Numbers of triangles that are left out, by reason.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LeftOut {
    /// Number of triangles without area.
    pub n_degenerate: usize,
    /// Number of triangles with a corner that is out of range: not finite, or farther from the origin than
    /// [`MAX_COORDINATE`].
    pub n_out_of_range: usize,
    /// Place in the file of the first vertex that is out of range, in words.
    pub place: Option<String>,
}

impl LeftOut {
    /// Whether a triangle can be rendered; it is counted if not.
    pub fn keeps(&mut self, corners: [Vec3; 3]) -> bool {
        let is_kept = is_proper(corners);
        if !corners.into_iter().all(is_in_range) {
            self.n_out_of_range += 1;
        } else if !is_kept {
            self.n_degenerate += 1;
        }
        is_kept
    }

    /// Adds triangles of one place of the file to those of others.
    pub fn add(&mut self, other: Self, place: impl FnOnce() -> String) {
        self.n_degenerate += other.n_degenerate;
        self.n_out_of_range += other.n_out_of_range;
        if other.n_out_of_range > 0 && self.place.is_none() {
            self.place = Some(place());
        }
    }

    /// Says what is left out of a file.
    pub fn report(&self, path: &Path, warnings: &mut Warnings) {
        let mut say = |n: usize, kind: &str, what: &str| {
            let triangles = if n == 1 { "triangle" } else { "triangles" };
            if n > 0 {
                warnings.add(format!("{}: left out {n} {kind}{triangles}{what}", path.display()));
            }
        };
        say(self.n_degenerate, "degenerate ", "");
        say(self.n_out_of_range, "", &format!(" with {}", self.vertex()));
    }

    /// The vertices that are out of range, and what is allowed.
    fn vertex(&self) -> String {
        let first = self.place.as_ref().map_or_else(String::new, |place| format!(", the first {place}"));
        format!(
            "vertices out of range{first}: coordinates must be finite and at most {MAX_COORDINATE:e} in magnitude"
        )
    }
}

/// What there is beside nothing in a file of which no triangle is left.
impl fmt::Display for LeftOut {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.n_degenerate, self.n_out_of_range) {
            (0, 0) => Ok(()),
            (n, 0) => write!(f, " but for {n} that are degenerate"),
            (0, n) => write!(f, " but for {n} with {}", self.vertex()),
            (n, m) => write!(f, " but for {n} that are degenerate and {m} with {}", self.vertex()),
        }
    }
}
