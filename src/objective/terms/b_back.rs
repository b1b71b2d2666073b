//! Mean of b of Oklab, yellow against blue, over the background.

use super::definition::{Definition, Kind, Scalar};
use crate::objective::chroma::Axis;
use crate::objective::region::Region;

pub(super) const DEFINITION: Definition = Definition {
    name: "bBack",
    words: "the background's mean of yellow against blue",
    label: "background yellow–blue",
    weight: 0.0,
    kind: Kind::Scalar(Scalar::chroma(
        |picture| picture.chroma_moments(Axis::B, Region::Background).mean,
        |d, _, adjoint| adjoint.add_chroma_mean(Axis::B, Region::Background, d),
    )),
};
