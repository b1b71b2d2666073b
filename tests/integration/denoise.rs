//! Denoised pictures of `run`, `render` and `relight`: what they are made of, and that nothing that is measured
//! is one.

use std::{fs, path::Path};

use lightopt_embree::{
    film::{
        exr::{ExrImage, ExrPart, read_exr},
        image_file::{LinearImage, write_png},
    },
    math::display::luminance,
};
use serde_json::Value;

use crate::room::{QUICK, Room, names};

fn exr(room: &Room, name: &str) -> ExrImage {
    read_exr(&room.path(name)).unwrap()
}

fn colours(part: &ExrPart) -> Vec<[f32; 3]> {
    part.colours().unwrap()
}

/// Checks that the denoised lights add up to the denoised picture, and each to as much light as the noisy
/// one.
fn adds_up(exr: &ExrImage) {
    let beauty = colours(exr.part("denoised").unwrap());
    let lights: Vec<&ExrPart> =
        exr.parts.iter().filter(|part| part.name.starts_with("denoised.light.")).collect();
    assert!(!lights.is_empty());
    let each: Vec<Vec<[f32; 3]>> = lights.iter().map(|part| colours(part)).collect();
    for (p, rgb) in beauty.iter().enumerate() {
        for (c, &v) in rgb.iter().enumerate() {
            let sum: f64 = each.iter().map(|light| f64::from(light[p][c])).sum();
            assert!((sum - f64::from(v)).abs() <= 1e-6 * sum, "pixel {p}: {sum} {v}");
        }
    }
    let total = |part: &ExrPart| colours(part).as_flattened().iter().map(|&v| f64::from(v)).sum::<f64>();
    for part in lights {
        let noisy = exr.part(part.name.strip_prefix("denoised.").unwrap()).unwrap();
        assert!((total(part) / total(noisy) - 1.0).abs() < 1e-4, "{}", part.name);
    }
}

/// Checks that a PNG shows this part of an EXR.
fn shows(room: &Room, png: &str, exr: &ExrImage, part: &str, exposure: f64) {
    let rgb = colours(exr.part(part).unwrap());
    let path = room.path("wanted.png");
    write_png(&path, &LinearImage { width: exr.width, height: exr.height, rgb }, exposure).unwrap();
    let open = |path: &Path| image::open(path).unwrap().into_rgb8();
    assert!(open(&path) == open(&room.path(png)), "{png} shows {part}");
}

#[test]
fn pictures_of_a_run_are_shown_denoised_and_measured_as_they_are() {
    let room = Room::new();
    let run = |out: &str, more: &[&str]| -> Value {
        let mut arguments = vec!["run", "room.obj", "--json", "--out", out, "--final-noise", "0"];
        arguments.extend(QUICK);
        arguments.extend(more);
        serde_json::from_slice(&room.succeed(&arguments).stdout).unwrap()
    };
    let (shown, plain) = (run("a", &[]), run("b", &["--no-denoise"]));
    for picture in ["initial", "final"] {
        let [a, b] = ["a", "b"].map(|out| exr(&room, &format!("{out}/{picture}.exr")));
        adds_up(&a);
        let exposure = a.lightopt.as_ref().unwrap()["exposure"].as_f64().unwrap();
        shows(&room, &format!("a/{picture}.png"), &a, "denoised", exposure);
        shows(&room, &format!("b/{picture}.png"), &b, "rgb", exposure);
        // Beside what is denoised everything is the same.
        assert!(b.part("denoised").is_none());
        for part in &b.parts {
            assert_eq!(a.part(&part.name), Some(part));
        }
        assert_ne!(colours(a.part("denoised").unwrap()), a.beauty().unwrap());
    }
    for key in ["f_q", "f_q_final", "f_q_picture", "terms", "x"] {
        assert_eq!(shown[key], plain[key], "{key}");
    }
    assert_ne!(shown["final_noise"], plain["final_noise"]);
    for log in ["evaluations.jsonl", "iter_0000.exr"] {
        assert!(fs::read(room.path("a").join(log)).unwrap() == fs::read(room.path("b").join(log)).unwrap());
    }
    let [a, b] = ["a", "b"].map(|out| fs::read(room.path(out).join("found.png")).unwrap());
    assert!(a != b);
    let manifest = fs::read_to_string(room.path("b/run.toml")).unwrap();
    assert!(manifest.contains("denoise = false"), "{manifest}");
}

#[test]
fn render_denoises_when_asked_and_the_same_on_any_number_of_threads() {
    let room = Room::new();
    let render = |output: &str, more: &[&str]| {
        let spp = if output == "truth.exr" { "1600" } else { "16" };
        let mut arguments = vec!["render", "room.obj", "--size", "48x36", "--spp", spp, "-o", output];
        arguments.extend(more);
        room.succeed(&arguments);
    };
    render("a.exr", &["--denoise", "--threads", "1"]);
    render("b.exr", &["--denoise", "--threads", "3"]);
    render("a.png", &["--denoise"]);
    render("plain.exr", &[]);
    assert!(fs::read(room.path("a.exr")).unwrap() == fs::read(room.path("b.exr")).unwrap());
    let (a, plain) = (exr(&room, "a.exr"), exr(&room, "plain.exr"));
    adds_up(&a);
    assert!(plain.part("denoised").is_none());
    let attribute = a.lightopt.as_ref().unwrap();
    assert_eq!(attribute["spp"], 16);
    shows(&room, "a.png", &a, "denoised", attribute["exposure"].as_f64().unwrap());
    // Against a picture of a hundred times the samples.
    render("truth.exr", &["--seed", "5"]);
    let truth = exr(&room, "truth.exr").beauty().unwrap();
    let errors = |rgb: Vec<[f32; 3]>| -> Vec<f64> {
        rgb.iter().zip(&truth).map(|(a, b)| (luminance(*a) - luminance(*b)).abs()).collect()
    };
    let noisy = errors(a.beauty().unwrap());
    let denoised = errors(colours(a.part("denoised").unwrap()));
    // Pixel by pixel, since the few at the rim of a lamp that is seen outweigh all others.
    let nearer = noisy.iter().zip(&denoised).filter(|(noisy, denoised)| denoised < noisy).count();
    // Before nothing there is no light, and no error.
    let lit = truth.iter().filter(|&&rgb| rgb != [0.0; 3]).count();
    assert!(3 * nearer > 2 * lit, "{nearer} of {lit}");
}

#[test]
fn relight_denoises_when_asked() {
    let room = Room::new();
    let mut run = vec!["run", "room.obj", "--cache", "bases", "--out", "a"];
    run.extend(QUICK);
    room.succeed(&run);
    let basis = format!("bases/{}", names(&room.path("bases"))[0]);
    let relight = |output: &str, more: &[&str]| {
        room.succeed(&[&["relight", &basis, "--lights", "a/lights.toml", "-o", output][..], more].concat());
    };
    relight("a.exr", &["--denoise"]);
    relight("a.png", &["--denoise"]);
    relight("plain.exr", &[]);
    let (a, plain) = (exr(&room, "a.exr"), exr(&room, "plain.exr"));
    adds_up(&a);
    assert!(plain.part("denoised").is_none());
    for part in &plain.parts {
        assert_eq!(a.part(&part.name), Some(part));
    }
    let exposure = a.lightopt.as_ref().unwrap()["exposure"].as_f64().unwrap();
    shows(&room, "a.png", &a, "denoised", exposure);
}
