//! Perspective camera: a pinhole, or a thin lens.
//!
//! Raster space: pixels, x to the right, y down, the film is
//! `[0, width] × [0, height]`. A pixel's value is the mean radiance over its
//! area on the film (box filter).
//!
//! # References
//! \[PBRT3\] 16.1.1 (importance of a perspective camera); \[Kolb95\] 2.1 (thin lens).

use glam::{UVec2, Vec2, Vec3};

use crate::math::{SolidAnglePdf, warp};

/// Largest film, pixels (8192 × 8192): the picture of each light, RGB in f32, then takes 768 MiB.
pub const MAX_PIXELS: u32 = 1 << 26;

/// Whether a film may have this width and height, pixels.
#[must_use]
pub fn is_film_size(size: UVec2) -> bool {
    size.min_element() >= 1 && u64::from(size.x) * u64::from(size.y) <= u64::from(MAX_PIXELS)
}

/// A perspective camera.
#[derive(Clone, Debug)]
pub struct Camera {
    /// Position of the pinhole or of the lens's centre, metres.
    pub position: Vec3,
    lens: Option<Lens>,
    right: Vec3,
    up: Vec3,
    forward: Vec3,
    /// Half-width and half-height of the film plane at distance 1.
    half: Vec2,
    /// Shift of the film to the right and up, in lengths of its longer side.
    shift: Vec2,
    /// Width and height of the film, pixels.
    size: UVec2,
}

/// A thin lens, which images the plane in focus sharply.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lens {
    /// Radius of the aperture, metres.
    pub radius: f32,
    /// Distance of the plane in focus from the lens, along the viewing direction, metres.
    pub focus_distance: f32,
}

/// The connection of a point of the scene to a point of the lens.
#[derive(Clone, Copy, Debug)]
pub struct CameraWiSample {
    /// Raster position at which the camera sees the point, pixels.
    pub raster: Vec2,
    /// Unit direction from the point of the scene to that of the lens.
    pub wi: Vec3,
    /// Squared distance of the two points, m².
    pub dist2: f32,
    /// Importance emitted toward the point, for the mean over the film, sr⁻¹. It equals the density of
    /// the direction, given the point of the lens.
    pub we: SolidAnglePdf,
}

impl Camera {
    /// A camera at `position` looking at `look_at`; `vfov` in degrees, in
    /// (0, 180); `size` in pixels. `None` when the view direction is zero or
    /// parallel to `up`.
    #[must_use]
    pub fn new(position: Vec3, look_at: Vec3, up: Vec3, vfov: f32, size: UVec2) -> Option<Self> {
        let forward = (look_at - position).try_normalize()?;
        let right = forward.cross(up).try_normalize()?;
        let tan = (vfov.to_radians() * 0.5).tan();
        let camera = Self {
            position,
            lens: None,
            right,
            up: right.cross(forward),
            forward,
            half: Vec2::splat(tan),
            shift: Vec2::ZERO,
            size,
        };
        Some(camera.resized(size))
    }

    /// The camera with a lens; with `None` a pinhole.
    #[must_use]
    pub fn with_lens(self, lens: Option<Lens>) -> Self {
        Self { lens, ..self }
    }

    /// The camera with its film shifted to the right and up, in lengths of the film's longer side: it sees
    /// what lies there without being turned, as Blender's *Shift X* and *Y* and a view camera's rise do.
    #[must_use]
    pub fn with_shift(self, shift: Vec2) -> Self {
        Self { shift, ..self }
    }

    /// Shift of the film to the right and up, in lengths of its longer side.
    #[must_use]
    pub fn shift(&self) -> Vec2 {
        self.shift
    }

    /// Middle of the film plane at distance 1, to the right of and above the viewing direction.
    fn middle(&self) -> Vec2 {
        self.shift * (2.0 * self.half.max_element())
    }

    /// The lens; `None` for a pinhole.
    #[must_use]
    pub fn lens(&self) -> Option<Lens> {
        self.lens
    }

    /// The camera with a film of another size in pixels; the vertical field of view stays.
    #[must_use]
    pub fn resized(&self, size: UVec2) -> Self {
        let half = Vec2::new(self.half.y * size.x as f32 / size.y as f32, self.half.y);
        Self { size, half, ..self.clone() }
    }

    /// Film size in pixels.
    #[must_use]
    pub fn size(&self) -> UVec2 {
        self.size
    }

    /// Unit viewing direction.
    #[must_use]
    pub fn forward(&self) -> Vec3 {
        self.forward
    }

    /// Unit vector toward the top of the picture.
    #[must_use]
    pub fn up(&self) -> Vec3 {
        self.up
    }

    /// Vertical field of view, degrees.
    #[must_use]
    pub fn vfov(&self) -> f32 {
        2.0 * self.half.y.atan().to_degrees()
    }

    /// Whether a body, the convex hull of some points, may show in the picture; false only where all of it
    /// lies behind the lens or beyond one edge of the picture.
    #[must_use]
    pub fn may_see(&self, hull: &[Vec3]) -> bool {
        let (radius, blur) = self.lens.map_or((0.0, 0.0), |l| (l.radius, l.radius / l.focus_distance));
        // A ray from the lens at o through the edge of the plane in focus is at x = h·z + o·(1 − z/f).
        let (edge, middle) = (self.half + blur, self.middle());
        let is_outside =
            |beyond: &dyn Fn(Vec3) -> f32| hull.iter().all(|&p| beyond(p - self.position) > radius);
        let ahead = |d: Vec3| d.dot(self.forward);
        let sides: [&dyn Fn(Vec3) -> f32; 5] = [
            &|d| radius - ahead(d),
            &|d| d.dot(self.right) - (edge.x + middle.x) * ahead(d),
            &|d| -d.dot(self.right) - (edge.x - middle.x) * ahead(d),
            &|d| d.dot(self.up) - (edge.y + middle.y) * ahead(d),
            &|d| -d.dot(self.up) - (edge.y - middle.y) * ahead(d),
        ];
        !sides.into_iter().any(is_outside)
    }

    /// Vector from the lens's centre to a raster position on the film plane one metre ahead.
    fn film_point(&self, raster: Vec2) -> Vec3 {
        let ndc = raster / self.size.as_vec2() * 2.0 - Vec2::ONE;
        let middle = self.middle();
        self.forward + self.right * (ndc.x * self.half.x + middle.x)
            - self.up * (ndc.y * self.half.y - middle.y)
    }

    /// Unit direction of the ray through a raster position and the lens's centre.
    #[must_use]
    pub fn direction(&self, raster: Vec2) -> Vec3 {
        self.film_point(raster).normalize()
    }

    /// Origin and unit direction of the ray through a raster position and a
    /// point of the lens that `u` chooses uniformly.
    #[must_use]
    pub fn ray(&self, raster: Vec2, u: Vec2) -> (Vec3, Vec3) {
        let Some(lens) = self.lens else { return (self.position, self.direction(raster)) };
        let on_lens = warp::square_to_disk(u) * lens.radius;
        let offset = self.right * on_lens.x + self.up * on_lens.y;
        let to_focus = self.film_point(raster) * lens.focus_distance - offset;
        (self.position + offset, to_focus.normalize())
    }

    /// Density of a unit direction when the film is sampled uniformly; 0 behind the camera.
    #[must_use]
    pub fn pdf_we(&self, dir: Vec3) -> SolidAnglePdf {
        let cos = dir.dot(self.forward);
        if cos <= 0.0 {
            return SolidAnglePdf(0.0);
        }
        // [PBRT3] eq. 16.2: 1 / (A cos³ θ) with the film at distance 1.
        SolidAnglePdf(1.0 / (4.0 * self.half.x * self.half.y * cos * cos * cos))
    }

    /// Connects the point `p` of the scene to the point `on_lens` of the lens; `None` if the camera
    /// sees it outside the film.
    #[must_use]
    pub fn sample_wi(&self, on_lens: Vec3, p: Vec3) -> Option<CameraWiSample> {
        let d = p - on_lens;
        let z = d.dot(self.forward);
        if z <= 0.0 {
            return None;
        }
        // Seen from the lens's centre, the ray meets the film where it meets the plane in focus.
        let seen = match self.lens {
            None => d / z,
            Some(lens) => d / z + (on_lens - self.position) / lens.focus_distance,
        };
        let middle = self.middle();
        let ndc = Vec2::new(seen.dot(self.right) - middle.x, middle.y - seen.dot(self.up)) / self.half;
        let raster = (ndc + Vec2::ONE) * 0.5 * self.size.as_vec2();
        let size = self.size.as_vec2();
        if !(raster.x >= 0.0 && raster.y >= 0.0 && raster.x < size.x && raster.y < size.y) {
            return None;
        }
        let dist2 = d.length_squared();
        let dir = d / dist2.sqrt();
        Some(CameraWiSample { raster, wi: -dir, dist2, we: self.pdf_we(dir) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera() -> Camera {
        Camera::new(Vec3::new(1.0, 2.0, 3.0), Vec3::ZERO, Vec3::Y, 40.0, UVec2::new(40, 30)).unwrap()
    }

    #[test]
    fn projection_inverts_ray_generation() {
        let c = camera();
        for raster in [Vec2::new(0.5, 0.5), Vec2::new(20.0, 15.0), Vec2::new(39.7, 3.2)] {
            let s = c.sample_wi(c.position, c.position + c.direction(raster) * 2.5).unwrap();
            assert!((s.raster - raster).length() < 1e-4);
            assert!((s.wi + c.direction(raster)).length() < 1e-6);
        }
        assert!(c.sample_wi(c.position, c.position + Vec3::new(1.0, 2.0, 3.0)).is_none());
    }

    #[test]
    fn a_shifted_film_sees_what_lies_beside_without_turning() {
        let c = camera();
        let shifted = c.clone().with_shift(Vec2::new(0.25, -0.5));
        // A quarter of the width of 40 pixels to the right, half of it down.
        let moved = Vec2::new(10.0, 20.0);
        for raster in [Vec2::new(0.5, 0.5), Vec2::new(20.0, 15.0), Vec2::new(39.7, 3.2)] {
            let dir = shifted.direction(raster);
            assert!((dir - c.direction(raster + moved)).length() < 1e-6);
            assert_eq!(shifted.pdf_we(dir), c.pdf_we(dir));
            for camera in
                [shifted.clone(), shifted.clone().with_lens(Some(Lens { radius: 0.1, focus_distance: 2.0 }))]
            {
                let (org, dir) = camera.ray(raster, Vec2::new(0.3, 0.9));
                let s = camera.sample_wi(org, org + dir * 2.5).unwrap();
                assert!((s.raster - raster).length() < 1e-3, "{}", s.raster);
            }
        }
        // The same picture of another size.
        let small = shifted.resized(UVec2::new(20, 15));
        assert!((small.direction(Vec2::ZERO) - shifted.direction(Vec2::ZERO)).length() < 1e-6);
    }

    #[test]
    fn a_lens_gathers_its_rays_in_the_plane_in_focus() {
        let c = camera().with_lens(Some(Lens { radius: 0.1, focus_distance: 2.0 }));
        let raster = Vec2::new(33.3, 4.2);
        let in_focus = c.position + c.film_point(raster) * 2.0;
        for u in [Vec2::ZERO, Vec2::new(0.3, 0.9), Vec2::new(0.99, 0.5)] {
            let (org, dir) = c.ray(raster, u);
            assert!(org.distance(c.position) <= 0.1 + 1e-6);
            assert!((in_focus - org).normalize().distance(dir) < 1e-6);
            for t in [0.5, 2.0, 7.0] {
                let s = c.sample_wi(org, org + dir * t).unwrap();
                assert!(s.raster.distance(raster) < 1e-3, "{}", s.raster);
            }
        }
    }

    #[test]
    fn what_may_not_be_seen_is_on_no_ray() {
        let lens = Lens { radius: 0.3, focus_distance: 2.0 };
        let shift = Vec2::new(0.4, -0.3);
        let cameras = [camera(), camera().with_lens(Some(lens)), camera().with_shift(shift)];
        for c in cameras {
            let (mut n_hidden, mut n_seen) = (0, 0);
            for i in 0..2000 {
                let at = |k: u32| ((i * 7 + 1) as f32 * 0.618 * k as f32).fract() * 12.0 - 6.0;
                let p = Vec3::new(at(1), at(3), at(5));
                let is_hidden = !c.may_see(&[p]);
                let mut on_lens = (0..16).map(|k| (k as f32 * 0.393).sin_cos()).map(|(sin, cos)| {
                    c.position + (c.right * cos + c.up * sin) * c.lens().map_or(0.0, |l| l.radius)
                });
                let is_seen = on_lens.any(|o| c.sample_wi(o, p).is_some());
                assert!(!(is_hidden && is_seen), "{p}");
                n_hidden += usize::from(is_hidden);
                n_seen += usize::from(is_seen);
            }
            assert!(n_hidden > 1000 && n_seen > 20, "{n_hidden} {n_seen}");
            // A body may fill the picture although none of its corners is in it.
            let ahead = c.position + 2.0 * c.forward;
            assert!(c.may_see(&[c.right, -c.right, c.up, -c.up].map(|d| ahead + 9.0 * d)));
            assert!(!c.may_see(&[c.right, -c.right, c.up, -c.up].map(|d| c.position - c.forward + 9.0 * d)));
        }
    }

    #[test]
    fn directions_have_the_stated_density() {
        // ∫ pdf dω over the film = 1: dω = cos³ θ dA for a film at distance 1.
        let c = camera();
        let (n, mut sum) = (64, 0.0_f64);
        for i in 0..n * n {
            let raster =
                Vec2::new((i % n) as f32 + 0.5, (i / n) as f32 + 0.5) / n as f32 * c.size().as_vec2();
            let dir = c.direction(raster);
            let cos = dir.dot(c.forward());
            let cell = 4.0 * c.half.x * c.half.y / (n * n) as f32;
            sum += f64::from(c.pdf_we(dir).0 * cos.powi(3) * cell);
        }
        assert!((sum - 1.0).abs() < 1e-4);
    }

    #[test]
    fn impossible_views_are_refused() {
        let size = UVec2::new(4, 4);
        assert!(Camera::new(Vec3::ZERO, Vec3::ZERO, Vec3::Y, 40.0, size).is_none());
        assert!(Camera::new(Vec3::ZERO, Vec3::Y, Vec3::Y, 40.0, size).is_none());
    }
}
