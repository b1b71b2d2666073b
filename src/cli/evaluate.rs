//! `evaluate`: measures a finished picture against a target.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};
use clap::Args;
use serde::Deserialize;
use serde_json::{Value, json};

use super::common::{MatchArgs, say_look, say_notes, say_view, views};
use super::{
    LuminanceArg,
    output::{one_line, say},
    parse_exposure, print, print_json,
};
use crate::film::image_file::{MaskImage, read_mask};
use crate::math::{Measure, ViewTransform};
use crate::objective::{Evaluation, Goal, LABELLINGS, LuminanceMode, Replicates, Target};
use crate::photo::{Look, weights::Weights};
use crate::picture::{Picture, Purpose, Reading, Transfer};

/// Bytes of a pixel beside the picture: its brightness and its mask.
const MEASURED: usize = 9;

/// Measure a picture against a target and print f_q with its six terms
///
/// Each term compares a measured value with its target: f = |value - target| /
/// max(target, 1 - target), so 0 is a hit and 1 the worst possible miss (grad may exceed it).
/// f_q is their weighted sum; lower is better. meanObj and meanBack are mean brightnesses of
/// the main object and of the rest, varObj and varBack standard deviations there, grad is the
/// object's root mean squared brightness gradient, and hist the distance of the whole
/// picture's cumulated histogram to the target's signature. Brightness runs from 0 (black)
/// to 1 (display white).
///
/// EXR pictures written by this program bring target, mask, exposure, view and luminance mode;
/// options override them. Any other picture needs --target and --mask. Final pictures of a run
/// bring replicates, from which f_q and terms are freed of the bias of noise; f_q_picture is that of
/// the picture as it is.
///
/// A photograph may be the target: its brightness histogram is the signature. With --target-mask all
/// terms are measured on it, without only the histogram counts. It is reduced to the size of IMAGE.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    lightopt-embree evaluate runs/still-high-key/final.exr\n  \
    lightopt-embree evaluate photo.png --mask object.png --target low-key --json\n  \
    lightopt-embree evaluate runs/still-portrait/final.exr --target portrait.jpg --target-mask face.png")]
pub struct EvaluateArgs {
    /// Picture to measure: EXR or HDR (linear), PNG, JPEG, TIFF, WebP, BMP or TGA (sRGB)
    #[arg(value_name = "IMAGE")]
    pub image: PathBuf,

    /// Built-in target (high-key, low-key), target file (TOML), photograph, or LIBRARY.toml#CLASS
    #[arg(long, value_name = "NAME|FILE")]
    pub target: Option<String>,

    /// Mask of the main object of the photograph that is the target, of its size (upright): white on
    /// the object [default: that of an EXR of this program]
    #[arg(long, value_name = "FILE", requires = "target")]
    pub target_mask: Option<PathBuf>,

    /// Mask of the main object, of the picture's size: white on the object, or transparent around it
    #[arg(long, value_name = "FILE")]
    pub mask: Option<PathBuf>,

    /// Weights in [0, 1] in the place of the mask: how much each pixel is main object, white being 1 (a map of
    /// saliency); of any size
    #[arg(long, value_name = "FILE")]
    pub weights: Option<PathBuf>,

    /// What of a photograph is matched.
    #[command(flatten)]
    pub matched: MatchArgs,

    /// Layer of an EXR that has several [default: the one that is the picture, by its name]
    #[arg(long, value_name = "NAME")]
    pub layer: Option<String>,

    /// Factor on linear radiance before display: 2 is one stop brighter [default: as stored, else 1]
    #[arg(long, value_name = "FACTOR", allow_negative_numbers = true, value_parser = parse_exposure)]
    pub exposure: Option<f64>,

    /// View transform between light and display, of a picture of light: EXR or HDR; looks measured under
    /// different views do not compare [default: as stored, else srgb]
    #[arg(long, value_name = "VIEW", value_parser = views())]
    pub view: Option<ViewTransform>,

    /// Which brightness is measured, of what the view shows [default: as stored, else srgb]
    #[arg(long, value_enum)]
    pub luminance: Option<LuminanceArg>,

    /// Print one JSON object in full precision instead of a table
    #[arg(long)]
    pub json: bool,
}

/// What our EXR pictures store for their evaluation; other keys are for others.
#[derive(Debug, Default, Deserialize)]
struct Stored {
    exposure: Option<f64>,
    luminance: Option<LuminanceMode>,
    view: Option<ViewTransform>,
    target: Option<Value>,
    f_q: Option<f64>,
}

/// A picture with all that is needed to measure it.
struct Subject {
    picture: Picture,
    mask: MaskImage,
    target: Target,
    exposure: f64,
    measure: Measure,
    /// f_q as the file records it, when nothing overrides what it refers to.
    recorded: Option<f64>,
}

/// What was measured of a picture.
struct Measured {
    /// f_q and its terms, from the replicates where there are any.
    evaluation: Evaluation,
    /// The error of f_q from replicates, and f_q of the picture as it is; `None` without replicates.
    of_picture: Option<OfPicture>,
}

/// What is told of a picture with replicates.
struct OfPicture {
    /// Half width of the 95 % interval of the f_q that is freed of noise bias, plus the size of its noise
    /// correction.
    error: f64,
    /// f_q of the picture as it is, noise included.
    f_q: f64,
}

/// Runs the subcommand.
///
/// # Errors
/// When a file cannot be read or does not fit, or something needed is not known.
pub fn evaluate(args: &EvaluateArgs) -> anyhow::Result<()> {
    // A wrong target name should not wait for a large picture.
    let mask = args.target_mask.as_deref();
    let look = args.target.as_deref().map(|spec| Look::resolve(spec, mask)).transpose()?;
    let subject = load(args, look)?;
    let measured = measure(&subject, args)?;
    if args.json {
        print_json(&to_json(&subject, &measured))
    } else {
        print(&to_table(&subject, &measured, &args.image))
    }
}

fn load(args: &EvaluateArgs, look: Option<Look>) -> anyhow::Result<Subject> {
    look.iter().for_each(say_look);
    let path = args.image.as_path();
    let reading = Reading {
        layer: args.layer.as_deref(),
        kept: MEASURED,
        own_mask: args.mask.is_none(),
        own_replicates: args.layer.is_none(),
        ..Reading::of(Purpose::Light)
    };
    let mut picture = Picture::read(path, &reading)?;
    say_notes(path, &picture.notes, true);
    let stored = stored(path, &picture)?;
    let luminance = args.luminance.map(Into::into).or(stored.luminance).unwrap_or_default();
    let view = args.view.or(stored.view).unwrap_or_default();
    say_view(view, say);
    ensure!(
        view == ViewTransform::Srgb || picture.colour.transfer == Transfer::Linear,
        "{}: --view {view}: the picture is already encoded for a display; a view needs light, as an EXR or HDR \
         has it",
        path.display()
    );
    let target = match (look, &stored.target) {
        (Some(look), _) => {
            look.into_target(luminance, picture.width.max(picture.height), args.matched.get())?
        }
        (None, Some(value)) => {
            Target::from_value(value).with_context(|| format!("{}: stored target", path.display()))?
        }
        (None, None) => bail!(
            "{}: the picture stores no target; name one with --target (high-key, low-key or a \
             TOML file)",
            path.display()
        ),
    };
    let mask = match (&args.mask, picture.mask.take()) {
        (Some(mask), _) => read_mask(mask)?,
        (None, Some(own)) => MaskImage::of_samples([picture.width, picture.height], &own),
        (None, None) => {
            bail!("{}: the picture stores no mask of the main object; give one with --mask", path.display())
        }
    };
    ensure!(
        (mask.width, mask.height) == (picture.width, picture.height),
        "{}: the mask has {} x {} pixels, the picture {} x {}; they must be of one size",
        args.mask.as_deref().unwrap_or(path).display(),
        mask.width,
        mask.height,
        picture.width,
        picture.height
    );
    let given = [args.target.is_some(), args.mask.is_some(), args.layer.is_some()];
    let shown_otherwise = args.exposure.is_some() || args.luminance.is_some() || args.view.is_some();
    let as_recorded = !given.contains(&true) && !shown_otherwise;
    Ok(Subject {
        picture,
        mask,
        exposure: args.exposure.or(stored.exposure).unwrap_or(1.0),
        measure: Measure { view, luminance, color: target.needs_color() },
        recorded: stored.f_q.filter(|_| as_recorded),
        target,
    })
}

fn stored(path: &Path, picture: &Picture) -> anyhow::Result<Stored> {
    let Some(value) = picture.our_attribute(path)? else {
        return Ok(Stored::default());
    };
    let what = || format!("{}: attribute `lightopt`", path.display());
    let stored = Stored::deserialize(value).with_context(what)?;
    if let Some(exposure) = stored.exposure {
        ensure!(exposure > 0.0, "{}: exposure must be above 0, got {exposure}", what());
    }
    Ok(stored)
}

fn measure(subject: &Subject, args: &EvaluateArgs) -> anyhow::Result<Measured> {
    let Subject { picture, measure, exposure, .. } = subject;
    let Picture { width, height, .. } = *picture;
    let n = picture.n_pixels();
    let rgb: Vec<[f32; 3]> = (0..n).map(|i| picture.over_black(i)).collect();
    let l = measure.encode_image(&rgb, *exposure);
    // Those of a picture that was seen through srgb have no colour, which other views need.
    let n_linear = measure.n_planes() * n;
    let with_planes = picture.replicates.iter().filter(|planes| planes.len() >= n_linear);
    let linear: Vec<Vec<f64>> =
        with_planes.map(|planes| planes[..n_linear].iter().map(|&v| f64::from(v)).collect()).collect();
    if let Some(i) = [&l].into_iter().chain(&linear).find_map(|l| l.iter().position(|l| l.is_nan())) {
        let (x, y) = (i % n % width, i % n / width);
        bail!("{}: the pixel at column {x}, row {y} is not a number", args.image.display());
    }
    // The picture has pixels, as many as the mask: what is wrong is what the mask marks.
    let mask = args.mask.as_ref().unwrap_or(&args.image);
    let weights = args.weights.as_deref().map(Weights::read).transpose()?;
    let objective =
        Weights::objective(weights.as_ref(), &subject.target, [width, height], &subject.mask.object)
            .with_context(|| mask.display().to_string())?;
    let plain = objective.evaluate(&l);
    if linear.is_empty() {
        return Ok(Measured { evaluation: plain, of_picture: None });
    }
    let replicates = Replicates { linear: &linear, measure: *measure, exposure: *exposure };
    let estimate = replicates.measure(&objective, LABELLINGS)?;
    let of_picture = OfPicture { error: estimate.error_bar(), f_q: plain.f_q };
    Ok(Measured { evaluation: estimate.evaluation, of_picture: Some(of_picture) })
}

fn to_json(subject: &Subject, Measured { evaluation, of_picture }: &Measured) -> Value {
    let mut value = json!({
        "f_q": evaluation.f_q,
        "terms": evaluation.terms_json(),
        "target": subject.target.name(),
        "exposure": subject.exposure,
        "luminance": subject.measure.luminance,
        "view": subject.measure.view,
    });
    if let Some(OfPicture { error, f_q }) = of_picture {
        value["f_q_error"] = json!(error);
        value["f_q_picture"] = json!(f_q);
    }
    if let Some(recorded) = subject.recorded {
        value["f_q_recorded"] = json!(recorded);
    }
    value
}

fn to_table(subject: &Subject, measured: &Measured, path: &Path) -> String {
    let Measured { evaluation, of_picture } = measured;
    let object = subject.mask.object.iter().filter(|&&o| o).count();
    let mut text = format!(
        "{}: {} x {} pixels, {:.1} % main object\ntarget {}, exposure {}, view {}, {} luminance\n\n",
        one_line(&path.to_string_lossy()),
        subject.picture.width,
        subject.picture.height,
        100.0 * object as f64 / subject.mask.object.len() as f64,
        subject.target.name(),
        subject.exposure,
        subject.measure.view,
        match subject.measure.luminance {
            LuminanceMode::Srgb => "sRGB-encoded",
            LuminanceMode::Linear => "linear",
        },
    );
    let wanted: Vec<String> = subject
        .target
        .goals()
        .map(|(_, goal)| match goal {
            Goal::Value(value) => format!("{value:.6}"),
            Goal::Signature(signature) => signature.name().to_owned(),
            Goal::Palette(palette) => palette.name().to_owned(),
        })
        .collect();
    let wide = wanted.iter().map(|w| w.chars().count()).fold(8, usize::max);
    // Writing to a String does not fail.
    let _ = writeln!(
        text,
        "{:<9} {:>8}  {:>wide$}  {:>8}  {:>6}  {:>10}",
        "term", "value", "target", "f", "weight", "weight * f"
    );
    for (t, target) in evaluation.terms().zip(&wanted) {
        let _ = writeln!(
            text,
            "{:<9} {:>8.6}  {target:>wide$}  {:>8.6}  {:>6.3}  {:>10.6}",
            t.term.name(),
            t.value,
            t.f,
            t.weight,
            t.contribution()
        );
    }
    let _ = writeln!(text, "f_q {:>1$.6}", evaluation.f_q, wide + 46);
    if let Some(OfPicture { error, f_q }) = of_picture {
        let _ = writeln!(
            text,
            "\nfrom {} replicates, freed of noise bias: ± {error:.6}\nf_q_picture {f_q:.6}, of the picture as it is",
            subject.picture.replicates.len()
        );
    }
    if let Some(recorded) = subject.recorded {
        let _ = writeln!(text, "\nrecorded in the file: f_q {recorded:.6}");
    }
    text
}
