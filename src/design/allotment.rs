//! How many samples each tile of a picture is to have.
//!
//! Where v/n is the mean squared error of a tile with n samples per pixel, that of the picture falls to what is
//! allowed with the fewest samples if n = f √v with the same f everywhere: the samples of a tile grow with the
//! root of its variance. A sixteenth of the picture, whose error counts by half, may need a larger f. Tiles
//! have some hundred pixels, so that none of these chooses its own number of samples.
//!
//! # References
//! \[Cochran77\] 5.5 (optimum allocation).

use super::noise::{SIXTEENTH_WEIGHT, SIXTEENTHS, sixteenth};
use crate::film::tiling::Tiling;

/// Factor by which the samples of a tile grow in a round at most: what is known of its noise is rough at first.
const MAX_GROWTH: u32 = 8;
/// Factors by which all samples together grow in a round at least, since each round is followed by measuring,
/// and at most. Without the latter every tile of the fruit basket grew as much as it might after the first round,
/// and none was spared.
const GROWTH: [f64; 2] = [1.1, 3.0];
/// Share of the mean squared error of the picture that is added to a tile's before samples are shared out, since
/// that may be small or negative by chance: samples would end first where the error only seems small. With a floor of .02 in its place what was told
/// of the fruit basket was too small by a sixth and its backdrop mottled; with .2 it is too small by a twentieth,
/// for no more time at the same error.
const SHARE_OF_MEAN: f64 = 0.2;
/// Halvings of the range of f: 2⁻⁴⁰ of 60 octaves is less than a sample.
const HALVINGS: u32 = 40;
/// Largest f looked at, and inverse of the least.
const LARGEST_FACTOR: f64 = 1e9;

/// The samples per pixel that each tile is to have after the next round.
///
/// * `squares`: mean squared error of each tile in each picture, over the square of what is allowed in it
/// * `counts`: samples per pixel that each tile has
/// * `most`: samples per pixel that a tile may have
#[must_use]
pub fn allot(tiling: &Tiling, squares: &[Vec<f64>], counts: &[u32], most: u32) -> Vec<u32> {
    let plan = Plan::new(tiling, squares, counts, most);
    if plan.roots.iter().all(|&root| root <= 0.0) {
        return plan.largest;
    }
    let tiles: Vec<usize> = (0..tiling.len()).collect();
    let of_parts: Vec<f64> = (0..SIXTEENTHS)
        .map(|part| {
            let tiles: Vec<usize> = tiles.iter().copied().filter(|&t| plan.parts[t] == part).collect();
            let allowed = 1.0 / SIXTEENTH_WEIGHT.powi(2);
            least_factor(|f| plan.is_met(&tiles, allowed, |_| f))
        })
        .collect();
    let factor = |f: f64, t: usize| of_parts[plan.parts[t]].max(f);
    let total = |of_tile: &dyn Fn(usize) -> u32| plan.tiling.total(of_tile) as f64;
    let [enough, much] = GROWTH.map(|growth| growth * total(&|t| counts[t]));
    let of_whole = least_factor(|f| {
        plan.is_met(&tiles, 1.0, |t| factor(f, t)) && total(&|t| plan.samples(t, factor(f, t))) >= enough
    });
    let limited = |limit: f64, t: usize| plan.samples(t, factor(of_whole, t).min(limit));
    let limit = least_factor(|limit| total(&|t| limited(limit, t)) >= much);
    tiles.iter().map(|&t| limited(limit, t)).collect()
}

/// The least factor at which something is so that is so at every larger one.
fn least_factor(is_met: impl Fn(f64) -> bool) -> f64 {
    let (mut least, mut most) = (-LARGEST_FACTOR.log2(), LARGEST_FACTOR.log2());
    for _ in 0..HALVINGS {
        let middle = 0.5 * (least + most);
        if is_met(middle.exp2()) {
            most = middle;
        } else {
            least = middle;
        }
    }
    most.exp2()
}

/// What is known of the tiles of some pictures.
struct Plan<'a> {
    tiling: &'a Tiling,
    counts: &'a [u32],
    /// Samples per pixel that each tile may have after the round.
    largest: Vec<u32>,
    /// Number of pixels of each tile.
    pixels: Vec<f64>,
    /// Index of the sixteenth that each tile lies in.
    parts: Vec<usize>,
    /// Mean squared error of each tile in each picture.
    squares: Vec<Vec<f64>>,
    /// Root of the variance of each tile with its share of the mean, the largest over the pictures.
    roots: Vec<f64>,
}

impl<'a> Plan<'a> {
    fn new(tiling: &'a Tiling, squares: &[Vec<f64>], counts: &'a [u32], most: u32) -> Self {
        let pixels: Vec<f64> = (0..tiling.len()).map(|t| tiling.n_pixels(t) as f64).collect();
        let smooth = |squares: &Vec<f64>| -> Vec<f64> {
            (0..tiling.len()).map(|t| around(tiling, squares, &pixels, t).max(0.0)).collect()
        };
        let squares: Vec<Vec<f64>> = squares.iter().map(smooth).collect();
        let mean = |squares: &Vec<f64>| {
            let sum: f64 = squares.iter().zip(&pixels).map(|(square, n)| square * n).sum();
            sum / pixels.iter().sum::<f64>().max(1.0)
        };
        let means: Vec<f64> = squares.iter().map(mean).collect();
        let part_of = |t: usize| {
            let middle = tiling.ranges(t).map(|range| (range.start + range.end) as usize / 2);
            sixteenth(middle, tiling.size.to_array().map(|n| n as usize))
        };
        let root = |t: usize| {
            let each = squares.iter().zip(&means).map(|(squares, mean)| squares[t] + SHARE_OF_MEAN * mean);
            (each.fold(0.0, f64::max) * f64::from(counts[t])).sqrt()
        };
        Self {
            largest: counts.iter().map(|&n| n.saturating_mul(MAX_GROWTH).min(most).max(n)).collect(),
            parts: (0..tiling.len()).map(part_of).collect(),
            roots: (0..tiling.len()).map(root).collect(),
            tiling,
            counts,
            pixels,
            squares,
        }
    }

    /// Samples per pixel of a tile at a factor.
    fn samples(&self, tile: usize, factor: f64) -> u32 {
        ((factor * self.roots[tile]).ceil() as u32).clamp(self.counts[tile], self.largest[tile])
    }

    /// Whether the mean squared error over some tiles is as small as is allowed in every picture.
    fn is_met(&self, tiles: &[usize], allowed: f64, factor: impl Fn(usize) -> f64) -> bool {
        let n_pixels: f64 = tiles.iter().map(|&t| self.pixels[t]).sum();
        let falls_to = |t: usize| f64::from(self.counts[t]) / f64::from(self.samples(t, factor(t)).max(1));
        let left = |squares: &Vec<f64>| {
            let sum: f64 = tiles.iter().map(|&t| self.pixels[t] * squares[t] * falls_to(t)).sum();
            sum <= allowed * n_pixels
        };
        self.squares.iter().all(left)
    }
}

/// Mean squared error over a tile and those about it: that of a tile alone is known to about its own size.
fn around(tiling: &Tiling, squares: &[f64], n_pixels: &[f64], tile: usize) -> f64 {
    let [across, down] = tiling.shape().to_array().map(|n| n as usize);
    let near = |i: usize, n: usize| i.saturating_sub(1)..(i + 2).min(n);
    let (x, y) = (tile % across, tile / across);
    let tiles = near(y, down).flat_map(|row| near(x, across).map(move |column| row * across + column));
    let (sum, n) = tiles.fold((0.0, 0.0), |(sum, n), t| (sum + squares[t] * n_pixels[t], n + n_pixels[t]));
    sum / n
}

#[cfg(test)]
mod tests {
    use glam::UVec2;

    use super::*;

    const TILING: Tiling = Tiling { size: UVec2::new(128, 96), side: 4 };

    /// The mean squared error that is left when the error of each tile falls as its samples grow.
    fn left(squares: &[f64], before: &[u32], after: &[u32]) -> f64 {
        let each = squares.iter().zip(before).zip(after);
        let sum: f64 = each.map(|((square, &n), &m)| square * f64::from(n) / f64::from(m)).sum();
        sum / squares.len() as f64
    }

    fn total(counts: &[u32]) -> u32 {
        counts.iter().sum()
    }

    /// Tiles of which one in four, in a corner, is a hundred times as noisy as the others.
    fn corner() -> Vec<f64> {
        let is_noisy = |t: usize| t % 32 < 16 && t / 32 < 12;
        (0..TILING.len()).map(|t| if is_noisy(t) { 4.0 } else { 0.04 }).collect()
    }

    #[test]
    fn noisy_tiles_have_more_samples_and_all_together_fewer_than_when_all_have_as_many() {
        let (squares, counts) = (corner(), vec![100; TILING.len()]);
        // The mean squared error of what is allowed is 1, that of the noisy sixteenths 4.
        let next = allot(&TILING, std::slice::from_ref(&squares), &counts, 100_000);
        assert!((125..=160).contains(&next[0]) && next[TILING.len() - 1] == 100, "{}", next[0]);
        let mean = left(&squares, &counts, &counts);
        let even = mean * f64::from(total(&counts));
        let uneven = left(&squares, &counts, &next) * f64::from(total(&next));
        assert!(uneven < 0.85 * even, "{uneven} {even}");
    }

    #[test]
    fn what_is_allotted_is_just_enough() {
        // Smooth, so that the mean over the tiles about one is its own.
        let at = |t: usize| 1.05 + 0.5 * ((t % 32) as f64 * 0.1).sin();
        let squares: Vec<f64> = (0..TILING.len()).map(at).collect();
        let counts = vec![1000; TILING.len()];
        let squares: Vec<f64> = squares.iter().map(|square| 1.5 * square).collect();
        let next = allot(&TILING, std::slice::from_ref(&squares), &counts, 1_000_000);
        let left = left(&squares, &counts, &next);
        assert!((left - 1.0).abs() < 0.02, "{left}");
    }

    #[test]
    fn samples_grow_within_limits() {
        let grow = |square: f64, n: u32, most: u32| {
            let next = allot(&TILING, &[vec![square; TILING.len()]], &vec![n; TILING.len()], most);
            assert!(next.iter().all(|&m| m == next[0]));
            next[0]
        };
        assert_eq!(grow(1e9, 10, 1000), 30, "threefold all together at most");
        assert_eq!(grow(1.205, 100, 1000), 121);
        assert_eq!(grow(0.5, 100, 1000), 110, "by a tenth at least");
        assert_eq!(grow(f64::INFINITY, 10, 1000), 80);
        assert_eq!(grow(f64::NAN, 10, 1000), 80);
        assert_eq!(grow(0.0, 10, 1000), 80, "nothing is known of the noise");
        assert_eq!(grow(-1.0, 10, 1000), 80);
        assert_eq!(grow(2.0, 10, 12), 12, "as many as are allowed");
        assert_eq!(grow(2.0, 10, 10), 10);
    }

    #[test]
    fn what_is_far_from_enough_goes_to_noisy_tiles() {
        let far: Vec<f64> = corner().into_iter().map(|square| 100.0 * square).collect();
        let counts = vec![100; TILING.len()];
        let next = allot(&TILING, &[far], &counts, 100_000);
        let growth = f64::from(total(&next)) / f64::from(total(&counts));
        assert!((2.4..=3.01).contains(&growth), "{growth}");
        assert!(next[0] >= 650 && next[TILING.len() - 1] <= 180, "{} {:?}", next[0], next.last());
    }

    #[test]
    fn a_noisy_sixteenth_asks_for_more_than_the_whole() {
        // All error lies in one sixteenth, in which four times what is allowed for the whole may be left.
        let is_noisy = |t: usize| t % 32 < 8 && t / 32 < 6;
        let squares: Vec<f64> = (0..TILING.len()).map(|t| if is_noisy(t) { 8.0 } else { 0.0 }).collect();
        let next = allot(&TILING, &[squares], &vec![100; TILING.len()], 1000);
        // Its mean is .5 of what is allowed of the whole, and twice what is allowed of a sixteenth.
        assert!((200..=400).contains(&next[0]), "{}", next[0]);
        assert_eq!(next[TILING.len() - 1], 100);
    }

    #[test]
    fn every_picture_has_what_it_needs() {
        let flat = vec![1.5; TILING.len()];
        let [corner, both] = [vec![corner()], vec![flat, corner()]];
        let counts = vec![100; TILING.len()];
        let [of_one, of_both] = [corner, both].map(|squares| allot(&TILING, &squares, &counts, 1000));
        assert!(of_one.iter().zip(&of_both).all(|(one, both)| one <= both));
        assert!(of_one.last() < of_both.last());
    }
}
