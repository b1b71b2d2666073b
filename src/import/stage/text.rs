//! The sidecar of a staged scene as text, for users to edit.

use std::fmt::Write as _;

use glam::{DVec3, Vec3};

use super::{
    plan::{MainObject, Plan},
    rig::{LightForm, radius},
};
use crate::import::{
    axes::UpAxis,
    backdrop::{self, Sweep},
    sidecar::SCHEMA,
};

/// Names of the main object on one line, at most: four of some 20 letters fill 100 columns.
const MAX_ON_A_LINE: usize = 4;
/// Bounds of the background's value: they take the albedo of [`backdrop::BASE_COLOR`] to 0.006, black
/// velvet, and to 0.95, white paper; above 1/0.6 it would exceed 1.
const VALUE_RANGE: [f32; 2] = [0.01, 1.58];
/// Margin of the main object's box, in radii of the box. [`Decimals`] rounds its corners by at most
/// 5·10⁻⁴ of the subject's radius; four times as much keeps its own triangles inside.
const BOX_MARGIN: f32 = 2e-3;

/// A number to three significant digits, for messages.
pub fn three_digits(v: f32) -> String {
    if v != 0.0 && (v.abs() < 0.01 || v.abs() >= 1e6) {
        return format!("{v:.2e}");
    }
    let decimals = (2.0 - v.abs().max(1e-30).log10().floor()).clamp(0.0, 4.0) as usize;
    format!("{v:.decimals$}")
}

/// The main object in words.
pub fn main_object_words(main_object: &MainObject) -> String {
    match main_object {
        MainObject::Named(names) if names.iter().any(|n| n == "*") => "everything".to_owned(),
        MainObject::Named(names) if names.len() > MAX_ON_A_LINE => {
            format!("{} and {} more", names[..MAX_ON_A_LINE - 1].join(", "), names.len() + 1 - MAX_ON_A_LINE)
        }
        MainObject::Named(names) => names.join(", "),
        MainObject::Inside(_) => "what stands on the floor".to_owned(),
    }
}

/// Which object was taken for the main one, and what was added, in words.
pub fn summary(plan: &Plan) -> String {
    let main = main_object_words(&plan.main_object);
    let staged = [
        (plan.camera.is_some(), "a camera"),
        (plan.backdrop.is_some(), "a backdrop"),
        (!plan.lights.is_empty(), "three lights"),
    ];
    let staged: Vec<&str> =
        staged.iter().filter(|(is_staged, _)| *is_staged).map(|(_, what)| *what).collect();
    if staged.is_empty() {
        return format!("main object: {main}; camera and lights are the file's own");
    }
    format!("main object: {main}; staged with {}", staged.join(", "))
}

/// Writes lengths with as many decimals as resolve a thousandth of the subject's radius.
#[derive(Clone, Copy)]
struct Decimals(usize);

impl Decimals {
    fn for_size(size: f32) -> Self {
        Self((3.0 - size.max(1e-30).log10().floor()).clamp(1.0, 30.0) as usize)
    }

    fn one(self, v: f32) -> String {
        self.exact(f64::from(v))
    }

    fn exact(self, v: f64) -> String {
        let text = format!("{v:.*}", self.0);
        // Not -0.000.
        if text.chars().any(|c| c.is_ascii_digit() && c != '0') { text } else { "0.0".into() }
    }

    /// The point `p` of the plan in the file's coordinates.
    fn point(self, plan: &Plan, p: Vec3) -> String {
        let DVec3 { x, y, z } = p.as_dvec3() + plan.origin;
        format!("[{}, {}, {}]", self.exact(x), self.exact(y), self.exact(z))
    }
}

/// The text of the sidecar.
pub fn sidecar(plan: &Plan) -> String {
    let n = Decimals::for_size(radius(&plan.subject));
    let mut out = format!(
        "# Staging of {}: camera and lights found from its geometry. Edit what you like;\n\
         # lengths are metres, angles degrees.\nschema = {SCHEMA}\n",
        plan.file.replace(char::is_control, " ")
    );
    if let Some(scale) = plan.scale {
        push(&mut out, format_args!("scale = {scale:?}   # metres per unit of the file\n"));
    }
    if plan.up_axis == UpAxis::Z {
        out.push_str("up_axis = \"z\"\n");
    }
    if let Some(view) = &plan.camera {
        let [width, height] = view.size;
        push(
            &mut out,
            format_args!(
                "\n[camera]\nposition = {}\nlook_at = {}\nvfov = {:.2}\nsize = [{width}, {height}]\n",
                n.point(plan, view.eye),
                n.point(plan, view.look_at),
                view.vfov
            ),
        );
    }
    main_object(&mut out, plan, n);
    if let Some(sweep) = &plan.backdrop {
        backdrop(&mut out, plan, sweep, n);
    }
    lights(&mut out, plan, n);
    out
}

fn push(out: &mut String, arguments: std::fmt::Arguments<'_>) {
    let _ = out.write_fmt(arguments);
}

fn main_object(out: &mut String, plan: &Plan, n: Decimals) {
    match &plan.main_object {
        MainObject::Named(names) => {
            let quoted = names.iter().map(|name| toml::Value::from(name.as_str()).to_string());
            let quoted: Vec<String> = quoted.collect();
            let list = match names.len() {
                0..=MAX_ON_A_LINE => format!("[{}]", quoted.join(", ")),
                _ => format!("[\n  {},\n]", quoted.join(",\n  ")),
            };
            push(out, format_args!("\n[main_object]\nobjects = {list}\n"));
        }
        MainObject::Inside(bounds) => {
            let margin = BOX_MARGIN * radius(bounds);
            let (lo, hi) = (n.point(plan, bounds.lo - margin), n.point(plan, bounds.hi + margin));
            push(out, format_args!("\n[main_object]\ninside = [{lo}, {hi}]\n"));
        }
    }
}

fn backdrop(out: &mut String, plan: &Plan, sweep: &Sweep, n: Decimals) {
    push(
        out,
        format_args!(
            "\n# A seamless sweep: a floor that bends up into a wall.\n[{}]\nposition = {}\nturn = {:.1}\n\
             front = {}\nback = {}\nwidth = {}\nheight = {}\nradius = {}\nbase_color = {:?}\n\n\
             # The backdrop may be exchanged, from black velvet to white paper.\n\
             [background]\nvalue_range = {VALUE_RANGE:?}\n",
            backdrop::NAME,
            n.point(plan, sweep.position),
            sweep.turn.to_degrees(),
            n.one(sweep.front),
            n.one(sweep.back),
            n.one(sweep.width),
            n.one(sweep.height),
            n.one(sweep.radius),
            backdrop::BASE_COLOR
        ),
    );
}

fn lights(out: &mut String, plan: &Plan, n: Decimals) {
    for light in &plan.lights {
        let (kind, extent) = match light.form {
            LightForm::Square(half) => ("rectangle", format!("half_extents = [{0}, {0}]", n.one(half))),
            LightForm::Disk(r) => ("disk", format!("radius = {}", n.one(r))),
        };
        push(
            out,
            format_args!(
                "\n# {}\n[[lights]]\nname = \"{}\"\ntype = \"{kind}\"\nposition = {}\nlook_at = {}\n{extent}\n\
                 radiance = {:.3}\ncamera_visible = false\n",
                sentence(light.purpose),
                light.name,
                n.point(plan, light.position),
                n.point(plan, plan.subject.center()),
                light.radiance
            ),
        );
    }
}

/// Words as a sentence, with a capital and a full stop.
fn sentence(words: &str) -> String {
    let mut letters = words.chars();
    let first = letters.next().map(|c| c.to_ascii_uppercase());
    first.into_iter().chain(letters).chain(['.']).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_the_digits_that_the_size_asks_for() {
        assert_eq!(Decimals::for_size(0.05).one(0.123456), "0.12346");
        assert_eq!(Decimals::for_size(50.0).one(123.456), "123.46");
        assert_eq!(Decimals::for_size(5e6).one(-0.01), "0.0");
        assert_eq!(
            ["61.0", "1.80", "0.0500", "1.00e-5", "1234"],
            [61.0, 1.8, 0.05, 1e-5, 1234.0].map(three_digits)
        );
    }
}
