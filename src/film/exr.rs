//! OpenEXR containers: several named parts of f32 channels and one attribute.
//!
//! Ours: part 0 is the beauty with plain channels R, G, B (linear Rec.709 radiance);
//! further parts carry `luminance` (`l`), `mask` (`mask`), light groups and auxiliary
//! channels. Part 0 has one custom attribute, `lightopt`, a JSON text with sorted keys:
//! the `exr` crate keeps custom attributes in a hash map and would write several in random
//! order. Compression is lossless (ZIP) or none, so a picture reads back bit for bit, and equal
//! pictures make equal files.
//!
//! Reading also takes files of other programs: half, float and integer samples, layers
//! as channel prefixes, data windows other than the display window.

mod error;

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use exr::prelude::{
    AnyChannel, AnyChannels, AttributeValue, Encoding, FlatSamples, Image, ImageAttributes, IntegerBounds,
    Layer, LayerAttributes, Layers, MetaData, ReadChannels, ReadLayers, Text, Vec2, WritableImage,
};
use serde_json::Value;

pub use error::ExrError;

use crate::files::atomic::write_atomically;

/// Name of our attribute.
pub const ATTRIBUTE: &str = "lightopt";

/// Most pixels a part may have, 2²⁸: a wrong header must not exhaust the memory.
pub const MAX_PIXELS: usize = 1 << 28;

/// One part: a named group of channels of the picture's size.
#[derive(Clone, Debug, PartialEq)]
pub struct ExrPart {
    /// Its name, unique in the file; may be empty in files of other programs.
    pub name: String,
    /// Names and samples, row-major from the top left; files keep them sorted by name.
    pub channels: Vec<(String, Vec<f32>)>,
}

/// A picture of one or more parts.
#[derive(Clone, Debug, PartialEq)]
pub struct ExrImage {
    /// Width, pixels (of the display window).
    pub width: usize,
    /// Height, pixels.
    pub height: usize,
    /// At least one; part 0 is the beauty.
    pub parts: Vec<ExrPart>,
    /// The `lightopt` attribute of part 0.
    pub lightopt: Option<Value>,
}

impl ExrPart {
    /// A colour part with channels R, G, B.
    #[must_use]
    pub fn rgb(name: impl Into<String>, rgb: &[[f32; 3]]) -> Self {
        Self::triple(name, ["R", "G", "B"], rgb)
    }

    /// A part of three channels, for instance X, Y, Z of a normal.
    #[must_use]
    pub fn triple(name: impl Into<String>, channels: [&str; 3], values: &[[f32; 3]]) -> Self {
        let channels =
            (0..3).map(|c| (channels[c].to_owned(), values.iter().map(|v| v[c]).collect())).collect();
        Self { name: name.into(), channels }
    }

    /// A part of one channel.
    #[must_use]
    pub fn single(name: impl Into<String>, channel: &str, values: Vec<f32>) -> Self {
        Self { name: name.into(), channels: vec![(channel.to_owned(), values)] }
    }

    /// The samples of a channel.
    #[must_use]
    pub fn channel(&self, name: &str) -> Option<&[f32]> {
        self.channels.iter().find(|(n, _)| n == name).map(|(_, samples)| samples.as_slice())
    }

    /// Colours from the channels `{prefix}R`, `{prefix}G`, `{prefix}B`.
    fn colours(&self, prefix: &str) -> Option<Vec<[f32; 3]>> {
        let [r, g, b] = ["R", "G", "B"].map(|c| self.channel(&format!("{prefix}{c}")));
        let (r, g, b) = (r?, g?, b?);
        Some(r.iter().zip(g).zip(b).map(|((&r, &g), &b)| [r, g, b]).collect())
    }
}

impl ExrImage {
    /// The part of this name.
    #[must_use]
    pub fn part(&self, name: &str) -> Option<&ExrPart> {
        self.parts.iter().find(|p| p.name == name)
    }

    /// The picture's colours: plain R, G, B of the first part that has them; else a layer
    /// (channel prefix) with them, one called beauty, combined or rgba first; else a
    /// single Y as grey.
    #[must_use]
    pub fn beauty(&self) -> Option<Vec<[f32; 3]>> {
        if let Some(rgb) = self.parts.iter().find_map(|p| p.colours("")) {
            return Some(rgb);
        }
        let mut layers: Vec<(&ExrPart, &str)> = self
            .parts
            .iter()
            .flat_map(|p| p.channels.iter().map(move |(name, _)| (p, name.as_str())))
            .filter_map(|(p, name)| name.strip_suffix('R').map(|prefix| (p, prefix)))
            .filter(|(_, prefix)| prefix.ends_with('.'))
            .collect();
        let likely = |prefix: &str| {
            let lower = prefix.to_lowercase();
            ["beauty", "combined", "rgba"].iter().any(|known| lower.contains(known))
        };
        layers.sort_by_key(|(_, prefix)| !likely(prefix));
        layers.iter().find_map(|(p, prefix)| p.colours(prefix)).or_else(|| {
            let grey = self.parts.iter().find_map(|p| p.channel("Y"))?;
            Some(grey.iter().map(|&y| [y; 3]).collect())
        })
    }

    /// `part.channel` of every channel, for messages.
    #[must_use]
    pub fn channel_names(&self) -> Vec<String> {
        let mut names = Vec::new();
        for part in &self.parts {
            for (channel, _) in &part.channels {
                names.push(match part.name.as_str() {
                    "" => channel.clone(),
                    name => format!("{name}/{channel}"),
                });
            }
        }
        names
    }
}

/// Writes `image`, whole or not at all.
///
/// # Errors
/// When names, sizes or the destination are not possible.
pub fn write_exr(path: &Path, image: &ExrImage) -> Result<(), ExrError> {
    write_encoded(path, image, Encoding::SMALL_LOSSLESS)
}

/// As [`write_exr`] without compression: much sooner done, and a quarter larger, for noisy
/// floats hardly compress.
///
/// # Errors
/// As [`write_exr`].
pub fn write_exr_plain(path: &Path, image: &ExrImage) -> Result<(), ExrError> {
    write_encoded(path, image, Encoding::UNCOMPRESSED)
}

fn write_encoded(path: &Path, image: &ExrImage, encoding: Encoding) -> Result<(), ExrError> {
    check(path, image)?;
    let size = Vec2(image.width, image.height);
    let text = |kind, name: &str| {
        Text::new_or_none(name).ok_or_else(|| ExrError::Name {
            path: path.to_owned(),
            kind,
            name: name.to_owned(),
        })
    };
    let mut layers = Layers::new();
    for (i, part) in image.parts.iter().enumerate() {
        let mut attributes = LayerAttributes::named(text("part", &part.name)?);
        if let (0, Some(value)) = (i, &image.lightopt) {
            let json = text("attribute", &ascii_json(value))?;
            attributes.other.insert(Text::from(ATTRIBUTE), AttributeValue::Text(json));
        }
        let mut channels = Vec::with_capacity(part.channels.len());
        for (name, samples) in &part.channels {
            channels.push(AnyChannel::new(text("channel", name)?, FlatSamples::F32(samples.clone())));
        }
        let channels = AnyChannels::sort(channels.into());
        layers.push(Layer::new(size, attributes, encoding, channels));
    }
    let exr =
        Image { attributes: ImageAttributes::new(IntegerBounds::from_dimensions(size)), layer_data: layers };
    write_atomically(path, |file| {
        // One thread: pictures are small, and the order of chunks is then beyond doubt.
        exr.write()
            .non_parallel()
            .to_buffered(file)
            .map_err(|source| ExrError::Write { path: path.to_owned(), source })
    })
}

fn check(path: &Path, image: &ExrImage) -> Result<(), ExrError> {
    let &ExrImage { width, height, .. } = image;
    check_size(path, width, height)?;
    if image.parts.is_empty() || image.parts.iter().any(|p| p.channels.is_empty()) {
        return Err(ExrError::Empty { path: path.to_owned() });
    }
    check_names(path, "part", image.parts.iter().map(|p| p.name.as_str()))?;
    for part in &image.parts {
        check_names(path, "channel", part.channels.iter().map(|(name, _)| name.as_str()))?;
        for (channel, samples) in &part.channels {
            if samples.len() != width * height {
                return Err(ExrError::ChannelSize {
                    path: path.to_owned(),
                    part: part.name.clone(),
                    channel: channel.clone(),
                    samples: samples.len(),
                    width,
                    height,
                });
            }
        }
    }
    Ok(())
}

fn check_size(path: &Path, width: usize, height: usize) -> Result<(), ExrError> {
    match width.checked_mul(height) {
        Some(1..=MAX_PIXELS) => Ok(()),
        _ => Err(ExrError::Size { path: path.to_owned(), width, height }),
    }
}

fn check_names<'a>(
    path: &Path,
    kind: &'static str,
    names: impl Iterator<Item = &'a str>,
) -> Result<(), ExrError> {
    let mut seen: Vec<&str> = Vec::new();
    for name in names {
        let printable = name.bytes().all(|b| (b' '..=b'~').contains(&b));
        if !printable || name.is_empty() || name.len() > 255 || seen.contains(&name) {
            let name = name.to_owned();
            return Err(ExrError::Name { path: path.to_owned(), kind, name });
        }
        seen.push(name);
    }
    Ok(())
}

/// JSON with sorted keys in ASCII: EXR texts are bytes.
fn ascii_json(value: &Value) -> String {
    let mut ascii = String::new();
    for c in sorted(value).to_string().chars() {
        if c.is_ascii() {
            ascii.push(c);
        } else {
            // Outside ASCII only string contents occur, where escapes are allowed.
            for unit in c.encode_utf16(&mut [0; 2]) {
                // Writing to a String does not fail.
                let _ = write!(ascii, "\\u{unit:04x}");
            }
        }
    }
    ascii
}

/// Sorts keys even where a dependency turns on `serde_json/preserve_order`.
fn sorted(value: &Value) -> Value {
    match value {
        Value::Object(map) => {
            let ordered: BTreeMap<_, _> = map.iter().map(|(k, v)| (k.clone(), sorted(v))).collect();
            Value::Object(ordered.into_iter().collect())
        }
        Value::Array(list) => Value::Array(list.iter().map(sorted).collect()),
        other => other.clone(),
    }
}

/// Reads an EXR file, ours or another program's. Samples become f32; every part is laid
/// into the display window, 0 where it has no data.
///
/// # Errors
/// When the file is no EXR, too large, deep, subsampled, or its attribute broken.
pub fn read_exr(path: &Path) -> Result<ExrImage, ExrError> {
    let read = |source| ExrError::Read { path: path.to_owned(), source };
    // The headers first: sizes are checked before anything is allocated for them.
    let meta = MetaData::read_from_file(path, false).map_err(read)?;
    for header in &meta.headers {
        check_size(path, header.layer_size.0, header.layer_size.1)?;
        let window = header.shared_attributes.display_window.size;
        check_size(path, window.0, window.1)?;
    }
    let exr = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .from_file(path)
        .map_err(read)?;

    let window = exr.attributes.display_window;
    let mut parts = Vec::with_capacity(exr.layer_data.len());
    let mut lightopt = None;
    for layer in &exr.layer_data {
        if let Some(AttributeValue::Text(text)) = layer.attributes.other.get(ATTRIBUTE.as_bytes())
            && lightopt.is_none()
        {
            let json = serde_json::from_str(&text.to_string())
                .map_err(|source| ExrError::Attribute { path: path.to_owned(), source })?;
            lightopt = Some(json);
        }
        let data = IntegerBounds::new(layer.attributes.layer_position, layer.size);
        let mut channels = Vec::with_capacity(layer.channel_data.list.len());
        for channel in &layer.channel_data.list {
            let name = channel.name.to_string();
            if channel.sampling != Vec2(1, 1) {
                return Err(ExrError::Subsampled { path: path.to_owned(), channel: name });
            }
            let samples: Vec<f32> = channel.sample_data.values_as_f32().collect();
            channels.push((name, fit(samples, data, window)));
        }
        let name = layer.attributes.layer_name.as_ref().map(Text::to_string).unwrap_or_default();
        parts.push(ExrPart { name, channels });
    }
    Ok(ExrImage { width: window.size.0, height: window.size.1, parts, lightopt })
}

/// Lays samples of the data window into the display window.
fn fit(samples: Vec<f32>, data: IntegerBounds, display: IntegerBounds) -> Vec<f32> {
    if data == display {
        return samples;
    }
    let Vec2(width, height) = display.size;
    let mut out = vec![0.0; width * height];
    let dx = i64::from(data.position.0) - i64::from(display.position.0);
    let dy = i64::from(data.position.1) - i64::from(display.position.1);
    for (i, &sample) in samples.iter().enumerate() {
        let x = (i % data.size.0) as i64 + dx;
        let y = (i / data.size.0) as i64 + dy;
        if (0..width as i64).contains(&x) && (0..height as i64).contains(&y) {
            out[y as usize * width + x as usize] = sample;
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use exr::prelude::{SmallVec, f16};
    use serde_json::json;

    const AWKWARD: [f32; 12] = [
        0.0,
        -0.0,
        1.0,
        f32::MAX,
        f32::MIN,
        f32::MIN_POSITIVE,
        1e-45, // the smallest subnormal
        65_519.99,
        1e30,
        0.1,
        f32::INFINITY,
        f32::NEG_INFINITY,
    ];

    fn sample() -> ExrImage {
        let n = 12;
        let rgb: Vec<[f32; 3]> = (0..n).map(|i| [AWKWARD[i], i as f32 / 7.0, AWKWARD[n - 1 - i]]).collect();
        ExrImage {
            width: 4,
            height: 3,
            parts: vec![
                ExrPart::rgb("beauty", &rgb),
                ExrPart::single("luminance", "l", (0..n).map(|i| i as f32).collect()),
                ExrPart::single("mask", "mask", vec![1.0; n]),
                ExrPart::triple("normal", ["X", "Y", "Z"], &rgb),
                ExrPart::rgb("light.key", &rgb),
            ],
            lightopt: Some(json!({
                "zeta": 1.0 / 3.0, "alpha": [1, { "y": 0, "b": "Grüße 𝄞" }], "f_q": 0.1 + 0.2,
            })),
        }
    }

    fn sorted_channels(mut image: ExrImage) -> ExrImage {
        for part in &mut image.parts {
            part.channels.sort_by(|a, b| a.0.cmp(&b.0));
        }
        image
    }

    #[test]
    fn a_picture_reads_back_bit_for_bit() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.exr");
        let image = sorted_channels(sample());
        write_exr(&path, &image).unwrap();
        let read = read_exr(&path).unwrap();
        assert_eq!(read, image);
        for (a, b) in read.parts.iter().zip(&image.parts) {
            for ((_, a), (_, b)) in a.channels.iter().zip(&b.channels) {
                let bits = |s: &[f32]| s.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
                assert_eq!(bits(a), bits(b));
            }
        }
        let rgb = read.beauty().unwrap();
        assert_eq!((rgb[3][0], rgb[3][1]), (f32::MAX, 3.0 / 7.0));
        let f_q = read.lightopt.unwrap()["f_q"].as_f64().unwrap();
        assert_eq!(f_q.to_bits(), (0.1_f64 + 0.2).to_bits());
    }

    #[test]
    fn pixel_noise_of_many_blocks_reads_back_too() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.exr");
        let (width, height) = (67, 53);
        let noise: Vec<f32> = (0..width * height)
            .map(|i| f32::from_bits((i as u32).wrapping_mul(2_654_435_761) & 0x7f7f_ffff))
            .collect();
        let parts = vec![ExrPart::single("x", "v", noise)];
        let image = ExrImage { width, height, parts, lightopt: None };
        write_exr(&path, &image).unwrap();
        assert_eq!(read_exr(&path).unwrap(), image);
    }

    #[test]
    fn equal_pictures_make_equal_files_whatever_the_hash_seed() {
        let directory = tempfile::tempdir().unwrap();
        let bytes = |name: &str| {
            let path = directory.path().join(name);
            write_exr(&path, &sample()).unwrap();
            std::fs::read(path).unwrap()
        };
        // Every HashMap has its own seed, also within one process.
        let first = bytes("0.exr");
        for i in 1..8 {
            assert_eq!(bytes(&format!("{i}.exr")), first);
        }
    }

    #[test]
    fn the_attribute_is_ascii_json_with_sorted_keys() {
        let text = ascii_json(&sample().lightopt.unwrap());
        assert!(text.is_ascii());
        assert!(text.starts_with(r#"{"alpha":[1,{"b":"Gr\u00fc\u00dfe \ud834\udd1e","y":0}],"f_q""#));
        let back: Value = serde_json::from_str(&text).unwrap();
        assert_eq!(Some(back), sample().lightopt);
    }

    #[test]
    fn what_cannot_be_written_is_refused_before_anything_appears() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.exr");
        let refused = |change: &dyn Fn(&mut ExrImage)| {
            let mut image = sample();
            change(&mut image);
            let error = write_exr(&path, &image).unwrap_err();
            assert!(!path.exists());
            assert!(error.to_string().contains("a.exr"), "{error}");
            error
        };
        assert!(matches!(
            refused(&|i| i.parts[1].channels[0].1.truncate(5)),
            ExrError::ChannelSize { samples: 5, .. }
        ));
        assert!(matches!(refused(&|i| i.parts[1].name = "mask".into()), ExrError::Name { kind: "part", .. }));
        assert!(matches!(
            refused(&|i| i.parts[0].channels[0].0 = "G".into()),
            ExrError::Name { kind: "channel", .. }
        ));
        assert!(matches!(refused(&|i| i.parts[2].name = "Maß".into()), ExrError::Name { .. }));
        assert!(matches!(refused(&|i| i.parts.clear()), ExrError::Empty { .. }));
        assert!(matches!(refused(&|i| i.parts[0].channels.clear()), ExrError::Empty { .. }));
        assert!(matches!(refused(&|i| i.width = 0), ExrError::Size { .. }));
        assert!(matches!(refused(&|i| i.width = usize::MAX), ExrError::Size { .. }));
    }

    #[test]
    fn files_that_are_no_exr_are_errors() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.exr");
        assert!(matches!(read_exr(&path), Err(ExrError::Read { .. })));
        std::fs::write(&path, "no picture at all").unwrap();
        assert!(matches!(read_exr(&path), Err(ExrError::Read { .. })));
        write_exr(&path, &sample()).unwrap();
        let whole = std::fs::read(&path).unwrap();
        for part in 1..10 {
            std::fs::write(&path, &whole[..whole.len() * part / 10]).unwrap();
            assert!(matches!(read_exr(&path), Err(ExrError::Read { .. })), "{part}/10");
        }
    }

    #[test]
    fn half_floats_layers_and_data_windows_of_other_programs_are_read() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.exr");
        let half = |name: &str, v: f32| AnyChannel::new(name, FlatSamples::F16(vec![f16::from_f32(v); 4]));
        let channels: SmallVec<_> = [
            half("View Layer.Depth.Z", 9.0),
            half("View Layer.Combined.R", 0.5),
            half("View Layer.Combined.G", 0.25),
            half("View Layer.Combined.B", 2.0),
            half("Albedo.R", 7.0),
            half("Albedo.G", 7.0),
            half("Albedo.B", 7.0),
        ]
        .into_iter()
        .collect();
        // Data: 2 × 2 at (3, 1); display: 3 × 3 at (1, 0).
        let attributes = LayerAttributes { layer_position: Vec2(3, 1), ..LayerAttributes::default() };
        let layer =
            Layer::new((2, 2), attributes, Encoding::SMALL_FAST_LOSSLESS, AnyChannels::sort(channels));
        let window = IntegerBounds::new((1, 0), (3, 3));
        let image = Image { attributes: ImageAttributes::new(window), layer_data: layer };
        image.write().to_file(&path).unwrap();

        let read = read_exr(&path).unwrap();
        assert_eq!((read.width, read.height, read.parts.len()), (3, 3, 1));
        let rgb = read.beauty().unwrap();
        // The data's left column falls on the window's last one, its right column outside.
        for (i, &value) in rgb.iter().enumerate() {
            let inside = i == 5 || i == 8;
            assert_eq!(value, if inside { [0.5, 0.25, 2.0] } else { [0.0; 3] }, "{i}");
        }
        assert!(read.lightopt.is_none());
    }

    #[test]
    fn a_grey_picture_is_its_y_and_one_without_colours_has_no_beauty() {
        let with = |channel: &str| ExrImage {
            width: 1,
            height: 1,
            parts: vec![ExrPart::single("p", channel, vec![0.5])],
            lightopt: None,
        };
        assert_eq!(with("Y").beauty(), Some(vec![[0.5; 3]]));
        assert_eq!(with("Z").beauty(), None);
        assert_eq!(with("Z").channel_names(), ["p/Z"]);
    }
}
