//! Reading TOML files with errors that a user can act on.

use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;

use super::nearest;

/// A TOML file does not say what it should.
#[derive(Debug, thiserror::Error)]
#[error("{path}:{line}: {message}", path = path.display())]
pub struct TomlError {
    /// The file.
    pub path: PathBuf,
    /// Line, from 1.
    pub line: usize,
    /// What is wrong, and what is allowed.
    pub message: String,
}

/// Parses `text`, which came from `path`.
///
/// # Errors
/// With the line, and for an unknown key the nearest one that is allowed.
pub fn parse<T: DeserializeOwned>(path: &Path, text: &str) -> Result<T, TomlError> {
    toml::from_str(text).map_err(|e| {
        let line = e.span().map_or(1, |s| text[..s.start.min(text.len())].matches('\n').count() + 1);
        TomlError { path: path.to_path_buf(), line, message: explain(e.message()) }
    })
}

/// Rewrites serde's list of expected names as the nearest one.
fn explain(message: &str) -> String {
    let message = message.trim().replace('\n', "; ");
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
