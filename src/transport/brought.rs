//! What lights bring to a part of the picture, as smooth functions of their sizes.

use serde::{Deserialize, Serialize};

use super::{Knots, Tables, TransportBasis, kernels};

/// Mean luminance that a light brings to some pixels at unit radiance, at one value of the background.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Brought {
    /// Knots of a free size.
    knots: Option<Knots>,
    /// Mean luminance up to each knot, or of the fixed size.
    means: Vec<f64>,
}

impl Brought {
    /// The mean luminance at a size, and its derivative by the size.
    #[must_use]
    pub fn at(&self, size: f64) -> (f64, f64) {
        let Some(knots) = &self.knots else { return (self.means[0], 0.0) };
        let weights = knots.weights(size);
        let sum = |of: [f64; 3]| -> f64 {
            of.iter().zip(self.means.iter().skip(weights.first)).map(|(w, mean)| w * mean).sum()
        };
        (sum(weights.value), sum(weights.slope))
    }

    /// Whether a file may have it: a mean for every knot.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        let n = self.knots.as_ref().map_or(1, Knots::len);
        self.means.len() == n
            && self.means.iter().all(|m| m.is_finite())
            && self.knots.as_ref().is_none_or(Knots::is_sound)
    }
}

impl TransportBasis {
    /// What each light brings to the pixels of a mask, with the background at a value.
    ///
    /// # Panics
    /// When the mask has another size than the pictures.
    #[must_use]
    pub fn brought(&self, mask: &[bool], value: f64) -> Vec<Brought> {
        let layout = self.layout();
        assert_eq!(mask.len(), layout.n_pixels(), "one flag a pixel");
        let (by_node, _) = layout.nodes.weights(value);
        let flags: Vec<f64> = mask.iter().map(|&on| f64::from(u8::from(on))).collect();
        let width = self.width();
        let on = flags.iter().sum::<f64>().max(1.0);
        let scale = 1.0 / (on * f64::from(self.n_samples().max(1)) * self.n_replicates() as f64);
        let mean = |cell: usize| -> f64 {
            let mut line = vec![0.0; width];
            let mut sum = 0.0;
            for (replicate, y) in
                (0..self.n_replicates()).flat_map(|r| (0..layout.size.y as usize).map(move |y| (r, y)))
            {
                let rows =
                    (0..layout.nodes.len()).map(|k| self.row(replicate, 0, cell * layout.nodes.len() + k, y));
                kernels::combine(&rows.collect::<Vec<_>>(), &by_node, &mut line);
                sum += line.iter().zip(&flags[y * width..]).map(|(v, flag)| v * flag).sum::<f64>();
            }
            sum * scale
        };
        let of_light = layout
            .lights
            .iter()
            .map(|cells| Brought { knots: cells.knots.clone(), means: cells.cells().map(mean).collect() });
        of_light.collect()
    }
}
