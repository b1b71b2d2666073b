//! Pictures of surroundings from which is chosen.

use std::{
    fs,
    path::{Path, PathBuf},
};

use anyhow::{Context, bail};

use super::progress::Console;
use crate::{
    design::{Reporter, rig::SkyFile},
    files::reach::{MAX_PICTURE_BYTES, Reach},
};

/// The pictures of surroundings in a folder, by name, or the one that is named; what is none is left out, and said.
///
/// # Errors
/// When the folder cannot be read, or holds no such picture.
pub fn skies(place: &Path, console: &Console) -> anyhow::Result<Vec<SkyFile>> {
    let paths = if place.is_dir() { pictures(place)? } else { vec![place.to_owned()] };
    let mut skies = Vec::new();
    for path in paths {
        match read(&path) {
            Ok((sky, warnings)) => {
                warnings.iter().for_each(|warning| console.note(warning));
                skies.push(sky);
            }
            Err(error) => console.note(&format!("left out: {error:#}")),
        }
    }
    if skies.is_empty() {
        bail!("--environments: {}: no HDR or EXR picture of surroundings can be read there", place.display());
    }
    Ok(skies)
}

/// The files of a folder that are called as pictures of radiance are, by name.
fn pictures(folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let is_picture = |path: &PathBuf| {
        let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase());
        ending.is_some_and(|ending| ["hdr", "pic", "exr"].contains(&ending.as_str()))
    };
    let entries = fs::read_dir(folder).and_then(|entries| entries.map(|e| Ok(e?.path())).collect());
    let mut paths: Vec<PathBuf> =
        entries.with_context(|| format!("--environments: {}: cannot read the folder", folder.display()))?;
    paths.retain(is_picture);
    paths.sort();
    Ok(paths)
}

/// Reads one of them, with what is worth a warning.
fn read(path: &Path) -> anyhow::Result<(SkyFile, Vec<String>)> {
    Reach::anywhere().check(path, MAX_PICTURE_BYTES)?;
    Ok(SkyFile::read(path)?)
}
