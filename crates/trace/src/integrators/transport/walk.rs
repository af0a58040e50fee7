//! Walk of a ray to the first surface where the index of refraction around it changes, or which is opaque and there. Paths from
//! the eye and photons walk alike; a [`Walker`] decides what happens at that surface.
//!
//! Thin panes, and surfaces that chance leaves out by their opacity, are passed straight on: to what it meets there, the path comes
//! from its last vertex, as shadow rays do.

use super::crossing::{Crossing, CrossingMemory};
use super::interface::STRAIGHT;
use super::medium::{Medium, absorption, ior};
use super::ray::PathRay;
use super::tile::TileContext;
use super::vertex::Vertex;
use crate::geometry::{Ray, ShapeHit, SurfacePoint};
use crate::integrators::RayCounters;
use crate::materials::{Bsdf, GlassPoint, Pane};
use crate::math::Vec3;
use crate::sampling::Decision;
use crate::world::{Hit, MOST_STRAIGHT, Sides};

/// Most surfaces without a change of glass that a ray passes in one walk.
pub const MOST_HIDDEN: usize = 64;

/// Surface at which a walk ends.
pub enum Reached<'v, 'a> {
    /// An opaque surface, and the medium beyond it.
    Opaque(&'v Vertex<'a>, OpaqueHit, &'v Medium),
    /// A change of glass at a hit.
    Glass(&'v Vertex<'a>, Hit, Change<'v>),
    /// None: the ray leaves the scene.
    Nothing,
    /// One more surface within glass, after [`MOST_HIDDEN`] of them.
    Hidden,
}

/// Change of glass at a surface.
#[derive(Clone, Copy)]
pub struct Change<'v> {
    /// The medium beyond it.
    pub far: &'v Medium,
    /// The rough surface there. `None` if it is smooth.
    pub rough: Option<GlassPoint>,
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

    /// Number of texture look-ups, to be added to.
    fn lookups(&mut self) -> &mut u64;

    /// Goes on at a thin pane. The path is as for [`Walker::reach`].
    fn meet_pane(&mut self, path: &PathRay, vertex: &Vertex<'a>, hit: OpaqueHit, pane: &Pane) -> Straight;
}

/// Continuation of a path at a surface that light may pass straight on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Straight {
    /// It passes, with this factor on its throughput.
    Passes(Vec3),
    /// The surface is there.
    Stays,
    /// It ends, or goes on elsewhere.
    Ends,
}

/// Way of a path since its last vertex, if it passed surfaces straight on.
#[derive(Clone, Copy)]
struct Way {
    /// The last vertex, if there are any surfaces.
    origin: Vec3,
    /// Distance of the path's current ray from it.
    distance: f32,
    /// Number of the surfaces.
    count: u32,
}

impl Way {
    /// The way of a path that has passed nothing yet.
    const DIRECT: Self = Self { origin: Vec3::ZERO, distance: 0.0, count: 0 };

    /// The way behind one more surface, which the path meets at a distance.
    fn behind(self, path: &PathRay, distance: f32) -> Self {
        let origin = if self.count == 0 { path.ray.origin } else { self.origin };
        Self { origin, distance: self.distance + distance, count: self.count + 1 }
    }

    /// Makes the path one that comes from its last vertex without a stop; returns its hit.
    #[inline(always)]
    fn straighten(&self, path: &mut PathRay, mut hit: Hit) -> Hit {
        if self.count > 0 {
            path.ray.origin = self.origin;
            hit.shape.t += self.distance;
        }
        hit
    }
}

/// Hit of an opaque surface.
#[derive(Clone, Copy, Debug)]
pub enum OpaqueHit {
    /// The ray hits it.
    Own(Hit),
    /// It touches the glass that the ray hits with it.
    Touching(Hit),
}

/// Walks from the hit of a path's ray, which takes the path along; `surface` is that of the hit, if it is known. No path and no
/// vertex is moved, as they are large.
#[inline(always)]
pub fn walk<'a, W: Walker<'a>>(
    walker: &mut W,
    path: &mut PathRay,
    (mut hit, mut surface): (Hit, Option<SurfacePoint>),
) {
    let tile = walker.tile();
    let (mut way, mut hidden) = (Way::DIRECT, 0);
    while hidden < MOST_HIDDEN {
        let has_passed = hidden > 0;
        let mut vertex = match surface.take() {
            Some(surface) => Vertex::on(tile, path, &hit, surface),
            None => Vertex::to_shade(tile, path, &hit),
        };
        // Stop at an opaque surface, or pass it straight on.
        if vertex.material.bsdf.glass().is_none() {
            path.throughput *= absorption(tile.world, &path.medium, hit.shape.t);
            if vertex.material.lets_pass() {
                match straight(walker, path, &vertex, (way, hit)) {
                    Straight::Passes(_) if way.count == MOST_STRAIGHT => return,
                    Straight::Passes(part) => {
                        way = way.behind(path, hit.shape.t);
                        *path = passed(*path, &vertex, part);
                        match tile.world.geometry.closest(&path.ray) {
                            Some(next) => {
                                walker.pass(path, Some(next));
                                hit = next;
                                continue;
                            }
                            None => {
                                walker.pass(path, None);
                                path.ray.origin = way.origin;
                                return walker.reach(path, Reached::Nothing, has_passed);
                            }
                        }
                    }
                    Straight::Ends => return,
                    Straight::Stays => {}
                }
            }
            if tile.world.has_open_glass() {
                path.medium = tile.without_open(path.medium);
            }
            let mut far = path.medium;
            if vertex.material.bsdf.lets_through() && tile.world.has_glass() {
                // Light may come out of glass that touches it.
                let crossing = tile.crossing(path, &vertex, &hit, walker.crossing());
                if let Some([_, near]) = crossing.before {
                    path.medium = near;
                }
                far = crossing.far;
                vertex.start_between(crossing.sides);
            }
            let hit = way.straighten(path, hit);
            return walker.reach(path, Reached::Opaque(&vertex, OpaqueHit::Own(hit), &far), has_passed);
        }
        // At glass, find all surfaces that touch here.
        let Crossing { sides, before, far, opaque } = tile.crossing(path, &vertex, &hit, walker.crossing());
        let arrived = before.as_ref().map_or(&path.medium, |[arrived, _]| arrived);
        path.throughput *= absorption(tile.world, arrived, hit.shape.t);
        if let Some([_, near]) = before {
            path.medium = near;
        }
        if let Some(touching) = opaque {
            let vertex = Vertex::touching(tile, path, (sides, &touching), hit.shape.t);
            if !vertex.material.lets_pass() || is_touched(walker, path, &vertex) {
                let touched = Hit { shape: ShapeHit { t: hit.shape.t, ..touching.shape }, ..touching };
                let touched = way.straighten(path, touched);
                let reached = Reached::Opaque(&vertex, OpaqueHit::Touching(touched), &far);
                return walker.reach(path, reached, has_passed);
            }
            path.path = path.next_path(STRAIGHT);
        }
        // Stop at a change of glass, if both sides refract differently.
        let near = &path.medium;
        if near.glass() != far.glass() && ior(tile.world, near) != ior(tile.world, &far) {
            vertex.start_between(sides);
            let rough = if tile.world.has_rough_glass() {
                rough(walker, path, (&vertex, &hit), (sides, &far))
            } else {
                None
            };
            let hit = way.straighten(path, hit);
            return walker.reach(path, Reached::Glass(&vertex, hit, Change { far: &far, rough }), has_passed);
        }
        // Pass on, as nothing changes here.
        (path.medium, path.ray) = (far, Ray::new(sides.beyond, path.ray.direction));
        path.state = path.state.hidden();
        path.cone = path.cone.after(hit.shape.t);
        (way, hidden) = (Way::DIRECT, hidden + 1);
        let next = tile.world.geometry.closest(&path.ray);
        walker.pass(path, next);
        match next {
            Some(next) => hit = next,
            None => return walker.reach(path, Reached::Nothing, true),
        }
    }
    walker.reach(path, Reached::Hidden, true);
}

/// The rough surface between a path's medium and that beyond a hit, which refract differently. `None` if it is smooth.
#[cold]
#[inline(never)]
fn rough<'a, W: Walker<'a>>(
    walker: &mut W,
    path: &PathRay,
    (vertex, hit): (&Vertex<'a>, &Hit),
    (sides, far): (Sides, &Medium),
) -> Option<GlassPoint> {
    let tile = walker.tile();
    let media = [&path.medium, far];
    let indices = media.map(|medium| ior(tile.world, medium));
    let boundary = tile.boundary(hit, media, walker.crossing())?;
    let glass = tile.world.materials[boundary.material as usize].bsdf.glass()?;
    let touching = boundary.hit.filter(|_| glass.roughness.texture().is_some());
    let touching = touching.map(|other| Vertex::touching(tile, path, (sides, &other), hit.shape.t));
    let at = touching.as_ref().map_or(&vertex.texture_point, |other| &other.texture_point);
    let alpha = glass.alpha(at, walker.lookups())?;
    Some(GlassPoint { near: indices[0], far: indices[1], alpha })
}

/// Continuation of a path at a surface that light may pass.
#[cold]
#[inline(never)]
fn straight<'a, W: Walker<'a>>(
    walker: &mut W,
    path: &PathRay,
    vertex: &Vertex<'a>,
    (way, hit): (Way, Hit),
) -> Straight {
    if !is_there(walker.tile(), path, vertex, walker.lookups()) {
        return Straight::Passes(Vec3::ONE);
    }
    match &vertex.material.bsdf {
        Bsdf::Pane(pane) => {
            let mut whole = *path;
            let hit = way.straighten(&mut whole, hit);
            whole.medium = walker.tile().without_open(whole.medium);
            walker.meet_pane(&whole, vertex, OpaqueHit::Own(hit), pane)
        }
        Bsdf::Rough(_) | Bsdf::Mirror(_) | Bsdf::Glass(_) | Bsdf::Coated(_) => Straight::Stays,
    }
}

/// Whether a surface that touches glass, and which light may pass, stops a path. Panes add nothing to the glass.
#[cold]
#[inline(never)]
fn is_touched<'a, W: Walker<'a>>(walker: &mut W, path: &PathRay, vertex: &Vertex<'a>) -> bool {
    match &vertex.material.bsdf {
        Bsdf::Pane(_) => false,
        Bsdf::Rough(_) | Bsdf::Mirror(_) | Bsdf::Glass(_) | Bsdf::Coated(_) => {
            is_there(walker.tile(), path, vertex, walker.lookups())
        }
    }
}

/// The chance that the surface is there. For paths that share their lamps with light samples, it is what these find: that of the
/// point.
pub fn chance(path: &PathRay, vertex: &Vertex<'_>, lookups: &mut u64) -> f32 {
    let Some(opacity) = &vertex.material.opacity else { return 1.0 };
    let is_shared = path.state.density > 0.0;
    let at = vertex.place(is_shared);
    opacity.at(&at, lookups)
}

/// Whether chance puts the surface there.
fn is_there(tile: &TileContext<'_>, path: &PathRay, vertex: &Vertex<'_>, lookups: &mut u64) -> bool {
    let chance = chance(path, vertex, lookups);
    chance >= 1.0 || tile.sampler(path.slot).pair(path.path, Decision::Opacity).x < chance
}

/// The path behind a surface that it passed straight on.
fn passed(path: PathRay, vertex: &Vertex<'_>, part: Vec3) -> PathRay {
    PathRay {
        ray: vertex.leaving(path.ray.direction),
        throughput: path.throughput * part,
        path: path.next_path(STRAIGHT),
        state: path.state.straight(part.max_element()),
        cone: vertex.cone,
        ..path
    }
}

impl TileContext<'_> {
    /// The first surface that is there along a camera ray from its hit on, with the ray's path. `None` if there is none.
    pub fn first_there(
        &self,
        path: &PathRay,
        hit: &Hit,
        counters: &mut RayCounters,
    ) -> Option<(PathRay, Hit)> {
        let (mut path, mut hit) = (*path, *hit);
        for _ in 0..=MOST_STRAIGHT {
            let vertex = Vertex::to_shade(self, &path, &hit);
            if is_there(self, &path, &vertex, &mut counters.texture_lookups) {
                return Some((path, hit));
            }
            path = passed(path, &vertex, Vec3::ONE);
            hit = self.world.geometry.closest(&path.ray)?;
        }
        None
    }

    /// Whether chance chooses reflection, which has this probability, at a path's vertex.
    #[inline]
    pub fn chooses_reflection(&self, path: &PathRay, reflectance: f32) -> bool {
        self.sampler(path.slot).pair(path.path, Decision::Choice).x < reflectance
    }
}
