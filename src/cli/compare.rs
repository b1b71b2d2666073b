//! `compare`: one page over several runs.

use std::path::PathBuf;

use clap::Args;

use super::output::print;
use crate::{audit::write_whole, files::atomic::probe, report};

/// Put several runs side by side in one page
///
/// Their pictures, what f_q each came to, its terms, the power of its lights, and the time that it took. A directory
/// of a run with --targets counts as all of its looks.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  \
    lightopt-embree compare runs/fruit_basket-high-key runs/fruit_basket-low-key")]
pub struct CompareArgs {
    /// Run directories
    #[arg(value_name = "RUN_DIR", required = true, num_args = 1..)]
    pub directories: Vec<PathBuf>,

    /// Page to write
    #[arg(short, long, value_name = "FILE.html", default_value = "compare.html")]
    pub output: PathBuf,
}

/// Runs the subcommand.
///
/// # Errors
/// When a directory holds no run, or the page cannot be written.
pub fn compare(args: &CompareArgs) -> anyhow::Result<()> {
    probe(&args.output)?;
    write_whole(&args.output, report::compare::page(&args.directories)?)?;
    print(&format!("{}\n", args.output.display()))
}
