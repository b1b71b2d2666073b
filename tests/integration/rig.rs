//! `run --lamps`: lamps that the program places.

use lightopt_embree::{
    audit::lights::LightsFile,
    import::{self, LoadOptions},
    light::Shape,
};
use predicates::str::contains;

use crate::room::{MTL, OBJ, QUICK, Room, TOML};

/// The sidecar of the room without its lights.
fn dark() -> String {
    TOML.split("[[lights]]").next().unwrap().to_owned()
}

fn run<'a>(options: &[&'a str]) -> Vec<&'a str> {
    [&["run", "room.obj", "--free", "radiance,size"], &QUICK[..], options].concat()
}

#[test]
fn a_scene_without_lights_is_lit_and_its_lamps_are_found_again() {
    let room = Room::with(OBJ, MTL, &dark());
    let output = room.succeed(&run(&["--lamps", "2", "--out", "lit", "--json"]));
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let lamps = report["lamps"].as_array().unwrap();
    assert!((1..=2).contains(&lamps.len()));
    // A black picture has an f_q above 1.
    assert!(report["f_q"].as_f64().unwrap() < 0.8, "{}", report["f_q"]);

    let path = room.path("lit/lights.toml");
    let file = LightsFile::load(&path).unwrap();
    assert!(file.without_lights && file.lights.len() == lamps.len());
    let loaded =
        import::load_with(&room.path("room.obj"), &file.load_options(LoadOptions::default())).unwrap();
    for (light, setting) in loaded.scene.lights.iter().zip(&file.lights) {
        let setup = setting.setup.as_ref().unwrap();
        let Shape::Planar(panel) = &light.shape else { panic!("{:?}", light.shape) };
        // What a photographer sets up, against the scene: the box's middle is at (0, 0.3, 0), the camera at +z.
        let d = panel.center - glam::Vec3::new(0.0, 0.3, 0.0);
        assert!((f64::from(d.length()) - setup.distance).abs() < 1e-3);
        assert!((f64::from(d.x.atan2(d.z).to_degrees()) - setup.azimuth).abs() < 0.06, "{setup:?} {d}");
        assert!((f64::from((d.y / d.length()).asin().to_degrees()) - setup.elevation).abs() < 0.06);
        assert!((f64::from(panel.center.y) - setup.height).abs() < 1e-3);
        let power = setting.radiance * f64::from(light.unit_power(setting.size.unwrap() as f32));
        assert!((power - setup.watts).abs() < 1e-3 + 1e-6 * power);
    }
    room.succeed(&["render", "room.obj", "--lights", "lit/lights.toml", "--spp", "4", "-o", "a.png"]);
    let picture = image::open(room.path("a.png")).unwrap().into_luma8();
    let mean = picture.as_raw().iter().map(|&v| f64::from(v)).sum::<f64>() / picture.len() as f64;
    assert!(mean > 40.0, "{mean}");
    let plan = std::fs::read_to_string(room.path("lit/plan.svg")).unwrap();
    assert!(lamps.iter().all(|lamp| plan.contains(lamp["name"].as_str().unwrap())), "{plan}");
    // Nobody asked: a scene without lights has no other way.
    room.command(&run(&["--out", "again"])).assert().code(0).stdout(contains("lm"));
}

#[test]
fn the_threads_do_not_matter_and_own_lights_are_kept_if_asked() {
    let room = Room::new();
    for (name, threads) in [("one", "1"), ("two", "2")] {
        room.succeed(&run(&["--lamps", "1", "--keep", "--threads", threads, "--out", name]));
    }
    for name in ["lights.toml", "evaluations.jsonl", "plan.svg", "final.png"] {
        let [one, two] = ["one", "two"].map(|run| std::fs::read(room.path(run).join(name)).unwrap());
        assert!(one == two, "{name}");
    }
    let file = LightsFile::load(&room.path("one/lights.toml")).unwrap();
    let names: Vec<&str> = file.lights.iter().map(|l| l.name.as_str()).collect();
    assert_eq!(names[..2], ["key", "fill"]);
    assert!(names.len() == 3 && !file.without_lights);
    assert!(file.lights[2].placed.is_some() && file.lights[0].placed.is_none());
}

#[test]
fn lamps_stay_where_the_sidecar_says() {
    let movement = "[movement]\nazimuth = [-90.0, -20.0]\nelevation = [25.0, 70.0]\ndistance = [0.9, 2.5]\n";
    let room = Room::with(OBJ, MTL, &format!("{}{movement}", dark()));
    room.succeed(&run(&["--lamps", "3", "--out", "lit"]));
    for light in LightsFile::load(&room.path("lit/lights.toml")).unwrap().lights {
        let setup = light.setup.unwrap();
        assert!((-90.0..=-20.0).contains(&setup.azimuth), "{setup:?}");
        assert!(
            (25.0..=70.0).contains(&setup.elevation) && (0.9..=2.5).contains(&setup.distance),
            "{setup:?}"
        );
    }
}

#[test]
fn what_is_wrong_with_the_region_is_said() {
    let wrong = [
        ("azimuth = [20.0, -20.0]", "`movement.azimuth`: must be -180 <= min <= max <= 180, got [20, -20]"),
        ("elevation = [0.0, 95.0]", "`movement.elevation`: must be -90 <= min <= max <= 90"),
        ("distance = [-1.0, 2.0]", "`movement.distance`: must be 0 <= min"),
        ("height = [nan, 2.0]", "`movement.height`: must be 0 <= min"),
        ("clearance = 0.0", "`movement.clearance`: must be > 0, got 0"),
        ("azimut = [0.0, 1.0]", "azimuth"),
        ("distance = [0.01, 0.02]", "there is no place for a lamp; allow more of them in [movement]"),
    ];
    for (line, message) in wrong {
        let room = Room::with(OBJ, MTL, &format!("{}[movement]\n{line}\n", dark()));
        let error = room.fail(&run(&["--lamps", "2"]));
        assert!(error.contains(message), "{line}: {error}");
    }
    let room = Room::new();
    room.command(&run(&["--keep"])).assert().code(2);
    room.command(&run(&["--lamps", "0"])).assert().code(2);
}
