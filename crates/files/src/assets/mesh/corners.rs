//! Splits vertices whose corners have different attributes.

use std::collections::HashMap;

use super::parsed::ParsedMesh;
use crate::control::{CancelToken, Canceled};
use crate::geometry::mesh::VertexNormalGroup;
use crate::math::Vec2;

/// Number of corners between polls of the cancel token.
const BATCH: usize = 1 << 14;

/// A corner's vertex index, texture coordinates (as bit patterns) and color.
type VertexUvColorKey = (u32, [u32; 2], [u8; 3]);

/// Creates one vertex for each combination of vertex, texture coordinates and color that occurs at a corner.
/// New vertices keep the normal of the original vertex.
pub(super) fn split_vertices_by_uv_and_color(
    parsed: &mut ParsedMesh,
    token: &CancelToken,
) -> Result<(), Canceled> {
    let (uvs, colors) = (std::mem::take(&mut parsed.corner_uvs), std::mem::take(&mut parsed.corner_colors));
    let vertices = parsed.positions.len();
    let is_in_range = |corner: &u32| (*corner as usize) < vertices;
    // Leave out-of-range indices to `assemble`, which reports them together with the face.
    if (uvs.is_empty() && colors.is_empty()) || !parsed.faces.corners.iter().all(is_in_range) {
        return Ok(());
    }
    let mut sources = Vec::new();
    let (mut new_uvs, mut new_colors) = (Vec::new(), Vec::new());
    let mut known: HashMap<VertexUvColorKey, u32> = HashMap::new();
    for (place, corner) in parsed.faces.corners.iter_mut().enumerate() {
        if place % BATCH == 0 {
            token.check_pause_and_cancel()?;
        }
        let vertex = *corner as usize;
        let of_vertex = || parsed.uvs.get(vertex).copied().unwrap_or(Vec2::ZERO);
        let uv = uvs.get(place).copied().filter(|uv| !uv.is_nan()).unwrap_or_else(of_vertex);
        let color = colors.get(place).copied().unwrap_or_default();
        let next = sources.len() as u32;
        *corner = *known.entry((*corner, uv.to_array().map(f32::to_bits), color)).or_insert(next);
        if *corner == next {
            sources.push(vertex);
            new_uvs.push(uv);
            new_colors.push(color);
        }
    }
    replace_with_gathered_values(&mut parsed.positions, &sources);
    replace_with_gathered_values(&mut parsed.normals, &sources);
    replace_with_gathered_values(&mut parsed.uvs, &sources);
    replace_with_gathered_values(&mut parsed.second_uvs, &sources);
    replace_with_gathered_values(&mut parsed.colors, &sources);
    if !uvs.is_empty() {
        parsed.uvs = new_uvs;
    }
    if !colors.is_empty() {
        parsed.colors = new_colors;
    }
    let group =
        |vertex: &usize| VertexNormalGroup { normal: *vertex as u32, group: VertexNormalGroup::BY_ANGLE };
    parsed.normal_groups = sources.iter().map(group).collect();
    Ok(())
}

/// Replaces `values` with the values at the indices in `sources`. An empty list stays empty.
fn replace_with_gathered_values<T: Copy>(values: &mut Vec<T>, sources: &[usize]) {
    if !values.is_empty() {
        *values = sources.iter().map(|vertex| values[*vertex]).collect();
    }
}
