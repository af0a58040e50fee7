//! Faces of a mesh light that coincide with each other or with other faces of the mesh.
//!
//! Duplicate faces emit only once: they are given the same corners in the same order, so that rays always hit
//! the first. Emissive faces in the plane of a face that does not emit or that faces the other way are moved
//! off the plane.

use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap};

use super::coplanar::{
    EmissiveFacesByMinX, FlatFace, LIFT, MAX_PAIRS, ROUNDING, SURROUNDINGS, are_coplanar_and_overlap,
};
use crate::assets::{FileMaterial, LoadedMesh};
use crate::control::{CancelToken, Canceled};
use crate::geometry::mesh::TriangleMesh;
use crate::math::{DVec3, Vec3};
use crate::scene::description::Scene;

/// For each mesh file, whether any object overrides its materials with an emissive material.
pub fn emissive_override_flags_by_mesh_file(scene: &Scene) -> Vec<bool> {
    let mut emissive = vec![false; scene.mesh_files.len()];
    for object in &scene.objects {
        if let (Some(mesh), Some(own)) = (object.shape.as_mesh(), object.material) {
            emissive[mesh.file] |= scene.materials[own].emits();
        }
    }
    emissive
}

/// Returns a copy of the mesh in which camera rays, shadow rays and light samples agree on which coincident
/// emissive triangle they reach, or `None` if there are no such triangles. If `all_emit` is false, the file's
/// materials determine the emissive triangles.
///
/// # Errors
/// [`Canceled`].
pub fn separate_coincident_emitters(
    loaded: &LoadedMesh,
    all_emit: bool,
    token: &CancelToken,
) -> Result<Option<LoadedMesh>, Canceled> {
    if !all_emit && !loaded.materials.iter().any(FileMaterial::emits) {
        return Ok(None);
    }
    let emits_in_file = |triangle: u32| {
        let material = loaded.mesh.materials.get(triangle as usize);
        material.and_then(|own| loaded.materials.get(*own as usize)).is_some_and(FileMaterial::emits)
    };
    let emits = |triangle: u32| all_emit || emits_in_file(triangle);
    let mut mesh = Cow::Borrowed(&loaded.mesh);
    let repeated = find_duplicate_emissive_triangles(&loaded.mesh, emits);
    for (triangle, rotation) in repeated.filter(|(_, rotation)| *rotation != 0) {
        mesh.to_mut().triangles[triangle as usize].rotate_left(rotation);
    }
    let (lifts, height) = find_triangle_lifts(&mesh, emits, emits_in_file, token)?;
    if !lifts.is_empty() {
        apply_triangle_lifts(mesh.to_mut(), &lifts, height);
    }
    Ok(match mesh {
        Cow::Borrowed(_) => None,
        Cow::Owned(mesh) => Some(LoadedMesh { mesh, ..loaded.clone() }),
    })
}

/// Emissive triangles with the same corners and orientation as an earlier triangle, and the rotation that
/// gives their corners the same order.
pub(super) fn find_duplicate_emissive_triangles(
    mesh: &TriangleMesh,
    emits: impl Fn(u32) -> bool,
) -> impl Iterator<Item = (u32, usize)> {
    let mut known = HashMap::new();
    (0..mesh.triangles.len() as u32).filter(move |id| emits(*id)).filter_map(move |id| {
        // Adding 0 converts −0 to 0.
        let place = |corner: Vec3| (corner + Vec3::ZERO).to_array().map(f32::to_bits);
        let mut corners = mesh.corners(id).map(place);
        let start = (0..3).min_by_key(|index| corners[*index]).unwrap_or(0);
        corners.rotate_left(start);
        let (first, first_start) = *known.entry(corners).or_insert((id, start));
        (first != id).then_some((id, (start + 3 - first_start) % 3))
    })
}

/// Finds the emissive triangles that must be moved off the plane of other faces. Returns their normals and
/// the distance to move them.
fn find_triangle_lifts(
    mesh: &TriangleMesh,
    emits: impl Fn(u32) -> bool,
    emits_in_file: impl Fn(u32) -> bool,
    token: &CancelToken,
) -> Result<(BTreeMap<usize, DVec3>, f64), Canceled> {
    let reach =
        |face: &FlatFace| face.corners.iter().fold(0.0, |most: f64, at| most.max(at.abs().max_element()));
    let face = |triangle: u32| {
        let mut face = FlatFace::new(mesh.corners(triangle).map(|corner| corner.as_dvec3()).to_vec())?;
        (face.object, face.rounding) = (triangle as usize, ROUNDING * reach(&face));
        Some(face)
    };
    let all = 0..mesh.triangles.len() as u32;
    let (mut found, mut pairs, mut sizes) = (BTreeMap::new(), 0, 1.0);
    let emissive = all.clone().filter(|id| emits(*id)).filter_map(face).collect();
    let Some(lights) = EmissiveFacesByMinX::new(emissive) else { return Ok((found, 0.0)) };
    for (other, is_light) in all.filter_map(|id| Some((face(id)?, emits(id)))) {
        token.check_pause_and_cancel()?;
        if pairs > MAX_PAIRS {
            break;
        }
        for light in lights.lights_with_touching_bounds(&other, &mut pairs) {
            // Other instances of the mesh may use the file's materials, in which only some faces emit.
            let is_dark =
                !is_light || emits_in_file(light.object as u32) && !emits_in_file(other.object as u32);
            let is_against = light.has_opposite_normal(&other);
            if (is_dark || is_against) && are_coplanar_and_overlap(light, &other) {
                found.insert(light.object, light.normal);
                // A light that consists of two sheets may be seen from a distance much greater than its size.
                sizes = if is_light && is_against { SURROUNDINGS } else { sizes };
            }
        }
    }
    let largest =
        lights.faces.iter().map(|face| reach(face).max(sizes * face.max_extent())).fold(0.0, f64::max);
    Ok((found, LIFT * largest))
}

/// Moves triangles by `height` along their normals in `lifts`. The moved triangles no longer share vertices
/// with the others.
fn apply_triangle_lifts(mesh: &mut TriangleMesh, lifts: &BTreeMap<usize, DVec3>, height: f64) {
    let mut known = HashMap::new();
    for (triangle, normal) in lifts {
        let direction = (*normal * 1e4).round().to_array().map(|part| part as i32);
        let corners = mesh.triangles[*triangle].map(|corner| {
            *known.entry((corner, direction)).or_insert_with(|| {
                let at = mesh.positions[corner as usize].as_dvec3() + *normal * height;
                append_vertex_copy_at_position(mesh, corner as usize, at.as_vec3())
            })
        });
        mesh.triangles[*triangle] = corners;
    }
}

/// Adds a copy of a vertex at position `at`.
fn append_vertex_copy_at_position(mesh: &mut TriangleMesh, vertex: usize, at: Vec3) -> u32 {
    fn push_attribute_copy<T: Copy>(values: &mut Vec<T>, vertex: usize) {
        values.extend(values.get(vertex).copied());
    }
    mesh.positions.push(at);
    push_attribute_copy(&mut mesh.normals, vertex);
    push_attribute_copy(&mut mesh.normal_groups, vertex);
    push_attribute_copy(&mut mesh.uvs, vertex);
    push_attribute_copy(&mut mesh.second_uvs, vertex);
    push_attribute_copy(&mut mesh.colors, vertex);
    (mesh.positions.len() - 1) as u32
}
