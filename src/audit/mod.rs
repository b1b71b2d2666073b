//! The run directory: an auditable record of what was done and found.
//!
//! Its files, with the keys of the logs and of the manifest, are listed in `docs/formats.md`. All but
//! `timing.jsonl` are the same bytes for the same scene, options and seed. Pictures and TOML files appear
//! whole or not at all; a log grows by whole lines, so that a killed run leaves a readable one.

pub mod lights;
pub mod live;
pub mod picture;
pub mod placed;
pub mod products;
pub mod stored;
pub mod unfinished;

use std::{
    fs::{self, File, OpenOptions, TryLockError},
    io::{self, Write},
    path::{Path, PathBuf},
};

use rayon::prelude::*;
use serde_json::Value;

use crate::{
    files::{
        atomic::{AtomicWriteError, probe, temporary_of},
        toml_file::TomlError,
        write_atomically,
    },
    film::exr::{ExrImage, write_exr_plain},
};

/// Name of the manifest, the file that makes a directory a run directory.
pub const MANIFEST: &str = "run.toml";
/// Name of the sidecar that was made for a scene without one.
pub const STAGING: &str = "staging.toml";
/// Name of the plan of the set of lamps that the program placed.
pub const PLAN: &str = "plan.svg";
/// Stems of the names of the maps of where a lamp would help, at the start and with the lamps that were placed.
pub const MAPS: [&str; 2] = ["where-start", "where-found"];
/// Name of the table of surroundings that were compared.
pub const ENVIRONMENTS: &str = "environments.csv";
/// Name of the transport basis of a run.
pub const BASIS: &str = "transport.basis";
/// Name of the small copy of the basis, for the report.
pub const LIVE: &str = "live.basis";
/// Name of what a run has come to, as JSON.
pub const RESULT: &str = "result.json";
/// Name of the report, a page for browsers.
pub const REPORT: &str = "report.html";
/// Name of the sheet of the lightings to choose from.
pub const CONTACT: &str = "contact.png";
/// Name of the log of times.
pub const TIMING: &str = "timing.jsonl";
/// Lightings that a run offers at most, the best one included.
pub const MAX_PICKS: usize = 12;

/// Stem of the files of the n-th lighting that a run offers, from 1, which is the best one.
#[must_use]
pub fn pick_stem(n: usize) -> String {
    if n == 1 { "lights".into() } else { format!("lights-{n:02}") }
}

/// A run cannot be recorded.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum AuditError {
    #[error("{path}: a run is recorded here already; choose another --out, or replace it with --force", path = path.display())]
    Exists { path: PathBuf },
    #[error("{path}: not empty and not a run directory; choose another --out", path = path.display())]
    NotARun { path: PathBuf },
    #[error("{path}: another run is being recorded here; wait for it, or choose another --out", path = path.display())]
    Busy { path: PathBuf },
    #[error("{path}: what was begun here is not done; go on with --resume {path}, or replace it with --force", path = path.display())]
    Unfinished { path: PathBuf },
    #[error("{path}: nothing here is unfinished; --resume goes on with what was stopped or killed", path = path.display())]
    NothingUnfinished { path: PathBuf },
    #[error("{path}: cannot {action}", path = path.display())]
    Io { path: PathBuf, action: &'static str, source: io::Error },
    #[error("{path}: not a whole copy of a transport basis of this version", path = path.display())]
    Live { path: PathBuf },
    #[error(transparent)]
    Toml(#[from] TomlError),
    #[error(transparent)]
    Write(#[from] AtomicWriteError),
    #[error(transparent)]
    Exr(#[from] crate::film::exr::ExrError),
    #[error(transparent)]
    Image(#[from] crate::film::image_file::ImageFileError),
}

/// An open run directory.
#[derive(Debug)]
pub struct RunDir {
    path: PathBuf,
    evaluations: File,
    iterations: File,
    timing: File,
    n_iterations: usize,
    /// Held as long as the run is recorded: another one is refused.
    _lock: File,
}

impl RunDir {
    /// Checks that a run may be recorded at `path`, without touching it.
    ///
    /// # Errors
    /// When something is there that `force` does not allow to replace, another run is being recorded there,
    /// or nothing can be written there.
    pub fn check(path: &Path, force: bool) -> Result<(), AuditError> {
        Self::check_content(path, force)?;
        if path.is_dir() { lock(path, path).map(drop) } else { Ok(()) }
    }

    /// As [`Self::check`], whoever holds the lock.
    fn check_content(path: &Path, force: bool) -> Result<(), AuditError> {
        let is_empty = match fs::read_dir(path) {
            Err(source) if source.kind() == io::ErrorKind::NotFound => {
                let fail = |action, source| AuditError::Io { path: path.into(), action, source };
                if path.is_symlink() {
                    return Err(fail("follow the link", source));
                }
                let parent = path.ancestors().skip(1).find(|p| p.exists()).unwrap_or(Path::new(""));
                return probe(&parent.join(MANIFEST)).map_err(|e| fail("make the directory", e.source));
            }
            Err(source) => {
                return Err(AuditError::Io { path: path.into(), action: "read the directory", source });
            }
            Ok(entries) => entries.flatten().all(|entry| {
                // What whoever records a run has begun there, or left when it was killed.
                let name = entry.file_name();
                let name = name.to_string_lossy();
                name == unfinished::UNFINISHED || temporary_of(&name).is_some_and(is_ours)
            }),
        };
        let is_run = path.join(MANIFEST).exists();
        match (is_empty, is_run, force) {
            (true, _, _) | (_, true, true) => Ok(probe(&path.join(MANIFEST))?),
            (_, true, false) => Err(AuditError::Exists { path: path.into() }),
            _ => Err(AuditError::NotARun { path: path.into() }),
        }
    }

    /// Makes the directory, or empties it of an earlier run's files.
    ///
    /// # Errors
    /// As [`Self::check`], or when the directory cannot be written.
    pub fn create(path: &Path, force: bool, manifest: &str) -> Result<Self, AuditError> {
        Self::check_content(path, force)?;
        let fail = |action| move |source| AuditError::Io { path: path.into(), action, source };
        fs::create_dir_all(path).map_err(fail("make the directory"))?;
        let lock = lock(path, path)?;
        // Another run may have been recorded here since.
        Self::check_content(path, force)?;
        for entry in fs::read_dir(path).map_err(fail("read the directory"))? {
            let entry = entry.map_err(fail("read the directory"))?;
            let name = entry.file_name();
            // The manifest is replaced: without it this would be no run directory.
            if name != MANIFEST && is_ours(&name.to_string_lossy()) {
                fs::remove_file(entry.path()).map_err(fail("remove the earlier run"))?;
            }
        }
        write_whole(&path.join(MANIFEST), manifest)?;
        let log = |name: &str| {
            let path = path.join(name);
            OpenOptions::new().create(true).append(true).open(&path).map_err(|source| AuditError::Io {
                path,
                action: "open the log",
                source,
            })
        };
        Ok(Self {
            evaluations: log("evaluations.jsonl")?,
            iterations: log("iterations.jsonl")?,
            timing: log(TIMING)?,
            path: path.into(),
            n_iterations: 0,
            _lock: lock,
        })
    }

    /// Appends an evaluation.
    ///
    /// # Errors
    /// When the log cannot be written.
    pub fn log_evaluation(&mut self, line: &Value) -> Result<(), AuditError> {
        append(&mut self.evaluations, &self.path.join("evaluations.jsonl"), line)
    }

    /// Writes the starts of a search, a line each.
    ///
    /// # Errors
    /// When they cannot be written.
    pub fn log_starts(&self, lines: impl Iterator<Item = Value>) -> Result<(), AuditError> {
        let text: String = lines.map(|l| format!("{l}\n")).collect();
        write_whole(&self.path.join("starts.jsonl"), text)
    }

    /// Appends a timing.
    ///
    /// # Errors
    /// When the log cannot be written.
    pub fn log_timing(&mut self, line: &Value) -> Result<(), AuditError> {
        append(&mut self.timing, &self.path.join(TIMING), line)
    }

    /// Records evaluations that improved on the best so far, each with its picture;
    /// the pictures are written in parallel.
    ///
    /// # Errors
    /// When a picture or the log cannot be written.
    pub fn log_iterations(&mut self, iterations: &[(Value, ExrImage)]) -> Result<(), AuditError> {
        let first = self.n_iterations;
        iterations.par_iter().enumerate().try_for_each(|(i, (_, picture))| {
            write_exr_plain(&self.path.join(format!("iter_{:04}.exr", first + i)), picture)
        })?;
        self.n_iterations += iterations.len();
        let path = self.path.join("iterations.jsonl");
        iterations.iter().try_for_each(|(line, _)| append(&mut self.iterations, &path, line))
    }
}

/// Takes the lock of a directory, which ends with the process: the directory itself is locked, so that
/// nothing is left behind. The user knows it as `shown`.
fn lock(directory: &Path, shown: &Path) -> Result<File, AuditError> {
    let fail = |source| AuditError::Io { path: directory.into(), action: "lock the directory", source };
    let file = File::open(directory).map_err(fail)?;
    match file.try_lock() {
        Ok(()) => Ok(file),
        Err(TryLockError::WouldBlock) => Err(AuditError::Busy { path: shown.into() }),
        Err(TryLockError::Error(source)) => Err(fail(source)),
    }
}

/// Whether a file name is one that a run writes, or left when it was killed.
fn is_ours(name: &str) -> bool {
    if let Some(destination) = temporary_of(name) {
        return is_ours(destination);
    }
    const NAMES: [&str; 20] = [
        MANIFEST,
        STAGING,
        BASIS,
        LIVE,
        RESULT,
        REPORT,
        CONTACT,
        "evaluations.jsonl",
        "iterations.jsonl",
        TIMING,
        "starts.jsonl",
        "initial.exr",
        "initial.png",
        "final.exr",
        "final.png",
        "found.png",
        "lights.toml",
        PLAN,
        "plan.png",
        ENVIRONMENTS,
    ];
    let iteration = name.strip_prefix("iter_").and_then(|n| n.strip_suffix(".exr"));
    let stem = name.strip_suffix(".toml").or(name.strip_suffix(".png"));
    let map = MAPS.iter().find_map(|stem| name.strip_prefix(stem));
    NAMES.contains(&name)
        || map.is_some_and(|ending| [".png", ".csv", ".exr"].contains(&ending))
        || iteration.is_some_and(|n| !n.is_empty() && n.bytes().all(|b| b.is_ascii_digit()))
        || stem.is_some_and(|stem| (2..=MAX_PICKS).any(|n| stem == pick_stem(n)))
}

/// Appends a line to a log, whole or not at all.
fn append(file: &mut File, path: &Path, line: &Value) -> Result<(), AuditError> {
    let fail = |source| AuditError::Io { path: path.into(), action: "append to the log", source };
    let length = file.metadata().map_err(fail)?.len();
    // One write, which a kill does not halve; a disk that fills up does.
    file.write_all(format!("{line}\n").as_bytes()).map_err(|source| {
        // The first error is the one to report.
        let _ = file.set_len(length);
        fail(source)
    })
}

/// Writes a file, whole or not at all.
///
/// # Errors
/// When the destination is impossible.
pub fn write_whole(path: &Path, content: impl AsRef<[u8]>) -> Result<(), AuditError> {
    write_atomically(path, |file| {
        file.write_all(content.as_ref()).map_err(|source| AuditError::Io {
            path: path.into(),
            action: "write the file",
            source,
        })
    })
}
