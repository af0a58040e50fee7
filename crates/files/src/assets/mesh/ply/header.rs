//! The header of a PLY file: its elements and their layout.

use super::super::text::shown;
use super::super::{AssetError, Source};

/// Most bytes of a header; real ones have a few hundred.
const HEADER_LIMIT: usize = 1 << 20;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    LittleEndian,
    BigEndian,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    fn named(name: &str) -> Option<Self> {
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

    /// Bytes in a binary file.
    pub(super) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// The number that stands for 1 in a colour.
    pub(super) fn greatest(self) -> f64 {
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

    pub(super) fn is_whole(self) -> bool {
        !matches!(self, Self::F32 | Self::F64)
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    One(Scalar),
    List { count: Scalar, item: Scalar },
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Property {
    pub(super) name: String,
    pub(super) kind: Kind,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: u64,
    pub(super) properties: Vec<Property>,
}

impl Element {
    /// Fewest bytes of one such element; in text, a digit and a blank for each number.
    pub(super) fn least_bytes(&self, encoding: Encoding) -> u64 {
        let least = |property: &Property| match (encoding, property.kind) {
            (Encoding::Ascii, _) => 2,
            (_, Kind::One(scalar) | Kind::List { count: scalar, .. }) => scalar.size() as u64,
        };
        self.properties.iter().map(least).sum()
    }
}

#[derive(Debug, PartialEq, Eq)]
pub(super) struct Header {
    pub(super) encoding: Encoding,
    pub(super) elements: Vec<Element>,
    /// The warning of lines that were skipped.
    pub(super) warning: Option<String>,
    /// First byte behind the header.
    pub(super) body: usize,
}

/// Words that begin the statements of a header.
const STATEMENTS: [&str; 6] = ["format", "element", "property", "comment", "obj_info", "end_header"];

/// Reads the header.
pub(super) fn parse(source: &Source<'_>) -> Result<Header, AssetError> {
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
            return Err(source.wrong_at(0, format!("expected ply, found {}", shown(found))));
        }
    }
    let mut encoding = None;
    let mut elements = Vec::new();
    // Lines that the reader skips: their number, and the first with its word.
    let mut skipped = (0_u32, String::new());
    for (start, end, line) in lines {
        if end == HEADER_LIMIT && !line.ends_with(b"\n") {
            break; // cut within the line
        }
        let line = String::from_utf8_lossy(line);
        let words: Vec<&str> = line.split_whitespace().collect();
        if words == ["end_header"] {
            let (count, first) = skipped;
            let warning = match count {
                0 => None,
                1 => Some(format!("{first} is no statement of a PLY header: the line is skipped")),
                _ => Some(format!(
                    "{first} is no statement of a PLY header: the line and {} more are skipped",
                    count - 1
                )),
            };
            let encoding = encoding.ok_or_else(|| {
                let hint = warning.iter().map(|warning| format!("; {warning}")).collect::<String>();
                source.wrong_at(start, format!("the header has no format line{hint}"))
            })?;
            return Ok(Header { encoding, elements, warning, body: end });
        }
        // Behind the first element, an unknown word may be a misspelt one of what the file holds.
        if elements.is_empty() && words.first().is_some_and(|first| !STATEMENTS.contains(first)) {
            if skipped.0 == 0 {
                skipped.1 = format!("line {}: {}", source.line(start), shown(words[0].as_bytes()));
            }
            skipped.0 += 1;
            continue;
        }
        statement(&words, &mut encoding, &mut elements).map_err(|reason| source.wrong_at(start, reason))?;
    }
    let reason = "the header has no end_header";
    Err(source.wrong(if bytes.len() == source.bytes.len() {
        reason.to_owned()
    } else {
        let limit = HEADER_LIMIT >> 20;
        format!("{reason} in its first {limit} MiB, and no more than that is read of a header")
    }))
}

fn statement(
    words: &[&str],
    encoding: &mut Option<Encoding>,
    elements: &mut Vec<Element>,
) -> Result<(), String> {
    match *words {
        [] | ["comment" | "obj_info", ..] => {}
        ["format", name, ..] => *encoding = Some(named_encoding(name)?),
        ["element", name, count] => {
            let count =
                count.parse().map_err(|_| format!("{} is no number of {name}", shown(count.as_bytes())))?;
            elements.push(Element { name: name.to_owned(), count, properties: Vec::new() });
        }
        ["property", ref words @ ..] => {
            let element = elements.last_mut().ok_or("a property before the first element")?;
            let property = property(words)?;
            if element.properties.iter().any(|known| known.name == property.name) {
                let (name, of) = (shown(property.name.as_bytes()), shown(element.name.as_bytes()));
                return Err(format!("the property {name} of {of} is there twice"));
            }
            element.properties.push(property);
        }
        [first, ..] => return Err(format!("{} is no statement of a PLY header", shown(first.as_bytes()))),
    }
    Ok(())
}

fn named_encoding(name: &str) -> Result<Encoding, String> {
    match name {
        "ascii" => Ok(Encoding::Ascii),
        "binary_little_endian" => Ok(Encoding::LittleEndian),
        "binary_big_endian" => Ok(Encoding::BigEndian),
        _ => Err(format!(
            "the format is ascii, binary_little_endian or binary_big_endian, not {}",
            shown(name.as_bytes())
        )),
    }
}

fn property(words: &[&str]) -> Result<Property, String> {
    let scalar = |name: &str| {
        Scalar::named(name).ok_or_else(|| format!("{} is no type of PLY", shown(name.as_bytes())))
    };
    let (kind, name) = match *words {
        ["list", count, item, name] => {
            let count = scalar(count)?;
            if !count.is_whole() {
                return Err("the length of a list is a whole number".to_owned());
            }
            (Kind::List { count, item: scalar(item)? }, name)
        }
        [kind, name] => (Kind::One(scalar(kind)?), name),
        _ => return Err("expected `property type name` or `property list type type name`".to_owned()),
    };
    Ok(Property { name: name.to_owned(), kind })
}
