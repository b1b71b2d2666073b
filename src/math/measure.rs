//! The measure of luminance: from linear pictures to the display luminance `l` in [0, 1] that the terms of
//! f_q measure, as a view shows it.
//!
//! With D the display-linear colour that the view makes of the exposed one, `l = oetf_srgb(Y(D))`. The
//! view `srgb` needs luminance alone, and clips that instead of the channels:
//! `l = oetf_srgb(clamp(e·Y, 0, 1))`.
//!
//! A picture that is measured is given as planes, one after the other: linear luminance and, where the view
//! needs colour, red and blue, from which green follows.

use glam::DVec3;

use super::{
    display::{LUMINANCE_WEIGHTS, LuminanceMode, luminance},
    oklab::chroma,
    view::ViewTransform,
};

/// Planes of a picture of which colour is known: luminance, red, blue.
pub const COLOUR_PLANES: usize = 3;

/// Names of the planes in the part of an EXR that holds replicates.
pub const PLANES: [char; COLOUR_PLANES] = ['Y', 'R', 'B'];

/// How a linear picture is shown, and how its brightness is measured then.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Measure {
    /// View through which pictures are seen.
    pub view: ViewTransform,
    /// How luminance is measured behind the view.
    pub luminance: LuminanceMode,
    /// Whether the chroma of what the view shows is measured, too.
    pub color: bool,
}

impl From<LuminanceMode> for Measure {
    fn from(luminance: LuminanceMode) -> Self {
        Self { view: ViewTransform::Srgb, luminance, color: false }
    }
}

impl Measure {
    /// The same view with brightness as a display shows it, whatever f_q measures.
    #[must_use]
    pub fn as_shown(self) -> Self {
        Self { luminance: LuminanceMode::Srgb, ..self }
    }

    /// The same measure of luminance alone.
    #[must_use]
    pub fn of_luminance(self) -> Self {
        Self { color: false, ..self }
    }

    /// Planes of the pictures that are measured: 1, or [`COLOUR_PLANES`].
    #[must_use]
    pub fn n_planes(self) -> usize {
        if self.view == ViewTransform::Srgb && !self.color { 1 } else { COLOUR_PLANES }
    }

    /// Planes of what is shown: display luminance, and where colour is measured a and b of [Oklab](super::oklab).
    #[must_use]
    pub fn n_shown(self) -> usize {
        if self.color { 3 } else { 1 }
    }

    /// Planes of a linear picture.
    #[must_use]
    pub fn planes(self, rgb: &[[f32; 3]]) -> Vec<f64> {
        let planes = (0..self.n_planes()).flat_map(|plane| rgb.iter().map(move |&c| plane_of(plane, c)));
        planes.collect()
    }

    /// Display luminance of a linear colour.
    #[must_use]
    pub fn encode(self, rgb: [f32; 3], exposure: f64) -> f64 {
        match self.view {
            ViewTransform::Srgb => self.luminance.encode(luminance(rgb), exposure),
            _ => self.luminance.encode(self.shown(rgb.map(|v| exposure * f64::from(v))), 1.0),
        }
    }

    /// Chroma, a and b, of a linear colour as the view shows it.
    #[must_use]
    pub fn chroma(self, rgb: [f32; 3], exposure: f64) -> [f64; 2] {
        let exposed = exposure * DVec3::from_array(rgb.map(f64::from));
        chroma(self.view.shown(exposed)).map(|(v, _)| v)
    }

    /// [What is shown](Self::n_shown) of every pixel of a linear picture, plane by plane.
    ///
    /// Every reported value of a picture comes through here, so a stored picture gives it again bit for bit.
    #[must_use]
    pub fn encode_image(self, rgb: &[[f32; 3]], exposure: f64) -> Vec<f64> {
        let mut shown: Vec<f64> = rgb.iter().map(|&c| self.encode(c, exposure)).collect();
        if self.color {
            let chroma: Vec<[f64; 2]> = rgb.iter().map(|&c| self.chroma(c, exposure)).collect();
            [0, 1].into_iter().for_each(|k| shown.extend(chroma.iter().map(|c| c[k])));
        }
        shown
    }

    /// Luminance of what the view shows of an exposed colour.
    fn shown(self, exposed: [f64; 3]) -> f64 {
        DVec3::from_array(LUMINANCE_WEIGHTS).dot(self.view.shown(DVec3::from_array(exposed)))
    }

    /// Display luminance of a pixel, given by its value in each plane, and its derivatives by them. The
    /// derivative of what is clipped is 0 beyond the clip and the inner one on its ends.
    #[must_use]
    pub fn encode_pixel(self, planes: [f64; COLOUR_PLANES], exposure: f64) -> (f64, [f64; COLOUR_PLANES]) {
        if self.view == ViewTransform::Srgb {
            let (l, slope) = self.luminance.encode_with_derivative(planes[0], exposure);
            return (l, [slope, 0.0, 0.0]);
        }
        let [y, red, blue] = planes;
        let [of_red, of_green, of_blue] = LUMINANCE_WEIGHTS;
        let green = (y - of_red * red - of_blue * blue) / of_green;
        let (shown, by_exposed) = self.view.display(exposure * DVec3::new(red, green, blue));
        let weights = DVec3::from_array(LUMINANCE_WEIGHTS);
        let (l, slope) = self.luminance.encode_with_derivative(weights.dot(shown).min(1.0), 1.0);
        let DVec3 { x, y, z } = slope * exposure * (by_exposed.transpose() * weights);
        (l, [y / of_green, x - of_red / of_green * y, z - of_blue / of_green * y])
    }

    /// Linear colour of a pixel, given by its value in each plane.
    fn rgb_of([y, red, blue]: [f64; COLOUR_PLANES]) -> DVec3 {
        let [of_red, of_green, of_blue] = LUMINANCE_WEIGHTS;
        DVec3::new(red, (y - of_red * red - of_blue * blue) / of_green, blue)
    }

    /// Chroma of a pixel, given by its value in each plane, with its derivatives by them; 0 for channels that are
    /// clipped.
    fn chroma_pixel(self, planes: [f64; COLOUR_PLANES], exposure: f64) -> [(f64, [f64; COLOUR_PLANES]); 2] {
        let [of_red, of_green, of_blue] = LUMINANCE_WEIGHTS;
        let (shown, by_exposed) = self.view.display(exposure * Self::rgb_of(planes));
        chroma(shown).map(|(v, by_shown)| {
            let DVec3 { x, y, z } = exposure * (by_exposed.transpose() * by_shown);
            (v, [y / of_green, x - of_red / of_green * y, z - of_blue / of_green * y])
        })
    }

    /// [What is shown](Self::n_shown) of every pixel of a picture that is given by its planes, with derivatives as
    /// [`Self::encode_pixel`] has them: `slopes` are planes too, those of display luminance first.
    ///
    /// # Panics
    /// When the pictures differ in size.
    pub fn encode_all(self, planes: &[f64], exposure: f64, shown: &mut [f64], slopes: &mut [f64]) {
        let (n, of_plane) = (shown.len() / self.n_shown(), slopes.len() / self.n_shown());
        let (l, chroma) = shown.split_at_mut(n);
        let (slopes, chroma_slopes) = slopes.split_at_mut(of_plane);
        self.encode_luminance(planes, exposure, l, slopes);
        if !self.color {
            return;
        }
        for p in 0..n {
            let found = self.chroma_pixel([0, 1, 2].map(|c| planes[c * n + p]), exposure);
            for (k, (v, by_plane)) in found.into_iter().enumerate() {
                chroma[k * n + p] = v;
                by_plane.into_iter().enumerate().for_each(|(c, d)| chroma_slopes[(3 * k + c) * n + p] = d);
            }
        }
    }

    /// The part of [`Self::encode_all`] that is display luminance.
    fn encode_luminance(self, planes: &[f64], exposure: f64, l: &mut [f64], slopes: &mut [f64]) {
        if self.view == ViewTransform::Srgb && planes.len() > l.len() {
            let (luminance, others) = slopes.split_at_mut(l.len());
            others.fill(0.0);
            return self.luminance.encode_all(&planes[..l.len()], exposure, l, luminance);
        }
        if self.view == ViewTransform::Srgb {
            return self.luminance.encode_all(planes, exposure, l, slopes);
        }
        let n = l.len();
        assert!([planes.len(), slopes.len()] == [COLOUR_PLANES * n; 2], "pictures of one size");
        for (p, l) in l.iter_mut().enumerate() {
            let (shown, by_plane) = self.encode_pixel([0, 1, 2].map(|c| planes[c * n + p]), exposure);
            *l = shown;
            by_plane.into_iter().enumerate().for_each(|(c, slope)| slopes[c * n + p] = slope);
        }
    }
}

/// Value of a colour in a plane.
#[must_use]
pub fn plane_of(plane: usize, rgb: [f32; 3]) -> f64 {
    match plane {
        0 => luminance(rgb),
        1 => f64::from(rgb[0]),
        _ => f64::from(rgb[2]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Derivatives of display luminance by the planes, through every view, against central differences on
    /// either side of what is clipped, and as a whole picture.
    #[test]
    fn derivatives_agree_with_central_differences() {
        let colours =
            [[0.2, 0.3, 0.1], [3.0, 0.4, 0.05], [0.01, 0.02, 0.9], [7.0, 9.0, 14.0], [0.52, 0.47, 0.63]];
        for (view, luminance) in ViewTransform::ALL
            .into_iter()
            .flat_map(|v| [(v, LuminanceMode::Srgb), (v, LuminanceMode::Linear)])
        {
            let measure = Measure { view, luminance, color: true };
            for (rgb, exposure) in colours.into_iter().flat_map(|c| [(c, 1.0), (c, 0.3)]) {
                let planes: [f64; 3] = std::array::from_fn(|c| plane_of(c, rgb));
                let (l, slopes) = measure.encode_pixel(planes, exposure);
                assert!((l - measure.encode(rgb, exposure)).abs() < 1e-6, "{measure:?} {rgb:?}");
                let (mut all, mut of_all) = ([0.0; 3], vec![0.0; 9]);
                measure.encode_all(&planes, exposure, &mut all, &mut of_all);
                assert_eq!((all[0], &of_all[..3]), (l, &slopes[..]));
                let chroma = measure.chroma(rgb, exposure);
                assert!((0..2).all(|k| (all[k + 1] - chroma[k]).abs() < 1e-6), "{measure:?} {rgb:?}");
                for c in 0..measure.n_planes() {
                    let h = 1e-7 * planes[c].max(0.01);
                    let at = |d: f64| {
                        let mut moved = planes;
                        moved[c] += d;
                        let mut shown = [0.0; 3];
                        measure.encode_all(&moved, exposure, &mut shown, &mut [0.0; 9]);
                        shown
                    };
                    let (more, less) = (at(h), at(-h));
                    for k in 0..3 {
                        let (measured, found) = ((more[k] - less[k]) / (2.0 * h), of_all[3 * k + c]);
                        let allowed = 1e-6 * found.abs().max(1.0);
                        assert!(
                            (measured - found).abs() < allowed,
                            "{measure:?} {rgb:?} {c} {k}: {measured} {found}"
                        );
                    }
                }
                let alone = measure.of_luminance();
                let n = alone.n_planes();
                let (mut all, mut of_all) = ([0.0], vec![0.0; n]);
                alone.encode_all(&planes[..n], exposure, &mut all, &mut of_all);
                assert_eq!((all[0], of_all.as_slice()), (l, &slopes[..n]));
            }
        }
    }

    #[test]
    fn the_view_of_srgb_measures_luminance_alone_and_clips_it() {
        let measure = Measure::from(LuminanceMode::Srgb);
        let rgb = [4.0, 0.1, 0.0];
        assert_eq!(measure.encode(rgb, 0.9), LuminanceMode::Srgb.encode(luminance(rgb), 0.9));
        assert_eq!(measure.planes(&[rgb]), [luminance(rgb)]);
        // With channels clipped, as another view has them, red is no brighter than its weight.
        let clipped = Measure { view: ViewTransform::Linear, ..Measure::from(LuminanceMode::Linear) };
        assert!(clipped.encode(rgb, 1.0) < 0.3 && measure.encode(rgb, 1.0) > 0.9);
    }
}
