//! `classify`: the signatures that pictures are nearest to.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::{Value, json};

use super::common::say_notes;
use super::output::{one_line, print, print_json};
use crate::objective::LuminanceMode;
use crate::objective::histogram::{Cumulated, f_hist};
use crate::objective::signature::library::{LONGEST_SIDE, Library};
use crate::objective::signature::{BUILTIN, Signature};
use crate::photo::Photo;

/// Tell which signature pictures are nearest to
///
/// The distance is f_hist, that of a picture's cumulated brightness histogram to the signature:
/// 0 is equality, 1 about the worst. The margin is how much farther the second nearest is; a small
/// one means that the picture could be either.
///
/// Without --signatures the picture is held against the built-in ones: high, low, high-photo and
/// medium. These are formulas (mixtures of Beta distributions), not learned from photographs;
/// `learn-signature` learns your own.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    lightopt-embree classify photo.jpg\n  \
    lightopt-embree classify --signatures styles.toml --json runs/*/final.png\n\n\
    Pictures are turned upright and reduced to the size the signatures were learned at (512\n\
    pixels for the built-in ones); an EXR of this program brings its exposure.")]
pub struct ClassifyArgs {
    /// Pictures: JPEG, PNG, TIFF, WebP, BMP, TGA (sRGB), EXR, HDR (linear)
    #[arg(value_name = "IMAGE", required = true)]
    pub images: Vec<PathBuf>,

    /// Signature library, as `learn-signature` writes it [default: the built-in signatures]
    #[arg(long, value_name = "FILE")]
    pub signatures: Option<PathBuf>,

    /// Layer of EXRs that have several [default: the one that is the picture, by its name]
    #[arg(long, value_name = "NAME")]
    pub layer: Option<String>,

    /// Print a JSON list, an object for each picture, in full precision instead of a table
    #[arg(long)]
    pub json: bool,
}

/// Distances of a picture to all signatures.
struct Verdict<'a> {
    /// Path of the picture.
    image: &'a Path,
    /// Name and distance of each signature, nearest first.
    distances: Vec<(&'a str, f64)>,
}

impl Verdict<'_> {
    /// Distance of the second signature minus that of the first; `None` with a single one.
    fn margin(&self) -> Option<f64> {
        Some(self.distances.get(1)?.1 - self.distances[0].1)
    }
}

/// Runs the subcommand.
///
/// # Errors
/// When a picture or the library cannot be read.
pub fn classify(args: &ClassifyArgs) -> anyhow::Result<()> {
    let (signatures, longest) = signatures(args.signatures.as_deref())?;
    let known: Vec<(&str, Cumulated)> = signatures.iter().map(|s| (s.name(), s.cumulated())).collect();
    let mut verdicts = Vec::new();
    for image in &args.images {
        let photo = Photo::read(image, None, args.layer.as_deref())?;
        say_notes(image, photo.notes(), true);
        let q = photo.reduced(longest).cumulated(LuminanceMode::Srgb);
        let mut distances: Vec<(&str, f64)> = known.iter().map(|(name, p)| (*name, f_hist(p, &q))).collect();
        distances.sort_by(|a, b| a.1.total_cmp(&b.1));
        verdicts.push(Verdict { image, distances });
    }
    if args.json {
        let list: Value = verdicts.iter().map(to_json).collect();
        print_json(&list)
    } else {
        print(&to_table(&verdicts))
    }
}

/// Signatures asked for, with the longest side of the pictures from which they were learned, pixels.
fn signatures(path: Option<&Path>) -> anyhow::Result<(Vec<Signature>, usize)> {
    Ok(match path {
        None => (BUILTIN.into_iter().filter_map(Signature::builtin).collect(), LONGEST_SIDE as usize),
        Some(path) => {
            let library = Library::read(path)?;
            (library.signatures(path)?, library.longest_side as usize)
        }
    })
}

fn to_json(verdict: &Verdict) -> Value {
    let distances = verdict.distances.iter().map(|(name, d)| json!({ "signature": name, "distance": d }));
    json!({
        "image": verdict.image,
        "nearest": verdict.distances.first().map(|(name, _)| name),
        "margin": verdict.margin(),
        "distances": distances.collect::<Value>(),
    })
}

fn to_table(verdicts: &[Verdict]) -> String {
    let mut text = String::new();
    for verdict in verdicts {
        // Writing to a String does not fail.
        let _ = write!(text, "{}:", one_line(&verdict.image.to_string_lossy()));
        for (name, distance) in &verdict.distances {
            let _ = write!(text, "  {name} {distance:.4}");
        }
        let margin = verdict.margin().map(|m| format!("  margin {m:.4}")).unwrap_or_default();
        let _ = writeln!(text, "{margin}");
    }
    text
}
