//! View transforms, exposure and ties as users meet them.

use std::fs;

use lightopt_embree::{
    film::exr::read_exr,
    math::{Measure, ViewTransform},
};
use predicates::str::contains;
use serde_json::Value;

use crate::room::{MTL, OBJ, QUICK, Room, TOML};

fn json(bytes: &[u8]) -> Value {
    serde_json::from_slice(bytes).unwrap()
}

fn stderr(room: &Room, arguments: &[&str]) -> String {
    String::from_utf8(room.succeed(arguments).stderr).unwrap()
}

/// Arguments of a quick run of the room, and others.
fn run<'a>(others: &[&'a str]) -> Vec<&'a str> {
    [&["run", "room.obj", "--force", "--json"], &QUICK[..], others].concat()
}

#[test]
fn a_png_is_what_the_view_shows_and_an_exr_names_it() {
    let room = Room::with(OBJ, MTL, &format!("view = \"filmic\"\nexposure = 3.0\n{TOML}"));
    let shows = |view: ViewTransform, options: &[&str]| {
        for output in ["a.png", "a.exr"] {
            room.succeed(&[&["render", "room.obj", "--spp", "4", "-o", output], options].concat());
        }
        let exr = read_exr(&room.path("a.exr")).unwrap();
        let rgb = exr.beauty().unwrap();
        let png = image::open(room.path("a.png")).unwrap().into_rgb8();
        for (pixel, &light) in png.pixels().zip(&rgb) {
            let wanted = view.encode(light, 3.0).map(|code| (255.0 * code).round() as u8);
            assert_eq!(pixel.0, wanted, "{view}");
        }
        assert_eq!(exr.lightopt.as_ref().unwrap()["view"], view.name());
        let measure = Measure { view, ..Measure::default() };
        let l = &exr.parts.iter().find(|part| part.name == "luminance").unwrap().channels[0].1;
        let wanted = measure.encode_image(&rgb, 3.0);
        assert!(l.iter().zip(wanted).all(|(&l, wanted)| l == wanted as f32));
    };
    shows(ViewTransform::Filmic, &[]);
    shows(ViewTransform::Agx, &["--view", "agx"]);
    shows(ViewTransform::Srgb, &["--view", "srgb"]);
    room.write("l.toml", "schema = 1\nview = \"pbr-neutral\"\n");
    shows(ViewTransform::PbrNeutral, &["--lights", "l.toml"]);
    let wrong = Room::with(OBJ, MTL, &format!("view = \"agxx\"\n{TOML}"));
    let error = wrong.fail_at_once(&["render", "room.obj"]);
    assert!(error.contains("room.toml:1:") && error.contains("agx"), "{error}");
}

#[test]
fn a_run_through_a_view_is_measured_through_it() {
    let room = Room::new();
    let told = json(&room.succeed(&run(&["--view", "agx", "--out", "r", "--cache", "bases"])).stdout);
    let evaluated = |options: &[&str]| {
        json(&room.succeed(&[&["evaluate", "r/final.exr", "--json"], options].concat()).stdout)
    };
    let again = evaluated(&[]);
    assert_eq!((&again["view"], &again["f_q"]), (&Value::from("agx"), &told["f_q_final"]));
    assert_eq!(
        (&again["f_q_error"], &again["f_q_picture"]),
        (&told["f_q_final_error"], &told["f_q_picture"])
    );
    // Through another view it is another look; the colour of the replicates serves all of them.
    let other = evaluated(&["--view", "srgb"]);
    assert!(other["view"] == "srgb" && other["f_q"] != again["f_q"] && other["f_q_error"].is_number());
    let manifest = fs::read_to_string(room.path("r/run.toml")).unwrap();
    assert!(manifest.contains("view = \"agx\""), "{manifest}");
    let lights = fs::read_to_string(room.path("r/lights.toml")).unwrap();
    assert!(lights.contains("view = \"agx\""), "{lights}");

    let basis = fs::read_dir(room.path("bases")).unwrap().next().unwrap().unwrap().path();
    let basis = basis.to_str().unwrap();
    room.succeed(&["relight", basis, "--lights", "r/lights.toml", "-o", "a.exr"]);
    let exr = read_exr(&room.path("a.exr")).unwrap();
    assert_eq!(exr.lightopt.unwrap()["view"], "agx");
    let scan = |basis: &str, options: &[&str]| {
        let arguments = ["scan", basis, "--variable", "key.radiance", "--steps", "3", "-o", "s.csv"];
        room.command(&[&arguments[..], options].concat()).assert().get_output().clone()
    };
    let tables: Vec<String> = [&[][..], &["--view", "agx"], &["--view", "srgb"]]
        .iter()
        .map(|options| {
            assert!(scan(basis, options).status.success());
            fs::read_to_string(room.path("s.csv")).unwrap()
        })
        .collect();
    assert!(tables[0] == tables[1] && tables[0] != tables[2]);
    // A basis that was made for srgb has no colour to look through another view.
    room.succeed(&run(&["--out", "plain", "--cache", "plain-bases"]));
    let plain = fs::read_dir(room.path("plain-bases")).unwrap().next().unwrap().unwrap().path();
    let refused = scan(plain.to_str().unwrap(), &["--view", "agx"]);
    let said = String::from_utf8(refused.stderr).unwrap();
    assert!(!refused.status.success() && said.contains("--view agx: the basis has the luminance"), "{said}");
}

#[test]
fn pictures_for_a_display_are_not_looked_at_through_a_view() {
    let room = Room::new();
    room.succeed(&["render", "room.obj", "--spp", "1", "-o", "a.png"]);
    let arguments = ["evaluate", "a.png", "--mask", "a.png", "--target", "low-key", "--view", "agx"];
    let error = room.fail_at_once(&arguments);
    assert!(error.contains("a.png: --view agx: the picture is already encoded"), "{error}");
}

/// A jar before a wall, with camera and light: glTF of Blender 5.0.1.
const OF_BLENDER: &[u8] = include_bytes!("../data/camera_light_room.glb");

#[test]
fn of_a_file_of_blender_the_view_that_is_taken_is_said() {
    let room = Room::new();
    room.write("jar.glb", OF_BLENDER);
    room.write("b.obj", format!("# Blender 4.2.0\n{OBJ}"));
    room.write("b.toml", TOML);
    let line = "made with Blender, seen through the view srgb";
    let count = |arguments: &[&str]| {
        let said = stderr(&room, &[&["render", "--spp", "1", "-o", "a.png"], arguments].concat());
        said.lines().filter(|said| said.contains(line)).count()
    };
    assert_eq!((count(&["jar.glb"]), count(&["b.obj"]), count(&["room.obj"])), (1, 1, 0));
    assert_eq!(count(&["jar.glb", "--view", "agx"]), 0);
    room.write("b.toml", format!("view = \"srgb\"\n{TOML}"));
    assert_eq!(count(&["b.obj"]), 0);
}

/// With the lights as they are, the exposure that is found is that of a dense scan, which `lights.toml` and the
/// pictures have.
#[test]
fn a_free_exposure_is_found_and_recorded() {
    let room = Room::with(OBJ, MTL, &format!("exposure = 0.5\n{TOML}"));
    let options = ["--free", "exposure", "--out", "r", "--cache", "bases", "--target", "low-key"];
    let told = json(&room.succeed(&run(&options)).stdout);
    let x = told["x"].as_object().unwrap();
    assert_eq!(x.keys().collect::<Vec<_>>(), ["camera.exposure"]);
    let found = x["camera.exposure"].as_f64().unwrap();
    assert!((0.5 / 64.0..=0.5 * 64.0).contains(&found), "{found}");
    let lights = fs::read_to_string(room.path("r/lights.toml")).unwrap();
    let stored = lights.lines().find_map(|line| line.strip_prefix("exposure = ")).unwrap();
    assert!((stored.parse::<f64>().unwrap() / found - 1.0).abs() < 1e-6, "{stored} {found}");
    let again = json(&room.succeed(&["evaluate", "r/final.exr", "--json"]).stdout);
    assert_eq!((&again["f_q"], again["exposure"].as_f64()), (&told["f_q_final"], Some(found)));
    let basis = fs::read_dir(room.path("bases")).unwrap().next().unwrap().unwrap().path();
    room.succeed(&[
        "scan",
        basis.to_str().unwrap(),
        "--variable",
        "camera.exposure",
        "--steps",
        "400",
        "--target",
        "low-key",
        "-o",
        "s.csv",
    ]);
    let text = fs::read_to_string(room.path("s.csv")).unwrap();
    let rows: Vec<[f64; 2]> = text
        .lines()
        .skip(1)
        .map(|line| {
            let mut numbers = line.split(',').map(|v| v.parse().unwrap());
            [numbers.next().unwrap(), numbers.next().unwrap()]
        })
        .collect();
    let least = rows.iter().map(|row| row[1]).fold(f64::INFINITY, f64::min);
    let there =
        rows.iter().min_by(|a, b| (a[0] / found).ln().abs().total_cmp(&(b[0] / found).ln().abs())).unwrap();
    assert!(there[1] < least + 0.01, "{there:?} {least}");
}

#[test]
fn a_camera_s_settings_take_the_place_of_the_exposure() {
    let with =
        |lines: &str| Room::with(OBJ, MTL, &TOML.replace("[main_object]", &format!("{lines}[main_object]")));
    // EV 100 of 10 at f/4, a 64th of a second and ISO 100: white is 1.2·2^10 cd/m².
    let room = with("iso = 100\nshutter = 0.015625\nf_number = 4.0\n");
    room.succeed(&["render", "room.obj", "--spp", "1", "-o", "a.exr"]);
    let exposure = read_exr(&room.path("a.exr")).unwrap().lightopt.unwrap()["exposure"].as_f64().unwrap();
    assert!((exposure / (683.0 / (1.2 * 1024.0)) - 1.0).abs() < 1e-6, "{exposure}");
    for (lines, wanted) in [
        ("iso = 100\n", "`camera.shutter`: is needed beside `camera.iso`"),
        ("iso = 0\nshutter = 1\nf_number = 2\n", "`camera.iso`: must be from 1e-6 to 1e9, got 0"),
    ] {
        let error = with(lines).fail_at_once(&["render", "room.obj"]);
        assert!(error.contains(wanted), "{error}");
    }
    let toml = TOML.replace("[main_object]", "iso = 100\nshutter = 1\nf_number = 2\n[main_object]");
    let both = Room::with(OBJ, MTL, &format!("exposure = 2.0\n{toml}"));
    let error = both.fail_at_once(&["render", "room.obj"]);
    assert!(error.contains("`camera.iso`: takes the place of `exposure`"), "{error}");
}

/// Radiances of key and fill in the `lights.toml` of a run.
fn found(room: &Room, directory: &str) -> [f64; 2] {
    let text = fs::read_to_string(room.path(directory).join("lights.toml")).unwrap();
    let radiances = text.lines().filter_map(|line| line.strip_prefix("radiance = "));
    let radiances: Vec<f64> = radiances.map(|v| v.parse().unwrap()).collect();
    radiances.try_into().unwrap()
}

#[test]
fn locked_lights_keep_their_bits_and_tied_ones_their_ratio() {
    let room = Room::new();
    let names = |told: &Value| told["x"].as_object().unwrap().keys().cloned().collect::<Vec<_>>();
    let look = |options: &[&str]| json(&room.succeed(&run(options)).stdout);
    let told = look(&["--lock", "key", "--out", "locked"]);
    assert_eq!(names(&told), ["background.value", "fill.radiance", "fill.size"]);
    assert_eq!(found(&room, "locked")[0], 8.0);
    let told = look(&["--tie", "fill=key*0.25", "--free", "radiance", "--out", "tied"]);
    assert_eq!(names(&told), ["key.radiance"]);
    let [key, fill] = found(&room, "tied");
    assert!((fill / key - 0.25).abs() < 1e-6 && key != 8.0, "{key} {fill}");
    assert!(fs::read_to_string(room.path("tied/run.toml")).unwrap().contains("follows = \"key\""));
    look(&["--group", "all=key,fill", "--free", "radiance", "--out", "grouped"]);
    let [key, fill] = found(&room, "grouped");
    assert!((fill / key - 5.0 / 8.0).abs() < 1e-6, "{key} {fill}");
    look(&["--solo", "key", "--out", "solo"]);
    assert_eq!(found(&room, "solo")[1], 0.0);

    // A ratio is that of what the lights bring to the main object.
    look(&["--ratio", "fill=key-2stops", "--out", "ratio"]);
    let exr = read_exr(&room.path("ratio/final.exr")).unwrap();
    let plane = |name: &str, channel: &str| {
        let part = exr.parts.iter().find(|part| part.name == name).unwrap();
        part.channels.iter().find(|(n, _)| n == channel).unwrap().1.clone()
    };
    let mask = plane("mask", "mask");
    let brought = |light: &str| {
        let [r, g, b] = ["R", "G", "B"].map(|channel| plane(light, channel));
        let y = |p: usize| 0.2126 * r[p] + 0.7152 * g[p] + 0.0722 * b[p];
        (0..mask.len()).filter(|&p| mask[p] > 0.5).map(y).sum::<f32>()
    };
    let ratio = brought("light.fill") / brought("light.key");
    // Of a survey of few samples, at a smaller size.
    assert!((ratio / 0.25 - 1.0).abs() < 0.2, "{ratio}");

    for (options, wanted) in [
        (
            ["--tie", "fill=kye", "--lock", "key"],
            "tie kye: the scene has no light `kye`; did you mean `key`?",
        ),
        (["--tie", "fill=key", "--lock", "fill"], "tie fill=key: `fill` is locked (lock fill)"),
        (["--tie", "fill=key", "--off", "key"], "tie fill=key: `key` is off"),
    ] {
        let error = room.fail(&run(&options));
        assert!(error.contains(wanted), "{error}");
    }
    let room = Room::with(OBJ, MTL, &format!("{TOML}[ties]\ntie = [\"fill=key/2\"]\n"));
    let error = room.fail(&run(&["--tie", "fill=key"]));
    assert!(error.contains("tie fill=key and tie fill=key/2"), "{error}");
}

#[cfg(not(feature = "ocio"))]
#[test]
fn views_of_opencolorio_need_the_feature() {
    let room = Room::new();
    room.write("studio.ocio", "ocio_profile_version: 2\n");
    let usage = room.command(&["render", "room.obj", "--view", "ocio:studio.ocio"]).assert().code(2);
    usage.stderr(contains("--view")).stderr(contains("cargo build --release --features ocio"));
    let named = Room::with(OBJ, MTL, &format!("view = \"ocio:studio.ocio\"\n{TOML}"));
    named.write("studio.ocio", "ocio_profile_version: 2\n");
    let error = named.fail_at_once(&["render", "room.obj"]);
    assert!(error.contains("room.toml: `view`: view `ocio:studio.ocio`: this program was built"), "{error}");
}

/// Pictures, records and measures of a run through a studio's view; its configuration stands beside the scene.
#[cfg(feature = "ocio")]
#[test]
fn a_view_of_opencolorio_is_shown_measured_and_recorded() {
    use std::path::Path;

    let studio = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/ocio");
    let room = Room::with(OBJ, MTL, &format!("view = \"ocio:colours/studio.ocio\"\n{TOML}"));
    fs::create_dir_all(room.path("colours/luts")).unwrap();
    for file in ["studio.ocio", "luts/film.spi1d", "luts/print.cube"] {
        fs::copy(studio.join(file), room.path(format!("colours/{file}"))).unwrap();
    }
    let name = format!("ocio:{}:sRGB:Film", room.path("colours/studio.ocio").display());

    let told = json(&room.succeed(&run(&["--out", "r", "--cache", "bases"])).stdout);
    let manifest: toml::Value =
        toml::from_str(&fs::read_to_string(room.path("r/run.toml")).unwrap()).unwrap();
    assert_eq!(manifest["options"]["view"].as_str(), Some(name.as_str()));
    let lights: toml::Value =
        toml::from_str(&fs::read_to_string(room.path("r/lights.toml")).unwrap()).unwrap();
    assert_eq!(lights["view"].as_str(), Some(name.as_str()));
    let evaluated = |options: &[&str]| {
        json(&room.succeed(&[&["evaluate", "r/final.exr", "--json"], options].concat()).stdout)
    };
    let again = evaluated(&[]);
    assert_eq!((&again["view"], &again["f_q"]), (&Value::from(name.as_str()), &told["f_q_final"]));
    let warm = evaluated(&["--view", "ocio:colours/studio.ocio:sRGB:Film: warm"]);
    assert!(warm["f_q"] != told["f_q_final"]);

    let view = ViewTransform::named(&name, Path::new("")).unwrap().unwrap();
    let rgb = read_exr(&room.path("r/final.exr")).unwrap().beauty().unwrap();
    room.succeed(&["render", "room.obj", "--lights", "r/lights.toml", "--spp", "4", "-o", "a.png"]);
    room.succeed(&["render", "room.obj", "--lights", "r/lights.toml", "--spp", "4", "-o", "a.exr"]);
    let png = image::open(room.path("a.png")).unwrap().into_rgb8();
    let light = read_exr(&room.path("a.exr")).unwrap().beauty().unwrap();
    for (pixel, &light) in png.pixels().zip(&light) {
        assert_eq!(pixel.0, view.encode(light, 1.0).map(|code| (255.0 * code).round() as u8));
    }
    assert_eq!(rgb.len(), light.len());

    // Another scene is confined to its folder, which a configuration may leave.
    let error = room.fail_at_once(&["render", "room.obj", "--confine"]);
    assert!(
        error.contains("room.toml: `view`: a configuration of OpenColorIO names further files"),
        "{error}"
    );
    let wrong = ["render", "room.obj", "--view", "ocio:colours/studio.ocio:sRGB:Flim"];
    room.command(&wrong)
        .assert()
        .code(2)
        .stderr(contains("`Flim` is no view of that display; it has Film, Plain"));
}
