//! `export` to Blender, USD, pbrt and glTF: the numbers that are written, against closed forms.

use std::{collections::BTreeMap, f64::consts::PI, fs, path::Path};

use predicates::prelude::*;
use predicates::str::contains;
use serde_json::Value;

use crate::room::{MTL, OBJ, Room, TOML};

/// A light of each kind; the disk has a colour and a size, the lamp hangs at (1, 2, 3) and looks down -x.
const LIGHTS: &str = r#"
[[lights]]
name = "panel"
type = "rectangle"
position = [1.0, 2.0, 3.0]
look_at = [0.0, 2.0, 3.0]
half_extents = [0.5, 0.2]
size = 1.5
radiance = 3.0
[[lights]]
name = "disk"
type = "disk"
position = [1.0, 2.0, 3.0]
look_at = [1.0, 0.0, 3.0]
radius = 0.3
size = 2.0
radiance = 4.0
color = [1.0, 0.5, 0.25]
[[lights]]
name = "ball"
type = "sphere"
position = [1.0, 2.0, 3.0]
radius = 0.2
radiance = 9.0
[[lights]]
name = "bulb"
type = "point"
position = [1.0, 2.0, 3.0]
radiance = 2.0
[[lights]]
name = "beam"
type = "spot"
position = [1.0, 2.0, 3.0]
look_at = [1.0, 0.0, 3.0]
radius = 0.0
angle = 60.0
softness = 0.5
radiance = 8.0
[[lights]]
name = "sun"
type = "distant"
look_at = [0.0, -1.0, 0.0]
radiance = 5.0
[[lights]]
name = "sky"
type = "environment"
radiance = 0.7
"#;

fn room() -> Room {
    let top = TOML.split("[[lights]]").next().unwrap().replace("schema = 1", "schema = 1\nview = \"agx\"");
    let room = Room::with(OBJ, MTL, &format!("{top}{LIGHTS}"));
    fs::write(
        room.directory.path().join("found.toml"),
        "schema = 1\nexposure = 4.0\n[background]\nvalue = 0.5\n",
    )
    .unwrap();
    room
}

/// Exports the room and returns the text of a file.
fn exported(room: &Room, format: &str, more: &[&str], out: &str, read: &str) -> String {
    let mut command = room.command(&[]);
    command.args(["export", "--format", format, "--lights", "found.toml", "-o", out]).args(more);
    command.arg("room.obj").assert().success();
    fs::read_to_string(room.directory.path().join(read)).unwrap()
}

#[track_caller]
fn near(a: &Value, b: f64) {
    let a = a.as_f64().unwrap();
    assert!((a - b).abs() <= 1e-6 * b.abs().max(1e-3), "{a} is not {b}");
}

/// The largest channel of the disk's colour once its luminance is 1.
fn most() -> f64 {
    1.0 / (0.2126 + 0.7152 * 0.5 + 0.0722 * 0.25)
}

#[test]
fn lamps_of_blender_have_the_power_of_ours() {
    let script = exported(&room(), "blender", &[], "lights.py", "lights.py");
    let json = script.split("DATA = r'''").nth(1).unwrap().split("'''").next().unwrap();
    let data: Value = serde_json::from_str(json).unwrap();
    let lamp = |name: &str| {
        data["lamps"].as_array().unwrap().iter().find(|l| l["name"] == name).expect("it is there").clone()
    };
    let set = |name: &str, key: &str| lamp(name)["settings"][key].clone();
    near(&set("panel", "energy"), 4.0 * PI * 0.5 * 0.2 * 1.5 * 1.5 * 3.0);
    near(&set("panel", "size"), 1.5);
    near(&set("panel", "size_y"), 0.6);
    let disk = set("disk", "energy").as_f64().unwrap();
    assert!((disk / (PI * PI * 0.36 * 4.0 * most()) - 1.0).abs() < 1e-4, "{disk}");
    assert_eq!(set("disk", "color"), serde_json::json!([1.0, 0.5, 0.25]));
    near(&set("disk", "size"), 1.2);
    near(&set("ball", "energy"), 4.0 * PI * PI * 0.04 * 9.0);
    near(&set("ball", "shadow_soft_size"), 0.2);
    assert_eq!(set("ball", "use_soft_falloff"), false);
    near(&set("bulb", "energy"), 4.0 * PI * 2.0);
    near(&set("beam", "energy"), 4.0 * PI * 8.0);
    near(&set("beam", "spot_size"), 2.0 * PI / 3.0);
    near(&set("beam", "spot_blend"), ((PI / 6.0).cos() - 0.5) / 0.5);
    near(&set("sun", "energy"), 5.0);
    near(&data["world"]["strength"], 0.7);
    near(&data["exposure"], 2.0);
    near(&data["value"], 0.5);
    assert_eq!((&data["view"], &data["scene"]), (&"AgX".into(), &Value::Null));
    assert_eq!(data["background"], serde_json::json!(["floor", "wall"]));
    // (x, y, z) is (x, -z, y) there; a lamp shines along its -z.
    let matrix = &lamp("panel")["matrix"];
    for (row, at) in [1.0, -3.0, 2.0].into_iter().enumerate() {
        near(&matrix[row][3], at);
    }
    for (row, z) in [1.0, 0.0, 0.0].into_iter().enumerate() {
        assert!((matrix[row][2].as_f64().unwrap() - z).abs() < 1e-6);
    }
}

/// Attributes of the prims of a layer by the name of the prim.
fn prims(layer: &str) -> BTreeMap<String, BTreeMap<String, String>> {
    let mut prims: BTreeMap<String, BTreeMap<String, String>> = BTreeMap::new();
    let mut name = String::new();
    for line in layer.lines().map(str::trim) {
        if let Some(rest) = line.strip_prefix("def ") {
            let mut words = rest.split_whitespace();
            let kind = words.next().unwrap().to_owned();
            name = words.next().unwrap().trim_matches('"').to_owned();
            prims.entry(name.clone()).or_default().insert("kind".to_owned(), kind);
        } else if let Some((key, value)) = line.split_once(" = ") {
            let key = key.rsplit(' ').next().unwrap();
            prims.entry(name.clone()).or_default().insert(key.to_owned(), value.to_owned());
        }
    }
    prims
}

#[test]
fn lights_of_usd_have_our_radiance_and_are_not_normalised() {
    let room = room();
    for (more, unit) in [(&[][..], 1.0), (&["--photometric"][..], 683.0)] {
        let layer = exported(&room, "usd", more, "lights.usda", "lights.usda");
        assert!(layer.starts_with("#usda 1.0\n") && layer.contains("metersPerUnit = 1"), "{layer}");
        let prims = prims(&layer);
        let number = |name: &str, key: &str| prims[name][&format!("inputs:{key}")].parse::<f64>().unwrap();
        for (name, kind, intensity, normalize) in [
            ("panel", "RectLight", 3.0, 0.0),
            ("disk", "DiskLight", 4.0, 0.0),
            ("ball", "SphereLight", 9.0, 0.0),
            ("bulb", "SphereLight", 2.0 / (PI * 1e-6), 0.0),
            ("beam", "SphereLight", 8.0 / (PI * 1e-6), 0.0),
            ("sun", "DistantLight", 5.0, 1.0),
            ("sky", "DomeLight", 0.7, 0.0),
        ] {
            assert_eq!(prims[name]["kind"], kind);
            assert!((number(name, "intensity") / (unit * intensity) - 1.0).abs() < 1e-6, "{name}");
            assert_eq!(number(name, "normalize"), normalize, "{name}");
            assert_eq!(number(name, "enableColorTemperature"), 0.0, "{name}");
        }
        assert_eq!((number("panel", "width"), number("panel", "height")), (1.5, 0.6));
        assert_eq!((number("disk", "radius"), number("sun", "angle")), (0.6, 0.0));
        assert!((number("beam", "shaping:cone:angle") - 60.0).abs() < 1e-4);
        assert!((number("beam", "shaping:cone:softness") - 0.5).abs() < 1e-4);
        assert!(prims["panel"]["xformOp:transform"].ends_with("(1, 2, 3, 1) )"));
        assert!(!layer.contains("def Mesh"));
    }
    let layer = exported(&room, "usd", &["--whole"], "whole.usda", "whole.usda");
    let prims = prims(&layer);
    assert_eq!(prims.values().filter(|p| p.get("kind").is_some_and(|k| k == "Mesh")).count(), 3);
    // The background's value is in the colours: half of 0.5.
    assert!(layer.contains("inputs:diffuseColor = (0.25, 0.25, 0.25)"), "{layer}");
}

/// A directive of pbrt with its words and its parameters, by type and name.
#[derive(Debug, Default)]
struct Directive {
    name: String,
    words: Vec<String>,
    parameters: BTreeMap<String, Vec<String>>,
}

/// Reads pbrt's syntax: directives, quoted words, and parameters with a list in brackets.
fn directives(text: &str) -> Vec<Directive> {
    let plain: String = text.lines().map(|l| l.split('#').next().unwrap().to_owned() + "\n").collect();
    let spaced = plain.replace('[', " [ ").replace(']', " ] ");
    let mut tokens = Vec::new();
    for (i, piece) in spaced.split('"').enumerate() {
        if i % 2 == 1 {
            tokens.push(format!("\"{piece}"));
        } else {
            tokens.extend(piece.split_whitespace().map(str::to_owned));
        }
    }
    let mut all: Vec<Directive> = Vec::new();
    let mut i = 0;
    while i < tokens.len() {
        let token = &tokens[i];
        if token.starts_with(|c: char| c.is_ascii_uppercase()) {
            all.push(Directive { name: token.clone(), ..Directive::default() });
        } else if tokens.get(i + 1).is_some_and(|t| t == "[") && token.starts_with('"') {
            let end = i + tokens[i..].iter().position(|t| t == "]").expect("a list ends");
            let values = tokens[i + 2..end].iter().map(|t| t.trim_start_matches('"').to_owned()).collect();
            let key = token.trim_start_matches('"').to_owned();
            assert_eq!(key.split(' ').count(), 2, "{key} is a type and a name");
            all.last_mut().unwrap().parameters.insert(key, values);
            i = end;
        } else if token != "[" && token != "]" {
            all.last_mut().unwrap().words.push(token.trim_start_matches('"').to_owned());
        }
        i += 1;
    }
    all
}

#[test]
fn lights_of_pbrt_are_given_by_radiance_and_never_by_power() {
    let room = room();
    let lights = exported(&room, "pbrt", &["--size", "40x20"], "pbrt", "pbrt/lights.pbrt");
    assert!(!lights.contains("power"));
    let all = directives(&lights);
    let begun = all.iter().filter(|d| d.name == "AttributeBegin").count();
    assert_eq!((begun, all.iter().filter(|d| d.name == "AttributeEnd").count()), (7, 7));
    let find = |name: &str, word: &str| all.iter().find(|d| d.name == name && d.words == [word]).unwrap();
    let numbers = |d: &Directive, key: &str| -> Vec<f64> {
        d.parameters[key].iter().map(|v| v.parse().unwrap()).collect()
    };
    let emitted: Vec<_> =
        all.iter().filter(|d| d.name == "AreaLightSource").map(|d| numbers(d, "rgb L")[0]).collect();
    assert_eq!((emitted[0], emitted[2]), (3.0, 9.0));
    assert!((emitted[1] / (4.0 * most()) - 1.0).abs() < 1e-4);
    // Of the rectangle's corners, the normal of dp/du and dp/dv looks where it shines.
    let corners = numbers(find("Shape", "bilinearmesh"), "point3 P");
    let p = |i: usize| glam::DVec3::from_slice(&corners[3 * i..]);
    let normal = (p(1) - p(0)).cross(p(2) - p(0));
    assert!((normal - glam::DVec3::new(-1.5 * 0.6, 0.0, 0.0)).length() < 1e-5, "{normal}");
    assert_eq!(numbers(find("Shape", "bilinearmesh"), "float alpha"), [0.0]);
    assert_eq!(numbers(find("Shape", "sphere"), "float radius"), [0.2]);
    assert_eq!(numbers(find("LightSource", "point"), "rgb I"), [2.0; 3]);
    let spot = find("LightSource", "spot");
    assert!((numbers(spot, "float coneangle")[0] - 60.0).abs() < 1e-4);
    assert!((numbers(spot, "float conedeltaangle")[0] - 30.0).abs() < 1e-4);
    assert_eq!(numbers(find("LightSource", "distant"), "point3 from"), [0.0, 1.0, 0.0]);
    assert_eq!(numbers(find("LightSource", "infinite"), "rgb L"), [0.7; 3]);

    let scene = fs::read_to_string(room.directory.path().join("pbrt/scene.pbrt")).unwrap();
    let all = directives(&scene);
    let names: Vec<_> = all.iter().map(|d| d.name.as_str()).collect();
    assert_eq!(names[..3], ["Scale", "LookAt", "Camera"]);
    // Of a picture twice as wide as high the shorter side has the vertical field of view.
    let camera = all.iter().find(|d| d.name == "Camera").unwrap();
    assert!((numbers(camera, "float fov")[0] - 45.0).abs() < 1e-4);
    assert_eq!(numbers(camera, "float screenwindow"), [-2.0, 2.0, -1.0, 1.0]);
    let meshes: Vec<_> = all.iter().filter_map(|d| d.parameters.get("string filename")).flatten().collect();
    let there = |name: &&&String| room.directory.path().join("pbrt").join(name).is_file();
    assert_eq!(meshes.iter().filter(there).count(), 3, "{meshes:?}");
}

#[test]
fn a_picture_of_the_surroundings_keeps_its_light_in_pbrt_and_its_place() {
    // White to the east (+x), black elsewhere.
    let room = room();
    let path = |name: &str| room.directory.path().join(name);
    let picture: Vec<u8> =
        (0..64 * 32).flat_map(|i| if (12..20).contains(&(i % 64)) { [255; 3] } else { [0; 3] }).collect();
    image::RgbImage::from_raw(64, 32, picture).unwrap().save(path("sky.png")).unwrap();
    let toml = fs::read_to_string(path("room.toml")).unwrap();
    fs::write(
        path("room.toml"),
        toml.replace("type = \"environment\"", "type = \"environment\"\nimage = \"sky.png\""),
    )
    .unwrap();
    exported(&room, "pbrt", &[], "pbrt", "pbrt/scene.pbrt");
    let square = lightopt_embree::film::image_file::read_image(&path("pbrt/light_sky.exr")).unwrap();
    assert_eq!(square.width, square.height);
    // Texels have equal solid angles: their mean is that of the band over the sphere, an eighth, times 0.7.
    let mean = square.rgb.iter().map(|t| f64::from(t[0])).sum::<f64>() / square.rgb.len() as f64;
    assert!((mean / (0.7 / 8.0) - 1.0).abs() < 0.02, "{mean}");
    // The middle of the square is +z, and that of its right side +x.
    let at = |x: usize, y: usize| square.rgb[y * square.width + x][0];
    let (last, middle) = (square.width - 1, square.width / 2);
    assert!((at(last, middle) - 0.7).abs() < 1e-3 && at(0, middle) == 0.0 && at(middle, middle) == 0.0);
}

#[test]
fn lights_of_gltf_are_in_candela_and_lux_and_say_what_they_were() {
    let room = room();
    let mut command = room.command(&[]);
    command.args([
        "export",
        "--format",
        "gltf",
        "--whole",
        "--lights",
        "found.toml",
        "-o",
        "s.gltf",
        "room.obj",
    ]);
    command.assert().success().stderr(contains("light `panel`: a spot in glTF").and(contains("light `sky`")));
    let root: Value =
        serde_json::from_slice(&fs::read(room.directory.path().join("s.gltf")).unwrap()).unwrap();
    let lights = root["extensions"]["KHR_lights_punctual"]["lights"].as_array().unwrap();
    let light = |name: &str| lights.iter().find(|l| l["name"] == name).unwrap();
    let lumens = 683.0;
    near(&light("panel")["intensity"], lumens * 4.0 * 0.5 * 0.2 * 2.25 * 3.0);
    near(&light("ball")["intensity"], lumens * PI * 0.04 * 9.0);
    near(&light("bulb")["intensity"], lumens * 2.0);
    near(&light("beam")["intensity"], lumens * 8.0);
    near(&light("beam")["spot"]["innerConeAngle"], PI / 6.0);
    near(&light("beam")["spot"]["outerConeAngle"], PI / 3.0);
    near(&light("sun")["intensity"], lumens * 5.0);
    assert_eq!(light("panel")["extras"]["lightopt"]["half_extents"], serde_json::json!([0.5, 0.2]));
    assert_eq!(root["scenes"][0]["extras"]["lightopt"]["lights"][0]["name"], "sky");
    // The program itself reads it: punctual lights, camera, triangles.
    let scene = lightopt_embree::import::load(&room.directory.path().join("s.gltf")).unwrap().scene;
    assert_eq!((scene.lights.len(), scene.mesh.indices.len()), (6, 14));
    assert!((scene.lights.iter().find(|l| l.name == "bulb").unwrap().radiance - 2.0).abs() < 1e-5);
    assert!((scene.camera.vfov() - 45.0).abs() < 1e-3);
}

#[test]
fn an_option_of_another_format_is_refused_and_an_ending_asked_for() {
    let room = room();
    for (format, out, option, words) in [
        ("pbrt", "p", "--path", "--path: only for --format mitsuba"),
        ("gltf", "g.gltf", "--photometric", "--photometric: only for --format usd"),
        ("mitsuba", "m", "--whole", "--whole: only for --format blender, usd, gltf"),
    ] {
        let mut command = room.command(&[]);
        command.args(["export", "--format", format, "-o", out, option, "room.obj"]);
        command.assert().code(1).stderr(contains(words));
    }
    let mut command = room.command(&[]);
    command.args(["export", "--format", "usd", "-o", "lights.usd", "room.obj"]);
    command.assert().code(1).stderr(contains("ends in .usda"));
}

#[test]
fn mitsuba_says_which_lights_stop_rays() {
    let room = room();
    let xml = |more: &[&str], toml: &str| {
        fs::write(room.directory.path().join("room.toml"), toml).unwrap();
        exported(&room, "mitsuba", more, "m", "m/scene.xml")
    };
    let toml = fs::read_to_string(room.directory.path().join("room.toml")).unwrap();
    assert!(xml(&[], &toml).contains("<!-- Lights do not block: volpath"));
    let solid = toml.replace("radius = 0.2\n", "radius = 0.2\noccludes = true\n");
    assert!(xml(&[], &solid).contains("<!-- Black bodies that stop rays: ball. Other lights do not block"));
    let path = xml(&["--path"], &toml);
    assert!(path.contains("<integrator type=\"path\">") && !path.contains("null"), "{path}");
    assert!(path.contains("All lamps with a surface are black bodies"));
    assert_eq!(path.matches("<rgb name=\"reflectance\" value=\"0\"/>").count(), 3);
}

#[test]
fn the_directory_of_a_run_is_exported_with_its_lights() {
    let room = room();
    fs::create_dir_all(room.directory.path().join("runs/r")).unwrap();
    let write = |name: &str, text: &str| fs::write(room.directory.path().join(name), text).unwrap();
    write(
        "runs/r/run.toml",
        "schema = 1\n[scene]\npath = \"room.obj\"\ncontent = \"0\"\n[options]\nview = \"filmic\"\n\
         size = [16, 12]\nfinal_spp = 4\nintegrator = \"bdpt\"\n",
    );
    write("runs/r/lights.toml", "schema = 1\n[[lights]]\nname = \"bulb\"\nradiance = 7.0\n");
    for from in [room.directory.path(), Path::new("/")] {
        let mut command = room.command(&[]);
        command.current_dir(from).args(["export", "--format", "blender", "-o"]);
        command.args([room.directory.path().join("r.py"), room.directory.path().join("runs/r")]);
        command.assert().success().stderr(contains("has changed since the run"));
        let script = fs::read_to_string(room.directory.path().join("r.py")).unwrap();
        assert!(script.contains("\"view\": \"Filmic\""));
        let energy = format!("\"energy\": {}", 4.0 * PI * 7.0);
        assert!(script.contains(&energy), "{energy}");
    }
    fs::create_dir(room.directory.path().join("empty")).unwrap();
    let mut command = room.command(&[]);
    command.args(["export", "--format", "blender", "-o", "r.py", "empty"]);
    command.assert().code(1).stderr(contains("run.toml"));
}
