//! Plots of what was measured.

use plotters::style::{Color, RGBColor};

use super::spread::Spread;
use crate::canvas::{Anchor, Area, Canvas, FAINT, FigureError, INK, bar, line, text};

/// A measured number as a bar, its range as a line.
#[derive(Clone, Debug)]
pub struct Bar {
    /// What was measured.
    pub name: String,
    /// The number with its range: the length of the bar, and the line on it.
    pub value: Spread,
    /// Whether it is this program's.
    pub ours: bool,
}

/// Bars that belong together.
#[derive(Clone, Debug)]
pub struct Group {
    /// What they have in common.
    pub name: String,
    /// The bars.
    pub bars: Vec<Bar>,
}

/// Bars in groups: those that follow each other under the same name belong together.
#[must_use]
pub fn grouped(bars: impl IntoIterator<Item = (String, Bar)>) -> Vec<Group> {
    let mut groups: Vec<Group> = Vec::new();
    for (name, bar) in bars {
        match groups.last_mut().filter(|group| group.name == name) {
            Some(group) => group.bars.push(bar),
            None => groups.push(Group { name, bars: vec![bar] }),
        }
    }
    groups
}

/// Width of the canvas, pixels.
const WIDTH: i32 = 960;
/// Width of the left margin, with the names, pixels.
const LEFT: i32 = 320;
/// Right margin, with the last number, pixels.
const RIGHT: i32 = 80;
/// Height of a row, pixels.
const ROW: i32 = 22;
/// Upper margin, with what the bars show, pixels.
const TOP: i32 = 56;
/// Lower margin, pixels.
const BOTTOM: i32 = 20;
/// Height of letters, pixels.
const LETTERS: u32 = 14;
/// Colour of this program's bars.
const OURS: RGBColor = RGBColor(0, 96, 160);
/// Colour of the bars of other programs.
const THEIRS: RGBColor = RGBColor(176, 176, 176);

/// Draws groups of bars, one below the other, on one scale from 0.
///
/// # Errors
/// When the font or the canvas fails.
pub fn bars(groups: &[Group], what: &str) -> Result<Canvas, FigureError> {
    let rows: usize = groups.iter().map(|g| g.bars.len() + 2).sum();
    let all = groups.iter().flat_map(|g| &g.bars).map(|b| b.value.largest);
    let most = all.filter(|v| v.is_finite()).fold(f64::MIN_POSITIVE, f64::max);
    let across = |value: f64| LEFT + (f64::from(WIDTH - LEFT - RIGHT) * value / most).round() as i32;
    let height = TOP + ROW * rows as i32 + BOTTOM;
    Canvas::drawn((WIDTH as u32, height as u32), |area| {
        text(area, what, (LEFT, 24), LETTERS + 1, INK, Anchor::Left)?;
        let mut y = TOP;
        for group in groups {
            text(area, &group.name, (16, y), LETTERS, INK, Anchor::Left)?;
            y += ROW;
            for one in &group.bars {
                row(area, one, y, &across)?;
                y += ROW;
            }
            y += ROW;
        }
        Ok(())
    })
}

/// Draws a bar at a height, with its name on the left and its number on the right.
fn row(area: &Area, one: &Bar, y: i32, across: &impl Fn(f64) -> i32) -> Result<(), FigureError> {
    let Bar { name, value, ours } = one;
    text(area, name, (LEFT - 10, y), LETTERS - 1, FAINT, Anchor::Right)?;
    if !value.median.is_finite() {
        return Ok(());
    }
    bar(
        area,
        [(LEFT, y - 7), (across(value.median).max(LEFT + 1), y + 7)],
        if *ours { OURS } else { THEIRS },
    )?;
    line(area, &[(across(value.least), y), (across(value.largest), y)], INK.to_rgba(), 2)?;
    let at = across(value.largest.max(value.median)) + 8;
    text(area, &format!("{:.2}", value.median), (at, y), LETTERS - 1, INK, Anchor::Left)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bars_are_drawn_whatever_they_show() {
        let of = |values: &[f64]| Spread::of(values);
        let group = |name: &str| Group {
            name: name.to_owned(),
            bars: vec![
                Bar { name: "ours".to_owned(), value: of(&[1.0, 1.5]), ours: true },
                Bar { name: "theirs".to_owned(), value: of(&[0.5]), ours: false },
                Bar { name: "none".to_owned(), value: of(&[]), ours: false },
            ],
        };
        let png = bars(&[group("a"), group("b")], "ratio").unwrap().png().unwrap();
        let image = image::load_from_memory(&png).unwrap().to_rgb8();
        assert_eq!(image.width(), WIDTH as u32);
        let has = |color: RGBColor| image.pixels().any(|p| p.0 == [color.0, color.1, color.2]);
        assert!(has(OURS) && has(THEIRS));
    }
}
