//! A path's ray, and the state of the path that weighs what the ray meets.

use super::cone::Cone;
use super::medium::Medium;
use crate::geometry::Ray;
use crate::integrators::view::Ways;
use crate::math::Vec3;

/// A path's ray.
#[derive(Clone, Copy)]
pub struct PathRay {
    /// The ray; its direction is a unit vector.
    pub ray: Ray,
    /// Throughput: the factor on the radiance that the ray meets.
    pub throughput: Vec3,
    /// The sample that it belongs to.
    pub slot: u32,
    /// Number that tells the paths of one sample apart.
    pub path: u32,
    /// The glass around it.
    pub medium: Medium,
    /// Events before this ray.
    pub state: PathState,
    /// The beam around it.
    pub cone: Cone,
}

/// State of a path, beside its ray, that determines the weight of the light which it meets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathState {
    /// Pdf in sr⁻¹ of the direction at the last vertex's lobes. 0 after the camera, a mirror or glass, and if the path passed
    /// through glass since: then no light sample finds what it meets.
    pub density: f32,
    /// The normal at the last vertex, by which its light samples went, if there is a pdf.
    pub normal: Vec3,
    /// Throughput for Russian roulette: the largest component, of all lobes, whatever the view shows.
    pub roulette_throughput: f32,
    /// Whether only the camera, mirrors and glass come before.
    pub only_specular_before: bool,
    /// Whether exactly one diffuse or glossy surface comes before.
    pub one_diffuse_before: bool,
    /// Whether the last such surface had a glossy lobe.
    pub is_after_gloss: bool,
}

impl PathState {
    /// The state of camera rays.
    pub const CAMERA: Self = Self {
        density: 0.0,
        normal: Vec3::ZERO,
        roulette_throughput: 1.0,
        only_specular_before: true,
        one_diffuse_before: false,
        is_after_gloss: false,
    };

    /// The state after a δ lobe that keeps this part of the radiance.
    pub fn mirrored(self, part: f32) -> Self {
        Self { density: 0.0, roulette_throughput: self.roulette_throughput * part, ..self }
    }

    /// The state after a surface that it passed straight on, of which this part is left: light samples find what is behind it.
    pub fn straight(self, part: f32) -> Self {
        Self { roulette_throughput: self.roulette_throughput * part, ..self }
    }

    /// Whether the view shows light that reaches the first diffuse or glossy surface by this path.
    pub fn contributes(&self, ways: Ways) -> bool {
        match (self.one_diffuse_before, self.density > 0.0) {
            (true, true) => ways.direct,
            (true, false) => ways.caustic,
            (false, _) => ways.indirect,
        }
    }

    /// The state after surfaces that change nothing, but hide from light samples what is behind them.
    pub fn hidden(self) -> Self {
        self.mirrored(1.0)
    }
}

impl PathRay {
    /// Number of the path that goes on from here; `branch` tells its continuations apart.
    pub fn next_path(&self, branch: u32) -> u32 {
        // With XOR, the number 1 would stay 1 at each reflection, and every choice of the path would repeat the first
        // one.
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
            medium: Medium::default(),
            state: PathState::CAMERA,
            cone: Cone::default(),
        }
    }

    #[test]
    fn the_paths_of_a_sample_have_numbers_of_their_own() {
        // Follow all paths of 12 splits, and one that is always reflected or always refracted.
        let (mut round, mut only_specular_before) =
            (vec![CAMERA_PATH + 1], HashSet::from([CAMERA_PATH, CAMERA_PATH + 1]));
        for _ in 0..12 {
            round = round.iter().flat_map(|&path| [1, 2].map(|way| numbered(path).next_path(way))).collect();
            assert!(round.iter().all(|&path| only_specular_before.insert(path)));
        }
        for way in [1, 2] {
            let (mut path, mut only_specular_before) = (CAMERA_PATH + 1, HashSet::from([CAMERA_PATH]));
            for length in 0..10_000 {
                assert!(only_specular_before.insert(path), "way {way} comes back to itself after {length}");
                path = numbered(path).next_path(way);
            }
        }
    }
}
