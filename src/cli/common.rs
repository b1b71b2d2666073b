//! Options that several subcommands share.

use std::{ffi::OsStr, path::Path};

use anyhow::{Context, bail};
use clap::{
    Arg, ArgAction, ArgMatches, Args, Command, FromArgMatches, ValueEnum,
    builder::{PossibleValue, PossibleValuesParser, TypedValueParser},
};
use glam::UVec2;

use super::{
    choices::{SAMPLERS, one_of},
    output::say,
};
use crate::{
    audit::lights::LightsFile,
    camera::{MAX_PIXELS, is_film_size},
    design::noise::FINAL_NOISE,
    import::{self, LoadOptions, Loaded, sidecar::CameraName},
    integrator::{Integrator, IntegratorKind},
    lighting::{self, Lighting, MAX_EXPOSURE},
    math::{ViewTransform, display::LuminanceMode, view::OCIO},
    photo::{Look, Matched},
    picture::Note,
    sampler::SamplerKind,
    scene::Scene,
    variables::{VariableKind, Wishes},
};

/// Options of light transport.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Light transport")]
pub struct TransportArgs {
    /// Which integrator.
    #[command(flatten)]
    pub kind: IntegratorFlags,

    /// Edges of the longest light path after the camera; 1 shows the lights only
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u8).range(1..=32))]
    pub max_depth: u8,

    /// Sequence of sample points
    #[arg(long, value_parser = one_of(&SAMPLERS), default_value = "sobol")]
    pub sampler: SamplerKind,

    /// Seed of all randomness: the same seed gives the same bytes
    #[arg(long, value_name = "N", allow_negative_numbers = true, default_value_t = 0)]
    pub seed: u64,

    /// Threads [default: all processors]; does not change the result
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub threads: Option<u16>,
}

/// A flag for each integrator, of which one at most may be given.
#[derive(Clone, Copy, Debug, Default)]
pub struct IntegratorFlags(pub IntegratorKind);

impl Args for IntegratorFlags {
    fn augment_args(command: Command) -> Command {
        let others = |kind| IntegratorKind::ALL.into_iter().filter(move |&other| other != kind);
        let flag = |kind: IntegratorKind| {
            let arg = Arg::new(kind.name()).long(kind.name()).help(kind.help()).action(ArgAction::SetTrue);
            arg.conflicts_with_all(others(kind).map(IntegratorKind::name))
        };
        command.args(IntegratorKind::ALL.map(flag))
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl FromArgMatches for IntegratorFlags {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let given = IntegratorKind::ALL.into_iter().find(|kind| matches.get_flag(kind.name()));
        Ok(Self(given.unwrap_or_default()))
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

/// The camera of the scene file through which pictures are seen.
#[derive(Clone, Debug, Default, Args)]
pub struct CameraArgs {
    /// Camera of the scene file to see through: its name, or its number from 1 [default: the sidecar's,
    /// else the first]
    #[arg(long, value_name = "NAME|N")]
    pub camera: Option<String>,
}

impl CameraArgs {
    /// How a scene is loaded.
    #[must_use]
    pub fn options(&self, confinement: ConfinementArgs) -> LoadOptions {
        LoadOptions { camera: self.camera.clone().map(CameraName::Name), ..confinement.options() }
    }
}

/// Sizes of pictures, and whether earlier ones are replaced. The help is that of `run`; `figures` has its
/// own words.
#[derive(Clone, Debug, Args)]
pub struct PictureArgs {
    /// Replace an earlier run in that directory; files of others stay
    #[arg(long)]
    pub force: bool,

    /// Size of the final picture, pixels [default: the sidecar's]
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub size: Option<UVec2>,

    /// Size of the pictures that are optimised, pixels [default: 128 wide]
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub work_size: Option<UVec2>,

    /// Error that noise may leave in the final picture, a root mean square of brightness from 0 (black) to
    /// 1 (white), over the whole and half of that in its worst sixteenth: no more samples are taken then.
    /// With 0 all of --final-spp are
    #[arg(long, value_name = "ERROR", default_value_t = FINAL_NOISE, value_parser = parse_noise)]
    pub final_noise: f64,

    /// Show pictures with their noise: PNGs are of the samples as they are, and --final-noise is that of
    /// those
    #[arg(long)]
    pub no_denoise: bool,
}

impl TransportArgs {
    /// The integrator asked for.
    #[must_use]
    pub fn integrator(&self) -> Integrator {
        Integrator { kind: self.kind.0, max_depth: usize::from(self.max_depth), ..Integrator::default() }
    }

    /// Runs `f` on the threads asked for.
    ///
    /// # Errors
    /// Those of `f`, or when threads cannot be made.
    pub fn in_pool<T: Send>(&self, f: impl FnOnce() -> anyhow::Result<T> + Send) -> anyhow::Result<T> {
        in_pool(self.threads, f)
    }
}

/// Most threads for each processor: rows of pixels are the unit of work, and more threads than some
/// a processor only wait for one another and take memory.
const MAX_THREADS_PER_PROCESSOR: usize = 32;

/// Runs `f` on that many threads, by default one for each processor; too many are cut to what makes
/// sense, and that is said.
///
/// # Errors
/// Those of `f`, or when threads cannot be made.
pub fn in_pool<T: Send>(
    threads: Option<u16>,
    f: impl FnOnce() -> anyhow::Result<T> + Send,
) -> anyhow::Result<T> {
    let processors = std::thread::available_parallelism().map_or(1, usize::from);
    let (wanted, most) = (threads.map_or(0, usize::from), MAX_THREADS_PER_PROCESSOR * processors);
    if wanted > most {
        say(&format!("--threads {wanted}: using {most}, {MAX_THREADS_PER_PROCESSOR} a processor"));
    }
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(wanted.min(most))
        .build()
        .context("cannot start threads")?;
    pool.install(f)
}

/// [`LuminanceMode`] as an option.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum LuminanceArg {
    /// sRGB-encoded, as a display shows it: what the published values refer to
    Srgb,
    /// Linear radiance, clamped to [0, 1]
    Linear,
}

impl From<LuminanceArg> for LuminanceMode {
    fn from(arg: LuminanceArg) -> Self {
        match arg {
            LuminanceArg::Srgb => Self::Srgb,
            LuminanceArg::Linear => Self::Linear,
        }
    }
}

/// [`Matched`] as options.
#[derive(Clone, Copy, Debug, Default, Args)]
pub struct MatchArgs {
    /// What of a photograph, or of a class of photographs, is matched
    #[arg(long = "match", value_name = "WHAT", value_enum, default_value_t = MatchArg::Luminance)]
    pub matched: MatchArg,
}

/// [`Matched`] as an option.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum MatchArg {
    /// Brightness alone, as f_q is defined
    #[default]
    Luminance,
    /// Colour too: its means and spread on object and background, and its joint histogram
    Colour,
}

impl MatchArgs {
    /// What is matched.
    #[must_use]
    pub fn get(self) -> Matched {
        match self.matched {
            MatchArg::Luminance => Matched::Luminance,
            MatchArg::Colour => Matched::Colour,
        }
    }
}

/// What is wished of the lights.
#[derive(Clone, Debug, Default, Args)]
#[command(next_help_heading = "Lights")]
pub struct TieArgs {
    /// Leave a light as it is, or a variable of it (key.size), or the background; may be repeated
    #[arg(long, value_name = "LIGHT[.KIND]")]
    pub lock: Vec<String>,

    /// Turn a light off; may be repeated
    #[arg(long, value_name = "LIGHT")]
    pub off: Vec<String>,

    /// Turn all lights off but this one; may be repeated
    #[arg(long, value_name = "LIGHT")]
    pub solo: Vec<String>,

    /// Radiance of a light as a multiple of another's: fill=key*0.5, fill=key-1stop
    #[arg(long, value_name = "LIGHT=LIGHT*X")]
    pub tie: Vec<String>,

    /// Mean luminance that a light brings to the main object as a multiple of what another brings, at whatever sizes:
    /// fill=key/4, fill=key-2stops
    #[arg(long, value_name = "LIGHT=LIGHT/X")]
    pub ratio: Vec<String>,

    /// Lights whose radiances keep the ratio that they have, with one variable of the group's name, warm.radiance:
    /// warm=key,fill
    #[arg(long, value_name = "NAME=LIGHT,LIGHT")]
    pub group: Vec<String>,
}

impl TieArgs {
    /// The wishes of the sidecar and of the command line.
    #[must_use]
    pub fn wishes(&self, of_sidecar: &Wishes) -> Wishes {
        let Self { lock, off, solo, tie, ratio, group } = self.clone();
        Wishes { lock, off, solo, tie, ratio, group }.and(of_sidecar)
    }
}

/// The view through which pictures are seen.
#[derive(Clone, Copy, Debug, Default, Args)]
pub struct ViewArgs {
    /// View transform between light and display: what is measured and shown is what it shows [default: the
    /// sidecar's, else srgb]
    #[arg(long, value_name = "VIEW", value_parser = views())]
    pub view: Option<ViewTransform>,
}

impl ViewArgs {
    /// The view that is asked for, else that of a `lights.toml`, else that of the scene's sidecar; what is taken
    /// for a scene of Blender about which nothing is said, is told.
    #[must_use]
    pub fn of_scene(
        self,
        lights: Option<ViewTransform>,
        loaded: &Loaded,
        say: impl Fn(&str),
    ) -> ViewTransform {
        let view = self.view.or(lights).or(loaded.view);
        if view.is_none() && loaded.is_of_blender {
            say(
                "the scene was made with Blender, seen through the view srgb (Blender's Standard); Blender's own \
                 default is --view agx, or `view = \"agx\"` in the sidecar",
            );
        }
        let view = view.unwrap_or_default();
        say_view(view, say);
        view
    }
}

/// Says what a user should know of how a view is taken.
pub fn say_view(view: ViewTransform, say: impl Fn(&str)) {
    if let ViewTransform::Ocio(view) = view {
        view.notes().iter().for_each(|note| say(note));
    }
}

/// Parses a view.
pub fn views() -> impl TypedValueParser<Value = ViewTransform> {
    ViewParser
}

/// The parser of [`views`]: one of several names, or that of a configuration.
#[derive(Clone)]
struct ViewParser;

impl TypedValueParser for ViewParser {
    type Value = ViewTransform;

    fn parse_ref(
        &self,
        command: &clap::Command,
        arg: Option<&clap::Arg>,
        value: &OsStr,
    ) -> Result<ViewTransform, clap::Error> {
        let name = match value.to_str() {
            Some(name) if name.starts_with(OCIO) => name.to_owned(),
            _ => PossibleValuesParser::new(own_views()).parse_ref(command, arg, value)?,
        };
        let named = |name: &str| -> Result<ViewTransform, String> {
            let view = ViewTransform::named(name, Path::new("")).map_err(|e| e.to_string())?;
            view.ok_or_else(|| "no such view".into())
        };
        TypedValueParser::parse_ref(&named, command, arg, OsStr::new(&name))
    }

    fn possible_values(&self) -> Option<Box<dyn Iterator<Item = PossibleValue> + '_>> {
        let of_studios = PossibleValue::new("ocio:CONFIG[:DISPLAY:VIEW]")
            .help("A view of a configuration of OpenColorIO, its first display and view by default");
        Some(Box::new(own_views().into_iter().chain([of_studios])))
    }
}

/// The program's own views, as the help lists them.
fn own_views() -> [PossibleValue; 5] {
    ViewTransform::ALL.map(|view| PossibleValue::new(view.name()).help(view.help()))
}

/// Parses an exposure: a number from 1 / [`MAX_EXPOSURE`] to [`MAX_EXPOSURE`].
///
/// # Errors
/// With what is allowed.
pub fn parse_exposure(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if lighting::exposure(value).is_ok() => Ok(value),
        _ => Err(format!("must be a number above 0, from {:e} to {MAX_EXPOSURE:e}", 1.0 / MAX_EXPOSURE)),
    }
}

/// Parses `WxH`.
///
/// # Errors
/// With what is allowed.
pub fn parse_size(text: &str) -> Result<UVec2, String> {
    let parsed = text
        .split_once(['x', 'X'])
        .and_then(|(w, h)| Some(UVec2::new(w.parse().ok()?, h.parse().ok()?)))
        .filter(|&s| is_film_size(s));
    parsed.ok_or_else(|| {
        format!("must be WIDTHxHEIGHT in pixels, such as 640x480, at most {MAX_PIXELS} pixels")
    })
}

/// Parses an error that noise may leave.
fn parse_noise(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(error) if (0.0..=1.0).contains(&error) => Ok(error),
        _ => Err("must be a number from 0 to 1".to_owned()),
    }
}

/// Parses a number of samples.
///
/// # Errors
/// With what is allowed.
pub fn parse_spp(text: &str) -> Result<u32, String> {
    match text.parse() {
        Ok(n @ 1..=1_048_576) => Ok(n),
        _ => Err("must be a whole number from 1 to 1048576".to_owned()),
    }
}

/// Says what people should hear of how a picture was read; `has_layer` when `--layer` could choose
/// another of its layers.
pub fn say_notes(path: &Path, notes: &[Note], has_layer: bool) {
    for note in notes {
        let choice = match note {
            Note::Layer { .. } if has_layer => "; --layer NAME chooses another",
            _ => "",
        };
        say_note(&format!("{}: {note}{choice}", path.display()));
    }
}

/// Says what people should hear of how the photograph of a look was read.
pub fn say_look(look: &Look) {
    if let Look::Photo { path, photo } = look {
        say_notes(path, photo.notes(), false);
    }
}

/// Writes a note to standard error.
pub fn say_note(note: &str) {
    say(&format!("note: {note}"));
}

/// Where the files of a scene may lie.
#[derive(Clone, Copy, Debug, Default, Args)]
pub struct ConfinementArgs {
    /// Refuse files outside the scene's folder and the `textures` beside it, whatever the scene names:
    /// for scenes of strangers
    #[arg(long)]
    pub confine: bool,
}

impl ConfinementArgs {
    /// How the scene is loaded.
    #[must_use]
    pub fn options(self) -> LoadOptions {
        LoadOptions { confine: self.confine, ..LoadOptions::default() }
    }
}

/// Loads a scene and prints what its loader noticed.
///
/// # Errors
/// Those of [`import::load_with`], or when there are no lights.
pub fn load_scene(path: &Path, options: &LoadOptions, say: impl Fn(&str)) -> anyhow::Result<Loaded> {
    let loaded = load_any_scene(path, options, say)?;
    needs_lights(&loaded, path)?;
    Ok(loaded)
}

/// An error where a scene that was loaded from `path` has no lights.
///
/// # Errors
/// When it has none.
pub fn needs_lights(loaded: &Loaded, path: &Path) -> anyhow::Result<()> {
    if loaded.scene.lights.is_empty() {
        let sidecar = import::find(path)?.with_extension("toml");
        bail!(
            "{}: `lights`: the scene has no lights; add [[lights]], or a material with `emission`",
            sidecar.display()
        );
    }
    Ok(())
}

/// Loads a scene, which may have no lights, and prints what its loader noticed.
///
/// # Errors
/// When the scene cannot be loaded, see [`import::load_with`].
pub fn load_any_scene(path: &Path, options: &LoadOptions, say: impl Fn(&str)) -> anyhow::Result<Loaded> {
    let loaded = import::load_with(path, options)?;
    loaded.warnings.iter().for_each(|warning| say(warning));
    Ok(loaded)
}

/// Loads a scene, which may have no lights, with the lamps that a `lights.toml` places; returns it with the lighting
/// that the file, or else the scene's author, gives it, at an exposure where one is given, and the file's view.
///
/// # Errors
/// When the scene or the `lights.toml` cannot be loaded, or the latter does not fit the former.
pub fn load_lit_scene(
    path: &Path,
    options: LoadOptions,
    (lights, exposure): (Option<&Path>, Option<f64>),
    say: impl Fn(&str),
) -> anyhow::Result<(Loaded, Lighting, Option<ViewTransform>)> {
    let Some(lights) = lights else {
        let loaded = load_any_scene(path, &options, say)?;
        let lighting = authored(&loaded.scene, exposure);
        return Ok((loaded, lighting, None));
    };
    let file = LightsFile::load(lights)?;
    let mut loaded = load_any_scene(path, &file.load_options(options), say)?;
    file.record_white(&mut loaded.scene);
    let mut lighting = authored(&loaded.scene, None);
    file.apply(&loaded.scene, &mut lighting, lights)?;
    lighting.exposure = exposed(exposure).unwrap_or(lighting.exposure);
    Ok((loaded, lighting, file.view))
}

/// The lighting that a scene's author gave it, at an exposure where one is given.
#[must_use]
pub fn authored(scene: &Scene, exposure: Option<f64>) -> Lighting {
    let lighting = Lighting::authored(scene);
    Lighting { exposure: exposed(exposure).unwrap_or(lighting.exposure), ..lighting }
}

/// An exposure with the digits that a scene has.
fn exposed(exposure: Option<f64>) -> Option<f64> {
    exposure.map(|e| f64::from(e as f32))
}

/// Parses a kind of variable.
pub fn free_kinds() -> impl TypedValueParser<Value = VariableKind> {
    let possible = VariableKind::words().map(|kind| PossibleValue::new(kind.keyword()).help(kind.help()));
    let parser = PossibleValuesParser::new(possible);
    parser.try_map(|word| VariableKind::named(&word).ok_or("no such kind of variable"))
}

/// The measure of luminance asked for.
#[must_use]
pub fn luminance_mode(arg: Option<LuminanceArg>) -> LuminanceMode {
    arg.map(Into::into).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_two_positive_numbers() {
        assert_eq!(parse_size("64x48"), Ok(UVec2::new(64, 48)));
        for bad in ["64", "0x4", "4x", "-1x4", "65536x65536", "axb"] {
            assert!(parse_size(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn noise_is_a_part_of_white() {
        assert_eq!(parse_noise("0.02"), Ok(0.02));
        assert_eq!(parse_noise("0"), Ok(0.0));
        for bad in ["-0.1", "1.5", "nan", "x", ""] {
            assert!(parse_noise(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn exposures_are_positive_numbers() {
        assert_eq!(parse_exposure("0.5"), Ok(0.5));
        for bad in ["0", "-1", "nan", "inf", "x", "", "1e40", "1e-40"] {
            assert!(parse_exposure(bad).is_err(), "{bad}");
        }
    }
}
