//! Options of `figures`, and what they resolve to.

use std::path::PathBuf;

use clap::Args;
use glam::UVec2;

use crate::{
    cli::{
        choices::{PARTS, one_of},
        common::{ConfinementArgs, PictureArgs, TransportArgs, parse_spp, views},
    },
    design::noise::FINAL_NOISE,
    figures::Part,
    math::ViewTransform,
};

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
    Ctrl-C, SIGTERM or SIGHUP ends within two seconds; files are whole or not there, and\n\
    `figures --resume DIR` goes on. Until all is done, DIR/.resume holds what took long to make.\n\
    Exit status: 0 done, 1 failed, 2 wrong usage, 130, 143 or 129 ended by one of those signals.")]
#[command(mut_arg("force", |a| a.help("Replace earlier figures in that directory; files of others stay")))]
#[command(mut_arg("size", |a| a.help("Size of the pictures [default: 480x360; quick: 160x120]")))]
#[command(mut_arg("work_size", |a| {
    a.help("Size of the pictures that are optimised [default: 128x96; quick: 64x48]")
}))]
#[command(mut_arg("final_noise", |a| {
    a.help("Error that noise may leave in a picture: see `run --help`")
}))]
pub struct FiguresArgs {
    /// Directory to write to
    #[arg(long, value_name = "DIR", default_value = "figures")]
    pub out: PathBuf,

    /// Go on with figures that were stopped or killed: DIR is their --out, and their options are those with
    /// which they were begun, so that none can be given. All ends as if it had never been stopped
    #[arg(long, value_name = "DIR", exclusive = true)]
    pub resume: Option<PathBuf>,

    /// Make only these
    #[arg(long, value_name = "PART,…", value_delimiter = ',', value_parser = one_of(&PARTS))]
    pub only: Option<Vec<Part>>,

    /// Small pictures with few samples: a look at everything in a few minutes
    #[arg(long)]
    pub quick: bool,

    /// Directory of the scenes: fruit_basket.obj, fetched/girl.obj, fetched/creature.obj
    #[arg(long, value_name = "DIR", default_value = "scenes")]
    pub scenes: PathBuf,

    /// Where the files of the scenes may lie.
    #[command(flatten)]
    pub confinement: ConfinementArgs,

    /// Sizes of the pictures.
    #[command(flatten)]
    pub pictures: PictureArgs,

    /// Samples per pixel of the pictures at most; --final-noise ends them sooner [default: 192; quick: 64]
    #[arg(long, value_name = "N", value_parser = parse_spp)]
    pub final_spp: Option<u32>,

    /// In paper mode: evaluations of f_q with its gradient, at most [default: 30; quick: 6]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub max_evaluations: Option<u32>,

    /// View transform between light and display, of all scenes [default: srgb]
    #[arg(long, value_name = "VIEW", value_parser = views())]
    pub view: Option<ViewTransform>,

    /// Light transport.
    #[command(flatten)]
    pub transport: TransportArgs,
}

/// Sizes, samples and limits of all figures: those asked for, else those of the usual or of the quick
/// set.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// Size of the pictures shown, pixels.
    pub size: UVec2,
    /// Samples per pixel of the pictures shown, at most.
    pub final_spp: u32,
    /// Error that noise may leave in the pictures shown.
    pub final_noise: f64,
    /// Whether the pictures shown are denoised.
    pub denoise: bool,
    /// View through which all pictures are seen.
    pub view: ViewTransform,
    /// Size of the pictures that are optimised, pixels.
    pub work_size: UVec2,
    /// Samples per pixel of the first transport basis.
    pub spp: u32,
    /// Half width of the 95 % interval of f_q at which no more samples are added.
    pub tolerance: f64,
    /// Size of the pictures of the comparison of paper mode and default mode, pixels.
    pub compared_size: UVec2,
    /// Samples per pixel of a render of that comparison in paper mode, and of its final pictures.
    pub compared_spp: u32,
    /// Upper bound of the evaluations of f_q with its gradient in paper mode.
    pub max_evaluations: u32,
}

impl Settings {
    /// The working size and the tolerance are the defaults of `run`; the comparison is small because
    /// paper mode renders as often as there are variables for every gradient.
    const USUAL: Self = Self {
        size: UVec2::new(480, 360),
        final_spp: 192,
        final_noise: FINAL_NOISE,
        denoise: true,
        view: ViewTransform::Srgb,
        work_size: UVec2::new(128, 96),
        spp: 12,
        tolerance: 0.005,
        compared_size: UVec2::new(64, 48),
        compared_spp: 16,
        max_evaluations: 30,
    };
    /// A look at everything: 70 to 107 s on two cores when it was introduced.
    const QUICK: Self = Self {
        size: UVec2::new(160, 120),
        final_spp: 64,
        final_noise: FINAL_NOISE,
        denoise: true,
        view: ViewTransform::Srgb,
        work_size: UVec2::new(64, 48),
        spp: 16,
        tolerance: 0.02,
        compared_size: UVec2::new(48, 36),
        compared_spp: 8,
        max_evaluations: 6,
    };

    /// What some options resolve to.
    #[must_use]
    pub fn of(args: &FiguresArgs) -> Self {
        let usual = if args.quick { Self::QUICK } else { Self::USUAL };
        let work_size = args.pictures.work_size.unwrap_or(usual.work_size);
        Self {
            size: args.pictures.size.unwrap_or(usual.size),
            final_spp: args.final_spp.unwrap_or(usual.final_spp),
            final_noise: args.pictures.final_noise,
            denoise: !args.pictures.no_denoise,
            view: args.view.unwrap_or_default(),
            work_size,
            compared_size: usual.compared_size.min(work_size),
            max_evaluations: args.max_evaluations.unwrap_or(usual.max_evaluations),
            ..usual
        }
    }

    /// Size of a picture of the grid of sizes and fluxes, pixels: five columns of it are about as wide
    /// as the three of other figures.
    #[must_use]
    pub fn thumbnail(&self) -> UVec2 {
        let largest = self.size.x.min(WIDEST) * 5 / 8;
        let scale = f64::from(largest) / f64::from(self.size.x);
        (self.size.as_dvec2() * scale).round().as_uvec2().max(UVec2::ONE)
    }
}

/// Width, pixels, above which pictures are reduced in figures; in their run directories they are
/// whole.
pub const WIDEST: u32 = 960;
