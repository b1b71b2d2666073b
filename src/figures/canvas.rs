//! An RGB picture to draw, letter and paste on.

use std::io::Cursor;

use image::RgbImage;
use plotters::{
    coord::Shift,
    prelude::*,
    style::{
        FontTransform, RGBAColor,
        text_anchor::{HPos, Pos, VPos},
    },
};

use crate::{film::Picture, math::display::oetf_srgb};

/// What drawing may fail with.
pub type DrawError = DrawingAreaErrorKind<<BitMapBackend<'static> as DrawingBackend>::ErrorType>;
/// Where plots are drawn.
pub type Area<'a> = DrawingArea<BitMapBackend<'a>, Shift>;

/// A figure cannot be made.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum FigureError {
    #[error("cannot read the font")]
    Font,
    #[error("cannot draw the figure")]
    Draw(#[from] DrawError),
    #[error("cannot encode the figure")]
    Encode(#[from] image::ImageError),
    #[error("cannot fill in the table")]
    Table(#[from] std::fmt::Error),
}

/// Dark enough to read, softer than black.
pub const INK: RGBColor = RGBColor(34, 34, 34);
/// For what is said in passing.
pub const FAINT: RGBColor = RGBColor(110, 110, 110);

/// How a text hangs on its point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Anchor {
    /// Left end, middle of the height.
    Left,
    /// Middle of both.
    Center,
    /// Right end, middle of the height.
    Right,
    /// Middle of both, read upward.
    Upward,
}

/// A picture in the making, white at first.
#[derive(Clone, Debug)]
pub struct Canvas {
    image: RgbImage,
}

impl Canvas {
    /// A white canvas, pixels.
    #[must_use]
    pub fn new(width: u32, height: u32) -> Self {
        Self { image: RgbImage::from_pixel(width, height, image::Rgb([255; 3])) }
    }

    /// Puts a picture with its upper left corner at (x, y).
    pub fn paste(&mut self, picture: &RgbImage, x: u32, y: u32) {
        image::imageops::replace(&mut self.image, picture, i64::from(x), i64::from(y));
    }

    /// Draws on it.
    ///
    /// # Errors
    /// What `draw` fails with, or when the font cannot be read.
    pub fn draw<T>(&mut self, draw: impl FnOnce(&Area) -> Result<T, FigureError>) -> Result<T, FigureError> {
        // The font is part of the program: a headless machine may have none.
        plotters::style::register_font("sans-serif", FontStyle::Normal, dejavu::sans::regular())
            .map_err(|_| FigureError::Font)?;
        let size = self.image.dimensions();
        let area = BitMapBackend::with_buffer(&mut self.image, size).into_drawing_area();
        let out = draw(&area)?;
        area.present()?;
        Ok(out)
    }

    /// As PNG.
    ///
    /// # Errors
    /// When it cannot be encoded.
    pub fn png(&self) -> Result<Vec<u8>, FigureError> {
        let mut png = Cursor::new(Vec::new());
        self.image.write_to(&mut png, image::ImageFormat::Png)?;
        Ok(png.into_inner())
    }
}

/// Writes a text of a height in pixels at (x, y).
///
/// # Errors
/// When the backend cannot draw.
pub fn text(
    area: &Area,
    words: &str,
    (x, y): (i32, i32),
    size: u32,
    color: RGBColor,
    anchor: Anchor,
) -> Result<(), FigureError> {
    let h = match anchor {
        Anchor::Left => HPos::Left,
        Anchor::Right => HPos::Right,
        Anchor::Center | Anchor::Upward => HPos::Center,
    };
    let font = ("sans-serif", size).into_font();
    let font = if anchor == Anchor::Upward { font.transform(FontTransform::Rotate270) } else { font };
    let style = font.color(&color).pos(Pos::new(h, VPos::Center));
    Ok(area.draw(&Text::new(words.to_owned(), (x, y), style))?)
}

/// A straight line, one pixel or more wide.
///
/// # Errors
/// When the backend cannot draw.
pub fn line(area: &Area, points: Vec<(i32, i32)>, color: RGBAColor, width: u32) -> Result<(), FigureError> {
    Ok(area.draw(&PathElement::new(points, color.stroke_width(width)))?)
}

/// A picture as a display shows it.
#[must_use]
pub fn displayed(picture: &Picture, exposure: f64) -> RgbImage {
    let encode = |v: f32| (255.0 * oetf_srgb((exposure * f64::from(v)).clamp(0.0, 1.0))).round() as u8;
    RgbImage::from_fn(picture.width as u32, picture.height as u32, |x, y| {
        image::Rgb(picture.rgb[y as usize * picture.width + x as usize].map(encode))
    })
}
