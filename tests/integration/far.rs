//! Scenes far from the origin, as in the coordinates of a map.

use glam::{DVec3, Vec3};
use lightopt_embree::{
    import::{self, builder, stage::StageOptions},
    light::Shape,
    scene::Scene,
};

use crate::room::{MTL, OBJ, Room, TOML};

/// Easting and northing of a map grid, metres; f32 resolves half a metre there.
const PLACE: DVec3 = DVec3::new(500_000.0, 0.0, 4_500_000.0);

/// The room with its vertices moved by `PLACE`, in units of `unit` metres.
fn moved_obj(unit: f64) -> String {
    let vertex = |line: &str| {
        let v: Vec<f64> = line[2..].split_whitespace().map(|v| v.parse().unwrap()).collect();
        let p = (DVec3::from_slice(&v) + PLACE) / unit;
        format!("v {:.6} {:.6} {:.6}", p.x, p.y, p.z)
    };
    let lines = OBJ.lines().map(|l| if l.starts_with("v ") { vertex(l) } else { l.to_owned() });
    lines.collect::<Vec<_>>().join("\n")
}

/// The room's sidecar with all points moved by `PLACE`.
fn moved_toml() -> String {
    let point = |line: &str| {
        let (key, value) = line.split_once(" = [")?;
        if !["position", "look_at"].contains(&key) {
            return None;
        }
        let v: Vec<f64> = value.trim_end_matches(']').split(", ").map(|v| v.parse().unwrap()).collect();
        let p = DVec3::from_slice(&v) + PLACE;
        Some(format!("{key} = [{:?}, {:?}, {:?}]", p.x, p.y, p.z))
    };
    TOML.lines().map(|l| point(l).unwrap_or_else(|| l.to_owned())).collect::<Vec<_>>().join("\n")
}

fn load(room: &Room) -> Scene {
    import::load(&room.path("room.obj")).unwrap().scene
}

fn center_of(shape: &Shape) -> Vec3 {
    match shape {
        Shape::Planar(l) => l.center,
        Shape::Sphere(l) => l.center,
        other => panic!("{other:?} is not of the room"),
    }
}

#[test]
fn a_far_room_is_the_room_at_the_origin() {
    let near = load(&Room::new());
    assert_eq!(near.origin, DVec3::ZERO);
    for unit in [1.0, 0.001] {
        let toml = moved_toml().replacen("schema = 1", &format!("schema = 1\nscale = {unit}"), 1);
        let far = load(&Room::with(&moved_obj(unit), MTL, &toml));
        assert!((far.origin - PLACE).length() < 4.0, "{}", far.origin);
        let shift = PLACE - far.origin;
        // Half a micrometre: the decimals of the file.
        let assert_moved = |a: Vec3, b: Vec3| {
            assert!((b.as_dvec3() - a.as_dvec3() - shift).length() < 1e-6, "{a} {b} {shift}");
        };
        assert_eq!(near.mesh.indices, far.mesh.indices);
        near.mesh.positions.iter().zip(&far.mesh.positions).for_each(|(a, b)| assert_moved(*a, *b));
        assert_moved(near.camera.position, far.camera.position);
        assert!((near.camera.forward() - far.camera.forward()).length() < 1e-5);
        for (a, b) in near.lights.iter().zip(&far.lights) {
            assert_moved(center_of(&a.shape), center_of(&b.shape));
        }
    }
}

#[test]
fn a_staged_far_room_is_written_in_the_coordinates_of_its_file() {
    let staged = |obj: &str| {
        let room = Room::with(obj, MTL, TOML);
        builder::stage(&room.path("room.obj"), &StageOptions::default()).unwrap()
    };
    let (near, far) = (staged(OBJ), staged(&moved_obj(1.0)));
    assert_eq!(near.summary, far.summary);
    let points = |text: &str| -> Vec<DVec3> {
        let values = text.lines().filter_map(|l| {
            let (key, value) = l.split_once(" = [")?;
            ["position", "look_at"].contains(&key).then_some(value)
        });
        let point = |v: &str| v.trim_end_matches(']').split(", ").map(|v| v.parse().unwrap()).collect();
        values
            .map(|v| {
                let v: Vec<f64> = point(v);
                DVec3::from_slice(&v)
            })
            .collect()
    };
    let (near_points, far_points) = (points(&near.text), points(&far.text));
    assert!(near_points.len() >= 6 && near_points.len() == far_points.len(), "{}", far.text);
    for (a, b) in near_points.iter().zip(&far_points) {
        assert!((*b - *a - PLACE).length() < 2e-3, "{a} {b}");
    }
    // What was written is read as what was staged.
    let room = Room::with(&moved_obj(1.0), MTL, &far.text);
    let scene = load(&room);
    assert!((scene.camera.position.as_dvec3() + scene.origin - far_points[0]).length() < 1e-5);
}

#[test]
fn an_export_says_where_its_origin_lies() {
    let room = Room::with(&moved_obj(1.0), MTL, &moved_toml());
    room.succeed(&["export", "--format", "mitsuba", "room.obj", "-o", "out"]);
    let xml = std::fs::read_to_string(room.path("out/scene.xml")).unwrap();
    let origin = load(&room).origin;
    let said = format!("Add ({}, {}, {})", origin.x, origin.y, origin.z);
    assert!(xml.contains(&said), "{xml}");
    let near = Room::new();
    near.succeed(&["export", "--format", "mitsuba", "room.obj", "-o", "out"]);
    assert!(!std::fs::read_to_string(near.path("out/scene.xml")).unwrap().contains("Add ("));
}
