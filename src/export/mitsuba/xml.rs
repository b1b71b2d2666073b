//! Elements of Mitsuba's scene description. Every function returns whole lines.

use std::fmt::Display;

use glam::{Affine2, Vec2, Vec3};

use crate::{
    math::Frame,
    scene::texture::{Texture, Wrap},
};

/// The text with each line moved in by a level of four blanks.
pub(super) fn indented(text: &str) -> String {
    text.lines().map(|l| format!("    {l}\n")).collect()
}

/// An element with a type, and its body on lines of their own.
pub(super) fn element(tag: &str, kind: &str, body: &str) -> String {
    format!("<{tag} type=\"{kind}\">\n{}</{tag}>\n", indented(body))
}

/// An element with a type and its body on one line.
pub(super) fn inline(tag: &str, kind: &str, body: &str) -> String {
    format!("<{tag} type=\"{kind}\">{}</{tag}>\n", body.replace('\n', ""))
}

/// An element with a type and nothing else.
pub(super) fn empty(tag: &str, kind: &str) -> String {
    format!("<{tag} type=\"{kind}\"/>\n")
}

/// A named value.
pub(super) fn property(tag: &str, name: &str, value: impl Display) -> String {
    format!("<{tag} name=\"{name}\" value=\"{value}\"/>\n")
}

pub(super) fn string(name: &str, value: &str) -> String {
    property("string", name, value)
}

pub(super) fn boolean(name: &str, value: bool) -> String {
    property("boolean", name, value)
}

pub(super) fn integer(name: &str, value: impl Display) -> String {
    property("integer", name, value)
}

pub(super) fn float(name: &str, value: f32) -> String {
    property("float", name, value)
}

pub(super) fn rgb(name: &str, value: Vec3) -> String {
    property("rgb", name, list(value))
}

/// Three numbers as an attribute's value.
pub(super) fn list(v: Vec3) -> String {
    format!("{}, {}, {}", v.x, v.y, v.z)
}

/// A BSDF that lets all light pass.
pub(super) fn null() -> String {
    empty("bsdf", "null")
}

/// The transform from the axes of `frame` at `p` to the world.
pub(super) fn place(frame: Frame, p: Vec3) -> String {
    let rows: Vec<String> =
        (0..3).map(|i| format!("{} {} {} {}", frame.s[i], frame.t[i], frame.n[i], p[i])).collect();
    matrix("to_world", &format!("{} 0 0 0 1", rows.join(" ")))
}

/// A transform given by one other than a matrix.
pub(super) fn to_world(transform: &str) -> String {
    format!("<transform name=\"to_world\">\n    {transform}\n</transform>\n")
}

fn matrix(name: &str, rows: &str) -> String {
    format!("<transform name=\"{name}\"><matrix value=\"{rows}\"/></transform>\n")
}

/// A picture file as a texture. `label` is its `name="…"` as a parameter or its `id="…"`
/// for references, `options` further parameters.
pub(super) fn bitmap(label: &str, file: &str, options: &str) -> String {
    let body = [&string("filename", file), &boolean("raw", true), &string("format", "variant"), options];
    format!("<texture type=\"bitmap\" {label}>\n{}</texture>\n", indented(&body.concat()))
}

/// A picture file as the texture of the parameter `name`. `transform` maps the
/// surface's texture coordinates to the image's, v up.
///
/// Mitsuba has one word for both axes of an image: that of the axis across.
pub(super) fn texture(name: &str, file: &str, image: &Texture) -> String {
    let transform = image.transform();
    let placed = if transform == Affine2::IDENTITY { String::new() } else { to_uv(transform) };
    let wrapped = match image.wrap()[0] {
        Wrap::Repeat => String::new(),
        Wrap::Clamp => string("wrap_mode", "clamp"),
        Wrap::Mirror => string("wrap_mode", "mirror"),
    };
    bitmap(&format!("name=\"{name}\""), file, &(placed + &wrapped))
}

fn to_uv(transform: Affine2) -> String {
    // v runs down in the exported mesh and in Mitsuba's images.
    let flip = Affine2::from_cols(Vec2::X, Vec2::NEG_Y, Vec2::Y);
    let t = flip * transform * flip;
    let [x, y, offset] = [t.matrix2.x_axis, t.matrix2.y_axis, t.translation];
    let rows = format!("{} {} 0 {} {} {} 0 {} 0 0 1 0 0 0 0 1", x.x, y.x, offset.x, x.y, y.y, offset.y);
    matrix("to_uv", &rows)
}

/// A name with everything replaced that is not safe in a file name and in XML.
pub(super) fn plain(name: &str) -> String {
    name.chars().map(|c| if c.is_ascii_alphanumeric() || c == '_' || c == '-' { c } else { '_' }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_become_safe() {
        assert_eq!(plain("a/b <c>&\u{e9}"), "a_b__c___");
    }

    #[test]
    fn a_body_stands_one_level_deeper_than_its_element() {
        let inner = element("sampler", "multijitter", &integer("sample_count", "$spp"));
        let text = element("sensor", "thinlens", &(float("fov", 0.5) + &inner));
        let want = "<sensor type=\"thinlens\">\n    <float name=\"fov\" value=\"0.5\"/>\n    \
                    <sampler type=\"multijitter\">\n        \
                    <integer name=\"sample_count\" value=\"$spp\"/>\n    </sampler>\n</sensor>\n";
        assert_eq!(text, want);
    }
}
