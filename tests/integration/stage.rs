//! Scenes without sidecar, and `lightopt-embree stage`.

use lightopt_embree::{
    film::exr::read_exr,
    import::{self, builder, stage::StageOptions},
};

use crate::room::{MTL, OBJ, QUICK, Room, TOML, names};

/// A step of two boxes without floor, 60 units high.
const STEP: &str = "v 0 0 0\nv 40 0 0\nv 40 0 20\nv 0 0 20\nv 0 30 0\nv 40 30 0\nv 40 30 20\nv 0 30 20
v 0 60 0\nv 20 60 0\nv 20 60 20\nv 0 60 20\nv 20 30 0\nv 20 30 20
o base\nf 1 2 3 4\nf 1 5 6 2\nf 2 6 7 3\nf 3 7 8 4\nf 4 8 5 1\nf 13 6 7 14
o top\nf 5 9 10 13\nf 13 10 11 14\nf 14 11 12 8\nf 8 12 9 5\nf 9 12 11 10\n";

fn bare(obj: &str) -> Room {
    let room = Room::with(obj, MTL, TOML);
    std::fs::remove_file(room.path("room.toml")).unwrap();
    room
}

fn stderr(room: &Room, arguments: &[&str]) -> String {
    String::from_utf8(room.succeed(arguments).stderr).unwrap()
}

#[test]
fn a_scene_without_sidecar_is_staged_in_the_frame_and_lit() {
    let room = bare(STEP);
    let said = stderr(&room, &["render", "room.obj", "--spp", "16", "--size", "48x36"]);
    let line = "room.obj: 60.0 units high, taken as centimetres; main object: everything; \
                staged with a camera, a backdrop, three lights; `stage` writes this as room.toml to edit";
    assert!(said.lines().any(|l| l == line), "{said}");
    assert_eq!(names(room.directory.path()), ["room.exr", "room.mtl", "room.obj"]);

    let exr = read_exr(&room.path("room.exr")).unwrap();
    let part = |name: &str| -> &[f32] { &exr.parts.iter().find(|p| p.name == name).unwrap().channels[0].1 };
    let (mask, depth, luminance) = (part("mask"), part("depth"), part("luminance"));
    assert!(depth.iter().all(|d| d.is_finite() && *d > 0.0), "the backdrop fills the frame");
    let object: Vec<usize> = (0..mask.len()).filter(|&i| mask[i] > 0.5).collect();
    let share = object.len() as f32 / mask.len() as f32;
    assert!((0.1..0.6).contains(&share), "{share}");
    assert!(object.iter().all(|i| (2..46).contains(&(i % 48)) && (2..34).contains(&(i / 48))));
    let mean = object.iter().map(|&i| luminance[i]).sum::<f32>() / object.len() as f32;
    assert!((0.3..0.9).contains(&mean), "{mean}");
    for light in ["light.key", "light.fill", "light.rim"] {
        assert!(object.iter().any(|&i| part(light)[i] > 0.01), "{light}");
    }
}

#[test]
fn a_backdrop_of_the_scene_fills_the_picture_where_it_can() {
    // A box on a floor before a wall, both 4 m wide: seen from 30 degrees to the right one sees past them.
    let product = "o product\nv -0.25 0 -0.25\nv 0.25 0 -0.25\nv 0.25 0 0.25\nv -0.25 0 0.25\nv -0.25 0.7 -0.25\nv 0.25 0.7 -0.25
v 0.25 0.7 0.25\nv -0.25 0.7 0.25\nf 1 2 3 4\nf 5 8 7 6\nf 1 5 6 2\nf 2 6 7 3\nf 3 7 8 4\nf 4 8 5 1\n";
    let set = "o floor\nv -2 0 2\nv 2 0 2\nv 2 0 -2\nv -2 0 -2\nf 9 10 11 12\no wall\nv -2 0 -2\nv 2 0 -2
v 2 2.6 -2\nv -2 2.6 -2\nf 13 14 15 16\n";
    let room = bare(&format!("{product}{set}"));
    let said = stderr(&room, &["render", "room.obj", "--spp", "1", "--size", "48x36"]);
    assert!(said.contains("main object: product; staged with a camera, three lights"), "{said}");
    let exr = read_exr(&room.path("room.exr")).unwrap();
    let depth = &exr.parts.iter().find(|p| p.name == "depth").unwrap().channels[0].1;
    assert!(depth.iter().all(|d| d.is_finite() && *d > 0.0));
    // A floor alone fills no picture: it is seen as ever.
    let camera = |room: &Room| import::load(&room.path("room.obj")).unwrap().scene.camera.position;
    let alone = camera(&bare(&format!("{product}{}", &set[..set.find("o wall").unwrap()])));
    assert!((alone.x.atan2(alone.z).to_degrees() - 30.0).abs() < 1.0, "{alone}");
    let before_wall = camera(&room);
    assert!(before_wall.x.atan2(before_wall.z).to_degrees().abs() < 16.0, "{before_wall}");
}

#[test]
fn the_sidecar_that_stage_writes_gives_the_picture_of_staging_in_memory() {
    for obj in [STEP, OBJ] {
        let room = bare(obj);
        room.succeed(&["render", "room.obj", "--spp", "2", "--size", "24x18", "-o", "memory.png"]);
        assert!(stderr(&room, &["stage", "room.obj"]).contains("wrote room.toml"));
        let said = stderr(&room, &["render", "room.obj", "--spp", "2", "--size", "24x18", "-o", "file.png"]);
        assert!(!said.contains("stage"), "{said}");
        let bytes = |name| std::fs::read(room.path(name)).unwrap();
        assert_eq!(bytes("memory.png"), bytes("file.png"));
    }
}

#[test]
fn a_run_keeps_the_staging_and_leaves_the_scene_alone() {
    let room = bare(STEP);
    let arguments = [&["run", "room.obj", "--out", "r", "--tolerance", "1"], &QUICK[..]].concat();
    room.succeed(&arguments);
    assert_eq!(names(room.directory.path()), ["r", "room.mtl", "room.obj"]);
    let kept = std::fs::read_to_string(room.path("r/staging.toml")).unwrap();
    let staged = builder::stage(&room.path("room.obj"), &StageOptions::default()).unwrap();
    assert_eq!(kept, staged.text);
    // A later run with a sidecar has no staging.
    room.write("room.toml", kept);
    room.succeed(&[&arguments[..], &["--force"]].concat());
    assert!(!room.path("r/staging.toml").exists());
}

#[test]
fn on_its_floor_the_box_is_the_main_object_and_no_backdrop_is_added() {
    let room = bare(OBJ);
    let loaded = import::load(&room.path("room.obj")).unwrap();
    let parts = import::obj::load(&room.path("room.obj"), 0.7).unwrap().parts;
    let is_main = |o: &u32| parts[*o as usize].object.as_deref() == Some("box");
    let expected: Vec<bool> = loaded.scene.mesh.objects.iter().map(is_main).collect();
    assert_eq!(loaded.scene.is_main, expected);
    assert!(!loaded.staging.unwrap().contains("[backdrop]"));
}

#[test]
fn without_names_the_main_object_is_a_box_in_space() {
    let nameless: String = OBJ.lines().filter(|l| !l.starts_with("o ")).map(|l| format!("{l}\n")).collect();
    let room = bare(&nameless);
    let loaded = import::load(&room.path("room.obj")).unwrap();
    assert!(loaded.staging.unwrap().contains("inside = "));
    assert_eq!(loaded.scene.is_main.iter().filter(|m| **m).count(), 10);
}

#[test]
fn a_scene_without_height_is_staged_and_lit() {
    let square = |i: usize, x: [f32; 2], z: [f32; 2]| {
        let v =
            [(x[0], z[0]), (x[0], z[1]), (x[1], z[1]), (x[1], z[0])].map(|(x, z)| format!("v {x} 0 {z}\n"));
        let first = 4 * i + 1;
        format!("o part{i}\n{}f {first} {} {} {}\n", v.concat(), first + 1, first + 2, first + 3)
    };
    // A floor with squares painted on it, and a single square.
    let painted = [square(0, [0.0, 5.0], [0.0, 5.0]), square(1, [1.0, 2.0], [1.0, 2.0])].concat();
    for (obj, n_triangles) in [(painted, 4), (square(0, [0.0, 1.0], [0.0, 1.0]), 2)] {
        let room = bare(&obj);
        room.succeed(&["render", "room.obj", "--spp", "4", "--size", "16x12", "-o", "a.exr"]);
        let scene = import::load(&room.path("room.obj")).unwrap().scene;
        assert_eq!(scene.is_main.iter().filter(|m| **m).count(), n_triangles);
        assert!(scene.lights.iter().all(|l| l.radiance.is_finite() && l.size > 0.0));
    }
}

#[test]
fn a_sidecar_that_exists_is_replaced_by_force_only() {
    let room = Room::new();
    let error = room.fail_at_once(&["stage", "room.obj"]);
    assert_eq!(error, "error: room.toml: exists; --force replaces it");
    assert_eq!(std::fs::read_to_string(room.path("room.toml")).unwrap(), TOML);
    room.succeed(&["stage", "--force", "room.obj"]);
    assert!(std::fs::read_to_string(room.path("room.toml")).unwrap().starts_with("# Staging of room.obj"));
    room.succeed(&["stage", "-o", "other.toml", "room.obj"]);
    let error = room.fail_at_once(&["stage", "-o", "no/other.toml", "room.obj"]);
    assert_eq!(error, "error: no: no such directory");
}

#[test]
fn users_name_the_main_object_the_view_and_the_axis() {
    let room = bare(STEP);
    room.succeed(&["stage", "--main-object", "to*", "--view", "-45", "--up-axis", "z", "room.obj"]);
    let text = std::fs::read_to_string(room.path("room.toml")).unwrap();
    assert!(text.contains("objects = [\"to*\"]") && text.contains("up_axis = \"z\""), "{text}");
    let scene = import::load(&room.path("room.obj")).unwrap().scene;
    assert!(scene.camera.position.x < 0.0, "{:?}", scene.camera.position);
    let error = room.fail_at_once(&["stage", "--force", "--main-object", "tpo", "room.obj"]);
    assert_eq!(error, "error: room.obj: `--main-object`: no `tpo` in room.obj; did you mean `top`?");
    let error = room.fail_at_once(&["stage", "--force", "--main-object", "x*", "room.obj"]);
    assert_eq!(error, "error: room.obj: `--main-object`: no `x*` in room.obj, which has base, top");
    room.command(&["stage", "--view", "x", "room.obj"]).assert().code(2);
}

#[test]
fn units_are_guessed_from_the_size() {
    for (factor, unit, scale) in
        [(0.03, "metres", 1.0), (1.0, "centimetres", 0.01), (50.0, "millimetres", 0.001)]
    {
        let scaled: String = STEP
            .lines()
            .map(|l| match l.strip_prefix("v ") {
                Some(v) => {
                    let v: Vec<String> =
                        v.split(' ').map(|x| (x.parse::<f32>().unwrap() * factor).to_string()).collect();
                    format!("v {}\n", v.join(" "))
                }
                None => format!("{l}\n"),
            })
            .collect();
        let room = bare(&scaled);
        let staged = builder::stage(&room.path("room.obj"), &StageOptions::default()).unwrap();
        assert!(staged.summary.contains(&format!("taken as {unit};")), "{}", staged.summary);
        let scene = import::load(&room.path("room.obj")).unwrap().scene;
        let object = (0..scene.is_main.len()).filter(|&t| scene.is_main[t]);
        let height = object.flat_map(|t| scene.mesh.corners(t)).map(|p| p.y).fold(0.0, f32::max);
        assert!((height - 60.0 * factor * scale).abs() < 1e-5, "{height}");
    }
}

#[test]
fn keys_of_place_are_checked() {
    let room = bare(STEP);
    room.succeed(&["stage", "room.obj"]);
    let text = std::fs::read_to_string(room.path("room.toml")).unwrap();
    for (from, to, wanted) in [
        ("scale = 0.01", "scale = 0.0", "`scale`: must be > 0, got 0"),
        ("scale = 0.01", "up_axis = \"x\"", "room.toml:4: `up_axis`: unknown variant `x`"),
        ("front =", "frnot =", "unknown key `frnot`; did you mean `front`?"),
        ("back = ", "back = -", "`backdrop.back`: must be > 0"),
        ("\nradius = ", "\nradius = 9", "`backdrop.radius`: must be > 0 and at most `back` and `height`"),
        ("[0.6, 0.6, 0.6]", "[0.6, 0.6, 2.0]", "`backdrop.base_color`: channels must be in [0, 1]"),
        (
            "objects = [\"*\"]",
            "inside = [[1, 0, 0], [0, 1, 1]]",
            "`main_object.inside`: must be two corners, the lesser first",
        ),
    ] {
        assert!(text.contains(from), "{from}");
        room.write("room.toml", text.replacen(from, to, 1));
        let error = room.fail_at_once(&["render", "room.obj", "-o", "a.png"]);
        assert!(error.contains(wanted), "wanted `{wanted}` in: {error}");
    }
}

/// A jar on a floor before a wall, with a camera and a point light: glTF of Blender 5.0.1.
const LIT_ROOM: &[u8] = include_bytes!("../data/camera_light_room.glb");

#[test]
fn of_a_file_with_camera_and_lights_the_main_object_is_found_as_stage_finds_it() {
    let room = Room::new();
    room.write("jar.glb", LIT_ROOM);
    let said = stderr(&room, &["stage", "-o", "jar.txt", "jar.glb"]);
    assert!(said.contains("main object: Jar; camera and lights are the file's own\n"), "{said}");
    let said = stderr(&room, &[&["run", "jar.glb", "--out", "r", "--tolerance", "1"], &QUICK[..]].concat());
    let line =
        "jar.glb: main object: Jar, found from its geometry; `[main_object]` in jar.toml chooses another";
    assert_eq!(said.lines().filter(|l| *l == line).count(), 1, "{said}");
    let scene = import::load(&room.path("jar.glb")).unwrap().scene;
    assert_eq!((scene.is_main.len(), scene.is_main.iter().filter(|m| **m).count()), (16, 12));
    // What `stage` writes says the same.
    room.write("jar.toml", std::fs::read(room.path("jar.txt")).unwrap());
    assert_eq!(import::load(&room.path("jar.glb")).unwrap().scene.is_main, scene.is_main);
}

#[test]
fn what_the_camera_of_the_file_cannot_see_is_not_the_main_object() {
    // The camera looks from behind the wall.
    let mut bytes = LIT_ROOM.to_vec();
    let key = b"\"translation\":[0,1.2";
    let at = bytes.windows(key.len()).position(|w| w == key).unwrap();
    let length = bytes[at..].iter().position(|b| *b == b']').unwrap() + 1;
    let new = format!("{:<1$}", "\"translation\":[0,1,-9]", length);
    bytes[at..at + new.len()].copy_from_slice(new.as_bytes());
    let room = Room::new();
    room.write("jar.glb", bytes);
    assert!(import::load(&room.path("jar.glb")).unwrap().scene.is_main.iter().all(|m| *m));
}

#[test]
fn a_scene_lit_by_what_shines_gets_lights_from_neither_render_nor_stage() {
    let json = r#"{"asset":{"version":"2.0"},"scenes":[{"nodes":[0,1]}],"nodes":[{"mesh":0},
        {"camera":0,"translation":[0,0,3]}],"cameras":[{"type":"perspective","perspective":{"yfov":0.8,"znear":0.1}}],
        "materials":[{"emissiveFactor":[1,1,1]}],
        "meshes":[{"primitives":[{"attributes":{"POSITION":0},"material":0}]}],
        "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}],
        "bufferViews":[{"buffer":0,"byteLength":36}],
        "buffers":[{"byteLength":36,"uri":"data:;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}]}"#;
    let room = Room::new();
    room.write("sign.gltf", json);
    assert_eq!(import::load(&room.path("sign.gltf")).unwrap().scene.lights.len(), 1);
    let staged = builder::stage(&room.path("sign.gltf"), &StageOptions::default()).unwrap();
    assert!(!staged.text.contains("[[lights]]"), "{}", staged.text);
    room.write("sign.toml", staged.text);
    assert_eq!(import::load(&room.path("sign.gltf")).unwrap().scene.lights.len(), 1);
}
