//! Mean of b of Oklab, yellow against blue, over the main object.

use super::definition::{Definition, Kind, Scalar};
use crate::objective::chroma::Axis;
use crate::objective::region::Region;

pub(super) const DEFINITION: Definition = Definition {
    name: "bObj",
    words: "the object's mean of yellow against blue",
    label: "object yellow–blue",
    weight: 0.0,
    kind: Kind::Scalar(Scalar::chroma(
        |picture| picture.chroma_moments(Axis::B, Region::Object).mean,
        |d, _, adjoint| adjoint.add_chroma_mean(Axis::B, Region::Object, d),
    )),
};
