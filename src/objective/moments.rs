//! Mean and spread of display luminance over the object and the background: eqs. (2) to (5).
//!
//! The terms compare σ, the population standard deviation, whatever they are called; the
//! statistic is σ², which combines over replicates before the root is taken.

use super::region::Regions;

/// Independent sums of a region, so that additions need not wait for each other.
const LANES: usize = 8;

/// `[object, background]` means of `l`.
pub(super) fn means(l: &[f64], regions: &Regions) -> [f64; 2] {
    let [object, background] = sums(l, regions, |l, _| l);
    [object / regions.n_object(), background / regions.n_background()]
}

/// `[object, background]` population variances of `l`, in a second pass.
pub(super) fn variances(l: &[f64], means: [f64; 2], regions: &Regions) -> [f64; 2] {
    let [object, background] = sums(l, regions, |l, on_object| {
        let d = l - if on_object { means[0] } else { means[1] };
        d * d
    });
    [object / regions.n_object(), background / regions.n_background()]
}

/// `[object, background]` sums of a function of `l`.
fn sums(l: &[f64], regions: &Regions, f: impl Fn(f64, bool) -> f64) -> [f64; 2] {
    let (mut object, mut background) = ([0.0; LANES], [0.0; LANES]);
    // Two sums by selection, not by index: they stay in registers.
    let mut add = |lane: usize, l: f64, on_object: bool| {
        let v = f(l, on_object);
        object[lane] += if on_object { v } else { 0.0 };
        background[lane] += if on_object { 0.0 } else { v };
    };
    let whole = l.len() / LANES * LANES;
    for (l, mask) in l[..whole].chunks_exact(LANES).zip(regions.mask()[..whole].chunks_exact(LANES)) {
        for lane in 0..LANES {
            add(lane, l[lane], mask[lane]);
        }
    }
    for (&l, &on_object) in l[whole..].iter().zip(&regions.mask()[whole..]) {
        add(0, l, on_object);
    }
    [object.iter().sum(), background.iter().sum()]
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
    let step: [f64; 2] = std::array::from_fn(|r| d_mean[r] / counts[r]);
    let slope: [f64; 2] = std::array::from_fn(|r| 2.0 * d_var[r] / counts[r]);
    for ((out, &l), &on_object) in out.iter_mut().zip(l).zip(regions.mask()) {
        let of = |v: [f64; 2]| if on_object { v[0] } else { v[1] };
        *out += of(step) + of(slope) * (l - of(means));
    }
}
