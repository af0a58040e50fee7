//! Types that define the keys and tables of scene files.

use super::limits::Limits;
use crate::choice::Choice;
use crate::toml::{self, Value};

/// Definition of a scene file table.
#[derive(Clone, Debug)]
pub struct TableInfo {
    /// Name of the table in scene files.
    pub name: &'static str,
    /// Syntax of the table in scene files.
    pub form: TableSyntax,
    /// Description: one sentence without a final period.
    pub doc: &'static str,
    /// The keys that all types have in common.
    pub keys: &'static [KeyInfo],
    /// The values of the key `type`, starting with the default. Empty if the table has no key `type`.
    pub types: &'static [TableTypeInfo],
    /// Returns the lists of tables inside each named table, such as `[[groups.NAME.sphere]]`.
    pub tables: fn() -> &'static [TableInfo],
}

/// Syntax of a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TableSyntax {
    /// `[name]`, at most once.
    Single,
    /// `[name.NAME]`, one per name.
    Named,
    /// `[[name]]`, a list.
    List,
}

/// Definition of a material or light type.
#[derive(Clone, Debug)]
pub struct TableTypeInfo {
    /// The value of `type`.
    pub name: &'static str,
    /// Description: one sentence without a final period.
    pub doc: &'static str,
    /// The keys specific to this type.
    pub keys: &'static [KeyInfo],
}

/// Definition of a key.
#[derive(Clone, Debug)]
pub struct KeyInfo {
    /// Name of the key.
    pub name: &'static str,
    /// Accepted values.
    pub kind: ValueKind,
    /// Unit of the value, or an empty string.
    pub unit: &'static str,
    /// The value used if the key is absent.
    pub default: DefaultValue,
    /// Returns the default in the form of a value in a file, or `None` if it is not a constant.
    pub(crate) default_value: fn() -> Option<Value<'static>>,
    /// Description: one sentence without a final period.
    pub doc: &'static str,
}

/// Type of a key's value.
#[derive(Clone, Copy, Debug)]
pub enum ValueKind {
    /// An integer between two inclusive bounds.
    Whole(u64, u64),
    /// A number.
    Number(Limits),
    /// `true` or `false`.
    Flag,
    /// One of these words.
    Words(ChoiceValuesFn),
    /// Any text.
    Text,
    /// The path of a file with one of these extensions. If the list is empty, any file is allowed.
    File(&'static [&'static str]),
    /// A color. The limits apply to each component.
    Color(Limits),
    /// An array of two colors. The limits apply to each component.
    ColorPair(Limits),
    /// A color or a texture.
    ColorOrTexture(Limits),
    /// A color, or a texture with a scale factor.
    Emission(Limits),
    /// A number or a texture.
    NumberOrTexture(Limits),
    /// An array of numbers. Contains the array's length and the name of its type, such as `point`.
    Numbers(usize, &'static str, Limits),
    /// A number or an array of three numbers.
    Scale(Limits),
    /// A rotation matrix of 9 or 16 numbers, row by row.
    Rotation,
    /// The name of a texture.
    Texture,
    /// The name of a height map, optionally with a channel.
    Heights,
    /// The name of a material.
    Material,
    /// The names of two materials.
    MaterialPair,
    /// The name of a group.
    Group,
    /// A table with these keys.
    InlineTable(&'static [KeyInfo]),
}

impl ValueKind {
    /// Returns the table in which the name is defined, or `None` if the value is not a name.
    pub fn defining_table(self) -> Option<&'static str> {
        match self {
            Self::Material | Self::MaterialPair => Some("materials"),
            Self::Texture | Self::Heights => Some("textures"),
            Self::Group => Some("groups"),
            Self::Whole(..)
            | Self::Number(_)
            | Self::Flag
            | Self::Words(_)
            | Self::Text
            | Self::File(_)
            | Self::Color(_)
            | Self::ColorPair(_)
            | Self::ColorOrTexture(_)
            | Self::Emission(_)
            | Self::NumberOrTexture(_)
            | Self::Numbers(..)
            | Self::Scale(_)
            | Self::Rotation
            | Self::InlineTable(_) => None,
        }
    }

    /// Returns the keys of an inline table, or an empty slice for other kinds.
    pub fn inner_keys(self) -> &'static [KeyInfo] {
        if let Self::InlineTable(keys) = self { keys } else { &[] }
    }

    /// Returns the range of the numbers in the value, or `None` if it is an integer or contains no numbers.
    pub fn limits(self) -> Option<Limits> {
        match self {
            Self::Number(limits)
            | Self::Color(limits)
            | Self::ColorPair(limits)
            | Self::ColorOrTexture(limits)
            | Self::Emission(limits)
            | Self::NumberOrTexture(limits)
            | Self::Numbers(_, _, limits)
            | Self::Scale(limits) => Some(limits),
            Self::Whole(..)
            | Self::Flag
            | Self::Words(_)
            | Self::Text
            | Self::File(_)
            | Self::Rotation
            | Self::Texture
            | Self::Heights
            | Self::Material
            | Self::MaterialPair
            | Self::Group
            | Self::InlineTable(_) => None,
        }
    }
}

/// A function that returns a choice's named values in display order.
pub type ChoiceValuesFn = fn() -> Vec<ChoiceValue>;

/// A named value of a choice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChoiceValue {
    /// The value's name.
    pub name: &'static str,
    /// Description of the value.
    pub meaning: &'static str,
}

/// Returns a choice's named values.
pub fn choice_values<C: Choice>() -> Vec<ChoiceValue> {
    C::ALL.iter().map(|one| ChoiceValue { name: one.name(), meaning: one.meaning() }).collect()
}

/// Default of a key.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DefaultValue {
    /// The key is required. Contains an example value.
    Required(&'static str),
    /// A constant, in scene file syntax.
    Is(&'static str),
    /// Description of a value that depends on other keys.
    By(&'static str),
    /// The key has no default, but is required unless other keys replace it. Contains an example value.
    Alternative(&'static str),
    /// The key has no default value.
    Absent,
}

impl DefaultValue {
    /// Parses a constant default.
    pub(crate) fn to_toml_value(self) -> Option<Value<'static>> {
        if let Self::Is(text) = self { toml::parse_leaked_constant(text) } else { None }
    }
}

/// Upper bound for integer keys without a specific limit.
pub(crate) const MAX_INTEGER: u64 = u32::MAX as u64;

/// Three coordinates.
pub(crate) const POINT: ValueKind = ValueKind::Numbers(3, "point", Limits::Any);

/// A vector of any nonzero length.
pub(crate) const DIRECTION: ValueKind = ValueKind::Numbers(3, "direction", Limits::Any);

/// Angles about the three axes.
pub(crate) const ANGLES: ValueKind = ValueKind::Numbers(3, "three numbers", Limits::Any);

/// Two non-negative colors.
pub(crate) const COLOR_PAIR: ValueKind = ValueKind::ColorPair(Limits::AtLeast(0.0));

/// A non-negative color.
pub(crate) const COLOR: ValueKind = ValueKind::Color(Limits::AtLeast(0.0));

/// Defines a function that parses a default on its first call. A default is read for every absent key, so
/// later calls must be fast.
macro_rules! parsed_default {
    ($default:expr) => {{
        fn parse_default_once() -> Option<$crate::toml::Value<'static>> {
            static PARSED: std::sync::OnceLock<Option<$crate::toml::Value<'static>>> =
                std::sync::OnceLock::new();
            *PARSED.get_or_init(|| $default.to_toml_value())
        }
        parse_default_once
    }};
}
pub(crate) use parsed_default;

/// Defines a list of keys, each as `/// DOC` and `NAME: KIND, DEFAULT, UNIT;`. The unit is optional.
macro_rules! keys {
    ($($(#[doc = $doc:literal])+ $name:ident: $kind:expr, $default:expr $(, $unit:literal)?;)*) => {
        &[
            $($crate::keys::key::KeyInfo {
                name: stringify!($name),
                kind: $kind,
                unit: concat!($($unit)?),
                default: $default,
                default_value: $crate::keys::key::parsed_default!($default),
                doc: $crate::keys::key::doc_without_final_period(concat!($($doc),+)),
            },)*
        ]
    };
}
pub(crate) use keys;

/// Defines the types of a table: an enum of the values of `type`, starting with the default, and a constant
/// with the keys of each type.
macro_rules! table_types {
    (
        $(#[doc = $about:literal])+
        enum $enum:ident, const $types:ident;
        $($(#[doc = $doc:literal])+ $variant:ident = $name:literal { $($keys:tt)* })+
    ) => {
        $crate::choice! {
            $(#[doc = $about])+
            enum $enum {
                $($(#[doc = $doc])+ $variant = $name,)+
            }
        }

        const $types: &[$crate::keys::key::TableTypeInfo] = &[
            $($crate::keys::key::TableTypeInfo {
                name: $name,
                doc: $crate::keys::key::doc_without_final_period(concat!($($doc),+)),
                keys: $crate::keys::key::keys! { $($keys)* },
            }),+
        ];
    };
}
pub(crate) use table_types;

/// Returns the text of a doc comment without its final period.
pub(crate) const fn doc_without_final_period(lines: &'static str) -> &'static str {
    match lines.trim_ascii().as_bytes() {
        [.., b'.'] => lines.trim_ascii().split_at(lines.trim_ascii().len() - 1).0,
        _ => lines.trim_ascii(),
    }
}

impl TableInfo {
    /// Defines a table without types.
    pub(crate) const fn new(
        name: &'static str,
        form: TableSyntax,
        doc: &'static str,
        keys: &'static [KeyInfo],
    ) -> Self {
        Self { name, form, doc, keys, types: &[], tables: || &[] }
    }

    /// Returns the type called `name`, or the default type if `name` is `None`. Returns `None` if the type is
    /// unknown.
    pub fn find_type_or_default(&self, name: Option<&str>) -> Option<&'static TableTypeInfo> {
        match name {
            Some(name) => self.types.iter().find(|one| one.name == name),
            None => self.types.first(),
        }
    }

    /// Returns all keys of a table with this type, except `type`. The type-specific keys come first.
    pub fn keys_for_type(
        &self,
        kind: Option<&'static TableTypeInfo>,
    ) -> impl Iterator<Item = &'static KeyInfo> {
        kind.map_or(&[] as &[KeyInfo], |kind| kind.keys).iter().chain(self.keys)
    }

    /// The table header, such as `[materials.NAME]`.
    pub fn header(&self) -> String {
        match self.form {
            TableSyntax::Single => format!("[{}]", self.name),
            TableSyntax::Named => format!("[{}.NAME]", self.name),
            TableSyntax::List => format!("[[{}]]", self.name),
        }
    }

    /// Returns the headers of the tables inside each named table, such as `[[groups.NAME.sphere]]`.
    pub fn inner_headers(&self) -> impl Iterator<Item = (String, &'static Self)> {
        let header = |inner: &'static Self| (format!("[[{}.NAME.{}]]", self.name, inner.name), inner);
        (self.tables)().iter().map(header)
    }

    /// Returns the table `name` inside each named table.
    pub fn find_inner_table(&self, name: &str) -> Option<&'static Self> {
        (self.tables)().iter().find(|inner| inner.name == name)
    }
}

impl KeyInfo {
    /// The default value, or an example.
    pub fn default_or_example(&self) -> String {
        match self.default {
            DefaultValue::Required(value) | DefaultValue::Is(value) | DefaultValue::Alternative(value) => {
                value.to_owned()
            }
            DefaultValue::By(_) | DefaultValue::Absent => self.kind.example(),
        }
    }

    /// Returns a line for a scene file that sets the key to its default or an example.
    pub fn example_line(&self) -> String {
        format!("{} = {}", self.name, self.default_or_example())
    }

    /// Returns the range, such as `0 … 1`, or an empty string if the type implies the range.
    pub fn range_text(&self) -> String {
        self.kind.range_text()
    }

    /// The name of the type, such as `color or texture`.
    pub fn kind_text(&self) -> String {
        self.kind.kind_text()
    }

    /// Returns the default in Markdown, as shown in the documentation.
    pub fn default_markdown(&self) -> String {
        match self.default {
            DefaultValue::Required(_) => "*required*".to_owned(),
            DefaultValue::Is(value) => format!("`{value}`"),
            DefaultValue::By(words) => words.to_owned(),
            DefaultValue::Alternative(_) | DefaultValue::Absent => "none".to_owned(),
        }
    }
}

impl ValueKind {
    /// An example value.
    fn example(self) -> String {
        match self {
            Self::Whole(least, _) => least.to_string(),
            Self::Number(_) => "0.25".to_owned(),
            Self::NumberOrTexture(_) | Self::Scale(_) => "0.5".to_owned(),
            Self::Flag => "true".to_owned(),
            Self::Words(list) => format!("\"{}\"", list().first().map_or("", |word| word.name)),
            Self::Text | Self::Texture | Self::Heights | Self::Material | Self::Group => {
                "\"name\"".to_owned()
            }
            Self::MaterialPair => "[\"name\", \"other\"]".to_owned(),
            Self::File(endings) => format!("\"file.{}\"", endings.first().copied().unwrap_or("txt")),
            Self::Color(_) | Self::ColorOrTexture(_) | Self::Emission(_) => "[0.5, 0.5, 0.5]".to_owned(),
            Self::ColorPair(_) => "[\"white\", \"black\"]".to_owned(),
            Self::Rotation => "[1, 0, 0, 0, 1, 0, 0, 0, 1]".to_owned(),
            // The identity matrix.
            Self::Numbers(16, ..) => {
                let number = |i: usize| if i.is_multiple_of(5) { "1" } else { "0" };
                format!("[{}]", (0..16).map(number).collect::<Vec<_>>().join(", "))
            }
            Self::Numbers(count, ..) => format!("[{}]", vec!["0"; count].join(", ")),
            Self::InlineTable(keys) => {
                let required = keys.iter().filter(|key| matches!(key.default, DefaultValue::Required(_)));
                format!("{{ {} }}", required.map(KeyInfo::example_line).collect::<Vec<_>>().join(", "))
            }
        }
    }

    fn kind_text(self) -> String {
        match self {
            Self::Whole(..) => "whole number".to_owned(),
            Self::Number(_) => "number".to_owned(),
            Self::Flag => "true or false".to_owned(),
            Self::Words(list) => {
                list().iter().map(|word| format!("`\"{}\"`", word.name)).collect::<Vec<_>>().join(", ")
            }
            Self::Text => "text".to_owned(),
            Self::File(_) => "file".to_owned(),
            Self::Color(_) => "color".to_owned(),
            Self::ColorPair(_) => "two colors".to_owned(),
            Self::ColorOrTexture(_) => "color or texture".to_owned(),
            Self::Emission(_) => "color or `{ texture = \"NAME\", scale = 1.0 }`".to_owned(),
            Self::NumberOrTexture(_) => "number or texture".to_owned(),
            Self::Numbers(_, words, _) => words.to_owned(),
            Self::Scale(_) => "number or three numbers".to_owned(),
            Self::Rotation => "9 or 16 numbers".to_owned(),
            Self::Texture => "name of a texture".to_owned(),
            Self::Heights => "name of a texture, or `{ texture = \"NAME\", channel = \"r\" }`".to_owned(),
            Self::Material => "name of a material".to_owned(),
            Self::MaterialPair => "names of two materials".to_owned(),
            Self::Group => "name of a group".to_owned(),
            Self::InlineTable(_) => "table".to_owned(),
        }
    }

    fn range_text(self) -> String {
        if let Self::Whole(least, most) = self {
            return if least == most { least.to_string() } else { format!("{least} … {most}") };
        }
        self.limits().map_or_else(String::new, Limits::range_text)
    }
}
