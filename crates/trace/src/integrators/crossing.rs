//! What a ray crosses where it meets glass: all surfaces that touch there at once, and with them from one medium to another.

use super::medium::{Inside, Medium};
use super::queues::PathRay;
use super::shot::Shot;
use super::vertices::Vertex;
use crate::world::{Hit, Meeting, Near, NearMemory, Sides};

/// What a ray crosses at a hit of glass.
pub struct Crossing {
    /// Where rays that leave start.
    pub sides: Sides,
    /// The glass that the ray came through.
    pub arrived: Medium,
    /// The glass on the side that the ray comes from.
    pub near: Medium,
    /// The glass on the other side.
    pub far: Medium,
    /// A surface there that nothing passes, as the ray between the sides meets it.
    pub opaque: Option<Hit>,
}

/// Memory for what is near.
#[derive(Default)]
pub struct CrossingMemory {
    around: NearMemory,
    near: Vec<Near>,
}

impl Shot<'_> {
    /// What a ray crosses at a hit of glass.
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
        let meeting = Meeting { hit: *hit, surface: vertex.surface, normal: vertex.normal, lead };
        let sides = self.world.contact(&meeting, around, |near| found.push(near));
        let [arrived, near, far] = self.media(path.medium, found);
        let opaque = found.iter().filter_map(|near| self.opaque(near));
        let opaque = opaque.min_by(|a, b| a.shape.t.total_cmp(&b.shape.t).then(a.object.cmp(&b.object)));
        Crossing { sides, arrived, near, far, opaque }
    }

    /// The media before and beyond what is near. Before it is what the ray knows; of closed shapes, beyond it is what is there. A
    /// ray that leaves another one was in it, whatever it knows. Of open bodies those alone count that are left or entered here, so
    /// that a ray and the one back see the same: nobody knows which way around the others the ray came. The first of the media is
    /// the one that absorbed on the way here.
    fn media(&self, known: Medium, found: &[Near]) -> [Medium; 3] {
        let (mut arrived, mut near) = (known, self.without_open(known));
        let mut far = near.retained(|glass| !self.world.is_closed(glass.body));
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
        let far = crossed(true).chain(around).fold(far, Medium::entered);
        [arrived, near, far]
    }

    /// What of a medium is of closed bodies.
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
