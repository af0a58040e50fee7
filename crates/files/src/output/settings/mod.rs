//! Settings that glimt wrote into a picture, read again: they tell how it was made.

mod gif;
mod text;
mod webp;

use std::fs::File;
use std::io::{BufReader, Cursor, Read};
use std::path::{Path, PathBuf};

use ::exr::meta::MetaData;

use super::part::{Kind, PartFile};
use super::{PROGRAM, SOFTWARE};
use crate::system::describe_error;
use crate::system::file::{self, PART_MARK};

/// Bytes at the start of a file in which its settings are: behind them are pixels.
const START_BYTES: u64 = 4 << 20;
/// Most settings of a file.
const MOST: usize = 200;
/// Start of the names of glimt's own settings.
const OWN: &str = "glimt:";

/// A picture by its header.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Made {
    /// The format in words: "PNG", "part 2 of 8".
    pub format: String,
    /// Columns and rows. `None` if the header does not tell.
    pub size: Option<(u32, u32)>,
    /// Frames of a moving picture.
    pub frames: Option<u32>,
    /// Name and version of the program that wrote it.
    pub program: Option<String>,
    /// Names and values of the settings, in the order of the file.
    pub settings: Vec<(String, String)>,
    /// Names of the channels of an EXR file.
    pub channels: Vec<String>,
}

impl Made {
    /// Whether glimt wrote it, of any version.
    pub fn is_own(&self) -> bool {
        self.program.as_deref().is_some_and(|program| program.split(' ').next() == Some(PROGRAM))
    }

    /// Adds a text of the file.
    fn add(&mut self, name: &str, value: &str) {
        match name {
            "Software" | "SOFTWARE" => self.program = Some(value.to_owned()),
            _ if self.settings.len() < MOST => {
                let name = name.strip_prefix(OWN).unwrap_or(name);
                self.settings.push((name.to_owned(), value.to_owned()));
            }
            _ => {}
        }
    }

    /// Adds a line `name: value`. Other lines are ignored.
    fn add_line(&mut self, line: &str) {
        if let Some((name, value)) = line.split_once(": ") {
            self.add(name.trim(), value.trim());
        }
    }
}

/// Reasons for which it is not known how a file was made.
#[derive(Debug, thiserror::Error)]
pub enum MadeError {
    /// The file cannot be read.
    #[error("cannot read {}: {why}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The reason.
        why: String,
    },
    /// The header of the picture cannot be read.
    #[error("{}: {why}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// The reason.
        why: String,
    },
    /// The file is no picture that carries settings.
    #[error(
        "{}: it is no picture that carries settings: png, apng, gif, exr, hdr, jpg, ppm, webp, nor a part or a checkpoint",
        path.display()
    )]
    NoPicture {
        /// The file.
        path: PathBuf,
    },
}

/// Returns how a file was made: a picture of any format that glimt writes, a part or a checkpoint.
///
/// # Errors
/// [`MadeError`].
pub fn made(path: &Path) -> Result<Made, MadeError> {
    let unreadable = |why: String| MadeError::Unreadable { path: path.to_owned(), why };
    let (opened, _) = match file::open(path) {
        Ok(Ok(found)) => found,
        Ok(Err(kind)) => return Err(unreadable(format!("it is {}, not a file", kind.words()))),
        Err(error) => return Err(unreadable(describe_error(&error))),
    };
    let start = start(&opened).map_err(|error| unreadable(describe_error(&error)))?;
    if start.starts_with(&PART_MARK) {
        // Do not need two descriptors at once.
        drop(opened);
        return of_part(path).map_err(unreadable);
    }
    // A WebP file has its settings behind the pixels.
    if start.len() as u64 == START_BYTES
        && start.starts_with(b"RIFF")
        && let Some(made) = webp::of_webp(&opened)
    {
        return Ok(made);
    }
    // The frames of a GIF go on to its end.
    if start.len() as u64 == START_BYTES && start.starts_with(b"GIF") {
        let rest = BufReader::new(&opened);
        if let Some(made) = gif::of_gif(start.chain(rest)) {
            return Ok(made);
        }
    }
    of_bytes(&start).map_err(|why| match why {
        Some(why) => MadeError::Damaged { path: path.to_owned(), why },
        None => MadeError::NoPicture { path: path.to_owned() },
    })
}

fn start(file: &File) -> std::io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    file.take(START_BYTES).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// The same by the first bytes of a picture.
///
/// # Errors
/// What is wrong with its header. `None` if no picture that carries settings begins so.
fn of_bytes(bytes: &[u8]) -> Result<Made, Option<String>> {
    let wrong = |format: &str| Some(format!("its {format} header is damaged or cut short"));
    match bytes {
        [0x89, b'P', b'N', b'G', ..] => of_png(bytes).ok_or_else(|| wrong("PNG")),
        [0x76, 0x2f, 0x31, 0x01, ..] => of_exr(bytes).ok_or_else(|| wrong("EXR")),
        [b'#', b'?', ..] => text::of_hdr(bytes).ok_or_else(|| wrong("HDR")),
        [b'P', b'6', ..] => text::of_ppm(bytes).ok_or_else(|| wrong("PPM")),
        [0xff, 0xd8, ..] => text::of_jpeg(bytes).ok_or_else(|| wrong("JPEG")),
        [b'R', b'I', b'F', b'F', ..] => webp::of_webp(Cursor::new(bytes)).ok_or_else(|| wrong("WebP")),
        [b'G', b'I', b'F', ..] => gif::of_gif(bytes).ok_or_else(|| wrong("GIF")),
        _ => Err(None),
    }
}

fn of_png(bytes: &[u8]) -> Option<Made> {
    let limits = ::png::Limits { bytes: START_BYTES as usize };
    let mut decoder = ::png::Decoder::new_with_limits(Cursor::new(bytes), limits);
    decoder.set_ignore_iccp_chunk(true);
    let info = decoder.read_header_info().ok()?;
    let (width, height, bits) = (info.width, info.height, info.bit_depth as u8);
    let mut made = Made { size: Some((width, height)), ..Made::default() };
    let reader = decoder.read_info().ok()?;
    let info = reader.info();
    made.frames = info.animation_control.map(|control| control.num_frames);
    made.format = match made.frames {
        Some(_) => "APNG".to_owned(),
        None => format!("PNG, {bits} bits a channel"),
    };
    for text in &info.uncompressed_latin1_text {
        made.add(&text.keyword, &text.text);
    }
    for text in &info.utf8_text {
        made.add(&text.keyword, &text.get_text().unwrap_or_default());
    }
    Some(made)
}

fn of_exr(bytes: &[u8]) -> Option<Made> {
    let meta = MetaData::read_from_buffered(BufReader::new(Cursor::new(bytes)), false).ok()?;
    let header = meta.headers.first()?;
    let size =
        (u32::try_from(header.layer_size.width()).ok()?, u32::try_from(header.layer_size.height()).ok()?);
    let channels = header.channels.list.iter().map(|channel| channel.name.to_string()).collect();
    let mut made = Made { format: "EXR".to_owned(), size: Some(size), channels, ..Made::default() };
    made.program = header.own_attributes.software_name.as_ref().map(ToString::to_string);
    if let Some(comments) = &header.own_attributes.comments {
        // As UTF-8: the texts of the library are bytes.
        let comments: Vec<u8> = comments.as_slice().to_vec();
        String::from_utf8_lossy(&comments).lines().for_each(|line| made.add_line(line));
    }
    Some(made)
}

fn of_part(path: &Path) -> Result<Made, String> {
    let head = PartFile::head(path).map_err(|error| error.to_string())?;
    let format = match head.kind {
        Kind::Part => format!("part {} of {}", head.share.index, head.share.count),
        Kind::Checkpoint => "checkpoint".to_owned(),
    };
    let mut made = Made { format, size: Some((head.picture.width, head.picture.height)), ..Made::default() };
    for one in &head.identity {
        match one.name.as_str() {
            PROGRAM => made.program = Some(format!("{PROGRAM} {}", one.value)),
            name => made.add(name, &one.value),
        }
    }
    // A head without the version is of this one: others are not read.
    made.program.get_or_insert_with(|| SOFTWARE.to_owned());
    Ok(made)
}

#[cfg(test)]
mod tests;
