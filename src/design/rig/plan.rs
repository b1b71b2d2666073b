//! The plan of a set as photographers draw it: from above and from the side, to scale.

use glam::{Vec2, Vec3};
use plotters::{
    coord::Shift,
    prelude::*,
    style::text_anchor::{HPos, Pos, VPos},
};

use super::{PlacedLamp, describe::in_words, set::Ground};
use crate::{
    audit::placed::Description,
    canvas::{Canvas, FigureError, INK, SCALE, take_font},
    light::Planar,
};

/// Width and height of a view, pixels.
const VIEW: f32 = 420.0;
/// Margin around a view, pixels.
const MARGIN: f32 = 24.0;
/// Height of a line of the legend, pixels.
const LINE: f32 = 18.0;
/// Height of the letters, pixels.
const LETTERS: i32 = 12;

/// Colour of frames, of the camera's axis and of where lamps stood.
const PALE: RGBColor = RGBColor(200, 200, 200);
/// Colour of points of the background.
const SURFACE: RGBColor = RGBColor(187, 187, 187);
/// Colour of the subject.
const SUBJECT: RGBColor = RGBColor(232, 232, 232);
/// Colour of the middle of a lamp's light.
const BEAM: RGBColor = RGBColor(221, 153, 0);
/// Colours of lamps and of their edges.
const LAMP: [RGBColor; 2] = [RGBColor(255, 204, 102), RGBColor(187, 119, 0)];

/// What a plan shows: the set, and lamps with their descriptions.
pub(super) struct Plan<'a> {
    pub ground: &'a Ground,
    pub lamps: Vec<(&'a PlacedLamp, Description)>,
}

type Drawn<B> = Result<(), DrawingAreaErrorKind<<B as DrawingBackend>::ErrorType>>;

/// What draws on an area, in pixels of the plan.
#[derive(Clone, Copy)]
struct Pen<'a, B: DrawingBackend> {
    area: &'a DrawingArea<B, Shift>,
    /// Pixels of the area for one of the plan.
    enlarged: i32,
}

/// A view of the set: two axes of the drawing, to the right and down, metres.
struct View<'a, B: DrawingBackend> {
    pen: &'a Pen<'a, B>,
    right: Vec3,
    down: Vec3,
    /// Place of the drawing's left edge, pixels.
    left: f32,
    /// Middle of what is drawn, metres along the axes.
    middle: Vec2,
    /// Pixels per metre.
    scale: f32,
}

/// A point along two axes, metres.
fn along(p: Vec3, [right, down]: [Vec3; 2]) -> Vec2 {
    Vec2::new(p.dot(right), p.dot(down))
}

impl Plan<'_> {
    /// The plan as an SVG file.
    ///
    /// # Errors
    /// When the font cannot be read, or nothing drawn.
    pub fn svg(&self) -> Result<String, FigureError> {
        // Letters are measured with it.
        take_font()?;
        let mut text = String::new();
        let area = SVGBackend::with_string(&mut text, self.size()).into_drawing_area();
        let fail = |e: DrawingAreaErrorKind<_>| FigureError::Svg(e.to_string());
        area.fill(&WHITE).map_err(fail)?;
        self.draw(&area, 1).map_err(fail)?;
        area.present().map_err(fail)?;
        drop(area);
        Ok(text)
    }

    /// The plan as a PNG file.
    ///
    /// # Errors
    /// When the font cannot be read, or nothing drawn.
    pub fn png(&self) -> Result<Vec<u8>, FigureError> {
        Canvas::drawn(self.size(), |area| Ok(self.draw(area, SCALE)?))?.png()
    }

    /// Width and height of the drawing, pixels.
    fn size(&self) -> (u32, u32) {
        let height = VIEW + 2.0 * MARGIN + LINE * (self.lamps.len() as f32 + 1.5);
        ((2.0 * VIEW + 3.0 * MARGIN) as u32, height as u32)
    }

    /// Draws everything, `enlarged` times as large.
    fn draw<B: DrawingBackend>(&self, area: &DrawingArea<B, Shift>, enlarged: i32) -> Drawn<B> {
        let Self { ground, lamps } = self;
        let views =
            [("from above", ground.right, ground.front), ("from the side", ground.front, Vec3::NEG_Y)];
        let reach = |p: Vec3| p.distance(ground.center);
        let places = lamps.iter().flat_map(|(l, _)| l.moved_from.into_iter().chain([l.lamp.position]));
        let far = places.map(reach).fold(reach(ground.eye), f32::max);
        let scale = 0.5 * VIEW / (1.1 * far).max(f32::MIN_POSITIVE);
        let pen = Pen { area, enlarged };
        let mut left = MARGIN;
        for (title, right, down) in views {
            let middle = along(ground.center, [right, down]);
            let view = View { pen: &pen, right, down, left, middle, scale };
            self.draw_view(&view, title)?;
            left += VIEW + MARGIN;
        }
        for (k, (lamp, description)) in lamps.iter().enumerate() {
            let y = VIEW + 2.0 * MARGIN + LINE * (k as f32 + 0.25);
            let line = format!("{}: {}", lamp.name, in_words(description));
            pen.label(Vec2::new(MARGIN, y), HPos::Left, &line)?;
        }
        let from = Vec2::new(MARGIN, VIEW + 2.0 * MARGIN + LINE * (lamps.len() as f32 + 0.5));
        let to = from + Vec2::new(scale, 0.0);
        pen.line(from, to, INK)?;
        pen.label(to + Vec2::new(6.0, 0.0), HPos::Left, "1 m")
    }

    /// Draws one view of the set.
    fn draw_view<B: DrawingBackend>(&self, view: &View<B>, title: &str) -> Drawn<B> {
        let Self { ground, lamps } = self;
        let pen = view.pen;
        let corner = Vec2::new(view.left, MARGIN);
        pen.frame(corner, corner + VIEW, PALE.stroke_width(pen.enlarged as u32))?;
        pen.label(corner + Vec2::new(6.0, 12.0), HPos::Left, title)?;
        for p in ground.surfaces.iter().map(|&p| view.at(p)).filter(|&p| view.holds(p)) {
            pen.disk(p, 1.0, SURFACE.filled())?;
        }
        let middle = view.at(ground.center);
        let radius = ground.radius * view.scale;
        pen.disk(middle, radius, SUBJECT.filled())?;
        pen.disk(middle, radius, INK.stroke_width(pen.enlarged as u32))?;
        pen.label(middle, HPos::Center, "subject")?;
        let eye = view.at(ground.eye);
        pen.line(eye, middle, PALE)?;
        pen.frame(eye - 6.0, eye + 6.0, INK.filled())?;
        pen.label(eye + Vec2::new(0.0, -14.0), HPos::Center, "camera")?;
        lamps.iter().try_for_each(|(lamp, description)| view.lamp(lamp, description))
    }
}

impl<B: DrawingBackend> View<'_, B> {
    /// A point of the set in the drawing, pixels.
    fn at(&self, p: Vec3) -> Vec2 {
        let to = (along(p, [self.right, self.down]) - self.middle) * self.scale;
        to + Vec2::new(self.left + 0.5 * VIEW, MARGIN + 0.5 * VIEW)
    }

    /// Whether a point of the drawing is within the view.
    fn holds(&self, p: Vec2) -> bool {
        let (lo, hi) = (Vec2::new(self.left, MARGIN), Vec2::new(self.left + VIEW, MARGIN + VIEW));
        p.cmpge(lo).all() && p.cmple(hi).all()
    }

    /// Draws a lamp to scale, with a line to where it looks, and where it stood before.
    fn lamp(&self, lamp: &PlacedLamp, description: &Description) -> Drawn<B> {
        let pen = self.pen;
        let Planar { center, frame, .. } = lamp.lamp.planar();
        let [a, b] = description.extent.map(|extent| 0.5 * extent as f32);
        let corners = [(a, b), (-a, b), (-a, -b), (a, -b), (a, b)];
        let corners = corners.map(|(u, v)| pen.pixel(self.at(center + frame.s * u + frame.t * v)));
        let (from, to) = (self.at(center), self.at(lamp.lamp.look_at));
        if let Some(before) = lamp.moved_from.map(|p| self.at(p)) {
            pen.line(before, from, PALE)?;
            pen.disk(before, 5.0, PALE.stroke_width(2 * pen.enlarged as u32))?;
        }
        pen.line(from, from + (to - from) * 0.4, BEAM)?;
        pen.area.draw(&Polygon::new(corners, LAMP[0].mix(0.6)))?;
        pen.area.draw(&PathElement::new(corners, LAMP[1].stroke_width(2 * pen.enlarged as u32)))?;
        pen.label(from + Vec2::new(0.0, -12.0), HPos::Center, &lamp.name)
    }
}

impl<B: DrawingBackend> Pen<'_, B> {
    /// A point of the drawing in the area, pixels.
    fn pixel(&self, p: Vec2) -> (i32, i32) {
        let p = (p * self.enlarged as f32).round();
        (p.x as i32, p.y as i32)
    }

    fn line(&self, a: Vec2, b: Vec2, color: RGBColor) -> Drawn<B> {
        let style = color.stroke_width(self.enlarged as u32);
        self.area.draw(&PathElement::new([self.pixel(a), self.pixel(b)], style))
    }

    fn frame(&self, a: Vec2, b: Vec2, style: ShapeStyle) -> Drawn<B> {
        self.area.draw(&Rectangle::new([self.pixel(a), self.pixel(b)], style))
    }

    fn disk(&self, center: Vec2, radius: f32, style: ShapeStyle) -> Drawn<B> {
        let radius = (radius * self.enlarged as f32).round() as i32;
        self.area.draw(&Circle::new(self.pixel(center), radius, style))
    }

    /// Writes a text whose middle, or left end, is at a point.
    fn label(&self, at: Vec2, anchor: HPos, words: &str) -> Drawn<B> {
        let font = ("sans-serif", LETTERS * self.enlarged).into_font().color(&INK);
        let style = font.pos(Pos::new(anchor, VPos::Center));
        self.area.draw(&Text::new(words.to_owned(), self.pixel(at), style))
    }
}
