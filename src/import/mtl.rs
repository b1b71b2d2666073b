//! Parses a Wavefront MTL, checked line by line; [`super::mtl_params`] interprets it.
//!
//! # References
//! Alias *MTL Material Format*; its extension for physically based materials
//! (`Pr`, `Pm`, `map_Pr`, `map_Pm`, `norm`) as exporters write it.

use std::{
    collections::{BTreeMap, HashSet},
    ops::RangeInclusive,
    path::{Path, PathBuf},
};

use glam::{Affine2, DVec3, Vec2};

use super::{
    error::LineError,
    warnings::Warnings,
    wavefront::{logical_lines, numbers, physical_lines, split_keyword},
};
use crate::{
    files::number::Number,
    math::primaries,
    scene::texture::{Channel, Wrap},
};

/// Program that wrote a file, which decides what its numbers mean.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Origin {
    /// Any program but Blender.
    #[default]
    Other,
    /// Blender up to 3.0, whose header names no version: `Ns` = 900·(1 − roughness)².
    OldBlender,
    /// Blender whose header names its version: `Ns` = 1000·(1 − roughness)².
    Blender,
}

/// Parameter that an image varies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum MapKind {
    /// Diffuse or base colour, `map_Kd`.
    Kd,
    /// Specular colour or strength, `map_Ks`.
    Ks,
    /// Emission, `map_Ke`.
    Ke,
    /// Specular exponent, `map_Ns`.
    Ns,
    /// Roughness, `map_Pr`.
    Pr,
    /// Share of metal, `map_Pm`.
    Pm,
    /// Reflection, `map_refl`; in Blender's files also `refl`, the share of metal.
    Refl,
    /// Opacity, `map_d`.
    D,
    /// Heights, or normals in disguise, `map_Bump` or `bump`.
    Bump,
    /// Tangent-space normals, `norm`.
    Norm,
}

/// An image and its options.
#[derive(Clone, Debug, PartialEq)]
pub struct MapSpec {
    /// Keyword as written, for messages.
    pub keyword: String,
    /// File name as written.
    pub file: String,
    /// Transformation from the surface's texture coordinates to the image's (`-s`, `-o`).
    pub transform: Affine2,
    /// What lies beyond the edges of the image (`-clamp`).
    pub wrap: Wrap,
    /// Factor on the slopes of a relief (`-bm`).
    pub multiplier: Option<f32>,
    /// Channel that a scalar is read from (`-imfchan`).
    pub channel: Option<Channel>,
}

/// A material as written; a statement that is absent is `None`. Numbers are finite, not clamped.
#[derive(Clone, Debug, Default)]
pub struct MtlMaterial {
    /// Name after `newmtl`.
    pub name: String,
    /// Program that wrote the file.
    pub origin: Origin,
    /// Directory of the file, relative to which images are sought.
    pub directory: PathBuf,
    /// Ambient colour, `Ka`; in Blender's files the share of metal.
    pub ka: Option<[f32; 3]>,
    /// Diffuse or base colour, `Kd`, linear Rec.709.
    pub kd: Option<[f32; 3]>,
    /// Specular colour, `Ks`; in Blender's files the specular level.
    pub ks: Option<[f32; 3]>,
    /// Emitted radiance, `Ke`, W·m⁻²·sr⁻¹.
    pub ke: Option<[f32; 3]>,
    /// Transmission filter, `Tf`.
    pub tf: Option<[f32; 3]>,
    /// Specular (Blinn-Phong) exponent, `Ns`.
    pub ns: Option<f32>,
    /// Index of refraction, `Ni`.
    pub ni: Option<f32>,
    /// Opacity ("dissolve"), `d`.
    pub d: Option<f32>,
    /// Transparency, `Tr`: 1 − opacity.
    pub tr: Option<f32>,
    /// Perceptual roughness, `Pr`.
    pub pr: Option<f32>,
    /// Share of metal, `Pm`.
    pub pm: Option<f32>,
    /// Illumination model, `illum`, 0 to 10.
    pub illum: Option<u8>,
    /// Images by the parameter that they vary.
    pub maps: BTreeMap<MapKind, MapSpec>,
}

/// Illumination models.
const ILLUM: RangeInclusive<u8> = 0..=10;

/// Keywords with numbers, in lower case.
const NUMERIC: [&str; 11] = ["kd", "ks", "ke", "ka", "tf", "ns", "ni", "d", "tr", "pr", "pm"];

/// Parses the text of an MTL in `directory`. Returns the materials in their order, and warnings of
/// statements that are ignored.
///
/// # Errors
/// When a line cannot be understood; the first such line. Since an OBJ may name any file as its MTL, the
/// error shows nothing of it but keywords that an MTL has.
pub fn parse(text: &str, directory: &Path) -> Result<(Vec<MtlMaterial>, Vec<String>), LineError> {
    let origin = origin(text);
    let mut out: Vec<MtlMaterial> = Vec::new();
    let mut warnings = Warnings::default();
    let mut empty = Empty::default();
    let mut names = HashSet::new();
    for (line, content) in logical_lines(text) {
        let (keyword, rest) = split_keyword(&content);
        let fail = |message: String| LineError { line, message: format!("`{keyword}`: {message}") };
        let key = keyword.to_lowercase();
        if key == "newmtl" {
            if rest.is_empty() {
                return Err(fail("needs a name".into()));
            }
            if !names.insert(rest.to_owned()) {
                warnings.about("material", rest, "is there more than once: the last counts".into());
            }
            let (name, directory) = (rest.to_owned(), directory.to_path_buf());
            out.push(MtlMaterial { name, origin, directory, ..MtlMaterial::default() });
            continue;
        }
        let Some(m) = out.last_mut() else {
            let is_known = NUMERIC.contains(&key.as_str()) || map_kind(&key, origin).is_some();
            let statement = if is_known { format!("`{keyword}`") } else { "a statement".into() };
            return Err(LineError { line, message: format!("{statement}: stands before any `newmtl`") });
        };
        if rest.is_empty() || rest.starts_with('#') {
            empty.count(line);
            continue;
        }
        let mut warn = |message: String| warnings.about("material", &m.name, message);
        match key.as_str() {
            "kd" | "ks" | "ke" if rest.split_whitespace().next() == Some("spectral") => {
                warn(format!("`{keyword} spectral` is ignored: spectra are not read"));
            }
            "kd" => m.kd = Some(color(rest).map_err(fail)?),
            "ks" => m.ks = Some(color(rest).map_err(fail)?),
            "ke" => m.ke = Some(color(rest).map_err(fail)?),
            // May also be a spectrum, and rarely matters.
            "ka" => m.ka = color(rest).ok(),
            "tf" => match color(rest) {
                Ok(filter) => m.tf = Some(filter),
                Err(_) => warn(format!("`{keyword}` is ignored: it must be 1 or 3 numbers")),
            },
            "ns" => m.ns = Some(number(rest).map_err(fail)?),
            "ni" => m.ni = Some(number(rest).map_err(fail)?),
            "d" => {
                let halo = rest.strip_prefix("-halo");
                if halo.is_some() {
                    warn("`d -halo` is taken as `d`: as opaque at the rim as in the middle".into());
                }
                m.d = Some(number(halo.unwrap_or(rest)).map_err(fail)?);
            }
            "tr" => m.tr = Some(number(rest).map_err(fail)?),
            "pr" => m.pr = Some(number(rest).map_err(fail)?),
            "pm" => m.pm = Some(number(rest).map_err(fail)?),
            "illum" => {
                let v = number(rest).map_err(fail)?;
                if v > f32::from(*ILLUM.end()) {
                    return Err(fail(format!("must be 0 to {}", ILLUM.end())));
                }
                m.illum = ILLUM.into_iter().find(|&model| f32::from(model) == v);
                // Blender writes -1 for what it does not know.
                if m.illum.is_none() && !(origin != Origin::Other && v == -1.0) {
                    let (v, last) = (Number(v), ILLUM.end());
                    warn(format!("`{keyword}` {v} is not a whole number from 0 to {last}: 2 is taken"));
                }
            }
            "ps" | "pc" | "aniso" => {
                if number(rest).is_ok_and(|v| v > 0.0) {
                    warn(format!("`{keyword}` is ignored"));
                }
            }
            _ => match map_kind(&key, origin) {
                Some(kind) => {
                    let map = map(keyword, rest, &mut warn);
                    if map.file.is_empty() || map.file.starts_with('#') {
                        empty.count(line);
                    } else {
                        m.maps.insert(kind, map);
                    }
                }
                None if is_ignored_map(&key) => warn(format!("`{keyword}` is ignored")),
                None => {}
            },
        }
    }
    empty.report(&mut warnings);
    Ok((out, warnings.into_lines()))
}

/// Entries without a value, as some exporters write for every parameter that a material does not have.
#[derive(Default)]
struct Empty {
    /// Line of the first.
    first: Option<usize>,
    n: usize,
}

impl Empty {
    fn count(&mut self, line: usize) {
        self.first.get_or_insert(line);
        self.n += 1;
    }

    fn report(self, warnings: &mut Warnings) {
        match self {
            Self { first: None, .. } => {}
            Self { first: Some(line), n: 1 } => {
                warnings.add(format!("line {line} has no value and is passed over"));
            }
            Self { first: Some(line), n } => {
                let message = format!("line {line} and {} more have no value and are passed over", n - 1);
                warnings.add(message);
            }
        }
    }
}

/// The program that wrote the file, by its first line; that of an OBJ, too.
pub fn origin(text: &str) -> Origin {
    let first = physical_lines(text).next().unwrap_or_default();
    match first.trim().strip_prefix("# Blender ") {
        None => Origin::Other,
        Some(rest) if rest.starts_with("MTL File") => Origin::OldBlender,
        Some(_) => Origin::Blender,
    }
}

fn number(rest: &str) -> Result<f32, String> {
    match numbers::<1>(rest).map_err(|_| "needs a number")? {
        (_, 0) => Err("needs a number".into()),
        ([v], _) => finite(&[v]).map(|()| v),
    }
}

/// A colour in linear Rec.709, of one or three numbers, or of CIE XYZ after the word `xyz`.
fn color(rest: &str) -> Result<[f32; 3], String> {
    if let Some(xyz) = rest.strip_prefix("xyz") {
        let (c, n) = numbers::<3>(xyz).map_err(|_| "needs 3 numbers after `xyz`")?;
        finite(&c)?;
        // Two of them may be left out.
        let c = if n == 1 { [c[0]; 3] } else { c };
        let matrix = primaries::xyz_to_rec709().ok_or("needs 3 numbers")?;
        return Ok((matrix * DVec3::from_array(c.map(f64::from))).to_array().map(|v| v.max(0.0) as f32));
    }
    let (c, n) = numbers::<3>(rest).map_err(|_| "needs 3 numbers")?;
    finite(&c)?;
    match n {
        1 => Ok([c[0]; 3]),
        3 => Ok(c),
        _ => Err(format!("needs 3 numbers, got {n}")),
    }
}

fn finite(values: &[f32]) -> Result<(), String> {
    if values.iter().all(|v| v.is_finite()) {
        return Ok(());
    }
    Err(format!("must be finite, at most {:e} in magnitude", f32::MAX))
}

/// The parameter that a keyword, in lower case, gives an image to.
fn map_kind(key: &str, origin: Origin) -> Option<MapKind> {
    Some(match key {
        "map_kd" => MapKind::Kd,
        "map_ks" => MapKind::Ks,
        "map_ke" => MapKind::Ke,
        "map_ns" => MapKind::Ns,
        "map_pr" => MapKind::Pr,
        "map_pm" => MapKind::Pm,
        "map_refl" => MapKind::Refl,
        // Elsewhere it is a picture of what is reflected.
        "refl" if origin != Origin::Other => MapKind::Refl,
        "map_d" => MapKind::D,
        "map_bump" | "bump" => MapKind::Bump,
        "norm" | "map_norm" | "map_kn" => MapKind::Norm,
        _ => return None,
    })
}

/// Whether a keyword, in lower case, names a map that is not supported. `map_Ka` is left out without
/// a warning: there is no ambient light.
fn is_ignored_map(key: &str) -> bool {
    (key.starts_with("map_") && key != "map_ka") || ["disp", "decal", "refl"].contains(&key)
}

/// Parses options and file of a map; `warn` is told of ignored options.
fn map(keyword: &str, rest: &str, warn: &mut impl FnMut(String)) -> MapSpec {
    let (mut scale, mut offset) = (Vec2::ONE, Vec2::ZERO);
    let (mut multiplier, mut channel, mut wrap) = (None, None, Wrap::Repeat);
    let mut file = rest;
    while let Some(option) = file.split_whitespace().next().filter(|w| w.starts_with('-')) {
        let (least, most) = match option {
            "-s" | "-o" | "-t" => (1, 3),
            "-mm" => (2, 2),
            "-blendu" | "-blendv" | "-cc" | "-clamp" | "-texres" | "-bm" | "-boost" | "-imfchan"
            | "-type" | "-colorspace" => (1, 1),
            _ => break,
        };
        file = file[option.len()..].trim_start();
        let mut words: Vec<&str> = Vec::new();
        while words.len() < most
            && let Some(word) = file.split_whitespace().next()
            && (words.len() < least || word.parse::<f32>().is_ok())
        {
            words.push(word);
            file = file[word.len()..].trim_start();
        }
        let given: Vec<f32> =
            words.iter().filter_map(|w| w.parse().ok()).filter(|v: &f32| v.is_finite()).collect();
        let pair = |default: f32| Vec2::new(given[0], given.get(1).copied().unwrap_or(default));
        match (option, given.first(), words.first().copied()) {
            ("-s", Some(_), _) => scale = pair(1.0),
            ("-o", Some(_), _) => offset = pair(0.0),
            ("-bm", Some(&v), _) => multiplier = Some(v),
            ("-imfchan", _, Some("r")) => channel = Some(Channel::R),
            ("-imfchan", _, Some("g" | "l")) => channel = Some(Channel::G),
            ("-imfchan", _, Some("b")) => channel = Some(Channel::B),
            ("-imfchan", _, Some("m")) => channel = Some(Channel::A),
            ("-clamp", _, Some("on")) => wrap = Wrap::Clamp,
            ("-clamp", _, Some("off")) => wrap = Wrap::Repeat,
            ("-cc", _, Some("off")) | ("-blendu" | "-blendv", _, _) => {}
            _ => warn(format!("option `{option} {}` of `{keyword}` is ignored", words.join(" "))),
        }
    }
    let transform = Affine2::from_scale_angle_translation(scale, 0.0, offset);
    MapSpec { keyword: keyword.into(), file: file.into(), transform, wrap, multiplier, channel }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_of_a_map_are_told_from_its_file() {
        let parse = |rest: &str| {
            let mut n_warnings = 0;
            let m = map("map_Kd", rest, &mut |_| n_warnings += 1);
            let s = m.transform;
            (m.file, s.transform_vector2(Vec2::ONE), s.translation, m.multiplier, m.channel, n_warnings)
        };
        let plain = |file: &str| (file.to_owned(), Vec2::ONE, Vec2::ZERO, None, None, 0);
        assert_eq!(parse("a b.png"), plain("a b.png"));
        assert_eq!(parse("-odd.png"), plain("-odd.png"));
        assert_eq!(parse("-clamp off -s 1 1 1 a.png"), plain("a.png"));
        assert_eq!(parse("-s 2 3 -clamp on a.png").1, Vec2::new(2.0, 3.0));
        assert_eq!(parse("-s 2 3 -clamp on a.png").5, 0);
        assert_eq!(parse("-s 2 3 -clamp maybe a.png").5, 1);
        let wrap = |rest: &str| map("map_Kd", rest, &mut |_| {}).wrap;
        assert_eq!((wrap("-clamp on a.png"), wrap("-clamp off a.png")), (Wrap::Clamp, Wrap::Repeat));
        let m = parse("-o 0.5 1 1 -bm 2 -imfchan m 7 of 9.png");
        assert_eq!(m, ("7 of 9.png".into(), Vec2::ONE, Vec2::new(0.5, 1.0), Some(2.0), Some(Channel::A), 0));
    }

    #[test]
    fn colours_in_other_spaces_are_converted_or_said_to_be_ignored() {
        let parsed = |text: &str| parse(text, Path::new("")).unwrap();
        // The white of Rec.709 is D65: x .3127, y .3290 at Y = 1.
        let (materials, warnings) =
            parsed("newmtl a\nKd xyz 0.9505 1.0 1.0891\nKs xyz 0.4124 0.2126 0.0193\n");
        let near = |a: [f32; 3], b: [f32; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-3);
        assert!(near(materials[0].kd.unwrap(), [1.0; 3]), "{:?}", materials[0].kd);
        assert!(near(materials[0].ks.unwrap(), [1.0, 0.0, 0.0]), "{:?}", materials[0].ks);
        assert!(warnings.is_empty(), "{warnings:?}");
        let (materials, warnings) = parsed("newmtl a\nKd spectral file.rfl 1\nd -halo 0.3\nnewmtl a\n");
        assert_eq!((materials[0].kd, materials[0].d), (None, Some(0.3)));
        let said = warnings.join("; ");
        assert!(
            ["spectra are not read", "-halo", "more than once"].iter().all(|word| said.contains(word)),
            "{said}"
        );
    }

    #[test]
    fn blender_is_known_by_its_first_line() {
        assert_eq!(origin("# Blender 4.2.0 MTL File: 'a.blend'\n"), Origin::Blender);
        assert_eq!(origin("# Blender v2.80 (sub 75) OBJ File\n"), Origin::Blender);
        assert_eq!(origin("# Blender MTL File: 'None'\r\n# Material Count: 1\n"), Origin::OldBlender);
        assert_eq!(origin("newmtl a\n# Blender 4.2.0\n"), Origin::Other);
    }
}
