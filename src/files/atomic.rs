//! Files that appear whole or not at all.
//!
//! The content goes to a temporary file beside the destination, is synced, and takes the
//! destination's name in one step; a reader, or a run killed half-way, sees the old file
//! or the new one, never a part. A destination that is a link stays one, and what it leads to is
//! replaced; a file that is replaced keeps its permissions.

use std::ffi::OsString;
use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::process;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use thiserror::Error;

/// Why a file could not be brought to its place.
#[derive(Debug, Error)]
#[error("{path}: cannot {action}", path = .path.display())]
pub struct AtomicWriteError {
    /// Path of the destination.
    pub path: PathBuf,
    /// Step that failed, as the end of "cannot …".
    pub action: &'static str,
    /// Error of the file system.
    #[source]
    pub source: io::Error,
}

/// Number of temporary files that this process has made, which tells their names apart.
static COUNTER: AtomicU64 = AtomicU64::new(0);

/// Paths of the temporary files that are being written.
static OPEN: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// A temporary file that is removed when dropped, also by a panic of the writer.
struct Temporary {
    path: PathBuf,
    /// Whether the file still has its temporary name.
    armed: bool,
}

impl Temporary {
    /// Makes a file that must not exist yet.
    fn create(path: PathBuf) -> io::Result<(Self, File)> {
        // Locked until the file is there: once `abandon` has begun, no file is made any more.
        let mut open = OPEN.lock();
        if let Ok(open) = &mut open {
            open.push(path.clone());
        }
        let file = OpenOptions::new().write(true).create_new(true).open(&path);
        // A temporary file that is dropped takes the lock.
        drop(open);
        let temporary = Self { path, armed: file.is_ok() };
        Ok((temporary, file?))
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        if self.armed {
            // Nothing more can be done about a failure here; the first error is reported.
            let _ = fs::remove_file(&self.path);
        }
        if let Ok(mut open) = OPEN.lock() {
            open.retain(|path| *path != self.path);
        }
    }
}

/// Removes all temporary files and lets no more be made, for a process that ends at once: every
/// [`write_atomically`] and [`write_unsynced`] that would begin after it waits for ever.
pub fn abandon() {
    if let Ok(open) = OPEN.lock() {
        open.iter().for_each(|path| drop(fs::remove_file(path)));
        std::mem::forget(open);
    }
}

/// Writes `path` through `write`, whole or not at all; an existing file is replaced.
///
/// # Errors
/// The error that `write` returns, or the step that failed. The destination is then as before and
/// no temporary file remains.
pub fn write_atomically<T, E>(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> Result<T, E>,
) -> Result<T, E>
where
    E: From<AtomicWriteError>,
{
    put(path, true, write)
}

/// Writes `path` as [`write_atomically`] does, whole whenever the process ends, but not when the machine
/// does: without waiting for the disk. For files that can be made again.
///
/// # Errors
/// The error that `write` returns, or the step that failed; the destination is then as before and no
/// temporary file remains.
pub fn write_unsynced<T, E>(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> Result<T, E>,
) -> Result<T, E>
where
    E: From<AtomicWriteError>,
{
    put(path, false, write)
}

fn put<T, E>(
    path: &Path,
    is_synced: bool,
    write: impl FnOnce(&mut BufWriter<File>) -> Result<T, E>,
) -> Result<T, E>
where
    E: From<AtomicWriteError>,
{
    let fail = |action| {
        let path = path.to_owned();
        move |source| AtomicWriteError { path, action, source }
    };
    let (path, permissions) = &destination(path).map_err(fail("follow the link"))?;
    let Some(name) = path.file_name() else {
        let source = io::Error::new(io::ErrorKind::InvalidInput, "the path names no file");
        return Err(fail("create the file")(source).into());
    };
    let directory = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    let mut temporary_name = OsString::from(".");
    temporary_name.push(name);
    let count = COUNTER.fetch_add(1, Ordering::Relaxed);
    temporary_name.push(format!(".{}-{count}.tmp", process::id()));
    let temporary_path = directory.join(temporary_name);

    let (mut temporary, file) = Temporary::create(temporary_path).map_err(fail("create the file"))?;
    if let Some(permissions) = permissions {
        file.set_permissions(permissions.clone()).map_err(fail("set the permissions"))?;
    }
    let mut writer = BufWriter::new(file);
    let result = write(&mut writer)?;
    writer.flush().map_err(fail("write the file"))?;
    if is_synced {
        writer.get_ref().sync_all().map_err(fail("write the file to disk"))?;
    }
    drop(writer);
    fs::rename(&temporary.path, path).map_err(fail("put the file in its place"))?;
    temporary.armed = false;
    if is_synced {
        sync_directory(directory).map_err(fail("write the directory to disk"))?;
    }
    Ok(result)
}

/// Links followed at most from one to the next; the kernel's own limit.
const MAX_LINKS: usize = 40;

/// The path of the file that a path means, links followed, and the permissions of what is there.
fn destination(path: &Path) -> io::Result<(PathBuf, Option<fs::Permissions>)> {
    let mut path = path.to_owned();
    for _ in 0..MAX_LINKS {
        match fs::symlink_metadata(&path) {
            Ok(found) if found.is_symlink() => {
                let target = fs::read_link(&path)?;
                path = path.parent().unwrap_or(Path::new("")).join(target);
            }
            Ok(found) => return Ok((path, Some(found.permissions()))),
            Err(_) => return Ok((path, None)),
        }
    }
    Err(io::Error::other("too many links"))
}

/// Removes what processes that are gone left half-written in a directory, of the destinations whose
/// names `is_ours` accepts. What cannot be read or removed stays.
pub fn sweep(directory: &Path, is_ours: impl Fn(&str) -> bool) {
    for entry in fs::read_dir(directory).into_iter().flatten().flatten() {
        let name = entry.file_name();
        let Some((destination, process)) = name.to_str().and_then(parse_temporary) else { continue };
        let is_gone = !Path::new("/proc").join(process).exists();
        if is_gone && Path::new("/proc/self").exists() && is_ours(destination) {
            let _ = fs::remove_file(entry.path());
        }
    }
}

/// Name of the destination of the temporary file called `name`; `None` when `name` is not
/// that of a temporary file.
#[must_use]
pub fn temporary_of(name: &str) -> Option<&str> {
    parse_temporary(name).map(|(destination, _)| destination)
}

/// Names of the destination of a temporary file and of the process that made it.
fn parse_temporary(name: &str) -> Option<(&str, &str)> {
    let (destination, id) = name.strip_prefix('.')?.strip_suffix(".tmp")?.rsplit_once('.')?;
    let is_number = |s: &str| !s.is_empty() && s.bytes().all(|b| b.is_ascii_digit());
    let (process, count) = id.split_once('-')?;
    (is_number(process) && is_number(count)).then_some((destination, process))
}

/// Checks whether a file can be written at `path`, before the long work whose result goes
/// there. An existing file is left as it is; what dead processes left of it is removed.
///
/// # Errors
/// When [`write_atomically`] would fail, with its error.
pub fn probe(path: &Path) -> Result<(), AtomicWriteError> {
    if path.is_dir() {
        let source = io::Error::new(io::ErrorKind::IsADirectory, "it is a directory");
        return Err(AtomicWriteError { path: path.into(), action: "create the file", source });
    }
    if let (Some(directory), Some(name)) = (path.parent(), path.file_name()) {
        let directory = if directory.as_os_str().is_empty() { Path::new(".") } else { directory };
        sweep(directory, |destination| name == destination);
    }
    enum Probe {
        Possible,
        Failed(AtomicWriteError),
    }
    impl From<AtomicWriteError> for Probe {
        fn from(e: AtomicWriteError) -> Self {
            Self::Failed(e)
        }
    }
    // The error ends the writing before the destination is replaced.
    match write_atomically(path, |_| Err::<(), _>(Probe::Possible)) {
        Ok(()) | Err(Probe::Possible) => Ok(()),
        Err(Probe::Failed(e)) => Err(e),
    }
}

/// Writes the entries of a directory to disk, so that a new name survives a power cut.
#[cfg(unix)]
fn sync_directory(directory: &Path) -> io::Result<()> {
    File::open(directory)?.sync_all()
}

#[cfg(not(unix))]
fn sync_directory(_: &Path) -> io::Result<()> {
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(directory: &Path) -> Vec<String> {
        let mut names: Vec<String> =
            fs::read_dir(directory).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[derive(Debug, Error)]
    enum TestError {
        #[error(transparent)]
        Atomic(#[from] AtomicWriteError),
        #[error("own")]
        Own,
    }

    #[test]
    fn the_file_appears_only_when_whole_and_replaces_the_old_one() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.txt");
        for content in ["first", "second, longer", "3"] {
            let before = fs::read(&path).ok();
            write_atomically::<_, TestError>(&path, |file| {
                file.write_all(content.as_bytes()).unwrap();
                file.flush().unwrap();
                assert_eq!(fs::read(&path).ok(), before);
                Ok(())
            })
            .unwrap();
            assert_eq!(fs::read_to_string(&path).unwrap(), content);
        }
        assert_eq!(names(directory.path()), ["a.txt"]);
    }

    #[test]
    fn a_failed_or_panicking_writer_leaves_the_old_file_and_nothing_else() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.txt");
        fs::write(&path, "old").unwrap();
        let failed = write_atomically::<(), _>(&path, |file| {
            file.write_all(b"half").unwrap();
            Err(TestError::Own)
        });
        assert!(matches!(failed, Err(TestError::Own)));
        let panicked = std::panic::catch_unwind(|| {
            let _ = write_atomically::<(), TestError>(&path, |_| panic!("on purpose"));
        });
        assert!(panicked.is_err());
        assert_eq!(fs::read_to_string(&path).unwrap(), "old");
        assert_eq!(names(directory.path()), ["a.txt"]);
    }

    #[cfg(unix)]
    #[test]
    fn links_stay_links_and_permissions_stay() {
        use std::os::unix::fs::{PermissionsExt, symlink};
        let directory = tempfile::tempdir().unwrap();
        let at = |name: &str| directory.path().join(name);
        fs::create_dir(at("deep")).unwrap();
        fs::write(at("deep/file"), "old").unwrap();
        fs::set_permissions(at("deep/file"), fs::Permissions::from_mode(0o640)).unwrap();
        symlink("deep/file", at("link")).unwrap();
        symlink("link", at("link to a link")).unwrap();
        symlink("deep/new", at("dangling")).unwrap();
        symlink("loop", at("loop")).unwrap();
        let write = |name: &str| {
            write_atomically::<_, TestError>(&at(name), |file| {
                file.write_all(name.as_bytes()).unwrap();
                Ok(())
            })
        };
        write("link to a link").unwrap();
        assert_eq!(fs::read_to_string(at("deep/file")).unwrap(), "link to a link");
        assert_eq!(fs::metadata(at("deep/file")).unwrap().permissions().mode() & 0o777, 0o640);
        write("dangling").unwrap();
        assert_eq!(fs::read_to_string(at("deep/new")).unwrap(), "dangling");
        assert!(fs::symlink_metadata(at("link")).unwrap().is_symlink());
        let error = write("loop").unwrap_err().to_string();
        assert!(error.contains("loop") && error.contains("follow the link"), "{error}");
        assert_eq!(names(&at("deep")), ["file", "new"]);
    }

    #[test]
    fn what_dead_processes_left_is_swept_and_what_living_ones_write_stays() {
        let directory = tempfile::tempdir().unwrap();
        // Process numbers end at 2^22.
        let (dead, alive) = (4_194_304, process::id());
        let left =
            [format!(".a.basis.{dead}-0.tmp"), format!(".b.basis.{alive}-3.tmp"), format!(".c.{dead}-1.tmp")];
        left.iter().for_each(|name| fs::write(directory.path().join(name), "half").unwrap());
        sweep(directory.path(), |name| name.ends_with(".basis"));
        assert_eq!(names(directory.path()), [left[1].clone(), left[2].clone()]);
    }

    #[test]
    fn impossible_destinations_are_errors_that_name_the_path() {
        let directory = tempfile::tempdir().unwrap();
        let never = |_: &mut BufWriter<File>| Ok::<(), TestError>(());
        for path in [directory.path().join("no/such/a.txt"), directory.path().join("..")] {
            let error = write_atomically(&path, never).unwrap_err();
            assert!(error.to_string().contains(&*path.to_string_lossy()), "{error}");
        }
        // A directory in the place of the file.
        let path = directory.path().join("d");
        fs::create_dir(&path).unwrap();
        fs::write(path.join("x"), "").unwrap();
        assert!(write_atomically(&path, never).is_err());
        assert_eq!(names(directory.path()), ["d"]);
    }
}
