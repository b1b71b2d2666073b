//! Densities of the size coordinate.

/// Density of the size coordinate ρ on (0, extent] with which a light is sampled.
///
/// It is a mixture: its cores are uniform in area up to a size each, and the rest is uniform in ln ρ
/// from the least size on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SizeDensity {
    /// Cores of the mixture; those in use come first and have a positive share.
    cores: [Core; MAX_CORES],
    /// Size at which the part uniform in ln ρ begins.
    least: f32,
    extent: f32,
    /// Density of the part uniform in ln ρ, times ρ.
    rest: f32,
}

/// Part of a mixture with the density 2ρ/size² up to a size.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Core {
    size: f32,
    share: f32,
}

/// Cores of a mixture at most: one for each likely size and one for the whole area.
const MAX_CORES: usize = SizeDensity::MAX_LIKELY + 1;
/// Share of the core at the least size where no size is likelier than another: without it a light that
/// turns out small has hardly any samples. Chosen on the fruit basket.
const LEAST_SHARE: f32 = 0.25;
/// Share of the likely sizes: what is left lets a search go to other sizes. On the fruit basket .5
/// and .8 were tried and were no better.
const FOCUS_SHARE: f32 = 0.6;
/// Part of what the likely sizes leave that is uniform in the whole area, so that the largest lights
/// are sampled as well; the remainder is uniform in ln ρ. Chosen on the fruit basket.
const WHOLE: f32 = 1.0 / 3.0;

impl SizeDensity {
    /// Upper bound of the number of likely sizes: room for one of each look that is sought together,
    /// at the price of a comparison a core for every density evaluated.
    pub const MAX_LIKELY: usize = 4;

    /// Density for a light of size `extent`, uniform in its area.
    #[must_use]
    pub fn uniform_area(extent: f32) -> Self {
        Self::one_of(&[(extent, 1.0)])
    }

    /// Density for a light of one of several sizes, given as (size, positive weight).
    ///
    /// # Panics
    /// With none of them, or more than [`Self::MAX_LIKELY`].
    #[must_use]
    pub fn one_of(sizes: &[(f32, f32)]) -> Self {
        let extent = sizes.iter().fold(0.0_f32, |most, s| most.max(s.0));
        Self::mixture([extent, extent], sizes, 1.0)
    }

    /// Density for a light that may be of any size in the range [least, extent].
    #[must_use]
    pub fn any_size([least, extent]: [f32; 2]) -> Self {
        Self::mixture([least, extent], &[(least, 1.0)], LEAST_SHARE)
    }

    /// Density for a light of any size in the range [least, extent], but probably of one of the sizes
    /// `likely`, given as (size, positive weight).
    ///
    /// # Panics
    /// With none of them, or more than [`Self::MAX_LIKELY`].
    #[must_use]
    pub fn focused(range: [f32; 2], likely: &[(f32, f32)]) -> Self {
        Self::mixture(range, likely, FOCUS_SHARE)
    }

    fn mixture([least, extent]: [f32; 2], likely: &[(f32, f32)], share: f32) -> Self {
        let count = likely.len();
        assert!((1..=Self::MAX_LIKELY).contains(&count), "one to {} sizes, not {count}", Self::MAX_LIKELY);
        let total: f32 = likely.iter().map(|s| s.1).sum();
        let mut cores = [Core { size: extent, share: 0.0 }; MAX_CORES];
        for (core, &(size, weight)) in cores.iter_mut().zip(likely) {
            *core = Core { size: size.min(extent), share: share * weight / total };
        }
        cores[count].share = (1.0 - share) * WHOLE;
        let left = 1.0 - cores.iter().map(|core| core.share).sum::<f32>();
        let rest = if least < extent { left / (extent / least).ln() } else { 0.0 };
        Self { cores, least, extent, rest }
    }

    fn cores(&self) -> impl Iterator<Item = Core> {
        self.cores.into_iter().take_while(|core| core.share > 0.0)
    }

    /// Largest size that is sampled.
    #[must_use]
    pub fn extent(&self) -> f32 {
        self.extent
    }

    /// Maps a uniform variate to ρ in (0, extent].
    #[must_use]
    pub fn sample(&self, u: f32) -> f32 {
        // Kept off the rim, where a sphere's rays are tangents and their densities 0/0 in f32;
        // it costs a millionth of the range.
        let within = |size: f32, u: f32| size * (1.0 - u.max(1e-6)).sqrt();
        let mut below = 0.0;
        for core in self.cores() {
            if u < below + core.share {
                return within(core.size, (u - below) / core.share);
            }
            below += core.share;
        }
        let rest = 1.0 - below;
        if self.least < self.extent && rest > 0.0 {
            let rho = self.least * (self.extent / self.least).powf((u - below) / rest);
            return rho.min(within(self.extent, 0.0));
        }
        // Rounding: the shares sum to one.
        within(self.cores[0].size, 0.0)
    }

    /// Cumulative distribution: share of the samples with ρ up to `size`.
    #[must_use]
    pub fn below(&self, size: f32) -> f32 {
        let cores = self.cores().map(|core| core.share * (size / core.size).clamp(0.0, 1.0).powi(2));
        let rest =
            if self.rest > 0.0 { (size.clamp(self.least, self.extent) / self.least).ln() } else { 0.0 };
        cores.sum::<f32>() + self.rest * rest
    }

    /// q(ρ)/ρ, which stays finite at ρ = 0.
    #[must_use]
    pub fn pdf_over_rho(&self, rho: f32) -> f32 {
        let mut sum = 0.0;
        for core in self.cores() {
            if rho <= core.size {
                sum += 2.0 * core.share / (core.size * core.size);
            }
        }
        if self.rest > 0.0 && (self.least..=self.extent).contains(&rho) {
            sum += self.rest / (rho * rho);
        }
        sum
    }
}
