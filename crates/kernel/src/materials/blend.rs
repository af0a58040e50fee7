//! Blends of two materials. Each interaction chooses one of the materials with the probability of its weight,
//! and then shades the surface as if it had only that material. Estimates are unbiased because the choice is
//! independent of all other random numbers, and each material has consistent values and pdfs. Shadow rays and
//! light samples do not choose; they use weighted means.

use super::Material;
use super::footprint::TexturePoint;
use super::scalar::ScalarParameter;
use crate::math::Vec3;

/// A blend of two materials.
#[derive(Clone, Debug, PartialEq)]
pub struct Blend {
    /// Weight of the second material.
    pub weight: ScalarParameter,
    /// The materials, which may be blends.
    pub parts: [Material; 2],
}

impl Blend {
    /// Chooses a part with the random number `u` in [0, 1), and remaps `u` to [0, 1) so that nested blends
    /// can reuse it. Counts texture lookups in `lookups`.
    pub fn choose(&self, at: &TexturePoint, u: &mut f32, lookups: &mut u64) -> &Material {
        let weight = self.second_weight(at, lookups);
        if *u < weight {
            *u /= weight;
            &self.parts[1]
        } else {
            *u = (*u - weight) / (1.0 - weight);
            &self.parts[0]
        }
    }

    /// Weighted mean of `value` over the parts. Skips parts with weight 0. Counts texture lookups in
    /// `lookups`.
    pub fn mean_over_parts(
        &self,
        at: &TexturePoint,
        lookups: &mut u64,
        value: impl Fn(&Material, &mut u64) -> Vec3,
    ) -> Vec3 {
        let second = self.second_weight(at, lookups);
        let mut sum = Vec3::ZERO;
        for (part, weight) in self.parts.iter().zip([1.0 - second, second]) {
            if weight > 0.0 {
                sum += value(part, lookups) * weight;
            }
        }
        sum
    }

    fn second_weight(&self, at: &TexturePoint, lookups: &mut u64) -> f32 {
        self.weight.evaluate(at, lookups).clamp(0.0, 1.0)
    }
}
