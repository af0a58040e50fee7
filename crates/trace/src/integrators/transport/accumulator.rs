//! Accumulates the light components visible in the view, and the layers.

use super::ray::PathRay;
use crate::integrators::layers::{SampleBatchLayerValues, SampleLayer};
use crate::integrators::view::{PathAov, RadianceComponentMask};
use crate::math::Vec3;

/// A contribution other than reflected light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NonReflectedTerm {
    /// Emission of a surface, or the background.
    Emitted,
    /// The ambient term.
    Ambient,
}

/// For each path in a bounce's queue, the fraction of its throughput that wide lobes of the path's first
/// diffuse or glossy vertex reflect. Arbitrary before that vertex.
#[derive(Default)]
pub struct PathDiffuseFractions {
    /// Fractions of this bounce's paths.
    pub current: Vec<Vec3>,
    /// Fractions of the next bounce's paths.
    pub next: Vec<Vec3>,
}

impl PathDiffuseFractions {
    /// Begins with `count` camera paths.
    pub fn begin_camera_paths(&mut self, count: usize) {
        self.current.clear();
        self.current.resize(count, Vec3::ZERO);
        self.next.clear();
    }

    /// Appends a path that continues path `place` specularly.
    pub fn append_inherited(&mut self, place: u32) {
        self.next.push(self.current[place as usize]);
    }

    /// Starts the next bounce.
    pub fn advance_to_next_bounce(&mut self) {
        std::mem::swap(&mut self.current, &mut self.next);
        self.next.clear();
    }
}

/// Layers recorded along with the radiance.
pub struct LayerAccumulator<'a> {
    /// The layers' values.
    pub values: &'a mut SampleBatchLayerValues,
    /// The paths' diffuse fractions, or `None` if no component of the light is recorded.
    pub fractions: Option<&'a mut PathDiffuseFractions>,
}

impl LayerAccumulator<'_> {
    /// Adds light to a layer. Out of line because most images have no layers.
    #[inline(never)]
    fn add(&mut self, layer: SampleLayer, slot: u32, light: Vec3) {
        self.values.add_to_sample(layer, slot, light);
    }
}

/// Accumulates each slot's radiance, limited to the components visible in the view. In each bounce, emission
/// and ambient light are added first, followed by reflected light, in path order.
pub struct Accumulator<'a> {
    /// The AOV to accumulate.
    pub aov: PathAov,
    /// Radiance sums, indexed by slot.
    pub radiance: &'a mut [Vec3],
    /// Upper bound on contributions from vertices that the camera does not see, or 0 for no bound.
    pub clamp: f32,
    /// The layers, if any.
    pub layers: Option<LayerAccumulator<'a>>,
}

impl Accumulator<'_> {
    /// The paths' diffuse fractions, if they are needed for the layers.
    #[inline]
    pub fn diffuse_fractions(&mut self) -> Option<&mut PathDiffuseFractions> {
        self.layers.as_mut()?.fractions.as_deref_mut()
    }

    /// The layers, if any of them records a quantity at the first hit.
    #[inline]
    pub fn first_hit_layers(&mut self) -> Option<&mut SampleBatchLayerValues> {
        self.layers
            .as_mut()
            .map(|layers| &mut *layers.values)
            .filter(|values| values.layer_set().has_first_hit())
    }

    /// Part of the light at a path's vertex that counts as diffuse. `visible` is this part if the camera sees
    /// the vertex.
    #[inline]
    pub fn diffuse_part_of_light(&self, place: u32, light: Vec3, visible: Option<Vec3>) -> Vec3 {
        let fractions = self.layers.as_ref().and_then(|layers| layers.fractions.as_deref());
        fractions.map_or(Vec3::ZERO, |fractions| {
            visible.unwrap_or_else(|| light * fractions.current[place as usize])
        })
    }

    /// Adds emission or ambient light.
    pub fn add_non_reflected(&mut self, slot: u32, part: NonReflectedTerm, radiance: Vec3) {
        let parts = self.components_to_accumulate();
        let (is_taken, layer) = match part {
            NonReflectedTerm::Emitted => (parts.emitted, SampleLayer::Emission),
            NonReflectedTerm::Ambient => (parts.ambient, SampleLayer::Ambient),
        };
        if is_taken {
            self.radiance[slot as usize] += radiance;
            if let Some(layers) = &mut self.layers {
                layers.add(layer, slot, radiance);
            }
        }
    }

    /// Adds the background to the slots of camera rays that leave the scene.
    pub fn add_background(&mut self, slots: impl Iterator<Item = u32>, background: Vec3) {
        if self.layers.is_none() && self.components_to_accumulate().emitted {
            slots.for_each(|slot| self.radiance[slot as usize] += background);
        } else {
            slots.for_each(|slot| self.add_non_reflected(slot, NonReflectedTerm::Emitted, background));
        }
    }

    /// Adds light from a source that path `place` hits after its first diffuse or glossy surface.
    pub fn add_emitter_hit(&mut self, path: &PathRay, place: u32, radiance: Vec3) {
        match self.aov {
            PathAov::Radiance(parts) if path.state.contributes_to_view(parts.paths) => {
                let diffuse = self.diffuse_part_of_light(place, radiance, None);
                self.add_clamped_direct(path.slot, (radiance, diffuse), false);
            }
            PathAov::Radiance(_) | PathAov::LitFraction | PathAov::TraversalCost => {}
        }
    }

    /// Adds the traversal cost of a ray.
    pub fn add_traversal_cost(&mut self, slot: u32, count: u32) {
        self.radiance[slot as usize] += Vec3::splat(count as f32);
    }

    /// Radiance components to accumulate.
    fn components_to_accumulate(&self) -> RadianceComponentMask {
        match self.aov {
            PathAov::Radiance(parts) => parts,
            PathAov::LitFraction | PathAov::TraversalCost => RadianceComponentMask::NONE,
        }
    }

    /// Whether any reflected light is accumulated.
    pub fn accepts_reflected(&self) -> bool {
        match self.aov {
            PathAov::Radiance(parts) => parts.has_reflected(),
            PathAov::LitFraction | PathAov::TraversalCost => true,
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

    /// Adds the ambient term of a surface hit by path `place`.
    #[inline]
    pub fn add_ambient(&mut self, path: &PathRay, place: u32, radiance: Vec3) {
        if path.state.only_specular_before {
            self.add_non_reflected(path.slot, NonReflectedTerm::Ambient, radiance);
        } else if self.accepts_ambient(path) {
            let diffuse = self.diffuse_part_of_light(place, radiance, None);
            self.add_clamped_direct(path.slot, (radiance, diffuse), false);
        }
    }

    /// Adds direct light at vertices with consecutive slots. The camera must see all of these vertices.
    /// `diffuse` contains the diffuse parts, or nothing if they are not needed.
    pub fn add_direct_to_consecutive_slots(&mut self, first: u32, contributions: &[Vec3], diffuse: &[Vec3]) {
        // The compiler vectorizes the loop over `f32`, but not a loop over `Vec3`.
        let sums = bytemuck::cast_slice_mut::<Vec3, f32>(&mut self.radiance[first as usize..]);
        for (sum, contribution) in sums.iter_mut().zip(bytemuck::cast_slice::<Vec3, f32>(contributions)) {
            *sum += contribution;
        }
        let Some(layers) = self.layers.as_mut().filter(|_| !diffuse.is_empty()) else { return };
        layers.values.add_to_consecutive_samples(SampleLayer::Diffuse, first, diffuse.iter().copied());
        if contributions != diffuse {
            let specular = contributions.iter().zip(diffuse).map(|(light, diffuse)| light - diffuse);
            layers.values.add_to_consecutive_samples(SampleLayer::Specular, first, specular);
        }
    }

    /// Adds direct light at a vertex and its diffuse part, clamped unless the camera sees the vertex.
    pub fn add_clamped_direct(
        &mut self,
        slot: u32,
        (contribution, diffuse): (Vec3, Vec3),
        only_specular_before: bool,
    ) {
        let largest = contribution.max_element();
        let is_clamped = !only_specular_before && self.clamp > 0.0 && largest > self.clamp;
        let kept = if is_clamped { self.clamp / largest } else { 1.0 };
        self.radiance[slot as usize] += contribution * kept;
        if let Some(layers) = &mut self.layers {
            let (light, diffuse) = (contribution * kept, diffuse * kept);
            layers.add(SampleLayer::Diffuse, slot, diffuse);
            if light != diffuse {
                layers.add(SampleLayer::Specular, slot, light - diffuse);
            }
        }
    }
}
