//! The layers of an EXR file that are pictures, and which of them is *the* picture.
//!
//! A layer is what its channels' names have before the last dot, in a part of a name. It is a
//! picture when it has R, G and B, or luminance with or without chroma (Y, RY, BY), or one
//! channel of grey as Blender names it (V), or when its part has a single channel that can be grey.

use super::ExrFault;
use super::header::{Channel, Headers, Part};
use crate::files::nearest;

/// Names of the layer that shows everything, in lower case: of Blender, Arnold, Houdini, Nuke,
/// Redshift, V-Ray, Mitsuba and Unreal Engine.
const WHOLE: [&str; 11] =
    ["beauty", "combined", "composite", "rgba", "rgb", "image", "c", "main", "master", "final", "finalimage"];

/// Parts of the names, in lower case, of layers that show one share of the light, or none of it.
const PARTIAL: [&str; 19] = [
    "albedo", "alpha", "ambient", "coat", "crypto", "depth", "diffuse", "direct", "emission", "glossy",
    "mask", "motion", "noise", "normal", "position", "reflect", "shadow", "specular", "variance",
];

/// Names of the channel of a part that has a single one, when it is grey.
const LONE: [&str; 6] = ["R", "G", "L", "luminance", "grey", "gray"];

/// Most names that a message lists.
const MAX_LISTED: usize = 12;

/// A layer that is a picture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layer {
    /// Its name for people: part and channels' prefix; empty where it has none.
    pub name: String,
    /// Index of its part.
    pub part: usize,
    /// Indices of its channels.
    pub colours: Colours,
    /// Index of the channel A.
    pub alpha: Option<usize>,
    /// The view of a stereo picture that it is of.
    view: Option<String>,
    /// Whether that is another one than the default.
    is_other_view: bool,
    /// Parts of its name in lower case, without the view.
    words: Vec<String>,
}

/// Channels that make a colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Colours {
    /// Red, green, blue.
    Rgb([usize; 3]),
    /// Luminance Y, and (R − Y)/Y, (B − Y)/Y.
    Chroma([usize; 3]),
    /// Grey.
    Grey(usize),
}

impl Colours {
    /// The channels in order.
    #[must_use]
    pub fn indices(&self) -> &[usize] {
        match self {
            Self::Rgb(c) | Self::Chroma(c) => c,
            Self::Grey(c) => std::slice::from_ref(c),
        }
    }
}

impl Layer {
    /// The less, the likelier it is what the file shows.
    fn rank(&self) -> (bool, u8) {
        let is_whole = |word: &String| WHOLE.contains(&word.as_str());
        let begins = |word: &String| ["beauty", "combined", "rgba"].iter().any(|w| word.contains(w));
        let by_name = match self.words.as_slice() {
            [] => 0,
            [only] if is_whole(only) => 0,
            [.., last] if is_whole(last) => 1,
            words if words.iter().any(begins) => 2,
            [.., last] if PARTIAL.iter().any(|part| last.contains(part)) => 4,
            _ => 3,
        };
        (self.is_other_view, by_name)
    }
}

/// The pictures among the layers of a file, in its order; those of deep parts only where there
/// are no others.
#[must_use]
pub fn layers(headers: &Headers) -> Vec<Layer> {
    let of = |is_deep: bool| -> Vec<Layer> {
        let parts = headers.parts.iter().enumerate().filter(|(_, part)| part.is_deep == is_deep);
        let default = headers.parts.iter().find_map(|part| part.view.as_deref());
        parts.flat_map(|(i, part)| of_part(i, part, default)).collect()
    };
    Some(of(false)).filter(|flat| !flat.is_empty()).unwrap_or_else(|| of(true))
}

fn of_part(index: usize, part: &Part, default_view: Option<&str>) -> Vec<Layer> {
    let mut prefixes: Vec<&str> = Vec::new();
    for channel in &part.channels {
        let prefix = split(channel).0;
        if !prefixes.contains(&prefix) {
            prefixes.push(prefix);
        }
    }
    let layer = |prefix: &&str| {
        let find = |names: &[&str]| {
            part.channels.iter().position(|c| {
                let (of, name) = split(c);
                of == *prefix && names.iter().any(|n| n.eq_ignore_ascii_case(name))
            })
        };
        let all = |names: [&[&str]; 3]| {
            let [a, b, c] = names.map(find);
            Some([a?, b?, c?])
        };
        // With an X it is a vector.
        let grey = || find(&["Y", "V"]).filter(|_| find(&["X"]).is_none());
        let lone = || find(&LONE).filter(|_| part.channels.len() == 1);
        let colours = all([&["R", "red"], &["G", "green"], &["B", "blue"]])
            .map(Colours::Rgb)
            .or_else(|| all([&["Y"], &["RY"], &["BY"]]).map(Colours::Chroma))
            .or_else(|| grey().or_else(lone).map(Colours::Grey))?;
        let name = joined(&part.name, prefix.trim_end_matches('.'));
        let view = |word: &&str| part.views.iter().any(|v| v == word) || part.view.as_deref() == Some(*word);
        let words = || name.split('.').filter(|w| !w.is_empty());
        let of_channels = || words().find(|w| part.views.iter().any(|v| v == w));
        let own = part.view.as_deref().or_else(of_channels).or(part.views.first().map(String::as_str));
        let default = default_view.or(part.views.first().map(String::as_str));
        Some(Layer {
            part: index,
            colours,
            alpha: find(&["A", "alpha"]),
            view: own.map(str::to_owned),
            is_other_view: own != default,
            words: words().filter(|w| !view(w)).map(str::to_lowercase).collect(),
            name,
        })
    };
    prefixes.iter().filter_map(layer).collect()
}

/// The layer of a channel, with its dot, and the channel's own name.
fn split(channel: &Channel) -> (&str, &str) {
    let dot = channel.name.rfind('.').map_or(0, |i| i + 1);
    channel.name.split_at(dot)
}

fn joined(part: &str, prefix: &str) -> String {
    match (part, prefix) {
        ("", name) | (name, "") => name.to_owned(),
        (part, prefix) if prefix == part || prefix.starts_with(&format!("{part}.")) => prefix.to_owned(),
        (part, prefix) => format!("{part}.{prefix}"),
    }
}

/// The layer of the given name, or the likeliest: first what has no name or one of [`WHOLE`],
/// then what ends so, then what sounds like it, then the first that is not one of [`PARTIAL`], then the first.
/// In our files it is the first.
///
/// # Errors
/// When no layer is a picture, all data are deep, or none or several layers have the name.
pub fn choose<'a>(
    headers: &Headers,
    layers: &'a [Layer],
    wanted: Option<&str>,
) -> Result<&'a Layer, ExrFault> {
    if layers.is_empty() && headers.parts.iter().all(|part| part.is_deep) {
        return Err(ExrFault::Deep);
    }
    let Some(name) = wanted else {
        let is_ours = headers.parts[0].attribute.is_some();
        let mut order: Vec<&Layer> = layers.iter().collect();
        order.sort_by_key(|layer| if is_ours { (layer.part > 0, 0) } else { layer.rank() });
        return order.first().copied().ok_or_else(|| ExrFault::NoPicture(channel_names(headers)));
    };
    let same = |a: &str| a.eq_ignore_ascii_case(name);
    let tests: [&dyn Fn(&Layer) -> bool; 5] = [
        &|l| l.name == name,
        &|l| same(&l.name),
        &|l| same(&headers.parts[l.part].name),
        &|l| l.name.rsplit('.').next().is_some_and(same),
        &|l| l.view.as_deref().is_some_and(same),
    ];
    for test in tests {
        let mut fitting = layers.iter().filter(|layer| test(layer));
        match (fitting.next(), fitting.next()) {
            (Some(only), None) => return Ok(only),
            (Some(a), Some(b)) => {
                let choices = format!("{} or {}", quoted(&a.name), quoted(&b.name));
                return Err(ExrFault::Layer { name: name.to_owned(), choices });
            }
            (None, _) => {}
        }
    }
    let names = || layers.iter().map(|l| l.name.as_str()).filter(|n| !n.is_empty());
    let choices = nearest(name, names()).map_or_else(|| listed(names()), quoted);
    Err(ExrFault::Layer { name: name.to_owned(), choices })
}

/// Names in a message.
pub fn listed<'a>(names: impl Iterator<Item = &'a str>) -> String {
    let names: Vec<String> = names.map(quoted).collect();
    match names.len() {
        0 => "none".into(),
        n if n > MAX_LISTED => format!("{} and {} more", names[..MAX_LISTED].join(", "), n - MAX_LISTED),
        _ => names.join(", "),
    }
}

/// A name in a message.
pub fn quoted(name: &str) -> String {
    if name.is_empty() { "one without a name".into() } else { format!("`{name}`") }
}

fn channel_names(headers: &Headers) -> String {
    let all = headers.parts.iter().flat_map(|part| {
        part.channels.iter().map(|c| match part.name.as_str() {
            "" => c.name.clone(),
            name => format!("{name}/{}", c.name),
        })
    });
    let names: Vec<String> = all.collect();
    listed(names.iter().map(String::as_str))
}
