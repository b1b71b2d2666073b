//! Seeded random numbers and noise, so that the scene is the same on every run.

use glam::DVec3;

/// Mixes 64 bits; the finaliser of SplitMix64 (Steele, Lea, Flood 2014).
fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// The 53 upper bits as a number in [0, 1).
fn unit(bits: u64) -> f64 {
    (bits >> 11) as f64 / (1u64 << 53) as f64
}

/// SplitMix64: small, fast, and good enough to scatter fruit.
pub struct Rng(u64);

impl Rng {
    /// Every seed gives an unrelated sequence.
    pub fn new(seed: u64) -> Self {
        Self(mix(seed.wrapping_add(0x9e37_79b9_7f4a_7c15)))
    }

    /// Uniform in `[low, high)`.
    pub fn range(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        low + (high - low) * unit(mix(self.0))
    }

    /// A direction, uniform on the sphere.
    pub fn direction(&mut self) -> DVec3 {
        let y = self.range(-1.0, 1.0);
        let (sin, cos) = self.range(0.0, std::f64::consts::TAU).sin_cos();
        let r = (1.0 - y * y).sqrt();
        DVec3::new(r * cos, y, r * sin)
    }
}

/// Smooth value noise in [-1, 1] with a lattice of unit cells.
pub fn noise(p: DVec3, seed: u64) -> f64 {
    let cell = p.floor();
    let t = p - cell;
    let w = t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
    let corner = |dx: i64, dy: i64, dz: i64| {
        let h = [cell.x as i64 + dx, cell.y as i64 + dy, cell.z as i64 + dz]
            .iter()
            .fold(seed, |h, &c| mix(h ^ (c as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15)));
        2.0 * unit(h) - 1.0
    };
    let lerp = |a: f64, b: f64, t: f64| a + (b - a) * t;
    let row = |dy, dz| lerp(corner(0, dy, dz), corner(1, dy, dz), w.x);
    let plane = |dz| lerp(row(0, dz), row(1, dz), w.y);
    lerp(plane(0), plane(1), w.z)
}

/// Hermite step from 0 at `low` to 1 at `high`.
pub fn smoothstep(low: f64, high: f64, x: f64) -> f64 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}
