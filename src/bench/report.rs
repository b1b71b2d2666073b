//! Tables, pages and records of all parts.

use std::{fs, path::Path};

use serde_json::{Value, json};

use super::{BenchError, machine::Machine};
use crate::{audit::write_whole, canvas::Canvas, figures::table::Table};

/// What a part has measured.
#[derive(Debug)]
pub struct Section {
    /// Name of the part.
    pub name: &'static str,
    /// Heading of the part in pages.
    pub heading: &'static str,
    /// Tables, by the names of their files.
    pub tables: Vec<(String, Table)>,
    /// Plots, by the names of their files.
    pub plots: Vec<(String, Canvas)>,
    /// Sentences about what the tables do not say.
    pub notes: Vec<String>,
    /// Everything in full precision.
    pub record: Value,
}

/// All parts, with what they were measured on.
#[derive(Debug)]
pub struct Report {
    /// The machine, and versions.
    pub machine: Machine,
    /// The command that measures all of this again.
    pub command: String,
    /// Parts in their order.
    pub sections: Vec<Section>,
}

/// Name of the page among the files of a report.
pub const PAGE: &str = "performance.md";
/// Name of the record among the files of a report.
pub const RECORD: &str = "bench.json";

/// Lines around the part of a page that [`into_page`] replaces.
const MARKS: [&str; 2] = ["<!-- lightopt-embree bench: begin -->", "<!-- lightopt-embree bench: end -->"];

impl Report {
    /// Everything as one JSON object.
    #[must_use]
    pub fn record(&self) -> Value {
        let parts: serde_json::Map<String, Value> =
            self.sections.iter().map(|s| (s.name.to_owned(), s.record.clone())).collect();
        json!({"machine": self.machine, "command": self.command, "parts": parts})
    }

    /// Tables as plain text.
    #[must_use]
    pub fn text(&self) -> String {
        let mut text = self.machine.words() + "\n";
        for section in &self.sections {
            text += &format!("\n== {}\n", section.heading);
            text.extend(section.tables.iter().map(|(_, table)| table.text()));
            text.extend(section.notes.iter().map(|note| format!("note: {note}\n")));
        }
        text
    }

    /// A page in Markdown, with the plots in files beside it.
    #[must_use]
    pub fn markdown(&self) -> String {
        let mut text = format!("Measured by `{}` on {}\n", self.command, self.machine.words());
        for section in &self.sections {
            text += &format!("\n### {}\n\n", section.heading);
            for (_, table) in &section.tables {
                text += &format!("{}\n\n{}\n", table.caption, table.markdown());
            }
            text.extend(section.notes.iter().map(|note| format!("- {note}\n")));
        }
        text
    }

    /// Writes tables as CSV, plots as PNG, the page and the record into a directory, which is made.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub fn write(&self, directory: &Path) -> Result<(), BenchError> {
        for section in &self.sections {
            for (name, table) in &section.tables {
                write_whole(&directory.join(name).with_extension("csv"), table.csv()?)?;
            }
            for (name, canvas) in &section.plots {
                write_whole(&directory.join(name).with_extension("png"), canvas.png()?)?;
            }
        }
        write_whole(&directory.join(PAGE), self.markdown())?;
        write_whole(&directory.join(RECORD), format!("{:#}\n", self.record()))?;
        Ok(())
    }
}

/// Puts a page between the marks of a file that has them, in the place of what stands there.
///
/// # Errors
/// When the file cannot be read or written, or has no marks.
pub fn into_page(file: &Path, page: &str) -> Result<(), BenchError> {
    let text = fs::read_to_string(file).map_err(|source| BenchError::File {
        path: file.to_owned(),
        action: "read",
        source,
    })?;
    let parts =
        text.split_once(MARKS[0]).and_then(|(before, rest)| Some((before, rest.split_once(MARKS[1])?.1)));
    let Some((before, after)) = parts else {
        let fault = format!("has no lines `{}` and `{}` between which to write", MARKS[0], MARKS[1]);
        return Err(BenchError::Answer { path: file.to_owned(), fault });
    };
    let text = format!("{before}{}\n\n{}\n{}{after}", MARKS[0], page.trim_end(), MARKS[1]);
    Ok(write_whole(file, text)?)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use crate::figures::table::Entry;

    fn report() -> Report {
        let table = Table {
            caption: "Numbers.".to_owned(),
            header: vec!["what", "value"],
            rows: vec![vec!["a".into(), Entry::number(0.5)]],
            grouped: 0,
        };
        let section = Section {
            name: "rays",
            heading: "Rays",
            tables: vec![("rays".to_owned(), table)],
            plots: Vec::new(),
            notes: vec!["One.".to_owned()],
            record: json!({"rows": [1]}),
        };
        Report {
            machine: Machine::here(&BTreeMap::new()),
            command: "bench".to_owned(),
            sections: vec![section],
        }
    }

    #[test]
    fn a_report_is_a_page_a_record_and_tables() {
        let directory = tempfile::tempdir().unwrap();
        report().write(directory.path()).unwrap();
        let read = |name: &str| fs::read_to_string(directory.path().join(name)).unwrap();
        assert_eq!(read("rays.csv"), "what,value\na,0.5\n");
        assert!(read(PAGE).contains("### Rays\n\nNumbers.\n\n| what | value |\n"), "{}", read(PAGE));
        let record: Value = serde_json::from_str(&read(RECORD)).unwrap();
        assert_eq!(record["parts"]["rays"]["rows"][0], 1);
        assert!(report().text().contains("note: One."));
    }

    #[test]
    fn a_page_takes_the_place_between_its_marks_and_nothing_else() {
        let directory = tempfile::tempdir().unwrap();
        let file = directory.path().join("README.md");
        fs::write(&file, format!("before\n{}\nold\n{}\nafter\n", MARKS[0], MARKS[1])).unwrap();
        for page in ["new", "newer\n"] {
            into_page(&file, page).unwrap();
            let text = fs::read_to_string(&file).unwrap();
            let wanted = format!("before\n{}\n\n{}\n{}\nafter\n", MARKS[0], page.trim_end(), MARKS[1]);
            assert_eq!(text, wanted);
        }
        fs::write(&file, "nothing").unwrap();
        let error = into_page(&file, "new").unwrap_err().to_string();
        assert!(error.contains("README.md") && error.contains(MARKS[1]), "{error}");
        assert_eq!(fs::read_to_string(&file).unwrap(), "nothing");
    }
}
