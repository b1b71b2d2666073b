//! Choice between the lobes of a model.

/// A lobe that exists is chosen at least this often against one whose share grows with the
/// background's value: the choice is made at the largest value, and at a smaller one the
/// other lobe prevails.
const MIN_PROBABILITY: f32 = 0.1;

/// Probability of choosing a lobe that reflects `mirror` over one that reflects `diffuse`,
/// whose shares depend on the background's value.
pub(super) fn mirror_probability(mirror: f32, diffuse: f32) -> f32 {
    if diffuse <= 0.0 {
        return 1.0;
    }
    if mirror <= 0.0 {
        return 0.0;
    }
    (mirror / (mirror + diffuse)).clamp(MIN_PROBABILITY, 1.0 - MIN_PROBABILITY)
}

/// Probability of choosing light between facets, `wide`, over all the `rest`.
///
/// It is its very share, however small: no weight then exceeds the albedo, at no value of the
/// background, as that share is largest at the largest value. Least probabilities would be paid
/// by the lobe of a single facet, which is most of the light: under a uniform sky a metal of
/// slope 0.04 would have a relative deviation of 0.33 a sample with 0.1; it has 0.04.
pub(super) fn wide_probability(wide: f32, rest: f32) -> f32 {
    if wide <= 0.0 { 0.0 } else { (wide / (wide + rest)).min(1.0 - MIN_PROBABILITY) }
}
