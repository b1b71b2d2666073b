//! Random walks from the camera and from the lights.

use glam::{UVec2, Vec3};

use super::{
    super::{Context, Heuristic, Strategy},
    vertex::{Vertex, VertexKind},
    weight::Partial,
};
use crate::{
    bsdf::TransportMode,
    film::{Contribution, Recorder},
    light::LightPoint,
    math::{NodeRgb, SolidAnglePdf, distance2},
    sampler::Sampler,
    scene::Edge,
};

/// Traces a camera subpath into `out`, `z_0` first, and records the lights that it crosses (s = 0).
pub fn trace_camera<'a, const N: usize>(
    context: &Context<'a, N>,
    sampler: &mut Sampler,
    pixel: UVec2,
    out: &mut Vec<Vertex<'a, N>>,
    recorder: &mut impl Recorder<N>,
) {
    let (org, dir) = context.camera_ray(sampler, pixel);
    out.clear();
    out.push(Vertex {
        kind: VertexKind::Camera,
        p: org,
        wo: Vec3::ZERO,
        beta: NodeRgb::ONE,
        light: 0,
        at: LightPoint { p: Vec3::ZERO, n: Vec3::ZERO, rho: 0.0, element: 0 },
        pdf_fwd: 1.0,
        delta: false,
        mis: Partial::default(),
    });
    let walk = Walk {
        org,
        dir,
        beta: NodeRgb::ONE,
        pdf: context.camera.pdf_we(dir),
        // z_1 can be connected to the lens; t = 0 does not exist.
        mis: Partial { previous: 1.0, geometry: 0.0, inner: 0.0 },
        cos_over_pdf: 0.0,
        mode: TransportMode::Radiance,
    };
    walk.run(context, sampler, out, |walk, n_edges, from, edge| {
        cross_lights(context, walk, n_edges, from, edge, recorder);
    });
}

/// Records the lights that an edge of a camera subpath crosses (s = 0).
fn cross_lights<const N: usize>(
    context: &Context<N>,
    walk: &Walk<N>,
    n_edges: usize,
    from: &Vertex<N>,
    edge: &Edge,
    recorder: &mut impl Recorder<N>,
) {
    let h = context.integrator.heuristic;
    context.for_each_crossing(edge, |id, light, c| {
        if n_edges == 1 && !light.camera_visible {
            return;
        }
        let sampled = context.light(id);
        let pmf = f64::from(sampled.pmf.0);
        let dist2 = light.distance2(c.at.p, from.p);
        let cos = c.at.n.dot(walk.dir);
        let p_hit = f64::from(walk.pdf.to_area(dist2, cos).0);
        // The silhouette of a sphere, touched to a rounding: all densities are 0, their ratios no numbers.
        if p_hit == 0.0 {
            return;
        }
        let p_nee = pmf * f64::from(sampled.pdf_li(from.p, &c.at).to_area(dist2, cos).0);
        let (origin, emission) = sampled.pdf_le(&c.at, -walk.dir);
        let partial = walk.partial(h, dist2);
        // s = 1 has its own density of the light point, s >= 2 that of an origin.
        let n_nee = f64::from(context.samples_at(n_edges - 1));
        let s1 = h.apply(n_nee * p_nee / p_hit) * partial.previous;
        let p_origin = f64::from(context.light_subpaths()) * pmf * f64::from(origin.0);
        let s2 = h.apply(p_origin / p_hit) * (partial.close(h, emission.0) - partial.previous);
        let mis_weight = (1.0 / (1.0 + s1 + s2)) as f32;
        recorder.add(&Contribution {
            light: id,
            at: c.at,
            value: walk.beta.times(c.radiance * mis_weight),
            strategy: Strategy::new(0, n_edges + 1),
            mis_weight,
        });
    });
}

/// Traces a light subpath into `out`, `y_0` first; it is empty without lights.
pub fn trace_light<'a, const N: usize>(
    context: &Context<'a, N>,
    sampler: &mut Sampler,
    out: &mut Vec<Vertex<'a, N>>,
) {
    out.clear();
    let u_light = sampler.next_1d();
    let _spare = sampler.next_1d();
    let u_pos = sampler.next_2d();
    let u_dir = sampler.next_2d();
    let _spare = sampler.next_2d();
    let Some((id, pmf, _)) = context.plan.lights.sample(u_light) else { return };
    let sampled = context.light(id);
    let light = sampled.light;
    let Some(e) = sampled.sample_le(u_pos, u_dir) else { return };
    let n = context.light_subpaths();
    let origin = pmf.0 * e.pdf_pos.0;
    let cos = if light.is_delta() { 1.0 } else { e.at.n.dot(e.dir).abs() };
    out.push(Vertex {
        kind: VertexKind::Light(id),
        p: e.at.p,
        wo: Vec3::ZERO,
        beta: NodeRgb::ONE,
        light: id,
        at: e.at,
        pdf_fwd: f64::from(origin),
        delta: false,
        mis: Partial::default(),
    });
    let walk = Walk {
        org: context.scene.light_end(id, &e.at),
        dir: e.dir,
        beta: NodeRgb::ONE.times(e.radiance * (cos / (n * origin * e.pdf_dir.0))),
        pdf: e.pdf_dir,
        // c_0: a light that can be crossed has s = 0, with every camera subpath.
        mis: Partial {
            previous: 0.0,
            geometry: 0.0,
            inner: if light.is_delta() {
                0.0
            } else {
                context.integrator.heuristic.apply(1.0 / f64::from(n))
            },
        },
        cos_over_pdf: f64::from(cos) / f64::from(origin),
        mode: TransportMode::Importance,
    };
    walk.run(context, sampler, out, |_, _, _, _| {});
}

/// State of a random walk: the ray that leaves the last vertex, its throughput and densities.
struct Walk<const N: usize> {
    org: Vec3,
    dir: Vec3,
    beta: NodeRgb<N>,
    /// Density of `dir`, sr⁻¹; for a delta lobe its probability.
    pdf: SolidAnglePdf,
    /// Weight sums of the next vertex, without `geometry`, which needs its distance.
    mis: Partial,
    /// |cos θ| of `dir` over `pdf_fwd`, at the last vertex.
    cos_over_pdf: f64,
    mode: TransportMode,
}

impl<const N: usize> Walk<N> {
    /// Weight sums of a next vertex at the squared distance `dist2`, m².
    fn partial(&self, h: Heuristic, dist2: f32) -> Partial {
        Partial { geometry: h.apply(self.cos_over_pdf / f64::from(dist2)), ..self.mis }
    }

    /// Walks until absorption, escape or the depth limit. `on_edge` sees each
    /// edge with its number and its first vertex.
    fn run<'a>(
        mut self,
        context: &Context<'a, N>,
        sampler: &mut Sampler,
        out: &mut Vec<Vertex<'a, N>>,
        mut on_edge: impl FnMut(&Self, usize, &Vertex<'a, N>, &Edge),
    ) {
        let h = context.integrator.heuristic;
        let max_depth = context.integrator.max_depth;
        let is_camera = self.mode == TransportMode::Radiance;
        let start = self.beta.largest().max_element();
        loop {
            let n_edges = out.len();
            // The last edge of a path can only cross a light: light subpaths need not walk it.
            if n_edges == max_depth && !is_camera {
                return;
            }
            let from = out[n_edges - 1];
            let origin = match from.kind {
                VertexKind::Light(id) => Some(id),
                _ => None,
            };
            let edge = context.trace(self.org, self.dir, origin);
            on_edge(&self, n_edges, &from, &edge);
            let Some(hit) = edge.hit else { return };
            if n_edges == max_depth {
                return;
            }
            let si = hit.si;
            let wo = -self.dir;
            let light = origin.map(|id| context.light(id));
            let dist2 = light.map_or_else(|| distance2(si.p, from.p), |l| l.light.distance2(from.p, si.p));
            let mut mis = self.partial(h, dist2);
            if let Some(sampled) = light {
                // c_1 on the light side: the density of y_0 as seen from y_1, a later vertex of the
                // camera subpath, over its own.
                let n = f64::from(context.samples_at(2) / context.light_subpaths());
                let expected = n * f64::from(sampled.pmf.0);
                mis.previous = if sampled.light.is_delta() {
                    h.apply(n)
                } else {
                    let nee = sampled.pdf_li(si.p, &from.at).to_area(dist2, from.at.n.dot(wo));
                    h.apply(expected * f64::from(nee.0) / from.pdf_fwd)
                };
            }
            let mut vertex = Vertex {
                kind: VertexKind::Surface(si),
                p: si.p,
                wo,
                beta: self.beta,
                light: from.light,
                at: from.at,
                pdf_fwd: f64::from(self.pdf.to_area(dist2, si.ng.dot(wo)).0),
                delta: false,
                mis,
            };

            let uc = sampler.next_1d();
            let u = sampler.next_2d();
            let u_roulette = sampler.next_1d();
            let sample = si.sample(wo, uc, u, self.mode);
            vertex.delta = sample.is_some_and(|s| s.delta);
            out.push(vertex);
            let Some(s) = sample else { return };
            self.beta = context.scatter(&self.beta, s.weight, &si);
            let throughput = self.beta.largest() / start;
            let Some(survivor) = context.roulette(n_edges, throughput, u_roulette) else { return };
            self.beta = self.beta.scaled(survivor);
            if self.beta.is_zero() {
                return;
            }
            self.mis = mis.extend(h, s.pdf_rev.0, s.delta);
            self.cos_over_pdf = f64::from(si.ng.dot(s.wi).abs()) / vertex.pdf_fwd;
            self.pdf = s.pdf;
            self.org = si.spawn_origin(s.wi);
            self.dir = s.wi;
        }
    }
}
