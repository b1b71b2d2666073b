//! Mean of a of Oklab, red against green, over the background.

use super::definition::{Definition, Kind, Scalar};
use crate::objective::chroma::Axis;
use crate::objective::region::Region;

pub(super) const DEFINITION: Definition = Definition {
    name: "aBack",
    words: "the background's mean of red against green",
    label: "background red–green",
    weight: 0.0,
    kind: Kind::Scalar(Scalar::chroma(
        |picture| picture.chroma_moments(Axis::A, Region::Background).mean,
        |d, _, adjoint| adjoint.add_chroma_mean(Axis::A, Region::Background, d),
    )),
};
