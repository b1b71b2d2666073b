//! What a file that comes from elsewhere may make the program read.
//!
//! A scene names further files: material libraries, buffers, images. Whatever it names, only regular files
//! are read, no device, pipe or socket, and only up to a size. On request nothing is read that lies outside
//! the scene's folder.

use std::{
    fs::{self, File},
    io::{self, ErrorKind, Read as _},
    path::{Component, Path, PathBuf},
};

/// Largest scene file or glTF buffer, bytes: 4 GiB, what the numbers in a GLB can say.
pub const MAX_SCENE_BYTES: u64 = 1 << 32;
/// Largest file of a picture, bytes: 1 GiB, as large as all images of a scene may be decoded.
pub const MAX_PICTURE_BYTES: u64 = 1 << 30;
/// Largest material library, sidecar, file of lights, targets or signatures, bytes: 64 MiB, some million
/// lines.
pub const MAX_TEXT_BYTES: u64 = 1 << 26;

/// Name of the folder of images that may stand beside the scene's, in any letter case.
const TEXTURES: &str = "textures";

/// A file is not read.
#[derive(Debug, thiserror::Error)]
pub enum ReachError {
    /// It does not exist or cannot be read.
    #[error("{path}", path = path.display())]
    Io {
        /// Path of the file.
        path: PathBuf,
        /// Cause.
        source: io::Error,
    },
    /// It is no regular file.
    #[error("{path}: is {kind}; only regular files are read", path = path.display())]
    Kind {
        /// Path of the file.
        path: PathBuf,
        /// What it is, with its article.
        kind: &'static str,
    },
    /// It is larger than what is read.
    #[error("{path}: has {bytes} bytes; at most {most} are read", path = path.display())]
    TooLarge {
        /// Path of the file.
        path: PathBuf,
        /// Its size, bytes.
        bytes: u64,
        /// Largest size of such a file, bytes.
        most: u64,
    },
    /// It lies outside the scene's folder, in which reading is confined.
    #[error(
        "{path}: lies outside the scene's folder and the `textures` beside it, to which --confine keeps",
        path = path.display()
    )]
    Outside {
        /// Path of the file.
        path: PathBuf,
    },
}

impl ReachError {
    /// Whether the file does not exist or cannot be read, rather than being refused.
    #[must_use]
    pub fn is_missing(&self) -> bool {
        matches!(self, Self::Io { .. })
    }
}

/// Which files may be read.
#[derive(Clone, Debug, Default)]
pub struct Reach {
    /// The scene's folder as named and with its links resolved; `None` without confinement.
    folder: Option<[PathBuf; 2]>,
}

impl Reach {
    /// The reach of a scene file that may name any regular file.
    #[must_use]
    pub fn anywhere() -> Self {
        Self::default()
    }

    /// The reach of a scene file that is confined to its own folder, and to the folder `textures` beside
    /// that one.
    ///
    /// # Errors
    /// When the folder does not exist or cannot be resolved.
    pub fn confined(scene: &Path) -> Result<Self, ReachError> {
        let folder = scene.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let error = |source| ReachError::Io { path: folder.into(), source };
        let named = std::path::absolute(folder).map_err(error)?;
        Ok(Self { folder: Some([plain(&named), fs::canonicalize(folder).map_err(error)?]) })
    }

    /// Whether reading is confined to a folder.
    #[must_use]
    pub fn is_confined(&self) -> bool {
        self.folder.is_some()
    }

    /// Whether `path` is within reach, links resolved. A file that does not exist is, if one of its name
    /// would be.
    #[must_use]
    pub fn admits(&self, path: &Path) -> bool {
        let Some([named, real]) = &self.folder else { return true };
        let Ok(absolute) = std::path::absolute(path) else { return false };
        // By its words first, so that nothing outside is even looked at.
        let absolute = plain(&absolute);
        if !(is_inside(named, &absolute) || is_inside(real, &absolute)) {
            return false;
        }
        match fs::canonicalize(path) {
            Ok(resolved) => is_inside(real, &resolved),
            Err(e) => e.kind() == ErrorKind::NotFound,
        }
    }

    /// Whether `path` is a regular file within reach. Outside nothing is even looked at.
    #[must_use]
    pub fn has_file(&self, path: &Path) -> bool {
        self.admits(path) && path.is_file()
    }

    /// Checks that `path` is a regular file within reach of at most `most` bytes; returns its size.
    ///
    /// # Errors
    /// When it is not, or does not exist.
    pub fn check(&self, path: &Path, most: u64) -> Result<u64, ReachError> {
        if !self.admits(path) {
            return Err(ReachError::Outside { path: path.into() });
        }
        let metadata = fs::metadata(path).map_err(|source| ReachError::Io { path: path.into(), source })?;
        if !metadata.is_file() {
            return Err(ReachError::Kind { path: path.into(), kind: kind(&metadata) });
        }
        match metadata.len() {
            bytes if bytes > most => Err(ReachError::TooLarge { path: path.into(), bytes, most }),
            bytes => Ok(bytes),
        }
    }

    /// Reads a regular file within reach of at most `most` bytes.
    ///
    /// # Errors
    /// When it is not, or cannot be read.
    pub fn read(&self, path: &Path, most: u64) -> Result<Vec<u8>, ReachError> {
        let bytes = self.check(path, most)?;
        let mut out = Vec::with_capacity(usize::try_from(bytes).unwrap_or(0));
        // No more than it had: what has no end, as some files of the system, says that it has none.
        let read = File::open(path).and_then(|file| file.take(bytes).read_to_end(&mut out));
        read.map_err(|source| ReachError::Io { path: path.into(), source })?;
        Ok(out)
    }
}

/// Whether an absolute path without `..` lies in a folder or in the folder of textures beside it.
fn is_inside(folder: &Path, path: &Path) -> bool {
    let beside = || {
        let mut rest = path.strip_prefix(folder.parent()?).ok()?.components();
        let Component::Normal(first) = rest.next()? else { return None };
        Some(first.eq_ignore_ascii_case(TEXTURES) && rest.next().is_some())
    };
    path.starts_with(folder) || beside().unwrap_or(false)
}

/// An absolute path without `.` and `..`, by its words alone.
fn plain(path: &Path) -> PathBuf {
    let mut out = PathBuf::new();
    for component in path.components() {
        match component {
            Component::ParentDir => drop(out.pop()),
            Component::CurDir => {}
            other => out.push(other),
        }
    }
    out
}

/// What a file that is not regular is, with its article.
fn kind(metadata: &fs::Metadata) -> &'static str {
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt as _;
        let kind = metadata.file_type();
        if kind.is_fifo() {
            return "a pipe";
        }
        if kind.is_socket() {
            return "a socket";
        }
        if kind.is_char_device() || kind.is_block_device() {
            return "a device";
        }
    }
    if metadata.is_dir() { "a directory" } else { "no file" }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_regular_files_up_to_a_size_are_read() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a");
        fs::write(&path, "abc").unwrap();
        let reach = Reach::anywhere();
        assert_eq!(reach.read(&path, 3).unwrap(), b"abc");
        let error = reach.read(&path, 2).unwrap_err().to_string();
        assert!(error.ends_with("a: has 3 bytes; at most 2 are read"), "{error}");
        // A hole of a terabyte takes no room.
        File::create(directory.path().join("hole")).unwrap().set_len(1 << 40).unwrap();
        assert!(reach.read(&directory.path().join("hole"), MAX_SCENE_BYTES).is_err());
        let error = reach.read(directory.path(), 9).unwrap_err();
        assert!(error.to_string().ends_with("is a directory; only regular files are read"), "{error}");
        assert!(reach.read(&directory.path().join("b"), 9).unwrap_err().is_missing());
        #[cfg(unix)]
        for (path, kind) in [("/dev/zero", "a device"), ("/dev/null", "a device")] {
            let error = reach.read(Path::new(path), 9).unwrap_err().to_string();
            assert_eq!(error, format!("{path}: is {kind}; only regular files are read"));
        }
    }

    #[cfg(unix)]
    #[test]
    fn what_is_confined_reads_its_folder_and_the_textures_beside_it() {
        use std::os::unix::fs::symlink;
        let directory = tempfile::tempdir().unwrap();
        let at = |name: &str| directory.path().join(name);
        for name in ["scene/deep/a", "Textures/a", "other/a", "scene2/a", "texturesque/a"] {
            fs::create_dir_all(at(name).parent().unwrap()).unwrap();
            fs::write(at(name), "a").unwrap();
        }
        symlink("deep/a", at("scene/inner")).unwrap();
        symlink("../other/a", at("scene/outer")).unwrap();
        symlink("../other", at("scene/folder")).unwrap();
        symlink("scene", at("alias")).unwrap();
        symlink("/etc", at("textures")).unwrap();
        for scene in ["scene/s.obj", "alias/s.obj"] {
            let reach = Reach::confined(&at(scene)).unwrap();
            let folder = at(scene).parent().unwrap().to_path_buf();
            for name in ["deep/a", "inner", "absent", "../Textures/a", "deep/../deep/a"] {
                assert!(reach.admits(&folder.join(name)), "{scene} {name}");
            }
            for name in [
                "outer",
                "folder/a",
                "../other/a",
                "../scene2/a",
                "../texturesque/a",
                "../textures/hostname",
                "/etc/hostname",
                "../absent",
                "deep/../../other/a",
                "folder/../scene2/a",
            ] {
                assert!(!reach.admits(&folder.join(name)), "{scene} {name}");
            }
            assert!(matches!(reach.read(&folder.join("outer"), 9), Err(ReachError::Outside { .. })));
        }
    }
}
