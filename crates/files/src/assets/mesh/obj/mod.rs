//! OBJ by `tobj`, which makes one index of the three that a corner has. Faults that it accepts or cannot report are
//! checked here.

mod fault;
mod input;
mod libraries;

use std::cell::RefCell;

use super::assemble::{Parsed, assemble, color_bytes};
use super::text::with_line_feeds;
use super::{AssetError, LoadedMesh, Source};
use crate::assets::FileMaterial;
use crate::assets::contain::contain;
use crate::math::{DVec2, DVec3, Vec2, Vec3};
use fault::first_fault;
use input::{Chunks, Survey};
use libraries::{Found, Libraries};

/// Options that leave faces as they are: this program cuts polygons, and counts points and lines among the faces.
const OPTIONS: tobj::LoadOptions =
    tobj::LoadOptions { single_index: true, triangulate: false, ignore_points: false, ignore_lines: false };

pub(super) fn parse(source: &Source<'_>) -> Result<LoadedMesh, AssetError> {
    parse_lines(&Source { bytes: &with_line_feeds(source.bytes), ..*source })
}

fn parse_lines(source: &Source<'_>) -> Result<LoadedMesh, AssetError> {
    let survey = Survey::of(source.bytes, source.watch.token)?;
    let used = &survey.used_materials;
    let libraries = Libraries { source, used, found: RefCell::default(), failed: RefCell::default() };
    let mut reader = Chunks::new(source, &survey.text);
    let result = contain(|| tobj::load_obj_buf(&mut reader, &OPTIONS, |name| libraries.load(name)));
    source.watch.token.check()?;
    if let Some(error) = libraries.failed.into_inner() {
        return Err(error);
    }
    let Ok(Ok((models, materials))) = result else {
        let reason = match result {
            Ok(Err(error)) => error.to_string(),
            Err(panic) => panic,
            Ok(Ok(_)) => String::new(),
        };
        return Err(first_fault(source).unwrap_or_else(|| source.wrong(reason)));
    };
    let Found { materials: known, resolved, warnings: mut material_warnings, missing, files, pictures } =
        libraries.found.into_inner();
    let materials: Vec<FileMaterial> = materials.map_or(Vec::new(), |found| {
        found.iter().filter_map(|material| known.get(&material.name).cloned()).collect()
    });
    if !missing {
        let unknown = used.difference(&resolved);
        material_warnings.extend(unknown.map(|name| format!("no material is named {name:?}")));
    }
    let mut parsed =
        Parsed { materials, material_warnings, companions: files, pictures, ..Parsed::default() };
    join(&models, &mut parsed);
    assemble(source, parsed)
}

/// Joins the models (one for each object, group and material) into one mesh.
fn join(models: &[tobj::Model], parsed: &mut Parsed) {
    let vertices = |model: &tobj::Model| model.mesh.positions.len() / 3;
    let any_uvs = models.iter().any(|model| !model.mesh.texcoords.is_empty());
    let any_normals = models.iter().any(|model| !model.mesh.normals.is_empty());
    let any_colors = models.iter().any(|model| !model.mesh.vertex_color.is_empty());
    let any_materials = models.iter().any(|model| model.mesh.material_id.is_some());
    for model in models {
        let mesh = &model.mesh;
        let base = parsed.positions.len() as u32;
        let end = parsed.positions.len() + vertices(model);
        parsed.positions.extend(mesh.positions.chunks_exact(3).map(DVec3::from_slice));
        if any_uvs && whole(mesh.texcoords.len(), 2 * vertices(model), model, "texture coordinates", parsed) {
            parsed.uvs.extend(mesh.texcoords.chunks_exact(2).map(|uv| DVec2::from_slice(uv).as_vec2()));
        }
        if any_normals && whole(mesh.normals.len(), 3 * vertices(model), model, "normals", parsed) {
            let normals = mesh.normals.chunks_exact(3).map(|normal| DVec3::from_slice(normal).as_vec3());
            parsed.normals.extend(normals);
        }
        if any_colors {
            let colors = mesh.vertex_color.chunks_exact(3).map(DVec3::from_slice);
            parsed.colors.extend(colors.map(|color| color_bytes(color.to_array())));
        }
        parsed.colors.resize(if any_colors { end } else { 0 }, [u8::MAX; 3]);
        parsed.uvs.resize(if any_uvs { end } else { 0 }, Vec2::ZERO);
        parsed.normals.resize(if any_normals { end } else { 0 }, Vec3::ZERO);
        add_faces(mesh, base, parsed);
        if any_materials {
            let material = mesh.material_id.map_or(u32::MAX, |id| id as u32);
            parsed.face_materials.resize(parsed.faces.len(), material);
        }
    }
}

/// Whether every corner of a model has the attribute; `tobj` drops gaps, so that a part cannot be assigned.
fn whole(found: usize, wanted: usize, model: &tobj::Model, what: &str, parsed: &mut Parsed) -> bool {
    if found != wanted && found > 0 {
        let name = &model.name;
        parsed
            .warnings
            .push(format!("some corners of {name:?} have {what} and some have none: ignored there"));
    }
    found == wanted
}

fn add_faces(mesh: &tobj::Mesh, base: u32, parsed: &mut Parsed) {
    let mut corners = mesh.indices.iter();
    let triangles = mesh.indices.len() / 3;
    let arities: &mut dyn Iterator<Item = usize> = if mesh.face_arities.is_empty() {
        parsed.faces.reserve(triangles);
        &mut std::iter::repeat_n(3, triangles)
    } else {
        &mut mesh.face_arities.iter().map(|arity| *arity as usize)
    };
    for arity in arities {
        corners.by_ref().take(arity).for_each(|corner| parsed.faces.corner(base + corner));
        parsed.faces.close(arity);
    }
}

#[cfg(test)]
mod tests;
