//! `relight`: pictures of any lighting from a stored transport basis.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::Args;
use serde_json::json;

use super::{
    common::{LuminanceArg, say_view, views},
    output::{print, say},
};
use crate::{
    audit::{lights::LightsFile, picture, stored::About},
    film::{exr::write_exr, image_file::write_view_png},
    integrator::aov::Aovs,
    math::{Measure, ViewTransform},
    transport::TransportBasis,
};

/// Light a stored scene anew, without rendering
///
/// BASIS is a transport basis that `run` has kept: with `--cache DIR` in DIR, with `--keep-basis` in
/// the run directory. It holds the scene's picture under every lighting that the run could have chosen.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    lightopt-embree run --cache bases fruit_basket.obj\n  \
    lightopt-embree relight --lights runs/fruit_basket-high-key/lights.toml bases/fruit_basket-*.basis -o a.exr")]
pub struct RelightArgs {
    /// Stored transport basis
    #[arg(value_name = "BASIS")]
    pub basis: PathBuf,

    /// Lighting, as `run` writes it [default: the start of the run that stored the basis]
    #[arg(long, value_name = "FILE")]
    pub lights: Option<PathBuf>,

    /// Picture to write: .exr (with mask and a part per light) or .png
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,

    /// Remove noise from the picture that is shown: the PNG, or parts of the EXR beside the noisy ones
    #[arg(long)]
    pub denoise: bool,

    /// View transform between light and display [default: that of --lights, else as stored]
    #[arg(long, value_name = "VIEW", value_parser = views())]
    pub view: Option<ViewTransform>,

    /// Which brightness goes into the EXR's luminance [default: as stored]
    #[arg(long, value_enum)]
    pub luminance: Option<LuminanceArg>,
}

/// Reads a basis with the description of its scene.
///
/// # Errors
/// When the file is no basis, or does not describe its scene.
pub(super) fn load(path: &Path) -> anyhow::Result<(TransportBasis, About)> {
    let (basis, about) = TransportBasis::load(path)?;
    let about: Option<About> = serde_json::from_value(about).ok();
    match about.filter(|a| a.fits(&basis)) {
        Some(about) => Ok((basis, about)),
        None => bail!("{}: the transport basis does not say what it is of", path.display()),
    }
}

/// Runs the subcommand.
///
/// # Errors
/// When the basis or the lighting is wrong, or the picture cannot be written.
pub fn relight(args: &RelightArgs) -> anyhow::Result<()> {
    let is_exr = match args.output.extension().and_then(|e| e.to_str()) {
        Some(e) if e.eq_ignore_ascii_case("exr") => true,
        Some(e) if e.eq_ignore_ascii_case("png") => false,
        _ => bail!("{}: a picture ends in .exr or .png", args.output.display()),
    };
    crate::files::atomic::probe(&args.output)?;
    let (basis, about) = load(&args.basis)?;
    let mut x = about.lighting();
    let mut view = args.view;
    if let Some(path) = &args.lights {
        let file = LightsFile::load(path)?;
        file.apply_to(&about, basis.layout(), &mut x, path)?;
        view = view.or(file.view);
    }
    let view = view.unwrap_or(about.view);
    say_view(view, say);
    let exposure = x.exposure;
    let shown = basis.picture(&x);
    let denoised = match (args.denoise, &about.features) {
        (false, _) => None,
        (true, None) => bail!(
            "{}: the basis does not say what the camera sees, without which nothing is denoised; `run` it anew",
            args.basis.display()
        ),
        (true, Some(features)) => {
            let size = [shown.width, shown.height];
            let denoised = features.read(size).and_then(|features| basis.denoised(&x, &features));
            let fault = || format!("{}: the basis cannot be denoised", args.basis.display());
            Some(denoised.with_context(fault)?)
        }
    };
    if is_exr {
        let luminance = args.luminance.map_or(about.luminance, Into::into);
        let measure = Measure { view, luminance, color: false };
        let n = shown.rgb.len();
        let aovs = Aovs {
            width: shown.width,
            height: shown.height,
            mask: about.mask(),
            albedo: vec![[0.0; 3]; n],
            normal: vec![[0.0; 3]; n],
            depth: vec![f32::INFINITY; n],
        };
        let names: Vec<&str> = about.lights.iter().map(String::as_str).collect();
        let attribute = json!({
            "scene": about.scene,
            "exposure": exposure,
            "luminance": luminance,
            "view": view,
            "spp": basis.n_samples() * basis.n_replicates() as u32,
            "version": env!("CARGO_PKG_VERSION"),
            "commit": env!("LIGHTOPT_COMMIT"),
        });
        let mut image = picture::exr(&shown, &aovs, &names, exposure, measure, attribute);
        // A basis knows nothing of surfaces.
        image.parts.retain(|p| !["albedo", "normal", "depth"].contains(&p.name.as_str()));
        image.parts.extend(denoised.iter().flat_map(|denoised| picture::denoised(denoised, &names)));
        write_exr(&args.output, &image)?;
    } else {
        let shown = picture::beauty(denoised.as_ref().unwrap_or(&shown));
        write_view_png(&args.output, &shown, exposure, view)?;
    }
    print(&format!("{}\n", args.output.display()))
}
