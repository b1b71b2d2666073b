//! The report of a run: one page that shows what was found, and in which its lights can be moved.
//!
//! A page is made of what stands in the run directory alone, so that it can be made again. It has everything in
//! it (styles, scripts, pictures, a [small copy](crate::transport::compact) of the transport basis) and asks
//! nothing of a network; it forbids itself to. Its scripts are plain JavaScript on typed arrays: a picture of
//! 128 × 96 pixels under twelve lights takes some milliseconds, so that neither WebGL nor a framework is needed.

pub mod compare;
mod gather;
mod html;
mod pdf;
mod picture;
pub mod plot;

use std::{
    fs, io,
    path::{Path, PathBuf},
};

use crate::{
    audit::{AuditError, LIVE, MANIFEST, REPORT, RESULT, live::Live, write_whole},
    film::exr::ExrError,
    objective::target::TargetError,
};

pub use picture::contact_sheet;

/// A report cannot be made.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum ReportError {
    #[error("{path}: no run directory, and none of its folders is one", path = path.display())]
    NoRun { path: PathBuf },
    #[error("{path}: cannot read the record", path = path.display())]
    Read { path: PathBuf, source: io::Error },
    #[error("{path}: not as `run` writes it: {message}", path = path.display())]
    Record { path: PathBuf, message: String },
    #[error("{path}: no `result.json`: the lights are not found yet, or an earlier version made the run", path = path.display())]
    Unfinished { path: PathBuf },
    #[error(transparent)]
    Target(#[from] TargetError),
    #[error(transparent)]
    Audit(#[from] AuditError),
    #[error(transparent)]
    Exr(#[from] ExrError),
    #[error("{path}: cannot show the picture", path = path.display())]
    Picture { path: PathBuf, source: image::ImageError },
    #[error("cannot draw the sheet of lightings")]
    Figure(#[from] crate::canvas::FigureError),
    #[error("cannot draw the plot: {0}")]
    Draw(String),
    #[error("{path}: no `{name}` there, which this plot is made from", path = path.display())]
    Missing { path: PathBuf, name: &'static str },
    #[error(transparent)]
    Objective(#[from] crate::objective::ObjectiveError),
    #[error("cannot pack what the page shows")]
    Pack(#[source] io::Error),
}

/// Writes the report of a run directory, or of a directory that holds several, and returns its path; with
/// `running` the page loads itself anew, since more is to come.
///
/// # Errors
/// When the directory holds no run, a file of it cannot be read, or the page cannot be written.
pub fn write(directory: &Path, running: bool) -> Result<PathBuf, ReportError> {
    let mut runs = runs(directory)?;
    if runs.len() > 1 {
        // Looks whose lights are still sought come later.
        runs.retain(|run| run.join(RESULT).is_file());
    }
    let mut looks = Vec::new();
    let mut bases: Vec<(PathBuf, Live)> = Vec::new();
    for run in &runs {
        let mut basis = None;
        if let Some(path) = live(run) {
            let known = bases.iter().position(|(other, _)| *other == path);
            if known.is_none() {
                bases.push((path.clone(), Live::load(&path)?));
            }
            basis = Some(known.unwrap_or(bases.len() - 1));
        }
        let about = basis.map(|basis| &bases[basis].1.facts.about);
        looks.push(gather::Look { basis, ..gather::look(run, about)? });
    }
    let bases: Vec<Live> = bases.into_iter().map(|(_, live)| live).collect();
    let page = html::page(&looks, &bases, running)?;
    let path = directory.join(REPORT);
    write_whole(&path, page)?;
    Ok(path)
}

/// Directories of the runs that are shown together: the directory itself, or the folders in it, in the order in
/// which their looks were asked for.
///
/// # Errors
/// When there are none.
pub fn runs(directory: &Path) -> Result<Vec<PathBuf>, ReportError> {
    if directory.join(MANIFEST).is_file() {
        return Ok(vec![directory.into()]);
    }
    let entries =
        fs::read_dir(directory).map_err(|source| ReportError::Read { path: directory.into(), source })?;
    let mut runs: Vec<PathBuf> =
        entries.flatten().map(|e| e.path()).filter(|p| p.join(MANIFEST).is_file()).collect();
    runs.sort();
    let Some(first) = runs.first() else {
        return Err(ReportError::NoRun { path: directory.into() });
    };
    let mut asked = gather::targets(first)?;
    if asked.is_empty() {
        // Looks with lamps of their own are recorded one by one.
        asked = gather::asked(first)?;
    }
    let place = |run: &PathBuf| {
        let name = run.file_name().map(|n| n.to_string_lossy().into_owned());
        asked.iter().position(|look| Some(look) == name.as_ref()).unwrap_or(usize::MAX)
    };
    runs.sort_by_key(place);
    Ok(runs)
}

/// The small copy of the basis of a run: in its directory, or beside those of the looks that were found with it.
fn live(run: &Path) -> Option<PathBuf> {
    let run = run.canonicalize().ok()?;
    let beside = gather::targets(&run).is_ok_and(|looks| looks.len() > 1);
    let places = [Some(run.as_path()), run.parent().filter(|_| beside)];
    places.into_iter().flatten().map(|d| d.join(LIVE)).find(|path| path.is_file())
}
