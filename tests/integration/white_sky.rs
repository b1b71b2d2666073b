//! What surfaces show under a white sky: their base colour, whatever their roughness.

use lightopt_embree::film::exr::read_exr;

use crate::room::Room;

/// A plane, seen from above alone.
const OBJ: &str = "mtllib room.mtl
o plane
v -1 0 -1
v -1 0 1
v 1 0 1
v 1 0 -1
usemtl m
f 1 2 3 4
";

const CAMERA: &str = "[camera]
position = [0, 3, 0]
look_at = [0, 0, 0]
up = [0, 0, -1]
vfov = 20
size = [16, 16]
[main_object]
objects = [\"*\"]
";

const SKY: &str = "[[lights]]
name = \"sky\"
type = \"environment\"
";

/// Mean of the first channel of a picture in which nothing but the plane is seen.
fn mean(room: &Room, scene: &str, max_depth: &str) -> f64 {
    room.succeed(&[
        "render",
        scene,
        "--spp",
        "256",
        "--max-depth",
        max_depth,
        "--size",
        "16x16",
        "-o",
        "a.exr",
    ]);
    let exr = read_exr(&room.path("a.exr")).unwrap();
    let red = exr.parts[0].channel("R").unwrap();
    red.iter().map(|&v| f64::from(v)).sum::<f64>() / red.len() as f64
}

/// The plane with a material of MTL.
fn shown(mtl: &str) -> f64 {
    mean(&Room::with(OBJ, mtl, &format!("schema = 1\n{CAMERA}{SKY}")), "room.obj", "2")
}

#[track_caller]
fn assert_shows(shown: f64, right: f64) {
    assert!((shown - right).abs() < 0.005, "{shown} should be {right}");
}

/// What Cycles 5.0.1 shows of Blender's default material, base colour 0.8, at these roughnesses.
#[test]
fn the_default_material_of_blender_shows_its_base_colour() {
    let header = "# Blender 5.0.1 MTL File: 'a.blend'\nnewmtl m\n";
    let common = "Kd 0.8 0.8 0.8\nKs 0.5 0.5 0.5\nKe 0 0 0\nNi 1.5\nd 1\nillum 2\n";
    assert_shows(shown(&format!("{header}Ns 250\nKa 1 1 1\n{common}")), 0.807);
    for (roughness, right) in [(0.5, 0.808), (0.9, 0.804), (1.0, 0.803)] {
        assert_shows(shown(&format!("{header}{common}Pr {roughness}\nPm 0\n")), right);
    }
}

#[test]
fn a_white_matte_material_of_gltf_is_white() {
    let room = Room::new();
    room.write("matte.gltf", include_str!("../data/white_sky/matte.gltf"));
    room.write("matte.toml", format!("schema = 1\n{SKY}"));
    assert_shows(mean(&room, "matte.gltf", "2"), 1.0);
}

#[test]
fn white_metal_is_as_bright_as_the_sky_at_any_roughness() {
    for roughness in [0.3, 0.7, 1.0] {
        assert_shows(shown(&format!("newmtl m\nKd 1 1 1\nPm 1\nPr {roughness}\n")), 1.0);
    }
}

#[test]
fn a_block_of_rough_glass_is_as_bright_as_the_sky() {
    let block =
        "mtllib room.mtl\nv -1 -1 -1\nv 1 -1 -1\nv 1 -1 1\nv -1 -1 1\nv -1 0 -1\nv 1 0 -1\nv 1 0 1\nv -1 0 1
o block\nusemtl m\nf 1 2 3 4\nf 5 8 7 6\nf 1 5 6 2\nf 2 6 7 3\nf 3 7 8 4\nf 4 8 5 1\n";
    let glass = "newmtl m\nNi 1.5\nPr 0.9\nillum 7\n";
    let room = Room::with(block, glass, &format!("schema = 1\n{CAMERA}{SKY}"));
    // Light meets several surfaces, each within 0.0013 of losing nothing, and is noisier for it.
    let shown = mean(&room, "room.obj", "32");
    assert!((shown - 1.0).abs() < 0.01, "{shown}");
}
