//! Sample generators: Owen-scrambled Sobol (default) and scrambled Halton.
//!
//! A sampler is a pure function of (seed, pixel, sample index, stream,
//! dimension): any sample can be replayed out of order and on any thread. Each
//! pixel has its own scramble. The streams (camera subpath, light subpath,
//! connections) are padded by seed, so that a decision added to one never
//! shifts the dimensions of another.
//!
//! # References
//! \[Burley20\] (hash-based Owen scrambling); \[PBRT4\] 8.6 (Halton).

mod halton;

use glam::{UVec2, Vec2};
use sobol_burley::{NUM_DIMENSION_SETS_4D, sample_4d};

use crate::math::hash::hash_words;

/// The families of sequences.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum SamplerKind {
    /// Owen-scrambled Sobol, the default.
    #[default]
    Sobol,
    /// Owen-scrambled Halton, the sequence of \[PG14\].
    Halton,
}

/// Independent sequences of dimensions within one sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Stream {
    /// Film position, point of the lens, camera subpath.
    Camera = 0,
    /// Choice of the light, emission, light subpath.
    Light = 1,
    /// Next-event estimation and connections to the camera.
    Connection = 2,
}

/// Samples of a Sobol sequence under one scramble, the most that `sobol_burley` specifies; each block
/// of so many has a scramble of its own.
const SOBOL_MAX_SAMPLES: u32 = 1 << 16;

/// A source of uniform variates in [0, 1) for one sample of one pixel.
#[derive(Clone, Debug)]
pub struct Sampler {
    kind: SamplerKind,
    seed: u64,
    pixel: UVec2,
    /// Index of the sample within its pixel.
    index: u32,
    stream: u8,
    /// Scramble of the stream: a hash of seed, pixel and stream.
    stream_seed: u64,
    /// Next dimension within the stream.
    dimension: u32,
    /// Sobol's four dimensions that hold `dimension`.
    cache: [f32; 4],
}

impl Sampler {
    /// A sampler of the given family; `seed` selects an independent scramble of the whole picture.
    /// Every pixel hashes all 64 bits of it into a scramble of its own, of which Halton's sequence
    /// has 2⁶⁴ and Sobol's 2³²: two seeds share the scramble of a Sobol pixel once in 2³² pixels,
    /// and hardly ever that of two.
    #[must_use]
    pub fn new(kind: SamplerKind, seed: u64) -> Self {
        let mut s = Self {
            kind,
            seed,
            pixel: UVec2::ZERO,
            index: 0,
            stream: 0,
            stream_seed: 0,
            dimension: 0,
            cache: [0.0; 4],
        };
        s.start(UVec2::ZERO, 0);
        s
    }

    /// Moves to sample `index` of `pixel`, at the start of the camera stream.
    pub fn start(&mut self, pixel: UVec2, index: u32) {
        self.pixel = pixel;
        self.index = index;
        self.start_stream(Stream::Camera);
    }

    /// Moves to the first dimension of a stream of the current sample.
    pub fn start_stream(&mut self, stream: Stream) {
        self.stream = stream as u8;
        self.dimension = 0;
        let block = match self.kind {
            SamplerKind::Sobol => u64::from(self.index / SOBOL_MAX_SAMPLES),
            SamplerKind::Halton => 0,
        };
        self.stream_seed = hash_words(&[
            self.seed,
            u64::from(self.pixel.x) << 32 | u64::from(self.pixel.y),
            u64::from(self.stream),
            block,
        ]);
    }

    /// Moves to the first dimension of a stream that only one of every `n` samples of a pixel uses, and
    /// returns whether the current one does; which one it is varies from pixel to pixel.
    pub fn start_one_of(&mut self, stream: Stream, n: u32) -> bool {
        self.start_stream(stream);
        let offset = (self.stream_seed >> 32) % u64::from(n);
        let index = self.index;
        self.index /= n;
        (u64::from(index) + offset).is_multiple_of(u64::from(n))
    }

    /// Skips the next aligned group of four dimensions.
    pub fn skip_4d(&mut self) {
        self.dimension = self.dimension.next_multiple_of(4) + 4;
    }

    /// The variate of the next dimension, in [0, 1).
    pub fn next_1d(&mut self) -> f32 {
        let d = self.dimension;
        self.dimension += 1;
        match self.kind {
            SamplerKind::Sobol => {
                if d.is_multiple_of(4) {
                    let set = d / 4;
                    let pad = u64::from(set / NUM_DIMENSION_SETS_4D);
                    let seed = (self.stream_seed ^ (self.stream_seed >> 32)) as u32;
                    self.cache = sample_4d(
                        self.index % SOBOL_MAX_SAMPLES,
                        set % NUM_DIMENSION_SETS_4D,
                        seed ^ (pad as u32).wrapping_mul(0x9e37_79b9),
                    );
                }
                self.cache[(d % 4) as usize]
            }
            SamplerKind::Halton => halton::sample(self.index, d, self.stream_seed),
        }
    }

    /// The variates of the next two dimensions, in [0, 1)².
    pub fn next_2d(&mut self) -> Vec2 {
        let x = self.next_1d();
        Vec2::new(x, self.next_1d())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const KINDS: [SamplerKind; 2] = [SamplerKind::Sobol, SamplerKind::Halton];

    #[test]
    fn replay_out_of_order_gives_equal_values() {
        for kind in KINDS {
            let mut s = Sampler::new(kind, 7);
            let mut draw = |p: UVec2, i: u32, stream| {
                s.start(p, i);
                s.start_stream(stream);
                (0..11).map(|_| s.next_1d()).collect::<Vec<_>>()
            };
            let p = UVec2::new(3, 9);
            let forward: Vec<_> = (0..8).map(|i| draw(p, i, Stream::Light)).collect();
            draw(UVec2::new(4, 9), 70_000, Stream::Camera);
            for i in (0..8).rev() {
                assert_eq!(draw(p, i, Stream::Light), forward[i as usize]);
            }
        }
    }

    #[test]
    fn every_elementary_interval_of_a_sobol_pair_holds_one_point() {
        let mut s = Sampler::new(SamplerKind::Sobol, 1);
        for (log_x, log_y) in [(0, 8), (4, 4), (8, 0), (3, 5)] {
            let mut seen = vec![0; 256];
            for i in 0..256 {
                s.start(UVec2::new(5, 6), i);
                let u = s.next_2d();
                let cell =
                    ((u.x * (1 << log_x) as f32) as usize) << log_y | (u.y * (1 << log_y) as f32) as usize;
                seen[cell] += 1;
            }
            assert!(seen.iter().all(|&n| n == 1), "2^{log_x} x 2^{log_y}");
        }
    }

    #[test]
    fn every_elementary_interval_of_a_halton_pair_holds_one_point() {
        let mut s = Sampler::new(SamplerKind::Halton, 1);
        let (a, b) = (32, 27);
        let mut seen = vec![0; a * b];
        for i in 0..(a * b) as u32 {
            s.start(UVec2::new(5, 6), i);
            let u = s.next_2d();
            seen[(u.x * a as f32) as usize * b + (u.y * b as f32) as usize] += 1;
        }
        assert!(seen.iter().all(|&n| n == 1));
    }

    #[test]
    fn streams_pixels_and_seeds_are_independent() {
        for kind in KINDS {
            let value = |seed, x, stream| {
                let mut s = Sampler::new(kind, seed);
                s.start(UVec2::new(x, 0), 0);
                s.start_stream(stream);
                s.next_1d()
            };
            let base = value(0, 0, Stream::Camera);
            assert_ne!(base, value(1, 0, Stream::Camera));
            assert_ne!(base, value(0, 1, Stream::Camera));
            assert_ne!(base, value(0, 0, Stream::Light));
        }
    }

    #[test]
    fn values_stay_uniform_far_into_the_sequence_and_the_dimensions() {
        for kind in KINDS {
            let mut s = Sampler::new(kind, 3);
            let mut sums = vec![0.0_f64; 300];
            for i in 65_000..67_048 {
                s.start(UVec2::new(1, 1), i);
                for sum in &mut sums {
                    let u = s.next_1d();
                    assert!((0.0..1.0).contains(&u));
                    *sum += f64::from(u);
                }
            }
            let z = crate::math::stats::sidak_z(0.01, sums.len());
            let sigma = (1.0 / 12.0 / 2048.0_f64).sqrt();
            for (d, sum) in sums.iter().enumerate() {
                let mean = sum / 2048.0;
                assert!((mean - 0.5).abs() < z * sigma, "{kind:?} dimension {d}: {mean}");
            }
        }
    }
}
