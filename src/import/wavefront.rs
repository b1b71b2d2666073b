//! Checks an OBJ line by line and normalises it for `tobj`.
//!
//! `tobj` knows neither line numbers nor which corner lacks a normal, takes `o` and `g` for the
//! same, and stumbles over comments behind numbers, tabs, vertex colours on some vertices only,
//! polylines and `Kd` with one number. The normalised text has none of this: absolute indices,
//! triangles, one name per part.
//!
//! # References
//! *Advanced Visualizer* manual, appendix B1. Triangulation: \[Meisters75\] (two
//! ears theorem).

use std::{borrow::Cow, collections::HashMap, fmt::Write as _};

use glam::{Vec2, Vec3};
use memchr::{memchr, memchr_iter};

use super::{error::LineError, imported::Part};
use crate::scene::mesh::is_in_range;

/// Corners of a polygon above which it is taken to be convex. Clipping ears takes 10 ms for a comb of 1000
/// corners, 60 ms for one that crosses itself at random, and grows with the square.
const MAX_CONCAVE: usize = 1000;
/// Bend of a polygon's edge below which it counts as straight, in twice the polygon's area: rounding
/// of f32 coordinates bends by some 10⁻⁷.
const FLATNESS: f32 = 1e-6;
/// Vertex colours from here on count as white: half a step of 8 bits is 0.002.
const WHITE: f32 = 0.999;
/// Beginning of the comments in which `ZBrush` writes the colours of its vertices.
const POLYPAINT: &str = "#MRGB";

/// An OBJ, normalised.
#[derive(Debug, Default)]
pub struct NormalizedObj {
    /// Text for `tobj`. Objects are named by index into `parts`; texture
    /// coordinate 1 and normal 1 are zero and stand for absent ones.
    pub text: String,
    /// Objects and groups that triangles belong to.
    pub parts: Vec<Part>,
    /// Material names after `usemtl`, each once, with the number of its first line. The text names them by
    /// index into this list.
    pub materials: Vec<(usize, String)>,
    /// File names after `mtllib`, one line's as a whole, with the line's number.
    pub libraries: Vec<(usize, String)>,
    /// Number of faces of fewer than three corners, which are left out.
    pub n_short: usize,
    /// Keywords of unsupported geometry, each once, with the number of its first line.
    pub unsupported: Vec<(usize, String)>,
    /// Attributes (`texture coordinate`, `normal`) that corners refer to although the file has none,
    /// with the number of the first such line.
    pub absent: Vec<(usize, &'static str)>,
    /// Number of the first line whose vertex is out of range, and the vertex's number in the file.
    pub out_of_range: Option<(usize, usize)>,
    /// Number of the first line that gives a vertex a colour other than white.
    pub colored: Option<usize>,
}

/// Lines of a text, whether they end in LF, in CR LF or in CR alone.
pub(super) fn physical_lines(text: &str) -> impl Iterator<Item = &str> {
    let text = text.trim_start_matches('\u{feff}');
    // Most texts have no CR.
    let has_cr = memchr(b'\r', text.as_bytes()).is_some();
    let mut start = 0;
    let ends = memchr_iter(b'\n', text.as_bytes()).chain(std::iter::once(text.len()));
    let lines = ends.map(move |end| &text[std::mem::replace(&mut start, end + 1)..end]);
    lines.flat_map(move |line| {
        let parts = has_cr.then(|| line.strip_suffix('\r').unwrap_or(line).split('\r'));
        parts.into_iter().flatten().chain((!has_cr).then_some(line))
    })
}

/// Lines of a text, numbered from 1, joined where one ends in `\`, without blank and comment lines.
pub(super) fn logical_lines(text: &str) -> impl Iterator<Item = (usize, Cow<'_, str>)> {
    let mut physical = physical_lines(text).enumerate();
    std::iter::from_fn(move || {
        let (i, first) = physical.next()?;
        let mut line = Cow::Borrowed(first.trim());
        while line.ends_with('\\') {
            let next = physical.next().map_or("", |(_, l)| l.trim());
            let joined = line.to_mut();
            joined.pop();
            joined.push(' ');
            joined.push_str(next);
            if next.is_empty() {
                break;
            }
        }
        Some((i + 1, line))
    })
    .filter(|(_, line)| !line.trim().is_empty() && !line.starts_with('#'))
}

/// The keyword of a line, and the rest of the line without spaces around it.
pub(super) fn split_keyword(line: &str) -> (&str, &str) {
    // Before anything that is not ASCII a space is one byte.
    let end = line.bytes().position(|b| b.is_ascii_whitespace() || !b.is_ascii());
    let (keyword, rest) = match end {
        Some(end) if line.as_bytes()[end].is_ascii() => (&line[..end], &line[end + 1..]),
        Some(_) => line.split_once(char::is_whitespace).unwrap_or((line, "")),
        None => (line, ""),
    };
    (keyword, rest.trim())
}

/// Words between spaces, which in a text of ASCII alone are found byte by byte.
fn words(text: &str) -> impl Iterator<Item = &str> {
    let (plain, other) = match text.is_ascii() {
        true => (Some(text.split_ascii_whitespace()), None),
        false => (None, Some(text.split_whitespace())),
    };
    plain.into_iter().flatten().chain(other.into_iter().flatten())
}

/// Up to `N` numbers, the rest 0, and how many there are; a comment may follow them.
pub(super) fn numbers<const N: usize>(rest: &str) -> Result<([f32; N], usize), String> {
    let mut out = [0.0; N];
    let mut n = 0;
    for word in words(without_comment(rest)) {
        let number = word.parse().map_err(|_| format!("`{word}` is not a number"))?;
        *out.get_mut(n).ok_or_else(|| format!("more than {N} numbers"))? = number;
        n += 1;
    }
    Ok((out, n))
}

fn without_comment(rest: &str) -> &str {
    rest.bytes().position(|b| b == b'#').map_or(rest, |end| &rest[..end])
}

/// A name without the comment behind it, which begins with a blank and `#`; `None` where there is none.
/// It may be part of the name, as in `Material #25`.
pub(super) fn name_before_comment(name: &str) -> Option<&str> {
    let at = name.match_indices('#').map(|(i, _)| i).find(|&i| name[..i].ends_with(char::is_whitespace))?;
    Some(name[..at].trim_end())
}

/// Numbers of positions, texture coordinates and normals.
type Counts = [usize; 3];

/// Result of the first pass over a file.
struct Vertices<'t> {
    positions: Vec<Vec3>,
    counts: Counts,
    /// Lines that are no vertices: number, vertices before the line, text.
    others: Vec<(usize, Counts, Cow<'t, str>)>,
    /// First line, and number of its vertex, that is out of range.
    out_of_range: Option<(usize, usize)>,
    /// Number of the first line with a colour other than white.
    colored: Option<usize>,
}

/// First pass: reads all vertices and appends their normalised lines to `out`.
fn vertices<'t>(text: &'t str, out: &mut String) -> Result<Vertices<'t>, LineError> {
    let mut found = Vertices {
        positions: Vec::new(),
        counts: [0; 3],
        others: Vec::new(),
        out_of_range: None,
        colored: None,
    };
    for (line, content) in logical_lines(text) {
        let (keyword, rest) = split_keyword(&content);
        let fail = |message: String| LineError { line, message: format!("`{keyword}`: {message}") };
        match keyword {
            "v" => {
                let (numbers, n) = numbers::<8>(rest).map_err(fail)?;
                let [x, y, z, w, ..] = numbers;
                let p = Vec3::new(x, y, z);
                // More than four are colours.
                if n > 5 && numbers[3..n].iter().any(|&c| c < WHITE) {
                    found.colored.get_or_insert(line);
                }
                let p = match n {
                    0..=2 => return Err(fail(format!("needs 3 numbers, got {n}"))),
                    4 if w == 0.0 => return Err(fail("the weight (4th number) must not be 0".into())),
                    4 => p / w,
                    _ => p,
                };
                if n == 4 {
                    push(out, format_args!("v {} {} {}\n", p.x, p.y, p.z));
                } else {
                    push_words(out, keyword, rest, 3);
                }
                found.positions.push(p);
                found.counts[0] += 1;
                if !is_in_range(p) {
                    found.out_of_range.get_or_insert((line, found.counts[0]));
                }
            }
            "vt" => {
                let (_, n) = numbers::<3>(rest).map_err(fail)?;
                match n {
                    0 => return Err(fail("needs 1 to 3 numbers, got 0".into())),
                    1 => push_words(out, keyword, &format!("{} 0", without_comment(rest)), 2),
                    _ => push_words(out, keyword, rest, 2),
                }
                found.counts[1] += 1;
            }
            "vn" => {
                let (_, n) = numbers::<3>(rest).map_err(fail)?;
                if n < 3 {
                    return Err(fail(format!("needs 3 numbers, got {n}")));
                }
                push_words(out, keyword, rest, 3);
                found.counts[2] += 1;
            }
            _ => found.others.push((line, found.counts, content)),
        }
    }
    Ok(found)
}

/// Appends a line of the first `n` words of `rest`, which are numbers.
fn push_words(out: &mut String, keyword: &str, rest: &str, n: usize) {
    out.push_str(keyword);
    for word in words(without_comment(rest)).take(n) {
        out.push(' ');
        out.push_str(word);
    }
    out.push('\n');
}

/// Appends to a string, which does not fail.
fn push(out: &mut String, arguments: std::fmt::Arguments<'_>) {
    let _ = out.write_fmt(arguments);
}

/// What the indices of a corner refer to, in messages.
const INDEXED: [&str; 3] = ["vertex", "texture coordinate", "normal"];

/// Most digits of an index that is read in one go.
const MAX_DIGITS: usize = 9;

/// A corner whose indices are plain numbers of what the file has, as nearly all are: as [`corner`] reads it.
fn plain_corner(word: &str, total: &Counts) -> Option<[Option<usize>; 3]> {
    let mut out = [None; 3];
    let mut bytes = word.as_bytes();
    for (i, slot) in out.iter_mut().enumerate() {
        let n = bytes.iter().position(|b| !b.is_ascii_digit()).unwrap_or(bytes.len());
        if n > MAX_DIGITS || n == 0 && i == 0 {
            return None;
        }
        if n > 0 {
            let index = bytes[..n].iter().fold(0, |index, b| 10 * index + usize::from(b - b'0'));
            *slot = Some(index.checked_sub(1).filter(|&k| k < total[i])?);
        }
        match bytes.get(n) {
            None => return Some(out),
            Some(b'/') => bytes = &bytes[n + 1..],
            Some(_) => return None,
        }
    }
    None
}

/// One corner `v/vt/vn` of a face as indices from 0. Texture coordinates and normals of which the file
/// has none count as not given and are passed to `absent`.
fn corner(
    word: &str,
    before: &Counts,
    total: &Counts,
    mut absent: impl FnMut(&'static str),
) -> Result<[Option<usize>; 3], String> {
    let mut out = [None; 3];
    if word.split('/').count() > out.len() {
        return Err(format!("`{word}` has more than 3 indices"));
    }
    if word.starts_with('/') {
        return Err(format!("`{word}` names no vertex"));
    }
    for (i, text) in word.split('/').enumerate() {
        if text.is_empty() {
            continue;
        }
        let index: i64 = text.parse().map_err(|_| format!("`{word}` is not an index"))?;
        if i > 0 && total[i] == 0 {
            absent(INDEXED[i]);
            continue;
        }
        let from_0 = match index {
            0 => return Err(format!("`{word}`: indices begin at 1")),
            1.. => usize::try_from(index - 1).ok(),
            _ => usize::try_from(index.unsigned_abs()).ok().and_then(|back| before[i].checked_sub(back)),
        };
        let from_0 = from_0.filter(|&k| k < total[i]).ok_or_else(|| {
            let known = if index < 0 { before[i] } else { total[i] };
            let so_far = if index < 0 { " so far" } else { "" };
            format!("{} {index} does not exist: the file has {known}{so_far}", INDEXED[i])
        })?;
        out[i] = Some(from_0);
    }
    Ok(out)
}

/// Checks an OBJ and normalises it.
///
/// # Errors
/// When a line cannot be understood; the first such line.
pub fn normalize(text: &str) -> Result<NormalizedObj, LineError> {
    let mut out = NormalizedObj { text: String::with_capacity(text.len()), ..NormalizedObj::default() };
    out.text.push_str("mtllib all\nvt 0 0\nvn 0 0 0\n");
    let Vertices { positions, counts: total, others, out_of_range, colored } = vertices(text, &mut out.text)?;
    out.out_of_range = out_of_range;
    let painted = || physical_lines(text).position(|l| l.starts_with(POLYPAINT)).map(|i| i + 1);
    out.colored = colored.or_else(painted);
    let mut writer = Writer {
        out,
        positions,
        total,
        part: Part::default(),
        ids: HashMap::new(),
        material_ids: HashMap::new(),
        is_new_part: true,
        corners: Vec::new(),
        digits: itoa::Buffer::new(),
    };
    for (line, before, content) in others {
        let (keyword, rest) = split_keyword(&content);
        writer
            .line(line, &before, keyword, rest)
            .map_err(|message| LineError { line, message: format!("`{keyword}`: {message}") })?;
    }
    Ok(writer.out)
}

/// Second pass over a file: writes the lines that are no vertices.
struct Writer {
    out: NormalizedObj,
    positions: Vec<Vec3>,
    total: Counts,
    /// The part that faces belong to now.
    part: Part,
    /// Indices of the parts in `out`.
    ids: HashMap<Part, usize>,
    /// Indices of the materials in `out`.
    material_ids: HashMap<String, usize>,
    /// Whether `part` has changed since the last face.
    is_new_part: bool,
    /// Corners of the face that is read.
    corners: Vec<[Option<usize>; 3]>,
    digits: itoa::Buffer,
}

impl Writer {
    fn line(&mut self, line: usize, before: &Counts, keyword: &str, rest: &str) -> Result<(), String> {
        match keyword {
            "o" => {
                let rest = name_before_comment(rest).unwrap_or(rest);
                let object = (!rest.is_empty()).then(|| rest.to_owned());
                self.part = Part { object, groups: Vec::new() };
                self.is_new_part = true;
            }
            "g" => {
                let rest = name_before_comment(rest).unwrap_or(rest);
                self.part.groups = rest.split_whitespace().map(str::to_owned).collect();
                if self.part.groups.len() > 1 {
                    self.part.groups.push(rest.to_owned());
                }
                self.is_new_part = true;
            }
            "mtllib" => self.out.libraries.push((line, rest.to_owned())),
            "usemtl" => {
                let materials = &mut self.out.materials;
                let id = (!rest.is_empty()).then(|| {
                    *self.material_ids.entry(rest.to_owned()).or_insert_with_key(|name| {
                        materials.push((line, name.clone()));
                        materials.len() - 1
                    })
                });
                // `tobj` takes an unknown name for none.
                let name = id.map_or_else(|| "(none)".to_owned(), |id| id.to_string());
                push(&mut self.out.text, format_args!("usemtl {name}\n"));
            }
            "f" | "fo" => self.face(line, before, rest)?,
            "curv" | "curv2" | "surf" | "call" if !self.out.unsupported.iter().any(|(_, k)| k == keyword) => {
                self.out.unsupported.push((line, keyword.to_owned()));
            }
            _ => {}
        }
        Ok(())
    }

    fn face(&mut self, line: usize, before: &Counts, rest: &str) -> Result<(), String> {
        let absent = &mut self.out.absent;
        let mut note = |what| {
            if !absent.iter().any(|(_, known)| *known == what) {
                absent.push((line, what));
            }
        };
        self.corners.clear();
        for word in words(without_comment(rest)) {
            self.corners.push(match plain_corner(word, &self.total) {
                Some(corner) => corner,
                None => corner(word, before, &self.total, &mut note)?,
            });
        }
        if self.corners.len() < 3 {
            self.out.n_short += 1;
            return Ok(());
        }
        if self.is_new_part {
            let n = self.ids.len();
            let id = *self.ids.entry(self.part.clone()).or_insert(n);
            if id == n {
                self.out.parts.push(self.part.clone());
            }
            push(&mut self.out.text, format_args!("o {id}\n"));
            self.is_new_part = false;
        }
        if let [a, b, c] = self.corners[..] {
            self.triangle([a, b, c]);
            return Ok(());
        }
        let polygon: Vec<Vec3> = self.corners.iter().map(|c| self.positions[c[0].unwrap_or(0)]).collect();
        for t in triangulate(&polygon) {
            self.triangle(t.map(|i| self.corners[i]));
        }
        Ok(())
    }

    /// Writes a triangle.
    fn triangle(&mut self, corners: [[Option<usize>; 3]; 3]) {
        self.out.text.push('f');
        for [v, vt, vn] in corners {
            // Number 1 stands for absent: see `NormalizedObj::text`.
            let n = |i: Option<usize>| i.map_or(1, |i| i + 2);
            for (separator, index) in [(' ', v.unwrap_or(0) + 1), ('/', n(vt)), ('/', n(vn))] {
                self.out.text.push(separator);
                self.out.text.push_str(self.digits.format(index));
            }
        }
        self.out.text.push('\n');
    }
}

/// Triangulates a polygon, given by its corners in order: a fan when it is convex, otherwise ears are
/// clipped. Returns indices of corners.
fn triangulate(p: &[Vec3]) -> Vec<[usize; 3]> {
    let n = p.len();
    let fan = || (2..n).map(|i| [0, i - 1, i]).collect();
    if n == 3 {
        return fan();
    }
    // Newell's method: the normal of the least-squares plane.
    let normal: Vec3 = (0..n).map(|i| p[i].cross(p[(i + 1) % n])).sum();
    let Some(axis) = normal.try_normalize() else { return fan() };
    let (s, t) = axis.any_orthonormal_pair();
    let flat: Vec<Vec2> = p.iter().map(|&q| Vec2::new((q - p[0]).dot(s), (q - p[0]).dot(t))).collect();
    let turn = |a: usize, b: usize, c: usize| (flat[b] - flat[a]).perp_dot(flat[c] - flat[b]);
    let flatness = -FLATNESS * normal.length();
    if n > MAX_CONCAVE || (0..n).all(|i| turn((i + n - 1) % n, i, (i + 1) % n) >= flatness) {
        return fan();
    }
    let mut left: Vec<usize> = (0..n).collect();
    // Of a corner that is no ear, one that lies in its triangle, or `n` where it bends inward: it stays none
    // as long as that one and its neighbours are left.
    let mut reason: Vec<Option<usize>> = vec![None; n];
    let mut is_left = vec![true; n];
    let mut out = Vec::with_capacity(n - 2);
    while left.len() > 3 {
        let m = left.len();
        let around = |i: usize| [left[(i + m - 1) % m], left[i], left[(i + 1) % m]];
        let lies_in = |[a, b, c]: [usize; 3], q: usize| {
            ![a, b, c].contains(&q)
                && [flat[a], flat[b], flat[c]].iter().all(|&corner| corner != flat[q])
                && turn(a, b, q) >= 0.0
                && turn(b, c, q) >= 0.0
                && turn(c, a, q) >= 0.0
        };
        let is_ear = |&i: &usize| {
            let [a, b, c] = around(i);
            if reason[b].is_some_and(|q| q == n || is_left[q]) {
                return false;
            }
            let is_convex = turn(a, b, c) > 0.0;
            let within = || left.iter().copied().find(|&q| lies_in([a, b, c], q));
            reason[b] = if is_convex { within() } else { Some(n) };
            reason[b].is_none()
        };
        // A polygon that crosses itself may have no ear.
        let ear = (0..m).find(is_ear).unwrap_or(0);
        let [a, b, c] = around(ear);
        out.push([a, b, c]);
        (reason[a], reason[c], is_left[b]) = (None, None, false);
        left.remove(ear);
    }
    out.push([left[0], left[1], left[2]]);
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(p: &[Vec3], triangles: &[[usize; 3]]) -> f32 {
        triangles.iter().map(|t| 0.5 * (p[t[1]] - p[t[0]]).cross(p[t[2]] - p[t[0]]).length()).sum()
    }

    #[test]
    fn concave_polygons_are_covered_once() {
        let l = [(0., 0.), (4., 0.), (4., 1.), (1., 1.), (1., 3.), (0., 3.)];
        for first in 0..l.len() {
            let p: Vec<Vec3> =
                (0..l.len()).map(|i| l[(i + first) % l.len()]).map(|(x, y)| Vec3::new(x, 5.0, y)).collect();
            for p in [p.clone(), p.into_iter().rev().collect()] {
                let t = triangulate(&p);
                assert_eq!(t.len(), 4);
                assert!((area(&p, &t) - 6.0).abs() < 1e-5, "{first}: {t:?}");
            }
        }
    }

    #[test]
    fn combs_are_covered_and_whatever_crosses_itself_ends() {
        let n = 300;
        let tooth = |i: usize| Vec3::new(i as f32, if i.is_multiple_of(2) { 0.0 } else { 9.0 }, 0.0);
        let comb: Vec<Vec3> = (0..n).map(tooth).chain((0..n).rev().map(|i| tooth(i) - Vec3::Y)).collect();
        let t = triangulate(&comb);
        assert_eq!(t.len(), 2 * n - 2);
        assert!((area(&comb, &t) - (n - 1) as f32).abs() < 1e-2, "{}", area(&comb, &t));
        let crossed: Vec<Vec3> = (0..2 * n).map(|i| comb[i * 7 % (2 * n)]).collect();
        assert_eq!(triangulate(&crossed).len(), 2 * n - 2);
    }

    #[test]
    fn lines_are_joined_numbered_and_cleaned() {
        let lines: Vec<_> = logical_lines("\u{feff}# c\r\n\tv 1 \\\r\n 2 3\r\n\r\nf 1\\").collect();
        let lines: Vec<_> =
            lines.iter().map(|(n, l)| (*n, l.split_whitespace().collect::<Vec<_>>())).collect();
        assert_eq!(lines, [(2, vec!["v", "1", "2", "3"]), (5, vec!["f", "1"])]);
        let of = |text: &'static str| logical_lines(text).collect::<Vec<_>>();
        let unix = of("# c\nv 1\n\nf 1\n");
        assert_eq!(of("# c\rv 1\r\rf 1\r"), unix);
        assert_eq!(of("# c\r\nv 1\r\n\r\nf 1\r\n"), unix);
        assert_eq!(unix, [(2, "v 1".into()), (4, "f 1".into())]);
    }

    #[test]
    fn a_corner_is_read_alike_in_one_go_and_by_parts() {
        let total = [120, 7, 0];
        let slow = |word| corner(word, &[60, 7, 0], &total, |_| {});
        for word in [
            "1",
            "120",
            "12/7",
            "3//",
            "3/",
            "5/1/",
            "0",
            "121",
            "1/8",
            "1//1",
            "-1",
            "+1",
            "1/2/3/4",
            "/1",
            "",
            "1 ",
            "x",
            "0000000003",
            "99999999999",
        ] {
            match plain_corner(word, &total) {
                Some(fast) => assert_eq!(Ok(fast), slow(word), "{word}"),
                None => assert!(!matches!(word, "1" | "120" | "12/7" | "3//" | "3/" | "5/1/"), "{word}"),
            }
        }
    }

    #[test]
    fn words_are_those_between_spaces_of_every_kind() {
        for text in ["", " ", "a", " 1.5\t-2  3 ", "a\u{a0}b c", "\u{e4} b\u{2003}c"] {
            let wanted: Vec<&str> = text.split_whitespace().collect();
            assert_eq!(words(text).collect::<Vec<_>>(), wanted, "{text:?}");
            let (keyword, rest) = text.split_once(char::is_whitespace).unwrap_or((text, ""));
            assert_eq!(split_keyword(text), (keyword, rest.trim()), "{text:?}");
        }
    }

    #[test]
    fn a_comment_behind_a_name_begins_with_a_blank() {
        assert_eq!(name_before_comment("red # the warm one"), Some("red"));
        assert_eq!(name_before_comment("red\t#warm"), Some("red"));
        assert_eq!(name_before_comment("red#1"), None);
        assert_eq!(name_before_comment("# nothing"), None);
    }
}
