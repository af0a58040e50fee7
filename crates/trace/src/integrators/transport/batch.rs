//! Vertices that wait for direct light, sixteen side by side.

use super::tile::TileContext;
use super::vertex::{Lift, ShadingVertex};
use crate::geometry::Ray;
use crate::geometry::rows::lanes;
use crate::integrators::view::{Measure, Parts};
use crate::materials::bsdf::{BsdfValues, Place};
use crate::materials::{BsdfRow, RoughKind};
use crate::math::Vec3;
use crate::math::lanes::{Folds, LANES, Lanes, Lanes3, TRUE, lane, set_lane, truths};
use crate::sampling::SamplerRow;
use crate::scene::description::Shadows;

/// Vertices to be lit.
#[derive(Clone)]
pub struct VertexBatch {
    /// A bit for each lane with a vertex.
    pub used: u32,
    /// Origins of light samples and shadow rays.
    pub from: Lanes3,
    /// Triangles at the origins, for [`VertexBatch::starts`].
    pub start: [u32; LANES],
    /// Horizon normals: nothing behind them is visible, in the lanes whose bits are set.
    pub horizon: Lanes3,
    pub is_bounded: u32,
    /// Points above the facets that see lights in all directions, if nothing is on the way to the points, in the lanes whose
    /// bits are set; with the ends of these ways.
    pub lifted: Lanes3,
    pub lift_end: Lanes,
    pub may_lift: u32,
    /// Points of the surfaces and normals of their facets on the viewer's side, in the lanes whose bits are set; in other lanes
    /// these are `from` and `normal`.
    pub point: Lanes3,
    /// [`VertexBatch::point`].
    pub facet: Lanes3,
    /// [`VertexBatch::point`].
    pub has_facet: u32,
    /// A bit for each vertex that the camera sees, directly or by mirrors and glass.
    pub only_specular_before: u32,
    /// A bit for each vertex whose path comes from a surface with a glossy lobe.
    pub after_gloss: u32,
    /// Normals for the cosines.
    pub normal: Lanes3,
    /// Normals before a relief bent them, and the cosine between both; [`UNBENT`] without a relief.
    pub smooth_normal: Lanes3,
    pub bend: Lanes,
    /// BSDFs, all of one kind.
    pub bsdf: BsdfRow,
    /// Throughput of the paths.
    pub throughput: Lanes3,
    /// Slots of the paths.
    pub slot: [u32; LANES],
    /// Numbers of the paths.
    pub path: [u32; LANES],
    /// Places of the paths in the round's queue.
    pub place: [u32; LANES],
    /// [`PathState::roulette_throughput`](super::ray::PathState::roulette_throughput) of the paths.
    pub roulette_throughput: Lanes,
    /// Indices of the glass around the vertices.
    pub medium: [u32; LANES],
    /// Whether any vertex has a bent normal.
    pub is_bent: bool,
    /// Whether light samples find nothing from any vertex.
    pub is_dark: bool,
    /// Whether the vertices stand for both sides of their surfaces.
    pub has_two_sides: bool,
    /// Origins of rays on the other side, and indices of the glass around these, if it has two sides.
    pub beyond: Lanes3,
    /// [`VertexBatch::beyond`].
    pub medium_beyond: [u32; LANES],
}

/// Value in place of the cosine between two equal normals.
pub const UNBENT: f32 = -2.0;

impl VertexBatch {
    /// Least α of lobes that are worth rays of their own under any light.
    const SHARP: f32 = 100.0;

    /// Least ratio of the width of light from beyond the scene to that of a lobe, for which the lobe is worth rays of
    /// its own too.
    const FILLED: f32 = 1.5;

    /// A bit for each vertex whose highlights of lamps are too rare for light samples alone.
    pub fn sharp(&self, tile: &TileContext<'_>, measure: Measure) -> u32 {
        let shows = match measure {
            Measure::Radiance(Parts { specular, .. }) => specular,
            Measure::ArrivingShare => false,
            Measure::Work => true,
        };
        let is_soft = tile.settings.render.shadows == Shadows::Soft;
        if !(self.bsdf.has_narrow_lobes() && shows && is_soft && tile.world.lights.can_be_found()) {
            return 0;
        }
        // A lobe is about as wide as 2π/(α + 1) sr.
        let filled = Self::FILLED * std::f32::consts::TAU / tile.world.lights.extent_beyond() - 1.0;
        let least = filled.min(Self::SHARP);
        self.bsdf.narrower_than(self.used, least)
    }

    /// The random numbers of the vertices.
    #[inline(always)]
    pub fn sampler(&self, tile: &TileContext<'_>) -> SamplerRow<LANES> {
        let (block, slots) = (tile.block, &self.slot);
        let mut is_run = true;
        for i in 0..LANES {
            is_run &= slots[i] == slots[0] + i as u32;
        }
        let (xs, ys, samples) = if is_run { block.places(slots[0]) } else { block.places_of(slots) };
        SamplerRow::new(tile.settings.render.seed, &xs, &ys, &samples)
    }

    /// A row without vertices.
    pub const EMPTY: Self = Self {
        used: 0,
        from: [[0.0; LANES]; 3],
        start: [Ray::NO_TRIANGLE; LANES],
        horizon: [[0.0; LANES]; 3],
        is_bounded: 0,
        lifted: [[0.0; LANES]; 3],
        lift_end: [0.0; LANES],
        may_lift: 0,
        point: [[0.0; LANES]; 3],
        facet: [[0.0; LANES]; 3],
        has_facet: 0,
        only_specular_before: 0,
        after_gloss: 0,
        normal: [[0.0; LANES]; 3],
        smooth_normal: [[0.0; LANES]; 3],
        bend: [UNBENT; LANES],
        bsdf: BsdfRow::EMPTY,
        throughput: [[0.0; LANES]; 3],
        slot: [0; LANES],
        path: [0; LANES],
        place: [0; LANES],
        roulette_throughput: [0.0; LANES],
        medium: [0; LANES],
        is_bent: false,
        is_dark: false,
        has_two_sides: false,
        beyond: [[0.0; LANES]; 3],
        medium_beyond: [0; LANES],
    };

    /// Prepares the row for other vertices, with normals as they are.
    #[inline(always)]
    pub fn reset(&mut self) {
        (self.used, self.is_bounded, self.may_lift) = (0, 0, 0);
        (self.has_facet, self.only_specular_before, self.after_gloss) = (0, 0, 0);
        (self.is_bent, self.is_dark, self.has_two_sides) = (false, false, false);
        self.bsdf.reset();
        self.bend = [UNBENT; LANES];
    }

    /// Whether it has vertices of this kind, dark ones or others, with two sides or one.
    #[inline(always)]
    pub fn is_for(&self, kind: RoughKind, (is_dark, has_two_sides): (bool, bool)) -> bool {
        self.bsdf.kind() == kind && self.is_dark == is_dark && self.has_two_sides == has_two_sides
    }

    /// Keeps these vertices only.
    pub fn keep(&mut self, these: u32) {
        let Self { used, is_bounded, may_lift, has_facet, only_specular_before, after_gloss, .. } = self;
        for bits in [used, is_bounded, may_lift, has_facet, only_specular_before, after_gloss] {
            *bits &= these;
        }
    }

    /// Takes a vertex of another row, whose BSDFs are of the same kind; neither has two sides.
    pub fn copy(&mut self, i: usize, other: &Self, from: usize) {
        for (own, other) in [
            (&mut self.from, &other.from),
            (&mut self.horizon, &other.horizon),
            (&mut self.lifted, &other.lifted),
            (&mut self.point, &other.point),
            (&mut self.facet, &other.facet),
            (&mut self.normal, &other.normal),
            (&mut self.smooth_normal, &other.smooth_normal),
            (&mut self.throughput, &other.throughput),
        ] {
            set_lane(own, i, lane(other, from));
        }
        self.bsdf.copy(i, &other.bsdf, from);
        self.bend[i] = other.bend[from];
        (self.roulette_throughput[i], self.medium[i]) = (other.roulette_throughput[from], other.medium[from]);
        (self.slot[i], self.path[i], self.place[i]) = (other.slot[from], other.path[from], other.place[from]);
        self.start[i] = other.start[from];
        self.is_bent |= other.is_bent;
        self.is_bounded |= (other.is_bounded >> from & 1) << i;
        self.lift_end[i] = other.lift_end[from];
        self.may_lift |= (other.may_lift >> from & 1) << i;
        self.has_facet |= (other.has_facet >> from & 1) << i;
        self.only_specular_before |= (other.only_specular_before >> from & 1) << i;
        self.after_gloss |= (other.after_gloss >> from & 1) << i;
        self.used |= 1 << i;
    }

    /// Sets a vertex, whose BSDF is of the row's kind.
    pub fn put(
        &mut self,
        i: usize,
        tile: &TileContext<'_>,
        lit: &ShadingVertex<'_>,
        measure: Measure,
        medium: u32,
    ) {
        let ShadingVertex { path, place, vertex, shading, bsdf, .. } = lit;
        // Set the origin of light samples.
        let shadow_origin = vertex.shadow_origin(tile, path.state.only_specular_before);
        set_lane(&mut self.from, i, shadow_origin.point);
        self.start[i] = shadow_origin.start;
        set_lane(&mut self.horizon, i, shadow_origin.horizon.unwrap_or(Vec3::ZERO));
        self.is_bounded |= u32::from(shadow_origin.horizon.is_some()) << i;
        if let Some(Lift { to, end }) = shadow_origin.lift {
            set_lane(&mut self.lifted, i, to);
            self.lift_end[i] = end;
            self.may_lift |= 1 << i;
        }
        // Set the surface and its normals.
        set_lane(&mut self.point, i, vertex.surface.point);
        set_lane(&mut self.facet, i, vertex.normal);
        self.has_facet |= 1 << i;
        self.only_specular_before |= u32::from(path.state.only_specular_before) << i;
        self.after_gloss |= u32::from(path.state.is_after_gloss) << i;
        let normal = bsdf.turned(shading.normal, vertex.to_eye);
        set_lane(&mut self.normal, i, normal);
        set_lane(&mut self.smooth_normal, i, shading.smooth_normal);
        self.bend[i] = shading.bend.unwrap_or(UNBENT);
        // Set the BSDF.
        let directions = Place { normal, to_eye: vertex.to_eye, tangent: vertex.tangent() };
        self.bsdf.put(i, bsdf, measure.lobes(), &directions);
        // Copy the state of the path.
        (self.roulette_throughput[i], self.medium[i]) = (path.state.roulette_throughput, medium);
        set_lane(&mut self.throughput, i, path.throughput);
        (self.slot[i], self.path[i], self.place[i]) = (path.slot, path.path, *place);
        self.is_bent |= shading.bend.is_some();
        self.used |= 1 << i;
    }

    /// Sets the other side of a vertex: the origin of rays there, and the index of the glass around it.
    pub fn put_beyond(&mut self, i: usize, beyond: Vec3, medium: u32) {
        set_lane(&mut self.beyond, i, beyond);
        self.medium_beyond[i] = medium;
    }

    /// Response of the vertices to light from these directions.
    #[inline(always)]
    pub fn response(&self, directions: &Lanes3, folds: impl Folds) -> Response {
        let mut cosines = [0.0; LANES];
        for i in 0..LANES {
            cosines[i] = lane(&self.normal, i).dot(lane(directions, i));
        }
        if self.is_bent {
            for i in 0..LANES {
                let smooth = lane(&self.smooth_normal, i).dot(lane(directions, i));
                cosines[i] *= terminator(cosines[i], smooth, self.bend[i]);
            }
        }
        Response { bsdf: self.bsdf.f(directions, folds), cosines }
    }

    /// Terminator factors of light from these directions, on the sides of the vertices where `sides` is 1, on the others where it
    /// is −1; not above 0 if nothing arrives.
    #[inline(always)]
    pub fn softened(&self, directions: &Lanes3, sides: &Lanes) -> Lanes {
        let mut left = [1.0; LANES];
        if self.is_bent {
            for i in 0..LANES {
                let direction = lane(directions, i) * sides[i];
                let cosine = lane(&self.normal, i).dot(direction);
                let smooth = lane(&self.smooth_normal, i).dot(direction);
                left[i] = terminator(cosine, smooth, self.bend[i]);
            }
        }
        left
    }

    /// [`Ray::start`] of rays from the vertices in these directions: none of a ray that goes behind its facet.
    #[inline(always)]
    pub fn starts(&self, directions: &Lanes3) -> [u32; LANES] {
        // Vertices of shapes have none.
        if self.start.iter().fold(!0, |all, start| all & start) == Ray::NO_TRIANGLE {
            return self.start;
        }
        let apart = truths(self.has_facet);
        let mut starts = self.start;
        for i in 0..LANES {
            let (facet, normal) = (lane(&self.facet, i), lane(&self.normal, i));
            let choose = |facet: f32, normal: f32| if apart[i] != 0 { facet } else { normal };
            let Vec3 { x, y, z } = lane(directions, i);
            let height =
                choose(facet.x, normal.x) * x + choose(facet.y, normal.y) * y + choose(facet.z, normal.z) * z;
            starts[i] = if height > 0.0 { starts[i] } else { Ray::NO_TRIANGLE };
        }
        starts
    }

    /// [`VertexBatch::starts`] for one vertex.
    pub fn start_of(&self, i: usize, direction: Vec3) -> u32 {
        let normal = if self.has_facet & 1 << i != 0 { &self.facet } else { &self.normal };
        if lane(normal, i).dot(direction) > 0.0 { self.start[i] } else { Ray::NO_TRIANGLE }
    }

    /// Whether a vertex certainly sees nothing in a direction.
    pub fn hides(&self, i: usize, direction: Vec3) -> bool {
        self.is_bounded & 1 << i != 0 && !(lane(&self.horizon, i).dot(direction) > 0.0)
    }

    /// Position of a vertex's surface, and the normal of its facet on the viewer's side.
    #[inline(always)]
    pub fn place_of(&self, i: usize) -> (Vec3, Vec3) {
        if self.has_facet & 1 << i != 0 {
            (lane(&self.point, i), lane(&self.facet, i))
        } else {
            (lane(&self.from, i), lane(&self.normal, i))
        }
    }

    /// Weight of photons that land at a vertex: the cosine of the light's direction, times the terminator factor, over the cosine
    /// with the facet.
    #[inline(always)]
    pub fn landed(&self, i: usize, direction: Vec3) -> f32 {
        if self.has_facet & 1 << i == 0 {
            return 1.0;
        }
        let cosine = lane(&self.normal, i).dot(direction);
        let smooth = lane(&self.smooth_normal, i).dot(direction);
        let left = cosine * terminator(cosine, smooth, self.bend[i]);
        let arriving = lane(&self.facet, i).dot(direction);
        if (left > 0.0) & (arriving > 0.0) { left / arriving } else { 0.0 }
    }

    /// Light of the vertices, times the throughput of the paths.
    #[inline(always)]
    pub fn carried_on(&self, light: &Lanes3) -> Lanes3 {
        let mut roulette_throughput = *light;
        for axis in 0..3 {
            for i in 0..LANES {
                roulette_throughput[axis][i] = light[axis][i] * self.throughput[axis][i];
            }
        }
        roulette_throughput
    }

    /// The first place, if there is a vertex in every lane and their places are consecutive. Otherwise `None`.
    #[inline(always)]
    pub fn run(&self) -> Option<u32> {
        let mut is_run = self.used == ALL;
        for i in 0..LANES {
            is_run &= self.place[i] == self.place[0].wrapping_add(i as u32);
        }
        is_run.then_some(self.place[0])
    }

    /// Whether any vertex is in glass.
    pub fn is_inside(&self) -> bool {
        lanes(self.used).any(|i| self.medium[i] != 0)
    }

    /// A bit for each vertex that certainly sees nothing in its direction.
    #[inline(always)]
    pub fn hidden(&self, directions: &Lanes3, folds: impl Folds) -> u32 {
        let mut hidden = [0; LANES];
        if self.is_bounded != 0 {
            for i in 0..LANES {
                let cosine = lane(&self.horizon, i).dot(lane(directions, i));
                hidden[i] = if cosine > 0.0 { 0 } else { TRUE };
            }
        }
        folds.bits(&hidden) & self.is_bounded
    }
}

/// Response of vertices to light from directions.
pub struct Response {
    /// BSDFs.
    pub bsdf: BsdfValues,
    /// Cosines, times the terminator factor; not above 0 if nothing arrives.
    pub cosines: Lanes,
}

/// A bit for each lane.
pub const ALL: u32 = ((1_u64 << LANES) - 1) as u32;

/// Terminator factor: softens the edge at which bent normals lose the light of their surface, 0 behind the surface; 1
/// without bent normals (Chiang, Li, Burley, *Taming the Shadow Terminator*, 2019).
#[inline(always)]
fn terminator(cosine: f32, smooth: f32, bend: f32) -> f32 {
    let g = smooth / (cosine * bend);
    let g = if g < 1.0 { g } else { 1.0 };
    // Light behind the bent normal is none: of a lesser g, the polynomial would be negative too, and the product not.
    let g = if g > 0.0 { g } else { 0.0 };
    let soft = if bend > 0.0 { -g * g * g + g * g + g } else { 1.0 };
    if (smooth > 0.0) | (bend == UNBENT) { soft } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_vertex_in_the_place_of_another_keeps_nothing_of_it() {
        // Row whose bits are set for all vertices, also for unused ones.
        let noisy = VertexBatch {
            used: ALL,
            is_bounded: ALL,
            may_lift: ALL,
            has_facet: ALL,
            only_specular_before: ALL,
            after_gloss: ALL,
            ..VertexBatch::EMPTY
        };
        let plain = VertexBatch { used: ALL, ..VertexBatch::EMPTY };
        let mut row = noisy;
        row.keep(0b11);
        row.copy(2, &plain, 7);
        row.copy(3, &VertexBatch { only_specular_before: 1 << 9, ..plain }, 9);
        let bits = [
            row.used,
            row.is_bounded,
            row.may_lift,
            row.has_facet,
            row.only_specular_before,
            row.after_gloss,
        ];
        assert_eq!(bits, [0b1111, 0b11, 0b11, 0b11, 0b1011, 0b11]);
    }
}
