//! `scan --pareto`: the front between two aims, as a table, a plot and small pictures.

use std::path::PathBuf;

use anyhow::{Context, bail};
use plotters::prelude::*;

use super::{
    relight,
    scan::{ScanArgs, png_of},
};
use crate::{
    audit::{lights::LightsFile, picture, stored::About, write_whole},
    design::{
        evaluator::Evaluator,
        pareto::{Aim, FrontPoint, front, power},
    },
    files::csv_file,
    film::image_file::write_view_png,
    math::Measure,
    objective::{Objective, Target, Term},
    photo::Look,
    transport::TransportBasis,
    variables::ParamVector,
};

/// Word for the power of all lights.
const WATTS: &str = "watts";
/// Pictures along the front at most: as many as fit beside each other on a page.
const PICTURES: usize = 9;
/// Seed of the points among which descents find their starts.
const SEED: u32 = 1;

/// Two aims as the user named them.
struct Aims {
    aims: [Aim; 2],
    /// Whether a look among them, or the target of a term, asks for colour.
    color: bool,
}

/// Runs the subcommand.
///
/// # Errors
/// When the basis or an aim is wrong, or nothing can be written.
pub fn pareto(args: &ScanArgs, names: &[String]) -> anyhow::Result<()> {
    let [a, b] = names else { bail!("--pareto {}: name two aims, A,B", names.join(",")) };
    if !args.output.extension().is_some_and(|e| e.eq_ignore_ascii_case("csv")) {
        bail!("{}: the table ends in .csv", args.output.display());
    }
    crate::files::atomic::probe(&args.output)?;
    let (basis, about) = relight::load(&args.basis)?;
    let variables = about.variables();
    if variables.is_empty() {
        bail!("{}: nothing is free in the basis", args.basis.display());
    }
    let mut fixed = about.lighting();
    if let Some(path) = &args.lights {
        LightsFile::load(path)?.apply_to(&about, basis.layout(), &mut fixed, path)?;
    }
    let Aims { aims, color } = read_aims(args, [a, b], &basis, &about)?;
    let measure = Measure { view: args.view.unwrap_or(about.view), color, ..about.measure() };
    super::scan::check_planes(args, &basis, measure)?;
    let halves = basis.halves();
    let objective = about.objective(&Target::resolve("high-key")?, &basis)?;
    let evaluator = Evaluator {
        basis: &basis,
        halves: &halves,
        objective: &objective,
        variables: &variables,
        fixed: &fixed,
        measure,
        least_sizes: &[],
    };
    let found = front(&evaluator, &aims, args.steps as usize, SEED)?;
    let in_units: Vec<[f64; 2]> =
        found.iter().map(|p| std::array::from_fn(|k| p.values[k] * aims[k].unit())).collect();
    write_whole(&args.output, table([a, b], &found, &in_units, &variables)?)?;
    let plot_path = args.output.with_extension("png");
    write_whole(&plot_path, plot([a, b], &in_units)?)?;
    let pictures = pictures(args, &basis, &about, &evaluator, &found)?;
    super::print(&format!(
        "{} lightings, from {a} {:.4} and {b} {:.4} to {a} {:.4} and {b} {:.4}\n{}\n{}\n{}\n",
        found.len(),
        in_units[0][0],
        in_units[0][1],
        in_units[found.len() - 1][0],
        in_units[found.len() - 1][1],
        args.output.display(),
        plot_path.display(),
        pictures.iter().map(|p| p.display().to_string()).collect::<Vec<_>>().join("\n")
    ))
}

/// What the names stand for: terms of the target, looks, or the power of the lights.
fn read_aims(
    args: &ScanArgs,
    names: [&String; 2],
    basis: &TransportBasis,
    about: &About,
) -> anyhow::Result<Aims> {
    let longest = basis.layout().size.max_element() as usize;
    let mut color = false;
    let mut look = |spec: &str| -> anyhow::Result<Objective> {
        let target = Look::resolve(spec, None)?.into_target(about.luminance, longest, args.matched.get())?;
        color |= target.needs_color();
        Ok(about.objective(&target, basis)?)
    };
    let mut aims = Vec::new();
    for name in names {
        let term = Term::ALL.into_iter().find(|term| term.name() == name);
        aims.push(match term {
            _ if name == WATTS => {
                if about.watts.is_empty() {
                    bail!(
                        "{}: the basis does not say the power of its lights; `run` it anew",
                        args.basis.display()
                    );
                }
                let lights = about.watts.clone();
                let unit = power(&lights, &about.lighting());
                Aim::Power { lights, unit: if unit > 0.0 { unit } else { 1.0 } }
            }
            Some(term) => {
                let objective = look(&args.target)?;
                if !objective.listed().any(|listed| listed == term) {
                    bail!("--pareto {name}: {} asks for no {name}", args.target);
                }
                Aim::Look(Box::new(objective.only(term)))
            }
            None => Aim::Look(Box::new(look(name).with_context(|| {
                let terms: Vec<&str> = Term::ALL.into_iter().map(Term::name).collect();
                format!("--pareto {name}: neither a term ({}), nor {WATTS}, nor a look", terms.join(", "))
            })?)),
        });
    }
    let aims = <[Aim; 2]>::try_from(aims).map_err(|_| anyhow::anyhow!("two aims"))?;
    Ok(Aims { aims, color })
}

/// The CSV: both aims, then the variables.
fn table(
    names: [&String; 2],
    found: &[FrontPoint],
    values: &[[f64; 2]],
    variables: &ParamVector,
) -> Result<Vec<u8>, csv::Error> {
    let header = names.into_iter().cloned().chain(variables.variables.iter().map(|v| v.name.clone()));
    let line = |(p, values): (&FrontPoint, &[f64; 2])| -> Vec<String> {
        let x = variables.decode(&p.u);
        values.iter().chain(&x).map(ToString::to_string).collect()
    };
    csv_file::encode(std::iter::once(header.collect()).chain(found.iter().zip(values).map(line)))
}

/// A PNG of the front.
fn plot(names: [&String; 2], values: &[[f64; 2]]) -> anyhow::Result<Vec<u8>> {
    let range = |k: usize| {
        let all = || values.iter().map(move |v| v[k]);
        let (low, high) = (all().fold(f64::INFINITY, f64::min), all().fold(f64::NEG_INFINITY, f64::max));
        let margin = (0.06 * (high - low)).max(1e-6);
        low - margin..high + margin
    };
    png_of(|root| {
        let mut chart = ChartBuilder::on(root)
            .caption(format!("front between {} and {}", names[0], names[1]), ("sans-serif", 22))
            .margin(16)
            .x_label_area_size(44)
            .y_label_area_size(64)
            .build_cartesian_2d(range(0), range(1))?;
        chart.configure_mesh().x_desc(names[0].as_str()).y_desc(names[1].as_str()).draw()?;
        chart.draw_series(LineSeries::new(
            values.iter().map(|v| (v[0], v[1])),
            BLACK.mix(0.4).stroke_width(2),
        ))?;
        chart.draw_series(values.iter().map(|v| Circle::new((v[0], v[1]), 4, BLACK.filled())))?;
        Ok(())
    })
}

/// Writes small pictures along the front with their lightings, at even steps from end to end; returns the pictures'
/// paths.
fn pictures(
    args: &ScanArgs,
    basis: &TransportBasis,
    about: &About,
    evaluator: &Evaluator,
    found: &[FrontPoint],
) -> anyhow::Result<Vec<PathBuf>> {
    let n = found.len().min(PICTURES);
    let stem = args.output.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let mut paths = Vec::new();
    for k in 0..n {
        let point = &found[if n > 1 { k * (found.len() - 1) / (n - 1) } else { 0 }];
        let x = evaluator.lighting(&evaluator.variables.decode(&point.u));
        let path = args.output.with_file_name(format!("{stem}-{:02}.png", k + 1));
        let size = [basis.layout().size.x, basis.layout().size.y].map(|n| n as usize);
        let features = about.features.as_ref().and_then(|features| features.read(size));
        let shown = picture::beauty(&basis.shown(&x, features.as_ref()));
        write_view_png(&path, &shown, x.exposure, evaluator.measure.view)?;
        let lights = LightsFile::of_basis(about, basis.layout(), &x).seen_through(evaluator.measure.view);
        write_whole(&path.with_extension("toml"), toml::to_string(&lights)?)?;
        paths.push(path);
    }
    Ok(paths)
}
