//! Shared edges: pairs of rim edges that belong to the same glass and have the same endpoints but opposite
//! directions.

use super::parts::{GlassMediumKey, GlassPart, RimEdge};
use crate::accel::Bvh;
use crate::control::{CancelToken, Canceled};
use crate::geometry::Aabb;
use crate::math::DVec3;

/// Angle in radians within which surfaces that share an edge are considered coincident.
const SAME_ANGLE: f64 = 1e-3;

/// A rim edge with the ids of its endpoints.
pub(super) type RimEdgeWithEndpointIds = (RimEdge, [u32; 2]);

/// An edge shared by two parts, where the surface continues from one part to the other.
#[derive(Clone, Copy, Debug)]
pub(super) struct SharedEdge {
    /// Both edges, and the ids of their endpoints.
    pub rims: [RimEdgeWithEndpointIds; 2],
    /// Whether the parts have opposite orientations.
    pub disagrees: bool,
}

/// Matched edges and open edges.
#[derive(Debug, Default)]
pub(super) struct MatchedAndOpenEdges {
    pub joined: Vec<SharedEdge>,
    /// Open edges, and the ids of their endpoints.
    pub open: Vec<RimEdgeWithEndpointIds>,
}

/// A rim edge normalized for matching.
#[derive(Clone, Copy)]
struct NormalizedRimEdge {
    /// Endpoint ids, lower id first.
    places: [u32; 2],
    /// Whether the edge runs from the higher to the lower id.
    is_back: bool,
    substance: GlassMediumKey,
    rim: RimEdge,
}

impl NormalizedRimEdge {
    fn original_rim_edge(&self) -> RimEdgeWithEndpointIds {
        let [low, high] = self.places;
        (self.rim, if self.is_back { [high, low] } else { [low, high] })
    }
}

impl SharedEdge {
    /// Indices of the two parts.
    pub fn parts(&self) -> [u32; 2] {
        self.rims.map(|(rim, _)| rim.part)
    }
}

impl MatchedAndOpenEdges {
    /// Matches rim edges. If more than two surfaces share an edge, surfaces with glass between them are
    /// paired.
    pub fn match_rim_edges(
        parts: &[GlassPart],
        rims: &[RimEdge],
        token: &CancelToken,
    ) -> Result<Self, Canceled> {
        let mut edges = Self::default();
        let sites = MergedEdgeEndpoints::from_rim_edges(parts, rims, token)?;
        // Match edges that have both endpoints in common.
        let halves = rims.iter().enumerate().map(|(i, rim)| (*rim, sites.endpoint_ids_of_rim_edge(i)));
        let open = edges.match_equal_edges(parts, halves.collect());
        token.check_pause_and_cancel()?;
        // Split the remaining edges at the endpoints of other edges, and match again.
        let split = sites.split_at_endpoints(parts, &open, token)?;
        edges.open = edges.match_equal_edges(parts, split);
        Ok(edges)
    }

    /// Matches edges of the same glass with the same endpoints, and returns the remaining edges.
    fn match_equal_edges(
        &mut self,
        parts: &[GlassPart],
        rims: Vec<RimEdgeWithEndpointIds>,
    ) -> Vec<RimEdgeWithEndpointIds> {
        let half = |(rim, [from, to]): RimEdgeWithEndpointIds| NormalizedRimEdge {
            places: [from.min(to), from.max(to)],
            is_back: from > to,
            substance: parts[rim.part as usize].substance,
            rim,
        };
        let mut halves: Vec<NormalizedRimEdge> = rims.into_iter().map(half).collect();
        halves.retain(|half| half.places[0] != half.places[1]);
        // The sort is stable, so ties are broken by file order.
        halves.sort_by_key(|half| (half.places, half.substance, half.is_back, half.rim.part));
        let mut open = Vec::new();
        let is_same = |one: &NormalizedRimEdge, other: &NormalizedRimEdge| {
            (one.places, one.substance) == (other.places, other.substance)
        };
        for same in halves.chunk_by(is_same) {
            let mut is_closed = vec![false; same.len()];
            let mut close = |i: usize, j: usize, disagrees: bool| {
                self.joined.push(SharedEdge {
                    rims: [same[i], same[j]].map(|half| half.original_rim_edge()),
                    disagrees,
                });
                (is_closed[i], is_closed[j]) = (true, true);
            };
            match *same {
                [one, other] if one.is_back != other.is_back => close(0, 1, false),
                [one, other] if one.rim.part != other.rim.part => close(0, 1, true),
                [_] | [_, _] => {}
                _ => pairs_with_glass_between(same).for_each(|[i, j]| close(i, j, false)),
            }
            let left = same.iter().zip(is_closed).filter(|(_, is_closed)| !is_closed);
            open.extend(left.map(|(half, _)| half.original_rim_edge()));
        }
        open
    }
}

/// Returns pairs of edges with glass between them. Two surfaces that are neighbors in angular order around
/// the common edge are paired if their backs face each other.
fn pairs_with_glass_between(same: &[NormalizedRimEdge]) -> impl Iterator<Item = [usize; 2]> {
    let ends = |half: &NormalizedRimEdge| {
        if half.is_back { [half.rim.ends[1], half.rim.ends[0]] } else { half.rim.ends }
    };
    let [from, to] = ends(&same[0]);
    let axis = (to - from).normalize_or_zero();
    let beside = |half: &NormalizedRimEdge| {
        let inner = half.rim.inner - from;
        inner - axis * inner.dot(axis)
    };
    let first = beside(&same[0]).normalize_or_zero();
    let second = axis.cross(first);
    let angle = |half: &NormalizedRimEdge| {
        let inner = beside(half);
        let angle = libm::atan2(inner.dot(second), inner.dot(first));
        let angle = if angle < 0.0 { angle + std::f64::consts::TAU } else { angle };
        // Angle 0 must not fall between coincident surfaces.
        if angle > std::f64::consts::TAU - SAME_ANGLE { 0.0 } else { angle }
    };
    let mut order: Vec<(f64, usize)> = same.iter().enumerate().map(|(i, half)| (angle(half), i)).collect();
    order.sort_by(|one, other| one.0.total_cmp(&other.0).then(one.1.cmp(&other.1)));
    // If surfaces coincide, order them so that one solid ends before the next begins.
    for together in order.chunk_by_mut(|one, other| other.0 - one.0 < SAME_ANGLE) {
        together.sort_by_key(|&(_, i)| (same[i].is_back, i));
    }
    let order: Vec<usize> = order.into_iter().map(|(_, i)| i).collect();
    let is_back: Vec<bool> = same.iter().map(|half| half.is_back).collect();
    (0..order.len())
        .map(move |at| [order[at], order[(at + 1) % order.len()]])
        .filter(move |&[begin, end]| is_back[begin] && !is_back[end])
}

/// Endpoints of rim edges, merged if they coincide up to rounding.
struct MergedEdgeEndpoints {
    points: Vec<DVec3>,
    tolerances: Vec<f64>,
    /// Endpoint ids of each edge.
    ends: Vec<[u32; 2]>,
}

impl MergedEdgeEndpoints {
    fn from_rim_edges(parts: &[GlassPart], rims: &[RimEdge], token: &CancelToken) -> Result<Self, Canceled> {
        // Merge identical points first.
        let point = |end: usize| rims[end / 2].ends[end % 2];
        let mut order: Vec<usize> = (0..2 * rims.len()).collect();
        let compare = |&one: &usize, &other: &usize| {
            let (p, q) = (point(one), point(other));
            p.x.total_cmp(&q.x).then(p.y.total_cmp(&q.y)).then(p.z.total_cmp(&q.z)).then(one.cmp(&other))
        };
        order.sort_unstable_by(compare);
        let (mut points, mut tolerances) = (Vec::new(), Vec::new());
        let mut number = vec![0_usize; order.len()];
        for end in order {
            let (own, tolerance) = (point(end), parts[rims[end / 2].part as usize].tolerance);
            if points.last() == Some(&own) {
                let last = tolerances.len() - 1;
                tolerances[last] = f64::max(tolerances[last], tolerance);
            } else {
                points.push(own);
                tolerances.push(tolerance);
            }
            number[end] = points.len() - 1;
        }
        // Then merge points within tolerance of each other.
        let mut same: Vec<u32> = (0..points.len() as u32).collect();
        let tree = Bvh::build(&endpoint_boxes(&points, &tolerances), token)?;
        for (i, (own, tolerance)) in points.iter().zip(&tolerances).enumerate() {
            tree.visit_overlapping(&box_around_point(*own, *tolerance), |j| {
                let reach = tolerance + tolerances[j as usize];
                if (j as usize) < i && own.distance_squared(points[j as usize]) <= reach * reach {
                    let (one, other) = (find_set_root(&mut same, i as u32), find_set_root(&mut same, j));
                    same[one.max(other) as usize] = one.min(other);
                }
            });
        }
        let mut site = |end: usize| find_set_root(&mut same, number[end] as u32);
        let ends = (0..rims.len()).map(|rim| [site(2 * rim), site(2 * rim + 1)]).collect();
        Ok(Self { points, tolerances, ends })
    }

    fn endpoint_ids_of_rim_edge(&self, rim: usize) -> [u32; 2] {
        self.ends[rim]
    }

    /// Splits edges at the endpoints of other edges.
    fn split_at_endpoints(
        &self,
        parts: &[GlassPart],
        rims: &[RimEdgeWithEndpointIds],
        token: &CancelToken,
    ) -> Result<Vec<RimEdgeWithEndpointIds>, Canceled> {
        let mut ends: Vec<u32> = rims.iter().flat_map(|&(_, ends)| ends).collect();
        ends.sort_unstable();
        ends.dedup();
        let points: Vec<DVec3> = ends.iter().map(|&end| self.points[end as usize]).collect();
        let tolerances: Vec<f64> = ends.iter().map(|&end| self.tolerances[end as usize]).collect();
        let tree = Bvh::build(&endpoint_boxes(&points, &tolerances), token)?;
        let mut split = Vec::with_capacity(rims.len());
        for &(rim, [first, last]) in rims {
            let [from, to] = rim.ends;
            let tolerance = parts[rim.part as usize].tolerance;
            let way = to - from;
            let mut cuts = Vec::new();
            tree.visit_overlapping(
                &Aabb::from_points_f64([from, to]).expanded(crate::math::Vec3::splat(tolerance as f32)),
                |i| {
                    let (site, point) = (ends[i as usize], points[i as usize]);
                    let along = (point - from).dot(way) / way.length_squared();
                    let off = (from + way * along).distance(point);
                    if off <= tolerance + tolerances[i as usize] && along > 0.0 && along < 1.0 {
                        cuts.push((along, site));
                    }
                },
            );
            cuts.retain(|&(_, site)| site != first && site != last);
            cuts.sort_by(|one, other| one.0.total_cmp(&other.0).then(one.1.cmp(&other.1)));
            let mut begin = (0.0, first);
            for end in cuts.into_iter().chain([(1.0, last)]) {
                let ends = [begin, end].map(|(along, _)| from + way * along);
                split.push((RimEdge { ends, ..rim }, [begin.1, end.1]));
                begin = end;
            }
        }
        Ok(split)
    }
}

fn endpoint_boxes(points: &[DVec3], tolerances: &[f64]) -> Vec<Aabb> {
    points.iter().zip(tolerances).map(|(&point, &tolerance)| box_around_point(point, tolerance)).collect()
}

fn box_around_point(point: DVec3, tolerance: f64) -> Aabb {
    Aabb::from_points_f64([point - tolerance, point + tolerance])
}

/// Finds the lowest number in a set of joined items, using union-find with path halving.
pub(super) fn find_set_root(same: &mut [u32], of: u32) -> u32 {
    let mut at = of;
    while same[at as usize] != at {
        same[at as usize] = same[same[at as usize] as usize];
        at = same[at as usize];
    }
    at
}
