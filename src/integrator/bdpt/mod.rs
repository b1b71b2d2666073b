//! Bidirectional path tracing with pass-through lights.
//!
//! Each sample traces a camera and a light subpath and connects every pair of
//! their vertices. Strategies (s, t):
//!
//! * s = 0: the camera subpath crosses a light; the crossing is a vertex of
//!   its own path only, and the ray goes on;
//! * s = 1: a light point sampled as seen from the camera vertex (its density
//!   is not that of the light subpaths' origins);
//! * s ≥ 2, t ≥ 2: connections;
//! * t = 1: light vertices connected to the pinhole, splatted.
//!
//! # References
//! \[Veach97\] chapter 10; \[Georgiev12\] and \[vanAntwerpen11\] (weights in
//! constant time by recurrence, see [`weight`]).

pub mod connect;
pub mod subpath;
pub mod vertex;
pub mod weight;

use glam::UVec2;

use super::{Context, Work};
use crate::{
    film::Recorder,
    sampler::{Sampler, Stream},
};
pub use vertex::Vertex;

/// Subpaths of a sample; their memory is reused from sample to sample.
#[derive(Debug, Default)]
pub struct Workspace<'a, const N: usize = 1> {
    /// Camera subpath, `z_0` first.
    pub camera: Vec<Vertex<'a, N>>,
    /// Light subpath, `y_0` first.
    pub light: Vec<Vertex<'a, N>>,
}

/// Traces both subpaths of a sample through `pixel` and records the contributions of all strategies; returns
/// their work.
pub fn sample<'a, const N: usize>(
    context: &Context<'a, N>,
    sampler: &mut Sampler,
    pixel: UVec2,
    workspace: &mut Workspace<'a, N>,
    recorder: &mut impl Recorder<N>,
) -> Work {
    let Workspace { camera, light } = workspace;
    let mut connection = sampler.clone();
    connection.start_stream(Stream::Connection);
    let mut light_sampler = sampler.clone();
    let is_lit = light_sampler.start_one_of(Stream::Light, context.camera_subpaths());

    subpath::trace_camera(context, sampler, pixel, camera, recorder);
    if is_lit {
        subpath::trace_light(context, &mut light_sampler, light);
        connect::to_camera(context, &mut connection, camera, light, recorder);
    } else {
        light.clear();
        connection.skip_4d();
    }
    let mut work = Work {
        samples: 1,
        edges: (camera.len() + light.len()) as u64,
        light_samples: 0,
        connections: light.len() as u64,
    };
    for t in 2..=camera.len() {
        work.light_samples += connect::next_event(context, &mut connection, &camera[..t], recorder);
        let s_max = light.len().min(context.integrator.max_depth + 1 - t);
        for s in 2..=s_max {
            connect::vertices(context, &light[..s], &camera[..t], recorder);
        }
        work.connections += s_max.saturating_sub(1) as u64;
    }
    work
}
