//! A plot of what the lights can reach of every term, beside what was found.

use plotters::prelude::*;

use super::{
    LOOKS, Outcome,
    canvas::{Anchor, Area, Canvas, FAINT, FigureError, INK, line, text},
    published,
};
use crate::objective::Term;

/// Lengths, pixels.
const PANEL: (i32, i32) = (270, 210);
const GAP: i32 = 28;
const LEFT: i32 = 128;
const TOP: i32 = 74;
const BOTTOM: i32 = 62;
/// Height of the letters.
const LETTERS: u32 = 15;
/// The largest f shown.
const MOST: f64 = 1.0;

const OUT_OF_REACH: RGBColor = RGBColor(205, 205, 205);
const FOUND: RGBColor = RGBColor(0, 96, 160);
const PAPER: RGBColor = RGBColor(200, 80, 0);

/// Draws a panel per outcome: a column per study, a row per look.
///
/// # Errors
/// When the font or the canvas fails.
pub fn plot(outcomes: &[&Outcome]) -> Result<Canvas, FigureError> {
    let mut studies: Vec<_> = outcomes.iter().map(|o| o.study).collect();
    studies.dedup();
    let n = studies.len().max(1) as i32;
    let width = LEFT + n * (PANEL.0 + GAP);
    let height = TOP + 2 * (PANEL.1 + GAP) - GAP + BOTTOM;
    let mut canvas = Canvas::new(width as u32, height as u32);
    canvas.draw(|area| {
        legend(area)?;
        for (i, study) in studies.iter().enumerate() {
            let x = LEFT + i as i32 * (PANEL.0 + GAP);
            let background = if study.background { ", background free" } else { "" };
            let name = format!("{}{background}", study.title);
            text(area, &name, (x + PANEL.0 / 2, TOP - 16), LETTERS + 1, INK, Anchor::Center)?;
            for (look, _) in LOOKS.iter().enumerate() {
                let y = TOP + look as i32 * (PANEL.1 + GAP);
                let found = outcomes.iter().find(|o| o.study == *study && o.look == look);
                panel(area, found.copied(), (x, y), look + 1 == LOOKS.len())?;
            }
        }
        for (look, name) in LOOKS.iter().enumerate() {
            let y = TOP + look as i32 * (PANEL.1 + GAP);
            text(area, name, (18, y + PANEL.1 / 2), LETTERS + 1, INK, Anchor::Upward)?;
            for (k, term) in Term::ALL.iter().enumerate() {
                text(area, term.name(), (LEFT - 10, row(y, k)), LETTERS, INK, Anchor::Right)?;
            }
        }
        Ok(())
    })?;
    Ok(canvas)
}

/// Middle of a term's row in the panel at `y`.
fn row(y: i32, term: usize) -> i32 {
    y + PANEL.1 * (2 * term as i32 + 1) / 12
}

/// Where f lies in the panel at `x`.
fn across(x: i32, f: f64) -> i32 {
    x + (f64::from(PANEL.0) * (f / MOST).clamp(0.0, 1.0)).round() as i32
}

fn panel(area: &Area, found: Option<&Outcome>, (x, y): (i32, i32), is_last: bool) -> Result<(), FigureError> {
    let (right, bottom) = (x + PANEL.0, y + PANEL.1);
    for tick in [0.0, 0.25, 0.5, 0.75, 1.0] {
        let at = across(x, tick * MOST);
        line(area, vec![(at, y), (at, bottom)], BLACK.mix(0.12), 1)?;
        if is_last {
            let label = format!("{:.2}", tick * MOST);
            text(area, &label, (at, bottom + 14), LETTERS - 2, FAINT, Anchor::Center)?;
        }
    }
    if is_last {
        text(area, "f of the term", ((x + right) / 2, bottom + 38), LETTERS, INK, Anchor::Center)?;
    }
    if let Some(outcome) = found {
        let paper = published::of(&outcome.study, outcome.look);
        for (k, term) in Term::ALL.into_iter().enumerate() {
            let at = row(y, k);
            if let Some(reach) = outcome.reach.iter().find(|r| r.term == term) {
                let bar = [(x, at - 8), (across(x, reach.floor), at + 8)];
                area.draw(&Rectangle::new(bar, OUT_OF_REACH.filled()))?;
            }
            let f = outcome.found.get(term).f;
            area.draw(&Circle::new((across(x, f), at), 5, FOUND.filled()))?;
            if let Some(hist) = paper.hist.filter(|_| term == Term::Hist) {
                diamond(area, (across(x, hist), at))?;
            }
        }
    }
    line(area, vec![(x, y), (right, y), (right, bottom), (x, bottom), (x, y)], BLACK.mix(0.5), 1)
}

fn diamond(area: &Area, (x, y): (i32, i32)) -> Result<(), FigureError> {
    let points = vec![(x - 6, y), (x, y - 6), (x + 6, y), (x, y + 6), (x - 6, y)];
    line(area, points, PAPER.to_rgba(), 2)
}

/// What the marks mean, in a line at the top.
fn legend(area: &Area) -> Result<(), FigureError> {
    let y = 20;
    let mut x = LEFT;
    area.draw(&Rectangle::new([(x, y - 8), (x + 24, y + 8)], OUT_OF_REACH.filled()))?;
    text(area, "out of reach", (x + 32, y), LETTERS, INK, Anchor::Left)?;
    x += 160;
    area.draw(&Circle::new((x, y), 5, FOUND.filled()))?;
    text(area, "found", (x + 14, y), LETTERS, INK, Anchor::Left)?;
    x += 90;
    diamond(area, (x, y))?;
    text(area, "published", (x + 14, y), LETTERS, INK, Anchor::Left)
}
