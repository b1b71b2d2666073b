//! `scan`: f_q along a variable of a stored transport basis.

use std::path::PathBuf;

use anyhow::{Context, bail};
use clap::Args;
use plotters::prelude::*;

use super::{
    common::{MatchArgs, say_look, views},
    pareto::pareto,
    relight,
};
use crate::{
    audit::{lights::LightsFile, write_whole},
    canvas::take_font,
    design::evaluator::Evaluator,
    files::{csv_file, nearest},
    math::{Measure, ViewTransform},
    objective::{JackknifeEstimate, LABELLINGS, Term},
    photo::Look,
    transport::TransportBasis,
    variables::ParamVector,
};

/// Measure f_q and its terms along a variable, without rendering
///
/// BASIS is a transport basis that `run --cache DIR` has left in DIR. All other variables stay
/// as --lights says. Writes a CSV and, beside it, a plot.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    lightopt-embree scan --variable key.size --steps 32 bases/fruit_basket-*.basis -o size.csv\n  \
    lightopt-embree scan --variable background.value --target low-key \\\n    \
    --lights runs/fruit_basket-low-key/lights.toml bases/fruit_basket-*.basis -o value.csv\n\n\
    Columns: the variable, f_q, the half width of its 95 % interval with the noise correction,\n\
    and value and f of every term (see `evaluate --help`).")]
pub struct ScanArgs {
    /// Stored transport basis
    #[arg(value_name = "BASIS")]
    pub basis: PathBuf,

    /// Variable: LIGHT.radiance, LIGHT.size, LIGHT.color_temperature, background.value and others that were free
    #[arg(long, value_name = "NAME", required_unless_present = "pareto", conflicts_with = "pareto")]
    pub variable: Option<String>,

    /// In the place of a variable, the front between two aims over all variables: terms of the target (meanObj),
    /// looks, or watts, the power of all lights. Beside the table and its plot are small pictures along the front with
    /// their lightings
    #[arg(long, value_name = "A,B", value_delimiter = ',')]
    pub pareto: Option<Vec<String>>,

    /// Number of values, evenly spread over the optimiser's scale between the variable's bounds; of a front, of the
    /// bounds of its second aim
    #[arg(long, value_name = "N", default_value_t = 32, value_parser = clap::value_parser!(u32).range(2..=100_000))]
    pub steps: u32,

    /// The look: high-key, low-key, a target file, a photograph, or LIBRARY.toml#CLASS
    #[arg(long, value_name = "NAME|FILE", default_value = "high-key")]
    pub target: String,

    /// What of a photograph is matched.
    #[command(flatten)]
    pub matched: MatchArgs,

    /// Lighting, as `run` writes it [default: the start of the run that stored the basis]
    #[arg(long, value_name = "FILE")]
    pub lights: Option<PathBuf>,

    /// View transform between light and display; another than that of the run that stored the basis needs a
    /// basis with colour, as all views but srgb make it [default: as stored]
    #[arg(long, value_name = "VIEW", value_parser = views())]
    pub view: Option<ViewTransform>,

    /// CSV to write; the plot has the same name, ending in .png
    #[arg(short, long, value_name = "FILE.csv", default_value = "scan.csv")]
    pub output: PathBuf,
}

/// Runs the subcommand.
///
/// # Errors
/// When the basis, the lighting or the variable is wrong, or nothing can be written.
pub fn scan(args: &ScanArgs) -> anyhow::Result<()> {
    if let Some(names) = &args.pareto {
        return pareto(args, names);
    }
    let wanted = args.variable.as_deref().unwrap_or_default();
    let look = Look::resolve(&args.target, None)?;
    say_look(&look);
    if !args.output.extension().is_some_and(|e| e.eq_ignore_ascii_case("csv")) {
        bail!("{}: the table ends in .csv", args.output.display());
    }
    crate::files::atomic::probe(&args.output)?;
    let (basis, about) = relight::load(&args.basis)?;
    let longest = basis.layout().size.max_element() as usize;
    let target = look.into_target(about.luminance, longest, args.matched.get())?;
    let view = args.view.unwrap_or(about.view);
    let measure = Measure { view, color: target.needs_color(), ..about.measure() };
    check_planes(args, &basis, measure)?;
    let all = about.variables();
    let Some(variable) = all.variables.iter().find(|v| v.name == wanted) else {
        let names = || all.variables.iter().map(|v| v.name.as_str());
        let hint = nearest(wanted, names())
            .map_or_else(|| names().collect::<Vec<_>>().join(", "), |n| format!("did you mean `{n}`?"));
        bail!("{}: no variable `{}`; {hint}", args.basis.display(), wanted);
    };
    let mut fixed = about.lighting();
    if let Some(path) = &args.lights {
        LightsFile::load(path)?.apply_to(&about, basis.layout(), &mut fixed, path)?;
    }
    let objective = about.objective(&target, &basis)?;
    let variables = ParamVector { variables: vec![variable.clone()], ties: all.ties.clone() };
    let evaluator = Evaluator {
        basis: &basis,
        halves: &basis,
        objective: &objective,
        variables: &variables,
        fixed: &fixed,
        measure,
        least_sizes: &[],
    };
    let mut rows: Vec<(f64, JackknifeEstimate)> = Vec::new();
    for i in 0..args.steps {
        let u = f64::from(i) / f64::from(args.steps - 1);
        rows.push((variable.decode(u), evaluator.estimate(&[u], LABELLINGS)?));
    }
    let here = *variable.kind.value(&mut fixed, variable.light);
    write_whole(&args.output, table(wanted, &rows)?)?;
    let plot_path = args.output.with_extension("png");
    write_whole(&plot_path, plot(wanted, target.name(), here, &rows)?)?;
    let Some((x, best)) = rows.iter().min_by(|a, b| a.1.evaluation.f_q.total_cmp(&b.1.evaluation.f_q)) else {
        return Ok(());
    };
    super::print(&format!(
        "least f_q {:.4} ± {:.4} at {} = {x:.5}\n{}\n{}\n",
        best.evaluation.f_q,
        best.error_bar(),
        wanted,
        args.output.display(),
        plot_path.display()
    ))
}

/// An error where the basis has no colour that the measure needs.
///
/// # Errors
/// When it has none.
pub(super) fn check_planes(args: &ScanArgs, basis: &TransportBasis, measure: Measure) -> anyhow::Result<()> {
    if measure.n_planes() > basis.layout().planes {
        let why = match args.view {
            Some(view) if view != ViewTransform::Srgb => format!("--view {view}"),
            _ => format!("--target {}", args.target),
        };
        bail!(
            "{}: {why}: the basis has the luminance of its replicates alone; `run {why}` makes one with their colour",
            args.basis.display()
        );
    }
    Ok(())
}

/// The CSV: a header, then a line for each value of the variable.
fn table(name: &str, rows: &[(f64, JackknifeEstimate)]) -> Result<Vec<u8>, csv::Error> {
    let mut header = vec![name.to_owned(), "f_q".to_owned(), "f_q_error".to_owned()];
    header.extend(listed(rows).flat_map(|t| [t.name().to_owned(), format!("f_{}", t.name())]));
    let line = |(x, e): &(f64, JackknifeEstimate)| -> Vec<String> {
        let terms = e.evaluation.terms().flat_map(|t| [t.value, t.f]);
        [*x, e.evaluation.f_q, e.error_bar()].into_iter().chain(terms).map(|v| v.to_string()).collect()
    };
    csv_file::encode(std::iter::once(header).chain(rows.iter().map(line)))
}

/// The terms that were measured.
fn listed(rows: &[(f64, JackknifeEstimate)]) -> impl Iterator<Item = Term> {
    rows.iter().take(1).flat_map(|(_, e)| e.evaluation.terms()).map(|t| t.term)
}

/// Size of the plot, pixels.
const PLOT: (u32, u32) = (960, 600);

/// A PNG: f_q with its error, and the share of each term.
fn plot(name: &str, target: &str, here: f64, rows: &[(f64, JackknifeEstimate)]) -> anyhow::Result<Vec<u8>> {
    png_of(|root| {
        let (low, high) = (rows[0].0, rows[rows.len() - 1].0);
        let top = rows.iter().map(|(_, e)| e.evaluation.f_q + e.error_bar()).fold(0.0_f64, f64::max);
        let mut chart = ChartBuilder::on(root)
            .caption(format!("f_q of {target} along {name}"), ("sans-serif", 22))
            .margin(16)
            .x_label_area_size(44)
            .y_label_area_size(56)
            .build_cartesian_2d(low..high, 0.0..1.05 * top)?;
        chart.configure_mesh().x_desc(name).y_desc("f_q and the shares of its terms").draw()?;
        let band = rows
            .iter()
            .map(|(x, e)| (*x, e.evaluation.f_q + e.error_bar()))
            .chain(rows.iter().rev().map(|(x, e)| (*x, (e.evaluation.f_q - e.error_bar()).max(0.0))));
        chart.draw_series(std::iter::once(Polygon::new(band.collect::<Vec<_>>(), BLACK.mix(0.15))))?;
        for (k, term) in listed(rows).enumerate() {
            let color = Palette99::pick(k).to_rgba();
            let line = rows.iter().map(|(x, e)| (*x, e.evaluation[term].contribution()));
            chart
                .draw_series(LineSeries::new(line, color.stroke_width(2)))?
                .label(term.name())
                .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], color.stroke_width(2)));
        }
        let line = rows.iter().map(|(x, e)| (*x, e.evaluation.f_q));
        chart
            .draw_series(LineSeries::new(line, BLACK.stroke_width(3)))?
            .label("f_q")
            .legend(|(x, y)| PathElement::new([(x, y), (x + 18, y)], BLACK.stroke_width(3)));
        if (low..=high).contains(&here) {
            chart.draw_series(LineSeries::new([(here, 0.0), (here, 1.05 * top)], BLACK.mix(0.4)))?;
        }
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::UpperRight)
            .background_style(WHITE.mix(0.8))
            .border_style(BLACK.mix(0.3))
            .draw()?;
        Ok(())
    })
}

/// A PNG that `draw` draws on white.
pub(super) fn png_of(draw: impl FnOnce(&Canvas) -> anyhow::Result<()>) -> anyhow::Result<Vec<u8>> {
    take_font()?;
    let mut pixels = vec![0_u8; (PLOT.0 * PLOT.1 * 3) as usize];
    {
        let root = BitMapBackend::with_buffer(&mut pixels, PLOT).into_drawing_area();
        root.fill(&WHITE)?;
        draw(&root)?;
        root.present()?;
    }
    let mut png = std::io::Cursor::new(Vec::new());
    let image = image::RgbImage::from_raw(PLOT.0, PLOT.1, pixels).context("cannot draw the plot")?;
    image.write_to(&mut png, image::ImageFormat::Png)?;
    Ok(png.into_inner())
}

/// What plots are drawn on.
pub(super) type Canvas<'a> = DrawingArea<BitMapBackend<'a>, plotters::coord::Shift>;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_variable_named_with_commas_and_quotes_is_one_column() {
        let name = "key, \"left\".size";
        let text = table(name, &[]).unwrap();
        let mut reader = csv::Reader::from_reader(text.as_slice());
        assert_eq!(reader.headers().unwrap(), vec![name, "f_q", "f_q_error"]);
    }
}
