//! Standard deviation of display luminance over the background: \[PG14\] eq. (5).
//!
//! The term compares σ, the population standard deviation, whatever it is called.

use super::definition::{Definition, Kind, Scalar};
use super::var_obj::LARGEST_DEVIATION;
use super::{Statistics, Term};
use crate::objective::adjoint::Adjoint;
use crate::objective::region::Region;

pub(super) const DEFINITION: Definition = Definition {
    name: "varBack",
    words: "the background's standard deviation",
    label: "background contrast",
    weight: 0.4, // [PG14] table 1
    kind: Kind::Scalar(Scalar {
        reads: &[Term::MeanBack],
        is_square: true,
        limit: Some(LARGEST_DEVIATION),
        ..Scalar::unit(|picture| picture.moments(Region::Background).variance, add_adjoint)
    }),
};

fn add_adjoint(d: f64, z: &Statistics, adjoint: &mut Adjoint) {
    adjoint.add_variance(Region::Background, d, z.scalar(Term::MeanBack));
}
