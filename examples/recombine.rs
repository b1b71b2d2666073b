//! Renders a transport basis once, and recombines pictures of two lightings from it.
//!
//! `cargo run --release --example recombine [SCENE]` writes `authored.png` and `alone.png`.

use std::{env, error::Error, path::Path, time::Instant};

use glam::UVec2;
use lightopt_embree::{
    audit::picture::beauty,
    film::image_file::write_png,
    import::{self, Loaded},
    integrator::{Integrator, View},
    light::SizeDensity,
    lighting::{Lighting, SamplingPlan},
    sampler::SamplerKind,
    transport::{Knots, Layout, SizeBins, Source, TransportBasis, ValueNodes},
    variables::Fitted,
};

/// Independent renders of the basis, from which the noise of its pictures can be told.
const REPLICATES: usize = 4;
/// Samples per pixel of each of them.
const SPP: u32 = 8;
/// Size knots per light: between two of them a light's edge is feathered.
const KNOTS: usize = 14;

fn main() -> Result<(), Box<dyn Error>> {
    let basket = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/fruit_basket.obj").into();
    let Loaded { scene, constraints, .. } =
        import::load(Path::new(&env::args_os().nth(1).unwrap_or(basket)))?;
    let camera = scene.camera.resized(UVec2::new(160, 120));
    let view = View { scene: &scene, camera: &camera };

    // The sizes that each light may take, from the geometry around it.
    let authored = Lighting::authored(&scene);
    let Fitted { lighting, sizes, .. } = Fitted::new(view, &authored, &constraints)?;

    // Keeps every size of every light apart, and the background at one value. Samples go to all
    // sizes, so that any of them can be asked for.
    let mut plan = SamplingPlan::uniform(&lighting);
    let mut bins = Vec::new();
    for ((range, q), &size) in sizes.iter().zip(&mut plan.sizes).zip(&lighting.size) {
        bins.push(match *range {
            None => SizeBins::Fixed(size as f32),
            Some([least, most]) => {
                *q = SizeDensity::any_size([least, most]);
                SizeBins::Free(Knots::geometric(least.into(), most.into(), KNOTS))
            }
        });
    }
    let layout = Layout::new(camera.size(), bins, ValueNodes::new(lighting.value, 1));
    println!("{} MiB of tables", layout.table_memory(REPLICATES) >> 20);

    let clock = Instant::now();
    let mut basis = TransportBasis::new(layout, REPLICATES);
    let integrator = Integrator::default();
    let source = Source { view, plan: &plan, integrator: &integrator, sampler: SamplerKind::Sobol, seed: 0 };
    basis.render(source, SPP, &())?;
    println!("rendered in {:.1} s", clock.elapsed().as_secs_f64());

    // The first light alone, as large as it may be, with the flux that it had.
    let mut alone = Lighting { radiance: vec![0.0; lighting.n_lights()], ..lighting.clone() };
    alone.size[0] = sizes[0].map_or(lighting.size[0], |[_, most]| f64::from(most));
    alone.radiance[0] = lighting.radiance[0] * (lighting.size[0] / alone.size[0]).powi(2);
    for (name, x) in [("authored.png", &lighting), ("alone.png", &alone)] {
        let clock = Instant::now();
        let picture = basis.picture(x);
        println!("{name}: recombined in {:.1} ms", 1e3 * clock.elapsed().as_secs_f64());
        write_png(Path::new(name), &beauty(&picture), x.exposure)?;
    }
    Ok(())
}
