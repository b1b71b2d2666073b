//! The scene to export and the lighting it is exported with.

use std::path::Path;

use glam::{DVec3, Vec3};

use crate::{
    camera::Camera,
    integrator::View,
    light::{Light, Shape},
    lighting::Lighting,
    math::{Frame, Rgb, ViewTransform},
    scene::{Material, Scene},
};

/// A scene and how the other program is to render it.
#[derive(Clone, Copy, Debug)]
pub struct ExportJob<'a> {
    /// The scene and the camera.
    pub view: View<'a>,
    /// The radiances and sizes of the lights, the background's value and the exposure.
    pub lighting: &'a Lighting,
    /// Number of edges of the longest light path after the camera; 1 shows emitters alone.
    pub max_depth: usize,
    /// The view transform through which the picture is seen.
    pub display: ViewTransform,
    /// What the user chose of what some formats offer.
    pub options: ExportOptions<'a>,
}

/// What some formats offer; [`Exporter::offers`](super::Exporter::offers) says which do.
#[derive(Clone, Copy, Debug, Default)]
pub struct ExportOptions<'a> {
    /// Whether every light has a body that stops rays, for integrators that know no others.
    pub blocking: bool,
    /// Whether radiances are written as luminances, 683 lm a watt.
    pub photometric: bool,
    /// The scene file where the geometry is written too, or is to be read by the other program; `None` for
    /// the lights, the camera and what else is laid over a scene that the other program has.
    pub whole: Option<&'a Path>,
}

/// A rigid place of a thing that looks along its -z, as lamps and cameras of other programs do.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pose {
    /// Unit vectors of the thing's x, y and z.
    pub axes: [Vec3; 3],
    /// Place of the thing in the coordinates of the scene file, metres.
    pub at: DVec3,
}

impl Pose {
    /// The place of a light with this frame, which shines along its normal.
    fn of_light(frame: Frame, at: DVec3) -> Self {
        Self { axes: [-frame.s, frame.t, -frame.n], at }
    }

    /// The place of a camera.
    pub(super) fn of_camera(c: &Camera, origin: DVec3) -> Self {
        let z = -c.forward();
        Self { axes: [c.up().cross(z), c.up(), z], at: c.position.as_dvec3() + origin }
    }
}

/// A light with the radiance and the size that the lighting gives it.
#[derive(Clone, Copy, Debug)]
pub struct LitLight<'a> {
    /// The light: name, shape at unit size.
    pub light: &'a Light,
    /// Linear Rec.709 colour of luminance 1.
    pub color: Rgb,
    /// Radiance per unit of the colour, W·m⁻²·sr⁻¹ (a point light's intensity,
    /// W·sr⁻¹; a distant light's irradiance, W·m⁻²).
    pub radiance: f32,
    /// Factor on the extents of the light's shape.
    pub size: f32,
}

impl<'a> ExportJob<'a> {
    /// A job with the light as it is and no options.
    #[must_use]
    pub fn new(view: View<'a>, lighting: &'a Lighting, max_depth: usize) -> Self {
        Self {
            view,
            lighting,
            max_depth,
            display: ViewTransform::default(),
            options: ExportOptions::default(),
        }
    }

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
        let lighting = self.lighting;
        let lit = move |(l, light): (usize, &'a Light)| LitLight {
            light,
            color: light.color * lighting.color_of(l).gain().map_or(Rgb::ONE, Rgb::from_array),
            radiance: lighting.radiance[l] as f32,
            size: lighting.size[l] as f32,
        };
        self.view.scene.lights.iter().enumerate().map(lit)
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
    /// Where the light is and whither it shines, in the coordinates of the scene file; `None` for an
    /// environment and an emissive mesh.
    pub(super) fn pose(&self, origin: DVec3) -> Option<Pose> {
        let at = |p: Vec3| p.as_dvec3() + origin;
        match &self.light.shape {
            Shape::Planar(p) => Some(Pose::of_light(p.frame, at(p.center))),
            Shape::Sphere(s) => Some(Pose::of_light(Frame::from_normal(Vec3::NEG_Y), at(s.center))),
            Shape::Point(p) => {
                let axis = p.cone.map_or(Vec3::NEG_Y, |(axis, _)| axis);
                Some(Pose::of_light(Frame::from_normal(axis), at(p.position)))
            }
            Shape::Distant(d) => Some(Pose::of_light(Frame::from_normal(d.direction), DVec3::ZERO)),
            Shape::Environment(_) | Shape::Mesh(_) => None,
        }
    }

    /// Whether the light emits nothing, so that it is left out.
    pub(super) fn is_dark(&self) -> bool {
        self.rgb() == Rgb::ZERO || (self.light.has_size() && self.size <= 0.0)
    }

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
