//! Rays that leave a surface do not meet it again, at any scale.

use glam::{Vec2, Vec3};
use lightopt_embree::scene::{Mesh, Scene, material::Model};

use crate::support::{
    random::Random,
    scenes::{Shapes, camera, material},
};

fn scene(mesh: Mesh) -> Scene {
    let materials = vec![material("gray", Model::Diffuse, [0.5; 3], 0.0)];
    Scene::new("spawn", mesh, materials, vec![], camera(Vec3::Z, Vec3::ZERO, 40.0, (4, 4))).unwrap()
}

/// Metres: a grain of sand to a landscape.
const SCALES: [f32; 8] = [1e-3, 1e-2, 0.1, 1.0, 10.0, 100.0, 1e3, 1e4];

/// Counts rays that leave outward and hit, and rays that leave inward and
/// escape or meet the triangle they left.
fn defects_of_a_ball(center: Vec3, radius: f32, n: u32) -> (usize, usize) {
    let mut shapes = Shapes::default();
    shapes.sphere(center, radius, n, false, 0);
    let scene = scene(shapes.mesh);
    let mut random = Random::new(&[21]);
    let (mut outward, mut inward) = (0, 0);
    for _ in 0..50_000 {
        let org = center + random.direction() * (3.0 * radius);
        let target = center + random.direction() * (0.99 * radius);
        let Some(hit) = scene.intersect(org, (target - org).normalize()) else { continue };
        let si = hit.si;
        let w = random.direction();
        // Half of them along the surface.
        let along = (w - si.ng * (w.dot(si.ng) - random.range(-0.02, 0.02))).normalize();
        for w in [w, along] {
            let again = scene.intersect(si.spawn_origin(w), w);
            if w.dot(si.ng) >= 0.0 {
                outward += usize::from(again.is_some());
            } else {
                inward += usize::from(again.is_none_or(|a| a.si.triangle == si.triangle));
            }
        }
    }
    (outward, inward)
}

#[test]
fn rays_leave_a_finely_tessellated_ball_clear_of_it() {
    for radius in SCALES {
        for center in [Vec3::ZERO, Vec3::new(2.0, -0.7, 1.3) * radius, Vec3::new(30.0, -7.0, 13.0) * radius] {
            // Facets must stay far larger than the coordinates' last place.
            let n = if center.length() > 10.0 * radius { 64 } else { 128 };
            let defects = defects_of_a_ball(center, radius, n);
            assert_eq!(defects, (0, 0), "radius {radius} at {center}");
        }
    }
}

/// Large tilted triangles, hit anywhere, near the origin above all: there the
/// point's own coordinates are small, and its rounding is that of the corners.
#[test]
fn rays_leave_large_tilted_triangles_clear_of_them() {
    let mut random = Random::new(&[22]);
    let mut failures = Vec::new();
    for scale in SCALES {
        let (mut n, mut again) = (0, 0);
        for _ in 0..200 {
            let normal = random.direction();
            let (s, t) = normal.any_orthonormal_pair();
            let mut mesh = Mesh::default();
            let corner = |k: f32, random: &mut Random| {
                let (sin, cos) = (2.1 * k + random.range(0.0, 1.0)).sin_cos();
                (s * cos + t * sin) * scale * random.range(0.5, 1.0)
            };
            // A plane through a point near the origin.
            let base = random.direction() * random.range(0.0, 0.1) * scale.min(1.0);
            for k in 0..3 {
                mesh.positions.push(base + corner(k as f32, &mut random));
                mesh.normals.push(normal);
                mesh.uvs.push(Vec2::ZERO);
            }
            mesh.indices.push([0, 1, 2]);
            mesh.materials.push(0);
            mesh.objects.push(0);
            let scene = scene(mesh);
            for _ in 0..500 {
                let near = random.next() * random.next() * random.next();
                let target =
                    base + (s * random.range(-1.0, 1.0) + t * random.range(-1.0, 1.0)) * (scale * near);
                let org = target + random.direction() * scale;
                let Some(hit) = scene.intersect(org, (target - org).normalize()) else { continue };
                let si = hit.si;
                for _ in 0..2 {
                    let w = random.direction();
                    let along = (w - si.ng * (w.dot(si.ng) - random.range(-0.02, 0.02))).normalize();
                    for w in [w, along] {
                        n += 1;
                        again += usize::from(scene.intersect(si.spawn_origin(w), w).is_some());
                    }
                }
            }
        }
        println!("triangles of {scale} m: {again} of {n} rays meet the triangle they leave");
        if again > 0 {
            failures.push((scale, again, n));
        }
    }
    assert!(failures.is_empty(), "{failures:?}");
}
