//! Warnings, each once, those of one kind on one line.

use std::collections::{HashMap, HashSet};

/// Names listed in a line about several things; more are counted.
const MAX_LISTED: usize = 3;

/// What was left out or replaced while reading, one line each in the order in which it was noticed.
#[derive(Debug, Default)]
pub struct Warnings {
    lines: Vec<Line>,
    /// Positions in `lines` by kind of thing and message.
    places: HashMap<(&'static str, String), usize>,
    /// What each line has been said of.
    said: HashSet<(usize, String)>,
}

/// A line, and what it is about.
#[derive(Debug)]
struct Line {
    /// Kind of the things that have `names`; empty for a line that stands by itself.
    kind: &'static str,
    message: String,
    /// The first [`MAX_LISTED`] names.
    names: Vec<String>,
    n_names: usize,
}

impl Warnings {
    /// Adds a line unless it is there already.
    pub fn add(&mut self, line: String) {
        self.place("", line);
    }

    /// Adds a line about the thing `name` of a kind such as `material`; things of one kind of which the
    /// same is to be said share a line.
    pub fn about(&mut self, kind: &'static str, name: &str, message: String) {
        let place = self.place(kind, message);
        if self.said.insert((place, name.to_owned())) {
            let line = &mut self.lines[place];
            line.n_names += 1;
            if line.names.len() < MAX_LISTED {
                line.names.push(name.to_owned());
            }
        }
    }

    fn place(&mut self, kind: &'static str, message: String) -> usize {
        let Self { lines, places, .. } = self;
        *places.entry((kind, message)).or_insert_with_key(|(kind, message)| {
            lines.push(Line { kind, message: message.clone(), names: Vec::new(), n_names: 0 });
            lines.len() - 1
        })
    }

    /// The lines in the order in which they were added.
    pub fn into_lines(self) -> Vec<String> {
        self.lines.into_iter().map(Line::text).collect()
    }
}

impl Line {
    fn text(self) -> String {
        let Self { kind, message, names, n_names } = self;
        let names: Vec<String> = names.iter().map(|n| format!("`{n}`")).collect();
        match n_names {
            0 => message,
            1 => format!("{kind} {}: {message}", names[0]),
            n if n == names.len() => format!("{kind}s {}: {message}", names.join(", ")),
            n => format!("{kind}s {} and {} more: {message}", names.join(", "), n - names.len()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_said_of_many_is_one_line() {
        let mut warnings = Warnings::default();
        warnings.add("first".into());
        for name in ["a", "b", "a"] {
            warnings.about("material", name, "is odd".into());
        }
        warnings.about("material", "a", "is even".into());
        (0..1000).for_each(|i| warnings.about("light", &i.to_string(), "is dark".into()));
        warnings.add("first".into());
        assert_eq!(
            warnings.into_lines(),
            [
                "first",
                "materials `a`, `b`: is odd",
                "material `a`: is even",
                "lights `0`, `1`, `2` and 997 more: is dark"
            ]
        );
    }
}
