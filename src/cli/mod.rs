//! The command line: one file a subcommand.

pub mod classify;
mod common;
pub mod evaluate;
pub mod export;
pub mod figures;
pub mod learn;
mod progress;
pub mod relight;
pub mod render;
pub mod run;
pub mod scan;
mod signals;
pub mod stage;

use std::io::{self, Write};

use anyhow::Context;
use clap::{Parser, Subcommand, ValueEnum};

use crate::{lighting::MAX_EXPOSURE, objective::LuminanceMode};

/// Automatic, aesthetics-driven lighting design with global illumination.
#[derive(Debug, Parser)]
#[command(name = "lightopt-embree", version, about, propagate_version = true)]
pub struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Run(run::RunArgs),
    Render(render::RenderArgs),
    Stage(stage::StageArgs),
    Relight(relight::RelightArgs),
    Scan(scan::ScanArgs),
    Evaluate(evaluate::EvaluateArgs),
    LearnSignature(learn::LearnArgs),
    Classify(classify::ClassifyArgs),
    Export(export::ExportArgs),
    Figures(figures::FiguresArgs),
}

/// Runs the subcommand.
///
/// # Errors
/// Whatever stops it; `{:#}` prints the whole chain on one line.
pub fn run(cli: &Cli) -> anyhow::Result<()> {
    match &cli.command {
        Command::Run(args) => run::run(args),
        Command::Render(args) => render::render(args),
        Command::Stage(args) => stage::stage(args),
        Command::Relight(args) => relight::relight(args),
        Command::Scan(args) => scan::scan(args),
        Command::Evaluate(args) => evaluate::evaluate(args),
        Command::LearnSignature(args) => learn::learn_signature(args),
        Command::Classify(args) => classify::classify(args),
        Command::Export(args) => export::export(args),
        Command::Figures(args) => figures::figures(args),
    }
}

pub use signals::{exit_code, received as interrupted};

/// [`LuminanceMode`] as an option.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum LuminanceArg {
    /// sRGB-encoded, as a display shows it: what the published values refer to
    Srgb,
    /// Linear radiance, clamped to [0, 1]
    Linear,
}

impl From<LuminanceArg> for LuminanceMode {
    fn from(arg: LuminanceArg) -> Self {
        match arg {
            LuminanceArg::Srgb => Self::Srgb,
            LuminanceArg::Linear => Self::Linear,
        }
    }
}

/// Parses an exposure: a finite number above 0.
fn parse_exposure(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value > 0.0 && (1.0 / MAX_EXPOSURE..=MAX_EXPOSURE).contains(&(value as f32)) => {
            Ok(value)
        }
        _ => Err(format!("must be a number above 0, from {:e} to {MAX_EXPOSURE:e}", 1.0 / MAX_EXPOSURE)),
    }
}

/// Writes `text` to standard output; a reader that has gone away (as `head`) is no error.
fn print(text: &str) -> anyhow::Result<()> {
    let mut out = io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(e) if e.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        other => other.context("cannot write to standard output"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn exposures_are_positive_numbers() {
        assert_eq!(parse_exposure("0.5"), Ok(0.5));
        for bad in ["0", "-1", "nan", "inf", "x", "", "1e40", "1e-40"] {
            assert!(parse_exposure(bad).is_err(), "{bad}");
        }
    }
}
