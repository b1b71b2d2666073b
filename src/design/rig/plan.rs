//! The plan of a set as photographers draw it: from above and from the side, to scale.

use std::fmt::Write as _;

use glam::{Vec2, Vec3};

use super::{PlacedLamp, describe::in_words, set::Ground};
use crate::{audit::placed::Description, light::Planar};

/// Width and height of a view, pixels.
const VIEW: f32 = 420.0;
/// Margin around a view, pixels.
const MARGIN: f32 = 24.0;
/// Height of a line of the legend, pixels.
const LINE: f32 = 18.0;

/// A view of the set: two axes of the drawing, to the right and down, metres.
struct View<'a> {
    title: &'a str,
    right: Vec3,
    down: Vec3,
    /// Place of the drawing's left edge, pixels.
    left: f32,
    /// Middle of what is drawn, metres along the axes.
    middle: Vec2,
    /// Pixels per metre.
    scale: f32,
}

impl View<'_> {
    fn along(&self, p: Vec3) -> Vec2 {
        Vec2::new(p.dot(self.right), p.dot(self.down))
    }

    fn at(&self, p: Vec3) -> Vec2 {
        let to = (self.along(p) - self.middle) * self.scale;
        to + Vec2::new(self.left + 0.5 * VIEW, MARGIN + 0.5 * VIEW)
    }

    fn holds(&self, p: Vec2) -> bool {
        let (lo, hi) = (Vec2::new(self.left, MARGIN), Vec2::new(self.left + VIEW, MARGIN + VIEW));
        p.cmpge(lo).all() && p.cmple(hi).all()
    }
}

/// The plan of some lamps with their descriptions, as an SVG file.
#[must_use]
pub fn svg(ground: &Ground, lamps: &[(&PlacedLamp, Description)]) -> String {
    let views = [("from above", ground.right, ground.front), ("from the side", ground.front, Vec3::NEG_Y)];
    let reach = |p: Vec3| p.distance(ground.center);
    let far = lamps.iter().map(|(l, _)| reach(l.lamp.position)).fold(reach(ground.eye), f32::max);
    let scale = 0.5 * VIEW / (1.1 * far).max(f32::MIN_POSITIVE);
    let (width, height) =
        (2.0 * VIEW + 3.0 * MARGIN, VIEW + 2.0 * MARGIN + LINE * (lamps.len() as f32 + 1.5));
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
         viewBox=\"0 0 {width} {height}\" font-family=\"sans-serif\" font-size=\"12\" fill=\"none\" \
         stroke=\"#222\">\n<rect width=\"{width}\" height=\"{height}\" fill=\"#fff\" stroke=\"none\"/>\n"
    );
    for (i, (title, right, down)) in views.into_iter().enumerate() {
        let left = MARGIN + i as f32 * (VIEW + MARGIN);
        let mut view = View { title, right, down, left, middle: Vec2::ZERO, scale };
        view.middle = view.along(ground.center);
        draw(&mut out, &view, ground, lamps);
    }
    for (k, (lamp, description)) in lamps.iter().enumerate() {
        let y = VIEW + 2.0 * MARGIN + LINE * (k as f32 + 0.5);
        let words = format!("{}: {}", lamp.name, in_words(description));
        label(&mut out, Vec2::new(MARGIN, y), "start", &words);
    }
    let y = VIEW + 2.0 * MARGIN + LINE * (lamps.len() as f32 + 0.5);
    let metre = Vec2::new(scale, 0.0);
    line(&mut out, Vec2::new(MARGIN, y), Vec2::new(MARGIN, y) + metre, "#222");
    label(&mut out, Vec2::new(MARGIN, y) + metre + Vec2::new(6.0, 4.0), "start", "1 m");
    out += "</svg>\n";
    out
}

/// Draws one view of the set.
fn draw(out: &mut String, view: &View, ground: &Ground, lamps: &[(&PlacedLamp, Description)]) {
    let corner = Vec2::new(view.left, MARGIN);
    // Writing to a String does not fail.
    let _ = writeln!(
        out,
        "<rect x=\"{}\" y=\"{}\" width=\"{VIEW}\" height=\"{VIEW}\" stroke=\"#ccc\"/>",
        corner.x, corner.y
    );
    label(out, corner + Vec2::new(6.0, 16.0), "start", view.title);
    for p in ground.surfaces.iter().map(|&p| view.at(p)).filter(|&p| view.holds(p)) {
        let _ = writeln!(
            out,
            "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"1\" fill=\"#bbb\" stroke=\"none\"/>",
            p.x, p.y
        );
    }
    let middle = view.at(ground.center);
    let radius = ground.radius * view.scale;
    let _ = writeln!(
        out,
        "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"{radius:.1}\" fill=\"#e8e8e8\"/>",
        middle.x, middle.y
    );
    label(out, middle + Vec2::new(0.0, 4.0), "middle", "subject");
    let eye = view.at(ground.eye);
    line(out, eye, middle, "#ddd");
    let _ = writeln!(
        out,
        "<rect x=\"{:.1}\" y=\"{:.1}\" width=\"12\" height=\"12\" fill=\"#222\"/>",
        eye.x - 6.0,
        eye.y - 6.0
    );
    label(out, eye + Vec2::new(0.0, -10.0), "middle", "camera");
    for (lamp, description) in lamps {
        draw_lamp(out, view, lamp, description);
    }
}

/// Draws a lamp to scale, with a line to where it looks.
fn draw_lamp(out: &mut String, view: &View, lamp: &PlacedLamp, description: &Description) {
    let Planar { center, frame, .. } = lamp.lamp.planar();
    let [a, b] = description.extent.map(|extent| 0.5 * extent as f32);
    let corners =
        [(a, b), (-a, b), (-a, -b), (a, -b)].map(|(u, v)| view.at(center + frame.s * u + frame.t * v));
    let points: Vec<String> = corners.iter().map(|p| format!("{:.1},{:.1}", p.x, p.y)).collect();
    let (from, to) = (view.at(center), view.at(lamp.lamp.look_at));
    line(out, from, from + (to - from) * 0.4, "#d90");
    let _ = writeln!(
        out,
        "<polygon points=\"{}\" fill=\"#fc6\" fill-opacity=\"0.6\" stroke=\"#b70\" stroke-width=\"2\"/>",
        points.join(" ")
    );
    label(out, from + Vec2::new(0.0, -8.0), "middle", &lamp.name);
}

fn line(out: &mut String, a: Vec2, b: Vec2, colour: &str) {
    let _ = writeln!(
        out,
        "<line x1=\"{:.1}\" y1=\"{:.1}\" x2=\"{:.1}\" y2=\"{:.1}\" stroke=\"{colour}\"/>",
        a.x, a.y, b.x, b.y
    );
}

fn label(out: &mut String, at: Vec2, anchor: &str, words: &str) {
    let words = words.replace('&', "&amp;").replace('<', "&lt;");
    let _ = writeln!(
        out,
        "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"{anchor}\" fill=\"#222\" stroke=\"none\">{words}</text>",
        at.x, at.y
    );
}
