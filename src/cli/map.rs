//! `where`: a map of where a lamp would help.

use std::path::PathBuf;

use anyhow::bail;
use clap::Args;
use glam::UVec2;

use super::{
    common::{
        CameraArgs, ConfinementArgs, MatchArgs, TransportArgs, ViewArgs, load_lit_scene, parse_size, say_look,
    },
    output::print,
    progress::Console,
};
use crate::{
    audit::write_whole,
    design::{
        Reporter,
        render::Renderer,
        rig::{
            self, Survey,
            chart::{self, Chart},
        },
    },
    files::atomic::probe,
    film::exr::write_exr,
    math::{Measure, display::LuminanceMode},
    photo::Look,
};

/// Show where one lamp more would help
///
/// Draws the directions around the subject, from above and unrolled: blue where a lamp would
/// lower f_q, the deeper the more; red where its light only raises it; grey where none may
/// stand. What one lamp would do is measured at several radiances of it, with all other
/// lights as they are.
///
/// A file that ends in .csv has a line for each place; one that ends in .exr has the unrolled
/// map in numbers.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    lightopt-embree where --target low-key -o where.png fruit_basket.obj\n  \
    lightopt-embree where --lights runs/dark/lights.toml -o where.csv fruit_basket.obj")]
pub struct MapArgs {
    /// Scene: Wavefront OBJ or glTF, with its sidecar
    #[arg(value_name = "SCENE")]
    pub scene: PathBuf,

    /// Where the scene's files may lie.
    #[command(flatten)]
    pub confinement: ConfinementArgs,

    /// The look: high-key, low-key, a target file, a photograph, or LIBRARY.toml#CLASS
    #[arg(long, value_name = "NAME|FILE", default_value = "high-key")]
    pub target: String,

    /// What of a photograph is matched.
    #[command(flatten)]
    pub matched: MatchArgs,

    /// Present lighting, as `run` writes it [default: the scene's own]
    #[arg(long, value_name = "FILE")]
    pub lights: Option<PathBuf>,

    /// File to write: .png, .csv or .exr
    #[arg(short, long, value_name = "FILE", default_value = "where.png")]
    pub output: PathBuf,

    /// Size of the working pictures, of which half is measured
    #[arg(long, value_name = "WxH", value_parser = parse_size, default_value = "128x96")]
    pub work_size: UVec2,

    /// View through which the pictures are seen.
    #[command(flatten)]
    pub view: ViewArgs,

    /// Camera of the scene file.
    #[command(flatten)]
    pub camera: CameraArgs,

    /// Light transport.
    #[command(flatten)]
    pub transport: TransportArgs,
}

/// Upper bound of the memory, bytes: that of `run`.
const MEMORY: u64 = 2 << 30;
/// Runs the subcommand.
///
/// # Errors
/// When the scene, the lighting or the look is wrong, or nothing can be rendered or written.
pub fn map(args: &MapArgs) -> anyhow::Result<()> {
    let look = Look::resolve(&args.target, None)?;
    say_look(&look);
    let ending = args.output.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    if !["png", "csv", "exr"].contains(&ending.as_str()) {
        bail!("{}: the map must end in .png, .csv or .exr", args.output.display());
    }
    probe(&args.output)?;
    let console = Console::new();
    let map = args.transport.in_pool(|| {
        let (options, given) = (args.camera.options(args.confinement), (args.lights.as_deref(), None));
        let (loaded, lighting, view) = load_lit_scene(&args.scene, options, given, |w| console.note(w))?;
        let luminance = LuminanceMode::Srgb;
        let view = args.view.of_scene(view, &loaded, |w| console.note(w));
        let target =
            look.into_target(luminance, args.work_size.max_element() as usize, args.matched.get())?;
        let measure = Measure { view, luminance, color: target.needs_color() };
        let (integrator, sampler) = (args.transport.integrator(), args.transport.sampler);
        let renderer = Renderer { integrator, sampler, measure };
        let survey = Survey {
            target: &target,
            lighting: &lighting,
            constraints: &loaded.constraints,
            renderer,
            work_size: args.work_size,
            memory: MEMORY,
            seed: args.transport.seed,
        };
        Ok(rig::map(loaded.scene, survey, &console)?)
    });
    console.finish();
    let map = map?;
    match ending.as_str() {
        "csv" => write_whole(&args.output, chart::table(&map)?)?,
        "exr" => write_exr(&args.output, &Chart::of(&map).numbers())?,
        _ => write_whole(&args.output, Chart::of(&map).drawing(&args.target)?)?,
    }
    let best = map.spots.iter().min_by(|a, b| a.f_q.total_cmp(&b.f_q));
    let best = best.map_or_else(String::new, |s| {
        format!(
            "; {:.4} with a lamp at azimuth {:.0}, elevation {:.0} degrees, {:.2} m away",
            s.f_q, s.place.azimuth, s.place.elevation, s.place.distance
        )
    });
    print(&format!("f_q {:.4} now{best}\n{}\n", map.f_q, args.output.display()))
}
