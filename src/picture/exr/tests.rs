use std::io::Cursor;

use exr::meta::attribute::SampleType;
use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image, ImageAttributes, IntegerBounds, Layer as ExrLayer,
    LayerAttributes, SmallVec, Vec2, WritableImage, f16,
};

use super::header::Headers;
use super::*;
use crate::picture::{Fault, Picture, Purpose, Reading};

const PLAIN: &[u8] = include_bytes!("../../../tests/data/pictures/plain.exr");
const PARTS: &[u8] = include_bytes!("../../../tests/data/pictures/deep-between.exr");

fn read(bytes: &[u8]) -> Result<Picture, Fault> {
    Picture::decode(bytes, &Reading::of(Purpose::Light))
}

/// Encodes one layer of constant half-float channels.
fn constant(
    channels: &[(&str, f32)],
    size: (usize, usize),
    position: (i32, i32),
    display: IntegerBounds,
    encoding: Encoding,
) -> Vec<u8> {
    let n = size.0 * size.1;
    let channel =
        |&(name, v): &(&str, f32)| AnyChannel::new(name, FlatSamples::F16(vec![f16::from_f32(v); n]));
    let channels: SmallVec<_> = channels.iter().map(channel).collect();
    let attributes =
        LayerAttributes { layer_position: Vec2(position.0, position.1), ..LayerAttributes::default() };
    let layer = ExrLayer::new(size, attributes, encoding, AnyChannels::sort(channels));
    let image = Image { attributes: ImageAttributes::new(display), layer_data: layer };
    let mut bytes = Cursor::new(Vec::new());
    image.write().to_buffered(&mut bytes).unwrap();
    bytes.into_inner()
}

#[test]
fn half_floats_layers_and_data_windows_of_other_programs_are_read() {
    let channels = [
        ("View Layer.Depth.Z", 9.0),
        ("View Layer.Combined.R", 0.5),
        ("View Layer.Combined.G", 0.25),
        ("View Layer.Combined.B", 2.0),
        ("Albedo.R", 7.0),
        ("Albedo.G", 7.0),
        ("Albedo.B", 7.0),
    ];
    // Data: 2 × 2 at (3, 1); display: 3 × 3 at (1, 0).
    let display = IntegerBounds::new((1, 0), (3, 3));
    for encoding in [Encoding::SMALL_FAST_LOSSLESS, Encoding::SMALL_LOSSLESS, Encoding::UNCOMPRESSED] {
        let picture = read(&constant(&channels, (2, 2), (3, 1), display, encoding)).unwrap();
        assert_eq!((picture.width, picture.height), (3, 3));
        // The data's left column falls on the window's last one, its right column outside.
        for i in 0..9 {
            let inside = i == 5 || i == 8;
            let want = if inside { [0.5, 0.25, 2.0] } else { [0.0; 3] };
            assert_eq!(picture.over_black(i), want, "{i}");
        }
    }
}

#[test]
fn names_of_channels_may_be_in_any_script_or_in_none() {
    let channels = [("B", 0.25), ("G", 0.5), ("R", 2.0), ("zzz.Z", 9.0)];
    let display = IntegerBounds::new((0, 0), (2, 2));
    let mut bytes = constant(&channels, (2, 2), (0, 0), display, Encoding::SMALL_LOSSLESS);
    let at = bytes.windows(5).position(|w| w == b"zzz.Z").unwrap();
    for name in ["層".as_bytes(), &[0xff; 3]] {
        bytes[at..at + 3].copy_from_slice(name);
        assert_eq!(read(&bytes).unwrap().over_black(3), [2.0, 0.5, 0.25], "{name:?}");
    }
}

/// Headers of parts by name and channels.
fn headers(parts: &[(&str, &[&str])]) -> Headers {
    let channel = |name: &&str| Channel {
        name: (*name).to_owned(),
        kind: SampleType::F16,
        is_linear: false,
        sampling: [1, 1],
    };
    let part = |(name, channels): &(&str, &[&str])| Part {
        name: (*name).to_owned(),
        channels: channels.iter().map(channel).collect(),
        ..Part::default()
    };
    Headers { is_multipart: parts.len() > 1, parts: parts.iter().map(part).collect() }
}

const RGB: &[&str] = &["B", "G", "R"];

/// Name of the layer that is chosen, or the message.
fn chosen(parts: &[(&str, &[&str])], name: Option<&str>) -> String {
    let headers = headers(parts);
    let layers = layers::layers(&headers);
    layers::choose(&headers, &layers, name).map_or_else(|e| e.to_string(), |layer| layer.name.clone())
}

#[test]
fn names_tell_which_layer_is_the_picture() {
    let combined: &[&str] = &["V.Combined.B", "V.Combined.G", "V.Combined.R"];
    let key: &[&str] = &["V.Combined_key.B", "V.Combined_key.G", "V.Combined_key.R"];
    for (parts, want) in [
        (&[("", RGB)][..], ""),
        (&[("albedo", RGB), ("beauty", RGB)], "beauty"),
        (&[("N", &["X", "Y", "Z"]), ("albedo", RGB), ("RGBA", RGB)], "RGBA"),
        (&[("", &["B", "G", "R", "diffuse.B", "diffuse.G", "diffuse.R"])], ""),
        (&[("", &["diffuse.B", "diffuse.G", "diffuse.R", "C.b", "C.g", "C.r"])], "C"),
        (&[("V.Combined_key", key), ("V.Combined", combined)], "V.Combined"),
        (&[("one", RGB), ("two", RGB)], "one"),
        (&[("depth", &["Z"]), ("grey", &["Y"])], "grey"),
        (&[("depth", &["Z"]), ("lone", &["R"])], "lone"),
        (&[("", &["G", "R"])], "needs channels R, G, B (or Y, or V), the file has `G`, `R`"),
        (&[("first", RGB), ("the_beauty_pass", RGB)], "the_beauty_pass"),
        (&[("depth", &["Z"])], "needs channels R, G, B (or Y, or V), the file has `depth/Z`"),
    ] {
        assert_eq!(chosen(parts, None), want, "{parts:?}");
    }
}

#[test]
fn a_layer_is_chosen_by_any_name_that_means_one() {
    let parts: &[(&str, &[&str])] = &[("a.beauty", RGB), ("b.beauty", RGB), ("b.Albedo", RGB)];
    for (name, want) in [
        ("b.beauty", "b.beauty"),
        ("A.BEAUTY", "a.beauty"),
        ("albedo", "b.Albedo"),
        ("beauty", "no single layer is called `beauty`; choose `a.beauty` or `b.beauty`"),
        ("b.albdeo", "no single layer is called `b.albdeo`; choose `b.Albedo`"),
        ("x", "no single layer is called `x`; choose `a.beauty`, `b.beauty`, `b.Albedo`"),
    ] {
        assert_eq!(chosen(parts, Some(name)), want, "{name}");
    }
}

#[test]
fn luminance_chroma_and_grey_are_told_from_vectors() {
    let colours =
        |channels: &[&str]| layers::layers(&headers(&[("", channels)])).first().map(|layer| layer.colours);
    assert_eq!(colours(&["BY", "RY", "Y"]), Some(Colours::Chroma([2, 1, 0])));
    assert_eq!(colours(&["A", "Y"]), Some(Colours::Grey(1)));
    assert_eq!(colours(&["V"]), Some(Colours::Grey(0)));
    assert_eq!(colours(&["Y", "Z"]), Some(Colours::Grey(0)));
    assert_eq!(colours(&["X", "Y", "Z"]), None);
    assert_eq!(colours(&["blue", "green", "red"]), Some(Colours::Rgb([2, 1, 0])));
}

#[test]
fn files_that_are_cut_off_or_changed_are_refused_or_read_but_never_panic() {
    for whole in [PLAIN, PARTS] {
        for n in 0..whole.len() {
            assert!(read(&whole[..n]).is_err(), "{n} of {}", whole.len());
        }
        let mut changed = whole.to_vec();
        for i in 4..whole.len() {
            for value in [0, 1, 0x7f, 0x80, 0xff] {
                changed[i] = value;
                let _ = read(&changed);
            }
            changed[i] = whole[i];
        }
    }
}

#[test]
fn a_window_of_absurd_size_is_refused_before_anything_is_reserved() {
    let name = b"dataWindow\0box2i\0";
    let at = PLAIN.windows(name.len()).position(|w| w == name).unwrap() + name.len() + 4;
    // Only the data window: its rows would be decoded to be shown in a small picture.
    let mut bytes = PLAIN.to_vec();
    bytes[at + 8..at + 12].copy_from_slice(&0x3fff_fff0_u32.to_le_bytes());
    let error = read(&bytes).unwrap_err();
    assert!(error.to_string().contains("a block of the file takes"), "{error}");
    let name = b"displayWindow\0box2i\0";
    let at = PLAIN.windows(name.len()).position(|w| w == name).unwrap() + name.len() + 4;
    let mut bytes = PLAIN.to_vec();
    bytes[at + 8..at + 12].copy_from_slice(&0x7fff_ffff_u32.to_le_bytes());
    let error = read(&bytes).unwrap_err();
    assert!(error.to_string().contains("2147483648 x 24 pixels are over the limit"), "{error}");
}
