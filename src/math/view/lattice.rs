//! A function of colours, sampled on a cubic lattice of logarithmic coordinates.

use std::f64::consts::LN_2;

use glam::{DMat3, DVec3};

use super::MIDDLE_GREY;

/// Stops below middle grey at coordinate 0.
pub(super) const STOPS_BELOW: f64 = 10.0;
/// Stops between the coordinates 0 and 1.
pub(super) const STOPS: f64 = 25.0;

/// Linear value at a coordinate: coordinates count stops, from 10 below middle grey at 0 to 15 above at 1.
pub(super) fn linear(coordinate: f64) -> f64 {
    MIDDLE_GREY * (STOPS * coordinate - STOPS_BELOW).exp2()
}

/// Coordinate in [0, 1] of a linear value.
pub(super) fn coordinate(linear: f64) -> f64 {
    // What has no logarithm is 0.
    let stops = (linear.max(0.0) / MIDDLE_GREY).log2();
    (stops / STOPS + STOPS_BELOW / STOPS).clamp(0.0, 1.0)
}

/// Values of a function at the points of a lattice over the unit cube.
#[derive(Debug)]
pub(super) struct Lattice {
    /// Points along each edge.
    side: usize,
    /// Values, the first coordinate running fastest.
    values: Vec<[f32; 3]>,
}

impl Lattice {
    /// Samples `of`, a function of linear values, at `side`³ points.
    pub fn sample(side: usize, of: impl Fn(DVec3) -> DVec3) -> Self {
        let steps: Vec<f64> = (0..side).map(|i| linear(i as f64 / (side - 1) as f64)).collect();
        let mut values = Vec::with_capacity(side * side * side);
        for &z in &steps {
            for &y in &steps {
                values.extend(steps.iter().map(|&x| of(DVec3::new(x, y, z)).as_vec3().to_array()));
            }
        }
        Self { side, values }
    }

    /// Points along each edge.
    pub fn side(&self) -> usize {
        self.side
    }

    /// Values, the first coordinate running fastest.
    pub fn values(&self) -> &[[f32; 3]] {
        &self.values
    }

    /// Value at linear values, interpolated tetrahedrally in the coordinates, and its derivative by each of
    /// the linear values, a column each. Inside a tetrahedron the value is linear in the coordinates; outside
    /// the range of the lattice it stays as it is.
    pub fn at(&self, linear: DVec3) -> (DVec3, DMat3) {
        let most = self.side - 1;
        let place =
            DVec3::new(coordinate(linear.x), coordinate(linear.y), coordinate(linear.z)) * most as f64;
        let cell = place.to_array().map(|p| (p as usize).min(most - 1));
        let within = place - DVec3::from_array(cell.map(|c| c as f64));
        // Along the edges of the tetrahedron: the largest part first.
        let mut order = [0, 1, 2];
        order.sort_by(|&a, &b| within[b].total_cmp(&within[a]));
        let step = [1, self.side, self.side * self.side];
        let mut corner = cell[0] + step[1] * cell[1] + step[2] * cell[2];
        let value = |corner: usize| DVec3::from_array(self.values[corner].map(f64::from));
        let mut before = value(corner);
        let (mut sum, mut slopes) = (before, DMat3::ZERO);
        for axis in order {
            corner += step[axis];
            let here = value(corner);
            sum += within[axis] * (here - before);
            if place[axis] > 0.0 && place[axis] < most as f64 {
                *slopes.col_mut(axis) = most as f64 / (STOPS * LN_2 * linear[axis]) * (here - before);
            }
            before = here;
        }
        (sum, slopes)
    }
}
