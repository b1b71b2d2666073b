//! Signature libraries: signatures learned from photographs, with where they came from.
//!
//! A class is named by `FILE.toml#CLASS`. `name` and `cumulated` are all that a class needs; the rest is
//! provenance. The keys are listed in `docs/formats.md`; unknown ones are refused.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::{Shape, Signature, SignatureError};
use crate::files::toml_file::{self, TomlError};
use crate::files::{did_you_mean, nearest, text};
use crate::objective::palette::Palette;

/// Version of the format of libraries, the only one so far.
const SCHEMA: u32 = 1;

/// Longest side to which a photograph is reduced by default before it is measured, pixels. Its
/// 10⁵ pixels give the values of the cumulated histogram with standard errors of at most 0.0016, even if
/// they were independent, and photographs of one size compare in g, which depends on it.
pub const LONGEST_SIDE: u32 = 512;

/// Why a signature library, or a class of it, cannot be had.
#[derive(Debug, Error)]
pub enum LibraryError {
    /// The file cannot be read.
    #[error("{path}: cannot read the signature library", path = path.display())]
    Read {
        /// Path of the library.
        path: PathBuf,
        /// Error of the operating system.
        #[source]
        source: std::io::Error,
    },
    /// The file is not TOML, or not of the structure of a library.
    #[error(transparent)]
    Syntax(#[from] TomlError),
    /// A value is not allowed at its key.
    #[error("{path}: `{key}`: {expected}", path = path.display())]
    Value {
        /// Path of the library.
        path: PathBuf,
        /// Key of the value, with the names of the tables around it.
        key: String,
        /// What is allowed there, and what was found.
        expected: String,
    },
    /// The cumulated values of a class are no distribution.
    #[error("{path}: `classes.cumulated` of `{class}`", path = path.display())]
    Signature {
        /// Path of the library.
        path: PathBuf,
        /// Name of the class.
        class: String,
        /// What is wrong with its values.
        #[source]
        source: SignatureError,
    },
    /// The library has no class of this name.
    #[error(
        "{path}: no class `{name}`{}; the library has {known}",
        did_you_mean(nearest.as_deref()),
        path = path.display()
    )]
    NoClass {
        /// Path of the library.
        path: PathBuf,
        /// Name of the class that was asked for.
        name: String,
        /// Class whose name it resembles, if there is one.
        nearest: Option<String>,
        /// Names of the classes that there are, separated by commas.
        known: String,
    },
}

/// How a class's signature is made of the cumulated histograms of its photographs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// The mean of the cumulated histograms.
    #[default]
    Mean,
    /// The Wasserstein barycentre of the histograms: the mean of their quantile functions.
    Barycentre,
}

/// A photograph that a signature was learned from.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PhotoRecord {
    /// Name of the photograph's file, without folder.
    pub file: String,
    /// SHA-256 of the bytes of the file, in hexadecimal.
    pub sha256: String,
}

/// A class of photographs: the signature that was learned from them, with where it came from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Class {
    /// Name of the class: letters, digits, `-` and `_`.
    pub name: String,
    /// How the histograms of the photographs were combined.
    #[serde(default)]
    pub method: Method,
    /// Number of photographs that the signature was learned from.
    #[serde(default)]
    pub count: usize,
    /// Names of the files whose photographs are unlike the rest of the class.
    #[serde(default)]
    pub outliers: Vec<String>,
    /// Signature of the class: for each of 256 bins the share of pixels below its upper edge.
    pub cumulated: Vec<f64>,
    /// Colours of the class: shares of the pixels in 16 × 16 bins of a and b of Oklab, those of one b together; empty
    /// in libraries of earlier versions.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub palette: Vec<f64>,
    /// Photographs that the signature was learned from.
    #[serde(default)]
    pub photos: Vec<PhotoRecord>,
}

/// A file of signatures that were learned from photographs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Library {
    schema: u32,
    /// Name and version of the program that learned the signatures.
    #[serde(default)]
    pub program: String,
    /// Longest side to which the photographs were reduced before they were measured, pixels.
    #[serde(default = "longest_side")]
    pub longest_side: u32,
    /// Classes of photographs, each with its signature, in the order of the file.
    pub classes: Vec<Class>,
}

fn longest_side() -> u32 {
    LONGEST_SIDE
}

/// Whether a class may have this name, which becomes a part of file names and follows a `#`.
#[must_use]
pub fn is_class_name(name: &str) -> bool {
    !name.is_empty() && name.chars().all(|c| c.is_alphanumeric() || c == '-' || c == '_')
}

/// File and class that `FILE.toml#CLASS` names; `None` if the text is of another form.
#[must_use]
pub fn split_reference(text: &str) -> Option<(&Path, &str)> {
    let (file, class) = text.rsplit_once('#')?;
    let file = Path::new(file);
    file.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml")).then_some((file, class))
}

impl Library {
    /// A library of `classes`, learned by this program from photographs of at most `longest_side` pixels
    /// a side.
    #[must_use]
    pub fn new(longest_side: u32, classes: Vec<Class>) -> Self {
        let program = concat!(env!("CARGO_PKG_NAME"), " ", env!("CARGO_PKG_VERSION")).to_owned();
        Self { schema: SCHEMA, program, longest_side, classes }
    }

    /// Reads and checks a library.
    ///
    /// # Errors
    /// With file and key, when it is no valid one.
    pub fn read(path: &Path) -> Result<Self, LibraryError> {
        let text = text::read(path).map_err(|source| LibraryError::Read { path: path.to_owned(), source })?;
        let library: Self = toml_file::parse(path, &text)?;
        library.check(path)?;
        Ok(library)
    }

    fn check(&self, path: &Path) -> Result<(), LibraryError> {
        let value = |key: &str, expected: String| {
            Err(LibraryError::Value { path: path.to_owned(), key: key.to_owned(), expected })
        };
        if self.schema != SCHEMA {
            return value("schema", format!("must be {SCHEMA}, got {}", self.schema));
        }
        if self.longest_side == 0 {
            return value("longest_side", "must be at least 1 pixel, got 0".to_owned());
        }
        if self.classes.is_empty() {
            return value("classes", "must have at least one class, got none".to_owned());
        }
        for (i, class) in self.classes.iter().enumerate() {
            if !is_class_name(&class.name) {
                let expected = format!("must be letters, digits, - and _, got `{}`", class.name);
                return value("classes.name", expected);
            }
            if self.classes[..i].iter().any(|c| c.name == class.name) {
                return value("classes.name", format!("two classes are called `{}`", class.name));
            }
            self.to_signature(class, path)?;
        }
        Ok(())
    }

    fn to_signature(&self, class: &Class, path: &Path) -> Result<Signature, LibraryError> {
        Signature::new(&class.name, Shape::Cumulated(class.cumulated.clone())).map_err(|source| {
            LibraryError::Signature { path: path.to_owned(), class: class.name.clone(), source }
        })
    }

    /// Signatures of all classes, in the order of the file; `path` is for messages only.
    ///
    /// # Errors
    /// When one is no distribution.
    pub fn signatures(&self, path: &Path) -> Result<Vec<Signature>, LibraryError> {
        self.classes.iter().map(|class| self.to_signature(class, path)).collect()
    }

    /// Names of the classes, separated by commas.
    #[must_use]
    pub fn names(&self) -> String {
        self.classes.iter().map(|c| c.name.as_str()).collect::<Vec<_>>().join(", ")
    }

    /// Signature of a class of the library at `path`.
    ///
    /// # Errors
    /// When the library is no valid one or has no such class.
    pub fn find(path: &Path, class: &str) -> Result<Signature, LibraryError> {
        let library = Self::read(path)?;
        let Some(found) = library.classes.iter().find(|c| c.name == class) else {
            let nearest = nearest(class, library.classes.iter().map(|c| c.name.as_str()));
            return Err(LibraryError::NoClass {
                path: path.to_owned(),
                name: class.to_owned(),
                nearest: nearest.map(str::to_owned),
                known: library.names(),
            });
        };
        library.to_signature(found, path)
    }

    /// Palette of a class of the library at `path`.
    ///
    /// # Errors
    /// When the library is no valid one or has no such class, or the class no palette.
    pub fn find_palette(path: &Path, class: &str) -> Result<Palette, LibraryError> {
        let signature = Self::find(path, class)?;
        let library = Self::read(path)?;
        let found = library.classes.into_iter().find(|c| c.name == class);
        let shares = found.map(|class| class.palette).unwrap_or_default();
        Palette::new(signature.name(), shares).map_err(|e| LibraryError::Value {
            path: path.to_owned(),
            key: "classes.palette".into(),
            expected: e.to_string(),
        })
    }

    /// Text of the file that reads as this library again.
    ///
    /// # Errors
    /// Never; the serialiser's signature has them.
    pub fn to_toml(&self) -> Result<String, toml::ser::Error> {
        let head = "# Signatures learned from photographs. Name one as FILE.toml#CLASS.\n\n";
        Ok(format!("{head}{}", toml::to_string(self)?))
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    fn library() -> Library {
        let class = |name: &str, power: f64| Class {
            name: name.to_owned(),
            method: Method::Barycentre,
            count: 1,
            outliers: vec![],
            palette: Vec::new(),
            cumulated: (1..=256).map(|i| (f64::from(i) / 256.0).powf(power)).collect(),
            photos: vec![PhotoRecord { file: "ä b.jpg".to_owned(), sha256: "00".to_owned() }],
        };
        Library::new(512, vec![class("high", 3.0), class("low", 0.1)])
    }

    fn message(text: &str) -> String {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("s.toml");
        fs::write(&path, text).unwrap();
        let message = format!("{:#}", anyhow::Error::new(Library::read(&path).unwrap_err()));
        assert!(message.contains("s.toml") && !message.contains('\n'), "{message}");
        message
    }

    #[test]
    fn a_library_survives_its_file_exactly() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("s.toml");
        fs::write(&path, library().to_toml().unwrap()).unwrap();
        assert_eq!(Library::read(&path).unwrap(), library());
        let low = Library::find(&path, "low").unwrap();
        assert_eq!((low.name(), low.cumulated().to_vec()), ("low", library().classes[1].cumulated.clone()));
        let error = Library::find(&path, "hihg").unwrap_err().to_string();
        assert!(error.contains("did you mean `high`?; the library has high, low"), "{error}");
    }

    #[test]
    fn a_wrong_library_is_refused_with_file_and_key() {
        let good = library().to_toml().unwrap();
        for (from, to, want) in [
            ("schema = 1", "schema = 2", "`schema`: must be 1, got 2"),
            ("longest_side = 512", "longest_side = 0", "`longest_side`: must be at least 1"),
            ("longest_side", "longest_sied", "did you mean `longest_side`?"),
            ("name = \"low\"", "name = \"high\"", "`classes.name`: two classes are called `high`"),
            ("name = \"low\"", "name = \"l/w\"", "`classes.name`: must be letters"),
            ("method = \"barycentre\"", "method = \"median\"", "`classes.method`: unknown value `median`"),
            ("sha256", "sha", "unknown key `sha`"),
            (
                "cumulated = [",
                "cumulated = [2.0, ",
                "`classes.cumulated` of `high`: need 256 cumulated values",
            ),
        ] {
            let text = good.replacen(from, to, 1);
            assert_ne!(text, good, "{from}");
            let message = message(&text);
            assert!(message.contains(want), "{message}");
        }
        assert!(message("schema = 1\nclasses = []").contains("at least one class"));
    }

    #[test]
    fn a_reference_is_a_toml_file_and_a_class() {
        assert_eq!(split_reference("a#b/s.toml#high"), Some((Path::new("a#b/s.toml"), "high")));
        for other in ["high", "s.toml", "s.json#high", "#high"] {
            assert_eq!(split_reference(other), None, "{other}");
        }
    }
}
