//! The objects of a Mitsuba scene: plugins with properties, nested objects and references.

use std::cell::Cell;
use std::collections::HashMap;
use std::ops::Range;

use super::property::{PropertyValue, SpectrumValue, TransformValue};
use super::values::{self, ValueError, parse_float, parse_numbers, parse_point, to_snake_case_if_old};
use super::xml::{Attribute, Element, MAX_ERRORS, truncate_for_message};
use crate::control::CancelToken;
use crate::math::{DMat4, DVec3};
use crate::scene::SourceFiles;
use crate::scene::diagnostic::{Diagnostic, Severity};
use crate::scene::nearest::nearest_name;

/// Maximum number of properties of an object.
const MAX_PROPERTIES: usize = 1000;

/// Index of an object in the graph.
pub(super) type GraphObjectIndex = usize;

/// Kinds of objects, named after their XML elements.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ObjectKind {
    Scene,
    Bsdf,
    Emitter,
    Film,
    Filter,
    Integrator,
    Medium,
    Phase,
    Sampler,
    Sensor,
    Shape,
    Spectrum,
    Subsurface,
    Texture,
    Volume,
}

/// Tags of the elements that define objects.
const OBJECT_TAGS: [(&str, ObjectKind); 16] = [
    ("scene", ObjectKind::Scene),
    ("bsdf", ObjectKind::Bsdf),
    ("emitter", ObjectKind::Emitter),
    ("luminaire", ObjectKind::Emitter),
    ("film", ObjectKind::Film),
    ("rfilter", ObjectKind::Filter),
    ("integrator", ObjectKind::Integrator),
    ("medium", ObjectKind::Medium),
    ("phase", ObjectKind::Phase),
    ("sampler", ObjectKind::Sampler),
    ("sensor", ObjectKind::Sensor),
    ("camera", ObjectKind::Sensor),
    ("shape", ObjectKind::Shape),
    ("subsurface", ObjectKind::Subsurface),
    ("texture", ObjectKind::Texture),
    ("volume", ObjectKind::Volume),
];

/// Tags of the elements that define values.
const VALUE_TAGS: [&str; 16] = [
    "float",
    "integer",
    "boolean",
    "string",
    "vector",
    "point",
    "rgb",
    "srgb",
    "spectrum",
    "blackbody",
    "transform",
    "animation",
    "ref",
    "alias",
    "tensor",
    "xyz",
];

/// A plugin instance.
#[derive(Debug)]
pub(super) struct PluginInstance {
    pub(super) kind: ObjectKind,
    /// The plugin's name in lowercase.
    pub(super) plugin: String,
    pub(super) id: Option<String>,
    /// Span of the plugin's name, or of the tag if it has none.
    pub(super) span: Range<usize>,
    pub(super) properties: Vec<Property>,
    pub(super) children: Vec<Child>,
    /// Whether the file's version is below 2.
    pub(super) is_old: bool,
}

/// A named value.
#[derive(Debug)]
pub(super) struct Property {
    pub(super) name: String,
    pub(super) value: PropertyValue,
    pub(super) span: Range<usize>,
    pub(super) is_used: Cell<bool>,
}

/// A nested object or a reference.
#[derive(Clone, Debug)]
pub(super) struct Child {
    pub(super) name: Option<String>,
    pub(super) target: GraphObjectIndex,
    pub(super) span: Range<usize>,
    pub(super) is_used: Cell<bool>,
}

impl PluginInstance {
    /// Returns a property and marks it as used.
    pub(super) fn property(&self, name: &str) -> Option<&Property> {
        let found = self.properties.iter().find(|one| one.name == name)?;
        found.is_used.set(true);
        Some(found)
    }

    /// Returns the nested object with a name, and marks it as used.
    pub(super) fn named_child(&self, name: &str) -> Option<&Child> {
        let found = self.children.iter().find(|child| child.name.as_deref() == Some(name))?;
        found.is_used.set(true);
        Some(found)
    }
}

/// All objects of a scene.
#[derive(Debug, Default)]
pub(super) struct SceneGraph {
    pub(super) objects: Vec<PluginInstance>,
}

/// Builds the graph from the elements of a scene.
pub(super) struct GraphBuilder<'a> {
    graph: SceneGraph,
    ids: HashMap<String, GraphObjectIndex>,
    /// References to resolve when all objects are known.
    references: Vec<UnresolvedReference>,
    files: &'a SourceFiles,
    pub(super) errors: Vec<Diagnostic>,
    /// The last object with too many properties.
    overfull: Option<GraphObjectIndex>,
    token: &'a CancelToken,
}

/// An unresolved reference.
struct UnresolvedReference {
    parent: GraphObjectIndex,
    /// Index in the parent's children.
    child: usize,
    id: String,
    span: Range<usize>,
}

/// Target of an unresolved reference.
const UNRESOLVED: GraphObjectIndex = usize::MAX;

impl<'a> GraphBuilder<'a> {
    pub(super) fn new(files: &'a SourceFiles, token: &'a CancelToken) -> Self {
        let (graph, ids, references, errors, overfull) = Default::default();
        Self { graph, ids, references, files, errors, overfull, token }
    }

    fn report_error(&mut self, span: Range<usize>, message: impl Into<String>, help: Option<String>) {
        if self.errors.len() < MAX_ERRORS {
            self.errors.push(self.files.diagnostic(Severity::Error, span, message, "", help));
        }
    }

    /// Builds the graph, whose object 0 is the scene. Returns the errors if there are any. The graph is
    /// incomplete if the token is canceled.
    pub(super) fn build(mut self, root: &Element) -> Result<SceneGraph, Vec<Diagnostic>> {
        self.add_object(root, ObjectKind::Scene);
        self.resolve_references();
        if self.errors.is_empty() {
            self.report_first_cycle();
        }
        if self.errors.is_empty() { Ok(self.graph) } else { Err(self.errors) }
    }

    fn add_object(&mut self, element: &Element, kind: ObjectKind) -> Option<GraphObjectIndex> {
        let plugin = element.attribute("type");
        if plugin.is_none() && kind != ObjectKind::Scene {
            let help = format!("write <{} type=\"…\">", truncate_for_message(&element.tag));
            self.report_error(element.span.clone(), "the attribute `type` is missing", Some(help));
            return None;
        }
        let (name, span) =
            plugin.map_or(("scene", element.span.clone()), |one| (&one.value, one.span.clone()));
        let index = self.graph.objects.len();
        let id = element.value("id").map(str::to_owned);
        if let Some(id) = &id
            && self.ids.insert(id.clone(), index).is_some()
        {
            let span = element.attribute("id").map_or(element.span.clone(), |one| one.span.clone());
            self.report_error(span, format!("the id `{}` is used twice", truncate_for_message(id)), None);
        }
        self.graph.objects.push(PluginInstance {
            kind,
            plugin: name.to_ascii_lowercase(),
            id,
            span,
            properties: Vec::new(),
            children: Vec::new(),
            is_old: element.is_old,
        });
        for child in &element.children {
            self.add_child_or_property(index, child);
        }
        if element.is_old {
            self.upgrade_old_properties(index);
        }
        Some(index)
    }

    /// Adds a nested object, a reference or a property to an object.
    fn add_child_or_property(&mut self, parent: GraphObjectIndex, element: &Element) {
        if self.token.check_pause_and_cancel().is_err() {
            return;
        }
        let tag = element.tag.as_str();
        let is_plugin_spectrum = tag == "spectrum" && element.attribute("type").is_some();
        let kind = OBJECT_TAGS.iter().find(|(name, _)| *name == tag).map(|(_, kind)| *kind);
        if let Some(kind) = kind.or(is_plugin_spectrum.then_some(ObjectKind::Spectrum)) {
            let name = element.value("name").map(|name| to_snake_case_if_old(name, element.is_old));
            if let Some(target) = self.add_object(element, kind) {
                let span = element.span.clone();
                self.graph.objects[parent].children.push(Child {
                    name,
                    target,
                    span,
                    is_used: Cell::new(false),
                });
            }
            return;
        }
        match tag {
            "ref" => {
                let Some(id) = self.required_attribute(element, "id") else { return };
                let (id, span) = (id.value.clone(), id.span.clone());
                let name = element.value("name").map(|name| to_snake_case_if_old(name, element.is_old));
                let children = &mut self.graph.objects[parent].children;
                let child = children.len();
                let is_used = Cell::new(false);
                children.push(Child { name, target: UNRESOLVED, span: span.clone(), is_used });
                self.references.push(UnresolvedReference { parent, child, id, span });
            }
            "alias" => {
                let (Some(id), Some(copy)) =
                    (self.required_attribute(element, "id"), self.required_attribute(element, "as"))
                else {
                    return;
                };
                match self.ids.get(&id.value) {
                    Some(&target) => {
                        self.ids.insert(copy.value.clone(), target);
                    }
                    None => {
                        self.report_error(id.span.clone(), "no object before this alias has this id", None);
                    }
                }
            }
            _ if VALUE_TAGS.contains(&tag) => self.add_property(parent, element),
            _ => {
                let known = OBJECT_TAGS.iter().map(|(name, _)| *name).chain(VALUE_TAGS);
                let help = nearest_name(tag, known.chain(["include", "default", "path"]));
                let help = help.map(|near| format!("did you mean <{near}>?"));
                self.report_error(
                    element.span.clone(),
                    format!("unknown element <{}>", truncate_for_message(tag)),
                    help,
                );
            }
        }
    }

    /// Returns a required attribute, or reports an error.
    fn required_attribute<'e>(&mut self, element: &'e Element, name: &str) -> Option<&'e Attribute> {
        let found = element.attribute(name);
        if found.is_none() {
            let message = format!("<{}> needs the attribute `{name}`", truncate_for_message(&element.tag));
            self.report_error(element.span.clone(), message, None);
        }
        found
    }

    fn add_property(&mut self, parent: GraphObjectIndex, element: &Element) {
        let Some(name) = self.required_attribute(element, "name") else { return };
        let name = to_snake_case_if_old(&name.value, element.is_old);
        let value = match self.parse_property_value(element) {
            Ok(value) => value,
            Err(ValueError { span, message, help }) => return self.report_error(span, message, help),
        };
        let span = element.attribute("value").map_or(element.span.clone(), |value| value.span.clone());
        if self.graph.objects[parent].properties.len() >= MAX_PROPERTIES {
            if self.overfull.replace(parent) != Some(parent) {
                self.report_error(span, format!("more than {MAX_PROPERTIES} properties"), None);
            }
            return;
        }
        let properties = &mut self.graph.objects[parent].properties;
        if let Some(known) = properties.iter_mut().find(|known| known.name == name) {
            // Version 0.6 only warns about duplicates.
            if !element.is_old && known.value != value {
                return self.report_error(
                    span,
                    format!("`{}` is specified twice", truncate_for_message(&name)),
                    None,
                );
            }
            known.value = value;
            return;
        }
        properties.push(Property { name, value, span, is_used: Cell::new(false) });
    }

    fn parse_property_value(&mut self, element: &Element) -> Result<PropertyValue, ValueError> {
        match element.tag.as_str() {
            "transform" => Ok(PropertyValue::Transform(values::parse_transform(element)?)),
            "animation" => {
                let first = element.children.first().ok_or_else(|| ValueError {
                    span: element.span.clone(),
                    message: "the animation is empty".to_owned(),
                    help: None,
                })?;
                Ok(PropertyValue::Transform(values::parse_transform(first)?))
            }
            "vector" | "point" => {
                values::check_attributes(element, &["x", "y", "z", "value", "name", "id"])?;
                Ok(PropertyValue::Vector(parse_point(element, None)?))
            }
            "blackbody" => {
                let number = |name: &str, default: f64| match element.attribute(name) {
                    Some(attribute) => {
                        parse_float(attribute.value.trim_end_matches(['k', 'K']), &attribute.span)
                    }
                    None => Ok(default),
                };
                let (temperature, scale) = (number("temperature", 5000.0)?, number("scale", 1.0)?);
                Ok(PropertyValue::Spectrum(SpectrumValue::Blackbody(temperature, scale)))
            }
            "spectrum" => {
                if let Some(file) = element.attribute("filename") {
                    return Ok(PropertyValue::Spectrum(SpectrumValue::File(file.value.clone())));
                }
                values::parse_spectrum_or_rgb(self.required_value_attribute(element)?)
            }
            "tensor" => Err(ValueError {
                span: element.span.clone(),
                message: "glimt does not read tensors".to_owned(),
                help: None,
            }),
            tag => {
                let attribute = self.required_value_attribute(element)?;
                let (text, span) = (attribute.value.trim(), &attribute.span);
                match tag {
                    "float" => parse_float(text, span).map(PropertyValue::Float),
                    "integer" => values::parse_integer(text, span).map(PropertyValue::Integer),
                    "boolean" => values::parse_boolean(text, span).map(PropertyValue::Boolean),
                    "rgb" => values::parse_rgb(text, span).map(PropertyValue::Rgb),
                    "srgb" => values::parse_srgb(text, span).map(PropertyValue::Rgb),
                    "xyz" => {
                        let xyz = parse_numbers::<3>(text, span)?;
                        let color = crate::formats::foreign::spectra::xyz_to_linear_rgb(xyz.into());
                        Ok(PropertyValue::Rgb(color.max(DVec3::ZERO)))
                    }
                    _ => Ok(PropertyValue::Text(attribute.value.clone())),
                }
            }
        }
    }

    fn required_value_attribute<'e>(&self, element: &'e Element) -> Result<&'e Attribute, ValueError> {
        element.attribute("value").ok_or_else(|| ValueError {
            span: element.span.clone(),
            message: format!("<{}> needs the attribute `value`", truncate_for_message(&element.tag)),
            help: None,
        })
    }

    /// Converts properties of versions below 2 to those of Mitsuba 3.
    fn upgrade_old_properties(&mut self, index: GraphObjectIndex) {
        let object = &mut self.graph.objects[index];
        if object.plugin == "diffuse" {
            let old = "diffuse_reflectance";
            object
                .properties
                .iter_mut()
                .filter(|one| one.name == old)
                .for_each(|one| one.name = "reflectance".to_owned());
            let children = object.children.iter_mut().filter(|child| child.name.as_deref() == Some(old));
            children.for_each(|child| child.name = Some("reflectance".to_owned()));
        }
        let number = |name: &str, default: f64| {
            let found = object.properties.iter().find(|one| one.name == name);
            match found.map(|one| &one.value) {
                Some(PropertyValue::Float(number)) => (*number, found.map(|one| one.span.clone())),
                Some(PropertyValue::Integer(number)) => (*number as f64, found.map(|one| one.span.clone())),
                Some(_) | None => (default, None),
            }
        };
        let parts =
            [number("uscale", 1.0), number("vscale", 1.0), number("uoffset", 0.0), number("voffset", 0.0)];
        let Some(span) = parts.iter().find_map(|(_, span)| span.clone()) else { return };
        let [(scale_u, _), (scale_v, _), (offset_u, _), (offset_v, _)] = parts;
        let names = ["uscale", "vscale", "uoffset", "voffset"];
        object.properties.retain(|one| !names.contains(&one.name.as_str()));
        let scale = DMat4::from_scale(DVec3::new(scale_u, scale_v, 1.0));
        let matrix = scale * DMat4::from_translation(DVec3::new(offset_u, offset_v, 0.0));
        let value = PropertyValue::Transform(TransformValue { matrix, target: None });
        object.properties.push(Property { name: "to_uv".to_owned(), value, span, is_used: Cell::new(false) });
    }

    fn resolve_references(&mut self) {
        for UnresolvedReference { parent, child, id, span } in std::mem::take(&mut self.references) {
            match self.ids.get(&id) {
                Some(&target) => self.graph.objects[parent].children[child].target = target,
                None if self.errors.len() >= MAX_ERRORS => return,
                None => {
                    let near = nearest_name(&id, self.ids.keys().map(String::as_str).take(4096));
                    let help = near.map(|near| format!("did you mean `{near}`?"));
                    self.report_error(
                        span,
                        format!("no object has the id `{}`", truncate_for_message(&id)),
                        help,
                    );
                }
            }
        }
    }

    /// Reports the first object found that contains itself.
    fn report_first_cycle(&mut self) {
        const NEW: u8 = 0;
        const OPEN: u8 = 1;
        const DONE: u8 = 2;
        let mut states = vec![NEW; self.graph.objects.len()];
        // Objects being visited, each with the index of its next child.
        let mut stack = vec![(0, 0)];
        while let Some((index, next)) = stack.pop() {
            states[index] = OPEN;
            match self.graph.objects[index].children.get(next) {
                None => states[index] = DONE,
                Some(child) => {
                    let (target, span) = (child.target, child.span.clone());
                    stack.push((index, next + 1));
                    match states[target] {
                        NEW => stack.push((target, 0)),
                        OPEN => {
                            self.report_error(
                                span,
                                "this object contains itself",
                                Some("remove this reference".to_owned()),
                            );
                            return;
                        }
                        _ => {}
                    }
                }
            }
        }
    }
}
