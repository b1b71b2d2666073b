//! Views as tables, for programs that show pictures as this one does.

use glam::DMat3;

use super::{
    MIDDLE_GREY, ViewTransform, agx, filmic,
    lattice::{self, Lattice},
};

/// Points of [`Tables::curve`]: between them the curves of all views are straight to 2·10⁻⁶ of white.
const CURVE: usize = 4097;

/// A view as a matrix, a lattice and a curve: linear light goes through the matrix, the logarithm of each
/// channel through the lattice, interpolated tetrahedrally, and each of its three values through the curve,
/// which gives light of the display.
#[derive(Clone, Debug)]
pub struct Tables {
    /// From Rec.709 to the channels of the lattice.
    pub matrix: DMat3,
    /// Points of the lattice along each edge.
    pub side: usize,
    /// Values in [0, 1], the first coordinate running fastest.
    pub values: Vec<[f32; 3]>,
    /// Display-linear light for values evenly spaced from 0 to 1.
    pub curve: Vec<f64>,
    /// Middle grey, stops below it at the coordinate 0 of the lattice, and stops between 0 and 1.
    pub scale: [f64; 3],
}

impl ViewTransform {
    /// The view as tables; `None` of a view that is a formula of each channel or of all.
    #[must_use]
    pub fn tables(self) -> Option<Tables> {
        match self {
            Self::Agx => Some(Tables::new(agx::to_lattice(), agx::stored(), curve_of(agx::light))),
            Self::Filmic => Some(Tables::new(DMat3::IDENTITY, filmic::logarithms(), curve_of(filmic::light))),
            Self::Ocio(view) => Some(view.tables()),
            Self::Srgb | Self::PbrNeutral | Self::Linear => None,
        }
    }
}

impl Tables {
    /// Tables of a lattice whose coordinates are those of [`lattice`].
    pub(super) fn new(matrix: DMat3, lattice: &Lattice, curve: Vec<f64>) -> Self {
        let scale = [MIDDLE_GREY, lattice::STOPS_BELOW, lattice::STOPS];
        Self { matrix, side: lattice.side(), values: lattice.values().to_vec(), curve, scale }
    }
}

/// The curve of a function of values in [0, 1].
pub(super) fn curve_of(at: impl Fn(f64) -> f64) -> Vec<f64> {
    (0..CURVE).map(|i| at(i as f64 / (CURVE - 1) as f64)).collect()
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    /// The view by its tables, at a point of the lattice, where nothing is interpolated.
    #[test]
    fn tables_are_the_view_at_the_points_of_the_lattice() {
        for view in [ViewTransform::Agx, ViewTransform::Filmic] {
            let Tables { matrix, side, values, curve, scale: [grey, below, stops] } = view.tables().unwrap();
            for place in [[20, 21, 22], [14, 15, 14], [17, 12, 16]] {
                let linear = |i: usize| grey * (stops * i as f64 / (side - 1) as f64 - below).exp2();
                let rgb = matrix.inverse() * DVec3::from_array(place.map(linear));
                if rgb.min_element() < 0.0 {
                    continue;
                }
                let value = values[place[0] + side * (place[1] + side * place[2])];
                let shown = view.display(rgb).0;
                for c in 0..3 {
                    let at = f64::from(value[c]) * (curve.len() - 1) as f64;
                    let i = (at as usize).min(curve.len() - 2);
                    let light = curve[i] + (at - i as f64) * (curve[i + 1] - curve[i]);
                    assert!((light - shown[c]).abs() < 2e-5, "{view} {place:?} {light} {}", shown[c]);
                }
            }
        }
        assert!(ViewTransform::Srgb.tables().is_none());
    }
}
