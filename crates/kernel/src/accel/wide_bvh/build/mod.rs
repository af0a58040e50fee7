//! Construction of a wide BVH. Parts are split in two with the binned surface area heuristic, in parallel,
//! until each is small enough for a single thread to build eight-wide nodes. Finally, all parts are joined.
//!
//! The tree does not depend on the number of threads.

mod join;
pub mod split;
mod subtree;
mod triangle_splits;

use rayon::prelude::*;

use super::BuildQuality;
use super::node::{TrianglePack, WideNode};
use crate::accel::reference::{SimdBounds, TriangleReference};
use crate::control::{CancelToken, Canceled};
use crate::geometry::Aabb;
use crate::math::Vec3;

use split::{ReferenceRangeWithSplit, partition};
use subtree::WideSubtree;

/// Maximum number of triangles in a part built by a single thread. The cancellation token is polled between
/// such parts.
const TASK_SIZE: usize = 8192;

/// A finished wide BVH.
pub struct BuiltWideBvh {
    pub nodes: Vec<WideNode>,
    pub packs: Vec<TrianglePack>,
    pub bounds: Aabb,
}

/// Builds a tree over `count` triangles. Triangles without a finite bounding box are skipped.
///
/// # Errors
/// [`Canceled`] if the build was canceled.
pub fn build(
    count: u32,
    corners: impl Fn(u32) -> [Vec3; 3] + Sync,
    quality: BuildQuality,
    token: &CancelToken,
) -> Result<BuiltWideBvh, Canceled> {
    let mut references = TriangleReference::collect_finite(count, &corners, token)?;
    if references.is_empty() {
        return Ok(BuiltWideBvh { nodes: Vec::new(), packs: Vec::new(), bounds: Aabb::EMPTY });
    }
    if quality == BuildQuality::High {
        references = triangle_splits::split_large_triangles(&references, &corners, token)?;
    }
    let whole = ReferenceRangeWithSplit::whole(&references);
    let bounds = whole.bounds.aabb();
    let part = build_part(&mut references, 0, whole, token)?;
    token.check_pause_and_cancel()?;
    let (nodes, leaves) = join::flatten(part);
    token.check_pause_and_cancel()?;
    let pack = |leaf: &subtree::PackReferenceRange| {
        let members = &references[leaf.first as usize..][..leaf.count as usize];
        TrianglePack::new(members.iter().map(|member| (member.id(), corners(member.id()))))
    };
    let mut packs = super::simd::pages::allocate_vec_in_huge_pages(leaves.len());
    leaves.par_iter().map(pack).collect_into_vec(&mut packs);
    Ok(BuiltWideBvh { nodes, packs, bounds })
}

/// A part of the wide BVH: an upper node or a subtree.
enum TreePart {
    /// Two halves to be collapsed into a wide node.
    Halves(Box<[(SimdBounds, TreePart); 2]>),
    /// A subtree built by a single thread.
    Built(WideSubtree),
}

/// Splits parts in parallel until they are small enough for a single thread. `start` is the index of the
/// part's first reference among all references.
fn build_part(
    references: &mut [TriangleReference],
    start: usize,
    segment: ReferenceRangeWithSplit,
    token: &CancelToken,
) -> Result<TreePart, Canceled> {
    token.check_pause_and_cancel()?;
    let Some(split) = segment.split.as_ref().filter(|_| segment.count > TASK_SIZE) else {
        return Ok(TreePart::Built(WideSubtree::build(references, start, segment)));
    };
    let (left, right) = partition(references, &segment, split);
    let (left_bounds, right_bounds) = (left.bounds, right.bounds);
    let middle = left.count;
    let (left_references, right_references) = references.split_at_mut(middle);
    let (left, right) = rayon::join(
        || build_part(left_references, start, left, token),
        || build_part(right_references, start + middle, right, token),
    );
    Ok(TreePart::Halves(Box::new([(left_bounds, left?), (right_bounds, right?)])))
}
