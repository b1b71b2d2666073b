//! Independent uniform variates. A sampler's are stratified, which would make
//! every count agree too well with its expectation.

use glam::{Vec2, Vec3};
use lightopt_embree::math::{
    hash::{hash_words, mix64},
    warp::square_to_sphere,
};

/// SplitMix64.
pub struct Random(u64);

impl Random {
    pub fn new(seed: &[u64]) -> Self {
        Self(hash_words(seed))
    }

    /// Uniform in [0, 1), a multiple of 2⁻²⁴.
    pub fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        (mix64(self.0) >> 40) as f32 / (1 << 24) as f32
    }

    pub fn next_2d(&mut self) -> Vec2 {
        let x = self.next();
        Vec2::new(x, self.next())
    }

    /// Uniform direction of the whole sphere.
    pub fn direction(&mut self) -> Vec3 {
        square_to_sphere(self.next_2d())
    }

    /// Uniform in [lo, hi).
    pub fn range(&mut self, lo: f32, hi: f32) -> f32 {
        lo + (hi - lo) * self.next()
    }
}
