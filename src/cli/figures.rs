//! `figures`: the tables and figures of the paper.

mod runs;
mod workshop;

use std::path::{Path, PathBuf};

use anyhow::bail;
use clap::Args;
use glam::UVec2;

use super::{
    common::{TransportArgs, parse_size, parse_spp},
    print,
    progress::Console,
    signals,
};
use crate::figures::{Part, manifest, study::BASKET};
use workshop::Workshop;

/// Make the tables and figures of the paper anew
///
/// The paper's own scenes are not available. Its tables and figures are made on scenes of the
/// same kind: a portrait (`girl`), a bulldog (`creature`) and a fruit basket, each lit in
/// high-key and in low-key. Published numbers, where known, stand beside those found.
///
/// Girl and creature come from scenes/fetch.sh; fig2, fig4, table1 and convergence do without
/// them.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    lightopt-embree figures --quick\n  \
    lightopt-embree figures --only fig2,fig4 --out basket\n  \
    lightopt-embree figures --size 640x480 --final-spp 512\n\n\
    The directory holds index.html with everything in it, a PNG for each figure, CSV and LaTeX\n\
    for each table, runs/ with the run directory of every picture, and manifest.json with the\n\
    SHA-256 of every file. The same options and seed give the same bytes, but for timings.csv\n\
    and the runs' timing.jsonl. What is measured: see `evaluate --help`.\n\
    Ctrl-C ends after the present picture; files are whole or not there.\n\
    Exit status: 0 done, 1 failed, 2 wrong usage.")]
pub struct FiguresArgs {
    /// Directory to write to
    #[arg(long, value_name = "DIR", default_value = "figures")]
    pub out: PathBuf,

    /// Make only these
    #[arg(long, value_name = "PART,…", value_delimiter = ',', value_enum)]
    pub only: Option<Vec<Part>>,

    /// Small pictures with few samples: a look at everything in a few minutes
    #[arg(long)]
    pub quick: bool,

    /// Directory of the scenes: fruit_basket.obj, fetched/girl.obj, fetched/creature.obj
    #[arg(long, value_name = "DIR", default_value = "scenes")]
    pub scenes: PathBuf,

    /// Replace earlier figures in that directory; files of others stay
    #[arg(long)]
    pub force: bool,

    /// Size of the pictures [default: 480x360; quick: 160x120]
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub size: Option<UVec2>,

    /// Size of the pictures that are optimised [default: 128x96; quick: 64x48]
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub work_size: Option<UVec2>,

    /// Samples per pixel of the pictures [default: 192; quick: 64]
    #[arg(long, value_name = "N", value_parser = parse_spp)]
    pub final_spp: Option<u32>,

    /// In paper mode: evaluations of f_q with its gradient, at most [default: 30; quick: 6]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub max_evaluations: Option<u32>,

    /// Light transport.
    #[command(flatten)]
    pub transport: TransportArgs,
}

/// Everything resolved.
#[derive(Clone, Copy, Debug)]
struct Settings {
    /// Of the pictures.
    size: UVec2,
    final_spp: u32,
    /// Of the pictures that are optimised; samples are the first of a basis.
    work_size: UVec2,
    spp: u32,
    /// Error of f_q (95 %) at which no more samples are added.
    tolerance: f64,
    /// Comparison of the modes: size of its pictures, samples of a render in paper mode, evaluations.
    compared_size: UVec2,
    compared_spp: u32,
    max_evaluations: u32,
}

impl Settings {
    const USUAL: Self = Self {
        size: UVec2::new(480, 360),
        final_spp: 192,
        work_size: UVec2::new(128, 96),
        spp: 12,
        tolerance: 0.005,
        compared_size: UVec2::new(64, 48),
        compared_spp: 16,
        max_evaluations: 30,
    };
    const QUICK: Self = Self {
        size: UVec2::new(160, 120),
        final_spp: 64,
        work_size: UVec2::new(64, 48),
        spp: 16,
        tolerance: 0.02,
        compared_size: UVec2::new(48, 36),
        compared_spp: 8,
        max_evaluations: 6,
    };

    fn of(args: &FiguresArgs) -> Self {
        let usual = if args.quick { Self::QUICK } else { Self::USUAL };
        let work_size = args.work_size.unwrap_or(usual.work_size);
        Self {
            size: args.size.unwrap_or(usual.size),
            final_spp: args.final_spp.unwrap_or(usual.final_spp),
            work_size,
            compared_size: usual.compared_size.min(work_size),
            max_evaluations: args.max_evaluations.unwrap_or(usual.max_evaluations),
            ..usual
        }
    }

    /// Of a picture of the grid of sizes and fluxes.
    fn thumbnail(&self) -> UVec2 {
        let largest = self.size.x.min(WIDEST) * 5 / 8;
        let scale = f64::from(largest) / f64::from(self.size.x);
        (self.size.as_dvec2() * scale).round().as_uvec2().max(UVec2::ONE)
    }
}

/// Wider pictures are reduced to this in figures; in their run directories they are whole.
const WIDEST: u32 = 960;

/// Runs the subcommand.
///
/// # Errors
/// When a scene is missing, the directory is taken, or a run fails.
pub fn figures(args: &FiguresArgs) -> anyhow::Result<()> {
    let mut parts = args.only.clone().unwrap_or_else(|| Part::ALL.to_vec());
    parts.sort_unstable();
    parts.dedup();
    manifest::check(&args.out, args.force)?;
    for part in &parts {
        let studies = part.studies().into_iter().map(|s| s.scene);
        for scene in studies.chain(part.needs_basket().then_some(BASKET)) {
            require(&args.scenes, scene)?;
        }
    }
    let console = Console::new();
    signals::catch("ending after the present picture")?;
    let done = args.transport.in_pool(|| {
        let mut workshop = Workshop::open(args, Settings::of(args), &parts, &console)?;
        workshop.make(&parts)
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
