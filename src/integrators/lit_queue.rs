//! The rows of vertices that wait to be lit, and what arrives by them.

use super::beside::{LobeRays, Others};
use super::cone::Cone;
use super::light::{LightRays, Lighting};
use super::lit_row::{ALL, LitRow};
use super::medium::Medium;
use super::onward::{Onward, Scattering};
use super::picking::Picking;
use super::queues::PathRay;
use super::shot::Shot;
use super::sink::Sink;
use super::vertices::LitVertex;
use super::view::Measure;
use crate::control::Cancelled;
use crate::geometry::rows::{RayRows, lanes, traced};
use crate::lights::{Source, SourceRow};
use crate::math::Vec3;
use crate::math::lanes::{LANES, lane};
use crate::world::{Geometry, Loops};

/// Vertices that wait to be lit, side by side; each is lit alone, whatever it shares its row with.
#[derive(Default)]
pub struct LitQueue {
    rows: Vec<LitRow>,
    /// Rows that are in use; the others are memory.
    count: usize,
    /// The one that takes single vertices; full or none where this is no row in use.
    open: usize,
    /// What lamps send by the vertex of each path of the round.
    arrived: Vec<Vec3>,
    /// The glass around vertices; the first is none.
    media: Vec<Medium>,
    /// The beams that come to the vertices of the paths of the round, where they are asked for.
    cones: Vec<Cone>,
}

impl LitQueue {
    /// Rows from which on they are lit before more come, while what they need is in the cache.
    const FULL: usize = 64;

    /// Fewer vertices of a row are put together with others.
    const WORTH_A_ROW: u32 = 8;

    /// Whether they are to be lit now.
    pub fn is_full(&self) -> bool {
        self.count >= Self::FULL
    }

    /// A round of so many paths begins, whose beams are asked for or not.
    pub fn expect(&mut self, paths: usize, has_cones: bool) {
        self.clear();
        self.cones.clear();
        self.cones.resize(if has_cones { paths } else { 0 }, Cone::default());
        self.arrived.clear();
        self.arrived.resize(paths, Vec3::ZERO);
        self.media.clear();
        self.media.push(Medium::default());
    }

    /// Note the beam that comes to the vertex of a path.
    pub fn note_cone(&mut self, place: u32, cone: Cone) {
        if let Some(own) = self.cones.get_mut(place as usize) {
            *own = cone;
        }
    }

    /// The round is over: the sink gets what lamps send, in the order of the paths; their slots, and whether the eye sees their
    /// vertices, are told by their places.
    pub fn settle(&mut self, path: impl Fn(usize) -> (u32, bool), sink: &mut Sink<'_>) {
        for (place, light) in self.arrived.iter().enumerate().filter(|(_, light)| **light != Vec3::ZERO) {
            let (slot, is_seen) = path(place);
            sink.add_arrived(slot, *light, is_seen);
        }
    }

    /// The same where the slots of the paths are those from one on.
    pub fn settle_run(&mut self, first: u32, sink: &mut Sink<'_>) {
        sink.add_arrived_run(first, &self.arrived);
    }

    /// A row to be filled, to be kept by [`LitQueue::keep`] or forgotten.
    pub fn spare(&mut self) -> &mut LitRow {
        if self.count == self.rows.len() {
            self.rows.push(LitRow::EMPTY);
        }
        &mut self.rows[self.count]
    }

    /// Keep the vertices of the spare row.
    pub fn keep(&mut self) {
        let (kept, spare) = self.rows.split_at_mut(self.count);
        let Some(row) = spare.first_mut().filter(|row| row.used != 0) else { return };
        row.keep(row.used);
        if row.used.count_ones() >= Self::WORTH_A_ROW {
            self.count += 1;
            return;
        }
        let mut left = row.used;
        if let Some(open) = kept.get_mut(self.open) {
            for lane in lanes(row.used).take((ALL & !open.used).count_ones() as usize) {
                open.copy(open.used.trailing_ones() as usize, row, lane);
                left &= !(1 << lane);
            }
        }
        if left != 0 {
            row.keep(left);
            self.open = self.count;
            self.count += 1;
        }
    }

    /// One more vertex.
    pub fn push(&mut self, shot: &Shot<'_>, lit: &LitVertex<'_>, measure: Measure) {
        self.note_cone(lit.place, lit.vertex.cone);
        let mut medium = 0;
        if !lit.path.medium.is_air() {
            medium = self.media.len() as u32;
            self.media.push(lit.path.medium);
        }
        let (row, lane) = self.open_row();
        row.put(lane, shot, lit, measure, medium);
    }

    /// A row with a free lane.
    fn open_row(&mut self) -> (&mut LitRow, usize) {
        if self.open >= self.count || self.rows[self.open].used == ALL {
            self.spare().reset();
            self.open = self.count;
            self.count += 1;
        }
        let row = &mut self.rows[self.open];
        let lane = row.used.trailing_ones() as usize;
        (row, lane)
    }

    /// Forget all vertices.
    fn clear(&mut self) {
        (self.count, self.open) = (0, 0);
    }

    /// Light all vertices and forget them; what rays that took. Where paths go on from them, the rays of the next round
    /// are added to `next`.
    pub fn light(
        &mut self,
        shot: &Shot<'_>,
        measure: Measure,
        onward: Option<Onward>,
        next: &mut Vec<PathRay>,
    ) -> Result<LightRays, Cancelled> {
        let mut rays = LightRays::default();
        for row in &mut self.rows[..self.count] {
            shot.token.check()?;
            if row.may_lift != 0 {
                shot.world.geometry.instructions().run(Lifting { geometry: &shot.world.geometry, row });
            }
            let row = &*row;
            let media = (self.media.len() > 1 && row.is_inside()).then_some(&*self.media);
            let others = match onward {
                Some(_) => Others::Paths,
                None => Others::lobes(row.sharp(shot, measure)),
            };
            let instructions = shot.world.geometry.instructions();
            let used = row.used;
            let plain = Lighting::<false> { shot, row, used, measure, others, media };
            let weighed = Lighting::<true> { shot, row, used, measure, others, media };
            let mut arrived = match (others, shot.world.lights.tree()) {
                (Others::Nothing, None) => instructions.run(plain),
                (Others::Nothing, Some(tree)) => instructions.run(Picking { lighting: plain, tree }),
                (Others::Paths | Others::Lobes(_), None) => instructions.run(weighed),
                (Others::Paths | Others::Lobes(_), Some(tree)) => {
                    instructions.run(Picking { lighting: weighed, tree })
                }
            };
            if let Others::Lobes(sharp) = others {
                arrived = instructions.run(LobeRays { shot, row, sharp, measure, media, arrived });
            }
            rays.shadow += arrived.rays.shadow;
            rays.scattered += arrived.rays.scattered;
            rays.lookups += arrived.rays.lookups;
            arrived.light = match measure {
                Measure::Radiance(_) | Measure::ArrivingShare => row.carried_on(&arrived.light),
                Measure::Work => arrived.light,
            };
            match row.run() {
                Some(first) => {
                    let own = &mut self.arrived[first as usize..][..LANES];
                    for (i, own) in own.iter_mut().enumerate() {
                        *own = lane(&arrived.light, i);
                    }
                }
                None => {
                    for i in lanes(row.used) {
                        self.arrived[row.place[i] as usize] = lane(&arrived.light, i);
                    }
                }
            }
            if let Some(onward) = onward.filter(|onward| onward.leads_on) {
                Scattering { shot, row, onward }.scatter(&self.media, &self.cones, next);
            }
        }
        self.clear();
        Ok(rays)
    }
}

/// Lifts the vertices of a row to where nothing is on the way.
struct Lifting<'a> {
    geometry: &'a Geometry,
    row: &'a mut LitRow,
}

impl Loops for Lifting<'_> {
    type Done = ();

    #[inline(always)]
    fn run(self) {
        let Self { geometry, row } = self;
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
        let rays = RayRows::of(row.from, direction);
        let blocked = geometry.occluded_rows(&rays, &ends, traced(&ends), &SourceRow::of(Source::Nothing));
        let lifted = row.may_lift & !blocked;
        row.is_bounded &= !lifted;
        for axis in 0..3 {
            for i in 0..LANES {
                let (from, to) = (row.from[axis][i], row.lifted[axis][i]);
                row.from[axis][i] = if lifted & 1 << i != 0 { to } else { from };
            }
        }
    }
}
