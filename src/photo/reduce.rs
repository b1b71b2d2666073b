//! Reduction of pictures by the box filter, exactly weighted by area.

/// Width and height of a picture reduced so that its longer side has at most `longest`
/// pixels, with its shape kept to the nearest pixel; unchanged when it is no longer.
///
/// # Panics
/// When `longest` is 0.
#[must_use]
pub fn reduced_size([width, height]: [usize; 2], longest: usize) -> [usize; 2] {
    assert!(longest > 0, "a picture has at least one pixel");
    let side = width.max(height);
    if side <= longest {
        return [width, height];
    }
    [width, height].map(|n| ((n * longest + side / 2) / side).max(1))
}

/// The mean of `value`, of a pixel of a picture of size `from` by its row-major index, over the
/// area of every pixel of the picture of size `to`. It is asked for once a pixel where that is nowhere larger.
#[must_use]
pub fn box_filter(value: impl Fn(usize) -> f64, from: [usize; 2], to: [usize; 2]) -> Vec<f64> {
    if from == to {
        return (0..from[0] * from[1]).map(value).collect();
    }
    let columns = footprints(from[0], to[0]);
    let rows = footprints(from[1], to[1]);
    let mut out = Vec::with_capacity(to[0] * to[1]);
    let mut sums = vec![0.0; to[0]];
    // Rows that two rows of the result share are next to each other.
    let (mut line, mut line_is) = (vec![0.0; from[0]], None);
    let area = (from[0] * from[1]) as f64;
    for row in &rows {
        sums.fill(0.0);
        for &(y, weight) in row {
            if line_is != Some(y) {
                line.iter_mut().enumerate().for_each(|(x, v)| *v = value(y * from[0] + x));
                line_is = Some(y);
            }
            for (sum, column) in sums.iter_mut().zip(&columns) {
                *sum += weight * column.iter().map(|&(x, w)| w * line[x]).sum::<f64>();
            }
        }
        out.extend(sums.iter().map(|sum| sum / area));
    }
    out
}

/// Index and weight of the pixels of a line of `from` pixels under each pixel of a line of
/// `to`. Weights are the lengths of the overlaps in units of 1/`to` pixels: whole numbers that
/// add up to `from`.
fn footprints(from: usize, to: usize) -> Vec<Vec<(usize, f64)>> {
    let overlap = |i: usize, j: usize| {
        let (start, end) = ((j * from).max(i * to), ((j + 1) * from).min((i + 1) * to));
        (i, (end - start) as f64)
    };
    (0..to).map(|j| (j * from / to..((j + 1) * from).div_ceil(to)).map(|i| overlap(i, j)).collect()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_large_pictures_become_smaller_and_keep_their_shape() {
        assert_eq!(reduced_size([512, 100], 512), [512, 100]);
        assert_eq!(reduced_size([1024, 768], 512), [512, 384]);
        assert_eq!(reduced_size([768, 1000], 512), [393, 512]);
        assert_eq!(reduced_size([5000, 1], 512), [512, 1]);
    }

    #[test]
    fn whole_factors_average_blocks() {
        let values: Vec<f64> = (0..24).map(f64::from).collect(); // 6 × 4
        let got = box_filter(|i| values[i], [6, 4], [3, 2]);
        assert_eq!(got, [3.5, 5.5, 7.5, 15.5, 17.5, 19.5]);
    }

    #[test]
    fn fractions_of_pixels_count_by_their_area() {
        // 3 onto 2: each takes one pixel and half of the middle.
        assert_eq!(box_filter(|i| [1.0, 4.0, 10.0][i], [3, 1], [2, 1]), [2.0, 8.0]);
        assert_eq!(box_filter(|i| [1.0, 4.0, 10.0][i], [1, 3], [1, 2]), [2.0, 8.0]);
        // The integral of a function that rises linearly is exact in one direction by symmetry.
        let ramp: Vec<f64> = (0..35).map(|i| f64::from(i % 7)).collect(); // 7 × 5
        let got = box_filter(|i| ramp[i], [7, 5], [4, 3]);
        let (sum, n) = (got.iter().sum::<f64>(), got.len() as f64);
        assert!((sum / n - 3.0).abs() < 1e-14);
        assert!(got[..4].iter().zip(&got[8..]).all(|(a, b)| (a - b).abs() < 1e-14));
    }
}
