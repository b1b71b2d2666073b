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
    let dark = ["--target", "low-key", "--work-size", "48x36", "--json", "--out"];
    let report = |room: &Room, options: &[&str]| -> serde_json::Value {
        let words = [
            &["run", "room.obj", "--free", "radiance,size", "--size", "48x36", "--final-spp", "4"],
            &dark[..],
            options,
        ];
        serde_json::from_slice(&room.succeed(&words.concat()).stdout).unwrap()
    };
    let found = report(&room, &["lit", "--lamps", "2"]);
    let lamps = found["lamps"].as_array().unwrap();
    assert!((1..=2).contains(&lamps.len()));
    // The author's two lamps, wherever he has put them.
    let authored = report(&Room::new(), &["own"]);
    let [ours, theirs] = [&found, &authored].map(|report| report["f_q"].as_f64().unwrap());
    let errors = [&found, &authored].map(|report| report["f_q_error"].as_f64().unwrap());
    assert!(ours + errors[0] + errors[1] < theirs, "{ours} {theirs}");

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
    // They are the lamps of the run: the picture has the f_q that was found, within twice the half width of its 95 %
    // interval, which is that of 99 % for four replicates.
    room.succeed(&[
        "render",
        "room.obj",
        "--lights",
        "lit/lights.toml",
        "--size",
        "48x36",
        "--spp",
        "256",
        "-o",
        "a.exr",
    ]);
    let words = ["evaluate", "a.exr", "--target", "low-key", "--json"];
    let measured: serde_json::Value = serde_json::from_slice(&room.succeed(&words).stdout).unwrap();
    let (again, error) = (measured["f_q"].as_f64().unwrap(), found["f_q_error"].as_f64().unwrap());
    assert!((again - ours).abs() < 2.0 * error, "{again} {ours} {error}");
    let plan = std::fs::read_to_string(room.path("lit/plan.svg")).unwrap();
    assert!(lamps.iter().all(|lamp| plan.contains(lamp["name"].as_str().unwrap())), "{plan}");
    assert!(plan.contains("from above") && plan.contains("\n1 m\n"), "{plan}");
    // Where a lamp more would help, before and after: before, the picture is black.
    let maps = ["where-start", "where-found"].map(|stem| {
        let files = [".png", ".csv", ".exr"].map(|ending| room.path(format!("lit/{stem}{ending}")));
        assert!(files.iter().all(|path| path.is_file()), "{files:?}");
        let mut reader = csv::Reader::from_path(&files[1]).unwrap();
        let f_q = |row: csv::StringRecord| row[5].parse::<f64>().unwrap();
        reader.records().map(|row| f_q(row.unwrap())).fold(f64::INFINITY, f64::min)
    });
    assert!(maps[1] < maps[0] - 0.01, "{maps:?}");
    assert!(image::open(room.path("lit/plan.png")).unwrap().width() > 800);
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
fn lights_are_moved_unless_they_must_stay() {
    let place = |toml: &str| {
        let room = Room::with(OBJ, MTL, toml);
        room.succeed(&run(&["--move-lights", "--out", "moved"]));
        let lights = LightsFile::load(&room.path("moved/lights.toml")).unwrap().lights;
        lights
            .into_iter()
            .map(|light| (light.name, light.placed.and_then(|placed| placed.position)))
            .collect::<Vec<_>>()
    };
    // The sphere cannot be moved, and the rectangle comes last.
    let moved = place(TOML);
    assert_eq!((moved[0].0.as_str(), moved[1].0.as_str()), ("fill", "key"));
    assert!(moved[0].1.is_none() && moved[1].1.is_some_and(|p| p != [0.5, 1.8, 0.8]), "{moved:?}");
    let stays =
        place(&TOML.replace("half_extents = [0.2, 0.15]", "half_extents = [0.2, 0.15]\nmovable = false"));
    assert!(stays.iter().all(|(_, placed)| placed.is_none()), "{stays:?}");
    let locked = Room::with(OBJ, MTL, TOML);
    locked.succeed(&run(&["--move-lights", "--lock", "key", "--out", "locked"]));
    let lights = LightsFile::load(&locked.path("locked/lights.toml")).unwrap().lights;
    assert!(lights.iter().all(|light| light.placed.is_none()), "{lights:?}");
    let error = locked.fail(&["run", "room.obj", "--move-lights", "--tie", "fill=key/2"]);
    assert!(error.contains("--move-lights: lights that follow others"), "{error}");
}

#[test]
fn lights_that_were_staged_make_way_for_better_ones() {
    let room = Room::with(OBJ, MTL, TOML);
    std::fs::remove_file(room.path("room.toml")).unwrap();
    let run = |options: &[&str]| {
        let words = ["run", "room.obj", "--target", "low-key", "--work-size", "48x36", "--size", "48x36"];
        let last = ["--final-spp", "4", "--json"];
        let output = room.succeed(&[&words[..], &last, options].concat());
        let found: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        let f_q = ["f_q", "f_q_error"].map(|key| found[key].as_f64().unwrap());
        (f_q, String::from_utf8(output.stderr).unwrap())
    };
    let ([anew, error], said) = run(&["--out", "anew"]);
    assert!(said.contains("with the lights that were staged: lamps placed anew"), "{said}");
    let file = LightsFile::load(&room.path("anew/lights.toml")).unwrap();
    assert!(file.without_lights && file.lights.iter().all(|light| light.placed.is_some()));
    assert!(room.path("anew/staging.toml").is_file() && room.path("anew/where-found.png").is_file());
    // Somebody speaks of a light.
    let ([kept, other], said) = run(&["--lock", "fill.size", "--out", "kept"]);
    assert!(!said.contains("lamps placed anew"), "{said}");
    let file = LightsFile::load(&room.path("kept/lights.toml")).unwrap();
    let names: Vec<&str> = file.lights.iter().map(|light| light.name.as_str()).collect();
    assert_eq!((names, file.without_lights), (vec!["key", "fill", "rim"], false));
    assert!(anew + error + other < kept, "{anew} {error} {kept} {other}");
    // The lights found are those of the picture, also for who renders them.
    let words = ["render", "room.obj", "--lights", "anew/lights.toml", "--size", "48x36", "--spp", "256"];
    room.succeed(&[&words[..], &["-o", "a.exr"]].concat());
    let words = ["evaluate", "a.exr", "--target", "low-key", "--json"];
    let measured: serde_json::Value = serde_json::from_slice(&room.succeed(&words).stdout).unwrap();
    assert!((measured["f_q"].as_f64().unwrap() - anew).abs() < 2.0 * error);
}

#[test]
fn lamps_are_searched_for_the_weights_in_the_place_of_the_mask() {
    // The floor of the front left corner is to be lit, and nothing else: the lamp that does so is not that which
    // lights the main object.
    let room = Room::with(OBJ, MTL, &dark());
    let weights = |x: u32, y: u32| image::Luma([if x < 16 && y >= 24 { 255 } else { 0 }]);
    image::GrayImage::from_fn(48, 36, weights).save(room.path("w.png")).unwrap();
    let words = ["--lamps", "1", "--target", "low-key", "--weights", "w.png"];
    room.succeed(&run(&[&words[..], &["--out", "corner"]].concat()));
    room.succeed(&run(&[&words[..4], &["--out", "object"]].concat()));
    let evaluate = |run: &str| -> f64 {
        let picture = format!("{run}/final.exr");
        let words = ["evaluate", &picture, "--target", "low-key", "--weights", "w.png", "--json"];
        let told: serde_json::Value = serde_json::from_slice(&room.succeed(&words).stdout).unwrap();
        told["f_q"].as_f64().unwrap()
    };
    let [corner, object] = ["corner", "object"].map(evaluate);
    assert!(corner < object - 0.05, "{corner} {object}");
}

#[test]
fn a_map_shows_where_a_lamp_would_help() {
    let room = Room::with(OBJ, MTL, &dark());
    let size = ["--work-size", "24x18", "--target", "low-key"];
    for name in ["map.png", "map.csv", "map.exr"] {
        let words = [&["where", "room.obj", "-o", name], &size[..]].concat();
        room.command(&words).assert().code(0).stdout(contains("with a lamp at azimuth"));
    }
    let table = std::fs::read_to_string(room.path("map.csv")).unwrap();
    let mut reader = csv::Reader::from_reader(table.as_bytes());
    let rows: Vec<Vec<f64>> = reader
        .records()
        .map(|row| row.unwrap().iter().map(|v| v.parse().unwrap_or(f64::NAN)).collect())
        .collect();
    assert!(rows.len() > 30);
    // In a black picture a lamp can help, and f_q with it is no worse than without.
    let least = rows.iter().map(|row| row[5]).fold(f64::INFINITY, f64::min);
    let most = rows.iter().map(|row| row[5]).fold(0.0, f64::max);
    assert!(least < most - 0.05 && least > 0.0, "{least} {most}");
    assert_eq!(image::open(room.path("map.png")).unwrap().width(), 920);
    let error = room.fail(&["where", "room.obj", "-o", "map.txt"]);
    assert!(error.contains("must end in .png, .csv or .exr"), "{error}");
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

#[test]
fn lights_that_are_off_stay_dark_beside_placed_lamps() {
    let room = Room::with(OBJ, MTL, TOML);
    room.succeed(&run(&["--lamps", "1", "--keep", "--off", "fill", "--lock", "key", "--out", "off"]));
    let lights = LightsFile::load(&room.path("off/lights.toml")).unwrap().lights;
    let radiance = |name: &str| lights.iter().find(|light| light.name == name).unwrap().radiance;
    assert_eq!(radiance("fill"), 0.0);
    let authored = import::load(&room.path("room.obj")).unwrap().scene.lights;
    let key = authored.iter().find(|light| light.name == "key").unwrap().radiance;
    assert_eq!(radiance("key"), f64::from(key));
}

/// A picture of surroundings of 64 x 32 texels: dim, with a bright patch around a column and above the horizon.
fn write_surroundings(room: &Room, name: &str, column: u32, patch: [f32; 3]) {
    let picture = image::Rgb32FImage::from_fn(64, 32, |x, y| {
        let is_patch = x.abs_diff(column) < 3 && (8..13).contains(&y);
        image::Rgb(if is_patch { patch } else { [0.05; 3] })
    });
    picture.save(room.path(name)).unwrap();
}

/// A picture of the scene under known surroundings is the target: they are found, with their turn and radiance.
#[test]
fn surroundings_are_found_with_their_turn() {
    const TURN: f64 = 104.0;
    // From aside, so that no mirrored surroundings give the same values.
    let camera = TOML[..TOML.find("[[lights]]").unwrap()].replace("[0.0, 1.0, 3.0]", "[0.9, 1.0, 2.9]");
    let sky = format!(
        "{camera}[[lights]]\nname = \"sky\"\ntype = \"environment\"\nimage = \"skies/b.exr\"\nrotation = {TURN}\nradiance = 1.5\n"
    );
    let room = Room::with(OBJ, MTL, &sky);
    std::fs::create_dir(room.path("skies")).unwrap();
    write_surroundings(&room, "skies/a.exr", 20, [4.0, 4.0, 4.0]);
    write_surroundings(&room, "skies/b.exr", 32, [30.0, 25.0, 20.0]);
    write_surroundings(&room, "skies/c.hdr", 32, [0.05, 0.05, 0.05]);
    room.write("skies/broken.hdr", "#?RADIANCE\n");
    room.write("skies/notes.txt", "no picture");
    room.succeed(&["render", "room.obj", "--spp", "512", "--size", "48x36", "-o", "wanted.exr"]);
    let run = ["run", "room.obj", "--environments", "skies", "--target", "wanted.exr", "--free", "radiance"];
    let sizes = ["--work-size", "48x36", "--size", "48x36", "--final-spp", "16", "--out", "found", "--json"];
    let out = room.succeed(&[&run[..], &sizes].concat());
    let said = String::from_utf8(out.stderr.clone()).unwrap();
    assert!(said.contains("left out: ") && said.contains("broken.hdr") && !said.contains("notes"), "{said}");
    let json: serde_json::Value = serde_json::from_slice(&out.stdout).unwrap();
    let (f_q, error) = (json["f_q"].as_f64().unwrap(), json["f_q_error"].as_f64().unwrap());
    let file = LightsFile::load(&room.path("found/lights.toml")).unwrap();
    // The scene's own surroundings are gone: there is one light, under a name of its own.
    assert_eq!(file.lights.len(), 1);
    let placed = file.lights[0].placed.as_ref().unwrap();
    assert!(placed.image.as_ref().unwrap().ends_with("skies/b.exr"), "{placed:?}");
    let turn = placed.rotation.unwrap();
    println!("turned {turn}, radiance {}, f_q {f_q} ± {error}", file.lights[0].radiance);
    // Within the last two steps.
    assert!((turn - TURN).abs() < 6.0, "{turn}");
    assert!((file.lights[0].radiance / 1.5 - 1.0).abs() < 0.1, "{}", file.lights[0].radiance);
    // Half a step too far costs .05, and nothing but a known picture comes close to 0.
    assert!(f_q - error < 0.05, "{f_q} ± {error}");
    // The table is that of the renders, and the lights file alone makes the picture again.
    let table = std::fs::read_to_string(room.path("found/environments.csv")).unwrap();
    assert!(table.lines().nth(1).unwrap().starts_with("1,b.exr,"), "{table}");
    room.succeed(&["render", "room.obj", "--lights", "found/lights.toml", "--spp", "4", "-o", "again.exr"]);

    std::fs::create_dir(room.path("nothing")).unwrap();
    let error = room.fail(&["run", "room.obj", "--environments", "nothing", "--out", "x"]);
    assert!(error.contains("--environments: nothing: no HDR or EXR picture"), "{error}");
}
