//! Colours of lights as users meet them.

use std::fs;

use serde_json::Value;

use crate::room::{MTL, OBJ, QUICK, Room, TOML, names};

/// The room with a warm key and a cool fill.
fn colored() -> String {
    TOML.replace("radiance = 8.0", "radiance = 8.0\ncolor_temperature = 3200.0")
        .replace("radiance = 5.0", "radiance = 5.0\ncolor_temperature = 5600.0")
}

fn number(text: &str, name: &str, key: &str) -> f64 {
    let lights: toml::Value = toml::from_str(text).unwrap();
    let all = lights["lights"].as_array().unwrap();
    let light = all.iter().find(|light| light["name"].as_str() == Some(name)).unwrap();
    light[key].as_float().unwrap()
}

/// Lights that were made warm and cool and are set to white become so again, when the picture that they
/// made is the target with its colours.
#[test]
fn colours_come_back_from_a_picture_that_they_made() {
    let room = Room::with(OBJ, MTL, &colored());
    let size = ["--size", "24x18"];
    room.succeed(
        &[&["render", "room.obj", "-o", "a.exr", "--spp", "4096", "--seed", "9"][..], &size].concat(),
    );
    room.write("room.toml", TOML);
    let run = ["run", "room.obj", "--target", "a.exr", "--match", "colour", "--free", "color", "--json"];
    let options = ["--work-size", "24x18", "--size", "24x18", "--tolerance", "0.002", "--final-spp", "16"];
    let more = ["--out", "r", "--cache", "bases"];
    let told: Value =
        serde_json::from_slice(&room.succeed(&[&run[..], &options, &more].concat()).stdout).unwrap();
    for (name, kelvin) in [("key.color_temperature", 3200.0), ("fill.color_temperature", 5600.0)] {
        let found = told["x"][name].as_f64().unwrap();
        assert!((found - kelvin).abs() < 150.0, "{name}: {found}");
    }
    assert!(told["f_q"].as_f64().unwrap() < 0.005, "{told}");
    assert!(told["f_q_initial"].as_f64().unwrap() > 0.05, "{told}");
    let lights = fs::read_to_string(room.path("r/lights.toml")).unwrap();
    let kelvin = number(&lights, "key", "color_temperature");
    assert!((kelvin - told["x"]["key.color_temperature"].as_f64().unwrap()).abs() < 1e-3 * kelvin);

    // What is rendered, relit and scanned afterwards has these colours.
    let evaluated = |picture: &str| -> f64 {
        let arguments = ["evaluate", picture, "--target", "a.exr", "--match", "colour", "--json"];
        let told: Value = serde_json::from_slice(&room.succeed(&arguments).stdout).unwrap();
        told["f_q"].as_f64().unwrap()
    };
    let lights = ["--lights", "r/lights.toml", "-o", "b.exr"];
    room.succeed(&[&["render", "room.obj", "--spp", "1024"][..], &size, &lights].concat());
    assert!(evaluated("b.exr") < 0.02, "{}", evaluated("b.exr"));
    let basis = room.path("bases").join(&names(&room.path("bases"))[0]);
    let basis = basis.to_str().unwrap();
    room.succeed(&["relight", basis, "--lights", "r/lights.toml", "-o", "c.exr"]);
    assert!(evaluated("c.exr") < 0.03, "{}", evaluated("c.exr"));
    let scan = ["scan", basis, "--variable", "key.color_temperature", "--steps", "9", "--target", "a.exr"];
    let more = ["--match", "colour", "--lights", "r/lights.toml", "-o", "s.csv"];
    let said = String::from_utf8(room.succeed(&[&scan[..], &more].concat()).stdout).unwrap();
    let at = said.split("key.color_temperature = ").nth(1).unwrap();
    let least: f64 = at.split_whitespace().next().unwrap().parse().unwrap();
    assert!((2900.0..3600.0).contains(&least), "{said}");
}

#[test]
fn a_run_by_channels_is_recorded_as_rgb() {
    let room = Room::new();
    let arguments = ["run", "room.obj", "--free", "radiance,color_rgb", "--out", "r", "--json"];
    let told: Value =
        serde_json::from_slice(&room.succeed(&[&arguments[..], &QUICK].concat()).stdout).unwrap();
    assert!(told["x"]["key.red"].is_number() && told["x"]["fill.blue"].is_number(), "{told}");
    let lights = fs::read_to_string(room.path("r/lights.toml")).unwrap();
    let lights: toml::Value = toml::from_str(&lights).unwrap();
    let color = lights["lights"][0]["color"].as_array().unwrap();
    let [r, g, b] = [0, 1, 2].map(|c| color[c].as_float().unwrap());
    assert!((0.2126 * r + 0.7152 * g + 0.0722 * b - 1.0).abs() < 1e-5);
}

#[test]
fn wrong_colours_are_refused_with_what_is_allowed() {
    for (keys, wanted) in [
        ("color_temperature = 500", "`lights.key.color_temperature`: must be from 1000 to 15000 K, got 500"),
        ("color_temperature = 3200\ncolor = [1, 1, 1]", "give this or `color`, not both"),
        ("tint = 0.01", "`lights.key.tint`: needs `color_temperature`"),
        ("color_temperature = 3200\ntint = 0.2", "must be from -0.05 to 0.05, got 0.2"),
        ("color_temperature_range = [8000, 3000]", "must be 1000 <= min <= max <= 15000 K"),
    ] {
        let toml = TOML.replace("radiance = 8.0", &format!("radiance = 8.0\n{keys}"));
        let error = Room::with(OBJ, MTL, &toml).fail_at_once(&["render", "room.obj", "-o", "a.exr"]);
        assert!(error.contains("room.toml") && error.contains(wanted), "{error}");
    }
    let room = Room::new();
    let error = room.fail(&[&["run", "room.obj", "--free", "color,color_rgb"][..], &QUICK].concat());
    assert!(error.contains("`color` and `color_rgb` are free"), "{error}");
    room.succeed(&[&["run", "room.obj", "--out", "r", "--cache", "bases"][..], &QUICK].concat());
    room.write(
        "l.toml",
        "schema = 1\n[[lights]]\nname = \"key\"\nradiance = 8.0\ncolor_temperature = 3000.0\n",
    );
    let basis = room.path("bases").join(&names(&room.path("bases"))[0]);
    let error = room.fail(&["relight", basis.to_str().unwrap(), "--lights", "l.toml", "-o", "a.png"]);
    assert!(error.contains("`lights.key.color`: the basis has the light in a colour of its own"), "{error}");
}

/// The program's own colour of a temperature is that with which a light is exported.
#[test]
fn exports_have_the_colour_of_the_lighting() {
    let exported = |toml: &str, lights: Option<&str>| {
        let room = Room::with(OBJ, MTL, toml);
        let mut arguments = vec!["export", "room.obj", "--format", "mitsuba", "-o", "m"];
        if let Some(text) = lights {
            room.write("l.toml", text);
            arguments.extend(["--lights", "l.toml"]);
        }
        room.succeed(&arguments);
        fs::read_to_string(room.path("m/scene.xml")).unwrap()
    };
    let by_sidecar =
        exported(&TOML.replace("radiance = 8.0", "radiance = 8.0\ncolor_temperature = 3000.0"), None);
    let lights = "schema = 1\n[[lights]]\nname = \"key\"\nradiance = 8.0\ncolor_temperature = 3000.0\n";
    assert_eq!(by_sidecar, exported(TOML, Some(lights)));
    assert_ne!(by_sidecar, exported(TOML, None));
}
