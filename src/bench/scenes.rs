//! Scenes that are generated: a bare Cornell box, a caustic, and a still life.
//!
//! They are small programs instead of files of megabytes; the same program writes the same bytes.

mod shapes;

use std::{
    fs,
    path::{Path, PathBuf},
};

use glam::Vec3;

use super::BenchError;
use shapes::Shapes;

/// A generated scene.
struct Generated {
    name: &'static str,
    /// Geometry, by objects with their materials.
    shapes: Shapes,
    /// Materials, as MTL.
    materials: &'static str,
    /// Camera, main object and lights, as a sidecar.
    sidecar: &'static str,
}

/// Names of the scenes that [`write()`] writes.
pub const NAMES: [&str; 3] = ["still_life", "caustic_ring", "cornell_box"];

/// Writes the scene of this name into a directory, and returns the path of its OBJ; `None` for another name.
///
/// # Errors
/// When a file cannot be written.
pub fn write(name: &str, directory: &Path) -> Result<Option<PathBuf>, BenchError> {
    let scene = match name {
        "still_life" => still_life(),
        "caustic_ring" => caustic_ring(),
        "cornell_box" => cornell_box(),
        _ => return Ok(None),
    };
    let obj = format!("mtllib {}.mtl\n{}", scene.name, scene.shapes.obj());
    for (ending, text) in [("obj", obj.as_str()), ("mtl", scene.materials), ("toml", scene.sidecar)] {
        put(&directory.join(scene.name).with_extension(ending), text)?;
    }
    Ok(Some(directory.join(scene.name).with_extension("obj")))
}

fn put(path: &Path, text: &str) -> Result<(), BenchError> {
    fs::write(path, text).map_err(|source| BenchError::File {
        path: path.to_owned(),
        action: "write",
        source,
    })
}

/// Colours of rooms.
const ROOM: &str = "newmtl white\nKd 0.73 0.73 0.73\nillum 1\n\
                    newmtl red\nKd 0.6 0.06 0.06\nillum 1\n\
                    newmtl green\nKd 0.12 0.45 0.1\nillum 1\n";

/// A room of 2 m that is open toward the camera.
fn room(shapes: &mut Shapes) {
    let (x, y, z) = (Vec3::X, Vec3::Y, Vec3::Z);
    shapes.object("floor", "white").quad(-x - z, 2.0 * z, 2.0 * x);
    shapes.object("ceiling", "white").quad(2.0 * y - x - z, 2.0 * x, 2.0 * z);
    shapes.object("wall", "white").quad(-x - z, 2.0 * x, 2.0 * y);
    shapes.object("left", "red").quad(-x - z, 2.0 * y, 2.0 * z);
    shapes.object("right", "green").quad(x - z, 2.0 * z, 2.0 * y);
}

/// One rectangle in a room of diffuse walls with two boxes.
fn cornell_box() -> Generated {
    let mut shapes = Shapes::default();
    room(&mut shapes);
    let boxes = shapes.object("boxes", "white");
    boxes.turned_box(Vec3::new(-0.35, 0.0, -0.35), Vec3::new(0.3, 1.2, 0.3), 0.3);
    boxes.turned_box(Vec3::new(0.35, 0.0, 0.25), Vec3::new(0.3, 0.6, 0.3), -0.3);
    let sidecar = r#"schema = 1
[camera]
position = [0.0, 1.0, 3.9]
look_at = [0.0, 1.0, 0.0]
vfov = 38.0
size = [640, 480]
[main_object]
objects = ["boxes"]
[[lights]]
name = "ceiling"
type = "rectangle"
position = [0.0, 1.98, 0.0]
look_at = [0.0, 0.0, 0.0]
up = [0.0, 0.0, 1.0]
half_extents = [0.25, 0.2]
radiance = 14.0
color = [1.0, 0.85, 0.6]
"#;
    Generated { name: "cornell_box", shapes, materials: ROOM, sidecar }
}

/// What a ring of rough metal throws on the table, lit by one sphere.
fn caustic_ring() -> Generated {
    let mut shapes = Shapes::default();
    shapes.object("table", "table").quad(Vec3::new(-3.0, 0.0, -3.0), Vec3::Z * 6.0, Vec3::X * 6.0);
    shapes.object("wall", "table").quad(Vec3::new(-3.0, 0.0, -1.6), Vec3::X * 6.0, Vec3::Y * 3.0);
    // A band with a rounded cross-section: an inner and an outer side.
    let profile: Vec<[f32; 2]> = (0..=24)
        .map(|i| {
            let angle = std::f32::consts::TAU * i as f32 / 24.0;
            [0.62 + 0.03 * angle.cos(), 0.14 - 0.14 * angle.sin()]
        })
        .collect();
    shapes.object("ring", "metal").lathe(Vec3::new(0.0, 0.0, 0.1), &profile, 160);
    let sidecar = r#"schema = 1
[camera]
position = [0.0, 1.9, 2.6]
look_at = [0.0, 0.05, 0.1]
vfov = 36.0
size = [640, 480]
[main_object]
objects = ["ring"]
[background]
materials = ["table"]
[[lights]]
name = "bulb"
type = "sphere"
position = [1.1, 1.0, 0.9]
radius = 0.08
radiance = 60.0
"#;
    let materials = "newmtl table\nKd 0.55 0.52 0.48\nillum 1\n\
                     newmtl metal\nKd 0.92 0.75 0.45\nPm 1\nPr 0.2\nillum 2\n";
    Generated { name: "caustic_ring", shapes, materials, sidecar }
}

/// A vase, a bowl with balls and a plate before a cloth, some 130,000 triangles, lit by three lights.
fn still_life() -> Generated {
    let mut shapes = Shapes::default();
    // Table and backdrop are one sheet that is bent upward.
    let bend = |i: usize| {
        let t = i as f32 / 60.0;
        let along = 2.4 - 4.8 * t;
        Vec3::new(0.0, 1.8 * (-along - 0.4).max(0.0).powi(2) / (0.3 - along).max(0.3), along)
    };
    shapes.object("cloth", "cloth").sheet(60, 80, |i, j| bend(i) + Vec3::X * (-2.4 + 4.8 * j as f32 / 80.0));
    let vase: Vec<[f32; 2]> = (0..=140)
        .map(|i| {
            let t = i as f32 / 140.0;
            [0.11 + 0.07 * (5.2 * t + 0.4).sin() - 0.04 * t, 0.62 * t]
        })
        .collect();
    shapes.object("vase", "glaze").lathe(Vec3::new(-0.38, 0.0, -0.1), &vase, 180);
    let bowl: Vec<[f32; 2]> = (0..=80)
        .map(|i| {
            let t = i as f32 / 80.0;
            [0.06 + 0.24 * t, 0.2 * t * t]
        })
        .collect();
    shapes.object("bowl", "metal").lathe(Vec3::new(0.25, 0.0, 0.05), &bowl, 160);
    let balls = [(0.18, 0.15, 0.0), (0.32, 0.16, 0.1), (0.25, 0.15, 0.2), (0.26, 0.29, 0.08)];
    for (i, (x, y, z)) in balls.into_iter().enumerate() {
        let material = ["orange", "plum"][i % 2];
        shapes.object("fruit", material).sphere(Vec3::new(x, y, z), 0.085, 45);
    }
    for (i, (x, z)) in [(-0.1, 0.42), (0.62, 0.4)].into_iter().enumerate() {
        shapes.object("fruit", ["plum", "orange"][i]).sphere(Vec3::new(x, 0.085, z), 0.085, 45);
    }
    let materials = "newmtl cloth\nKd 0.55 0.53 0.5\nillum 1\n\
                     newmtl glaze\nKd 0.15 0.3 0.5\nKs 0.04 0.04 0.04\nNi 1.5\nPr 0\nillum 2\n\
                     newmtl metal\nKd 0.85 0.8 0.72\nPm 1\nPr 0.3\nillum 2\n\
                     newmtl orange\nKd 0.8 0.35 0.06\nKs 0.04 0.04 0.04\nNi 1.5\nPr 0.3\nillum 2\n\
                     newmtl plum\nKd 0.25 0.08 0.2\nillum 1\n";
    Generated { name: "still_life", shapes, materials, sidecar: STILL_LIFE }
}

/// Sidecar of the still life.
const STILL_LIFE: &str = r#"schema = 1
[camera]
position = [0.1, 0.75, 2.3]
look_at = [0.05, 0.2, 0.0]
vfov = 30.0
size = [640, 480]
[main_object]
objects = ["vase", "bowl", "fruit"]
[background]
materials = ["cloth"]
[[lights]]
name = "key"
type = "rectangle"
position = [-1.3, 1.5, 1.0]
look_at = [0.0, 0.1, 0.0]
half_extents = [0.35, 0.25]
radiance = 12.0
color = [1.0, 0.95, 0.88]
[[lights]]
name = "fill"
type = "disk"
position = [1.6, 1.2, 1.4]
look_at = [0.1, 0.1, 0.0]
radius = 0.3
radiance = 4.0
[[lights]]
name = "rim"
type = "sphere"
position = [0.9, 1.0, -0.7]
radius = 0.07
radiance = 40.0
color = [0.8, 0.9, 1.0]
"#;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import;

    #[test]
    fn generated_scenes_load_with_the_lights_that_they_promise() {
        let directory = tempfile::tempdir().unwrap();
        for (name, lights, triangles) in [
            ("still_life", 3, 100_000..160_000),
            ("caustic_ring", 1, 5_000..10_000),
            ("cornell_box", 1, 30..50),
        ] {
            let path = write(name, directory.path()).unwrap().unwrap();
            let loaded = import::load(&path).unwrap();
            assert_eq!(loaded.warnings, Vec::<String>::new(), "{name}");
            assert_eq!(loaded.scene.lights.len(), lights, "{name}");
            assert!(
                triangles.contains(&loaded.scene.mesh.indices.len()),
                "{}",
                loaded.scene.mesh.indices.len()
            );
            assert!(loaded.scene.is_main.iter().any(|&m| m), "{name}");
        }
        assert!(NAMES.iter().all(|name| write(name, directory.path()).unwrap().is_some()));
        assert!(write("elsewhere", directory.path()).unwrap().is_none());
    }
}
