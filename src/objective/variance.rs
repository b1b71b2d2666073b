//! Spread of display luminance over the object and the background: eqs. (4) and (5).
//!
//! The terms compare σ, the population standard deviation, whatever they are called; the
//! statistic is σ², which combines over replicates before the root is taken.

use super::region::Regions;

/// `[object, background]` population variances of `l`, in two passes.
pub(super) fn variances(l: &[f64], means: [f64; 2], regions: &Regions) -> [f64; 2] {
    let (mut object, mut background) = (0.0, 0.0);
    for (&l, &on_object) in l.iter().zip(regions.mask()) {
        let d = l - if on_object { means[0] } else { means[1] };
        object += if on_object { d * d } else { 0.0 };
        background += if on_object { 0.0 } else { d * d };
    }
    [object / regions.n_object(), background / regions.n_background()]
}

/// Adds `Σ_region adjoint · ∂σ²/∂l` to `out`; the mean's own dependence on `l` drops out.
pub(super) fn add_adjoint(l: &[f64], means: [f64; 2], regions: &Regions, adjoint: [f64; 2], out: &mut [f64]) {
    let step = [2.0 * adjoint[0] / regions.n_object(), 2.0 * adjoint[1] / regions.n_background()];
    for ((out, &l), &object) in out.iter_mut().zip(l).zip(regions.mask()) {
        let region = usize::from(!object);
        *out += step[region] * (l - means[region]);
    }
}
