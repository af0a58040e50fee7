//! Parses lines of an MTL file. Keywords are case-insensitive.

use super::map::{Map, MapKind};

/// A color statement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum MtlColor {
    Ambient,
    Diffuse,
    Specular,
    Emission,
    /// Transmission filter.
    Filter,
}

impl MtlColor {
    /// All colors and their keywords, in enum order.
    pub(super) const ALL: [(Self, &'static str); 5] = [
        (Self::Ambient, "Ka"),
        (Self::Diffuse, "Kd"),
        (Self::Specular, "Ks"),
        (Self::Emission, "Ke"),
        (Self::Filter, "Tf"),
    ];
}

/// A statement with a single number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum MtlNumber {
    Shininess,
    Ior,
    Dissolve,
    Transparency,
    Roughness,
    Metallic,
    Coat,
    CoatRoughness,
    Sheen,
    Anisotropy,
    AnisotropyRotation,
}

impl MtlNumber {
    /// All numbers and their keywords, in enum order.
    pub(super) const ALL: [(Self, &'static str); 11] = [
        (Self::Shininess, "Ns"),
        (Self::Ior, "Ni"),
        (Self::Dissolve, "d"),
        (Self::Transparency, "Tr"),
        (Self::Roughness, "Pr"),
        (Self::Metallic, "Pm"),
        (Self::Coat, "Pc"),
        (Self::CoatRoughness, "Pcr"),
        (Self::Sheen, "Ps"),
        (Self::Anisotropy, "aniso"),
        (Self::AnisotropyRotation, "anisor"),
    ];

    /// Keyword of the statement.
    pub(super) fn keyword(self) -> &'static str {
        Self::ALL[self as usize].1
    }
}

/// A parsed line.
pub(super) enum Statement {
    /// An empty line, a comment, or a statement that does not affect rendering.
    Nothing,
    New(String),
    Color(MtlColor, [f64; 3]),
    Number(MtlNumber, f64),
    Illumination(u8),
    Map(MapKind, Map),
    /// An ignored statement, with its warning.
    Ignored(String),
}

/// Parses a line.
pub(super) fn parse(line: &str) -> Result<Statement, String> {
    let line = line.trim();
    let (keyword, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
    let rest = rest.trim_start();
    let is = |name: &str| keyword.eq_ignore_ascii_case(name);
    if keyword.is_empty() || keyword.starts_with('#') {
        return Ok(Statement::Nothing);
    }
    if is("newmtl") {
        let name = (!rest.is_empty()).then(|| rest.to_owned());
        return name.map(Statement::New).ok_or_else(|| expected_after("newmtl", "a name"));
    }
    if let Some((color, _)) = MtlColor::ALL.into_iter().find(|(_, name)| is(name)) {
        return parse_color(keyword, color, rest);
    }
    if let Some((number, _)) = MtlNumber::ALL.into_iter().find(|(_, name)| is(name)) {
        return parse_number(keyword, number, rest);
    }
    if let Some(kind) = MapKind::from_keyword(keyword) {
        return match Map::parse(rest) {
            Some(map) => Ok(Statement::Map(kind, map)),
            None => Err(expected_after(keyword, "a file name")),
        };
    }
    match keyword.to_ascii_lowercase().as_str() {
        "illum" => illumination(rest),
        // This affects only reflection maps, which have their own warning.
        "sharpness" => Ok(Statement::Nothing),
        _ => Ok(Statement::Ignored(unknown_statement(keyword))),
    }
}

/// Error message for a statement with missing or invalid arguments.
pub(super) fn expected_after(keyword: &str, expected: &str) -> String {
    format!("expected {expected} after `{keyword}`")
}

pub(super) const THREE_NUMBERS: &str = "three finite numbers";
pub(super) const ONE_NUMBER: &str = "a finite number";
pub(super) const INTEGER: &str = "an integer";

pub(super) fn unknown_statement(keyword: &str) -> String {
    format!("unknown statement `{}` is ignored", truncate_word(keyword))
}

pub(super) fn spectrum_unsupported(keyword: &str) -> String {
    format!("the spectrum of `{keyword}` is not supported; the default color is used")
}

/// The first 20 characters of a word.
fn truncate_word(word: &str) -> String {
    word.chars().take(20).collect()
}

/// Words before a comment.
fn words_before_comment(rest: &str) -> Vec<&str> {
    rest.split('#').next().unwrap_or_default().split_whitespace().collect()
}

fn finite<T: std::str::FromStr + Into<f64>>(word: &str) -> Option<f64> {
    word.parse().ok().map(T::into).filter(|number: &f64| number.is_finite())
}

/// Parses a color: three numbers or a single gray value.
fn parse_color(keyword: &str, color: MtlColor, rest: &str) -> Result<Statement, String> {
    let words = words_before_comment(rest);
    let (is_xyz, words) = match words.as_slice() {
        ["spectral", ..] => {
            return Ok(Statement::Ignored(spectrum_unsupported(keyword)));
        }
        ["xyz", words @ ..] => (true, words),
        words => (false, words),
    };
    let numbers: Option<Vec<f64>> = words.iter().take(3).map(|word| finite::<f32>(word)).collect();
    let values = match numbers.as_deref() {
        Some([gray]) => [*gray; 3],
        Some([red, green, blue]) => [*red, *green, *blue],
        Some(_) | None => return Err(expected_after(keyword, THREE_NUMBERS)),
    };
    Ok(Statement::Color(color, if is_xyz { xyz_to_rgb(values) } else { values }))
}

/// Converts CIE XYZ to linear Rec. 709 (ITU-R BT.709 primaries, D65 white).
fn xyz_to_rgb([x, y, z]: [f64; 3]) -> [f64; 3] {
    [
        3.240_97 * x - 1.537_38 * y - 0.498_61 * z,
        -0.969_24 * x + 1.875_97 * y + 0.041_56 * z,
        0.055_63 * x - 0.203_98 * y + 1.056_97 * z,
    ]
}

/// Parses a number. Treats `d -halo` like `d`.
fn parse_number(keyword: &str, number: MtlNumber, rest: &str) -> Result<Statement, String> {
    let words = words_before_comment(rest);
    let word = match words.as_slice() {
        ["-halo", word, ..] if number == MtlNumber::Dissolve => Some(word),
        words => words.first(),
    };
    let value = word.and_then(|word| finite::<f32>(word));
    value.map(|value| Statement::Number(number, value)).ok_or_else(|| expected_after(keyword, ONE_NUMBER))
}

fn illumination(rest: &str) -> Result<Statement, String> {
    let number = words_before_comment(rest).first().and_then(|word| word.parse().ok());
    number.map(Statement::Illumination).ok_or_else(|| expected_after("illum", INTEGER))
}
