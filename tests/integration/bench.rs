//! `lightopt-embree bench`.

use serde_json::Value;

use crate::room::{Room, names};

/// A benchmark of next to nothing.
const LITTLE: [&str; 7] = ["bench", "--quick", "--rounds", "1", "--spp", "1", "--json"];

/// Runs a benchmark where there is no Python.
fn bench(room: &Room, options: &[&str]) -> Value {
    let mut command = room.command(&[&LITTLE[..], options].concat());
    let output = command.env("PATH", "/nowhere").assert().code(0).get_output().clone();
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(said.contains("python3: has no other renderer"), "{said}");
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn a_benchmark_without_others_measures_this_program_alone() {
    let room = Room::new();
    let options = ["--scene", "room.obj", "--only", "efficiency,rays", "--threads", "1", "--out", "b"];
    let printed = bench(&room, &options);
    assert_eq!(
        names(&room.path("b")),
        ["bench.json", "efficiency.csv", "efficiency.png", "performance.md", "rays.csv", "rays.png"]
    );
    let kept: Value = serde_json::from_slice(&std::fs::read(room.path("b/bench.json")).unwrap()).unwrap();
    assert_eq!(kept, printed);
    let command = printed["command"].as_str().unwrap();
    assert_eq!(
        command,
        "lightopt-embree bench --scene room.obj --only efficiency,rays --quick --spp 1 --rounds 1 --threads 1"
    );
    let number = |of: &Value| of["median"].as_f64().unwrap();
    let rows = |part: &str| printed["parts"][part]["rows"].as_array().unwrap().clone();
    // Two integrators, with lights that rays pass and lights that stop them.
    let efficiency = rows("efficiency");
    assert_eq!(efficiency.len(), 4);
    for row in &efficiency {
        let product = number(&row["seconds"]) * number(&row["relative_error"]) * number(&row["efficiency"]);
        assert!((product - 1.0).abs() < 1e-9, "{row}");
        assert_eq!(row["program"], "ours");
        assert!(row["ratio"].is_null(), "there is nothing to compare with");
    }
    for row in rows("rays") {
        // A sample asks for one ray at least, and some of them are shadow rays.
        assert!(row["rays_per_sample"].as_f64().unwrap() > 1.0, "{row}");
        let any = row["any_hit"].as_f64().unwrap();
        assert!(any > 0.0 && any < 1.0, "{row}");
    }
}

#[test]
fn an_earlier_benchmark_is_kept_unless_asked_for_otherwise() {
    let room = Room::new();
    let options = ["--scene", "room.obj", "--only", "rays", "--out", "b"];
    bench(&room, &options);
    let again = [&LITTLE[..], &options].concat();
    let error = room.fail(&again);
    assert!(error.contains("b: an earlier benchmark is here; --force replaces it"), "{error}");
    room.write("README.md", "no marks");
    let page = [&options[..], &["--force", "--page", "README.md"]].concat();
    let mut command = room.command(&[&LITTLE[..], &page].concat());
    let error = command.env("PATH", "/nowhere").assert().code(1).get_output().stderr.clone();
    assert!(String::from_utf8(error).unwrap().contains("README.md: has no lines `<!--"));
}

#[test]
fn what_is_missing_is_said_in_a_line() {
    let room = Room::new();
    let error = room.fail(&["bench", "--python", "no/python", "--scene", "room.obj"]);
    assert!(error.contains("no/python: cannot be started") && error.contains("--install-peers"), "{error}");
    let error = room.fail(&["bench", "--scene", "nothing.obj", "--only", "rays"]);
    assert!(error.contains("nothing.obj"), "{error}");
}
