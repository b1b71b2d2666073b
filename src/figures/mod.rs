//! Tables and figures of \[PG14\], made anew on scenes of the same kind.
//!
//! [`Outcome`]s of finished runs go in; pictures, tables and a page come out, as bytes. Only [`flux`]
//! renders. Everything depends on the outcomes alone, so that equal runs give equal files; seconds are
//! kept apart.
//!
//! | module | what it holds |
//! | --- | --- |
//! | [`study`] | the scenes with what is free in them, and outcomes of their runs |
//! | [`published`] | numbers printed in the paper |
//! | [`grid`] | labelled pictures side by side |
//! | [`flux`] | one light at several sizes and fluxes |
//! | [`table`], [`tables`] | CSV, LaTeX and HTML |
//! | [`reached`], [`convergence`] | plots of terms within reach, and of f_q along a search |
//! | [`page`] | one self-contained HTML page |
//! | [`manifest`] | the list of all files with their hashes |

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

pub use study::{LOOKS, Outcome, STUDIES, Study};

/// A figure or table that can be made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Part {
    /// Figure 2: one light at several sizes and fluxes.
    Fig2,
    /// Figure 3: girl and creature at the start, in high-key and in low-key.
    Fig3,
    /// Girl and creature with the background's value free, which the paper does not show.
    Background,
    /// Figure 4: the fruit basket at the start, in high-key and in low-key, with its background's value
    /// fixed and free.
    Fig4,
    /// Table 1: targets and weights.
    Table1,
    /// Table 2: terms found for every scene.
    Table2,
    /// Table 3: terms found with the background's value free.
    Table3,
    /// Terms found, beside the least that the lights can reach of each.
    Gaps,
    /// Paper mode and default mode compared: f_q along the search, and seconds.
    Convergence,
}

impl Part {
    /// All parts, in the order in which they are made.
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

    /// Studies whose runs the part shows.
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

    /// Whether the part renders the fruit basket apart from the studies.
    #[must_use]
    pub fn needs_basket(self) -> bool {
        matches!(self, Self::Fig2 | Self::Convergence)
    }
}
