//! Plot of the terms found, beside the least that the lights can reach of each.

use plotters::prelude::*;

use super::{LOOKS, Outcome, published};
use crate::{
    canvas::{Anchor, Area, Canvas, FAINT, FigureError, INK, bar, dot, line, text},
    objective::Term,
};

/// Width and height of a panel, pixels.
const PANEL: (i32, i32) = (286, 168);
/// Distance between panels, pixels.
const GAP: i32 = 36;
/// Left margin, with the names of looks and terms, pixels.
const LEFT: i32 = 148;
/// Upper margin, with the legend and the names of scenes, pixels.
const TOP: i32 = 78;
/// Lower margin, with the scale, pixels.
const BOTTOM: i32 = 56;
/// Height of the letters, pixels.
const LETTERS: u32 = 15;
/// Largest f that is shown: f of the gradient may exceed 1.
const MOST: f64 = 1.25;
/// Values of f at the marks of the scale.
const TICKS: [f64; 6] = [0.0, 0.25, 0.5, 0.75, 1.0, 1.25];

/// Colour of values of a term that are out of reach.
const OUT_OF_REACH: RGBColor = RGBColor(205, 205, 205);
/// Colour of terms found.
const FOUND: RGBColor = RGBColor(0, 96, 160);
/// Colour of published terms.
const PAPER: RGBColor = RGBColor(200, 80, 0);

/// Draws a panel for each outcome: a column for each scene, and for each look a row with the
/// background's value fixed and one with it free.
///
/// # Errors
/// When the font or the canvas fails.
pub fn plot(outcomes: &[&Outcome]) -> Result<Canvas, FigureError> {
    let mut titles: Vec<&str> = outcomes.iter().map(|o| o.study.title).collect();
    let mut seen = Vec::new();
    titles.retain(|t| {
        !seen.contains(t) && {
            seen.push(t);
            true
        }
    });
    let mut rows: Vec<(usize, bool)> = outcomes.iter().map(|o| (o.look, o.study.background)).collect();
    rows.sort_unstable();
    rows.dedup();
    let x_of = |i: usize| LEFT + i as i32 * (PANEL.0 + GAP);
    let y_of = |j: usize| TOP + j as i32 * (PANEL.1 + GAP);
    let size = (x_of(titles.len()), y_of(rows.len()) - GAP + BOTTOM);
    Canvas::drawn((size.0 as u32, size.1 as u32), |area| {
        legend(area)?;
        for (i, title) in titles.iter().enumerate() {
            text(area, title, (x_of(i) + PANEL.0 / 2, TOP - 16), LETTERS + 1, INK, Anchor::Center)?;
        }
        for (j, (look, background)) in rows.iter().enumerate() {
            let middle = y_of(j) + PANEL.1 / 2;
            let word = if *background { "background free" } else { "background fixed" };
            text(area, LOOKS[*look], (16, middle), LETTERS, INK, Anchor::Upward)?;
            text(area, word, (38, middle), LETTERS - 1, FAINT, Anchor::Upward)?;
            for (k, term) in Term::standing().enumerate() {
                text(area, term.name(), (LEFT - 10, row(y_of(j), k)), LETTERS, INK, Anchor::Right)?;
            }
            for (i, title) in titles.iter().enumerate() {
                let is_here = |o: &&&Outcome| {
                    (o.study.title, o.look, o.study.background) == (*title, *look, *background)
                };
                panel(area, outcomes.iter().find(is_here).copied(), (x_of(i), y_of(j)), j + 1 == rows.len())?;
            }
        }
        Ok(())
    })
}

/// Vertical position of the middle of a term's row, in the panel whose upper edge is at `y`.
fn row(y: i32, term: usize) -> i32 {
    y + PANEL.1 * (2 * term as i32 + 1) / (2 * Term::standing().count() as i32)
}

/// Horizontal position of the value `f`, in the panel whose left edge is at `x`.
fn across(x: i32, f: f64) -> i32 {
    x + (f64::from(PANEL.0) * (f / MOST).clamp(0.0, 1.0)).round() as i32
}

/// Draws the terms of an outcome in the panel whose upper left corner is (x, y); the last row has the
/// scale below.
fn panel(area: &Area, found: Option<&Outcome>, (x, y): (i32, i32), is_last: bool) -> Result<(), FigureError> {
    let (right, bottom) = (x + PANEL.0, y + PANEL.1);
    for tick in TICKS {
        let at = across(x, tick);
        line(area, &[(at, y), (at, bottom)], BLACK.mix(0.12), 1)?;
        if is_last {
            text(area, &format!("{tick:.2}"), (at, bottom + 14), LETTERS - 2, FAINT, Anchor::Center)?;
        }
    }
    if is_last {
        text(area, "f of the term", ((x + right) / 2, bottom + 36), LETTERS, INK, Anchor::Center)?;
    }
    line(area, &[(x, y), (right, y), (right, bottom), (x, bottom), (x, y)], BLACK.mix(0.5), 1)?;
    let Some(outcome) = found else { return Ok(()) };
    let paper = published::of(&outcome.study, outcome.look);
    for (k, found) in outcome.found.terms().enumerate() {
        let at = row(y, k);
        if let Some(reach) = outcome.reach.iter().find(|r| r.term == found.term) {
            bar(area, [(x, at - 8), (across(x, reach.floor), at + 8)], OUT_OF_REACH)?;
        }
        dot(area, (across(x, found.f), at), 5, FOUND)?;
        if let Some(f) = paper.f(found.term) {
            diamond(area, (across(x, f), at))?;
        }
    }
    Ok(())
}

/// Draws the mark of a published term.
fn diamond(area: &Area, (x, y): (i32, i32)) -> Result<(), FigureError> {
    line(area, &[(x - 6, y), (x, y - 6), (x + 6, y), (x, y + 6), (x - 6, y)], PAPER.to_rgba(), 2)
}

/// Draws what the marks mean, in a line at the top.
fn legend(area: &Area) -> Result<(), FigureError> {
    let y = 22;
    let letter = |words, x| text(area, words, (x, y), LETTERS, INK, Anchor::Left);
    bar(area, [(LEFT, y - 8), (LEFT + 24, y + 8)], OUT_OF_REACH)?;
    letter("out of reach", LEFT + 32)?;
    dot(area, (LEFT + 166, y), 5, FOUND)?;
    letter("found", LEFT + 180)?;
    diamond(area, (LEFT + 256, y))?;
    letter("published", LEFT + 270)
}
