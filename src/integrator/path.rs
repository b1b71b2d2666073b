//! Unidirectional path tracing with next-event estimation.
//!
//! # References
//! \[Kajiya86\]; \[Veach97\] 9.2 (multiple importance sampling).

use glam::UVec2;

use super::{Context, Heuristic, Strategy, Work, direct::LightChoice};
use crate::{
    bsdf::TransportMode,
    film::{Contribution, Recorder},
    math::{NodeRgb, Rgb, SolidAnglePdf},
    sampler::{Sampler, Stream},
    scene::SurfaceInteraction,
};

/// Traces one camera path through `pixel` and records the contributions of all lights that it crosses
/// or samples; returns its work.
pub fn sample<const N: usize>(
    context: &Context<N>,
    sampler: &mut Sampler,
    pixel: UVec2,
    recorder: &mut impl Recorder<N>,
) -> Work {
    let mut work = Work { samples: 1, ..Work::default() };
    let (mut org, mut dir) = context.camera_ray(sampler, pixel);
    let mut connection = sampler.clone();
    connection.start_stream(Stream::Connection);

    let heuristic = context.integrator.heuristic;
    let max_depth = context.integrator.max_depth;
    let mut beta = NodeRgb::ONE;
    // Density of `dir`; `None` where no other strategy could have sampled the light.
    let mut pdf: Option<SolidAnglePdf> = None;
    for n_edges in 1..=max_depth {
        let edge = context.trace(org, dir, None);
        work.edges += 1;
        context.for_each_crossing(&edge, |id, light, c| {
            if n_edges == 1 && !light.camera_visible {
                return;
            }
            let mis_weight = pdf.map_or(1.0, |p| {
                let n = context.samples_at(n_edges - 1);
                let sampled = context.light(id);
                weight(heuristic, p.0, n * sampled.pmf.0 * sampled.pdf_li(org, &c.at).0)
            });
            recorder.add(&Contribution {
                light: id,
                at: c.at,
                value: beta.times(c.radiance * mis_weight),
                strategy: Strategy::new(0, n_edges + 1),
                mis_weight,
            });
        });
        let Some(hit) = edge.hit else { break };
        if n_edges == max_depth {
            break;
        }
        let si = hit.si;
        let wo = -dir;
        work.light_samples += next_event(context, &mut connection, &si, wo, &beta, n_edges, recorder);

        let uc = sampler.next_1d();
        let u = sampler.next_2d();
        let u_roulette = sampler.next_1d();
        let Some(s) = si.sample(wo, uc, u, TransportMode::Radiance) else { break };
        beta = context.scatter(&beta, s.weight, &si);
        let Some(survivor) = context.roulette(n_edges, beta.largest(), u_roulette) else { break };
        beta = beta.scaled(survivor);
        if beta.is_zero() {
            break;
        }
        pdf = (!s.delta).then_some(s.pdf);
        org = si.spawn_origin(s.wi);
        dir = s.wi;
    }
    work
}

/// Next-event estimation at `si`, the end of a camera subpath of `n_edges` edges and throughput `beta`; returns
/// the number of light samples.
fn next_event<const N: usize>(
    context: &Context<N>,
    connection: &mut Sampler,
    si: &SurfaceInteraction,
    wo: glam::Vec3,
    beta: &NodeRgb<N>,
    n_edges: usize,
    recorder: &mut impl Recorder<N>,
) -> u64 {
    let choices = context.choose_lights(connection, n_edges);
    if !si.bsdf.has_non_delta() {
        return 0;
    }
    for LightChoice { id, expected, u } in choices {
        let light = context.light(id);
        let Some(l) = light.sample_li(si.p, u) else { continue };
        let density = l.pdf.0 * expected;
        let f = si.scatter(wo, l.wi, TransportMode::Radiance);
        if f.value.is_zero() || l.radiance == Rgb::ZERO {
            continue;
        }
        let passed =
            context.scene.transmittance(si.spawn_origin(l.wi), context.scene.light_end(id, &l.at), Some(id));
        if passed == 0.0 {
            continue;
        }
        let hit_pdf = if light.light.is_delta() { 0.0 } else { f.pdf.0 };
        let mis_weight = weight(context.integrator.heuristic, density, hit_pdf);
        recorder.add(&Contribution {
            light: id,
            at: l.at,
            value: context.scatter(beta, f.value, si).times(l.radiance * (passed * mis_weight / density)),
            strategy: Strategy::new(1, n_edges + 1),
            mis_weight,
        });
    }
    u64::from(context.light_samples_at(n_edges))
}

/// Weight of a strategy with density `p` against another with density `q`.
fn weight(heuristic: Heuristic, p: f32, q: f32) -> f32 {
    (1.0 / (1.0 + heuristic.apply(f64::from(q) / f64::from(p)))) as f32
}
