//! The distribution of the size coordinate.

/// Density of ρ on (0, extent] with which a light is sampled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SizeDensity {
    /// q(ρ) = 2ρ/extent²: uniform in area.
    UniformArea {
        /// The largest size sampled.
        extent: f32,
    },
    /// A mixture that finds the small parts of a light that may be of any size
    /// from `least` to `extent`: uniform in the area of the whole, in that of the
    /// least, and in ln ρ between.
    AnySize {
        /// The least size of interest.
        least: f32,
        /// The largest size sampled.
        extent: f32,
    },
}

/// Shares of the parts of [`SizeDensity::AnySize`]: the whole area, the least
/// area, the logarithm.
const SHARES: [f32; 3] = [0.4, 0.2, 0.4];

impl SizeDensity {
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
            Self::AnySize { least, extent } => {
                let [whole, small, _] = SHARES;
                let rho = if u < whole {
                    extent * (1.0 - u / whole).sqrt()
                } else if u < whole + small {
                    least * (1.0 - (u - whole) / small).sqrt()
                } else {
                    least * (extent / least).powf((u - whole - small) / SHARES[2])
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
            Self::AnySize { least, extent } => {
                let [whole, small, logarithm] = SHARES;
                let small = if rho <= least { small * uniform(least) } else { 0.0 };
                let between = rho >= least && rho <= extent;
                let logarithm = if between { logarithm / (rho * rho * (extent / least).ln()) } else { 0.0 };
                whole * uniform(extent) + small + logarithm
            }
        }
    }
}
