//! A picture while its statistics are measured.

use std::cell::OnceCell;

use super::Ramp;
use super::chroma::Axis;
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
    /// Planes of a and b of Oklab; empty where they are not known.
    chroma: &'a [f64],
    chroma_moments: [OnceCell<[Moments; 2]>; 2],
}

impl<'a> Picture<'a> {
    /// The picture of display luminance, behind which chroma may stand: planes of a and b of Oklab.
    ///
    /// # Panics
    /// When `shown` has another size than the mask.
    pub(super) fn new(shown: &'a [f64], regions: &'a Regions, ramp: Ramp) -> Self {
        let n = regions.mask().len();
        assert!(shown.len() == n || shown.len() == 3 * n, "the picture must have the size of its mask");
        let (l, chroma) = shown.split_at(n);
        Self { l, regions, ramp, moments: OnceCell::new(), chroma, chroma_moments: Default::default() }
    }

    /// Whether chroma is known.
    pub(super) fn has_chroma(&self) -> bool {
        !self.chroma.is_empty()
    }

    /// The plane of an axis of chroma.
    ///
    /// # Panics
    /// When chroma is not known.
    pub(super) fn chroma(&self, axis: Axis) -> &'a [f64] {
        assert!(self.has_chroma(), "terms of colour need the chroma of a picture");
        let n = self.l.len();
        &self.chroma[(axis.plane() - 1) * n..][..n]
    }

    /// Mean and variance of an axis of chroma over a region.
    pub(super) fn chroma_moments(&self, axis: Axis, region: Region) -> Moments {
        let moments = &self.chroma_moments[axis as usize];
        moments.get_or_init(|| moments::measure(self.chroma(axis), self.regions))[region as usize]
    }

    /// Mean and variance over a region.
    pub(super) fn moments(&self, region: Region) -> Moments {
        self.moments.get_or_init(|| moments::measure(self.l, self.regions))[region as usize]
    }
}
