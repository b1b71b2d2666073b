//! glTF 2.0 scenes.

use std::io::Cursor;

use glam::{Vec2, Vec3};
use lightopt_embree::film::image_file;
use lightopt_embree::import::{
    self, ImportError, gltf,
    imported::{Imported, Punctual},
};
use lightopt_embree::integrator::View;
use lightopt_embree::light::{Cone, Edge};
use lightopt_embree::lighting::Lighting;
use lightopt_embree::scene::{
    Scene,
    material::{MaterialParams, Model, Relief},
    mesh::face_normal,
};
use lightopt_embree::variables::Fitted;
use predicates::str::contains;
use serde_json::{Value, json};

use crate::room::Room;

const SIDECAR: &str = "schema = 1
[camera]
position = [0.0, 0.0, 3.0]
look_at = [0.0, 0.0, 0.0]
vfov = 50.0
size = [16, 12]
[main_object]
objects = [\"group\"]
[[lights]]
name = \"key\"
type = \"sphere\"
position = [1.0, 1.0, 2.0]
radius = 0.1
radiance = 50.0
";

/// Red, green / blue, white.
fn png() -> Vec<u8> {
    let pixels = [[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255], [255, 255, 255, 0]].concat();
    let image = image::RgbaImage::from_raw(2, 2, pixels).unwrap();
    let mut bytes = Cursor::new(Vec::new());
    image.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    bytes.into_inner()
}

/// Accessor 0: corners of the square [-1, 1]² from the lower left,
/// counter-clockwise; 1: texture coordinates, 2: indices. View 3 is [`png`].
fn bin() -> Vec<u8> {
    let floats = |values: &[f32]| values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
    let mut bytes = floats(&[-1., -1., 0., 1., -1., 0., 1., 1., 0., -1., 1., 0.]);
    bytes.extend(floats(&[0., 1., 1., 1., 1., 0., 0., 0.]));
    bytes.extend([0_u16, 1, 2, 0, 2, 3].iter().flat_map(|v| v.to_le_bytes()));
    bytes.extend(png());
    bytes
}

/// A square below a group, a camera three metres in front, and a light.
fn square() -> Value {
    json!({
        "asset": {"version": "2.0"},
        "extensionsUsed": ["KHR_lights_punctual"],
        "scene": 0,
        "scenes": [{"nodes": [0, 2, 3]}],
        "nodes": [
            {"name": "group", "children": [1]},
            {"name": "square", "mesh": 0},
            {"name": "eye", "camera": 0, "translation": [0, 0, 3]},
            {"extensions": {"KHR_lights_punctual": {"light": 0}}, "translation": [0, 1, 2]}
        ],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 0.9, "znear": 0.1, "aspectRatio": 2.0}}],
        "extensions": {"KHR_lights_punctual": {"lights": [{"type": "point", "name": "lamp", "intensity": 1366}]}},
        "meshes": [{"name": "plane", "primitives": [
            {"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 0}
        ]}],
        "materials": [{"pbrMetallicRoughness": {"metallicFactor": 0, "baseColorTexture": {"index": 0}}}],
        "textures": [{"source": 0}],
        "images": [{"bufferView": 3, "mimeType": "image/png"}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [-1, -1, 0], "max": [1, 1, 0]},
            {"bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC2"},
            {"bufferView": 2, "componentType": 5123, "count": 6, "type": "SCALAR"}
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": 48},
            {"buffer": 0, "byteOffset": 48, "byteLength": 32},
            {"buffer": 0, "byteOffset": 80, "byteLength": 12},
            {"buffer": 0, "byteOffset": 92, "byteLength": bin().len() - 92}
        ],
        "buffers": [{"byteLength": bin().len()}]
    })
}

/// [`square`] with some values replaced, given by JSON pointer.
fn square_with(changes: &[(&str, Value)]) -> Value {
    let mut json = square();
    for (pointer, value) in changes {
        let (parent, key) = pointer.rsplit_once('/').unwrap();
        match json.pointer_mut(parent).unwrap() {
            Value::Array(list) if key == "-" => list.push(value.clone()),
            Value::Array(list) => list[key.parse::<usize>().unwrap()] = value.clone(),
            object => object[key] = value.clone(),
        }
    }
    json
}

pub fn glb(json: &Value, bin: &[u8]) -> Vec<u8> {
    let mut text = json.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut bin = bin.to_vec();
    bin.resize(bin.len().next_multiple_of(4), 0);
    let word = |n: usize| u32::try_from(n).unwrap().to_le_bytes();
    let mut out = [b"glTF".as_slice(), &word(2), &word(28 + text.len() + bin.len())].concat();
    out.extend([&word(text.len()), b"JSON".as_slice(), &text].concat());
    out.extend([&word(bin.len()), b"BIN\0".as_slice(), &bin].concat());
    out
}

fn room_of(json: &Value) -> Room {
    let room = Room::new();
    room.write("s.glb", glb(json, &bin()));
    room
}

fn try_load(json: &Value) -> Result<Imported, ImportError> {
    gltf::load(&room_of(json).path("s.glb"))
}

fn load(changes: &[(&str, Value)]) -> Imported {
    try_load(&square_with(changes)).unwrap()
}

fn error(changes: &[(&str, Value)]) -> String {
    let text = try_load(&square_with(changes)).unwrap_err().to_string();
    assert_eq!(text.lines().count(), 1, "{text}");
    text.split_once("s.glb: ").unwrap_or_else(|| panic!("{text}")).1.to_owned()
}

fn color_at(scene: &Scene, x: f32, y: f32) -> [f32; 3] {
    let hit = scene.intersect(Vec3::new(x, y, 3.0), Vec3::NEG_Z).unwrap();
    scene.base_color(&hit, 1.0).to_array().map(f32::round)
}

#[test]
fn textures_are_the_right_way_up_in_all_ways_of_storing_them() {
    let room = room_of(&square());
    room.write("s.bin", bin());
    room.write("red green.png", png());
    let uri = |uri: &str| json!([{"uri": uri, "byteLength": bin().len()}]);
    let external =
        square_with(&[("/buffers", uri("s.bin")), ("/images", json!([{"uri": "red%20green.png"}]))]);
    room.write("external.gltf", external.to_string());
    use base64::{Engine as _, engine::general_purpose::STANDARD};
    let data = format!("data:application/octet-stream;base64,{}", STANDARD.encode(bin()));
    room.write("embedded.gltf", square_with(&[("/buffers", uri(&data))]).to_string());
    // Schemes are of any case; lines may be broken, and what follows a `#` is no data.
    let (head, tail) = data.split_at(100);
    let data = format!("{}\n {}#buffer", head.replace("data:", "DATA:"), tail.trim_end_matches('='));
    room.write("loose.gltf", square_with(&[("/buffers", uri(&data))]).to_string());
    for name in ["s.glb", "external.gltf", "embedded.gltf", "loose.gltf"] {
        let scene = import::load(&room.path(name)).unwrap().scene;
        let corners =
            [(-0.5, 0.5), (0.5, 0.5), (-0.5, -0.5), (0.5, -0.5)].map(|(x, y)| color_at(&scene, x, y));
        assert_eq!(corners, [[1., 0., 0.], [0., 1., 0.], [0., 0., 1.], [1., 1., 1.]], "{name}");
    }
}

#[test]
fn a_texture_transform_moves_the_image() {
    let transform = json!({"KHR_texture_transform": {"offset": [0.5, 0.0]}});
    let pointer = "/materials/0/pbrMetallicRoughness/baseColorTexture/extensions";
    let room = room_of(&square_with(&[(pointer, transform)]));
    let scene = import::load(&room.path("s.glb")).unwrap().scene;
    assert_eq!(color_at(&scene, -0.5, 0.5), [0., 1., 0.]);
}

#[test]
fn transformations_of_nodes_multiply_and_mirrors_keep_the_front() {
    let s = load(&[
        ("/nodes/0/scale", json!([-2, 1, 1])),
        ("/nodes/0/translation", json!([10, 0, 0])),
        ("/nodes/1/matrix", json!([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 1, 0, 5, 1])),
    ]);
    let of = |axis: fn(&Vec3) -> f32| {
        let values = s.mesh.positions.iter().map(axis);
        (values.clone().fold(f32::MAX, f32::min), values.fold(f32::MIN, f32::max))
    };
    assert_eq!((of(|p| p.x), of(|p| p.y), of(|p| p.z)), ((6.0, 10.0), (-1.0, 1.0), (5.0, 5.0)));
    for (t, indices) in s.mesh.indices.iter().enumerate() {
        assert!(face_normal(s.mesh.corners(t)).z > 0.0);
        assert!(indices.iter().all(|&i| s.mesh.normals[i as usize] == Vec3::Z));
    }
}

#[test]
fn strips_fans_and_lists_without_indices_cover_the_square_facing_front() {
    let indices = |list: &[u8]| {
        let mut json = square();
        json["accessors"][2] =
            json!({"bufferView": 4, "componentType": 5121, "count": list.len(), "type": "SCALAR"});
        json["bufferViews"].as_array_mut().unwrap().push(json!({"buffer": 1, "byteLength": list.len()}));
        let uri: String = list.iter().map(|i| format!("%{i:02x}")).collect();
        let buffer = json!({"byteLength": list.len(), "uri": format!("data:,{uri}")});
        json["buffers"].as_array_mut().unwrap().push(buffer);
        json
    };
    for (mode, list, n) in [(5, &[0_u8, 1, 3, 2][..], 2), (6, &[0, 1, 2, 3], 2), (4, &[2, 3, 0], 1)] {
        let mut json = indices(list);
        json["meshes"][0]["primitives"][0]["mode"] = json!(mode);
        let s = try_load(&json).unwrap();
        assert_eq!(s.mesh.indices.len(), n, "{mode}");
        assert!((0..n).all(|t| face_normal(s.mesh.corners(t)) == Vec3::Z * 4.0), "{mode}");
    }
    let mut json = square();
    json["meshes"][0]["primitives"][0].as_object_mut().unwrap().remove("indices");
    assert_eq!(try_load(&json).unwrap().mesh.indices.len(), 1);
    json["meshes"][0]["primitives"][0]["mode"] = json!(1);
    assert!(try_load(&json).unwrap_err().to_string().contains("no triangle"));
}

#[test]
fn quantised_and_sparse_accessors_are_read() {
    // Bytes 80.. are the indices 0 1 2 0 2 3.
    let sparse = json!({"count": 1, "indices": {"bufferView": 2, "byteOffset": 8, "componentType": 5123},
                        "values": {"bufferView": 1}});
    let s = load(&[("/accessors/0/sparse", sparse)]);
    assert!(s.mesh.positions.contains(&Vec3::new(0.0, 1.0, 1.0)), "{:?}", s.mesh.positions);
    let corners = "data:,%81%81%00%00%7f%81%00%00%7f%7f%00%00%81%7f%00%00";
    let s = load(&[
        (
            "/accessors/0",
            json!({"bufferView": 4, "componentType": 5120, "normalized": true, "count": 4, "type": "VEC3"}),
        ),
        ("/bufferViews/-", json!({"buffer": 1, "byteLength": 16, "byteStride": 4})),
        ("/buffers/-", json!({"byteLength": 16, "uri": corners})),
    ]);
    assert!(s.mesh.positions.iter().all(|p| p.abs() == Vec3::new(1.0, 1.0, 0.0)), "{:?}", s.mesh.positions);
}

#[test]
fn skins_and_morph_targets_take_their_default_pose() {
    // The target's deltas are the positions: weight 1 doubles the square.
    let s = load(&[
        ("/meshes/0/primitives/0/targets", json!([{"POSITION": 0}])),
        ("/meshes/0/weights", json!([1.0])),
    ]);
    assert!(s.mesh.positions.iter().all(|p| p.abs().truncate() == Vec2::splat(2.0)));
    // An animation that begins with other weights is not followed, and this is said.
    let said = |offset: u32| {
        let animation = json!({"name": "smile", "samplers": [{"input": 3, "output": 3}],
                               "channels": [{"sampler": 0, "target": {"node": 1, "path": "weights"}}]});
        let first = json!({"bufferView": 1, "byteOffset": offset, "componentType": 5126, "count": 1, "type": "SCALAR"});
        let imported = load(&[
            ("/meshes/0/primitives/0/targets", json!([{"POSITION": 0}])),
            ("/meshes/0/weights", json!([1.0])),
            ("/accessors/-", first),
            ("/animations", json!([animation])),
        ]);
        imported.warnings.join("; ").contains("animation `smile`: the weights of its shape keys")
    };
    // View 1 begins with the numbers 0 and 1.
    assert!(said(0) && !said(4));
    // All corners hang on joint 1, one metre up; the node itself does not count.
    let view = |n: usize| json!({"buffer": 1, "byteOffset": 4 * n, "byteLength": 4});
    let s = load(&[
        ("/nodes/1/skin", json!(0)),
        ("/nodes/1/translation", json!([7, 7, 7])),
        ("/nodes/-", json!({"translation": [0, 1, 0]})),
        ("/scenes/0/nodes", json!([0, 2, 3, 4])),
        ("/skins", json!([{"joints": [2, 4]}])),
        ("/buffers/-", json!({"byteLength": 8, "uri": "data:,%01%01%01%01%ff%00%00%00"})),
        ("/bufferViews/-", view(0)),
        ("/bufferViews/-", view(1)),
        (
            "/accessors/-",
            json!({"count": 4, "type": "VEC4", "componentType": 5121,
                   "sparse": {"count": 4, "indices": {"bufferView": 6, "componentType": 5121}, "values": {"bufferView": 7}}}),
        ),
        (
            "/accessors/-",
            json!({"count": 4, "type": "VEC4", "componentType": 5121, "normalized": true,
                   "sparse": {"count": 4, "indices": {"bufferView": 6, "componentType": 5121}, "values": {"bufferView": 8}}}),
        ),
        (
            "/buffers/-",
            json!({"byteLength": 36, "uri": format!("data:,%00%01%02%03{}{}", "%01%00%00%00".repeat(4), "%ff%00%00%00".repeat(4))}),
        ),
        ("/bufferViews/-", json!({"buffer": 2, "byteLength": 4})),
        ("/bufferViews/-", json!({"buffer": 2, "byteOffset": 4, "byteLength": 16})),
        ("/bufferViews/-", json!({"buffer": 2, "byteOffset": 20, "byteLength": 16})),
        ("/meshes/0/primitives/0/attributes/JOINTS_0", json!(3)),
        ("/meshes/0/primitives/0/attributes/WEIGHTS_0", json!(4)),
    ]);
    assert!(
        s.mesh.positions.iter().all(|p| p.x.abs() == 1.0 && (p.y == 0.0 || p.y == 2.0)),
        "{:?}",
        s.mesh.positions
    );
}

#[test]
fn cameras_and_lights_of_the_file_are_used() {
    let spot = json!({"type": "spot", "name": "lamp", "color": [1, 0.5, 0], "intensity": 683, "spot": {"innerConeAngle": 0.2, "outerConeAngle": 0.4}});
    let s = load(&[
        ("/extensions/KHR_lights_punctual/lights/-", spot),
        ("/extensions/KHR_lights_punctual/lights/-", json!({"type": "directional"})),
        ("/nodes/0/extensions", json!({"KHR_lights_punctual": {"light": 1}})),
        ("/nodes/0/rotation", json!([-1, 0, 0, 1])),
        ("/nodes/1/extensions", json!({"KHR_lights_punctual": {"light": 2}})),
        ("/nodes/1/camera", json!(0)),
    ]);
    let camera = s.camera.unwrap();
    assert_eq!((camera.look_at - camera.position).y.round(), -1.0, "the first camera is that of node 1");
    assert_eq!(camera.aspect, Some(2.0));
    assert!((camera.vfov - 0.9_f32.to_degrees()).abs() < 1e-4);
    let names: Vec<&str> = s.cameras.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, ["square", "eye"]);
    let names: Vec<&str> = s.lights.iter().map(|l| l.name.as_str()).collect();
    assert_eq!(names, ["lamp", "square", "lamp_2"]);
    let cone = Cone { cos_inner: 0.2_f32.cos(), cos_outer: 0.4_f32.cos(), edge: Edge::Squared };
    assert_eq!(s.lights[0].kind, Punctual::Spot(cone));
    assert_eq!((s.lights[0].intensity, s.lights[0].color.to_array()), (1.0, [1.0, 0.5, 0.0]));
    assert!((s.lights[0].direction - Vec3::NEG_Y).length() < 1e-6);
    assert_eq!(s.lights[1].kind, Punctual::Directional);
    assert_eq!((s.lights[2].kind, s.lights[2].intensity), (Punctual::Point, 2.0));
    assert_eq!(s.lights[2].position, Vec3::new(0.0, 1.0, 2.0));
}

#[test]
fn a_sidecar_is_optional_with_a_camera_and_wins_where_it_speaks() {
    let room = room_of(&square());
    let loaded = import::load(&room.path("s.glb")).unwrap();
    let scene = &loaded.scene;
    assert!(scene.is_main.iter().all(|m| *m));
    assert_eq!(scene.camera.size().to_array(), [640, 320]);
    assert_eq!(scene.lights.len(), 1);
    assert_eq!((scene.lights[0].name.as_str(), scene.lights[0].radiance), ("lamp", 2.0));
    assert!(loaded.constraints.lights[0].free.contains("radiance"));
    let view = View { scene, camera: &scene.camera };
    let fitted = Fitted::new(view, &Lighting::authored(scene), &loaded.constraints).unwrap();
    assert_eq!(fitted.sizes, [None], "a point has no size that could be free");
    let assert = room.command(&["render", "s", "--spp", "1", "--size", "8x4", "-o", "a.png"]).assert();
    assert.code(0).stderr(contains("s.glb: main object: everything, found from its geometry").count(1));

    room.write("s.toml", SIDECAR);
    let scene = import::load(&room.path("s.glb")).unwrap().scene;
    assert_eq!(scene.camera.size().to_array(), [16, 12]);
    assert_eq!(scene.light_names(), ["lamp", "key"]);
    room.write("s.toml", SIDECAR.replace("\"key\"", "\"lamp\""));
    let loaded = import::load(&room.path("s.glb")).unwrap();
    assert_eq!((loaded.scene.lights.len(), loaded.scene.lights[0].radiance), (1, 50.0));
    // Of another kind it is replaced as a whole.
    room.write(
        "s.toml",
        SIDECAR
            .replace("\"key\"", "\"lamp\"")
            .replace("sphere", "distant")
            .replace("radius = 0.1", "look_at = [0, 0, 0]"),
    );
    let warnings = import::load(&room.path("s.glb")).unwrap().warnings;
    assert!(warnings.iter().any(|w| w.ends_with("light `lamp` is replaced by that of the sidecar")));
}

#[test]
fn without_camera_or_lights_a_gltf_is_staged() {
    let mut json = square();
    json["nodes"][2].as_object_mut().unwrap().remove("camera");
    let room = room_of(&json);
    let loaded = import::load(&room.path("s.glb")).unwrap();
    let own = import::load(&room_of(&square()).path("s.glb")).unwrap();
    assert!(own.staging.is_none());
    let staging = loaded.staging.unwrap();
    assert!(staging.contains("[camera]") && !staging.contains("scale"), "{staging}");
    // Its own lights stay.
    assert_eq!(loaded.scene.lights.len(), own.scene.lights.len());
    assert!(!staging.contains("[[lights]]"), "{staging}");
    room.write("s.toml", "schema = 1\n");
    let error = room.fail_at_once(&["render", "s.glb", "-o", "a.png"]);
    assert!(
        error.contains("s.toml: `camera`: is missing, and s.glb has no camera; give `position`"),
        "{error}"
    );
    room.write("s.toml", "schema = 1\nscale = 2\n");
    let error = room.fail_at_once(&["render", "s.glb", "-o", "a.png"]);
    assert!(error.contains("s.toml: `scale`: only for an OBJ: a glTF is in metres, y up"), "{error}");
}

#[test]
fn names_of_nodes_their_ancestors_and_meshes_select_the_main_object() {
    let second = json!({"name": "other", "mesh": 0, "translation": [0, 0, -1]});
    let room = room_of(&square_with(&[("/nodes/-", second), ("/scenes/0/nodes/-", json!(4))]));
    let main = |name: &str| {
        room.write("s.toml", SIDECAR.replace("\"group\"", &format!("{name:?}")));
        import::load(&room.path("s.glb")).map(|loaded| loaded.scene.is_main)
    };
    for name in ["group", "square", "s*"] {
        assert_eq!(main(name).unwrap(), [true, true, false, false], "{name}");
    }
    assert_eq!(main("other").unwrap(), [false, false, true, true]);
    assert_eq!(main("plane").unwrap(), [true; 4]);
    let error = main("gruop").unwrap_err().to_string();
    assert!(error.contains("did you mean `group`?"), "{error}");
}

fn material(json: Value) -> MaterialParams {
    load(&[("/materials/0", json)]).materials.remove(0).1
}

#[test]
fn materials_are_mapped_as_documented() {
    let texture = json!({"index": 0});
    let m = material(
        json!({"pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.25, 1, 0.5], "roughnessFactor": 0.3}}),
    );
    assert_eq!((m.model, m.roughness, m.opacity, m.metallic), (Model::Conductor, 0.3, 1.0, 0.0));
    assert_eq!(m.base_color.to_array(), [0.5, 0.25, 1.0]);

    let m = material(
        json!({"pbrMetallicRoughness": {"metallicRoughnessTexture": texture}, "normalTexture": {"index": 0, "scale": 0.5}}),
    );
    assert_eq!((m.model, m.metallic, m.roughness, m.ior), (Model::Plastic, 1.0, 1.0, 1.5));
    // The lower left pixel is blue: metal, and not rough.
    let at = Vec2::new(0.25, 0.25);
    assert_eq!((m.metallic_map.unwrap().sample(at), m.roughness_map.unwrap().sample(at)), (1.0, 0.0));
    assert!(matches!(m.relief, Some(Relief::NormalMap { scale: 0.5, .. })));

    let extensions = json!({"KHR_materials_ior": {"ior": 1.3}, "KHR_materials_specular": {"specularFactor": 0.5, "specularTexture": texture}});
    let m = material(json!({"pbrMetallicRoughness": {"metallicFactor": 0}, "extensions": extensions}));
    assert_eq!((m.model, m.ior, m.specular), (Model::Plastic, 1.3, 0.5));
    assert_eq!(m.specular_map.unwrap().sample(Vec2::new(0.75, 0.25)), 0.0);

    let m = material(
        json!({"pbrMetallicRoughness": {"roughnessFactor": 0.1}, "extensions": {"KHR_materials_transmission": {"transmissionFactor": 1}}}),
    );
    // A thin sheet, unless it says what is below it.
    assert_eq!((m.model, m.roughness), (Model::Thin, 0.1));
    let glass = |thickness: f32| {
        let extensions = json!({"KHR_materials_transmission": {"transmissionFactor": 1}, "KHR_materials_volume": {"thicknessFactor": thickness}});
        material(json!({"extensions": extensions})).model
    };
    assert_eq!([glass(0.1), glass(0.0)], [Model::Dielectric, Model::Thin]);

    let m = material(
        json!({"emissiveFactor": [1, 0.5, 0], "doubleSided": true, "emissiveTexture": texture, "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 4}}}),
    );
    assert_eq!((m.emission.to_array(), m.emission_two_sided), ([4.0, 2.0, 0.0], true));
    assert!(m.emission_texture.is_some());
}

/// What is said of the square's material, without its name.
fn said_of_material(json: Value) -> Vec<String> {
    let warnings = load(&[("/materials/0", json)]).warnings;
    warnings.iter().filter_map(|w| w.strip_prefix("material `material_0`: ").map(str::to_owned)).collect()
}

#[test]
fn factors_outside_their_range_are_cut_and_said() {
    let pbr = json!({"baseColorFactor": [2, -1, 0.5, 3], "roughnessFactor": 7, "metallicFactor": -1});
    let m = material(json!({"pbrMetallicRoughness": pbr}));
    assert_eq!((m.base_color.to_array(), m.roughness, m.metallic), ([1.0, 0.0, 0.5], 1.0, 0.0));
    assert_eq!(
        said_of_material(json!({"pbrMetallicRoughness": pbr})),
        [
            "`baseColorFactor` [2, -1, 0.5] is not in [0, 1]: [1, 0, 0.5] is taken",
            "`roughnessFactor` 7 is not in [0, 1]: 1 is taken",
            "`metallicFactor` -1 is not in [0, 1]: 0 is taken",
            "`alpha of baseColorFactor` 3 is not in [0, 1]: 1 is taken",
        ]
    );
    let with = |extensions: Value| said_of_material(json!({"extensions": extensions}));
    for (ior, taken, said) in [
        (0.0, 4.0, Some("its ior 0, which reflects everything, is taken as 4")),
        (0.5, 1.001, Some("`ior` 0.5 is not in [1, 4]: 1 is taken")),
        (9.0, 4.0, Some("`ior` 9 is not in [1, 4]: 4 is taken")),
        (1.0, 1.001, None),
        (2.42, 2.42, None),
    ] {
        let extensions = json!({"KHR_materials_ior": {"ior": ior}});
        assert_eq!(material(json!({"extensions": extensions})).ior, taken, "{ior}");
        assert_eq!(with(extensions), said.into_iter().collect::<Vec<_>>(), "{ior}");
    }
    assert_eq!(
        with(json!({"KHR_materials_specular": {"specularFactor": 2}})),
        ["`specularFactor` 2 is not in [0, 1]: 1 is taken"]
    );
    assert_eq!(
        with(json!({"KHR_materials_transmission": {"transmissionFactor": 3}})),
        ["`transmissionFactor` 3 is not in [0, 1]: 1 is taken"]
    );
    assert_eq!(
        said_of_material(json!({"emissiveFactor": [-1, 2, 0]})),
        ["`emissiveFactor` [-1, 2, 0] is not at least 0: [0, 2, 0] is taken"]
    );
    assert_eq!(
        said_of_material(
            json!({"emissiveFactor": [1, 1, 1], "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": -4}}})
        ),
        ["`emissiveStrength` -4 is not at least 0: 0 is taken"]
    );
    assert_eq!(
        said_of_material(json!({"alphaMode": "MASK", "alphaCutoff": -3})),
        ["`alphaCutoff` -3 is not at least 0: 0 is taken"]
    );
    let lamp = json!({"type": "spot", "name": "lamp", "intensity": 1, "spot": {"innerConeAngle": -1, "outerConeAngle": 3}});
    let warnings = load(&[("/extensions/KHR_lights_punctual/lights/0", lamp)]).warnings;
    for wanted in [
        "light `lamp`: `outerConeAngle` 3 is not in [0.001, 1.5707964]: 1.5707964 is taken",
        "light `lamp`: `innerConeAngle` -1 is not in [0, 1.5707964]: 0 is taken",
    ] {
        assert!(warnings.iter().any(|w| w == wanted), "{warnings:?}");
    }
}

#[test]
fn of_a_volume_only_what_is_not_followed_is_said_to_be_ignored() {
    let said = |transmission: f32, volume: Value| {
        said_of_material(
            json!({"extensions": {"KHR_materials_transmission": {"transmissionFactor": transmission}, "KHR_materials_volume": volume}}),
        )
    };
    let none: [&str; 0] = [];
    assert_eq!(said(1.0, json!({"thicknessFactor": 1})), none);
    assert_eq!(
        said(1.0, json!({"thicknessFactor": 1, "attenuationColor": [1, 1, 1], "attenuationDistance": 2})),
        none
    );
    // Without a distance light is never attenuated, and neither is it in a sheet.
    let red = json!([1, 0.1, 0.1]);
    assert_eq!(said(1.0, json!({"thicknessFactor": 1, "attenuationColor": red})), none);
    assert_eq!(said(1.0, json!({"attenuationColor": red, "attenuationDistance": 2})), none);
    assert_eq!(
        said(1.0, json!({"thicknessFactor": 1, "attenuationColor": red, "attenuationDistance": 2})),
        ["the attenuation of its KHR_materials_volume is ignored; it is solid and refracts"]
    );
    assert_eq!(
        said(0.0, json!({"thicknessFactor": 1})),
        ["its KHR_materials_volume is ignored: it is not glass"]
    );
}

#[test]
fn alpha_is_read_as_its_mode_says() {
    let with = |mode: &str| {
        let pbr = json!({"baseColorFactor": [1, 1, 1, 0.75], "baseColorTexture": {"index": 0}});
        material(json!({"pbrMetallicRoughness": pbr, "alphaMode": mode}))
    };
    let m = with("OPAQUE");
    assert!(m.opacity == 1.0 && m.opacity_map.is_none() && m.opacity_cutoff.is_none());
    let m = with("MASK");
    assert_eq!((m.opacity, m.opacity_cutoff), (0.75, Some(0.5)));
    assert_eq!(m.opacity_map.unwrap().sample(Vec2::new(0.75, 0.25)), 0.0);
    let m = with("BLEND");
    assert!(m.opacity == 0.75 && m.opacity_map.is_some() && m.opacity_cutoff.is_none());
    assert_eq!(
        error(&[("/materials/0/alphaMode", json!("SOLID"))]),
        "`materials[0].alphaMode`: must be OPAQUE, MASK or BLEND"
    );
}

#[test]
fn materials_have_unique_names_and_what_has_none_is_grey() {
    let primitive = |m: Value| json!({"attributes": {"POSITION": 0}, "material": m});
    let mut bare = primitive(json!(0));
    bare.as_object_mut().unwrap().remove("material");
    let s = load(&[
        ("/materials", json!([{"name": "a"}, {}, {"name": "a"}])),
        (
            "/meshes/0/primitives",
            json!([primitive(json!(0)), primitive(json!(1)), primitive(json!(2)), bare]),
        ),
    ]);
    let names: Vec<&str> = s.materials.iter().map(|(n, _)| n.as_str()).collect();
    assert_eq!(names, ["a", "material_1", "a_2", "(none)"]);
    let grey = &s.materials[3].1;
    assert_eq!((grey.model, grey.base_color.to_array()), (Model::Diffuse, [0.8; 3]));
}

#[test]
fn what_cannot_be_read_is_refused_in_one_line_that_says_where() {
    for (extension, advice) in [
        ("KHR_draco_mesh_compression", "; export it again without mesh compression"),
        ("EXT_meshopt_compression", "; export it again without mesh compression"),
        ("KHR_texture_basisu", "; export it again with PNG, JPEG or WebP textures"),
        ("ACME_gizmo", ""),
    ] {
        let room = room_of(&square_with(&[("/extensionsRequired", json!([extension]))]));
        let error = room.fail_at_once(&["render", "s.glb", "-o", "a.png"]);
        let wanted =
            format!("s.glb: requires the extension {extension}, which this program does not read{advice}");
        assert!(error.ends_with(&wanted), "{error}");
    }
    for (pointer, value, wanted) in [
        ("/asset/version", json!("1.0"), "is glTF 1.0; this program reads glTF 2.0"),
        ("/nodes/1/mesh", json!(7), "`nodes[1].mesh`: points to number 7, which does not exist"),
        ("/nodes/1/children", json!([0]), "`nodes[1].children`: node 0 stands in the tree twice"),
        (
            "/accessors/0/count",
            json!(5),
            "`accessors[0]`: 5 elements of 12 bytes, 12 apart from byte 0, do not fit into the 48 bytes of bufferViews[0]",
        ),
        (
            "/accessors/0/type",
            json!("VEC2"),
            "`accessors[0]`: must have 3 components where it is used, it has 2",
        ),
        (
            "/accessors/1/count",
            json!(3),
            "`meshes[0].primitives[0].attributes.TEXCOORD`: must have one element a vertex, 4; it has 3",
        ),
        (
            "/accessors/2/bufferView",
            json!(0),
            "`meshes[0].primitives[0].indices`: vertex 49024 does not exist: there are 4, from 0",
        ),
        ("/bufferViews/0/byteLength", json!(4000), "`bufferViews[0]`: 4000 bytes from 0 do not fit"),
        ("/buffers/0/byteLength", json!(4000), "`buffers[0]`: must hold 4000 bytes, its data has"),
        ("/buffers/0/uri", json!("no.bin"), "`buffers[0]`: cannot read "),
        ("/buffers/0/uri", json!("data:;base64"), "`buffers[0]`: its data URI has no data"),
        ("/buffers/0/uri", json!("data:;base64,A*"), "`buffers[0]`: its data URI is not base64: "),
        (
            "/buffers/0/uri",
            json!("https://a.b/c.bin"),
            "`buffers[0]`: must be a file beside the scene or a data URI",
        ),
        ("/images/0/bufferView", json!(0), "`images[0]`: cannot be decoded: "),
        ("/meshes/0/primitives", json!(7), "cannot be understood as glTF: invalid type"),
    ] {
        let error = error(&[(pointer, value)]);
        assert!(error.starts_with(wanted), "{pointer}: {error}");
    }
    let room = room_of(&square_with(&[("/images/0", json!({"uri": "no.png"}))]));
    let error = room.fail_at_once(&["render", "s.glb", "-o", "a.png"]);
    assert!(error.contains("no.png: cannot read the texture (`pbrMetallicRoughness.baseColorTexture` of material `material_0`)"), "{error}");
}

#[test]
fn a_file_cut_anywhere_is_an_error() {
    let whole = glb(&square(), &bin());
    let room = Room::new();
    for n in (0..whole.len()).step_by(7) {
        room.write("s.glb", &whole[..n]);
        let error = gltf::load(&room.path("s.glb")).unwrap_err().to_string();
        assert!(error.contains("s.glb: ") && error.lines().count() == 1, "{n}: {error}");
    }
    room.write("s.glb", &whole[..whole.len() - 4]);
    let error = room.fail_at_once(&["render", "s.glb", "-o", "a.png"]);
    assert!(error.contains("s.glb: is cut short: its header says"), "{error}");
}

#[test]
fn degenerate_triangles_are_left_out_and_counted() {
    let with_corner = |corner: [f32; 3]| {
        let mut bytes = bin();
        bytes[12..24].copy_from_slice(&corner.map(f32::to_le_bytes).concat());
        let room = Room::new();
        room.write("s.glb", glb(&square(), &bytes));
        room
    };
    // The second corner, which is that of the first triangle alone.
    for corner in
        [[f32::NAN, 0., 0.], [0., f32::INFINITY, 0.], [1e30, 0., 0.], [1e19, -1., 0.], [-1., -1., 0.]]
    {
        let room = with_corner(corner);
        let s = gltf::load(&room.path("s.glb")).unwrap();
        assert_eq!(s.mesh.indices.len(), 1, "{corner:?}");
        let wanted = match corner {
            [-1., -1., 0.] => "s.glb: left out 1 degenerate triangle",
            _ => {
                "s.glb: left out 1 triangle with vertices out of range, the first `meshes[0].primitives[0]`: \
                 coordinates must be finite and at most 1.844e18 in magnitude"
            }
        };
        assert!(s.warnings.iter().any(|w| w.ends_with(wanted)), "{corner:?}: {:?}", s.warnings);
        room.succeed(&["render", "s.glb", "--size", "16x12", "--spp", "4", "-o", "a.exr"]);
        let picture = image_file::read_image(&room.path("a.exr")).unwrap();
        assert!(picture.rgb.iter().flatten().all(|v| v.is_finite()), "{corner:?}");
    }
    let mut bytes = bin();
    for v in bytes[..48].chunks_exact_mut(4) {
        let tiny = f32::from_le_bytes(v.try_into().unwrap()) * 1e-30;
        v.copy_from_slice(&tiny.to_le_bytes());
    }
    let room = Room::new();
    room.write("s.glb", glb(&square(), &bytes));
    let error = room.fail_at_once(&["render", "s.glb", "-o", "a.png"]);
    assert!(error.ends_with("s.glb: no triangle in this file but for 2 that are degenerate"), "{error}");
}

#[test]
fn no_number_of_a_file_makes_it_panic() {
    fn numbers(json: &Value, at: &str, out: &mut Vec<String>) {
        match json {
            Value::Object(map) => map.iter().for_each(|(k, v)| numbers(v, &format!("{at}/{k}"), out)),
            Value::Array(list) => {
                list.iter().enumerate().for_each(|(i, v)| numbers(v, &format!("{at}/{i}"), out))
            }
            Value::Number(_) => out.push(at.to_owned()),
            _ => {}
        }
    }
    let json = square();
    let mut pointers = Vec::new();
    numbers(&json, "", &mut pointers);
    let room = Room::new();
    for pointer in &pointers {
        for value in [json!(0), json!(1), json!(-1), json!(3), json!(u32::MAX), json!(u64::MAX), json!(1e30)]
        {
            let mut json = json.clone();
            *json.pointer_mut(pointer).unwrap() = value;
            room.write("s.glb", glb(&json, &bin()));
            if let Err(e) = gltf::load(&room.path("s.glb")) {
                assert_eq!(e.to_string().lines().count(), 1, "{pointer}: {e}");
            }
        }
    }
}

#[test]
fn nodes_far_from_the_origin_keep_their_shape() {
    let at = |x: f64, y: f64, z: f64| json!([500_000.25 + x, y, 4_500_000.125 + z]);
    let s = load(&[
        ("/nodes/0/translation", at(0.0, 0.0, 0.0)),
        ("/nodes/2/translation", at(0.0, 0.0, 3.0)),
        ("/nodes/3/translation", at(0.0, 1.0, 2.0)),
    ]);
    let near = load(&[]);
    assert_eq!(near.origin, glam::DVec3::ZERO);
    let shift = glam::DVec3::new(500_000.25, 0.0, 4_500_000.125) - s.origin;
    assert!(shift.length() < 4.0, "{}", s.origin);
    let shift = shift.as_vec3();
    for (a, b) in near.mesh.positions.iter().zip(&s.mesh.positions) {
        assert!((*b - *a - shift).length() < 1e-6, "{a} {b}");
    }
    assert!((s.camera.unwrap().position - near.camera.unwrap().position - shift).length() < 1e-6);
    assert!((s.lights[0].position - near.lights[0].position - shift).length() < 1e-6);
    // Two large translations that cancel.
    let s = load(&[
        ("/nodes/0/translation", at(0.0, 0.0, 0.0)),
        ("/nodes/1/translation", json!([-500_000.25, 0.0, -4_500_000.125])),
    ]);
    assert_eq!((s.origin, s.mesh.positions), (glam::DVec3::ZERO, near.mesh.positions));
}
