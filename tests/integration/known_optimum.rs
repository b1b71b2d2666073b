//! Looks that some lighting is known to have: the search must come back to them.

use lightopt_embree::film::exr::read_exr;
use serde_json::Value;

use crate::room::Room;

/// The lighting sought, far from where any search begins.
const STAR: &str = "schema = 1\n[background]\nvalue = 0.5\n[[lights]]\nname = \"key\"\nradiance = 30.0\nsize = 1.6\n\
                    [[lights]]\nname = \"fill\"\nradiance = 2.0\nsize = 0.5\n";

fn json(room: &Room, arguments: &[&str]) -> Value {
    serde_json::from_slice(&room.succeed(&[arguments, &["--json"]].concat()).stdout).unwrap()
}

/// The picture of the lighting sought, as an EXR that holds its mask.
fn room_with_star() -> Room {
    let room = Room::new();
    room.write("star.toml", STAR);
    let render = ["render", "--lights", "star.toml", "--size", "48x36", "--spp", "512", "--seed", "77"];
    room.succeed(&[&render[..], &["-o", "star.exr", "room.obj"]].concat());
    assert!(read_exr(&room.path("star.exr")).unwrap().part("mask").is_some());
    room
}

const RUN: [&str; 9] =
    ["run", "room.obj", "--target", "star.exr", "--work-size", "48x36", "--size", "24x18", "--force"];

/// Error of f_q up to which lights are sought, the default of `--tolerance`.
const TOLERANCE: f64 = 0.005;

#[test]
fn a_picture_of_the_scene_itself_is_found_again() {
    let room = room_with_star();
    for seed in ["0", "1"] {
        let found = json(&room, &[&RUN[..], &["--final-spp", "4", "--seed", seed]].concat());
        let (f_q, error) = (found["f_q"].as_f64().unwrap(), found["f_q_error"].as_f64().unwrap());
        println!("seed {seed}: {f_q} ± {error}, start {}", found["f_q_initial"]);
        // The least f_q is 0, but for the noise of the target's 512 samples.
        assert!(f_q - error < TOLERANCE, "{f_q} ± {error}");
        assert!(found["f_q_initial"].as_f64().unwrap() > 20.0 * f_q);
    }
    let out = room.succeed(&[&RUN[..], &["--final-spp", "4", "--global"]].concat());
    let stderr = String::from_utf8(out.stderr).unwrap();
    let line = stderr.lines().find(|l| l.contains("evaluations over the whole box")).expect("says so");
    let f_q: f64 = line.split("f_q ").nth(1).unwrap().split(' ').next().unwrap().parse().unwrap();
    assert!(f_q < 4.0 * TOLERANCE, "the search over the whole box, on few samples: {line}");
}
