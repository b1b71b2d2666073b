//! Plot and table of f_q along a search: by renders in paper mode, by evaluations in default mode.

use std::{
    fs, io,
    path::{Path, PathBuf},
};

use plotters::prelude::*;
use serde_json::Value;

use super::{
    LOOKS,
    table::{Entry, Table},
};
use crate::{
    canvas::{Anchor, Area, Canvas, FigureError, INK, SCALE, dot, line, text},
    design::Gradient,
};

/// An evaluation of f_q in a search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Number of the evaluation, from 1.
    pub evaluation: u64,
    /// Number of renders of the search up to the evaluation; `None` in default mode.
    pub renders: Option<u64>,
    /// Value of f_q.
    pub f_q: f64,
    /// Half width of the 95 % interval of f_q, with the noise correction.
    pub error: f64,
}

/// A search for the lights of one look, as it was recorded.
#[derive(Clone, Debug)]
pub struct SearchLog {
    /// Source of the gradients: finite differences in paper mode, the basis in default mode.
    pub gradient: Gradient,
    /// Index of the look in [`LOOKS`].
    pub look: usize,
    /// Evaluations that led to the result, in order.
    pub steps: Vec<Step>,
    /// f_q of the result measured with new samples, and the half width of its error bar.
    pub check: [f64; 2],
}

/// The log of a run cannot be read.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum LogError {
    #[error("{path}: cannot read the log", path = path.display())]
    Read { path: PathBuf, source: io::Error },
    #[error("{path}:{line}: no evaluation", path = path.display())]
    Line { path: PathBuf, line: usize },
}

/// Evaluations that a run directory has recorded, in paper mode without the starts among which it
/// chose.
///
/// # Errors
/// When the log cannot be read.
pub fn steps(run: &Path) -> Result<Vec<Step>, LogError> {
    let path = run.join("evaluations.jsonl");
    let text = fs::read_to_string(&path).map_err(|source| LogError::Read { path: path.clone(), source })?;
    let mut steps = Vec::new();
    // The count goes on from one look to the next; a log begins with the render of a start.
    let mut before = None;
    for (i, line) in text.lines().enumerate() {
        let fail = || LogError::Line { path: path.clone(), line: i + 1 };
        let value: Value = serde_json::from_str(line).map_err(|_| fail())?;
        let renders = value["renders"].as_u64();
        before = before.or(renders.map(|n| n.saturating_sub(1)));
        let Some(evaluation) = value["evaluation"].as_u64() else { continue };
        steps.push(Step {
            evaluation,
            renders: renders.zip(before).map(|(n, b)| n - b),
            f_q: value["f_q"].as_f64().ok_or_else(fail)?,
            error: value["f_q_error"].as_f64().ok_or_else(fail)?,
        });
    }
    Ok(steps)
}

/// Name of the mode whose gradients come from `gradient`.
#[must_use]
pub fn mode(gradient: Gradient) -> &'static str {
    match gradient {
        Gradient::Basis => "default",
        Gradient::Fd => "paper",
    }
}

/// Table of all evaluations of some searches.
#[must_use]
pub fn table(searches: &[SearchLog]) -> Table {
    let row = |s: &SearchLog, step: &Step| {
        vec![
            LOOKS[s.look].into(),
            mode(s.gradient).into(),
            Entry::Number(step.evaluation as f64, 0),
            step.renders.map_or(Entry::Dash, |n| Entry::Number(n as f64, 0)),
            Entry::Number(step.f_q, 4),
            Entry::Number(step.error, 4),
        ]
    };
    Table {
        caption: String::new(),
        header: vec!["look", "mode", "evaluation", "renders", "f_q", "error"],
        rows: searches.iter().flat_map(|s| s.steps.iter().map(|step| row(s, step))).collect(),
        grouped: 0,
    }
}

/// Width and height of the plot, pixels.
const SIZE: (u32, u32) = (1120, 800);
/// Colour of evaluations.
const POINT: RGBColor = RGBColor(120, 160, 200);
/// Colour of the least f_q so far.
const BEST: RGBColor = RGBColor(0, 70, 130);
/// Colour of the result.
const CHECK: RGBColor = RGBColor(200, 80, 0);

/// Height of the legend above the panels, pixels.
const LEGEND: i32 = 48;

/// Draws a row of panels per look, a column per mode.
///
/// # Errors
/// When the font or the canvas fails.
pub fn plot(searches: &[SearchLog]) -> Result<Canvas, FigureError> {
    Canvas::drawn(SIZE, |area| {
        legend(area)?;
        let (_, below) = area.split_vertically(LEGEND * SCALE);
        let panels = below.split_evenly((LOOKS.len(), 2));
        for (look, pair) in panels.chunks(2).enumerate() {
            // One scale for both modes.
            let of_look = || searches.iter().filter(|s| s.look == look);
            let values =
                of_look().flat_map(|s| s.steps.iter().map(|p| p.f_q).chain([s.check[0] + s.check[1]]));
            let top = 1.08 * values.fold(0.1_f64, f64::max);
            for (area, gradient) in pair.iter().zip([Gradient::Fd, Gradient::Basis]) {
                if let Some(search) = of_look().find(|s| s.gradient == gradient) {
                    panel(area, search, top)?;
                }
            }
        }
        Ok(())
    })
}

/// Draws what the marks mean, in a line at the top.
fn legend(area: &Area) -> Result<(), FigureError> {
    let y = 26;
    let letter = |words, x| text(area, words, (x, y), 16, INK, Anchor::Left);
    dot(area, (92, y), 4, POINT)?;
    letter("evaluation", 106)?;
    line(area, &[(236, y), (264, y)], BEST.to_rgba(), 2)?;
    letter("best so far", 274)?;
    line(area, &[(404, y), (432, y)], CHECK.to_rgba(), 2)?;
    letter("result, measured on samples that chose nothing", 442)
}

/// Draws the evaluations of one search, with f_q up to `top`.
fn panel(area: &Area, search: &SearchLog, top: f64) -> Result<(), FigureError> {
    let at = |s: &Step| s.renders.unwrap_or(s.evaluation) as f64;
    let last = 1.03 * search.steps.last().map_or(1.0, at);
    let (name, along) = match search.gradient {
        Gradient::Fd => ("paper mode", "renders"),
        Gradient::Basis => ("default mode", "evaluations on one transport basis"),
    };
    let [f_q, error] = search.check;
    let title = format!("{}, {name}: {f_q:.3} ± {error:.3}", LOOKS[search.look]);
    let font = |size: i32| ("sans-serif", size * SCALE).into_font().color(&INK);
    let mut chart = ChartBuilder::on(area)
        .caption(title, font(18))
        .margin(12 * SCALE)
        .x_label_area_size(46 * SCALE)
        .y_label_area_size(60 * SCALE)
        .build_cartesian_2d(0.0..last, 0.0..top)?;
    chart
        .configure_mesh()
        .x_labels(7)
        .y_labels(7)
        .x_label_formatter(&|x| format!("{x:.0}"))
        .y_label_formatter(&|y| format!("{y:.2}"))
        .x_desc(along)
        .y_desc("f_q")
        .label_style(font(14))
        .axis_desc_style(font(15))
        .axis_style(BLACK.mix(0.6).stroke_width(SCALE as u32))
        .set_all_tick_mark_size(4 * SCALE)
        .light_line_style(WHITE)
        .bold_line_style(BLACK.mix(0.12).stroke_width(SCALE as u32))
        .draw()?;
    let width = 2 * SCALE as u32;
    let band = [(0.0, (f_q - error).max(0.0)), (last, f_q + error)];
    chart.draw_series([Rectangle::new(band, CHECK.mix(0.18).filled())])?;
    chart.draw_series(LineSeries::new([(0.0, f_q), (last, f_q)], CHECK.stroke_width(width)))?;
    let points = search.steps.iter().map(|s| Circle::new((at(s), s.f_q), 3 * SCALE, POINT.filled()));
    chart.draw_series(points)?;
    chart.draw_series(LineSeries::new(best(&search.steps, at), BEST.stroke_width(width)))?;
    Ok(())
}

/// Corners of the staircase of the least f_q so far; `at` gives the position of an evaluation.
fn best(steps: &[Step], at: impl Fn(&Step) -> f64) -> Vec<(f64, f64)> {
    let mut corners: Vec<(f64, f64)> = Vec::new();
    let mut least = f64::INFINITY;
    for step in steps {
        if least.is_finite() {
            corners.push((at(step), least));
        }
        least = least.min(step.f_q);
        corners.push((at(step), least));
    }
    corners
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_best_so_far_is_a_falling_staircase() {
        let step = |evaluation, f_q| Step { evaluation, renders: None, f_q, error: 0.0 };
        let steps = [step(1, 0.5), step(2, 0.7), step(3, 0.2)];
        let corners = best(&steps, |s| s.evaluation as f64);
        assert_eq!(corners, [(1.0, 0.5), (2.0, 0.5), (2.0, 0.5), (3.0, 0.5), (3.0, 0.2)]);
    }

    #[test]
    fn starts_are_no_steps_and_broken_logs_name_their_line() {
        let run = tempfile::tempdir().unwrap();
        let log = run.path().join("evaluations.jsonl");
        let good = "{\"start\":\"a\",\"f_q\":0.9,\"renders\":61}\n\
                    {\"evaluation\":1,\"f_q\":0.5,\"f_q_error\":0.1,\"renders\":68}\n";
        fs::write(&log, good).unwrap();
        // The first start is the first render of the search, whatever came before.
        assert_eq!(
            steps(run.path()).unwrap(),
            [Step { evaluation: 1, renders: Some(8), f_q: 0.5, error: 0.1 }]
        );
        fs::write(&log, "{\"evaluation\":1}\n").unwrap();
        assert!(steps(run.path()).unwrap_err().to_string().ends_with("evaluations.jsonl:1: no evaluation"));
    }
}
