//! Converts textures that read attributes of a mesh (`mesh_attribute`).
//!
//! Attributes of faces become an image with one texel per face, and texture coordinates that point to it.
//! Colors of vertices become glimt's vertex colors.

use std::path::Path;

use super::graph::{GraphObjectIndex, ObjectKind, PluginInstance};
use super::ply::{AttributedMesh, MeshAttribute, attribute_in_table, face_attribute, triangle_mesh};
use super::reader::SceneReader;
use super::shapes::ShapeTarget;
use super::textures::{MitsubaTextureUse, extension};
use crate::assets::mesh::ply::tables::read_tables;
use crate::formats::foreign::import::TableEntries;
use crate::formats::foreign::meshes::MeshData;
use crate::formats::foreign::pixels::Pixels;
use crate::math::{DMat4, DVec2, DVec3, Vec3};
use crate::scene::SceneDocumentValue;

/// Maximum size of a file with attributes.
const MAX_BYTES: u64 = 1 << 30;
/// Maximum number of faces of a mesh with attributes of faces.
const MAX_FACES: usize = 1 << 22;

/// How a material uses the attributes of its mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
enum AttributeUse {
    /// In images with one texel per face.
    Faces,
    /// As the reflectance of a diffuse surface.
    VertexColors,
}

/// Names of textures that read attributes.
pub(super) fn is_attribute_texture(plugin: &str) -> bool {
    matches!(plugin, "mesh_attribute" | "vertexcolors" | "vertex_color")
}

/// Columns of the image with one texel per face.
fn atlas_width(faces: usize) -> usize {
    (1..).find(|width| width * width >= faces).unwrap_or(1)
}

/// Returns the image with one texel per face, from the top row.
fn atlas(attribute: &MeshAttribute) -> Pixels {
    let width = atlas_width(attribute.values.len());
    let height = attribute.values.len().div_ceil(width);
    let mut values: Vec<Vec3> = attribute.values.iter().map(|value| value.as_vec3()).collect();
    values.resize(width * height, Vec3::ZERO);
    Pixels { width, height, values }
}

/// Points all corners of every triangle to the triangle's texel.
fn add_atlas_coordinates(mesh: &mut MeshData) {
    let faces = mesh.triangles.len();
    let width = atlas_width(faces);
    let height = faces.div_ceil(width);
    mesh.split_triangles();
    let center = |face: usize| {
        let (column, row) = ((face % width) as f64, (face / width) as f64);
        DVec2::new((column + 0.5) / width as f64, 1.0 - (row + 0.5) / height as f64)
    };
    mesh.uvs = (0..faces).flat_map(|face| [center(face); 3]).collect();
}

impl<'a> SceneReader<'a> {
    /// Returns how the BSDF of a shape uses the attributes of its mesh. Returns `None` if it does not use
    /// them or if glimt cannot express it.
    fn attribute_use(&mut self, object: &'a PluginInstance) -> Option<AttributeUse> {
        let mut pending: Vec<GraphObjectIndex> =
            self.children_of_kind(object, ObjectKind::Bsdf).map(|child| child.target).collect();
        let (mut faces, mut others, mut colors, mut bsdfs) = (0, 0, 0, 0);
        let mut visits = 0;
        while let Some(index) = pending.pop() {
            let inner = self.object_by_index(index);
            let is_texture = inner.kind == ObjectKind::Texture;
            let has_anisotropy = inner.properties.iter().any(|one| one.name == "alpha_u");
            if is_texture && is_attribute_texture(&inner.plugin) {
                match self.text(inner, "name") {
                    Some((name, _)) if name.starts_with("face_") => faces += 1,
                    Some(("vertex_color", _)) if colors == 0 => colors += 1,
                    _ => others += 1,
                }
            } else if is_texture || has_anisotropy {
                others += 1;
            }
            bsdfs += usize::from(inner.kind == ObjectKind::Bsdf && inner.plugin != "twosided");
            let is_diffuse = inner.plugin == "diffuse";
            let is_other_slot = |name: Option<&str>| !is_diffuse || name != Some("reflectance");
            for child in &inner.children {
                let target = self.object_by_index(child.target);
                if is_attribute_texture(&target.plugin)
                    && is_other_slot(child.name.as_deref())
                    && matches!(self.text(target, "name"), Some(("vertex_color", _)))
                {
                    others += 1;
                }
                pending.push(child.target);
            }
            // References can lead to the same object on exponentially many paths.
            visits += 1;
            if visits > 10_000 {
                return None;
            }
        }
        match (faces, colors, others) {
            (1.., 0, 0) => Some(AttributeUse::Faces),
            (0, 1, 0) if bsdfs == 1 => Some(AttributeUse::VertexColors),
            _ => None,
        }
    }

    /// Reads the attributes of a mesh if its material needs them. The material must be converted next.
    pub(super) fn read_attributes_if_used(&mut self, object: &'a PluginInstance, path: &Path) {
        self.attributes = None;
        if object.plugin != "ply" || extension(&path.to_string_lossy()) != "ply" {
            return;
        }
        let Some(usage) = self.attribute_use(object) else { return };
        let Some(bytes) = self.read_watched_file(path, MAX_BYTES) else { return };
        // Errors in the file are reported when it is loaded.
        let Ok(tables) = read_tables(path, &bytes, self.token) else { return };
        let Some(mesh) = triangle_mesh(&tables) else { return };
        let is_color = |color: &DVec3| color.min_element() >= 0.0 && color.max_element() <= 1.0;
        let colors = match usage {
            AttributeUse::Faces if mesh.triangles.len() <= MAX_FACES => Vec::new(),
            AttributeUse::Faces => return,
            AttributeUse::VertexColors => match attribute_in_table(&tables.vertices, "color") {
                Some(color) if color.is_color && color.values.iter().all(is_color) => color.values,
                Some(_) | None => return,
            },
        };
        self.attributes = Some(AttributedMesh { id: object.span.start, tables, colors });
    }

    /// Returns the keys of a texture of an attribute, or `None` if glimt cannot express it.
    pub(super) fn attribute_texture_keys(
        &mut self,
        object: &'a PluginInstance,
        usage: MitsubaTextureUse,
    ) -> Option<(TableEntries, String)> {
        let (name, _) = self.text(object, "name")?;
        let attribute = face_attribute(&self.attributes.as_ref()?.tables, name.strip_prefix("face_")?)?;
        let is_valid = attribute.values.iter().all(|value| value.is_finite() && value.min_element() >= 0.0);
        if !is_valid
            || usage == MitsubaTextureUse::Normal
            || usage == MitsubaTextureUse::Number && attribute.is_color
        {
            return None;
        }
        let scale = self.float(object, "scale").unwrap_or(1.0);
        let bytes = atlas(&attribute).encode_pfm(!attribute.is_color);
        let file = self.add_generated_file(name, "pfm", bytes);
        let mut keys: TableEntries =
            vec![("file", file.into()), ("filter", "nearest".into()), ("wrap", "clamp".into())];
        if scale != 1.0 {
            keys.push(("factor", scale.into()));
        }
        Some((keys, name.to_owned()))
    }

    /// Returns the reflectance of a diffuse surface that multiplies the colors of vertices.
    pub(super) fn vertex_color_scale(&mut self, object: &'a PluginInstance) -> Option<SceneDocumentValue> {
        let texture = self.object_by_index(object.named_child("reflectance")?.target);
        let has_colors = self.attributes.as_ref().is_some_and(|mesh| !mesh.colors.is_empty());
        if !has_colors || !is_attribute_texture(&texture.plugin) {
            return None;
        }
        texture.property("name");
        Some(self.float(texture, "scale").unwrap_or(1.0).clamp(0.0, 1.0).into())
    }

    /// Adds a mesh with attributes. Returns whether it has an area.
    pub(super) fn add_attributed_mesh(
        &mut self,
        attributes: &AttributedMesh,
        object: &'a PluginInstance,
        target: ShapeTarget<'_>,
        material: String,
        matrix: &DMat4,
    ) -> bool {
        let Some(mut mesh) = triangle_mesh(&attributes.tables) else { return false };
        if self.boolean(object, "face_normals", false) {
            mesh.normals.clear();
        } else if mesh.normals.is_empty() {
            mesh.add_smooth_normals();
        }
        if attributes.colors.is_empty() {
            add_atlas_coordinates(&mut mesh);
        } else {
            mesh.colors.clone_from(&attributes.colors);
        }
        self.add_generated_mesh(mesh, object, target, material, matrix)
    }
}
