//! Lamps among which a rig is chosen, all in one basis, against renders of each.

use glam::Vec3;
use lightopt_embree::{
    design::rig::{Beam, Lamp, Set, places},
    integrator::{Heuristic, Integrator, IntegratorKind, Samples, View},
    light::{Light, Outline},
    lighting::{Lighting, SampleCounts, SamplingPlan},
    math::{display, stats::sidak_z},
    sampler::SamplerKind,
    scene::{Scene, material::Model},
    transport::{Layout, SizeBins, Source, TransportBasis, ValueNodes},
    variables::Movement,
};

use crate::{
    basis::{compare, recombined},
    support::{compare::Subject, scenes},
};

/// A ball, a pane of glass and a glossy floor in a room that is open to the camera.
fn scene(lights: Vec<Light>) -> Scene {
    let (mut s, mut m) = scenes::room();
    m.push(scenes::material("floor", Model::Plastic, [0.5, 0.4, 0.3], 0.3));
    m.push(scenes::material("ball", Model::Diffuse, [0.6, 0.5, 0.7], 0.0));
    m.push(scenes::material("mirror", Model::Conductor, [0.9, 0.8, 0.7], 0.1));
    s.quad(Vec3::new(-1.0, 0.01, -1.0), Vec3::Z * 2.0, Vec3::X * 2.0, 3);
    s.quad(Vec3::new(-0.9, 0.1, -0.9), Vec3::X * 0.5, Vec3::Y * 1.2, 5);
    s.sphere(Vec3::new(0.1, 0.3, 0.1), 0.25, 8, true, 4);
    let is_main = s.mesh.materials.iter().map(|&m| m == 4).collect();
    let mut scene = Scene::new("places", s.mesh, m, lights, scenes::room_camera((12, 9))).unwrap();
    scene.is_main = is_main;
    scene
}

/// Some lamps of every family, with a beam among them.
fn lamps() -> Vec<Lamp> {
    let scene = scene(Vec::new());
    let view = View { scene: &scene, camera: &scene.camera };
    // The camera sees nearly all of the room.
    let set = Set::new(view, Movement { in_frame: true, ..Movement::default() }).unwrap();
    let all = places::all(&set);
    assert!(all.len() > 30, "{}", all.len());
    let mut lamps: Vec<Lamp> = all.iter().copied().step_by(all.len() / 7).collect();
    lamps.push(Lamp {
        beam: Some(Beam { angle: 20.0, softness: 0.5 }),
        outline: Outline::Disk { r: 0.1 },
        ..lamps[0]
    });
    assert!(lamps.iter().any(|l| l.beam.is_some()) && lamps.iter().any(|l| l.beam.is_none()));
    lamps
}

#[test]
fn lamps_of_one_basis_equal_renders_of_each() {
    const REPLICATES: usize = 12;
    const SPP: u32 = 48;
    let lamps = lamps();
    let named = |(i, lamp): (usize, &Lamp)| lamp.light(format!("place {i}"));
    let together = scene(Vec::new()).with_clear_lights(lamps.iter().enumerate().map(named).collect());
    let all = Lighting::authored(&together);
    let n_pixels = together.camera.size().element_product() as usize;
    let threshold = sidak_z(0.01, 2 * (lamps.len() + 1) * (n_pixels + 1));
    for kind in [IntegratorKind::Path, IntegratorKind::Bdpt] {
        let integrator = Integrator { kind, max_depth: 5, heuristic: Heuristic::Power };
        let bins = lamps.iter().map(|_| SizeBins::Fixed(1.0)).collect();
        let layout = Layout::new(together.camera.size(), bins, ValueNodes::new(1.0, 1));
        let mut basis = TransportBasis::for_search(layout, REPLICATES);
        let counts = SampleCounts {
            first_light_samples: 9,
            light_samples: 4,
            camera_subpaths: 3,
            ..SampleCounts::default()
        };
        let plan = SamplingPlan { counts, ..SamplingPlan::uniform(&all) };
        let view = View { scene: &together, camera: &together.camera };
        let source =
            Source { view, plan: &plan, integrator: &integrator, sampler: SamplerKind::Sobol, seed: 7 };
        basis.render(source, SPP, &()).unwrap();
        // Each lamp as the only light of its scene, and three of them at once.
        let trio: Vec<usize> = vec![0, lamps.len() / 2, lamps.len() - 1];
        for chosen in (0..lamps.len()).map(|i| vec![i]).chain([trio]) {
            let alone = scene(chosen.iter().map(|&i| lamps[i].light(format!("lamp {i}"))).collect());
            let lighting = Lighting {
                radiance: chosen.iter().map(|&i| 1.0 + i as f64).collect(),
                ..Lighting::authored(&alone)
            };
            let found = recombined(&basis.of_lights(&chosen), &lighting);
            let expected: Vec<Vec<f64>> = (0..REPLICATES as u64)
                .map(|r| {
                    let samples =
                        Samples { sampler: SamplerKind::Sobol, seed: 1000 + r, first: 0, count: SPP };
                    let picture = Subject::lit(&alone, lighting.clone()).render(&integrator, samples);
                    picture.rgb.iter().map(|&rgb| display::luminance(rgb)).collect()
                })
                .collect();
            let (worst, total) = compare(&found, &expected);
            println!("{kind:?} {chosen:?}: worst pixel {worst:.2}, total {total:.2}, allowed {threshold:.2}");
            assert!(worst < threshold && total.abs() < threshold);
        }
    }
}

#[test]
fn some_lights_of_a_basis_are_those_of_the_whole() {
    let lamps = lamps();
    let scene = scene(lamps.iter().map(|lamp| lamp.light("lamp".into())).collect());
    let bins = lamps.iter().map(|_| SizeBins::Fixed(1.0)).collect();
    let layout = Layout::new(scene.camera.size(), bins, ValueNodes::new(1.0, 3));
    let mut basis = TransportBasis::for_search(layout, 2);
    let mut other = basis.clone();
    let lighting = Lighting::authored(&scene);
    let plan = SamplingPlan::uniform(&lighting);
    let integrator = Integrator { max_depth: 3, ..Integrator::default() };
    let view = View { scene: &scene, camera: &scene.camera };
    let source = Source { view, plan: &plan, integrator: &integrator, sampler: SamplerKind::Sobol, seed: 3 };
    basis.render(source, 2, &()).unwrap();
    other.render(Source { seed: 4, ..source }, 3, &()).unwrap();
    let chosen = [4, 1];
    let part = Lighting { radiance: vec![2.0, 3.0], size: vec![1.0; 2], value: 0.4, ..lighting.clone() };
    let mut whole = Lighting { radiance: vec![0.0; lamps.len()], value: 0.4, ..lighting };
    (whole.radiance[4], whole.radiance[1]) = (2.0, 3.0);
    let [few, all] = [recombined(&basis.of_lights(&chosen), &part), recombined(&basis, &whole)];
    assert!(all[0].iter().any(|&y| y > 0.0));
    for (few, all) in few.concat().iter().zip(all.concat()) {
        assert!((few - all).abs() <= 1e-12 * all.abs().max(1e-6), "{few} {all}");
    }
    // Lights of bases of different numbers of samples, side by side.
    let [ours, theirs] = [(&basis, 4), (&other, 1)].map(|(basis, light)| basis.of_lights(&[light]));
    let [a, b] = [0, 1].map(|l| part.of_lights(&[l]));
    let both = recombined(&ours.joined(&theirs).unwrap(), &part).concat();
    let sum = recombined(&ours, &a).concat().into_iter().zip(recombined(&theirs, &b).concat());
    for (both, sum) in both.iter().zip(sum.map(|(a, b)| a + b)) {
        assert!((both - sum).abs() <= 1e-6 * sum.abs().max(1e-6), "{both} {sum}");
    }
    let larger = Layout::new(scene.camera.size() * 2, vec![SizeBins::Fixed(1.0)], ValueNodes::new(1.0, 3));
    assert!(ours.joined(&TransportBasis::for_search(larger, 2)).is_none());
}

/// Shows every lamp, and every lamp turned round, as the camera sees them: paths of one edge.
#[test]
fn no_lamp_stands_in_the_picture_or_cuts_a_surface() {
    let scene = scene(Vec::new());
    let view = View { scene: &scene, camera: &scene.camera };
    for movement in [Movement::default(), Movement { in_frame: true, ..Movement::default() }] {
        let lamps = places::all(&Set::new(view, movement).unwrap());
        for lamp in &lamps {
            let shape = lamp.planar();
            use lightopt_embree::light::Resizable;
            for t in 0..scene.mesh.indices.len() {
                assert!(shape.size_at_triangle(scene.mesh.corners(t)) > 1.0, "{lamp:?} cuts triangle {t}");
            }
        }
        let turned = |lamp: &Lamp| Lamp { look_at: 2.0 * lamp.position - lamp.look_at, beam: None, ..*lamp };
        let both = lamps.iter().flat_map(|lamp| [Lamp { beam: None, ..*lamp }, turned(lamp)]);
        let shown = self::scene(both.map(|lamp| lamp.light("lamp".into())).collect());
        let integrator = Integrator { kind: IntegratorKind::Path, max_depth: 1, heuristic: Heuristic::Power };
        let samples = Samples { sampler: SamplerKind::Sobol, seed: 1, first: 0, count: 64 };
        let picture = Subject::new(&shown).render(&integrator, samples);
        let is_black = picture.rgb.iter().flatten().all(|&v| v == 0.0);
        assert_eq!(is_black, !movement.in_frame, "{} lamps", lamps.len());
    }
}
