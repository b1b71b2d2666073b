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
pub mod verify;
pub mod vertex;
pub mod weight;

use glam::UVec2;

use super::{Integrator, Values};
use crate::{
    film::Recorder,
    sampler::{Sampler, Stream},
    scene::Scene,
};
pub use vertex::Vertex;

/// Memory of a thread, reused from sample to sample.
#[derive(Debug, Default)]
pub struct Workspace<'a, const N: usize = 1> {
    /// Camera subpath, `z_0` first.
    pub camera: Vec<Vertex<'a, N>>,
    /// Light subpath, `y_0` first.
    pub light: Vec<Vertex<'a, N>>,
}

/// Traces both subpaths of a sample and records every connection. With
/// `trace_camera` off only the light subpath's splats are made.
#[allow(clippy::too_many_arguments)]
pub fn sample<'a, const N: usize>(
    integrator: &Integrator,
    scene: &'a Scene,
    nodes: &Values<N>,
    sampler: &mut Sampler,
    pixel: UVec2,
    trace_camera: bool,
    workspace: &mut Workspace<'a, N>,
    recorder: &mut impl Recorder<N>,
) {
    let Workspace { camera, light } = workspace;
    let mut connection = sampler.clone();
    connection.start_stream(Stream::Connection);
    let mut light_sampler = sampler.clone();
    let is_lit = light_sampler.start_one_of(Stream::Light, integrator.camera_subpaths);

    subpath::trace_camera(integrator, scene, nodes, sampler, pixel, camera, trace_camera, recorder);
    let connect = connect::Connect { integrator, scene, nodes };
    if is_lit {
        subpath::trace_light(integrator, scene, nodes, &mut light_sampler, light);
        connect.to_camera(&mut connection, camera, light, recorder);
    } else {
        light.clear();
        connection.skip_4d();
    }
    if !trace_camera {
        return;
    }
    for t in 2..=camera.len() {
        connect.next_event(&mut connection, camera, t, recorder);
        let s_max = light.len().min(integrator.max_depth + 1 - t);
        for s in 2..=s_max {
            connect.vertices(light, s, camera, t, recorder);
        }
    }
}
