//! State shared by the functions that convert a scene graph to a scene document.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::ops::Range;
use std::path::{Path, PathBuf};

use super::graph::{Child, GraphObjectIndex, ObjectKind, PluginInstance, SceneGraph};
use super::material_key::{BlendPartKey, MaterialKey};
use super::plastic::PlasticCoat;
use super::ply::AttributedMesh;
use super::property::{PropertyValue, SpectrumValue, TransformValue};
use super::xml::{MAX_ERRORS, truncate_for_message};
use crate::assets::Companion;
use crate::control::CancelToken;
use crate::formats::ForeignReadContext;
use crate::formats::foreign::import::TableEntries;
use crate::formats::foreign::notes::NoteCollector;
use crate::formats::foreign::options::ForeignOptions;
use crate::formats::model::UsedNames;
use crate::math::{DMat4, DVec3};
use crate::scene::diagnostic::{Diagnostic, Severity};
use crate::scene::nearest::nearest_name;
use crate::scene::{SceneDocumentBuilder, SourceFiles};
use crate::stages::containers::OpenAssetFiles;

/// Maximum number of shapes and instances. Tests use a small limit.
const MAX_SHAPES: usize = if cfg!(test) { 20_000 } else { 4_000_000 };
/// Maximum number of materials. Tests use a small limit.
const MAX_MATERIALS: usize = if cfg!(test) { 2_000 } else { 1_000_000 };

/// The use of a color. It determines how spectra are converted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum ColorRole {
    /// A reflectance or transmittance from 0 to 1.
    Reflectance,
    /// Emitted light.
    Emission,
    /// An index of refraction or another unbounded quantity.
    Unbounded,
}

/// A constant color or a texture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum ColorSource {
    Constant(DVec3),
    Texture(GraphObjectIndex),
}

/// A constant number or a texture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum NumberSource {
    Constant(f64),
    Texture(GraphObjectIndex),
}

/// Converts a scene graph to a scene document.
pub(super) struct SceneReader<'a> {
    pub(super) graph: &'a SceneGraph,
    pub(super) files: &'a SourceFiles,
    /// The scene file.
    pub(super) path: &'a Path,
    /// Folders to search for assets, last first.
    pub(super) folders: &'a [PathBuf],
    pub(super) options: &'a ForeignOptions,
    pub(super) token: &'a CancelToken,
    /// Loads meshes.
    pub(super) containers: &'a OpenAssetFiles,
    /// Folder to which an import copies the assets, or `None` if they stay in place.
    pub(super) asset_folder: Option<&'a str>,
    pub(super) errors: Vec<Diagnostic>,
    pub(super) notes: NoteCollector,
    pub(super) document: SceneDocumentBuilder,
    pub(super) companions: Vec<Companion>,
    /// Names used in the document, per kind of table.
    pub(super) material_names: UsedNames,
    pub(super) texture_names: UsedNames,
    pub(super) shape_names: UsedNames,
    pub(super) group_names: UsedNames,
    /// Names of the converted materials. `None` marks invisible surfaces and errors.
    pub(super) materials: HashMap<MaterialKey, Option<String>>,
    /// Names of the converted textures, by their formatted table entries.
    pub(super) textures: HashMap<String, String>,
    /// Names of the groups in the document. `None` marks groups without visible shapes.
    pub(super) groups: HashMap<GraphObjectIndex, Option<String>>,
    /// Names of the files that an import writes, by source path.
    pub(super) asset_names: BTreeMap<PathBuf, String>,
    pub(super) used_asset_names: HashSet<String>,
    /// Names of the files that exist only in memory, by their hash.
    pub(super) generated_names: HashMap<[u8; 32], String>,
    /// The mesh whose material is being converted, if the material uses its attributes.
    pub(super) attributes: Option<AttributedMesh>,
    /// Transmittance per unit of length of the medium in the shape whose material is being converted.
    pub(super) interior_tint: Option<DVec3>,
    /// Position of the camera.
    pub(super) camera_position: Option<DVec3>,
    /// Objects whose unused properties have been reported.
    pub(super) reported_unused: HashSet<GraphObjectIndex>,
    pub(super) has_environment: bool,
    /// Name of the black material, if the document has one.
    pub(super) black: Option<String>,
    /// Integrals of plastic coats, by index of refraction, α and distribution.
    pub(super) plastic_coats: HashMap<(u64, Option<u64>, bool), PlasticCoat>,
    /// Names of the materials in the blends of the current shape. `None` marks errors.
    pub(super) blend_parts: HashMap<BlendPartKey, Option<String>>,
    /// Files in `companions`.
    pub(super) watched_files: HashSet<PathBuf>,
    /// Inspected properties of files, by path and part.
    pub(super) inspected_files: HashMap<(PathBuf, Option<i64>), bool>,
    /// Objects whose nested objects were reported as unused.
    pub(super) reported_children: HashSet<GraphObjectIndex>,
    /// Number of materials in the document.
    pub(super) material_count: usize,
    /// Number of shapes converted, including those that contain shapes.
    shape_count: usize,
    /// Whether a limit was reached or the token was canceled, so that the rest of the scene is skipped.
    has_stopped: bool,
}

impl<'a> SceneReader<'a> {
    pub(super) fn new(
        graph: &'a SceneGraph,
        files: &'a SourceFiles,
        path: &'a Path,
        folders: &'a [PathBuf],
        asset_folder: Option<&'a str>,
        context: &ForeignReadContext<'a>,
    ) -> Self {
        let ForeignReadContext { options, token, containers, .. } = *context;
        Self {
            graph,
            files,
            path,
            folders,
            options,
            token,
            containers,
            asset_folder,
            errors: Vec::new(),
            notes: NoteCollector::default(),
            document: SceneDocumentBuilder::default(),
            companions: Vec::new(),
            material_names: UsedNames::default(),
            texture_names: UsedNames::default(),
            shape_names: UsedNames::default(),
            group_names: UsedNames::default(),
            materials: HashMap::new(),
            textures: HashMap::new(),
            groups: HashMap::new(),
            asset_names: BTreeMap::new(),
            used_asset_names: HashSet::new(),
            generated_names: HashMap::new(),
            attributes: None,
            interior_tint: None,
            camera_position: None,
            reported_unused: HashSet::new(),
            has_environment: false,
            black: None,
            plastic_coats: HashMap::new(),
            blend_parts: HashMap::new(),
            watched_files: HashSet::new(),
            inspected_files: HashMap::new(),
            reported_children: HashSet::new(),
            material_count: 0,
            shape_count: 0,
            has_stopped: false,
        }
    }

    /// Whether the rest of the scene is skipped: a limit was reached, or the token was canceled.
    pub(super) fn must_stop(&mut self) -> bool {
        self.has_stopped |= self.token.check_pause_and_cancel().is_err();
        self.has_stopped
    }

    /// Counts a shape. Returns whether it may be added.
    pub(super) fn count_shape_and_check_limit(&mut self, object: &PluginInstance) -> bool {
        self.shape_count += 1;
        if self.shape_count > MAX_SHAPES && !self.has_stopped {
            let help = "combine them in meshes, or use instances of a `shapegroup`".to_owned();
            self.report_error(
                object.span.clone(),
                format!("more than {MAX_SHAPES} shapes and instances"),
                Some(help),
            );
            self.has_stopped = true;
        }
        !self.must_stop()
    }

    /// Whether another material may be added. Reports an error at the reference to its BSDF if not.
    pub(super) fn may_add_material(&mut self, reference: &Range<usize>) -> bool {
        if self.material_count >= MAX_MATERIALS && !self.has_stopped {
            let help = "let shapes share their BSDFs, and nest fewer blends".to_owned();
            self.report_error(reference.clone(), format!("more than {MAX_MATERIALS} materials"), Some(help));
            self.has_stopped = true;
        }
        !self.must_stop()
    }

    /// Whether a predicate is true for any of the objects or any object in them.
    pub(super) fn any_nested_object_satisfies(
        &self,
        objects: impl IntoIterator<Item = GraphObjectIndex>,
        is_found: impl Fn(&PluginInstance) -> bool,
    ) -> bool {
        let mut pending: Vec<GraphObjectIndex> = objects.into_iter().collect();
        // References can lead to the same object on many paths.
        let mut visited: HashSet<GraphObjectIndex> = HashSet::new();
        while let Some(index) = pending.pop() {
            if !visited.insert(index) {
                continue;
            }
            let object = self.object_by_index(index);
            if is_found(object) {
                return true;
            }
            pending.extend(object.children.iter().map(|child| child.target));
        }
        false
    }

    /// Returns an object. The result does not borrow the reader.
    pub(super) fn object_by_index(&self, index: GraphObjectIndex) -> &'a PluginInstance {
        &self.graph.objects[index]
    }

    /// Reports an error, unless there are `MAX_ERRORS` already.
    pub(super) fn report_error(
        &mut self,
        span: Range<usize>,
        message: impl Into<String>,
        help: Option<String>,
    ) {
        if self.errors.len() < MAX_ERRORS {
            self.errors.push(self.files.diagnostic(Severity::Error, span, message, "", help));
        }
        self.has_stopped |= self.errors.len() >= MAX_ERRORS;
    }

    /// Reports an error for a feature that glimt neither supports nor substitutes.
    pub(super) fn refuse(&mut self, object: &PluginInstance, what: &str) {
        let message = format!("glimt does not render {what} (`{}`)", truncate_for_message(&object.plugin));
        let help = "remove it, or render this scene with Mitsuba".to_owned();
        self.report_error(object.span.clone(), message, Some(help));
    }

    /// Reports an unknown plugin, and suggests a similar name from `known`.
    pub(super) fn report_unknown_plugin(&mut self, object: &PluginInstance, kind: &str, known: &[&str]) {
        let near = nearest_name(&object.plugin, known.iter().copied());
        let help = match near {
            Some(near) => format!("did you mean `{near}`?"),
            None => format!("expected one of {}", known.join(", ")),
        };
        self.report_error(
            object.span.clone(),
            format!("unknown {kind} `{}`", truncate_for_message(&object.plugin)),
            Some(help),
        );
    }

    pub(super) fn report_wrong_type(
        &mut self,
        span: &Range<usize>,
        name: &str,
        expected: &str,
        found: &PropertyValue,
    ) {
        let message =
            format!("`{}` must be {expected}, found {}", truncate_for_message(name), found.type_name());
        self.report_error(span.clone(), message, None);
    }

    /// Returns a numeric property. Other types are errors.
    pub(super) fn float(&mut self, object: &PluginInstance, name: &str) -> Option<f64> {
        let property = object.property(name)?;
        match &property.value {
            PropertyValue::Float(number) => Some(*number),
            PropertyValue::Integer(number) => Some(*number as f64),
            PropertyValue::Spectrum(SpectrumValue::Uniform(number)) => Some(*number),
            other => {
                self.report_wrong_type(&property.span, name, "a float", other);
                None
            }
        }
    }

    /// Returns an integer property. Other types are errors.
    pub(super) fn integer(&mut self, object: &PluginInstance, name: &str) -> Option<i64> {
        let property = object.property(name)?;
        match &property.value {
            PropertyValue::Integer(number) => Some(*number),
            PropertyValue::Float(number) if number.fract() == 0.0 => Some(*number as i64),
            other => {
                self.report_wrong_type(&property.span, name, "an integer", other);
                None
            }
        }
    }

    /// Returns a boolean property, or `default`. Other types are errors.
    pub(super) fn boolean(&mut self, object: &PluginInstance, name: &str, default: bool) -> bool {
        let Some(property) = object.property(name) else { return default };
        match &property.value {
            PropertyValue::Boolean(flag) => *flag,
            other => {
                self.report_wrong_type(&property.span, name, "a boolean", other);
                default
            }
        }
    }

    /// Returns a string property and its span. Other types are errors.
    pub(super) fn text(&mut self, object: &'a PluginInstance, name: &str) -> Option<(&'a str, Range<usize>)> {
        let property = object.property(name)?;
        match &property.value {
            PropertyValue::Text(text) => Some((text, property.span.clone())),
            other => {
                self.report_wrong_type(&property.span, name, "a string", other);
                None
            }
        }
    }

    /// Returns a vector property. Other types are errors.
    pub(super) fn vector_property(&mut self, object: &PluginInstance, name: &str) -> Option<DVec3> {
        let property = object.property(name)?;
        match &property.value {
            PropertyValue::Vector(vector) => Some(*vector),
            other => {
                self.report_wrong_type(&property.span, name, "a vector", other);
                None
            }
        }
    }

    /// Returns a transform property. Other types are errors.
    pub(super) fn transform_value(&mut self, object: &PluginInstance, name: &str) -> Option<TransformValue> {
        let property = object.property(name)?;
        match &property.value {
            PropertyValue::Transform(transform) => Some(*transform),
            other => {
                self.report_wrong_type(&property.span, name, "a transform", other);
                None
            }
        }
    }

    /// Returns the matrix of `to_world`, or the identity.
    pub(super) fn world_matrix(&mut self, object: &PluginInstance) -> DMat4 {
        self.transform_value(object, "to_world").map_or(DMat4::IDENTITY, |transform| transform.matrix)
    }

    /// Returns the nested objects of a kind, and marks those that the caller reaches as used.
    pub(super) fn children_of_kind(
        &self,
        object: &'a PluginInstance,
        kind: ObjectKind,
    ) -> impl Iterator<Item = &'a Child> + use<'a> {
        let graph = self.graph;
        let children = object.children.iter().filter(move |child| graph.objects[child.target].kind == kind);
        children.inspect(|child| child.is_used.set(true))
    }

    /// Adds the entries to the current table.
    pub(super) fn set_all(&mut self, entries: TableEntries) {
        for (key, value) in entries {
            self.document.set(key, value);
        }
    }

    /// Adds a note for each property of an object that has not been read.
    pub(super) fn report_unused(&mut self, index: GraphObjectIndex) {
        /// Properties that do not affect glimt's images.
        const IRRELEVANT: [&str; 12] = [
            "name",
            "sample_visible",
            "rr_depth",
            "silent",
            "max_smooth_angle",
            "collapse",
            "sampling_weight",
            "shutter_open",
            "shutter_close",
            "max_compile_time",
            "strict_normals",
            "approximate",
        ];
        let object = self.object_by_index(index);
        if !self.reported_unused.insert(index) {
            return;
        }
        for property in object.properties.iter().filter(|one| !one.is_used.get()) {
            if IRRELEVANT.contains(&property.name.as_str()) {
                continue;
            }
            let subject = format!(
                "`{}` of `{}`",
                truncate_for_message(&property.name),
                truncate_for_message(&object.plugin)
            );
            self.notes.note(&subject, "ignored", property.span.clone());
        }
    }
}

/// Relative luminance of a linear color.
pub(super) fn luminance(color: DVec3) -> f64 {
    color.dot(DVec3::new(0.212_671, 0.715_16, 0.072_169))
}
