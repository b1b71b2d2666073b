//! The free variables: their names, units, bounds, scales and starts, and what each does to a
//! lighting.
//!
//! A kind of variable is one file that implements [`Kind`] and one line in [`KINDS`]; everything
//! that deals with variables, from `--free` to the gradient, asks the kind. The optimiser works on
//! the unit cube; a [`Scale`] maps each component to the value that a user reads.

mod background;
pub mod bounds;
mod kind;
mod radiance;
mod size;
pub mod survey;
mod variable;
mod wishes;

pub use kind::{BasisRanges, KEYWORDS, KINDS, Kind, MatchedStart, Owner, VariableKind};
pub use survey::{Fitted, SizeBounds, Survey, SurveyError};
pub use variable::{ParamVector, Range, Scale, Variable};
pub use wishes::{FreeKinds, LightWishes, Wishes};
