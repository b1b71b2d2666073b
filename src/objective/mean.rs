//! Mean display luminance of the object and of the background: eqs. (2) and (3).

use super::region::Regions;

/// `[object, background]` means of `l`.
pub(super) fn means(l: &[f64], regions: &Regions) -> [f64; 2] {
    let mut sums = [0.0; 2];
    for (&l, &object) in l.iter().zip(regions.mask()) {
        sums[usize::from(!object)] += l;
    }
    [
        sums[0] / regions.n_object(),
        sums[1] / regions.n_background(),
    ]
}

/// Adds `Σ_region adjoint · ∂mean/∂l` to `out`.
pub(super) fn add_adjoint(regions: &Regions, adjoint: [f64; 2], out: &mut [f64]) {
    let step = [
        adjoint[0] / regions.n_object(),
        adjoint[1] / regions.n_background(),
    ];
    for (out, &object) in out.iter_mut().zip(regions.mask()) {
        *out += step[usize::from(!object)];
    }
}
