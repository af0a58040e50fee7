//! Parses lines from an MTL file. Keywords are case-insensitive.

use super::map::{MapKind, MtlMap, ignored_option_warning};
use crate::math::limits::MAX_MAGNITUDE;

/// A color statement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum MtlColorParameter {
    Ambient,
    Diffuse,
    Specular,
    Emission,
    /// Transmission filter.
    Filter,
}

impl MtlColorParameter {
    /// All colors with their keywords, in enum order.
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
pub(super) enum MtlScalarParameter {
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

impl MtlScalarParameter {
    /// All numbers with their keywords, in enum order.
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

    /// Smallest and largest valid value, or `None` if the number has no effect or its effect depends on the
    /// material.
    fn range(self) -> Option<[f64; 2]> {
        match self {
            Self::Shininess => Some([0.0, MAX_MAGNITUDE]),
            Self::Dissolve
            | Self::Transparency
            | Self::Roughness
            | Self::Metallic
            | Self::Coat
            | Self::CoatRoughness => Some([0.0, 1.0]),
            Self::Anisotropy => Some([-1.0, 1.0]),
            Self::Ior | Self::Sheen | Self::AnisotropyRotation => None,
        }
    }
}

/// A parsed line.
pub(super) enum Statement {
    /// An empty line, a comment, or a statement that does not affect rendering.
    Nothing,
    /// A statement that is ignored with a warning.
    Ignored,
    New(String),
    Color(MtlColorParameter, [f64; 3]),
    Number(MtlScalarParameter, f64),
    Illumination(u8),
    Map(MapKind, MtlMap),
}

/// Parses a line, adding a warning for each unusable part.
pub(super) fn parse_line(line: &str, warnings: &mut Vec<String>) -> Result<Statement, String> {
    let line = line.trim();
    let (keyword, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
    let rest = rest.trim_start();
    let is = |name: &str| keyword.eq_ignore_ascii_case(name);
    if keyword.is_empty() || keyword.starts_with('#') {
        return Ok(Statement::Nothing);
    }
    if is("newmtl") {
        let name = (!rest.is_empty()).then(|| rest.to_owned());
        return name.map(Statement::New).ok_or_else(|| expected_arguments_message("newmtl", "a name"));
    }
    if let Some((color, _)) = MtlColorParameter::ALL.into_iter().find(|(_, name)| is(name)) {
        return parse_color(keyword, color, rest, warnings);
    }
    if let Some((number, _)) = MtlScalarParameter::ALL.into_iter().find(|(_, name)| is(name)) {
        return parse_number(keyword, number, rest, warnings);
    }
    if let Some(kind) = MapKind::from_keyword(keyword) {
        return match MtlMap::parse(rest) {
            Some(map) => Ok(Statement::Map(kind, map)),
            None => Err(expected_arguments_message(keyword, "a file name")),
        };
    }
    match keyword.to_ascii_lowercase().as_str() {
        "illum" => parse_illumination_model(rest, warnings),
        // This affects only reflection maps, which have their own warning.
        "sharpness" => Ok(Statement::Nothing),
        _ => {
            warnings.push(unknown_statement_warning(keyword));
            Ok(Statement::Ignored)
        }
    }
}

/// Error message for a statement with missing or invalid arguments.
pub(super) fn expected_arguments_message(keyword: &str, expected: &str) -> String {
    format!("expected {expected} after `{keyword}`")
}

pub(super) const THREE_NUMBERS: &str = "three finite numbers";
pub(super) const ONE_NUMBER: &str = "a finite number";
pub(super) const INTEGER: &str = "an integer";

pub(super) fn unknown_statement_warning(keyword: &str) -> String {
    format!("unknown statement `{}` is ignored", truncate_word(keyword))
}

pub(super) fn unsupported_spectrum_warning(keyword: &str) -> String {
    format!("the spectrum of `{keyword}` is not supported; the default color is used")
}

/// Truncates a word to its first 20 characters.
fn truncate_word(word: &str) -> String {
    word.chars().take(20).collect()
}

/// Returns the words before a comment.
fn words_before_comment(rest: &str) -> Vec<&str> {
    rest.split('#').next().unwrap_or_default().split_whitespace().collect()
}

fn parse_finite(word: &str) -> Option<f64> {
    word.parse::<f32>().ok().map(f64::from).filter(|number| number.is_finite())
}

/// Clamps a value to a range. Adds a warning that quotes `word` if the value changes.
fn clamp_with_warning(
    word: &str,
    value: f64,
    [least, most]: [f64; 2],
    keyword: &str,
    warnings: &mut Vec<String>,
) -> f64 {
    let clamped = value.clamp(least, most);
    if clamped != value {
        warnings.push(clamped_value_warning(word, keyword, clamped));
    }
    clamped
}

pub(super) fn clamped_value_warning(word: &str, keyword: &str, limit: f64) -> String {
    let limit = if limit == MAX_MAGNITUDE { "1e18".to_owned() } else { limit.to_string() };
    format!("{word} in `{keyword}` is clamped to {limit}")
}

/// Warns if there are more than `count` words.
fn warn_about_excess(words: &[&str], count: usize, keyword: &str, warnings: &mut Vec<String>) {
    if words.len() > count {
        warnings.push(excess_words_warning(keyword));
    }
}

pub(super) fn excess_words_warning(keyword: &str) -> String {
    format!("extra words in `{keyword}` are ignored")
}

pub(super) fn outside_gamut_warning(keyword: &str) -> String {
    format!("`{keyword}` is outside the RGB gamut; its negative components are clamped to 0")
}

/// Parses a color: three numbers or a single gray value.
fn parse_color(
    keyword: &str,
    color: MtlColorParameter,
    rest: &str,
    warnings: &mut Vec<String>,
) -> Result<Statement, String> {
    let words = words_before_comment(rest);
    let (is_xyz, words) = match words.as_slice() {
        ["spectral", ..] => {
            warnings.push(unsupported_spectrum_warning(keyword));
            return Ok(Statement::Ignored);
        }
        ["xyz", words @ ..] => (true, words),
        words => (false, words),
    };
    let numbers: Option<Vec<f64>> = words.iter().take(3).map(|word| parse_finite(word)).collect();
    let values = match numbers.as_deref() {
        Some([gray]) => [*gray; 3],
        Some([red, green, blue]) => [*red, *green, *blue],
        Some(_) | None => return Err(expected_arguments_message(keyword, THREE_NUMBERS)),
    };
    warn_about_excess(words, 3, keyword, warnings);
    let values = match (color, is_xyz) {
        // These colors have no effect.
        (MtlColorParameter::Ambient | MtlColorParameter::Filter, _) => values,
        (MtlColorParameter::Diffuse | MtlColorParameter::Specular | MtlColorParameter::Emission, true) => {
            /// Maximum rounding error for colors at the edge of the gamut.
            const TINY: f64 = 1e-3;
            let rgb = xyz_to_rgb(values);
            if rgb.iter().any(|part| *part < -TINY) {
                warnings.push(outside_gamut_warning(keyword));
            }
            rgb.map(|part| part.clamp(0.0, MAX_MAGNITUDE))
        }
        (MtlColorParameter::Diffuse | MtlColorParameter::Specular | MtlColorParameter::Emission, false) => {
            // Report only the first component.
            let mut reported = Vec::new();
            let part = |part: usize| {
                let word = words.get(part).or(words.first()).copied().unwrap_or_default();
                clamp_with_warning(word, values[part], [0.0, MAX_MAGNITUDE], keyword, &mut reported)
            };
            let clamped = [0, 1, 2].map(part);
            warnings.extend(reported.into_iter().next());
            clamped
        }
    };
    Ok(Statement::Color(color, values))
}

/// Converts CIE XYZ to linear Rec. 709 (ITU-R BT.709 primaries, D65 white).
fn xyz_to_rgb([x, y, z]: [f64; 3]) -> [f64; 3] {
    [
        3.240_97 * x - 1.537_38 * y - 0.498_61 * z,
        -0.969_24 * x + 1.875_97 * y + 0.041_56 * z,
        0.055_63 * x - 0.203_98 * y + 1.056_97 * z,
    ]
}

/// Parses a number. Treats `d -halo` like `d`, with a warning.
fn parse_number(
    keyword: &str,
    number: MtlScalarParameter,
    rest: &str,
    warnings: &mut Vec<String>,
) -> Result<Statement, String> {
    let words = words_before_comment(rest);
    let words = match words.as_slice() {
        ["-halo", words @ ..] if number == MtlScalarParameter::Dissolve => {
            warnings.push(ignored_option_warning("-halo"));
            words
        }
        words => words,
    };
    let value = words.first().and_then(|word| Some((*word, parse_finite(word)?)));
    let (word, value) = value.ok_or_else(|| expected_arguments_message(keyword, ONE_NUMBER))?;
    warn_about_excess(words, 1, keyword, warnings);
    let value = match number.range() {
        Some(range) => clamp_with_warning(word, value, range, keyword, warnings),
        None => value,
    };
    Ok(Statement::Number(number, value))
}

/// Parses an illumination model. Unknown models become 255.
fn parse_illumination_model(rest: &str, warnings: &mut Vec<String>) -> Result<Statement, String> {
    let words = words_before_comment(rest);
    let number = words.first().and_then(|word| word.parse::<i64>().ok());
    let number = number.ok_or_else(|| expected_arguments_message("illum", INTEGER))?;
    warn_about_excess(&words, 1, "illum", warnings);
    Ok(Statement::Illumination(u8::try_from(number).unwrap_or(u8::MAX)))
}
