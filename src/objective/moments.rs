//! Mean and spread of display luminance over the object and the background: eqs. (2) to (5).
//!
//! The terms compare σ, the population standard deviation, whatever they are called; the
//! statistic is σ², which combines over replicates before the root is taken.

use multiversion::multiversion;

use super::region::Regions;

/// Independent sums of a region, so that additions need not wait for each other.
const LANES: usize = 32;

/// `[object, background]` means of `l`.
pub(super) fn means(l: &[f64], regions: &Regions) -> [f64; 2] {
    let [object, background] = sums(l, regions.mask());
    [object / regions.n_object(), background / regions.n_background()]
}

/// `[object, background]` population variances of `l`, in a second pass.
pub(super) fn variances(l: &[f64], means: [f64; 2], regions: &Regions) -> [f64; 2] {
    let [object, background] = squares(l, regions.mask(), means);
    [object / regions.n_object(), background / regions.n_background()]
}

/// `[object, background]` sums of `l`.
#[multiversion(targets = "simd")]
fn sums(l: &[f64], mask: &[bool]) -> [f64; 2] {
    let mut sums = [[0.0; LANES]; 2];
    for (l, mask) in l.chunks(LANES).zip(mask.chunks(LANES)) {
        for (lane, (&l, &on_object)) in l.iter().zip(mask).enumerate() {
            // By selection, not by index: the sums stay in registers.
            sums[0][lane] += if on_object { l } else { 0.0 };
            sums[1][lane] += if on_object { 0.0 } else { l };
        }
    }
    sums.map(|lanes| lanes.iter().sum())
}

/// `[object, background]` sums of the squared distances of `l` from `means`.
#[multiversion(targets = "simd")]
fn squares(l: &[f64], mask: &[bool], means: [f64; 2]) -> [f64; 2] {
    let mut sums = [[0.0; LANES]; 2];
    for (l, mask) in l.chunks(LANES).zip(mask.chunks(LANES)) {
        for (lane, (&l, &on_object)) in l.iter().zip(mask).enumerate() {
            let d = l - if on_object { means[0] } else { means[1] };
            sums[0][lane] += if on_object { d * d } else { 0.0 };
            sums[1][lane] += if on_object { 0.0 } else { d * d };
        }
    }
    sums.map(|lanes| lanes.iter().sum())
}

/// Adds `Σ_region d_mean · ∂mean/∂l + d_var · ∂σ²/∂l` to `out`; in the variance the mean's
/// own dependence on `l` drops out.
pub(super) fn add_adjoint(
    l: &[f64],
    means: [f64; 2],
    regions: &Regions,
    d_mean: [f64; 2],
    d_var: [f64; 2],
    out: &mut [f64],
) {
    let counts = [regions.n_object(), regions.n_background()];
    let slope: [f64; 2] = std::array::from_fn(|r| 2.0 * d_var[r] / counts[r]);
    let constant: [f64; 2] = std::array::from_fn(|r| d_mean[r] / counts[r] - slope[r] * means[r]);
    add_line(l, regions.mask(), constant, slope, out);
}

/// `out += constant + slope · l`, both by region.
#[multiversion(targets = "simd")]
fn add_line(l: &[f64], mask: &[bool], constant: [f64; 2], slope: [f64; 2], out: &mut [f64]) {
    for ((out, &l), &on_object) in out.iter_mut().zip(l).zip(mask) {
        let (c, s) = if on_object { (constant[0], slope[0]) } else { (constant[1], slope[1]) };
        *out += c + s * l;
    }
}
