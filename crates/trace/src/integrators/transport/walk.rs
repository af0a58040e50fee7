//! Walk of a ray through changes between parts of one glass, up to the first surface that is more than that. Paths from the eye
//! and photons walk alike; each decides by itself what it leaves at the surface, and how it goes on.

use super::crossing::{Crossing, CrossingMemory};
use super::medium::{Medium, absorption};
use super::ray::PathRay;
use super::tile::TileContext;
use super::vertex::Vertex;
use crate::geometry::{Ray, ShapeHit, SurfacePoint};
use crate::sampling::Decision;
use crate::world::Hit;

/// Most surfaces without a change of glass that a ray passes in one walk.
pub const MOST_HIDDEN: usize = 64;

/// A walk that has ended.
pub struct Walk<'a> {
    /// The path with the ray that arrives, in the medium before the surface, after absorption by glass on the way.
    pub path: PathRay,
    /// Place to which it came.
    pub reached: Reached<'a>,
    /// Whether it passed any surface before.
    pub has_passed: bool,
}

/// Place to which a walk came.
pub enum Reached<'a> {
    /// An opaque surface.
    Opaque(Vertex<'a>, OpaqueHit),
    /// A change of glass, and the medium beyond it.
    Glass(Vertex<'a>, Medium),
    /// Nothing: the ray leaves the scene.
    Nothing,
    /// One more surface within glass, after [`MOST_HIDDEN`] of them.
    Hidden,
}

/// Hit of an opaque surface.
#[derive(Clone, Copy, Debug)]
pub enum OpaqueHit {
    /// The ray hits it.
    Own(Hit),
    /// It touches the glass that the ray hits with it.
    Touching(Hit),
}

impl<'a> TileContext<'a> {
    /// Walks from the hit of a path's ray; `surface` is that of the hit, if it is known. `passed` gets the path after each surface
    /// that it passes, with its next hit.
    // Inlined, as vertices are large to move.
    #[inline(always)]
    pub fn walk(
        &self,
        mut path: PathRay,
        (mut hit, mut surface): (Hit, Option<SurfacePoint>),
        crossing: &mut CrossingMemory,
        mut passed: impl FnMut(&PathRay, Option<Hit>),
    ) -> Walk<'a> {
        for number in 0..MOST_HIDDEN {
            let has_passed = number > 0;
            let vertex = match surface.take() {
                Some(surface) => Vertex::on(self, &path, &hit, surface),
                None => Vertex::to_shade(self, &path, &hit),
            };
            // Stop at an opaque surface.
            if vertex.material.bsdf.glass().is_none() {
                path.throughput *= absorption(self.world, path.medium, hit.shape.t);
                path.medium = self.without_open(path.medium);
                let reached = Reached::Opaque(vertex, OpaqueHit::Own(hit));
                return Walk { path, reached, has_passed };
            }
            // At glass, find all surfaces that touch here.
            let Crossing { sides, arrived, near, far, opaque } =
                self.crossing(&path, &vertex, &hit, crossing);
            path.throughput *= absorption(self.world, arrived, hit.shape.t);
            path.medium = near;
            if let Some(touching) = opaque {
                let vertex = Vertex::touching(self, &path, (sides, &touching), hit.shape.t);
                let touched = Hit { shape: ShapeHit { t: hit.shape.t, ..touching.shape }, ..touching };
                let reached = Reached::Opaque(vertex, OpaqueHit::Touching(touched));
                return Walk { path, reached, has_passed };
            }
            // Stop at a change of glass.
            if near.glass() != far.glass() {
                return Walk { path, reached: Reached::Glass(vertex.between(sides), far), has_passed };
            }
            // Pass on, as nothing changes here.
            (path.medium, path.ray) = (far, Ray::new(sides.beyond, path.ray.direction));
            path.state = path.state.hidden();
            path.cone = path.cone.after(hit.shape.t);
            let next = self.world.geometry.closest(&path.ray);
            passed(&path, next);
            match next {
                Some(next) => hit = next,
                None => return Walk { path, reached: Reached::Nothing, has_passed: true },
            }
        }
        Walk { path, reached: Reached::Hidden, has_passed: true }
    }

    /// Whether chance chooses reflection, which has this probability, at a path's vertex.
    #[inline]
    pub fn chooses_reflection(&self, path: &PathRay, reflectance: f32) -> bool {
        self.sampler(path.slot).pair(path.path, Decision::Choice).x < reflectance
    }
}
