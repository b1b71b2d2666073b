//! Renders a scene with the lights that its author gave it.
//!
//! `cargo run --release --example render [SCENE [PICTURE.png]]`

use std::{env, error::Error, path::PathBuf};

use glam::UVec2;
use lightopt_embree::{
    audit::picture::beauty,
    film::{RgbFilm, image_file::write_png},
    import::{self, Loaded},
    integrator::{Integrator, Samples, View},
    lighting::{Lighting, SamplingPlan},
    math::display::luminance,
    sampler::SamplerKind,
};

/// Samples per pixel.
const SPP: u32 = 32;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = env::args_os().skip(1).map(PathBuf::from);
    let basket = || concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/fruit_basket.obj").into();
    let path = arguments.next().unwrap_or_else(basket);
    let output = arguments.next().unwrap_or_else(|| "render.png".into());

    // An OBJ or glTF with its sidecar; a scene without one is staged. It does not change any more.
    let Loaded { scene, warnings, .. } = import::load(&path)?;
    warnings.iter().for_each(|warning| eprintln!("{warning}"));

    // What varies between pictures of a scene is a value beside it, and so is what steers samples.
    let lighting = Lighting::authored(&scene);
    let plan = SamplingPlan::for_picture(&lighting);

    // The author's camera, with a smaller film.
    let camera = scene.camera.resized(UVec2::new(320, 240));
    let view = View { scene: &scene, camera: &camera };

    // Bidirectional path tracing with paths of at most eight edges, on all processors.
    let integrator = Integrator::default();
    let samples = Samples { sampler: SamplerKind::Sobol, seed: 0, first: 0, count: SPP };
    let mut film = RgbFilm::by_light(camera.size(), &lighting);
    integrator.render(view, &lighting, &plan, &mut film, samples, &())?;

    // Linear radiance; the PNG is encoded for the display.
    let picture = film.develop(&lighting, SPP);
    write_png(&output, &beauty(&picture), lighting.exposure)?;
    println!("{}", output.display());

    // The film has kept the lights apart.
    let mean = |rgb: &[[f32; 3]]| rgb.iter().map(|&c| luminance(c)).sum::<f64>() / rgb.len() as f64;
    for (light, share) in scene.lights.iter().zip(&picture.lights) {
        println!("{:>5.1} % of the light is from `{}`", 100.0 * mean(share) / mean(&picture.rgb), light.name);
    }
    Ok(())
}
