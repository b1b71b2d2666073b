//! The transport basis on disk: `run --cache`, `relight`, `scan`.

use std::fs;

use lightopt_embree::film::exr::read_exr;
use serde_json::Value;

use crate::room::{QUICK, Room, names};

fn run(room: &Room, more: &[&str]) -> Value {
    let mut arguments = vec!["run", "room.obj", "--json", "--cache", "bases", "--tolerance", "1"];
    arguments.extend(QUICK);
    arguments.extend(more);
    serde_json::from_slice(&room.succeed(&arguments).stdout).unwrap()
}

fn basis(room: &Room) -> String {
    let all = names(&room.path("bases"));
    assert_eq!(all.len(), 1, "{all:?}");
    format!("bases/{}", all[0])
}

#[test]
fn another_look_of_the_scene_renders_no_basis() {
    let room = Room::new();
    run(&room, &["--out", "a"]);
    let first = fs::read(room.path(basis(&room))).unwrap();
    let mut arguments = vec!["run", "room.obj", "--cache", "bases", "--tolerance", "1"];
    arguments.extend(QUICK);
    arguments.extend(["--target", "low-key", "--out", "b"]);
    let stderr = String::from_utf8(room.succeed(&arguments).stderr).unwrap();
    assert!(stderr.contains("nothing to render"), "{stderr}");
    assert!(!stderr.contains("rendering the transport basis"), "{stderr}");
    assert!(fs::read(room.path(basis(&room))).unwrap() == first);
    // What decides the transport makes another basis.
    room.write(
        "room.mtl",
        "newmtl floor\nKd 0.4 0.5 0.5\nnewmtl wall\nKd 0.6 0.6 0.7\nnewmtl red\nKd 0.7 0.2 0.1\n",
    );
    run(&room, &["--out", "c"]);
    assert_eq!(names(&room.path("bases")).len(), 2);
}

#[test]
fn several_looks_come_from_one_basis() {
    let room = Room::new();
    let all = run(&room, &["--targets", "high-key,low-key", "--out", "looks"]);
    let looks: Vec<&str> = all.as_array().unwrap().iter().map(|r| r["run_dir"].as_str().unwrap()).collect();
    assert_eq!(looks, ["looks/high-key", "looks/low-key"]);
    let (high, low) = (&all[0], &all[1]);
    assert!(high["terms"]["meanBack"]["value"].as_f64() > low["terms"]["meanBack"]["value"].as_f64());
    for look in looks {
        let manifest = fs::read_to_string(room.path(look).join("run.toml")).unwrap();
        assert!(manifest.contains("targets = [\"high-key\", \"low-key\"]"), "{manifest}");
        assert!(room.path(look).join("final.exr").exists() && room.path(look).join("lights.toml").exists());
        let mut again = vec!["evaluate", "--json"];
        let picture = format!("{look}/final.exr");
        again.push(&picture);
        room.succeed(&again);
    }
}

#[test]
fn more_looks_than_are_found_together_are_found_in_turn() {
    let room = Room::new();
    let high = include_str!("../../scenes/targets/high-key.toml");
    for (name, mean) in [("a", "0.2"), ("b", "0.3"), ("c", "0.4")] {
        let text = high.replace("\"high-key\"", &format!("{name:?}"));
        room.write(&format!("{name}.toml"), text.replace("t_meanObj = 0.47", &format!("t_meanObj = {mean}")));
    }
    let targets = "high-key,a.toml,low-key,b.toml,c.toml";
    let run = ["run", "room.obj", "--json", "--targets", targets, "--out", "looks", "--tolerance", "0.05"];
    let all: Value = serde_json::from_slice(&room.succeed(&[&run[..], &QUICK].concat()).stdout).unwrap();
    let found: Vec<(&str, f64)> = all
        .as_array()
        .unwrap()
        .iter()
        .map(|r| (r["target"].as_str().unwrap(), r["f_q"].as_f64().unwrap()))
        .collect();
    assert_eq!(found.iter().map(|f| f.0).collect::<Vec<_>>(), ["high-key", "a", "low-key", "b", "c"]);
    for (name, f_q) in &found {
        let initial = all.as_array().unwrap().iter().find(|r| r["target"] == *name).unwrap();
        assert!(*f_q < initial["f_q_initial"].as_f64().unwrap(), "{name}: {f_q}");
    }
}

#[test]
fn a_basis_is_relit_as_the_run_recorded_it() {
    let room = Room::new();
    run(&room, &["--out", "a"]);
    let basis = basis(&room);
    // The lighting of the last improvement, whose picture is in the run directory.
    let log = fs::read_to_string(room.path("a/iterations.jsonl")).unwrap();
    let line: Value = serde_json::from_str(log.lines().last().unwrap()).unwrap();
    let x = |name: &str| line["x"][name].as_f64().unwrap();
    let mut lights = format!("schema = 1\n[background]\nvalue = {:?}\n", x("background.value"));
    for l in ["key", "fill"] {
        let (radiance, size) = (x(&format!("{l}.radiance")), x(&format!("{l}.size")));
        lights += &format!("[[lights]]\nname = \"{l}\"\nradiance = {radiance:?}\nsize = {size:?}\n");
    }
    room.write("lights.toml", lights);
    room.succeed(&["relight", "--lights", "lights.toml", &basis, "-o", "lit.exr"]);
    let lit = read_exr(&room.path("lit.exr")).unwrap();
    assert_eq!((lit.width, lit.height), (16, 12));
    let last = names(&room.path("a")).into_iter().filter(|n| n.starts_with("iter_")).max().unwrap();
    let recorded = read_exr(&room.path("a").join(last)).unwrap();
    let (a, b) = (lit.beauty().unwrap(), recorded.beauty().unwrap());
    let scale = b.iter().flatten().fold(0.0_f32, |m, v| m.max(*v));
    for (a, b) in a.iter().flatten().zip(b.iter().flatten()) {
        assert!((a - b).abs() <= 1e-5 * scale, "{a} {b}");
    }
    room.succeed(&["relight", "--lights", "a/lights.toml", &basis, "-o", "found.png"]);
    room.succeed(&["relight", &basis, "-o", "start.png"]);
    image::open(room.path("start.png")).unwrap();
}

#[test]
fn a_scan_is_a_table_and_a_plot() {
    let room = Room::new();
    run(&room, &["--out", "a"]);
    let basis = basis(&room);
    room.succeed(&["scan", "--variable", "key.size", "--steps", "5", &basis, "-o", "size.csv"]);
    let table = fs::read_to_string(room.path("size.csv")).unwrap();
    let rows: Vec<Vec<&str>> = table.lines().map(|l| l.split(',').collect()).collect();
    assert_eq!(rows.len(), 6);
    assert_eq!(rows[0][..3], ["key.size", "f_q", "f_q_error"]);
    assert!(rows.iter().all(|r| r.len() == 15));
    for row in &rows[1..] {
        assert!(row.iter().all(|v| v.parse::<f64>().unwrap().is_finite()), "{row:?}");
    }
    image::open(room.path("size.png")).unwrap();
    let error = room.fail(&["scan", "--variable", "key.sise", &basis, "-o", "x.csv"]);
    assert!(error.contains("no variable `key.sise`; did you mean `key.size`?"), "{error}");
}

#[test]
fn what_is_no_basis_or_does_not_fit_is_one_line() {
    let room = Room::new();
    run(&room, &["--out", "a"]);
    let whole = fs::read(room.path(basis(&room))).unwrap();
    let basis = basis(&room);
    for (bytes, wanted) in [
        (b"hello".to_vec(), "not a transport basis"),
        (whole[..whole.len() - 9].to_vec(), "damaged or cut short"),
        ([&whole[..500], &[whole[500] ^ 1], &whole[501..]].concat(), "damaged or cut short"),
        ([&whole[..13], &[9], &whole[14..]].concat(), "of version 9"),
    ] {
        room.write("bad.basis", bytes);
        let error = room.fail(&["relight", "bad.basis", "-o", "x.png"]);
        assert!(error.contains("bad.basis") && error.contains(wanted), "{error}");
    }
    let lights = fs::read_to_string(room.path("a/lights.toml")).unwrap();
    room.write("bad.toml", lights.replace("name = \"key\"", "name = \"kee\""));
    let error = room.fail(&["relight", "--lights", "bad.toml", &basis, "-o", "x.png"]);
    assert!(error.contains("bad.toml: `lights.name`: the basis has no light `kee`"), "{error}");
    let error = room.fail(&["relight", &basis, "-o", "x.jpg"]);
    assert!(error.contains("a picture ends in .exr or .png"), "{error}");
    // A damaged basis in the cache is rendered again.
    room.write(&basis, &whole[..100]);
    run(&room, &["--out", "b"]);
    assert!(fs::read(room.path(&basis)).unwrap().len() == whole.len());
}

#[test]
fn memory_is_planned_before_rendering() {
    let room = Room::new();
    let mut arguments = vec!["run", "room.obj", "--memory", "2M"];
    arguments.extend(QUICK);
    let stderr = String::from_utf8(room.succeed(&arguments).stderr).unwrap();
    assert!(stderr.contains("fewer to fit the memory allowed"), "{stderr}");
    let mut arguments = vec!["run", "room.obj", "--memory", "10K", "--out", "b"];
    arguments.extend(QUICK);
    let error = room.fail(&arguments);
    assert!(error.contains("allow more with --memory"), "{error}");
    let needed = error.split("needs ").nth(1).unwrap().split(',').next().unwrap();
    assert!(error.contains("more than the 10 KiB allowed") && needed != "0 MiB", "{error}");
    assert!(needed.split(' ').next().unwrap().parse::<u32>().unwrap() > 10, "{error}");
    let error = room.fail(&["run", "room.obj", "--memory", "1", "--out", "b"]);
    assert!(error.contains("more than the 1 byte allowed"), "{error}");
    assert!(!room.path("b").exists());
}
