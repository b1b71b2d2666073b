//! Pictures side by side: headings above the columns, names beside the rows, a caption below
//! each picture; gaps are equal in both directions.

use image::RgbImage;

use crate::canvas::{Anchor, Area, Canvas, FAINT, FigureError, INK, length, text};

/// A picture of a grid, with its caption.
#[derive(Clone, Debug)]
pub struct Cell {
    /// The picture; all pictures of a grid have the same size.
    pub picture: RgbImage,
    /// Lines of the caption below the picture; all cells of a grid have as many.
    pub caption: Vec<String>,
}

/// A row of pictures.
#[derive(Clone, Debug)]
pub struct Row {
    /// Name beside the row, read upward.
    pub name: String,
    /// Pictures from left to right.
    pub cells: Vec<Cell>,
}

/// A grid of pictures.
#[derive(Clone, Debug)]
pub struct Grid {
    /// Headings above the columns.
    pub columns: Vec<String>,
    /// Rows from top to bottom.
    pub rows: Vec<Row>,
    /// Names of the scales along the columns and along the rows; `None` where they are no scales.
    pub axes: Option<[String; 2]>,
}

/// Lengths of a grid, pixels.
struct Measures {
    /// Width and height of a picture.
    picture: (u32, u32),
    /// Height of the letters of headings.
    heading: u32,
    /// Height of the letters of captions.
    caption: u32,
    /// Distance between pictures.
    gap: u32,
    /// Distance of the pictures from the left edge.
    left: u32,
    /// Distance of the pictures from the upper edge.
    top: u32,
    /// Distance from one row to the next.
    pitch: u32,
}

impl Measures {
    fn of(grid: &Grid) -> Self {
        let cell = grid.rows.first().and_then(|r| r.cells.first());
        let picture = cell.map_or((1, 1), |c| c.picture.dimensions());
        let lines = cell.map_or(0, |c| c.caption.len() as u32);
        let heading = (picture.0 / 20).clamp(13, 24);
        let caption = (picture.0 / 26).clamp(12, 18);
        let gap = (picture.0 / 30).max(6);
        let strips = if grid.axes.is_some() { 2 } else { 1 };
        let strip = strips * (heading * 3 / 2) + gap;
        Self {
            picture,
            heading,
            caption,
            gap,
            left: strip,
            top: strip,
            pitch: picture.1 + gap + if lines > 0 { lines * caption * 3 / 2 + gap / 2 } else { 0 },
        }
    }

    /// Upper left corner of a picture.
    fn corner(&self, column: usize, row: usize) -> (u32, u32) {
        (self.left + column as u32 * (self.picture.0 + self.gap), self.top + row as u32 * self.pitch)
    }
}

impl Grid {
    /// Draws the grid.
    ///
    /// # Errors
    /// When the font or the canvas fails.
    pub fn draw(&self) -> Result<Canvas, FigureError> {
        let m = Measures::of(self);
        let n_columns = self.rows.iter().map(|r| r.cells.len()).max().unwrap_or(0).max(1);
        let (right, bottom) = m.corner(n_columns, self.rows.len());
        let mut canvas = Canvas::drawn((right, bottom), |area| self.letter(&m, n_columns, area))?;
        for (j, row) in self.rows.iter().enumerate() {
            for (i, cell) in row.cells.iter().enumerate() {
                let (x, y) = m.corner(i, j);
                canvas.paste(&cell.picture, x, y);
            }
        }
        Ok(canvas)
    }

    /// Writes headings, names and captions.
    fn letter(&self, m: &Measures, n_columns: usize, area: &Area) -> Result<(), FigureError> {
        let (w, h) = m.picture;
        // The strip nearest to the pictures is that of the names.
        let beside = (m.left - m.gap - m.heading * 3 / 4) as i32;
        let across = fitting(self.columns.iter(), m.heading, w)?;
        let upward = fitting(self.rows.iter().map(|r| &r.name), m.heading, h)?;
        for (i, name) in self.columns.iter().enumerate() {
            let (x, _) = m.corner(i, 0);
            text(area, name, ((x + w / 2) as i32, beside), across, INK, Anchor::Center)?;
        }
        if let Some([along, down]) = &self.axes {
            let far = (m.heading * 3 / 4 + m.gap / 2) as i32;
            let (right, bottom) = m.corner(n_columns, self.rows.len());
            let middle = |from: u32, to: u32| ((from + to - m.gap) / 2) as i32;
            text(area, along, (middle(m.left, right), far), m.heading, FAINT, Anchor::Center)?;
            text(area, down, (far, middle(m.top, bottom)), m.heading, FAINT, Anchor::Upward)?;
        }
        for (j, row) in self.rows.iter().enumerate() {
            let (_, y) = m.corner(0, j);
            text(area, &row.name, (beside, (y + h / 2) as i32), upward, INK, Anchor::Upward)?;
            for (i, cell) in row.cells.iter().enumerate() {
                let (x, _) = m.corner(i, j);
                for (k, words) in cell.caption.iter().enumerate() {
                    let below = y + h + m.gap / 2 + m.caption * 3 / 4 + k as u32 * m.caption * 3 / 2;
                    let color = if k == 0 { INK } else { FAINT };
                    text(area, words, ((x + w / 2) as i32, below as i32), m.caption, color, Anchor::Center)?;
                }
            }
        }
        Ok(())
    }
}

/// Largest height of letters, `size` at most, at which none of the words is longer than `room`.
fn fitting<'a>(
    mut words: impl Iterator<Item = &'a String>,
    size: u32,
    room: u32,
) -> Result<u32, FigureError> {
    let longest = words.try_fold(1, |most, w| Ok::<_, FigureError>(length(w, size)?.max(most)))?;
    Ok(size.min(size * room / longest).max(6))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(width: u32) -> Grid {
        let picture = RgbImage::from_pixel(width, width / 2, image::Rgb([255, 0, 0]));
        let cell = Cell { picture, caption: vec!["f_q 0.25".to_owned()] };
        let row = Row { name: "row".to_owned(), cells: vec![cell.clone(), cell] };
        Grid { columns: vec!["a".to_owned(), "b".to_owned()], rows: vec![row.clone(), row], axes: None }
    }

    /// Lengths of runs of red along a line of pixels.
    fn runs(line: impl Iterator<Item = image::Rgb<u8>>) -> Vec<(bool, usize)> {
        let mut runs: Vec<(bool, usize)> = Vec::new();
        for pixel in line {
            let red = pixel.0 == [255, 0, 0];
            match runs.last_mut() {
                Some((last, n)) if *last == red => *n += 1,
                _ => runs.push((red, 1)),
            }
        }
        runs
    }

    #[test]
    fn pictures_are_whole_and_evenly_spaced_and_nothing_is_written_on_them() {
        let png = grid(90).draw().unwrap().png().unwrap();
        let image = image::load_from_memory(&png).unwrap().to_rgb8();
        let red = image.pixels().filter(|p| p.0 == [255, 0, 0]).count();
        assert_eq!(red, 4 * 90 * 45);
        let m = Measures::of(&grid(90));
        let across = runs((0..image.width()).map(|x| *image.get_pixel(x, m.top + 2)));
        let widths: Vec<usize> = across.iter().filter(|r| r.0).map(|r| r.1).collect();
        assert_eq!(widths, [90, 90]);
        assert_eq!(across[2], (false, m.gap as usize));
        assert_eq!(across[4], (false, m.gap as usize));
    }
}
