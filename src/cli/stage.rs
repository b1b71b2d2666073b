//! `stage`: camera, backdrop and lights for a scene that comes without.

use std::path::PathBuf;

use anyhow::bail;
use clap::{Args, ValueEnum};

use super::{
    common::{CameraArgs, ConfinementArgs},
    progress::Console,
};
use crate::{
    audit::write_whole,
    design::Reporter,
    files::atomic::probe,
    import::{
        self,
        axes::UpAxis,
        builder,
        stage::{StageOptions, Staging},
    },
};

/// Write a sidecar for a scene that has none: camera, backdrop, main object and lights
///
/// `run` and `render` stage a scene without sidecar by themselves, in the same way; this
/// writes the staging down, to be edited.
///
/// The main object is all of the file or, if it stands on a floor or in a room, the largest
/// group of touching objects there, with those about as large. A camera with a normal lens frames it from the front
/// (+z), a little from the right and from above. A scene without floor gets a seamless
/// backdrop. A softbox is the key light, a larger one fills its shadows, and a light behind
/// sets the main object off. The unit of an OBJ is guessed from its size.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    lightopt-embree stage dog.obj                            # writes dog.toml\n  \
    lightopt-embree stage --view -45 --force dog.obj         # seen more from the left\n  \
    lightopt-embree stage --main-object 'Sofa*' lounge.obj")]
pub struct StageArgs {
    /// Scene to stage: Wavefront OBJ or glTF
    #[arg(value_name = "SCENE")]
    pub scene: PathBuf,

    /// Where the scene's files may lie.
    #[command(flatten)]
    pub confinement: ConfinementArgs,

    /// File to write [default: SCENE.toml beside the scene, where it is its sidecar]
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,

    /// Object or group that is the main object; * matches any ending; may be repeated [default: found]
    #[arg(long, value_name = "GLOB")]
    pub main_object: Vec<String>,

    /// Direction from which it is seen: degrees from the front (+z) to the right (+x) [default: 30, or
    /// where nothing hides it]
    #[arg(long, value_name = "DEGREES", allow_negative_numbers = true, value_parser = parse_degrees)]
    pub view: Option<f32>,

    /// Camera of the scene file.
    #[command(flatten)]
    pub camera: CameraArgs,

    /// Which way is up in an OBJ
    #[arg(long, value_enum, default_value_t)]
    pub up_axis: UpAxisArg,

    /// Replace the file if it exists
    #[arg(long)]
    pub force: bool,
}

/// [`UpAxis`] as an option.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum UpAxisArg {
    /// +y, as OBJ has it
    #[default]
    Y,
    /// +z, as CAD programs have it; +y is then to the back
    Z,
}

impl From<UpAxisArg> for UpAxis {
    fn from(arg: UpAxisArg) -> Self {
        match arg {
            UpAxisArg::Y => Self::Y,
            UpAxisArg::Z => Self::Z,
        }
    }
}

/// Parses an angle, degrees.
fn parse_degrees(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(v) if v.abs() <= 360.0 => Ok(v),
        _ => Err("must be a number of degrees from -360 to 360".to_owned()),
    }
}

/// Runs the subcommand.
///
/// # Errors
/// When the scene cannot be read, or the sidecar exists or cannot be written.
pub fn stage(args: &StageArgs) -> anyhow::Result<()> {
    let scene = import::find(&args.scene)?;
    let output = args.output.clone().unwrap_or_else(|| scene.with_extension("toml"));
    if output.exists() && !args.force {
        bail!("{}: exists; --force replaces it", output.display());
    }
    if let Some(parent) = output.parent().filter(|p| !p.as_os_str().is_empty() && !p.is_dir()) {
        bail!("{}: no such directory", parent.display());
    }
    probe(&output)?;
    let options =
        StageOptions { main_object: args.main_object.clone(), up_axis: args.up_axis.into(), view: args.view };
    let load = args.camera.options(args.confinement);
    let Staging { text, summary } = builder::stage_with(&scene, &options, &load)?;
    write_whole(&output, text)?;
    let console = Console::new();
    console.note(&format!("{}: {summary}", scene.display()));
    console.note(&format!("wrote {}", output.display()));
    Ok(())
}
