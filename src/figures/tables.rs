//! Tables of targets, of terms found, and of terms within reach.

use super::{
    LOOKS, Outcome, published,
    table::{Entry, Table},
};
use crate::{
    design::attainable::Reach,
    objective::{Evaluation, Goal, Target, Term, TermValue},
};

/// Headings of a table with a column for each term between `first` and `last`.
fn header(first: &[&'static str], last: &[&'static str]) -> Vec<&'static str> {
    let terms: Vec<&str> = Term::standing().map(Term::name).collect();
    [first, &terms, last].concat()
}

/// Table 1: the paper's targets and weights, as they are built in.
#[must_use]
pub fn targets(targets: &[Target; 2]) -> Table {
    let values = |target: &Target| -> Vec<Entry> {
        let entry = |(_, goal): (Term, &Goal)| match goal {
            Goal::Value(value) => Entry::Number(*value, 2),
            Goal::Signature(signature) => format!("“{}”", signature.name()).into(),
            Goal::Palette(palette) => format!("“{}”", palette.name()).into(),
        };
        target.goals().map(entry).collect()
    };
    let mut rows: Vec<Vec<Entry>> =
        targets.iter().map(|t| [vec![format!("target, {}", t.name()).into()], values(t)].concat()).collect();
    let weights = targets[0].goals().map(|(term, _)| Entry::Number(targets[0].weight(term), 1));
    rows.push([vec!["weight".into()], weights.collect()].concat());
    Table {
        caption: "Table 1. Targets and weights. All are the paper's, but for the signatures of the \
                  histogram term, which it did not publish."
            .to_owned(),
        header: header(&["quantity"], &[]),
        rows,
        grouped: 0,
    }
}

/// Weighted sum of the terms, which is f_q up to rounding.
fn sum(evaluation: &Evaluation) -> f64 {
    evaluation.terms().map(TermValue::contribution).sum()
}

/// Entry of a term with a measured value; a dash for a distance between distributions.
fn scalar(term: Term, entry: impl FnOnce() -> Entry) -> Entry {
    if term.is_distance() { Entry::Dash } else { entry() }
}

/// Tables 2 and 3: terms found, with the paper's numbers below ours where they are known.
#[must_use]
pub fn found(outcomes: &[&Outcome], caption: &str) -> Table {
    let mut rows: Vec<Vec<Entry>> = Vec::new();
    for (look, name) in LOOKS.iter().enumerate() {
        for (i, outcome) in outcomes.iter().filter(|o| o.look == look).enumerate() {
            let row = |scene: &str, line: &str, entry: &dyn Fn(&TermValue) -> Entry, last: [Entry; 4]| {
                let terms = outcome.found.terms().map(entry).collect();
                [vec![(*name).into(), scene.into(), line.into()], terms, last.to_vec()].concat()
            };
            let blank = || [Entry::Dash, Entry::Dash, Entry::Dash, Entry::Dash];
            if i == 0 {
                let wanted = |t: &TermValue| scalar(t.term, || Entry::Number(t.target, 2));
                rows.push(row("target", "value", &wanted, blank()));
            }
            let scene = outcome.study.title;
            let measured = |t: &TermValue| scalar(t.term, || Entry::number(t.value));
            rows.push(row(scene, "value", &measured, blank()));
            let ours = [sum(&outcome.found), outcome.found.f_q, outcome.error, outcome.f_q_final];
            let ours = ours.map(Entry::number);
            rows.push(row(scene, "f", &|t| Entry::number(t.f), ours));
            let paper = published::of(&outcome.study, look);
            if paper == published::Published::default() {
                continue;
            }
            let printed = |t: &TermValue| Entry::known(paper.f(t.term));
            let last = [Entry::known(paper.sum), Entry::known(paper.f_q), Entry::Dash, Entry::Dash];
            rows.push(row(scene, "f, published", &printed, last));
        }
    }
    Table {
        caption: caption.to_owned(),
        header: header(&["look", "scene", "quantity"], &["Σ w f", "f_q", "±", "f_q, full size"]),
        rows,
        grouped: 2,
    }
}

/// Weighted sum of the least f of each term by itself, a lower bound of f_q as far as the scan saw.
#[must_use]
pub fn sum_of_floors(outcome: &Outcome) -> f64 {
    outcome.reach.iter().map(|r| r.floor * outcome.found[r.term].weight).sum()
}

/// Table of the range of each term within reach by itself, beside the terms found.
#[must_use]
pub fn gaps(outcomes: &[&Outcome]) -> Table {
    let mut rows: Vec<Vec<Entry>> = Vec::new();
    for outcome in outcomes {
        let names = [outcome.study.title, outcome.study.background_word(), LOOKS[outcome.look]];
        let of = |entry: &dyn Fn(&Reach) -> Entry| {
            let find = |t: Term| outcome.reach.iter().find(|r| r.term == t).map_or(Entry::Dash, entry);
            Term::standing().map(find).collect()
        };
        let row = |line: &str, terms: Vec<Entry>, total: Entry| {
            let first = names.map(Entry::from).to_vec();
            [first, vec![line.into()], terms, vec![total]].concat()
        };
        let wanted = of(&|r| scalar(r.term, || Entry::Number(r.target, 2)));
        rows.push(row("target", wanted, Entry::Dash));
        let range = of(&|r| format!("{:.2}–{:.2}", r.least, r.largest).into());
        rows.push(row("reachable", range, Entry::Dash));
        let floors = of(&|r| Entry::number(r.floor));
        rows.push(row("least f", floors, Entry::number(sum_of_floors(outcome))));
        let found = outcome.found.terms().map(|t| Entry::number(t.f)).collect();
        rows.push(row("f found", found, Entry::number(sum(&outcome.found))));
    }
    Table {
        caption: "What was found, and what these lights can reach of each term by itself, whatever becomes of \
                  the others. The weighted sum of the least f bounds f_q from below, as far as the scan saw; what \
                  was found lies above it by the price of one term against another."
            .to_owned(),
        header: header(&["scene", "background", "look", "quantity"], &["Σ w f"]),
        rows,
        grouped: 3,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{figures::STUDIES, objective::Objective};

    fn outcome(look: usize) -> Outcome {
        let target = Target::resolve(LOOKS[look]).unwrap();
        let objective = Objective::new(&target, 2, 2, &[true, false, false, true]).unwrap();
        let found = objective.evaluate(&[0.2, 0.4, 0.6, 0.9]);
        let reach = |t: &TermValue| Reach {
            term: t.term,
            target: t.target,
            floor: 0.5 * t.f,
            least: 0.0,
            largest: 1.0,
        };
        Outcome {
            study: STUDIES[0],
            look,
            f_q_initial: 1.0,
            reach: found.terms().map(reach).collect(),
            f_q_final: found.f_q,
            found,
            error: 0.01,
            caution: None,
            initial: image::RgbImage::new(1, 1),
            last: image::RgbImage::new(1, 1),
        }
    }

    #[test]
    fn unknown_numbers_are_dashes_and_sums_are_computed_anew() {
        let outcomes = [outcome(0), outcome(1)];
        let all: Vec<&Outcome> = outcomes.iter().collect();
        let table = found(&all, "");
        assert_eq!(table.rows.len(), 2 * 4);
        assert!(table.rows.iter().all(|r| r.len() == table.header.len()));
        let high = &table.rows[3];
        assert_eq!(
            high[3..9],
            [Entry::Dash, Entry::Dash, Entry::Dash, Entry::Dash, Entry::Dash, Entry::Dash]
        );
        assert_eq!(high[9..11], [Entry::number(0.237), Entry::number(0.284)]);
        let low = &table.rows[7];
        assert_eq!(low[8..11], [Entry::number(0.278), Entry::Dash, Entry::number(0.609)]);
        let (Entry::Number(sum, _), Entry::Number(f_q, _)) = (&table.rows[2][9], &table.rows[2][10]) else {
            panic!("{:?}", table.rows[2]);
        };
        assert!((sum - f_q).abs() < 1e-12);
    }

    #[test]
    fn what_the_paper_does_not_show_has_no_row_for_its_numbers() {
        let free = Outcome { study: STUDIES[3], ..outcome(0) };
        assert_eq!(found(&[&free], "").rows.len(), 3);
    }

    #[test]
    fn the_sum_of_least_terms_is_weighted() {
        let outcome = outcome(1);
        assert!((sum_of_floors(&outcome) - 0.5 * outcome.found.f_q).abs() < 1e-12);
        let table = gaps(&[&outcome]);
        assert!(table.rows.iter().all(|r| r.len() == table.header.len()));
    }

    #[test]
    fn the_built_in_targets_are_those_of_table_1() {
        let both = LOOKS.map(|l| Target::resolve(l).unwrap());
        let table = targets(&both);
        let numbers = |row: usize| -> Vec<f64> {
            table.rows[row]
                .iter()
                .filter_map(|e| if let Entry::Number(v, _) = e { Some(*v) } else { None })
                .collect()
        };
        assert_eq!(numbers(0), [0.47, 0.78, 0.24, 0.17, 0.39]);
        assert_eq!(numbers(1), [0.47, 0.04, 0.63, 0.04, 0.39]);
        assert_eq!(numbers(2), [0.5, 0.5, 0.4, 0.4, 0.2, 1.0]);
    }
}
