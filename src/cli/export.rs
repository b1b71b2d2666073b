//! `export`: a scene for another renderer.

use std::path::{Path, PathBuf};

use anyhow::bail;
use clap::{
    Args,
    builder::{PossibleValue, PossibleValuesParser, TypedValueParser},
};
use glam::UVec2;

use super::{
    common::{CameraArgs, ConfinementArgs, load_lit_scene, needs_lights, parse_size},
    progress::Console,
    recorded::Recorded,
};
use crate::{
    design::Reporter,
    export::{self, EXPORTERS, ExportJob, ExportOptions, Exporter, Offer},
    import,
    integrator::View,
};

/// Write a scene, as it is lit, for another program
///
/// The other renderer then converges to the picture that `render` makes; a light or material
/// that it cannot represent exactly is refused or warned about. Of a run's directory, its scene is written with
/// the lights found.
///
/// Mitsuba and pbrt get the whole scene. Blender, USD and glTF get the lights, the camera, the background's value,
/// the exposure and the view, to be laid over the scene that is there; with --whole they get the scene too.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    lightopt-embree export --format mitsuba -o basket fruit_basket.obj\n  \
    mitsuba -m llvm_ad_rgb -Dspp=256 -o basket.exr basket/scene.xml\n  \
    lightopt-embree export --format blender -o lights.py runs/fruit_basket-high-key\n  \
    blender basket.blend --python lights.py\n  \
    lightopt-embree export --format usd --whole -o basket.usda fruit_basket.obj")]
pub struct ExportArgs {
    /// Scene to export: Wavefront OBJ or glTF, with its sidecar; or the directory of a run
    #[arg(value_name = "SCENE|RUN_DIR")]
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

    /// Lighting to use, as `run` writes it [default: of a run's directory its lights.toml]
    #[arg(long, value_name = "FILE")]
    pub lights: Option<PathBuf>,

    /// For blender, usd and gltf: the whole scene. The script for Blender then reads the scene file into an
    /// empty Blender
    #[arg(long)]
    pub whole: bool,

    /// For mitsuba: every light has a black body that stops rays, and the integrator is `path`, which is faster
    /// than `volpath` and knows no others
    #[arg(long)]
    pub path: bool,

    /// For usd: intensities in nits and lux, 683 lm a watt, in the place of W/(m2 sr) and W/m2
    #[arg(long)]
    pub photometric: bool,

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
    for (given, option, name) in [
        (args.whole, Offer::Whole, "--whole"),
        (args.path, Offer::Blocking, "--path"),
        (args.photometric, Offer::Photometric, "--photometric"),
    ] {
        if given && !args.format.offers(option) {
            let able: Vec<_> = EXPORTERS.iter().filter(|e| e.offers(option)).map(|e| e.name()).collect();
            bail!("{name}: only for --format {}", able.join(", "));
        }
    }
    let console = Console::new();
    let recorded = Recorded::of(&args.scene, |w| console.note(w))?;
    let scene_path = recorded.as_ref().map_or(args.scene.as_path(), |r| &r.scene);
    let lights = args.lights.as_deref().or(recorded.as_ref().map(|r| r.lights.as_path()));
    let options = args.camera.options(args.confinement);
    let (loaded, lighting, view) = load_lit_scene(scene_path, options, (lights, None), |w| console.note(w))?;
    needs_lights(&loaded, scene_path)?;
    let found = import::find(scene_path)?;
    let display = view.or(recorded.as_ref().map(|r| r.view)).or(loaded.view).unwrap_or_default();
    let scene = loaded.scene;
    let camera = args.size.map_or_else(|| scene.camera.clone(), |size| scene.camera.resized(size));
    let view = View { scene: &scene, camera: &camera };
    let job = ExportJob {
        display,
        options: ExportOptions {
            blocking: args.path,
            photometric: args.photometric,
            whole: args.whole.then_some(Path::new(&found)),
        },
        ..ExportJob::new(view, &lighting, usize::from(args.max_depth))
    };
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
