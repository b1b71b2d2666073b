//! The camera that frames a subject.

use glam::{Vec2, Vec3};

use crate::{import::sidecar::DEFAULT_FILM, math::Bounds};

/// Diagonal field of view, degrees: that of 56 mm on 35 mm film, a normal lens. A wider one distorts the
/// subject, a narrower one needs more room than its 6 radii.
const DIAGONAL_FOV: f32 = 42.0;
/// Share of the half width of the frame that the subject may fill to the left and right. With the heights
/// below it leaves a margin of about a quarter, in which shadow and backdrop show.
const FILL_ACROSS: f32 = 0.74;
/// Share of the half height of the frame that the subject may fill below the centre.
const FILL_BELOW: f32 = 0.72;
/// Share of the half height of the frame that the subject may fill above the centre; less than below, for
/// headroom.
const FILL_ABOVE: f32 = 0.64;
/// Elevation of the camera, degrees, on a standing and on a flat subject: the former is seen almost from
/// its own height, the latter from above, where its upper side shows.
const ELEVATION: [f32; 2] = [9.0, 28.0];
/// Height over horizontal diagonal from which a subject counts as standing: that of a cube is 0.71.
const STANDING: f32 = 0.8;
/// Height over width, as seen, from which the picture is upright. An upright one shows the subject larger
/// from 0.92 on, and by a third from 1.23 on; up to 1.5 the usual format is kept all the same.
const UPRIGHT: f32 = 1.5;
/// Widest view that a room may force, degrees: at its edge, 45° off the axis, a ball is stretched by √2.
const MAX_VFOV: f32 = 90.0;

/// Position, direction and film of a pinhole camera that stands upright.
#[derive(Clone, Copy, Debug)]
pub struct View {
    /// Position of the pinhole, metres.
    pub eye: Vec3,
    /// Point at the centre of the picture, metres.
    pub look_at: Vec3,
    /// Vertical field of view, degrees.
    pub vfov: f32,
    /// Width and height of the film, pixels.
    pub size: [u32; 2],
}

/// Orthonormal axes of a camera.
#[derive(Clone, Copy, Debug)]
pub struct Axes {
    /// Unit vector to the right in the picture.
    pub right: Vec3,
    /// Unit vector up in the picture.
    pub up: Vec3,
    /// Unit vector along the optical axis, into the picture.
    pub forward: Vec3,
}

impl Axes {
    /// Axes of an upright camera that looks along the unit vector `forward`.
    pub fn along(forward: Vec3) -> Self {
        let right = forward.cross(Vec3::Y).try_normalize().unwrap_or(Vec3::X);
        Self { right, up: right.cross(forward), forward }
    }

    fn coordinates(&self, p: Vec3) -> Vec3 {
        Vec3::new(p.dot(self.right), p.dot(self.up), p.dot(self.forward))
    }
}

impl View {
    /// Axes of the camera.
    pub fn axes(&self) -> Axes {
        Axes::along((self.look_at - self.eye).normalize_or(Vec3::NEG_Z))
    }

    /// Tangents of the half fields of view across and up.
    pub fn tangents(&self) -> Vec2 {
        let up = (0.5 * self.vfov).to_radians().tan();
        Vec2::new(up * self.size[0] as f32 / self.size[1] as f32, up)
    }

    /// Position of a point in the picture, whose edges are at ±1; `None` behind the camera.
    pub fn project(&self, p: Vec3) -> Option<Vec2> {
        let q = self.axes().coordinates(p - self.eye);
        (q.z > 0.0).then(|| Vec2::new(q.x, q.y) / q.z / self.tangents())
    }
}

/// Unit direction to a camera at an azimuth, degrees to the right of +z, and an elevation, degrees.
fn direction(azimuth: f32, elevation: f32) -> Vec3 {
    let (sin, cos) = azimuth.to_radians().sin_cos();
    let (up, across) = elevation.to_radians().sin_cos();
    Vec3::new(across * sin, up, across * cos)
}

/// Frames points, seen from `azimuth` degrees to the right of +z.
pub fn frame(points: &[Vec3], azimuth: f32) -> View {
    let bounds = Bounds::of(points.iter().copied());
    let extent = bounds.extent();
    let shape = extent.y / extent.x.hypot(extent.z).max(f32::MIN_POSITIVE);
    let lying = 1.0 - (shape / STANDING).min(1.0);
    let elevation = ELEVATION[0] + lying * (ELEVATION[1] - ELEVATION[0]);
    let axes = Axes::along(-direction(azimuth, elevation));
    let seen = Bounds::of(points.iter().map(|&p| axes.coordinates(p))).extent();
    let [long, short] = DEFAULT_FILM;
    let size = if seen.y > UPRIGHT * seen.x { [short, long] } else { [long, short] };
    let diagonal = (size[0] as f32).hypot(size[1] as f32);
    let up = (0.5 * DIAGONAL_FOV).to_radians().tan() * size[1] as f32 / diagonal;
    let view = View { eye: Vec3::ZERO, look_at: Vec3::ZERO, vfov: 2.0 * up.atan().to_degrees(), size };
    place(points, &axes, view, bounds.center())
}

/// Moves a camera to the nearest position from which all points are within the margins, in the
/// middle between these.
///
/// In the camera's axes a point at (x, z) is left of the right margin if x − e.x ≤ t (z − e.z):
/// for all points, the eye e is on one side of a line, and so for the other margins.
fn place(points: &[Vec3], axes: &Axes, view: View, center: Vec3) -> View {
    let t = view.tangents();
    let [right, left, above, below] =
        [t.x * FILL_ACROSS, t.x * FILL_ACROSS, t.y * FILL_ABOVE, t.y * FILL_BELOW];
    let mut most = [f32::NEG_INFINITY; 4];
    for p in points.iter().map(|&p| axes.coordinates(p - center)) {
        let reach = [p.x - right * p.z, -p.x - left * p.z, p.y - above * p.z, -p.y - below * p.z];
        for (m, r) in most.iter_mut().zip(reach) {
            *m = m.max(r);
        }
    }
    let [r, l, a, b] = most;
    let z = (-(r + l) / (right + left)).min(-(a + b) / (above + below));
    let middle = |least: f32, largest: f32| 0.5 * (least + largest);
    let x = middle(r + right * z, -l - left * z);
    let y = middle(a + above * z, -b - below * z);
    let eye = center + axes.right * x + axes.up * y + axes.forward * z;
    View { eye, look_at: eye + axes.forward * (center - eye).dot(axes.forward), ..view }
}

/// Moves a camera forward to `distance` from the point it looks at, and widens its field of view
/// until all points are in the picture, up to [`MAX_VFOV`].
pub fn from_nearer(points: &[Vec3], view: View, distance: f32) -> View {
    let eye = view.look_at - view.axes().forward * distance;
    let near = View { eye, ..view };
    let widest = points.iter().map(|&p| near.project(p).map_or(f32::INFINITY, |q| q.abs().max_element()));
    let factor = widest.fold(0.0, f32::max) / FILL_BELOW;
    let vfov = 2.0 * (near.tangents().y * factor).atan().to_degrees();
    View { vfov: vfov.clamp(view.vfov, MAX_VFOV), ..near }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn corners(lo: Vec3, hi: Vec3) -> Vec<Vec3> {
        let pick = |i: usize| Vec3::select(glam::BVec3::new(i & 1 > 0, i & 2 > 0, i & 4 > 0), hi, lo);
        (0..8).map(pick).collect()
    }

    #[test]
    fn subjects_of_any_shape_fill_the_frame_to_its_margins() {
        for hi in [Vec3::new(1.0, 1.0, 1.0), Vec3::new(0.2, 3.0, 0.1), Vec3::new(90.0, 1.0, 30.0)] {
            for azimuth in [0.0, 30.0, 200.0] {
                let points = corners(Vec3::new(0.0, -0.1, 0.0), hi);
                let view = frame(&points, azimuth);
                let seen: Vec<Vec2> = points.iter().map(|&p| view.project(p).unwrap()).collect();
                let most = |f: fn(&Vec2) -> f32| seen.iter().map(f).fold(f32::NEG_INFINITY, f32::max);
                let (right, left) = (most(|p| p.x), most(|p| -p.x));
                let (above, below) = (most(|p| p.y), most(|p| -p.y));
                assert!(right <= FILL_ACROSS + 1e-3 && left <= FILL_ACROSS + 1e-3, "{hi}: {right} {left}");
                assert!(above <= FILL_ABOVE + 1e-3 && below <= FILL_BELOW + 1e-3, "{hi}: {above} {below}");
                let fills =
                    (right + left > 1.97 * FILL_ACROSS) || (above + below > FILL_ABOVE + FILL_BELOW - 0.02);
                assert!(fills, "{hi} {azimuth}: {right} {left} {above} {below}");
                assert_eq!(view.size, if hi.y > 2.0 { [480, 640] } else { [640, 480] });
            }
        }
    }

    #[test]
    fn a_nearer_camera_sees_as_much() {
        let points = corners(Vec3::ZERO, Vec3::ONE);
        let view = frame(&points, 30.0);
        let near = from_nearer(&points, view, 0.6 * view.eye.distance(view.look_at));
        assert!(near.vfov > view.vfov);
        assert!(points.iter().all(|&p| near.project(p).unwrap().abs().max_element() < 0.75));
    }
}
