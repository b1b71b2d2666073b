//! Views of a configuration of OpenColorIO.
//!
//! What a configuration shows are code values of its display. They are written to files as they are, and
//! measured as those of an sRGB display, which is what any program takes such a file for. Derivatives are
//! differences: the configuration computes in single precision, and its tables have no others.
//!
//! The crate that reads configurations is there with the feature `ocio`; without it no [`OcioView`] can be
//! made, and [`OcioView::open`] says so.

#[cfg(feature = "ocio")]
mod config;

use std::{
    fmt,
    hash::{Hash, Hasher},
    path::{Path, PathBuf},
    sync::{Mutex, PoisonError},
};

use glam::{DMat3, DVec3};

use super::{Tables, lattice::Lattice, tables::curve_of};
use crate::math::display::eotf_srgb;

/// What the names of these views begin with.
pub const PREFIX: &str = "ocio:";

/// What the names of the configurations that the crate brings begin with.
const BUILT_IN: &str = "ocio://";
/// Step of a difference over the channel: rounding and curvature of a view both tell in the sixth digit.
const STEP: f64 = 1.0 / 256.0;
/// Least value over the largest channel for which a step is taken: where a channel is 0, single precision
/// must still see the step beside the others.
const LEAST_OF_MOST: f64 = 1.0 / 64.0;
/// Least value for which a step is taken.
const LEAST: f64 = 1.0 / 16384.0;
/// Points along each edge of the lattice of [`OcioView::tables`].
const SIDE: usize = 57;

/// A view cannot be had from a configuration.
#[derive(Debug, thiserror::Error)]
pub enum OcioError {
    /// The program was built without what reads configurations.
    #[error(
        "view `{name}`: this program was built without OpenColorIO; `cargo build --release --features ocio` makes \
         one that has it"
    )]
    NotBuilt {
        /// Name as given.
        name: String,
    },
    /// No part of the name is a file.
    #[error(
        "view `{name}`: {config}: no such file; the form is ocio:CONFIG or ocio:CONFIG:DISPLAY:VIEW, with the path of a \
         config.ocio",
        config = config.display()
    )]
    NoFile {
        /// Name as given.
        name: String,
        /// Path up to the first colon.
        config: PathBuf,
    },
    /// The configuration cannot be read.
    #[error("view `{name}`: {message}")]
    Config {
        /// Name as given.
        name: String,
        /// What is wrong, in one line.
        message: String,
    },
    /// What follows the configuration is no display and view of it.
    #[error("view `{name}`: `{given}` is no {what}; it has {allowed}")]
    Unknown {
        /// Name as given.
        name: String,
        /// The part at fault.
        given: String,
        /// What it should be.
        what: &'static str,
        /// What there is.
        allowed: String,
    },
}

/// The transform of a view.
#[cfg(feature = "ocio")]
type Transform = config::Transform;
/// The transform of a view: there is none.
#[cfg(not(feature = "ocio"))]
enum Transform {}

/// A view of a configuration, for a display of it.
pub struct OcioView {
    /// `ocio:CONFIG:DISPLAY:VIEW`, with the absolute path.
    name: String,
    /// The view's own name.
    view: String,
    /// What a user should know of it.
    notes: Vec<String>,
    transform: Transform,
}

/// All views that were opened. They stay: a run needs one or two.
static OPENED: Mutex<Vec<&'static OcioView>> = Mutex::new(Vec::new());

impl OcioView {
    /// The view `name`, `ocio:CONFIG[:DISPLAY:VIEW]`, of a configuration whose path is sought from `folder`.
    /// Without display and view those are the configuration's own first ones.
    ///
    /// # Errors
    /// When the configuration cannot be read, or has no such display or view.
    pub fn open(name: &str, folder: &Path) -> Result<&'static Self, OcioError> {
        let (config, of_display) = Self::split(name, folder)?;
        let opened = Self::load(name, &config, of_display)?;
        let mut all = OPENED.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(&known) = all.iter().find(|known| ***known == opened) {
            return Ok(known);
        }
        let kept: &'static Self = Box::leak(Box::new(opened));
        all.push(kept);
        Ok(kept)
    }

    /// The configuration, and what stands behind it: the longest part of the name before a colon that is a file.
    fn split<'a>(name: &'a str, folder: &Path) -> Result<(PathBuf, Option<&'a str>), OcioError> {
        let whole = name.strip_prefix(PREFIX).unwrap_or(name);
        if let Some(rest) = whole.strip_prefix(BUILT_IN) {
            let (config, of_display) = rest.split_once(':').map_or((rest, None), |(c, d)| (c, Some(d)));
            return Ok((format!("{BUILT_IN}{config}").into(), of_display));
        }
        let ends = std::iter::once(whole.len()).chain(whole.rmatch_indices(':').map(|(i, _)| i));
        for end in ends {
            let path = folder.join(&whole[..end]);
            if end > 0 && path.is_file() {
                let path = std::path::absolute(&path).unwrap_or(path);
                return Ok((path, whole.get(end + 1..)));
            }
        }
        let first = whole.split(':').next().unwrap_or_default();
        Err(OcioError::NoFile { name: name.to_owned(), config: folder.join(first) })
    }

    #[cfg(not(feature = "ocio"))]
    fn load(name: &str, _: &Path, _: Option<&str>) -> Result<Self, OcioError> {
        Err(OcioError::NotBuilt { name: name.to_owned() })
    }

    /// `ocio:CONFIG:DISPLAY:VIEW`, with the absolute path.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The view's own name in the configuration.
    #[must_use]
    pub fn view(&self) -> &str {
        &self.view
    }

    /// What a user should know of how the view is taken, a line each.
    #[must_use]
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Code values in [0, 1] of linear colours, in their place.
    fn show<const N: usize>(&self, linear: [DVec3; N]) -> [DVec3; N] {
        let mut pixels = linear.map(|c| c.as_vec3().extend(1.0).to_array());
        self.transform.apply(&mut pixels);
        // What is no number becomes 0.
        pixels.map(|[r, g, b, _]| [r, g, b].map(|v| f64::from(if v > 0.0 { v.min(1.0) } else { 0.0 })).into())
    }

    /// Code values in [0, 1] of a linear colour.
    pub(super) fn codes(&self, linear: DVec3) -> DVec3 {
        let [codes] = self.show([linear]);
        codes
    }

    /// Display-linear light of a linear colour without negative channels, with its derivatives by them: central
    /// differences, one-sided where a step would leave the positive.
    pub(super) fn display(&self, linear: DVec3) -> (DVec3, DMat3) {
        let least = LEAST.max(LEAST_OF_MOST * linear.max_element());
        let steps = linear.to_array().map(|v| STEP * v.max(least));
        let moved = |c: usize, by: f64| {
            let mut moved = linear;
            moved[c] = (moved[c] + by).max(0.0);
            // The step is what single precision makes of it.
            moved.as_vec3().as_dvec3()
        };
        let [r, g, b] = [0, 1, 2].map(|c| [moved(c, steps[c]), moved(c, -steps[c])]);
        let places = [linear, r[0], r[1], g[0], g[1], b[0], b[1]];
        let light = self.show(places).map(|codes| DVec3::from_array(codes.to_array().map(eotf_srgb)));
        let slope = |c: usize| {
            let [more, less] = [2 * c + 1, 2 * c + 2];
            (light[more] - light[less]) / (places[more][c] - places[less][c])
        };
        (light[0], DMat3::from_cols(slope(0), slope(1), slope(2)))
    }

    /// The view as tables, which are near it and not the same: between the points of the lattice it is
    /// interpolated.
    pub(super) fn tables(&self) -> Tables {
        let lattice = Lattice::sample(SIDE, |linear| self.codes(linear));
        Tables::new(DMat3::IDENTITY, &lattice, curve_of(eotf_srgb))
    }
}

#[cfg(not(feature = "ocio"))]
impl Transform {
    fn apply(&self, _: &mut [[f32; 4]]) {
        match *self {}
    }
}

impl PartialEq for OcioView {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

impl Eq for OcioView {}

impl Hash for OcioView {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.name.hash(state);
    }
}

impl fmt::Debug for OcioView {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.name)
    }
}

#[cfg(test)]
mod tests;
