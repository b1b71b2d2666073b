//! `export`: a scene for another renderer.

use std::path::PathBuf;

use clap::{
    Args,
    builder::{PossibleValue, PossibleValuesParser, TypedValueParser},
};
use glam::UVec2;

use super::{
    common::{CameraArgs, ConfinementArgs, load_lit_scene, needs_lights, parse_size},
    progress::Console,
};
use crate::{
    design::Reporter,
    export::{self, EXPORTERS, ExportJob, Exporter},
    integrator::View,
};

/// Write a scene, as it is lit, for another renderer
///
/// The other renderer then converges to the picture that `render` makes; a light or material
/// that it cannot represent exactly is refused or warned about.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    lightopt-embree export --format mitsuba -o basket fruit_basket.obj\n  \
    mitsuba -m llvm_ad_rgb -Dspp=256 -o basket.exr basket/scene.xml")]
pub struct ExportArgs {
    /// Scene to export: Wavefront OBJ or glTF, with its sidecar
    #[arg(value_name = "SCENE")]
    pub scene: PathBuf,

    /// Where the scene's files may lie.
    #[command(flatten)]
    pub confinement: ConfinementArgs,

    /// Format to write
    #[arg(long, value_parser = formats())]
    pub format: &'static dyn Exporter,

    /// Directory (made if it is not there) or file to write, as the format needs
    #[arg(short, long, value_name = "OUT")]
    pub output: PathBuf,

    /// Lighting to use, as `run` writes it
    #[arg(long, value_name = "FILE")]
    pub lights: Option<PathBuf>,

    /// Camera of the scene file.
    #[command(flatten)]
    pub camera: CameraArgs,

    /// Size of the picture, pixels [default: the sidecar's]
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub size: Option<UVec2>,

    /// Edges of the longest light path after the camera; 1 shows the lights only
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u8).range(1..=32))]
    pub max_depth: u8,
}

/// Runs the subcommand.
///
/// # Errors
/// When the scene or the lighting is wrong, cannot be represented, or cannot be written.
pub fn export(args: &ExportArgs) -> anyhow::Result<()> {
    let console = Console::new();
    let options = args.camera.options(args.confinement);
    let given = (args.lights.as_deref(), None);
    let (loaded, lighting, _) = load_lit_scene(&args.scene, options, given, |w| console.note(w))?;
    needs_lights(&loaded, &args.scene)?;
    let scene = loaded.scene;
    let camera = args.size.map_or_else(|| scene.camera.clone(), |size| scene.camera.resized(size));
    let view = View { scene: &scene, camera: &camera };
    let job = ExportJob { view, lighting: &lighting, max_depth: usize::from(args.max_depth) };
    let exported = args.format.write(&job, &args.output)?;
    console.finish();
    for warning in &exported.warnings {
        console.note(warning);
    }
    let (n, open) = (exported.files.len(), args.format.entry_point(&args.output));
    console.note(&format!("wrote {n} file{}; open {}", if n == 1 { "" } else { "s" }, open.display()));
    Ok(())
}

/// Parses the name of a format; the help lists all with what they write.
fn formats() -> impl TypedValueParser<Value = &'static dyn Exporter> {
    let value =
        |e: &dyn Exporter| PossibleValue::new(e.name()).help(format!("{}; writes {}", e.help(), e.files()));
    PossibleValuesParser::new(EXPORTERS.map(value))
        .try_map(|name| export::by_name(&name).ok_or("no such format"))
}
