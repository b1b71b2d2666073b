//! What all was measured on.

use std::{collections::BTreeMap, fs};

use serde::Serialize;

use crate::embree;

/// The machine and the versions of everything that was measured.
#[derive(Clone, Debug, Serialize)]
pub struct Machine {
    /// Model of the processor.
    pub processor: String,
    /// Number of processors that the program may use.
    pub processors: usize,
    /// Memory, bytes; 0 where it is not known.
    pub memory: u64,
    /// Name of the operating system.
    pub system: String,
    /// Versions by name: this program, Embree, and what other renderers consist of.
    pub versions: BTreeMap<String, String>,
}

/// What follows `key` on its first line of a text.
fn value<'t>(text: &'t str, key: &str, separator: char) -> Option<&'t str> {
    let line = text.lines().find(|line| line.starts_with(key))?;
    Some(line.split_once(separator)?.1.trim().trim_matches('"'))
}

impl Machine {
    /// This machine, with the versions of others.
    #[must_use]
    pub fn here(others: &BTreeMap<String, String>) -> Self {
        let read = |path: &str| fs::read_to_string(path).unwrap_or_default();
        let unknown = || "unknown".to_owned();
        let memory = read("/proc/meminfo");
        let kilobytes = value(&memory, "MemTotal", ':').and_then(|m| m.trim_end_matches(" kB").parse().ok());
        let mut versions = others.clone();
        versions.insert(
            "lightopt-embree".to_owned(),
            format!("{} ({})", env!("CARGO_PKG_VERSION"), env!("LIGHTOPT_COMMIT")),
        );
        versions.insert("embree".to_owned(), format!("{}, {}", embree::version(), embree::isa()));
        Self {
            processor: value(&read("/proc/cpuinfo"), "model name", ':').map_or_else(unknown, str::to_owned),
            processors: std::thread::available_parallelism().map_or(1, usize::from),
            memory: 1024 * kilobytes.unwrap_or(0_u64),
            system: value(&read("/etc/os-release"), "PRETTY_NAME", '=').map_or_else(unknown, str::to_owned),
            versions,
        }
    }

    /// The machine in a sentence.
    #[must_use]
    pub fn words(&self) -> String {
        let gigabytes = self.memory as f64 / f64::from(1 << 30);
        let versions: Vec<String> = self.versions.iter().map(|(name, v)| format!("{name} {v}")).collect();
        format!(
            "{}, {} processors, {gigabytes:.0} GiB, {}; {}.",
            self.processor,
            self.processors,
            self.system,
            versions.join(", ")
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_found_by_their_keys() {
        let text = "processor\t: 0\nmodel name\t: Some CPU @ 2 GHz\nPRETTY_NAME=\"Debian 12\"\n";
        assert_eq!(value(text, "model name", ':'), Some("Some CPU @ 2 GHz"));
        assert_eq!(value(text, "PRETTY_NAME", '='), Some("Debian 12"));
        assert_eq!(value(text, "flags", ':'), None);
    }

    #[test]
    fn this_program_is_among_the_versions() {
        let others = BTreeMap::from([("mitsuba".to_owned(), "3.9.1".to_owned())]);
        let words = Machine::here(&others).words();
        assert!(words.contains("mitsuba 3.9.1") && words.contains(env!("CARGO_PKG_VERSION")), "{words}");
    }
}
