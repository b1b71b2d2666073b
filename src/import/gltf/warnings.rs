//! Warnings, each once, and unique names.

/// What was left out or replaced while reading, one line each.
#[derive(Debug, Default)]
pub struct Warnings(Vec<String>);

impl Warnings {
    /// Adds a line unless it is there already.
    pub fn add(&mut self, line: String) {
        if !self.0.contains(&line) {
            self.0.push(line);
        }
    }

    /// The lines in the order in which they were added.
    pub fn into_lines(self) -> Vec<String> {
        self.0
    }
}

/// `name`, or with `_2` and so on behind it when it is among `taken`.
pub fn unique(name: String, taken: &[String]) -> String {
    let is_free = |n: &String| !taken.contains(n);
    if is_free(&name) {
        return name;
    }
    (2..).map(|i| format!("{name}_{i}")).find(is_free).unwrap_or(name)
}
