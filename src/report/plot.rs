//! Plots of a run for papers: convergence, terms, histograms, and f_q along each variable; as SVG, PDF or PNG.

use std::{cell::RefCell, path::Path, rc::Rc};

use ab_glyph::FontRef;
use plotters::{
    coord::Shift,
    prelude::*,
    style::text_anchor::{HPos, Pos, VPos},
};
use serde_json::Value;

use super::{ReportError, gather, live, pdf::Pdf};
use crate::{
    audit::live::Live,
    canvas::{Canvas, FigureError, INK, SCALE, take_font},
    lighting::Lighting,
    math::Measure,
    objective::Statistics,
    variables::ParamVector,
};

/// What a plot shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum What {
    /// f_q over the evaluations that led to the result.
    Convergence,
    /// Histograms of the start and of the result against the signature.
    Histogram,
    /// The share of each term in f_q over the evaluations.
    Terms,
    /// f_q along each variable, all others as found.
    Scan,
}

impl What {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Convergence, Self::Histogram, Self::Terms, Self::Scan];

    /// Name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Convergence => "convergence",
            Self::Histogram => "histogram",
            Self::Terms => "terms",
            Self::Scan => "scan",
        }
    }
}

/// Kinds of files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Vectors.
    Svg,
    /// Vectors on a page.
    Pdf,
    /// Pixels.
    Png,
}

/// Width and height of a plot, pixels.
const SIZE: (u32, u32) = (800, 500);
/// Points of a page, 1/72 inch, per pixel: 15 cm fit across a column and a half.
const POINTS: f64 = 0.54;
/// Values along each variable: enough for a smooth line in a plot of this size.
const STEPS: u32 = 49;
/// Bars of a histogram: single codes of a small picture are mostly noise.
const BARS: usize = 32;
/// Lines from which on their names stand beside the plot and not in it, where they would hide some.
const MANY: usize = 5;
/// Width of the names beside a plot, and height of each, pixels.
const NAMES: (i32, i32) = (205, 22);
/// Length of a dash and of the space behind it, pixels.
const DASH: (u32, u32) = (6, 4);
/// Colours of lines that are told apart without red and green alone.
const COLOURS: [RGBColor; 8] = [
    RGBColor(0, 70, 130),
    RGBColor(200, 80, 0),
    RGBColor(0, 130, 110),
    RGBColor(140, 70, 160),
    RGBColor(190, 150, 0),
    RGBColor(90, 140, 200),
    RGBColor(120, 60, 30),
    RGBColor(90, 90, 90),
];

/// A plot before it is drawn.
struct Plot {
    title: String,
    x: String,
    y: String,
    /// Largest x and y; both begin at 0.
    most: (f64, f64),
    lines: Vec<Line>,
}

/// A line of a plot.
struct Line {
    name: String,
    points: Vec<(f64, f64)>,
    colour: RGBColor,
    /// Half widths of the band around the points; empty for none.
    band: Vec<f64>,
    /// Whether the points are marked and not joined.
    dotted: bool,
    /// Whether the line is broken: where there are more lines than colours.
    dashed: bool,
    /// Width of the line, pixels.
    width: u32,
}

impl Line {
    fn new(name: impl Into<String>, points: Vec<(f64, f64)>, colour: RGBColor) -> Self {
        Self { name: name.into(), points, colour, band: Vec::new(), dotted: false, dashed: false, width: 2 }
    }
}

/// A plot of a run directory as the bytes of a file.
///
/// # Errors
/// When the directory has not what the plot needs, or nothing can be drawn.
pub fn plot(run: &Path, what: What, format: Format) -> Result<Vec<u8>, ReportError> {
    let plot = match what {
        What::Convergence => convergence(run)?,
        What::Terms => terms(run)?,
        What::Histogram => histogram(run)?,
        What::Scan => scan(run)?,
    };
    match format {
        Format::Png => {
            Ok(Canvas::drawn(SIZE, |area| plot.draw(area, SCALE).map_err(FigureError::from))?.png()?)
        }
        Format::Pdf => {
            take_font()?;
            let font = FontRef::try_from_slice(dejavu::sans::regular()).map_err(|_| FigureError::Font)?;
            let size = (SIZE.0 * SCALE as u32, SIZE.1 * SCALE as u32);
            let page = Rc::new(RefCell::new(Pdf::new(size, POINTS / f64::from(SCALE), font)));
            let area = DrawingArea::from(&page);
            plot.draw(&area, SCALE).map_err(|e| ReportError::Draw(e.to_string()))?;
            drop(area);
            page.borrow().finish().map_err(ReportError::Pack)
        }
        Format::Svg => {
            // Letters are measured with the font of the other figures.
            take_font()?;
            let mut text = String::new();
            let area = SVGBackend::with_string(&mut text, SIZE).into_drawing_area();
            let fail = |e: String| ReportError::Draw(e);
            area.fill(&WHITE).map_err(|e| fail(e.to_string()))?;
            plot.draw(&area, 1).map_err(|e| fail(e.to_string()))?;
            area.present().map_err(|e| fail(e.to_string()))?;
            drop(area);
            Ok(text.into_bytes())
        }
    }
}

impl Plot {
    /// Draws the plot, `scale` times as large.
    fn draw<DB: DrawingBackend>(
        &self,
        area: &DrawingArea<DB, Shift>,
        scale: i32,
    ) -> Result<(), DrawingAreaErrorKind<DB::ErrorType>> {
        let font = |size: i32| ("sans-serif", size * scale).into_font().color(&INK);
        let has_many = self.lines.len() >= MANY;
        let wide = area.dim_in_pixel().0 as i32;
        let (main, beside) = area.split_horizontally(wide - if has_many { NAMES.0 * scale } else { 0 });
        if has_many {
            self.draw_names(&beside, scale)?;
        }
        let mut chart = ChartBuilder::on(&main)
            .caption(&self.title, font(18))
            .margin(14 * scale)
            .x_label_area_size(46 * scale)
            .y_label_area_size(60 * scale)
            .build_cartesian_2d(0.0..self.most.0, 0.0..self.most.1)?;
        let whole = self.most.0 > 10.0;
        chart
            .configure_mesh()
            .x_labels(7)
            .y_labels(7)
            .x_label_formatter(&|x| if whole { format!("{x:.0}") } else { format!("{x:.1}") })
            .y_label_formatter(&|y| format!("{y:.2}"))
            .x_desc(&self.x)
            .y_desc(&self.y)
            .label_style(font(14))
            .axis_desc_style(font(15))
            .axis_style(BLACK.mix(0.6).stroke_width(scale as u32))
            .set_all_tick_mark_size(4 * scale)
            .light_line_style(WHITE)
            .bold_line_style(BLACK.mix(0.12).stroke_width(scale as u32))
            .draw()?;
        for line in &self.lines {
            let style = line.colour.stroke_width(line.width * scale as u32);
            if !line.band.is_empty() {
                let edge = |sign: f64| {
                    let at = move |(&(x, y), e): (&(f64, f64), &f64)| (x, (y + sign * e).max(0.0));
                    line.points.iter().zip(&line.band).map(at)
                };
                let outline: Vec<(f64, f64)> = edge(1.0).chain(edge(-1.0).rev()).collect();
                chart.draw_series([Polygon::new(outline, line.colour.mix(0.15))])?;
            }
            let length = 18 * scale;
            if line.dotted {
                let dot = |&p: &(f64, f64)| Circle::new(p, 3 * scale, line.colour.filled());
                let drawn = chart.draw_series(line.points.iter().map(dot))?;
                if !line.name.is_empty() {
                    drawn
                        .label(&line.name)
                        .legend(move |(x, y)| Circle::new((x + length / 2, y), 3 * scale, style.filled()));
                }
            } else {
                let drawn = if line.dashed {
                    let (dash, space) = (DASH.0 * scale as u32, DASH.1 * scale as u32);
                    chart.draw_series(DashedLineSeries::new(line.points.clone(), dash, space, style))?
                } else {
                    chart.draw_series(LineSeries::new(line.points.clone(), style))?
                };
                drawn
                    .label(&line.name)
                    .legend(move |(x, y)| PathElement::new([(x, y), (x + length, y)], style));
            }
        }
        if has_many {
            return Ok(());
        }
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::UpperRight)
            .legend_area_size(24 * scale)
            .margin(8 * scale)
            .label_font(font(14))
            .background_style(WHITE.mix(0.85))
            .border_style(BLACK.mix(0.2))
            .draw()
    }
}

impl Plot {
    /// Draws the names of the lines below each other, each behind a piece of it.
    fn draw_names<DB: DrawingBackend>(
        &self,
        area: &DrawingArea<DB, Shift>,
        scale: i32,
    ) -> Result<(), DrawingAreaErrorKind<DB::ErrorType>> {
        let anchor = Pos::new(HPos::Left, VPos::Center);
        let font = ("sans-serif", 14 * scale).into_font().color(&INK).pos(anchor);
        for (k, line) in self.lines.iter().filter(|line| !line.name.is_empty()).enumerate() {
            let y = scale * (50 + NAMES.1 * k as i32);
            let style = line.colour.stroke_width(line.width * scale as u32);
            let (from, to) = (2 * scale, 24 * scale);
            if line.dotted {
                area.draw(&Circle::new(((from + to) / 2, y), 3 * scale, style.filled()))?;
            } else {
                let piece = if line.dashed { DASH.0 as i32 * scale } else { to - from };
                let step = if line.dashed { (DASH.0 + DASH.1) as i32 * scale } else { piece };
                for x in (from..to).step_by(step.max(1) as usize) {
                    area.draw(&PathElement::new([(x, y), ((x + piece).min(to), y)], style))?;
                }
            }
            area.draw(&Text::new(line.name.clone(), (to + 8 * scale, y), font.clone()))?;
        }
        Ok(())
    }
}

/// A column of the evaluations.
fn column(values: &Value) -> Vec<f64> {
    values.as_array().into_iter().flatten().filter_map(Value::as_f64).collect()
}

/// Evaluations of a run: their numbers, and all of its columns.
fn evaluations(run: &Path) -> Result<(Vec<f64>, gather::Look), ReportError> {
    let look = gather::look(run, None)?;
    let n = column(&look.data["evaluations"]["n"]);
    if n.is_empty() {
        return Err(ReportError::Missing { path: run.into(), name: "evaluations.jsonl" });
    }
    Ok((n, look))
}

fn convergence(run: &Path) -> Result<Plot, ReportError> {
    let (n, look) = evaluations(run)?;
    let f_q = column(&look.data["evaluations"]["f_q"]);
    let result = &look.data["result"];
    let (found, error) = (result["f_q"].as_f64().unwrap_or(0.0), result["f_q_error"].as_f64().unwrap_or(0.0));
    let last = 1.03 * n.last().copied().unwrap_or(1.0);
    let top = 1.08 * f_q.iter().copied().fold(found + error, f64::max);
    let points: Vec<(f64, f64)> = n.iter().copied().zip(f_q.iter().copied()).collect();
    let mut least = f64::INFINITY;
    let mut stairs = Vec::new();
    for &(x, y) in &points {
        if least.is_finite() {
            stairs.push((x, least));
        }
        least = least.min(y);
        stairs.push((x, least));
    }
    let evaluated = Line { dotted: true, ..Line::new("evaluation", points, RGBColor(120, 160, 200)) };
    let check = Line {
        band: vec![error; 2],
        ..Line::new("result, with its error", vec![(0.0, found), (last, found)], COLOURS[1])
    };
    Ok(Plot {
        title: format!("{}, {}: f_q {found:.3} ± {error:.3}", look.scene, look.name),
        x: "evaluation".into(),
        y: "f_q".into(),
        most: (last, top),
        lines: vec![check, evaluated, Line::new("best so far", stairs, COLOURS[0])],
    })
}

fn terms(run: &Path) -> Result<Plot, ReportError> {
    let (n, look) = evaluations(run)?;
    let mut lines = Vec::new();
    for (k, term) in look.data["terms"].as_array().into_iter().flatten().enumerate() {
        let weight = term["weight"].as_f64().unwrap_or(0.0);
        let f = column(&look.data["evaluations"]["f"][gather::text(&term["name"])]);
        let points = n.iter().copied().zip(f.iter().map(|f| weight * f)).collect();
        let dashed = k >= COLOURS.len();
        lines.push(Line {
            dashed,
            ..Line::new(gather::text(&term["label"]), points, COLOURS[k % COLOURS.len()])
        });
    }
    let f_q = column(&look.data["evaluations"]["f_q"]);
    let sum = n.iter().copied().zip(f_q.iter().copied()).collect();
    lines.push(Line { width: 3, ..Line::new("f_q", sum, RGBColor(34, 34, 34)) });
    Ok(Plot {
        title: format!("{}, {}: f_q and the shares of its terms", look.scene, look.name),
        x: "evaluation".into(),
        y: "share of f_q".into(),
        most: (1.03 * n.last().copied().unwrap_or(1.0), 1.08 * f_q.iter().copied().fold(0.01, f64::max)),
        lines,
    })
}

/// The small copy of the basis of a run, with the record of what it came to.
fn relit(run: &Path) -> Result<(Live, gather::Look), ReportError> {
    let look = gather::look(run, None)?;
    let path = live(run).ok_or(ReportError::Missing { path: run.into(), name: "live.basis" })?;
    Ok((Live::load(&path)?, look))
}

/// A lighting of the record of a run, of as many lights as the copy of its basis has.
fn lighting(
    look: &gather::Look,
    run: &Path,
    live: &Live,
    name: &'static str,
) -> Result<Lighting, ReportError> {
    let n = live.copy.header.lights.len();
    let read =
        serde_json::from_value::<Lighting>(look.data["result"][name].clone()).map_err(|e| e.to_string());
    let whole = read.and_then(|x| match [x.radiance.len(), x.size.len()] == [n; 2] {
        true => Ok(x),
        false => Err(format!("must have {n} lights")),
    });
    whole.map_err(|e| ReportError::Record {
        path: run.join(crate::audit::RESULT),
        message: format!("`{name}`: {e}"),
    })
}

fn histogram(run: &Path) -> Result<Plot, ReportError> {
    let (live, look) = relit(run)?;
    let open = live.copy.open().map_err(ReportError::Pack)?;
    let [width, height] = live.copy.header.size.map(|n| n as usize);
    let bars = |q: &[f64]| -> Vec<(f64, f64)> {
        let wide = q.len() / BARS;
        let share = |i: usize| q[wide * (i + 1) - 1] - if i == 0 { 0.0 } else { q[wide * i - 1] };
        let corners = |i: usize| [(i, share(i)), (i + 1, share(i))].map(|(x, y)| (x as f64 / BARS as f64, y));
        (0..BARS).flat_map(corners).collect()
    };
    let mut lines = Vec::new();
    for (name, label, colour) in [("start", "start", COLOURS[7]), ("found", "result", COLOURS[0])] {
        let x = lighting(&look, run, &live, name)?;
        let l = live.facts.about.measure().encode_image(&open.picture(&x), x.exposure);
        lines.push(Line::new(label, bars(&Statistics::measure_whole(&l, width, height).cumulated()), colour));
    }
    let wanted = column(&look.data["signature"]["cumulated"]);
    if !wanted.is_empty() {
        let name = format!("signature {}", gather::text(&look.data["signature"]["name"]));
        lines.push(Line { width: 3, ..Line::new(name, bars(&wanted), COLOURS[1]) });
    }
    let top = lines.iter().flat_map(|l| &l.points).map(|p| p.1).fold(0.0, f64::max);
    Ok(Plot {
        title: format!("{}, {}: brightness", look.scene, look.name),
        x: "brightness".into(),
        y: "share of the pixels".into(),
        most: (1.0, 1.08 * top),
        lines,
    })
}

fn scan(run: &Path) -> Result<Plot, ReportError> {
    let (live, look) = relit(run)?;
    let open = live.copy.open().map_err(ReportError::Pack)?;
    let target = gather::target(&gather::manifest(run)?["target"], run)?;
    let objective = live.objective(&target)?;
    let measure = Measure { color: target.needs_color(), ..live.facts.about.measure() };
    let found = lighting(&look, run, &live, "found")?;
    let all = live.facts.about.variables();
    let f_q = |x: &Lighting| objective.evaluate(&measure.encode_image(&open.picture(x), x.exposure)).f_q;
    let here = f_q(&found);
    let mut lines = Vec::new();
    let mut marks = Vec::new();
    for (k, variable) in all.variables.iter().enumerate() {
        let alone = ParamVector { variables: vec![variable.clone()], ties: all.ties.clone() };
        let mut lighting = found.clone();
        let here_u = variable.encode(*variable.kind.value(&mut lighting, variable.light));
        marks.push((here_u, here));
        // Where f_q has its kink is among the values.
        let mut values: Vec<f64> = (0..STEPS).map(|i| f64::from(i) / f64::from(STEPS - 1)).collect();
        values.push(here_u);
        values.sort_by(f64::total_cmp);
        let at = |u: f64| (u, f_q(&alone.lighting(found.clone(), &[variable.decode(u)])));
        let points = values.into_iter().map(at).collect();
        let dashed = k / COLOURS.len() % 2 == 1;
        lines.push(Line { dashed, ..Line::new(&variable.name, points, COLOURS[k % COLOURS.len()]) });
    }
    lines.push(Line { dotted: true, ..Line::new("as found", marks, RGBColor(34, 34, 34)) });
    let top = lines.iter().flat_map(|l| &l.points).map(|p| p.1).fold(0.0, f64::max);
    Ok(Plot {
        title: format!("{}, {}: f_q along each variable", look.scene, look.name),
        x: "from the lower to the upper bound, on the optimiser's scale".into(),
        y: "f_q, noise included".into(),
        most: (1.0, 1.08 * top),
        lines,
    })
}
