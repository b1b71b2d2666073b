//! RGB pictures to draw on, to write on and to paste pictures on.

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

use crate::{film::Picture, math::ViewTransform};

/// Error of the drawing backend.
pub type DrawError = DrawingAreaErrorKind<<BitMapBackend<'static> as DrawingBackend>::ErrorType>;
/// Area of a canvas on which plots are drawn.
pub type Area<'a> = DrawingArea<BitMapBackend<'a>, Shift>;

/// A figure cannot be made.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum FigureError {
    #[error("cannot read the font")]
    Font,
    #[error("cannot draw the figure")]
    Draw(#[from] DrawError),
    #[error("cannot draw the figure: {0}")]
    Svg(String),
    #[error("cannot encode the figure")]
    Encode(#[from] image::ImageError),
    #[error("cannot fill in the table")]
    Table(#[from] std::fmt::Error),
}

/// Colour of text and lines: dark enough to read, softer than black.
pub const INK: RGBColor = RGBColor(34, 34, 34);
/// Colour of secondary text.
pub const FAINT: RGBColor = RGBColor(110, 110, 110);

/// Position of a text relative to the point at which it is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Anchor {
    /// The point is at the left end, in the middle of the height.
    Left,
    /// The point is in the middle of length and height.
    Center,
    /// The point is at the right end, in the middle of the height.
    Right,
    /// The point is in the middle of length and height, and the text is read upward.
    Upward,
}

/// A drawing on which pictures may be pasted.
#[derive(Clone, Debug)]
pub struct Canvas {
    image: RgbImage,
}

/// Factor by which drawings are made larger and then reduced: the bitmap backend sets letters on whole
/// pixels, which spaces small ones unevenly.
pub const SCALE: i32 = 3;

/// Lets plots be written with the font that is part of the program: a headless machine may have none.
///
/// # Errors
/// When it cannot be read.
pub fn take_font() -> Result<(), FigureError> {
    plotters::style::register_font("sans-serif", FontStyle::Normal, dejavu::sans::regular())
        .map_err(|_| FigureError::Font)
}

impl Canvas {
    /// Draws on white; lengths given to the functions of this module are in pixels of the
    /// canvas, those given to `area` itself [`SCALE`] times as long.
    ///
    /// # Errors
    /// What `draw` fails with, or when the font cannot be read.
    pub fn drawn(
        (width, height): (u32, u32),
        draw: impl FnOnce(&Area) -> Result<(), FigureError>,
    ) -> Result<Self, FigureError> {
        take_font()?;
        let size = (width * SCALE as u32, height * SCALE as u32);
        let mut large = RgbImage::from_pixel(size.0, size.1, image::Rgb([255; 3]));
        let area = BitMapBackend::with_buffer(&mut large, size).into_drawing_area();
        draw(&area)?;
        area.present()?;
        drop(area);
        Ok(Self { image: image::imageops::thumbnail(&large, width, height) })
    }

    /// Pastes a picture with its upper left corner at (x, y), pixels.
    pub fn paste(&mut self, picture: &RgbImage, x: u32, y: u32) {
        image::imageops::replace(&mut self.image, picture, i64::from(x), i64::from(y));
    }

    /// Bytes of the canvas as a PNG file.
    ///
    /// # Errors
    /// When it cannot be encoded.
    pub fn png(&self) -> Result<Vec<u8>, FigureError> {
        let mut png = Cursor::new(Vec::new());
        self.image.write_to(&mut png, image::ImageFormat::Png)?;
        Ok(png.into_inner())
    }
}

/// Writes a text in letters of the height `size`, pixels, at a point.
///
/// # Errors
/// When the backend cannot draw.
pub fn text(
    area: &Area,
    words: &str,
    at: (i32, i32),
    size: u32,
    color: RGBColor,
    anchor: Anchor,
) -> Result<(), FigureError> {
    let h = match anchor {
        Anchor::Left => HPos::Left,
        Anchor::Right => HPos::Right,
        Anchor::Center | Anchor::Upward => HPos::Center,
    };
    let font = ("sans-serif", size * SCALE as u32).into_font();
    let font = if anchor == Anchor::Upward { font.transform(FontTransform::Rotate270) } else { font };
    let style = font.color(&color).pos(Pos::new(h, VPos::Center));
    // The middle of a line of text lies above that of its letters.
    let lower = size as i32 * SCALE / 8;
    let (x, y) = scaled(at);
    let at = if anchor == Anchor::Upward { (x + lower, y) } else { (x, y + lower) };
    Ok(area.draw(&Text::new(words.to_owned(), at, style))?)
}

/// Length of a text in letters of the height `size`, pixels.
///
/// # Errors
/// When the font cannot be read.
pub fn length(words: &str, size: u32) -> Result<u32, FigureError> {
    let font = ("sans-serif", size * SCALE as u32).into_font();
    let (width, _) = font.box_size(words).map_err(|_| FigureError::Font)?;
    Ok(width.div_ceil(SCALE as u32))
}

/// A point of the canvas in the enlarged drawing.
fn scaled((x, y): (i32, i32)) -> (i32, i32) {
    (x * SCALE, y * SCALE)
}

/// Draws straight lines from point to point.
///
/// # Errors
/// When the backend cannot draw.
pub fn line(area: &Area, points: &[(i32, i32)], color: RGBAColor, width: u32) -> Result<(), FigureError> {
    let points: Vec<_> = points.iter().map(|p| scaled(*p)).collect();
    Ok(area.draw(&PathElement::new(points, color.stroke_width(width * SCALE as u32)))?)
}

/// Draws a filled rectangle between two corners.
///
/// # Errors
/// When the backend cannot draw.
pub fn bar(area: &Area, [a, b]: [(i32, i32); 2], color: RGBColor) -> Result<(), FigureError> {
    Ok(area.draw(&Rectangle::new([scaled(a), scaled(b)], color.filled()))?)
}

/// Draws a filled circle.
///
/// # Errors
/// When the backend cannot draw.
pub fn dot(area: &Area, at: (i32, i32), radius: i32, color: RGBColor) -> Result<(), FigureError> {
    Ok(area.draw(&Circle::new(scaled(at), radius * SCALE, color.filled()))?)
}

/// A linear picture as a view shows it on an sRGB display, at an exposure.
#[must_use]
pub fn displayed(picture: &Picture, exposure: f64, view: ViewTransform) -> RgbImage {
    RgbImage::from_fn(picture.width as u32, picture.height as u32, |x, y| {
        let codes = view.encode(picture.rgb[y as usize * picture.width + x as usize], exposure);
        image::Rgb(codes.map(|code| (255.0 * code).round() as u8))
    })
}
