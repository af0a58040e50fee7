//! Shared state of the functions that convert a scene graph to a scene document.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::ops::Range;
use std::path::{Path, PathBuf};

use super::bsdfs::MaterialKey;
use super::graph::{Child, Object, ObjectIndex, ObjectKind, PropertyValue, SceneGraph, SpectrumValue, TransformValue};
use super::xml::{MAX_ERRORS, shorten};
use super::plastic::PlasticCoat;
use crate::assets::Companion;
use crate::formats::ForeignReadContext;
use crate::control::CancelToken;
use crate::formats::foreign::notes::NoteCollector;
use crate::formats::foreign::options::{ForeignOptions, MissingAssetMode};
use crate::formats::foreign::spectra::{
    SampledSpectrum, blackbody_radiance, emission_color, flat_emission_color, reflectance_color, spectrum_to_xyz,
    unbounded_color, xyz_to_linear_rgb,
};
use crate::formats::model::UsedNames;
use crate::math::{DMat4, DVec3};
use crate::scene::diagnostic::{Diagnostic, Severity};
use crate::scene::nearest::nearest_name;
use crate::stages::containers::GltfContainers;
use crate::scene::{BuiltDocument, BuiltValue, SourceFiles};

/// Keys and values of a table.
pub(super) type Entries = Vec<(&'static str, BuiltValue)>;

/// What a color is used for, which determines how spectra are converted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum ColorRole {
    /// A reflectance or transmittance from 0 to 1.
    Reflectance,
    /// Emitted light.
    Emission,
    /// An index of refraction or another unbounded quantity.
    Unbounded,
}

/// A color or the texture that contains it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum ColorSource {
    Constant(DVec3),
    Texture(ObjectIndex),
}

/// A number or the texture that contains it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum NumberSource {
    Constant(f64),
    Texture(ObjectIndex),
}

/// Converts a scene graph to a scene document.
pub(super) struct SceneReader<'a> {
    pub(super) graph: &'a SceneGraph,
    pub(super) files: &'a SourceFiles,
    /// The scene file.
    pub(super) path: &'a Path,
    /// Folders to search for assets, the last one first.
    pub(super) folders: &'a [PathBuf],
    pub(super) options: &'a ForeignOptions,
    pub(super) token: &'a CancelToken,
    /// Loads meshes.
    pub(super) containers: &'a GltfContainers,
    /// Folder to which an import copies the assets. `None` if they stay in place.
    pub(super) asset_folder: Option<&'a str>,
    pub(super) errors: Vec<Diagnostic>,
    pub(super) notes: NoteCollector,
    pub(super) document: BuiltDocument,
    pub(super) companions: Vec<Companion>,
    /// Names in the document, by kind of table.
    pub(super) material_names: UsedNames,
    pub(super) texture_names: UsedNames,
    pub(super) shape_names: UsedNames,
    pub(super) group_names: UsedNames,
    /// Names of the materials that are in the document. `None` marks invisible surfaces.
    pub(super) materials: HashMap<MaterialKey, Option<String>>,
    /// Names of the textures that are in the document, by their keys.
    pub(super) textures: HashMap<String, String>,
    /// Names of the groups in the document. `None` marks groups without visible shapes.
    pub(super) groups: HashMap<ObjectIndex, Option<String>>,
    /// Names of the files that an import writes, by source.
    pub(super) asset_names: BTreeMap<PathBuf, String>,
    pub(super) used_asset_names: UsedNames,
    /// Properties reported as unused.
    pub(super) reported_unused: HashSet<ObjectIndex>,
    pub(super) has_environment: bool,
    /// Name of the black material, if it is in the document.
    pub(super) black: Option<String>,
    /// Integrals of plastic coats, by index of refraction, α and distribution.
    pub(super) plastic_coats: HashMap<(u64, Option<u64>, bool), PlasticCoat>,
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
            document: BuiltDocument::default(),
            companions: Vec::new(),
            material_names: UsedNames::default(),
            texture_names: UsedNames::default(),
            shape_names: UsedNames::default(),
            group_names: UsedNames::default(),
            materials: HashMap::new(),
            textures: HashMap::new(),
            groups: HashMap::new(),
            asset_names: BTreeMap::new(),
            used_asset_names: UsedNames::default(),
            reported_unused: HashSet::new(),
            has_environment: false,
            black: None,
            plastic_coats: HashMap::new(),
        }
    }

    /// Returns an object. The result does not borrow the reader.
    pub(super) fn object(&self, index: ObjectIndex) -> &'a Object {
        &self.graph.objects[index]
    }

    /// Reports an error.
    pub(super) fn error(&mut self, span: Range<usize>, message: impl Into<String>, help: Option<String>) {
        if self.errors.len() < MAX_ERRORS {
            self.errors.push(self.files.diagnostic(Severity::Error, span, message, "", help));
        }
    }

    /// Reports a feature that glimt lacks and cannot replace.
    pub(super) fn refuse(&mut self, object: &Object, what: &str) {
        let message = format!("glimt does not render {what} (`{}`)", shorten(&object.plugin));
        let help = "remove it, or render this scene with Mitsuba".to_owned();
        self.error(object.span.clone(), message, Some(help));
    }

    /// Reports a plugin that neither Mitsuba nor glimt knows.
    pub(super) fn unknown_plugin(&mut self, object: &Object, kind: &str, known: &[&str]) {
        let near = nearest_name(&object.plugin, known.iter().copied());
        let help = match near {
            Some(near) => format!("did you mean `{near}`?"),
            None => format!("expected one of {}", known.join(", ")),
        };
        self.error(object.span.clone(), format!("unknown {kind} `{}`", shorten(&object.plugin)), Some(help));
    }

    fn wrong_type(&mut self, span: &Range<usize>, name: &str, expected: &str, found: &PropertyValue) {
        let message = format!("`{}` must be {expected}, found {}", shorten(name), found.type_name());
        self.error(span.clone(), message, None);
    }

    /// Returns a number.
    pub(super) fn float(&mut self, object: &Object, name: &str) -> Option<f64> {
        let property = object.property(name)?;
        match &property.value {
            PropertyValue::Float(number) => Some(*number),
            PropertyValue::Integer(number) => Some(*number as f64),
            PropertyValue::Spectrum(SpectrumValue::Uniform(number)) => Some(*number),
            other => {
                self.wrong_type(&property.span, name, "a float", other);
                None
            }
        }
    }

    /// Returns an integer.
    pub(super) fn integer(&mut self, object: &Object, name: &str) -> Option<i64> {
        let property = object.property(name)?;
        match &property.value {
            PropertyValue::Integer(number) => Some(*number),
            PropertyValue::Float(number) if number.fract() == 0.0 => Some(*number as i64),
            other => {
                self.wrong_type(&property.span, name, "an integer", other);
                None
            }
        }
    }

    /// Returns a boolean.
    pub(super) fn boolean(&mut self, object: &Object, name: &str, default: bool) -> bool {
        let Some(property) = object.property(name) else { return default };
        match &property.value {
            PropertyValue::Boolean(flag) => *flag,
            other => {
                self.wrong_type(&property.span, name, "a boolean", other);
                default
            }
        }
    }

    /// Returns a string and its span.
    pub(super) fn text(&mut self, object: &'a Object, name: &str) -> Option<(&'a str, Range<usize>)> {
        let property = object.property(name)?;
        match &property.value {
            PropertyValue::Text(text) => Some((text, property.span.clone())),
            other => {
                self.wrong_type(&property.span, name, "a string", other);
                None
            }
        }
    }

    /// Returns a vector.
    pub(super) fn vector(&mut self, object: &Object, name: &str) -> Option<DVec3> {
        let property = object.property(name)?;
        match &property.value {
            PropertyValue::Vector(vector) => Some(*vector),
            other => {
                self.wrong_type(&property.span, name, "a vector", other);
                None
            }
        }
    }

    /// Returns a transform.
    pub(super) fn transform_value(&mut self, object: &Object, name: &str) -> Option<TransformValue> {
        let property = object.property(name)?;
        match &property.value {
            PropertyValue::Transform(transform) => Some(*transform),
            other => {
                self.wrong_type(&property.span, name, "a transform", other);
                None
            }
        }
    }

    /// Returns the matrix of `to_world`, or the identity.
    pub(super) fn world_matrix(&mut self, object: &Object) -> DMat4 {
        self.transform_value(object, "to_world").map_or(DMat4::IDENTITY, |transform| transform.matrix)
    }

    /// Returns a color or texture. `default` is a gray.
    pub(super) fn color(&mut self, object: &'a Object, name: &str, role: ColorRole, default: f64) -> ColorSource {
        if let Some(child) = object.named_child(name) {
            return self.color_of_child(child, role);
        }
        let Some(property) = object.property(name) else {
            return ColorSource::Constant(DVec3::splat(default));
        };
        let color = match &property.value {
            PropertyValue::Float(number) => Some(DVec3::splat(*number)),
            PropertyValue::Integer(number) => Some(DVec3::splat(*number as f64)),
            PropertyValue::Rgb(color) => Some(*color),
            PropertyValue::Spectrum(spectrum) => self.spectrum_color(spectrum, role, &property.span),
            other => {
                self.wrong_type(&property.span, name, "a color", other);
                None
            }
        };
        ColorSource::Constant(color.unwrap_or(DVec3::splat(default)).max(DVec3::ZERO))
    }

    fn color_of_child(&mut self, child: &Child, role: ColorRole) -> ColorSource {
        let object = self.object(child.target);
        match object.kind {
            ObjectKind::Texture if matches!(object.plugin.as_str(), "rawconstant" | "constant" | "srgb" | "uniform") => {
                ColorSource::Constant(self.constant_texture_color(object))
            }
            ObjectKind::Texture => ColorSource::Texture(child.target),
            ObjectKind::Spectrum => ColorSource::Constant(self.spectrum_plugin_color(object, role)),
            _ => {
                self.error(child.span.clone(), "expected a texture", None);
                ColorSource::Constant(DVec3::splat(0.5))
            }
        }
    }

    /// Returns the color of a texture with a single value.
    fn constant_texture_color(&mut self, object: &'a Object) -> DVec3 {
        let name = if object.property("color").is_some() { "color" } else { "value" };
        match object.property(name).map(|property| &property.value) {
            Some(PropertyValue::Vector(vector)) => *vector,
            Some(_) | None => match self.color(object, name, ColorRole::Unbounded, 0.5) {
                ColorSource::Constant(color) => color,
                ColorSource::Texture(_) => DVec3::splat(0.5),
            },
        }
    }

    /// Returns the color of a `<spectrum type="…">`.
    pub(super) fn spectrum_plugin_color(&mut self, object: &'a Object, role: ColorRole) -> DVec3 {
        let constant = |source: ColorSource| match source {
            ColorSource::Constant(color) => color,
            ColorSource::Texture(_) => DVec3::splat(0.5),
        };
        match object.plugin.as_str() {
            "uniform" => {
                let value = self.float(object, "value").unwrap_or(1.0);
                // In Mitsuba's RGB mode, an explicit `uniform` plugin is gray.
                DVec3::splat(value)
            }
            "srgb" | "rgb" => constant(self.color(object, if object.property("color").is_some() { "color" } else { "value" }, role, 1.0)),
            "d65" => {
                let scale = self.float(object, "scale").unwrap_or(1.0);
                let color = constant(self.color(object, "color", ColorRole::Reflectance, 1.0));
                color * scale
            }
            "blackbody" => {
                let kelvin = self.float(object, "temperature").unwrap_or(5000.0);
                let scale = self.float(object, "scale").unwrap_or(1.0);
                blackbody_color(kelvin) * scale
            }
            "regular" | "irregular" => self.tabulated_spectrum(object, role),
            _ => {
                self.unknown_plugin(object, "spectrum", &["uniform", "srgb", "d65", "blackbody", "regular", "irregular"]);
                DVec3::splat(0.5)
            }
        }
    }

    fn tabulated_spectrum(&mut self, object: &'a Object, role: ColorRole) -> DVec3 {
        let numbers = |text: Option<(&str, Range<usize>)>| -> Vec<f64> {
            let words = text.map_or("", |(text, _)| text).split(|c: char| c.is_whitespace() || c == ',');
            words.filter_map(|word| word.parse().ok()).collect()
        };
        if let Some(property) = object.property("value")
            && let PropertyValue::Spectrum(spectrum) = &property.value
        {
            return self.spectrum_color(spectrum, role, &property.span).unwrap_or(DVec3::splat(0.5));
        }
        let values = numbers(self.text(object, if object.property("values").is_some() { "values" } else { "value" }));
        let wavelengths = match object.plugin.as_str() {
            "irregular" => numbers(self.text(object, "wavelengths")),
            _ => {
                let first = self.float(object, "wavelength_min").unwrap_or(360.0);
                let last = self.float(object, "wavelength_max").unwrap_or(830.0);
                let steps = (values.len().max(2) - 1) as f64;
                (0..values.len()).map(|index| first + (last - first) * index as f64 / steps).collect()
            }
        };
        let points = wavelengths.into_iter().zip(values).map(|(wavelength, value)| [wavelength, value]).collect();
        match SampledSpectrum::new(points) {
            Ok(spectrum) => sampled_color(&spectrum, role),
            Err(reason) => {
                self.error(object.span.clone(), reason, None);
                DVec3::splat(0.5)
            }
        }
    }

    fn spectrum_color(&mut self, spectrum: &SpectrumValue, role: ColorRole, span: &Range<usize>) -> Option<DVec3> {
        match spectrum {
            SpectrumValue::Uniform(value) => Some(match role {
                ColorRole::Emission => flat_emission_color() * *value,
                ColorRole::Reflectance | ColorRole::Unbounded => DVec3::splat(*value),
            }),
            SpectrumValue::Sampled(spectrum) => Some(sampled_color(spectrum, role)),
            SpectrumValue::Blackbody(kelvin, scale) => Some(blackbody_color(*kelvin) * *scale),
            SpectrumValue::File(name) => {
                let path = self.find_file(name, span)?;
                let read = crate::assets::read_text_file(&path, 16 << 20, self.token);
                let text = match read {
                    Ok(file) => {
                        let (hash, stamp) = (Some(file.hash), file.stamp);
                        self.companions.push(Companion { path: path.clone(), hash, stamp });
                        file.text
                    }
                    Err(error) => {
                        self.companions.push(Companion { path, hash: None, stamp: None });
                        self.error(span.clone(), format!("cannot read the spectrum: {error}"), None);
                        return None;
                    }
                };
                match SampledSpectrum::from_spd(&text) {
                    Ok(spectrum) => Some(sampled_color(&spectrum, role)),
                    Err((line, reason)) => {
                        let message = format!("{}:{line}: {reason}", path.display());
                        self.error(span.clone(), message, None);
                        None
                    }
                }
            }
        }
    }

    /// Returns a number or texture.
    pub(super) fn number(&mut self, object: &'a Object, name: &str, default: f64) -> NumberSource {
        if let Some(child) = object.named_child(name) {
            return match self.color_of_child(child, ColorRole::Reflectance) {
                ColorSource::Constant(color) => NumberSource::Constant(luminance(color)),
                ColorSource::Texture(texture) => NumberSource::Texture(texture),
            };
        }
        let Some(property) = object.property(name) else { return NumberSource::Constant(default) };
        NumberSource::Constant(match &property.value {
            PropertyValue::Float(number) => *number,
            PropertyValue::Integer(number) => *number as f64,
            PropertyValue::Spectrum(SpectrumValue::Uniform(number)) => *number,
            PropertyValue::Rgb(color) => luminance(*color),
            other => {
                self.wrong_type(&property.span, name, "a number or a texture", other);
                default
            }
        })
    }

    /// Returns the nested objects of a kind.
    pub(super) fn children_of_kind(
        &self,
        object: &'a Object,
        kind: ObjectKind,
    ) -> impl Iterator<Item = &'a Child> + use<'a> {
        let graph = self.graph;
        object.children.iter().filter(move |child| graph.objects[child.target].kind == kind)
    }

    /// Searches for a file. Reports an error if it does not exist, or returns `None` with a substitution if
    /// missing files are allowed.
    pub(super) fn find_file(&mut self, name: &str, span: &Range<usize>) -> Option<PathBuf> {
        let own_folder = self.files.path_at(span).and_then(Path::parent);
        let own = own_folder.map(|folder| folder.join(name));
        // Files written on Windows have backslashes.
        let plain = name.replace('\\', "/");
        let names = [name, plain.as_str()];
        let candidates = names.iter().flat_map(|name| self.folders.iter().rev().map(move |folder| folder.join(name)));
        let found = candidates.chain(own).find(|path| path.is_file());
        if found.is_none() {
            let first = self.folders.first().map_or_else(|| PathBuf::from(name), |folder| folder.join(&plain));
            self.companions.push(Companion { path: first, hash: None, stamp: None });
        }
        found
    }

    /// Returns the name by which the document refers to an asset. Reports an error if the file does not
    /// exist, unless missing files are allowed.
    pub(super) fn asset(&mut self, name: &str, span: &Range<usize>, kind: &str) -> Option<String> {
        let path = self.asset_path(name, span, kind)?;
        Some(self.asset_reference(&path))
    }

    /// Returns the path of an asset. Reports an error if the file does not exist, unless missing files are
    /// allowed.
    pub(super) fn asset_path(&mut self, name: &str, span: &Range<usize>, kind: &str) -> Option<PathBuf> {
        if let Some(found) = self.find_file(name, span) {
            return Some(found);
        }
        match self.options.missing {
            MissingAssetMode::Error => {
                let help = "add the file, or use --missing note to render without it".to_owned();
                self.error(span.clone(), format!("{kind} not found: {}", shorten(name)), Some(help));
            }
            MissingAssetMode::Note => {
                let text = if kind == "image" { "not found; replaced by gray" } else { "not found; left out" };
                self.notes.substitute_light(&format!("{kind} {}", shorten(name)), text, span.clone());
            }
        }
        None
    }

    /// Returns the name by which the document refers to an existing file.
    pub(super) fn asset_reference(&mut self, path: &Path) -> String {
        let Some(folder) = self.asset_folder else {
            let scene_folder = self.path.parent().unwrap_or(Path::new(""));
            let relative = path.strip_prefix(scene_folder).unwrap_or(path);
            // A path that does not start with the scene's folder is relative to the working directory.
            let is_relative = relative == path && !path.is_absolute() && !scene_folder.as_os_str().is_empty();
            let absolute = is_relative.then(|| std::path::absolute(path).ok()).flatten();
            return absolute.as_deref().unwrap_or(relative).to_string_lossy().into_owned();
        };
        if let Some(known) = self.asset_names.get(path) {
            return known.clone();
        }
        let stem = path.file_stem().unwrap_or_default().to_string_lossy().to_lowercase();
        let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        let plain: String =
            stem.chars().map(|c| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '_' }).take(60).collect();
        // Names of numbers are allowed for files, so use the extension to make them unique.
        let unique = self.used_asset_names.make_unique(&format!("{plain}.{extension}"), "asset");
        let name = match unique.strip_prefix(&format!("{plain}.{extension}")) {
            Some("") | None => unique.clone(),
            Some(number) => format!("{plain}{number}.{extension}"),
        };
        let name = format!("{folder}/{name}");
        self.asset_names.insert(path.to_owned(), name.clone());
        name
    }

    /// Adds the entries to the current table.
    pub(super) fn set_all(&mut self, entries: Entries) {
        for (key, value) in entries {
            self.document.set(key, value);
        }
    }

    /// Notes properties of an object that no function has read.
    pub(super) fn report_unused(&mut self, index: ObjectIndex) {
        /// Properties without an effect on the image in glimt.
        const IRRELEVANT: [&str; 12] = [
            "name", "sample_visible", "rr_depth", "silent", "max_smooth_angle", "collapse", "sampling_weight",
            "shutter_open", "shutter_close", "max_compile_time", "strict_normals", "approximate",
        ];
        let object = self.object(index);
        if !self.reported_unused.insert(index) {
            return;
        }
        for property in object.properties.iter().filter(|one| !one.is_used.get()) {
            if IRRELEVANT.contains(&property.name.as_str()) {
                continue;
            }
            let subject = format!("`{}` of `{}`", shorten(&property.name), shorten(&object.plugin));
            self.notes.note(&subject, "ignored", property.span.clone());
        }
    }
}

/// Color of a sampled spectrum.
fn sampled_color(spectrum: &SampledSpectrum, role: ColorRole) -> DVec3 {
    match role {
        ColorRole::Reflectance => reflectance_color(spectrum),
        ColorRole::Emission => emission_color(spectrum),
        ColorRole::Unbounded => unbounded_color(spectrum),
    }
}

/// Radiance of a blackbody, in linear Rec. 709, in the units of Mitsuba: W·sr⁻¹·m⁻² per nanometer.
fn blackbody_color(kelvin: f64) -> DVec3 {
    xyz_to_linear_rgb(spectrum_to_xyz(|wavelength| blackbody_radiance(wavelength, kelvin))).max(DVec3::ZERO)
}

/// Relative luminance of a linear color.
pub(super) fn luminance(color: DVec3) -> f64 {
    color.dot(DVec3::new(0.212_671, 0.715_16, 0.072_169))
}
