//! Random pictures for the tests of this module.

/// SplitMix64 \[Steele14\]: short, seeded, the same everywhere.
pub(crate) struct Rng(u64);

impl Rng {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed)
    }

    pub(crate) fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 * (-53.0_f64).exp2()
    }

    pub(crate) fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform()).cos()
    }

    pub(crate) fn image(&mut self, n: usize) -> Vec<f64> {
        (0..n).map(|_| self.uniform()).collect()
    }
}

/// A mask with a disk-like object somewhat off the centre, touching the left border.
pub(crate) fn disk_mask(width: usize, height: usize) -> Vec<bool> {
    let (cx, cy) = (0.3 * width as f64, 0.5 * height as f64);
    (0..width * height)
        .map(|i| {
            let (dx, dy) = ((i % width) as f64 - cx, (i / width) as f64 - cy);
            dx * dx + dy * dy < 0.12 * (width * height) as f64
        })
        .collect()
}
