//! The terms of the objective: a file each, and the one table that lists them.
//!
//! A new term is a file here, whose `Definition` says what is measured of a picture, what that is
//! compared with and how it is differentiated; a line of the table in this file; and a test. Whatever
//! lists terms (logs, tables, figures, target files) goes by the table, and shows of a picture the
//! terms that its target has a [`Goal`] for.

mod a_back;
mod a_obj;
mod b_back;
mod b_obj;
mod chroma;
mod definition;
mod grad;
mod hist;
mod mean_back;
mod mean_obj;
mod spread_back;
mod spread_obj;
mod statistics;
mod var_back;
mod var_obj;

pub use definition::Goal;
pub(super) use definition::{Distance, Kind, Scalar};
pub use statistics::Statistics;

use definition::Definition;

/// Declares [`Term`] and lists the definitions in its order.
macro_rules! table {
    ($($(#[$documentation:meta])+ $term:ident = $file:ident,)+) => {
        /// A term of the objective, in the order in which terms are summed and listed.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
        pub enum Term {
            $($(#[$documentation])+ $term,)+
        }

        /// Definitions of the terms, in the order of [`Term`].
        const DEFINITIONS: &[Definition] = &[$($file::DEFINITION),+];

        impl Term {
            /// Every term.
            pub const ALL: [Self; N_TERMS] = [$(Self::$term),+];
        }
    };
}

table! {
    /// Mean luminance of the object, \[PG14\] eq. (2).
    MeanObj = mean_obj,
    /// Mean luminance of the background, \[PG14\] eq. (3).
    MeanBack = mean_back,
    /// Standard deviation of luminance over the object, \[PG14\] eq. (4).
    VarObj = var_obj,
    /// Standard deviation of luminance over the background, \[PG14\] eq. (5).
    VarBack = var_back,
    /// Root mean squared gradient of luminance over the object, \[PG14\] eqs. (6) and (7).
    Grad = grad,
    /// Distance of the picture's cumulated histogram to the signature, \[PG14\] eq. (8).
    Hist = hist,
    /// Mean of a of Oklab over the object.
    AObj = a_obj,
    /// Mean of b of Oklab over the object.
    BObj = b_obj,
    /// Mean of a of Oklab over the background.
    ABack = a_back,
    /// Mean of b of Oklab over the background.
    BBack = b_back,
    /// Spread of colour over the object.
    SpreadObj = spread_obj,
    /// Spread of colour over the background.
    SpreadBack = spread_back,
    /// Distance of the picture's joint histogram of chroma to a palette.
    Chroma = chroma,
}

/// Number of terms.
pub const N_TERMS: usize = DEFINITIONS.len();

/// Measured values by term, in the order of [`Term::ALL`]; `None` of distances, which have none, and
/// of terms that were not measured.
pub type Values = [Option<f64>; N_TERMS];

impl Term {
    const fn definition(self) -> &'static Definition {
        &DEFINITIONS[self as usize]
    }

    /// The kind of the term, with the functions that measure, compare and differentiate it.
    pub(super) fn kind(self) -> &'static Kind {
        &self.definition().kind
    }

    /// Name in files and tables, the paper's where it has one.
    #[must_use]
    pub const fn name(self) -> &'static str {
        self.definition().name
    }

    /// The measured quantity, as the subject of a sentence: "the object's mean luminance".
    #[must_use]
    pub const fn words(self) -> &'static str {
        self.definition().words
    }

    /// A short name for people: "object brightness".
    #[must_use]
    pub const fn label(self) -> &'static str {
        self.definition().label
    }

    /// Weight in f_q where a target names none: the published one, \[PG14\] table 1, and 0 of terms
    /// that the paper does not have.
    #[must_use]
    pub const fn default_weight(self) -> f64 {
        self.definition().weight
    }

    /// Whether every target has a goal for the term. Any other term is measured and listed only if the
    /// target at hand has a goal for it.
    #[must_use]
    pub fn is_standing(self) -> bool {
        self.default_weight() > 0.0
    }

    /// The terms that every target has a goal for, in the order of [`Term::ALL`].
    pub fn standing() -> impl Iterator<Item = Self> {
        Self::ALL.into_iter().filter(|term| term.is_standing())
    }

    /// Whether the term measures colour.
    #[must_use]
    pub fn is_of_color(self) -> bool {
        self as usize >= Self::AObj as usize
    }

    /// Weight of a term of colour where the colours of a photograph are matched. A mean that is off by .03, as by a
    /// light of 3200 K in the place of 4000 K, then counts as much as a mean luminance that is off by .06.
    #[must_use]
    pub fn matched_weight(self) -> f64 {
        match self {
            Self::AObj | Self::BObj | Self::ABack | Self::BBack | Self::Chroma => 1.0,
            Self::SpreadObj | Self::SpreadBack => 0.4,
            _ => 0.0,
        }
    }

    /// Whether the term is a distance between distributions; else it is the modulus of a number less
    /// its target.
    #[must_use]
    pub fn is_distance(self) -> bool {
        matches!(self.kind(), Kind::Distance(_))
    }

    /// The reason in words why no picture can reach `target`; `None` if some may.
    #[must_use]
    pub fn beyond_all_pictures(self, target: f64) -> Option<&'static str> {
        match self.kind() {
            Kind::Scalar(scalar) => scalar.limit.filter(|limit| target > limit.value).map(|l| l.words),
            Kind::Distance(_) => None,
        }
    }

    /// The most by which the value can differ from `target`: what 1 means of f.
    #[must_use]
    pub fn largest_miss(self, target: f64) -> f64 {
        self.definition().largest_miss(target)
    }

    /// Whether the derivative of the term needs the statistics of `other`.
    pub(super) fn reads(self, other: Self) -> bool {
        match self.kind() {
            Kind::Scalar(scalar) => scalar.reads.contains(&other),
            Kind::Distance(_) => false,
        }
    }

    /// Key of the term's goal in target files.
    pub(super) fn goal_key(self) -> String {
        match self.kind() {
            Kind::Scalar(_) => format!("t_{}", self.name()),
            Kind::Distance(distance) => distance.key.to_owned(),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn names_and_keys_are_told_apart() {
        let names: BTreeSet<&str> = Term::ALL.into_iter().map(Term::name).collect();
        let keys: BTreeSet<String> = Term::ALL.into_iter().map(Term::goal_key).collect();
        assert_eq!((names.len(), keys.len()), (N_TERMS, N_TERMS));
        assert!(["schema", "name", "weights"].iter().all(|key| !keys.contains(*key)));
    }

    #[test]
    fn the_published_terms_stand_first_with_their_weights() {
        let published: Vec<_> = Term::standing().map(|term| (term.name(), term.default_weight())).collect();
        let want = [
            ("meanObj", 0.5),
            ("meanBack", 0.5),
            ("varObj", 0.4),
            ("varBack", 0.4),
            ("grad", 0.2),
            ("hist", 1.0),
        ];
        assert_eq!(published, want);
        assert!(Term::ALL.into_iter().take(want.len()).eq(Term::standing()));
    }

    #[test]
    fn every_term_has_statistics_of_its_own() {
        let mut z = Statistics::ZERO;
        for (i, term) in Term::ALL.into_iter().enumerate() {
            assert!(z[term].iter().all(|&z| z == 0.0));
            z[term].fill(1.0 + i as f64);
        }
        for (i, term) in Term::ALL.into_iter().enumerate() {
            assert!(!z[term].is_empty() && z[term].iter().all(|&z| z == 1.0 + i as f64));
        }
        assert!(Term::ALL.into_iter().all(|term| term.is_distance() || z[term].len() == 1));
    }
}
