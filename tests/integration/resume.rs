//! What is stopped or killed goes on where it was, and ends with the same bytes.

use std::{
    collections::BTreeMap,
    fs,
    path::Path,
    process::{Command, Stdio},
    time::{Duration, Instant},
};

use lightopt_embree::film::exr::read_exr;

use crate::{
    reliability::{end, spawn, start},
    room::{MTL, OBJ, Room, TOML, names, signal, wait_for},
};

/// Bytes of all files below a directory, by their paths, but those that hold seconds.
fn contents(directory: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut all = BTreeMap::new();
    for name in names(directory) {
        let path = directory.join(&name);
        if path.is_dir() {
            all.extend(contents(&path).into_iter().map(|(below, bytes)| (format!("{name}/{below}"), bytes)));
        } else if !["timing.jsonl", "timings.csv", "report.html"].contains(&name.as_str()) {
            all.insert(name, fs::read(path).unwrap());
        }
    }
    all
}

fn assert_equal(room: &Room, a: &str, b: &str) {
    let (a, b) = (contents(&room.path(a)), contents(&room.path(b)));
    assert_eq!(a.keys().collect::<Vec<_>>(), b.keys().collect::<Vec<_>>());
    for (name, bytes) in &a {
        assert!(bytes == &b[name], "{name} differs");
    }
}

/// Starts the program, sends it the signal of a name after some time, and waits for its end. Returns whether it
/// was still at work.
fn stop_after(room: &Room, arguments: &[&str], time: Duration, name: &str) -> bool {
    let mut command = Command::new(assert_cmd::cargo::cargo_bin("lightopt-embree"));
    command.current_dir(room.directory.path()).args(arguments);
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    std::thread::sleep(time);
    let is_at_work = child.try_wait().unwrap().is_none();
    if is_at_work {
        signal(&child, name);
    }
    child.wait().unwrap();
    is_at_work
}

/// Runs that render bases, refine and check them, and pictures long enough to be stopped.
const RUNS: [&[&str]; 3] = [
    &[
        "--work-size",
        "32x24",
        "--size",
        "48x36",
        "--final-spp",
        "150",
        "--final-noise",
        "0",
        "--tolerance",
        "0.01",
        "--keep-basis",
    ],
    &[
        "--work-size",
        "24x18",
        "--size",
        "48x36",
        "--final-noise",
        "0.03",
        "--targets",
        "high-key,low-key",
        "--tolerance",
        "0.0075",
    ],
    &[
        "--gradient",
        "fd",
        "--work-size",
        "16x12",
        "--size",
        "48x36",
        "--final-spp",
        "64",
        "--max-evaluations",
        "4",
    ],
];

/// Kills a command at moments that a seed chooses, and lets it go on to its end.
fn kill_and_go_on(room: &Room, begin: &[&str], place: &str, whole: Duration, seed: u64, signal: &str) {
    let mut state = seed;
    let mut next = || {
        state = lightopt_embree::math::hash::mix64(state);
        whole.mul_f64((state >> 11) as f64 / (1_u64 << 53) as f64)
    };
    let resume = [begin[0], "--resume", place];
    // A command that is killed before it has its record leaves nothing to go on with.
    while !room.path(place).join(".resume/command.toml").exists() {
        if !stop_after(room, begin, next(), signal) {
            return;
        }
    }
    for _ in 0..2 {
        if !stop_after(room, &resume, next(), signal) || !room.path(place).join(".resume").exists() {
            return;
        }
    }
    room.succeed(&resume);
}

/// The command that begins a run.
fn begin<'a>(options: &[&'a str], out: &'a str) -> Vec<&'a str> {
    [&["run", "room.obj", "--out", out, "--threads", "2"], options].concat()
}

/// Kills each of some runs several times.
fn runs_that_are_killed(moments: u64, signals: &[&str]) {
    for (i, options) in RUNS.iter().enumerate() {
        let room = Room::new();
        let clock = Instant::now();
        room.succeed(&begin(options, "whole"));
        let whole = clock.elapsed();
        assert!(!room.path("whole/.resume").exists());
        for moment in 0..moments {
            let seed = 1000 * i as u64 + moment;
            let signal = signals[moment as usize % signals.len()];
            let out = format!("killed {moment}");
            kill_and_go_on(&room, &begin(options, &out), &out, whole, seed, signal);
            assert_equal(&room, "whole", &out);
        }
    }
}

#[test]
fn a_run_that_was_killed_ends_with_the_bytes_of_one_that_was_not() {
    runs_that_are_killed(1, &["-KILL"]);
}

/// Takes some minutes.
#[test]
#[ignore = "minutes of runs; the test before is a part of it"]
fn runs_that_are_killed_at_thirty_moments_end_with_the_same_bytes() {
    runs_that_are_killed(30, &["-KILL", "-KILL", "-INT"]);
}

#[test]
fn finished_pictures_are_not_rendered_again() {
    let room = Room::new();
    let run = ["run", "room.obj", "--out", "a", "--work-size", "24x18", "--tolerance", "0.5"];
    let sizes = ["--size", "96x72", "--final-spp"];
    // The pictures take for ever; so does what is stopped in them.
    let begin = [&run[..], &sizes, &["1000000", "--final-noise", "0"]].concat();
    let samples_of = |arguments: &[&str], time| {
        let mut child = start(&room, arguments, "pictures");
        std::thread::sleep(Duration::from_millis(time));
        end(&mut child, "-TERM", 143);
        let exr = read_exr(&room.path("a/initial.exr")).unwrap();
        exr.lightopt.unwrap()["spp"].as_u64().unwrap()
    };
    let first = samples_of(&begin, 2000);
    // Less time, in which it would not get as far, and enough for a pass: of one that is stopped nothing is left.
    let second = samples_of(&["run", "--resume", "a"], 800);
    assert!(second > first, "{first} samples, then {second}");
    assert!(names(&room.path("a/.resume")).iter().any(|name| name.ends_with(".basis")));
    assert!(room.path("a/transport.basis").exists() && room.path("a/lights.toml").exists());
}

#[test]
fn what_cannot_go_on_is_one_line_that_says_why() {
    let room = Room::new();
    let run = ["run", "room.obj", "--out", "a", "--work-size", "24x18", "--size", "96x72", "--final-spp"];
    let endless = [&run[..], &["1000000", "--final-noise", "0"]].concat();
    let mut child = start(&room, &endless, "pictures");
    child.kill().unwrap();
    child.wait().unwrap();
    let error = room.fail_at_once(&endless);
    assert!(error.contains("a: what was begun here is not done") && error.contains("--resume a"), "{error}");
    let other = room.command(&["run", "--resume", "a", "--seed", "3"]).assert().code(2);
    let error = String::from_utf8(other.get_output().stderr.clone()).unwrap();
    assert!(error.contains("'--resume <DIR>' cannot be used with"), "{error}");
    let error = room.fail_at_once(&["run", "--resume", "nowhere"]);
    assert!(error.contains("nowhere: nothing here is unfinished"), "{error}");
    // Of two that would go on, one does.
    let mut child = start(&room, &["run", "--resume", "a"], "pictures");
    let error = room.fail_at_once(&["run", "--resume", "a"]);
    assert!(error.contains("a: another run is being recorded here"), "{error}");
    child.kill().unwrap();
    child.wait().unwrap();
    fs::rename(room.path("a"), room.path("b")).unwrap();
    let error = room.fail_at_once(&["run", "--resume", "b"]);
    assert!(error.contains("b: ") && error.contains("move it back"), "{error}");
    // What is replaced is gone.
    let quick =
        [&run[..3], &["b", "--force", "--work-size", "16x12", "--final-spp", "1", "--tolerance", "1"]];
    room.succeed(&quick.concat());
    assert!(!room.path("b/.resume").exists() && !room.path("b/transport.basis").exists());
    let error = room.fail_at_once(&["run", "--resume", "b"]);
    assert!(error.contains("nothing here is unfinished"), "{error}");
}

#[test]
fn a_run_that_fails_leaves_nothing_behind() {
    let room = Room::new();
    room.write("bad.obj", "nothing");
    room.fail(&["run", "bad.obj", "--out", "deep/er/a"]);
    room.fail(&["run", "room.obj", "--memory", "10K", "--out", "deep/er/a"]);
    assert!(!room.path("deep").exists());
}

#[test]
fn what_the_cache_held_at_first_holds_for_the_whole_run() {
    let room = Room::new();
    let run = |out: &'static str, cache: &'static str, spp: &'static str| {
        let options = ["run", "room.obj", "--out", out, "--cache", cache, "--work-size", "24x18"];
        [&options[..], &["--size", "48x36", "--final-spp", spp, "--final-noise", "0", "--tolerance", "0.02"]]
            .concat()
    };
    // Stopped in its pictures, when the basis it found is in the cache already.
    let mut child = start(&room, &run("a", "cache a", "300"), "pictures");
    end(&mut child, "-TERM", 143);
    assert_eq!(names(&room.path("cache a")).len(), 1);
    room.succeed(&["run", "--resume", "a"]);
    room.succeed(&run("b", "cache b", "300"));
    assert_equal(&room, "a", "b");
    assert_equal(&room, "cache a", "cache b");
}

#[test]
fn figures_go_on_where_they_were() {
    let room = Room::new();
    room.write("fruit_basket.obj", OBJ);
    room.write("room.mtl", MTL);
    room.write("fruit_basket.toml", TOML);
    let options =
        ["--quick", "--scenes", ".", "--size", "24x18", "--work-size", "16x12", "--final-spp", "64"];
    let begin = |out| {
        let first = ["figures", "--only", "fig2,fig4,convergence", "--max-evaluations", "2", "--out", out];
        [&first[..], &options].concat()
    };
    let clock = Instant::now();
    room.succeed(&begin("whole"));
    let whole = clock.elapsed();
    for (out, seed, signal) in [("a", 1, "-KILL"), ("b", 2, "-TERM")] {
        kill_and_go_on(&room, &begin(out), out, whole, seed, signal);
        assert_equal(&room, "whole", out);
        assert!(!room.path(out).join(".resume").exists());
    }
}

#[test]
fn learning_goes_on_where_it_was() {
    let room = Room::new();
    for i in 0..40 {
        let value = |x: u32, y: u32| image::Luma([(x / 7 + y / 5 * i) as u8]);
        fs::create_dir_all(room.path("high")).unwrap();
        image::GrayImage::from_fn(450, 300, value).save(room.path(format!("high/{i:02}.png"))).unwrap();
    }
    let learn = |out| ["learn-signature", "--class", "high=high", "-o", out, "--threads", "1"];
    room.succeed(&learn("whole.toml"));
    let wanted = fs::read(room.path("whole.toml")).unwrap();
    let mut child = spawn(&room, &learn("a.toml"));
    wait_for(|| fs::read_dir(room.path(".a.toml.resume")).is_ok_and(|entries| entries.count() > 5));
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(!room.path("a.toml").exists());
    room.succeed(&["learn-signature", "--resume", "a.toml"]);
    assert!(fs::read(room.path("a.toml")).unwrap() == wanted);
    assert!(!room.path(".a.toml.resume").exists());
}
