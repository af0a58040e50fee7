//! Crosses all coincident surfaces at a hit on glass in one step, from one medium to another.

use super::interiors::{Interior, InteriorList};
use super::ray::PathRay;
use super::tile::TileContext;
use super::vertex::SurfaceVertex;
use crate::world::{CoincidenceQuery, CoincidenceScratch, CoincidentOrEnclosingSurface, Hit, OffsetPoints};

/// Surfaces and media crossed by a ray at a hit on glass.
pub struct InterfaceCrossing {
    /// Origins for rays leaving on either side.
    pub sides: OffsetPoints,
    /// The medium traversed by the ray, and the medium on the near side, or `None` if each is the ray's
    /// recorded medium.
    pub before: Option<[InteriorList; 2]>,
    /// The medium on the far side.
    pub far: InteriorList,
    /// The hit on a coincident opaque surface, along the ray between the two origins.
    pub opaque: Option<Hit>,
}

/// The glass whose surface separates two media. Where two glass objects overlap, the one defined later in the
/// scene file takes priority.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SeparatingGlassSurface {
    /// Material of the glass at this point.
    pub material: u32,
    /// Hit on the glass surface, along the ray between the two origins, or `None` if the path itself hits
    /// this surface or if the glass was found only because it encloses the far origin.
    pub hit: Option<Hit>,
}

/// Buffers for the search for coincident surfaces.
#[derive(Default)]
pub struct CoincidentSurfaceBuffers {
    around: CoincidenceScratch,
    near: Vec<CoincidentOrEnclosingSurface>,
}

impl TileContext<'_> {
    /// Finds all surfaces that a ray crosses at a hit on glass.
    pub fn interface_crossing_at_hit(
        &self,
        path: &PathRay,
        vertex: &SurfaceVertex<'_>,
        hit: &Hit,
        memory: &mut CoincidentSurfaceBuffers,
    ) -> InterfaceCrossing {
        let CoincidentSurfaceBuffers { around, near: found } = memory;
        found.clear();
        let lead = hit.shape.t * f32::EPSILON * path.ray.direction.dot(vertex.normal).abs();
        let meeting = CoincidenceQuery { hit, surface: &vertex.surface, normal: vertex.normal, lead };
        let sides = self.world.find_coincident_surfaces_at(&meeting, around, |near| found.push(near));
        let (before, far) = self.media_on_both_sides(&path.interiors, found);
        let opaque = found.iter().filter_map(|near| self.hit_if_not_glass(near));
        let opaque = opaque.min_by(|a, b| a.shape.t.total_cmp(&b.shape.t).then(a.object.cmp(&b.object)));
        InterfaceCrossing { sides, before, far, opaque }
    }

    /// Media before and beyond the coincident surfaces. The near medium is the medium recorded for the ray.
    /// For closed shapes, the far medium is determined by their geometry. A ray that leaves a solid must have
    /// been inside it, even if it was not recorded as inside. Open solids are considered only if the ray
    /// enters or leaves them here, because it is unknown whether the ray is inside other open solids. A ray
    /// and its reverse therefore see the same media. The returned pair contains the medium that the ray
    /// traversed and the medium on the near side, or is `None` if each is the recorded medium.
    fn media_on_both_sides(
        &self,
        known: &InteriorList,
        found: &[CoincidentOrEnclosingSurface],
    ) -> (Option<[InteriorList; 2]>, InteriorList) {
        let is_only_recorded = |glass: Interior| !self.world.is_closed_shape(glass.body);
        // With only closed shapes, most rays enter at most one shape.
        if !self.world.has_open_glass() {
            match *found {
                [] => return (None, known.filter_solids(is_only_recorded)),
                [CoincidentOrEnclosingSurface::Around { object, material }] => {
                    let entered = Interior { body: object, material };
                    return (None, known.filter_solids(is_only_recorded).entered(entered));
                }
                [CoincidentOrEnclosingSurface::Surface { .. }] | [_, _, ..] => {}
            }
        }
        // Start with the recorded media, without open solids.
        let (mut arrived, mut near) = (*known, self.interiors_without_open_solids(*known));
        let mut far = near.filter_solids(is_only_recorded);
        let crossed = |as_front: bool| {
            found.iter().filter_map(move |surface_or_solid| match *surface_or_solid {
                CoincidentOrEnclosingSurface::Surface { hit, material, is_front } if is_front == as_front => {
                    let glass = Interior { body: self.world.solid_id(hit.object), material };
                    self.world.is_glass_material(material).then_some(glass)
                }
                CoincidentOrEnclosingSurface::Surface { .. }
                | CoincidentOrEnclosingSurface::Around { .. } => None,
            })
        };
        let around = found.iter().filter_map(|surface_or_solid| match *surface_or_solid {
            CoincidentOrEnclosingSurface::Around { object, material } => {
                Some(Interior { body: object, material })
            }
            CoincidentOrEnclosingSurface::Surface { .. } => None,
        });
        // Leave the solids whose back faces are hit.
        for glass in crossed(false) {
            if self.world.is_glass_solid_open(glass.body) {
                near = near.entered(glass);
                arrived = if arrived.exited(glass).is_none() { arrived.entered(glass) } else { arrived };
                continue;
            }
            match far.exited(glass) {
                Some(left) => far = left,
                None => (arrived, near) = (arrived.entered(glass), near.entered(glass)),
            }
        }
        // Enter the solids whose front faces are hit, and the solids that enclose the point.
        let far = crossed(true).chain(around).fold(far, InteriorList::entered);
        (Some([arrived, near]), far)
    }

    /// The glass surface that separates two media at a hit, or `None` if both media are air. Must be called
    /// after [`TileContext::interface_crossing_at_hit`], with the same buffers.
    pub fn glass_interface_at_hit(
        &self,
        hit: &Hit,
        [near, far]: [&InteriorList; 2],
        memory: &CoincidentSurfaceBuffers,
    ) -> Option<SeparatingGlassSurface> {
        let later = near.medium_glass().max(far.medium_glass())?;
        let own = self.world.material_index(hit) as u32;
        if self.world.solid_id(hit.object) == later.body && self.world.is_glass_material(own) {
            return Some(SeparatingGlassSurface { material: own, hit: None });
        }
        // The path hits a different coincident surface.
        let of_body = memory.near.iter().find_map(|surface_or_solid| match *surface_or_solid {
            CoincidentOrEnclosingSurface::Surface { hit, material, .. } => {
                let is_later =
                    self.world.solid_id(hit.object) == later.body && self.world.is_glass_material(material);
                is_later.then_some(SeparatingGlassSurface { material, hit: Some(hit) })
            }
            CoincidentOrEnclosingSurface::Around { .. } => None,
        });
        Some(of_body.unwrap_or(SeparatingGlassSurface { material: later.material, hit: None }))
    }

    /// Removes the open solids from a medium.
    pub fn interiors_without_open_solids(&self, interiors: InteriorList) -> InteriorList {
        if self.world.has_open_glass() {
            return interiors.filter_solids(|glass| !self.world.is_glass_solid_open(glass.body));
        }
        interiors
    }

    fn hit_if_not_glass(&self, surface_or_solid: &CoincidentOrEnclosingSurface) -> Option<Hit> {
        match *surface_or_solid {
            CoincidentOrEnclosingSurface::Around { .. } => None,
            CoincidentOrEnclosingSurface::Surface { hit, material, .. } => {
                (!self.world.is_glass_material(material)).then_some(hit)
            }
        }
    }
}
