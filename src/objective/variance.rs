//! Spread of display luminance over the object and the background: eqs. (4) and (5).
//!
//! The terms compare σ, the population standard deviation, whatever they are called; the
//! statistic is σ², which combines over replicates before the root is taken.

use super::region::Regions;

/// `[object, background]` population variances of `l`, in two passes.
pub(super) fn variances(l: &[f64], means: [f64; 2], regions: &Regions) -> [f64; 2] {
    let mut sums = [0.0; 2];
    for (&l, &object) in l.iter().zip(regions.mask()) {
        let region = usize::from(!object);
        let d = l - means[region];
        sums[region] += d * d;
    }
    [
        sums[0] / regions.n_object(),
        sums[1] / regions.n_background(),
    ]
}

/// Adds `Σ_region adjoint · ∂σ²/∂l` to `out`; the mean's own dependence on `l` drops out.
pub(super) fn add_adjoint(
    l: &[f64],
    means: [f64; 2],
    regions: &Regions,
    adjoint: [f64; 2],
    out: &mut [f64],
) {
    let step = [
        2.0 * adjoint[0] / regions.n_object(),
        2.0 * adjoint[1] / regions.n_background(),
    ];
    for ((out, &l), &object) in out.iter_mut().zip(l).zip(regions.mask()) {
        let region = usize::from(!object);
        *out += step[region] * (l - means[region]);
    }
}
