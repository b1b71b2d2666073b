//! Palettes: the joint histogram of a and b of Oklab that the term `chroma` steers towards.

use serde::Serialize;
use thiserror::Error;

use super::chroma::CHROMA_BINS;

/// A named joint histogram of chroma.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Palette {
    name: String,
    shares: Vec<f64>,
}

/// The values are no shares of pixels.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("need {CHROMA_BINS} shares of at least 0 that add up to 1, got {count} that add up to {sum}")]
pub struct PaletteError {
    count: usize,
    sum: f64,
}

/// Slack on "add up to 1": shares that people write down with six digits count as exact.
const SLACK: f64 = 1e-4;

impl Palette {
    /// A palette of shares of the pixels, those of one value of b together.
    ///
    /// # Errors
    /// When they are not [`CHROMA_BINS`] shares.
    pub fn new(name: impl Into<String>, shares: Vec<f64>) -> Result<Self, PaletteError> {
        let (count, sum) = (shares.len(), shares.iter().sum::<f64>());
        let is_sound = count == CHROMA_BINS && shares.iter().all(|&s| s >= 0.0) && (sum - 1.0).abs() <= SLACK;
        if is_sound { Ok(Self { name: name.into(), shares }) } else { Err(PaletteError { count, sum }) }
    }

    /// Name of the palette, for people.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Shares of the pixels in each bin.
    #[must_use]
    pub fn shares(&self) -> &[f64] {
        &self.shares
    }
}
