//! `render`: the picture of a scene with given lights.

use std::path::PathBuf;

use anyhow::bail;
use clap::Args;
use glam::UVec2;
use serde_json::json;

use super::{
    common::{
        CameraArgs, ConfinementArgs, TransportArgs, ViewArgs, load_lit_scene, needs_lights, parse_exposure,
        parse_size, parse_spp,
    },
    output::say,
    pick,
    progress::Console,
    signals,
};
use crate::{
    audit::{MAX_PICKS, picture},
    design::{
        Reporter,
        growing::Wanted,
        render::{Budget, PassedPicture, Renderer},
    },
    files::atomic::probe,
    film::{
        exr::{write_exr, write_exr_plain},
        image_file::write_view_png,
    },
    integrator::{
        IntegratorKind, Observer, View,
        aov::{self, Features},
    },
    lighting::SamplingPlan,
    math::Measure,
};

/// Samples per pixel by default: quick to look at, with some noise.
const SPP: u32 = 64;

/// Render a scene with the lights of its sidecar, or with lights that `run` found
///
/// An EXR holds linear radiance with the object mask, albedo, normals, depth and the share of
/// each light; a PNG is encoded for display.
///
/// With the lights.toml of a run this shows what its final picture shows, but for noise: it has samples of
/// its own.
#[derive(Clone, Debug, Args)]
#[command(after_help = "Examples:\n  \
    lightopt-embree render -o basket.png fruit_basket.obj\n  \
    lightopt-embree render --lights runs/dark/lights.toml --spp 1024 -o dark.exr fruit_basket.obj\n  \
    lightopt-embree render --pick 3 runs/fruit_basket-high-key\n\n\
    Ctrl-C, SIGTERM or SIGHUP ends within two seconds and writes the picture as far as it is, marked\n\
    incomplete; twice quits at once.\n\
    Exit status: 0 done, 1 failed, 2 wrong usage, 130, 143 or 129 ended by one of those signals.")]
pub struct RenderArgs {
    /// Scene to render: Wavefront OBJ or glTF, with its sidecar; with --pick a run directory
    #[arg(value_name = "SCENE")]
    pub scene: PathBuf,

    /// Render one of the lightings that a run offers, by its number in contact.png and the report: its scene at the
    /// size of the final picture, with the view, the integrator and the denoising of the run
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=MAX_PICKS as i64), conflicts_with = "lights")]
    pub pick: Option<u8>,

    /// Where the scene's files may lie.
    #[command(flatten)]
    pub confinement: ConfinementArgs,

    /// Lighting to use, as `run` writes it
    #[arg(long, value_name = "FILE")]
    pub lights: Option<PathBuf>,

    /// Samples per pixel [default: 64, with --pick the most that the run allowed for its final picture]
    #[arg(long, value_name = "N", value_parser = parse_spp)]
    pub spp: Option<u32>,

    /// Size of the picture, pixels [default: the sidecar's]
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub size: Option<UVec2>,

    /// Factor on linear radiance before display [default: the lighting's, else the sidecar's]
    #[arg(long, value_name = "FACTOR", allow_negative_numbers = true, value_parser = parse_exposure)]
    pub exposure: Option<f64>,

    /// View transform.
    #[command(flatten)]
    pub view: ViewArgs,

    /// Remove noise from the picture that is shown: the PNG, or parts of the EXR beside the noisy ones. The
    /// samples, no less than 4, are then those of four replicates
    #[arg(long)]
    pub denoise: bool,

    /// Say what is decided on the way: how many light samples and light subpaths a camera subpath takes, which
    /// suits the scene
    #[arg(short, long)]
    pub verbose: bool,

    /// File to write: .exr or .png [default: SCENE.exr, with --pick pick-N.png in the run directory]
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,

    /// Camera of the scene file.
    #[command(flatten)]
    pub camera: CameraArgs,

    /// Light transport.
    #[command(flatten)]
    pub transport: TransportArgs,
}

/// Runs the subcommand.
///
/// # Errors
/// When the scene or the lighting is wrong, or the picture cannot be made or written.
pub fn render(args: &RenderArgs) -> anyhow::Result<()> {
    let Some(number) = args.pick else { return render_lit(args) };
    let run = &args.scene;
    let picked = pick::resolve(run, number.into(), say)?;
    let mut args = args.clone();
    if args.transport.kind.0 == IntegratorKind::default() {
        args.transport.kind.0 = picked.pictures.integrator;
    }
    let args = RenderArgs {
        output: args.output.or_else(|| Some(run.join(format!("pick-{number}.png")))),
        scene: picked.scene,
        lights: Some(picked.lights),
        spp: args.spp.or(Some(picked.pictures.final_spp)),
        size: args.size.or(Some(UVec2::from_array(picked.pictures.size))),
        denoise: args.denoise || picked.pictures.denoise,
        ..args
    };
    render_lit(&args)
}

/// Renders a scene with the lights of its sidecar, or of a file.
fn render_lit(args: &RenderArgs) -> anyhow::Result<()> {
    let spp = args.spp.unwrap_or(SPP);
    let output = match &args.output {
        Some(path) => path.clone(),
        None => PathBuf::from(args.scene.file_stem().unwrap_or("scene".as_ref())).with_extension("exr"),
    };
    let extension = output.extension().map(|e| e.to_string_lossy().to_lowercase());
    let is_png = match extension.as_deref() {
        Some("png") => true,
        Some("exr") => false,
        _ => bail!("{}: the output must end in .exr or .png", output.display()),
    };
    if let Some(parent) = output.parent().filter(|p| !p.as_os_str().is_empty() && !p.is_dir()) {
        bail!("{}: no such directory", parent.display());
    }
    probe(&output)?;
    let console = Console::new();
    let result = args.transport.in_pool(|| {
        let options = args.camera.options(args.confinement);
        let given = (args.lights.as_deref(), args.exposure);
        let (loaded, lighting, view) = load_lit_scene(&args.scene, options, given, |w| console.note(w))?;
        needs_lights(&loaded, &args.scene)?;
        let seen_through = args.view.of_scene(view, &loaded, |w| console.note(w));
        let scene = loaded.scene;
        let camera = args.size.map_or_else(|| scene.camera.clone(), |size| scene.camera.resized(size));
        let view = View { scene: &scene, camera: &camera };
        let aovs = aov::trace(view, lighting.value as f32);
        signals::end_in_order("keeping the picture as far as it is");
        console.stage("rendering", Some(u64::from(camera.size().y) * u64::from(spp)));
        let renderer = Renderer {
            integrator: args.transport.integrator(),
            sampler: args.transport.sampler,
            measure: Measure { view: seen_through, ..Measure::default() },
        };
        let seed = args.transport.seed;
        let plan = SamplingPlan::for_picture(&lighting);
        let plan = renderer.suited(plan, view, &[&lighting], seed, spp);
        if args.verbose {
            console.note(&plan.counts.to_string());
        }
        let is_over = || console.cancelled();
        let (picture, taken, denoised) = if args.denoise {
            let wanted = Wanted { view, lightings: &[&lighting], plan: &plan, seed, spp };
            let grown = renderer.grow(&wanted, &is_over, &console)?;
            (grown.picture(0), grown.spp(), Some(grown.denoised(0, &Features::trace(view))))
        } else {
            let budget = Budget { seed, spp, n_replicates: 1 };
            let PassedPicture { picture, spp: taken } =
                renderer.render_in_passes(view, &lighting, &plan, budget, &is_over, &console)?;
            (picture, taken, None)
        };
        let is_whole = taken >= spp;
        if !is_whole {
            console.note(&format!("{taken} of {spp} samples a pixel"));
        }
        let exposure = lighting.exposure;
        if is_png {
            let shown = picture::beauty(denoised.as_ref().unwrap_or(&picture));
            write_view_png(&output, &shown, exposure, seen_through)?;
        } else {
            let names = scene.light_names();
            let mut attribute = json!({
                "scene": scene.name,
                "exposure": exposure,
                "luminance": renderer.measure.luminance,
                "view": seen_through,
                "integrator": renderer.integrator.kind,
                "spp": taken,
                "sampling": plan.counts,
                "seed": args.transport.seed,
                "version": env!("CARGO_PKG_VERSION"),
                "commit": env!("LIGHTOPT_COMMIT"),
            });
            if !is_whole {
                attribute["incomplete"] = true.into();
            }
            let mut exr = picture::exr(&picture, &aovs, &names, exposure, renderer.measure, attribute);
            exr.parts.extend(denoised.iter().flat_map(|denoised| picture::denoised(denoised, &names)));
            if is_whole { write_exr(&output, &exr) } else { write_exr_plain(&output, &exr) }?;
        }
        Ok(())
    });
    console.finish();
    result?;
    console.note(&format!("wrote {}", output.display()));
    Ok(())
}
