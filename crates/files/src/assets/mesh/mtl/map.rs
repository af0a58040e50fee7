//! Maps in an MTL file: options followed by a file name.

use std::ffi::OsStr;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};

use crate::assets::{FileLine, FileTexture};
use crate::materials::{Channel, ChannelSelector};
use crate::math::limits::{MAX_MAGNITUDE, is_nonzero_but_too_short};
use crate::math::{DVec2, Vec2};

/// Material parameter that a map controls.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum MapKind {
    Diffuse,
    Specular,
    Emission,
    Opacity,
    /// `norm` or `map_Kn`.
    Normal,
    /// `bump` or `map_Bump`: a normal map or a height map.
    Bump,
    Roughness,
    Metallic,
    Coat,
    CoatRoughness,
    Ambient,
    /// Unsupported.
    Other(&'static str),
}

impl MapKind {
    /// Map kind for a keyword, ignoring case.
    pub(super) fn from_keyword(keyword: &str) -> Option<Self> {
        const OTHERS: [&str; 11] = [
            "map_Ns",
            "disp",
            "map_Disp",
            "decal",
            "refl",
            "map_Refl",
            "map_Tr",
            "map_Tf",
            "map_Ps",
            "map_aniso",
            "map_aat",
        ];
        Some(match keyword.to_ascii_lowercase().as_str() {
            "map_kd" => Self::Diffuse,
            "map_ks" => Self::Specular,
            "map_ke" => Self::Emission,
            "map_d" | "map_opacity" => Self::Opacity,
            "norm" | "map_norm" | "map_kn" => Self::Normal,
            "bump" | "map_bump" => Self::Bump,
            "map_pr" => Self::Roughness,
            "map_pm" => Self::Metallic,
            "map_pc" => Self::Coat,
            "map_pcr" => Self::CoatRoughness,
            "map_ka" => Self::Ambient,
            other => Self::Other(OTHERS.into_iter().find(|name| name.eq_ignore_ascii_case(other))?),
        })
    }

    /// Returns the statement's keyword, or one of them if there are several.
    pub(super) fn keyword(self) -> &'static str {
        match self {
            Self::Diffuse => "map_Kd",
            Self::Specular => "map_Ks",
            Self::Emission => "map_Ke",
            Self::Opacity => "map_d",
            Self::Normal => "norm",
            Self::Bump => "bump",
            Self::Roughness => "map_Pr",
            Self::Metallic => "map_Pm",
            Self::Coat => "map_Pc",
            Self::CoatRoughness => "map_Pcr",
            Self::Ambient => "map_Ka",
            Self::Other(name) => name,
        }
    }

    /// Whether the map contains colors.
    fn is_color(self) -> bool {
        match self {
            Self::Diffuse | Self::Specular | Self::Emission | Self::Ambient => true,
            Self::Opacity
            | Self::Normal
            | Self::Bump
            | Self::Roughness
            | Self::Metallic
            | Self::Coat
            | Self::CoatRoughness
            | Self::Other(_) => false,
        }
    }

    fn perturbs_normals(self) -> bool {
        match self {
            Self::Normal | Self::Bump => true,
            Self::Diffuse
            | Self::Specular
            | Self::Emission
            | Self::Opacity
            | Self::Roughness
            | Self::Metallic
            | Self::Coat
            | Self::CoatRoughness
            | Self::Ambient
            | Self::Other(_) => false,
        }
    }
}

/// A map and its options, as given in the file.
#[derive(Clone, Debug)]
pub(super) struct MtlMap {
    pub(super) line: usize,
    repeat: [f64; 2],
    offset: [f64; 2],
    range: [f64; 2],
    is_clamped: bool,
    /// Channel to read as a scalar, if specified.
    number: Option<ChannelSelector>,
    /// Scale factor for the normal map's slopes.
    pub(super) strength: f64,
    /// Warnings about options.
    warnings: Vec<String>,
    /// File name: the text after the options.
    name: String,
}

impl MtlMap {
    /// Parses the text after the keyword, or returns `None` if it has no file name.
    pub(super) fn parse(text: &str) -> Option<Self> {
        let mut map = Self {
            line: 0,
            repeat: [1.0; 2],
            offset: [0.0; 2],
            range: [0.0, 1.0],
            is_clamped: false,
            number: None,
            strength: 1.0,
            warnings: Vec::new(),
            name: String::new(),
        };
        let mut rest = MapArgumentCursor(text.trim());
        while let Some(option) = rest.next_option_name() {
            let start = rest.0;
            if !map.parse_option_arguments(&option, &mut rest) {
                let arguments = start[..start.len() - rest.0.len()].trim_end();
                let option = format!("{option} {arguments}");
                map.warnings.push(ignored_option_warning(option.trim_end()));
            }
        }
        // Some exporters quote names that contain spaces.
        let name = rest.0;
        map.name = name.strip_prefix('"').and_then(|name| name.strip_suffix('"')).unwrap_or(name).to_owned();
        let first = map.name.split_whitespace().next().filter(|first| first.len() < map.name.len());
        map.warnings.extend(first.filter(|first| looks_like_option(first)).map(not_an_option_warning));
        (!map.name.is_empty()).then_some(map)
    }

    /// Parses an option's arguments. Returns whether all of them are usable.
    fn parse_option_arguments(&mut self, option: &str, rest: &mut MapArgumentCursor<'_>) -> bool {
        match option {
            "-s" => {
                let scale =
                    rest.next_numbers([1.0; 3]).filter(|[u, v, _]| !is_near_zero(*u) && !is_near_zero(*v));
                set_if_some(&mut self.repeat, scale.map(|[u, v, _]| [u, v]))
            }
            "-o" => set_if_some(&mut self.offset, rest.next_numbers([0.0; 3]).map(|[u, v, _]| [u, v])),
            "-t" => rest.next_numbers([0.0; 3]) == Some([0.0; 3]),
            "-mm" => set_if_some(&mut self.range, rest.next_numbers([0.0, 1.0])),
            "-bm" => {
                let strength = rest.next_numbers([1.0]).filter(|[strength]| *strength >= 0.0);
                set_if_some(&mut self.strength, strength.map(|[strength]| strength))
            }
            "-clamp" => set_if_some(&mut self.is_clamped, rest.next_on_or_off()),
            "-imfchan" => {
                set_if_some(&mut self.number, rest.next_unless_last().and_then(parse_channel).map(Some))
            }
            "-boost" | "-texres" => rest.next_numbers([0.0]) == Some([0.0]),
            "-blendu" | "-blendv" => rest.next_on_or_off() == Some(true),
            "-cc" => rest.next_on_or_off() == Some(false),
            "-type" | "-colorspace" => {
                rest.next_unless_last();
                false
            }
            _ => {
                while rest.is_next_number_or_switch() {
                    rest.next_unless_last();
                }
                false
            }
        }
    }

    /// Warnings about options that are unusable or have no effect on this kind of map.
    pub(super) fn option_warnings(&self, kind: MapKind) -> impl Iterator<Item = String> {
        let channel =
            (self.number.is_some() && (kind.is_color() || kind.perturbs_normals())).then_some("-imfchan");
        let range = (self.range != [0.0, 1.0] && kind.perturbs_normals()).then_some("-mm");
        let strength = (self.strength != 1.0 && !kind.perturbs_normals()).then_some("-bm");
        let unused = channel.into_iter().chain(range).chain(strength).map(ignored_option_warning);
        self.warnings.iter().cloned().chain(unused)
    }

    /// Candidate paths for the image file, relative to the MTL file's folder: first the whole name, then the
    /// name without possible comments.
    pub(super) fn candidate_paths(&self) -> impl Iterator<Item = PathBuf> {
        successively_strip_comments(&self.name)
            .flat_map(|name| encode_utf8_and_latin1_paths(&name.replace('\\', "/")))
    }

    /// Returns the texture for this map in the MTL file at `library`. Its path is the first candidate that
    /// exists, or the first candidate if none exists.
    pub(super) fn texture(&self, library: &Path) -> Option<FileTexture> {
        let folder = library.parent().unwrap_or(Path::new(""));
        let statement = FileLine { path: library.to_owned(), line: self.line };
        let [u, v] = self.repeat;
        let [base, gain] = self.range.map(|number| number as f32);
        Some(FileTexture {
            repeat: Vec2::new(u as f32, v as f32),
            offset: DVec2::from_array(self.offset),
            is_clamped: self.is_clamped,
            range: (base, gain),
            number: self.number,
            ..FileTexture::new(first_existing_or_first(folder, self.candidate_paths())?, statement)
        })
    }
}

/// Sets a field unless the value is `None`. Returns whether it was set.
fn set_if_some<T>(field: &mut T, value: Option<T>) -> bool {
    let is_set = value.is_some();
    if let Some(value) = value {
        *field = value;
    }
    is_set
}

/// Returns the channel that `-imfchan` selects.
fn parse_channel(letter: &str) -> Option<ChannelSelector> {
    match letter.to_ascii_lowercase().as_str() {
        "r" => Some(ChannelSelector::Channel(Channel::Red)),
        "g" => Some(ChannelSelector::Channel(Channel::Green)),
        "b" => Some(ChannelSelector::Channel(Channel::Blue)),
        "m" => Some(ChannelSelector::Channel(Channel::Alpha)),
        "l" => Some(ChannelSelector::Luminance),
        _ => None,
    }
}

/// Whether a scale is 0 or too small to compute with.
fn is_near_zero(scale: f64) -> bool {
    scale == 0.0 || is_nonzero_but_too_short(scale)
}

/// Whether a word looks like an option: a dash followed by letters.
fn looks_like_option(word: &str) -> bool {
    word.strip_prefix('-')
        .is_some_and(|name| !name.is_empty() && name.chars().all(|c| c.is_ascii_alphabetic()))
}

pub(super) fn ignored_option_warning(option: &str) -> String {
    format!("option `{option}` is ignored")
}

pub(super) fn not_an_option_warning(word: &str) -> String {
    format!("`{word}` is not a map option; it is read as part of the file name")
}

/// Arguments of a map statement, of which the last one is the file name.
#[derive(Clone, Copy)]
struct MapArgumentCursor<'a>(&'a str);

impl<'a> MapArgumentCursor<'a> {
    /// Consumes an option and returns it in lowercase. An unknown option is recognized only if a number or a
    /// switch follows it. Any other word starts the file name, even if it begins with a dash.
    fn next_option_name(&mut self) -> Option<String> {
        const OPTIONS: [&str; 14] = [
            "-s",
            "-o",
            "-t",
            "-mm",
            "-bm",
            "-clamp",
            "-imfchan",
            "-boost",
            "-texres",
            "-blendu",
            "-blendv",
            "-cc",
            "-type",
            "-colorspace",
        ];
        let (word, rest) = self.0.split_once(char::is_whitespace)?;
        let (option, rest) = (word.to_ascii_lowercase(), Self(rest.trim_start()));
        let is_option =
            OPTIONS.contains(&option.as_str()) || looks_like_option(word) && rest.is_next_number_or_switch();
        is_option.then(|| {
            *self = rest;
            option
        })
    }

    /// Returns the next word and the text after it, or `None` if the next word is the last one.
    fn peek_unless_last(&self) -> Option<(&'a str, &'a str)> {
        let (word, rest) = self.0.split_once(char::is_whitespace)?;
        Some((word, rest.trim_start()))
    }

    /// Consumes the next word unless it is the last one.
    fn next_unless_last(&mut self) -> Option<&'a str> {
        let (word, rest) = self.peek_unless_last()?;
        self.0 = rest;
        Some(word)
    }

    /// Whether the next word is a number or a switch but not the last word.
    fn is_next_number_or_switch(&self) -> bool {
        self.peek_unless_last()
            .is_some_and(|(word, _)| word.parse::<f32>().is_ok() || parse_switch(word).is_some())
    }

    /// Consumes up to `N` numbers. Missing numbers keep their defaults. Returns `None` if there are no
    /// numbers, or if one of them is too large or not finite.
    fn next_numbers<const N: usize>(&mut self, default: [f64; N]) -> Option<[f64; N]> {
        let mut numbers = default;
        let mut are_usable = false;
        for (index, number) in numbers.iter_mut().enumerate() {
            let Some(value) = self.peek_unless_last().and_then(|(word, _)| word.parse::<f32>().ok()) else {
                break;
            };
            self.next_unless_last();
            *number = f64::from(value);
            are_usable = (index == 0 || are_usable) && number.abs() <= MAX_MAGNITUDE;
        }
        are_usable.then_some(numbers)
    }

    /// Consumes `on` or `off`.
    fn next_on_or_off(&mut self) -> Option<bool> {
        let is_on = parse_switch(self.peek_unless_last()?.0)?;
        self.next_unless_last();
        Some(is_on)
    }
}

fn parse_switch(word: &str) -> Option<bool> {
    let switches = [("on", true), ("off", false)];
    switches.into_iter().find(|(name, _)| word.eq_ignore_ascii_case(name)).map(|(_, is_on)| is_on)
}

/// Yields the whole text, then the text without its last comment, and so on.
pub(in crate::assets::mesh) fn successively_strip_comments(text: &str) -> impl Iterator<Item = &str> {
    let is_comment = |(at, _): &(usize, &str)| text[..*at].ends_with([' ', '\t']);
    let cuts = text.rmatch_indices('#').filter(is_comment).map(|(at, _)| text[..at].trim_end());
    std::iter::once(text).chain(cuts).filter(|text| !text.is_empty())
}

/// Yields the name encoded as UTF-8, and also as Latin-1 if it has non-ASCII letters.
pub(in crate::assets::mesh) fn encode_utf8_and_latin1_paths(
    name: &str,
) -> impl Iterator<Item = PathBuf> + use<> {
    let latin1: Option<Vec<u8>> = name.chars().map(|letter| u8::try_from(u32::from(letter)).ok()).collect();
    let latin1 = latin1.filter(|_| !name.is_ascii()).map(|bytes| PathBuf::from(OsStr::from_bytes(&bytes)));
    std::iter::once(PathBuf::from(name)).chain(latin1)
}

/// Returns the first file that exists, or the first file in the list if none exists.
pub(in crate::assets::mesh) fn first_existing_or_first(
    folder: &Path,
    names: impl Iterator<Item = PathBuf>,
) -> Option<PathBuf> {
    let files: Vec<_> = names.map(|name| folder.join(name)).collect();
    files.iter().find(|file| file.exists()).or(files.first()).cloned()
}
