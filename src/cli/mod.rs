//! The command line: one file a subcommand.

pub mod bench;
mod choices;
pub mod classify;
mod common;
pub mod compare;
mod environments;
pub mod evaluate;
pub mod export;
pub mod figures;
pub mod learn;
pub mod map;
mod output;
mod pareto;
mod pick;
pub mod plot;
mod progress;
mod recorded;
pub mod relight;
pub mod render;
pub mod report;
mod resume;
pub mod run;
pub mod scan;
mod signals;
pub mod stage;

use clap::{Parser, Subcommand};

use common::{LuminanceArg, parse_exposure};
pub use output::say_error;
use output::{print, print_json};
pub use signals::{catch as catch_signals, exit_code, received as interrupted};

/// Automatic, aesthetics-driven lighting design with global illumination.
#[derive(Debug, Parser)]
#[command(name = "lightopt-embree", version, about, propagate_version = true)]
pub struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Run(Box<run::RunArgs>),
    Render(render::RenderArgs),
    Stage(stage::StageArgs),
    Report(report::ReportArgs),
    Compare(compare::CompareArgs),
    Plot(plot::PlotArgs),
    Relight(relight::RelightArgs),
    Scan(scan::ScanArgs),
    Where(map::MapArgs),
    Evaluate(evaluate::EvaluateArgs),
    LearnSignature(learn::LearnArgs),
    Classify(classify::ClassifyArgs),
    Export(export::ExportArgs),
    Figures(figures::FiguresArgs),
    Bench(bench::BenchArgs),
}

/// Runs the subcommand.
///
/// # Errors
/// Whatever stops it; [`say_error`] prints the whole chain on one line.
pub fn run(cli: &Cli) -> anyhow::Result<()> {
    match &cli.command {
        Command::Run(args) => run::run(args),
        Command::Render(args) => render::render(args),
        Command::Stage(args) => stage::stage(args),
        Command::Report(args) => report::report(args),
        Command::Compare(args) => compare::compare(args),
        Command::Plot(args) => plot::plot(args),
        Command::Relight(args) => relight::relight(args),
        Command::Scan(args) => scan::scan(args),
        Command::Where(args) => map::map(args),
        Command::Evaluate(args) => evaluate::evaluate(args),
        Command::LearnSignature(args) => learn::learn_signature(args),
        Command::Classify(args) => classify::classify(args),
        Command::Export(args) => export::export(args),
        Command::Figures(args) => figures::figures(args),
        Command::Bench(args) => bench::bench(args),
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
}
