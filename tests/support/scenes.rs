//! Small scenes, built in memory.

use std::{f32::consts::PI, sync::Arc};

use glam::{UVec2, Vec2, Vec3};
use lightopt_embree::{
    camera::{Camera, Lens},
    light::{
        Cone, Distant, Edge, EmissiveTriangle, Environment, Light, LightColor, MeshLight, Outline, Planar,
        Point, RadianceMap, Shape, Sphere, Surroundings, look_frame,
    },
    math::Rgb,
    picture::Samples,
    scene::{
        Material, Mesh, Scene,
        material::{Coats, MaterialParams, Model, Relief},
        mesh::face_normal,
        texture::{Channel, Encoding, ScalarMap, Texture},
    },
};

/// A mesh under construction.
#[derive(Default)]
pub struct Shapes {
    pub mesh: Mesh,
}

impl Shapes {
    fn vertex(&mut self, p: Vec3, n: Vec3, uv: Vec2) -> u32 {
        self.mesh.positions.push(p);
        self.mesh.normals.push(n);
        self.mesh.uvs.push(uv);
        self.mesh.positions.len() as u32 - 1
    }

    fn triangle(&mut self, t: [u32; 3], material: u32) {
        self.mesh.indices.push(t);
        self.mesh.materials.push(material);
        self.mesh.objects.push(0);
    }

    /// A parallelogram `p + a u + b v`, front side along a × b.
    pub fn quad(&mut self, p: Vec3, a: Vec3, b: Vec3, material: u32) -> &mut Self {
        let n = a.cross(b).normalize();
        let i: Vec<u32> = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
            .map(|(u, v)| self.vertex(p + a * u + b * v, n, Vec2::new(u, v)))
            .to_vec();
        self.triangle([i[0], i[1], i[2]], material);
        self.triangle([i[0], i[2], i[3]], material);
        self
    }

    /// An axis-aligned box, inward or outward.
    pub fn cuboid(&mut self, lo: Vec3, hi: Vec3, inward: bool, material: u32) -> &mut Self {
        let d = hi - lo;
        let (x, y, z) = (Vec3::X * d.x, Vec3::Y * d.y, Vec3::Z * d.z);
        for (p, a, b) in [(lo, y, x), (lo, x, z), (lo, z, y), (hi, -x, -y), (hi, -z, -x), (hi, -y, -z)] {
            if inward {
                self.quad(p, b, a, material);
            } else {
                self.quad(p, a, b, material);
            }
        }
        self
    }

    /// A sphere of `n` × 2n quads; with `smooth` the normals are the sphere's.
    pub fn sphere(&mut self, center: Vec3, radius: f32, n: u32, smooth: bool, material: u32) -> &mut Self {
        let point = |i: u32, j: u32| {
            let (theta, phi) = (PI * i as f32 / n as f32, PI * j as f32 / n as f32);
            Vec3::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin())
        };
        for i in 0..n {
            for j in 0..2 * n {
                let corners = [point(i, j), point(i, j + 1), point(i + 1, j + 1), point(i + 1, j)];
                for [a, b, c] in [[0, 1, 2], [0, 2, 3]] {
                    let t = [corners[a], corners[b], corners[c]];
                    let flat = face_normal(t);
                    if flat.length() < 1e-7 {
                        continue;
                    }
                    let flat = flat.normalize();
                    let v = t.map(|d| {
                        self.vertex(
                            center + d * radius,
                            if smooth { d.normalize() } else { flat },
                            Vec2::ZERO,
                        )
                    });
                    self.triangle(v, material);
                }
            }
        }
        self
    }
}

pub fn params(model: Model, color: [f32; 3], roughness: f32) -> MaterialParams {
    MaterialParams { model, base_color: Rgb::from_array(color), roughness, ..MaterialParams::default() }
}

pub fn material(name: &str, model: Model, color: [f32; 3], roughness: f32) -> Material {
    Material::new(name.into(), params(model, color, roughness), &mut Coats::default())
}

pub fn light(name: &str, shape: Shape) -> Light {
    Light {
        name: name.into(),
        shape,
        color: Rgb::ONE,
        picture_color: LightColor::Recorded,
        temperature: None,
        radiance: 1.0,
        size: 1.0,
        camera_visible: true,
        occludes: false,
    }
}

pub fn rectangle(name: &str, center: Vec3, normal: Vec3, a: f32, b: f32) -> Light {
    let frame = look_frame(normal, if normal.y.abs() > 0.9 { Vec3::Z } else { Vec3::Y });
    light(name, Shape::Planar(Planar { center, frame, outline: Outline::Rectangle { a, b }, cone: None }))
}

pub fn disk(name: &str, center: Vec3, normal: Vec3, r: f32, cone: Option<Cone>) -> Light {
    let frame = look_frame(normal, Vec3::Z);
    light(name, Shape::Planar(Planar { center, frame, outline: Outline::Disk { r }, cone }))
}

pub fn sphere_light(name: &str, center: Vec3, radius: f32) -> Light {
    light(name, Shape::Sphere(Sphere { center, radius }))
}

pub fn camera(position: Vec3, look_at: Vec3, vfov: f32, size: (u32, u32)) -> Camera {
    Camera::new(position, look_at, Vec3::Y, vfov, UVec2::new(size.0, size.1)).unwrap()
}

/// A closed cube of the given albedo whose walls emit radiance 1: every pixel
/// sees 1 + a + a² + …
pub fn furnace(albedo: f32) -> Scene {
    let mut s = Shapes::default();
    s.cuboid(Vec3::splat(-1.0), Vec3::ONE, true, 0);
    let lights = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z]
        .iter()
        .map(|n| rectangle(&format!("{n}"), *n * (1.0 - 1e-5), -*n, 1.0, 1.0))
        .collect();
    let materials = vec![material("wall", Model::Diffuse, [albedo; 3], 0.0)];
    let camera = camera(Vec3::new(0.1, -0.2, 0.3), Vec3::new(0.4, 0.3, -1.0), 70.0, (8, 8));
    Scene::new("furnace", s.mesh, materials, lights, camera).unwrap()
}

/// The walls, floor and ceiling of a box open toward +z, 2 m wide, with
/// coloured sides: materials 0 white, 1 red, 2 green.
pub fn room() -> (Shapes, Vec<Material>) {
    let mut s = Shapes::default();
    let (x, y, z) = (Vec3::X * 2.0, Vec3::Y * 2.0, Vec3::Z * 2.0);
    let lo = Vec3::new(-1.0, 0.0, -1.0);
    s.quad(lo, z, x, 0).quad(lo + y, x, z, 0).quad(lo, x, y, 0).quad(lo, y, z, 1).quad(lo + x, z, y, 2);
    let materials = vec![
        material("white", Model::Diffuse, [0.7, 0.7, 0.7], 0.0),
        material("red", Model::Diffuse, [0.6, 0.1, 0.1], 0.0),
        material("green", Model::Diffuse, [0.1, 0.5, 0.1], 0.0),
    ];
    (s, materials)
}

pub fn room_camera(size: (u32, u32)) -> Camera {
    camera(Vec3::new(0.0, 1.0, 3.8), Vec3::new(0.0, 0.95, 0.0), 38.0, size)
}

fn finish(name: &str, s: Shapes, materials: Vec<Material>, lights: Vec<Light>, size: (u32, u32)) -> Scene {
    Scene::new(name, s.mesh, materials, lights, room_camera(size)).unwrap()
}

fn ceiling_light() -> Light {
    let mut l = rectangle("ceiling", Vec3::new(0.0, 1.98, 0.0), Vec3::NEG_Y, 0.4, 0.3);
    l.radiance = 6.0;
    l
}

pub fn cornell(size: (u32, u32)) -> Scene {
    let (mut s, m) = room();
    s.cuboid(Vec3::new(-0.7, 0.0, -0.6), Vec3::new(-0.1, 1.1, 0.0), false, 0);
    s.cuboid(Vec3::new(0.1, 0.0, -0.1), Vec3::new(0.6, 0.5, 0.4), false, 0);
    finish("cornell", s, m, vec![ceiling_light()], size)
}

/// A coarse sphere with smooth normals: shading and geometric normals differ.
pub fn smooth_sphere(size: (u32, u32)) -> Scene {
    let (mut s, m) = room();
    s.sphere(Vec3::new(0.0, 0.6, 0.0), 0.6, 6, true, 0);
    finish("smooth_sphere", s, m, vec![ceiling_light()], size)
}

/// Coarse balls with smooth normals, rough and smooth, that lean from many a viewer.
pub fn coarse_gloss(size: (u32, u32)) -> Scene {
    let (mut s, mut m) = room();
    m.push(material("metal", Model::Conductor, [0.9, 0.7, 0.4], 0.4));
    m.push(material("mirror", Model::Conductor, [0.8, 0.8, 0.9], 0.0));
    m.push(material("varnish", Model::Plastic, [0.6, 0.2, 0.2], 0.0));
    m.push(material("glass", Model::Dielectric, [1.0; 3], 0.4));
    for (i, x) in [-0.6, 0.6].into_iter().enumerate() {
        s.sphere(Vec3::new(x, 0.4, 0.2), 0.35, 4, true, 3 + i as u32);
        s.sphere(Vec3::new(x, 1.3, 0.0), 0.35, 4, true, 5 + i as u32);
    }
    finish("coarse_gloss", s, m, vec![ceiling_light()], size)
}

pub fn rough_glass(size: (u32, u32)) -> Scene {
    let (mut s, mut m) = room();
    m.push(material("glass", Model::Dielectric, [1.0; 3], 0.5));
    s.sphere(Vec3::new(0.0, 0.6, 0.1), 0.5, 16, true, 3);
    finish("rough_glass", s, m, vec![ceiling_light()], size)
}

pub fn smooth_glass(size: (u32, u32)) -> Scene {
    let (mut s, mut m) = room();
    m.push(material("glass", Model::Dielectric, [1.0; 3], 0.0));
    s.sphere(Vec3::new(0.0, 0.6, 0.1), 0.5, 16, true, 3);
    finish("smooth_glass", s, m, vec![ceiling_light()], size)
}

pub fn glossy_floor(size: (u32, u32)) -> Scene {
    let (mut s, mut m) = room();
    m.push(material("floor", Model::Plastic, [0.3, 0.2, 0.1], 0.35));
    m.push(material("metal", Model::Conductor, [0.9, 0.7, 0.4], 0.4));
    m.push(material("varnish", Model::Plastic, [0.6, 0.2, 0.2], 0.0));
    s.quad(Vec3::new(-1.0, 0.01, -1.0), Vec3::Z * 2.0, Vec3::X * 2.0, 3);
    s.sphere(Vec3::new(-0.4, 0.4, 0.0), 0.35, 12, true, 4);
    s.sphere(Vec3::new(0.45, 0.4, 0.1), 0.35, 12, true, 5);
    let mut ball = sphere_light("ball", Vec3::new(0.3, 1.4, 0.2), 0.15);
    ball.radiance = 10.0;
    finish("glossy_floor", s, m, vec![ceiling_light(), ball], size)
}

/// Two lights on one line of sight, the nearer in front of the farther, and
/// a spot and a point: nothing blocks anything.
pub fn lights_in_line(size: (u32, u32)) -> Scene {
    let (s, m) = room();
    let mut near = rectangle("near", Vec3::new(0.0, 1.0, 0.3), Vec3::Z, 0.3, 0.2);
    near.radiance = 0.7;
    let mut far = sphere_light("far", Vec3::new(0.05, 1.0, -0.4), 0.3);
    far.radiance = 1.5;
    let cone = Cone { cos_inner: 0.95, cos_outer: 0.8, edge: Edge::Smooth };
    let mut spot = disk("spot", Vec3::new(-0.6, 1.7, 0.4), Vec3::new(0.5, -1.0, -0.3), 0.1, Some(cone));
    spot.radiance = 40.0;
    let mut point = light("point", Shape::Point(Point::isotropic(Vec3::new(0.6, 1.5, 0.5))));
    point.radiance = 0.3;
    finish("lights_in_line", s, m, vec![near, far, spot, point], size)
}

/// Coarse surroundings: a dim sky with a bright window and a coloured ground.
pub fn sky() -> Arc<RadianceMap> {
    let texel = |i: usize| match (i % 16, i / 16) {
        (9..=10, 2..=3) => [12.0, 11.0, 9.0],
        (_, 0..4) => [0.3, 0.4, 0.6],
        (x, _) => [0.2, 0.1 + 0.01 * x as f32, 0.1],
    };
    Arc::new(RadianceMap::new(16, 8, (0..128).map(texel).collect()).unwrap())
}

pub fn environment(name: &str, map: Option<Arc<RadianceMap>>) -> Light {
    light(name, Shape::Environment(Environment { map, rotation: 0.7, scene: Surroundings::default() }))
}

/// Triangles `prims` of a mesh as a light.
pub fn mesh_light(name: &str, mesh: &Mesh, prims: std::ops::Range<u32>, two_sided: bool) -> Light {
    let triangles = prims
        .map(|prim| EmissiveTriangle {
            prim,
            corners: mesh.corners(prim as usize),
            uvs: mesh.indices[prim as usize].map(|i| mesh.uvs[i as usize]),
            clearance: 2e-5,
        })
        .collect();
    light(name, Shape::Mesh(MeshLight::new(triangles, None, two_sided).unwrap()))
}

/// The open room under a sky, and parallel light.
pub fn outdoors(size: (u32, u32)) -> Scene {
    let mut s = Shapes::default();
    let mut m = room().1;
    m.push(material("metal", Model::Conductor, [0.9, 0.8, 0.7], 0.5));
    // Rough: what smooth glass makes of parallel light a path tracer cannot find.
    m.push(material("glass", Model::Dielectric, [1.0; 3], 0.4));
    s.quad(Vec3::new(-1.5, 0.0, -1.5), Vec3::Z * 3.0, Vec3::X * 3.0, 0);
    s.sphere(Vec3::new(-0.5, 0.5, 0.0), 0.5, 8, true, 3);
    s.sphere(Vec3::new(0.6, 0.4, 0.3), 0.4, 8, true, 4);
    let mut sun = light(
        "sun",
        Shape::Distant(Distant {
            direction: Vec3::new(0.4, -1.0, -0.3).normalize(),
            scene: Surroundings::default(),
        }),
    );
    sun.radiance = 1.5;
    finish("outdoors", s, m, vec![environment("sky", Some(sky())), sun], size)
}

/// A room lit through its opening by constant surroundings.
pub fn overcast(size: (u32, u32)) -> Scene {
    let (mut s, m) = room();
    s.cuboid(Vec3::new(-0.4, 0.0, -0.4), Vec3::new(0.4, 0.8, 0.4), false, 0);
    finish("overcast", s, m, vec![environment("sky", None)], size)
}

/// A room lit by a shining octahedron-like ball, which is geometry, a panel
/// that shines on both sides, and a black-backed panel.
pub fn shining_meshes(size: (u32, u32)) -> Scene {
    let (mut s, mut m) = room();
    m.push(material("bulb", Model::Diffuse, [0.5; 3], 0.0));
    m.push(material("leaf", Model::Plastic, [0.3; 3], 0.4));
    let first = s.mesh.indices.len() as u32;
    s.sphere(Vec3::new(-0.4, 0.9, 0.0), 0.25, 4, true, 3);
    let second = s.mesh.indices.len() as u32;
    s.quad(Vec3::new(0.3, 0.3, 0.2), Vec3::new(0.3, 0.1, 0.2), Vec3::new(-0.1, 0.5, 0.0), 4);
    let third = s.mesh.indices.len() as u32;
    let mut bulb = mesh_light("bulb", &s.mesh, first..second, false);
    bulb.radiance = 3.0;
    let leaf = mesh_light("leaf", &s.mesh, second..third, true);
    let mut panel = rectangle("panel", Vec3::new(0.1, 1.6, 0.1), Vec3::new(0.3, -1.0, 0.2), 0.3, 0.3);
    panel.radiance = 4.0;
    panel.occludes = true;
    let mut ball = sphere_light("ball", Vec3::new(0.6, 0.3, 0.5), 0.15);
    ball.radiance = 2.0;
    ball.occludes = true;
    finish("shining_meshes", s, m, vec![bulb, leaf, panel, ball], size)
}

/// Panes that let half of the light pass, in front of one another and of a lamp.
pub fn veils(size: (u32, u32)) -> Scene {
    let (mut s, mut m) = room();
    let veil = MaterialParams { opacity: 0.5, ..params(Model::Plastic, [0.7, 0.4, 0.3], 0.4) };
    m.push(Material::new("veil".into(), veil, &mut Coats::default()));
    s.quad(Vec3::new(-0.8, 0.2, 0.4), Vec3::X * 0.9, Vec3::Y * 1.2, 3);
    s.quad(Vec3::new(-0.5, 0.1, 0.1), Vec3::X * 1.2, Vec3::new(0.0, 1.0, -0.3), 3);
    s.quad(Vec3::new(-0.7, 1.6, -0.6), Vec3::Z * 1.2, Vec3::X * 1.4, 3);
    finish("veils", s, m, vec![ceiling_light()], size)
}

/// The glossy floor through a wide lens, and a point light with a cone.
pub fn out_of_focus(size: (u32, u32)) -> Scene {
    let mut scene = glossy_floor(size);
    let mut lights = scene.lights.clone();
    let cone = Cone { cos_inner: 0.9, cos_outer: 0.7, edge: Edge::Smooth };
    let axis = Vec3::new(-0.3, -1.0, 0.1).normalize();
    lights.push(light(
        "spot",
        Shape::Point(Point { position: Vec3::new(0.2, 1.8, 0.0), cone: Some((axis, cone)) }),
    ));
    // Rough, for the same reason: what smooth varnish makes of a point light.
    scene.materials[5] = material("varnish", Model::Plastic, [0.6, 0.2, 0.2], 0.3);
    let lens = Lens { radius: 0.08, focus_distance: 3.6 };
    let camera = scene.camera.clone().with_lens(Some(lens));
    scene = Scene::new("out_of_focus", scene.mesh, scene.materials, lights, camera).unwrap();
    scene
}

/// An image of linear numbers, 16 bits a channel, of `f` at the texels' centres (v up).
pub fn image(size: u32, f: impl Fn(Vec2) -> [f32; 4]) -> Arc<Texture> {
    let texel = |x: u32, y: u32| {
        let uv = Vec2::new(x as f32 + 0.5, (size - y) as f32 - 0.5) / size as f32;
        f(uv).map(|v| (v.clamp(0.0, 1.0) * 65535.0).round() as u16)
    };
    let texels = (0..size * size).flat_map(|i| texel(i % size, i / size)).collect();
    let extent = [size as usize; 2];
    Arc::new(Texture::from_samples(extent, 4, Samples::U16(texels), Encoding::Linear))
}

pub fn scalar(texture: &Arc<Texture>, channel: Channel) -> ScalarMap {
    ScalarMap { texture: texture.clone(), channel }
}

/// Steep waves as a normal map.
pub fn waves(size: u32) -> Relief {
    let texture = image(size, |uv| {
        let slope = Vec2::new((4.0 * PI * uv.x).sin(), (6.0 * PI * uv.y).cos());
        let n = (slope * 1.2).extend(1.0).normalize();
        ((n + Vec3::ONE) / 2.0).extend(1.0).to_array()
    });
    Relief::NormalMap { texture, scale: 1.0 }
}

/// Walls with steep waves, a bumpy table of varying metal, coat and roughness,
/// and wavy glass.
pub fn normal_mapped(size: (u32, u32)) -> Scene {
    let (mut s, mut m) = room();
    let dots = image(16, |uv| [uv.x, (8.0 * uv.x).fract().round(), (3.0 * uv.y).sin().abs(), 1.0]);
    let mut coats = Coats::default();
    let mut add = |name: &str, params| m.push(Material::new(name.into(), params, &mut coats));
    add("wavy", MaterialParams { relief: Some(waves(32)), ..params(Model::Diffuse, [0.7, 0.6, 0.5], 0.0) });
    let table = MaterialParams {
        roughness_map: Some(scalar(&dots, Channel::R)),
        specular_map: Some(scalar(&dots, Channel::B)),
        metallic: 1.0,
        metallic_map: Some(scalar(&dots, Channel::G)),
        relief: Some(Relief::BumpMap { height: scalar(&dots, Channel::B), scale: 0.3 }),
        ..params(Model::Plastic, [0.8, 0.5, 0.2], 0.8)
    };
    add("table", table);
    add("glass", MaterialParams { relief: Some(waves(16)), ..params(Model::Dielectric, [1.0; 3], 0.4) });
    s.quad(Vec3::new(-0.9, 0.1, -0.95), Vec3::X * 1.8, Vec3::Y * 1.7, 3);
    s.quad(Vec3::new(-0.9, 0.3, 0.9), Vec3::X * 1.8, -Vec3::Z * 1.6, 4);
    s.quad(Vec3::new(-0.4, 0.5, 0.3), Vec3::X * 0.8, Vec3::new(0.0, 0.8, -0.2), 5);
    finish("normal_mapped", s, m, vec![ceiling_light()], size)
}

/// Inside a closed box whose walls have steep waves, lit from outside only.
pub fn dark_box(size: (u32, u32)) -> Scene {
    let mut s = Shapes::default();
    s.cuboid(Vec3::splat(-1.0), Vec3::ONE, true, 0);
    let walls = MaterialParams { relief: Some(waves(32)), ..params(Model::Plastic, [0.9; 3], 0.5) };
    let walls = Material::new("walls".into(), walls, &mut Coats::default());
    let lights = vec![
        rectangle("sun", Vec3::new(0.3, 4.0, 0.2), Vec3::NEG_Y, 2.0, 2.0),
        sphere_light("lamp", Vec3::new(2.5, 0.1, 0.3), 0.5),
    ];
    let camera = camera(Vec3::new(0.1, -0.2, 0.3), Vec3::new(0.6, 0.4, -0.2), 100.0, size);
    Scene::new("dark_box", s.mesh, vec![walls], lights, camera).unwrap()
}

type Make = fn((u32, u32)) -> Scene;

/// Every kind of material, light and camera.
pub const ALL: [Make; 13] = [
    cornell,
    smooth_sphere,
    coarse_gloss,
    rough_glass,
    smooth_glass,
    glossy_floor,
    lights_in_line,
    outdoors,
    overcast,
    shining_meshes,
    veils,
    out_of_focus,
    normal_mapped,
];
