//! Bodies of glass: which surfaces belong together.
//!
//! A ray that enters glass by one object and leaves it by another was in one thing only if both objects are one body. Objects of
//! glass that enclose nothing by themselves (meshes, quads, triangles, disks, tubes) are one body if they close each other: if their
//! rims are equal within rounding, whole or cut by the ends of others, and the surface continues from one front to the other. They
//! are of one glass, with the same index of refraction and tint: the inside does not depend on the way in. A piece whose front faces
//! the other way than its neighbours' is turned, and so is a body whose front faces inwards. A body has the place of its last object
//! in the order of the file.
//!
//! A closed mesh whose front faces inwards is a cavity if it is wholly inside another body of the same glass: a hollow ball of
//! two meshes is one body, as it is if both are in one file.
//!
//! A body with a hole is open, unless something opaque surrounds the hole. No ray can know whether it is inside such glass: its
//! surface only determines the medium of a ray that arrives or leaves there (`integrators::crossing`).

mod cover;
mod hollow;
mod pieces;
mod seams;

use std::collections::{BTreeMap, HashMap};

use hollow::{Closed, cavities};
use pieces::{Piece, Pieces, Rim};
use seams::{OpenRim, Seam, Seams, root};

use crate::assets::LoadedMesh;
use crate::control::{CancelToken, Cancelled};
use crate::math::DVec3;
use crate::scene::description::Scene;

/// Largest missing part of a body's surface for which it is reported as if it were whole.
const SMALL_HOLE: f64 = 1e-3;

/// Missing part of a body's surface below which a hole is rounding.
const NO_HOLE: f64 = 1e-7;

/// Volume of a body below which it encloses nothing, relative to a cube of about its surface.
const NO_VOLUME: f64 = 1e-9;

/// Least part of a rim that opaque surfaces must cover to close it.
const COVERED: f64 = 0.95;

/// The bodies of a scene's glass.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Bodies {
    /// One entry for each object; empty if each is a body of its own and none is open.
    parts: Vec<Part>,
    /// The pieces that stay open.
    open: Vec<OpenGlass>,
    /// Objects of bodies without a hole that enclose nothing, one for each body.
    flat: Vec<u32>,
}

/// An object's role in a body.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Part {
    place: u32,
    is_turned: bool,
    is_open: bool,
}

/// An object of glass that does not close a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OpenGlass {
    /// The object.
    pub object: u32,
    /// Number of its edges that nothing closes.
    pub edges: usize,
    /// The missing part of the body's surface; up to 1 is sensible, more is possible.
    pub missing: f64,
    /// Whether its edges have neighbours whose front is on the other side.
    pub disagrees: bool,
    /// Whether opaque surfaces surround the hole.
    pub is_covered: bool,
}

impl Bodies {
    /// Finds the bodies of a scene with these mesh files.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn find(scene: &Scene, meshes: &[&LoadedMesh], token: &CancelToken) -> Result<Self, Cancelled> {
        let pieces = Pieces::of(scene, meshes, token)?;
        if pieces.list.is_empty() {
            return Ok(Self::default());
        }
        let mut seams = Seams::between(&pieces.list, &pieces.rims, token)?;
        let groups = Groups::of(&pieces, &seams);
        // Pieces that disagree with the rest of their border are not closed by it.
        let is_odd = |seam: &&Seam| groups.disagree(seam.pieces()) != seam.disagrees;
        let odd: Vec<OpenRim> = seams.joined.iter().filter(is_odd).flat_map(|seam| seam.rims).collect();
        seams.open.extend(odd);
        let mut bodies = Self::default();
        let alone = |place| Part { place, is_turned: false, is_open: false };
        bodies.parts = (0..scene.objects.len() as u32).map(alone).collect();
        let all = groups.members();
        let holes = Hole::of_all(&pieces, &groups, &all, &seams);
        let covered = covered(scene, meshes, &pieces, &holes, token)?;
        let mut closed: Vec<Closed> = Vec::new();
        for ((members, hole), &is_covered) in all.iter().zip(&holes).zip(&covered) {
            let is_open = hole.part > SMALL_HOLE && !is_covered;
            let turns = groups.turns(&pieces, members, hole.part <= SMALL_HOLE);
            let place = members.iter().map(|&piece| pieces.list[piece as usize].object).max();
            for &piece in members {
                let object = pieces.list[piece as usize].object;
                let is_turned = turns != groups.flips[piece as usize];
                bodies.parts[object as usize] = Part { place: place.unwrap_or(object), is_turned, is_open };
                bodies.open.extend(hole.at(piece, object, is_covered));
            }
            if hole.part <= NO_HOLE && groups.are_flat(&pieces, members) {
                bodies.flat.extend(members.first().map(|&piece| pieces.list[piece as usize].object));
            } else if hole.part <= SMALL_HOLE {
                closed.extend(groups.closed(scene, &pieces, members));
            }
        }
        for (cavity, around) in cavities(scene, meshes, pieces.origin, &closed, token)? {
            bodies.join(&closed[cavity].objects, &closed[around].objects);
        }
        bodies.open.sort_by_key(|open| open.object);
        let is_plain = |(object, part): (u32, &Part)| *part == alone(object);
        if (0..).zip(&bodies.parts).all(is_plain) {
            bodies.parts.clear();
        }
        Ok(bodies)
    }

    /// Makes the objects of a cavity part of the body around it. Their front stays on the outside of the glass, in the cavity.
    fn join(&mut self, cavity: &[u32], around: &[u32]) {
        let objects = || cavity.iter().chain(around).map(|&object| object as usize);
        let place = objects().map(|object| self.parts[object].place).max().unwrap_or_default();
        // Cavities that joined before have the place of the body.
        let body = around.first().map(|&object| self.parts[object as usize].place);
        for part in self.parts.iter_mut().filter(|part| Some(part.place) == body) {
            part.place = place;
        }
        for &object in cavity {
            self.parts[object as usize] = Part { place, is_turned: false, is_open: false };
        }
    }

    /// The place of an object's body in the order of the file.
    pub fn place(&self, object: u32) -> u32 {
        self.parts.get(object as usize).map_or(object, |part| part.place)
    }

    /// Whether the front of an object is on the inside of its body.
    pub fn is_turned(&self, object: u32) -> bool {
        self.parts.get(object as usize).is_some_and(|part| part.is_turned)
    }

    /// Whether the body at a place is open.
    pub fn is_open(&self, place: u32) -> bool {
        self.parts.get(place as usize).is_some_and(|part| part.is_open)
    }

    /// Whether any body is open.
    pub fn has_open(&self) -> bool {
        self.parts.iter().any(|part| part.is_open)
    }

    /// Objects of bodies that have no hole and enclose nothing: each of their faces is there twice, facing both ways.
    pub fn flat(&self) -> &[u32] {
        &self.flat
    }

    /// The objects with holes in their surface, in the order of the file.
    pub fn open(&self) -> &[OpenGlass] {
        &self.open
    }
}

/// Whether opaque surfaces surround each hole.
fn covered(
    scene: &Scene,
    meshes: &[&LoadedMesh],
    pieces: &Pieces,
    holes: &[Hole],
    token: &CancelToken,
) -> Result<Vec<bool>, Cancelled> {
    let is_large = |hole: &&Hole| hole.part > SMALL_HOLE;
    let rims: Vec<&[Rim]> = holes.iter().filter(is_large).map(|hole| &*hole.rims).collect();
    let mut parts = cover::covered(scene, meshes, pieces, &rims, token)?.into_iter();
    let is_covered = |hole: &Hole| is_large(&hole) && parts.next().is_some_and(|part| part >= COVERED);
    Ok(holes.iter().map(is_covered).collect())
}

/// Joined pieces.
struct Groups {
    /// First piece of each piece's body.
    roots: Vec<u32>,
    /// Whether each piece's front faces the other way than that of the first.
    flips: Vec<bool>,
}

impl Groups {
    fn of(pieces: &Pieces, seams: &Seams) -> Self {
        let mut same: Vec<u32> = (0..pieces.list.len() as u32).collect();
        for seam in &seams.joined {
            let [one, other] = seam.pieces().map(|piece| root(&mut same, piece));
            same[one.max(other) as usize] = one.min(other);
        }
        let roots: Vec<u32> = (0..same.len() as u32).map(|piece| root(&mut same, piece)).collect();
        // Two pieces agree if most of the border between them does.
        let mut borders = BTreeMap::new();
        for seam in &seams.joined {
            let [one, other] = seam.pieces();
            let length = seam.rims[0].0.ends[0].distance(seam.rims[0].0.ends[1]);
            *borders.entry([one.min(other), one.max(other)]).or_insert(0.0) +=
                if seam.disagrees { -length } else { length };
        }
        let mut neighbours = vec![Vec::new(); roots.len()];
        for ([one, other], agreed) in borders.into_iter().filter(|([one, other], _)| one != other) {
            neighbours[one as usize].push((other, agreed < 0.0));
            neighbours[other as usize].push((one, agreed < 0.0));
        }
        // Derive each front from that of a neighbour, from the first piece on.
        let mut flips = vec![None; roots.len()];
        for first in 0..roots.len() {
            if flips[first].is_some() {
                continue;
            }
            flips[first] = Some(false);
            let mut pending = vec![(first, false)];
            while let Some((piece, is_flipped)) = pending.pop() {
                for &(next, disagrees) in &neighbours[piece] {
                    let own = &mut flips[next as usize];
                    if own.is_none() {
                        *own = Some(is_flipped != disagrees);
                        pending.push((next as usize, is_flipped != disagrees));
                    }
                }
            }
        }
        Self { roots, flips: flips.into_iter().map(Option::unwrap_or_default).collect() }
    }

    /// Whether the fronts of two pieces of one body face different ways.
    fn disagree(&self, [one, other]: [u32; 2]) -> bool {
        self.flips[one as usize] != self.flips[other as usize]
    }

    /// Volume and area of a body, with the fronts of its pieces as that of the first.
    fn volume(&self, pieces: &Pieces, members: &[u32]) -> (f64, f64) {
        let (mut volume, mut area) = (0.0, 0.0);
        for &piece in members {
            let Piece { volume: own, area: surface, .. } = &pieces.list[piece as usize];
            volume += if self.flips[piece as usize] { -own } else { *own };
            area += surface;
        }
        (volume, area)
    }

    /// Whether the pieces of a closed body enclose nothing.
    fn are_flat(&self, pieces: &Pieces, members: &[u32]) -> bool {
        let (volume, area) = self.volume(pieces, members);
        volume.abs() <= NO_VOLUME * area * area.sqrt()
    }

    /// A closed body, if all of it are meshes whose fronts agree.
    fn closed(&self, scene: &Scene, pieces: &Pieces, members: &[u32]) -> Option<Closed> {
        let objects: Vec<u32> = members.iter().map(|&piece| pieces.list[piece as usize].object).collect();
        let are_meshes = objects.iter().all(|&object| scene.objects[object as usize].shape.mesh().is_some());
        let do_agree = members.iter().all(|&piece| !self.flips[piece as usize]);
        let substance = pieces.list[members[0] as usize].substance;
        let (volume, _) = self.volume(pieces, members);
        (are_meshes && do_agree).then_some(Closed { objects, volume, substance })
    }

    /// The pieces of each body.
    fn members(&self) -> Vec<Vec<u32>> {
        let mut members = vec![Vec::new(); self.roots.len()];
        for (piece, &root) in (0..).zip(&self.roots) {
            members[root as usize].push(piece);
        }
        members.retain(|members| !members.is_empty());
        members
    }

    /// Whether the front of a body's first piece is on the inside: for a closed body by its volume, for an open one by most of its
    /// surface.
    fn turns(&self, pieces: &Pieces, members: &[u32], is_closed: bool) -> bool {
        if is_closed {
            // Less than that is rounding.
            let (volume, area) = self.volume(pieces, members);
            return volume < -1e-9 * area * area.sqrt();
        }
        let own = members.iter().map(|&piece| (&pieces.list[piece as usize], self.flips[piece as usize]));
        let sign = |is_flipped: bool| if is_flipped { -1.0 } else { 1.0 };
        own.map(|(piece, is_flipped)| sign(is_flipped) * piece.area).sum::<f64>() < 0.0
    }
}

/// Missing part of a body.
struct Hole {
    rims: Vec<Rim>,
    /// Whether each rim has another rim of its body on it, in the same direction.
    disagree: Vec<bool>,
    /// The missing part of the surface.
    part: f64,
}

impl Hole {
    /// The holes of all bodies.
    fn of_all(pieces: &Pieces, groups: &Groups, all: &[Vec<u32>], seams: &Seams) -> Vec<Self> {
        let mut own: HashMap<u32, Vec<OpenRim>> = HashMap::new();
        for open in &seams.open {
            own.entry(groups.roots[open.0.piece as usize]).or_default().push(*open);
        }
        let hole = |members: &Vec<u32>| {
            Self::of(pieces, groups, members, own.remove(&members[0]).unwrap_or_default())
        };
        all.iter().map(hole).collect()
    }

    /// The hole of a body with these open rims.
    fn of(pieces: &Pieces, groups: &Groups, members: &[u32], mut own: Vec<OpenRim>) -> Self {
        if own.is_empty() {
            return Self { rims: Vec::new(), disagree: Vec::new(), part: 0.0 };
        }
        // Go around each hole with the body on the left.
        for (rim, sites) in own.iter_mut().filter(|(rim, _)| groups.flips[rim.piece as usize]) {
            rim.ends.reverse();
            sites.reverse();
        }
        let key = |[from, to]: [u32; 2]| [from.min(to), from.max(to)];
        own.sort_by_key(|&(rim, sites)| (key(sites), rim.piece));
        let disagree =
            own.chunk_by(|a, b| key(a.1) == key(b.1)).flat_map(|same| vec![same.len() > 1; same.len()]);
        let disagree = disagree.collect();
        // Join rims with a place in common: twice the area that each loop spans is the sum of p × q.
        let mut sites: Vec<u32> = own.iter().flat_map(|&(_, sites)| sites).collect();
        sites.sort_unstable();
        sites.dedup();
        let number = |site: u32| sites.partition_point(|&other| other < site) as u32;
        let mut same: Vec<u32> = (0..sites.len() as u32).collect();
        for &(_, [from, to]) in &own {
            let [one, other] = [from, to].map(|site| root(&mut same, number(site)));
            same[one.max(other) as usize] = one.min(other);
        }
        let mut spans: Vec<Option<(DVec3, DVec3)>> = vec![None; sites.len()];
        for &(rim, [from, _]) in &own {
            let [p, q] = rim.ends;
            let (start, sum) = spans[root(&mut same, number(from)) as usize].get_or_insert((p, DVec3::ZERO));
            *sum += (p - *start).cross(q - *start);
        }
        let missing: f64 = spans.iter().flatten().map(|(_, sum)| sum.length() * 0.5).sum();
        let area: f64 = members.iter().map(|&piece| pieces.list[piece as usize].area).sum();
        Self { rims: own.into_iter().map(|(rim, _)| rim).collect(), disagree, part: missing / area }
    }

    /// Report on a piece. `None` if it has no part in a hole that is more than rounding.
    fn at(&self, piece: u32, object: u32, is_covered: bool) -> Option<OpenGlass> {
        let own = || self.rims.iter().zip(&self.disagree).filter(|(rim, _)| rim.piece == piece);
        let edges = own().count();
        let disagrees = own().all(|(_, disagrees)| *disagrees);
        (edges > 0 && self.part > NO_HOLE).then_some(OpenGlass {
            object,
            edges,
            missing: self.part,
            disagrees,
            is_covered,
        })
    }
}
