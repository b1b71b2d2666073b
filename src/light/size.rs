//! The distribution of the size coordinate.

/// Density of ρ on (0, extent] with which a light is sampled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SizeDensity {
    /// q(ρ) = 2ρ/extent²: uniform in area.
    UniformArea {
        /// The largest size sampled.
        extent: f32,
    },
    /// A mixture for a light that may be of any size from `least` to `extent`: uniform
    /// in the area of a `core`, and for the rest in that of the whole and in ln ρ.
    AnySize {
        /// The least size of interest.
        least: f32,
        /// The largest size sampled.
        extent: f32,
        /// What is drawn most: the least size, or one that is likely.
        core: f32,
        /// Share of the core.
        share: f32,
    },
}

/// Share of the least size where nothing is known about the likely one.
const LEAST_SHARE: f32 = 0.25;
/// Share of a likely size.
const FOCUS_SHARE: f32 = 0.8;
/// Of what the core leaves, the part that is uniform in the whole area.
const WHOLE: f32 = 1.0 / 3.0;

impl SizeDensity {
    /// For a light that may be of any size in a range.
    #[must_use]
    pub fn any_size([least, extent]: [f32; 2]) -> Self {
        Self::AnySize { least, extent, core: least, share: LEAST_SHARE }
    }

    /// For one whose size is probably not above `likely`.
    #[must_use]
    pub fn focused([least, extent]: [f32; 2], likely: f32) -> Self {
        Self::AnySize { least, extent, core: likely.clamp(least, extent), share: FOCUS_SHARE }
    }

    /// The largest size sampled.
    #[must_use]
    pub fn extent(&self) -> f32 {
        match *self {
            Self::UniformArea { extent } | Self::AnySize { extent, .. } => extent,
        }
    }

    /// Maps a uniform variate to ρ in (0, extent].
    #[must_use]
    pub fn sample(&self, u: f32) -> f32 {
        match *self {
            // Kept off the rim, where a sphere's rays are tangents and their
            // densities 0/0 in f32; it costs a millionth of the range.
            Self::UniformArea { extent } => extent * (1.0 - u.max(1e-6)).sqrt(),
            Self::AnySize { least, extent, core, share } => {
                let whole = (1.0 - share) * WHOLE;
                let rho = if u < whole {
                    extent * (1.0 - u / whole).sqrt()
                } else if u < whole + share {
                    core * (1.0 - (u - whole) / share).sqrt()
                } else {
                    least * (extent / least).powf((u - whole - share) / (1.0 - whole - share))
                };
                rho.min(extent * (1.0_f32 - 1e-6).sqrt())
            }
        }
    }

    /// q(ρ)/ρ, which stays finite at ρ = 0.
    #[must_use]
    pub fn pdf_over_rho(&self, rho: f32) -> f32 {
        let uniform = |extent: f32| 2.0 / (extent * extent);
        match *self {
            Self::UniformArea { extent } => uniform(extent),
            Self::AnySize { least, extent, core, share } => {
                let whole = (1.0 - share) * WHOLE;
                let in_core = if rho <= core { share * uniform(core) } else { 0.0 };
                let between = rho >= least && rho <= extent;
                let logarithm = 1.0 - whole - share;
                let logarithm = if between { logarithm / (rho * rho * (extent / least).ln()) } else { 0.0 };
                whole * uniform(extent) + in_core + logarithm
            }
        }
    }
}
