//! Seams: rims of one glass that close each other, which are those between the same places that go opposite ways.

use super::pieces::{Piece, Rim, Substance};
use crate::accel::Bvh;
use crate::control::{CancelToken, Cancelled};
use crate::geometry::Aabb;
use crate::math::DVec3;

/// Angle in radians within which surfaces at one edge lie on each other.
const SAME_ANGLE: f64 = 1e-3;

/// A rim with the places of its ends.
pub(super) type OpenRim = (Rim, [u32; 2]);

/// Two pieces that close each other along an edge.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seam {
    /// The rims, with the places of their ends.
    pub rims: [OpenRim; 2],
    /// Whether their fronts are on opposite sides.
    pub disagrees: bool,
}

/// Joined rims, and rims that nothing closes.
#[derive(Debug, Default)]
pub(super) struct Seams {
    pub joined: Vec<Seam>,
    /// Rims that nothing closes, with the places of their ends.
    pub open: Vec<OpenRim>,
}

/// A rim between two places.
#[derive(Clone, Copy)]
struct Half {
    /// The places, the lower first.
    places: [u32; 2],
    /// Whether it goes from the higher to the lower.
    is_back: bool,
    substance: Substance,
    rim: Rim,
}

impl Half {
    fn open(&self) -> OpenRim {
        let [low, high] = self.places;
        (self.rim, if self.is_back { [high, low] } else { [low, high] })
    }
}

impl Seam {
    /// The pieces.
    pub fn pieces(&self) -> [u32; 2] {
        self.rims.map(|(rim, _)| rim.piece)
    }
}

impl Seams {
    /// Joins rims. Of more than two along one edge, those close each other that have nothing between their backs.
    pub fn between(pieces: &[Piece], rims: &[Rim], token: &CancelToken) -> Result<Self, Cancelled> {
        let mut seams = Self::default();
        let sites = Sites::of(pieces, rims, token)?;
        // Join the rims that have both ends in common.
        let halves = rims.iter().enumerate().map(|(i, rim)| (*rim, sites.of_rim(i)));
        let open = seams.join(pieces, halves.collect());
        token.check()?;
        // Cut the rest at the ends of others, and join the parts.
        let parts = sites.cut(pieces, &open, token)?;
        seams.open = seams.join(pieces, parts);
        Ok(seams)
    }

    /// Joins rims of one glass with the same places; returns the others.
    fn join(&mut self, pieces: &[Piece], rims: Vec<OpenRim>) -> Vec<OpenRim> {
        let half = |(rim, [from, to]): OpenRim| Half {
            places: [from.min(to), from.max(to)],
            is_back: from > to,
            substance: pieces[rim.piece as usize].substance,
            rim,
        };
        let mut halves: Vec<Half> = rims.into_iter().map(half).collect();
        halves.retain(|half| half.places[0] != half.places[1]);
        // The order of the file breaks ties: the sort is stable.
        halves.sort_by_key(|half| (half.places, half.substance, half.is_back, half.rim.piece));
        let mut open = Vec::new();
        let is_same =
            |one: &Half, other: &Half| (one.places, one.substance) == (other.places, other.substance);
        for same in halves.chunk_by(is_same) {
            let mut is_closed = vec![false; same.len()];
            let mut close = |i: usize, j: usize, disagrees: bool| {
                self.joined.push(Seam { rims: [same[i], same[j]].map(|half| half.open()), disagrees });
                (is_closed[i], is_closed[j]) = (true, true);
            };
            match *same {
                [one, other] if one.is_back != other.is_back => close(0, 1, false),
                [one, other] if one.rim.piece != other.rim.piece => close(0, 1, true),
                [_] | [_, _] => {}
                _ => around(same).for_each(|[i, j]| close(i, j, false)),
            }
            let left = same.iter().zip(is_closed).filter(|(_, is_closed)| !is_closed);
            open.extend(left.map(|(half, _)| half.open()));
        }
        open
    }
}

/// Pairs of rims along one edge with a body between them: around the edge, one whose back faces ahead, and next after it one
/// whose back faces behind.
fn around(same: &[Half]) -> impl Iterator<Item = [usize; 2]> {
    let ends = |half: &Half| if half.is_back { [half.rim.ends[1], half.rim.ends[0]] } else { half.rim.ends };
    let [from, to] = ends(&same[0]);
    let axis = (to - from).normalize_or_zero();
    let beside = |half: &Half| {
        let inner = half.rim.inner - from;
        inner - axis * inner.dot(axis)
    };
    let first = beside(&same[0]).normalize_or_zero();
    let second = axis.cross(first);
    let angle = |half: &Half| {
        let inner = beside(half);
        let angle = libm::atan2(inner.dot(second), inner.dot(first));
        let angle = if angle < 0.0 { angle + std::f64::consts::TAU } else { angle };
        // The start of the circle of angles must not be between surfaces that lie on each other.
        if angle > std::f64::consts::TAU - SAME_ANGLE { 0.0 } else { angle }
    };
    let mut order: Vec<(f64, usize)> = same.iter().enumerate().map(|(i, half)| (angle(half), i)).collect();
    order.sort_by(|one, other| one.0.total_cmp(&other.0).then(one.1.cmp(&other.1)));
    // If surfaces lie on each other, one body ends before the next begins.
    for together in order.chunk_by_mut(|one, other| other.0 - one.0 < SAME_ANGLE) {
        together.sort_by_key(|&(_, i)| (same[i].is_back, i));
    }
    let order: Vec<usize> = order.into_iter().map(|(_, i)| i).collect();
    let is_back: Vec<bool> = same.iter().map(|half| half.is_back).collect();
    (0..order.len())
        .map(move |at| [order[at], order[(at + 1) % order.len()]])
        .filter(move |&[begin, end]| is_back[begin] && !is_back[end])
}

/// The places at which rims end: ends that are equal within rounding are one place.
struct Sites {
    points: Vec<DVec3>,
    tolerances: Vec<f64>,
    /// Places of the ends of each rim.
    ends: Vec<[u32; 2]>,
}

impl Sites {
    fn of(pieces: &[Piece], rims: &[Rim], token: &CancelToken) -> Result<Self, Cancelled> {
        // Ends with the same numbers first.
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
            let (own, tolerance) = (point(end), pieces[rims[end / 2].piece as usize].tolerance);
            if points.last() == Some(&own) {
                let last = tolerances.len() - 1;
                tolerances[last] = f64::max(tolerances[last], tolerance);
            } else {
                points.push(own);
                tolerances.push(tolerance);
            }
            number[end] = points.len() - 1;
        }
        // Then those that are near each other.
        let mut same: Vec<u32> = (0..points.len() as u32).collect();
        let tree = Bvh::build(&boxes(&points, &tolerances), token)?;
        for (i, (own, tolerance)) in points.iter().zip(&tolerances).enumerate() {
            tree.meeting(&around_point(*own, *tolerance), |j| {
                let reach = tolerance + tolerances[j as usize];
                if (j as usize) < i && own.distance_squared(points[j as usize]) <= reach * reach {
                    let (one, other) = (root(&mut same, i as u32), root(&mut same, j));
                    same[one.max(other) as usize] = one.min(other);
                }
            });
        }
        let mut site = |end: usize| root(&mut same, number[end] as u32);
        let ends = (0..rims.len()).map(|rim| [site(2 * rim), site(2 * rim + 1)]).collect();
        Ok(Self { points, tolerances, ends })
    }

    fn of_rim(&self, rim: usize) -> [u32; 2] {
        self.ends[rim]
    }

    /// Cuts rims at the ends of others that lie on them.
    fn cut(
        &self,
        pieces: &[Piece],
        rims: &[OpenRim],
        token: &CancelToken,
    ) -> Result<Vec<OpenRim>, Cancelled> {
        let mut ends: Vec<u32> = rims.iter().flat_map(|&(_, ends)| ends).collect();
        ends.sort_unstable();
        ends.dedup();
        let points: Vec<DVec3> = ends.iter().map(|&end| self.points[end as usize]).collect();
        let tolerances: Vec<f64> = ends.iter().map(|&end| self.tolerances[end as usize]).collect();
        let tree = Bvh::build(&boxes(&points, &tolerances), token)?;
        let mut parts = Vec::with_capacity(rims.len());
        for &(rim, [first, last]) in rims {
            let [from, to] = rim.ends;
            let tolerance = pieces[rim.piece as usize].tolerance;
            let way = to - from;
            let mut cuts = Vec::new();
            tree.meeting(
                &Aabb::around_f64([from, to]).grown(crate::math::Vec3::splat(tolerance as f32)),
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
                parts.push((Rim { ends, ..rim }, [begin.1, end.1]));
                begin = end;
            }
        }
        Ok(parts)
    }
}

fn boxes(points: &[DVec3], tolerances: &[f64]) -> Vec<Aabb> {
    points.iter().zip(tolerances).map(|(&point, &tolerance)| around_point(point, tolerance)).collect()
}

fn around_point(point: DVec3, tolerance: f64) -> Aabb {
    Aabb::around_f64([point - tolerance, point + tolerance])
}

/// The lowest number of a set of joined items.
pub(super) fn root(same: &mut [u32], of: u32) -> u32 {
    let mut at = of;
    while same[at as usize] != at {
        same[at as usize] = same[same[at as usize] as usize];
        at = same[at as usize];
    }
    at
}
