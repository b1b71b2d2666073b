//! Parsing of TOML files, with errors that a user can act on.

use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;

use super::nearest;

/// Why the content of a TOML file is refused.
#[derive(Debug, thiserror::Error)]
#[error("{path}:{line}: {message}", path = path.display())]
pub struct TomlError {
    /// Path of the file.
    pub path: PathBuf,
    /// Number of the line at fault, from 1.
    pub line: usize,
    /// Key at fault, what is wrong with it, and what is allowed.
    pub message: String,
}

/// Parses `text`, the content of the file at `path`.
///
/// # Errors
/// When the text is not TOML or does not fit `T`; for an unknown key the error names the
/// most similar key that is allowed.
pub fn parse<T: DeserializeOwned>(path: &Path, text: &str) -> Result<T, TomlError> {
    toml::from_str(text).map_err(|e| {
        let before = e.span().and_then(|s| text.get(..s.start)).unwrap_or_default();
        let line = before.matches('\n').count() + 1;
        let message = explain(e.message());
        // serde says what a wrong value is, but not of which key.
        let is_value = ["invalid type", "invalid value", "invalid length", "unknown variant", "wanted"];
        let key = key_at(text, before).filter(|_| is_value.iter().any(|k| e.message().starts_with(k)));
        let message = key.map_or_else(|| message.clone(), |key| format!("`{key}`: {message}"));
        TomlError { path: path.to_path_buf(), line, message }
    })
}

/// The key, with its table, whose value begins where `before` ends in `text`.
fn key_at(text: &str, before: &str) -> Option<String> {
    let line = before.matches('\n').count();
    let lines: Vec<&str> = text.lines().take(line + 1).map(str::trim).collect();
    let begins_with_letter = |s: &str| s.starts_with(|c: char| c.is_alphabetic());
    // A value may stand some lines below its key.
    let (at, key) = lines.iter().enumerate().rev().find_map(|(i, l)| {
        let (key, _) = l.split_once('=')?;
        begins_with_letter(key).then(|| (i, key.trim()))
    })?;
    let table = lines[..at].iter().rev().find_map(|l| {
        let name = l.strip_prefix('[')?.trim_start_matches('[').split(']').next()?;
        begins_with_letter(name).then_some(name)
    });
    Some(table.map_or_else(|| key.to_owned(), |table| format!("{table}.{key}")))
}

/// The message of serde in a user's words: types by their everyday names, and the most
/// similar of the allowed names offered for an unknown one.
fn explain(message: &str) -> String {
    let message = message
        .trim()
        .replace('\n', "; ")
        .replace("expected f64", "expected a number")
        .replace("expected u32", "expected a whole number")
        .replace("wanted string or table", "expected a string");
    let mut names = message.split('`').skip(1).step_by(2);
    let (Some(found), true) = (names.next(), message.starts_with("unknown")) else { return message };
    let allowed: Vec<&str> = names.collect();
    let kind = if message.starts_with("unknown variant") { "value" } else { "key" };
    match nearest(found, allowed.iter().copied()) {
        Some(near) => {
            format!("unknown {kind} `{found}`; did you mean `{near}`? (allowed: {})", allowed.join(", "))
        }
        None => message,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, serde::Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Example {
        #[allow(dead_code)]
        radius: f32,
    }

    #[test]
    fn an_unknown_key_is_answered_with_file_line_and_the_nearest() {
        let e = parse::<Example>(Path::new("a.toml"), "\n\nraduis = 1.0\n").unwrap_err().to_string();
        assert!(e.starts_with("a.toml:3:"), "{e}");
        assert!(e.contains("`raduis`; did you mean `radius`?"), "{e}");
    }
}
