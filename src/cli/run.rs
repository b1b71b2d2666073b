//! `run`: finds the lights that give a scene a look.

use std::{
    fmt::Write as _,
    fs,
    path::{Path, PathBuf},
    time::Duration,
};

use anyhow::bail;
use clap::Args;
use glam::UVec2;
use serde_json::json;

use super::{
    choices::{GRADIENTS, one_of},
    common::{
        CameraArgs, ConfinementArgs, LuminanceArg, MatchArgs, PictureArgs, TieArgs, TransportArgs, ViewArgs,
        authored, free_kinds, load_any_scene, luminance_mode, parse_exposure, parse_spp, say_look,
    },
    environments::skies,
    output::{print, print_json},
    progress::Console,
    report, resume, signals,
};
use crate::{
    audit::{
        BASIS, LIVE, REPORT, RunDir, STAGING,
        unfinished::{UNFINISHED, Unfinished},
        write_whole,
    },
    design::{
        self, Gradient, Job, Reporter, RunOptions, RunReport, Subject, attainable,
        attainable::Reach,
        rig::{self, Order},
    },
    import::{self, LoadOptions, Loaded},
    lighting::Lighting,
    math::Measure,
    photo::{Look, weights::Weights},
    variables::{FreeKinds, VariableKind, Wishes},
};

/// Find the lights that give a scene a look, and render it
///
/// The lights' radiance and size and the background's brightness are varied until the
/// picture, rendered with global illumination, comes as close to the target as they allow.
/// Closeness is f_q, a weighted sum of six terms (see `evaluate --help`); lower is better.
///
/// The look may also be a photograph ("light my scene like this"): its brightness histogram
/// becomes the signature. With --target-mask its main object is known, and all six terms are
/// measured on it and count with the published weights; without, the histogram alone counts.
/// The photograph is measured at the size at which the pictures are optimised (--work-size).
///
/// SCENE is a Wavefront OBJ or glTF (.obj, .glb, .gltf). Beside it a sidecar of the same name
/// ending in .toml gives camera, main object and lights; a glTF may bring its own camera and
/// lights. A scene that has none is staged: see `stage --help`. A name that is not found is also sought in scenes/; the ending may be left out.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    lightopt-embree run fruit_basket.obj\n  \
    lightopt-embree run --target low-key --out runs/dark fruit_basket.obj\n  \
    lightopt-embree run --target portrait.jpg --target-mask face.png fruit_basket.obj\n  \
    lightopt-embree run --work-size 64x48 --size 320x240 --final-spp 64 --json fruit_basket.obj\n  \
    lightopt-embree run --resume runs/fruit_basket-high-key\n\n\
    The run directory holds final.png, final.exr, lights.toml (for `render --lights`), an EXR\n\
    per iteration, run.toml with all options, and logs of every evaluation. A small picture of\n\
    the lights found, found.png, is there at once; final.png gets better as samples come.\n\
    Ctrl-C, SIGTERM or SIGHUP ends the run within two seconds and keeps what is found: lights.toml,\n\
    the record, and the final picture as far as it is; twice quits at once. `run --resume DIR` goes\n\
    on.\n\
    Exit status: 0 done, 1 failed, 2 wrong usage, 130, 143 or 129 ended by one of those signals.")]
pub struct RunArgs {
    /// Scene to light: Wavefront OBJ or glTF, with its sidecar
    #[arg(value_name = "SCENE", required_unless_present = "resume")]
    pub scene: Option<PathBuf>,

    /// Go on with a run that was stopped or killed: DIR is its --out, and its options are those with which
    /// it was begun, so that none can be given. It ends with the files of a run that was never stopped
    #[arg(long, value_name = "DIR", exclusive = true)]
    pub resume: Option<PathBuf>,

    /// Where the scene's files may lie.
    #[command(flatten)]
    pub confinement: ConfinementArgs,

    /// The look: high-key, low-key, a target file (TOML; copy one from scenes/targets), a photograph
    /// (JPEG, PNG, TIFF, EXR), or LIBRARY.toml#CLASS (see `learn-signature --help`)
    #[arg(long, value_name = "NAME|FILE", default_value = "high-key")]
    pub target: String,

    /// What of a photograph is matched.
    #[command(flatten)]
    pub matched: MatchArgs,

    /// Mask of the main object of the photograph that is the target, of its size (upright): white on
    /// the object [default: that of an EXR of this program]
    #[arg(long, value_name = "FILE", conflicts_with = "targets")]
    pub target_mask: Option<PathBuf>,

    /// Weights in [0, 1] in the place of the mask of the main object: how much each pixel is main object, white being
    /// 1 (a map of saliency); of any size
    #[arg(long, value_name = "FILE")]
    pub weights: Option<PathBuf>,

    /// Several looks from one simulation, each recorded in a directory of its own below DIR; up to
    /// four are found together and share all renders
    #[arg(long, value_name = "NAME|FILE,…", value_delimiter = ',', conflicts_with = "target")]
    pub targets: Option<Vec<String>>,

    /// Directory to record the run in [default: runs/SCENE-TARGET]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,

    /// Sizes of the pictures.
    #[command(flatten)]
    pub pictures: PictureArgs,

    /// Samples per pixel of the first transport basis, which tells where to look [default: 8]; of
    /// every working picture with --gradient fd [default: what --tolerance needs]
    #[arg(long, value_name = "N", value_parser = parse_spp)]
    pub spp: Option<u32>,

    /// Samples of a pixel of the final picture at most, no less than 4; --final-noise ends it sooner
    #[arg(long, value_name = "N", default_value = "192", value_parser = parse_spp)]
    pub final_spp: u32,

    /// What may vary [default: the sidecar's, else all]
    #[arg(long, value_name = "KIND,…", value_delimiter = ',', value_parser = free_kinds())]
    pub free: Option<Vec<VariableKind>>,

    /// Place lamps: N at most, and as few as it takes, in the place of the scene's own lights [default: 4
    /// for a scene that has none or is staged]. Where they may stand is said by `movement` in the sidecar
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=12))]
    pub lamps: Option<u8>,

    /// Move the scene's own rectangles, disks and spots as well: each goes around the subject and turns to face
    /// what it faces now. Lights that are locked or off stay, and those with `movable = false` in the sidecar
    #[arg(long)]
    pub move_lights: bool,

    /// With --lamps: keep the scene's own lights, and add lamps to them
    #[arg(long, requires = "lamps")]
    pub keep: bool,

    /// Choose surroundings: every HDR and EXR picture in a folder, or one picture, is tried at every turn, in
    /// the place of the scene's own, and the best ten are rendered; environments.csv holds their ranking
    #[arg(long, value_name = "DIR|FILE", conflicts_with_all = ["lamps", "move_lights"])]
    pub environments: Option<PathBuf>,

    /// How gradients are found
    #[arg(long, value_parser = one_of(&GRADIENTS), default_value = "basis")]
    pub gradient: Gradient,

    /// Also search the whole box of the variables on the transport basis, without starts or
    /// gradients (NLopt's DIRECT-L): a check that the starts missed nothing
    #[arg(long)]
    pub global: bool,

    /// Error of f_q (95 %) at which the check of the lights found takes no more samples; three
    /// times as much is enough to search the transport basis, and twice, the noise's bias included,
    /// for what --gradient fd minimises
    #[arg(long, value_name = "F_Q", default_value_t = 0.005, value_parser = parse_tolerance)]
    pub tolerance: f64,

    /// Seconds that the run may take once the scene is loaded, search, checks and pictures together; one
    /// pass of each is made in any case, and what the result then lacks is said
    #[arg(long, value_name = "SECONDS", value_parser = parse_seconds)]
    pub time_limit: Option<Duration>,

    /// Directory that keeps transport bases: another look of the same scene renders nothing, and
    /// `relight` and `scan` work on them
    #[arg(long, value_name = "DIR")]
    pub cache: Option<PathBuf>,

    /// Keep the transport basis with which the lights were found, transport.basis in the directory of the
    /// run, for `relight` and `scan`; otherwise it is there only until the run is done
    #[arg(long)]
    pub keep_basis: bool,

    /// Most memory of the transport basis: fewer size knots are kept if it needs more; and of the final
    /// pictures of the start and all looks, which otherwise are not all rendered together
    #[arg(long, value_name = "BYTES", default_value = "2G", value_parser = parse_bytes)]
    pub memory: u64,

    /// With --gradient fd: evaluations of f_q with its gradient, at most
    #[arg(long, value_name = "N", default_value_t = 30, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub max_evaluations: u32,

    /// Factor on linear radiance before display: 2 is one stop brighter [default: the sidecar's]
    #[arg(long, value_name = "FACTOR", allow_negative_numbers = true, value_parser = parse_exposure)]
    pub exposure: Option<f64>,

    /// View transform.
    #[command(flatten)]
    pub view: ViewArgs,

    /// Ties and locks.
    #[command(flatten)]
    pub ties: TieArgs,

    /// Which brightness is measured, of what the view shows [default: srgb]
    #[arg(long, value_enum)]
    pub luminance: Option<LuminanceArg>,

    /// Print one JSON object in full precision instead of a table
    #[arg(long)]
    pub json: bool,

    /// Camera of the scene file.
    #[command(flatten)]
    pub camera: CameraArgs,

    /// Light transport.
    #[command(flatten)]
    pub transport: TransportArgs,
}

impl RunArgs {
    /// Path of the scene.
    fn scene(&self) -> &Path {
        // Without --resume there is one.
        self.scene.as_deref().unwrap_or(Path::new(""))
    }
}

/// Parses a tolerance of f_q.
fn parse_tolerance(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(t) if t > 0.0 && t <= 1.0 => Ok(t),
        _ => Err("must be above 0 and at most 1".to_owned()),
    }
}

/// Parses a time in seconds.
fn parse_seconds(text: &str) -> Result<Duration, String> {
    let seconds = text.parse().ok().filter(|s: &f64| *s > 0.0);
    seconds
        .and_then(|s| Duration::try_from_secs_f64(s).ok())
        .ok_or_else(|| "must be a number above 0".to_owned())
}

/// Parses an amount of memory: bytes, or with K, M or G.
fn parse_bytes(text: &str) -> Result<u64, String> {
    let (number, shift) = match text.char_indices().last() {
        Some((i, 'K' | 'k')) => (&text[..i], 10),
        Some((i, 'M' | 'm')) => (&text[..i], 20),
        Some((i, 'G' | 'g')) => (&text[..i], 30),
        _ => (text, 0),
    };
    let bytes = number.parse::<f64>().ok().map(|n| n * f64::from(1_u32 << shift));
    bytes
        .filter(|b| *b >= 1.0 && *b < 1e18)
        .map(|b| b as u64)
        .ok_or_else(|| "must be a number of bytes, such as 512M or 2G".to_owned())
}

/// Lamps at most that are placed in a scene without lights, as many as a portrait is lit with: key, fill, rim
/// and background.
const LAMPS: u8 = 4;

/// Width of the working pictures by default, pixels: the noise and the cost of a search are those of this
/// size, while the gradient term of f_q depends on it.
const WORK_WIDTH: u32 = 128;

/// Runs the subcommand.
///
/// # Errors
/// When the scene, the target or the run directory is wrong, or a render fails.
pub fn run(args: &RunArgs) -> anyhow::Result<()> {
    // What is wrong with the words should show in the first second.
    let Some(place) = &args.resume else {
        let (root, wanted) = wanted(args)?;
        import::find(args.scene())?;
        Unfinished::check(&root.join(UNFINISHED), args.pictures.force)?;
        for (_, out) in &wanted {
            RunDir::check(out, args.pictures.force)?;
        }
        let unfinished = resume::begin("run", &root, &root.join(UNFINISHED), args.pictures.force)?;
        let result = work(args, args.pictures.force, &root, wanted, &unfinished);
        return resume::end(unfinished, "run", &root, result);
    };
    let (unfinished, args) = resume::take_up("run", place, &place.join(UNFINISHED), |args: &RunArgs| {
        Ok(wanted(args)?.0.join(UNFINISHED))
    })?;
    let (root, wanted) = wanted(&args)?;
    let result = work(&args, true, &root, wanted, &unfinished);
    resume::end(unfinished, "run", place, result)
}

/// Does what `args` say, with `wanted` recorded in its directories below `root`, of which `force` replaces
/// the contents; prints the result.
fn work(
    args: &RunArgs,
    force: bool,
    root: &Path,
    wanted: Vec<(Look, PathBuf)>,
    unfinished: &Unfinished,
) -> anyhow::Result<()> {
    for (look, _) in &wanted {
        say_look(look);
    }
    let scene_path = import::find(args.scene())?;
    let console = Console::with_reports();
    let basis_file = root.join(BASIS);
    let words = unfinished.command().arguments.iter().cloned();
    let command: Vec<String> = std::iter::once("run".to_owned()).chain(words).collect();
    if args.targets.is_some() {
        // Of an earlier run: what is shown together is made anew.
        [LIVE, REPORT].iter().for_each(|name| drop(fs::remove_file(root.join(name))));
    }
    let done = args.transport.in_pool(|| {
        let without_lights = args.lamps.is_some() && !args.keep;
        let load = LoadOptions { without_lights, ..args.camera.options(args.confinement) };
        let mut loaded = load_any_scene(args.scene(), &load, |w| console.note(w))?;
        // Surroundings are chosen in the place of lights that staging alone has brought.
        let without_lights = without_lights || (args.environments.is_some() && loaded.staging.is_some());
        if without_lights && !load.without_lights {
            loaded = load_any_scene(args.scene(), &LoadOptions { without_lights, ..load }, |_| ())?;
        }
        let view = args.view.of_scene(None, &loaded, |w| console.note(w));
        let Loaded { mut scene, mut constraints, wishes, staging, has_staged_lights, .. } = loaded;
        signals::end_in_order("keeping what is found so far");
        let wishes = args.ties.wishes(&wishes);
        // Staged lights are a guess, which lamps that are sought take the place of unless somebody speaks of them.
        let places_anew = !args.move_lights
            && args.lamps.is_none()
            && args.gradient == Gradient::Basis
            && wishes == Wishes::default()
            && has_staged_lights;
        let without_lights = without_lights || places_anew;
        let mut staged = Vec::new();
        if places_anew {
            staged = std::mem::take(&mut scene.lights);
            scene = scene.with_lights(Vec::new());
            constraints.lights.clear();
        }
        let mut authored = authored(&scene, args.exposure);
        wishes.apply(&scene.light_names(), &mut authored.radiance, &mut constraints)?;
        let free = args.free.clone().map_or_else(|| constraints.free.clone(), FreeKinds);
        for (light, constraints) in scene.lights.iter_mut().zip(&constraints.lights) {
            if free.intersection(&constraints.free).0.iter().any(|kind| kind.is_of_color()) {
                light.record_white();
            }
        }
        authored.color = Lighting::authored(&scene).color;
        let size = args.pictures.size.unwrap_or_else(|| scene.camera.size());
        let work_size = args.pictures.work_size.unwrap_or_else(|| {
            let height = (WORK_WIDTH * size.y).div_ceil(size.x).max(1);
            UVec2::new(WORK_WIDTH, height).min(size)
        });
        let luminance = luminance_mode(args.luminance);
        let longest = work_size.max_element() as usize;
        let jobs: Vec<Job> = wanted
            .into_iter()
            .map(|(look, out)| {
                Ok(Job { target: look.into_target(luminance, longest, args.matched.get())?, out })
            })
            .collect::<anyhow::Result<_>>()?;
        let options = RunOptions {
            jobs: jobs.clone(),
            gradient: args.gradient,
            tolerance: args.tolerance,
            time_limit: args.time_limit,
            cache: args.cache.clone(),
            global: args.global,
            memory: args.memory,
            integrator: args.transport.integrator(),
            sampler: args.transport.sampler,
            weights: args.weights.as_deref().map(Weights::read).transpose()?,
            measure: Measure { view, luminance, color: jobs.iter().any(|job| job.target.needs_color()) },
            size,
            work_size,
            spp: args.spp,
            final_spp: args.final_spp,
            final_noise: args.pictures.final_noise,
            denoise: !args.pictures.no_denoise,
            free,
            seed: args.transport.seed,
            max_evaluations: args.max_evaluations,
            force,
            products: Some(unfinished.products().to_owned()),
            basis_file: Some(basis_file.clone()),
            live_file: Some(root.join(LIVE)),
            alternatives: true,
            command: command.clone(),
        };
        let is_colored = options.free.0.iter().any(|kind| kind.is_of_color());
        if let Some(job) = jobs.iter().find(|job| job.target.needs_color() && !is_colored) {
            console.note(&format!(
                "{} asks for colours, and those of the lights stay as they are; `--free radiance,size,background,color` \
                 varies them",
                job.target.name()
            ));
        }
        if args.move_lights && !constraints.bonds.is_empty() {
            bail!(
                "--move-lights: lights that follow others (--tie, --ratio, --group, [ties]) cannot be moved"
            );
        }
        if args.environments.is_some() && !constraints.bonds.is_empty() {
            bail!("--environments: with ties (--tie, --ratio, --group, [ties]) there is no choice of surroundings");
        }
        let (path, authored, constraints) = (scene_path.as_path(), &authored, &constraints);
        let own_names: Vec<String> = scene.lights.iter().map(|light| light.name.clone()).collect();
        let skies = args.environments.as_deref().map(|folder| skies(folder, &console)).transpose()?;
        let skies = skies.unwrap_or_default();
        let wanted = args.lamps.or_else(|| own_names.is_empty().then_some(LAMPS));
        let places = args.move_lights || !skies.is_empty();
        let lamps = wanted.or(places.then_some(0)).map(usize::from);
        let reports = match lamps {
            None => {
                let subject =
                    Subject { scene: &scene, path, authored, constraints, rig: None, time_left: None };
                design::run(subject, &options, &console)?
            }
            Some(most) => {
                let order = Order {
                    most,
                    moves: args.move_lights,
                    skies: &skies,
                    staged: &staged,
                    without_lights,
                    path,
                    authored,
                    own_names: &own_names,
                    constraints,
                    options: &options,
                };
                rig::run(scene, &order, &console)?
            }
        };
        if let Some(sidecar) = &staging {
            for job in &jobs {
                write_whole(&job.out.join(STAGING), sidecar)?;
            }
        }
        Ok((reports, jobs))
    });
    console.finish();
    let (reports, jobs) = done?;
    if args.targets.is_some() && !root.join(REPORT).is_file() {
        // Looks with lamps of their own were done one after the other.
        report::together(root);
    }
    if !args.keep_basis && !signals::received() {
        // There is none where gradients are differences.
        let each = jobs.iter().map(|job| job.out.join(BASIS));
        each.chain([basis_file]).for_each(|file| drop(fs::remove_file(file)));
    }
    let each = reports.iter().zip(&jobs);
    if args.json {
        let mut all: Vec<serde_json::Value> = each.map(|(r, job)| to_json(r, job)).collect();
        let value = if args.targets.is_some() { all.into() } else { all.remove(0) };
        print_json(&value)
    } else {
        print(&each.map(|(r, job)| to_table(r, job)).collect::<Vec<_>>().join("\n"))
    }
}

/// Looks asked for, each with its run directory, and the directory of the whole.
fn wanted(args: &RunArgs) -> anyhow::Result<(PathBuf, Vec<(Look, PathBuf)>)> {
    let stem = args.scene().file_stem().map_or_else(|| "scene".into(), |s| s.to_string_lossy().into_owned());
    let Some(names) = &args.targets else {
        let look = Look::resolve(&args.target, args.target_mask.as_deref())?;
        let default = || Path::new("runs").join(format!("{stem}-{}", look.name()));
        let out = args.out.clone().unwrap_or_else(default);
        return Ok((out.clone(), vec![(look, out)]));
    };
    let root = args.out.clone().unwrap_or_else(|| Path::new("runs").join(stem));
    let mut wanted: Vec<(Look, PathBuf)> = Vec::new();
    for name in names {
        let look = Look::resolve(name, None)?;
        let out = root.join(look.name());
        if wanted.iter().any(|(_, o)| *o == out) {
            bail!("--targets: two targets are called `{}`", look.name());
        }
        wanted.push((look, out));
    }
    Ok((root, wanted))
}

/// Report of a look as a JSON object.
fn to_json(r: &RunReport, job: &Job) -> serde_json::Value {
    let mut report = r.to_json(job);
    report["seconds"] = r.seconds.into();
    report["run_dir"] = json!(job.out);
    report
}

/// Report of a look as text.
fn to_table(r: &RunReport, Job { target, out }: &Job) -> String {
    // Writing to a String does not fail.
    let mut text = String::new();
    let _ = writeln!(text, "target {}", target.name());
    let _ = writeln!(
        text,
        "f_q {:.4} at the start, {:.4} ± {:.4} found; {}",
        r.initial.evaluation.f_q,
        r.check.evaluation.f_q,
        r.check.error_bar(),
        r.last.as_ref().map_or_else(
            || "no final picture".to_owned(),
            |last| format!("{:.4} in the final picture", last.estimate.evaluation.f_q)
        )
    );
    if let Some(last) = &r.last {
        let _ = writeln!(
            text,
            "final picture: {} samples a pixel, noise {:.4}, f_q {:.4} with the noise",
            last.spp,
            last.noise.error(),
            last.f_q_picture
        );
    }
    let _ = writeln!(
        text,
        "{} evaluations, {} renders, {:.0} s; stopped because {}\n",
        r.evaluations, r.renders, r.seconds, r.stop
    );
    let _ = writeln!(text, "{:<9} {:>8} {:>8} {:>8} {:>8}", "term", "start", "found", "target", "weight");
    for (a, b) in r.initial.evaluation.terms().zip(r.check.evaluation.terms()) {
        let wanted = if b.term.is_distance() { "0".to_owned() } else { format!("{:.3}", b.target) };
        let _ = writeln!(
            text,
            "{:<9} {:>8.3} {:>8.3} {wanted:>8} {:>8.2}",
            b.term.name(),
            a.value,
            b.value,
            b.weight
        );
    }
    let _ = writeln!(text);
    let counting: Vec<Reach> =
        r.reach_with_found().into_iter().filter(|t| target.weight(t.term) > 0.0).collect();
    for line in attainable::in_words(&counting).iter().chain(&r.caution) {
        let _ = writeln!(text, "{line}");
    }
    if !r.reach.is_empty() {
        let _ = writeln!(text);
    }
    for (v, x) in r.variables.variables.iter().zip(&r.x) {
        let _ = writeln!(text, "{:<24} {x:>12.5}   within [{:.5}, {:.5}]", v.name, v.lower, v.upper);
    }
    if !r.lamps.is_empty() {
        let _ = writeln!(text);
    }
    for (name, lamp) in &r.lamps {
        let _ = writeln!(text, "{name}: {}", rig::in_words(lamp));
    }
    if let Some(surroundings) = &r.surroundings {
        let _ = writeln!(text, "\nsurroundings: {surroundings}");
    }
    let file = if r.last.is_some() { "final.png" } else { "lights.toml" };
    let _ = writeln!(text, "\n{}", out.join(file).display());
    text
}
