//! What is found is kept, whatever happens.

use std::{
    fs,
    io::{BufRead, BufReader},
    path::Path,
    process::{Child, Command, Stdio},
    time::{Duration, Instant},
};

use lightopt_embree::film::exr::read_exr;

use crate::room::{MTL, OBJ, Room, Running, TOML, names, signal, wait_for};

/// Starts the program in a room.
pub fn spawn(room: &Room, arguments: &[&str]) -> Running {
    let mut command = Command::new(assert_cmd::cargo::cargo_bin("lightopt-embree"));
    command.current_dir(room.directory.path()).args(arguments);
    Running(command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap())
}

/// Starts the program in a room and waits until it says `line`.
pub fn start(room: &Room, arguments: &[&str], line: &str) -> Running {
    let mut child = spawn(room, arguments);
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines().map_while(Result::ok);
    assert!(lines.any(|l| l.starts_with(line)), "it never says `{line}`");
    // Whoever reads no more would end it by a broken pipe.
    std::thread::spawn(move || lines.for_each(drop));
    child
}

/// Ends a program by a signal, and checks how it ends and that it does so soon.
pub fn end(child: &mut Child, name: &str, status: i32) {
    let clock = Instant::now();
    signal(child, name);
    assert_eq!(child.wait().unwrap().code(), Some(status), "{name}");
    // Two seconds are promised; what else the machine does must not fail a test.
    assert!(clock.elapsed() < Duration::from_secs(6), "{:?}", clock.elapsed());
}

/// Checks that no file below a directory is half-written, and that pictures can be read.
fn all_is_whole(directory: &Path) {
    for name in names(directory) {
        let path = directory.join(&name);
        assert!(!name.ends_with(".tmp"), "{name}");
        if path.is_dir() {
            all_is_whole(&path);
        } else if name.ends_with(".exr") {
            read_exr(&path).unwrap();
        } else if name.ends_with(".jsonl") {
            let text = fs::read_to_string(&path).unwrap();
            assert!(
                text.lines().all(|line| serde_json::from_str::<serde_json::Value>(line).is_ok()),
                "{name}"
            );
        }
    }
}

const LONG: [&str; 10] = [
    "--work-size",
    "32x24",
    "--size",
    "96x72",
    "--final-spp",
    "100000",
    "--final-noise",
    "0",
    "--tolerance",
    "0.5",
];

#[test]
fn signals_end_a_run_in_order_and_keep_what_is_found() {
    for (name, status) in [("-INT", 130), ("-TERM", 143), ("-HUP", 129)] {
        let room = Room::new();
        let mut child = start(&room, &[&["run", "room.obj", "--out", "a"], &LONG[..]].concat(), "pictures");
        assert!(room.path("a/lights.toml").exists(), "the lights are there before any picture");
        end(&mut child, name, status);
        all_is_whole(&room.path("a"));
        room.succeed(&["render", "--lights", "a/lights.toml", "--spp", "1", "-o", "a.exr", "room.obj"]);
    }
}

/// Options of a run, and the line with which the stage begins during which it is ended.
const STAGES: [(&[&str], &str); 7] = [
    (&["--work-size", "160x120", "--spp", "65536"], "survey"),
    (&["--work-size", "160x120", "--spp", "65536"], "rendering the transport basis"),
    (&["--work-size", "160x120", "--spp", "4", "--tolerance", "0.0001"], "searching the basis"),
    (&["--work-size", "48x36", "--spp", "256", "--tolerance", "0.5"], "checking the result"),
    (&["--work-size", "32x24", "--tolerance", "0.5", "--size", "2048x1536"], "pictures"),
    (&["--gradient", "fd", "--spp", "4096", "--work-size", "64x48"], "measuring the start"),
    (&["--gradient", "fd", "--spp", "128", "--work-size", "64x48"], "optimising"),
];

#[test]
fn every_stage_of_a_run_ends_within_seconds_of_a_signal() {
    for (options, line) in STAGES {
        let room = Room::new();
        let mut child = start(&room, &[&["run", "room.obj", "--out", "a"], options].concat(), line);
        end(&mut child, "-TERM", 143);
        if room.path("a").exists() {
            all_is_whole(&room.path("a"));
        }
    }
}

/// Waits until a process catches SIGTERM.
fn wait_for_handler(child: &Child) {
    wait_for(|| {
        let status = fs::read_to_string(format!("/proc/{}/status", child.id())).unwrap();
        let mask = status.lines().find_map(|line| line.strip_prefix("SigCgt:")).unwrap().trim();
        u64::from_str_radix(mask, 16).unwrap() >> 14 & 1 == 1
    });
}

#[test]
fn commands_that_have_nothing_to_keep_end_at_once() {
    let room = Room::new();
    // Vertices that take some seconds to read.
    let vertices: String = (0..400_000).map(|i| format!("v {i} 0.25 {}\n", i % 7)).collect();
    room.write("large.obj", format!("{OBJ}{vertices}"));
    room.write("large.toml", TOML);
    for command in
        [&["run", "large.obj", "--out", "a"][..], &["render", "large.obj"], &["stage", "large.obj"]]
    {
        let mut child = spawn(&room, command);
        wait_for_handler(&child);
        let clock = Instant::now();
        signal(&child, "-TERM");
        let status = child.wait().unwrap().code();
        // `stage` finds a sidecar there, which may come first.
        assert!(
            status == Some(143) || (command[0] == "stage" && status == Some(1)),
            "{command:?} {status:?}"
        );
        assert!(clock.elapsed() < Duration::from_secs(5), "{:?}", clock.elapsed());
    }
    assert!(!room.path("large.exr").exists());
}

#[test]
fn a_render_that_is_stopped_keeps_its_picture() {
    let room = Room::new();
    let render = ["render", "room.obj", "--size", "96x72", "--spp", "100000", "-o", "a.exr"];
    let mut child = start(&room, &render, "rendering");
    std::thread::sleep(Duration::from_secs(1));
    end(&mut child, "-INT", 130);
    let exr = read_exr(&room.path("a.exr")).unwrap();
    let attribute = exr.lightopt.unwrap();
    assert_eq!(attribute["incomplete"], true);
    let spp = attribute["spp"].as_u64().unwrap().to_string();
    room.succeed(&["render", "room.obj", "--size", "96x72", "--spp", &spp, "-o", "b.exr"]);
    let again = read_exr(&room.path("b.exr")).unwrap();
    assert_eq!(
        exr.parts[0].channels, again.parts[0].channels,
        "its samples are the first of those asked for"
    );
    assert!(again.lightopt.unwrap().get("incomplete").is_none());
}

#[test]
fn a_second_signal_ends_at_once_and_what_nohup_ignores_is_ignored() {
    let room = Room::new();
    let run = [&["run", "room.obj", "--out", "a"], &LONG[..]].concat();
    let mut child = start(&room, &run, "pictures");
    signal(&child, "-INT");
    signal(&child, "-TERM");
    let status = child.wait().unwrap().code();
    assert!(status == Some(143) || status == Some(130), "{status:?}");
    all_is_whole(&room.path("a"));

    let program = assert_cmd::cargo::cargo_bin("lightopt-embree");
    let script = "trap '' HUP; exec \"$0\" render room.obj --size 96x72 --spp 100000 -o c.exr";
    let mut command = Command::new("sh");
    command.current_dir(room.directory.path()).args(["-c", script]).arg(program).stderr(Stdio::null());
    let mut child = Running(command.spawn().unwrap());
    wait_for_handler(&child);
    signal(&child, "-HUP");
    std::thread::sleep(Duration::from_millis(300));
    assert!(child.try_wait().unwrap().is_none(), "it goes on");
    end(&mut child, "-TERM", 143);
}

/// A limit of the size of files, 40 blocks of 512 or 1024 bytes, is what a full disk is.
/// Runs the program with arguments under a limit of `ulimit`, with which it must fail; returns what it says.
fn fail_under(room: &Room, limit: &str, arguments: &str) -> String {
    let program = assert_cmd::cargo::cargo_bin("lightopt-embree");
    let script = format!("ulimit {limit}; exec \"$0\" {arguments}");
    let mut command = Command::new("sh");
    command.current_dir(room.directory.path()).args(["-c", &script]).arg(program);
    let out = command.output().unwrap();
    let error = String::from_utf8(out.stderr).unwrap();
    assert_eq!(out.status.code(), Some(1), "{error}");
    error
}

#[test]
fn a_file_that_may_not_grow_is_an_error() {
    let room = Room::new();
    let error = fail_under(&room, "-f 40", "render room.obj --size 128x96 --spp 1 -o a.exr");
    let last = error.lines().last().unwrap();
    assert!(last.starts_with("error: a.exr: ") && last.contains("File too large"), "{error}");
    assert_eq!(names(room.directory.path()), ["room.mtl", "room.obj", "room.toml"]);
}

#[test]
fn a_log_that_may_not_grow_ends_with_a_whole_line() {
    let room = Room::new();
    // More than any picture takes, and less than the log.
    let error = fail_under(
        &room,
        "-f 41",
        "run room.obj --out a --gradient fd --max-evaluations 60 --tolerance 0.5 --work-size 16x12 \
         --size 24x18 --spp 4 --final-spp 4",
    );
    let last = error.lines().last().unwrap();
    assert!(last.starts_with("error: a/evaluations.jsonl: cannot append to the log: "), "{error}");
    let log = fs::read_to_string(room.path("a/evaluations.jsonl")).unwrap();
    assert!(log.ends_with('\n') && log.len() > 10_000, "{}", log.len());
    for line in log.lines() {
        serde_json::from_str::<serde_json::Value>(line).unwrap();
    }
}

#[test]
fn what_a_killed_render_left_is_removed_by_the_next() {
    let room = Room::new();
    // Process numbers end at 2^22.
    room.write(".a.png.4194304-0.tmp", "half");
    room.write(".b.png.4194304-0.tmp", "of another");
    room.succeed(&["render", "room.obj", "--spp", "1", "-o", "a.png"]);
    let left = names(room.directory.path());
    assert_eq!(left, [".b.png.4194304-0.tmp", "a.png", "room.mtl", "room.obj", "room.toml"]);
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
    let exr = read_exr(&room.path("a/final.exr")).unwrap();
    let attribute = exr.lightopt.unwrap();
    assert_eq!(attribute["incomplete"], true);
    assert!((4..100_000).contains(&attribute["spp"].as_u64().unwrap()));
    let evaluated = room.succeed(&["evaluate", "a/final.exr", "--json"]);
    let evaluated: serde_json::Value = serde_json::from_slice(&evaluated.stdout).unwrap();
    let [found, told] = [&evaluated["f_q"], &json["f_q_final"]].map(|f_q| f_q.as_f64().unwrap());
    assert!((found - told).abs() < 1e-12);
}

/// With a search of the whole box, and with lamps to be placed, one pass of each is made as well, and the limit
/// that is named is the one that was given.
#[test]
fn a_limit_leaves_one_pass_of_everything() {
    for more in [&["--global"][..], &["--lamps", "2"]] {
        let room = Room::new();
        let run = ["run", "room.obj", "--out", "a", "--time-limit", "0.5", "--tolerance", "1e-5", "--json"];
        let sizes =
            ["--work-size", "24x18", "--size", "48x36", "--final-spp", "1000000", "--final-noise", "0"];
        let out = room.succeed(&[&run[..], &sizes, more].concat());
        let json: serde_json::Value = serde_json::from_slice(&out.stdout).unwrap();
        let caution = json["caution"].as_str().unwrap();
        assert!(caution.contains("the time limit of 0.5 s was too short"), "{more:?}: {caution}");
        let record: toml::Table = fs::read_to_string(room.path("a/run.toml")).unwrap().parse().unwrap();
        assert_eq!(record["options"]["time_limit"].as_float(), Some(0.5));
        all_is_whole(&room.path("a"));
    }
}

/// Error and samples that would take hours: where they are asked for, only the limit ends a run.
#[test]
fn a_limit_ends_a_run_that_asks_for_more_than_fits_and_what_is_lacking_is_said() {
    for mode in ["basis", "fd"] {
        let room = Room::new();
        let clock = Instant::now();
        let out = room.succeed(
            &[
                "run",
                "room.obj",
                "--out",
                "a",
                "--gradient",
                mode,
                "--tolerance",
                "1e-5",
                "--time-limit",
                "2",
            ]
            .into_iter()
            .chain(["--work-size", "24x18", "--size", "48x36", "--final-spp", "1000000"])
            .chain(["--final-noise", "0", "--json"])
            .collect::<Vec<_>>(),
        );
        // The limit and a tenth and a second are promised; what else the machine does must not fail a test.
        assert!(clock.elapsed() < Duration::from_secs(20), "{mode}: {:?}", clock.elapsed());
        let json: serde_json::Value = serde_json::from_slice(&out.stdout).unwrap();
        let caution = json["caution"].as_str().unwrap();
        let error = json["f_q_error"].as_f64().unwrap();
        let said = format!(
            "the time limit of 2 s was too short: f_q is known to {error:.4} only, 0.00001 was asked for, the \
             picture has"
        );
        assert!(caution.contains(&said), "{mode}: {caution}");
        assert!(error > 1e-5 && error.is_finite(), "{mode}: {error}");
        if mode == "fd" {
            assert_eq!(json["stop_reason"], "the time limit was reached");
        }
        let exr = read_exr(&room.path("a/final.exr")).unwrap();
        assert_eq!(exr.lightopt.unwrap()["incomplete"], true);
        all_is_whole(&room.path("a"));
    }
}

#[test]
fn a_second_run_into_one_directory_is_refused() {
    let room = Room::new();
    let run = [&["run", "room.obj", "--force", "--out", "a"], &LONG[..]].concat();
    let mut child = start(&room, &run, "pictures");
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
fn a_cache_below_a_file_is_an_error_before_any_work() {
    let room = Room::new();
    room.write("file", "mine");
    for (cache, wanted) in [
        ("file", "error: file: cannot make the directory: "),
        ("file/c", "error: file/c: cannot make the directory: "),
        ("file/c/d", "error: file/c/d: cannot make the directory: "),
    ] {
        let error = room.fail(&["run", "room.obj", "--cache", cache, "--out", "a", "--work-size", "16x12"]);
        assert!(error.starts_with(wanted), "{error}");
    }
    assert_eq!(names(room.directory.path()), ["file", "room.mtl", "room.obj", "room.toml"]);
    assert_eq!(fs::read_to_string(room.path("file")).unwrap(), "mine");
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
        let exr = read_exr(&room.path(file)).unwrap();
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
