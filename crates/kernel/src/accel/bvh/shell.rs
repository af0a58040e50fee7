//! Spherical shells around nested surfaces. The boxes of concentric spheres are nested, so for a ray that
//! starts among the spheres, they do not narrow down which ones it hits. The shell between the smallest and
//! largest sphere in a subtree does.

use arrayvec::ArrayVec;

use super::{Bvh, ChildRef, DEEP_STACK};
use crate::geometry::aabb::{SLAB_PAD, SlabRay};
use crate::geometry::{Aabb, Ray, RayF64};
use crate::math::DVec3;

/// Relative error bound for distances and hits, with a generous margin.
const ROUNDING: f64 = 1e-6;

/// Ratio of squared distance to squared outer radius beyond which rounding errors make shells useless.
const MAX_SQUARED_DISTANCE_RATIO: f64 = 1e12;

/// A region between two concentric spheres that contains the surfaces of some primitives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SphericalShell {
    center: DVec3,
    /// Radius of a ball that every primitive encloses. Negative if there is no such ball.
    inner: f64,
    outer: f64,
}

/// Position of a box relative to a shell.
enum BoxShellRelation {
    /// All primitives enclose the box.
    Enclosed,
    /// The box may intersect a surface.
    Near,
    Outside,
}

impl SphericalShell {
    /// The shell of an empty set.
    const EMPTY: Self = Self { center: DVec3::ZERO, inner: f64::INFINITY, outer: f64::NEG_INFINITY };

    /// The shell of a single sphere.
    pub fn from_sphere(center: DVec3, radius: f64) -> Self {
        Self { center, inner: radius, outer: radius }
    }

    /// The shell around the bounding box of an arbitrary primitive. It has no inner ball.
    pub fn enclosing_box(bounds: &Aabb) -> Self {
        let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
        let center = (min + max) * 0.5;
        Self { center, inner: f64::NEG_INFINITY, outer: (max - center).length() }
    }

    /// The shell around two shells. It is centered on the shell with the smaller inner ball.
    fn union(self, other: Self) -> Self {
        let (a, b) = if self.inner <= other.inner { (self, other) } else { (other, self) };
        let apart = a.center.distance(b.center);
        if b.outer == f64::NEG_INFINITY {
            return a;
        }
        Self { inner: a.inner.min(b.inner - apart), outer: a.outer.max(b.outer + apart), ..a }
    }

    /// The shell with a margin for rounding errors.
    fn padded(self) -> Self {
        let room = ROUNDING * (self.outer.max(0.0) + self.center.abs().max_element());
        Self { inner: self.inner - room, outer: self.outer + room, ..self }
    }

    /// Returns a lower bound on the distance at which a ray hits a surface in the shell, or `None` if the ray
    /// misses the shell.
    fn entry_distance(&self, ray: &RayF64) -> Option<f32> {
        let to_origin = ray.origin - self.center;
        let distance = to_origin.length_squared();
        let is_inside = self.inner > 0.0 && distance < self.inner * self.inner;
        let is_outside = distance > self.outer * self.outer;
        if !(is_inside || is_outside) || distance > MAX_SQUARED_DISTANCE_RATIO * self.outer * self.outer {
            return Some(0.0);
        }
        let a = ray.direction.length_squared();
        let b = -to_origin.dot(ray.direction);
        let foot = to_origin + ray.direction * (b / a);
        let radius = if is_inside { self.inner } else { self.outer };
        let discriminant = radius * radius - foot.length_squared();
        if is_outside && (b < 0.0 || discriminant < 0.0) {
            return None;
        }
        let half = (a * discriminant.max(0.0)).sqrt();
        let t = if is_inside { b + half } else { b - half };
        Some((t / a * (1.0 - ROUNDING)) as f32)
    }

    fn classify_box(&self, bounds: &Aabb) -> BoxShellRelation {
        let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
        let nearest = self.center.clamp(min, max).distance_squared(self.center);
        let farthest = (self.center - min).abs().max((self.center - max).abs()).length_squared();
        if self.inner > 0.0 && farthest < self.inner * self.inner {
            BoxShellRelation::Enclosed
        } else if nearest > self.outer * self.outer {
            BoxShellRelation::Outside
        } else {
            BoxShellRelation::Near
        }
    }
}

/// A primitive or subtree reported by [`Bvh::visit_surfaces_overlapping_box`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PrimitiveOrSubtreeAroundBox {
    /// A primitive whose surface may intersect the box.
    Primitive(u32),
    /// A subtree in which every primitive encloses the box, identified by its index in
    /// [`Bvh::n_highest_ids_by_subtree`].
    Enclosing(usize),
}

impl Bvh {
    /// Whether the tree has shells. Single rays use them, but packets use only the boxes and are slow in such
    /// trees.
    #[inline(always)]
    pub fn has_shells(&self) -> bool {
        self.shells.is_some()
    }

    /// Adds shells if many primitives are nested. `shell` returns the shell of one primitive.
    pub fn with_shells_if_nested(self, shell: impl Fn(u32) -> SphericalShell) -> Self {
        if !self.is_nested {
            return self;
        }
        let shells = self.fold_primitives_per_subtree(SphericalShell::EMPTY, shell, SphericalShell::union);
        let shells = shells.into_iter().map(|both| both.map(SphericalShell::padded)).collect();
        Self { shells: Some(shells), ..self }
    }

    /// Returns, for each subtree, the `N` highest primitive ids that satisfy `counts`, in descending order.
    /// Empty if the tree has no shells.
    pub fn n_highest_ids_by_subtree<const N: usize>(
        &self,
        counts: impl Fn(u32) -> bool,
    ) -> Vec<ArrayVec<u32, N>> {
        if self.shells.is_none() {
            return Vec::new();
        }
        let own = |id: u32| counts(id).then_some(id).into_iter().collect();
        let join = |a: ArrayVec<u32, N>, b: ArrayVec<u32, N>| {
            let mut all: Vec<u32> = a.into_iter().chain(b).collect();
            all.sort_unstable_by(|a, b| b.cmp(a));
            all.into_iter().take(N).collect()
        };
        self.fold_primitives_per_subtree(ArrayVec::new(), own, join).into_iter().flatten().collect()
    }

    /// Folds a value over the primitives of every subtree.
    fn fold_primitives_per_subtree<T: Clone>(
        &self,
        empty: T,
        own: impl Fn(u32) -> T,
        join: impl Fn(T, T) -> T,
    ) -> Vec<[T; 2]> {
        let mut values = vec![[empty.clone(), empty.clone()]; self.nodes.len()];
        // Child nodes follow their parents.
        for (place, node) in self.nodes.iter().enumerate().rev() {
            for side in (0..2).filter(|&side| !node.bounds[side].is_empty()) {
                let ChildRef { first, count } = node.child[side];
                values[place][side] = if count == 0 {
                    let [left, right] = values[first as usize].clone();
                    join(left, right)
                } else {
                    let ids = &self.order[first as usize..(first + count) as usize];
                    ids.iter().map(|&id| own(id)).fold(empty.clone(), &join)
                };
            }
        }
        values
    }

    /// Visits every primitive whose surface may intersect a box, until `visit` returns false. A subtree whose
    /// primitives all enclose the box is reported as a single item. Without shells, this is equivalent to
    /// [`Bvh::visit_overlapping`].
    pub fn visit_surfaces_overlapping_box(
        &self,
        other: &Aabb,
        mut visit: impl FnMut(PrimitiveOrSubtreeAroundBox) -> bool,
    ) {
        let Some(shells) = &self.shells else {
            let mut continues = true;
            return self.visit_overlapping(other, |id| {
                continues = continues && visit(PrimitiveOrSubtreeAroundBox::Primitive(id));
            });
        };
        let mut stack = ArrayVec::<ChildRef, { DEEP_STACK + 1 }>::new();
        stack.push(ChildRef { first: 0, count: 0 });
        while let Some(ChildRef { first, count }) = stack.pop() {
            if count > 0 {
                let ids = &self.order[first as usize..(first + count) as usize];
                if !ids.iter().all(|&id| visit(PrimitiveOrSubtreeAroundBox::Primitive(id))) {
                    return;
                }
                continue;
            }
            let (node, shells) = (&self.nodes[first as usize], &shells[first as usize]);
            for side in (0..2).filter(|&side| node.bounds[side].overlaps(other)) {
                match shells[side].classify_box(other) {
                    BoxShellRelation::Outside => {}
                    BoxShellRelation::Near => stack.push(node.child[side]),
                    BoxShellRelation::Enclosed
                        if visit(PrimitiveOrSubtreeAroundBox::Enclosing(2 * first as usize + side)) => {}
                    BoxShellRelation::Enclosed => return,
                }
            }
        }
    }

    /// The closest-hit traversal with shells. The callback is `dyn` because compiling this function
    /// separately for each caller would not make it faster.
    #[cold]
    #[inline(never)]
    pub(super) fn visit_with_spherical_shells(
        &self,
        shells: &[[SphericalShell; 2]],
        ray: &Ray,
        test: &mut dyn FnMut(u32, f32) -> Option<f32>,
    ) {
        let mut t_max = ray.t_max;
        let enter = ShellRay::new(ray);
        let mut stack = ArrayVec::<(f32, ChildRef), { DEEP_STACK + 1 }>::new();
        stack.push((0.0, ChildRef { first: 0, count: 0 }));
        while let Some((entry, ChildRef { first, count })) = stack.pop() {
            if !(entry <= t_max * SLAB_PAD) {
                continue;
            }
            if count > 0 {
                for &id in &self.order[first as usize..(first + count) as usize] {
                    t_max = test(id, t_max).unwrap_or(t_max);
                }
                continue;
            }
            let (node, shells) = (&self.nodes[first as usize], &shells[first as usize]);
            let [left, right] =
                [0, 1].map(|side| enter.entry_distance(&node.bounds[side], &shells[side], t_max));
            let children = [(left, node.child[0]), (right, node.child[1])];
            let far_first = if right < left { children } else { [children[1], children[0]] };
            stack.extend(far_first.into_iter().filter_map(|(entry, child)| Some((entry?, child))));
        }
    }

    /// [`Bvh::any_hit`] with shells.
    #[cold]
    #[inline(never)]
    pub(super) fn any_hit_culled_by_shells(
        &self,
        shells: &[[SphericalShell; 2]],
        ray: &Ray,
        test: &mut dyn FnMut(u32) -> bool,
    ) -> bool {
        let enter = ShellRay::new(ray);
        let mut stack = ArrayVec::<ChildRef, { DEEP_STACK + 1 }>::new();
        stack.push(ChildRef { first: 0, count: 0 });
        while let Some(ChildRef { first, count }) = stack.pop() {
            if count > 0 {
                let ids = &self.order[first as usize..(first + count) as usize];
                if ids.iter().any(|&id| test(id)) {
                    return true;
                }
                continue;
            }
            let (node, shells) = (&self.nodes[first as usize], &shells[first as usize]);
            let is_hit =
                |side: &usize| enter.entry_distance(&node.bounds[*side], &shells[*side], ray.t_max).is_some();
            stack.extend((0..2).filter(is_hit).map(|side| node.child[side]));
        }
        false
    }
}

/// A ray preprocessed for box and shell tests.
struct ShellRay {
    slabs: SlabRay,
    line: RayF64,
}

impl ShellRay {
    fn new(ray: &Ray) -> Self {
        Self { slabs: SlabRay::new(ray.origin, ray.direction), line: ray.to_f64() }
    }

    /// Returns a lower bound on the distance at which the ray hits a surface, or `None` if it misses the box
    /// or the shell.
    fn entry_distance(&self, bounds: &Aabb, shell: &SphericalShell, t_max: f32) -> Option<f32> {
        let of_box = self.slabs.entry_distance(bounds.min, bounds.max, t_max)?;
        let of_shell = shell.entry_distance(&self.line)?;
        let entry = if of_shell > of_box { of_shell } else { of_box };
        (entry <= t_max * SLAB_PAD).then_some(entry)
    }
}

#[cfg(test)]
#[path = "shell_tests.rs"]
mod tests;
