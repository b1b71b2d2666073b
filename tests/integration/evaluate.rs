//! `lightopt-embree evaluate`.

use std::path::{Path, PathBuf};

use assert_cmd::Command;
use lightopt_embree::film::exr::{ExrImage, ExrPart, write_exr};
use lightopt_embree::film::image_file::{LinearImage, MaskImage, mask_part, write_mask_png, write_png};
use lightopt_embree::objective::{LuminanceMode, Objective, Target, Term};
use predicates::prelude::*;
use predicates::str::contains;
use serde_json::{Value, json};
use tempfile::TempDir;

const W: usize = 24;
const H: usize = 16;

fn evaluate() -> Command {
    let mut command = Command::cargo_bin("lightopt-embree").unwrap();
    command.arg("evaluate");
    command
}

fn picture() -> LinearImage {
    let rgb = (0..W * H)
        .map(|i| {
            let (x, y) = ((i % W) as f32 / W as f32, (i / W) as f32 / H as f32);
            [x * 0.9, 0.2 + 0.7 * y * x, 1.2 * y]
        })
        .collect();
    LinearImage { width: W, height: H, rgb }
}

fn mask() -> MaskImage {
    let object = (0..W * H).map(|i| (8..16).contains(&(i % W)) && i / W > 4).collect();
    MaskImage { width: W, height: H, object }
}

fn png_and_mask(directory: &TempDir) -> (PathBuf, PathBuf) {
    let (image, mask_file) = (directory.path().join("a.png"), directory.path().join("m.png"));
    write_png(&image, &picture(), 1.0).unwrap();
    write_mask_png(&mask_file, &mask()).unwrap();
    (image, mask_file)
}

/// Our kind of EXR; returns the f_q it records.
fn write_our_exr(path: &Path, exposure: f64, mode: LuminanceMode, target: &Target) -> f64 {
    let (picture, mask) = (picture(), mask());
    let l = mode.encode_image(&picture.rgb, exposure);
    let f_q = Objective::new(target, W, H, &mask.object).unwrap().evaluate(&l).f_q;
    let parts = vec![ExrPart::rgb("beauty", &picture.rgb), mask_part(&mask.object)];
    let lightopt = json!({
        "exposure": exposure, "luminance": mode, "target": target, "f_q": f_q, "x": { "key": 1.5 },
    });
    write_exr(path, &ExrImage { width: W, height: H, parts, lightopt: Some(lightopt) }).unwrap();
    f_q
}

fn json_of(command: &mut Command) -> Value {
    let output = command.arg("--json").assert().success().get_output().stdout.clone();
    serde_json::from_slice(&output).unwrap()
}

#[test]
fn a_png_with_a_mask_gives_a_table_of_every_term() {
    let directory = tempfile::tempdir().unwrap();
    let (image, mask) = png_and_mask(&directory);
    // Terms of colour stand in the table of a target that asks for them only.
    for target in ["high-key", "neon"] {
        let asked = Target::resolve(target).unwrap();
        let mut command = evaluate();
        command.arg(&image).arg("--mask").arg(&mask).args(["--target", target]);
        let mut assert = command.assert().success().stderr("");
        for term in Term::ALL {
            let row = contains(format!("{} ", term.name()));
            let is_asked = term.is_standing() || asked.goal(term).is_some();
            assert = if is_asked { assert.stdout(row) } else { assert.stdout(row.not()) };
        }
        assert.stdout(contains("f_q").and(contains(format!("target {target}"))));
    }
}

#[test]
fn a_png_measures_like_the_picture_it_shows() {
    let directory = tempfile::tempdir().unwrap();
    let (image, mask_file) = png_and_mask(&directory);
    let mut command = evaluate();
    command.arg(&image).arg("--mask").arg(&mask_file).args(["--target", "low-key"]);
    let json = json_of(&mut command);

    let target = Target::resolve("low-key").unwrap();
    let display: Vec<[f32; 3]> = picture().rgb.iter().map(|c| c.map(|v| v.clamp(0.0, 1.0))).collect();
    let l = LuminanceMode::Srgb.encode_image(&display, 1.0);
    let want = Objective::new(&target, W, H, &mask().object).unwrap().evaluate(&l);
    let mut sum = 0.0;
    for t in want.terms() {
        let got = &json["terms"][t.term.name()];
        // 8 bits: a code is 1/255; Sobel sums eight of them, the histogram moves by bins.
        let tolerance = if t.term.is_distance() { 0.02 } else { 0.004 };
        let value = got["value"].as_f64().unwrap();
        assert!((value - t.value).abs() < tolerance, "{:?}: {value} {}", t.term, t.value);
        assert_eq!(got["target"].as_f64(), Some(t.target));
        sum += got["weight"].as_f64().unwrap() * got["f"].as_f64().unwrap();
    }
    assert!((json["f_q"].as_f64().unwrap() - sum).abs() < 1e-14);
}

#[test]
fn exposing_a_png_is_exposing_its_light() {
    let directory = tempfile::tempdir().unwrap();
    let (image, mask) = png_and_mask(&directory);
    let mean = |exposure: &str, luminance: &str| {
        let mut command = evaluate();
        command.arg(&image).arg("--mask").arg(&mask).args(["--target", "low-key"]);
        command.args(["--exposure", exposure, "--luminance", luminance]);
        json_of(&mut command)["terms"]["meanObj"]["value"].as_f64().unwrap()
    };
    // Below the clamp, linear brightness is proportional to exposure.
    let ratio = mean("0.5", "linear") / mean("0.25", "linear");
    assert!((ratio - 2.0).abs() < 1e-9, "{ratio}");
    assert!(mean("0.5", "srgb") > mean("0.5", "linear"));
}

#[test]
fn an_exr_of_ours_reproduces_its_recorded_value_without_options() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("final.exr");
    for (exposure, mode, base) in
        [(1.0, LuminanceMode::Srgb, "high-key"), (0.7, LuminanceMode::Linear, "low-key")]
    {
        let mut target = serde_json::to_value(Target::resolve(base).unwrap()).unwrap();
        target["weights"]["grad"] = json!(1.0 / 3.0);
        let target = Target::from_value(&target).unwrap();
        let recorded = write_our_exr(&path, exposure, mode, &target);
        let json = json_of(evaluate().arg(&path));
        let f_q = json["f_q"].as_f64().unwrap();
        assert!((f_q - recorded).abs() < 1e-12, "{f_q} {recorded}");
        assert_eq!(json["f_q_recorded"].as_f64(), Some(recorded));
        assert_eq!(json["exposure"].as_f64(), Some(exposure));
    }
}

#[test]
fn options_override_what_an_exr_stores() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("final.exr");
    let high = Target::resolve("high-key").unwrap();
    let low = Target::resolve("low-key").unwrap();
    let stored = write_our_exr(&path, 1.0, LuminanceMode::Srgb, &high);
    let other = write_our_exr(&directory.path().join("b.exr"), 2.0, LuminanceMode::Linear, &low);
    assert!((stored - other).abs() > 1e-3);
    let mut command = evaluate();
    command.arg(&path).args(["--target", "low-key", "--exposure", "2", "--luminance", "linear"]);
    let json = json_of(&mut command);
    assert!((json["f_q"].as_f64().unwrap() - other).abs() < 1e-12);
    assert_eq!(json.get("f_q_recorded"), None);
}

#[test]
fn failures_are_one_clear_line_and_code_1() {
    let directory = tempfile::tempdir().unwrap();
    let (image, mask) = png_and_mask(&directory);
    let small = directory.path().join("small.png");
    let object = vec![true, false];
    write_mask_png(&small, &MaskImage { width: 2, height: 1, object }).unwrap();
    let all = directory.path().join("all.png");
    write_mask_png(&all, &MaskImage { width: W, height: H, object: vec![true; W * H] }).unwrap();
    let text = directory.path().join("text.png");
    std::fs::write(&text, "no picture").unwrap();
    let plain = directory.path().join("plain.exr");
    let parts = vec![ExrPart::rgb("", &picture().rgb)];
    let mut exr = ExrImage { width: W, height: H, parts, lightopt: None };
    exr.parts[0].name = "rgb".to_owned();
    write_exr(&plain, &exr).unwrap();
    let broken = directory.path().join("nan.exr");
    exr.parts[0].channels[1].1[W + 3] = f32::NAN;
    write_exr(&broken, &exr).unwrap();
    let bad_target = directory.path().join("t.toml");
    std::fs::write(&bad_target, "schema = 1\nnmae = \"x\"\n").unwrap();

    let high = "high-key".as_ref();
    let missing = directory.path().join("missing.png");
    for (image, mask, target, wanted) in [
        (missing.as_path(), Some(&mask), Some(high), vec!["missing.png: cannot open", "No such"]),
        (&text, Some(&mask), Some(high), vec!["text.png: cannot read it as a picture"]),
        (&image, Some(&small), Some(high), vec!["small.png: the mask has 2 x 1", "24 x 16"]),
        (&image, Some(&all), Some(high), vec!["all.png: the mask marks every pixel as main object"]),
        (&image, Some(&text), Some(high), vec!["text.png: cannot read"]),
        (&image, None, Some(high), vec!["stores no mask", "--mask"]),
        (&image, Some(&mask), None, vec!["stores no target", "--target"]),
        (&image, Some(&mask), Some("hgih-key".as_ref()), vec!["did you mean `high-key`?"]),
        (&image, Some(&mask), Some("no/t.toml".as_ref()), vec!["no/t.toml: cannot read"]),
        (
            &image,
            Some(&mask),
            Some(bad_target.as_path()),
            vec!["t.toml:2: `nmae`: unknown key, did you mean `name`?"],
        ),
        (&plain, None, Some(high), vec!["plain.exr: the picture stores no mask"]),
        (&broken, Some(&mask), Some(high), vec!["nan.exr: the pixel at column 3, row 1"]),
    ] {
        let mut command = evaluate();
        command.arg(image);
        if let Some(mask) = mask {
            command.arg("--mask").arg(mask);
        }
        if let Some(target) = target {
            command.arg("--target").arg(target);
        }
        let assert = command.assert().code(1).stdout("");
        let stderr = String::from_utf8(assert.get_output().stderr.clone()).unwrap();
        assert!(stderr.starts_with("error: ") && stderr.lines().count() == 1, "{stderr}");
        for wanted in wanted {
            assert!(stderr.contains(wanted), "wanted `{wanted}` in: {stderr}");
        }
    }
}

#[test]
fn an_exr_with_nonsense_in_its_attribute_is_an_error() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("a.exr");
    let parts = vec![ExrPart::rgb("beauty", &picture().rgb), mask_part(&mask().object)];
    let mut exr = ExrImage { width: W, height: H, parts, lightopt: None };
    for (lightopt, wanted) in [
        (json!({ "exposure": "x" }), "attribute `lightopt`"),
        (json!({ "exposure": 0.0 }), "exposure must be above 0"),
        (json!({ "target": { "schema": 1 } }), "stored target: `name`: is missing"),
    ] {
        exr.lightopt = Some(lightopt);
        write_exr(&path, &exr).unwrap();
        evaluate().arg(&path).assert().code(1).stderr(contains(wanted));
    }
}

#[test]
fn wrong_usage_is_code_2() {
    evaluate().assert().code(2).stderr(contains("IMAGE"));
    evaluate().args(["a.png", "--exposure", "0"]).assert().code(2).stderr(contains("above 0"));
    evaluate().args(["a.png", "--luminance", "x"]).assert().code(2).stderr(contains("linear"));
    evaluate().arg("--help").assert().success().stdout(contains("six terms"));
}
