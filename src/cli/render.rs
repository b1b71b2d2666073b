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
    progress::Console,
    signals,
};
use crate::{
    audit::picture,
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
        Observer, View,
        aov::{self, Features},
    },
    lighting::SamplingPlan,
    math::Measure,
};

/// Render a scene with the lights of its sidecar, or with lights that `run` found
///
/// An EXR holds linear radiance with the object mask, albedo, normals, depth and the share of
/// each light; a PNG is encoded for display.
///
/// With the lights.toml of a run this shows what its final picture shows, but for noise: it has samples of
/// its own.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    lightopt-embree render -o basket.png fruit_basket.obj\n  \
    lightopt-embree render --lights runs/dark/lights.toml --spp 1024 -o dark.exr fruit_basket.obj\n\n\
    Ctrl-C, SIGTERM or SIGHUP ends within two seconds and writes the picture as far as it is, marked\n\
    incomplete; twice quits at once.\n\
    Exit status: 0 done, 1 failed, 2 wrong usage, 130, 143 or 129 ended by one of those signals.")]
pub struct RenderArgs {
    /// Scene to render: Wavefront OBJ or glTF, with its sidecar
    #[arg(value_name = "SCENE")]
    pub scene: PathBuf,

    /// Where the scene's files may lie.
    #[command(flatten)]
    pub confinement: ConfinementArgs,

    /// Lighting to use, as `run` writes it
    #[arg(long, value_name = "FILE")]
    pub lights: Option<PathBuf>,

    /// Samples per pixel
    #[arg(long, value_name = "N", default_value = "64", value_parser = parse_spp)]
    pub spp: u32,

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

    /// File to write: .exr or .png [default: SCENE.exr]
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
        console.stage("rendering", Some(u64::from(camera.size().y) * u64::from(args.spp)));
        let renderer = Renderer {
            integrator: args.transport.integrator(),
            sampler: args.transport.sampler,
            measure: Measure { view: seen_through, ..Measure::default() },
        };
        let seed = args.transport.seed;
        let plan = SamplingPlan::for_picture(&lighting);
        let plan = renderer.suited(plan, view, &[&lighting], seed, args.spp);
        if args.verbose {
            console.note(&plan.counts.to_string());
        }
        let is_over = || console.cancelled();
        let (picture, spp, denoised) = if args.denoise {
            let wanted = Wanted { view, lightings: &[&lighting], plan: &plan, seed, spp: args.spp };
            let grown = renderer.grow(&wanted, &is_over, &console)?;
            (grown.picture(0), grown.spp(), Some(grown.denoised(0, &Features::trace(view))))
        } else {
            let budget = Budget { seed, spp: args.spp, n_replicates: 1 };
            let PassedPicture { picture, spp } =
                renderer.render_in_passes(view, &lighting, &plan, budget, &is_over, &console)?;
            (picture, spp, None)
        };
        let is_whole = spp >= args.spp;
        if !is_whole {
            console.note(&format!("{spp} of {} samples a pixel", args.spp));
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
                "spp": spp,
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
