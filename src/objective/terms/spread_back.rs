//! Spread of colour over the background: the root of the variance of a and b of Oklab together.

use super::definition::{Definition, Interval, Kind, Scalar};
use super::{Statistics, Term};
use crate::objective::adjoint::Adjoint;
use crate::objective::chroma::Axis;
use crate::objective::picture::Picture;
use crate::objective::region::Region;

pub(super) const DEFINITION: Definition = Definition {
    name: "spreadBack",
    words: "the background's spread of colour",
    label: "background spread of colour",
    weight: 0.0,
    kind: Kind::Scalar(Scalar {
        reads: &[Term::ABack, Term::BBack],
        is_square: true,
        range: [0.0, LARGEST],
        targets: Interval { low: 0.0, high: LARGEST, words: "a number from 0 to 0.32" },
        ..Scalar::chroma(measure, add_adjoint)
    }),
};

/// No picture of Rec.709 spreads more: half of its pixels green and half of them magenta have a deviation of .31.
const LARGEST: f64 = 0.32;

fn measure(picture: &Picture) -> f64 {
    Axis::ALL.map(|axis| picture.chroma_moments(axis, Region::Background).variance).iter().sum()
}

fn add_adjoint(d: f64, z: &Statistics, adjoint: &mut Adjoint) {
    for (axis, term) in Axis::ALL.into_iter().zip([Term::ABack, Term::BBack]) {
        adjoint.add_chroma_variance(axis, Region::Background, d, z.scalar(term));
    }
}
