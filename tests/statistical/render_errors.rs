//! Renders that must not pass for pictures.

use lightopt_embree::{
    film::{Picture, RgbFilm},
    integrator::{Integrator, IntegratorKind, Observer, RenderError, Samples, View},
    lighting::{Lighting, SamplingPlan},
    math::Rgb,
    sampler::SamplerKind,
    scene::Scene,
};

use crate::support::scenes;

const SAMPLES: Samples = Samples { sampler: SamplerKind::Sobol, seed: 1, first: 0, count: 4 };

fn render(
    scene: &Scene,
    lighting: &Lighting,
    kind: IntegratorKind,
    observer: &impl Observer,
) -> Result<Picture, RenderError> {
    let integrator = Integrator { kind, ..Integrator::default() };
    let view = View { scene, camera: &scene.camera };
    let mut film = RgbFilm::by_light(scene.camera.size(), lighting);
    integrator.render(view, lighting, &SamplingPlan::uniform(lighting), &mut film, SAMPLES, observer)?;
    Ok(film.develop(lighting, SAMPLES.count))
}

/// Cancels after some rows.
struct After(std::sync::atomic::AtomicU64, u64);

impl Observer for After {
    fn advance(&self, rows: u64) {
        self.0.fetch_add(rows, std::sync::atomic::Ordering::Relaxed);
    }
    fn cancelled(&self) -> bool {
        self.0.load(std::sync::atomic::Ordering::Relaxed) >= self.1
    }
}

#[test]
fn a_render_ends_when_its_observer_says_so() {
    let scene = scenes::cornell((16, 16));
    let lighting = Lighting::authored(&scene);
    for kind in [IntegratorKind::Path, IntegratorKind::Bdpt] {
        for rows in [0, 5] {
            let observer = After(0.into(), rows);
            assert_eq!(render(&scene, &lighting, kind, &observer).unwrap_err(), RenderError::Cancelled);
            let done = observer.0.into_inner();
            assert!(done < 16, "{done} rows, after {rows} were enough");
        }
    }
}

#[test]
fn a_light_that_is_no_number_is_an_error_and_no_picture() {
    let mut scene = scenes::cornell((16, 16));
    scene.lights[0].color = Rgb::new(1.0, f32::INFINITY, 1.0);
    let lighting = Lighting::authored(&scene);
    for kind in [IntegratorKind::Path, IntegratorKind::Bdpt] {
        let error = render(&scene, &lighting, kind, &()).unwrap_err();
        let RenderError::NonFinite { dropped, samples } = error else { panic!("{error:?}") };
        assert!(dropped > 0 && samples == 16 * 16 * 4, "{dropped} of {samples}");
    }
}

#[test]
fn splats_that_do_not_fit_their_cells_are_an_error() {
    let scene = scenes::cornell((16, 16));
    // Cells are in units of display white as the lighting says and hold 7·10²⁸ of it.
    let dim = Lighting { radiance: vec![1.0], ..Lighting::authored(&scene) };
    assert!(render(&scene, &dim, IntegratorKind::Bdpt, &()).is_ok());
    let mut bright = scene;
    bright.lights[0].color = Rgb::splat(1e32);
    let error = render(&bright, &dim, IntegratorKind::Bdpt, &()).unwrap_err();
    assert!(matches!(error, RenderError::Overflow(n) if n > 0), "{error:?}");
    assert!(render(&bright, &dim, IntegratorKind::Path, &()).is_ok(), "nothing is splatted");
}
