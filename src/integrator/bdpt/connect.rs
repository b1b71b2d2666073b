//! Connections of subpaths: next-event estimation (s = 1), splats (t = 1) and inner edges.

use super::{
    super::{Context, Strategy, direct::LightChoice},
    vertex::Vertex,
};
use crate::{
    bsdf::TransportMode,
    film::{Contribution, Recorder},
    math::{LEAST_DISTANCE2, NodeRgb, Rgb},
    sampler::Sampler,
};

/// Strategies (1, t ≥ 2): samples light points as seen from the last of the t vertices `camera`; returns their
/// number.
pub fn next_event<const N: usize>(
    context: &Context<N>,
    connection: &mut Sampler,
    camera: &[Vertex<N>],
    recorder: &mut impl Recorder<N>,
) -> u64 {
    let t = camera.len();
    let choices = context.choose_lights(connection, t - 1);
    let z = &camera[t - 1];
    let Some(si) = z.surface() else { return 0 };
    if !z.connectible() {
        return 0;
    }
    for LightChoice { id, expected, u } in choices {
        let sampled = context.light(id);
        let light = sampled.light;
        let Some(l) = sampled.sample_li(z.p, u) else { continue };
        let f = z.scatter(l.wi, TransportMode::Radiance);
        if f.value.is_zero() || l.radiance == Rgb::ZERO {
            continue;
        }
        let passed =
            context.scene.transmittance(si.spawn_origin(l.wi), context.scene.light_end(id, &l.at), Some(id));
        if passed == 0.0 {
            continue;
        }
        let h = context.integrator.heuristic;
        let dist2 = light.distance2(l.at.p, z.p);
        // Densities of the light point, m⁻², without the light's choice: as sampled here, and
        // as an origin. Those of a point light are 1.
        let (p_nee, p_origin, pdf_dir) = {
            let (origin, dir) = sampled.pdf_le(&l.at, -l.wi);
            let nee = if light.is_delta() { 1.0 } else { l.pdf.to_area(dist2, l.at.n.dot(l.wi)).0 };
            (f64::from(nee), f64::from(origin.0), dir)
        };
        let s0 = if light.is_delta() {
            0.0
        } else {
            h.apply(f64::from(f.pdf.to_area(dist2, l.at.n.dot(l.wi)).0) / (p_nee * f64::from(expected)))
        };
        // s >= 2 chooses the light once a light subpath.
        let once = f64::from(context.light_subpaths() * sampled.pmf.0 / expected);
        let r = once * p_origin / p_nee * f64::from(pdf_dir.to_area(dist2, z.abs_cos(l.wi)).0) / z.pdf_fwd;
        let s_c = h.apply(r) * z.mis.close(h, f.pdf_rev.0);
        let mis_weight = (1.0 / (1.0 + s0 + s_c)) as f32;
        let from_light = l.radiance * (passed * mis_weight / (l.pdf.0 * expected));
        recorder.add(&Contribution {
            light: id,
            at: l.at,
            value: context.scatter(&z.beta, f.value, si).times(from_light),
            strategy: Strategy::new(1, t),
            mis_weight,
        });
    }
    u64::from(context.light_samples_at(t - 1))
}

/// Strategies (s ≥ 2, t ≥ 2): connects the last of the s vertices `light` with the last of the t
/// vertices `camera`.
pub fn vertices<const N: usize>(
    context: &Context<N>,
    light: &[Vertex<N>],
    camera: &[Vertex<N>],
    recorder: &mut impl Recorder<N>,
) {
    let (s, t) = (light.len(), camera.len());
    let (y, z) = (&light[s - 1], &camera[t - 1]);
    let (Some(y_si), Some(z_si)) = (y.surface(), z.surface()) else { return };
    if !(y.connectible() && z.connectible()) {
        return;
    }
    let d = y.p - z.p;
    let dist2 = d.length_squared();
    if dist2 < LEAST_DISTANCE2 {
        return;
    }
    let w = d / dist2.sqrt();
    let f_z = z.scatter(w, TransportMode::Radiance);
    if f_z.value.is_zero() {
        return;
    }
    // Each side's throughput holds its own cosine about the edge.
    let f_y = y.scatter(-w, TransportMode::Importance);
    if f_y.value.is_zero() {
        return;
    }
    let passed = context.scene.transmittance(z_si.spawn_origin(w), y_si.spawn_origin(-w), None);
    if passed == 0.0 {
        return;
    }
    let h = context.integrator.heuristic;
    let r_z = f64::from(f_y.pdf.to_area(dist2, z.abs_cos(w)).0) / z.pdf_fwd;
    let r_y = f64::from(f_z.pdf.to_area(dist2, y.abs_cos(w)).0) / y.pdf_fwd;
    let s_c = h.apply(r_z) * z.mis.close(h, f_z.pdf_rev.0);
    let s_l = h.apply(r_y) * y.mis.close(h, f_y.pdf_rev.0);
    let mis_weight = (1.0 / (1.0 + s_l + s_c)) as f32;
    let from_light = context.scatter(&y.beta, f_y.value, y_si);
    let value = context.scatter(&z.beta, f_z.value, z_si).product(&from_light);
    recorder.add(&Contribution {
        light: y.light,
        at: y.at,
        value: value.scaled(passed * mis_weight / dist2),
        strategy: Strategy::new(s, t),
        mis_weight,
    });
}

/// Strategies (s, 1): connects a light point and every later vertex of the light subpath to the lens.
pub fn to_camera<const N: usize>(
    context: &Context<N>,
    connection: &mut Sampler,
    camera: &[Vertex<N>],
    light: &[Vertex<N>],
    recorder: &mut impl Recorder<N>,
) {
    light_to_camera(context, connection, camera, recorder);
    let h = context.integrator.heuristic;
    let on_lens = camera[0].p;
    for (s, y) in light.iter().enumerate().skip(1).map(|(i, y)| (i + 1, y)) {
        let Some(si) = y.surface() else { continue };
        if s > context.integrator.max_depth || !y.connectible() {
            continue;
        }
        let Some(c) = context.camera.sample_wi(on_lens, y.p) else { continue };
        let f = y.scatter(c.wi, TransportMode::Importance);
        let value = context.scatter(&y.beta, f.value, si).scaled(c.we.0 / c.dist2);
        if value.is_zero() {
            continue;
        }
        let value = value.scaled(context.scene.transmittance(on_lens, si.spawn_origin(c.wi), None));
        if value.is_zero() {
            continue;
        }
        let r_y = f64::from(c.we.to_area(c.dist2, y.abs_cos(c.wi)).0) / y.pdf_fwd;
        let mut mis = y.mis;
        if s == 2 {
            // Seen by the camera, y_1 is the first vertex there.
            let [first, later] = [1, 2].map(|n| f64::from(context.samples_at(n)));
            mis.previous *= h.apply(first / later);
        }
        let s_l = h.apply(r_y) * mis.close(h, f.pdf_rev.0);
        let mis_weight = (1.0 / (1.0 + s_l)) as f32;
        recorder.splat(
            c.raster,
            &Contribution {
                light: y.light,
                at: y.at,
                value: value.scaled(mis_weight),
                strategy: Strategy::new(s, 1),
                mis_weight,
            },
        );
    }
}

/// Strategy (1, 1): samples a light point as seen from the lens.
fn light_to_camera<const N: usize>(
    context: &Context<N>,
    connection: &mut Sampler,
    camera: &[Vertex<N>],
    recorder: &mut impl Recorder<N>,
) {
    let u_light = connection.next_1d();
    let u = connection.next_2d();
    let _spare = connection.next_1d();
    let Some((id, pmf, _)) = context.plan.lights.sample(u_light) else { return };
    let sampled = context.light(id);
    let light = sampled.light;
    if light.is_delta() || !light.camera_visible {
        return;
    }
    let Some(l) = sampled.sample_li(camera[0].p, u) else { return };
    let Some(c) = context.camera.sample_wi(camera[0].p, l.at.p) else { return };
    let p_nee = context.samples_at(0) * l.pdf.0 * pmf.0;
    let passed = context.scene.transmittance(camera[0].p, context.scene.light_end(id, &l.at), Some(id));
    let value = NodeRgb::<N>::ONE.times(l.radiance * (passed * c.we.0 / p_nee));
    if value.is_zero() {
        return;
    }
    let s0 = context.integrator.heuristic.apply(f64::from(c.we.0) / f64::from(p_nee));
    let mis_weight = (1.0 / (1.0 + s0)) as f32;
    recorder.splat(
        c.raster,
        &Contribution {
            light: id,
            at: l.at,
            value: value.scaled(mis_weight),
            strategy: Strategy::new(1, 1),
            mis_weight,
        },
    );
}
