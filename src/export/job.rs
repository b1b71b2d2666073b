//! The scene to export and the lighting it is exported with.

use crate::{
    camera::Camera,
    integrator::View,
    light::Light,
    lighting::Lighting,
    math::Rgb,
    scene::{Material, Scene},
};

/// A scene and how the other program is to render it.
#[derive(Clone, Copy, Debug)]
pub struct ExportJob<'a> {
    /// The scene and the camera.
    pub view: View<'a>,
    /// The radiances and sizes of the lights, and the background's value.
    pub lighting: &'a Lighting,
    /// Number of edges of the longest light path after the camera; 1 shows emitters alone.
    pub max_depth: usize,
}

/// A light with the radiance and the size that the lighting gives it.
#[derive(Clone, Copy, Debug)]
pub struct LitLight<'a> {
    /// The light: name, shape at unit size, colour.
    pub light: &'a Light,
    /// Radiance per unit of the light's colour, W·m⁻²·sr⁻¹ (a point light's intensity,
    /// W·sr⁻¹; a distant light's irradiance, W·m⁻²).
    pub radiance: f32,
    /// Factor on the extents of the light's shape.
    pub size: f32,
    /// Linear Rec.709 colour of luminance 1.
    pub color: Rgb,
}

impl<'a> ExportJob<'a> {
    /// The scene: geometry, materials and lights.
    #[must_use]
    pub fn scene(&self) -> &'a Scene {
        self.view.scene
    }

    /// The camera with the size of its film.
    #[must_use]
    pub fn camera(&self) -> &'a Camera {
        self.view.camera
    }

    /// The scene's lights, lit, in the scene's order.
    pub fn lights(&self) -> impl Iterator<Item = LitLight<'a>> + Clone + use<'a> {
        let settings = self.lighting.radiance.iter().zip(&self.lighting.size);
        let lit = |(light, (&radiance, &size)): (&'a Light, (&f64, &f64))| LitLight {
            light,
            radiance: radiance as f32,
            size: size as f32,
            color: Rgb::ONE,
        };
        let color = |l: usize| self.lighting.color_of(l).gain().map_or(Rgb::ONE, Rgb::from_array);
        let lights = self.view.scene.lights.iter().zip(settings).map(lit).enumerate();
        lights.map(move |(l, lit)| LitLight { color: lit.light.color * color(l), ..lit })
    }

    /// Factor on the base colour's image of the material at `index`, or the base colour
    /// itself without one; a background material's includes the background's value.
    #[must_use]
    pub fn tint(&self, index: usize) -> Rgb {
        self.material(index).tint() * self.scene().value_of(index, self.lighting.value as f32)
    }

    /// The material at `index`.
    #[must_use]
    pub fn material(&self, index: usize) -> &'a Material {
        &self.scene().materials[index]
    }
}

impl LitLight<'_> {
    /// Whether the light emits at all.
    #[must_use]
    pub fn shines(&self) -> bool {
        self.radiance > 0.0
    }

    /// Radiance of each colour channel, in the unit of [`Self::radiance`].
    #[must_use]
    pub fn rgb(&self) -> Rgb {
        self.color * self.radiance
    }
}
