//! Tables as CSV (full precision), LaTeX (booktabs), HTML, Markdown and plain text.

use std::fmt::{self, Write as _};

use crate::files::csv_file;

/// An entry of a table.
#[derive(Clone, Debug, PartialEq)]
pub enum Entry {
    /// Text.
    Text(String),
    /// A number, and the number of decimals with which it is shown.
    Number(f64, usize),
    /// A dash, for what is not known or has no meaning.
    Dash,
}

impl Entry {
    /// A number shown with three decimals.
    #[must_use]
    pub fn number(value: f64) -> Self {
        Self::Number(value, 3)
    }

    /// A number shown with three decimals; a dash for `None`.
    #[must_use]
    pub fn known(value: Option<f64>) -> Self {
        value.map_or(Self::Dash, Self::number)
    }
}

impl From<&str> for Entry {
    fn from(words: &str) -> Self {
        Self::Text(words.to_owned())
    }
}

impl From<String> for Entry {
    fn from(words: String) -> Self {
        Self::Text(words)
    }
}

/// A table of text and numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// Caption above the table.
    pub caption: String,
    /// Heading of each column.
    pub header: Vec<&'static str>,
    /// Rows, each of as many entries as there are columns.
    pub rows: Vec<Vec<Entry>>,
    /// Number of leading columns whose entries are shown once for rows that share them.
    pub grouped: usize,
}

/// Markup language of a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Markup {
    Latex,
    Html,
    Markdown,
    Plain,
}

/// Symbols by their spelling in captions and headings, with those of LaTeX and HTML.
const SYMBOLS: [(&str, &str, &str); 11] = [
    ("f_q", "$f_q$", "<i>f</i><sub>q</sub>"),
    ("Σ w f", r"$\sum w f$", "Σ <i>w f</i>"),
    ("±", r"$\pm$", "±"),
    ("×", r"$\times$", "×"),
    ("σ", r"$\sigma$", "σ"),
    ("≥", r"$\ge$", "≥"),
    ("…", r"\dots{}", "…"),
    ("“", "``", "“"),
    ("”", "''", "”"),
    ("–", "--", "–"),
    ("—", "---", "—"),
];

/// Text with special characters escaped and symbols replaced.
fn set(words: &str, markup: Markup) -> String {
    let mut out = String::new();
    let mut rest = words;
    while let Some(c) = rest.chars().next() {
        if let Some((symbol, latex, html)) = SYMBOLS.iter().find(|(s, ..)| rest.starts_with(s)) {
            out += match markup {
                Markup::Latex => latex,
                Markup::Html => html,
                Markup::Markdown | Markup::Plain => symbol,
            };
            rest = &rest[symbol.len()..];
            continue;
        }
        match (markup, c) {
            (Markup::Latex, '_' | '&' | '%' | '#' | '$' | '{' | '}') => {
                out.push('\\');
                out.push(c);
            }
            (Markup::Html, '&') => out += "&amp;",
            (Markup::Html, '<') => out += "&lt;",
            (Markup::Html, '>') => out += "&gt;",
            (Markup::Markdown, '|' | '_' | '*' | '<' | '`' | '\\') => {
                out.push('\\');
                out.push(c);
            }
            _ => out.push(c),
        }
        rest = &rest[c.len_utf8()..];
    }
    out
}

/// Text as HTML, with special characters escaped and symbols replaced.
#[must_use]
pub fn html_words(words: &str) -> String {
    set(words, Markup::Html)
}

/// Text of an entry.
fn shown(entry: &Entry, markup: Markup) -> String {
    match entry {
        Entry::Text(words) => set(words, markup),
        Entry::Number(value, decimals) => format!("{value:.decimals$}"),
        Entry::Dash => set("–", markup),
    }
}

/// A caption without its number, as `Table 2. `.
fn unnumbered(caption: &str) -> &str {
    let rest = caption.strip_prefix("Table ").and_then(|rest| rest.split_once(". "));
    rest.filter(|(number, _)| number.parse::<u32>().is_ok()).map_or(caption, |(_, words)| words)
}

impl Table {
    /// Text of a row's entries, empty for the grouped ones that it shares with the row before, and whether
    /// the row begins a group.
    fn visible(&self, row: usize, markup: Markup) -> (Vec<String>, bool) {
        let now = &self.rows[row];
        let before = row.checked_sub(1).map(|r| &self.rows[r]);
        let shared =
            before.map_or(0, |b| now.iter().zip(b).take(self.grouped).take_while(|(a, b)| a == b).count());
        let words =
            now.iter().enumerate().map(|(i, e)| if i < shared { String::new() } else { shown(e, markup) });
        (words.collect(), self.grouped > 0 && shared < self.grouped && row > 0)
    }

    /// Whether a column has a number.
    fn is_number(&self, column: usize) -> bool {
        self.rows.iter().any(|r| matches!(r.get(column), Some(Entry::Number(..))))
    }

    /// Comma-separated: names spelt out in every row, numbers in full precision, nothing for a dash.
    ///
    /// # Errors
    /// When a row has more or fewer entries than the header.
    pub fn csv(&self) -> Result<Vec<u8>, csv::Error> {
        let field = |entry: &Entry| match entry {
            Entry::Text(words) => words.clone(),
            Entry::Number(value, 0) => format!("{value:.0}"),
            Entry::Number(value, _) => format!("{value:?}"),
            Entry::Dash => String::new(),
        };
        let header: Vec<String> = self.header.iter().map(|&h| h.to_owned()).collect();
        let rows = self.rows.iter().map(|row| row.iter().map(field).collect());
        csv_file::encode(std::iter::once(header).chain(rows))
    }

    /// The table as a LaTeX `table*` environment with notes below, made narrower if it were wider than the
    /// line. It needs the packages `booktabs` and `graphicx`. LaTeX numbers tables by itself: the caption's
    /// own number is left out.
    ///
    /// # Errors
    /// Never: writing to a string does not fail.
    pub fn latex(&self, notes: &[&str]) -> Result<String, fmt::Error> {
        let m = Markup::Latex;
        let columns: String =
            (0..self.header.len()).map(|i| if self.is_number(i) { 'r' } else { 'l' }).collect();
        let mut text = String::from(
            "% needs \\usepackage{booktabs,graphicx}\n\\begin{table*}\n\\centering\\small\\setlength{\\tabcolsep}{4pt}\n",
        );
        writeln!(text, "\\caption{{{}}}", set(unnumbered(&self.caption), m))?;
        text.push_str("\\resizebox{\\ifdim\\width>\\linewidth\\linewidth\\else\\width\\fi}{!}{%\n");
        writeln!(text, "\\begin{{tabular}}{{{columns}}}\n\\toprule")?;
        let heads: Vec<String> = self.header.iter().map(|h| set(h, m)).collect();
        writeln!(text, "{} \\\\\n\\midrule", heads.join(" & "))?;
        for i in 0..self.rows.len() {
            let (words, begins) = self.visible(i, m);
            if begins {
                text.push_str("\\addlinespace\n");
            }
            writeln!(text, "{} \\\\", words.join(" & "))?;
        }
        text.push_str("\\bottomrule\n\\end{tabular}}\n");
        for note in notes {
            writeln!(text, "\n\\smallskip\\raggedright\\footnotesize {}\\par", set(note, m))?;
        }
        text.push_str("\\end{table*}\n");
        Ok(text)
    }

    /// The table as an HTML `table` element.
    ///
    /// # Errors
    /// Never: writing to a string does not fail.
    pub fn html(&self) -> Result<String, fmt::Error> {
        let m = Markup::Html;
        let mut text = format!("<table>\n<caption>{}</caption>\n<thead><tr>", set(&self.caption, m));
        for (i, head) in self.header.iter().enumerate() {
            let class = if self.is_number(i) { " class=\"n\"" } else { "" };
            write!(text, "<th{class}>{}</th>", set(head, m))?;
        }
        text.push_str("</tr></thead>\n<tbody>\n");
        let numbers: Vec<bool> = (0..self.header.len()).map(|i| self.is_number(i)).collect();
        for i in 0..self.rows.len() {
            let (words, begins) = self.visible(i, m);
            text.push_str(if begins { "<tr class=\"begins\">" } else { "<tr>" });
            for (word, number) in words.iter().zip(&numbers) {
                let class = if *number { " class=\"n\"" } else { "" };
                write!(text, "<td{class}>{word}</td>")?;
            }
            text.push_str("</tr>\n");
        }
        text.push_str("</tbody>\n</table>\n");
        Ok(text)
    }
}

impl Table {
    /// Text of all entries, row by row, empty for grouped ones that a row shares with the row before.
    fn words(&self, markup: Markup) -> Vec<Vec<String>> {
        (0..self.rows.len()).map(|row| self.visible(row, markup).0).collect()
    }

    /// The table in Markdown as GitHub has it, without its caption.
    #[must_use]
    pub fn markdown(&self) -> String {
        let line = |cells: Vec<String>| format!("| {} |\n", cells.join(" | "));
        let heads = self.header.iter().map(|h| set(h, Markup::Markdown)).collect();
        let sides = (0..self.header.len()).map(|i| if self.is_number(i) { "---:" } else { "---" }.to_owned());
        let rows = self.words(Markup::Markdown).into_iter().map(line).collect::<String>();
        line(heads) + &line(sides.collect()) + &rows
    }

    /// The table in columns of plain text, below its caption.
    #[must_use]
    pub fn text(&self) -> String {
        let heads: Vec<String> = self.header.iter().map(|&h| h.to_owned()).collect();
        let rows: Vec<Vec<String>> = std::iter::once(heads).chain(self.words(Markup::Plain)).collect();
        let width = |i: usize| rows.iter().map(|row| row[i].chars().count()).max().unwrap_or(0);
        let widths: Vec<usize> = (0..self.header.len()).map(width).collect();
        let line = |row: &Vec<String>| {
            let cells = row.iter().enumerate().map(|(i, word)| match self.is_number(i) {
                true => format!("{word:>width$}", width = widths[i]),
                false => format!("{word:<width$}", width = widths[i]),
            });
            cells.collect::<Vec<_>>().join("  ").trim_end().to_owned() + "\n"
        };
        let caption = if self.caption.is_empty() { String::new() } else { format!("{}\n", self.caption) };
        caption + &rows.iter().map(line).collect::<String>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> Table {
        let row = |a: &str, b: f64| vec![a.into(), "x_1, \"y\"".into(), Entry::number(b), Entry::Dash];
        Table {
            caption: "A & B: f_q".to_owned(),
            header: vec!["scene", "what", "f_q", "none"],
            rows: vec![row("a", 0.123_456), row("a", 0.5), row("b", 1.0)],
            grouped: 1,
        }
    }

    #[test]
    fn a_csv_is_complete_and_exact() {
        let csv = String::from_utf8(table().csv().unwrap()).unwrap();
        let lines: Vec<&str> = csv.lines().collect();
        assert_eq!(lines[0], "scene,what,f_q,none");
        assert_eq!(lines[1], "a,\"x_1, \"\"y\"\"\",0.123456,");
        assert!(lines[2].starts_with("a,"));
    }

    #[test]
    fn latex_and_html_escape_and_show_a_shared_name_once() {
        let latex = table().latex(&["50 %"]).unwrap();
        assert!(latex.contains("A \\& B: $f_q$") && latex.contains("50 \\%"), "{latex}");
        assert!(latex.contains("a & x\\_1, \"y\" & 0.123 & -- \\\\\n & x\\_1"), "{latex}");
        assert_eq!(latex.matches("\\addlinespace").count(), 1);
        assert!(latex.contains("{llrl}"));
        let numbered = Table { caption: "Table 2. Terms.".to_owned(), ..table() };
        assert!(numbered.latex(&[]).unwrap().contains("\\caption{Terms.}"));
        assert!(numbered.html().unwrap().contains("Table 2. Terms."));
        let html = table().html().unwrap();
        assert!(html.contains("A &amp; B: <i>f</i><sub>q</sub>"), "{html}");
        assert_eq!(html.matches("<td>a</td>").count(), 1);
        assert_eq!(html.matches("<tr class=\"begins\">").count(), 1);
    }

    #[test]
    fn markdown_and_text_have_a_line_a_row() {
        let markdown = table().markdown();
        let lines: Vec<&str> = markdown.lines().collect();
        assert_eq!(
            lines[..3],
            [
                "| scene | what | f_q | none |",
                "| --- | --- | ---: | --- |",
                "| a | x\\_1, \"y\" | 0.123 | – |",
            ]
        );
        assert_eq!(lines.len(), 5);
        let text = table().text();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[..3], ["A & B: f_q", "scene  what        f_q  none", "a      x_1, \"y\"  0.123  –"]);
    }
}
