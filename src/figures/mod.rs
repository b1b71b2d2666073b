//! The tables and figures of \[PG14\], made anew on scenes of the same kind.
//!
//! Nothing here renders: [`Outcome`]s of finished runs go in; pictures, tables and a page
//! come out, as bytes. Everything depends on the outcomes alone, so that equal runs give
//! equal files; seconds are kept apart.
//!
//! | module | what it makes |
//! | --- | --- |
//! | [`study`] | which scenes are lit how, and what was found |
//! | [`published`] | the numbers of the paper |
//! | [`canvas`], [`grid`] | labelled pictures side by side |
//! | [`flux`] | one light at several sizes and fluxes |
//! | [`table`], [`tables`] | CSV, LaTeX and HTML |
//! | [`reached`], [`convergence`] | plots |
//! | [`page`] | one self-contained HTML page |
//! | [`manifest`] | hashes of all that was written |

pub mod canvas;
pub mod convergence;
pub mod flux;
pub mod grid;
pub mod manifest;
pub mod page;
pub mod published;
pub mod reached;
pub mod study;
pub mod table;
pub mod tables;

pub use canvas::{Canvas, FigureError};
pub use study::{LOOKS, Outcome, STUDIES, Study};

/// What can be made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Part {
    /// One light at several sizes and fluxes
    Fig2,
    /// Girl and creature: start, high-key, low-key
    Fig3,
    /// Girl and creature when the background is free, which the paper does not show
    Background,
    /// Fruit basket: start, high-key, low-key, its background as it is and free
    Fig4,
    /// Targets and weights
    Table1,
    /// Terms found for every scene
    Table2,
    /// Terms found when the background is free
    Table3,
    /// What the lights can reach of every term, beside what was found
    Gaps,
    /// Paper mode and default mode compared: `f_q` as the search goes on, and seconds
    Convergence,
}

impl Part {
    /// All of them.
    pub const ALL: [Self; 9] = [
        Self::Fig2,
        Self::Fig3,
        Self::Background,
        Self::Fig4,
        Self::Table1,
        Self::Table2,
        Self::Table3,
        Self::Gaps,
        Self::Convergence,
    ];

    /// The runs it shows.
    #[must_use]
    pub fn studies(self) -> Vec<Study> {
        match self {
            Self::Fig2 | Self::Table1 | Self::Convergence => Vec::new(),
            Self::Fig3 => STUDIES[..2].to_vec(),
            Self::Background => STUDIES[3..5].to_vec(),
            Self::Fig4 => vec![STUDIES[2], STUDIES[5]],
            Self::Table2 => STUDIES[..3].to_vec(),
            Self::Table3 => STUDIES[3..].to_vec(),
            Self::Gaps => STUDIES.to_vec(),
        }
    }

    /// Whether it shows the fruit basket besides.
    #[must_use]
    pub fn needs_basket(self) -> bool {
        matches!(self, Self::Fig2 | Self::Convergence)
    }
}
