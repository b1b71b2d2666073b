//! Products of a command that is not done: what took long to make, kept so that the command can go on
//! where it was.
//!
//! A product is found by its key, a hash of everything that it is made from. The work is deterministic, so
//! that a command that is run again does the same, finds what it made before, and ends with the same
//! bytes.

use std::{
    error::Error,
    fs,
    io::{self, Write},
    path::{Path, PathBuf},
    sync::{
        Mutex,
        atomic::{AtomicBool, Ordering},
    },
    time::{Duration, Instant},
};

use super::AuditError;
use crate::{
    files::atomic::write_unsynced,
    math::hash::{hash_bytes, hash_on, hash_words},
};

/// Work after which a product that is growing is kept again: no more than that is lost.
const INTERVAL: Duration = Duration::from_secs(10);
/// Time until a growing product is kept again, in units of the time that it took the last time: large
/// products must not slow the work down.
const REST: u32 = 20;
/// Bytes that are hashed at a time.
const CHUNK: usize = 1 << 16;

/// Products of a command, in a directory of their own.
#[derive(Debug, Default)]
pub struct Products {
    /// The directory; `None` where nothing is kept.
    directory: Option<PathBuf>,
    /// Whether it was said that a product cannot be kept.
    has_failed: AtomicBool,
    /// Time at which a growing product is to be kept again.
    next: Mutex<Option<Instant>>,
}

impl Products {
    /// Products in a directory, which exists; with `None` nothing is kept or found.
    #[must_use]
    pub fn new(directory: Option<&Path>) -> Self {
        Self { directory: directory.map(Path::to_owned), ..Self::default() }
    }

    /// The key of a product: of words that describe what it is made from, of the keys of other products,
    /// and of the program's own sources.
    #[must_use]
    pub fn key(words: &str, keys: &[u64]) -> u64 {
        let own = [words, env!("LIGHTOPT_SOURCES")].map(|text| hash_bytes(text.bytes()));
        hash_words(&[keys, &own].concat())
    }

    /// Path of the product of a kind with a key; `None` where nothing is kept.
    #[must_use]
    pub fn path(&self, key: u64, kind: &str) -> Option<PathBuf> {
        Some(self.directory.as_ref()?.join(format!("{key:016x}.{kind}")))
    }

    /// A product; `None` where it is not there, or damaged, and must be made.
    #[must_use]
    pub fn load(&self, key: u64, kind: &str) -> Option<Vec<u8>> {
        let mut bytes = fs::read(self.path(key, kind)?).ok()?;
        let length = bytes.len().checked_sub(8)?;
        let hash = bytes[..length].chunks(CHUNK).fold(0, hash_on).to_le_bytes();
        (bytes[length..] == hash).then(|| {
            bytes.truncate(length);
            bytes
        })
    }

    /// Keeps a product, whose bytes `write` writes. That it cannot be kept is no error of the work: `say`
    /// is told so, once.
    pub fn save(
        &self,
        key: u64,
        kind: &str,
        say: impl Fn(&str),
        write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
    ) {
        self.save_file(key, kind, say, |path| {
            write_unsynced(path, |file| {
                let mut out = Hashed { file, hash: 0, chunk: Vec::with_capacity(CHUNK) };
                let written = write(&mut out).and_then(|()| out.finish());
                written.map_err(|source| AuditError::Io {
                    path: path.into(),
                    action: "write the file",
                    source,
                })
            })
        });
    }

    /// Keeps a product as [`Self::save`] does, as a file of a format of its own.
    pub fn save_file<E: Error>(
        &self,
        key: u64,
        kind: &str,
        say: impl Fn(&str),
        write: impl FnOnce(&Path) -> Result<(), E>,
    ) {
        let Some(path) = self.path(key, kind) else { return };
        let clock = Instant::now();
        if let Err(e) = write(&path)
            && !self.has_failed.swap(true, Ordering::Relaxed)
        {
            let cause = e.source().map(|cause| format!(": {cause}")).unwrap_or_default();
            say(&format!("{e}{cause}; going on, but --resume would have to make it again"));
        }
        self.begin(INTERVAL.max(REST * clock.elapsed()));
    }

    /// Begins work on a growing product.
    pub fn begin_growing(&self) {
        self.begin(INTERVAL);
    }

    fn begin(&self, interval: Duration) {
        if let Ok(mut next) = self.next.lock() {
            *next = Some(Instant::now() + interval);
        }
    }

    /// Whether a growing product should be kept, since more than some seconds of work might be lost.
    #[must_use]
    pub fn is_due(&self) -> bool {
        let next = self.next.lock().ok().and_then(|next| *next);
        self.directory.is_some() && next.is_some_and(|next| Instant::now() >= next)
    }
}

/// A file that ends with a hash of what was written.
struct Hashed<'a, W> {
    file: &'a mut W,
    hash: u64,
    /// Bytes that are not written yet, less than [`CHUNK`].
    chunk: Vec<u8>,
}

impl<W: Write> Hashed<'_, W> {
    fn put(&mut self) -> io::Result<()> {
        self.hash = hash_on(self.hash, &self.chunk);
        self.file.write_all(&self.chunk)?;
        self.chunk.clear();
        Ok(())
    }

    fn finish(mut self) -> io::Result<()> {
        if !self.chunk.is_empty() {
            self.put()?;
        }
        self.file.write_all(&self.hash.to_le_bytes())
    }
}

impl<W: Write> Write for Hashed<'_, W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let n = bytes.len().min(CHUNK - self.chunk.len());
        self.chunk.extend_from_slice(&bytes[..n]);
        if self.chunk.len() == CHUNK {
            self.put()?;
        }
        Ok(n)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_are_found_by_their_keys_and_damaged_ones_are_not() {
        let directory = tempfile::tempdir().unwrap();
        let products = Products::new(Some(directory.path()));
        let silent = |text: &str| panic!("{text}");
        let keys = [Products::key("a", &[]), Products::key("b", &[]), Products::key("a", &[1])];
        let content = |i: usize| vec![i as u8; 70_001 * i];
        for (i, key) in keys.into_iter().enumerate() {
            assert_eq!(products.load(key, "x"), None);
            products.save(key, "x", silent, |out| out.write_all(&content(i)));
        }
        for (i, key) in keys.into_iter().enumerate() {
            assert_eq!(products.load(key, "x"), Some(content(i)));
            assert_eq!(products.load(key, "y"), None);
        }
        let path = products.path(keys[2], "x").unwrap();
        let mut bytes = fs::read(&path).unwrap();
        bytes[100_000] ^= 1;
        fs::write(&path, &bytes).unwrap();
        assert_eq!(products.load(keys[2], "x"), None);
        fs::write(&path, "short").unwrap();
        assert_eq!(products.load(keys[2], "x"), None);
        assert_eq!(Products::default().path(keys[0], "x"), None);
    }

    #[test]
    fn what_cannot_be_kept_is_said_once() {
        let products = Products::new(Some(Path::new("/no/such/directory")));
        let said = Mutex::new(Vec::new());
        for key in 0..3 {
            products.save(key, "x", |text| said.lock().unwrap().push(text.to_owned()), |_| Ok(()));
        }
        let said = said.into_inner().unwrap();
        assert!(said.len() == 1 && said[0].contains("/no/such/directory"), "{said:?}");
    }
}
