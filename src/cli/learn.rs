//! `learn-signature`: signatures, and whole looks, from folders of photographs.

mod report;

use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};
use clap::Args;
use rayon::prelude::*;

use super::{
    common::{MatchArgs, in_pool, say_note},
    output::{print, print_json},
    resume,
};
use crate::audit::products::Products;
use crate::audit::unfinished::{Unfinished, beside};
use crate::audit::write_whole;
use crate::files::atomic::probe;
use crate::objective::palette::Palette;
use crate::objective::signature::library::{
    Class, LONGEST_SIDE, Library, Method, PhotoRecord, is_class_name,
};
use crate::objective::signature::{Shape, Signature};
use crate::objective::target::DEFAULT_WEIGHTS;
use crate::objective::{LuminanceMode, Target};
use crate::photo::folder::{Listing, list, masks, sha256};
use crate::photo::learn::{Learned, Measured, confusion, learn};
use crate::photo::{Matched, Photo, PhotoError};
use crate::picture::Note;

/// Learn signatures of looks from folders of photographs
///
/// A signature is the cumulated histogram of brightness that a look has: the mean of those of
/// its photographs (--barycentre: their Wasserstein barycentre, the mean of the quantile
/// functions, which keeps peaks sharp where the mean keeps all of them). Every photograph is
/// turned upright, decoded to linear light, reduced by a box filter to at most --longest-side
/// pixels, and measured as a display shows it.
///
/// How well the signatures tell the looks apart is shown by leaving each photograph out of its
/// own class and seeing which signature is nearest to it. A photograph is called an outlier when
/// it is farther from the rest of its class than the median of the class's photographs by more
/// than 3 * 1.4826 times their median absolute deviation. Outliers are reported, not left out.
///
/// With --masks the main object of every photograph is known too, and the folder becomes a whole
/// look: means and standard deviations of object and background and the object's gradient,
/// averaged over the photographs, in a target file for each class.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    lightopt-embree learn-signature --class high=photos/high --class low=photos/low -o styles.toml\n  \
    lightopt-embree classify --signatures styles.toml photo.jpg\n  \
    lightopt-embree run --target styles.toml#high fruit_basket.obj\n\n\
    With --masks, beside styles.toml also styles-high.toml and styles-low.toml are written:\n  \
    lightopt-embree run --target styles-high.toml fruit_basket.obj\n\n\
    The gradient depends on the size of the pictures: learn with --longest-side 128, the width at\n\
    which `run` optimises by default, for targets whose gradient counts.\n\
    In a target file, signature = \"styles.toml#high\" uses the signature with values of your own.")]
pub struct LearnArgs {
    /// A look and the folder of its photographs (JPEG, PNG, TIFF, EXR and others; sub-folders are
    /// not searched, and files that are no pictures are left out)
    #[arg(long = "class", value_name = "NAME=DIR", required_unless_present = "resume", value_parser = parse_class)]
    pub classes: Vec<(String, PathBuf)>,

    /// Folder of masks, white on the main object: for DIR/a.jpg the picture a.png (or another
    /// ending), of its size
    #[arg(long, value_name = "DIR")]
    pub masks: Option<PathBuf>,

    /// What of a photograph is matched.
    #[command(flatten)]
    pub matched: MatchArgs,

    /// Wasserstein barycentre of the histograms instead of their mean
    #[arg(long)]
    pub barycentre: bool,

    /// Longest side to which larger photographs are reduced, pixels
    #[arg(long, value_name = "PIXELS", default_value_t = LONGEST_SIDE, value_parser = clap::value_parser!(u32).range(1..=65_536))]
    pub longest_side: u32,

    /// Signature library to write
    #[arg(short, long, value_name = "FILE.toml", required_unless_present = "resume")]
    pub output: Option<PathBuf>,

    /// Go on with learning that was stopped or killed: FILE.toml is its --output, and its options are
    /// those with which it was begun, so that none can be given
    #[arg(long, value_name = "FILE.toml", exclusive = true)]
    pub resume: Option<PathBuf>,

    /// Print one JSON object in full precision instead of tables
    #[arg(long)]
    pub json: bool,

    /// Threads [default: all processors]; does not change the result. Each takes about 4 bytes
    /// of memory for each pixel of a photograph of 8 bits a channel, 10 of a progressive JPEG
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub threads: Option<u16>,
}

impl LearnArgs {
    /// Path of the signature library.
    fn output(&self) -> &Path {
        // Without --resume there is one.
        self.output.as_deref().unwrap_or(Path::new(""))
    }
}

/// Parses `NAME=DIR`.
fn parse_class(text: &str) -> Result<(String, PathBuf), String> {
    match text.split_once('=') {
        Some((name, folder)) if is_class_name(name) && !folder.is_empty() => {
            Ok((name.to_owned(), PathBuf::from(folder)))
        }
        _ => Err("must be NAME=DIR, with letters, digits, - and _ in the name".to_owned()),
    }
}

/// The photographs of a class.
struct Folder {
    name: String,
    photos: Vec<PathBuf>,
    masks: Option<Vec<PathBuf>>,
    /// What was passed over, for people.
    note: Option<String>,
}

/// All that is told about a class.
struct Outcome {
    class: Class,
    learned: Learned,
    /// File and target, when there are masks.
    target: Option<(PathBuf, Target)>,
}

/// Runs the subcommand.
///
/// # Errors
/// When a mask is missing or wrong, no photograph of a class can be read, or a file cannot be
/// written.
pub fn learn_signature(args: &LearnArgs) -> anyhow::Result<()> {
    let Some(place) = &args.resume else {
        check_output(args)?;
        let unfinished = resume::begin("learn-signature", args.output(), &beside(args.output()), true)?;
        return learn_all(args, args.output(), unfinished);
    };
    let (unfinished, args) =
        resume::take_up("learn-signature", place, &beside(place), |args: &LearnArgs| {
            Ok(beside(args.output()))
        })?;
    check_output(&args)?;
    learn_all(&args, place, unfinished)
}

/// Learns what `args` say and prints it; whoever would go on with it knows the library as `place`.
fn learn_all(args: &LearnArgs, place: &Path, unfinished: Unfinished) -> anyhow::Result<()> {
    let products = Products::new(Some(unfinished.products()));
    let result = learn_kept(args, &products);
    resume::end(unfinished, "learn-signature", place, result)
}

/// Learns what `args` say, with what an earlier attempt has measured, and prints it.
fn learn_kept(args: &LearnArgs, products: &Products) -> anyhow::Result<()> {
    let folders = folders(args)?;
    let gathered: Vec<Gathered> =
        in_pool(args.threads, || folders.iter().map(|f| gather(args, f, products)).collect())?;
    let mut notes: Vec<String> = folders.iter().filter_map(|f| f.note.clone()).collect();
    notes.extend(gathered.iter().flat_map(|g| g.notes.clone()));
    let (records, measured): (Vec<_>, Vec<_>) = gathered.into_iter().map(|g| (g.records, g.measured)).unzip();
    let learned = learn(&measured, method(args));
    let outcomes: Vec<Outcome> = folders
        .iter()
        .zip(records)
        .zip(learned)
        .map(|((folder, records), learned)| outcome(args, folder, records, learned))
        .collect::<anyhow::Result<_>>()?;
    write(args, &outcomes)?;
    notes.extend(report::notes(&outcomes));
    notes.iter().for_each(|note| say_note(note));
    let learned: Vec<Learned> = outcomes.iter().map(|o| o.learned.clone()).collect();
    let confusion = confusion(&learned);
    if args.json {
        print_json(&report::to_json(args, &outcomes, &confusion, &notes))
    } else {
        print(&report::to_table(args, &outcomes, &confusion))
    }
}

fn method(args: &LearnArgs) -> Method {
    if args.barycentre { Method::Barycentre } else { Method::Mean }
}

fn folders(args: &LearnArgs) -> anyhow::Result<Vec<Folder>> {
    let mut folders: Vec<Folder> = Vec::new();
    for (name, folder) in &args.classes {
        ensure!(folders.iter().all(|f| f.name != *name), "--class: two classes are called `{name}`");
        let Listing { pictures, others } = list(folder)?;
        let note = report::passed_over(folder, &others);
        folders.push(Folder { name: name.clone(), photos: pictures, masks: None, note });
    }
    if let Some(directory) = &args.masks {
        let all: Vec<PathBuf> = folders.iter().flat_map(|f| f.photos.clone()).collect();
        let mut found = masks(directory, &all)?.into_iter();
        for folder in &mut folders {
            folder.masks = Some(found.by_ref().take(folder.photos.len()).collect());
        }
    }
    Ok(folders)
}

/// Beside `styles.toml` the target of class `high` is `styles-high.toml`.
fn target_path(output: &Path, class: &str) -> PathBuf {
    let stem = output.file_stem().unwrap_or_default().to_string_lossy();
    output.with_file_name(format!("{stem}-{class}.toml"))
}

fn check_output(args: &LearnArgs) -> anyhow::Result<()> {
    if !args.output().extension().is_some_and(|e| e.eq_ignore_ascii_case("toml")) {
        bail!("{}: the signature library ends in .toml", args.output().display());
    }
    probe(args.output())?;
    for (name, _) in args.classes.iter().filter(|_| args.masks.is_some()) {
        probe(&target_path(args.output(), name))?;
    }
    Ok(())
}

/// The photographs of a class that could be read.
struct Gathered {
    records: Vec<PhotoRecord>,
    measured: Vec<Measured>,
    /// What was left out, and what people should hear of the others.
    notes: Vec<String>,
}

/// What became of a photograph.
enum Outlook {
    Read(Box<(PhotoRecord, Measured, Vec<Note>)>),
    /// It is no picture, or a broken one.
    LeftOut(PhotoError),
}

/// Measures every photograph of a class. What is no picture is left out; the first in order whose
/// mask does not fit is what is reported.
fn gather(args: &LearnArgs, folder: &Folder, products: &Products) -> anyhow::Result<Gathered> {
    let mask = |i: usize| folder.masks.as_ref().map(|masks| masks[i].as_path());
    let each = folder.photos.par_iter().enumerate();
    let done: Vec<anyhow::Result<Outlook>> =
        each.map(|(i, path)| measure_once(path, mask(i), args.longest_side, products)).collect();
    let mut gathered = Gathered { records: Vec::new(), measured: Vec::new(), notes: Vec::new() };
    let mut kinds: Vec<(Note, &Path, usize)> = Vec::new();
    for (path, outlook) in folder.photos.iter().zip(done) {
        match outlook? {
            Outlook::LeftOut(error) => {
                gathered.notes.push(format!("{:#}; left out", anyhow::Error::from(error)));
            }
            Outlook::Read(read) => {
                let (record, measured, notes) = *read;
                gathered.records.push(record);
                gathered.measured.push(measured);
                for note in notes {
                    let same = |(n, ..): &&mut (Note, &Path, usize)| {
                        std::mem::discriminant(n) == std::mem::discriminant(&note)
                    };
                    match kinds.iter_mut().find(same) {
                        Some((.., more)) => *more += 1,
                        None => kinds.push((note, path, 0)),
                    }
                }
            }
        }
    }
    gathered.notes.extend(kinds.into_iter().map(|(note, path, more)| match more {
        0 => format!("{}: {note}", path.display()),
        n => format!("{}: {note}; so it is with {n} more of the class", path.display()),
    }));
    if gathered.records.is_empty() {
        let first = gathered.notes.first().map_or("", String::as_str);
        bail!("class `{}`: none of its pictures can be read: {first}", folder.name);
    }
    Ok(gathered)
}

/// Kind of the product that is what was measured of a photograph.
const KIND: &str = "photo-2";

/// What a file is known by without reading it: path, length and time of its last change.
fn known_by(path: &Path) -> String {
    let facts = std::fs::metadata(path).map(|file| (file.len(), file.modified().ok())).ok();
    format!("{path:?} {facts:?}")
}

/// Measures a photograph, or takes what an earlier attempt has measured. Of what there is something to say
/// nothing is kept, so that it is said again.
fn measure_once(
    path: &Path,
    mask: Option<&Path>,
    longest: u32,
    products: &Products,
) -> anyhow::Result<Outlook> {
    let key = Products::key(&format!("{} {:?} {longest}", known_by(path), mask.map(known_by)), &[]);
    let kept = products.load(key, KIND).and_then(|bytes| serde_json::from_slice(&bytes).ok());
    if let Some((sha256, cumulated, palette, values)) = kept
        && let Ok(cumulated) = Vec::<f64>::try_into(cumulated)
    {
        let file = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let record = PhotoRecord { file, sha256 };
        return Ok(Outlook::Read(Box::new((record, Measured { cumulated, palette, values }, Vec::new()))));
    }
    let outlook = measure_one(path, mask, longest as usize)?;
    if let Outlook::Read(read) = &outlook
        && read.2.is_empty()
    {
        let content = (&read.0.sha256, read.1.cumulated.as_slice(), &read.1.palette, read.1.values);
        products.save(key, KIND, say_note, |out| Ok(serde_json::to_writer(out, &content)?));
    }
    Ok(outlook)
}

fn measure_one(path: &Path, mask: Option<&Path>, longest: usize) -> anyhow::Result<Outlook> {
    let photo = match Photo::read(path, mask, None) {
        Err(error @ (PhotoError::File(_) | PhotoError::NotANumber { .. })) => {
            return Ok(Outlook::LeftOut(error));
        }
        other => other?,
    };
    let reduced = photo.reduced(longest);
    // An EXR may bring a mask of its own; whole looks need one of every photograph.
    let measured = match mask {
        None => {
            let z = reduced.measure_whole(LuminanceMode::Srgb);
            Measured { cumulated: z.cumulated(), palette: z.palette(), values: None }
        }
        Some(_) => {
            let z = reduced.measure(LuminanceMode::Srgb)?;
            Measured { cumulated: z.cumulated(), palette: z.palette(), values: Some(z.values_with_color()) }
        }
    };
    let file = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let record = PhotoRecord { file, sha256: sha256(path)? };
    Ok(Outlook::Read(Box::new((record, measured, photo.notes().to_vec()))))
}

fn outcome(
    args: &LearnArgs,
    folder: &Folder,
    photos: Vec<PhotoRecord>,
    learned: Learned,
) -> anyhow::Result<Outcome> {
    let outliers = photos.iter().zip(&learned.photos).filter(|(_, judged)| judged.outlier);
    let class = Class {
        name: folder.name.clone(),
        method: method(args),
        count: photos.len(),
        outliers: outliers.map(|(record, _)| record.file.clone()).collect(),
        cumulated: learned.signature.to_vec(),
        palette: learned.palette.clone(),
        photos,
    };
    let target = match learned.values {
        None => None,
        Some(values) => {
            let path = target_path(args.output(), &class.name);
            let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            let signature = Signature::new(&class.name, Shape::Cumulated(class.cumulated.clone()))
                .with_context(|| format!("class `{}`", class.name))?;
            let palette = Palette::new(&class.name, class.palette.clone())
                .with_context(|| format!("class `{}`", class.name))?;
            let plain = Target::new(name, &values, DEFAULT_WEIGHTS, signature);
            let target = if args.matched.get() == Matched::Colour {
                plain.with_palette(palette)
            } else {
                plain.without_color()
            };
            Some((path, target))
        }
    };
    Ok(Outcome { class, learned, target })
}

fn write(args: &LearnArgs, outcomes: &[Outcome]) -> anyhow::Result<()> {
    let classes = outcomes.iter().map(|o| o.class.clone()).collect();
    write_whole(args.output(), Library::new(args.longest_side, classes).to_toml()?)?;
    for Outcome { class, target, .. } in outcomes {
        if let Some((path, target)) = target {
            let head = format!(
                "# Learned from {} photographs with masks, reduced to at most {} pixels a side (on which\n\
                 # t_grad depends); display luminance, 0 to 1. Their names are in the signature library.\n\n",
                class.count, args.longest_side
            );
            write_whole(path, head + &target.to_toml()?)?;
        }
    }
    Ok(())
}
