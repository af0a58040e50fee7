//! Lines of an MTL as statements, whose keywords may be in any case.

use super::map::{Kind, Map};

/// Colors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Colour {
    Ambient,
    Diffuse,
    Specular,
    Emission,
    /// The transmission filter.
    Filter,
}

impl Colour {
    /// All colors with their keywords, in the order of the enum.
    pub(super) const ALL: [(Self, &'static str); 5] = [
        (Self::Ambient, "Ka"),
        (Self::Diffuse, "Kd"),
        (Self::Specular, "Ks"),
        (Self::Emission, "Ke"),
        (Self::Filter, "Tf"),
    ];
}

/// Numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Number {
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

impl Number {
    /// All numbers with their keywords, in the order of the enum.
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

    /// Its keyword.
    pub(super) fn keyword(self) -> &'static str {
        Self::ALL[self as usize].1
    }
}

/// A line.
pub(super) enum Statement {
    /// Empty, a comment, or without an effect on any image.
    Nothing,
    New(String),
    Colour(Colour, [f64; 3]),
    Number(Number, f64),
    Illumination(u8),
    Map(Kind, Map),
    /// A statement without effect, with a warning.
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
        return name.map(Statement::New).ok_or_else(|| "`newmtl` is followed by a name".to_owned());
    }
    if let Some((color, _)) = Colour::ALL.into_iter().find(|(_, name)| is(name)) {
        return self::color(keyword, color, rest);
    }
    if let Some((number, _)) = Number::ALL.into_iter().find(|(_, name)| is(name)) {
        return self::number(keyword, number, rest);
    }
    if let Some(kind) = Kind::of(keyword) {
        return match Map::parse(rest) {
            Some(map) => Ok(Statement::Map(kind, map)),
            None => Err(format!("`{keyword}` is followed by a file")),
        };
    }
    match keyword.to_ascii_lowercase().as_str() {
        "illum" => illumination(rest),
        // It sharpens reflection maps, which are reported themselves.
        "sharpness" => Ok(Statement::Nothing),
        _ => Ok(Statement::Ignored(format!("`{}` is no known statement and is ignored", short(keyword)))),
    }
}

/// The start of a word that may be long.
fn short(word: &str) -> String {
    word.chars().take(20).collect()
}

/// The words before a comment.
fn words(rest: &str) -> Vec<&str> {
    rest.split('#').next().unwrap_or_default().split_whitespace().collect()
}

fn finite<T: std::str::FromStr + Into<f64>>(word: &str) -> Option<f64> {
    word.parse().ok().map(T::into).filter(|number: &f64| number.is_finite())
}

/// A color of three numbers, or of one, which is gray.
fn color(keyword: &str, color: Colour, rest: &str) -> Result<Statement, String> {
    let words = words(rest);
    let (is_xyz, words) = match words.as_slice() {
        ["spectral", ..] => {
            let words = format!("the spectrum of `{keyword}` is not read; the usual color is used");
            return Ok(Statement::Ignored(words));
        }
        ["xyz", words @ ..] => (true, words),
        words => (false, words),
    };
    let numbers: Option<Vec<f64>> = words.iter().take(3).map(|word| finite::<f32>(word)).collect();
    let values = match numbers.as_deref() {
        Some([gray]) => [*gray; 3],
        Some([red, green, blue]) => [*red, *green, *blue],
        Some(_) | None => return Err(format!("`{keyword}` is followed by three finite numbers")),
    };
    Ok(Statement::Colour(color, if is_xyz { rgb(values) } else { values }))
}

/// CIE's XYZ as linear Rec. 709 (ITU-R BT.709, its primaries and its white D65).
fn rgb([x, y, z]: [f64; 3]) -> [f64; 3] {
    [
        3.240_97 * x - 1.537_38 * y - 0.498_61 * z,
        -0.969_24 * x + 1.875_97 * y + 0.041_56 * z,
        0.055_63 * x - 0.203_98 * y + 1.056_97 * z,
    ]
}

/// A number; `d -halo` counts as `d`.
fn number(keyword: &str, number: Number, rest: &str) -> Result<Statement, String> {
    let words = words(rest);
    let word = match words.as_slice() {
        ["-halo", word, ..] if number == Number::Dissolve => Some(word),
        words => words.first(),
    };
    let value = word.and_then(|word| finite::<f32>(word));
    value
        .map(|value| Statement::Number(number, value))
        .ok_or_else(|| format!("`{keyword}` is followed by a finite number"))
}

fn illumination(rest: &str) -> Result<Statement, String> {
    let number = words(rest).first().and_then(|word| word.parse().ok());
    number.map(Statement::Illumination).ok_or_else(|| "`illum` is followed by a whole number".to_owned())
}
