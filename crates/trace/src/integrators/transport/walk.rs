//! Walk of a ray to the first surface where the glass around it changes, or which is opaque. Paths from the eye and photons walk
//! alike; a [`Walker`] decides what happens at that surface.

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

/// Surface at which a walk ends.
pub enum Reached<'v, 'a> {
    /// An opaque surface.
    Opaque(&'v Vertex<'a>, OpaqueHit),
    /// A change of glass, and the medium beyond it.
    Glass(&'v Vertex<'a>, Medium),
    /// None: the ray leaves the scene.
    Nothing,
    /// One more surface within glass, after [`MOST_HIDDEN`] of them.
    Hidden,
}

/// Owner of walking paths: the wavefront of the eye, or that of the photons.
pub trait Walker<'a> {
    /// Context of the tile.
    fn tile(&self) -> &'a TileContext<'a>;

    /// Memory for the surfaces near a hit of glass.
    fn crossing(&mut self) -> &mut CrossingMemory;

    /// Takes note of a surface that changed nothing: the path goes on behind it, to the next hit.
    fn pass(&mut self, path: &PathRay, next: Option<Hit>);

    /// Goes on where the walk ends. The path's ray is the one that arrives, in the medium before the surface, with the absorption on
    /// the way in its throughput. `has_passed` tells whether any surface was passed.
    fn reach(&mut self, path: &PathRay, reached: Reached<'_, 'a>, has_passed: bool);
}

/// Hit of an opaque surface.
#[derive(Clone, Copy, Debug)]
pub enum OpaqueHit {
    /// The ray hits it.
    Own(Hit),
    /// It touches the glass that the ray hits with it.
    Touching(Hit),
}

/// Walks from the hit of a path's ray; `surface` is that of the hit, if it is known. No vertex is moved, as vertices are large.
#[inline(always)]
pub fn walk<'a, W: Walker<'a>>(
    walker: &mut W,
    mut path: PathRay,
    (mut hit, mut surface): (Hit, Option<SurfacePoint>),
) {
    let tile = walker.tile();
    for number in 0..MOST_HIDDEN {
        let has_passed = number > 0;
        let mut vertex = match surface.take() {
            Some(surface) => Vertex::on(tile, &path, &hit, surface),
            None => Vertex::to_shade(tile, &path, &hit),
        };
        // Stop at an opaque surface.
        if vertex.material.bsdf.glass().is_none() {
            path.throughput *= absorption(tile.world, path.medium, hit.shape.t);
            path.medium = tile.without_open(path.medium);
            return walker.reach(&path, Reached::Opaque(&vertex, OpaqueHit::Own(hit)), has_passed);
        }
        // At glass, find all surfaces that touch here.
        let Crossing { sides, arrived, near, far, opaque } =
            tile.crossing(&path, &vertex, &hit, walker.crossing());
        path.throughput *= absorption(tile.world, arrived, hit.shape.t);
        path.medium = near;
        if let Some(touching) = opaque {
            let vertex = Vertex::touching(tile, &path, (sides, &touching), hit.shape.t);
            let touched = Hit { shape: ShapeHit { t: hit.shape.t, ..touching.shape }, ..touching };
            return walker.reach(&path, Reached::Opaque(&vertex, OpaqueHit::Touching(touched)), has_passed);
        }
        // Stop at a change of glass.
        if near.glass() != far.glass() {
            vertex.start_between(sides);
            return walker.reach(&path, Reached::Glass(&vertex, far), has_passed);
        }
        // Pass on, as nothing changes here.
        (path.medium, path.ray) = (far, Ray::new(sides.beyond, path.ray.direction));
        path.state = path.state.hidden();
        path.cone = path.cone.after(hit.shape.t);
        let next = tile.world.geometry.closest(&path.ray);
        walker.pass(&path, next);
        match next {
            Some(next) => hit = next,
            None => return walker.reach(&path, Reached::Nothing, true),
        }
    }
    walker.reach(&path, Reached::Hidden, true);
}

impl TileContext<'_> {
    /// Whether chance chooses reflection, which has this probability, at a path's vertex.
    #[inline]
    pub fn chooses_reflection(&self, path: &PathRay, reflectance: f32) -> bool {
        self.sampler(path.slot).pair(path.path, Decision::Choice).x < reflectance
    }
}
