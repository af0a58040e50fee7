//! Queue of rows of vertices that wait for direct light, and the light that arrives there.

use arrayvec::ArrayVec;

use super::all_lights::{Arrived, LightRays, Lighting, Sums, add_where};
use super::lobe_rays::LobeRays;
use super::mis::CompetingTechnique;
use super::picked::Picking;
use super::shadow_rays::ShadowRayQueue;
use crate::control::Cancelled;
use crate::geometry::Ray;
use crate::geometry::rows::{RayRows, lanes, traced};
use crate::integrators::transport::accumulator::Accumulator;
use crate::integrators::transport::batch::{ALL, VertexBatch};
use crate::integrators::transport::cone::Cone;
use crate::integrators::transport::medium::{Media, Medium};
use crate::integrators::transport::ray::PathRay;
use crate::integrators::transport::scatter::{BsdfSampling, Continuation};
use crate::integrators::transport::tile::TileContext;
use crate::integrators::transport::vertex::ShadingVertex;
use crate::integrators::view::{Measure, Ways};
use crate::lights::{Source, SourceRow};
use crate::materials::RoughKind;
use crate::materials::bsdf::LobeSet;
use crate::math::Vec3;
use crate::math::lanes::{Folds, LANES, Lanes3, lane};
use crate::scene::description::Shadows;
use crate::world::{Geometry, Loops};

/// Vertices that wait for direct light, side by side; each is lit by itself, whatever vertices share its row.
#[derive(Default)]
pub struct DirectLightQueue {
    rows: Vec<VertexBatch>,
    /// Rows in use; the others are memory.
    count: usize,
    /// Index of the row for single vertices of each kind of BSDF, of dark ones of each kind, and of both kinds with two sides. If no
    /// row in use has this index, the row is full or there is none.
    open: [[usize; RoughKind::ALL.len()]; 4],
    /// Light of lamps at the vertices of each path of the round.
    arrived: Vec<Vec3>,
    /// Media of the vertices.
    media: Media,
    /// Shadow rays of several rows.
    pool: ShadowRayQueue,
    /// Beams at the vertices of the paths of the round, if requested.
    cones: Vec<Cone>,
}

/// Sides of a vertex. No light sample finds anything from one that is dark.
#[derive(Clone, Copy)]
pub enum Lit<'m> {
    /// Its light is that of one side.
    OneSide {
        /// Whether it is dark.
        is_dark: bool,
    },
    /// It stands for the other side of its surface too, where no light sample finds anything.
    TwoSides {
        /// Whether it is dark.
        is_dark: bool,
        /// Origin of rays on the other side.
        beyond: Vec3,
        /// The glass around them.
        medium: &'m Medium,
    },
}

/// Rows that are lit together if lights are picked.
const ROWS: usize = 64;

impl DirectLightQueue {
    /// Number of rows from which they are lit before more come, while their data are in the cache.
    const FULL: usize = 64;

    /// Fewest vertices of a row of its own; fewer are put together with others.
    const WORTH_A_ROW: u32 = 8;

    /// Whether the rows are to be lit now.
    pub fn is_full(&self) -> bool {
        self.count >= Self::FULL
    }

    /// Begins a round of so many paths, with their beams or without.
    pub fn expect(&mut self, paths: usize, has_cones: bool) {
        self.clear();
        self.cones.clear();
        self.cones.resize(if has_cones { paths } else { 0 }, Cone::default());
        self.arrived.clear();
        self.arrived.resize(paths, Vec3::ZERO);
        self.media.clear();
    }

    /// Stores the beam at the vertex of a path.
    pub fn note_cone(&mut self, place: u32, cone: Cone) {
        if let Some(own) = self.cones.get_mut(place as usize) {
            *own = cone;
        }
    }

    /// Ends the round: the accumulator gets the light of lamps, in the order of the paths. `path` gives the slot of a place, and
    /// whether the camera sees its vertex.
    pub fn settle(&mut self, path: impl Fn(usize) -> (u32, bool), accumulator: &mut Accumulator<'_>) {
        for (place, light) in self.arrived.iter().enumerate().filter(|(_, light)| **light != Vec3::ZERO) {
            let (slot, only_specular_before) = path(place);
            accumulator.add_arrived(slot, *light, only_specular_before);
        }
    }

    /// [`DirectLightQueue::settle`] for paths whose slots are consecutive.
    pub fn settle_run(&mut self, first: u32, accumulator: &mut Accumulator<'_>) {
        accumulator.add_arrived_run(first, &self.arrived);
    }

    /// An empty row to fill, then to keep by [`DirectLightQueue::keep`] or to drop.
    pub fn spare(&mut self) -> &mut VertexBatch {
        if self.count == self.rows.len() {
            self.rows.push(VertexBatch::EMPTY);
        }
        &mut self.rows[self.count]
    }

    /// Keeps the vertices of the spare row.
    pub fn keep(&mut self) {
        let (kept, spare) = self.rows.split_at_mut(self.count);
        let Some(row) = spare.first_mut().filter(|row| row.used != 0) else { return };
        row.keep(row.used);
        if row.used.count_ones() >= Self::WORTH_A_ROW {
            self.count += 1;
            return;
        }
        // Put few vertices together with others of their kind.
        let mut left = row.used;
        let open = &mut self.open[0][row.bsdf.kind() as usize];
        if let Some(open) = kept.get_mut(*open).filter(|open| open.is_for(row.bsdf.kind(), (false, false))) {
            for lane in lanes(row.used).take((ALL & !open.used).count_ones() as usize) {
                open.copy(open.used.trailing_ones() as usize, row, lane);
                left &= !(1 << lane);
            }
        }
        if left != 0 {
            row.keep(left);
            *open = self.count;
            self.count += 1;
        }
    }

    /// Adds a vertex.
    #[inline(always)]
    pub fn push(
        &mut self,
        tile: &TileContext<'_>,
        lit: &ShadingVertex<'_>,
        measure: Measure,
        sides: Lit<'_>,
    ) {
        self.note_cone(lit.place, lit.vertex.cone);
        let medium = self.media.number(lit.medium);
        let (row, lane) = match sides {
            Lit::OneSide { is_dark } => self.open_row(lit.bsdf.kind(), (is_dark, false)),
            Lit::TwoSides { is_dark, beyond, medium } => {
                let medium = self.media.number(medium);
                let (row, lane) = self.open_row(lit.bsdf.kind(), (is_dark, true));
                row.put_beyond(lane, beyond, medium);
                (row, lane)
            }
        };
        row.put(lane, tile, lit, measure, medium);
    }

    /// A row of this kind with a free lane, of dark vertices or of others, with two sides or one.
    fn open_row(&mut self, kind: RoughKind, which: (bool, bool)) -> (&mut VertexBatch, usize) {
        let (is_dark, has_two_sides) = which;
        let table = usize::from(is_dark) + 2 * usize::from(has_two_sides);
        let mut number = self.open[table][kind as usize];
        let is_open = |row: &VertexBatch| row.used != ALL && row.is_for(kind, which);
        if number >= self.count || !is_open(&self.rows[number]) {
            let row = self.spare();
            row.reset();
            row.bsdf.prepare(kind);
            (row.is_dark, row.has_two_sides) = which;
            number = self.count;
            self.open[table][kind as usize] = number;
            self.count += 1;
        }
        let row = &mut self.rows[number];
        let lane = row.used.trailing_ones() as usize;
        (row, lane)
    }

    /// Drops all vertices.
    fn clear(&mut self) {
        (self.count, self.open) = (0, Default::default());
        // A cancelled round may have left rays.
        self.pool.clear();
    }

    /// Lights all vertices and drops them; returns the rays for it. `gather` gives the light at a row that another technique
    /// brings. If paths go on from the vertices, the rays of the next round are added to `next`: by the continuation, or in lobes of
    /// microfacets after `depth` scatterings.
    pub fn light(
        &mut self,
        tile: &TileContext<'_>,
        measure: Measure,
        (continuation, depth): (Option<Continuation>, u32),
        gather: impl Fn(&VertexBatch) -> Option<Lanes3>,
        next: &mut Vec<PathRay>,
    ) -> Result<LightRays, Cancelled> {
        let mut rays = LightRays::default();
        let mut group: ArrayVec<Sums, ROWS> = ArrayVec::new();
        let together = if tile.world.lights.selection(tile.behaviour.receivers).is_some() { ROWS } else { 1 };
        // Hard shadows are by light samples alone.
        let by_paths = continuation.is_some()
            && (!tile.behaviour.gathers || tile.settings.render.shadows == Shadows::Soft);
        let mirrors = || tile.behaviour.mirrors.then(|| Continuation::new(tile, depth, LobeSet::Narrow));
        let of_row = |row: &VertexBatch| {
            let own = if row.bsdf.sends_rays() { continuation.or_else(mirrors) } else { continuation };
            own.filter(|continuation| continuation.leads_on)
        };
        for first in (0..self.count).step_by(together) {
            let end = (first + together).min(self.count);
            // Sample the lights at each row; rays to picked lights wait in the pool.
            for number in first..end {
                tile.token.check()?;
                let row = &mut self.rows[number];
                if row.may_lift != 0 {
                    tile.world.geometry.instructions().run(Lifting { geometry: &tile.world.geometry, row });
                }
                let asked = Asked { number, used: row.used & shown(row, measure), by_paths };
                let sums = self.sums(asked, tile, measure, group.len() as u32);
                group.push(sums);
                if self.pool.is_full() {
                    self.pool.trace(tile, measure, &mut group);
                }
            }
            // Trace the rest of the pool.
            self.pool.trace(tile, measure, &mut group);
            // Add the light by rays in lobes and by photons, and store the result.
            for (number, sums) in (first..end).zip(group.drain(..)) {
                let row = &self.rows[number];
                let asked = Asked { number, used: row.used & shown(row, measure), by_paths };
                let mut arrived = self.arrived(asked, tile, measure, sums);
                if let Some(gathered) = gather(row) {
                    add_where(row.used, &gathered, &mut arrived.light);
                }
                rays += arrived.rays;
                self.note(number, measure, &arrived.light);
            }
            // Scatter the paths that go on.
            for row in &self.rows[first..end] {
                if let Some(continuation) = of_row(row) {
                    BsdfSampling { tile, row, used: row.used, continuation }.scatter(
                        &self.media,
                        &self.cones,
                        next,
                    );
                }
            }
        }
        self.clear();
        Ok(rays)
    }

    /// Technique that competes with light samples.
    fn competing(&self, asked: Asked, tile: &TileContext<'_>, measure: Measure) -> CompetingTechnique {
        let is_soft = tile.settings.render.shadows == Shadows::Soft;
        let row = &self.rows[asked.number];
        if asked.by_paths {
            CompetingTechnique::Paths
        } else if row.bsdf.sends_rays() && is_soft && tile.behaviour.mirrors {
            CompetingTechnique::NarrowPaths
        } else if row.bsdf.sends_rays() && !is_soft && measure != Measure::ArrivingShare {
            // Paths in the lobes of microfacets do not bring the light of lamps.
            CompetingTechnique::lobes(row.bsdf.narrow_lobes() & asked.used)
        } else {
            CompetingTechnique::lobes(row.sharp(tile, measure) & asked.used)
        }
    }

    /// The glass around the vertices of a row. `None` if all are in air.
    fn media_of(&self, row: &VertexBatch) -> Option<&Media> {
        (!self.media.are_air() && row.is_inside()).then_some(&self.media)
    }

    /// Contributions of light samples; rays to picked lamps wait in the pool, under the row's number.
    fn sums(&mut self, asked: Asked, tile: &TileContext<'_>, measure: Measure, number: u32) -> Sums {
        if asked.used == 0 {
            return Sums::NOTHING;
        }
        let mut pool = std::mem::take(&mut self.pool);
        let row = &self.rows[asked.number];
        let (competing, media) = (self.competing(asked, tile, measure), self.media_of(row));
        let (instructions, used) = (tile.world.geometry.instructions(), asked.used);
        let plain = Lighting::<false> { tile, row, used, measure, competing, media, only_beyond: false };
        let weighed = Lighting::<true> { tile, row, used, measure, competing, media, only_beyond: false };
        use CompetingTechnique::{Lobes, NarrowPaths, Nothing, Paths};
        let sums = match (competing, tile.world.lights.selection(tile.behaviour.receivers)) {
            (Nothing, None) => instructions.run(plain),
            (Nothing, Some(selection)) => {
                instructions.run(Picking { lighting: plain, selection, number, pool: &mut pool })
            }
            (Paths | NarrowPaths | Lobes(_), None) => instructions.run(weighed),
            (Paths | NarrowPaths | Lobes(_), Some(selection)) => {
                instructions.run(Picking { lighting: weighed, selection, number, pool: &mut pool })
            }
        };
        self.pool = pool;
        sums
    }

    /// Light that arrives, including that of rays in lobes.
    fn arrived(&self, asked: Asked, tile: &TileContext<'_>, measure: Measure, sums: Sums) -> Arrived {
        let row = &self.rows[asked.number];
        let arrived = sums.arrived(measure);
        match self.competing(asked, tile, measure) {
            CompetingTechnique::Lobes(sharp) => {
                let media = self.media_of(row);
                let lobes = LobeRays { tile, row, sharp, measure, media, arrived };
                tile.world.geometry.instructions().run(lobes)
            }
            CompetingTechnique::Nothing | CompetingTechnique::Paths | CompetingTechnique::NarrowPaths => {
                arrived
            }
        }
    }

    /// Adds the light that arrives at a row: a path has two vertices at a surface that lets light through.
    fn note(&mut self, number: usize, measure: Measure, arrived: &Lanes3) {
        let row = &self.rows[number];
        let light = match measure {
            Measure::Radiance(_) | Measure::ArrivingShare => row.carried_on(arrived),
            Measure::Work => *arrived,
        };
        match row.run() {
            Some(first) => {
                let own = &mut self.arrived[first as usize..][..LANES];
                for (i, own) in own.iter_mut().enumerate() {
                    *own += lane(&light, i);
                }
            }
            None => {
                for i in lanes(row.used) {
                    self.arrived[row.place[i] as usize] += lane(&light, i);
                }
            }
        }
    }
}

/// A bit for each vertex whose direct light is shown, if there may be any.
fn shown(row: &VertexBatch, measure: Measure) -> u32 {
    if row.is_dark {
        return 0;
    }
    let Ways { direct, indirect, .. } = measure.ways();
    let hidden = |bits: u32, is_shown: bool| if is_shown { 0 } else { bits };
    !(hidden(row.only_specular_before, direct) | hidden(!row.only_specular_before, indirect))
}

/// Vertices to light, and options.
#[derive(Clone, Copy)]
struct Asked {
    /// The number of the row.
    number: usize,
    /// A bit for each vertex.
    used: u32,
    /// Whether paths that go on from there share the light.
    by_paths: bool,
}

/// Moves the vertices of a row above their facets, if nothing is on the way.
struct Lifting<'a> {
    geometry: &'a Geometry,
    row: &'a mut VertexBatch,
}

impl Loops for Lifting<'_> {
    type Done = ();

    #[inline(always)]
    fn run(self, folds: impl Folds) {
        let Self { geometry, row } = self;
        // Make rays from the facets to the points above them.
        let mut direction = row.lifted;
        for axis in 0..3 {
            for i in 0..LANES {
                direction[axis][i] = row.lifted[axis][i] - row.from[axis][i];
            }
        }
        let mut ends = [-1.0; LANES];
        for i in 0..LANES {
            ends[i] = if row.may_lift & 1 << i != 0 { row.lift_end[i] } else { -1.0 };
        }
        let rays = RayRows::of(row.from, direction).leaving(row.start);
        // Find what is on the way.
        let blocked = {
            let (traced, nothing) = (traced(&ends, folds), SourceRow::of(Source::Nothing));
            geometry.occluded_rows(&rays, &ends, traced, &nothing, folds)
        };
        // Move the other vertices.
        let lifted = row.may_lift & !blocked;
        row.is_bounded &= !lifted;
        for i in 0..LANES {
            row.start[i] = if lifted & 1 << i != 0 { Ray::NO_TRIANGLE } else { row.start[i] };
        }
        for axis in 0..3 {
            for i in 0..LANES {
                let (from, to) = (row.from[axis][i], row.lifted[axis][i]);
                row.from[axis][i] = if lifted & 1 << i != 0 { to } else { from };
            }
        }
    }
}
