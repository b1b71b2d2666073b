//! Finds the lights that give a scene a look, and records how.
//!
//! `cargo run --release --example optimise [SCENE [TARGET]]`: a target is `high-key`, `low-key`
//! or a target file. The run directory is `runs/example`.

use std::{env, error::Error, path::PathBuf};

use glam::UVec2;
use lightopt_embree::{
    design::{self, Gradient, Job, Progress, Reporter, RunOptions, Subject},
    import::{self, Loaded},
    integrator::{Integrator, Observer},
    lighting::Lighting,
    math::Measure,
    objective::Target,
    sampler::SamplerKind,
};

/// Tells on standard error what a run is about.
struct Talkative;

impl Observer for Talkative {
    fn advance(&self, _rows: u64) {}
}

impl Reporter for Talkative {
    fn note(&self, text: &str) {
        eprintln!("{text}");
    }
    fn stage(&self, name: &str, _rows: Option<u64>) {
        eprintln!("{name} …");
    }
    fn evaluated(&self, _progress: &Progress) {}
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = env::args().skip(1);
    let basket = || concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/fruit_basket.obj").into();
    let path = PathBuf::from(arguments.next().unwrap_or_else(basket));
    let target = Target::resolve(&arguments.next().unwrap_or_else(|| "high-key".into()))?;

    // The scene, and what its author lets vary within which bounds.
    let Loaded { scene, constraints, .. } = import::load(&path)?;
    let authored = Lighting::authored(&scene);
    let subject = Subject {
        scene: &scene,
        path: &path,
        authored: &authored,
        constraints: &constraints,
        rig: None,
        time_left: None,
    };

    // As the command line has them, but for smaller pictures.
    let options = RunOptions {
        jobs: vec![Job { target, out: "runs/example".into() }],
        gradient: Gradient::Basis,
        global: false,
        tolerance: 0.01,
        time_limit: None,
        cache: None,
        memory: 2 << 30,
        integrator: Integrator::default(),
        sampler: SamplerKind::Sobol,
        weights: None,
        measure: Measure::default(),
        size: UVec2::new(320, 240),
        work_size: UVec2::new(64, 48),
        spp: None,
        final_spp: 32,
        final_noise: 0.02,
        denoise: true,
        free: constraints.free.clone(),
        seed: 0,
        max_evaluations: 30,
        force: true,
        products: None,
        basis_file: None,
        live_file: None,
        alternatives: false,
        command: Vec::new(),
    };
    for report in design::run(subject, &options, &Talkative)? {
        // Measured in a render whose samples chose nothing.
        let (f_q, error) = (report.check.evaluation.f_q, report.check.error_bar());
        println!("f_q {:.3} at the start, {f_q:.3} ± {error:.3} found", report.initial.evaluation.f_q);
        for (variable, value) in report.variables.variables.iter().zip(&report.x) {
            println!("{:<20} {value:>10.4} {}", variable.name, variable.unit);
        }
    }
    Ok(())
}
