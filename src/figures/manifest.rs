//! `manifest.json`: version, options, and the SHA-256 of every file.

use std::{
    collections::BTreeMap,
    fs, io,
    path::{Path, PathBuf},
};

use serde::{Deserialize, Serialize};
use serde_json::Value;
use sha2::{Digest, Sha256};

use super::Part;
use crate::{audit::unfinished::UNFINISHED, files::atomic::temporary_of};

/// Name of the manifest, the file that makes a directory one of figures.
pub const MANIFEST: &str = "manifest.json";
/// Name of the table of seconds, the only file of the figures that differs between equal runs.
pub const TIMINGS: &str = "timings.csv";
/// Name of the log of seconds in a run directory.
const RUN_TIMINGS: &str = "timing.jsonl";

/// Contents of the manifest: program, options and files of a set of figures.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Manifest {
    /// Version of the program.
    pub version: String,
    /// Commit from which the program was built.
    pub commit: String,
    /// Version of Embree.
    pub embree: String,
    /// Seed of all runs.
    pub seed: u64,
    /// Parts that were asked for.
    pub parts: Vec<Part>,
    /// Sizes, samples and other options.
    pub options: Value,
    /// Whether all parts were made: false while the work goes on, and after an interrupt.
    pub complete: bool,
    /// SHA-256 of each file, by its path below the directory.
    pub files: BTreeMap<String, String>,
    /// Paths of the files that hold seconds, which differ from one run to the next.
    pub timings: Vec<String>,
}

/// A directory of figures cannot be read or cleared.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum ManifestError {
    #[error("{path}: cannot {action}", path = path.display())]
    Io { path: PathBuf, action: &'static str, source: io::Error },
    #[error("{path}: figures are here already; choose another --out, or replace them with --force", path = path.display())]
    Exists { path: PathBuf },
    #[error("{path}: not empty and no directory of figures; choose another --out", path = path.display())]
    NotFigures { path: PathBuf },
}

fn fail(path: &Path, action: &'static str) -> impl FnOnce(io::Error) -> ManifestError + use<> {
    let path = path.to_path_buf();
    move |source| ManifestError::Io { path, action, source }
}

/// Checks that figures may be made at `path`, without touching it.
///
/// # Errors
/// When something is there that `force` does not allow to replace.
pub fn check(path: &Path, force: bool) -> Result<(), ManifestError> {
    let is_empty = match fs::read_dir(path) {
        Err(e) if e.kind() == io::ErrorKind::NotFound => true,
        Err(source) => return Err(fail(path, "read the directory")(source)),
        Ok(entries) => entries.flatten().all(|e| {
            // What whoever makes figures has begun there, or left when it was killed.
            let name = e.file_name();
            name == UNFINISHED || temporary_of(&name.to_string_lossy()) == Some(MANIFEST)
        }),
    };
    match (is_empty, path.join(MANIFEST).exists(), force) {
        (true, ..) | (_, true, true) => Ok(()),
        (_, true, false) => Err(ManifestError::Exists { path: path.into() }),
        _ => Err(ManifestError::NotFigures { path: path.into() }),
    }
}

/// Removes the files that the manifest of a directory lists, and nothing else.
///
/// # Errors
/// When one cannot be removed.
pub fn clear(directory: &Path) -> Result<(), ManifestError> {
    let Ok(text) = fs::read(directory.join(MANIFEST)) else { return Ok(()) };
    let Ok(earlier) = serde_json::from_slice::<Manifest>(&text) else { return Ok(()) };
    for name in earlier.files.keys().chain(&earlier.timings) {
        let relative = Path::new(name);
        // A manifest that was meddled with must not reach beyond its directory.
        if !relative.components().all(|c| matches!(c, std::path::Component::Normal(_))) {
            continue;
        }
        let path = directory.join(relative);
        match fs::remove_file(&path) {
            Err(e) if e.kind() != io::ErrorKind::NotFound => {
                return Err(fail(&path, "remove the earlier figure")(e));
            }
            _ => {}
        }
    }
    Ok(())
}

impl Manifest {
    /// Adds the file `name` below `directory`, or all files of the directory of that name.
    ///
    /// # Errors
    /// When one cannot be read.
    pub fn add(&mut self, directory: &Path, name: &str) -> Result<(), ManifestError> {
        let path = directory.join(name);
        if path.is_dir() {
            let entries = fs::read_dir(&path).map_err(fail(&path, "read the directory"))?;
            for entry in entries {
                let entry = entry.map_err(fail(&path, "read the directory"))?;
                self.add(directory, &format!("{name}/{}", entry.file_name().to_string_lossy()))?;
            }
        } else if name == TIMINGS || name.rsplit('/').next() == Some(RUN_TIMINGS) {
            self.timings.push(name.to_owned());
            self.timings.sort();
        } else {
            let bytes = fs::read(&path).map_err(fail(&path, "read the file"))?;
            let hash = Sha256::digest(&bytes).iter().map(|b| format!("{b:02x}")).collect();
            self.files.insert(name.to_owned(), hash);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn manifest() -> Manifest {
        Manifest {
            version: "1".to_owned(),
            commit: String::new(),
            embree: String::new(),
            seed: 0,
            parts: vec![Part::Fig2],
            options: Value::Null,
            complete: false,
            files: BTreeMap::new(),
            timings: Vec::new(),
        }
    }

    #[test]
    fn files_are_hashed_and_seconds_are_listed_apart() {
        let directory = tempfile::tempdir().unwrap();
        fs::create_dir(directory.path().join("a")).unwrap();
        for name in ["a/x", "a/timing.jsonl", "timings.csv"] {
            fs::write(directory.path().join(name), "abc").unwrap();
        }
        let mut m = manifest();
        m.add(directory.path(), "a").unwrap();
        m.add(directory.path(), TIMINGS).unwrap();
        assert_eq!(m.timings, ["a/timing.jsonl", "timings.csv"]);
        let abc = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(m.files.into_iter().collect::<Vec<_>>(), [("a/x".to_owned(), abc.to_owned())]);
    }

    #[test]
    fn only_what_a_manifest_lists_is_removed_and_nothing_outside() {
        let root = tempfile::tempdir().unwrap();
        let figures = root.path().join("figures");
        fs::create_dir(&figures).unwrap();
        // Of a killed process.
        fs::write(figures.join(".manifest.json.4194304-0.tmp"), "half").unwrap();
        assert!(check(&figures, false).is_ok());
        for name in ["mine", "figures/fig2.png", "figures/notes.txt"] {
            fs::write(root.path().join(name), "").unwrap();
        }
        assert!(matches!(check(&figures, true), Err(ManifestError::NotFigures { .. })));
        let mut m = manifest();
        for name in ["fig2.png", "../mine", "gone.png"] {
            m.files.insert(name.to_owned(), String::new());
        }
        fs::write(figures.join(MANIFEST), serde_json::to_string(&m).unwrap()).unwrap();
        assert!(matches!(check(&figures, false), Err(ManifestError::Exists { .. })));
        assert!(check(&figures, true).is_ok());
        clear(&figures).unwrap();
        assert!(root.path().join("mine").exists() && figures.join("notes.txt").exists());
        assert!(!figures.join("fig2.png").exists());
    }
}
