//! A scene as it is rendered here and exported there.

use std::{
    path::{Path, PathBuf},
    time::Instant,
};

use glam::UVec2;

use super::{BenchError, scenes};
use crate::{
    camera::Camera,
    design::render::{Budget, PassedPicture, Renderer},
    export::{ExportJob, Exporter, mitsuba::Mitsuba},
    film::Picture,
    import,
    integrator::{Integrator, IntegratorKind, View},
    light::{Light, Shape},
    lighting::{Lighting, SamplingPlan},
    math::Measure,
    sampler::SamplerKind,
    scene::Scene,
};

/// A scene with its own lighting.
#[derive(Debug)]
pub struct Subject {
    /// Name of the scene.
    pub name: String,
    /// Path of the scene file.
    pub path: PathBuf,
    /// The scene.
    pub scene: Scene,
    /// Lighting that the scene's author gave it.
    pub lighting: Lighting,
}

/// A rendered picture.
#[derive(Clone, Debug)]
pub struct Rendered {
    /// Linear radiance, row by row from the top, R, G, B of each pixel.
    pub rgb: Vec<f32>,
    /// Samples per pixel that were taken.
    pub spp: u32,
    /// Seconds of wall time until the pixels were in memory.
    pub seconds: f64,
}

/// A renderer of ours for the measurements: sampler and depth are the defaults of `render`.
#[must_use]
pub fn renderer(kind: IntegratorKind) -> Renderer {
    let integrator = Integrator { kind, ..Integrator::default() };
    Renderer { integrator, sampler: SamplerKind::Sobol, measure: Measure::default() }
}

impl Subject {
    /// Loads a scene file, or a generated scene by its name, which is written into `directory`.
    ///
    /// # Errors
    /// When the scene cannot be loaded or written.
    pub fn load(name: &str, directory: &Path) -> Result<Self, BenchError> {
        let path = match scenes::write(name, directory)? {
            Some(path) => path,
            None => import::find(Path::new(name))?,
        };
        Self::of_file(&path)
    }

    /// Loads a scene file.
    ///
    /// # Errors
    /// When it cannot be loaded.
    pub fn of_file(path: &Path) -> Result<Self, BenchError> {
        let scene = import::load(path)?.scene;
        let lighting = Lighting::authored(&scene);
        Ok(Self { name: scene.name.clone(), path: path.to_owned(), scene, lighting })
    }

    /// The scene with lights that stop rays, planar and spherical ones without a cone; `None` where some light
    /// has no such body, or all have it already.
    ///
    /// # Errors
    /// When Embree refuses it.
    pub fn with_bodies(&self) -> Result<Option<Self>, BenchError> {
        let is_solid = |l: &Light| match &l.shape {
            Shape::Planar(p) => p.cone.is_none(),
            Shape::Sphere(_) | Shape::Point(_) | Shape::Distant(_) | Shape::Environment(_) => true,
            Shape::Mesh(_) => false,
        };
        let lights = &self.scene.lights;
        if !lights.iter().all(is_solid) || lights.iter().all(|l| l.occludes) {
            return Ok(None);
        }
        let has_body = |l: &Light| matches!(l.shape, Shape::Planar(_) | Shape::Sphere(_));
        let lights = lights.iter().map(|l| Light { occludes: has_body(l), ..l.clone() }).collect();
        let Scene { name, mesh, materials, camera, .. } = &self.scene;
        let scene = Scene::new(name, mesh.clone(), materials.clone(), lights, camera.clone())?
            .with_background(self.scene.background().to_vec());
        let Self { name, path, lighting, .. } = self;
        Ok(Some(Self { name: name.clone(), path: path.clone(), scene, lighting: lighting.clone() }))
    }

    /// The scene's camera with a film of this size.
    #[must_use]
    pub fn camera(&self, size: UVec2) -> Camera {
        self.scene.camera.resized(size)
    }

    /// Renders a picture in the current rayon pool, as `render` does.
    ///
    /// # Errors
    /// When it cannot be rendered.
    pub fn render(
        &self,
        kind: IntegratorKind,
        size: UVec2,
        spp: u32,
        seed: u64,
    ) -> Result<Rendered, BenchError> {
        let camera = self.camera(size);
        let view = View { scene: &self.scene, camera: &camera };
        let clock = Instant::now();
        let renderer = renderer(kind);
        let plan = SamplingPlan::for_picture(&self.lighting);
        let plan = renderer.suited(plan, view, &[&self.lighting], seed, spp);
        let budget = Budget { seed, spp, n_replicates: 1 };
        let PassedPicture { picture: Picture { rgb, .. }, spp } =
            renderer.render_in_passes(view, &self.lighting, &plan, budget, &|| false, &())?;
        let seconds = clock.elapsed().as_secs_f64();
        Ok(Rendered { rgb: rgb.into_flattened(), spp, seconds })
    }

    /// Exports the scene for Mitsuba into a directory; returns the path of its description, and what Mitsuba
    /// shows differently.
    ///
    /// # Errors
    /// When the scene has no counterpart there, or cannot be written.
    pub fn export(&self, size: UVec2, directory: &Path) -> Result<(PathBuf, Vec<String>), BenchError> {
        let camera = self.camera(size);
        let view = View { scene: &self.scene, camera: &camera };
        let job = ExportJob::new(view, &self.lighting, Integrator::default().max_depth);
        let exported = Mitsuba.write(&job, directory)?;
        Ok((Mitsuba.entry_point(directory), exported.warnings))
    }
}
