//! Weights of the bidirectional strategies straight from their definition.
//!
//! [`reference_weight`] multiplies out the density of every strategy of a complete path, in O(n²);
//! the renderer's recurrences must give the same.

use glam::{UVec2, Vec3};

use lightopt_embree::{
    bsdf::TransportMode,
    film::{Contribution, Recorder},
    integrator::{
        Context,
        bdpt::{Vertex, Workspace, sample},
    },
    light::{LightId, LightPoint},
    sampler::Sampler,
    scene::SurfaceInteraction,
};

/// A vertex of a complete path.
#[derive(Clone, Copy, Debug)]
pub struct PathVertex<'a> {
    /// Position, metres.
    pub p: Vec3,
    /// The surface; `None` on the light and on the lens.
    pub si: Option<SurfaceInteraction<'a>>,
    /// Whether the path is scattered by a delta lobe at this vertex.
    pub delta: bool,
}

/// The end of a path on a light.
#[derive(Clone, Copy, Debug)]
pub struct LightEnd {
    /// The light.
    pub id: LightId,
    /// The point on it.
    pub at: LightPoint,
}

/// Weight of the strategy with `s` light vertices for the path `x` (light
/// first, lens last). \[Veach97\] eq. 9.8 with densities by eq. 10.6.
pub fn reference_weight(context: &Context, end: LightEnd, x: &[PathVertex], s: usize) -> f64 {
    let densities = densities(context, end, x);
    let h = context.integrator.heuristic;
    let total: f64 = densities.iter().map(|&p| h.apply(p)).sum();
    h.apply(densities[s]) / total
}

/// Area-product densities of all strategies of a path, s = 0 first, times the
/// number of samples; zero where the strategy does not exist. Delta densities count as one.
pub fn densities(context: &Context, end: LightEnd, x: &[PathVertex]) -> Vec<f64> {
    let k = x.len() - 1;
    let n_light_samples = f64::from(context.samples_at(k - 1));
    let n_light_subpaths = f64::from(context.light_subpaths());
    let sampled = context.light(end.id);
    let light = sampled.light;
    let pmf = f64::from(sampled.pmf.0);
    let is_infinite = light.is_infinite();
    let direction = |from: usize, to: usize| match (from, to) {
        (0, _) if is_infinite => end.at.n,
        (_, 0) if is_infinite => -end.at.n,
        _ => (x[to].p - x[from].p).normalize(),
    };
    let distance2 = |from: usize, to: usize| match from.min(to) {
        0 => light.distance2(x[0].p, x[from.max(to)].p),
        _ => x[to].p.distance_squared(x[from].p),
    };
    let first = direction(0, 1);
    let cos = |i: usize, w: Vec3| match (&x[i].si, i) {
        (Some(si), _) => si.ng.dot(w).abs(),
        (None, 0) if light.is_delta() => 1.0,
        (None, 0) => end.at.n.dot(w).abs(),
        (None, _) => 1.0,
    };
    let to_area = |from: usize, to: usize, pdf: f32| {
        f64::from(pdf) * f64::from(cos(to, direction(from, to))) / f64::from(distance2(from, to))
    };
    let scattered = |previous: usize, at: usize, next: usize| match &x[at].si {
        Some(si) if x[at].delta => {
            let is_found = previous > next || !si.is_bent(direction(at, next));
            f32::from(is_found)
        }
        Some(si) => {
            // The light comes first.
            let mode = if previous < next { TransportMode::Importance } else { TransportMode::Radiance };
            si.scatter(direction(at, previous), direction(at, next), mode).pdf.0
        }
        None => 0.0,
    };
    let (origin, emission) = sampled.pdf_le(&end.at, first);
    let from_light: Vec<f64> = (0..k)
        .map(|i| match i {
            0 => pmf * f64::from(origin.0),
            1 => to_area(0, 1, emission.0),
            _ => to_area(i - 1, i, scattered(i - 2, i - 1, i)),
        })
        .collect();
    let from_camera: Vec<f64> = (0..k)
        .map(|i| {
            if i + 1 == k {
                to_area(k, i, context.camera.pdf_we(direction(k, i)).0)
            } else {
                to_area(i + 1, i, scattered(i + 2, i + 1, i))
            }
        })
        .collect();
    let next_event =
        pmf * if light.is_delta() { 1.0 } else { to_area(1, 0, sampled.pdf_li(x[1].p, &end.at).0) };
    (0..=k)
        .map(|s| {
            let exists = match s {
                0 => !light.is_delta(),
                _ => !x[s - 1].delta && !x[s].delta,
            };
            let light_side: f64 = match s {
                0 => 1.0,
                1 => n_light_samples * next_event,
                _ => n_light_subpaths * from_light[..s].iter().product::<f64>(),
            };
            let camera_side: f64 = from_camera[s..].iter().product();
            if exists { light_side * camera_side } else { 0.0 }
        })
        .collect()
}

/// A contribution with its weight recomputed.
#[derive(Clone, Copy, Debug)]
pub struct Compared {
    /// The contribution, with the weight it was given.
    pub contribution: Contribution,
    /// The reference weight.
    pub reference: f64,
    /// Length of the path's shortest edge between surfaces, metres: the reference
    /// takes directions from positions, which on a short edge is inexact.
    pub shortest_edge: f32,
}

/// Takes one bidirectional sample and compares the weights of its contributions.
pub fn compare_weights(context: &Context, sampler: &mut Sampler, pixel: UVec2) -> Vec<Compared> {
    let mut found: Vec<Contribution> = Vec::new();
    let mut workspace = Workspace::default();
    let mut recorder = |_raster: Option<glam::Vec2>, c: &Contribution| found.push(*c);
    sample(context, sampler, pixel, &mut workspace, as_recorder(&mut recorder));
    found
        .into_iter()
        .map(|c| {
            let (s, t) = (usize::from(c.strategy.s), usize::from(c.strategy.t));
            let light_point = PathVertex { p: c.at.p, si: None, delta: false };
            let mut x = Vec::new();
            let camera_vertices = match s {
                0 => {
                    x.push(light_point);
                    &workspace.camera[..t - 1]
                }
                1 => {
                    x.push(light_point);
                    &workspace.camera[..t]
                }
                _ => {
                    x.push(light_point);
                    x.extend((1..s).map(|i| inner(&workspace.light[i], i + 1 == s)));
                    &workspace.camera[..t]
                }
            };
            let last = camera_vertices.len() - 1;
            x.extend(camera_vertices.iter().enumerate().rev().map(|(i, v)| inner(v, i == last && s > 0)));
            let end = LightEnd { id: c.light, at: c.at };
            let surfaces = &x[1..x.len() - 1];
            Compared {
                contribution: c,
                reference: reference_weight(context, end, &x, s),
                shortest_edge: surfaces
                    .windows(2)
                    .map(|e| e[0].p.distance(e[1].p))
                    .fold(f32::INFINITY, f32::min),
            }
        })
        .collect()
}

/// A subpath's vertex within a path; where a connection ends the lobe sampled
/// onward does not matter.
fn inner<'a>(v: &Vertex<'a>, is_end: bool) -> PathVertex<'a> {
    PathVertex { p: v.p, si: v.surface().copied(), delta: v.delta && !is_end }
}

fn as_recorder<F: FnMut(Option<glam::Vec2>, &Contribution)>(f: &mut F) -> &mut impl Recorder {
    f
}
