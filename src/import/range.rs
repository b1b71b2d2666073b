//! Numbers of scene files that lie outside the range that their format allows.

use glam::Vec3;

use crate::{
    files::number::{Number, Numbers},
    math::Rgb,
};

/// Range of a share.
pub const UNIT: [f32; 2] = [0.0, 1.0];
/// Largest IOR of a coat or glass, germanium's.
pub const MAX_IOR: f32 = 4.0;
/// What lies less outside its range is a rounding of the program that wrote it, and not worth a word.
const ROUNDING: f32 = 1e-3;

/// The number nearest to `value` in its range, inclusive; `warn` is told where that is another number.
pub fn clamped(key: &str, value: f32, range: [f32; 2], warn: impl FnOnce(String)) -> f32 {
    let [least, most] = range;
    let taken = value.clamp(least, most);
    if !is_near(value, taken) {
        warn(format!("`{key}` {} is not {}: {} is taken", Number(value), words(range), Number(taken)));
    }
    taken
}

/// As [`clamped`], of the channels of a colour.
pub fn clamped_color(key: &str, color: [f32; 3], range: [f32; 2], warn: impl FnOnce(String)) -> Rgb {
    let [least, most] = range;
    let taken = Vec3::from_array(color).clamp(Vec3::splat(least), Vec3::splat(most));
    if !color.iter().zip(taken.to_array()).all(|(&value, taken)| is_near(value, taken)) {
        let (given, taken) = (Numbers(&color), taken.to_array());
        warn(format!("`{key}` {given} is not {}: {} is taken", words(range), Numbers(&taken)));
    }
    taken
}

fn is_near(value: f32, taken: f32) -> bool {
    (value - taken).abs() <= ROUNDING * taken.abs().max(1.0)
}

/// A range in words.
fn words([least, most]: [f32; 2]) -> String {
    match most {
        f32::INFINITY.. => format!("at least {}", Number(least)),
        _ => format!("in [{}, {}]", Number(least), Number(most)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_out_of_range_is_said_but_for_roundings() {
        let of = |value: f32, range: [f32; 2]| {
            let mut said = String::new();
            (clamped("Pr", value, range, |s| said = s), said)
        };
        assert_eq!(of(0.5, UNIT), (0.5, String::new()));
        assert_eq!(of(1.0005, UNIT), (1.0, String::new()));
        assert_eq!(of(5.0, UNIT), (1.0, "`Pr` 5 is not in [0, 1]: 1 is taken".into()));
        assert_eq!(of(-3.0, [0.0, f32::INFINITY]), (0.0, "`Pr` -3 is not at least 0: 0 is taken".into()));
        assert_eq!(of(1e30, [0.0, 1e6]), (1e6, "`Pr` 1e30 is not in [0, 1000000]: 1000000 is taken".into()));
        let mut said = String::new();
        let color = clamped_color("Kd", [2.0, 0.5, -1.0], UNIT, |s| said = s);
        assert_eq!(color, Rgb::new(1.0, 0.5, 0.0));
        assert_eq!(said, "`Kd` [2, 0.5, -1] is not in [0, 1]: [1, 0.5, 0] is taken");
    }
}
