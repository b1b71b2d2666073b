//! Large files take time in proportion to their size: at these sizes its square would be minutes.

use std::fmt::Write as _;

use glam::Vec3;
use lightopt_embree::import::{Loaded, load};
use serde_json::json;

use crate::room::{Room, TOML};

/// The scene of an OBJ without library whose object is called `box`.
fn loaded(obj: &str) -> Loaded {
    load(&Room::with(obj, "", TOML).path("room.obj")).unwrap()
}

#[test]
fn a_hundred_thousand_materials_without_a_library_are_one_warning() {
    let n = 100_000;
    let mut obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\no box\n".to_owned();
    (0..n).for_each(|i| write!(obj, "usemtl m{i}\nf 1 2 3\n").unwrap());
    let Loaded { scene, warnings, .. } = loaded(&obj);
    assert_eq!(scene.materials.len(), n);
    let wanted = format!("room.obj:5: no library defines material `m0` nor {} more; using grey", n - 1);
    let said: Vec<&String> = warnings.iter().filter(|w| w.contains("library")).collect();
    assert!(said.len() == 1 && said[0].ends_with(&wanted), "{said:?}");
}

#[test]
fn a_hundred_thousand_materials_that_lack_their_images_are_one_warning() {
    let n = 100_000;
    let mut mtl = String::new();
    (0..n).for_each(|i| write!(mtl, "newmtl m{i}\nKd 2 2 2\nmap_Kd none.png\ndisp none.png\n").unwrap());
    let obj = "mtllib room.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\no box\nusemtl m7\nf 1 2 3\n";
    let warnings = load(&Room::with(obj, &mtl, TOML).path("room.obj")).unwrap().warnings;
    assert!(warnings.len() < 8, "{warnings:?}");
    assert!(
        warnings.iter().any(|w| w.contains("materials `m0`, `m1`, `m2` and 99997 more: `map_Kd`: no file")),
        "{warnings:?}"
    );
}

#[test]
fn a_disk_of_three_hundred_thousand_corners_is_flat() {
    let n = 300_000;
    let mut obj = "o box\n".to_owned();
    for i in 0..n {
        let (sin, cos) = (std::f64::consts::TAU * f64::from(i) / f64::from(n)).sin_cos();
        writeln!(obj, "v {cos} {sin} 0").unwrap();
    }
    obj += "f";
    (1..=n).for_each(|i| write!(obj, " {i}").unwrap());
    let scene = loaded(&obj).scene;
    assert!(scene.mesh.indices.len() > 290_000);
    // Of some hundred slivers at the hub rounding turns the corners over.
    let n_up = scene.mesh.normals.iter().filter(|v| v.dot(Vec3::Z) > 0.999_9).count();
    assert!(n_up > scene.mesh.normals.len() / 1000 * 999, "{n_up} of {}", scene.mesh.normals.len());
}

#[test]
fn a_face_of_a_million_continued_lines_is_one_face() {
    let mut obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\no box\nf".to_owned();
    (0..1_000_000).for_each(|_| obj.push_str(" \\\n"));
    obj += " 1 2 3\n";
    assert_eq!(loaded(&obj).scene.mesh.indices.len(), 1);
}

#[test]
fn thirty_thousand_lights_of_one_name_have_names_of_their_own() {
    let n = 30_000;
    let lamp = json!({"extensions": {"KHR_lights_punctual": {"light": 0}}});
    let mut nodes = vec![lamp; n];
    nodes.push(json!({"mesh": 0, "name": "box"}));
    let corners = [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].map(f32::to_le_bytes).concat();
    let uri: String = corners.iter().map(|b| format!("%{b:02x}")).collect();
    let gltf = json!({
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": (0..=n).collect::<Vec<_>>()}],
        "nodes": nodes,
        "extensionsUsed": ["KHR_lights_punctual"],
        "extensions": {"KHR_lights_punctual": {"lights": [{"type": "point", "name": "lamp", "intensity": 1}]}},
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "buffers": [{"byteLength": 36, "uri": format!("data:,{uri}")}],
    });
    let room = Room::new();
    room.write("s.gltf", gltf.to_string());
    let lights = lightopt_embree::import::gltf::load(&room.path("s.gltf")).unwrap().lights;
    assert_eq!((lights.len(), lights[0].name.as_str()), (n, "lamp"));
    assert_eq!(lights[n - 1].name, format!("lamp_{n}"));
}
