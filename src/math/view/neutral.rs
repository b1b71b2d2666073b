//! PBR Neutral of the Khronos group, which shows base colours under grey light as they are.
//!
//! # References
//! \[Khronos24\].

use glam::{DMat3, DVec3};

/// Brightest channel from which highlights are compressed, before the offset.
const START: f64 = 0.8 - LARGEST_OFFSET;
/// How fast highlights lose their colour.
const DESATURATION: f64 = 0.15;
/// What is taken from colours whose least channel is at least twice that: the reflection of an air-glass
/// surface at normal incidence.
const LARGEST_OFFSET: f64 = 0.04;

/// Display-linear Rec.709 in [0, 1] of a linear colour, with its derivatives by the channels, by column.
pub(super) fn display(rgb: DVec3) -> (DVec3, DMat3) {
    let least = index_of(rgb, |a, b| a < b);
    let m = rgb[least];
    let (offset, by_least) = if m < 2.0 * LARGEST_OFFSET {
        (m - m * m / (4.0 * LARGEST_OFFSET), 1.0 - m / (2.0 * LARGEST_OFFSET))
    } else {
        (LARGEST_OFFSET, 0.0)
    };
    let c = rgb - DVec3::splat(offset);
    let mut shifted = DMat3::IDENTITY;
    *shifted.col_mut(least) -= DVec3::splat(by_least);
    let (shown, slopes) = compressed(c);
    (shown, slopes * shifted)
}

/// A colour with its highlights compressed, and the derivatives by its channels.
fn compressed(c: DVec3) -> (DVec3, DMat3) {
    let largest = index_of(c, |a, b| a > b);
    let peak = c[largest];
    if peak < START {
        return (c, DMat3::IDENTITY);
    }
    let room = 1.0 - START;
    let beyond = peak + room - START;
    let (new, new_by_peak) = (1.0 - room * room / beyond, (room / beyond).powi(2));
    let fall = DESATURATION * (peak - new) + 1.0;
    let (kept, kept_by_peak) = (1.0 / fall, -DESATURATION * (1.0 - new_by_peak) / (fall * fall));
    // shown = kept·(new/peak)·c + (1 − kept)·new
    let (scale, scale_by_peak) = (new / peak, (new_by_peak - new / peak) / peak);
    let shown = kept * scale * c + DVec3::splat((1.0 - kept) * new);
    let mut slopes = DMat3::from_diagonal(DVec3::splat(kept * scale));
    let along = (kept_by_peak * scale + kept * scale_by_peak) * c
        + DVec3::splat((1.0 - kept) * new_by_peak - kept_by_peak * new);
    *slopes.col_mut(largest) += along;
    (shown, slopes)
}

/// Index of the first channel that none of the others `precedes`.
fn index_of(c: DVec3, precedes: impl Fn(f64, f64) -> bool) -> usize {
    (1..3).fold(0, |best, i| if precedes(c[i], c[best]) { i } else { best })
}
