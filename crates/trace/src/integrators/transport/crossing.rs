//! Crossings of a ray at glass: of all surfaces that touch there at once, from one medium to another.

use super::medium::{Inside, Medium};
use super::ray::PathRay;
use super::tile::TileContext;
use super::vertex::Vertex;
use crate::world::{Hit, Meeting, Near, NearMemory, Sides};

/// A ray's crossing at a hit of glass.
pub struct Crossing {
    /// Starts of the rays that leave.
    pub sides: Sides,
    /// The glass that the ray came through, and the glass on the side that it comes from. `None` if both are as the ray knows.
    pub before: Option<[Medium; 2]>,
    /// The glass on the other side.
    pub far: Medium,
    /// An opaque surface there, as the ray between the sides hits it.
    pub opaque: Option<Hit>,
}

/// The glass whose surface a boundary of two media has: the later one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Boundary {
    /// Its material there.
    pub material: u32,
    /// Its hit by the ray between the sides. `None` if the path itself hits it, or it is known only as one around the far side.
    pub hit: Option<Hit>,
}

/// Memory for the search of near surfaces.
#[derive(Default)]
pub struct CrossingMemory {
    around: NearMemory,
    near: Vec<Near>,
}

impl TileContext<'_> {
    /// The crossing of a ray at a hit of glass.
    pub fn crossing(
        &self,
        path: &PathRay,
        vertex: &Vertex<'_>,
        hit: &Hit,
        memory: &mut CrossingMemory,
    ) -> Crossing {
        let CrossingMemory { around, near: found } = memory;
        found.clear();
        let lead = hit.shape.t * f32::EPSILON * path.ray.direction.dot(vertex.normal).abs();
        let meeting = Meeting { hit, surface: &vertex.surface, normal: vertex.normal, lead };
        let sides = self.world.contact(&meeting, around, |near| found.push(near));
        let (before, far) = self.media(&path.medium, found);
        let opaque = found.iter().filter_map(|near| self.opaque(near));
        let opaque = opaque.min_by(|a, b| a.shape.t.total_cmp(&b.shape.t).then(a.object.cmp(&b.object)));
        Crossing { sides, before, far, opaque }
    }

    /// The media before and beyond the near surfaces. The ray's own record gives the medium before; for closed shapes, their
    /// geometry gives the medium beyond. A ray that leaves another body was in it, whatever its record says. Of open bodies only
    /// those count that are left or entered here, so that a ray and its reverse see the same, as the ray's way around the others is
    /// unknown. The first of the media is the one that absorbed on the way here; the first two are `None` if both are as known.
    fn media(&self, known: &Medium, found: &[Near]) -> (Option<[Medium; 2]>, Medium) {
        let is_told_by_record = |glass: Inside| !self.world.is_closed(glass.body);
        // Of closed shapes alone, most hits find at most the one that they enter.
        if !self.world.has_open_glass() {
            match *found {
                [] => return (None, known.retained(is_told_by_record)),
                [Near::Around { object, material }] => {
                    let entered = Inside { body: object, material };
                    return (None, known.retained(is_told_by_record).entered(entered));
                }
                [Near::Surface { .. }] | [_, _, ..] => {}
            }
        }
        // Begin with the record of the ray, without open bodies.
        let (mut arrived, mut near) = (*known, self.without_open(*known));
        let mut far = near.retained(is_told_by_record);
        let crossed = |as_front: bool| {
            found.iter().filter_map(move |thing| match *thing {
                Near::Surface { hit, material, is_front } if is_front == as_front => {
                    let glass = Inside { body: self.world.body(hit.object), material };
                    self.world.is_glass(material).then_some(glass)
                }
                Near::Surface { .. } | Near::Around { .. } => None,
            })
        };
        let around = found.iter().filter_map(|thing| match *thing {
            Near::Around { object, material } => Some(Inside { body: object, material }),
            Near::Surface { .. } => None,
        });
        // Leave the bodies whose backs are here.
        for glass in crossed(false) {
            if self.world.is_open(glass.body) {
                near = near.entered(glass);
                arrived = if arrived.left(glass).is_none() { arrived.entered(glass) } else { arrived };
                continue;
            }
            match far.left(glass) {
                Some(left) => far = left,
                None => (arrived, near) = (arrived.entered(glass), near.entered(glass)),
            }
        }
        // Enter those whose fronts are here, and those around the place.
        let far = crossed(true).chain(around).fold(far, Medium::entered);
        (Some([arrived, near]), far)
    }

    /// The surface that counts between two media, at a hit after [`TileContext::crossing`]. `None` if both are air.
    pub fn boundary(
        &self,
        hit: &Hit,
        [near, far]: [&Medium; 2],
        memory: &CrossingMemory,
    ) -> Option<Boundary> {
        let later = near.glass().max(far.glass())?;
        let own = self.world.material_index(hit) as u32;
        if self.world.body(hit.object) == later.body && self.world.is_glass(own) {
            return Some(Boundary { material: own, hit: None });
        }
        // The path hits another one of the surfaces that touch there.
        let of_body = memory.near.iter().find_map(|thing| match *thing {
            Near::Surface { hit, material, .. } => {
                let is_later = self.world.body(hit.object) == later.body && self.world.is_glass(material);
                is_later.then_some(Boundary { material, hit: Some(hit) })
            }
            Near::Around { .. } => None,
        });
        Some(of_body.unwrap_or(Boundary { material: later.material, hit: None }))
    }

    /// The closed bodies of a medium.
    pub fn without_open(&self, medium: Medium) -> Medium {
        if self.world.has_open_glass() {
            return medium.retained(|glass| !self.world.is_open(glass.body));
        }
        medium
    }

    fn opaque(&self, thing: &Near) -> Option<Hit> {
        match *thing {
            Near::Around { .. } => None,
            Near::Surface { hit, material, .. } => (!self.world.is_glass(material)).then_some(hit),
        }
    }
}
