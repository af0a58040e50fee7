//! The head of a part: what the picture is, which part of it this is, and how it becomes a file.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::super::{BitDepth, Finish};
use crate::choice::Choice;
use crate::film::range_map::{DataKind, RangeMap};
use crate::film::tone::{ToneMapping, Tonemap, Transfer};
use crate::film::{Convergence, Film, FilmError, Quantity, Rect, SumOrder};

/// The head of a file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Head {
    /// Whether it is a part or a checkpoint.
    pub kind: Kind,
    /// Everything that the picture depends on, by names that a person knows.
    pub identity: Vec<Trait>,
    /// The part of the picture.
    pub share: ShareHead,
    /// The picture.
    pub picture: PictureHead,
    /// Path of the scene, relative to the part. Empty if it is unknown. Parts of one picture may differ in it.
    #[serde(default)]
    pub scene: String,
}

/// Kind of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// A part of a picture, finished.
    Part,
    /// A render that was interrupted or may be extended.
    Checkpoint,
}

impl Kind {
    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Part => "part",
            Self::Checkpoint => "checkpoint",
        }
    }
}

/// Something that a picture depends on.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Trait {
    /// Its name: a key of the scene, a file.
    pub name: String,
    /// Its value, or the fingerprint of a content.
    pub value: String,
}

impl Head {
    /// Whether a render can have written these numbers.
    pub(super) fn is_possible(&self) -> bool {
        /// Most pixels a side, and most parts.
        const MOST: u32 = 1 << 17;
        let Self { share, picture, .. } = self;
        let [x, y, width, height] = picture.crop;
        let is_inside = |at: u32, length: u32, whole: u32| {
            length > 0 && whole <= MOST && at.checked_add(length).is_some_and(|end| end <= whole)
        };
        is_inside(x, width, picture.width)
            && is_inside(y, height, picture.height)
            && (1..=share.count).contains(&share.index)
            && share.blocks.is_sorted()
            && share.blocks.last().is_none_or(|last| *last < share.block_count)
            && picture.tone.exposure.is_finite()
    }

    /// The name of a file that the picture was made of and that has this hash, in hexadecimal digits. `None` if there is none.
    pub(super) fn input_of_hash(&self, hash: &str) -> Option<&str> {
        let is_it = |one: &&Trait| one.name.starts_with(FILE) && one.value == hash;
        self.identity.iter().find(is_it).map(|one| name_of(&one.name))
    }

    /// The name, as seen from the scene's folder, of a file that the picture was made of or would have been, with which this path
    /// ends. `None` if there is none.
    pub(super) fn input_of_name(&self, path: &Path) -> Option<&str> {
        let files = self.identity.iter().filter(|one| one.name.starts_with(FILE));
        files.map(|one| name_of(&one.name)).find(|name| !name.is_empty() && path.ends_with(name))
    }
}

/// Part of a picture that a file holds.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ShareHead {
    /// From 1.
    pub index: u32,
    /// Number of parts.
    pub count: u32,
    /// Number of blocks of samples in the picture; 0 if parts hold tiles with all their samples.
    pub block_count: u32,
    /// Numbers of the blocks that this part holds of its tiles, in their order.
    pub blocks: Vec<u32>,
}

/// The picture that a part is of.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PictureHead {
    /// Columns of the whole picture.
    pub width: u32,
    /// Rows of it.
    pub height: u32,
    /// Left and top pixel, columns and rows of what is rendered.
    pub crop: [u32; 4],
    /// Whether its noise falls as that of photons.
    pub is_by_photons: bool,
    /// Quantity that it shows: `radiance`, `samples` or `error`.
    pub quantity: String,
    /// Tone mapping.
    pub tone: ToneHead,
    /// Bits per channel of PNG and PPM files: 8 or 16.
    pub bit_depth: u8,
    /// Names and values for the files.
    pub metadata: Vec<(String, String)>,
    /// Whether its numbers are light.
    pub is_light: bool,
}

/// Tone mapping.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ToneHead {
    /// Exposure in stops.
    pub exposure: f32,
    /// Name of the curve.
    pub curve: String,
    /// Whether numbers are display values already.
    pub is_data: bool,
    /// Stretch to the range in view: `distances`, `amounts` or none.
    pub stretch: Option<String>,
}

/// The words for quantities.
const QUANTITIES: [(Quantity, &str); 3] =
    [(Quantity::Radiance, "radiance"), (Quantity::Samples, "samples"), (Quantity::Error, "error")];

/// The words for kinds of stretches.
const STRETCHES: [(DataKind, &str); 2] = [(DataKind::Distances, "distances"), (DataKind::Amounts, "amounts")];

impl PictureHead {
    /// The head of a film's picture that is finished so.
    pub fn new(film: &Film, finish: &Finish) -> Self {
        let Rect { x, y, width, height } = film.crop();
        let tone = &finish.tone;
        let kind = match tone.range_map {
            RangeMap::None => None,
            RangeMap::Unresolved(kind) | RangeMap::Resolved(kind, _) => Some(kind),
        };
        let word = |of: DataKind| STRETCHES.iter().find(|(kind, _)| *kind == of).map(|(_, word)| *word);
        let quantity = QUANTITIES.iter().find(|(quantity, _)| *quantity == finish.quantity);
        Self {
            width: film.width(),
            height: film.height(),
            crop: [x, y, width, height],
            is_by_photons: film.convergence() == Convergence::Photons,
            quantity: quantity.map_or("radiance", |(_, word)| *word).to_owned(),
            tone: ToneHead {
                exposure: tone.exposure_stops,
                curve: tone.curve.name().to_owned(),
                is_data: tone.transfer == Transfer::Identity,
                stretch: kind.and_then(word).map(str::to_owned),
            },
            bit_depth: match finish.bit_depth {
                BitDepth::Eight => 8,
                BitDepth::Sixteen => 16,
            },
            metadata: finish.metadata.clone(),
            is_light: finish.is_light,
        }
    }

    /// The settings that turn the film into a file. `None` if a word in it has no meaning.
    pub fn finish(&self) -> Option<Finish> {
        let range_map = match self.tone.stretch.as_deref() {
            None => RangeMap::None,
            Some(word) => RangeMap::Unresolved(STRETCHES.iter().find(|(_, known)| *known == word)?.0),
        };
        Some(Finish {
            quantity: QUANTITIES.iter().find(|(_, word)| *word == self.quantity)?.0,
            tone: ToneMapping {
                exposure_stops: self.tone.exposure,
                curve: Tonemap::named(&self.tone.curve)?,
                transfer: if self.tone.is_data { Transfer::Identity } else { Transfer::Srgb },
                range_map,
            },
            bit_depth: BitDepth::try_from(self.bit_depth).ok()?,
            metadata: self.metadata.clone(),
            is_light: self.is_light,
        })
    }

    /// An empty film for the picture.
    ///
    /// # Errors
    /// There is no memory for it.
    pub fn film(&self) -> Result<Film, FilmError> {
        let [x, y, width, height] = self.crop;
        let film = Film::new(self.width, self.height, Some(Rect { x, y, width, height }))?;
        Ok(match self.is_by_photons {
            true => film.with_convergence(Convergence::Photons).with_sum_order(SumOrder::Blocked)?,
            false => film,
        })
    }
}

/// Differences between two identities, a phrase for each; `here` and `there` name the two.
pub fn differences(own: &[Trait], other: &[Trait], (here, there): (&str, &str)) -> Vec<String> {
    let value_of =
        |all: &[Trait], name: &str| all.iter().find(|one| one.name == name).map(|one| one.value.clone());
    let shown = |value: Option<String>| value.unwrap_or_else(|| "not there".to_owned());
    let mut names: Vec<&str> = own.iter().map(|one| one.name.as_str()).collect();
    names.extend(other.iter().map(|one| one.name.as_str()).filter(|name| value_of(own, name).is_none()));
    let differing = names.into_iter().filter(|name| value_of(own, name) != value_of(other, name));
    let differing: Vec<&str> = differing.collect();
    let is_named = differing.iter().any(|name| !is_content(name));
    differing
        .iter()
        // The sum of everything says something only where nothing else does.
        .filter(|name| **name != EVERYTHING || differing.len() == 1)
        .filter(|name| !is_named || **name != EVERYTHING)
        .map(|name| match (value_of(own, name), value_of(other, name)) {
            _ if *name == EVERYTHING => {
                "the scene's shapes, materials, lights or camera are others".to_owned()
            }
            (Some(_), Some(_)) if is_content(name) => format!("{} has another content", name_of(name)),
            (own, other) if is_content(name) => {
                let place = if own.is_some() { here } else { there };
                debug_assert!(own.is_some() != other.is_some());
                format!("{} is used {place} only", name_of(name))
            }
            (Some(own), Some(other)) if *name == PROGRAM => {
                format!("glimt {own} rendered it {here} and glimt {other} {there}; use the same build")
            }
            (own, other) => format!("{name} is {} {here} and {} {there}", shown(own), shown(other)),
        })
        .collect()
}

/// Name of the trait that is the program's version and build.
const PROGRAM: &str = "glimt";

/// Name of the trait that stands for all others.
pub(super) const EVERYTHING: &str = "everything";

fn is_content(name: &str) -> bool {
    name.starts_with(FILE) || name == EVERYTHING
}

fn name_of(name: &str) -> &str {
    name.strip_prefix(FILE).unwrap_or(name)
}

/// Before the names of files, whose values are fingerprints.
const FILE: &str = "file ";

impl Trait {
    /// A setting.
    pub fn setting(name: &str, value: impl Into<String>) -> Self {
        Self { name: name.to_owned(), value: value.into() }
    }

    /// A file, by its name and the fingerprint of its content.
    pub fn file(name: &str, content: impl Into<String>) -> Self {
        Self { name: format!("{FILE}{name}"), value: content.into() }
    }

    /// The fingerprint of all that the picture depends on.
    pub fn everything(key: impl Into<String>) -> Self {
        Self { name: EVERYTHING.to_owned(), value: key.into() }
    }
}
