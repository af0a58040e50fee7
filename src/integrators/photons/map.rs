//! A photon map: photons by the cells of a grid, of which only a hash is kept, so that the grid may be as fine as the radius asks for
//! wherever photons are.

use crate::control::{CancelToken, Cancelled};
use crate::math::Vec3;

/// Light that arrived at a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Photon {
    /// Where.
    pub point: Vec3,
    /// Unit direction that it came from.
    pub direction: Vec3,
    /// Basic flux in W, Φ/n².
    pub flux: Vec3,
    /// Unit normal of the facet on the side that it came to.
    pub normal: Vec3,
    /// Scatterings on its way.
    pub depth: u32,
}

/// Photons that are put into their places between two looks at the token.
const POLL_INTERVAL: usize = 1 << 16;

/// Photons that are looked up together.
const LANES: usize = 16;

/// Photons and where they are.
#[derive(Clone, Debug)]
pub struct PhotonMap {
    radius: f32,
    /// Cells on a unit of length.
    cells: f32,
    /// Buckets less one; their number is a power of two.
    mask: u32,
    /// Where the photons of each bucket start; one more for the end.
    starts: Vec<u32>,
    /// Coordinates of the photons, and some more that are nowhere: loops run over all lanes.
    x: Vec<f32>,
    y: Vec<f32>,
    z: Vec<f32>,
    photons: Vec<Photon>,
}

/// Least cosine between the normals of surfaces that a kernel reaches over.
const LEAST_COSINE: f32 = 0.7;

/// How far from a tangent plane photons are taken, in radii.
const REACH: f32 = 0.3;

impl PhotonMap {
    /// Of some photons, for a kernel of this radius; those of a cell in the order given.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn new(photons: &[Photon], radius: f32, token: &CancelToken) -> Result<Self, Cancelled> {
        let cells = 0.5 / radius;
        let mask = (photons.len().max(1).next_power_of_two() - 1) as u32;
        let mut starts = vec![0_u32; mask as usize + 2];
        let mut buckets = Vec::with_capacity(photons.len());
        for photons in photons.chunks(POLL_INTERVAL) {
            token.check()?;
            for photon in photons {
                let [x, y, z] = cell_of(photon.point, cells);
                let bucket = bucket(x, y, z, mask);
                starts[bucket as usize + 1] += 1;
                buckets.push(bucket);
            }
        }
        for i in 1..starts.len() {
            starts[i] += starts[i - 1];
        }
        token.check()?;
        let mut next = starts.clone();
        let mut order = vec![0_u32; photons.len()];
        for (number, &bucket) in (0..).zip(&buckets) {
            let place = &mut next[bucket as usize];
            order[*place as usize] = number;
            *place += 1;
        }
        let mut sorted = Vec::with_capacity(photons.len());
        for order in order.chunks(POLL_INTERVAL) {
            token.check()?;
            sorted.extend(order.iter().map(|&number| photons[number as usize]));
        }
        let photons = sorted;
        let nowhere = std::iter::repeat_n(f32::INFINITY, LANES);
        let along = |axis: usize| {
            photons.iter().map(move |photon| photon.point[axis]).chain(nowhere.clone()).collect::<Vec<f32>>()
        };
        let (x, y, z) = (along(0), along(1), along(2));
        Ok(Self { radius, cells, mask, starts, x, y, z, photons })
    }

    /// All photons, by their cells.
    pub fn photons(&self) -> &[Photon] {
        &self.photons
    }

    /// Of how many photons.
    pub fn len(&self) -> usize {
        self.photons.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.photons.is_empty()
    }

    /// Radius of its kernel.
    pub fn radius(&self) -> f32 {
        self.radius
    }

    /// Bytes that it takes.
    pub fn memory_bytes(&self) -> usize {
        size_of_val(&*self.photons) + 4 * (self.starts.len() + 3 * self.x.len())
    }

    /// Visit the photons within the radius of a point of a surface whose normal on the side at hand is known, which came to that side
    /// after at most so many scatterings; each with what its flux counts: Epanechnikov's kernel, in m⁻², whose integral over the
    /// tangent plane is 1 (Silverman, *Density Estimation for Statistics and Data Analysis*, 1986).
    #[inline(always)]
    pub fn visit(&self, (point, normal): (Vec3, Vec3), most_depth: u32, mut visit: impl FnMut(&Photon, f32)) {
        if self.photons.is_empty() {
            return;
        }
        let radius_squared = self.radius * self.radius;
        let reach = REACH * self.radius;
        let scale = 2.0 / (std::f32::consts::PI * radius_squared);
        debug_assert!(self.x.len() == self.photons.len() + LANES);
        let corner = point - Vec3::splat(self.radius);
        let first = cell_of(corner, self.cells);
        // Cells are as long as the kernel is wide: it reaches over two of them.
        for number in 0..4_u32 {
            let (y, z) =
                (first[1].wrapping_add((number & 1) as i32), first[2].wrapping_add((number >> 1) as i32));
            let begin = bucket(first[0], y, z, self.mask);
            for bucket in
                [begin, begin.wrapping_add(1) & self.mask].into_iter().take(self.mask.min(1) as usize + 1)
            {
                let range = self.starts[bucket as usize] as usize..self.starts[bucket as usize + 1] as usize;
                for start in range.clone().step_by(LANES) {
                    let mut near = [0_u32; LANES];
                    let mut squares = [0.0; LANES];
                    let (Some(xs), Some(ys), Some(zs)) =
                        (row(&self.x, start), row(&self.y, start), row(&self.z, start))
                    else {
                        continue;
                    };
                    for i in 0..LANES {
                        let (dx, dy, dz) = (xs[i] - point.x, ys[i] - point.y, zs[i] - point.z);
                        let above = dx * normal.x + dy * normal.y + dz * normal.z;
                        let along = dx * dx + dy * dy + dz * dz - above * above;
                        squares[i] = along;
                        near[i] = u32::from((along < radius_squared) & (above.abs() < reach));
                    }
                    for i in 0..LANES.min(range.end - start) {
                        if near[i] == 0 {
                            continue;
                        }
                        let photon = &self.photons[start + i];
                        let [_, own_y, own_z] = cell_of(photon.point, self.cells);
                        // Of other cells with the same hash.
                        if own_y != y || own_z != z {
                            continue;
                        }
                        let faces =
                            photon.normal.dot(normal) > LEAST_COSINE && photon.direction.dot(normal) > 0.0;
                        if faces && photon.depth <= most_depth {
                            let share = 1.0 - squares[i].max(0.0) / radius_squared;
                            visit(photon, scale * share);
                        }
                    }
                }
            }
        }
    }
}

/// Numbers from a place on; there are some more behind the last.
#[inline(always)]
fn row(of: &[f32], start: usize) -> Option<&[f32; LANES]> {
    of.get(start..)?.first_chunk()
}

/// The cell of a point.
#[inline(always)]
fn cell_of(point: Vec3, cells: f32) -> [i32; 3] {
    // The system's floor is a call; a number that is too large for its cell is in the last one.
    let below = |x: f32| {
        let whole = x as i32;
        whole.wrapping_sub(i32::from(whole as f32 > x))
    };
    [below(point.x * cells), below(point.y * cells), below(point.z * cells)]
}

/// The bucket of a cell: those of one column follow each other.
#[inline(always)]
fn bucket(x: i32, y: i32, z: i32, mask: u32) -> u32 {
    let hash = (y as u32).wrapping_mul(0x9e37_79b1) ^ (z as u32).wrapping_mul(0x85eb_ca77).rotate_left(16);
    (hash ^ hash >> 15).wrapping_mul(0x2c1b_3c6d).rotate_left(13).wrapping_add(x as u32) & mask
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::signed as random;

    fn photon(point: Vec3, normal: Vec3) -> Photon {
        Photon { point, direction: normal, flux: Vec3::ONE, normal, depth: 1 }
    }

    #[test]
    fn a_map_finds_what_a_look_at_all_photons_finds_each_once() {
        let mut next = random(5);
        for count in [0, 1, 2, 3, 17, 3000] {
            for radius in [1e-3_f32, 0.05, 0.4, 30.0] {
                let place = |next: &mut dyn FnMut() -> f32| {
                    let point = Vec3::new(next(), next(), 0.1 * next()) * 3.0;
                    let normal = if next() > 0.0 { Vec3::Z } else { Vec3::new(0.6, 0.0, 0.8) };
                    (point, normal)
                };
                let photons: Vec<Photon> =
                    (0..count).map(|_| place(&mut next)).map(|(p, n)| photon(p, n)).collect();
                let map = PhotonMap::new(&photons, radius, &CancelToken::new()).expect("nobody cancels");
                assert_eq!(map.len(), count);
                let mut seen = 0;
                for look in 0..60 {
                    let (point, normal) = match photons.get(7 * look) {
                        // Near one of them.
                        Some(photon) => (
                            photon.point + 0.1 * radius * Vec3::new(next(), next(), 0.1 * next()),
                            photon.normal,
                        ),
                        None => place(&mut next),
                    };
                    let mut found = Vec::new();
                    map.visit((point, normal), 1, |photon, density| {
                        found.push((photon.point.to_array(), density));
                    });
                    let near = |photon: &&Photon| {
                        let way = photon.point - point;
                        let above = way.dot(normal);
                        let is_near = way.length_squared() - above * above < radius * radius;
                        let is_flat = above.abs() < REACH * radius;
                        is_near && is_flat && photon.normal.dot(normal) > LEAST_COSINE
                    };
                    let mut expected: Vec<_> =
                        photons.iter().filter(near).map(|photon| photon.point.to_array()).collect();
                    let mut points: Vec<_> = found.iter().map(|(point, _)| *point).collect();
                    points.sort_by(|a, b| a.partial_cmp(b).expect("numbers"));
                    expected.sort_by(|a, b| a.partial_cmp(b).expect("numbers"));
                    assert!(points.len().abs_diff(expected.len()) <= 1, "but for rounding at the edge");
                    seen += expected.len();
                    let peak = 2.0 / (std::f32::consts::PI * radius * radius);
                    assert!(found.iter().all(|(_, density)| *density >= 0.0 && *density <= peak));
                    points.dedup();
                    assert_eq!(points.len(), found.len(), "each once");
                    assert!(points.iter().filter(|point| !expected.contains(point)).count() <= 1);
                }
                assert!(seen >= count.min(60) / 8, "{seen} of {count} are found within {radius}");
            }
        }
    }

    #[test]
    fn the_kernel_sums_to_one_and_leaves_out_what_came_too_late() {
        // Photons on a fine grid stand for their areas.
        let step = 0.01_f32;
        let at = |i: i32| (i as f32 + 0.3) * step;
        let place = |i: i32| photon(Vec3::new(at(i % 200 - 100), 0.5, at(i / 200 - 100)), Vec3::Y);
        let photons: Vec<Photon> = (0..40_000).map(place).collect();
        let map = PhotonMap::new(&photons, 0.4, &CancelToken::new()).expect("nobody cancels");
        let sum = |most_depth: u32, normal: Vec3| {
            let mut sum = 0.0;
            map.visit((Vec3::new(0.1, 0.5, -0.2), normal), most_depth, |_, density| {
                sum += density * step * step;
            });
            sum
        };
        assert!((sum(1, Vec3::Y) - 1.0).abs() < 2e-3, "{}", sum(1, Vec3::Y));
        assert_eq!((sum(0, Vec3::Y), sum(1, Vec3::NEG_Y)), (0.0, 0.0));
    }
}
