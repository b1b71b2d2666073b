//! The distribution of the size coordinate.

/// Density of ρ on (0, extent] with which a light is sampled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SizeDensity {
    /// q(ρ) = 2ρ/extent²: uniform in area.
    UniformArea {
        /// The largest size sampled.
        extent: f32,
    },
}

impl SizeDensity {
    /// The largest size sampled.
    #[must_use]
    pub fn extent(&self) -> f32 {
        match *self {
            Self::UniformArea { extent } => extent,
        }
    }

    /// Maps a uniform variate to ρ in (0, extent].
    #[must_use]
    pub fn sample(&self, u: f32) -> f32 {
        match *self {
            // Kept off the rim, where a sphere's rays are tangents and their
            // densities 0/0 in f32; it costs a millionth of the range.
            Self::UniformArea { extent } => extent * (1.0 - u.max(1e-6)).sqrt(),
        }
    }

    /// q(ρ)/ρ, which stays finite at ρ = 0 (for the uniform density).
    #[must_use]
    pub fn pdf_over_rho(&self, _rho: f32) -> f32 {
        match *self {
            Self::UniformArea { extent } => 2.0 / (extent * extent),
        }
    }
}
