//! Filmic, the default view of Blender 2.79 to 3.6.
//!
//! Colours more than six stops above middle grey go over to white, by the 1.1th power of what they
//! exceed that by; the logarithm of each channel then runs through a filmic curve whose contrast and
//! shoulder are in the name of Blender's file. Blender displays a lattice of 33³ points of the first step,
//! interpolated tetrahedrally, and so does this. The formulas were found in the files that Blender brings,
//! whose makers have not published how they were made: the first reproduces them to their last digit, the
//! curve to .06/255. Measured against Blender 5.0.1 on 11,904 colours: .02/255 on average, at most .06/255.
//!
//! # References
//! \[Sobotka17\] (log encoding); \[Lottes16\] (curve).

use std::{f64::consts::LN_2, sync::LazyLock};

use glam::{DMat3, DVec3};

use super::{
    MIDDLE_GREY,
    lattice::{self, Lattice},
};
use crate::math::display::{eotf_srgb, eotf_srgb_derivative};

/// Points of the lattice along each edge.
const SIDE: usize = 33;
/// Stops from black to white of the curve.
const STOPS: f64 = 16.5;
/// Stops from black to middle grey of the curve.
const STOPS_BELOW: f64 = 10.0;
/// Stops above middle grey from which colours go over to white, and at which they are.
const DESATURATION: [i32; 2] = [6, 15];
/// Power of that.
const DESATURATION_POWER: f64 = 1.1;
/// Contrast of the curve, the `a` of its formula.
const CONTRAST: f64 = 0.7;
/// Shoulder of the curve, the `d` of its formula.
const SHOULDER: f64 = 1.03;
/// What middle grey becomes.
const SHOWN_GREY: f64 = 0.5;

/// The transform, ready to be used.
struct Filmic {
    /// Logarithms of the desaturated channels.
    lattice: Lattice,
    curve: Curve,
}

static FILMIC: LazyLock<Filmic> = LazyLock::new(|| {
    let logarithms = |rgb: DVec3| {
        let c = desaturated(rgb);
        DVec3::new(lattice::coordinate(c.x), lattice::coordinate(c.y), lattice::coordinate(c.z))
    };
    Filmic { lattice: Lattice::sample(SIDE, logarithms), curve: Curve::new() }
});

/// Display-linear Rec.709 in [0, 1] of a linear colour, with its derivatives by the channels, by column.
pub(super) fn display(rgb: DVec3) -> (DVec3, DMat3) {
    let Filmic { lattice, curve } = &*FILMIC;
    let (logarithms, slopes) = lattice.at(rgb);
    let shown = (logarithms * (lattice::STOPS / STOPS)).to_array().map(|x| curve.at(x));
    let light = DVec3::from_array(shown.map(|(code, _)| eotf_srgb(code)));
    let by_logarithm = shown.map(|(code, slope)| eotf_srgb_derivative(code) * slope * lattice::STOPS / STOPS);
    (light, DMat3::from_diagonal(DVec3::from_array(by_logarithm)) * slopes)
}

/// The lattice of logarithms.
pub(super) fn logarithms() -> &'static Lattice {
    &FILMIC.lattice
}

/// Display-linear light of a logarithm of the lattice.
pub(super) fn light(logarithm: f64) -> f64 {
    eotf_srgb(FILMIC.curve.at(logarithm * lattice::STOPS / STOPS).0)
}

/// A colour on its way to the white of its largest channel.
fn desaturated(rgb: DVec3) -> DVec3 {
    let [begin, end] = DESATURATION.map(|stops| MIDDLE_GREY * f64::from(stops).exp2());
    let most = rgb.max_element();
    let share = ((most - begin) / (end - begin)).clamp(0.0, 1.0).powf(DESATURATION_POWER);
    rgb + share * (DVec3::splat(most) - rgb)
}

/// \[Lottes16\]: `y = s^a / (b·s^(a·d) + c)` of the light `s`, where middle grey is 1, with black lifted
/// out below middle grey.
struct Curve {
    b: f64,
    c: f64,
    /// What the formula makes of black.
    black: f64,
}

impl Curve {
    fn new() -> Self {
        // Grey becomes SHOWN_GREY and white 1.
        let white = (STOPS - STOPS_BELOW).exp2();
        let b = (white.powf(CONTRAST) - 1.0 / SHOWN_GREY) / (white.powf(CONTRAST * SHOULDER) - 1.0);
        let c = 1.0 / SHOWN_GREY - b;
        let black = Self { b, c, black: 0.0 }.raw(0.0).0;
        Self { b, c, black }
    }

    /// The formula at the logarithm `x`, 0 for black and 1 for white, with its derivative.
    fn raw(&self, x: f64) -> (f64, f64) {
        let s = (STOPS * x - STOPS_BELOW).exp2();
        let shoulder = self.b * s.powf(CONTRAST * SHOULDER);
        let y = s.powf(CONTRAST) / (shoulder + self.c);
        let per_stop = y * CONTRAST * (1.0 - SHOULDER * shoulder / (shoulder + self.c));
        (y, per_stop * STOPS * LN_2)
    }

    /// Code value in [0, 1] at the logarithm `x`, with its derivative: 0 below black and beyond white.
    fn at(&self, x: f64) -> (f64, f64) {
        let (y, slope) = self.raw(x.clamp(0.0, 1.0));
        let slope = if (0.0..=1.0).contains(&x) { slope } else { 0.0 };
        if y >= SHOWN_GREY {
            return (y.min(1.0), slope);
        }
        let stretch = SHOWN_GREY / (SHOWN_GREY - self.black);
        ((y - self.black).max(0.0) * stretch, slope * stretch)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_goes_through_black_grey_and_white_and_rises() {
        let curve = Curve::new();
        let grey = STOPS_BELOW / STOPS;
        for (x, y) in [(0.0, 0.0), (grey, SHOWN_GREY), (1.0, 1.0), (-0.2, 0.0), (1.2, 1.0)] {
            assert!((curve.at(x).0 - y).abs() < 1e-12, "{x} {:?}", curve.at(x));
        }
        for i in 1..1000 {
            let x = f64::from(i) / 1000.0 + 1e-5;
            let (h, (y, slope)) = (1e-6, curve.at(x));
            let measured = (curve.at(x + h).0 - curve.at(x - h).0) / (2.0 * h);
            assert!(y > curve.at(x - 1e-3).0);
            assert!((measured - slope).abs() < 1e-6 * slope.max(1.0), "{x} {measured} {slope}");
        }
    }

    #[test]
    fn bright_colours_go_over_to_white() {
        assert_eq!(desaturated(DVec3::new(11.0, 0.0, 3.0)), DVec3::new(11.0, 0.0, 3.0));
        let brightest = MIDDLE_GREY * 15_f64.exp2();
        assert_eq!(desaturated(DVec3::new(0.0, brightest, 1.0)), DVec3::splat(brightest));
    }
}
