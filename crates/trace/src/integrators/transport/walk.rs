//! Traces a path to its next interaction: an opaque surface, or a boundary where the index of refraction
//! changes. The code is shared by camera paths and photons. A [`PathStepper`] handles the interaction.
//!
//! Thin panes and stochastically transparent surfaces are null interactions. They change neither the path
//! vertex nor its pdf, just as for shadow rays.

use super::crossing::{CoincidentSurfaceBuffers, InterfaceCrossing};
use super::interface::PASSED;
use super::interiors::{InteriorList, medium_ior, medium_transmittance};
use super::ray::PathRay;
use super::tile::TileContext;
use super::vertex::SurfaceVertex;
use crate::geometry::{Ray, ShapeHit, SurfacePoint};
use crate::integrators::RayCounters;
use crate::materials::{RoughDielectricPoint, ThinDielectric};
use crate::math::Vec3;
use crate::sampling::Dimension;
use crate::world::{Hit, MAX_NULL_INTERACTIONS, OffsetPoints};

/// Maximum number of surfaces that a ray can cross in one walk without a change of medium.
pub const MAX_PASSED_SURFACES: usize = 64;

/// The interaction at which a walk ends.
pub enum ReachedInteraction<'v, 'a> {
    /// An opaque surface, and the medium behind it.
    Opaque(&'v SurfaceVertex<'a>, OpaqueSurfaceHit, &'v InteriorList),
    /// A boundary between media, at a hit on glass.
    Glass(&'v SurfaceVertex<'a>, Hit, MediumInterface<'v>),
    /// The ray leaves the scene.
    Nothing,
    /// The ray has crossed [`MAX_PASSED_SURFACES`] surfaces without a change of medium.
    Hidden,
}

/// A boundary between two media.
#[derive(Clone, Copy)]
pub struct MediumInterface<'v> {
    /// The medium on the far side.
    pub far: &'v InteriorList,
    /// Parameters of a rough boundary, or `None` if the boundary is smooth.
    pub rough: Option<RoughDielectricPoint>,
}

/// Handles the interactions of paths. Implemented by the camera path and photon wavefronts.
pub trait PathStepper<'a> {
    /// Tile context.
    fn tile_context(&self) -> &'a TileContext<'a>;

    /// Buffers for the search for coincident surfaces.
    fn coincident_surface_buffers(&mut self) -> &mut CoincidentSurfaceBuffers;

    /// Records that the path crossed a surface. `next` is the next hit behind the surface.
    fn record_surface_crossing(&mut self, path: &PathRay, next: Option<Hit>);

    /// Handles the interaction that ends a walk. The path contains the incoming ray, in the medium before the
    /// surface, and its throughput includes absorption. `has_passed` is true if the walk crossed any surface
    /// inside glass.
    fn handle_interaction(&mut self, path: &PathRay, reached: ReachedInteraction<'_, 'a>, has_passed: bool);

    /// Texture lookup counter.
    fn texture_lookup_counter(&mut self) -> &mut u64;

    /// Handles a thin pane. The path has the same state as in [`PathStepper::handle_interaction`].
    fn handle_pane(
        &mut self,
        path: &PathRay,
        vertex: &SurfaceVertex<'a>,
        hit: OpaqueSurfaceHit,
        pane: &ThinDielectric,
    ) -> NullInteractionOutcome;
}

/// Outcome at a surface that light may pass through without changing direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NullInteractionOutcome {
    /// The path passes through, and its throughput is multiplied by this factor.
    Passed(Vec3),
    /// The surface is opaque at this point.
    Opaque,
    /// The path ends, or continues in another direction.
    Ended,
}

/// The straight segment from a path's last vertex, across any null interactions.
#[derive(Clone, Copy)]
struct SegmentFromLastVertex {
    /// Position of the last vertex. Only valid if `count` > 0.
    origin: Vec3,
    /// Distance from the last vertex to the origin of the path's current ray.
    distance: f32,
    /// Number of surfaces crossed so far.
    count: u32,
}

impl SegmentFromLastVertex {
    /// The initial segment, before the path has crossed any surface.
    const DIRECT: Self = Self { origin: Vec3::ZERO, distance: 0.0, count: 0 };

    /// Extends the segment across another surface, which the path hits at this distance.
    fn extended_across_surface(self, path: &PathRay, distance: f32) -> Self {
        let origin = if self.count == 0 { path.ray.origin } else { self.origin };
        Self { origin, distance: self.distance + distance, count: self.count + 1 }
    }

    /// Moves the ray origin back to the path's last vertex.
    #[inline(always)]
    fn move_origin_to_last_vertex(&self, path: &mut PathRay) {
        if self.count > 0 {
            path.ray.origin = self.origin;
        }
    }

    /// Moves the ray origin back to the path's last vertex, and returns the hit with the distance from that
    /// vertex.
    #[inline(always)]
    fn rebase_ray_to_last_vertex(&self, path: &mut PathRay, mut hit: Hit) -> Hit {
        self.move_origin_to_last_vertex(path);
        if self.count > 0 {
            hit.shape.t += self.distance;
        }
        hit
    }
}

/// Hit on an opaque surface.
#[derive(Clone, Copy, Debug)]
pub enum OpaqueSurfaceHit {
    /// The ray hits the surface itself.
    Direct(Hit),
    /// The surface is coincident with glass that the ray hits.
    Touching(Hit),
}

/// Walks a path from its ray's hit to the next interaction, updating the path. `surface` is the surface at
/// the hit, if known. Paths and vertices are large, so they are not moved.
#[inline(always)]
pub fn walk_to_interaction<'a, W: PathStepper<'a>>(
    stepper: &mut W,
    path: &mut PathRay,
    (hit, mut surface): (Hit, Option<SurfacePoint>),
) {
    let tile = stepper.tile_context();
    let (mut way, mut hidden, mut next) = (SegmentFromLastVertex::DIRECT, 0, Some(hit));
    loop {
        let has_passed = hidden > 0;
        let Some(hit) = next else {
            way.move_origin_to_last_vertex(path);
            return stepper.handle_interaction(path, ReachedInteraction::Nothing, has_passed);
        };
        if hidden == MAX_PASSED_SURFACES {
            return stepper.handle_interaction(path, ReachedInteraction::Hidden, true);
        }
        let mut vertex = match surface.take() {
            Some(surface) => SurfaceVertex::from_computed_surface(tile, path, &hit, surface),
            None => SurfaceVertex::from_hit_with_needed_attributes(tile, path, &hit),
        };
        // Stop if the surface is opaque. Otherwise, cross it as a null interaction.
        if vertex.material.bsdf.as_dielectric().is_none() {
            path.throughput *= medium_transmittance(tile.world, &path.interiors, hit.shape.t);
            if vertex.material.has_null_interaction() {
                match null_interaction_outcome(stepper, path, &vertex, (way, hit)) {
                    NullInteractionOutcome::Passed(_) if way.count == MAX_NULL_INTERACTIONS => return,
                    NullInteractionOutcome::Passed(part) => {
                        way = way.extended_across_surface(path, hit.shape.t);
                        *path = path_past_surface(*path, &vertex, part);
                        next = tile.world.geometry.closest_hit(&path.ray);
                        stepper.record_surface_crossing(path, next);
                        continue;
                    }
                    NullInteractionOutcome::Ended => return,
                    NullInteractionOutcome::Opaque => {}
                }
            }
            if tile.world.has_open_glass() {
                path.interiors = tile.interiors_without_open_solids(path.interiors);
            }
            let mut far = path.interiors;
            if vertex.material.bsdf.has_non_specular_transmission() && tile.world.has_glass() {
                // The path may be inside glass that touches the surface.
                let crossing =
                    tile.interface_crossing_at_hit(path, &vertex, &hit, stepper.coincident_surface_buffers());
                if let Some([_, near]) = crossing.before {
                    path.interiors = near;
                }
                far = crossing.far;
                vertex.set_offset_points(crossing.sides);
            }
            let hit = way.rebase_ray_to_last_vertex(path, hit);
            return stepper.handle_interaction(
                path,
                ReachedInteraction::Opaque(&vertex, OpaqueSurfaceHit::Direct(hit), &far),
                has_passed,
            );
        }
        // At glass, find all coincident surfaces.
        let InterfaceCrossing { sides, before, far, opaque } =
            tile.interface_crossing_at_hit(path, &vertex, &hit, stepper.coincident_surface_buffers());
        let arrived = before.as_ref().map_or(&path.interiors, |[arrived, _]| arrived);
        path.throughput *= medium_transmittance(tile.world, arrived, hit.shape.t);
        if let Some([_, near]) = before {
            path.interiors = near;
        }
        if let Some(touching) = opaque {
            let vertex = SurfaceVertex::at_coincident_surface(tile, path, (sides, &touching), hit.shape.t);
            if !vertex.material.has_null_interaction()
                || is_stopped_by_coincident_surface(stepper, path, &vertex)
            {
                let touched = Hit { shape: ShapeHit { t: hit.shape.t, ..touching.shape }, ..touching };
                let touched = way.rebase_ray_to_last_vertex(path, touched);
                let reached = ReachedInteraction::Opaque(&vertex, OpaqueSurfaceHit::Touching(touched), &far);
                return stepper.handle_interaction(path, reached, has_passed);
            }
            path.path = path.child_path_number(PASSED);
        }
        // Stop at a boundary between media with different indices of refraction, and at glass that emits.
        let near = &path.interiors;
        let refracts = medium_ior(tile.world, near) != medium_ior(tile.world, &far);
        if near.medium_glass() != far.medium_glass() && (refracts || vertex.emits()) {
            vertex.set_offset_points(sides);
            let rough = if refracts && tile.world.has_rough_glass() {
                rough_dielectric_point(stepper, path, (&vertex, &hit), (sides, &far))
            } else {
                None
            };
            let hit = way.rebase_ray_to_last_vertex(path, hit);
            return stepper.handle_interaction(
                path,
                ReachedInteraction::Glass(&vertex, hit, MediumInterface { far: &far, rough }),
                has_passed,
            );
        }
        // Otherwise, cross the surface.
        (path.interiors, path.ray) = (far, Ray::new(sides.beyond, path.ray.direction));
        path.state = path.state.after_crossing_inside_glass();
        path.cone = path.cone.propagated_by(hit.shape.t);
        (way, hidden) = (SegmentFromLastVertex::DIRECT, hidden + 1);
        next = tile.world.geometry.closest_hit(&path.ray);
        stepper.record_surface_crossing(path, next);
    }
}

/// Rough surface between two media with different indices of refraction, or `None` if the surface is smooth.
#[cold]
#[inline(never)]
fn rough_dielectric_point<'a, W: PathStepper<'a>>(
    stepper: &mut W,
    path: &PathRay,
    (vertex, hit): (&SurfaceVertex<'a>, &Hit),
    (sides, far): (OffsetPoints, &InteriorList),
) -> Option<RoughDielectricPoint> {
    let tile = stepper.tile_context();
    let interior_lists = [&path.interiors, far];
    let indices = interior_lists.map(|interiors| medium_ior(tile.world, interiors));
    let boundary = tile.glass_interface_at_hit(hit, interior_lists, stepper.coincident_surface_buffers())?;
    let glass = tile.world.materials[boundary.material as usize].bsdf.as_dielectric()?;
    let touching = boundary.hit.filter(|_| glass.roughness.texture().is_some());
    let touching =
        touching.map(|other| SurfaceVertex::at_coincident_surface(tile, path, (sides, &other), hit.shape.t));
    let at = touching.as_ref().map_or(&vertex.texture_point, |other| &other.texture_point);
    let alpha = glass.alpha(at, stepper.texture_lookup_counter())?;
    let [near, far] = indices;
    Some(RoughDielectricPoint { near, far, alpha, distribution: glass.distribution })
}

/// Determines whether a path passes straight through a surface that may be a null interaction.
#[cold]
#[inline(never)]
fn null_interaction_outcome<'a, W: PathStepper<'a>>(
    stepper: &mut W,
    path: &PathRay,
    vertex: &SurfaceVertex<'a>,
    (way, hit): (SegmentFromLastVertex, Hit),
) -> NullInteractionOutcome {
    if !is_stochastically_opaque(stepper.tile_context(), path, vertex, stepper.texture_lookup_counter()) {
        return NullInteractionOutcome::Passed(Vec3::ONE);
    }
    let Some(pane) = vertex.material.bsdf.as_thin_dielectric() else { return NullInteractionOutcome::Opaque };
    let mut whole = *path;
    let hit = way.rebase_ray_to_last_vertex(&mut whole, hit);
    whole.interiors = stepper.tile_context().interiors_without_open_solids(whole.interiors);
    stepper.handle_pane(&whole, vertex, OpaqueSurfaceHit::Direct(hit), pane)
}

/// Whether a partially transparent surface coincident with glass stops a path. Thin panes on glass have no
/// effect.
#[cold]
#[inline(never)]
fn is_stopped_by_coincident_surface<'a, W: PathStepper<'a>>(
    stepper: &mut W,
    path: &PathRay,
    vertex: &SurfaceVertex<'a>,
) -> bool {
    vertex.material.bsdf.as_thin_dielectric().is_none()
        && is_stochastically_opaque(stepper.tile_context(), path, vertex, stepper.texture_lookup_counter())
}

/// Opacity of the surface at a vertex. If light samples compete with the path, the texture is looked up
/// without filtering, as for shadow rays.
pub fn opacity_at_path_vertex(path: &PathRay, vertex: &SurfaceVertex<'_>, lookups: &mut u64) -> f32 {
    let Some(opacity) = &vertex.material.opacity else { return 1.0 };
    let is_shared = path.state.pdf > 0.0;
    let at = vertex.texture_lookup_point(is_shared);
    opacity.evaluate(&at, lookups)
}

/// Randomly decides whether the surface is opaque at this vertex, with a probability equal to its opacity.
fn is_stochastically_opaque(
    tile: &TileContext<'_>,
    path: &PathRay,
    vertex: &SurfaceVertex<'_>,
    lookups: &mut u64,
) -> bool {
    let chance = opacity_at_path_vertex(path, vertex, lookups);
    chance >= 1.0 || tile.sampler_for_slot(path.slot).pair(path.path, Dimension::Opacity).x < chance
}

/// Path after a null interaction.
fn path_past_surface(path: PathRay, vertex: &SurfaceVertex<'_>, part: Vec3) -> PathRay {
    PathRay {
        ray: vertex.spawn_ray(path.ray.direction),
        throughput: path.throughput * part,
        path: path.child_path_number(PASSED),
        state: path.state.after_null_interaction(part.max_element()),
        cone: vertex.cone,
        ..path
    }
}

impl TileContext<'_> {
    /// Returns the first opaque hit along a camera ray, starting with `hit`, and the path that reaches it, or
    /// `None` if there is no opaque hit.
    pub fn first_opaque_path_and_hit(
        &self,
        path: &PathRay,
        hit: &Hit,
        counters: &mut RayCounters,
    ) -> Option<(PathRay, Hit)> {
        let (mut path, mut hit) = (*path, *hit);
        for _ in 0..=MAX_NULL_INTERACTIONS {
            let vertex = SurfaceVertex::from_hit_with_needed_attributes(self, &path, &hit);
            if is_stochastically_opaque(self, &path, &vertex, &mut counters.texture_lookups) {
                return Some((path, hit));
            }
            path = path_past_surface(path, &vertex, Vec3::ONE);
            hit = self.world.geometry.closest_hit(&path.ray)?;
        }
        None
    }

    /// Randomly chooses between reflection and refraction. `reflectance` is the probability of reflection.
    #[inline]
    pub fn chooses_reflection(&self, path: &PathRay, reflectance: f32) -> bool {
        self.sampler_for_slot(path.slot).pair(path.path, Dimension::Fresnel).x < reflectance
    }
}
