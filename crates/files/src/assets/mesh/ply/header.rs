//! PLY header: the file's elements and their properties.

use super::super::text::{expected_message, quote_word};
use super::super::{AssetError, MeshFileBytes};

/// Maximum size of a header. Typical headers have a few hundred bytes.
const HEADER_LIMIT: usize = 1 << 20;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    LittleEndian,
    BigEndian,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ScalarType {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl ScalarType {
    fn from_name(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    /// Size of a value in a binary file, in bytes.
    pub(super) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// Color value at full intensity.
    pub(super) fn full_intensity(self) -> f64 {
        match self {
            Self::I8 => f64::from(i8::MAX),
            Self::U8 => f64::from(u8::MAX),
            Self::I16 => f64::from(i16::MAX),
            Self::U16 => f64::from(u16::MAX),
            Self::I32 => f64::from(i32::MAX),
            Self::U32 => f64::from(u32::MAX),
            Self::F32 | Self::F64 => 1.0,
        }
    }

    pub(super) fn is_integer(self) -> bool {
        !matches!(self, Self::F32 | Self::F64)
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PropertyType {
    Scalar(ScalarType),
    List { count: ScalarType, item: ScalarType },
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Property {
    pub(super) name: String,
    pub(super) kind: PropertyType,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: u64,
    pub(super) properties: Vec<Property>,
}

impl Element {
    /// Minimum size of an item in bytes. In text, a number takes at least a digit and a space.
    pub(super) fn min_item_bytes(&self, encoding: Encoding) -> u64 {
        let least = |property: &Property| match (encoding, property.kind) {
            (Encoding::Ascii, _) => 2,
            (_, PropertyType::Scalar(scalar) | PropertyType::List { count: scalar, .. }) => {
                scalar.size() as u64
            }
        };
        self.properties.iter().map(least).sum()
    }
}

#[derive(Debug, PartialEq, Eq)]
pub(super) struct PlyHeader {
    pub(super) encoding: Encoding,
    pub(super) elements: Vec<Element>,
    /// Warning about skipped header lines.
    pub(super) warning: Option<String>,
    /// Warning about textures.
    pub(super) texture_warning: Option<String>,
    /// Byte offset of the first byte after the header.
    pub(super) body: usize,
}

/// Keywords in a PLY header.
const KEYWORDS: [&str; 6] = ["format", "element", "property", "comment", "obj_info", "end_header"];

/// Parses the header.
pub(super) fn parse(source: &MeshFileBytes<'_>) -> Result<PlyHeader, AssetError> {
    let bytes = &source.bytes[..source.bytes.len().min(HEADER_LIMIT)];
    let mut at = 0;
    let mut lines = bytes.split_inclusive(|&byte| byte == b'\n').map(|line| {
        let start = at;
        at += line.len();
        (start, at, line)
    });
    match lines.next() {
        Some((_, _, line)) if line.trim_ascii() == b"ply" => {}
        other => {
            let found = other.map_or(&[][..], |(_, _, line)| line.trim_ascii());
            return Err(source.malformed_error_with_line(0, expected_message("ply", found)));
        }
    }
    let mut encoding = None;
    let mut elements = Vec::new();
    // Number of skipped lines, and a description of the first one.
    let mut skipped = (0_u32, String::new());
    // Number of textures, and the line and name of the first one.
    let mut textures = (0_u32, 0, String::new());
    for (start, end, line) in lines {
        if end == HEADER_LIMIT && !line.ends_with(b"\n") {
            break; // The size limit falls within this line.
        }
        let line = String::from_utf8_lossy(line);
        let words: Vec<&str> = line.split_whitespace().collect();
        if words == ["end_header"] {
            let (count, first) = skipped;
            let warning = (count > 0).then(|| skipped_lines_warning(&first, count));
            let encoding = encoding.ok_or_else(|| {
                let hint = warning.iter().map(|warning| format!("; {warning}")).collect::<String>();
                source.malformed_error_with_line(start, format!("{NO_FORMAT}{hint}"))
            })?;
            let (count, first, name) = textures;
            let texture_warning = (count > 0).then(|| ignored_texture_warning(first, &name, count));
            return Ok(PlyHeader { encoding, elements, warning, texture_warning, body: end });
        }
        if let Some(name) = texture_name(&line) {
            if textures.0 == 0 {
                (textures.1, textures.2) = (source.line_number(start), name.to_owned());
            }
            textures.0 += 1;
        }
        // Do not skip unknown keywords after the first element, because they may be misspelled properties.
        if elements.is_empty() && words.first().is_some_and(|first| !KEYWORDS.contains(first)) {
            if skipped.0 == 0 {
                skipped.1 =
                    format!("line {}: {}", source.line_number(start), unknown_keyword_message(words[0]));
            }
            skipped.0 += 1;
            continue;
        }
        parse_statement(&words, &mut encoding, &mut elements)
            .map_err(|reason| source.malformed_error_with_line(start, reason))?;
    }
    Err(source.malformed_error_without_line(if bytes.len() == source.bytes.len() {
        NO_END.to_owned()
    } else {
        header_too_long_message()
    }))
}

pub(super) const NO_FORMAT: &str = "the header has no format line";
pub(super) const NO_END: &str = "the header has no end_header";
pub(super) const PROPERTY_FIRST: &str = "a property before the first element";

/// Warning about `count` skipped lines. `first` describes the first one.
pub(super) fn skipped_lines_warning(first: &str, count: u32) -> String {
    match count {
        1 => format!("{first}; line skipped"),
        _ => format!("{first}; skipped this line and {} more", count - 1),
    }
}

/// Returns the image name from a comment such as `TextureFile wall.png`, which MeshLab writes.
fn texture_name(line: &str) -> Option<&str> {
    let comment = line.trim().strip_prefix("comment")?.trim_start();
    let (keyword, name) = comment.split_once(char::is_whitespace)?;
    keyword.eq_ignore_ascii_case("TextureFile").then(|| name.trim_start())
}

/// Warning about `count` ignored textures. The first one is `name`, on line `first`.
pub(super) fn ignored_texture_warning(first: usize, name: &str, count: u32) -> String {
    let more = if count > 1 { format!(" (and {} more)", count - 1) } else { String::new() };
    let name = quote_word(name.as_bytes());
    format!("line {first}: the texture {name}{more} is ignored; set a `material` with a texture in a scene")
}

pub(super) fn header_too_long_message() -> String {
    format!("{NO_END} in its first {} MiB, the maximum header size", HEADER_LIMIT >> 20)
}

pub(super) fn unknown_keyword_message(found: &str) -> String {
    format!("{} is not a PLY header keyword", quote_word(found.as_bytes()))
}

pub(super) fn invalid_statement_message(keyword: &str) -> String {
    format!("incomplete or unknown statement {}", quote_word(keyword.as_bytes()))
}

pub(super) fn invalid_count_message(found: &str, element: &str) -> String {
    format!("{} is not a valid count for element `{element}`", quote_word(found.as_bytes()))
}

pub(super) fn unknown_type_message(found: &str) -> String {
    format!("{} is not a PLY type", quote_word(found.as_bytes()))
}

pub(super) fn unknown_encoding_message(found: &str) -> String {
    let found = quote_word(found.as_bytes());
    format!("the format must be ascii, binary_little_endian or binary_big_endian, not {found}")
}

fn parse_statement(
    words: &[&str],
    encoding: &mut Option<Encoding>,
    elements: &mut Vec<Element>,
) -> Result<(), String> {
    match *words {
        [] | ["comment" | "obj_info", ..] => {}
        ["format", name, ..] => *encoding = Some(parse_encoding(name)?),
        ["element", name, count] => {
            let count = count.parse().map_err(|_| invalid_count_message(count, name))?;
            elements.push(Element { name: name.to_owned(), count, properties: Vec::new() });
        }
        ["property", ref words @ ..] => {
            let element = elements.last_mut().ok_or(PROPERTY_FIRST)?;
            let property = parse_property(words)?;
            if element.properties.iter().any(|known| known.name == property.name) {
                let (name, element) =
                    (quote_word(property.name.as_bytes()), quote_word(element.name.as_bytes()));
                return Err(format!("duplicate property {name} in element {element}"));
            }
            element.properties.push(property);
        }
        [first, ..] => return Err(invalid_statement_message(first)),
    }
    Ok(())
}

fn parse_encoding(name: &str) -> Result<Encoding, String> {
    match name {
        "ascii" => Ok(Encoding::Ascii),
        "binary_little_endian" => Ok(Encoding::LittleEndian),
        "binary_big_endian" => Ok(Encoding::BigEndian),
        _ => Err(unknown_encoding_message(name)),
    }
}

fn parse_property(words: &[&str]) -> Result<Property, String> {
    let scalar = |name: &str| ScalarType::from_name(name).ok_or_else(|| unknown_type_message(name));
    let (kind, name) = match *words {
        ["list", count, item, name] => {
            let count = scalar(count)?;
            if !count.is_integer() {
                return Err("the length of a list must have an integer type".to_owned());
            }
            (PropertyType::List { count, item: scalar(item)? }, name)
        }
        [kind, name] => (PropertyType::Scalar(scalar(kind)?), name),
        _ => return Err("expected `property type name` or `property list type type name`".to_owned()),
    };
    Ok(Property { name: name.to_owned(), kind })
}
