//! Maps of an MTL file: options followed by a file name.

use std::ffi::OsStr;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};

use crate::assets::FileTexture;
use crate::materials::{Channel, PixelValue};
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
    Ambient,
    /// Unsupported.
    Other(&'static str),
}

impl MapKind {
    /// Map kind for a keyword, ignoring case.
    pub(super) fn from_keyword(keyword: &str) -> Option<Self> {
        const OTHERS: [&str; 13] = [
            "map_Ns",
            "disp",
            "map_Disp",
            "decal",
            "refl",
            "map_Refl",
            "map_Tr",
            "map_Tf",
            "map_Ps",
            "map_Pc",
            "map_Pcr",
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
            "map_ka" => Self::Ambient,
            other => Self::Other(OTHERS.into_iter().find(|name| name.eq_ignore_ascii_case(other))?),
        })
    }

    /// Whether the map contains colors.
    fn is_color(self) -> bool {
        match self {
            Self::Diffuse | Self::Specular | Self::Emission | Self::Ambient => true,
            Self::Opacity | Self::Normal | Self::Bump | Self::Roughness | Self::Metallic | Self::Other(_) => {
                false
            }
        }
    }

    fn is_normal(self) -> bool {
        match self {
            Self::Normal | Self::Bump => true,
            Self::Diffuse
            | Self::Specular
            | Self::Emission
            | Self::Opacity
            | Self::Roughness
            | Self::Metallic
            | Self::Ambient
            | Self::Other(_) => false,
        }
    }
}

/// A map with its options, exactly as in the file.
#[derive(Clone, Debug)]
pub(super) struct Map {
    pub(super) line: usize,
    repeat: [f64; 2],
    offset: [f64; 2],
    range: [f64; 2],
    is_clamped: bool,
    /// Channel to read as a scalar, if specified.
    number: Option<PixelValue>,
    /// Scale factor for the normal map's slopes.
    pub(super) strength: f64,
    /// Options that have no effect.
    ignored: Vec<String>,
    /// File name: the text after the options.
    name: String,
}

impl Map {
    /// Parses the text after the keyword. `None` if there is no file name.
    pub(super) fn parse(text: &str) -> Option<Self> {
        let mut map = Self {
            line: 0,
            repeat: [1.0; 2],
            offset: [0.0; 2],
            range: [0.0, 1.0],
            is_clamped: false,
            number: None,
            strength: 1.0,
            ignored: Vec::new(),
            name: String::new(),
        };
        let mut rest = MapArguments(text.trim());
        while let Some(option) = rest.option() {
            map.add(&option, &mut rest);
        }
        // Some exporters quote names that contain spaces.
        let name = rest.0;
        map.name = name.strip_prefix('"').and_then(|name| name.strip_suffix('"')).unwrap_or(name).to_owned();
        (!map.name.is_empty()).then_some(map)
    }

    /// Parses the arguments of an option.
    fn add(&mut self, option: &str, rest: &mut MapArguments<'_>) {
        match option {
            "-s" => {
                let [u, v, _] = rest.numbers([1.0; 3]);
                self.repeat = [u, v];
            }
            "-o" => {
                let [u, v, _] = rest.numbers([0.0; 3]);
                self.offset = [u, v];
            }
            "-t" => {
                if rest.numbers([0.0; 3]) != [0.0; 3] {
                    self.ignored.push("-t".to_owned());
                }
            }
            "-mm" => self.range = rest.numbers([0.0, 1.0]),
            "-bm" => {
                let [strength] = rest.numbers([1.0]);
                if strength < 0.0 {
                    self.ignored.push(format!("-bm {strength}"));
                } else {
                    self.strength = strength;
                }
            }
            "-clamp" => self.is_clamped = rest.next_switch().unwrap_or(false),
            "-imfchan" => self.add_channel(rest),
            "-boost" | "-texres" => {
                if rest.numbers([0.0]) != [0.0] {
                    self.ignored.push(option.to_owned());
                }
            }
            "-blendu" | "-blendv" => {
                if rest.next_switch() == Some(false) {
                    self.ignored.push(format!("{option} off"));
                }
            }
            "-cc" => {
                if rest.next_switch() == Some(true) {
                    self.ignored.push("-cc on".to_owned());
                }
            }
            _ => {
                rest.word();
                self.ignored.push(option.to_owned());
            }
        }
    }

    fn add_channel(&mut self, rest: &mut MapArguments<'_>) {
        let Some(letter) = rest.word() else { return };
        let channel = |channel| Some(PixelValue::Channel(channel));
        self.number = match letter.to_ascii_lowercase().as_str() {
            "r" => channel(Channel::Red),
            "g" => channel(Channel::Green),
            "b" => channel(Channel::Blue),
            "m" => channel(Channel::Alpha),
            "l" => Some(PixelValue::Luminance),
            _ => {
                self.ignored.push(format!("-imfchan {letter}"));
                None
            }
        };
    }

    /// Options that have no effect on this kind of map.
    pub(super) fn ignored_options(&self, kind: MapKind) -> impl Iterator<Item = String> {
        let channel =
            (self.number.is_some() && (kind.is_color() || kind.is_normal())).then(|| "-imfchan".to_owned());
        let range = (self.range != [0.0, 1.0] && kind.is_normal()).then(|| "-mm".to_owned());
        let strength = (self.strength != 1.0 && !kind.is_normal()).then(|| "-bm".to_owned());
        self.ignored.iter().cloned().chain(channel).chain(range).chain(strength)
    }

    /// Candidate paths of the image file, relative to the MTL file's folder: the whole name, then the name
    /// with possible comments removed.
    pub(super) fn candidate_paths(&self) -> impl Iterator<Item = PathBuf> {
        without_trailing_comments(&self.name).flat_map(|name| decoded_paths(&name.replace('\\', "/")))
    }

    /// Texture for this map. Its path is the first candidate that exists, or the first candidate if none
    /// exists.
    pub(super) fn texture(&self, folder: &Path) -> Option<FileTexture> {
        let [u, v] = self.repeat;
        let [base, gain] = self.range.map(|number| number as f32);
        Some(FileTexture {
            repeat: Vec2::new(u as f32, v as f32),
            offset: DVec2::from_array(self.offset),
            is_clamped: self.is_clamped,
            range: (base, gain),
            number: self.number,
            ..FileTexture::new(first_existing(folder, self.candidate_paths())?)
        })
    }
}

/// Arguments of a map statement. The last one is the file name.
struct MapArguments<'a>(&'a str);

impl<'a> MapArguments<'a> {
    /// Consumes an option and returns it in lowercase. Any other word starts the file name, even if it begins
    /// with a dash.
    fn option(&mut self) -> Option<String> {
        const OPTIONS: [&str; 13] = [
            "-s", "-o", "-t", "-mm", "-bm", "-clamp", "-imfchan", "-boost", "-texres", "-blendu", "-blendv",
            "-cc", "-type",
        ];
        let (word, rest) = self.0.split_once(char::is_whitespace)?;
        let option = word.to_ascii_lowercase();
        OPTIONS.contains(&option.as_str()).then(|| {
            self.0 = rest.trim_start();
            option
        })
    }

    /// Consumes the next word unless it is the last one.
    fn word(&mut self) -> Option<&'a str> {
        let (word, rest) = self.0.split_once(char::is_whitespace)?;
        self.0 = rest.trim_start();
        Some(word)
    }

    /// Consumes up to `N` numbers. Missing numbers keep their defaults.
    fn numbers<const N: usize>(&mut self, default: [f64; N]) -> [f64; N] {
        let mut numbers = default;
        for number in &mut numbers {
            let Some((word, _)) = self.0.split_once(char::is_whitespace) else { break };
            let Ok(value) = word.parse::<f32>() else { break };
            if value.is_finite() {
                *number = f64::from(value);
            }
            self.word();
        }
        numbers
    }

    /// Consumes `on` or `off`.
    fn next_switch(&mut self) -> Option<bool> {
        let (word, _) = self.0.split_once(char::is_whitespace)?;
        let value = [("on", true), ("off", false)];
        let (_, is_on) = value.into_iter().find(|(name, _)| word.eq_ignore_ascii_case(name))?;
        self.word();
        Some(is_on)
    }
}

/// Yields the whole text, then the text without its last comment, and so on.
pub(in crate::assets::mesh) fn without_trailing_comments(text: &str) -> impl Iterator<Item = &str> {
    let is_comment = |(at, _): &(usize, &str)| text[..*at].ends_with([' ', '\t']);
    let cuts = text.rmatch_indices('#').filter(is_comment).map(|(at, _)| text[..at].trim_end());
    std::iter::once(text).chain(cuts).filter(|text| !text.is_empty())
}

/// Yields the name encoded as UTF-8, and also as Latin-1 if it has non-ASCII letters.
pub(in crate::assets::mesh) fn decoded_paths(name: &str) -> impl Iterator<Item = PathBuf> + use<> {
    let latin1: Option<Vec<u8>> = name.chars().map(|letter| u8::try_from(u32::from(letter)).ok()).collect();
    let latin1 = latin1.filter(|_| !name.is_ascii()).map(|bytes| PathBuf::from(OsStr::from_bytes(&bytes)));
    std::iter::once(PathBuf::from(name)).chain(latin1)
}

/// Returns the first file that exists, or the first file in the list if none exists.
pub(in crate::assets::mesh) fn first_existing(
    folder: &Path,
    names: impl Iterator<Item = PathBuf>,
) -> Option<PathBuf> {
    let files: Vec<_> = names.map(|name| folder.join(name)).collect();
    files.iter().find(|file| file.exists()).or(files.first()).cloned()
}
