//! Direct light at vertices, in rows of sixteen: every light with its own shadow rays.

use super::medium::{Medium, absorption};
use super::onward::{Onward, Scattering};
use super::queues::PathRay;
use super::shot::Shot;
use super::sink::Sink;
use super::vertices::{Lift, LitVertex};
use super::view::{Measure, Parts};
use crate::control::Cancelled;
use crate::geometry::Ray;
use crate::geometry::rows::{Ends, RayRows, lanes};
use crate::lights::{Light, LightRow, Middle, Source, SourceRow};
use crate::materials::Lobes;
use crate::materials::lobes::gloss;
use crate::materials::phong::PhongBsdf;
use crate::math::Vec3;
use crate::math::color::luminance;
use crate::math::lanes::{LANES, Lanes, Lanes3, TRUE, bits, lane, set_lane};
use crate::sampling::{Decision, SamplerRow};
use crate::scene::description::Shadows;
use crate::world::{Geometry, Hit, Loops};

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
}

/// Vertices to be lit.
#[derive(Clone)]
pub struct LitRow {
    /// A bit for each lane with a vertex.
    pub used: u32,
    /// Where lights are seen from and shadow rays start.
    pub from: Lanes3,
    /// Normals behind which nothing is seen, of the lanes whose bits are set.
    horizon: Lanes3,
    is_bounded: u32,
    /// Points from which lights are seen all around where nothing is on the way there, of the lanes whose bits are set, and the
    /// ends of the ways.
    lifted: Lanes3,
    lift_end: Lanes,
    may_lift: u32,
    /// Normals that the cosines are of.
    pub normal: Lanes3,
    /// Those before a normal map bent them, and the cosine between; [`UNBENT`] where none did.
    smooth_normal: Lanes3,
    bend: Lanes,
    /// The direction to the eye, mirrored.
    pub mirrored_eye: Lanes3,
    /// The diffuse part of f in sr⁻¹, and the glossy one at its peak.
    pub diffuse: Lanes3,
    /// [`LitRow::diffuse`].
    pub specular: Lanes3,
    /// Of the glossy lobe.
    pub shininess: Lanes,
    /// The largest parts of kd and ks, whatever is shown of them.
    pub albedos: [Lanes; 2],
    /// Of the paths.
    pub throughput: Lanes3,
    /// Of the paths.
    pub slot: [u32; LANES],
    /// Of the paths.
    pub path: [u32; LANES],
    /// Places of the paths in the round's queue.
    pub place: [u32; LANES],
    /// [`History::carried`](super::queues::History::carried) of the paths.
    pub carried: Lanes,
    /// Places of the glass that they are in.
    pub medium: [u32; LANES],
    /// Whether any vertex has a glossy lobe.
    pub is_glossy: bool,
    /// Whether any vertex has a bent normal.
    is_bent: bool,
}

/// In place of the cosine between two normals that are one.
const UNBENT: f32 = -2.0;

impl LitRow {
    /// The least α of lobes that are worth rays of their own.
    const SHARP: f32 = 100.0;

    /// A bit for each vertex whose highlights of lamps samples of the lamps alone would find too seldom.
    fn sharp(&self, shot: &Shot<'_>, measure: Measure) -> u32 {
        let shows = match measure {
            Measure::Radiance(Parts { specular, .. }) => specular,
            Measure::ArrivingShare => false,
        };
        let is_soft = shot.settings.render.shadows == Shadows::Soft;
        if !(self.is_glossy && shows && is_soft && shot.world.lights.can_be_found()) {
            return 0;
        }
        let is_sharp = |i: &usize| self.albedos[1][*i] > 0.0 && self.shininess[*i] >= Self::SHARP;
        lanes(self.used).filter(is_sharp).fold(0, |sharp, i| sharp | 1 << i)
    }

    /// The random numbers of the vertices.
    #[inline(always)]
    pub fn sampler(&self, shot: &Shot<'_>) -> SamplerRow<LANES> {
        let (block, slots) = (shot.block, &self.slot);
        let mut is_run = true;
        for i in 0..LANES {
            is_run &= slots[i] == slots[0] + i as u32;
        }
        let (xs, ys, samples) = if is_run {
            block.places(slots[0])
        } else {
            let [mut xs, mut ys, mut samples] = [[0; LANES]; 3];
            for i in (0..LANES).filter(|i| self.used & 1 << i != 0) {
                (xs[i], ys[i], samples[i]) = block.place(slots[i]);
            }
            (xs, ys, samples)
        };
        SamplerRow::new(shot.settings.render.seed, &xs, &ys, &samples)
    }

    /// No vertex.
    pub const EMPTY: Self = Self {
        used: 0,
        from: [[0.0; LANES]; 3],
        horizon: [[0.0; LANES]; 3],
        is_bounded: 0,
        lifted: [[0.0; LANES]; 3],
        lift_end: [0.0; LANES],
        may_lift: 0,
        normal: [[0.0; LANES]; 3],
        smooth_normal: [[0.0; LANES]; 3],
        bend: [UNBENT; LANES],
        mirrored_eye: [[0.0; LANES]; 3],
        diffuse: [[0.0; LANES]; 3],
        specular: [[0.0; LANES]; 3],
        shininess: [0.0; LANES],
        albedos: [[0.0; LANES]; 2],
        throughput: [[0.0; LANES]; 3],
        slot: [0; LANES],
        path: [0; LANES],
        place: [0; LANES],
        carried: [0.0; LANES],
        medium: [0; LANES],
        is_glossy: false,
        is_bent: false,
    };

    /// For other vertices, with normals as they are.
    #[inline(always)]
    pub fn reset(&mut self) {
        (self.used, self.is_bounded, self.may_lift) = (0, 0, 0);
        (self.is_glossy, self.is_bent) = (false, false);
        self.bend = [UNBENT; LANES];
    }

    /// Take a vertex of another row.
    fn copy(&mut self, i: usize, other: &Self, from: usize) {
        for (own, other) in [
            (&mut self.from, &other.from),
            (&mut self.horizon, &other.horizon),
            (&mut self.lifted, &other.lifted),
            (&mut self.normal, &other.normal),
            (&mut self.smooth_normal, &other.smooth_normal),
            (&mut self.mirrored_eye, &other.mirrored_eye),
            (&mut self.diffuse, &other.diffuse),
            (&mut self.specular, &other.specular),
            (&mut self.throughput, &other.throughput),
        ] {
            set_lane(own, i, lane(other, from));
        }
        (self.bend[i], self.shininess[i]) = (other.bend[from], other.shininess[from]);
        for (own, other) in self.albedos.iter_mut().zip(&other.albedos) {
            own[i] = other[from];
        }
        (self.carried[i], self.medium[i]) = (other.carried[from], other.medium[from]);
        (self.slot[i], self.path[i], self.place[i]) = (other.slot[from], other.path[from], other.place[from]);
        self.is_glossy |= other.is_glossy;
        self.is_bent |= other.is_bent;
        self.is_bounded |= (other.is_bounded >> from & 1) << i;
        self.lift_end[i] = other.lift_end[from];
        self.may_lift |= (other.may_lift >> from & 1) << i;
        self.used |= 1 << i;
    }

    fn put(&mut self, i: usize, shot: &Shot<'_>, lit: &LitVertex<'_>, measure: Measure, medium: u32) {
        let LitVertex { path, place, vertex, shading, bsdf } = lit;
        let outlook = vertex.outlook(shot);
        set_lane(&mut self.from, i, outlook.point);
        set_lane(&mut self.horizon, i, outlook.horizon.unwrap_or(Vec3::ZERO));
        self.is_bounded |= u32::from(outlook.horizon.is_some()) << i;
        if let Some(Lift { to, end }) = outlook.lift {
            set_lane(&mut self.lifted, i, to);
            self.lift_end[i] = end;
            self.may_lift |= 1 << i;
        }
        set_lane(&mut self.normal, i, shading.normal);
        set_lane(&mut self.smooth_normal, i, shading.smooth_normal);
        self.bend[i] = shading.bend.unwrap_or(UNBENT);
        set_lane(&mut self.mirrored_eye, i, shading.mirrored(vertex.to_eye));
        let [diffuse, specular] = bsdf_parts(bsdf, measure);
        set_lane(&mut self.diffuse, i, diffuse);
        set_lane(&mut self.specular, i, specular);
        self.shininess[i] = bsdf.shininess;
        self.albedos[0][i] = bsdf.diffuse.max_element();
        self.albedos[1][i] = bsdf.specular.max_element();
        (self.carried[i], self.medium[i]) = (path.history.carried, medium);
        set_lane(&mut self.throughput, i, path.throughput);
        (self.slot[i], self.path[i], self.place[i]) = (path.slot, path.path, *place);
        self.is_glossy |= bsdf.specular != Vec3::ZERO;
        self.is_bent |= shading.bend.is_some();
        self.used |= 1 << i;
    }

    /// The lobes of a vertex.
    #[inline(always)]
    pub fn lobes(&self, i: usize) -> Lobes {
        Lobes {
            normal: lane(&self.normal, i),
            mirrored_eye: lane(&self.mirrored_eye, i),
            diffuse: self.albedos[0][i],
            specular: self.albedos[1][i],
            shininess: self.shininess[i],
        }
    }

    /// What the vertices make of light from some directions.
    #[inline(always)]
    pub fn response(&self, directions: &Lanes3) -> Response {
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
        let (mut f, mut glosses) = (self.diffuse, [0.0; LANES]);
        if self.is_glossy {
            for i in 0..LANES {
                let left = gloss(lane(&self.mirrored_eye, i), lane(directions, i), self.shininess[i]);
                set_lane(&mut f, i, lane(&self.diffuse, i) + lane(&self.specular, i) * left);
                glosses[i] = left;
            }
        }
        Response { f, cosines, glosses }
    }

    /// Whether any vertex is in glass.
    fn is_inside(&self) -> bool {
        lanes(self.used).any(|i| self.medium[i] != 0)
    }

    /// A bit for each vertex that certainly sees nothing in a direction.
    #[inline(always)]
    pub fn hidden(&self, directions: &Lanes3) -> u32 {
        let mut hidden = [0; LANES];
        if self.is_bounded != 0 {
            for i in 0..LANES {
                let cosine = lane(&self.horizon, i).dot(lane(directions, i));
                hidden[i] = if cosine > 0.0 { 0 } else { TRUE };
            }
        }
        bits(hidden) & self.is_bounded
    }
}

/// What vertices make of light from directions.
pub struct Response {
    /// The BSDF in sr⁻¹, as far as it is shown.
    pub f: Lanes3,
    /// Cosines, times what is left of them at the terminator; not above 0 where nothing arrives.
    pub cosines: Lanes,
    /// [`gloss`].
    pub glosses: Lanes,
}

/// A bit for each lane.
const ALL: u32 = ((1_u64 << LANES) - 1) as u32;

/// The diffuse part of f in sr⁻¹, and the glossy one at its peak, as far as they are shown.
#[inline(always)]
pub fn bsdf_parts(bsdf: &PhongBsdf, measure: Measure) -> [Vec3; 2] {
    let part = |is_taken: bool, value: Vec3| if is_taken { value } else { Vec3::ZERO };
    match measure {
        Measure::Radiance(Parts { diffuse, specular, .. }) => {
            [part(diffuse, bsdf.diffuse_value()), part(specular, bsdf.specular_peak())]
        }
        Measure::ArrivingShare => [Vec3::ONE, Vec3::ZERO],
    }
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

    /// A round of so many paths begins.
    pub fn expect(&mut self, paths: usize) {
        self.clear();
        self.arrived.clear();
        self.arrived.resize(paths, Vec3::ZERO);
        self.media.clear();
        self.media.push(Medium::default());
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
        let used = self.rows[self.count].used;
        if used.count_ones() >= Self::WORTH_A_ROW {
            self.count += 1;
            return;
        }
        if used == 0 {
            return;
        }
        let row = self.rows[self.count].clone();
        for lane in lanes(used) {
            let (own, i) = self.open_row();
            own.copy(i, &row, lane);
        }
    }

    /// One more vertex.
    pub fn push(&mut self, shot: &Shot<'_>, lit: &LitVertex<'_>, measure: Measure) {
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
            let others =
                if onward.is_some() { Others::Paths } else { Others::Lobes(row.sharp(shot, measure)) };
            let media = row.is_inside().then_some(&*self.media);
            let work = Lighting { shot, row, used: row.used, measure, others, media };
            let arrived = shot.world.geometry.instructions().run(work);
            rays.shadow += arrived.rays.shadow;
            rays.scattered += arrived.rays.scattered;
            for i in lanes(row.used) {
                self.arrived[row.place[i] as usize] = lane(&arrived.light, i);
            }
            if let Some(onward) = onward.filter(|onward| onward.leads_on) {
                Scattering { shot, row, onward }.scatter(&self.media, next);
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
        let blocked = geometry.occluded_rows(&rays, &ends, &SourceRow::of(Source::Nothing));
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

/// Lights the vertices of a row whose bits are set.
struct Lighting<'a> {
    shot: &'a Shot<'a>,
    row: &'a LitRow,
    used: u32,
    measure: Measure,
    others: Others,
    /// Those that the vertices are in; none where all are in air.
    media: Option<&'a [Medium]>,
}

/// What finds light beside samples of the lamps.
#[derive(Clone, Copy)]
enum Others {
    /// The rays of paths that go on from the vertices.
    Paths,
    /// Rays in the glossy lobes of the vertices whose bits are set.
    Lobes(u32),
}

/// Rays that the light of vertices took.
#[derive(Clone, Copy, Debug, Default)]
pub struct LightRays {
    /// Towards lamps.
    pub shadow: u64,
    /// In lobes.
    pub scattered: u64,
}

/// What of the light that arrives at the vertices of a row gets to the eye.
struct Arrived {
    light: Lanes3,
    rays: LightRays,
}

/// Sums over the lights.
struct Sums {
    /// Of what arrives.
    light: Lanes3,
    /// Of what could.
    total: Lanes,
    rays: LightRays,
}

/// What a light could send, before one ray tells whether it does.
struct Waiting {
    light: Lanes3,
    active: u32,
}

impl Loops for Lighting<'_> {
    type Done = Arrived;

    #[inline(always)]
    fn run(self) -> Arrived {
        let render = &self.shot.settings.render;
        let mut sampler = None;
        let mut sums = Sums { light: [[0.0; LANES]; 3], total: [0.0; LANES], rays: LightRays::default() };
        for (number, light) in self.shot.world.lights.iter() {
            // Where one ray decides for all of a light, what it could send waits for that.
            let mut waiting = Waiting { light: [[0.0; LANES]; 3], active: 0 };
            let middle = light.middle();
            let waits = match render.shadows {
                Shadows::Soft => false,
                Shadows::Hard => middle.is_some(),
                Shadows::Off => true,
            };
            if light.is_single() {
                let nowhere = [[0.0; LANES]; 2];
                let samples = light.sample_row(&self.row.from, &self.row.normal, self.used, &nowhere);
                let (mut values, active) = self.values(&samples, 1.0);
                self.absorb(&samples, &mut values);
                self.add(&samples, &values, active, &mut sums, waits.then_some(&mut waiting));
            } else {
                let count = render.shadow_samples;
                if sampler.is_none() {
                    sampler = Some(self.sampler());
                }
                let Some(sampler) = &sampler else { continue };
                for repetition in 0..count {
                    let u = sampler.pairs(&self.row.path, Decision::Light(number), repetition, count);
                    let samples = light.sample_row(&self.row.from, &self.row.normal, self.used, &u);
                    let (mut values, active) = self.values(&samples, 1.0 / count as f32);
                    self.absorb(&samples, &mut values);
                    match self.others {
                        Others::Paths => self.weigh(light, &samples, 1.0 / count as f32, &mut values),
                        Others::Lobes(0) => {}
                        Others::Lobes(_) => self.weigh(light, &samples, 1.0, &mut values),
                    }
                    self.add(&samples, &values, active, &mut sums, waits.then_some(&mut waiting));
                }
            }
            if waiting.active != 0 {
                self.add_waiting(middle, &waiting, &mut sums);
            }
        }
        if let Others::Lobes(sharp @ 1..) = self.others {
            self.add_lobes(sharp, &sampler.unwrap_or_else(|| self.sampler()), &mut sums);
        }
        if self.measure == Measure::ArrivingShare {
            for i in 0..LANES {
                let share = if sums.total[i] > 0.0 { sums.light[0][i] / sums.total[i] } else { 0.0 };
                set_lane(&mut sums.light, i, Vec3::splat(share));
            }
        }
        for axis in 0..3 {
            for i in 0..LANES {
                sums.light[axis][i] *= self.row.throughput[axis][i];
            }
        }
        Arrived { light: sums.light, rays: sums.rays }
    }
}

impl Lighting<'_> {
    #[inline(always)]
    fn sampler(&self) -> SamplerRow<LANES> {
        self.row.sampler(self.shot)
    }

    /// Leave of samples what glass around the vertices lets through on the way.
    #[inline(always)]
    fn absorb(&self, samples: &LightRow, values: &mut Lanes3) {
        if self.media.is_none() || self.measure == Measure::ArrivingShare {
            return;
        }
        for i in lanes(self.used) {
            let way = lane(&samples.targets, i) - lane(&self.row.from, i);
            let is_beyond = samples.beyond & 1 << i != 0;
            let distance = if is_beyond { f32::MAX } else { way.length() };
            set_lane(values, i, lane(values, i) * self.transmittance(i, distance));
        }
    }

    /// What glass around a vertex lets through over a distance.
    fn transmittance(&self, i: usize, distance: f32) -> Vec3 {
        self.media.map_or(Vec3::ONE, |media| {
            absorption(self.shot.world, media[self.row.medium[i] as usize], distance)
        })
    }

    /// Leave of samples of one light what rays in the lobes do not bring, of which there are so many for each sample.
    #[inline(always)]
    fn weigh(&self, light: &Light, samples: &LightRow, others: f32, values: &mut Lanes3) {
        let of_light = light.inverse_densities(samples);
        let mut glosses = [0.0; LANES];
        if self.row.is_glossy {
            for i in 0..LANES {
                let mirrored = lane(&self.row.mirrored_eye, i);
                glosses[i] = gloss(mirrored, lane(&samples.directions, i), self.row.shininess[i]);
            }
        }
        for i in 0..LANES {
            let density = self.lobes(i).density(lane(&samples.directions, i), glosses[i]);
            let weight = weight(density * of_light[i] * others);
            let weight = if self.shares(i) { weight } else { 1.0 };
            let left = match self.others {
                Others::Paths => Vec3::splat(weight),
                Others::Lobes(_) => self.left_of_gloss(i, glosses[i], weight),
            };
            set_lane(values, i, lane(values, i) * left);
        }
    }

    /// What is left of the light that a vertex reflects where the glossy part of it counts so much: rays in a lobe bring no other,
    /// so that the parts of a picture add up to it.
    #[inline(always)]
    fn left_of_gloss(&self, i: usize, gloss: f32, weight: f32) -> Vec3 {
        let (diffuse, glossy) = (lane(&self.row.diffuse, i), lane(&self.row.specular, i) * gloss);
        let part = |diffuse: f32, glossy: f32| {
            let all = diffuse + glossy;
            if all > 0.0 { (diffuse + glossy * weight) / all } else { 0.0 }
        };
        Vec3::new(part(diffuse.x, glossy.x), part(diffuse.y, glossy.y), part(diffuse.z, glossy.z))
    }

    /// The lobes in which rays are sent out from a vertex.
    #[inline(always)]
    fn lobes(&self, i: usize) -> Lobes {
        let lobes = self.row.lobes(i);
        match self.others {
            Others::Paths => lobes,
            Others::Lobes(_) => Lobes { diffuse: 0.0, specular: 1.0, ..lobes },
        }
    }

    /// Whether rays are sent out from a vertex.
    #[inline(always)]
    fn shares(&self, i: usize) -> bool {
        match self.others {
            Others::Paths => true,
            Others::Lobes(sharp) => sharp & 1 << i != 0,
        }
    }

    /// Add what rays bring that are sent out in the glossy lobes of the vertices whose bits are set, as many as samples of a lamp:
    /// a narrow lobe finds in a wide lamp what samples of the lamp hardly ever meet.
    #[inline(always)]
    fn add_lobes(&self, sharp: u32, sampler: &SamplerRow<LANES>, sums: &mut Sums) {
        let (row, count) = (self.row, self.shot.settings.render.shadow_samples);
        for repetition in 0..count {
            let u = sampler.pairs(&row.path, Decision::Direction, repetition, count);
            let mut directions = [[0.0; LANES]; 3];
            for i in 0..LANES {
                set_lane(&mut directions, i, self.lobes(i).sample(1.0, [u[0][i], u[1][i]]));
            }
            let Response { cosines, glosses, .. } = row.response(&directions);
            let mut sent = sharp & !row.hidden(&directions);
            let mut ends = [-1.0; LANES];
            for i in 0..LANES {
                let bit = 1 << i;
                sent &= if cosines[i] > 0.0 { !0 } else { !bit };
                ends[i] = if sent & bit != 0 { f32::INFINITY } else { -1.0 };
            }
            let rays = RayRows::of(row.from, directions);
            let (hits, objects) = self.shot.world.geometry.closest_rows(&rays, &mut ends);
            sums.rays.scattered += u64::from(sent.count_ones());
            for i in lanes(sent) {
                let density = self.lobes(i).density(lane(&directions, i), glosses[i]);
                let radiance = match hits.get(i) {
                    Some(shape) => {
                        let hit = Hit { shape, object: objects[i] };
                        let radiance = self.shot.lamp_radiance(&rays.ray(i), &hit, density);
                        radiance * self.transmittance(i, hit.shape.t)
                    }
                    None => {
                        let radiance = self.shot.radiance_beyond(lane(&directions, i), density);
                        radiance * self.transmittance(i, f32::MAX)
                    }
                };
                let f = lane(&row.specular, i) * glosses[i];
                let value = f * radiance * (cosines[i] / (density * count as f32));
                let sum = lane(&sums.light, i) + value;
                set_lane(&mut sums.light, i, sum);
            }
        }
    }

    /// Add what samples of one light bring, if they bring anything; where it waits for one ray, it is put beside.
    #[inline(always)]
    fn add(
        &self,
        samples: &LightRow,
        values: &Lanes3,
        active: u32,
        sums: &mut Sums,
        waiting: Option<&mut Waiting>,
    ) {
        if active == 0 {
            return;
        }
        for i in 0..LANES {
            let is_active = active & 1 << i != 0;
            sums.total[i] += if is_active { values[0][i] } else { 0.0 };
        }
        if let Some(waiting) = waiting {
            waiting.active |= active;
            add_where(active, values, &mut waiting.light);
        } else {
            let (rays, ends) = self.shadow_rays(samples, active & !self.row.hidden(&samples.directions));
            self.add_seen(&rays, &ends, &samples.sources, values, sums);
        }
    }

    /// What waits for one ray to the middle of its light.
    #[inline(always)]
    fn add_waiting(&self, middle: Option<(Middle, Source)>, waiting: &Waiting, sums: &mut Sums) {
        let Some((middle, source)) = middle.filter(|_| self.shot.settings.render.shadows != Shadows::Off)
        else {
            return add_where(waiting.active, &waiting.light, &mut sums.light);
        };
        let (mut direction, mut ends) = ([[0.0; LANES]; 3], [-1.0; LANES]);
        for i in 0..LANES {
            let from = lane(&self.row.from, i);
            let ray = match middle {
                Middle::At(middle) => Ray::segment(from, middle),
                Middle::Towards(direction) => Ray::new(from, direction),
            };
            set_lane(&mut direction, i, ray.direction);
            ends[i] = ray.t_max;
        }
        let traced = waiting.active & !self.row.hidden(&direction);
        for i in 0..LANES {
            ends[i] = if traced & 1 << i != 0 { ends[i] } else { -1.0 };
        }
        let rays = RayRows::of(self.row.from, direction);
        self.add_seen(&rays, &ends, &SourceRow::of(source), &waiting.light, sums);
    }

    /// Add what arrives on rays; those that are not traced end below 0.
    #[inline(always)]
    fn add_seen(&self, rays: &RayRows, ends: &Ends, sources: &SourceRow, values: &Lanes3, sums: &mut Sums) {
        let mut traced = [0; LANES];
        for i in 0..LANES {
            traced[i] = if ends[i] >= 0.0 { TRUE } else { 0 };
        }
        let traced = bits(traced);
        let occluded = self.shot.world.geometry.occluded_rows(rays, ends, sources);
        sums.rays.shadow += u64::from(traced.count_ones());
        add_where(traced & !occluded, values, &mut sums.light);
    }

    /// What each sample brings if nothing is in its way, and a bit for each that brings anything.
    #[inline(always)]
    fn values(&self, samples: &LightRow, share: f32) -> (Lanes3, u32) {
        let Response { f, cosines, .. } = self.row.response(&samples.directions);
        let mut arriving = samples.weights;
        if self.measure == Measure::ArrivingShare {
            for i in 0..LANES {
                let light = Vec3::splat(luminance(lane(&samples.weights, i)));
                set_lane(&mut arriving, i, light);
            }
        }
        let (mut values, mut active) = (f, [0; LANES]);
        for i in 0..LANES {
            let value = lane(&f, i) * lane(&arriving, i) * (cosines[i] * share);
            set_lane(&mut values, i, value);
            let brings = (cosines[i] > 0.0) & ((value.x != 0.0) | (value.y != 0.0) | (value.z != 0.0));
            active[i] = if brings { TRUE } else { 0 };
        }
        (values, bits(active) & self.used)
    }

    /// The rays on which the light of the samples in `active` arrives; the others have no end.
    #[inline(always)]
    fn shadow_rays(&self, samples: &LightRow, active: u32) -> (RayRows, Ends) {
        let (mut direction, mut ends) = (samples.directions, [-1.0; LANES]);
        for i in 0..LANES {
            let ray = Ray::segment(lane(&self.row.from, i), lane(&samples.targets, i));
            set_lane(&mut direction, i, ray.direction);
            ends[i] = if active & 1 << i != 0 { ray.t_max } else { -1.0 };
        }
        for i in lanes(samples.beyond & active) {
            set_lane(&mut direction, i, lane(&samples.directions, i));
            ends[i] = f32::INFINITY;
        }
        (RayRows::of(self.row.from, direction), ends)
    }
}

/// What a sample counts where another way to find the same light has a density so many times as high (the power heuristic:
/// Veach, *Robust Monte Carlo Methods for Light Transport Simulation*, 1997, section 9.2).
#[inline(always)]
pub fn weight(ratio: f32) -> f32 {
    1.0 / (1.0 + ratio * ratio)
}

/// Add the values of the lanes whose bits are set.
#[inline(always)]
fn add_where(bits: u32, values: &Lanes3, sums: &mut Lanes3) {
    for axis in 0..3 {
        for i in 0..LANES {
            let is_added = bits & 1 << i != 0;
            sums[axis][i] += if is_added { values[axis][i] } else { 0.0 };
        }
    }
}

/// Softens the edge where bent normals leave the light of the surface that they are on, 0 behind that; 1 where nothing
/// bends them (Chiang, Li, Burley, *Taming the Shadow Terminator*, 2019).
#[inline(always)]
fn terminator(cosine: f32, smooth: f32, bend: f32) -> f32 {
    let g = smooth / (cosine * bend);
    let g = if g < 1.0 { g } else { 1.0 };
    let soft = if bend > 0.0 { -g * g * g + g * g + g } else { 1.0 };
    if (smooth > 0.0) | (bend == UNBENT) { soft } else { 0.0 }
}
