//! Orthonormal frames.

use glam::Vec3;

/// A right-handed orthonormal basis whose third axis is `n`.
#[derive(Clone, Copy, Debug)]
pub struct Frame {
    /// First tangent.
    pub s: Vec3,
    /// Second tangent.
    pub t: Vec3,
    /// The normal.
    pub n: Vec3,
}

impl Frame {
    /// Frame around a unit vector, computed without branches and accurate over the whole sphere (Duff et al.,
    /// *Building an Orthonormal Basis, Revisited*, JCGT 2017).
    #[inline(always)]
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

    /// Transforms a direction from this frame's coordinates to world coordinates.
    #[inline(always)]
    pub fn to_world(&self, local: Vec3) -> Vec3 {
        self.s * local.x + self.t * local.y + self.n * local.z
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn assert_orthonormal(n: Vec3) {
        let f = Frame::from_normal(n);
        for (value, expected) in [
            (f.s.dot(f.t), 0.0),
            (f.s.dot(f.n), 0.0),
            (f.t.dot(f.n), 0.0),
            (f.s.length(), 1.0),
            (f.t.length(), 1.0),
            (f.s.cross(f.t).dot(f.n), 1.0),
        ] {
            assert!((value - expected).abs() < 1e-6, "{n}: got {value}, expected {expected}");
        }
    }

    #[test]
    fn frames_are_orthonormal_near_the_south_pole() {
        assert_orthonormal(Vec3::new(3.85e-4, 3.85e-4, -0.999_999_9).normalize());
        assert_orthonormal(Vec3::NEG_Z);
        assert_orthonormal(Vec3::Z);
        for i in 0..1000_u32 {
            let z = -1.0 + 2.0 * (i as f32 + 0.5) / 1000.0;
            let r = (1.0 - z * z).sqrt();
            let phi = i as f32 * 2.399_963;
            assert_orthonormal(Vec3::new(r * phi.cos(), r * phi.sin(), z).normalize());
        }
    }
}
