//! A command that is not done: its record, its lock, and the directory of its products.

use std::{
    fs::{self, File},
    io,
    os::unix::fs::MetadataExt,
    path::{Path, PathBuf},
};

use serde::{Deserialize, Serialize};

use super::{AuditError, lock, write_whole};
use crate::files::{
    atomic::sweep,
    toml_file::{self, TomlError},
};

/// Name of the directory in a run directory, or in one of figures, that is there while the work is not
/// done.
pub const UNFINISHED: &str = ".resume";
/// Name of the record in it.
const COMMAND: &str = "command.toml";
/// Version of the record.
const SCHEMA: u32 = 1;

/// Record of how a command was begun.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Command {
    /// Version of the record, which must be 1.
    pub schema: u32,
    /// Directory in which it was begun, to which its relative paths refer.
    pub directory: PathBuf,
    /// Words of the command line after the name of the subcommand.
    pub arguments: Vec<String>,
}

impl Command {
    /// The record of a command.
    #[must_use]
    pub fn new(directory: PathBuf, arguments: Vec<String>) -> Self {
        Self { schema: SCHEMA, directory, arguments }
    }
}

/// A command that is not done. No other one can have the same place while this one lives.
#[derive(Debug)]
pub struct Unfinished {
    /// Directory of record and products.
    directory: PathBuf,
    /// How it was begun.
    command: Command,
    /// Directories that were made for it, deepest first.
    made: Vec<PathBuf>,
    _lock: File,
}

impl Unfinished {
    /// Checks that a command may be begun whose record and products go to `directory`.
    ///
    /// # Errors
    /// When an earlier one was not done, unless `force` replaces it.
    pub fn check(directory: &Path, force: bool) -> Result<(), AuditError> {
        if directory.join(COMMAND).exists() && !force {
            return Err(AuditError::Unfinished { path: shown(directory) });
        }
        Ok(())
    }

    /// Begins a command whose record and products go to `directory`; `force` replaces an earlier one that
    /// was not done.
    ///
    /// # Errors
    /// When another command is at work there or, without `force`, was not done; or when the directory
    /// cannot be written.
    pub fn begin(directory: &Path, command: &Command, force: bool) -> Result<Self, AuditError> {
        let fail = |action| move |source| AuditError::Io { path: directory.into(), action, source };
        let made: Vec<PathBuf> = directory
            .ancestors()
            .take_while(|p| !p.as_os_str().is_empty() && !p.exists())
            .map(Into::into)
            .collect();
        let lock = claim(directory, true)?;
        let unfinished = Self { directory: directory.into(), command: command.clone(), made, _lock: lock };
        Self::check(directory, force)?;
        unfinished.empty().map_err(fail("empty the directory"))?;
        let text =
            toml::to_string(command).map_err(|e| fail("record the command in")(io::Error::other(e)))?;
        write_whole(&directory.join(COMMAND), text)?;
        Ok(unfinished)
    }

    /// Takes up a command whose record and products are in `directory`.
    ///
    /// # Errors
    /// When there is none, its record cannot be read or is of another version, or it is at work.
    pub fn take_up(directory: &Path) -> Result<(Self, Command), AuditError> {
        let nothing = || AuditError::NothingUnfinished { path: shown(directory) };
        let record = directory.join(COMMAND);
        if !record.exists() {
            return Err(nothing());
        }
        let lock = claim(directory, false)?;
        let text = fs::read_to_string(&record).map_err(|source| match source.kind() {
            io::ErrorKind::NotFound => nothing(),
            _ => AuditError::Io { path: record.clone(), action: "read the record", source },
        })?;
        let command: Command = toml_file::parse(&record, &text)?;
        if command.schema != SCHEMA {
            let message =
                format!("`schema`: this program reads version {SCHEMA}, the file says {}", command.schema);
            // It is the first key of the record.
            return Err(TomlError { path: record, line: 1, message }.into());
        }
        sweep(directory, |_| true);
        let directory = directory.into();
        Ok((Self { directory, command: command.clone(), made: Vec::new(), _lock: lock }, command))
    }

    /// How it was begun.
    #[must_use]
    pub fn command(&self) -> &Command {
        &self.command
    }

    /// The directory of its products.
    #[must_use]
    pub fn products(&self) -> &Path {
        &self.directory
    }

    /// Removes record and products of a command that is done, or that has failed before it made anything:
    /// then also the directories that were made for it, if nothing else is in them.
    ///
    /// # Errors
    /// When they cannot be removed.
    pub fn end(self) -> Result<(), AuditError> {
        let fail =
            |source| AuditError::Io { path: self.directory.clone(), action: "remove the directory", source };
        fs::remove_dir_all(&self.directory).map_err(fail)?;
        for made in self.made.iter().skip(1) {
            if fs::remove_dir(made).is_err() {
                break;
            }
        }
        Ok(())
    }

    /// Whether nothing was made so far.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        fs::read_dir(&self.directory).is_ok_and(|entries| entries.flatten().all(|e| e.file_name() == COMMAND))
    }

    /// Removes the files in the directory.
    fn empty(&self) -> io::Result<()> {
        for entry in fs::read_dir(&self.directory)? {
            fs::remove_file(entry?.path())?;
        }
        Ok(())
    }
}

/// Locks the directory of a command, which with `make` is made.
fn claim(directory: &Path, make: bool) -> Result<File, AuditError> {
    let fail = |action| move |source| AuditError::Io { path: directory.into(), action, source };
    loop {
        if make {
            fs::create_dir_all(directory).map_err(fail("make the directory"))?;
        }
        let lock = lock(directory, &shown(directory))?;
        // A command that ended meanwhile has removed its directory: the lock must be that of a new one.
        let locked = lock.metadata().map_err(fail("lock the directory"))?;
        match fs::metadata(directory) {
            Ok(now) if (now.dev(), now.ino()) == (locked.dev(), locked.ino()) => return Ok(lock),
            Err(e) if !make => return Err(fail("lock the directory")(e)),
            _ => {}
        }
    }
}

/// The directory of record and products of a command that writes the file `output` when it is done.
#[must_use]
pub fn beside(output: &Path) -> PathBuf {
    let name = output.file_name().unwrap_or_default().to_string_lossy();
    output.with_file_name(format!(".{name}{UNFINISHED}"))
}

/// The path by which the user knows the place of a command: the directory or the file that it writes.
fn shown(directory: &Path) -> PathBuf {
    let name = directory.file_name().unwrap_or_default().to_string_lossy();
    match (name.strip_prefix('.').and_then(|name| name.strip_suffix(UNFINISHED)), directory.parent()) {
        (Some(output), _) => directory.with_file_name(output),
        (None, Some(parent)) if !parent.as_os_str().is_empty() => parent.into(),
        _ => ".".into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_is_taken_up_by_one_until_it_is_done() {
        let root = tempfile::tempdir().unwrap();
        let place = root.path().join("runs/a").join(UNFINISHED);
        assert_eq!(shown(&place), root.path().join("runs/a"));
        assert_eq!(shown(&beside("b/styles.toml".as_ref())), Path::new("b/styles.toml"));
        let command =
            Command::new("/somewhere".into(), ["run", "a b.obj", "--out", "ü"].map(Into::into).into());
        assert!(matches!(Unfinished::take_up(&place), Err(AuditError::NothingUnfinished { .. })));
        let first = Unfinished::begin(&place, &command, false).unwrap();
        assert!(first.is_empty());
        assert!(matches!(Unfinished::take_up(&place), Err(AuditError::Busy { .. })));
        assert!(matches!(Unfinished::begin(&place, &command, true), Err(AuditError::Busy { .. })));
        fs::write(first.products().join("x"), "").unwrap();
        // Process numbers end at 2^22.
        fs::write(first.products().join(".y.4194304-0.tmp"), "").unwrap();
        assert!(!first.is_empty());
        drop(first);
        assert!(matches!(Unfinished::begin(&place, &command, false), Err(AuditError::Unfinished { .. })));
        let record = |command: &Command| {
            fs::write(place.join(COMMAND), toml::to_string(command).unwrap()).unwrap();
        };
        record(&Command { schema: 2, ..command.clone() });
        let error = Unfinished::take_up(&place).unwrap_err().to_string();
        let wanted = "command.toml:1: `schema`: this program reads version 1, the file says 2";
        assert!(error.ends_with(wanted), "{error}");
        record(&command);
        let (again, found) = Unfinished::take_up(&place).unwrap();
        assert_eq!(found, command);
        let mut left: Vec<_> =
            fs::read_dir(again.products()).unwrap().map(|e| e.unwrap().file_name()).collect();
        left.sort();
        assert_eq!(left, [COMMAND, "x"]);
        again.end().unwrap();
        assert!(!place.exists() && root.path().join("runs/a").exists());
        let failed = Unfinished::begin(&place.join("deep/er"), &command, false).unwrap();
        failed.end().unwrap();
        assert!(!place.exists() && root.path().join("runs/a").exists());
    }
}
