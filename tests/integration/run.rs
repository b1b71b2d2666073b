//! `lightopt-embree run`.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use lightopt_embree::{
    film::exr::read_exr,
    math::{display::luminance, stats::Moments},
};
use predicates::str::contains;
use serde_json::Value;

use crate::room::{MTL, OBJ, QUICK, Room, TOML, names};

fn quick<'a>(options: &[&'a str]) -> Vec<&'a str> {
    let mut arguments = vec!["run", "room.obj"];
    arguments.extend(QUICK);
    arguments.extend(options);
    arguments
}

fn json_of(room: &Room, arguments: &[&str]) -> Value {
    let mut all = arguments.to_vec();
    all.push("--json");
    // One object and nothing else.
    serde_json::from_slice(&room.succeed(&all).stdout).unwrap()
}

fn lines(path: &Path) -> Vec<Value> {
    let text = fs::read_to_string(path).unwrap();
    assert!(text.is_empty() || text.ends_with('\n'), "{}", path.display());
    text.lines().map(|l| serde_json::from_str(l).unwrap_or_else(|e| panic!("{l}: {e}"))).collect()
}

fn iterations(directory: &Path) -> Vec<String> {
    names(directory).into_iter().filter(|n| n.starts_with("iter_")).collect()
}

/// Bytes of every file that the seed decides.
fn content(directory: &Path) -> BTreeMap<String, Vec<u8>> {
    let seconds = ["timing.jsonl", "report.html"];
    let kept = names(directory).into_iter().filter(|n| !seconds.contains(&n.as_str()));
    kept.map(|n| (n.clone(), fs::read(directory.join(&n)).unwrap())).collect()
}

#[test]
fn a_run_records_all_it_did_and_pictures_reproduce_their_values() {
    let room = Room::new();
    for gradient in ["basis", "fd"] {
        records_all_it_did(&room, gradient);
    }
}

fn records_all_it_did(room: &Room, gradient: &str) {
    let json = json_of(room, &quick(&["--seed", "5", "--gradient", gradient, "--force"]));
    let directory = room.path("runs/room-high-key");
    let iterations = iterations(&directory);
    let mut wanted: Vec<String> = [
        "evaluations.jsonl",
        "final.exr",
        "final.png",
        "found.png",
        "initial.exr",
        "initial.png",
        "iterations.jsonl",
        "lights.toml",
        "report.html",
        "result.json",
        "run.toml",
        "timing.jsonl",
    ]
    .map(str::to_owned)
    .to_vec();
    wanted.extend(iterations.iter().cloned());
    if gradient == "basis" {
        wanted.extend(["live.basis", "starts.jsonl"].map(str::to_owned));
        let offered = |n: &String| n.starts_with("lights-") || n == "contact.png";
        wanted.extend(names(&directory).into_iter().filter(offered));
        let starts = lines(&directory.join("starts.jsonl"));
        assert!(starts.len() > 100 && starts.iter().any(|l| l["f_q"].is_number()));
    }
    wanted.sort();
    assert_eq!(names(&directory), wanted);

    for key in [
        "f_q_initial",
        "f_q",
        "f_q_error",
        "f_q_final",
        "f_q_final_error",
        "f_q_picture",
        "final_noise",
        "final_spp",
        "renders",
        "evaluations",
        "seconds",
        "stop_reason",
        "run_dir",
        "terms",
        "x",
    ] {
        assert!(!json[key].is_null(), "{key}");
    }
    for term in ["meanObj", "meanBack", "varObj", "varBack", "grad", "hist"] {
        for key in ["value", "target", "f"] {
            assert!(json["terms"][term][key].is_number(), "{term}.{key}");
        }
    }
    assert_eq!(json["run_dir"], "runs/room-high-key");

    let manifest: toml::Table = fs::read_to_string(directory.join("run.toml")).unwrap().parse().unwrap();
    let options = &manifest["options"];
    for (key, value) in [("spp", 4), ("final_spp", 4), ("seed", 5), ("max_evaluations", 4), ("max_depth", 8)]
    {
        assert_eq!(options[key].as_integer(), Some(value), "{key}");
    }
    assert_eq!(options["final_noise"].as_float(), Some(0.0073));
    assert_eq!(options["size"].to_string(), "[24, 18]");
    assert_eq!(options["work_size"].to_string(), "[16, 12]");
    assert_eq!(options["integrator"].as_str(), Some("bdpt"));
    let variables: Vec<&str> =
        manifest["variables"].as_array().unwrap().iter().map(|v| v["name"].as_str().unwrap()).collect();
    assert_eq!(variables, ["key.radiance", "key.size", "fill.radiance", "fill.size", "background.value"]);
    for v in manifest["variables"].as_array().unwrap() {
        let number = |key: &str| v[key].as_float().unwrap();
        let found = json["x"][v["name"].as_str().unwrap()].as_f64().unwrap();
        assert!((number("lower")..=number("upper")).contains(&found), "{v}");
    }

    let evaluations = lines(&directory.join("evaluations.jsonl"));
    // On the basis the record is of the descent that led to the result.
    let n = evaluations.iter().filter(|l| l.get("evaluation").is_some()).count() as u64;
    let all = json["evaluations"].as_u64().unwrap();
    assert!(if gradient == "fd" { n == all } else { (1..=all).contains(&n) }, "{n} {all}");
    assert!(!lines(&directory.join("timing.jsonl")).is_empty());
    let improved = lines(&directory.join("iterations.jsonl"));
    assert_eq!(improved.len(), iterations.len());
    assert!(improved.windows(2).all(|w| w[1]["f_q"].as_f64() < w[0]["f_q"].as_f64()));

    let evaluate = |name: &str| {
        let path = format!("runs/room-high-key/{name}");
        let json = json_of(room, &["evaluate", &path]);
        assert!(json["f_q_recorded"].is_number());
        json["f_q"].as_f64().unwrap()
    };
    for (name, line) in iterations.iter().zip(&improved) {
        let recorded = line.get("f_q_picture").unwrap_or(&line["f_q"]).as_f64().unwrap();
        assert!((evaluate(name) - recorded).abs() < 1e-12, "{name}");
    }
    assert!((evaluate("final.exr") - json["f_q_final"].as_f64().unwrap()).abs() < 1e-12);
    evaluate("initial.exr");
    let small = image::open(directory.join("found.png")).unwrap();
    assert_eq!([small.width(), small.height()], [16, 12]);
    is_of_its_replicates(room, &directory, &json);
}

/// Checks the replicates of a final picture against the picture, and what is measured on them.
fn is_of_its_replicates(room: &Room, directory: &Path, json: &Value) {
    let exr = read_exr(&directory.join("final.exr")).unwrap();
    let part = exr.part("replicates").unwrap();
    let names: Vec<&str> = part.channels.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, ["Y0", "Y1", "Y2", "Y3"]);
    for (p, rgb) in exr.beauty().unwrap().into_iter().enumerate() {
        let mean = part.channels.iter().map(|(_, y)| f64::from(y[p])).sum::<f64>() / 4.0;
        let y = luminance(rgb);
        assert!((mean - y).abs() <= 1e-6 * y.max(1e-3), "pixel {p}: {mean} {y}");
    }
    let path = directory.join("final.exr");
    let path = path.to_str().unwrap();
    let measured = json_of(room, &["evaluate", path]);
    for (here, there) in [("f_q_picture", "f_q_picture"), ("f_q_error", "f_q_final_error")] {
        assert!((measured[here].as_f64().unwrap() - json[there].as_f64().unwrap()).abs() < 1e-12, "{here}");
    }
    assert!(measured["f_q"] != measured["f_q_picture"]);
    // Of a layer that was asked for there are no replicates.
    let plain = json_of(room, &["evaluate", path, "--layer", "rgb"]);
    assert!((plain["f_q"].as_f64().unwrap() - json["f_q_picture"].as_f64().unwrap()).abs() < 1e-12);
    assert!(plain.get("f_q_picture").is_none());
    let table = String::from_utf8(room.succeed(&["evaluate", path]).stdout).unwrap();
    assert!(table.contains("from 4 replicates") && table.contains("\nf_q_picture "), "{table}");
}

#[test]
fn samples_are_taken_until_the_noise_is_low_enough() {
    let room = Room::new();
    let run = |out: &str, more: &[&str]| {
        let first =
            ["run", "room.obj", "--out", out, "--work-size", "16x12", "--size", "24x18", "--spp", "4"];
        json_of(&room, &[&first[..], &["--tolerance", "0.5", "--threads", "2"], more].concat())
    };
    let spp = |json: &Value| json["final_spp"].as_u64().unwrap();
    let noise = |json: &Value| json["final_noise"].as_f64().unwrap();
    let coarse = run("a", &["--final-noise", "0.015", "--final-spp", "2000"]);
    let fine = run("b", &["--final-noise", "0.007", "--final-spp", "2000"]);
    assert!(noise(&coarse) < 0.015 && noise(&fine) < 0.007, "{coarse} {fine}");
    assert!(spp(&coarse) < spp(&fine) && spp(&fine) < 2000, "{coarse} {fine}");
    // What is allowed beyond what is needed makes no difference.
    let again = run("c", &["--final-noise", "0.007", "--final-spp", "3000"]);
    assert_eq!((spp(&again), noise(&again)), (spp(&fine), noise(&fine)));
    let [b, c] = ["b", "c"].map(|out| read_exr(&room.path(out).join("final.exr")).unwrap());
    assert_eq!(b.parts, c.parts);
    assert!(b.lightopt.unwrap().get("incomplete").is_none());
    // Where that is not enough, it is said.
    let mut few = vec!["run", "room.obj", "--out", "d", "--final-noise", "1e-5"];
    few.extend(QUICK);
    let stderr = String::from_utf8(room.succeed(&few).stderr).unwrap();
    assert!(stderr.contains("0.00001 was asked for") && stderr.contains("noise 0."), "{stderr}");
}

/// With the start there are five pictures, of which four are rendered together at most.
#[test]
fn pictures_of_many_looks_have_one_start() {
    const LOOKS: [&str; 4] = ["a", "b", "c", "d"];
    let room = Room::new();
    let high_key = include_str!("../../scenes/targets/high-key.toml");
    for (i, look) in LOOKS.iter().enumerate() {
        let target = high_key.replace("\"high-key\"", &format!("\"{look}\""));
        room.write(&format!("{look}.toml"), target.replace("= 0.78", &format!("= 0.{}", 2 + 2 * i)));
    }
    let all = json_of(&room, &quick(&["--out", "runs", "--targets", "a.toml,b.toml,c.toml,d.toml"]));
    for (look, json) in LOOKS.into_iter().zip(all.as_array().unwrap()) {
        let f_q = json_of(&room, &["evaluate", &format!("runs/{look}/final.exr")])["f_q"].as_f64().unwrap();
        assert!((f_q - json["f_q_final"].as_f64().unwrap()).abs() < 1e-12);
        let initial = |look: &str| read_exr(&room.path("runs").join(look).join("initial.exr")).unwrap().parts;
        assert_eq!(initial(look), initial("a"));
        assert!(room.path("runs").join(look).join("initial.png").exists());
    }
}

#[test]
fn values_are_reproduced_also_with_other_exposure_and_luminance() {
    let room = Room::new();
    let options = ["--exposure", "0.3", "--luminance", "linear", "--out", "a", "--target", "low-key"];
    let json = json_of(&room, &quick(&options));
    let evaluated = json_of(&room, &["evaluate", "a/final.exr"]);
    assert!((evaluated["f_q"].as_f64().unwrap() - json["f_q_final"].as_f64().unwrap()).abs() < 1e-12);
    assert_eq!(evaluated["luminance"], "linear");
}

#[test]
fn the_same_seed_gives_the_same_bytes_whatever_the_threads() {
    let room = Room::new();
    for (out, threads, seed) in [("a", "1", "3"), ("b", "2", "3"), ("c", "2", "4")] {
        room.succeed(&quick(&["--out", out, "--threads", threads, "--seed", seed]));
    }
    let (a, b, c) = (content(&room.path("a")), content(&room.path("b")), content(&room.path("c")));
    assert_eq!(a.keys().collect::<Vec<_>>(), b.keys().collect::<Vec<_>>());
    for (name, bytes) in &a {
        assert!(bytes == &b[name], "{name} depends on the threads");
    }
    assert!(a["final.exr"] != c["final.exr"] && a["evaluations.jsonl"] != c["evaluations.jsonl"]);
}

/// Means are compared by Student's t with 3 degrees of freedom, from the replicates of the final picture.
#[test]
fn render_shows_what_the_final_picture_shows() {
    for (toml, free) in [
        (TOML.to_owned(), "radiance,size,background"),
        (TOML.to_owned(), "radiance"),
        // A value of 1 is not within reach.
        (
            TOML.replace(
                "[[lights]]\nname = \"key\"",
                "[background]\nvalue_range = [0.1, 0.4]\n[[lights]]\nname = \"key\"",
            ),
            "size",
        ),
    ] {
        let room = Room::with(OBJ, MTL, &toml);
        let samples = ["--final-spp", "256", "--final-noise", "0"];
        let mut run = vec!["run", "room.obj", "--out", "a", "--seed", "9", "--free", free];
        run.extend(["--work-size", "16x12", "--size", "24x18", "--spp", "4", "--tolerance", "0.05"]);
        run.extend(samples);
        room.succeed(&run);
        // Its own error is half of that of the final picture.
        let options = ["--size", "24x18", "--spp", "1024", "--seed", "9", "-o", "again.exr"];
        let mut arguments = vec!["render", "room.obj", "--lights", "a/lights.toml"];
        arguments.extend(options);
        room.succeed(&arguments);
        let (found, again) =
            (read_exr(&room.path("a/final.exr")).unwrap(), read_exr(&room.path("again.exr")).unwrap());
        for name in ["mask", "albedo", "normal", "depth"] {
            assert_eq!(found.part(name), again.part(name), "{free}");
        }
        let mean = |y: &[f32]| y.iter().map(|&y| f64::from(y)).sum::<f64>() / y.len() as f64;
        let mut of_replicates = Moments::default();
        let replicates = &found.part("replicates").unwrap().channels;
        replicates.iter().for_each(|(_, y)| of_replicates.push(mean(y)));
        let y: Vec<f32> = again.beauty().unwrap().into_iter().map(|rgb| luminance(rgb) as f32).collect();
        let error = (1.25 * of_replicates.variance_of_mean()).sqrt();
        let t = (of_replicates.mean() - mean(&y)) / error;
        // 99.7 % for each of three.
        assert!(t.abs() < 8.9, "{free}: t {t:.2}");
        assert!(error < 0.01 * mean(&y), "{free}: {error} of {}", mean(&y));
    }
}

#[test]
fn only_what_is_free_varies() {
    let room = Room::new();
    let json = json_of(&room, &quick(&["--free", "radiance", "--out", "a"]));
    let x: Vec<&String> = json["x"].as_object().unwrap().keys().collect();
    assert_eq!(x, ["fill.radiance", "key.radiance"]);
    let lights: toml::Table = fs::read_to_string(room.path("a/lights.toml")).unwrap().parse().unwrap();
    for light in lights["lights"].as_array().unwrap() {
        assert_eq!(light["size"].as_float(), Some(1.0));
    }
    assert_eq!(lights["background"]["value"].as_float(), Some(1.0));
    let json = json_of(&room, &quick(&["--free", "background", "--out", "b"]));
    assert_eq!(json["x"].as_object().unwrap().keys().collect::<Vec<_>>(), ["background.value"]);

    let room = Room::with(OBJ, MTL, &TOML.replacen("schema = 1", "schema = 1\nfree = [\"size\"]", 1));
    let json = json_of(&room, &quick(&["--out", "a"]));
    assert_eq!(json["x"].as_object().unwrap().keys().collect::<Vec<_>>(), ["fill.size", "key.size"]);
}

#[test]
fn a_target_of_ones_own_names_the_directory_and_is_recorded() {
    let room = Room::new();
    let target = "schema = 1\nname = \"dusk\"\nsignature = \"low\"\nt_meanObj = 0.3\nt_meanBack = 0.1\n\
                  t_varObj = 0.2\nt_varBack = 0.1\nt_grad = 0.3\n";
    room.write("dusk.toml", target);
    let json = json_of(&room, &quick(&["--target", "dusk.toml"]));
    assert_eq!(json["run_dir"], "runs/room-dusk");
    assert_eq!(json["terms"]["meanObj"]["target"].as_f64(), Some(0.3));
    assert_eq!(json_of(&room, &["evaluate", "runs/room-dusk/final.exr"])["target"], "dusk");

    room.write("bad.toml", target.replace("0.3", "1.3"));
    let error = room.fail_at_once(&quick(&["--target", "bad.toml"]));
    assert!(error.contains("bad.toml:4: `t_meanObj`"), "{error}");
    let error = room.fail_at_once(&quick(&["--target", "hihg-key"]));
    assert!(error.contains("did you mean `high-key`?"), "{error}");
}

#[test]
fn a_light_may_keep_its_own_size_however_small() {
    let room = Room::with(OBJ, MTL, &TOML.replace("radiance = 8.0", "radiance = 8.0\nsize = 0.01"));
    let stderr = String::from_utf8(room.succeed(&quick(&["--out", "a"])).stderr).unwrap();
    assert!(!stderr.contains("set to"), "{stderr}");
    let run: toml::Table = fs::read_to_string(room.path("a/run.toml")).unwrap().parse().unwrap();
    let variables = run["variables"].as_array().unwrap();
    let size = variables.iter().find(|v| v["name"].as_str() == Some("key.size")).unwrap();
    let at = |key: &str| size[key].as_float().unwrap();
    assert!(
        (at("initial") - 0.01).abs() < 1e-6 && (at("lower") - 0.01).abs() < 1e-6 && at("upper") > 1.0,
        "{size}"
    );
}

#[test]
fn one_evaluation_is_enough() {
    let room = Room::new();
    for n in ["1", "2", "3"] {
        let mut arguments = vec!["run", "room.obj", "--out", n];
        arguments.extend(&QUICK[..8]);
        arguments.extend(["--gradient", "fd", "--max-evaluations", n]);
        let json = json_of(&room, &arguments);
        let evaluations = json["evaluations"].as_u64().unwrap();
        assert!((1..=n.parse().unwrap()).contains(&evaluations), "{evaluations} of {n}");
    }
}

/// In paper mode the tolerance chooses the samples, unless somebody does.
#[test]
fn paper_mode_takes_the_samples_that_the_tolerance_needs() {
    let room = Room::new();
    let samples = |more: &[&str]| {
        let mut arguments = vec!["run", "room.obj", "--force", "--gradient", "fd", "--max-evaluations", "1"];
        arguments.extend(["--work-size", "24x18", "--size", "24x18", "--final-spp", "4"]);
        arguments.extend(more);
        let stderr = String::from_utf8(room.succeed(&arguments).stderr).unwrap();
        let said = stderr.lines().find_map(|l| l.strip_suffix(" samples a pixel for every render"));
        said.unwrap_or_else(|| panic!("{stderr}")).parse::<u32>().unwrap()
    };
    let [loose, strict] = ["0.05", "0.003"].map(|t| samples(&["--tolerance", t]));
    assert!(strict > loose, "{strict} {loose}");
    assert_eq!(samples(&["--tolerance", "0.003", "--spp", "8"]), 8);
}

#[test]
fn a_bare_name_is_sought_among_the_scenes_and_said_so() {
    let room = Room::new();
    for (name, text) in [("hall.obj", OBJ), ("room.mtl", MTL), ("hall.toml", TOML)] {
        room.write(&format!("scenes/{name}"), text);
    }
    for name in ["hall.obj", "hall"] {
        let mut arguments = vec!["run", name, "--force"];
        arguments.extend(QUICK);
        let output = room.succeed(&arguments);
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert!(stderr.lines().any(|l| l == "using scenes/hall.obj"), "{stderr}");
        assert!(room.path("runs/hall-high-key/final.png").exists());
    }
}

#[cfg(unix)]
#[test]
fn the_directories_of_all_looks_are_checked_before_anything_is_rendered() {
    let room = Room::new();
    let run = quick(&["--targets", "high-key,low-key", "--out", "a"]);
    let refused = |wanted: &str| {
        let error = room.fail_at_once(&run);
        assert!(error.contains(wanted), "{error}");
        assert!(!room.path("a/high-key").exists());
    };
    room.write("a/low-key/mine", "");
    refused("a/low-key: not empty and not a run directory");
    fs::remove_dir_all(room.path("a/low-key")).unwrap();
    std::os::unix::fs::symlink("nowhere", room.path("a/low-key")).unwrap();
    refused("a/low-key: cannot follow the link: ");
    fs::remove_file(room.path("a/low-key")).unwrap();
    room.write("a/low-key", "");
    refused("a/low-key: cannot read the directory: ");
    fs::remove_file(room.path("a/low-key")).unwrap();
    fs::create_dir(room.path("a/low-key")).unwrap();
    let lock = fs::File::open(room.path("a/low-key")).unwrap();
    lock.lock().unwrap();
    refused("a/low-key: another run is being recorded here");
    drop(lock);
    room.succeed(&run);
    fs::remove_dir_all(room.path("a/high-key")).unwrap();
    refused("a/low-key: a run is recorded here already");
}

#[test]
fn earlier_runs_are_replaced_only_by_force_and_foreign_files_never() {
    let room = Room::new();
    room.succeed(&quick(&["--out", "a"]));
    let before = content(&room.path("a"));
    let error = room.fail_at_once(&quick(&["--out", "a", "--seed", "1"]));
    assert!(error.contains("a: a run is recorded here already") && error.contains("--force"), "{error}");
    assert!(content(&room.path("a")) == before);

    // A wrong target or scene leaves the earlier run alone, also with --force.
    room.fail_at_once(&quick(&["--out", "a", "--force", "--target", "no"]));
    room.fail_at_once(&["run", "no.obj", "--out", "a", "--force"]);
    assert!(content(&room.path("a")) == before);

    room.write("a/notes.txt", "mine");
    room.write("a/iter_9999.exr", "of a longer run");
    room.write("a/.final.exr.123-4.tmp", "of a killed run");
    room.succeed(&quick(&["--out", "a", "--force", "--seed", "1"]));
    assert_eq!(fs::read(room.path("a/notes.txt")).unwrap(), b"mine");
    assert!(!room.path("a/iter_9999.exr").exists() && !room.path("a/.final.exr.123-4.tmp").exists());
    assert!(content(&room.path("a"))["final.exr"] != before["final.exr"]);

    room.write("foreign/final.exr", "mine");
    for force in [&[][..], &["--force"]] {
        let error = room.fail_at_once(&quick(&[&["--out", "foreign"][..], force].concat()));
        assert!(error.contains("foreign: not empty and not a run directory"), "{error}");
    }
    assert_eq!(names(&room.path("foreign")), ["final.exr"]);
    assert_eq!(fs::read(room.path("foreign/final.exr")).unwrap(), b"mine");

    fs::create_dir(room.path("empty")).unwrap();
    room.succeed(&quick(&["--out", "empty"]));
    let error = room.fail_at_once(&quick(&["--out", "room.obj"]));
    assert!(error.contains("room.obj: cannot read the directory"), "{error}");
    let error = room.fail_at_once(&quick(&["--out", "room.obj/a"]));
    assert!(error.contains("room.obj/a: cannot"), "{error}");
    // Nobody, root included, can make a directory there.
    #[cfg(target_os = "linux")]
    for out in ["/proc/x", "/proc/x/y"] {
        let error = room.fail_at_once(&quick(&["--out", out]));
        assert!(error.starts_with(&format!("error: {out}: cannot make the directory: ")), "{error}");
    }
}

#[test]
fn scenes_that_cannot_be_lit_are_errors_that_leave_nothing() {
    for (from, to, wanted) in [
        (
            "[0.5, 1.8, 0.8]\nlook_at = [0.0, 0.3, 0.0]",
            "[0.5, 5.0, 0.8]\nlook_at = [0.5, 9.0, 0.8]",
            "light `key` does not light the picture",
        ),
        ("[-0.8, 1.2, 0.8]", "[-0.8, 0.0, 0.8]", "light `fill` is within"),
        ("[-0.8, 1.2, 0.8]", "[-0.8, 0.000005, 0.8]", "light `fill` is within 4.7e-6 m of a surface"),
        ("[\"box\"]", "[\"*\"]", "every pixel as main object"),
        ("look_at = [0.0, 0.5, 0.0]", "look_at = [0.0, 1.0, 9.0]", "no pixel as main object"),
    ] {
        let room = Room::with(OBJ, MTL, &TOML.replacen(from, to, 1));
        let mut arguments = quick(&["--out", "a"]);
        if to.contains('*') {
            // The picture holds nothing but the main object.
            room.write("room.toml", TOML.replace(from, to).replace("45.0", "10.0"));
        }
        arguments.push("--json");
        let error = room.fail(&arguments);
        assert!(error.contains(wanted), "wanted `{wanted}` in: {error}");
        assert!(!room.path("a").exists());
    }
    let room = Room::with(OBJ, MTL, &TOML.replacen("schema = 1", "schema = 1\nfree = []", 1));
    let error = room.fail(&quick(&[]));
    assert!(error.contains("nothing is free"), "{error}");
}

/// The room without its `[[lights]]`, with `lights` instead.
fn lit_by(lights: &str) -> String {
    format!("{}{lights}", &TOML[..TOML.find("[[lights]]").unwrap()])
}

const RECTANGLE: &str = "[[lights]]
name = \"key\"
type = \"rectangle\"
position = [0.5, 1.8, 0.8]
look_at = [0.0, 0.3, 0.0]
half_extents = [0.2, 0.15]
";

#[test]
fn every_kind_of_light_lens_and_opacity_can_be_designed_with() {
    let lamp = "v .6 1.7 .2\nv .9 1.7 .2\nv .9 1.7 .6\nv .6 1.7 .6\no lamp\nusemtl lamp\nf -4 -3 -2 -1\n";
    let obj = format!("{OBJ}{lamp}");
    let mtl = |ke: &str| format!("{MTL}newmtl lamp\nKd 0 0 0\n{ke}");
    let sky = "[[lights]]\nname = \"sky\"\ntype = \"environment\"\nimage = \"sky.png\"\nrotation = 90\n";
    let spot = "[[lights]]\nname = \"spot\"\ntype = \"spot\"\nposition = [0, 1.5, 1]\nlook_at = [0, 0.3, 0]\n\
                radius = 0\nangle = 40\n";
    let sun = "[[lights]]\nname = \"sun\"\ntype = \"distant\"\nlook_at = [-1, -2, -1]\n";
    let mesh = "[[lights]]\nname = \"bulb\"\ntype = \"mesh\"\nmaterial = \"lamp\"\n";
    let lens = lit_by(RECTANGLE).replace("size = [24, 18]", "size = [24, 18]\naperture_radius = 0.05");
    for (ke, toml, expected) in [
        ("Ke 20 18 15\n", lit_by(""), &["lamp.radiance"] as &[&str]),
        ("", lit_by(mesh), &["bulb.radiance"]),
        ("", lit_by(&format!("{sky}{RECTANGLE}")), &["sky.radiance", "key.radiance", "key.size"]),
        ("", lit_by(&format!("{RECTANGLE}occludes = true\n")), &["key.radiance"]),
        ("", lit_by(&format!("{spot}{sun}")), &["spot.radiance", "sun.radiance"]),
        ("", lens, &["key.radiance", "key.size"]),
        ("", lit_by(&format!("{RECTANGLE}[materials.red]\nopacity = 0.5\n")), &["key.radiance", "key.size"]),
    ] {
        let room = Room::with(&obj, &mtl(ke), &toml);
        image::RgbImage::from_fn(8, 4, |x, _| image::Rgb([40 * x as u8, 90, 200]))
            .save(room.path("sky.png"))
            .unwrap();
        let report = json_of(&room, &quick(&["--out", "a", "--free", "radiance,size"]));
        let variables: Vec<&str> =
            report["x"].as_object().unwrap().keys().map(String::as_str).filter(|k| k.contains('.')).collect();
        let mut expected = expected.to_vec();
        expected.sort_unstable();
        assert_eq!(variables, expected, "{toml}");
        assert!(report["f_q"].is_f64(), "{toml}");
        room.succeed(&["render", "--lights", "a/lights.toml", "--spp", "4", "-o", "a.exr", "room.obj"]);
        let again = std::fs::read(room.path("a.exr")).unwrap();
        room.succeed(&["render", "--lights", "a/lights.toml", "--spp", "4", "-o", "b.exr", "room.obj"]);
        assert_eq!(again, std::fs::read(room.path("b.exr")).unwrap());
    }
}

#[test]
fn a_light_of_the_scene_file_may_light_nothing() {
    // Behind the wall, turned away.
    let lamp = "v .6 1 -4\nv .9 1 -4\nv .9 1.5 -4\nv .6 1.5 -4\no lamp\nusemtl lamp\nf -1 -2 -3 -4\n";
    let mtl = format!("{MTL}newmtl lamp\nKd 0 0 0\nKe 1 1 1\n");
    let room = Room::with(&format!("{OBJ}{lamp}"), &mtl, TOML);
    let report = json_of(&room, &quick(&["--out", "a", "--free", "radiance"]));
    let x = report["x"].as_object().unwrap();
    assert!(x.contains_key("key.radiance") && !x.contains_key("lamp.radiance"), "{x:?}");
    // The sidecar's own must.
    let toml =
        format!("{TOML}[[lights]]\nname = \"bulb\"\ntype = \"mesh\"\nmaterial = \"lamp\"\nradiance = 1.0\n");
    let error = Room::with(&format!("{OBJ}{lamp}"), &mtl, &toml).fail(&quick(&["--out", "a"]));
    assert!(error.contains("light `bulb` does not light the picture"), "{error}");
}

#[test]
fn wrong_usage_is_code_2() {
    let room = Room::new();
    for (arguments, wanted) in [
        (vec!["--free", "colour"], "radiance"),
        (vec!["--gradient", "magic"], "fd"),
        (vec!["--max-evaluations", "0"], "1..="),
        (vec!["--work-size", "x"], "WIDTHxHEIGHT"),
        (vec!["--final-spp", "0"], "whole number from 1"),
    ] {
        room.command(
            &quick(&arguments)[..2].iter().copied().chain(arguments.iter().copied()).collect::<Vec<_>>(),
        )
        .assert()
        .code(2)
        .stdout("")
        .stderr(contains(wanted));
    }
    assert!(!room.path("runs").exists());
}

#[test]
fn plain_output_is_lines_without_control_characters() {
    let room = Room::new();
    let output = room.succeed(&quick(&["--gradient", "fd"]));
    let (stdout, stderr) =
        (String::from_utf8(output.stdout).unwrap(), String::from_utf8(output.stderr).unwrap());
    for text in [&stdout, &stderr] {
        assert!(!text.chars().any(|c| c.is_control() && c != '\n'), "{text:?}");
    }
    assert!(stderr.contains("evaluation 1/4: f_q ") && stderr.lines().any(|l| l == "pictures"), "{stderr}");
    assert!(
        stdout.starts_with("target high-key\nf_q ") && stdout.ends_with("runs/room-high-key/final.png\n")
    );
}

#[cfg(unix)]
mod signals {
    use std::process::{Child, Command, Stdio};

    use super::*;
    use crate::room::{signal, wait_for};

    /// A run that is busy with its evaluations for long.
    fn long_run(room: &Room, gradient: &str) -> Child {
        Command::new(assert_cmd::cargo::cargo_bin!("lightopt-embree"))
            .current_dir(room.directory.path())
            .args(["run", "room.obj", "--out", "a", "--json", "--max-evaluations", "1000"])
            .args(["--gradient", gradient, "--tolerance", "1e-6"])
            .args(["--work-size", "48x36", "--spp", "16", "--size", "24x18", "--final-spp", "4"])
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap()
    }

    #[test]
    fn an_interrupted_run_keeps_the_best_so_far() {
        // While the starts are compared, and while it optimises.
        for (gradient, log, n) in [
            ("fd", "evaluations.jsonl", 0),
            ("fd", "evaluations.jsonl", 2),
            ("fd", "iterations.jsonl", 1),
            ("basis", "evaluations.jsonl", 0),
            ("basis", "starts.jsonl", 1),
        ] {
            let room = Room::new();
            let child = long_run(&room, gradient);
            let path = room.path("a").join(log);
            wait_for(|| fs::read_to_string(&path).is_ok_and(|t| t.lines().count() >= n));
            signal(&child, "-INT");
            let output = child.wait_with_output().unwrap();
            let stderr = String::from_utf8(output.stderr).unwrap();
            assert_eq!(output.status.code(), Some(130), "{stderr}");
            assert!(stderr.contains("interrupted: keeping what is found so far"), "{stderr}");
            let json: Value = serde_json::from_slice(&output.stdout).unwrap();
            assert!(json["stop_reason"].as_str().unwrap().contains("interrupted"), "{json}");
            assert!(room.path("a/lights.toml").exists());
            // There may have been no time for a picture.
            let f_q_final = json["f_q_final"].as_f64();
            assert_eq!(room.path("a/final.png").exists(), f_q_final.is_some());
            if let Some(f_q_final) = f_q_final {
                let f_q = json_of(&room, &["evaluate", "a/final.exr"])["f_q"].as_f64().unwrap();
                assert!((f_q - f_q_final).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn a_killed_run_leaves_readable_logs_and_whole_pictures() {
        let room = Room::new();
        let mut child = long_run(&room, "fd");
        wait_for(|| {
            fs::read_to_string(room.path("a/iterations.jsonl")).is_ok_and(|t| t.lines().count() >= 1)
        });
        child.kill().unwrap();
        child.wait().unwrap();
        let directory = room.path("a");
        for log in ["evaluations.jsonl", "iterations.jsonl", "timing.jsonl"] {
            assert!(!lines(&directory.join(log)).is_empty(), "{log}");
        }
        let pictures = iterations(&directory);
        assert!(pictures.len() >= lines(&directory.join("iterations.jsonl")).len());
        for name in names(&directory).iter().filter(|n| n.ends_with(".exr")) {
            read_exr(&directory.join(name)).unwrap();
        }
        for name in names(&directory).iter().filter(|n| n.ends_with(".png")) {
            image::open(directory.join(name)).unwrap();
        }
        let error = room.fail_at_once(&quick(&["--out", "a"]));
        assert!(error.contains("go on with --resume a, or replace it with --force"), "{error}");
        room.succeed(&quick(&["--out", "a", "--force"]));
        assert!(names(&directory).iter().all(|n| !n.ends_with(".tmp")));
    }
}
