//! A picture while its statistics are measured.

use std::cell::OnceCell;

use super::Ramp;
use super::moments::{self, Moments};
use super::region::{Region, Regions};

/// Display luminance with the regions over which it is measured. What several terms share is measured
/// when the first asks for it.
pub(super) struct Picture<'a> {
    /// Display luminance of every pixel, row-major, in [0, 1].
    pub(super) l: &'a [f64],
    /// The main object and the background.
    pub(super) regions: &'a Regions,
    /// How a pixel passes from a bin of the cumulated histogram to the next.
    pub(super) ramp: Ramp,
    moments: OnceCell<[Moments; 2]>,
}

impl<'a> Picture<'a> {
    /// The picture of display luminance `l`.
    ///
    /// # Panics
    /// When `l` has another size than the mask.
    pub(super) fn new(l: &'a [f64], regions: &'a Regions, ramp: Ramp) -> Self {
        assert_eq!(l.len(), regions.mask().len(), "the picture must have the size of its mask");
        Self { l, regions, ramp, moments: OnceCell::new() }
    }

    /// Mean and variance over a region.
    pub(super) fn moments(&self, region: Region) -> Moments {
        self.moments.get_or_init(|| moments::measure(self.l, self.regions))[region as usize]
    }
}
