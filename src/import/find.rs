//! Finds scene files by name.

use std::{
    fs,
    path::{Path, PathBuf},
};

use super::error::ImportError;
use crate::files::nearest;

/// Directory in which scenes are sought that are not found as given: that of the repository.
const LIBRARY: &str = "scenes";

/// Endings of scene files, in the order in which they are tried on a name without one.
const ENDINGS: [&str; 3] = ["obj", "glb", "gltf"];

/// The ending of a scene file in lower case; `None` for other files.
pub(super) fn ending(path: &Path) -> Option<&'static str> {
    let given = path.extension()?;
    ENDINGS.into_iter().find(|e| given.eq_ignore_ascii_case(e))
}

/// Finds a scene file: as given or, for a relative path, in `scenes/`; the
/// ending `.obj`, `.glb` or `.gltf` may be left out.
///
/// # Errors
/// When no such file exists, or its ending is of another format. The error names the nearest scene.
pub fn find(path: &Path) -> Result<PathBuf, ImportError> {
    let mut given = vec![path.to_path_buf()];
    given.extend(ENDINGS.map(|e| {
        let mut with_ending = path.as_os_str().to_owned();
        with_ending.push(".");
        with_ending.push(e);
        PathBuf::from(with_ending)
    }));
    let sought = given.iter().map(|p| Path::new(LIBRARY).join(p)).filter(|_| path.is_relative());
    let Some(found) = given.iter().cloned().chain(sought).find(|p| p.is_file()) else {
        if path.is_dir() {
            return Err(ImportError::Directory { path: path.into() });
        }
        return Err(ImportError::NotFound { path: path.into(), hint: hint(path) });
    };
    if ending(&found).is_none() {
        return Err(ImportError::NotScene { path: found });
    }
    Ok(found)
}

/// Where else the scene was sought, and the nearest name there and beside it.
fn hint(path: &Path) -> String {
    if path.is_absolute() {
        return String::new();
    }
    let is_scene = |n: &String| ending(Path::new(n)).is_some();
    let list = |dir: &Path| -> Vec<String> {
        let entries = fs::read_dir(dir).into_iter().flatten().flatten();
        entries.map(|e| e.file_name().to_string_lossy().into_owned()).filter(is_scene).collect()
    };
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let beside = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut known = [list(beside), list(Path::new(LIBRARY))].concat();
    known.sort();
    match nearest(&name, known.iter().map(String::as_str)) {
        Some(near) => format!(", and none in {LIBRARY}/ either; did you mean `{near}`?"),
        None => format!(", and none in {LIBRARY}/ either"),
    }
}
