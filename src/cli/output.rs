//! Standard output and error. Names come from files of others: what would steer a terminal, or break a
//! line, is shown by its code instead.

use std::{
    borrow::Cow,
    io::{self, Write},
};

use anyhow::Context;
use serde_json::Value;

/// Whether a character steers a terminal: control characters (C0, DEL and C1), and those that turn the
/// direction of writing or break lines in Unicode.
fn steers(c: char) -> bool {
    c.is_control()
        || matches!(c, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// The text on one line: characters that steer a terminal, line ends among them, are shown by their code.
#[must_use]
pub fn one_line(text: &str) -> Cow<'_, str> {
    if !text.contains(steers) {
        return Cow::Borrowed(text);
    }
    let shown = |out: String, c: char| {
        if steers(c) { out + &c.escape_default().to_string() } else { out + c.encode_utf8(&mut [0; 4]) }
    };
    Cow::Owned(text.chars().fold(String::with_capacity(text.len()), shown))
}

/// Writes a line to standard error, which may be closed.
pub fn say(text: &str) {
    // Not `eprintln!`, which panics when standard error is closed.
    let _ = writeln!(io::stderr(), "{}", one_line(text));
}

/// Writes an error and its causes to standard error on one line. A cause that its effect has named already
/// is not named again.
pub fn say_error(error: &anyhow::Error) {
    say(&format!("error: {}", chain(error)));
}

fn chain(error: &anyhow::Error) -> String {
    error.chain().map(ToString::to_string).fold(String::new(), |said, cause| match said.as_str() {
        "" => cause,
        _ if said.ends_with(&cause) => said,
        _ => format!("{said}: {cause}"),
    })
}

/// Writes lines of text to standard output; a reader that has gone away (as `head`) is no error.
///
/// # Errors
/// When standard output cannot be written.
pub fn print(text: &str) -> anyhow::Result<()> {
    let lines: Vec<Cow<'_, str>> = text.split('\n').map(one_line).collect();
    write(&lines.join("\n"))
}

/// Writes a JSON value to standard output, with escapes for what would steer a terminal.
///
/// # Errors
/// As [`print`].
pub fn print_json(value: &Value) -> anyhow::Result<()> {
    let text = format!("{value:#}\n");
    let escaped =
        |c: char| if steers(c) && c != '\n' { format!("\\u{:04x}", u32::from(c)) } else { c.to_string() };
    if text.contains(|c| steers(c) && c != '\n') {
        return write(&text.chars().map(escaped).collect::<String>());
    }
    write(&text)
}

fn write(text: &str) -> anyhow::Result<()> {
    let mut out = io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(e) if e.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        other => other.context("cannot write to standard output"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_steers_a_terminal_is_shown_by_its_code() {
        assert_eq!(one_line("Tür, 木 😀"), "Tür, 木 😀");
        assert_eq!(one_line("a\x1b[2Jb\nc\u{9b}\u{202e}"), "a\\u{1b}[2Jb\\nc\\u{9b}\\u{202e}");
    }

    #[test]
    fn a_cause_is_said_once() {
        #[derive(Debug, thiserror::Error)]
        #[error("{0}")]
        struct Again(#[source] io::Error);
        let full = || io::Error::from(io::ErrorKind::StorageFull);
        let error = anyhow::Error::new(Again(full())).context("a.exr: cannot write");
        assert_eq!(chain(&error), format!("a.exr: cannot write: {}", full()));
    }
}
