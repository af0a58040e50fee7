//! Bounds and outline of a model.

use std::collections::HashMap;
use std::collections::hash_map::Entry;

use super::super::description::ModelScene;
use super::super::{GltfError, GltfFile};
use super::MAX_MAGNITUDE;
use crate::assets::AssetError;
use crate::control::{CancelToken, ignore_progress};
use crate::geometry::mesh::TriangleMesh;
use crate::math::DVec3;

/// Maximum total number of instance vertices for which the bounds are exact.
const MAX_MEASURED: usize = 20_000_000;

impl GltfFile {
    /// Computes the bounds and outline of the instances. Unless all parts are invalid, skips the invalid
    /// parts, whose errors are reported when they are loaded.
    pub(super) fn measure_bounds_and_outline(
        &self,
        scene: &mut ModelScene,
        token: &CancelToken,
    ) -> Result<(), AssetError> {
        let mut parts: HashMap<usize, (TriangleMesh, Vec<DVec3>)> = HashMap::new();
        let (mut vertices, mut first_wrong) = (0, None);
        for instance in &scene.instances {
            let (mesh, extremes) = match parts.entry(instance.part) {
                Entry::Occupied(known) => &*known.into_mut(),
                Entry::Vacant(new) => match self.build_part_mesh(instance.part, &ignore_progress, token) {
                    Err(AssetError::Canceled(canceled)) => return Err(canceled.into()),
                    loaded => {
                        let mesh = loaded.map(|loaded| loaded.mesh).unwrap_or_else(|wrong| {
                            first_wrong.get_or_insert(wrong);
                            TriangleMesh::default()
                        });
                        let extremes = mesh.extreme_vertices();
                        new.insert((mesh, extremes))
                    }
                },
            };
            let placed = &instance.placed;
            scene.outline.extend(extremes.iter().map(|at| placed.transform_point(*at)));
            // Measure every vertex until the limit is reached, then only extreme points.
            vertices += mesh.positions.len();
            let all = mesh.positions.iter().map(|at| at.as_dvec3() + mesh.origin);
            let few = extremes.iter().copied();
            let places: &mut dyn Iterator<Item = DVec3> =
                if vertices <= MAX_MEASURED { &mut { all } } else { &mut { few } };
            for at in places.map(|at| placed.transform_point(at)) {
                let [min, max] = scene.bounds.unwrap_or([at; 2]);
                scene.bounds = Some([min.min(at), max.max(at)]);
            }
            if let Some([min, max]) = scene.bounds
                && !(min.abs().max(max.abs()).max_element() < MAX_MAGNITUDE)
            {
                let farthest = min.abs().max(max.abs()).max_element();
                let wrong = GltfError::new(format!(
                    "its mesh extends to {farthest:e}, but must stay below {MAX_MAGNITUDE:e}"
                ));
                return Err(self.malformed_error(wrong.add_location(format!("nodes[{}]", instance.node))));
            }
            token.check_pause_and_cancel()?;
        }
        match (scene.bounds, first_wrong) {
            (None, Some(wrong)) => Err(wrong),
            (None, None) | (Some(_), _) => Ok(()),
        }
    }
}
