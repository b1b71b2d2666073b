//! What is found is kept, whatever happens.

use std::{
    fs,
    io::{BufRead, BufReader},
    process::{Child, Command, Stdio},
    time::{Duration, Instant},
};

use crate::room::{MTL, OBJ, Room, TOML, names};

/// Starts the program in a room and waits until it says `line`.
fn start(room: &Room, arguments: &[&str], line: &str) -> Child {
    let mut child = Command::new(assert_cmd::cargo::cargo_bin("lightopt-embree"))
        .current_dir(room.directory.path())
        .args(arguments)
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines().map_while(Result::ok);
    assert!(lines.any(|l| l.starts_with(line)), "it never says `{line}`");
    // Whoever reads no more would end it by a broken pipe.
    std::thread::spawn(move || lines.for_each(drop));
    child
}

fn signal(child: &Child, name: &str) {
    let status = Command::new("kill").args([name, &child.id().to_string()]).status().unwrap();
    assert!(status.success());
}

const LONG: [&str; 8] =
    ["--work-size", "32x24", "--size", "96x72", "--final-spp", "100000", "--tolerance", "0.5"];

#[test]
fn signals_end_a_run_in_order_and_keep_what_is_found() {
    for (name, status) in [("-INT", 130), ("-TERM", 143), ("-HUP", 129)] {
        let room = Room::new();
        let mut child =
            start(&room, &[&["run", "room.obj", "--out", "a"], &LONG[..]].concat(), "initial picture");
        assert!(room.path("a/lights.toml").exists(), "the lights are there before any picture");
        let clock = Instant::now();
        signal(&child, name);
        assert_eq!(child.wait().unwrap().code(), Some(status), "{name}");
        assert!(clock.elapsed() < Duration::from_secs(10), "{:?}", clock.elapsed());
        assert!(names(&room.path("a")).iter().all(|n| !n.ends_with(".tmp")), "{:?}", names(&room.path("a")));
        room.succeed(&["render", "--lights", "a/lights.toml", "--spp", "1", "-o", "a.exr", "room.obj"]);
        for file in names(&room.path("a")).iter().filter(|n| n.ends_with(".exr")) {
            lightopt_embree::film::exr::read_exr(&room.path("a").join(file)).unwrap();
        }
    }
}

#[test]
fn a_picture_that_was_cut_short_says_so() {
    let room = Room::new();
    let limit = ["--time-limit", "1", "--json"];
    let clock = Instant::now();
    let out = room.succeed(&[&["run", "room.obj", "--out", "a"], &LONG[..], &limit].concat());
    // Generous: what else the machine does must not fail a test.
    assert!(clock.elapsed() < Duration::from_secs(15), "{:?}", clock.elapsed());
    let json: serde_json::Value = serde_json::from_slice(&out.stdout).unwrap();
    let caution = json["caution"].as_str().unwrap();
    assert!(caution.contains("the time limit of 1 s was too short: the picture has"), "{caution}");
    let exr = lightopt_embree::film::exr::read_exr(&room.path("a/final.exr")).unwrap();
    let attribute = exr.lightopt.unwrap();
    assert_eq!(attribute["incomplete"], true);
    // Its samples are the first of those that it was to have.
    let spp = attribute["spp"].as_u64().unwrap().to_string();
    let render = ["render", "--lights", "a/lights.toml", "--size", "96x72", "--spp", &spp, "-o", "b.exr"];
    room.succeed(&[&render[..], &["room.obj"]].concat());
    let again = lightopt_embree::film::exr::read_exr(&room.path("b.exr")).unwrap();
    assert_eq!(exr.parts[0].channels, again.parts[0].channels);
}

#[test]
fn a_second_run_into_one_directory_is_refused() {
    let room = Room::new();
    let run = [&["run", "room.obj", "--force", "--out", "a"], &LONG[..]].concat();
    let mut child = start(&room, &run, "initial picture");
    let error = room.fail(&run);
    assert!(error.contains("a: another run is being recorded here"), "{error}");
    signal(&child, "-KILL");
    child.wait().unwrap();
    let quick: Vec<&str> = run.iter().map(|word| if *word == "100000" { "4" } else { word }).collect();
    room.succeed(&quick);
}

#[test]
fn a_cache_that_cannot_be_written_is_an_error_before_any_work() {
    // A name that leaves no room for that of the basis.
    let stem = "n".repeat(240);
    let room = Room::with(OBJ, MTL, TOML);
    fs::rename(room.path("room.obj"), room.path(format!("{stem}.obj"))).unwrap();
    fs::rename(room.path("room.toml"), room.path(format!("{stem}.toml"))).unwrap();
    let scene = format!("{stem}.obj");
    let error = room.fail(&["run", &scene, "--cache", "c", "--out", "a", "--work-size", "16x12"]);
    assert!(error.contains(".basis: cannot create the file"), "{error}");
    assert!(!room.path("a").exists());
}

#[test]
fn a_cache_is_freed_of_what_killed_runs_left() {
    let room = Room::new();
    fs::create_dir(room.path("c")).unwrap();
    // Process numbers end at 2^22.
    room.write("c/.room-0.basis.4194304-0.tmp", "half");
    room.write("c/mine.txt", "mine");
    let run = ["run", "room.obj", "--cache", "c", "--out", "a", "--work-size", "16x12", "--size", "16x12"];
    room.succeed(&[&run[..], &["--final-spp", "1", "--tolerance", "0.5"]].concat());
    let left = names(&room.path("c"));
    assert!(left.len() == 2 && left.contains(&"mine.txt".to_owned()), "{left:?}");
}

/// A variable whose bounds are equal is not free, and the basis shows what a render shows.
#[test]
fn ranges_of_no_width_hold_what_they_say() {
    let toml = TOML.replace("radiance = 8.0", "radiance = 8.0\nsize = 1.5\nsize_range = [1.5, 1.5]")
        + "[background]\nvalue_range = [0.4, 0.4]\n";
    let room = Room::with(OBJ, MTL, &toml);
    let run = ["run", "room.obj", "--cache", "c", "--out", "a", "--work-size", "24x18", "--size", "24x18"];
    let out = room.succeed(
        &[&run[..], &["--final-spp", "64", "--spp", "64", "--tolerance", "0.05", "--json"]].concat(),
    );
    let json: serde_json::Value = serde_json::from_slice(&out.stdout).unwrap();
    let x = json["x"].as_object().unwrap();
    assert_eq!(x.keys().collect::<Vec<_>>(), ["fill.radiance", "fill.size", "key.radiance"]);
    let basis = names(&room.path("c")).remove(0);
    let basis = format!("c/{basis}");
    room.succeed(&["relight", "--lights", "a/lights.toml", &basis, "-o", "b.exr"]);
    let mean = |file: &str| {
        let exr = lightopt_embree::film::exr::read_exr(&room.path(file)).unwrap();
        let values = exr.parts[0].channel("G").unwrap();
        values.iter().sum::<f32>() / values.len() as f32
    };
    let (relit, rendered) = (mean("b.exr"), mean("a/final.exr"));
    assert!((relit / rendered - 1.0).abs() < 0.02, "{relit} {rendered}");
    // A background that is black is lit all the same.
    let room = Room::with(OBJ, MTL, &toml.replace("[0.4, 0.4]", "[0.0, 0.0]"));
    room.succeed(&[
        "run",
        "room.obj",
        "--out",
        "a",
        "--work-size",
        "24x18",
        "--size",
        "24x18",
        "--final-spp",
        "4",
    ]);
}
