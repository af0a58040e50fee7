//! Reads the XML files of a Mitsuba scene, and resolves includes, defaults and parameters.

use std::ops::Range;
use std::path::{Path, PathBuf};

use roxmltree::{Document, Node, ParsingOptions, TextPos};

use super::tags::{MAX_ATTRIBUTES, element_name_span, find_overfull_tag};
use crate::assets::AssetError;
use crate::control::CancelToken;
use crate::formats::foreign::sources::SourceReader;
use crate::scene::diagnostic::{Diagnostic, Severity};
use crate::scene::nearest::nearest_name;

/// Maximum depth of nested includes, as in Mitsuba.
const MAX_INCLUDE_DEPTH: usize = 15;
/// Maximum depth of nested elements.
const MAX_DEPTH: usize = 64;
/// Maximum number of XML nodes in a file.
const MAX_NODES: u32 = 4 << 20;
/// Maximum length of an attribute. Ample for a spectrum.
const MAX_ATTRIBUTE_BYTES: usize = 4 << 20;
/// Maximum length of a parameter, and of an attribute after substitution.
const MAX_SUBSTITUTED_BYTES: usize = 64 << 10;
/// Maximum total length of the attributes of a scene that contain parameters.
const MAX_ADDED_BYTES: usize = 32 << 20;
/// Maximum number of errors reported.
pub(super) const MAX_ERRORS: usize = 100;

/// An XML element.
#[derive(Debug)]
pub(super) struct Element {
    pub(super) tag: String,
    pub(super) attributes: Vec<Attribute>,
    pub(super) children: Vec<Element>,
    /// Span of the element's name in its start tag.
    pub(super) span: Range<usize>,
    /// Whether the file's version is below 2, in which names are in camel case.
    pub(super) is_old: bool,
}

/// An attribute.
#[derive(Debug)]
pub(super) struct Attribute {
    pub(super) name: String,
    pub(super) value: String,
    /// Span of the value, without the quotes.
    pub(super) span: Range<usize>,
}

impl Element {
    /// Returns the attribute called `name`.
    pub(super) fn attribute(&self, name: &str) -> Option<&Attribute> {
        self.attributes.iter().find(|one| one.name == name)
    }

    /// Returns the value of the attribute called `name`.
    pub(super) fn value(&self, name: &str) -> Option<&str> {
        self.attribute(name).map(|one| one.value.as_str())
    }
}

/// Loads the files of a scene.
pub(super) struct XmlLoader<'a> {
    pub(super) reader: SourceReader,
    pub(super) errors: Vec<Diagnostic>,
    /// Folders to search for files, last first.
    pub(super) folders: Vec<PathBuf>,
    /// Names and values of the parameters. The first definition takes precedence.
    parameters: Vec<(String, String)>,
    /// Files being read, outermost first, to detect include cycles.
    open: Vec<PathBuf>,
    /// Total length of the attributes substituted so far.
    substituted_bytes: usize,
    token: &'a CancelToken,
}

impl<'a> XmlLoader<'a> {
    pub(super) fn new(scene: &Path, defines: &[(String, String)], token: &'a CancelToken) -> Self {
        let folder = scene.parent().unwrap_or(Path::new("")).to_owned();
        let mut parameters: Vec<(String, String)> = Vec::new();
        // If `-D` repeats a name, the last value takes precedence.
        for (name, value) in defines.iter().rev() {
            if !parameters.iter().any(|(known, _)| known == name) {
                parameters.push((name.clone(), value.clone()));
            }
        }
        let (reader, errors, open) = Default::default();
        Self { reader, errors, folders: vec![folder], parameters, open, substituted_bytes: 0, token }
    }

    /// Reports an error, unless there are `MAX_ERRORS` already.
    pub(super) fn report_error(
        &mut self,
        span: Range<usize>,
        message: impl Into<String>,
        help: Option<String>,
    ) {
        if self.errors.len() < MAX_ERRORS {
            self.errors.push(self.reader.files.diagnostic(Severity::Error, span, message, "", help));
        }
    }

    /// Loads the scene file and all files that it includes, and substitutes the parameters.
    pub(super) fn load_scene_elements(&mut self, path: &Path) -> Result<Option<Element>, AssetError> {
        let Some(mut root) = self.load_file(path)? else { return Ok(None) };
        if root.tag != "scene" {
            let message = format!("the root element is <{}>, not <scene>", truncate_for_message(&root.tag));
            let help = "this file is part of a scene; open the file that includes it".to_owned();
            self.report_error(root.span.clone(), message, Some(help));
            return Ok(None);
        }
        self.parameters.sort_by_key(|(name, _)| std::cmp::Reverse(name.len()));
        self.substitute_in_element(&mut root);
        self.token.check_pause_and_cancel()?;
        Ok(Some(root))
    }

    fn load_file(&mut self, path: &Path) -> Result<Option<Element>, AssetError> {
        let (text, start) = self.reader.read(path, self.token)?;
        if let Some(span) = find_overfull_tag(&text) {
            let message = format!("the element has more than {MAX_ATTRIBUTES} attributes");
            self.report_error(start + span.start..start + span.end, message, None);
            return Ok(None);
        }
        let options = ParsingOptions { nodes_limit: MAX_NODES, ..ParsingOptions::default() };
        let document = match Document::parse_with_options(&text, options) {
            Ok(document) => document,
            Err(error) => {
                self.report_syntax_error(&text, start, &error);
                return Ok(None);
            }
        };
        self.token.check_pause_and_cancel()?;
        let root = document.root_element();
        let is_old = root.attribute("version").is_some_and(is_old_version);
        if root.tag_name().name() == "scene" && root.attribute("version").is_none() {
            let span = element_name_span(&text, &root, start);
            let help = "add the version that the scene was written for, such as version=\"3.0.0\"".to_owned();
            self.report_error(span, "the version is missing", Some(help));
        }
        self.open.push(path.to_owned());
        let source = FileSource { text: &text, start, is_old, path };
        let element = self.element_from_node(&root, &source, 0);
        self.open.pop();
        element
    }

    fn report_syntax_error(&mut self, text: &str, start: usize, error: &roxmltree::Error) {
        let help = match error {
            roxmltree::Error::DtdDetected => "remove the <!DOCTYPE …> declaration; entities are unsupported",
            roxmltree::Error::NodesLimitReached => "split the scene into smaller files",
            roxmltree::Error::UnclosedRootNode | roxmltree::Error::UnexpectedCloseTag(..) => {
                "every element needs a closing tag or `/>`"
            }
            _ => "the file must be well-formed XML",
        };
        let message = match error {
            roxmltree::Error::DtdDetected => "the file has a document type declaration".to_owned(),
            roxmltree::Error::UnexpectedEndOfStream => "the file ends inside a tag".to_owned(),
            // The position is shown with the source line.
            other => other.to_string().replacen(&format!(" at {}", other.pos()), "", 1),
        };
        let offset = match error {
            roxmltree::Error::UnclosedRootNode
            | roxmltree::Error::NoRootNode
            | roxmltree::Error::UnexpectedEndOfStream => text.trim_end().len(),
            roxmltree::Error::DtdDetected => text.find("<!DOCTYPE").unwrap_or_default(),
            other => byte_offset_at_position(text, other.pos()),
        };
        let next = text[offset..].chars().next().map_or(0, char::len_utf8);
        self.report_error(
            start + offset..start + offset + next,
            truncate_for_message(&message),
            Some(help.to_owned()),
        );
    }

    /// Converts a node and its children, and replaces includes with the included elements.
    fn element_from_node(
        &mut self,
        node: &Node<'_, '_>,
        source: &FileSource<'_>,
        depth: usize,
    ) -> Result<Option<Element>, AssetError> {
        self.token.check_pause_and_cancel()?;
        let span = element_name_span(source.text, node, source.start);
        if depth > MAX_DEPTH {
            let help = "flatten the scene".to_owned();
            self.report_error(
                span,
                format!("elements are nested more than {MAX_DEPTH} levels deep"),
                Some(help),
            );
            return Ok(None);
        }
        let mut attributes = Vec::new();
        for attribute in node.attributes() {
            let local = attribute.range_value();
            let span = source.start + local.start..source.start + local.end.max(local.start);
            if attribute.value().len() > MAX_ATTRIBUTE_BYTES {
                let message = format!("the attribute is longer than {} MiB", MAX_ATTRIBUTE_BYTES >> 20);
                self.report_error(
                    span.start..span.start,
                    message,
                    Some("store the data in a file".to_owned()),
                );
                return Ok(None);
            }
            let (name, value) = (attribute.name().to_owned(), attribute.value().to_owned());
            attributes.push(Attribute { name, value, span });
        }
        self.report_stray_text(node, source);
        let tag = node.tag_name().name().to_owned();
        let mut element = Element { tag, attributes, children: Vec::new(), span, is_old: source.is_old };
        for child in node.children().filter(Node::is_element) {
            match child.tag_name().name() {
                "default" => {
                    if let Some(default) = self.element_from_node(&child, source, depth + 1)? {
                        self.add_default(&default);
                    }
                }
                "path" => {
                    if let Some(path) = self.element_from_node(&child, source, depth + 1)? {
                        self.add_folder(&path, source.path);
                    }
                }
                "include" => {
                    if let Some(include) = self.element_from_node(&child, source, depth + 1)? {
                        self.include(include, source.path, &mut element.children)?;
                    }
                }
                _ => element.children.extend(self.element_from_node(&child, source, depth + 1)?),
            }
        }
        Ok(Some(element))
    }

    /// Reports the first text in an element. Mitsuba's elements contain only elements.
    fn report_stray_text(&mut self, node: &Node<'_, '_>, source: &FileSource<'_>) {
        let is_stray = |child: &Node<'_, '_>| child.text().is_some_and(|text| !text.trim().is_empty());
        let Some(stray) = node.children().find(|child| child.is_text() && is_stray(child)) else { return };
        let range = stray.range();
        let text = &source.text[range.clone()];
        let start = range.start + text.len() - text.trim_start().len();
        let line = text.trim().lines().next().unwrap_or_default();
        let length = line.char_indices().nth(40).map_or(line.len(), |(at, _)| at);
        let span = source.start + start..source.start + start + length;
        let help = "remove it, or make it a comment: <!-- … -->".to_owned();
        self.report_error(span, format!("unexpected text `{}`", truncate_for_message(line)), Some(help));
    }

    fn add_default(&mut self, default: &Element) {
        let (Some(name), Some(value)) = (default.value("name"), default.attribute("value")) else {
            let help = "write <default name=\"…\" value=\"…\"/>".to_owned();
            return self.report_error(default.span.clone(), "<default> needs `name` and `value`", Some(help));
        };
        if self.parameters.iter().any(|(known, _)| known == name) {
            return;
        }
        let name = name.to_owned();
        let value = substitute_parameters(&value.value, &self.parameters);
        if value.len() > MAX_SUBSTITUTED_BYTES || name.is_empty() {
            let message = if name.is_empty() { "the name is empty" } else { "the value is too long" };
            return self.report_error(default.span.clone(), message, None);
        }
        self.parameters.push((name, value));
    }

    fn add_folder(&mut self, path: &Element, file: &Path) {
        let Some(value) = path.attribute("value") else {
            return self.report_error(path.span.clone(), "<path> needs `value`", None);
        };
        let folder = substitute_parameters(&value.value, &self.parameters).replace('\\', "/");
        let span = value.span.clone();
        let near = file.parent().unwrap_or(Path::new("")).join(&folder);
        let others = self.folders.iter().rev().map(|known| known.join(&folder));
        let candidates: Vec<PathBuf> = std::iter::once(near).chain(others).collect();
        match candidates.iter().find(|folder| folder.is_dir()) {
            Some(folder) => self.folders.push(folder.clone()),
            None => {
                candidates.into_iter().for_each(|folder| self.reader.watch_missing(folder));
                self.report_error(span, format!("folder not found: {}", truncate_for_message(&folder)), None);
            }
        }
    }

    fn include(
        &mut self,
        mut include: Element,
        file: &Path,
        children: &mut Vec<Element>,
    ) -> Result<(), AssetError> {
        let Some(name) = include.attributes.iter_mut().find(|one| one.name == "filename") else {
            self.report_error(include.span, "<include> needs `filename`", None);
            return Ok(());
        };
        // Files written on Windows have backslashes.
        name.value = substitute_parameters(&name.value, &self.parameters).replace('\\', "/");
        let (span, name) = (name.span.clone(), name.value.clone());
        let near = file.parent().unwrap_or(Path::new("")).join(&name);
        let others = self.folders.iter().rev().map(|folder| folder.join(&name));
        let mut found = None;
        for candidate in std::iter::once(near).chain(others) {
            if candidate.is_file() {
                found = Some(candidate);
                break;
            }
            // The file may be created in any of the folders.
            self.reader.watch_missing(candidate);
        }
        let Some(found) = found else {
            let help = "files are searched next to this file, then in the folders of <path>".to_owned();
            self.report_error(
                span,
                format!("included file not found: {}", truncate_for_message(&name)),
                Some(help),
            );
            return Ok(());
        };
        let is_same = |open: &PathBuf| is_same_file(open, &found);
        if self.open.iter().any(is_same) {
            self.report_error(span, "the file includes itself", Some("remove this include".to_owned()));
            return Ok(());
        }
        if self.open.len() > MAX_INCLUDE_DEPTH {
            let message = format!("includes are nested more than {MAX_INCLUDE_DEPTH} levels deep");
            self.report_error(span, message, None);
            return Ok(());
        }
        let root = match self.load_file(&found) {
            Ok(root) => root,
            Err(error @ (AssetError::Unreadable { .. } | AssetError::Malformed { .. })) => {
                self.report_error(span, format!("cannot include this file: {error}"), None);
                return Ok(());
            }
            Err(error) => return Err(error),
        };
        match root {
            Some(root) if root.tag == "scene" => children.extend(root.children),
            Some(root) => children.push(root),
            None => {}
        }
        Ok(())
    }

    fn substitute_in_element(&mut self, element: &mut Element) {
        if self.token.is_canceled() {
            return;
        }
        for attribute in &mut element.attributes {
            if !attribute.value.contains('$') {
                continue;
            }
            attribute.value = substitute_parameters(&attribute.value, &self.parameters);
            self.substituted_bytes += attribute.value.len();
            let is_too_long = attribute.value.len() > MAX_SUBSTITUTED_BYTES;
            if is_too_long || self.substituted_bytes > MAX_ADDED_BYTES {
                attribute.value = String::new();
                if self.errors.len() >= MAX_ERRORS {
                    return;
                }
                self.errors.push(self.reader.files.diagnostic(
                    Severity::Error,
                    attribute.span.clone(),
                    "the value is too long",
                    "",
                    None,
                ));
            }
            if let Some(at) = attribute.value.find('$') {
                let rest = &attribute.value[at + 1..];
                let end = rest.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(rest.len());
                let name = truncate_for_message(&rest[..end]);
                let known = self.parameters.iter().map(|(name, _)| name.as_str());
                let help = match nearest_name(&name, known) {
                    Some(near) => format!("did you mean `${near}`?"),
                    None => {
                        format!("set it with -D {name}=VALUE, or add <default name=\"{name}\" value=\"…\"/>")
                    }
                };
                let (span, message) = (attribute.span.clone(), format!("undefined parameter `${name}`"));
                if self.errors.len() < MAX_ERRORS {
                    let files = &self.reader.files;
                    self.errors.push(files.diagnostic(Severity::Error, span, message, "", Some(help)));
                }
            }
        }
        for child in &mut element.children {
            self.substitute_in_element(child);
        }
    }
}

/// A file that is being converted.
struct FileSource<'a> {
    text: &'a str,
    /// Offset of the text among all source files.
    start: usize,
    is_old: bool,
    path: &'a Path,
}

/// Replaces each `$name` with the value of the parameter. The longest matching name is used.
fn substitute_parameters(text: &str, parameters: &[(String, String)]) -> String {
    if !text.contains('$') {
        return text.to_owned();
    }
    let mut sorted: Vec<_> = parameters.iter().collect();
    sorted.sort_by_key(|(name, _)| std::cmp::Reverse(name.len()));
    let mut result = String::new();
    let mut rest = text;
    while let Some(at) = rest.find('$') {
        result.push_str(&rest[..at]);
        rest = &rest[at + 1..];
        match sorted.iter().find(|(name, _)| rest.starts_with(name.as_str())) {
            Some((name, value)) => {
                result.push_str(value);
                rest = &rest[name.len()..];
            }
            None => result.push('$'),
        }
        if result.len() > MAX_SUBSTITUTED_BYTES {
            break;
        }
    }
    result.push_str(rest);
    result
}

/// Whether a version such as "0.6.0" is below 2.
fn is_old_version(version: &str) -> bool {
    version
        .trim()
        .split('.')
        .next()
        .and_then(|major| major.parse::<u32>().ok())
        .is_some_and(|major| major < 2)
}

/// Byte offset of a position. Rows and columns start at 1, and columns count characters.
fn byte_offset_at_position(text: &str, position: TextPos) -> usize {
    let mut start = 0;
    for _ in 1..position.row {
        match text[start..].find('\n') {
            Some(end) => start += end + 1,
            None => break,
        }
    }
    let line = &text[start..];
    let column = (position.col as usize).saturating_sub(1);
    let inside = line.char_indices().nth(column).map_or(line.len(), |(at, _)| at);
    start + inside
}

/// Whether two paths refer to the same file.
fn is_same_file(a: &Path, b: &Path) -> bool {
    match (a.canonicalize(), b.canonicalize()) {
        (Ok(a), Ok(b)) => a == b,
        (Ok(_) | Err(_), Err(_)) | (Err(_), Ok(_)) => a == b,
    }
}

/// Truncates text from the scene for messages, and removes control characters.
pub(super) fn truncate_for_message(text: &str) -> String {
    const MAX_CHARS: usize = 120;
    let mut shown: String = text.chars().filter(|c| !c.is_control()).take(MAX_CHARS).collect();
    if text.chars().nth(MAX_CHARS).is_some() {
        shown.push('…');
    }
    shown
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn longest_parameter_name_is_substituted() {
        let parameters = [("a", "1"), ("ab", "2"), ("c", "$a")].map(|(a, b)| (a.to_owned(), b.to_owned()));
        assert_eq!(substitute_parameters("$ab $a $abc $b", &parameters), "2 1 2c $b");
        assert_eq!(substitute_parameters("$c", &parameters), "$a");
    }

    #[test]
    fn versions_below_two_are_old() {
        assert_eq!(
            ["0.6.0", "1.0", "2.0.0", "3.9.1", ""].map(is_old_version),
            [true, true, false, false, false]
        );
    }

    #[test]
    fn positions_count_characters() {
        assert_eq!(byte_offset_at_position("ä<\nö<b", TextPos::new(2, 2)), "ä<\nö".len());
    }
}
