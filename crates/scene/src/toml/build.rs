//! Documents built in memory by the importers of foreign formats.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

use super::tree::{Document, Name, NodeKind, Span, TableId, TableOrigin, ValueNode};
use super::write::{Comment, format_document};
use crate::math::DVec3;
use crate::source_files::{SourceFile, SourceFiles};

/// A scene document built in memory: the tables and keys of a scene file, and comments.
///
/// Tables have the same order as in the scene file that [`Self::to_toml`] returns. The keys of a table follow
/// the call that starts it.
#[derive(Clone, Debug)]
pub struct SceneDocumentBuilder {
    pub(crate) document: Document<'static>,
    /// The text of the foreign file, into which all spans index.
    pub(crate) source: Arc<str>,
    /// The files of which the source consists. Empty if it is a single file.
    pub(crate) files: Arc<[SourceFile]>,
    /// Meshes and images that exist only in memory, by the value of the key `file`.
    pub(crate) generated: Arc<BTreeMap<String, InMemoryFile>>,
    comments: Vec<Comment>,
    /// The current table.
    table: TableId,
    /// The span of the values added next.
    span: Span,
}

/// A mesh or an image that an importer has generated. The extension of its name determines its format.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InMemoryFile {
    /// The content of the file.
    pub bytes: Arc<[u8]>,
    /// BLAKE3 hash of the bytes.
    pub hash: [u8; 32],
}

/// A value in a [`SceneDocumentBuilder`].
#[derive(Clone, Debug, PartialEq)]
pub enum SceneDocumentValue {
    /// A number.
    Number(f64),
    /// A string.
    Text(Cow<'static, str>),
    /// `true` or `false`.
    Flag(bool),
    /// `[…]`
    Array(Vec<Self>),
    /// `{ … }`
    Table(Vec<(&'static str, Self)>),
}

impl From<f64> for SceneDocumentValue {
    fn from(number: f64) -> Self {
        Self::Number(number)
    }
}

impl From<bool> for SceneDocumentValue {
    fn from(flag: bool) -> Self {
        Self::Flag(flag)
    }
}

impl From<&'static str> for SceneDocumentValue {
    fn from(text: &'static str) -> Self {
        Self::Text(text.into())
    }
}

impl From<String> for SceneDocumentValue {
    fn from(text: String) -> Self {
        Self::Text(text.into())
    }
}

impl From<Vec<f64>> for SceneDocumentValue {
    fn from(numbers: Vec<f64>) -> Self {
        Self::Array(numbers.into_iter().map(Self::Number).collect())
    }
}

impl<const N: usize> From<[f64; N]> for SceneDocumentValue {
    fn from(numbers: [f64; N]) -> Self {
        numbers.to_vec().into()
    }
}

impl From<DVec3> for SceneDocumentValue {
    fn from(vector: DVec3) -> Self {
        vector.to_array().into()
    }
}

impl Default for SceneDocumentBuilder {
    fn default() -> Self {
        Self::new("".into())
    }
}

impl SceneDocumentBuilder {
    /// Creates an empty document. `source` is the text of the foreign file, or empty if the file is not text.
    pub fn new(source: Arc<str>) -> Self {
        let (comments, span) = Default::default();
        Self {
            document: Document::new(""),
            source,
            files: Arc::new([]),
            generated: Arc::default(),
            comments,
            table: Document::ROOT,
            span,
        }
    }

    /// Creates an empty document for a foreign scene that consists of several text files.
    pub fn empty_for_source_files(files: SourceFiles) -> Self {
        let (source, files) = files.into_parts();
        Self { files, ..Self::new(source) }
    }

    /// Adds a file that exists only in memory. The key `file` refers to it by `name`.
    pub fn add_in_memory_file(&mut self, name: String, file: InMemoryFile) {
        Arc::make_mut(&mut self.generated).insert(name, file);
    }

    /// The files that exist only in memory, by name.
    pub fn added_in_memory_files(&self) -> &Arc<BTreeMap<String, InMemoryFile>> {
        &self.generated
    }

    /// Sets the files of a foreign scene that consists of several text files. All spans, including those of
    /// values added before, index into their concatenated texts.
    pub fn set_source_files(&mut self, files: SourceFiles) {
        (self.source, self.files) = files.into_parts();
    }

    /// Sets the span in the foreign text of all tables and values added from now on. Errors underline it.
    pub fn set_span_for_next_values(&mut self, span: Range<usize>) {
        self.span = Span::new(span.start, span.end);
    }

    /// Adds a comment above the next table.
    pub fn add_comment_above_next_table(&mut self, text: impl Into<String>) {
        let table = self.document.next_table_id();
        self.comments.push(Comment { table, is_below_header: false, text: text.into() });
    }

    /// Adds a comment below the header of the current table.
    pub fn add_comment_below_header(&mut self, text: impl Into<String>) {
        self.comments.push(Comment { table: self.table, is_below_header: true, text: text.into() });
    }

    /// Starts or continues the table `[name]`.
    pub fn start_table(&mut self, name: &'static str) {
        self.table = self.find_or_add_table(Document::ROOT, name.into(), false);
    }

    /// Starts or continues the table `[group.name]`.
    pub fn start_named_table(&mut self, group: &'static str, name: &str) {
        let group = self.find_or_add_table(Document::ROOT, group.into(), true);
        self.table = self.find_or_add_table(group, name.to_owned().into(), false);
    }

    /// Starts a table `[[list]]`.
    pub fn start_list_table(&mut self, list: &'static str) {
        self.start_list_table_in(Document::ROOT, list);
    }

    fn start_list_table_in(&mut self, parent: TableId, list: &'static str) {
        let found = self.document.find_in_table(parent, list).map(|found| found.kind);
        let kind = found.unwrap_or_else(|| {
            let kind = self.document.add_table_list();
            self.add_entry(parent, list.into(), kind);
            kind
        });
        self.table = self.document.add_table(TableOrigin::default());
        if let NodeKind::List(list) = kind {
            let node = ValueNode { span: self.span, kind: NodeKind::Table(self.table) };
            self.document.table_list_mut(list).push(node);
        }
    }

    /// Starts a table `[[groups.group.list]]`.
    pub fn start_group_list_table(&mut self, group: &str, list: &'static str) {
        self.start_named_table("groups", group);
        let parent = self.table;
        self.start_list_table_in(parent, list);
    }

    /// Adds a key, which must be new, to the current table.
    pub fn set(&mut self, key: &'static str, value: impl Into<SceneDocumentValue>) {
        let kind = self.add_value_node(value.into());
        self.add_entry(self.table, key.into(), kind);
    }

    /// Formats the document as a scene file.
    pub fn to_toml(&self) -> String {
        format_document(&self.document, &self.comments)
    }

    fn find_or_add_table(&mut self, parent: TableId, name: Cow<'static, str>, is_implicit: bool) -> TableId {
        let found = self.document.find_in_table(parent, &name).and_then(|found| found.kind.as_table_id());
        found.unwrap_or_else(|| {
            let table = self.document.add_table(TableOrigin { is_implicit, ..TableOrigin::default() });
            self.add_entry(parent, name, NodeKind::Table(table));
            table
        })
    }

    fn add_entry(&mut self, table: TableId, key: Cow<'static, str>, kind: NodeKind) {
        let name = Name { span: self.span, text: key };
        self.document.add_entry(table, name, ValueNode { span: self.span, kind });
    }

    fn add_value_node(&mut self, value: SceneDocumentValue) -> NodeKind {
        match value {
            // Files contain 0 instead of -0.
            SceneDocumentValue::Number(number) => self.document.add_number(number + 0.0),
            SceneDocumentValue::Text(text) => {
                NodeKind::String(self.document.store_decoded_string(Span::default(), text))
            }
            SceneDocumentValue::Flag(flag) => NodeKind::Boolean(flag),
            SceneDocumentValue::Array(values) => {
                let span = self.span;
                let node = |value| ValueNode { span, kind: self.add_value_node(value) };
                let elements: Vec<ValueNode> = values.into_iter().map(node).collect();
                self.document.add_array(&elements)
            }
            SceneDocumentValue::Table(entries) => {
                let table =
                    self.document.add_table(TableOrigin { is_inline: true, ..TableOrigin::default() });
                for (key, value) in entries {
                    let kind = self.add_value_node(value);
                    self.add_entry(table, key.into(), kind);
                }
                NodeKind::Table(table)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn built_document_is_written_in_order() {
        let mut built = SceneDocumentBuilder::default();
        built.add_comment_above_next_table("cube.glb");
        built.add_comment_above_next_table("Approximated.");
        built.start_table("render");
        built.set("samples", 256.0);
        built.add_comment_above_next_table("All lights.");
        built.start_list_table("light");
        built.add_comment_below_header("sun");
        built.set("type", "directional");
        built.set("direction", DVec3::new(0.0, -1.0, -0.0));
        for (texture, material) in [("a", "wall"), ("b", "old floor")] {
            built.start_named_table("textures", texture);
            built.set("file", format!("{texture}.png"));
            built.start_named_table("materials", material);
            built.set(
                "emission",
                SceneDocumentValue::Table(vec![("texture", texture.into()), ("scale", 0.5.into())]),
            );
        }
        built.start_list_table("mesh");
        built.set("smooth", false);
        built.set(
            "matrix",
            [1.0, 0.0, 0.0, 1e-7, 0.0, 1.0, 0.0, 2e15, 0.0, 0.0, 1.0, -3.25, 0.0, 0.0, 0.0, 1.0],
        );
        built.start_list_table("light");
        built.start_table("render");
        built.set("width", 64.0);
        let expected = "# cube.glb
# Approximated.

[render]
samples = 256
width = 64

# All lights.

[[light]]
# sun
type = \"directional\"
direction = [0, -1, 0]

[textures.a]
file = \"a.png\"

[materials.wall]
emission = { texture = \"a\", scale = 0.5 }

[textures.b]
file = \"b.png\"

[materials.\"old floor\"]
emission = { texture = \"b\", scale = 0.5 }

[[mesh]]
smooth = false
matrix = [1, 0, 0, 1e-7,  0, 1, 0, 2e15,  0, 0, 1, -3.25,  0, 0, 0, 1]

[[light]]
";
        assert_eq!(built.to_toml(), expected);
        let (parsed, errors) = super::super::parse(expected);
        assert_eq!(
            (format_document(&parsed, &[]).lines().count(), errors),
            (expected.lines().count() - 6, vec![])
        );
    }
}
