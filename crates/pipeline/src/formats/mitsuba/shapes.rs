//! Converts shapes, groups and instances.

use std::path::Path;

use super::graph::{Child, GraphObjectIndex, ObjectKind, PluginInstance};
use super::material_key::UvFlips;
use super::placement::{cylinder_matrix, has_normals};
use super::reader::SceneReader;
use super::settings::span_of;
use crate::assets::AssetError;
use crate::control::ignore_progress;
use crate::formats::foreign::transform::{
    is_invertible_affine, is_mirroring, matrix_value, similarity_scale,
};
use crate::math::{DMat4, DVec3};

/// Shape plugins of Mitsuba 3, 2 and 0.6.
const KNOWN_SHAPES: [&str; 18] = [
    "obj",
    "ply",
    "serialized",
    "stl",
    "sphere",
    "cylinder",
    "disk",
    "rectangle",
    "cube",
    "shapegroup",
    "instance",
    "merge",
    "hair",
    "bsplinecurve",
    "linearcurve",
    "sdfgrid",
    "heightfield",
    "ellipsoids",
];

/// Start of the error message for a mesh without a usable face.
const NO_USABLE_FACE: &str = "no usable face";
/// Maximum depth of nested shapes.
const MAX_DEPTH: u32 = 16;

/// Corners of a cube's faces, in the order of Mitsuba's vertices. Bit i of a corner is set if coordinate i is
/// positive.
const CUBE_FACES: [[u32; 4]; 6] =
    [[1, 5, 4, 0], [3, 2, 6, 7], [1, 3, 7, 5], [5, 7, 6, 4], [4, 6, 2, 0], [3, 1, 0, 2]];

/// Where shapes are added.
#[derive(Clone, Copy, Debug)]
pub(super) struct ShapeTarget<'n> {
    /// The group, or `None` for the scene.
    pub(super) group: Option<&'n str>,
    pub(super) depth: u32,
}

impl ShapeTarget<'_> {
    pub(super) const SCENE: Self = ShapeTarget { group: None, depth: 0 };
}

impl<'a> SceneReader<'a> {
    /// Adds a shape. Returns whether anything was added.
    pub(super) fn add_shape(&mut self, index: GraphObjectIndex, target: ShapeTarget<'_>) -> bool {
        let object = self.object_by_index(index);
        if !self.count_shape_and_check_limit(object) {
            return false;
        }
        if target.depth > MAX_DEPTH {
            self.report_error(object.span.clone(), "shapes are nested too deeply", None);
            return false;
        }
        self.interior_tint = self.interior_tint(object);
        if let Some(subsurface) = self.children_of_kind(object, ObjectKind::Subsurface).next() {
            let subsurface = self.object_by_index(subsurface.target);
            self.refuse(subsurface, "subsurface scattering");
            return false;
        }
        let is_added = match object.plugin.as_str() {
            // Groups are added with their first instance.
            "shapegroup" => {
                if target.depth > 0 {
                    let text = "ignored here; use an instance of the group instead";
                    self.notes.note("a `shapegroup` in another shape", text, object.span.clone());
                }
                false
            }
            "instance" => self.add_instance(object, target),
            "merge" => {
                let inner = ShapeTarget { depth: target.depth + 1, ..target };
                self.add_shapes_of(object, inner)
            }
            "obj" | "ply" | "serialized" | "stl" => self.add_mesh(object, target),
            "sphere" => self.add_sphere(object, target),
            "cylinder" => self.add_cylinder(object, target),
            "disk" => self.add_disk(object, target),
            "rectangle" => self.add_rectangle(object, target),
            "cube" => self.add_cube(object, target),
            "bsplinecurve" | "linearcurve" => self.add_curves(object, target),
            "sdfgrid" => self.add_distance_grid(object, target),
            "hair" | "heightfield" | "ellipsoids" | "ellipsoidsmesh" | "deformable" => {
                self.refuse(object, "this kind of shape");
                false
            }
            _ => {
                self.report_unknown_plugin(object, "shape", &KNOWN_SHAPES);
                false
            }
        };
        self.interior_tint = None;
        self.report_unused(index);
        if is_added {
            self.report_unused_children(index);
        }
        is_added
    }

    /// Adds all nested shapes of an object. Returns whether anything was added.
    pub(super) fn add_shapes_of(&mut self, object: &'a PluginInstance, target: ShapeTarget<'_>) -> bool {
        let mut is_added = false;
        for child in self.children_of_kind(object, ObjectKind::Shape) {
            is_added |= self.add_shape(child.target, target);
        }
        is_added
    }

    /// Returns the name of a shape's material. Returns `None` if the shape is invisible or has errors.
    pub(super) fn shape_material(&mut self, object: &'a PluginInstance, uv: UvFlips) -> Option<String> {
        let bsdf: Option<&'a Child> = self.children_of_kind(object, ObjectKind::Bsdf).next();
        if let Some(second) = self.children_of_kind(object, ObjectKind::Bsdf).nth(1) {
            let text = "only the first is used";
            self.notes.note_lighting_substitution("a shape with several BSDFs", text, second.span.clone());
        }
        let emitter = self.children_of_kind(object, ObjectKind::Emitter).next();
        let emitter = emitter.and_then(|child| {
            let emitter = self.object_by_index(child.target);
            match emitter.plugin.as_str() {
                "area" => Some(child.target),
                "directionalarea" => {
                    self.refuse(emitter, "collimated light");
                    None
                }
                _ => {
                    self.report_error(
                        emitter.span.clone(),
                        "a shape can only contain an `area` emitter",
                        None,
                    );
                    None
                }
            }
        });
        self.material(bsdf, emitter, uv, object)
    }

    /// Reports flipped normals, which glimt ignores. In Mitsuba, mirroring transforms flip normals as well.
    fn note_flipped_normals(&mut self, object: &'a PluginInstance) {
        let text = "the front side is not flipped, which matters for one-sided materials, glass and lights";
        self.notes.note_lighting_substitution(
            "normals flipped by `flip_normals` or a mirroring `to_world`",
            text,
            object.span.clone(),
        );
    }

    /// Returns the transform of a shape, or reports an error and returns `None`.
    pub(super) fn shape_transform(&mut self, object: &'a PluginInstance) -> Option<DMat4> {
        let matrix = self.world_matrix(object);
        if !is_invertible_affine(&matrix) {
            let text = "skipped";
            self.notes.note("a shape whose `to_world` is not invertible", text, span_of(object, "to_world"));
            return None;
        }
        Some(matrix)
    }

    /// Starts the table of a shape.
    pub(super) fn start_shape(
        &mut self,
        object: &'a PluginInstance,
        target: ShapeTarget<'_>,
        list: &'static str,
        material: String,
    ) {
        self.document.set_span_for_next_values(object.span.clone());
        match target.group {
            Some(group) => self.document.start_group_list_table(group, list),
            None => self.document.start_list_table(list),
        }
        if let Some(id) = &object.id {
            let name = self.shape_names.make_unique(id, "shape");
            self.document.set("name", name);
        }
        self.document.set("material", material);
    }

    pub(super) fn set_matrix(&mut self, matrix: &DMat4) {
        if *matrix != DMat4::IDENTITY {
            self.document.set("matrix", matrix_value(matrix));
        }
    }

    fn add_mesh(&mut self, object: &'a PluginInstance, target: ShapeTarget<'_>) -> bool {
        let Some(matrix) = self.shape_transform(object) else { return false };
        let Some((name, span)) = self.text(object, "filename") else {
            self.report_error(object.span.clone(), "the mesh needs `filename`", None);
            return false;
        };
        let is_readable =
            Path::new(name).extension().is_some_and(|ending| ending.eq_ignore_ascii_case(&object.plugin));
        if !is_readable {
            let help = "use the plugin for the file's format: obj, ply, serialized or stl".to_owned();
            self.report_error(span, format!("`{0}` reads only .{0} files", object.plugin), Some(help));
            return false;
        }
        // OBJ files are flipped by default, so that v = 0 is at the top like in images.
        let is_obj = object.plugin == "obj";
        let flips_v = self.boolean(object, "flip_tex_coords", is_obj);
        let uv = UvFlips { flips_u: false, flips_v };
        let has_flat_faces = self.boolean(object, "face_normals", false);
        let is_flipped = self.boolean(object, "flip_normals", false);
        let part = self.integer(object, "shape_index");
        let Some(path) = self.asset_path(name, &span, "mesh") else { return false };
        if self.is_mesh_without_area(&path, part) {
            self.notes.note("a mesh without area", "skipped", span);
            return false;
        }
        self.read_attributes_if_used(object, &path);
        let material = self.shape_material(object, uv);
        let attributes = self.attributes.take();
        let Some(material) = material else { return false };
        // Normals in the file are mirrored with the mesh, computed normals are not.
        let is_mirrored = is_mirroring(&matrix) && (has_flat_faces || !has_normals(&path));
        if is_flipped != is_mirrored {
            self.note_flipped_normals(object);
        }
        for name in ["max_smooth_angle", "flip_uvs", "srgb"] {
            object.property(name);
        }
        if let Some(attributes) = attributes {
            return self.add_attributed_mesh(&attributes, object, target, material, &matrix);
        }
        let file = self.asset_reference(&path);
        self.start_shape(object, target, "mesh", material);
        self.document.set_span_for_next_values(span);
        self.document.set("file", file);
        self.document.set_span_for_next_values(object.span.clone());
        if object.plugin == "serialized" {
            self.document.set("part", part.unwrap_or(0).max(0) as f64);
        }
        if has_flat_faces {
            self.document.set("smooth", false);
        }
        self.set_matrix(&matrix);
        true
    }

    /// Whether no face of a mesh has an area. Only small files are checked, because such meshes are small.
    fn is_mesh_without_area(&mut self, path: &Path, part: Option<i64>) -> bool {
        const MAX_BYTES: u64 = 4096;
        if !std::fs::metadata(path).is_ok_and(|metadata| metadata.len() <= MAX_BYTES) {
            return false;
        }
        self.inspect_watched(path, part, |reader| {
            let part = part.and_then(|part| u32::try_from(part).ok());
            let loaded = reader.containers.load_any_mesh(path, part, &ignore_progress, reader.token);
            matches!(loaded, Err(AssetError::Malformed { reason, .. }) if reason.starts_with(NO_USABLE_FACE))
        })
    }

    fn add_sphere(&mut self, object: &'a PluginInstance, target: ShapeTarget<'_>) -> bool {
        let Some(matrix) = self.shape_transform(object) else { return false };
        let center = self.vector_property(object, "center").unwrap_or(DVec3::ZERO);
        let radius = self.float(object, "radius").unwrap_or(1.0);
        let is_flipped = self.boolean(object, "flip_normals", false);
        // glimt's poles are at ±y, Mitsuba's at ±z, and u is 0 on opposite sides.
        let axes = DMat4::from_cols(
            DVec3::NEG_X.extend(0.0),
            DVec3::Z.extend(0.0),
            DVec3::NEG_Y.extend(0.0),
            DVec3::ZERO.extend(1.0),
        );
        let Some(material) = self.shape_material(object, UvFlips { flips_u: false, flips_v: true }) else {
            return false;
        };
        self.start_shape(object, target, "sphere", material);
        match similarity_scale(&matrix).filter(|_| !self.shape_uses_coordinates(object)) {
            Some(scale) => {
                self.document.set("center", matrix.transform_point3(center));
                self.document.set("radius", radius * scale);
            }
            None => {
                let placed = matrix * DMat4::from_translation(center) * axes;
                self.document.set("center", DVec3::ZERO);
                self.document.set("radius", radius);
                self.set_matrix(&placed);
            }
        }
        if is_flipped != is_mirroring(&matrix) {
            self.note_flipped_normals(object);
        }
        true
    }

    /// Whether the material of a shape depends on its texture coordinates or tangents.
    pub(super) fn shape_uses_coordinates(&self, object: &'a PluginInstance) -> bool {
        let children = object.children.iter().map(|child| child.target);
        self.any_nested_object_satisfies(children, |inner| {
            inner.kind == ObjectKind::Texture || inner.properties.iter().any(|one| one.name == "alpha_u")
        })
    }

    fn add_cylinder(&mut self, object: &'a PluginInstance, target: ShapeTarget<'_>) -> bool {
        let Some(matrix) = self.shape_transform(object) else { return false };
        let start = self.vector_property(object, "p0").unwrap_or(DVec3::ZERO);
        let end = self.vector_property(object, "p1").unwrap_or(DVec3::Z);
        let radius = self.float(object, "radius").unwrap_or(1.0);
        let is_flipped = self.boolean(object, "flip_normals", false);
        let Some(material) = self.shape_material(object, UvFlips::default()) else { return false };
        let placed = if self.shape_uses_coordinates(object) {
            cylinder_matrix(&matrix, start, end, radius)
        } else {
            None
        };
        self.start_shape(object, target, "cylinder", material);
        if let Some(placed) = placed {
            self.document.set("a", DVec3::ZERO);
            self.document.set("b", DVec3::Z);
            self.document.set("radius", 1.0);
            self.set_matrix(&placed);
            self.document.set("caps", false);
            if is_flipped != is_mirroring(&matrix) {
                self.note_flipped_normals(object);
            }
            return true;
        }
        match similarity_scale(&matrix) {
            Some(scale) => {
                self.document.set("a", matrix.transform_point3(start));
                self.document.set("b", matrix.transform_point3(end));
                self.document.set("radius", radius * scale);
            }
            None => {
                self.document.set("a", start);
                self.document.set("b", end);
                self.document.set("radius", radius);
                self.set_matrix(&matrix);
            }
        }
        self.document.set("caps", false);
        if is_flipped != is_mirroring(&matrix) {
            self.note_flipped_normals(object);
        }
        true
    }

    fn add_rectangle(&mut self, object: &'a PluginInstance, target: ShapeTarget<'_>) -> bool {
        let Some(matrix) = self.shape_transform(object) else { return false };
        let is_flipped = self.boolean(object, "flip_normals", false);
        let corner = |x: f64, y: f64| matrix.transform_point3(DVec3::new(x, y, 0.0));
        let (across, along) =
            (corner(1.0, -1.0) - corner(-1.0, -1.0), corner(-1.0, 1.0) - corner(-1.0, -1.0));
        // A quad's front is on the side of u × v, which a mirroring transform reverses.
        let is_reversed = is_mirroring(&matrix) != is_flipped;
        let uv = UvFlips { flips_u: is_reversed, flips_v: false };
        let Some(material) = self.shape_material(object, uv) else { return false };
        self.start_shape(object, target, "quad", material);
        if is_reversed {
            self.set_quad(corner(1.0, -1.0), -across, along);
        } else {
            self.set_quad(corner(-1.0, -1.0), across, along);
        }
        true
    }

    fn set_quad(&mut self, corner: DVec3, across: DVec3, along: DVec3) {
        self.document.set("corner", corner);
        self.document.set("u", across);
        self.document.set("v", along);
    }

    fn add_cube(&mut self, object: &'a PluginInstance, target: ShapeTarget<'_>) -> bool {
        let Some(matrix) = self.shape_transform(object) else { return false };
        let is_flipped = self.boolean(object, "flip_normals", false);
        object.property("face_normals");
        if !is_flipped && !self.shape_uses_coordinates(object) {
            let Some(material) = self.shape_material(object, UvFlips::default()) else { return false };
            self.start_shape(object, target, "box", material);
            self.document.set("center", DVec3::ZERO);
            self.document.set("size", DVec3::splat(2.0));
            self.set_matrix(&matrix);
            return true;
        }
        let is_reversed = is_mirroring(&matrix) != is_flipped;
        let uv = UvFlips { flips_u: !is_reversed, flips_v: false };
        let Some(material) = self.shape_material(object, uv) else { return false };
        for face in CUBE_FACES {
            let point = |index: usize| {
                let sign = |bit: u32| if face[index] >> bit & 1 == 1 { 1.0 } else { -1.0 };
                matrix.transform_point3(DVec3::new(sign(0), sign(1), sign(2)))
            };
            self.start_shape(object, target, "quad", material.clone());
            // Texture coordinates are (0, 1), (1, 1), (1, 0) and (0, 0) at the vertices.
            if is_reversed {
                self.set_quad(point(3), point(2) - point(3), point(0) - point(3));
            } else {
                self.set_quad(point(2), point(3) - point(2), point(1) - point(2));
            }
        }
        true
    }
}
