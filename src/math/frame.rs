//! Orthonormal frames.

use glam::Vec3;

/// A right-handed orthonormal frame whose local +z is `n`.
#[derive(Clone, Copy, Debug)]
pub struct Frame {
    /// First tangent.
    pub s: Vec3,
    /// Second tangent.
    pub t: Vec3,
    /// Normal, local +z.
    pub n: Vec3,
}

impl Frame {
    /// Builds a frame around a unit normal, without branches or singularity.
    ///
    /// \[Duff17\] listing 3.
    #[must_use]
    pub fn from_normal(n: Vec3) -> Self {
        let sign = 1.0_f32.copysign(n.z);
        let a = -1.0 / (sign + n.z);
        let b = n.x * n.y * a;
        Self {
            s: Vec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x),
            t: Vec3::new(b, sign + n.y * n.y * a, -n.y),
            n,
        }
    }

    /// Coordinates in this frame of the world-space vector `v`.
    #[must_use]
    pub fn to_local(&self, v: Vec3) -> Vec3 {
        Vec3::new(v.dot(self.s), v.dot(self.t), v.dot(self.n))
    }

    /// World-space vector with the coordinates `v` in this frame.
    #[must_use]
    pub fn to_world(&self, v: Vec3) -> Vec3 {
        self.s * v.x + self.t * v.y + self.n * v.z
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_orthonormal_in_every_octant() {
        for i in 0..64 {
            let n =
                Vec3::new((i % 4) as f32 - 1.5, (i / 4 % 4) as f32 - 1.5, (i / 16) as f32 - 1.5).normalize();
            let f = Frame::from_normal(n);
            for (a, b) in [(f.s, f.t), (f.t, f.n), (f.n, f.s)] {
                assert!(a.dot(b).abs() < 1e-6);
            }
            assert!((f.s.cross(f.t) - f.n).length() < 1e-6);
        }
    }
}
