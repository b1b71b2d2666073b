//! Standard deviation of display luminance over the main object: \[PG14\] eq. (4).
//!
//! The term compares σ, the population standard deviation, whatever it is called.

use super::definition::{Definition, Kind, Limit, Scalar};
use super::{Statistics, Term};
use crate::objective::adjoint::Adjoint;
use crate::objective::region::Region;

pub(super) const DEFINITION: Definition = Definition {
    name: "varObj",
    words: "the object's standard deviation",
    label: "object contrast",
    weight: 0.4, // [PG14] table 1
    kind: Kind::Scalar(Scalar {
        reads: &[Term::MeanObj],
        is_square: true,
        limit: Some(LARGEST_DEVIATION),
        ..Scalar::unit(|picture| picture.moments(Region::Object).variance, add_adjoint)
    }),
};

/// Half of the pixels black and half of them white spread most. Of pictures in [0, 1] none has a
/// larger deviation, but the paper's low-key target asks for 0.63.
pub(super) const LARGEST_DEVIATION: Limit = Limit {
    value: 0.5,
    words: "no picture has one above 0.5, so this asks for as much contrast as there is",
};

fn add_adjoint(d: f64, z: &Statistics, adjoint: &mut Adjoint) {
    adjoint.add_variance(Region::Object, d, z.scalar(Term::MeanObj));
}
