//! Going on with a command that was stopped or killed.

use std::{
    env, io,
    path::{Path, PathBuf},
};

use anyhow::{Context, bail};
use clap::{Args, Command as Parser};

use super::{output::say, signals};
use crate::{
    audit::unfinished::{Command, Unfinished},
    files::atomic::sweep,
};

/// Index of the first argument after the program's name and the subcommand's.
const FIRST: usize = 2;

/// Begins the command `name` that writes to `place`, whose record and products go to `directory`.
///
/// # Errors
/// Every error of [`Unfinished::begin`]; also when the current directory is unknown.
pub fn begin(name: &str, place: &Path, directory: &Path, force: bool) -> anyhow::Result<Unfinished> {
    let here = env::current_dir().context("cannot tell the current directory")?;
    // Names that are no text would not be found again: such a command is recorded as they look.
    let arguments = env::args_os().skip(FIRST).map(|word| word.to_string_lossy().into_owned()).collect();
    let unfinished = Unfinished::begin(directory, &Command::new(here, arguments), force)?;
    signals::say_at_once(go_on(name, place));
    Ok(unfinished)
}

/// The line that says how to go on with a command.
fn go_on(name: &str, place: &Path) -> String {
    format!("to go on: lightopt-embree {name} --resume {}", place.display())
}

/// Takes up the command that writes to `place`, whose record is in `directory`: goes to where it was begun,
/// and reads its arguments again; `writes_to` tells from them where it writes.
///
/// # Errors
/// Every error of [`Unfinished::take_up`]; also when the current directory is unknown, when the directory in
/// which the command was begun cannot be entered, when its arguments are not understood, or when the place has
/// been moved.
pub fn take_up<A: Args>(
    name: &'static str,
    place: &Path,
    directory: &Path,
    writes_to: impl Fn(&A) -> anyhow::Result<PathBuf>,
) -> anyhow::Result<(Unfinished, A)> {
    // Seen from elsewhere the path would lead elsewhere.
    let directory = env::current_dir().context("cannot tell the current directory")?.join(directory);
    let (unfinished, command) = Unfinished::take_up(&directory)?;
    signals::say_at_once(go_on(name, place));
    sweep(place, |_| true);
    let begun_in = &command.directory;
    env::set_current_dir(begun_in)
        .with_context(|| format!("{}: it was begun in {}", place.display(), begun_in.display()))?;
    let parser = A::augment_args(Parser::new(name)).no_binary_name(true);
    let args = parser.try_get_matches_from(&command.arguments).and_then(|found| A::from_arg_matches(&found));
    let words = command.arguments.join(" ");
    let args = args.map_err(|e| {
        let reason = e.to_string().lines().next().unwrap_or_default().to_owned();
        anyhow::anyhow!("{}: cannot go on with `{name} {words}`: {reason}", place.display())
    })?;
    let recorded = writes_to(&args)?;
    if recorded.canonicalize().ok() != directory.canonicalize().ok() {
        bail!(
            "{}: `{name} {words}` was begun in {} and writes to {}; move it back to go on",
            place.display(),
            begun_in.display(),
            recorded.display()
        );
    }
    Ok((unfinished, args))
}

/// Ends a command that has come to its end with `result`: what is done leaves no record and no products, nor
/// does what failed before it made any or would fail again; of the rest the user is told how to go on with
/// it.
///
/// # Errors
/// The error of `result`; without one, when the products of what is done cannot be removed.
pub fn end<T>(
    unfinished: Unfinished,
    name: &str,
    place: &Path,
    result: anyhow::Result<T>,
) -> anyhow::Result<T> {
    let is_done = match &result {
        _ if signals::received() => false,
        Ok(_) => true,
        // What does not fit on a disk may fit another time; any other error would come again.
        Err(e) => unfinished.is_empty() || !e.chain().any(|cause| cause.is::<io::Error>()),
    };
    if is_done {
        let ended = unfinished.end();
        let value = result?;
        ended?;
        return Ok(value);
    }
    say(&go_on(name, place));
    result
}
