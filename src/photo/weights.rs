//! Weights in the place of a mask: how much every pixel of a picture belongs to its main object.

use std::path::Path;

use super::reduce::box_filter;
use crate::{
    objective::{Objective, ObjectiveError, Target},
    picture::{Picture, PictureError, Purpose, Reading},
};

/// A picture of weights in [0, 1], for pictures of any size.
#[derive(Clone, Debug, PartialEq)]
pub struct Weights {
    size: [usize; 2],
    values: Vec<f64>,
}

impl Weights {
    /// Reads the weights from a picture: the numbers of the file, white being 1, whatever colours it says it has.
    ///
    /// # Errors
    /// When it is no picture.
    pub fn read(path: &Path) -> Result<Self, PictureError> {
        let picture = Picture::read(path, &Reading::of(Purpose::Mask))?;
        let value = |i: usize| {
            let [r, g, b, _] = picture.stored(i);
            ((r + g + b) / 3.0).clamp(0.0, 1.0)
        };
        let values = (0..picture.n_pixels()).map(value).map(|v| if v.is_nan() { 0.0 } else { v }).collect();
        Ok(Self { size: [picture.width, picture.height], values })
    }

    /// Weights of each pixel of a picture of another size: means over its area.
    #[must_use]
    pub fn at(&self, width: usize, height: usize) -> Vec<f64> {
        box_filter(|i| self.values[i], self.size, [width, height])
            .into_iter()
            .map(|w| w.clamp(0.0, 1.0))
            .collect()
    }

    /// Objective of pictures of a size: weighted, or with a mask where there are no weights.
    ///
    /// # Errors
    /// As [`Objective::new`] and [`Objective::weighted`].
    pub fn objective(
        weights: Option<&Self>,
        target: &Target,
        [width, height]: [usize; 2],
        mask: &[bool],
    ) -> Result<Objective, ObjectiveError> {
        match weights {
            None => Objective::new(target, width, height, mask),
            Some(weights) => Objective::weighted(target, width, height, &weights.at(width, height)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_of_another_size_keep_their_mean() {
        let values: Vec<f64> = (0..12).map(|i| f64::from(i) / 11.0).collect();
        let weights = Weights { size: [4, 3], values: values.clone() };
        assert_eq!(weights.at(4, 3), values);
        for [w, h] in [[2, 3], [8, 6], [5, 7]] {
            let at = weights.at(w, h);
            assert!((at.iter().sum::<f64>() / at.len() as f64 - 0.5).abs() < 1e-12, "{w} {h}");
        }
        // A part of a pixel is that pixel but for rounding: overlaps are whole numbers, quotients are not.
        let parts = weights.at(8, 3);
        for (i, part) in parts.iter().enumerate() {
            assert!((part - values[i / 2]).abs() < 1e-15, "{i}: {part} {}", values[i / 2]);
        }
    }
}
