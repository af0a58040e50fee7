//! Normals of the limit surface. Tangents are left eigenvectors of the subdivision matrix for its second and
//! third largest eigenvalues, applied to the ring of neighbors.

use std::f64::consts::{PI, TAU};

use super::masks::edge_ring;
use super::topology::{NONE, Topology, WIDE, next_half_edge, previous_half_edge};
use crate::math::{DVec3, Vec3};

/// Number of neighbors up to which [`LimitNormalCalculator`] contains precomputed cosines and sines.
const TABLED: u32 = 24;

/// Length of a cross product of tangents, relative to the square of the ring's radius, below which it
/// consists of rounding errors.
const TINY: f64 = 1e-12;

/// Computes limit normals from the points after the last refinement, and the connectivity before it.
pub(super) struct LimitNormalCalculator<'a> {
    topology: &'a Topology,
    points: &'a [DVec3],
    /// Cosines and sines of multiples of 2π/n, for each number of neighbors n.
    turns: Vec<Vec<[f64; 2]>>,
}

impl<'a> LimitNormalCalculator<'a> {
    pub(super) fn new(topology: &'a Topology, points: &'a [DVec3]) -> Self {
        let turns = (0..=TABLED)
            .map(|count| (0..count).map(|index| cos_sin_of_turn_fraction(index, count)).collect());
        Self { topology, points, turns: turns.collect() }
    }

    /// Unit normal at the start of a half-edge, on the side of the half-edge's fan. `arms` is a buffer.
    pub(super) fn normal_at_vertex(&self, half: u32, arms: &mut Vec<DVec3>) -> Vec3 {
        let topology = self.topology;
        let vertex = topology.start_vertex(half);
        let (is_corner, usual) = (topology.is_corner(vertex), topology.vertex_halves[vertex as usize]);
        // In the only fan of a smooth vertex, start at the same half-edge for all of its texture coordinates,
        // so that the sums are identical.
        let is_smooth = !is_corner && topology.twin(usual) != NONE;
        let start = if is_smooth { usual } else { topology.first_half_edge_of_fan(half) };
        let center = self.points[vertex as usize];
        let arm = |half: u32| self.edge_middle_position(half) - center;
        arms.clear();
        let last = topology.walk_fan(start, |half| arms.push(arm(half)));
        arms.extend(last.map(arm));
        let normal = match (is_corner, last) {
            (true, _) => DVec3::ZERO,
            (false, None) => self.closed_fan_normal(arms),
            (false, Some(_)) => open_fan_normal(arms, topology.has_wide_fan_at(vertex)),
        };
        unit_or_substitute(normal, arms, last.is_some())
    }

    /// Unit normal at the middle of a half-edge's edge, on the side of its face if the edge is a crease.
    pub(super) fn normal_at_edge(&self, half: u32) -> Vec3 {
        let topology = self.topology;
        let edge = topology.edge_of_half_edge(half);
        let center = self.edge_middle_position(half);
        if topology.twin(half) == NONE {
            let [start, end] =
                [topology.start_vertex(half), topology.end_vertex(half)].map(|end| self.points[end as usize]);
            let arms = [
                end,
                self.edge_middle_position(next_half_edge(half)),
                self.edge_middle_position(previous_half_edge(half)),
                start,
            ];
            let arms = arms.map(|point| point - center);
            return unit_or_substitute(open_fan_normal(&arms, false), &arms, true);
        }
        let ring = edge_ring(topology, topology.edge_halves[edge as usize]);
        let arms = ring.map(|vertex| self.points[vertex as usize] - center);
        unit_or_substitute(self.closed_fan_normal(&arms), &arms, false)
    }

    /// Point at the middle of a half-edge's edge.
    fn edge_middle_position(&self, half: u32) -> DVec3 {
        self.points[self.topology.vertex_count() + self.topology.edge_of_half_edge(half) as usize]
    }

    /// Cross product of the tangents Σ cos(2πi/n) pᵢ and Σ sin(2πi/n) pᵢ (Loop 1987).
    fn closed_fan_normal(&self, arms: &[DVec3]) -> DVec3 {
        if arms.len() < 3 {
            return DVec3::ZERO;
        }
        let count = arms.len() as u32;
        let table = self.turns.get(arms.len());
        let (mut across, mut along) = (DVec3::ZERO, DVec3::ZERO);
        for (index, arm) in arms.iter().enumerate() {
            let [cos, sin] =
                table.map_or_else(|| cos_sin_of_turn_fraction(index as u32, count), |table| table[index]);
            across += *arm * cos;
            along += *arm * sin;
        }
        across.cross(along)
    }
}

/// Cross product of the tangent along a boundary and the one across it. `is_wide` is whether the vertex has
/// wide fans.
///
/// The mask across is sin(iπ/k) for the inner neighbors i of a fan with k faces, with the eigenvalue
/// λ = 3/8 + cos(π/k)/4, or 1/2 if the fan is wide. The first and last neighbors have equal weights, which
/// follow from the equations of the eigenvector. For k = 3, this is the mask (−2; −1, 2, 2, −1) of Hoppe et al.
/// 1994. The weight of the center does not matter, because the arms start there.
fn open_fan_normal(arms: &[DVec3], is_wide: bool) -> DVec3 {
    let faces = arms.len() - 1;
    let (along, ends) = (arms[0] - arms[faces], arms[0] + arms[faces]);
    if faces == 1 {
        return along.cross(ends);
    }
    let angle = PI / faces as f64;
    let (sin, cos) = (libm::sin(angle), libm::cos(angle));
    let is_wide = is_wide && faces >= WIDE as usize;
    let eigenvalue = if is_wide { 0.5 } else { 0.375 + 0.25 * cos };
    // The sines of the inner neighbors add up to cot(π/2k).
    let end_weight = (sin - (1.0 + cos) / sin) / (8.0 * eigenvalue - 2.0);
    let inner = (1..faces).map(|index| arms[index] * libm::sin(angle * index as f64));
    along.cross(inner.fold(ends * end_weight, |sum, arm| sum + arm))
}

/// Normalizes a cross product of tangents. If the tangents are parallel, substitutes the mean normal of the
/// faces, or if they cancel out, the normal of one face.
fn unit_or_substitute(normal: DVec3, arms: &[DVec3], is_open: bool) -> Vec3 {
    let size = arms.iter().map(|arm| arm.length_squared()).fold(0.0, f64::max);
    let is_long = |normal: &DVec3| normal.length() > TINY * size;
    let mean = || Some(sum_of_face_normals(arms, is_open)).filter(is_long);
    let face = || arms.windows(2).map(|pair| pair[0].cross(pair[1])).find(is_long);
    let normal = Some(normal).filter(is_long).or_else(mean).or_else(face);
    normal.and_then(DVec3::try_normalize).map_or(Vec3::Y, |normal| normal.as_vec3())
}

/// Cosine and sine of 2π·`index`/`count`.
fn cos_sin_of_turn_fraction(index: u32, count: u32) -> [f64; 2] {
    let angle = TAU * f64::from(index) / f64::from(count);
    [libm::cos(angle), libm::sin(angle)]
}

/// Sum of the cross products of consecutive arms, which are the normals of the faces weighted by area.
fn sum_of_face_normals(arms: &[DVec3], is_open: bool) -> DVec3 {
    let pairs = arms.windows(2).map(|pair| pair[0].cross(pair[1]));
    let last = arms[arms.len() - 1].cross(arms[0]);
    pairs.fold(if is_open { DVec3::ZERO } else { last }, |sum, normal| sum + normal)
}
