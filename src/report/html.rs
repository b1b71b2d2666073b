//! A page with everything in it.

use std::io::{self, Write};

use base64::prelude::{BASE64_STANDARD, Engine};
use flate2::{Compression, write::ZlibEncoder};
use serde_json::{Value, json};

use super::{ReportError, gather::Look};
use crate::{
    audit::live::Live,
    math::ViewTransform,
    transport::compact::{BLUE_STEPS, ONE, RED_STEPS, STEPS},
};

const PAGE: &str = include_str!("page/page.html");
const STYLE: &str = include_str!("page/page.css");
/// Scripts in their order.
const SCRIPTS: [&str; 9] = [
    include_str!("page/charts.js"),
    include_str!("page/basis.js"),
    include_str!("page/view.js"),
    include_str!("page/color.js"),
    include_str!("page/objective.js"),
    include_str!("page/state.js"),
    include_str!("page/detail.js"),
    include_str!("page/live.js"),
    include_str!("page/page.js"),
];

/// The page of some looks, with the small copies of their bases.
///
/// # Errors
/// When tables cannot be packed, which takes memory alone.
pub fn page(looks: &[Look], bases: &[Live], running: bool) -> Result<String, ReportError> {
    // Names of files have no spaces; headings do.
    let scene = looks.first().map_or_else(String::new, |look| look.scene.replace('_', " "));
    let names: Vec<&str> = looks.iter().map(|look| look.name.as_str()).collect();
    let looks_data = looks.iter().map(|look| {
        let mut data = look.data.clone();
        data["basis"] = json!(look.basis);
        data
    });
    let data = json!({
        "running": running,
        "looks": looks_data.collect::<Vec<_>>(),
        "bases": bases.iter().map(basis).collect::<Result<Vec<_>, _>>()?,
    });
    let kicker = if looks.len() == 1 { format!("Lighting · {}", names[0]) } else { "Lighting".to_owned() };
    let footer = format!("{} {}", env!("CARGO_PKG_NAME"), env!("CARGO_PKG_VERSION"));
    Ok(assemble(&[
        ("title", &escaped(&format!("{scene}: {}", names.join(", ")))),
        ("kicker", &escaped(&kicker)),
        ("heading", &escaped(&scene)),
        ("footer", &escaped(&footer)),
        ("content", ""),
        ("data", &script_data(&data)),
        ("style", STYLE),
        ("script", &SCRIPTS.concat()),
    ]))
}

/// The page with the parts in their places. What stands in a part is not looked at again.
pub fn assemble(parts: &[(&str, &str)]) -> String {
    let mut page = String::new();
    let mut rest = PAGE;
    while let Some((before, after)) = rest.split_once("{{") {
        let (name, after) = after.split_once("}}").unwrap_or((after, ""));
        page.push_str(before);
        page.push_str(parts.iter().find(|(n, _)| *n == name).map_or("", |(_, part)| *part));
        rest = after;
    }
    page + rest
}

/// The style of all pages.
pub fn style() -> &'static str {
    STYLE
}

/// A text in HTML.
pub fn escaped(text: &str) -> String {
    let escape = |out: String, c: char| match c {
        '&' => out + "&amp;",
        '<' => out + "&lt;",
        '>' => out + "&gt;",
        '"' => out + "&quot;",
        '\'' => out + "&#39;",
        c => out + c.encode_utf8(&mut [0; 4]),
    };
    text.chars().fold(String::with_capacity(text.len()), escape)
}

/// JSON that cannot end the element in which it stands.
fn script_data(data: &Value) -> String {
    data.to_string().replace('<', "\\u003c")
}

/// The copy of a basis as the script reads it.
fn basis(live: &Live) -> Result<Value, ReportError> {
    let (copy, facts) = (&live.copy, &live.facts);
    Ok(json!({
        "view": view_tables(facts.about.view).map_err(ReportError::Pack)?,
        "copy": copy.header,
        "names": facts.about.lights,
        "mask": facts.about.mask,
        "luminance": facts.about.luminance,
        "authored": facts.authored,
        "error": facts.error,
        "weights": facts.weights,
        "white": facts.about.white,
        "ties": facts.about.ties,
        "variables": facts.about.variables.iter().map(|v| &v.name).collect::<Vec<_>>(),
        "steps": STEPS,
        "one": ONE,
        "red_steps": RED_STEPS,
        "blue_steps": BLUE_STEPS,
        "codes": copy.codes.iter().map(|codes| BASE64_STANDARD.encode(codes)).collect::<Vec<_>>(),
    }))
}

/// A view as the script reads it: its name, and its tables where it is no formula.
fn view_tables(view: ViewTransform) -> io::Result<Value> {
    let Some(tables) = view.tables() else { return Ok(json!({"name": view})) };
    // Channel by channel, as differences in steps of a 16-bit number: they are small and deflate well.
    let mut before = 0_u16;
    let mut differences = Vec::with_capacity(3 * tables.values.len());
    for c in 0..3 {
        for value in &tables.values {
            let code = (f64::from(value[c]).clamp(0.0, 1.0) * f64::from(u16::MAX)).round() as u16;
            differences.push(code.wrapping_sub(before));
            before = code;
        }
    }
    let mut out = ZlibEncoder::new(Vec::new(), Compression::default());
    for shift in [8, 0] {
        out.write_all(&differences.iter().map(|d| (d >> shift) as u8).collect::<Vec<u8>>())?;
    }
    let rows: Vec<[f64; 3]> = (0..3).map(|i| tables.matrix.row(i).to_array()).collect();
    let tables = json!({
        "matrix": rows,
        "side": tables.side,
        "curve": tables.curve.iter().map(|&v| v as f32).collect::<Vec<f32>>(),
        "scale": tables.scale,
        "lattice": BASE64_STANDARD.encode(out.finish()?),
    });
    Ok(json!({"name": view, "tables": tables}))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_of_a_scene_ends_its_element() {
        let data = script_data(&json!({"name": "</script><b>\"&"}));
        assert!(
            !data.contains('<') && serde_json::from_str::<Value>(&data).unwrap()["name"] == "</script><b>\"&"
        );
        assert_eq!(escaped("<a href=\"'&'\">"), "&lt;a href=&quot;&#39;&amp;&#39;&quot;&gt;");
    }

    #[test]
    fn every_place_of_the_page_is_filled_once() {
        let page = assemble(&[("title", "{{data}}"), ("data", "D"), ("style", STYLE)]);
        assert!(page.contains("<title>{{data}}</title>") && page.contains("id=\"data\">D</script>"));
        assert!(page.ends_with("</html>\n"));
    }

    #[test]
    fn the_page_names_no_place_in_a_network() {
        let page = [PAGE, STYLE, &SCRIPTS.concat()].concat();
        // The namespace of SVG is a name, not a place.
        let page = page.replace("http://www.w3.org/2000/svg", "");
        for place in [
            "http:",
            "https:",
            "//cdn",
            "url(",
            "@import",
            "import(",
            "fetch(",
            "XMLHttp",
            "WebSocket",
            "sendBeacon",
        ] {
            assert!(!page.contains(place), "{place}");
        }
        assert!(PAGE.contains("default-src 'none'"));
    }
}
