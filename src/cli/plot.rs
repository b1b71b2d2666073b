//! `plot`: a picture of a run for a paper.

use std::path::{Path, PathBuf};

use anyhow::bail;
use clap::{
    Args,
    builder::{PossibleValuesParser, TypedValueParser},
};

use super::output::print;
use crate::{
    audit::write_whole,
    files::atomic::probe,
    report::plot::{self, Format, What},
};

/// Draw a plot of a run, for a paper
///
/// convergence: f_q over the evaluations that led to the result. terms: the share of each term in it. histogram: the
/// brightness of start and result against the signature. scan: f_q along each variable, all others as found, from the
/// small copy of the transport basis.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    lightopt-embree plot runs/fruit_basket-high-key --what convergence -o convergence.svg\n  \
    lightopt-embree plot runs/fruit_basket-high-key --what scan -o scan.pdf")]
pub struct PlotArgs {
    /// Run directory
    #[arg(value_name = "RUN_DIR")]
    pub directory: PathBuf,

    /// What the plot shows
    #[arg(long, value_name = "WHAT", value_parser = what())]
    pub what: What,

    /// File to write: .svg or .pdf (vectors), or .png
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
}

/// Parses what a plot shows.
fn what() -> impl TypedValueParser<Value = What> {
    let named = |name: String| What::ALL.into_iter().find(|what| what.name() == name).ok_or("no such plot");
    PossibleValuesParser::new(What::ALL.map(What::name)).try_map(named)
}

/// The kind of file that a name asks for.
fn format(path: &Path) -> anyhow::Result<Format> {
    match path.extension().map(|e| e.to_string_lossy().to_lowercase()).as_deref() {
        Some("svg") => Ok(Format::Svg),
        Some("pdf") => Ok(Format::Pdf),
        Some("png") => Ok(Format::Png),
        _ => bail!("{}: a plot ends in .svg, .pdf or .png", path.display()),
    }
}

/// Runs the subcommand.
///
/// # Errors
/// When the directory has not what the plot needs, or it cannot be written.
pub fn plot(args: &PlotArgs) -> anyhow::Result<()> {
    let format = format(&args.output)?;
    probe(&args.output)?;
    let mut runs = crate::report::runs(&args.directory)?;
    if runs.len() > 1 {
        let names: Vec<String> = runs.iter().map(|run| run.display().to_string()).collect();
        bail!("{}: has several looks; name one of {}", args.directory.display(), names.join(", "));
    }
    let run = runs.remove(0);
    write_whole(&args.output, plot::plot(&run, args.what, format)?)?;
    print(&format!("{}\n", args.output.display()))
}
