//! Light at several values of the background at once.

use super::Rgb;

/// A linear Rec.709 colour at each of `N` nodes of the background's value, `[channel][node]`.
///
/// The first node is the largest value, at which light is largest. With one node it is a plain
/// colour. The nodes of a channel lie together, so that loops over them become vector instructions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NodeRgb<const N: usize>(pub [[f32; N]; 3]);

impl<const N: usize> NodeRgb<N> {
    /// Colour (1, 1, 1) at every node.
    pub const ONE: Self = Self([[1.0; N]; 3]);

    /// Colour at a node.
    #[must_use]
    pub fn at(&self, node: usize) -> Rgb {
        Rgb::from_array(self.0.map(|channel| channel[node]))
    }

    /// Colour at the first node, the largest value of the background.
    #[must_use]
    pub fn largest(&self) -> Rgb {
        self.at(0)
    }

    /// Luminance at every node.
    #[must_use]
    pub fn luminance(&self) -> [f32; N] {
        let [r, g, b] = &self.0;
        std::array::from_fn(|k| super::luminance(Rgb::new(r[k], g[k], b[k])))
    }

    /// Whether the colour is zero at the largest value of the background, and so at every node.
    #[must_use]
    pub fn is_zero(&self) -> bool {
        self.largest() == Rgb::ZERO
    }

    /// Product with a colour that does not depend on the background's value.
    #[must_use]
    pub fn times(mut self, c: Rgb) -> Self {
        for (channel, c) in self.0.iter_mut().zip(c.to_array()) {
            channel.iter_mut().for_each(|v| *v *= c);
        }
        self
    }

    /// Product with a colour that is affine in the background's value: `constant + value · slope`, where
    /// `values` are the nodes.
    #[must_use]
    pub fn times_affine(mut self, constant: Rgb, slope: Rgb, values: &[f32; N]) -> Self {
        for (c, channel) in self.0.iter_mut().enumerate() {
            let (constant, slope) = (constant[c], slope[c]);
            channel.iter_mut().zip(values).for_each(|(v, value)| *v *= constant + slope * value);
        }
        self
    }

    /// Product with a number, at every node.
    #[must_use]
    pub fn scaled(self, s: f32) -> Self {
        self.times(Rgb::splat(s))
    }

    /// Product node by node.
    #[must_use]
    pub fn product(mut self, other: &Self) -> Self {
        for (a, b) in self.0.as_flattened_mut().iter_mut().zip(other.0.as_flattened()) {
            *a *= *b;
        }
        self
    }

    /// Whether every channel is finite and not negative at every node.
    #[must_use]
    pub fn is_radiance(&self) -> bool {
        self.0.as_flattened().iter().fold(true, |all, v| all & (0.0..=f32::MAX).contains(v))
    }
}
