//! `learn-signature`, `classify`, and photographs as targets.

use std::fs;
use std::path::Path;

use assert_cmd::Command;
use image::codecs::jpeg::JpegEncoder;
use image::{ImageBuffer, ImageEncoder, Luma, Rgb, RgbImage};
use lightopt_embree::film::image_file::{MaskImage, write_mask_png};
use lightopt_embree::math::display::oetf_srgb;
use lightopt_embree::math::stats::sidak_z;
use lightopt_embree::objective::signature::Signature;
use lightopt_embree::objective::signature::library::Library;
use lightopt_embree::objective::special::beta_cdf;
use lightopt_embree::objective::{Goal, Target, Term};
use predicates::prelude::*;
use predicates::str::contains;
use serde_json::Value;
use tempfile::TempDir;

use crate::room::{QUICK, Room, names, program, refused};

fn json_of(command: &mut Command) -> Value {
    let output = command.arg("--json").assert().success().get_output().stdout.clone();
    serde_json::from_slice(&output).unwrap()
}

/// Beta of mean and sigma.
fn shape(mean: f64, sigma: f64) -> (f64, f64) {
    let precision = mean * (1.0 - mean) / (sigma * sigma) - 1.0;
    (mean * precision, (1.0 - mean) * precision)
}

/// Uniform variates, seeded.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = lightopt_embree::math::hash::mix64(self.0);
        (self.0 >> 11) as f64 * (-53.0_f64).exp2()
    }
}

/// Independent draws of a Beta, by inversion.
fn draws(random: &mut Random, n: usize, (a, b): (f64, f64)) -> Vec<f64> {
    let table: Vec<f64> = (0..=4096).map(|i| beta_cdf(f64::from(i) / 4096.0, a, b)).collect();
    (0..n)
        .map(|_| {
            let u = random.next();
            let i = table.partition_point(|&p| p <= u).clamp(1, 4096);
            let within = (u - table[i - 1]) / (table[i] - table[i - 1]);
            ((i - 1) as f64 + within.clamp(0.0, 1.0)) / 4096.0
        })
        .collect()
}

/// Folders `high` and `low` of small noise pictures, three each.
fn two_folders(directory: &TempDir) {
    let mut random = Random(5);
    for (class, mean) in [("high", 0.75), ("low", 0.15)] {
        fs::create_dir(directory.path().join(class)).unwrap();
        for i in 0..3 {
            let l = draws(&mut random, 24 * 16, shape(mean + 0.02 * f64::from(i), 0.12));
            let picture =
                ImageBuffer::from_fn(24, 16, |x, y| Luma([(255.0 * l[(24 * y + x) as usize]).round() as u8]));
            picture.save(directory.path().join(class).join(format!("{class}{i}.png"))).unwrap();
        }
    }
}

fn learn(directory: &Path, options: &[&str]) -> Command {
    let mut command = program(directory);
    command.args(["learn-signature", "--class", "high=high", "--class", "low=low", "-o", "styles.toml"]);
    command.args(options);
    command
}

/// Black-and-white masks: object in the left half.
fn write_masks(directory: &TempDir, width: usize, height: usize, stems: &[&str]) {
    fs::create_dir_all(directory.path().join("masks")).unwrap();
    for stem in stems {
        let object = (0..width * height).map(|i| i % width < width / 2).collect();
        let path = directory.path().join(format!("masks/{stem}.png"));
        write_mask_png(&path, &MaskImage { width, height, object }).unwrap();
    }
}

#[test]
fn a_known_distribution_is_recovered_to_sampling_and_quantisation() {
    let directory = tempfile::tempdir().unwrap();
    // As large as a photograph may be that is not reduced; the filter would average the noise away.
    let (width, height, photos) = (512_u32, 512_u32, 4);
    let n = (width * height) as usize;
    for (bits, levels) in [(8, 255.0), (16, 65_535.0)] {
        for (mean, sigma) in [(0.47, 0.23), (0.78, 0.17), (0.45, 0.33)] {
            let (a, b) = shape(mean, sigma);
            let mut random = Random(bits + (mean * 100.0) as u64);
            let folder = directory.path().join(format!("{bits}-{mean}"));
            fs::create_dir(&folder).unwrap();
            for i in 0..photos {
                let l = draws(&mut random, n, (a, b));
                let code = |x: u32, y: u32| (levels * l[(width * y + x) as usize]).round();
                let path = folder.join(format!("{i}.png"));
                if bits == 8 {
                    let f = |x, y| Luma([code(x, y) as u8]);
                    ImageBuffer::from_fn(width, height, f).save(path).unwrap();
                } else {
                    let f = |x, y| Luma([code(x, y) as u16]);
                    ImageBuffer::from_fn(width, height, f).save(path).unwrap();
                }
            }
            let class = format!("known={}", folder.display());
            let mut command = program(directory.path());
            command.args(["learn-signature", "--class", &class, "-o", "known.toml"]).assert().success();
            let got = Library::find(&directory.path().join("known.toml"), "known").unwrap().cumulated();

            let z = sidak_z(0.01, 255);
            for (i, got) in got.iter().enumerate().take(255) {
                let edge = (i + 1) as f64 / 256.0;
                let p = beta_cdf(edge, a, b);
                // The standard error of a share of all pixels. The ramp spreads a pixel over a bin,
                // and a pixel is off by half a code at most: q lies between P at these distances,
                // averaged over the ramp.
                let sampling = z * (p * (1.0 - p) / (photos * n) as f64).sqrt();
                let half = 0.5 / levels + 1e-6;
                let averaged = |shift: f64| {
                    let at = |t: f64| beta_cdf((edge + shift + t / 256.0).clamp(0.0, 1.0), a, b);
                    (0..64).map(|k| at((f64::from(k) + 0.5) / 64.0 - 0.5)).sum::<f64>() / 64.0
                };
                let (low, high) = (averaged(-half), averaged(half));
                assert!(
                    (low - sampling..=high + sampling).contains(got),
                    "{bits} bits, mean {mean}, bin {i}: {got} not in {low}..{high} ± {sampling}"
                );
            }
        }
    }
}

#[test]
fn classes_that_differ_are_told_apart_and_the_same_again_gives_the_same_bytes() {
    let directory = tempfile::tempdir().unwrap();
    two_folders(&directory);
    for options in [&[][..], &["--barycentre"]] {
        let json = json_of(learn(directory.path(), options).args(["--threads", "1"]));
        assert_eq!(json["confusion"]["high"]["high"], 3);
        assert_eq!(json["confusion"]["low"]["low"], 3);
        assert_eq!((json["right"].as_u64(), json["judged"].as_u64()), (Some(6), Some(6)));
        assert_eq!(json["classes"][0]["photos"][2]["file"], "high2.png");
        let first = fs::read(directory.path().join("styles.toml")).unwrap();
        let again = json_of(learn(directory.path(), options).args(["--threads", "3"]));
        assert_eq!(json, again);
        assert_eq!(first, fs::read(directory.path().join("styles.toml")).unwrap());
        // Nothing of where or when.
        let text = String::from_utf8(first).unwrap();
        assert!(!text.contains(&*directory.path().to_string_lossy()) && text.contains("high0.png"));
    }
    let table = learn(directory.path(), &[]).assert().success().stderr("");
    table.stdout(contains("6 of 6 are nearest to their own class").and(contains("styles.toml")));
    assert_eq!(names(directory.path()), ["high", "low", "styles.toml"]);

    let mut classify = program(directory.path());
    classify.args(["classify", "--signatures", "styles.toml", "high/high0.png", "low/low2.png"]);
    let verdicts = json_of(&mut classify);
    assert_eq!((&verdicts[0]["nearest"], &verdicts[1]["nearest"]), (&"high".into(), &"low".into()));
    let d = |i: usize| verdicts[0]["distances"][i]["distance"].as_f64().unwrap();
    assert!(d(0) < d(1) && verdicts[0]["margin"].as_f64() == Some(d(1) - d(0)));
}

#[test]
fn built_in_signatures_recognise_pictures_of_their_own() {
    let directory = tempfile::tempdir().unwrap();
    let mut random = Random(7);
    let names = ["high", "low", "high-photo", "medium"];
    for name in names {
        // By inversion of the cumulated values, to the upper edge of the bin.
        let p = Signature::builtin(name).unwrap().cumulated();
        let picture = ImageBuffer::from_fn(200, 150, |_, _| {
            let u = random.next();
            Luma([p.partition_point(|&p| p <= u) as u8])
        });
        picture.save(directory.path().join(format!("{name}.png"))).unwrap();
    }
    let mut classify = program(directory.path());
    classify.arg("classify").args(names.map(|name| format!("{name}.png")));
    let table = classify.assert().success().stderr("").get_output().stdout.clone();
    let table = String::from_utf8(table).unwrap();
    for (line, name) in table.lines().zip(names) {
        assert!(
            line.starts_with(&format!("{name}.png:  {name} 0.0")) && line.contains("  margin 0."),
            "{table}"
        );
    }
    assert_eq!(table.lines().count(), 4);
}

#[test]
fn a_stranger_in_a_folder_is_flagged_and_kept() {
    let directory = tempfile::tempdir().unwrap();
    two_folders(&directory);
    fs::copy(directory.path().join("low/low0.png"), directory.path().join("high/odd.png")).unwrap();
    let json = json_of(&mut learn(directory.path(), &[]));
    assert_eq!(json["classes"][0]["outliers"], serde_json::json!(["odd.png"]));
    assert_eq!(json["confusion"]["high"]["low"], 1);
    let library = Library::read(&directory.path().join("styles.toml")).unwrap();
    assert_eq!(
        (library.classes[0].count, library.classes[0].outliers.as_slice()),
        (4, &["odd.png".into()][..])
    );
}

/// An upright picture of 40 × 24 with a bright object in the top left corner.
fn upright() -> RgbImage {
    ImageBuffer::from_fn(40, 24, |x, y| {
        if x < 16 && y < 8 { Rgb([230, 230, 230]) } else { Rgb([(4 * y) as u8, 20, 40]) }
    })
}

fn write_jpeg(path: &Path, picture: &RgbImage, orientation: u8) {
    // Exif: a big-endian TIFF whose only entry is the orientation (tag 0x0112, one SHORT).
    let mut exif = b"MM\0\x2a\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0".to_vec();
    exif.extend([orientation, 0, 0, 0, 0, 0, 0]);
    let mut encoder = JpegEncoder::new_with_quality(fs::File::create(path).unwrap(), 100);
    encoder.set_exif_metadata(exif).unwrap();
    let (width, height) = picture.dimensions();
    encoder.write_image(picture.as_raw(), width, height, image::ExtendedColorType::Rgb8).unwrap();
}

#[test]
fn a_photograph_that_its_exif_rotates_is_measured_upright_under_its_mask() {
    let directory = tempfile::tempdir().unwrap();
    for (name, picture, orientation) in
        [("plain", upright(), 1), ("turned", image::imageops::rotate270(&upright()), 6)]
    {
        fs::create_dir(directory.path().join(name)).unwrap();
        write_jpeg(&directory.path().join(format!("{name}/{name}.jpg")), &picture, orientation);
        let object = (0..40 * 24).map(|i| i % 40 < 16 && i / 40 < 8).collect();
        fs::create_dir_all(directory.path().join("masks")).unwrap();
        let mask = MaskImage { width: 40, height: 24, object };
        write_mask_png(&directory.path().join(format!("masks/{name}.png")), &mask).unwrap();
    }
    let mut command = program(directory.path());
    command.args(["learn-signature", "--class", "plain=plain", "--class", "turned=turned"]);
    let json = json_of(command.args(["--masks", "masks", "-o", "s.toml"]));
    let value = |class: usize, key: &str| json["classes"][class]["targets"][key].as_f64().unwrap();
    for key in ["meanObj", "meanBack", "varObj", "varBack", "grad"] {
        // JPEG compresses the turned picture a little differently.
        assert!((value(0, key) - value(1, key)).abs() < 0.01, "{key}: {json:#}");
    }
    assert!((value(1, "meanObj") - 230.0 / 255.0).abs() < 0.01);
    assert!(value(1, "varObj") < 0.03 && value(1, "meanBack") < 0.3);

    let target = Target::resolve(directory.path().join("s-turned.toml").to_str().unwrap()).unwrap();
    assert_eq!(target.name(), "s-turned");
    let library = Library::find(&directory.path().join("s.toml"), "turned").unwrap();
    let Some(Goal::Signature(signature)) = target.goal(Term::Hist) else { panic!("no signature") };
    assert_eq!(signature.cumulated(), library.cumulated());
}

#[test]
fn large_photographs_are_reduced_in_linear_light() {
    let directory = tempfile::tempdir().unwrap();
    fs::create_dir(directory.path().join("a")).unwrap();
    // Columns black and white: at half the size all pixels have half the light.
    let stripes = ImageBuffer::from_fn(1024, 64, |x, _| Luma([if x % 2 == 0 { 0_u8 } else { 255 }]));
    stripes.save(directory.path().join("a/stripes.png")).unwrap();
    let share_below = |side: &str, l: f64| {
        let mut command = program(directory.path());
        command.args(["learn-signature", "--class", "a=a", "--longest-side", side, "-o", "s.toml"]);
        command.assert().success();
        let p = Library::find(&directory.path().join("s.toml"), "a").unwrap().cumulated();
        p[(256.0 * l) as usize - 1]
    };
    let half = oetf_srgb(0.5);
    for (side, below, above) in [("512", 0.0, 1.0), ("1024", 0.5, 0.5)] {
        // The sum over the pixels rounds.
        assert!((share_below(side, half - 0.01) - below).abs() < 1e-9, "{side}");
        assert!((share_below(side, half + 0.01) - above).abs() < 1e-9, "{side}");
    }
}

#[test]
fn wrong_folders_photographs_and_masks_are_refused_in_one_line() {
    let directory = tempfile::tempdir().unwrap();
    two_folders(&directory);
    fs::create_dir(directory.path().join("empty")).unwrap();
    let with = |options: &[&str]| {
        let mut command = learn(directory.path(), &[]);
        command.args(options);
        command
    };
    refused(&mut with(&["--class", "x=empty"]), &["empty: no pictures in the folder"]);
    refused(&mut with(&["--class", "x=missing"]), &["missing: cannot read the folder"]);
    refused(&mut with(&["--class", "high=low"]), &["--class: two classes are called `high`"]);
    refused(&mut with(&["--masks", "empty"]), &["empty: no pictures"]);
    write_masks(&directory, 24, 16, &["high0", "high1", "high2", "low0", "low1"]);
    refused(&mut with(&["--masks", "masks"]), &["masks: no mask for low/low2.png", "low2.png"]);
    write_masks(&directory, 12, 16, &["low2"]);
    let sizes = ["masks/low2.png: the mask has 12 x 16 pixels", "low/low2.png 24 x 16"];
    refused(&mut with(&["--masks", "masks"]), &sizes);
    write_masks(&directory, 24, 16, &["low2"]);
    let black = MaskImage { width: 24, height: 16, object: vec![false; 24 * 16] };
    write_mask_png(&directory.path().join("masks/low0.png"), &black).unwrap();
    refused(&mut with(&["--masks", "masks"]), &["masks/low0.png", "the mask marks no pixel"]);
    fs::write(directory.path().join("masks/low0.png"), "no picture").unwrap();
    refused(&mut with(&["--masks", "masks"]), &["masks/low0.png: cannot read it as a picture"]);
    fs::write(directory.path().join("empty/broken.jpg"), "no picture").unwrap();
    refused(&mut with(&["--class", "x=empty"]), &["empty/broken.jpg: cannot read it as a picture"]);
    let mut command = program(directory.path());
    command.args(["learn-signature", "--class", "a=low", "-o", "styles.txt"]);
    refused(&mut command, &["styles.txt: the signature library ends in .toml"]);
    // Nothing of all that left a file.
    assert_eq!(names(directory.path()), ["empty", "high", "low", "masks"]);
    let usage = ["learn-signature", "--class", "a/b=low", "-o", "s.toml"];
    program(directory.path()).args(usage).assert().code(2).stderr(contains("must be NAME=DIR"));
}

#[test]
fn a_lone_class_or_photograph_is_learned_with_a_word_about_what_is_impossible() {
    let directory = tempfile::tempdir().unwrap();
    two_folders(&directory);
    fs::write(directory.path().join("low/phone.heic"), "").unwrap();
    let passed_over = "note: low: passed over what is no picture of a known format: phone.heic\n";
    learn(directory.path(), &[]).assert().success().stderr(passed_over);
    fs::remove_file(directory.path().join("low/phone.heic")).unwrap();
    let mut command = program(directory.path());
    command.args(["learn-signature", "--class", "high=high", "-o", "s.toml"]).assert().success().stderr(
        contains("note: `high` is the only class, so there is none to tell it from")
            .and(contains("\n").count(1)),
    );
    fs::remove_file(directory.path().join("low/low0.png")).unwrap();
    fs::remove_file(directory.path().join("low/low1.png")).unwrap();
    let json = json_of(learn(directory.path(), &[]).args(["--barycentre"]));
    assert!(json["notes"][0].as_str().unwrap().contains("class `low` has one photograph"));
    let alone = &json["classes"][1]["photos"][0];
    assert!(alone["nearest"].is_null() && alone["distances"]["low"].is_null());
    assert_eq!((&json["confusion"]["high"]["high"], &json["judged"]), (&3.into(), &3.into()));
}

#[test]
fn a_picture_is_its_own_target() {
    let directory = tempfile::tempdir().unwrap();
    upright().save(directory.path().join("a.png")).unwrap();
    write_masks(&directory, 40, 24, &["m"]);
    let evaluate = |options: &[&str]| {
        let mut command = program(directory.path());
        command.args(["evaluate", "a.png", "--mask", "masks/m.png", "--target", "a.png"]).args(options);
        json_of(&mut command)
    };
    for luminance in ["srgb", "linear"] {
        let json = evaluate(&["--target-mask", "masks/m.png", "--luminance", luminance]);
        assert_eq!((json["f_q"].as_f64(), &json["target"]), (Some(0.0), &"a".into()));
        let weights = ["meanObj", "varBack", "hist"].map(|t| json["terms"][t]["weight"].as_f64().unwrap());
        assert_eq!(weights, [0.5, 0.4, 1.0]);
    }
    let json = evaluate(&[]);
    let weights = ["meanObj", "varBack", "grad", "hist"].map(|t| json["terms"][t]["weight"].as_f64());
    assert_eq!(weights, [0.0, 0.0, 0.0, 1.0].map(Some));
    assert_eq!(json["terms"]["hist"]["f"].as_f64(), Some(0.0));

    let with = |options: &[&str]| {
        let mut command = program(directory.path());
        command.args(["evaluate", "a.png", "--mask", "masks/m.png", "--target"]).args(options);
        command
    };
    refused(&mut with(&["b.png"]), &["b.png: cannot open the picture"]);
    let stray = ["masks/m.png: a mask of a target needs a photograph", "`high-key` is none"];
    refused(&mut with(&["high-key", "--target-mask", "masks/m.png"]), &stray);
    write_masks(&directory, 24, 40, &["n"]);
    refused(&mut with(&["a.png", "--target-mask", "masks/n.png"]), &["masks/n.png: the mask has 24 x 40"]);
}

#[test]
fn a_library_class_is_a_target_and_a_signature_of_target_files() {
    let directory = tempfile::tempdir().unwrap();
    two_folders(&directory);
    learn(directory.path(), &[]).assert().success();
    fs::create_dir(directory.path().join("looks")).unwrap();
    let file = directory.path().join("looks/mine.toml");
    let text = include_str!("../../scenes/targets/high-key.toml");
    let evaluate = |target: &str| {
        let mut command = program(directory.path());
        command.args(["evaluate", "low/low0.png", "--mask", "masks/low0.png", "--target", target]);
        command
    };
    write_masks(&directory, 24, 16, &["low0"]);

    let json = json_of(&mut evaluate("styles.toml#low"));
    let near = json["f_q"].as_f64().unwrap();
    assert_eq!((&json["target"], &json["terms"]["grad"]["weight"]), (&"styles-low".into(), &0.0.into()));
    assert!(near < 0.1 && json_of(&mut evaluate("styles.toml#high"))["f_q"].as_f64().unwrap() > 0.3);

    fs::write(&file, text.replace("\"high\"", "\"../styles.toml#low\"")).unwrap();
    let json = json_of(&mut evaluate("looks/mine.toml"));
    assert_eq!(json["terms"]["hist"]["f"].as_f64(), Some(near));

    let choose = ["styles.toml: a signature library", "styles.toml#high, styles.toml#low"];
    refused(&mut evaluate("styles.toml"), &choose);
    refused(&mut evaluate("styles.toml#hihg"), &["styles.toml: no class `hihg`, did you mean `high`?"]);
    refused(&mut evaluate("none.toml#high"), &["none.toml: cannot read the signature library"]);
    fs::write(&file, text.replace("\"high\"", "\"styles.toml#low\"")).unwrap();
    refused(
        &mut evaluate("looks/mine.toml"),
        &["looks/mine.toml:", "`signature`: ", "looks/styles.toml: cannot"],
    );
    let broken = fs::read_to_string(directory.path().join("styles.toml")).unwrap();
    fs::write(directory.path().join("broken.toml"), broken.replacen("count", "cuont", 1)).unwrap();
    refused(&mut evaluate("broken.toml#high"), &["broken.toml:", "did you mean `count`?"]);
}

#[test]
fn a_run_lights_a_scene_like_a_picture_of_it() {
    let room = Room::new();
    let run = |options: &[&str]| {
        let mut arguments = vec!["run", "room.obj", "--json"];
        arguments.extend(QUICK);
        arguments.extend(options);
        let value: Value = serde_json::from_slice(&room.succeed(&arguments).stdout).unwrap();
        value
    };
    run(&["--target", "low-key", "--out", "dark"]);
    fs::copy(room.path("dark/final.png"), room.path("like this.png")).unwrap();
    fs::copy(room.path("dark/final.exr"), room.path("whole.exr")).unwrap();

    let json = run(&["--target", "like this.png"]);
    assert_eq!((&json["target"], &json["run_dir"]), (&"like this".into(), &"runs/room-like this".into()));
    assert!(json["f_q"].as_f64().unwrap() < 0.5 * json["f_q_initial"].as_f64().unwrap(), "{json:#}");
    // What the run recorded is the target again.
    let recorded: toml::Table =
        fs::read_to_string(room.path("runs/room-like this/run.toml")).unwrap().parse().unwrap();
    assert_eq!(recorded["target"]["signature"]["cumulated"].as_array().unwrap().len(), 256);

    // An EXR of ours brings its mask, so that all terms count; several looks at once.
    let both = run(&["--targets", "like this.png,whole.exr"]);
    assert_eq!(both[1]["terms"]["meanObj"]["weight"], 0.5);
    assert_eq!(both[0]["terms"]["meanObj"]["weight"], 0.0);
    assert!(room.path("runs/room/whole/final.png").exists());
}
