//! Front-to-back traversal with a stack of far children.
//!
//! Every distance is padded, so traversal never misses a triangle due to rounding. The triangle and plane
//! tests displace a ray by a few rounding errors relative to the lengths involved. No such length exceeds the
//! distance from the ray's origin to the far end of the mesh.

use super::KdTree;
use super::node::DecodedNode;
use crate::geometry::watertight::ShearedRay;
use crate::geometry::{Aabb, Ray, ShapeHit};

/// Displacement of a ray due to rounding, relative to the largest length.
const RAY_DISPLACEMENT: f32 = 32.0 * f32::EPSILON;

/// Stack size. The depth limit is lower even for the largest possible number of triangles.
pub(super) const STACK_SIZE: usize = 64;

/// A ray preprocessed for plane tests. Its parameter is relative to a scaled direction whose largest
/// component is between 1 and 2.
struct PlaneRay {
    origin: [f32; 3],
    inverse: [f32; 3],
    backward: [bool; 3],
    /// Maximum displacement of a plane or the ray due to rounding.
    pad: f32,
    /// Scaled ray parameter per unit of `t`.
    steps: f32,
}

impl PlaneRay {
    fn new(ray: &Ray, bounds: &Aabb) -> Self {
        let largest = ray.direction.abs().max_element();
        // Compute the next lower power of two from the exponent bits. Scaling by a power of two is exact.
        let steps =
            f32::from_bits(largest.to_bits() & 0x7f80_0000).clamp(f32::MIN_POSITIVE, 1.0 / f32::MIN_POSITIVE);
        let inverse = (ray.direction * (1.0 / steps)).recip();
        let reach = (bounds.min - ray.origin).abs().max((bounds.max - ray.origin).abs()).max_element();
        Self {
            origin: ray.origin.to_array(),
            inverse: inverse.to_array(),
            backward: inverse.to_array().map(|inverse| inverse.is_sign_negative()),
            pad: reach * RAY_DISPLACEMENT,
            steps,
        }
    }

    /// Lower and upper bounds on the ray's distance to a plane. If the ray is in the plane (up to rounding),
    /// the bounds include all distances. For other parallel rays, both are −∞ or both are ∞. NaN means
    /// unbounded.
    #[inline(always)]
    fn plane_distance_bounds(&self, axis: usize, at: f32) -> (f32, f32) {
        let distance = at - self.origin[axis];
        let low = (distance - self.pad) * self.inverse[axis];
        let high = (distance + self.pad) * self.inverse[axis];
        if self.backward[axis] { (high, low) } else { (low, high) }
    }

    /// Interval of the ray inside a box.
    fn box_interval(&self, bounds: &Aabb, t_max: f32) -> Option<(f32, f32)> {
        let (mut near, mut far) = (0.0_f32, self.ray_end_in_scaled_parameter(t_max));
        for axis in 0..3 {
            let (low, high) = (
                self.plane_distance_bounds(axis, bounds.min[axis]),
                self.plane_distance_bounds(axis, bounds.max[axis]),
            );
            let (enter, leave) = if self.backward[axis] { (high.0, low.1) } else { (low.0, high.1) };
            near = if enter > near { enter } else { near };
            far = if leave < far { leave } else { far };
        }
        (near <= far).then_some((near, far))
    }

    /// Scaled ray parameter at which a ray with end `t_max` ends.
    #[inline(always)]
    fn ray_end_in_scaled_parameter(&self, t_max: f32) -> f32 {
        t_max * self.steps + self.pad
    }
}

/// Stack entry: a node and the ray's interval inside it.
type PendingNode = (u32, f32, f32);

impl KdTree {
    /// Finds the nearest hit. Among hits at the same distance, the lowest triangle index wins.
    pub fn closest_hit(&self, ray: &Ray) -> Option<ShapeHit> {
        let sheared = ShearedRay::new(ray.origin, ray.direction);
        let mut best: Option<ShapeHit> = None;
        let mut t_max = ray.t_max;
        self.visit_leaves(ray, |leaf| {
            for &place in leaf {
                let triangle = &self.triangles[place as usize];
                if triangle.id == ray.start {
                    continue;
                }
                let Some(hit) = sheared.intersect(&triangle.corners, t_max) else { continue };
                if best.is_none_or(|best| (hit.t, triangle.id) < (best.t, best.primitive)) {
                    best = Some(ShapeHit { primitive: triangle.id, ..hit });
                    t_max = hit.t;
                }
            }
            Some(t_max)
        });
        best
    }

    /// Whether the ray hits any triangle other than `except`.
    pub fn any_hit(&self, ray: &Ray, except: Option<u32>) -> bool {
        let sheared = ShearedRay::new(ray.origin, ray.direction);
        let mut found = false;
        self.visit_leaves(ray, |leaf| {
            found = leaf.iter().any(|&place| {
                let triangle = &self.triangles[place as usize];
                let is_left_out = Some(triangle.id) == except || triangle.id == ray.start;
                !is_left_out && sheared.intersect(&triangle.corners, ray.t_max).is_some()
            });
            (!found).then_some(ray.t_max)
        });
        found
    }

    /// Visits the leaves that the ray may hit, front to back. `test` receives a leaf's triangle indices and
    /// returns the ray's new end, or `None` to stop. Non-finite rays visit no leaves.
    #[inline(always)]
    fn visit_leaves(&self, ray: &Ray, mut test: impl FnMut(&[u32]) -> Option<f32>) {
        if self.nodes.is_empty() || !ray.origin.is_finite() || !ray.direction.is_finite() {
            return;
        }
        let planes = PlaneRay::new(ray, &self.bounds);
        let Some((mut near, mut far)) = planes.box_interval(&self.bounds, ray.t_max) else { return };
        let mut stack: [PendingNode; STACK_SIZE] = [(0, 0.0, 0.0); STACK_SIZE];
        let mut size = 0;
        let mut place = 0;
        loop {
            match self.nodes[place as usize].decode() {
                DecodedNode::Inner { axis, at, right } => {
                    let (low, high) = planes.plane_distance_bounds(axis, at);
                    let (first, second) =
                        if planes.backward[axis] { (right, place + 1) } else { (place + 1, right) };
                    if low > far {
                        place = first;
                    } else if high < near {
                        place = second;
                    } else {
                        stack[size] = (second, if low > near { low } else { near }, far);
                        size += 1;
                        place = first;
                        far = if high < far { high } else { far };
                    }
                    continue;
                }
                DecodedNode::Leaf { first, count } => {
                    let references = &self.references[first as usize..][..count as usize];
                    let Some(t_max) = test(references) else { return };
                    let end = planes.ray_end_in_scaled_parameter(t_max);
                    loop {
                        if size == 0 {
                            return;
                        }
                        size -= 1;
                        (place, near, far) = stack[size];
                        if !(near > end) {
                            break;
                        }
                    }
                }
            }
        }
    }
}
