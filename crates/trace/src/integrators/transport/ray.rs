//! A path's ray, and the path state that determines the weight of any light the ray finds.

use super::cone::RayCone;
use super::interiors::InteriorList;
use crate::geometry::Ray;
use crate::integrators::view::PathClasses;
use crate::math::Vec3;

/// The current ray of a path.
#[derive(Clone, Copy)]
pub struct PathRay {
    /// The ray, with a normalized direction.
    pub ray: Ray,
    /// Throughput: the factor applied to radiance arriving along the ray.
    pub throughput: Vec3,
    /// Slot of the sample.
    pub slot: u32,
    /// Number that distinguishes the paths of one sample.
    pub path: u32,
    /// The glass solids around the ray.
    pub interiors: InteriorList,
    /// Summary of the path before this ray.
    pub state: PathHistory,
    /// The ray cone, for texture filtering.
    pub cone: RayCone,
}

/// Summary of a path's earlier vertices, which determines how light found by the path is weighted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathHistory {
    /// BSDF-sampling pdf of the direction at the last vertex, in sr⁻¹, or 0 if light samples cannot find the
    /// light: after the camera, a mirror or glass, or if the path has since passed through glass.
    pub pdf: f32,
    /// Normal used by light samples at the last vertex. Valid if `pdf` > 0.
    pub normal: Vec3,
    /// Throughput for Russian roulette: the largest component over all lobes, independent of the view.
    pub roulette_throughput: f32,
    /// Whether all vertices between the camera and this ray are specular.
    pub only_specular_before: bool,
    /// Whether exactly one of the path's vertices is diffuse or glossy.
    pub one_diffuse_before: bool,
    /// Whether the last diffuse or glossy vertex has a glossy lobe.
    pub is_after_gloss: bool,
}

impl PathHistory {
    /// State of camera rays.
    pub const CAMERA: Self = Self {
        pdf: 0.0,
        normal: Vec3::ZERO,
        roulette_throughput: 1.0,
        only_specular_before: true,
        one_diffuse_before: false,
        is_after_gloss: false,
    };

    /// Returns the state after a specular bounce with reflectance or transmittance `part`.
    pub fn after_specular(self, part: f32) -> Self {
        Self { pdf: 0.0, roulette_throughput: self.roulette_throughput * part, ..self }
    }

    /// Returns the state after a null interaction with transmittance `part`. Light samples still find the
    /// light behind the surface.
    pub fn after_null_interaction(self, part: f32) -> Self {
        Self { roulette_throughput: self.roulette_throughput * part, ..self }
    }

    /// Whether the view shows light that arrives along this path at its first diffuse or glossy vertex.
    pub fn contributes_to_view(&self, paths: PathClasses) -> bool {
        match (self.one_diffuse_before, self.pdf > 0.0) {
            (true, true) => paths.direct,
            (true, false) => paths.caustic,
            (false, _) => paths.indirect,
        }
    }

    /// Returns the state after crossing a surface inside glass. Such a surface does not change the ray, but
    /// blocks light samples.
    pub fn after_crossing_inside_glass(self) -> Self {
        self.after_specular(1.0)
    }
}

impl PathRay {
    /// Path number for a continuation of this path. Each continuation has a different `branch`.
    pub fn child_path_number(&self, branch: u32) -> u32 {
        // With XOR, path number 1 would remain 1 after each reflection, so all random choices along the path
        // would be the same.
        self.path.wrapping_add(branch).wrapping_mul(0x9e37_79b1).rotate_left(15).wrapping_add(branch)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;
    use crate::sampling::CAMERA_PATH;

    fn numbered(path: u32) -> PathRay {
        let ray = Ray::new(Vec3::ZERO, Vec3::Z);
        PathRay {
            ray,
            throughput: Vec3::ONE,
            slot: 0,
            path,
            interiors: InteriorList::default(),
            state: PathHistory::CAMERA,
            cone: RayCone::default(),
        }
    }

    #[test]
    fn path_numbers_within_a_sample_are_unique() {
        // Follow all paths through 12 splits, and then one path that is always reflected and one that is
        // always refracted.
        let (mut round, mut visited) = (vec![CAMERA_PATH + 1], HashSet::from([CAMERA_PATH, CAMERA_PATH + 1]));
        for _ in 0..12 {
            round = round
                .iter()
                .flat_map(|&path| [1, 2].map(|way| numbered(path).child_path_number(way)))
                .collect();
            assert!(round.iter().all(|&path| visited.insert(path)));
        }
        for way in [1, 2] {
            let (mut path, mut visited) = (CAMERA_PATH + 1, HashSet::from([CAMERA_PATH]));
            for length in 0..10_000 {
                assert!(visited.insert(path), "branch {way} repeats after {length} bounces");
                path = numbered(path).child_path_number(way);
            }
        }
    }
}
