//! Reads part files. The entire file is validated first, then tiles are read one at a time.

use std::fs::File;
use std::io::{self, BufReader, ErrorKind, Read};
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

use nix::sys::resource::{Resource, getrlimit, setrlimit};

use super::head::{PartFileKind, PartHeader};
use super::{Digest, FOOTER, Footer, MAGIC, PartError, VERSION, digest};
use crate::control::CancelToken;
use crate::film::{Film, StoredTile};
use crate::system::file;

/// A validated part or checkpoint on disk.
#[derive(Debug)]
pub struct PartFile {
    /// Path of the file.
    pub path: PathBuf,
    /// Header.
    pub head: PartHeader,
    /// State of the render that wrote the file.
    pub state: serde_json::Value,
    /// Number of nonfinite samples.
    pub non_finite: u64,
    file: File,
    header_digest: Digest,
    /// Index, file offset and length of each tile, sorted by index.
    pub(super) tiles: Vec<(u32, u64, u32)>,
}

/// Error message for a header with invalid values.
pub(super) const IMPOSSIBLE_HEADER: &str = "the header has invalid values";

/// Whether a file has the magic number of parts and checkpoints.
pub fn is_part_or_checkpoint(path: &Path) -> bool {
    let mut mark = [0; MAGIC.len()];
    open_raising_file_limit(path).is_ok_and(|mut file| file.read_exact(&mut mark).is_ok()) && mark == MAGIC
}

/// Returns the name of the input file that has the same content as the file at `path`, or `None` if there is
/// no such input or the file cannot be read. Input files must not be overwritten, even if the parts were
/// rendered on another machine.
pub fn find_render_input_by_content<'a>(parts: &'a [PartFile], path: &Path) -> Option<&'a str> {
    let mut hasher = blake3::Hasher::new();
    hasher.update_reader(open_raising_file_limit(path).ok()?).ok()?;
    let hash = hasher.finalize().to_hex();
    parts.iter().find_map(|part| part.head.input_name_by_hash(&hash))
}

/// Returns the name of an input file that matches the end of `path`. Unlike a comparison of contents, this
/// also finds files that were missing or have since changed.
pub fn find_input_that_is_path_suffix<'a>(parts: &'a [PartFile], path: &Path) -> Option<&'a str> {
    let absolute = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    let real = path.canonicalize().unwrap_or_else(|_| absolute.clone());
    parts.iter().find_map(|part| {
        [&absolute, &real].into_iter().find_map(|path| part.head.find_input_that_is_path_suffix(path))
    })
}

impl PartFile {
    /// Opens and validates a file.
    ///
    /// # Errors
    /// The file is unreadable, not a part, from another version, truncated or damaged, or the work is
    /// canceled.
    pub fn open_and_validate(path: &Path, token: &CancelToken) -> Result<Self, PartError> {
        let unreadable = |source| PartError::Unreadable { path: path.to_owned(), source };
        let file = open_raising_file_limit(path)?;
        let size = file.metadata().map_err(unreadable)?.len();
        let mut reader = PartReader { path, file: BufReader::with_capacity(1 << 20, &file), at: 0, size };
        let (head, header_digest) = reader.read_header()?;
        // Read the tiles up to the footer.
        let (mut tiles, mut records) = (Vec::<(u32, u64, u32)>::new(), blake3::Hasher::new());
        let mut bytes = Vec::new();
        let end = loop {
            token.check_pause_and_cancel()?;
            let (number, offset, digest) = reader.read_record(&header_digest, &mut bytes)?;
            if number == FOOTER {
                break serde_json::from_slice::<Footer>(&bytes);
            }
            if tiles.last().is_some_and(|(last, ..)| *last >= number) {
                return Err(reader.damaged_error("the tiles are out of order"));
            }
            records.update(&digest);
            tiles.push((number, offset, bytes.len() as u32));
        };
        let end = end.map_err(|_| reader.damaged_error("the footer is malformed"))?;
        let is_complete =
            end.tiles == tiles.len() as u64 && end.records == records.finalize().to_hex().as_str();
        if !is_complete {
            return Err(reader.damaged_error("some tiles are missing"));
        }
        if reader.at != size {
            return Err(reader.damaged_error(&format!("{} bytes follow the footer", size - reader.at)));
        }
        let Footer { non_finite, state, .. } = end;
        Ok(Self { path: path.to_owned(), head, state, non_finite, file, header_digest, tiles })
    }

    /// Reads only the header of a file, without validating the rest.
    ///
    /// # Errors
    /// Same as [`Self::open_and_validate`].
    pub fn read_header(path: &Path) -> Result<PartHeader, PartError> {
        let unreadable = |source| PartError::Unreadable { path: path.to_owned(), source };
        let file = open_raising_file_limit(path)?;
        let size = file.metadata().map_err(unreadable)?.len();
        PartReader { path, file: BufReader::new(&file), at: 0, size }.read_header().map(|(head, _)| head)
    }

    /// Checks the type of the file.
    ///
    /// # Errors
    /// [`PartError::Kind`].
    pub fn check_kind(&self, wanted: PartFileKind) -> Result<(), PartError> {
        let found = self.head.kind;
        if found == wanted {
            return Ok(());
        }
        Err(PartError::Kind { path: self.path.clone(), found: found.name(), wanted: wanted.name() })
    }

    /// Indices of the tiles in the file.
    pub fn tile_indices(&self) -> impl Iterator<Item = usize> {
        self.tiles.iter().map(|(number, ..)| *number as usize)
    }

    /// Reads a tile with `area` pixels. Returns `None` if the file does not contain the tile.
    ///
    /// # Errors
    /// The file has changed since it was opened.
    pub fn read_tile(&self, tile: usize, area: usize) -> Result<Option<StoredTile>, PartError> {
        let Ok(index) = self.tiles.binary_search_by_key(&tile, |(number, ..)| *number as usize) else {
            return Ok(None);
        };
        let (number, offset, length) = self.tiles[index];
        let damaged = |why: &str| PartError::Damaged { path: self.path.clone(), why: why.to_owned() };
        let mut bytes = vec![0; length as usize + size_of::<Digest>()];
        let read = self.file.read_exact_at(&mut bytes, offset);
        read.map_err(|source| PartError::Unreadable { path: self.path.clone(), source })?;
        let (bytes, found) = bytes.split_at(length as usize);
        let start = [number.to_le_bytes(), length.to_le_bytes()].concat();
        if digest(&self.header_digest, &[&start, bytes]) != found {
            return Err(damaged(&format!("tile {number} changed while it was read")));
        }
        let read = StoredTile::deserialize(bytes, area);
        read.map(Some).map_err(|_| damaged(&format!("tile {number} does not belong to this image")))
    }

    /// Adds all tiles to a film for the same image.
    ///
    /// # Errors
    /// The tiles do not belong to the film.
    pub fn restore_into_film(&self, film: &Film) -> Result<(), PartError> {
        for tile in self.tile_indices() {
            let why = || format!("tile {tile} does not belong to this image");
            let damaged = || PartError::Damaged { path: self.path.clone(), why: why() };
            let area = film.tile_rect(tile).ok_or_else(damaged)?.area();
            if let Some(stored) = self.read_tile(tile, area)? {
                film.restore_tile(tile, stored).map_err(|_| damaged())?;
            }
        }
        film.add_non_finite_count(self.non_finite);
        Ok(())
    }
}

/// Opens a regular file. If the process has reached its limit on open files, raises the limit and tries
/// again.
fn open_raising_file_limit(path: &Path) -> Result<File, PartError> {
    let opened = match file::open_regular_file(path) {
        Err(error) if error.raw_os_error() == Some(nix::errno::Errno::EMFILE as i32) => {
            raise_file_limit().and_then(|()| file::open_regular_file(path))
        }
        opened => opened,
    };
    let found = opened.map_err(|source| PartError::Unreadable { path: path.to_owned(), source })?;
    found.map(|(file, _)| file).map_err(|kind| PartError::NotRegular { path: path.to_owned(), kind })
}

/// Raises the limit on open files to its maximum.
fn raise_file_limit() -> io::Result<()> {
    let (_, limit) = getrlimit(Resource::RLIMIT_NOFILE)?;
    Ok(setrlimit(Resource::RLIMIT_NOFILE, limit, limit)?)
}

/// Sequential reader for a part file.
struct PartReader<'a> {
    path: &'a Path,
    file: BufReader<&'a File>,
    at: u64,
    size: u64,
}

impl PartReader<'_> {
    fn damaged_error(&self, why: &str) -> PartError {
        PartError::Damaged { path: self.path.to_owned(), why: why.to_owned() }
    }

    fn unfinished_error(&self) -> PartError {
        PartError::Unfinished { path: self.path.to_owned(), bytes: self.size }
    }

    /// Reads exactly `bytes.len()` bytes.
    fn read_exact(&mut self, bytes: &mut [u8]) -> Result<(), PartError> {
        match self.file.read_exact(bytes) {
            Ok(()) => {
                self.at += bytes.len() as u64;
                Ok(())
            }
            Err(error) if error.kind() == ErrorKind::UnexpectedEof => Err(self.unfinished_error()),
            Err(source) => Err(PartError::Unreadable { path: self.path.to_owned(), source }),
        }
    }

    fn read_u32(&mut self) -> Result<u32, PartError> {
        let mut bytes = [0; 4];
        self.read_exact(&mut bytes)?;
        Ok(u32::from_le_bytes(bytes))
    }

    /// Reads `length` bytes. Fails before allocating memory if the file is too short.
    fn read_n_bytes(&mut self, length: u32, into: &mut Vec<u8>) -> Result<(), PartError> {
        if u64::from(length) > self.size - self.at {
            return Err(self.unfinished_error());
        }
        into.resize(length as usize, 0);
        self.read_exact(into)
    }

    fn read_header(&mut self) -> Result<(PartHeader, Digest), PartError> {
        let mut mark = Vec::new();
        self.read_n_bytes(self.size.min(MAGIC.len() as u64) as u32, &mut mark)?;
        match mark.len() < MAGIC.len() {
            true if MAGIC.starts_with(&mark) => return Err(self.unfinished_error()),
            false if mark == MAGIC => {}
            true | false => return Err(PartError::Foreign { path: self.path.to_owned() }),
        }
        let version = self.read_u32()?;
        if version != VERSION {
            return Err(PartError::Version { path: self.path.to_owned(), found: version, known: VERSION });
        }
        let length = self.read_u32()?;
        let mut text = Vec::new();
        self.read_n_bytes(length, &mut text)?;
        let start = [&MAGIC[..], &version.to_le_bytes(), &length.to_le_bytes(), &text].concat();
        let mut found = Digest::default();
        self.read_exact(&mut found)?;
        if digest(&Digest::default(), &[&start]) != found {
            return Err(self.damaged_error("the header's checksum is wrong"));
        }
        let head: PartHeader =
            serde_json::from_slice(&text).map_err(|_| self.damaged_error("the header is malformed"))?;
        if !head.has_valid_numbers() {
            return Err(self.damaged_error(IMPOSSIBLE_HEADER));
        }
        Ok((head, found))
    }

    /// Reads the next record: its index, the offset of its data, and its digest.
    fn read_record(
        &mut self,
        header_digest: &Digest,
        bytes: &mut Vec<u8>,
    ) -> Result<(u32, u64, Digest), PartError> {
        let begin = self.at;
        let (number, length) = (self.read_u32()?, self.read_u32()?);
        let offset = self.at;
        self.read_n_bytes(length, bytes)?;
        let mut found = Digest::default();
        self.read_exact(&mut found)?;
        let start = [number.to_le_bytes(), length.to_le_bytes()].concat();
        if digest(header_digest, &[&start, bytes]) != found {
            return Err(self.damaged_error(&format!("wrong checksum of bytes {begin} to {}", self.at)));
        }
        Ok((number, offset, found))
    }
}
