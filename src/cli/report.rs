//! `report`: the page of a run, made again from its directory.

use std::path::{Path, PathBuf};

use clap::Args;

use super::output::{print, say};
use crate::report::{self, ReportError};

/// Write the page of a run anew, from its directory
///
/// `run` writes report.html by itself, as soon as lights are found and again with the pictures. The page shows the
/// result beside the start, every step of the search, terms against targets, lights in watts and lumens, and lets
/// the lights be moved: it holds a small copy of the transport basis. It opens from a disk, without a network.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    lightopt-embree report runs/fruit_basket-high-key\n  \
    lightopt-embree report runs/fruit_basket            # of --targets: one page over all looks")]
pub struct ReportArgs {
    /// Run directory, or the directory of a run with --targets
    #[arg(value_name = "RUN_DIR")]
    pub directory: PathBuf,
}

/// Runs the subcommand.
///
/// # Errors
/// When the directory holds no run, or the page cannot be written.
pub fn report(args: &ReportArgs) -> anyhow::Result<()> {
    for run in report::runs(&args.directory)? {
        report::contact_sheet(&run)?;
        if run != args.directory {
            report::write(&run, false)?;
        }
    }
    let path = report::write(&args.directory, false)?;
    print(&format!("{}\n", path.display()))
}

/// Writes what shows the looks of a run that goes on, or is done: the page of each, that of all, and the sheets of
/// lightings; `say` hears where. A run whose pages cannot be written is as good without.
pub(super) fn refresh(directories: &[&Path], running: bool, say: &impl Fn(&str)) {
    for run in directories {
        // What is offered does not change after lights are found.
        let drawn = if running { report::contact_sheet(run) } else { Ok(()) };
        let written = drawn.and_then(|()| report::write(run, running));
        say_written(written, running, say);
    }
    if let [first, _, ..] = directories
        && let Some(root) = first.parent()
    {
        say_written(report::write(root, running), running, say);
    }
}

/// Writes the page over all looks of a run that is done.
pub(super) fn together(root: &Path) {
    say_written(report::write(root, false), false, &say);
}

/// Says where a page is, or why there is none.
fn say_written(written: Result<PathBuf, ReportError>, running: bool, say: &impl Fn(&str)) {
    match written {
        Ok(path) if running => say(&format!("report: {}, to be completed", path.display())),
        Ok(path) => say(&format!("report: {}", path.display())),
        Err(e) => say(&format!("note: no report: {e}")),
    }
}
