//! What a scene file may reach: regular files, and with `--confine` those of its own folder.

use std::{path::Path, process::Command as Process, time::Duration};

use crate::room::{MTL, OBJ, Room, TOML};

/// A camera and one triangle, whose bytes and image are in other files.
fn gltf(buffer: &str, image: &str) -> String {
    format!(
        r#"{{"asset":{{"version":"2.0"}},"scenes":[{{"nodes":[0,1]}}],"nodes":[{{"mesh":0}},
        {{"camera":0,"translation":[0,0,3]}}],"cameras":[{{"type":"perspective","perspective":{{"yfov":0.8,"znear":0.1}}}}],
        "materials":[{{"emissiveFactor":[1,1,1],"emissiveTexture":{{"index":0}}}}],
        "textures":[{{"source":0}}],"images":[{{"uri":"{image}"}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"material":0}}]}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}}],
        "bufferViews":[{{"buffer":0,"byteLength":36}}],"buffers":[{{"byteLength":36,"uri":"{buffer}"}}]}}"#
    )
}

/// The positions of a triangle.
const TRIANGLE: [f32; 9] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];

fn triangle() -> Vec<u8> {
    TRIANGLE.iter().flat_map(|v| v.to_le_bytes()).collect()
}

fn write_image(path: &Path) {
    image::RgbImage::from_pixel(2, 2, image::Rgb([255, 255, 255])).save(path).unwrap();
}

/// The error of a command, which comes at once whatever it reads.
fn refused(room: &Room, arguments: &[&str]) -> String {
    let assert = room.command(arguments).timeout(Duration::from_secs(20)).assert().code(1).stdout("");
    let said = String::from_utf8(assert.get_output().stderr.clone()).unwrap();
    let errors: Vec<&str> = said.lines().filter(|l| l.starts_with("error: ")).collect();
    assert_eq!(errors.len(), 1, "{said}");
    errors[0].to_owned()
}

const RENDER: [&str; 7] = ["render", "--spp", "1", "--size", "8x6", "-o", "a.png"];

#[cfg(unix)]
#[test]
fn devices_pipes_and_folders_are_refused_wherever_a_scene_names_them() {
    let room = Room::new();
    assert!(Process::new("mkfifo").arg(room.path("pipe")).status().unwrap().success());
    std::fs::create_dir(room.path("folder")).unwrap();
    std::fs::write(room.path("t.bin"), triangle()).unwrap();
    write_image(&room.path("t.png"));
    let sky = "[[lights]]\nname = \"sky\"\ntype = \"environment\"\nradiance = 1.0\nimage = ";
    for (file, what) in [("/dev/zero", "a device"), ("pipe", "a pipe"), ("folder", "a directory")] {
        let ends = |error: &str, start: &str| {
            assert!(error.starts_with(&format!("error: {start}: ")), "{error}");
            assert!(error.ends_with(&format!("{file}: is {what}; only regular files are read")), "{error}");
        };
        room.write("room.obj", OBJ.replace("room.mtl", file));
        ends(&refused(&room, &[&RENDER[..], &["room.obj"]].concat()), "room.obj: `mtllib`");
        room.write("room.obj", OBJ);
        room.write("room.toml", format!("{TOML}{sky}\"{file}\"\n"));
        ends(&refused(&room, &[&RENDER[..], &["room.obj"]].concat()), "room.toml: `lights.sky.image`");
        room.write("room.toml", TOML);
        room.write("s.gltf", gltf(file, "t.png"));
        ends(&refused(&room, &[&RENDER[..], &["s.gltf"]].concat()), "s.gltf: `buffers[0]`");
        room.write("s.gltf", gltf("t.bin", file));
        ends(&refused(&room, &[&RENDER[..], &["s.gltf"]].concat()), "s.gltf: `images[0]`");
    }
    // What is no regular file is no image either, and is passed over as one that is missing.
    room.write("room.mtl", MTL.replace("Kd 0.7 0.2 0.1", "map_Kd /dev/zero"));
    room.command(&[&RENDER[..], &["room.obj"]].concat()).timeout(Duration::from_secs(20)).assert().code(0);
    std::fs::remove_file(room.path("room.toml")).unwrap();
    std::fs::rename(room.path("pipe"), room.path("room.toml")).unwrap();
    let error = refused(&room, &[&RENDER[..], &["room.obj"]].concat());
    assert_eq!(error, "error: room.toml: is a pipe; only regular files are read");
}

#[test]
fn what_a_file_outside_says_is_not_repeated() {
    let room = Room::new();
    for (i, secret) in ["hunter2:x:0:0", "newmtl a\nKd hunter2", "newmtl a\nillum 7654321", "Ns hunter2"]
        .into_iter()
        .enumerate()
    {
        room.write("other/secret", secret);
        room.write("room.obj", OBJ.replace("room.mtl", "other/secret"));
        let error = refused(&room, &[&RENDER[..], &["room.obj"]].concat());
        assert!(error.starts_with("error: other/secret:"), "{error}");
        assert!(!error.contains("hunter2") && !error.contains("7654321"), "{i}: {error}");
    }
}

#[cfg(unix)]
#[test]
fn a_confined_scene_reads_nothing_outside_its_folder() {
    let outer = Room::new();
    let scene = |name: &str| format!("scene/{name}");
    outer.write("other/room.mtl", MTL);
    outer.write("other/t.bin", triangle());
    write_image(&outer.path("other/u.png"));
    outer.write(&scene("room.toml"), TOML);
    outer.write(&scene("room.mtl"), MTL);
    outer.write(&scene("room.obj"), OBJ);
    outer.write(&scene("t.bin"), triangle());
    std::fs::create_dir(outer.path("textures")).unwrap();
    write_image(&outer.path("textures/t.png"));
    std::os::unix::fs::symlink("../other/room.mtl", outer.path("scene/link.mtl")).unwrap();
    let absolute = outer.path("other/u.png").display().to_string();

    let render = |file: &str, confine: bool| -> Vec<String> {
        let confine: &[&str] = if confine { &["--confine"] } else { &[] };
        [&RENDER[..], confine, &[file]].concat().into_iter().map(str::to_owned).collect()
    };
    let judge = |file: &str, key: &str| {
        let words = |confine| render(file, confine);
        let strings: Vec<String> = words(false);
        outer.succeed(&strings.iter().map(String::as_str).collect::<Vec<_>>());
        let strings = words(true);
        let error = refused(&outer, &strings.iter().map(String::as_str).collect::<Vec<_>>());
        assert!(error.starts_with(&format!("error: {file}: `{key}`: ")), "{error}");
        assert!(error.contains(": lies outside the scene's folder"), "{error}");
    };
    let obj = scene("room.obj");
    for library in ["../other/room.mtl", "link.mtl"] {
        outer.write(&obj, OBJ.replace("room.mtl", library));
        judge(&obj, "mtllib");
    }
    outer.write(&obj, OBJ);
    for image in ["../other/u.png", &absolute] {
        outer.write(&scene("room.mtl"), MTL.replace("Kd 0.7 0.2 0.1", &format!("map_Kd {image}")));
        judge(&obj, "red: map_Kd");
        outer.write(&scene("s.gltf"), gltf("t.bin", image));
        judge(&scene("s.gltf"), "images[0]");
    }
    outer.write(&scene("s.gltf"), gltf("../other/t.bin", "../textures/t.png"));
    judge(&scene("s.gltf"), "buffers[0]");

    // What lies inside is read, by every command that loads a scene.
    outer.write(&scene("room.mtl"), MTL.replace("Kd 0.7 0.2 0.1", "map_Kd t.png"));
    outer.write(&scene("s.gltf"), gltf("t.bin", "../textures/t.png"));
    for file in [scene("room.obj"), scene("s.gltf")] {
        for command in [
            &RENDER[..],
            &["export", "--format", "mitsuba", "-o", "x"],
            &["stage", "-o", "x.toml", "--force"],
        ] {
            outer.succeed(&[command, &["--confine", &file]].concat());
        }
        std::fs::remove_dir_all(outer.path("x")).unwrap();
    }
    outer.write(&obj, OBJ.replace("room.mtl", "../other/room.mtl"));
    for command in [
        &["run", "--out", "r"][..],
        &["export", "--format", "mitsuba", "-o", "x"],
        &["stage", "-o", "x.toml", "--force"],
    ] {
        let error = refused(&outer, &[command, &["--confine", &obj]].concat());
        assert!(error.contains("lies outside"), "{error}");
    }
}

#[cfg(unix)]
#[test]
fn names_do_not_steer_the_terminal_nor_break_the_line() {
    let room = Room::new();
    let name = "a\x1b[31m\nb";
    for ending in ["obj", "toml"] {
        std::fs::rename(room.path(format!("room.{ending}")), room.path(format!("{name}.{ending}"))).unwrap();
    }
    let obj = format!("{name}.obj");
    room.write(&obj, OBJ.replace("usemtl red", "usemtl \x1b]0;x\x07red"));
    let assert = room.command(&[&RENDER[..], &[&obj]].concat()).assert().code(0);
    let said = String::from_utf8(assert.get_output().stderr.clone()).unwrap();
    assert!(!said.contains(|c: char| c.is_control() && c != '\n'), "{said:?}");
    let names = ["a\\u{1b}[31m\\nb.obj", "\\u{1b}]0;x\\u{7}red"];
    assert!(said.lines().any(|l| names.iter().all(|n| l.contains(n))), "{said}");
    room.write(&obj, "v 1 2\n");
    let error = refused(&room, &[&RENDER[..], &[&obj]].concat());
    assert_eq!(error, "error: a\\u{1b}[31m\\nb.obj:1: `v`: needs 3 numbers, got 2");
}
