//! Generates scenes for mesh files: OBJ, OFF, Mitsuba's serialized meshes, PLY and STL.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use super::foreign::ForeignError;
use super::frame::{FOV, frame_model};
use super::model::{
    DEFAULT_SIZE, Lighting, POLISHED_EXPONENT, POLISHED_ROUGHNESS, UsedNames, add_camera_table, add_ground,
    add_lighting, add_render_settings, file_name, model_warning,
};
use super::{ForeignReadContext, ForeignScene};
use crate::assets::gltf::ModelProjection;
use crate::assets::{AssetError, FileMaterial, LoadedMesh};
use crate::control::ignore_progress;
use crate::math::DVec3;
use crate::math::limits::MAX_MAGNITUDE;
use crate::messages::INVISIBLE_MODEL;
use crate::scene::{MORE_LIKE_THESE, SceneDocumentBuilder, SceneDocumentValue};
use crate::settings::{UpAxis, ViewSide};
use crate::stages::mesh_warnings::MAX_WARNINGS;

/// Whether the header of a PLY file mentions Blender, which exports PLY files with z as the up axis.
fn is_from_blender(path: &Path) -> bool {
    const START: usize = 256;
    let mut start = [0; START];
    let read = File::open(path).and_then(|mut file| file.read(&mut start)).unwrap_or_default();
    let lines = start[..read].split(|byte| *byte == b'\n');
    lines
        .filter(|line| line.starts_with(b"comment"))
        .any(|line| line.windows(7).any(|word| word == b"Blender"))
}

impl UpAxis {
    /// Euler angles in degrees that rotate this axis to y, or `None` for y itself.
    fn upright_rotation_degrees(self) -> Option<[f64; 3]> {
        match self {
            Self::X => Some([0.0, 0.0, 90.0]),
            Self::Y => None,
            Self::Z => Some([-90.0, 0.0, 0.0]),
        }
    }

    /// Applies [`upright_rotation_degrees`](Self::upright_rotation_degrees) to a point.
    fn rotate_point_upright(self, at: DVec3) -> DVec3 {
        match self {
            Self::X => DVec3::new(-at.y, at.x, at.z),
            Self::Y => at,
            Self::Z => DVec3::new(at.x, at.z, -at.y),
        }
    }
}

/// Whether a material from a mesh file may cast caustics.
fn material_may_cast_caustics(material: &FileMaterial) -> bool {
    let is_mirror_or_glass = matches!(material.illumination_model, Some(3..=9));
    match &material.physical {
        Some(own) => {
            let is_smooth = own.roughness_texture.is_some() || f64::from(own.roughness) < POLISHED_ROUGHNESS;
            let is_coat_smooth = own.clearcoat_roughness_texture.is_some()
                || f64::from(own.clearcoat_roughness) < POLISHED_ROUGHNESS;
            let is_coated = own.has_clearcoat() && is_coat_smooth;
            is_mirror_or_glass || is_smooth || is_coated
        }
        None => {
            let reflects = material.specular_texture.is_some() || material.specular.max_element() > 0.0;
            is_mirror_or_glass || reflects && material.shininess > POLISHED_EXPONENT
        }
    }
}

/// Whether every face is fully transparent.
fn is_mesh_fully_transparent(loaded: &LoadedMesh) -> bool {
    let is_clear =
        |own: &FileMaterial| own.opacity == 0.0 && own.opacity_texture.is_none() && !own.is_glass();
    let is_fully_transparent = |index: &u32| loaded.materials.get(*index as usize).is_some_and(is_clear);
    !loaded.mesh.materials.is_empty() && loaded.mesh.materials.iter().all(is_fully_transparent)
}

/// Reads an OBJ, OFF or serialized file.
pub(super) fn read_y_up_mesh(
    path: &Path,
    context: &ForeignReadContext<'_>,
) -> Result<ForeignScene, ForeignError> {
    scene_of_mesh(path, UpAxis::Y, false, context)
}

/// Reads a PLY file. The default up axis is z for files from Blender, and y for all others.
pub(super) fn read_ply(path: &Path, context: &ForeignReadContext<'_>) -> Result<ForeignScene, ForeignError> {
    let up = if is_from_blender(path) { UpAxis::Z } else { UpAxis::Y };
    scene_of_mesh(path, up, false, context)
}

/// Reads an STL file. By the convention of CAD and 3D printing, z is the up axis. STL has no vertex normals,
/// and mechanical parts have sharp edges.
pub(super) fn read_stl(path: &Path, context: &ForeignReadContext<'_>) -> Result<ForeignScene, ForeignError> {
    scene_of_mesh(path, UpAxis::Z, true, context)
}

/// Generates the scene for a mesh file. `up` is the format's default up axis.
fn scene_of_mesh(
    path: &Path,
    up: UpAxis,
    is_faceted: bool,
    &ForeignReadContext { view, containers, token, .. }: &ForeignReadContext<'_>,
) -> Result<ForeignScene, ForeignError> {
    let loaded = containers.load_any_mesh(path, None, &ignore_progress, token)?;
    let Some([min, max]) = loaded.mesh.bounds_in_file_coordinates() else {
        return Err(AssetError::malformed(path, None, "no usable face").into());
    };
    let up = view.up.unwrap_or(up);
    let upright = |at: DVec3| up.rotate_point_upright(at);
    let (a, b) = (upright(min), upright(max));
    let bounds = [a.min(b), a.max(b)];
    let points: Vec<DVec3> = loaded.mesh.extreme_vertices().into_iter().map(upright).collect();
    let eye = frame_model(
        bounds,
        &points,
        view.from.unwrap_or(ViewSide::Iso),
        view.turns,
        view.aspect.unwrap_or(DEFAULT_SIZE[0] / DEFAULT_SIZE[1]),
    );
    // Report the file's coordinates as the cause, because the user did not choose the camera position.
    let eye_reach = eye.position.abs().max(eye.look_at.abs()).max_element();
    if eye_reach >= MAX_MAGNITUDE {
        let farthest = min.abs().max(max.abs()).max_element() as f32;
        let reason = format!(
            "its coordinates extend to {farthest:e}, which places the camera at {eye_reach:.0e}; coordinates must be below {MAX_MAGNITUDE:e}"
        );
        return Err(AssetError::malformed(path, None, reason).into());
    }
    let (mut document, mut names) = (SceneDocumentBuilder::default(), UsedNames::default());
    document.add_comment_above_next_table(format!("{}, as glimt shows it.", file_name(path)));
    let lighting = Lighting::Default { is_polished: loaded.materials.iter().any(material_may_cast_caustics) };
    add_render_settings(&mut document, None, lighting);
    add_camera_table(&mut document, &eye, ModelProjection::Perspective { fov: FOV });
    add_lighting(&mut document, &eye, lighting);
    let is_colored = !loaded.mesh.colors.is_empty();
    let needs_material = loaded.lacks_materials();
    let name = names.make_unique("model", "model");
    if needs_material {
        document.start_named_table("materials", &name);
        document.set("type", "principled");
        document
            .set("color", if is_colored { 1.0.into() } else { SceneDocumentValue::from([0.7, 0.68, 0.64]) });
    }
    document.start_list_table("mesh");
    document.set("file", file_name(path));
    if let Some(angles) = up.upright_rotation_degrees() {
        document.set("rotate", angles);
    }
    if is_faceted || loaded.is_polyhedral_without_normals() {
        document.set("smooth", false);
    }
    if needs_material {
        document.set("material", name);
    }
    if is_colored {
        document.set("vertex_colors", true);
    }
    add_ground(&mut document, &mut names, bounds, &eye);
    // Because of the generated material, later stages cannot tell that the file has none, so report it here.
    let mut notes = if needs_material { first_warnings(&loaded.material_warnings) } else { Vec::new() };
    notes.extend(is_mesh_fully_transparent(&loaded).then(|| INVISIBLE_MODEL.to_owned()));
    let notes = notes.into_iter().map(|note| model_warning(path, note)).collect();
    let (hash, companions) = (loaded.hash, loaded.companions.clone());
    containers.store_mesh_for_next_load(path, loaded);
    Ok(ForeignScene { document, hash, companions, notes, substitutions: Vec::new() })
}

/// Returns the first warnings and, if there are more, a final line with the number of the others.
fn first_warnings(warnings: &[String]) -> Vec<String> {
    let more = warnings.len().saturating_sub(MAX_WARNINGS);
    let rest = (more > 0).then(|| format!("and {more} {MORE_LIKE_THESE}"));
    warnings.iter().take(MAX_WARNINGS).cloned().chain(rest).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::transform::rotation_xyz;

    #[test]
    fn long_lists_of_warnings_are_shortened() {
        let warnings: Vec<_> = (0..MAX_WARNINGS + 7).map(|number| number.to_string()).collect();
        let shown = first_warnings(&warnings);
        assert_eq!(shown[..MAX_WARNINGS], warnings[..MAX_WARNINGS]);
        assert_eq!(shown[MAX_WARNINGS..], [format!("and 7 {MORE_LIKE_THESE}")]);
        assert_eq!(first_warnings(&warnings[..MAX_WARNINGS]), warnings[..MAX_WARNINGS]);
    }

    #[test]
    fn up_axis_matches_scene_rotation() {
        for (up, axis) in [(UpAxis::X, DVec3::X), (UpAxis::Y, DVec3::Y), (UpAxis::Z, DVec3::Z)] {
            let rotation = rotation_xyz(DVec3::from(up.upright_rotation_degrees().unwrap_or_default()));
            assert_eq!(up.rotate_point_upright(axis), DVec3::Y, "{up:?}");
            for at in [axis, DVec3::new(1.0, 2.0, 3.0)] {
                assert_eq!(rotation * at, up.rotate_point_upright(at), "{up:?}");
            }
        }
    }
}
