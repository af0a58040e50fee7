//! Accumulates the light components visible in the view.

use super::ray::PathRay;
use crate::integrators::view::{LightAov, RadianceComponentMask};
use crate::math::Vec3;

/// A contribution other than reflected light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NonReflectedTerm {
    /// Emission of a surface, or the background.
    Emitted,
    /// The ambient term.
    Ambient,
}

/// Accumulates each slot's radiance, limited to the components visible in the view. In each bounce, emission
/// and ambient light are added first, followed by reflected light, in path order.
pub struct Accumulator<'a> {
    /// The AOV to accumulate.
    pub aov: LightAov,
    /// Radiance sums, indexed by slot.
    pub radiance: &'a mut [Vec3],
    /// Upper bound on contributions from vertices that the camera does not see, or 0 for no bound.
    pub clamp: f32,
}

impl Accumulator<'_> {
    /// Adds emission or ambient light.
    pub fn add_non_reflected(&mut self, slot: u32, part: NonReflectedTerm, radiance: Vec3) {
        let parts = self.components_to_accumulate();
        let is_taken = match part {
            NonReflectedTerm::Emitted => parts.emitted,
            NonReflectedTerm::Ambient => parts.ambient,
        };
        if is_taken {
            self.radiance[slot as usize] += radiance;
        }
    }

    /// Adds light from a source that a path hits after its first diffuse or glossy surface.
    pub fn add_emitter_hit(&mut self, path: &PathRay, radiance: Vec3) {
        match self.aov {
            LightAov::Radiance(parts) if path.state.contributes_to_view(parts.paths) => {
                self.add_clamped_direct(path.slot, radiance, false);
            }
            LightAov::Radiance(_) | LightAov::LitFraction | LightAov::TraversalCost => {}
        }
    }

    /// Adds the traversal cost of a ray.
    pub fn add_traversal_cost(&mut self, slot: u32, count: u32) {
        self.radiance[slot as usize] += Vec3::splat(count as f32);
    }

    /// Radiance components to accumulate.
    fn components_to_accumulate(&self) -> RadianceComponentMask {
        match self.aov {
            LightAov::Radiance(parts) => parts,
            LightAov::LitFraction | LightAov::TraversalCost => RadianceComponentMask::NONE,
        }
    }

    /// Whether any reflected light is accumulated.
    pub fn accepts_reflected(&self) -> bool {
        match self.aov {
            LightAov::Radiance(parts) => parts.has_reflected(),
            LightAov::LitFraction | LightAov::TraversalCost => true,
        }
    }

    /// Whether the ambient term of a surface hit by a path is accumulated. After a diffuse or glossy surface,
    /// it is treated as light reflected by that surface.
    pub fn accepts_ambient(&self, path: &PathRay) -> bool {
        let parts = self.components_to_accumulate();
        if path.state.only_specular_before {
            parts.ambient
        } else {
            parts.has_reflected() && parts.paths.indirect
        }
    }

    /// Adds the ambient term of a surface hit by a path.
    #[inline]
    pub fn add_ambient(&mut self, path: &PathRay, radiance: Vec3) {
        if path.state.only_specular_before {
            self.add_non_reflected(path.slot, NonReflectedTerm::Ambient, radiance);
        } else if self.accepts_ambient(path) {
            self.add_clamped_direct(path.slot, radiance, false);
        }
    }

    /// Adds direct light at vertices with consecutive slots. The camera must see all of these vertices.
    pub fn add_direct_to_consecutive_slots(&mut self, first: u32, contributions: &[Vec3]) {
        for (sum, contribution) in self.radiance[first as usize..].iter_mut().zip(contributions) {
            *sum += *contribution;
        }
    }

    /// Adds direct light at a vertex, clamped unless the camera sees the vertex.
    pub fn add_clamped_direct(&mut self, slot: u32, contribution: Vec3, only_specular_before: bool) {
        let largest = contribution.max_element();
        let is_clamped = !only_specular_before && self.clamp > 0.0 && largest > self.clamp;
        let kept = if is_clamped { self.clamp / largest } else { 1.0 };
        self.radiance[slot as usize] += contribution * kept;
    }
}
