//! The perfect mirror.

use crate::math::Vec3;

/// A mirror, which reflects in one direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mirror {
    /// Reflectance of each colour.
    pub reflectance: Vec3,
}

/// The direction `incident` takes at a mirror: R = I − 2(I·N)N.
pub fn reflect(incident: Vec3, normal: Vec3) -> Vec3 {
    incident - normal * (2.0 * incident.dot(normal))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_in_and_out_are_equal() {
        let (incident, normal) = (Vec3::new(0.6, -0.8, 0.0), Vec3::Y);
        assert_eq!(reflect(incident, normal), Vec3::new(0.6, 0.8, 0.0));
        assert_eq!(reflect(incident, -normal), reflect(incident, normal));
    }
}
