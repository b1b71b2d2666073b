//! Hits against brute force in f64, and the promises of the wrapper.

use super::*;
use glam::DVec3;
use std::f32::consts::TAU;

/// SplitMix64, enough for test data.
struct Rng(u64);

impl Rng {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// Uniform in [0, 1).
    fn f32(&mut self) -> f32 {
        (self.next() >> 40) as f32 / (1_u64 << 24) as f32
    }

    /// Uniform in [-1, 1)³.
    fn cube(&mut self) -> Vec3 {
        2.0 * Vec3::new(self.f32(), self.f32(), self.f32()) - 1.0
    }

    fn direction(&mut self) -> Vec3 {
        let (z, phi) = (2.0 * self.f32() - 1.0, TAU * self.f32());
        let r = (1.0 - z * z).max(0.0).sqrt();
        Vec3::new(r * phi.cos(), r * phi.sin(), z)
    }
}

struct Mesh {
    positions: Vec<Vec3>,
    indices: Vec<[u32; 3]>,
}

impl Mesh {
    /// Unconnected triangles with centres in the unit cube.
    fn soup(n: u32, size: f32, rng: &mut Rng) -> Self {
        let mut positions = Vec::new();
        for _ in 0..n {
            let centre = rng.cube();
            positions.extend((0..3).map(|_| centre + size * rng.cube()));
        }
        let indices = (0..n).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        Mesh { positions, indices }
    }

    /// Octahedron subdivided `levels` times, projected to the unit sphere: closed, and every
    /// edge is shared.
    fn sphere(levels: u32) -> Self {
        let n = 1_u32 << levels;
        let mut mesh = Mesh { positions: Vec::new(), indices: Vec::new() };
        let mut ids = std::collections::HashMap::new();
        for face in 0..8 {
            let sign = |bit: u32| if face >> bit & 1 == 1 { -1_i32 } else { 1 };
            let mut id = |i: u32, j: u32| {
                let k = n - i - j;
                let key = [i as i32 * sign(0), j as i32 * sign(1), k as i32 * sign(2)];
                *ids.entry(key).or_insert_with(|| {
                    mesh.positions.push(Vec3::from(key.map(|x| x as f32)).normalize());
                    mesh.positions.len() as u32 - 1
                })
            };
            for i in 0..n {
                for j in 0..n - i {
                    mesh.indices.push([id(i, j), id(i + 1, j), id(i, j + 1)]);
                    if i + j + 2 <= n {
                        mesh.indices.push([id(i + 1, j), id(i + 1, j + 1), id(i, j + 1)]);
                    }
                }
            }
        }
        mesh
    }

    fn as_ref(&self) -> TriangleMesh<'_> {
        TriangleMesh { positions: &self.positions, indices: &self.indices }
    }
}

/// What f64 arithmetic says of a ray and a triangle, with the error that f32 may make.
struct Exact {
    t: f64,
    u: f64,
    v: f64,
    /// Bound on the error of f32 barycentrics; infinite for a triangle seen edge-on.
    err_b: f64,
    /// Bound on the error of f32 `t`.
    err_t: f64,
    verdict: Verdict,
}

#[derive(PartialEq)]
enum Verdict {
    Hit,
    /// Closer to an edge, or to an end of the ray, than f32 can tell.
    Unclear,
    Miss,
}

/// \[MT97\] in f64, with the bounds of the Plücker test in f32 that Embree's robust mode does:
/// it asks whether the three edge functions e × (a + b) · d, with vertices relative to the
/// origin, have one sign. Each has 8 roundings at most on the way to any term, so is computed
/// to within γ |e| |a + b| |d|, γ = 8 ε (a factor 2 for sums of components against norms).
fn exact(ray: &Ray, p: [Vec3; 3]) -> Exact {
    const GAMMA: f64 = 8.0 * f32::EPSILON as f64;
    let (o, d) = (ray.org.as_dvec3(), ray.dir.as_dvec3());
    let [a, b, c] = p.map(|q| q.as_dvec3() - o);
    let (e1, e2) = (b - a, c - a);
    let (h, q) = (d.cross(e2), (-a).cross(e1));
    let den = e1.dot(h);
    let (u, v, t) = (-a.dot(h) / den, d.dot(q) / den, e2.dot(q) / den);

    let longest = |vectors: [DVec3; 3]| vectors.map(DVec3::length).into_iter().fold(0.0, f64::max);
    let (edge, far, len) = (longest([e1, e2, b - c]), longest([a, b, c]), d.length());
    let err_edge = GAMMA * edge * 2.0 * far * len;
    // u = U / (U + V + W), all three to within err_edge.
    let err_b = 4.0 * err_edge / den.abs();
    // t = a·n / d·n, n = e1 × e2, each to within γ of the product of its norms.
    let err_t = GAMMA * edge * edge * (far + t.abs() * len) / den.abs();

    let functions = [-a.dot(h), d.dot(q), den + a.dot(h) - d.dot(q)];
    let (below, above) = functions.into_iter().fold((0, 0), |(below, above), f| {
        (below + i32::from(f < -err_edge), above + i32::from(f > err_edge))
    });
    let (near, end) = (f64::from(ray.t_min), f64::from(ray.t_max));
    let within = (t - near).min(end - t);
    let verdict = if (below > 0 && above > 0) || within < -err_t {
        Verdict::Miss
    } else if below.max(above) == 3 && within > err_t {
        Verdict::Hit
    } else {
        Verdict::Unclear
    };
    Exact { t, u, v, err_b, err_t, verdict }
}

/// Checks one ray against every triangle; true when nothing about it was unclear.
fn check_against_brute_force(accel: &Accel, mesh: &Mesh, ray: &Ray) -> bool {
    let corners = |i: [u32; 3]| i.map(|k| mesh.positions[k as usize]);
    let hit = accel.intersect(ray);
    let limit = hit.map_or(f64::INFINITY, |hit| {
        let e = exact(ray, corners(mesh.indices[hit.prim as usize]));
        assert!(e.verdict != Verdict::Miss, "{ray:?} cannot give {hit:?}");
        if e.err_b < 0.5 {
            let off = (f64::from(hit.t) - e.t).abs();
            assert!(off <= e.err_t, "{ray:?} {hit:?}: t off by {off}, allowed {}", e.err_t);
            let off = (f64::from(hit.u) - e.u).abs().max((f64::from(hit.v) - e.v).abs());
            assert!(off <= e.err_b, "{ray:?} {hit:?}: u, v off by {off}, allowed {}", e.err_b);
        }
        f64::from(hit.t)
    });
    let mut clear = true;
    let mut possible = false;
    for (i, &indices) in mesh.indices.iter().enumerate() {
        let e = exact(ray, corners(indices));
        possible |= e.verdict != Verdict::Miss;
        clear &= e.verdict != Verdict::Unclear;
        let missed = e.verdict == Verdict::Hit && e.t + e.err_t < limit;
        let same = hit.is_some_and(|hit| hit.prim as usize == i);
        assert!(!missed || same, "{ray:?} hits triangle {i} at {}, not {hit:?}", e.t);
    }
    assert!(possible || hit.is_none());
    assert_eq!(accel.occluded(ray), hit.is_some(), "{ray:?} {hit:?}");
    clear
}

#[test]
fn hits_equal_brute_force_on_a_triangle_soup() {
    let mut rng = Rng(1);
    let mesh = Mesh::soup(300, 0.2, &mut rng);
    let accel = Accel::build(&[mesh.as_ref()]).unwrap();
    let (n, mut clear, mut hits) = (100_000, 0, 0);
    for i in 0..n {
        let (org, t_max) = (1.5 * rng.cube(), if i % 2 == 0 { f32::INFINITY } else { 1.0 });
        let dir = rng.direction() * (0.1 + 3.0 * rng.f32());
        let ray = Ray { org, dir, t_min: 0.0, t_max };
        clear += u32::from(check_against_brute_force(&accel, &mesh, &ray));
        hits += u32::from(accel.occluded(&ray));
    }
    // Neither excuse may carry the test.
    assert!(clear > n - n / 100, "{clear} of {n} rays were clear of edges");
    assert!(hits > n / 10 && hits < n - n / 10, "{hits} of {n} rays hit");
}

#[test]
fn a_closed_mesh_has_no_leaks() {
    let mut rng = Rng(2);
    let mesh = Mesh::sphere(3);
    let accel = Accel::build(&[mesh.as_ref()]).unwrap();
    for _ in 0..100_000 {
        let (org, dir) = (0.5 * rng.cube(), rng.direction());
        let ray = Ray { org, dir, t_min: 0.0, t_max: f32::INFINITY };
        assert!(accel.intersect(&ray).is_some(), "{ray:?} escaped");
        check_against_brute_force(&accel, &mesh, &ray);
    }
    // Straight at vertices and edges, where a leak would be.
    for indices in &mesh.indices {
        let [a, b, c] = indices.map(|i| mesh.positions[i as usize]);
        for target in [a, b, c, (a + b) / 2.0, (b + c) / 2.0, 0.3 * a + 0.7 * c] {
            for org in [Vec3::ZERO, 0.5 * rng.cube(), 0.5 * rng.cube()] {
                let ray = Ray { org, dir: target - org, t_min: 0.0, t_max: f32::INFINITY };
                assert!(accel.intersect(&ray).is_some(), "{ray:?} escaped");
                assert!(accel.occluded(&ray), "{ray:?} escaped");
            }
        }
    }
}

#[test]
fn meshes_keep_their_place_even_when_some_are_empty() {
    let triangle = |z: f32| [Vec3::new(-1.0, -1.0, z), Vec3::new(3.0, -1.0, z), Vec3::new(-1.0, 3.0, z)];
    let (near, far) = (triangle(1.0), triangle(2.0));
    let empty = TriangleMesh { positions: &near, indices: &[] };
    let indices = &[[0, 1, 2]];
    let accel = Accel::build(&[
        empty,
        TriangleMesh { positions: &far, indices },
        empty,
        TriangleMesh { positions: &near, indices },
    ])
    .unwrap();
    let mut ray = Ray { org: Vec3::ZERO, dir: Vec3::Z, t_min: 0.0, t_max: 10.0 };
    assert_eq!(accel.intersect(&ray).unwrap().mesh, 3);
    ray.t_min = 1.5;
    assert_eq!(accel.intersect(&ray).unwrap().mesh, 1);
}

#[test]
fn an_empty_scene_is_never_hit() {
    let accel = Accel::build(&[]).unwrap();
    let ray = Ray { org: Vec3::ZERO, dir: Vec3::X, t_min: 0.0, t_max: f32::INFINITY };
    assert_eq!(accel.intersect(&ray), None);
    assert!(!accel.occluded(&ray));
}

#[test]
fn rays_that_are_not_finite_hit_nothing() {
    let mesh = Mesh::sphere(1);
    let accel = Accel::build(&[mesh.as_ref()]).unwrap();
    let good = Ray { org: Vec3::ZERO, dir: Vec3::X, t_min: -1.0, t_max: f32::INFINITY };
    assert!(accel.occluded(&good));
    for x in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        for bad in [
            Ray { org: Vec3::new(0.0, x, 0.0), ..good },
            Ray { dir: Vec3::new(1.0, 0.0, x), ..good },
            Ray { t_min: f32::NAN, ..good },
            Ray { t_max: f32::NAN, ..good },
            Ray { t_max: -0.5, ..good },
            Ray { dir: Vec3::ZERO, ..good },
        ] {
            assert_eq!(accel.intersect(&bad), None, "{bad:?}");
            assert!(!accel.occluded(&bad), "{bad:?}");
        }
    }
}

#[test]
fn errors_name_the_mesh_and_the_triangle() {
    let good = Mesh::sphere(0);
    let mut bad = Mesh::sphere(0);
    bad.indices[5][2] = 99;
    let message = |bad: &Mesh| Accel::build(&[good.as_ref(), bad.as_ref()]).unwrap_err().to_string();
    assert_eq!(message(&bad), "mesh 1, triangle 5: vertex index 99 is out of range, the mesh has 6 vertices");
    for x in [f32::NAN, f32::INFINITY, 2e18] {
        let mut bad = Mesh::sphere(0);
        let index = bad.indices[0][1] as usize;
        bad.positions[index].y = x;
        let message = message(&bad);
        assert!(message.starts_with("mesh 1, triangle 0: vertex 1 must have finite"), "{message}");
    }
}

#[test]
fn a_bad_configuration_is_an_error() {
    let mesh = Mesh::sphere(0);
    let build = |config| Accel::build_with(config, &[mesh.as_ref()]).unwrap_err().to_string();
    // One that the device refuses, and one that only the build does.
    let message = build(c"threads=many");
    assert!(message.starts_with("Embree could not create a device: "), "{message}");
    let message = build(c"tri_accel=nonsense");
    assert!(message.contains("nonsense"), "{message}");
}

/// Every bit of the hits of many rays with coincident triangles: which of them is reported
/// depends on the order of the tree's leaves, so this sees the tree itself.
fn fingerprint(accel: &Accel) -> Vec<Option<[u32; 5]>> {
    let mut rng = Rng(4);
    let mut ray = || Ray { org: rng.cube(), dir: rng.direction(), t_min: 0.0, t_max: f32::INFINITY };
    (0..20_000)
        .map(|_| accel.intersect(&ray()))
        .map(|hit| hit.map(|h| [h.t.to_bits(), h.u.to_bits(), h.v.to_bits(), h.mesh, h.prim]))
        .collect()
}

#[test]
fn the_tree_does_not_depend_on_the_number_of_threads() {
    let mut mesh = Mesh::soup(60_000, 0.03, &mut Rng(3));
    mesh.indices = mesh.indices.repeat(4);
    let reference = fingerprint(&Accel::build(&[mesh.as_ref()]).unwrap());
    for threads in [1, 2] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let built = pool.broadcast(|_| Accel::build(&[mesh.as_ref()]).unwrap());
        for accel in built {
            assert!(fingerprint(&accel) == reference, "differs with {threads} threads");
        }
    }
    if isa() == "avx2" {
        // Another tree (four children a node, not eight) does show.
        let other = Accel::build_with(c"threads=1,isa=sse4.2", &[mesh.as_ref()]).unwrap();
        let prims = |hits: &[Option<[u32; 5]>]| hits.iter().map(|h| h.map(|h| h[4])).collect::<Vec<_>>();
        assert!(prims(&fingerprint(&other)) != prims(&reference));
    }
}

#[test]
fn queries_from_many_threads_agree() {
    let mesh = Mesh::soup(2_000, 0.1, &mut Rng(5));
    let accel = Accel::build(&[mesh.as_ref()]).unwrap();
    let reference = fingerprint(&accel);
    std::thread::scope(|scope| {
        for _ in 0..8 {
            scope.spawn(|| assert!(fingerprint(&accel) == reference));
        }
    });
    // The last user may be another thread than the builder.
    std::thread::spawn(move || drop(accel)).join().unwrap();
}

#[test]
fn queries_leave_denormals_alone() {
    let mesh = Mesh::sphere(1);
    let accel = Accel::build(&[mesh.as_ref()]).unwrap();
    let ray = Ray { org: Vec3::ZERO, dir: Vec3::X, t_min: 0.0, t_max: f32::INFINITY };
    let halve = |x: f32| std::hint::black_box(x) / 2.0;
    assert!(accel.intersect(&ray).is_some() && accel.occluded(&ray));
    assert!(halve(f32::MIN_POSITIVE) > 0.0);
    std::thread::scope(|s| {
        s.spawn(|| assert!(accel.occluded(&ray) && halve(f32::MIN_POSITIVE) > 0.0));
    });
}

#[test]
fn the_version_and_instruction_set_are_known() {
    assert!(version().starts_with("3.13.") || version().starts_with("4."), "{}", version());
    assert!(["avx2", "sse4.2", "default"].contains(&isa()), "{}", isa());
}

/// What is played again is what was asked: as many hits, in any number of threads, and nothing that came before
/// the recording or after it.
#[test]
fn a_tape_plays_the_queries_that_were_made() {
    let mut rng = Rng(21);
    let mesh = Mesh::soup(200, 0.3, &mut rng);
    let mut accel = Accel::build(&[mesh.as_ref()]).unwrap();
    let mut ray = || Ray { org: 3.0 * rng.cube(), dir: rng.direction(), t_min: 0.0, t_max: 2.5 };
    let ask = |accel: &Accel, ray: &Ray| {
        (usize::from(accel.intersect(ray).is_some()), usize::from(accel.occluded(ray)))
    };
    ask(&accel, &ray());
    accel.record();
    let (mut closest, mut any) = (0, 0);
    for _ in 0..20_000 {
        let (c, a) = ask(&accel, &ray());
        closest += c;
        any += a;
    }
    // A ray that is not finite meets nothing, here and there.
    ask(&accel, &Ray { org: Vec3::splat(f32::NAN), dir: Vec3::X, t_min: 0.0, t_max: 1.0 });
    let tape = accel.recorded();
    ask(&accel, &ray());
    assert_eq!((tape.len(), tape.n_any_hit()), (40_002, 20_001));
    assert!(closest > 500 && closest < 19_500, "{closest}");
    assert_eq!(accel.replay(&tape), closest + any);
    assert!(accel.recorded().is_empty(), "nothing is recorded unless asked for");
}
