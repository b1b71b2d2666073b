//! Square tiles of a picture.

use std::ops::Range;

use glam::UVec2;

/// Division of a picture into square tiles, row by row from the top; those at the right and at the bottom are
/// cut off where the picture ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tiling {
    /// Width and height of the picture, pixels.
    pub size: UVec2,
    /// Side of a tile, pixels.
    pub side: u32,
}

impl Tiling {
    /// Numbers of tiles in a row and in a column.
    #[must_use]
    pub fn shape(&self) -> UVec2 {
        UVec2::new(self.size.x.div_ceil(self.side), self.size.y.div_ceil(self.side))
    }

    /// Number of tiles.
    #[must_use]
    pub fn len(&self) -> usize {
        self.shape().element_product() as usize
    }

    /// Whether the picture has no pixels.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Index of the tile of a pixel.
    #[must_use]
    pub fn of(&self, pixel: UVec2) -> usize {
        let tile = pixel / self.side;
        (tile.y * self.shape().x + tile.x) as usize
    }

    /// Index of the tile of the pixel with an index, row by row.
    #[must_use]
    pub fn of_index(&self, pixel: usize) -> usize {
        let (pixel, width) = (pixel as u32, self.size.x);
        self.of(UVec2::new(pixel % width, pixel / width))
    }

    /// Columns and rows of the pixels of a tile.
    #[must_use]
    pub fn ranges(&self, tile: usize) -> [Range<u32>; 2] {
        let across = self.shape().x;
        let first = UVec2::new(tile as u32 % across, tile as u32 / across) * self.side;
        let end = (first + self.side).min(self.size);
        [first.x..end.x, first.y..end.y]
    }

    /// Number of pixels of a tile.
    #[must_use]
    pub fn n_pixels(&self, tile: usize) -> usize {
        self.ranges(tile).iter().map(ExactSizeIterator::len).product()
    }

    /// Sum over all pixels of a number that each tile has for every pixel of it.
    pub fn total(&self, of_pixel: impl Fn(usize) -> u32) -> u64 {
        (0..self.len()).map(|t| self.n_pixels(t) as u64 * u64::from(of_pixel(t))).sum()
    }

    /// Mean over all pixels of a number that each tile has for every pixel of it; 0 without pixels.
    pub fn mean(&self, of_pixel: impl Fn(usize) -> u32) -> f64 {
        self.total(of_pixel) as f64 / f64::from(self.size.element_product().max(1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_hold_every_pixel_once() {
        let tiling = Tiling { size: UVec2::new(37, 20), side: 16 };
        assert_eq!((tiling.shape(), tiling.len()), (UVec2::new(3, 2), 6));
        let mut seen = vec![0; 37 * 20];
        for tile in 0..tiling.len() {
            let [columns, rows] = tiling.ranges(tile);
            assert_eq!(columns.len() * rows.len(), tiling.n_pixels(tile));
            for (x, y) in rows.flat_map(|y| columns.clone().map(move |x| (x, y))) {
                assert_eq!(tiling.of(UVec2::new(x, y)), tile);
                assert_eq!(tiling.of_index((y * 37 + x) as usize), tile);
                seen[(y * 37 + x) as usize] += 1;
            }
        }
        assert!(seen.iter().all(|&n| n == 1));
        // The right column of tiles is 5 wide, the lower row 4 high.
        assert_eq!(tiling.total(|t| u32::from(t == 2) + 10 * u32::from(t == 3)), 5 * 16 + 10 * 16 * 4);
        assert_eq!(tiling.mean(|_| 3), 3.0);
    }
}
