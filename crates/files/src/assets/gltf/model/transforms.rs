//! Transforms of nodes and skins, and checks of their size.

use super::super::GltfError;
use super::super::accessor::AccessorReader;
use super::super::description::AffineMap;
use super::super::json::JsonNode;
use super::{MAX_MAGNITUDE, SceneWalk, node_visited_twice_message};
use crate::math::{DMat3, DVec3};

impl SceneWalk<'_> {
    pub(super) fn world_transforms(&self, roots: &[usize]) -> Result<WorldTransforms, GltfError> {
        let nodes = &self.container.root.nodes;
        let mut worlds = WorldTransforms { order: Vec::new(), of_node: vec![None; nodes.len()] };
        let mut pending: Vec<(usize, AffineMap, bool)> =
            roots.iter().rev().map(|node| (*node, AffineMap::IDENTITY, true)).collect();
        while let Some((number, parent, is_parent_visible)) = pending.pop() {
            let node = nodes
                .get(number)
                .ok_or_else(|| GltfError::index_out_of_range("nodes", number, nodes.len()))?;
            if worlds.of_node[number].is_some() {
                return Err(GltfError::new(node_visited_twice_message(number)));
            }
            let placed = parent.compose(local_transform(node));
            worlds.of_node[number] = Some(placed);
            let hides = node.extensions.visibility.as_ref().is_some_and(|visibility| !visibility.visible);
            let is_visible = is_parent_visible && !hides;
            worlds.order.push((number, placed, is_visible));
            pending.extend(node.children.iter().rev().map(|child| (*child, placed, is_visible)));
        }
        Ok(worlds)
    }

    /// Transform of a skin in its bind pose (glTF 2.0, 3.7.3). In this pose, all joints yield the same
    /// transform, so only the first joint is evaluated.
    pub(super) fn bind_pose_transform(
        &mut self,
        number: usize,
        worlds: &WorldTransforms,
        place: &str,
    ) -> Result<Option<AffineMap>, GltfError> {
        let root = &self.container.root;
        let skin = root
            .skins
            .get(number)
            .ok_or_else(|| GltfError::index_out_of_range("skins", number, root.skins.len()))?;
        self.notes.add(place, "the skin is shown in its bind pose");
        let joint = skin.joints.first().and_then(|joint| *worlds.of_node.get(*joint)?);
        let Some(joint) = joint else { return Ok(None) };
        let bind = match skin.inverse_bind_matrices {
            Some(accessor) => {
                let numbers = AccessorReader::open(self.container, accessor)?;
                if numbers.count == 0 || numbers.width != 16 {
                    return Err(
                        GltfError::new("expected a matrix").add_location(format!("accessors[{accessor}]"))
                    );
                }
                affine_from_column_major(numbers.element_floats::<16>(0, 0.0).map(f64::from))
            }
            None => AffineMap::IDENTITY,
        };
        Ok(Some(joint.compose(bind)))
    }
}

/// Rejects transforms with entries above the limit. If one of the node's own properties exceeds the limit,
/// the error names that property.
pub(super) fn check_transform_magnitude(node: &JsonNode, placed: &AffineMap) -> Result<(), GltfError> {
    let largest = |numbers: &[f64]| numbers.iter().fold(0.0_f64, |largest, number| largest.max(number.abs()));
    let all = |placed: &AffineMap| {
        largest(&placed.linear.to_cols_array()).max(largest(&placed.translate.to_array()))
    };
    if all(placed) < MAX_MAGNITUDE {
        return Ok(());
    }
    let own = [
        ("scale", node.scale.as_ref().map(|numbers| &numbers[..])),
        ("translation", node.translation.as_ref().map(|numbers| &numbers[..])),
        ("matrix", node.matrix.as_ref().map(|numbers| &numbers[..])),
    ];
    let of_own = own.into_iter().filter_map(|(name, numbers)| Some((name, largest(numbers?))));
    Err(GltfError::new(
        match of_own.max_by(|a, b| a.1.total_cmp(&b.1)).filter(|(_, value)| *value >= MAX_MAGNITUDE) {
            Some((name, value)) => {
                format!("its {name} contains {value:e}, but must stay below {MAX_MAGNITUDE:e}")
            }
            None => format!(
                "its transform, including its ancestors', contains {:e}, but must stay below {MAX_MAGNITUDE:e}",
                all(placed)
            ),
        },
    ))
}

/// World transforms of all nodes.
pub(super) struct WorldTransforms {
    /// Nodes in traversal order, each with its transform and visibility (`KHR_node_visibility`).
    pub(super) order: Vec<(usize, AffineMap, bool)>,
    /// Transform of each node, or `None` for nodes outside the scene.
    pub(super) of_node: Vec<Option<AffineMap>>,
}

/// Whether a matrix is neither singular nor nearly singular.
pub(super) fn is_invertible(linear: &DMat3) -> bool {
    let [x, y, z] = [linear.x_axis, linear.y_axis, linear.z_axis];
    let (volume, edges) = (x.cross(y).dot(z), x.length() * y.length() * z.length());
    edges.is_finite() && volume.abs() > 1e-9 * edges && [x, y, z].iter().all(|axis| axis.length() > 1e-15)
}

/// Transform of a node relative to its parent.
fn local_transform(node: &JsonNode) -> AffineMap {
    if let Some(matrix) = node.matrix {
        return affine_from_column_major(matrix);
    }
    let [x, y, z, w] = node.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]);
    let length = (x * x + y * y + z * z + w * w).sqrt();
    let [x, y, z, w] =
        if length > 0.0 { [x, y, z, w].map(|part| part / length) } else { [0.0, 0.0, 0.0, 1.0] };
    // Convert the unit quaternion to a matrix.
    let rotation = DMat3::from_cols(
        DVec3::new(1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + z * w), 2.0 * (x * z - y * w)),
        DVec3::new(2.0 * (x * y - z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + x * w)),
        DVec3::new(2.0 * (x * z + y * w), 2.0 * (y * z - x * w), 1.0 - 2.0 * (x * x + y * y)),
    );
    let scale = DVec3::from(node.scale.unwrap_or([1.0; 3]));
    AffineMap {
        linear: rotation * DMat3::from_diagonal(scale),
        translate: DVec3::from(node.translation.unwrap_or_default()),
    }
}

/// Affine transform from a column-major 4 × 4 matrix.
fn affine_from_column_major(matrix: [f64; 16]) -> AffineMap {
    let column = |first: usize| DVec3::new(matrix[first], matrix[first + 1], matrix[first + 2]);
    AffineMap { linear: DMat3::from_cols(column(0), column(4), column(8)), translate: column(12) }
}
