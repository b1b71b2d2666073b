//! A directory that an export fills, and the images of materials in it.

use std::{
    fs::{self, File},
    io::{self, BufWriter},
    path::{Path, PathBuf},
};

use super::{ExportError, Exported};
use crate::{
    files::write_atomically,
    film::exr::{ExrImage, ExrPart, write_exr},
    scene::texture::{ScalarMap, Texture},
};

/// A directory and the files that an export has written into it.
pub(super) struct Directory {
    path: PathBuf,
    files: Vec<PathBuf>,
}

impl Directory {
    /// The directory at `path`, made with its parents if it is not there.
    pub(super) fn create(path: &Path) -> Result<Self, ExportError> {
        let path = path.to_path_buf();
        match fs::create_dir_all(&path) {
            Ok(()) => Ok(Self { path, files: Vec::new() }),
            Err(source) => Err(ExportError::Directory { path, source }),
        }
    }

    /// Whether the export has written the file `name`.
    pub(super) fn has(&self, name: &str) -> bool {
        self.files.contains(&self.path.join(name))
    }

    /// Writes the file `name` by `write`, whole or not at all.
    pub(super) fn write(
        &mut self,
        name: &str,
        write: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
    ) -> Result<(), ExportError> {
        let path = self.path.join(name);
        write_atomically(&path, |out| {
            write(out).map_err(|source| ExportError::Write { path: path.clone(), source })
        })?;
        self.files.push(path);
        Ok(())
    }

    /// Writes a picture of one part as `{stem}.exr`, and returns this name.
    pub(super) fn picture(
        &mut self,
        stem: &str,
        [width, height]: [usize; 2],
        part: ExrPart,
    ) -> Result<String, ExportError> {
        let name = format!("{stem}.exr");
        let path = self.path.join(&name);
        write_exr(&path, &ExrImage { width, height, parts: vec![part], lightopt: None })?;
        self.files.push(path);
        Ok(name)
    }

    /// Writes the linear RGBA texels of an image through `f` as the RGB part `part` of
    /// `{stem}.exr`, and returns this name.
    pub(super) fn color_texture(
        &mut self,
        stem: &str,
        part: &str,
        texture: &Texture,
        f: impl FnMut([f32; 4]) -> [f32; 3],
    ) -> Result<String, ExportError> {
        self.picture(stem, texture.size(), ExrPart::rgb(part, &texels(texture, f)))
    }

    /// Writes the numbers of one channel of an image through `f` as the part `part` with
    /// the channel Y of `{stem}.exr`, and returns this name.
    pub(super) fn scalar_texture(
        &mut self,
        stem: &str,
        part: &str,
        map: &ScalarMap,
        f: impl Fn(f32) -> f32,
    ) -> Result<String, ExportError> {
        let values = texels(&map.texture, |t| f(t[map.channel as usize]));
        self.picture(stem, map.texture.size(), ExrPart::single(part, "Y", values))
    }

    /// The export, finished with these warnings.
    pub(super) fn finish(self, warnings: Vec<String>) -> Exported {
        Exported { files: self.files, warnings }
    }
}

/// The texels of an image through `f`, row by row from the top.
fn texels<T>(texture: &Texture, mut f: impl FnMut([f32; 4]) -> T) -> Vec<T> {
    let [width, height] = texture.size();
    (0..width * height).map(|i| f(texture.texel(i % width, i / width))).collect()
}
