//! `figures`: the tables and figures of the paper.

mod args;
mod runs;
mod workshop;

use std::path::Path;

use anyhow::bail;

use super::{output::print, progress::Console, resume, signals};
use crate::{
    audit::unfinished::{UNFINISHED, Unfinished},
    figures::{Part, manifest, study::BASKET},
};
pub use args::FiguresArgs;
use workshop::Workshop;

/// Runs the subcommand.
///
/// # Errors
/// When a scene is missing, the directory is taken, or a run fails.
pub fn figures(args: &FiguresArgs) -> anyhow::Result<()> {
    let Some(place) = &args.resume else {
        let parts = parts(args)?;
        Unfinished::check(&args.out.join(UNFINISHED), args.pictures.force)?;
        manifest::check(&args.out, args.pictures.force)?;
        let unfinished =
            resume::begin("figures", &args.out, &args.out.join(UNFINISHED), args.pictures.force)?;
        let result = make(args, args.pictures.force, &parts, &unfinished);
        return resume::end(unfinished, "figures", &args.out, result);
    };
    let directory = place.join(UNFINISHED);
    let (unfinished, args) =
        resume::take_up("figures", place, &directory, |args: &FiguresArgs| Ok(args.out.join(UNFINISHED)))?;
    let result = make(&args, true, &parts(&args)?, &unfinished);
    resume::end(unfinished, "figures", place, result)
}

/// Parts asked for, whose scenes are there.
fn parts(args: &FiguresArgs) -> anyhow::Result<Vec<Part>> {
    let mut parts = args.only.clone().unwrap_or_else(|| Part::ALL.to_vec());
    parts.sort_unstable();
    parts.dedup();
    for part in &parts {
        let studies = part.studies().into_iter().map(|s| s.scene);
        for scene in studies.chain(part.needs_basket().then_some(BASKET)) {
            require(&args.scenes, scene)?;
        }
    }
    Ok(parts)
}

/// Makes the parts, and prints the path of the page; `force` replaces earlier ones.
fn make(args: &FiguresArgs, force: bool, parts: &[Part], unfinished: &Unfinished) -> anyhow::Result<()> {
    let console = Console::new();
    signals::end_in_order("keeping what is finished");
    let done = args.transport.in_pool(|| {
        let mut workshop = Workshop::open(args, force, parts, &console, unfinished.products())?;
        workshop.make(parts)
    });
    console.finish();
    let page = done?;
    print(&format!("{}\n", page.display()))
}

/// Checks that a scene is there.
fn require(scenes: &Path, name: &str) -> anyhow::Result<()> {
    let path = scenes.join(name);
    if path.is_file() {
        return Ok(());
    }
    if name == BASKET {
        bail!("{}: no such scene; give the directory of the scenes with --scenes", path.display());
    }
    bail!(
        "{}: no such scene; make it with scenes/fetch.sh, or do without it by \
         --only fig2,fig4,table1,convergence",
        path.display()
    );
}
