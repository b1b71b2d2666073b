//! One self-contained HTML page of all figures and tables.

use std::fmt::Write as _;

use base64::{Engine as _, engine::general_purpose::STANDARD};

use super::table::{Table, html_words};
use crate::canvas::FigureError;

/// A part of a page.
#[derive(Clone, Debug)]
pub enum Block {
    /// A heading.
    Heading(String),
    /// A PNG with its caption.
    Figure {
        /// Bytes of the PNG file.
        png: Vec<u8>,
        /// Caption below the picture.
        caption: String,
    },
    /// A table.
    Table(Table),
    /// Paragraphs in small type.
    Notes(Vec<String>),
}

/// Style sheet of a page.
const STYLE: &str = "
body { font: 16px/1.5 system-ui, 'DejaVu Sans', sans-serif; color: #222; max-width: 1180px; margin: 2.5rem auto; padding: 0 1.5rem; }
h1 { font-size: 1.7rem; margin-bottom: .2rem; }
sub { font-size: .72em; line-height: 0; } h2 { font-size: 1.25rem; margin: 2.8rem 0 .8rem; }
.lead { color: #555; margin-top: 0; }
figure { margin: 1.2rem 0 2rem; } figure img { display: block; max-width: 100%; height: auto; }
figcaption, caption { color: #444; font-size: .92rem; text-align: left; padding: .6rem 0; max-width: 62rem; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-size: .9rem; border-top: 2px solid #222; border-bottom: 2px solid #222; }
caption { caption-side: top; }
th { text-align: left; font-weight: 600; border-bottom: 1px solid #222; }
th, td { padding: .22rem .75rem; white-space: nowrap; } td.n, th.n { text-align: right; font-variant-numeric: tabular-nums; }
tr.begins td { border-top: 1px solid #ccc; }
.notes { color: #555; font-size: .85rem; max-width: 62rem; } .notes p { margin: .4rem 0; }
";

/// HTML of a page: `title`, the line `lead` below it, and the blocks.
///
/// # Errors
/// Never: writing to a string does not fail.
pub fn html(title: &str, lead: &str, blocks: &[Block]) -> Result<String, FigureError> {
    let mut text = format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>{0}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n<h1>{0}</h1>\n<p class=\"lead\">{1}</p>\n",
        html_words(title),
        html_words(lead)
    );
    for block in blocks {
        match block {
            Block::Heading(words) => writeln!(text, "<h2>{}</h2>", html_words(words))?,
            Block::Figure { png, caption } => {
                let words = html_words(caption);
                let image = STANDARD.encode(png);
                writeln!(
                    text,
                    "<figure><img alt=\"\" src=\"data:image/png;base64,{image}\">\
                     <figcaption>{words}</figcaption></figure>"
                )?;
            }
            Block::Table(table) => writeln!(text, "<div class=\"wide\">\n{}</div>", table.html()?)?,
            Block::Notes(notes) => {
                text.push_str("<div class=\"notes\">\n");
                for note in notes {
                    writeln!(text, "<p>{}</p>", html_words(note))?;
                }
                text.push_str("</div>\n");
            }
        }
    }
    text.push_str("</body>\n</html>\n");
    Ok(text)
}
