//! The definition of a key and of a table.

use super::limits::Limits;
use crate::choice::Choice;

/// A table of a scene file.
#[derive(Clone, Debug)]
pub struct TableInfo {
    /// Its name in the file.
    pub name: &'static str,
    /// Its form in the file.
    pub form: Form,
    /// Description, one sentence without its full stop.
    pub doc: &'static str,
    /// The keys that each such table has, whatever its type.
    pub keys: &'static [KeyInfo],
    /// The types that the key `type` chooses from, the default first; none if there is no such key.
    pub types: &'static [TypeInfo],
}

/// Forms of tables.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// `[name]`, at most once.
    Single,
    /// `[name.NAME]`, each with a name of its own.
    Named,
    /// `[[name]]`, a list.
    List,
}

/// A type of material or light.
#[derive(Clone, Debug)]
pub struct TypeInfo {
    /// The value of `type`.
    pub name: &'static str,
    /// Description, one sentence without its full stop.
    pub doc: &'static str,
    /// The keys that only this type has.
    pub keys: &'static [KeyInfo],
}

/// A key of a table.
#[derive(Clone, Debug)]
pub struct KeyInfo {
    /// The key.
    pub name: &'static str,
    /// Accepted values.
    pub kind: Kind,
    /// The unit; empty for none.
    pub unit: &'static str,
    /// The value without the key.
    pub default: Default,
    /// Description, one sentence without its full stop.
    pub doc: &'static str,
}

/// Kinds of values.
#[derive(Clone, Copy, Debug)]
pub enum Kind {
    /// A whole number from the first to the second.
    Whole(u64, u64),
    /// A number.
    Number(Limits),
    /// `true` or `false`.
    Flag,
    /// One of these words.
    Words(WordList),
    /// Any text.
    Text,
    /// The path of a file with one of these endings; with none given, of any file.
    File(&'static [&'static str]),
    /// A colour; the limits hold for each component.
    Color(Limits),
    /// A colour or a texture.
    ColorOrTexture(Limits),
    /// A colour, or a texture with a scale.
    Emission(Limits),
    /// A number or a texture.
    NumberOrTexture(Limits),
    /// An array of so many numbers, with the name of the whole.
    Numbers(usize, &'static str, Limits),
    /// A number or three.
    Scale(Limits),
    /// The name of a texture.
    Texture,
    /// The name of a texture of numbers, or that with a channel.
    Heights,
    /// The name of a material.
    Material,
}

impl Kind {
    /// The table that gives the value its name. `None` if the value is no name.
    pub fn named_in(self) -> Option<&'static str> {
        match self {
            Self::Material => Some("materials"),
            Self::Texture | Self::Heights => Some("textures"),
            Self::Whole(..)
            | Self::Number(_)
            | Self::Flag
            | Self::Words(_)
            | Self::Text
            | Self::File(_)
            | Self::Color(_)
            | Self::ColorOrTexture(_)
            | Self::Emission(_)
            | Self::NumberOrTexture(_)
            | Self::Numbers(..)
            | Self::Scale(_) => None,
        }
    }
}

/// The words of a choice, in the order in which they are offered.
pub type WordList = fn() -> Vec<Word>;

/// A word of a choice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Word {
    /// The word.
    pub name: &'static str,
    /// Its meaning.
    pub meaning: &'static str,
}

/// The words of a choice.
pub fn words<C: Choice>() -> Vec<Word> {
    C::ALL.iter().map(|one| Word { name: one.name(), meaning: one.meaning() }).collect()
}

/// Values of keys that are not given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Default {
    /// The key must be given, for example with this value.
    Required(&'static str),
    /// This value, as a scene file has it.
    Is(&'static str),
    /// A value that depends on others, in words.
    By(&'static str),
    /// None.
    Absent,
}

/// The greatest whole number of keys that count without a limit of their own.
pub(super) const MOST_WHOLE: u64 = u32::MAX as u64;

/// A key: name, values, unit, default, description.
pub(super) const fn key(
    name: &'static str,
    kind: Kind,
    unit: &'static str,
    default: Default,
    doc: &'static str,
) -> KeyInfo {
    KeyInfo { name, kind, unit, default, doc }
}

impl TableInfo {
    /// The type of this name; of no name, the default. `None` if the table has no such type.
    pub fn type_of(&self, name: Option<&str>) -> Option<&'static TypeInfo> {
        match name {
            Some(name) => self.types.iter().find(|one| one.name == name),
            None => self.types.first(),
        }
    }

    /// All keys of the table with this type, but for `type`: first those of the type.
    pub fn keys_of(&self, kind: Option<&'static TypeInfo>) -> impl Iterator<Item = &'static KeyInfo> {
        kind.map_or(&[] as &[KeyInfo], |kind| kind.keys).iter().chain(self.keys)
    }

    /// The head of the table in a file, as in `[materials.NAME]`.
    pub fn head(&self) -> String {
        match self.form {
            Form::Single => format!("[{}]", self.name),
            Form::Named => format!("[{}.NAME]", self.name),
            Form::List => format!("[[{}]]", self.name),
        }
    }
}

impl KeyInfo {
    /// The value to write for the key: the default, or an example.
    pub fn example(&self) -> String {
        match (self.default, self.kind) {
            (Default::Required(value) | Default::Is(value), _) => value.to_owned(),
            (Default::By(_) | Default::Absent, kind) => kind.example(),
        }
    }

    /// The range in words, as in `0 … 1`; empty if the kind says it all.
    pub fn range(&self) -> String {
        self.kind.range()
    }

    /// The kind in words, as in `colour or texture`.
    pub fn kind(&self) -> String {
        self.kind.words()
    }

    /// The default in words and code, as a page has it.
    pub fn default_words(&self) -> String {
        match self.default {
            Default::Required(_) => "*required*".to_owned(),
            Default::Is(value) => format!("`{value}`"),
            Default::By(words) => words.to_owned(),
            Default::Absent => "none".to_owned(),
        }
    }
}

impl Kind {
    /// A value of the kind.
    fn example(self) -> String {
        match self {
            Self::Whole(least, _) => least.to_string(),
            Self::Number(_) => "0.25".to_owned(),
            Self::NumberOrTexture(_) | Self::Scale(_) => "0.5".to_owned(),
            Self::Flag => "true".to_owned(),
            Self::Words(list) => format!("\"{}\"", list().first().map_or("", |word| word.name)),
            Self::Text | Self::Texture | Self::Heights | Self::Material => "\"name\"".to_owned(),
            Self::File(endings) => format!("\"file.{}\"", endings.first().copied().unwrap_or("txt")),
            Self::Color(_) | Self::ColorOrTexture(_) | Self::Emission(_) => "[0.5, 0.5, 0.5]".to_owned(),
            // A matrix has rows of four; that of no change has ones from corner to corner.
            Self::Numbers(16, ..) => {
                let number = |i: usize| if i.is_multiple_of(5) { "1" } else { "0" };
                format!("[{}]", (0..16).map(number).collect::<Vec<_>>().join(", "))
            }
            Self::Numbers(count, ..) => format!("[{}]", vec!["0"; count].join(", ")),
        }
    }

    fn words(self) -> String {
        match self {
            Self::Whole(..) => "whole number".to_owned(),
            Self::Number(_) => "number".to_owned(),
            Self::Flag => "true or false".to_owned(),
            Self::Words(list) => {
                list().iter().map(|word| format!("`\"{}\"`", word.name)).collect::<Vec<_>>().join(", ")
            }
            Self::Text => "text".to_owned(),
            Self::File(_) => "file".to_owned(),
            Self::Color(_) => "colour".to_owned(),
            Self::ColorOrTexture(_) => "colour or texture".to_owned(),
            Self::Emission(_) => "colour or `{ texture = \"NAME\", scale = 1.0 }`".to_owned(),
            Self::NumberOrTexture(_) => "number or texture".to_owned(),
            Self::Numbers(_, words, _) => words.to_owned(),
            Self::Scale(_) => "number or three numbers".to_owned(),
            Self::Texture => "name of a texture".to_owned(),
            Self::Heights => "name of a texture, or `{ texture = \"NAME\", channel = \"r\" }`".to_owned(),
            Self::Material => "name of a material".to_owned(),
        }
    }

    fn range(self) -> String {
        match self {
            Self::Whole(least, most) if least == most => least.to_string(),
            Self::Whole(least, most) => format!("{least} … {most}"),
            Self::Number(limits)
            | Self::Color(limits)
            | Self::ColorOrTexture(limits)
            | Self::Emission(limits)
            | Self::NumberOrTexture(limits)
            | Self::Numbers(_, _, limits)
            | Self::Scale(limits) => limits.range(),
            Self::Flag
            | Self::Words(_)
            | Self::Text
            | Self::File(_)
            | Self::Texture
            | Self::Heights
            | Self::Material => String::new(),
        }
    }
}
