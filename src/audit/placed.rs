//! Lamps that the program placed, in `lights.toml`: where each stands, and what a photographer sets up.

use serde::{Deserialize, Serialize};

use crate::import::sidecar::{LightSpec, LightType};

/// What a lamp is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Role {
    /// The lamp before the subject that brings the most to it.
    Key,
    /// Another lamp before the subject.
    Fill,
    /// A lamp behind the subject, whose edge it draws.
    Rim,
    /// A lamp above and behind the subject.
    Hair,
    /// A lamp that lights the background and spares the subject.
    Background,
}

impl Role {
    /// The role's word.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Key => "key",
            Self::Fill => "fill",
            Self::Rim => "rim",
            Self::Hair => "hair",
            Self::Background => "background",
        }
    }
}

/// What a photographer sets up: a lamp in numbers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Description {
    /// What the lamp is for.
    pub role: Role,
    /// Angle about the subject, degrees to the right of the camera in the picture.
    pub azimuth: f64,
    /// Angle above the subject's middle, degrees.
    pub elevation: f64,
    /// Distance from the subject's middle, metres.
    pub distance: f64,
    /// Height above the floor, metres.
    pub height: f64,
    /// Width and height of the lamp itself, metres; the diameter twice for a round one.
    pub extent: [f64; 2],
    /// Full angle of the beam, degrees; absent for a lamp without one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub beam: Option<f64>,
    /// Radiant power in the visible, weighted by luminance, W.
    pub watts: f64,
    /// Luminous flux, lm.
    pub lumens: f64,
}

/// Place and shape of a lamp, `[lights.placed]`, with the keys of a light of a sidecar.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Placed {
    /// Type of the light.
    #[serde(rename = "type")]
    pub kind: LightType,
    /// Centre, metres; absent for surroundings.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub position: Option<[f64; 3]>,
    /// A point in front of the centre, metres; absent for surroundings.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub look_at: Option<[f64; 3]>,
    /// Half-extents of a rectangle across and up at size 1, metres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub half_extents: Option<[f64; 2]>,
    /// Radius of a disk or spot at size 1, metres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub radius: Option<f64>,
    /// Half-angle of a spot's cone, degrees.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub angle: Option<f64>,
    /// Share in [0, 1] of a spot's half-angle over which the cone fades.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub softness: Option<f64>,
    /// Colour, linear Rec.709, which is scaled to luminance 1; white by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub color: Option<[f64; 3]>,
    /// Picture of surroundings.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub image: Option<String>,
    /// Angle of surroundings about the vertical, degrees, anticlockwise as seen from above.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rotation: Option<f64>,
}

impl Placed {
    /// Surroundings by a picture.
    #[must_use]
    pub fn environment(image: String, rotation: f64) -> Self {
        Self {
            kind: LightType::Environment,
            position: None,
            look_at: None,
            half_extents: None,
            radius: None,
            angle: None,
            softness: None,
            color: None,
            image: Some(image),
            rotation: Some(rotation),
        }
    }

    /// The light of a sidecar that stands there, under a name.
    #[must_use]
    pub fn spec(&self, name: &str) -> LightSpec {
        LightSpec {
            kind: Some(self.kind),
            position: self.position,
            look_at: self.look_at,
            half_extents: self.half_extents,
            radius: self.radius,
            angle: self.angle,
            softness: self.softness,
            color: self.color,
            image: self.image.clone(),
            rotation: self.rotation,
            ..LightSpec::named(name)
        }
    }
}
