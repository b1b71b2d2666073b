//! Where lamps may be placed, as a photographer says it.

/// Region in which lamps may be placed. Angles and distances are seen from the middle of the main object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Movement {
    /// Least and largest angle about the subject, degrees to the right of the camera in the picture.
    pub azimuth: [f32; 2],
    /// Least and largest angle above the subject's middle, degrees.
    pub elevation: [f32; 2],
    /// Least and largest distance, metres; `None` for [`Self::DISTANCE`].
    pub distance: Option<[f32; 2]>,
    /// Least and largest height of the lamp's middle above the floor, metres; `None` for any above it.
    pub height: Option<[f32; 2]>,
    /// Distance that a lamp keeps from the subject and from all surfaces before it, metres; `None` for
    /// [`Self::CLEARANCE`].
    pub clearance: Option<f32>,
    /// Whether lamps may stand in the picture.
    pub in_frame: bool,
}

impl Movement {
    /// Least and largest distance by default, in radii of the subject: from where a softbox as large as the
    /// subject just stands clear of it to where a studio ends. Set by reasoning.
    pub const DISTANCE: [f32; 2] = [1.6, 6.0];
    /// Clearance by default, in radii of the subject. Set by reasoning.
    pub const CLEARANCE: f32 = 0.1;
}

impl Default for Movement {
    /// All around the subject, not below its middle by more than a little, and out of the picture.
    fn default() -> Self {
        Self {
            azimuth: [-180.0, 180.0],
            elevation: [-10.0, 90.0],
            distance: None,
            height: None,
            clearance: None,
            in_frame: false,
        }
    }
}
