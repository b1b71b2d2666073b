//! Mean display luminance of the main object: \[PG14\] eq. (2).

use super::definition::{Definition, Kind, Scalar};
use crate::objective::region::Region;

pub(super) const DEFINITION: Definition = Definition {
    name: "meanObj",
    words: "the object's mean luminance",
    label: "object brightness",
    weight: 0.5, // [PG14] table 1
    kind: Kind::Scalar(Scalar::unit(
        |picture| picture.moments(Region::Object).mean,
        |d, _, adjoint| adjoint.add_mean(Region::Object, d),
    )),
};
