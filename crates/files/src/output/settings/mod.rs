//! Reads the settings that glimt wrote to an image.

mod gif;
mod text;
mod webp;

use std::fs::File;
use std::io::{BufReader, Cursor, Read};
use std::path::{Path, PathBuf};

use ::exr::meta::MetaData;

use super::part::{PartFile, PartFileKind};
use super::{PROGRAM, SOFTWARE};
use crate::system::describe_io_error;
use crate::system::file::{self, PART_MAGIC};

/// Number of bytes to search for settings at the start of a file.
const START_BYTES: u64 = 4 << 20;
/// Maximum number of settings.
const MAX_SETTINGS: usize = 200;
/// Name prefix for glimt's own settings.
const PREFIX: &str = "glimt:";

/// Properties of an image file, read from its header.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ImageFileInfo {
    /// Description of the format: "PNG", "part 2 of 8".
    pub format: String,
    /// Width and height. `None` if the header does not contain them.
    pub size: Option<(u32, u32)>,
    /// Number of frames in an animation.
    pub frames: Option<u32>,
    /// Name and version of the program that wrote the file.
    pub program: Option<String>,
    /// Names and values of the settings, in file order.
    pub settings: Vec<(String, String)>,
    /// Channel names in an EXR file.
    pub channels: Vec<String>,
}

impl ImageFileInfo {
    /// Whether any version of glimt wrote the file.
    pub fn is_written_by_glimt(&self) -> bool {
        self.program.as_deref().is_some_and(|program| program.split(' ').next() == Some(PROGRAM))
    }

    /// Adds a metadata entry.
    fn add_entry(&mut self, name: &str, value: &str) {
        match name {
            "Software" | "SOFTWARE" => self.program = Some(value.to_owned()),
            _ if self.settings.len() < MAX_SETTINGS => {
                let name = name.strip_prefix(PREFIX).unwrap_or(name);
                self.settings.push((name.to_owned(), value.to_owned()));
            }
            _ => {}
        }
    }

    /// Adds a line of the form `name: value`. Ignores all other lines.
    fn add_name_value_line(&mut self, line: &str) {
        if let Some((name, value)) = line.split_once(": ") {
            self.add_entry(name.trim(), value.trim());
        }
    }
}

/// Reason why a file's settings cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum ImageInfoReadError {
    /// The file cannot be read.
    #[error("cannot read {}: {why}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The reason.
        why: String,
    },
    /// The header of the image cannot be read.
    #[error("{}: {why}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// The reason.
        why: String,
    },
    /// The file is not an image that can store settings.
    #[error(
        "{}: not a part, a checkpoint, or an image that can store settings (png, apng, gif, exr, hdr, jpg, ppm, webp)",
        path.display()
    )]
    NotAnImage {
        /// The file.
        path: PathBuf,
    },
}

/// Reads the properties of a part, a checkpoint, or an image in any format that glimt can write.
///
/// # Errors
/// [`ImageInfoReadError`].
pub fn read_image_info(path: &Path) -> Result<ImageFileInfo, ImageInfoReadError> {
    let unreadable = |why: String| ImageInfoReadError::Unreadable { path: path.to_owned(), why };
    let (opened, _) = match file::open_regular_file(path) {
        Ok(Ok(found)) => found,
        Ok(Err(kind)) => return Err(unreadable(format!("it is {}, not a regular file", kind.description()))),
        Err(error) => return Err(unreadable(describe_io_error(&error))),
    };
    let start = read_start(&opened).map_err(|error| unreadable(describe_io_error(&error)))?;
    if start.starts_with(&PART_MAGIC) {
        // `read_part_file_info` opens the file again. Use only one descriptor at a time.
        drop(opened);
        return read_part_file_info(path).map_err(unreadable);
    }
    // WebP stores metadata after the pixels.
    if start.len() as u64 == START_BYTES
        && start.starts_with(b"RIFF")
        && let Some(info) = webp::read_webp_info(&opened)
    {
        return Ok(info);
    }
    // GIF frames extend to the end of the file.
    if start.len() as u64 == START_BYTES && start.starts_with(b"GIF") {
        let rest = BufReader::new(&opened);
        if let Some(info) = gif::read_gif_info(start.chain(rest)) {
            return Ok(info);
        }
    }
    read_info_from_start(&start).map_err(|why| match why {
        Some(why) => ImageInfoReadError::Damaged { path: path.to_owned(), why },
        None => ImageInfoReadError::NotAnImage { path: path.to_owned() },
    })
}

fn read_start(file: &File) -> std::io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    file.take(START_BYTES).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// Reads the properties of an image from its first bytes.
///
/// # Errors
/// A description of the damage to the header, or `None` if the file has another format.
fn read_info_from_start(bytes: &[u8]) -> Result<ImageFileInfo, Option<String>> {
    let wrong = |format: &str| Some(format!("the {format} header is damaged or truncated"));
    match bytes {
        [0x89, b'P', b'N', b'G', ..] => read_png_info(bytes).ok_or_else(|| wrong("PNG")),
        [0x76, 0x2f, 0x31, 0x01, ..] => read_exr_info(bytes).ok_or_else(|| wrong("EXR")),
        [b'#', b'?', ..] => text::read_hdr_info(bytes).ok_or_else(|| wrong("HDR")),
        [b'P', b'6', ..] => text::read_ppm_info(bytes).ok_or_else(|| wrong("PPM")),
        [0xff, 0xd8, ..] => text::read_jpeg_info(bytes).ok_or_else(|| wrong("JPEG")),
        [b'R', b'I', b'F', b'F', ..] => webp::read_webp_info(Cursor::new(bytes)).ok_or_else(|| wrong("WebP")),
        [b'G', b'I', b'F', ..] => gif::read_gif_info(bytes).ok_or_else(|| wrong("GIF")),
        _ => Err(None),
    }
}

fn read_png_info(bytes: &[u8]) -> Option<ImageFileInfo> {
    let limits = ::png::Limits { bytes: START_BYTES as usize };
    let mut decoder = ::png::Decoder::new_with_limits(Cursor::new(bytes), limits);
    decoder.set_ignore_iccp_chunk(true);
    let header = decoder.read_header_info().ok()?;
    let (width, height, bits) = (header.width, header.height, header.bit_depth as u8);
    let mut info = ImageFileInfo { size: Some((width, height)), ..ImageFileInfo::default() };
    let reader = decoder.read_info().ok()?;
    let header = reader.info();
    info.frames = header.animation_control.map(|control| control.num_frames);
    info.format = match info.frames {
        Some(_) => "APNG".to_owned(),
        None => format!("PNG, {bits} bits per channel"),
    };
    for text in &header.uncompressed_latin1_text {
        info.add_entry(&text.keyword, &text.text);
    }
    for text in &header.utf8_text {
        info.add_entry(&text.keyword, &text.get_text().unwrap_or_default());
    }
    Some(info)
}

fn read_exr_info(bytes: &[u8]) -> Option<ImageFileInfo> {
    let meta = MetaData::read_from_buffered(BufReader::new(Cursor::new(bytes)), false).ok()?;
    let header = meta.headers.first()?;
    let size =
        (u32::try_from(header.layer_size.width()).ok()?, u32::try_from(header.layer_size.height()).ok()?);
    let channels = header.channels.list.iter().map(|channel| channel.name.to_string()).collect();
    let mut info =
        ImageFileInfo { format: "EXR".to_owned(), size: Some(size), channels, ..ImageFileInfo::default() };
    info.program = header.own_attributes.software_name.as_ref().map(ToString::to_string);
    if let Some(comments) = &header.own_attributes.comments {
        // The library stores text as bytes. Decode it as UTF-8.
        let comments: Vec<u8> = comments.as_slice().to_vec();
        String::from_utf8_lossy(&comments).lines().for_each(|line| info.add_name_value_line(line));
    }
    Some(info)
}

fn read_part_file_info(path: &Path) -> Result<ImageFileInfo, String> {
    let head = PartFile::read_header(path).map_err(|error| error.to_string())?;
    let format = match head.kind {
        PartFileKind::Part => format!("part {} of {}", head.share.index, head.share.count),
        PartFileKind::Checkpoint => "checkpoint".to_owned(),
    };
    let mut info = ImageFileInfo {
        format,
        size: Some((head.picture.width, head.picture.height)),
        ..ImageFileInfo::default()
    };
    for input in &head.identity {
        match input.name.as_str() {
            PROGRAM => info.program = Some(format!("{PROGRAM} {}", input.value)),
            name => info.add_entry(name, &input.value),
        }
    }
    // If the version is missing, assume this version, because files from other versions are rejected.
    info.program.get_or_insert_with(|| SOFTWARE.to_owned());
    Ok(info)
}

#[cfg(test)]
mod tests;
