//! Free variables: their names, units, bounds, scales and starts, and their effect on a lighting.
//!
//! A kind of variable is one file that implements [`Kind`] and one line in [`KINDS`]; everything
//! that deals with variables, from `--free` to the gradient, asks the kind. The optimiser works on
//! the unit cube; a [`Scale`] maps each component to the value that a user reads.

mod background;
pub mod bounds;
mod color;
mod constraints;
mod exposure;
mod kind;
mod movement;
mod radiance;
mod range;
mod size;
pub mod survey;
mod table;
mod variable;
mod wishes;

pub use constraints::{Constraints, FreeKinds, LightConstraints};
pub use kind::{BasisRanges, Kind, Limits, MatchedStart, Owner, SizeBounds, SurveyedScene, VariableKind};
pub use movement::Movement;
pub use range::{Range, Scale};
pub use survey::{Fitted, Survey, SurveyError};
pub use table::KINDS;
pub use variable::{ParamVector, Variable};
pub use wishes::{Bond, Followed, Tie, WishError, Wishes};
