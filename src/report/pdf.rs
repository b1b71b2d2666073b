//! Drawings as PDF: what plotters draws becomes paths of one page. Letters are paths too, so that no font need be
//! embedded and all readers show them alike.

use std::{
    convert::Infallible,
    fmt::Write as _,
    io::{self, Write},
};

use ab_glyph::{Font, FontRef, OutlineCurve, Point};
use flate2::{Compression, write::ZlibEncoder};
use plotters_backend::{
    BackendColor, BackendCoord, BackendStyle, BackendTextStyle, DrawingBackend, DrawingErrorKind,
    FontTransform,
    text_anchor::{HPos, VPos},
};

/// Height of lower-case letters of the font over its size.
const X_HEIGHT: f32 = 0.547;
/// What plotters calls the size of a font over that of an em.
const LINE: f64 = 1.24;
/// Distance of the control points of a quarter of a circle of radius 1 from its ends.
const KAPPA: f64 = 0.552_284_75;

/// A page that is drawn.
pub struct Pdf<'f> {
    size: (u32, u32),
    /// Points of the page, 1/72 inch, per pixel.
    scale: f64,
    font: FontRef<'f>,
    content: String,
    /// Opacities that were used, in thousandths.
    opacities: Vec<u32>,
}

type Drawn = Result<(), DrawingErrorKind<Infallible>>;

impl<'f> Pdf<'f> {
    /// An empty page of `size` pixels.
    #[must_use]
    pub fn new(size: (u32, u32), scale: f64, font: FontRef<'f>) -> Self {
        Self { size, scale, font, content: String::new(), opacities: Vec::new() }
    }

    /// The bytes of the file.
    ///
    /// # Errors
    /// When the content cannot be deflated, which takes memory alone.
    pub fn finish(&self) -> io::Result<Vec<u8>> {
        let [width, height] = [self.size.0, self.size.1].map(|n| self.scale * f64::from(n));
        // Pixels count from the top.
        let content = format!("{0} 0 0 -{0} 0 {height} cm\n{1}", self.scale, self.content);
        let mut deflated = ZlibEncoder::new(Vec::new(), Compression::default());
        deflated.write_all(content.as_bytes())?;
        let deflated = deflated.finish()?;
        let states: String = self.opacities.iter().fold(String::new(), |states, o| {
            let opacity = f64::from(*o) / 1000.0;
            states + &format!("/O{o} << /CA {opacity} /ca {opacity} >> ")
        });
        let objects = [
            "<< /Type /Catalog /Pages 2 0 R >>".to_owned(),
            "<< /Type /Pages /Kids [3 0 R] /Count 1 >>".to_owned(),
            format!(
                "<< /Type /Page /Parent 2 0 R /MediaBox [0 0 {width} {height}] /Contents 4 0 R \
                 /Resources << /ExtGState << {states}>> >> >>"
            ),
        ];
        let mut out = b"%PDF-1.5\n%\xE2\xE3\xCF\xD3\n".to_vec();
        let mut places = Vec::new();
        for (i, object) in objects.iter().enumerate() {
            places.push(out.len());
            write!(out, "{} 0 obj\n{object}\nendobj\n", i + 1)?;
        }
        places.push(out.len());
        write!(out, "4 0 obj\n<< /Length {} /Filter /FlateDecode >>\nstream\n", deflated.len())?;
        out.extend_from_slice(&deflated);
        out.extend_from_slice(b"\nendstream\nendobj\n");
        let table = out.len();
        write!(out, "xref\n0 {}\n0000000000 65535 f \n", places.len() + 1)?;
        for place in &places {
            writeln!(out, "{place:010} 00000 n ")?;
        }
        write!(out, "trailer\n<< /Size {} /Root 1 0 R >>\nstartxref\n{table}\n%%EOF\n", places.len() + 1)?;
        Ok(out)
    }

    /// Adds operators; a string takes all.
    fn put(&mut self, operators: std::fmt::Arguments) {
        let _ = self.content.write_fmt(operators);
    }

    /// Sets the colour of lines and areas.
    fn paint(&mut self, color: BackendColor) {
        let opacity = (1000.0 * color.alpha.clamp(0.0, 1.0)).round() as u32;
        if !self.opacities.contains(&opacity) {
            self.opacities.push(opacity);
        }
        let (r, g, b) = color.rgb;
        let [r, g, b] = [r, g, b].map(|v| (f64::from(v) / 255.0 * 1e4).round() / 1e4);
        self.put(format_args!("/O{opacity} gs {r} {g} {b} RG {r} {g} {b} rg\n"));
    }

    /// Adds a path through some points; returns whether there are any.
    fn path(&mut self, points: impl IntoIterator<Item = BackendCoord>) -> bool {
        let mut is_first = true;
        for (x, y) in points {
            self.put(format_args!("{x} {y} {}\n", if is_first { "m" } else { "l" }));
            is_first = false;
        }
        !is_first
    }

    fn stroke(&mut self, width: u32, points: impl IntoIterator<Item = BackendCoord>) {
        self.put(format_args!("{width} w 1 j\n"));
        if self.path(points) {
            self.put(format_args!("S\n"));
        }
    }

    /// Adds the outline of a letter, whose points `to` puts on the page.
    fn letter(&mut self, curves: &[OutlineCurve], to: impl Fn(Point) -> [f32; 2]) {
        let mut at: Option<Point> = None;
        // A contour may end with a line of no length.
        let has_length = |curve: &&OutlineCurve| !matches!(curve, OutlineCurve::Line(a, b) if a == b);
        for curve in curves.iter().filter(has_length) {
            let (from, end) = match *curve {
                OutlineCurve::Line(a, b) | OutlineCurve::Quad(a, _, b) | OutlineCurve::Cubic(a, _, _, b) => {
                    (a, b)
                }
            };
            if at != Some(from) {
                let [x, y] = to(from);
                self.put(format_args!("{x:.2} {y:.2} m\n"));
            }
            at = Some(end);
            let [x, y] = to(end);
            let two_thirds = |a: Point, b: Point| {
                to(Point { x: a.x + 2.0 / 3.0 * (b.x - a.x), y: a.y + 2.0 / 3.0 * (b.y - a.y) })
            };
            let [p, q] = match *curve {
                OutlineCurve::Line(..) => {
                    self.put(format_args!("{x:.2} {y:.2} l\n"));
                    continue;
                }
                // A parabola as a cubic curve.
                OutlineCurve::Quad(a, control, b) => [two_thirds(a, control), two_thirds(b, control)],
                OutlineCurve::Cubic(_, p, q, _) => [to(p), to(q)],
            };
            self.put(format_args!("{:.2} {:.2} {:.2} {:.2} {x:.2} {y:.2} c\n", p[0], p[1], q[0], q[1]));
        }
    }
}

impl DrawingBackend for Pdf<'_> {
    type ErrorType = Infallible;

    fn get_size(&self) -> (u32, u32) {
        self.size
    }

    fn ensure_prepared(&mut self) -> Drawn {
        Ok(())
    }

    fn present(&mut self) -> Drawn {
        Ok(())
    }

    fn draw_pixel(&mut self, (x, y): BackendCoord, color: BackendColor) -> Drawn {
        self.draw_rect((x, y), (x + 1, y + 1), &color, true)
    }

    fn draw_line<S: BackendStyle>(&mut self, from: BackendCoord, to: BackendCoord, style: &S) -> Drawn {
        self.draw_path([from, to], style)
    }

    fn draw_rect<S: BackendStyle>(
        &mut self,
        (left, top): BackendCoord,
        (right, bottom): BackendCoord,
        style: &S,
        fill: bool,
    ) -> Drawn {
        let corners = [(left, top), (right, top), (right, bottom), (left, bottom)];
        if fill {
            return self.fill_polygon(corners, style);
        }
        self.draw_path(corners.into_iter().chain([(left, top)]), style)
    }

    fn draw_path<S: BackendStyle, I: IntoIterator<Item = BackendCoord>>(
        &mut self,
        path: I,
        style: &S,
    ) -> Drawn {
        if style.color().alpha > 0.0 {
            self.paint(style.color());
            self.stroke(style.stroke_width(), path);
        }
        Ok(())
    }

    fn draw_circle<S: BackendStyle>(
        &mut self,
        (x, y): BackendCoord,
        radius: u32,
        style: &S,
        fill: bool,
    ) -> Drawn {
        if style.color().alpha == 0.0 {
            return Ok(());
        }
        self.paint(style.color());
        let (x, y, r) = (f64::from(x), f64::from(y), f64::from(radius));
        let k = KAPPA * r;
        self.put(format_args!("{} w {} {y} m\n", style.stroke_width(), x + r));
        for (dx, dy) in [(0.0, 1.0), (-1.0, 0.0), (0.0, -1.0), (1.0, 0.0)] {
            // From the quarter before, which is turned back by a right angle.
            let (from_x, from_y) = (dy, -dx);
            self.put(format_args!(
                "{:.3} {:.3} {:.3} {:.3} {:.3} {:.3} c\n",
                x + r * from_x + k * dx,
                y + r * from_y + k * dy,
                x + r * dx + k * from_x,
                y + r * dy + k * from_y,
                x + r * dx,
                y + r * dy
            ));
        }
        self.put(format_args!("{}\n", if fill { "f" } else { "s" }));
        Ok(())
    }

    fn fill_polygon<S: BackendStyle, I: IntoIterator<Item = BackendCoord>>(
        &mut self,
        path: I,
        style: &S,
    ) -> Drawn {
        if style.color().alpha > 0.0 {
            self.paint(style.color());
            if self.path(path) {
                self.put(format_args!("f\n"));
            }
        }
        Ok(())
    }

    fn draw_text<S: BackendTextStyle>(&mut self, text: &str, style: &S, (x0, y0): BackendCoord) -> Drawn {
        if style.color().alpha == 0.0 {
            return Ok(());
        }
        self.paint(style.color());
        let em = (style.size() / LINE) as f32;
        let scale = em / self.font.units_per_em().unwrap_or(1.0);
        let letters: Vec<_> = text.chars().map(|c| self.font.glyph_id(c)).collect();
        let wide: f32 = letters.iter().map(|&id| scale * self.font.h_advance_unscaled(id)).sum();
        let mut x = match style.anchor().h_pos {
            HPos::Left => 0.0,
            HPos::Center => -0.5 * wide,
            HPos::Right => -wide,
        };
        let y = match style.anchor().v_pos {
            VPos::Top => 0.76 * em,
            VPos::Center => 0.5 * X_HEIGHT * em,
            VPos::Bottom => -0.5 * X_HEIGHT * em,
        };
        let turn = style.transform();
        let turned = |[x, y]: [f32; 2]| match turn {
            FontTransform::None => [x, y],
            FontTransform::Rotate90 => [-y, x],
            FontTransform::Rotate180 => [-x, -y],
            FontTransform::Rotate270 => [y, -x],
        };
        for id in letters {
            if let Some(outline) = self.font.outline(id) {
                let to = |p: Point| {
                    let [x, y] = turned([x + scale * p.x, y - scale * p.y]);
                    [x0 as f32 + x, y0 as f32 + y]
                };
                self.letter(&outline.curves, to);
            }
            x += scale * self.font.h_advance_unscaled(id);
        }
        self.put(format_args!("f\n"));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::io::Read;

    use flate2::read::ZlibDecoder;
    use plotters::prelude::*;

    use super::*;

    #[test]
    fn the_table_names_the_places_of_the_objects_and_the_content_is_what_was_drawn() {
        let font = FontRef::try_from_slice(dejavu::sans::regular()).unwrap();
        let mut pdf = Pdf::new((80, 50), 0.75, font);
        pdf.draw_line((1, 2), (30, 40), &RGBColor(255, 0, 51)).unwrap();
        pdf.draw_circle((20, 20), 10, &BLACK.mix(0.5), true).unwrap();
        pdf.draw_text("l", &("sans-serif", 12).into_text_style(&(80, 50)), (5, 5)).unwrap();
        let bytes = pdf.finish().unwrap();
        let find = |what: &[u8]| bytes.windows(what.len()).position(|w| w == what).unwrap();
        let table = find(b"xref\n");
        let text = String::from_utf8_lossy(&bytes[table..]);
        assert!(text.ends_with(&format!("startxref\n{table}\n%%EOF\n")));
        for (i, line) in text.lines().skip(3).take(4).enumerate() {
            let place: usize = line[..10].parse().unwrap();
            assert!(bytes[place..].starts_with(format!("{} 0 obj", i + 1).as_bytes()), "{line}");
        }
        let (start, end) = (find(b"stream\n") + 7, find(b"\nendstream"));
        let mut content = String::new();
        ZlibDecoder::new(&bytes[start..end]).read_to_string(&mut content).unwrap();
        assert!(content.starts_with("0.75 0 0 -0.75 0 37.5 cm\n"), "{content}");
        assert!(
            content.contains("/O1000 gs 1 0 0.2 RG 1 0 0.2 rg\n1 w 1 j\n1 2 m\n30 40 l\nS\n"),
            "{content}"
        );
        assert!(
            content.contains("/O500 gs")
                && content.contains("30 20 m\n")
                && content.contains("20.000 30.000 c")
        );
        // An l is an upright box, above the baseline.
        let letter = content.rsplit("rg\n").next().unwrap();
        assert_eq!(letter.matches(" l\n").count() + letter.matches(" m\n").count(), 5, "{letter}");
        assert!(String::from_utf8_lossy(&bytes).contains("/MediaBox [0 0 60 37.5]"));
    }
}
