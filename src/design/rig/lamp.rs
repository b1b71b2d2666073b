//! Lamps that are placed by the program.

use glam::Vec3;

use crate::{
    light::{Cone, Edge, Light, LightColor, Outline, Planar, Shape, look_frame},
    math::Rgb,
};

/// A flat lamp: a softbox or a round reflector, with or without a grid that narrows its beam.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lamp {
    /// Centre, metres.
    pub position: Vec3,
    /// Point that the lamp faces, metres.
    pub look_at: Vec3,
    /// Outline at size 1.
    pub outline: Outline,
    /// Beam; `None` for a lamp that shines into its half-space.
    pub beam: Option<Beam>,
    /// Linear Rec.709 colour of luminance 1.
    pub color: Rgb,
    /// The scene's own light that stands here, by its index among those that may be moved; `None` for another.
    pub of: Option<usize>,
}

/// Beam of a lamp.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beam {
    /// Half-angle of the cone, degrees.
    pub angle: f32,
    /// Share of the half-angle over which the cone fades.
    pub softness: f32,
}

impl Lamp {
    /// A white lamp without a beam.
    #[must_use]
    pub fn new(position: Vec3, look_at: Vec3, outline: Outline) -> Self {
        Self { position, look_at, outline, beam: None, color: Rgb::ONE, of: None }
    }

    /// The lamp that a flat light of the scene is, facing a point `distance` metres ahead; `None` for a light
    /// that is not flat, blocks rays, or has a beam that a lamp cannot have.
    #[must_use]
    pub fn of_light(light: &Light, distance: f32) -> Option<Self> {
        let Shape::Planar(Planar { center, frame, outline, cone }) = &light.shape else { return None };
        let beam = match cone {
            None => None,
            Some(cone) if cone.edge == Edge::Smooth => {
                let [inner, outer] = [cone.cos_inner, cone.cos_outer].map(|cos| cos.clamp(0.0, 1.0).acos());
                let softness = if outer > 0.0 { 1.0 - inner / outer } else { 0.0 };
                Some(Beam { angle: outer.to_degrees(), softness })
            }
            Some(_) => return None,
        };
        let look_at = *center + frame.n * distance;
        let lamp = Self { beam, color: light.color, ..Self::new(*center, look_at, *outline) };
        (!light.occludes).then_some(lamp)
    }

    /// Unit direction in which the lamp faces.
    #[must_use]
    pub fn axis(&self) -> Vec3 {
        (self.look_at - self.position).try_normalize().unwrap_or(Vec3::NEG_Y)
    }

    /// Shape of the lamp, as that of a light of a sidecar with the same numbers.
    #[must_use]
    pub fn planar(&self) -> Planar {
        Planar {
            center: self.position,
            frame: look_frame(self.axis(), Vec3::Y),
            outline: self.outline,
            cone: self.beam.map(|beam| Cone::with_edge(beam.angle.to_radians(), beam.softness)),
        }
    }

    /// A light of this shape and colour, at size and radiance 1.
    #[must_use]
    pub fn light(&self, name: String) -> Light {
        Light {
            name,
            shape: Shape::Planar(self.planar()),
            color: self.color,
            picture_color: LightColor::Recorded,
            temperature: None,
            radiance: 1.0,
            size: 1.0,
            camera_visible: true,
            occludes: false,
        }
    }

    /// The same lamp with its outline scaled.
    #[must_use]
    pub fn scaled(&self, factor: f32) -> Self {
        let outline = match self.outline {
            Outline::Rectangle { a, b } => Outline::Rectangle { a: factor * a, b: factor * b },
            Outline::Disk { r } => Outline::Disk { r: factor * r },
        };
        Self { outline, ..*self }
    }

    /// Points of a regular grid over the lamp, its edges and corners included, metres.
    pub fn grid(&self) -> impl Iterator<Item = Vec3> {
        // Gaps of a quarter of the lamp: what is thinner may be missed, and each point costs rays.
        const SIDE: u32 = 5;
        let Planar { center, frame, outline, .. } = self.planar();
        let at = |i: u32| 2.0 * i as f32 / (SIDE - 1) as f32 - 1.0;
        (0..SIDE * SIDE).map(move |k| {
            let (x, y) = (at(k % SIDE), at(k / SIDE));
            let (u, v) = match outline {
                Outline::Rectangle { a, b } => (a * x, b * y),
                // The grid of the square, pulled into its inscribed circle.
                Outline::Disk { r } => {
                    (r * x * (1.0 - 0.5 * y * y).sqrt(), r * y * (1.0 - 0.5 * x * x).sqrt())
                }
            };
            center + frame.s * u + frame.t * v
        })
    }
}
