//! Tests of EXR files.

use super::*;
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
fn a_file_of_too_many_samples_is_not_written() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("a.exr");
    // Parts count together.
    let error = write_exr(&path, &ExrImage { width: 1 << 14, height: 1 << 14, ..sample() }).unwrap_err();
    assert!(matches!(error, ExrError::Samples { samples, .. } if samples == 11 << 28), "{error}");
    let parts = |n: usize| check_samples(&path, std::iter::repeat_n((1 << 28, 2), n));
    assert!(parts(4).is_ok() && parts(5).is_err());
    assert!(check_samples(&path, [(usize::MAX, usize::MAX)].into_iter()).is_err());
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
