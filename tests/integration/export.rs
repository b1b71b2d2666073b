//! `lightopt-embree export`.

use std::{fs, path::Path};

use assert_cmd::Command;
use lightopt_embree::{
    export::{self, ExportError, ExportJob, Exported},
    import,
    integrator::View,
    lighting::Lighting,
};
use predicates::prelude::*;
use predicates::str::contains;
use tempfile::TempDir;

use crate::room::program;

/// Two triangles under a name that is no file name, one textured under another.
const OBJ: &str = "mtllib s.mtl
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
vt 0 0
vt 1 1
o quad
usemtl a/b<&>
f 1 2 3 4
o one
usemtl image
f 1/1 2/2 3/2
";
const MTL: &str = "newmtl a/b<&>
Kd 0.5 0.25 0.125
Ks 0.04 0.04 0.04
Ni 1.5
Pr 0.5
newmtl image
Kd 0.5 0.5 0.5
map_Kd t.png
illum 1
newmtl unused
Kd 1 1 1
";
const SIDECAR: &str = "schema = 1
[camera]
position = [0.0, 0.0, 3.0]
look_at = [0.0, 0.0, 0.0]
vfov = 40.0
size = [32, 24]
[main_object]
objects = [\"quad\"]
";
const DISK: &str = "[[lights]]
name = \"key\"
type = \"disk\"
position = [0.0, 2.0, 2.0]
look_at = [0.0, 0.0, 0.0]
radius = 0.5
radiance = 3.0
";

fn scene_dir(lights: &str) -> TempDir {
    let directory = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| fs::write(directory.path().join(name), text).unwrap();
    write("s.obj", OBJ);
    write("s.mtl", MTL);
    write("s.toml", &format!("{SIDECAR}{lights}"));
    image::RgbImage::from_pixel(3, 2, image::Rgb([255, 0, 0])).save(directory.path().join("t.png")).unwrap();
    directory
}

fn export(directory: &Path) -> Command {
    let mut command = program(directory);
    command.args(["export", "--format", "mitsuba", "-o", "out", "s.obj"]);
    command
}

/// Numbers of vertices and faces, and bytes after the header.
fn ply(path: &Path) -> (usize, usize, usize) {
    let bytes = fs::read(path).unwrap();
    let end = b"end_header\n";
    let body = bytes.windows(end.len()).position(|w| w == end).unwrap() + end.len();
    let header = std::str::from_utf8(&bytes[..body]).unwrap();
    let count = |element: &str| {
        let line = header.lines().find_map(|l| l.strip_prefix(&format!("element {element} ")));
        line.unwrap().parse::<usize>().unwrap()
    };
    (count("vertex"), count("face"), bytes.len() - body)
}

/// Fails unless tags nest and attributes are quoted.
fn assert_well_formed(xml: &str) {
    let mut open = Vec::new();
    let mut rest = xml;
    while let Some(start) = rest.find('<') {
        assert!(!rest[..start].contains(['>', '&']), "stray text before {}", &rest[start..]);
        let end = start + rest[start..].find('>').expect("a tag ends");
        let tag = &rest[start + 1..end];
        rest = &rest[end + 1..];
        if tag.starts_with('?') || tag.starts_with('!') {
            continue;
        }
        assert_eq!(tag.matches('"').count() % 2, 0, "{tag}");
        assert!(!tag.contains(['<', '&']), "{tag}");
        if let Some(name) = tag.strip_prefix('/') {
            assert_eq!(open.pop(), Some(name));
        } else if !tag.ends_with('/') {
            open.push(tag.split(' ').next().unwrap());
        }
    }
    assert!(open.is_empty(), "{open:?} are not closed");
}

#[test]
fn a_scene_becomes_xml_with_a_mesh_per_material_and_baked_textures() {
    let directory = scene_dir(DISK);
    export(directory.path()).args(["--size", "20x10", "--max-depth", "5"]).assert().success();
    let out = directory.path().join("out");
    let mut names: Vec<String> =
        fs::read_dir(&out).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    assert_eq!(names, ["00_a_b___.ply", "01_image.exr", "01_image.ply", "scene.xml"]);

    let xml = fs::read_to_string(out.join("scene.xml")).unwrap();
    assert_well_formed(&xml);
    for part in [
        "<integrator type=\"volpath\">",
        "name=\"max_depth\" value=\"5\"",
        "name=\"width\" value=\"20\"",
        "name=\"alpha\" value=\"0.25\"",
        "<bsdf type=\"roughplastic\">",
        "value=\"01_image.exr\"",
        "<shape type=\"disk\">",
        "<bsdf type=\"null\"/>",
    ] {
        assert!(xml.contains(part), "{part} is not in\n{xml}");
    }

    for (name, faces) in [("00_a_b___.ply", 2), ("01_image.ply", 1)] {
        let (n_vertices, n_faces, n_bytes) = ply(&out.join(name));
        assert_eq!(n_faces, faces);
        assert!((3..=3 * faces).contains(&n_vertices));
        assert_eq!(n_bytes, n_vertices * 8 * 4 + n_faces * (1 + 3 * 4));
    }
    let texture = lightopt_embree::film::image_file::read_image(&out.join("01_image.exr")).unwrap();
    assert_eq!((texture.width, texture.height), (3, 2));
    assert_eq!(texture.rgb, vec![[0.5, 0.0, 0.0]; 6]);
}

#[test]
fn a_lighting_that_was_found_is_exported() {
    let directory = scene_dir(DISK);
    let lights = "schema = 1\n[[lights]]\nname = \"key\"\nradiance = 7.0\nsize = 0.5\n";
    fs::write(directory.path().join("lights.toml"), lights).unwrap();
    export(directory.path()).args(["--lights", "lights.toml"]).assert().success();
    let xml = fs::read_to_string(directory.path().join("out/scene.xml")).unwrap();
    assert!(xml.contains("name=\"radiance\" value=\"7, 7, 7\""), "{xml}");
}

/// The scene.xml of the scene lit by `lights`, and what the program said.
fn exported(lights: &str) -> (TempDir, String, String) {
    let directory = scene_dir(lights);
    let output = export(directory.path()).assert().success().get_output().stderr.clone();
    let xml = fs::read_to_string(directory.path().join("out/scene.xml")).unwrap();
    assert_well_formed(&xml);
    (directory, xml, String::from_utf8(output).unwrap())
}

#[test]
fn a_spot_is_many_emitters_that_project_one_picture() {
    let spot = DISK.replace("\"disk\"", "\"spot\"") + "angle = 30.0\nsoftness = 0.5\n";
    let (directory, xml, said) = exported(&spot);
    assert!(said.contains("key") && said.contains("1024 points"), "{said}");
    assert_eq!(xml.matches("<emitter type=\"spot\">").count(), 1024);
    assert_eq!(xml.matches("<ref name=\"texture\" id=\"light_key\"/>").count(), 1024);
    let read = lightopt_embree::film::exr::read_exr(&directory.path().join("out/light_key.exr")).unwrap();
    let profile = read.parts[0].channel("Y").unwrap();
    assert!((profile[read.width * (read.height / 2) + read.width / 2] - 1.0).abs() < 1e-3);
    assert!(profile[0] == 0.0, "the corners lie outside the cone");
    // Together as bright as the disk: L π r² / n each, at full size.
    let intensity: f32 = xml
        .split_once("name=\"intensity\" value=\"")
        .and_then(|(_, rest)| rest.split([',', '"']).next())
        .and_then(|v| v.parse().ok())
        .unwrap();
    assert!((intensity * 1024.0 / (3.0 * std::f32::consts::PI * 0.25) - 1.0).abs() < 1e-5);

    let (_directory, xml, _) = exported(&spot.replace("radius = 0.5", "radius = 0"));
    assert_eq!(xml.matches("<emitter type=\"spot\">").count(), 1);
}

#[test]
fn lights_whose_names_differ_in_unsafe_characters_have_pictures_of_their_own() {
    let spot = |name: &str, angle: f32| {
        let point = DISK.replace("\"disk\"", "\"spot\"").replace("radius = 0.5", "radius = 0");
        format!("{}angle = {angle}\n", point.replace("key", name))
    };
    let lights = [spot("a b", 30.0), spot("a_b", 50.0), spot("a/b", 70.0)].concat();
    let (directory, xml, _) = exported(&lights);
    for id in ["light_a_b", "light_a_b_2", "light_a_b_3"] {
        assert!(xml.contains(&format!("<texture type=\"bitmap\" id=\"{id}\">")), "{id} is not in\n{xml}");
        assert!(xml.contains(&format!("<ref name=\"texture\" id=\"{id}\"/>")), "{id} is not in\n{xml}");
        assert!(directory.path().join(format!("out/{id}.exr")).is_file());
    }
}

#[test]
fn lights_at_infinity_and_bodies_that_stop_light_are_exported() {
    let sun = "[[lights]]\nname = \"sun\"\ntype = \"distant\"\nlook_at = [0.0, -2.0, 0.0]\nradiance = 3.0\n";
    let sky = "[[lights]]\nname = \"sky\"\ntype = \"environment\"\nradiance = 2.0\n";
    let (_directory, xml, _) = exported(&format!("{sun}{sky}{DISK}occludes = true\n"));
    for part in [
        "<vector name=\"direction\" value=\"0, -1, 0\"/>",
        "<rgb name=\"irradiance\" value=\"3, 3, 3\"/>",
        "<emitter type=\"constant\">",
        "<rgb name=\"reflectance\" value=\"0\"/>",
    ] {
        assert!(xml.contains(part), "{part} is not in\n{xml}");
    }
    assert!(!xml.contains("\"null\""));
    // Hidden from the camera, the black body stays and what shines lies before it.
    let (_directory, xml, _) = exported(&format!("{DISK}occludes = true\ncamera_visible = false\n"));
    assert!(xml.contains("\"hide_emitters\" value=\"true\""));
    assert_eq!(xml.matches("<shape type=\"disk\">").count(), 2);
}

#[test]
fn an_emissive_material_shines_and_a_lens_is_kept() {
    let directory = scene_dir("");
    let path = |name: &str| directory.path().join(name);
    fs::write(path("s.mtl"), MTL.replace("illum 1\n", "Ke 1 2 3\nd 0.5\nillum 1\n")).unwrap();
    let sidecar = SIDECAR.replace("vfov", "aperture_radius = 0.1\nfocus_distance = 2.5\nvfov");
    fs::write(path("s.toml"), sidecar).unwrap();
    export(directory.path()).assert().success();
    let xml = fs::read_to_string(path("out/scene.xml")).unwrap();
    assert_well_formed(&xml);
    for part in [
        "<sensor type=\"thinlens\">",
        "name=\"aperture_radius\" value=\"0.1\"",
        "name=\"focus_distance\" value=\"2.5\"",
        "<bsdf type=\"mask\">",
        "<emitter type=\"area\">",
    ] {
        assert!(xml.contains(part), "{part} is not in\n{xml}");
    }
    // What lets half of the light pass shines half as bright: the sum of 1, 2 and 3 over 2.
    let radiance = xml.split_once("name=\"radiance\" value=\"").unwrap().1.split_once('"').unwrap().0;
    let sum: f32 = radiance.split(", ").map(|v| v.parse::<f32>().unwrap()).sum();
    assert!((sum - 3.0).abs() < 1e-5, "{radiance}");
}

#[test]
fn what_cannot_be_represented_is_refused_before_anything_is_written() {
    let seen = DISK.replace("[0.0, 2.0, 2.0]", "[0.0, 0.5, 0.5]");
    let other = seen.replace("\"key\"", "\"hidden\"") + "camera_visible = false\n";
    let directory = scene_dir(&format!("{seen}{other}"));
    export(directory.path()).assert().code(1).stderr(contains("hidden").and(contains("camera_visible")));
    assert!(!directory.path().join("out").exists());
    let directory = scene_dir(&other);
    export(directory.path()).assert().success();
    let xml = fs::read_to_string(directory.path().join("out/scene.xml")).unwrap();
    assert!(xml.contains("name=\"hide_emitters\" value=\"true\""), "{xml}");
}

#[test]
fn a_hidden_light_outside_the_picture_may_stand_beside_visible_ones() {
    // To the left of the picture, and behind the camera.
    for place in ["[-9.0, 0.0, 0.0]", "[0.0, 0.0, 90.0]"] {
        let seen = DISK.replace("[0.0, 2.0, 2.0]", "[0.0, 0.5, 0.5]");
        let away = DISK.replace("[0.0, 2.0, 2.0]", place).replace("\"key\"", "\"hidden\"");
        let (_directory, xml, _) = exported(&format!("{seen}{away}camera_visible = false\n"));
        assert!(!xml.contains("name=\"hide_emitters\" value=\"true\""), "{xml}");
        assert_eq!(xml.matches("<emitter type=\"area\">").count(), 2, "{xml}");
    }
}

#[test]
fn a_staged_scene_with_a_surface_that_shines_is_exported() {
    let directory = tempfile::tempdir().unwrap();
    let quad = |x: f32, y: f32, z: f32, r: f32| {
        let at = |i: f32, j: f32| format!("v {} {} {}\n", x + i * r, y + j * 0.3 * r, z - j * r);
        [at(-1.0, -1.0), at(1.0, -1.0), at(1.0, 1.0), at(-1.0, 1.0)].concat()
    };
    let body = [quad(0.0, 0.3, 0.0, 0.3), quad(0.6, 0.8, 0.0, 0.1)].concat();
    let floor = "v -2 0 2\nv 2 0 2\nv 2 0 -2\nv -2 0 -2\n";
    let faces = "o jar\nusemtl paper\nf 1 2 3 4\no lamp\nusemtl glow\nf 5 6 7 8\no floor\nusemtl paper\nf 9 10 11 12\n";
    fs::write(directory.path().join("s.obj"), format!("mtllib s.mtl\n{body}{floor}{faces}")).unwrap();
    fs::write(directory.path().join("s.mtl"), "newmtl paper\nKd 0.5 0.5 0.5\nnewmtl glow\nKe 1 2 3\n")
        .unwrap();
    export(directory.path()).assert().success();
    let xml = fs::read_to_string(directory.path().join("out/scene.xml")).unwrap();
    // Key, fill, rim, and the surface.
    assert_eq!(xml.matches("<emitter type=\"area\">").count(), 4, "{xml}");
}

/// Exports the scene of a directory as its author lit it.
fn write(directory: &Path) -> Result<Exported, ExportError> {
    let scene = import::load(&directory.join("s.obj")).unwrap().scene;
    let view = View { scene: &scene, camera: &scene.camera };
    let lighting = Lighting::authored(&scene);
    let job = ExportJob::new(view, &lighting, 8);
    export::by_name("mitsuba").unwrap().write(&job, &directory.join("out"))
}

#[test]
fn an_exporter_names_the_files_it_has_written_the_one_to_open_last() {
    let directory = scene_dir(&(DISK.replace("\"disk\"", "\"spot\"") + "angle = 30.0\n"));
    let out = directory.path().join("out");
    let mitsuba = export::by_name("mitsuba").unwrap();
    let mut files = write(directory.path()).unwrap().files;
    assert_eq!(files.last(), Some(&mitsuba.entry_point(&out)));
    files.sort();
    let mut there: Vec<_> = fs::read_dir(&out).unwrap().map(|e| e.unwrap().path()).collect();
    there.sort();
    assert_eq!(files, there);
    export(directory.path()).assert().success().stderr(contains("wrote 5 files; open out/scene.xml"));
}

#[test]
fn an_error_names_the_format_and_what_has_no_counterpart_there() {
    let seen = DISK.replace("[0.0, 2.0, 2.0]", "[0.0, 0.5, 0.5]");
    let directory = scene_dir(&format!("{seen}camera_visible = false\n{}", seen.replace("key", "rim")));
    let error = write(directory.path()).unwrap_err();
    assert!(matches!(error, ExportError::NoCounterpart { .. }), "{error:?}");
    assert!(error.to_string().starts_with("light `key`: Mitsuba has no counterpart to "), "{error}");
}

#[test]
fn the_help_lists_every_format_with_what_it_writes() {
    let help = Command::cargo_bin("lightopt-embree").unwrap().args(["export", "--help"]).assert().success();
    let help = String::from_utf8(help.get_output().stdout.clone()).unwrap();
    let help = help.split_whitespace().collect::<Vec<_>>().join(" ");
    for exporter in export::EXPORTERS {
        let line = format!("- {}: {}; writes {}", exporter.name(), exporter.help(), exporter.files());
        assert!(help.contains(&line), "{line} is not in\n{help}");
    }
}

#[test]
fn a_wrong_format_is_a_usage_error() {
    for format in [&["--format", "povray"][..], &[]] {
        let mut command = Command::cargo_bin("lightopt-embree").unwrap();
        command.args(["export", "-o", "out", "s.obj"]).args(format);
        command.assert().code(2).stderr(contains("mitsuba").or(contains("--format")));
    }
}
