//! `figures`: the paper's tables and figures, on the room in place of the fruit basket.

use std::{collections::BTreeMap, fs, path::Path};

use serde_json::Value;
use sha2::{Digest, Sha256};

use crate::room::{MTL, OBJ, Room, TOML, names};

/// Options that make figures quick.
const TINY: [&str; 11] = [
    "--quick",
    "--scenes",
    ".",
    "--size",
    "24x18",
    "--work-size",
    "16x12",
    "--final-spp",
    "4",
    "--max-evaluations",
    "2",
];

fn room() -> Room {
    let room = Room::new();
    room.write("fruit_basket.obj", OBJ);
    room.write("room.mtl", MTL);
    room.write("fruit_basket.toml", TOML);
    room
}

fn figures(room: &Room, more: &[&str]) {
    let mut arguments = vec!["figures"];
    arguments.extend(TINY);
    arguments.extend(more);
    room.succeed(&arguments);
}

/// Bytes of all files below a directory but those that hold seconds.
fn files(directory: &Path, prefix: &str, into: &mut BTreeMap<String, Vec<u8>>) {
    for name in names(directory) {
        let path = directory.join(&name);
        if path.is_dir() {
            files(&path, &format!("{prefix}{name}/"), into);
        } else if name != "timing.jsonl" && name != "timings.csv" {
            into.insert(format!("{prefix}{name}"), fs::read(path).unwrap());
        }
    }
}

fn all(directory: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut all = BTreeMap::new();
    files(directory, "", &mut all);
    all
}

fn manifest(directory: &Path) -> Value {
    serde_json::from_slice(&fs::read(directory.join("manifest.json")).unwrap()).unwrap()
}

#[test]
fn equal_runs_of_figures_give_equal_bytes_and_the_manifest_hashes_them() {
    let room = room();
    let only = ["--only", "fig2,fig4,table1,convergence"];
    figures(&room, &[&only[..], &["--out", "a", "--threads", "1"]].concat());
    figures(&room, &[&only[..], &["--out", "b", "--threads", "2"]].concat());
    let (a, b) = (all(&room.path("a")), all(&room.path("b")));
    assert_eq!(a.keys().collect::<Vec<_>>(), b.keys().collect::<Vec<_>>());
    for (name, bytes) in &a {
        assert!(bytes == &b[name], "{name} differs");
    }
    for name in ["fig2.png", "fig4.png", "convergence.png"] {
        let picture = image::load_from_memory(&a[name]).unwrap().to_rgb8();
        assert!(picture.pixels().any(|p| p.0[0] > p.0[2].saturating_add(20)), "{name} does not show the box");
    }
    let manifest = manifest(&room.path("a"));
    assert_eq!(manifest["complete"], true);
    let listed = manifest["files"].as_object().unwrap();
    assert_eq!(listed.len() + 1, a.len(), "all but the manifest itself");
    for (name, hash) in listed {
        let sum: String = Sha256::digest(&a[name]).iter().map(|b| format!("{b:02x}")).collect();
        assert_eq!(hash, &sum, "{name}");
    }
    let timings = manifest["timings"].as_array().unwrap();
    assert!(timings.contains(&"timings.csv".into()) && timings.len() == 9, "{timings:?}");
    let seconds = fs::read_to_string(room.path("a/timings.csv")).unwrap();
    assert_eq!(seconds.lines().count(), 9, "{seconds}");
    let page = String::from_utf8(a["index.html"].clone()).unwrap();
    assert_eq!(page.matches("data:image/png;base64,").count(), 3);
    assert!(!page.contains("src=\"http") && !page.contains("href="), "the page is self-contained");
    let modes = String::from_utf8(a["convergence.csv"].clone()).unwrap();
    assert!(modes.lines().any(|l| l.starts_with("low-key,paper,2,")), "{modes}");
}

#[test]
fn earlier_figures_are_replaced_only_by_force_and_files_of_others_stay() {
    let room = room();
    figures(&room, &["--only", "fig2"]);
    room.write("figures/notes.txt", "mine");
    let mut again = vec!["figures", "--only", "table1"];
    again.extend(TINY);
    let error = room.fail_at_once(&again);
    assert!(error.contains("figures: figures are here already") && error.contains("--force"), "{error}");
    again.push("--force");
    room.succeed(&again);
    assert_eq!(
        names(&room.path("figures")),
        ["index.html", "manifest.json", "notes.txt", "table1.csv", "table1.tex"]
    );
    room.write("full/notes.txt", "mine");
    let error = room.fail_at_once(&["figures", "--only", "table1", "--out", "full", "--force"]);
    assert!(error.contains("full: not empty and no directory of figures"), "{error}");
}

#[test]
fn a_missing_scene_is_named_with_what_makes_it() {
    let room = room();
    let error = room.fail_at_once(&["figures", "--scenes", "."]);
    assert!(error.contains("fetched/girl.obj") && error.contains("scenes/fetch.sh"), "{error}");
    assert!(error.contains("--only fig2,fig4"), "{error}");
    let error = room.fail_at_once(&["figures", "--only", "fig2", "--scenes", "nowhere"]);
    assert!(error.contains("nowhere/fruit_basket.obj") && error.contains("--scenes"), "{error}");
    assert!(!room.path("figures").exists());
}
