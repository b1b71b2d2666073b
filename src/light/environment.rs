//! Lights at infinity: one direction, or all of them.
//!
//! A picture of the surroundings maps the direction d to
//! u = atan2(d.x, −d.z)/2π, v = acos(d.y)/π from the top (y up), as Mitsuba's
//! `envmap`: its left edge lies toward −z, its middle toward +z.

use std::{f32::consts::PI, fmt, sync::Arc};

use glam::{Vec2, Vec3};

use super::{Crossing, LightLeSample, LightLiSample, LightPoint};
use crate::math::{
    AreaPdf, Discrete, Frame, ONE_MINUS_EPSILON, Rgb, SolidAnglePdf, hash::hash_bytes, luminance, warp,
};

/// Bounding sphere of a scene, through which light from infinity enters.
#[derive(Clone, Copy, Debug)]
pub struct Surroundings {
    /// Centre of the scene's bounding sphere, metres.
    pub center: Vec3,
    /// Radius of that sphere, metres.
    pub radius: f32,
    /// Distance that leads out of the scene from every point in it and from the camera, metres.
    pub far: f32,
}

impl Default for Surroundings {
    /// The unit sphere at the origin.
    fn default() -> Self {
        Self { center: Vec3::ZERO, radius: 1.0, far: 4.0 }
    }
}

impl Surroundings {
    /// Density of a point of the disk that covers the scene, m⁻².
    pub(super) fn disk_pdf(&self) -> f32 {
        1.0 / (PI * self.radius * self.radius)
    }

    /// A point of the disk outside the scene through which light along `dir` comes.
    fn entry(&self, dir: Vec3, u: Vec2) -> Vec3 {
        let disk = warp::square_to_disk(u) * self.radius;
        self.center + Frame::from_normal(dir).to_world(disk.extend(-self.radius))
    }
}

/// A light at infinity in a single direction: its radiance is an irradiance across it, W·m⁻².
#[derive(Clone, Copy, Debug)]
pub struct Distant {
    /// Unit direction in which the light travels.
    pub direction: Vec3,
    /// Bounding sphere of the scene.
    pub scene: Surroundings,
}

impl Distant {
    fn at(&self, p: Vec3) -> LightPoint {
        LightPoint { p, n: self.direction, rho: 0.0, element: 0 }
    }

    pub(super) fn sample_li(&self, reference: Vec3) -> LightLiSample {
        LightLiSample {
            radiance: Rgb::ONE,
            wi: -self.direction,
            pdf: SolidAnglePdf(1.0),
            at: self.at(reference - self.direction * self.scene.far),
        }
    }

    pub(super) fn sample_le(&self, u: Vec2) -> LightLeSample {
        LightLeSample {
            radiance: Rgb::ONE,
            at: self.at(self.scene.entry(self.direction, u)),
            dir: self.direction,
            pdf_pos: AreaPdf(1.0),
            pdf_dir: SolidAnglePdf(self.scene.disk_pdf()),
        }
    }
}

/// A light at infinity in all directions, alike or as a radiance map says.
#[derive(Clone, Debug)]
pub struct Environment {
    /// Radiance by direction for L = 1; `None` for 1 in all directions.
    pub map: Option<Arc<RadianceMap>>,
    /// Angle by which the map is turned about +y, radians, anticlockwise as seen from above.
    pub rotation: f32,
    /// Bounding sphere of the scene.
    pub scene: Surroundings,
}

impl Environment {
    fn turn(d: Vec3, angle: f32) -> Vec3 {
        let (sin, cos) = angle.sin_cos();
        Vec3::new(cos * d.x + sin * d.z, d.y, cos * d.z - sin * d.x)
    }

    /// Radiance seen along unit `dir` for L = 1.
    #[must_use]
    pub fn radiance(&self, dir: Vec3) -> Rgb {
        self.map.as_ref().map_or(Rgb::ONE, |m| m.sample(direction_to_uv(Self::turn(dir, -self.rotation))))
    }

    /// Density of the direction `dir` toward the light.
    pub(super) fn pdf(&self, dir: Vec3) -> SolidAnglePdf {
        self.map.as_ref().map_or(warp::UNIFORM_SPHERE_PDF, |m| {
            let dir = Self::turn(dir, -self.rotation);
            let sin = (1.0 - dir.y * dir.y).max(0.0).sqrt();
            let pdf = m.pdf(direction_to_uv(dir));
            SolidAnglePdf(if sin > 0.0 { pdf / (2.0 * PI * PI * sin) } else { 0.0 })
        })
    }

    fn sample_direction(&self, u: Vec2) -> Vec3 {
        match &self.map {
            None => warp::square_to_sphere(u),
            Some(m) => Self::turn(uv_to_direction(m.sample_uv(u)), self.rotation),
        }
    }

    fn at(&self, p: Vec3, dir: Vec3) -> LightPoint {
        LightPoint { p, n: -dir, rho: 0.0, element: 0 }
    }

    pub(super) fn crossing(&self, org: Vec3, dir: Vec3) -> Crossing {
        Crossing {
            t: f32::INFINITY,
            at: self.at(org + dir * self.scene.far, dir),
            radiance: self.radiance(dir),
        }
    }

    pub(super) fn sample_li(&self, reference: Vec3, u: Vec2) -> Option<LightLiSample> {
        let wi = self.sample_direction(u);
        let pdf = self.pdf(wi);
        (pdf.0 > 0.0).then(|| LightLiSample {
            radiance: self.radiance(wi),
            wi,
            pdf,
            at: self.at(reference + wi * self.scene.far, wi),
        })
    }

    pub(super) fn sample_le(&self, u_pos: Vec2, u_dir: Vec2) -> Option<LightLeSample> {
        let wi = self.sample_direction(u_pos);
        let pdf = self.pdf(wi);
        (pdf.0 > 0.0).then(|| LightLeSample {
            radiance: self.radiance(wi),
            at: self.at(self.scene.entry(-wi, u_dir), wi),
            dir: -wi,
            pdf_pos: AreaPdf(pdf.0),
            pdf_dir: SolidAnglePdf(self.scene.disk_pdf()),
        })
    }

    /// Power at unit radiance that enters the scene's bounding sphere, W.
    pub(super) fn power(&self) -> Rgb {
        self.map.as_ref().map_or(Rgb::splat(4.0 * PI), |m| m.integral()) / self.scene.disk_pdf()
    }
}

fn direction_to_uv(d: Vec3) -> Vec2 {
    let u = d.x.atan2(-d.z) / (2.0 * PI);
    Vec2::new(if u < 0.0 { u + 1.0 } else { u }, d.y.clamp(-1.0, 1.0).acos() / PI)
}

fn uv_to_direction(uv: Vec2) -> Vec3 {
    let (sin_theta, cos_theta) = (PI * uv.y).sin_cos();
    let (sin_phi, cos_phi) = (2.0 * PI * uv.x).sin_cos();
    Vec3::new(sin_phi * sin_theta, cos_theta, -cos_phi * sin_theta)
}

/// An equirectangular map of radiance with the distribution of its light, interpolated bilinearly
/// between pixel centres, which wrap around horizontally.
pub struct RadianceMap {
    width: usize,
    height: usize,
    texels: Vec<[f32; 3]>,
    /// Distribution from which a pixel of each row is chosen; `None` for a black row.
    columns: Vec<Option<Discrete>>,
    /// Distribution from which rows are chosen.
    rows: Discrete,
    /// ∫ L dω over all directions.
    integral: Rgb,
}

impl fmt::Debug for RadianceMap {
    /// Names the size and a hash of the texels, in place of the texels.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let hash = hash_bytes(self.texels.as_flattened().iter().flat_map(|v| v.to_le_bytes()));
        write!(f, "RadianceMap({} x {}, {hash:016x})", self.width, self.height)
    }
}

impl RadianceMap {
    /// A map of linear Rec.709 radiance, row by row from the top; `None` if it is empty, black, or has a
    /// value that is negative or not finite.
    #[must_use]
    pub fn new(width: usize, height: usize, texels: Vec<[f32; 3]>) -> Option<Self> {
        let is_radiance = |v: &f32| v.is_finite() && *v >= 0.0;
        if texels.is_empty() || texels.len() != width * height || !texels.iter().flatten().all(is_radiance) {
            return None;
        }
        let rows = Discrete::default();
        let map = Self { width, height, texels, columns: vec![], rows, integral: Rgb::ZERO };
        let (mut columns, mut totals) = (Vec::with_capacity(height), Vec::with_capacity(height));
        let mut integral = glam::DVec3::ZERO;
        for y in 0..height {
            let sin = (PI * (y as f32 + 0.5) / height as f32).sin();
            let means: Vec<Rgb> = (0..width).map(|x| map.cell_mean(x, y) * sin).collect();
            integral += means.iter().map(|mean| mean.as_dvec3()).sum::<glam::DVec3>();
            let weights: Vec<f64> = means.iter().map(|mean| f64::from(luminance(*mean))).collect();
            totals.push(weights.iter().sum::<f64>());
            columns.push(Discrete::new(&weights));
        }
        let cell = 2.0 * std::f64::consts::PI.powi(2) / (width * height) as f64;
        let rows = Discrete::new(&totals)?;
        Some(Self { columns, rows, integral: (integral * cell).as_vec3(), ..map })
    }

    /// Width and height, pixels.
    #[must_use]
    pub fn size(&self) -> [usize; 2] {
        [self.width, self.height]
    }

    /// Linear Rec.709 radiance, row by row from the top.
    #[must_use]
    pub fn texels(&self) -> &[[f32; 3]] {
        &self.texels
    }

    /// Whether the map is the same at every turn about the vertical.
    #[must_use]
    pub fn is_round(&self) -> bool {
        self.texels.chunks(self.width).all(|row| row.iter().all(|texel| *texel == row[0]))
    }

    fn texel(&self, x: i64, y: i64) -> Vec3 {
        let x = x.rem_euclid(self.width as i64) as usize;
        let y = y.clamp(0, self.height as i64 - 1) as usize;
        Vec3::from_array(self.texels[y * self.width + x])
    }

    /// Mean of the bilinear map over the cell of a pixel.
    fn cell_mean(&self, x: usize, y: usize) -> Rgb {
        let (x, y) = (x as i64, y as i64);
        let row = |y| (self.texel(x - 1, y) + 6.0 * self.texel(x, y) + self.texel(x + 1, y)) / 8.0;
        (row(y - 1) + 6.0 * row(y) + row(y + 1)) / 8.0
    }

    fn sample(&self, uv: Vec2) -> Rgb {
        let x = uv.x * self.width as f32 - 0.5;
        let y = uv.y * self.height as f32 - 0.5;
        let (x0, y0) = (x.floor(), y.floor());
        let (fx, fy) = (x - x0, y - y0);
        let (x0, y0) = (x0 as i64, y0 as i64);
        let row = |y| self.texel(x0, y).lerp(self.texel(x0 + 1, y), fx);
        row(y0).lerp(row(y0 + 1), fy)
    }

    /// Density of texture coordinates, per unit area of the unit square.
    fn pdf(&self, uv: Vec2) -> f32 {
        let cell = |v: f32, n: usize| ((v * n as f32) as usize).min(n - 1);
        let (x, y) = (cell(uv.x, self.width), cell(uv.y, self.height));
        let Some(row) = &self.columns[y] else { return 0.0 };
        self.rows.pmf(y) * row.pmf(x) * (self.width * self.height) as f32
    }

    fn sample_uv(&self, u: Vec2) -> Vec2 {
        let (y, v) = self.rows.sample(u.y).unwrap_or_default();
        let (x, w) = self.columns[y].as_ref().and_then(|row| row.sample(u.x)).unwrap_or_default();
        let uv = Vec2::new((x as f32 + w) / self.width as f32, (y as f32 + v) / self.height as f32);
        uv.min(Vec2::splat(ONE_MINUS_EPSILON))
    }

    /// ∫ L dω, over the cells.
    fn integral(&self) -> Rgb {
        self.integral
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dim_pixel_beside_the_sun_keeps_its_density() {
        const SIZE: [usize; 2] = [64, 32];
        let texel = |i: usize| if i == 8 * 64 + 3 { [1e9; 3] } else { [1.0; 3] };
        let map = RadianceMap::new(SIZE[0], SIZE[1], (0..64 * 32).map(texel).collect()).unwrap();
        let at = |x: f32, y: f32| map.pdf(Vec2::new((x + 0.5) / 64.0, (y + 0.5) / 32.0));
        // In one row densities are as the radiances, and so they are between rows but for the sine.
        assert!((at(50.0, 8.0) / at(1.0, 8.0) - 1.0).abs() < 1e-5 && at(50.0, 8.0) > 0.0);
        let sines = (PI * 20.5 / 32.0).sin() / (PI * 8.5 / 32.0).sin();
        assert!((at(50.0, 20.0) / at(50.0, 8.0) / sines - 1.0).abs() < 1e-4);
    }
}
