//! Glass solids: groups of surfaces that together enclose one volume of glass.
//!
//! A ray that enters glass through one object and leaves through another was inside one solid only if both
//! objects bound the same solid. Glass objects that do not enclose a volume individually (meshes, quads,
//! triangles, disks, tubes) form one solid if they share their edges. This means that their rims coincide up
//! to rounding, possibly after splitting at the ends of other rims, and that the surface continues from front
//! to front. They must have the same index of refraction and tint, so that the interior does not depend on
//! where a ray entered. A part is flipped if its orientation differs from its neighbors', and so is a solid
//! whose front faces inward. A solid is identified by its last object in file order.
//!
//! A closed mesh whose front faces inward is a cavity if it is entirely inside another solid of the same
//! glass. A hollow sphere made of two meshes is therefore one solid, just as if it were a single mesh.
//!
//! A solid with a hole is open, unless the hole is surrounded by opaque surfaces. It is unknown whether a ray
//! is inside open glass. The surface of open glass therefore only affects the medium of rays that hit or
//! leave the surface (`integrators::transport::crossing`).

mod caps;
mod cavities;
mod parts;
mod shared_edges;

use std::collections::{BTreeMap, HashMap};

use cavities::{ClosedSolid, find_cavities};
use parts::{GlassPart, GlassParts, RimEdge};
use shared_edges::{MatchedAndOpenEdges, RimEdgeWithEndpointIds, SharedEdge, find_set_root};

use crate::assets::LoadedMesh;
use crate::control::{CancelToken, Canceled};
use crate::math::DVec3;
use crate::scene::description::Scene;

/// A solid is considered closed if at most this fraction of its surface is missing.
const SMALL_HOLE: f64 = 1e-3;

/// A hole is attributed to rounding if at most this fraction of the solid's surface is missing.
const NO_HOLE: f64 = 1e-7;

/// A solid is considered to enclose no volume if its volume, relative to a cube of about the same surface
/// area, is below this value.
const NO_VOLUME: f64 = 1e-9;

/// A rim is closed if opaque surfaces cover at least this fraction of it.
const MIN_COVERED_FRACTION: f64 = 0.95;

/// Glass solids of a scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GlassSolids {
    /// Role of each object, or empty if every object is a separate solid and no solids are open.
    parts: Vec<ObjectRoleInSolid>,
    /// Glass objects with open rims.
    open: Vec<OpenGlass>,
    /// One object from each closed solid that encloses no volume.
    flat: Vec<u32>,
}

/// An object's role in a solid.
#[derive(Clone, Copy, Debug, PartialEq)]
struct ObjectRoleInSolid {
    place: u32,
    is_inside_out: bool,
    is_open: bool,
}

/// A glass object with a hole in its surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OpenGlass {
    /// Index of the object.
    pub object: u32,
    /// Number of the object's edges that no other surface shares.
    pub edges: usize,
    /// Missing fraction of the solid's surface, which exceeds 1 if the hole is larger than the surface.
    pub missing: f64,
    /// Whether the object's open edges coincide with edges of surfaces with the opposite orientation.
    pub disagrees: bool,
    /// Whether opaque surfaces surround the hole.
    pub is_covered: bool,
}

impl GlassSolids {
    /// Finds the glass solids in a scene.
    ///
    /// # Errors
    /// [`Canceled`] if the token is canceled.
    pub fn find(scene: &Scene, meshes: &[&LoadedMesh], token: &CancelToken) -> Result<Self, Canceled> {
        let parts = GlassParts::find_in_scene(scene, meshes, token)?;
        if parts.list.is_empty() {
            return Ok(Self::default());
        }
        let mut shared_edges = MatchedAndOpenEdges::match_rim_edges(&parts.list, &parts.rims, token)?;
        let groups = PartGroups::from_shared_edges(&parts, &shared_edges);
        // Reopen edges where the relative orientation of two parts differs from the rest of their common
        // border.
        let is_odd = |seam: &&SharedEdge| groups.have_opposite_orientations(seam.parts()) != seam.disagrees;
        let odd: Vec<RimEdgeWithEndpointIds> =
            shared_edges.joined.iter().filter(is_odd).flat_map(|seam| seam.rims).collect();
        shared_edges.open.extend(odd);
        let mut solids = Self::default();
        let alone = |place| ObjectRoleInSolid { place, is_inside_out: false, is_open: false };
        solids.parts = (0..scene.objects.len() as u32).map(alone).collect();
        let all = groups.parts_by_solid();
        let holes = SurfaceHole::find_per_solid(&parts, &groups, &all, &shared_edges);
        let covered = opaque_cover_flag_per_hole(scene, meshes, &parts, &holes, token)?;
        let mut closed: Vec<ClosedSolid> = Vec::new();
        for ((members, hole), &is_covered) in all.iter().zip(&holes).zip(&covered) {
            let is_open = hole.part > SMALL_HOLE && !is_covered;
            let is_first_part_inside_out =
                groups.is_first_part_inside_out(&parts, members, hole.part <= SMALL_HOLE);
            let place = members.iter().map(|&part| parts.list[part as usize].object).max();
            for &part in members {
                let object = parts.list[part as usize].object;
                let is_inside_out = is_first_part_inside_out != groups.flips[part as usize];
                solids.parts[object as usize] =
                    ObjectRoleInSolid { place: place.unwrap_or(object), is_inside_out, is_open };
                solids.open.extend(hole.describe_border_with_part(part, object, is_covered));
            }
            if hole.part <= NO_HOLE && groups.have_zero_volume(&parts, members) {
                solids.flat.extend(members.first().map(|&part| parts.list[part as usize].object));
            } else if hole.part <= SMALL_HOLE {
                closed.extend(groups.closed_solid_if_cavity_candidate(scene, &parts, members));
            }
        }
        for (cavity, around) in find_cavities(scene, meshes, parts.origin, &closed, token)? {
            solids.merge_cavity(&closed[cavity].objects, &closed[around].objects);
        }
        solids.open.sort_by_key(|open| open.object);
        let is_plain = |(object, part): (u32, &ObjectRoleInSolid)| *part == alone(object);
        if (0..).zip(&solids.parts).all(is_plain) {
            solids.parts.clear();
        }
        Ok(solids)
    }

    /// Merges a cavity into the solid around it. The cavity's front remains the outside of the glass, facing
    /// the empty space.
    fn merge_cavity(&mut self, cavity: &[u32], around: &[u32]) {
        let objects = || cavity.iter().chain(around).map(|&object| object as usize);
        let place = objects().map(|object| self.parts[object].place).max().unwrap_or_default();
        // Cavities merged earlier are already identified with the solid.
        let body = around.first().map(|&object| self.parts[object as usize].place);
        for part in self.parts.iter_mut().filter(|part| Some(part.place) == body) {
            part.place = place;
        }
        for &object in cavity {
            self.parts[object as usize] = ObjectRoleInSolid { place, is_inside_out: false, is_open: false };
        }
    }

    /// Returns the object that identifies the solid to which `object` belongs.
    pub fn solid_id(&self, object: u32) -> u32 {
        self.parts.get(object as usize).map_or(object, |part| part.place)
    }

    /// Whether the object's front faces the inside of the solid.
    pub fn is_inside_out(&self, object: u32) -> bool {
        self.parts.get(object as usize).is_some_and(|part| part.is_inside_out)
    }

    /// Whether a solid is open.
    pub fn is_open(&self, place: u32) -> bool {
        self.parts.get(place as usize).is_some_and(|part| part.is_open)
    }

    /// Whether any solid is open.
    pub fn has_open(&self) -> bool {
        self.parts.iter().any(|part| part.is_open)
    }

    /// Objects of closed solids that enclose no volume because every face is duplicated with the opposite
    /// orientation.
    pub fn zero_volume_objects(&self) -> &[u32] {
        &self.flat
    }

    /// The objects with holes in their surface, in file order.
    pub fn open_objects(&self) -> &[OpenGlass] {
        &self.open
    }
}

/// Whether opaque surfaces surround each hole.
fn opaque_cover_flag_per_hole(
    scene: &Scene,
    meshes: &[&LoadedMesh],
    parts: &GlassParts,
    holes: &[SurfaceHole],
    token: &CancelToken,
) -> Result<Vec<bool>, Canceled> {
    let is_large = |hole: &&SurfaceHole| hole.part > SMALL_HOLE;
    let rims: Vec<&[RimEdge]> = holes.iter().filter(is_large).map(|hole| &*hole.rims).collect();
    let mut parts = caps::covered_rim_fractions(scene, meshes, parts, &rims, token)?.into_iter();
    let is_covered =
        |hole: &SurfaceHole| is_large(&hole) && parts.next().is_some_and(|part| part >= MIN_COVERED_FRACTION);
    Ok(holes.iter().map(is_covered).collect())
}

/// Connected groups of parts.
struct PartGroups {
    /// First part of each part's solid.
    roots: Vec<u32>,
    /// Whether each part is oriented opposite to the first part of its solid.
    flips: Vec<bool>,
}

impl PartGroups {
    fn from_shared_edges(parts: &GlassParts, shared_edges: &MatchedAndOpenEdges) -> Self {
        let mut same: Vec<u32> = (0..parts.list.len() as u32).collect();
        for seam in &shared_edges.joined {
            let [one, other] = seam.parts().map(|part| find_set_root(&mut same, part));
            same[one.max(other) as usize] = one.min(other);
        }
        let roots: Vec<u32> = (0..same.len() as u32).map(|part| find_set_root(&mut same, part)).collect();
        // Two parts have the same orientation if their orientations agree along most of their common border.
        let mut borders = BTreeMap::new();
        for seam in &shared_edges.joined {
            let [one, other] = seam.parts();
            let length = seam.rims[0].0.ends[0].distance(seam.rims[0].0.ends[1]);
            *borders.entry([one.min(other), one.max(other)]).or_insert(0.0) +=
                if seam.disagrees { -length } else { length };
        }
        let mut neighbors = vec![Vec::new(); roots.len()];
        for ([one, other], agreed) in borders.into_iter().filter(|([one, other], _)| one != other) {
            neighbors[one as usize].push((other, agreed < 0.0));
            neighbors[other as usize].push((one, agreed < 0.0));
        }
        // Propagate orientations from each solid's first part to its neighbors.
        let mut flips = vec![None; roots.len()];
        for first in 0..roots.len() {
            if flips[first].is_some() {
                continue;
            }
            flips[first] = Some(false);
            let mut pending = vec![(first, false)];
            while let Some((part, is_flipped)) = pending.pop() {
                for &(next, disagrees) in &neighbors[part] {
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

    /// Whether two parts of one solid have different orientations.
    fn have_opposite_orientations(&self, [one, other]: [u32; 2]) -> bool {
        self.flips[one as usize] != self.flips[other as usize]
    }

    /// Volume and area of a solid, with all parts oriented like the first part.
    fn solid_volume_and_area(&self, parts: &GlassParts, members: &[u32]) -> (f64, f64) {
        let (mut volume, mut area) = (0.0, 0.0);
        for &part in members {
            let GlassPart { volume: own, area: surface, .. } = &parts.list[part as usize];
            volume += if self.flips[part as usize] { -own } else { *own };
            area += surface;
        }
        (volume, area)
    }

    /// Whether the parts of a closed solid enclose no volume.
    fn have_zero_volume(&self, parts: &GlassParts, members: &[u32]) -> bool {
        let (volume, area) = self.solid_volume_and_area(parts, members);
        volume.abs() <= NO_VOLUME * area * area.sqrt()
    }

    /// Returns the solid if it may be a cavity or contain one, that is, if it consists only of consistently
    /// oriented meshes.
    fn closed_solid_if_cavity_candidate(
        &self,
        scene: &Scene,
        parts: &GlassParts,
        members: &[u32],
    ) -> Option<ClosedSolid> {
        let objects: Vec<u32> = members.iter().map(|&part| parts.list[part as usize].object).collect();
        let are_meshes =
            objects.iter().all(|&object| scene.objects[object as usize].shape.as_mesh().is_some());
        let do_agree = members.iter().all(|&part| !self.flips[part as usize]);
        let substance = parts.list[members[0] as usize].substance;
        let (volume, _) = self.solid_volume_and_area(parts, members);
        (are_meshes && do_agree).then_some(ClosedSolid { objects, volume, substance })
    }

    /// Returns the parts of each solid.
    fn parts_by_solid(&self) -> Vec<Vec<u32>> {
        let mut members = vec![Vec::new(); self.roots.len()];
        for (part, &root) in (0..).zip(&self.roots) {
            members[root as usize].push(part);
        }
        members.retain(|members| !members.is_empty());
        members
    }

    /// Whether the front of a solid's first part faces inward, as determined from the volume of a closed
    /// solid or from the majority of an open solid's surface.
    fn is_first_part_inside_out(&self, parts: &GlassParts, members: &[u32], is_closed: bool) -> bool {
        if is_closed {
            // Smaller volumes are attributed to rounding.
            let (volume, area) = self.solid_volume_and_area(parts, members);
            return volume < -1e-9 * area * area.sqrt();
        }
        let own = members.iter().map(|&part| (&parts.list[part as usize], self.flips[part as usize]));
        let sign = |is_flipped: bool| if is_flipped { -1.0 } else { 1.0 };
        own.map(|(part, is_flipped)| sign(is_flipped) * part.area).sum::<f64>() < 0.0
    }
}

/// Missing part of a solid's surface.
struct SurfaceHole {
    rims: Vec<RimEdge>,
    /// For each edge, whether another edge of the solid coincides with it and has the same direction.
    disagree: Vec<bool>,
    /// Missing fraction of the surface.
    part: f64,
}

impl SurfaceHole {
    /// Returns the holes of all solids.
    fn find_per_solid(
        parts: &GlassParts,
        groups: &PartGroups,
        all: &[Vec<u32>],
        shared_edges: &MatchedAndOpenEdges,
    ) -> Vec<Self> {
        let mut own: HashMap<u32, Vec<RimEdgeWithEndpointIds>> = HashMap::new();
        for open in &shared_edges.open {
            own.entry(groups.roots[open.0.part as usize]).or_default().push(*open);
        }
        let hole = |members: &Vec<u32>| {
            Self::from_open_edges(parts, groups, members, own.remove(&members[0]).unwrap_or_default())
        };
        all.iter().map(hole).collect()
    }

    /// Returns the hole formed by a solid's open edges.
    fn from_open_edges(
        parts: &GlassParts,
        groups: &PartGroups,
        members: &[u32],
        mut own: Vec<RimEdgeWithEndpointIds>,
    ) -> Self {
        if own.is_empty() {
            return Self { rims: Vec::new(), disagree: Vec::new(), part: 0.0 };
        }
        // Orient the edges with the solid on their left.
        for (rim, sites) in own.iter_mut().filter(|(rim, _)| groups.flips[rim.part as usize]) {
            rim.ends.reverse();
            sites.reverse();
        }
        let key = |[from, to]: [u32; 2]| [from.min(to), from.max(to)];
        own.sort_by_key(|&(rim, sites)| (key(sites), rim.part));
        let disagree =
            own.chunk_by(|a, b| key(a.1) == key(b.1)).flat_map(|same| vec![same.len() > 1; same.len()]);
        let disagree = disagree.collect();
        // Join edges into loops at common endpoints. The sum of p × q over a loop is twice the loop's area.
        let mut sites: Vec<u32> = own.iter().flat_map(|&(_, sites)| sites).collect();
        sites.sort_unstable();
        sites.dedup();
        let number = |site: u32| sites.partition_point(|&other| other < site) as u32;
        let mut same: Vec<u32> = (0..sites.len() as u32).collect();
        for &(_, [from, to]) in &own {
            let [one, other] = [from, to].map(|site| find_set_root(&mut same, number(site)));
            same[one.max(other) as usize] = one.min(other);
        }
        let mut spans: Vec<Option<(DVec3, DVec3)>> = vec![None; sites.len()];
        for &(rim, [from, _]) in &own {
            let [p, q] = rim.ends;
            let (start, sum) =
                spans[find_set_root(&mut same, number(from)) as usize].get_or_insert((p, DVec3::ZERO));
            *sum += (p - *start).cross(q - *start);
        }
        let missing: f64 = spans.iter().flatten().map(|(_, sum)| sum.length() * 0.5).sum();
        let area: f64 = members.iter().map(|&part| parts.list[part as usize].area).sum();
        Self { rims: own.into_iter().map(|(rim, _)| rim).collect(), disagree, part: missing / area }
    }

    /// Describes the hole where it borders one part. Returns `None` if the part does not border the hole or
    /// the hole is attributed to rounding.
    fn describe_border_with_part(&self, part: u32, object: u32, is_covered: bool) -> Option<OpenGlass> {
        let own = || self.rims.iter().zip(&self.disagree).filter(|(rim, _)| rim.part == part);
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
