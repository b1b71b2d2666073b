//! Mean display luminance of the background: \[PG14\] eq. (3).

use super::definition::{Definition, Kind, Scalar};
use crate::objective::region::Region;

pub(super) const DEFINITION: Definition = Definition {
    name: "meanBack",
    words: "the background's mean luminance",
    label: "background brightness",
    weight: 0.5, // [PG14] table 1
    kind: Kind::Scalar(Scalar::unit(
        |picture| picture.moments(Region::Background).mean,
        |d, _, adjoint| adjoint.add_mean(Region::Background, d),
    )),
};
