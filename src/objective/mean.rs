//! Mean display luminance of the object and of the background: eqs. (2) and (3).

use super::region::Regions;

/// `[object, background]` means of `l`.
pub(super) fn means(l: &[f64], regions: &Regions) -> [f64; 2] {
    // Two sums by selection, not by index: they stay in registers.
    let (mut object, mut background) = (0.0, 0.0);
    for (&l, &on_object) in l.iter().zip(regions.mask()) {
        object += if on_object { l } else { 0.0 };
        background += if on_object { 0.0 } else { l };
    }
    [object / regions.n_object(), background / regions.n_background()]
}

/// Adds `Σ_region adjoint · ∂mean/∂l` to `out`.
pub(super) fn add_adjoint(regions: &Regions, adjoint: [f64; 2], out: &mut [f64]) {
    let step = [adjoint[0] / regions.n_object(), adjoint[1] / regions.n_background()];
    for (out, &object) in out.iter_mut().zip(regions.mask()) {
        *out += step[usize::from(!object)];
    }
}
