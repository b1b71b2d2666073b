//! Listing of folders of photographs, and matching of masks to photographs.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::{fs, io};

use sha2::{Digest, Sha256};
use thiserror::Error;

use crate::picture::Format;

/// Why a folder of photographs or masks is refused.
#[derive(Debug, Error)]
pub enum FolderError {
    /// The folder cannot be read.
    #[error("{path}: cannot read the folder", path = path.display())]
    Read {
        /// Path of the folder.
        path: PathBuf,
        /// Error of the file system.
        #[source]
        source: io::Error,
    },
    /// A file in the folder cannot be read.
    #[error("{path}: cannot read the file", path = path.display())]
    File {
        /// Path of the file.
        path: PathBuf,
        /// Error of the file system.
        #[source]
        source: io::Error,
    },
    /// The folder has no pictures.
    #[error(
        "{path}: no pictures in the folder (files ending in .jpg, .png, .tif, .exr and the like; \
         sub-folders are not searched)",
        path = path.display()
    )]
    Empty {
        /// Path of the folder.
        path: PathBuf,
    },
    /// The folder of masks has none for a photograph.
    #[error(
        "{masks}: no mask for {photo}; it must have the name of the photograph, such as {}.png",
        photo.file_stem().unwrap_or_default().display(),
        masks = masks.display(), photo = photo.display()
    )]
    NoMask {
        /// Path of the folder of masks.
        masks: PathBuf,
        /// Path of the photograph.
        photo: PathBuf,
    },
    /// Two files have the same name but for their endings, where one is wanted.
    #[error("{first} and {second} have the same name but for their endings, so {what}", first = first.display(), second = second.display())]
    Ambiguous {
        /// Path of one of the files.
        first: PathBuf,
        /// Path of the other file.
        second: PathBuf,
        /// Consequence, and what the user can do.
        what: &'static str,
    },
}

/// The files of a folder.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Listing {
    /// Paths of the pictures, sorted by the bytes of their names; at least one.
    pub pictures: Vec<PathBuf>,
    /// Names of the files whose endings are of no known picture format, sorted likewise.
    pub others: Vec<String>,
}

/// Lists the files of a folder, without hidden ones and sub-folders.
///
/// # Errors
/// When the folder cannot be read or contains no picture.
pub fn list(folder: &Path) -> Result<Listing, FolderError> {
    let read = |source| FolderError::Read { path: folder.to_owned(), source };
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).map_err(read)? {
        let entry = entry.map_err(read)?;
        let name = entry.file_name();
        if !name.as_encoded_bytes().starts_with(b".") && !entry.path().is_dir() {
            files.push(name);
        }
    }
    files.sort();
    let (pictures, others): (Vec<_>, Vec<_>) =
        files.into_iter().partition(|name| Format::of_ending(Path::new(name)).is_some());
    if pictures.is_empty() {
        return Err(FolderError::Empty { path: folder.to_owned() });
    }
    Ok(Listing {
        pictures: pictures.into_iter().map(|name| folder.join(name)).collect(),
        others: others.into_iter().map(|name| name.to_string_lossy().into_owned()).collect(),
    })
}

/// Path of the mask of each photograph: the picture in `folder` whose name is that of the
/// photograph, endings aside.
///
/// # Errors
/// When a photograph has no mask or more than one, or two photographs would share one.
pub fn masks(folder: &Path, photos: &[PathBuf]) -> Result<Vec<PathBuf>, FolderError> {
    let all = list(folder)?.pictures;
    let stem = |path: &Path| path.file_stem().map(OsStr::to_owned);
    let ambiguous = |first: &Path, second: &Path, what| FolderError::Ambiguous {
        first: first.to_owned(),
        second: second.to_owned(),
        what,
    };
    let mut chosen: Vec<PathBuf> = Vec::new();
    for (i, photo) in photos.iter().enumerate() {
        if let Some(other) = photos[..i].iter().find(|p| stem(p) == stem(photo)) {
            return Err(ambiguous(other, photo, "they would share a mask; rename one"));
        }
        let mut fitting = all.iter().filter(|m| stem(m) == stem(photo));
        match (fitting.next(), fitting.next()) {
            (Some(mask), None) => chosen.push(mask.clone()),
            (Some(a), Some(b)) => return Err(ambiguous(a, b, "it is open which is the mask")),
            (None, _) => return Err(FolderError::NoMask { masks: folder.to_owned(), photo: photo.clone() }),
        }
    }
    Ok(chosen)
}

/// SHA-256 of a file's bytes, in hexadecimal.
///
/// # Errors
/// When the file cannot be read.
pub fn sha256(path: &Path) -> Result<String, FolderError> {
    let bytes = fs::read(path).map_err(|source| FolderError::File { path: path.to_owned(), source })?;
    Ok(Sha256::digest(&bytes).iter().map(|b| format!("{b:02x}")).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_lists_its_pictures_by_name_and_nothing_else() {
        let directory = tempfile::tempdir().unwrap();
        for name in ["b.JPG", "a.tiff", "c.exr", ".d.jpg", "notes.txt", "e"] {
            fs::write(directory.path().join(name), "abc").unwrap();
        }
        fs::create_dir(directory.path().join("f.png")).unwrap();
        let Listing { pictures: found, others } = list(directory.path()).unwrap();
        assert_eq!(others, ["e", "notes.txt"]);
        let names: Vec<_> = found.iter().map(|p| p.file_name().unwrap().to_str().unwrap()).collect();
        assert_eq!(names, ["a.tiff", "b.JPG", "c.exr"]);
        // The test vector of FIPS 180-2, appendix B.1.
        let sum = sha256(&found[0]).unwrap();
        assert_eq!(sum, "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
    }

    #[test]
    fn masks_go_by_the_stem_and_must_be_beyond_doubt() {
        let directory = tempfile::tempdir().unwrap();
        for name in ["a.png", "b.png", "b.tif"] {
            fs::write(directory.path().join(name), "").unwrap();
        }
        let find = |photos: &[&str]| {
            let photos: Vec<PathBuf> = photos.iter().map(PathBuf::from).collect();
            masks(directory.path(), &photos)
        };
        assert_eq!(find(&["x/a.jpg"]).unwrap(), [directory.path().join("a.png")]);
        assert!(matches!(find(&["x/c.jpg"]), Err(FolderError::NoMask { .. })));
        assert!(matches!(find(&["x/b.jpg"]), Err(FolderError::Ambiguous { .. })));
        assert!(matches!(find(&["x/a.jpg", "y/a.png"]), Err(FolderError::Ambiguous { .. })));
    }
}
