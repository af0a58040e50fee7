//! Reading a part: all of it once, to see that it is whole; then single tiles.

use std::fs::File;
use std::io::{self, BufReader, ErrorKind, Read};
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

use nix::sys::resource::{Resource, getrlimit, setrlimit};

use super::head::{Head, Kind};
use super::{Digest, END, End, MARK, PartError, VERSION, digest};
use crate::control::CancelToken;
use crate::film::{Film, StoredTile};

/// A part or a checkpoint on disk, found to be whole.
#[derive(Debug)]
pub struct PartFile {
    /// Its name.
    pub path: PathBuf,
    /// Its head.
    pub head: Head,
    /// State of the render that made it.
    pub state: serde_json::Value,
    /// Samples that were not finite.
    pub non_finite: u64,
    file: File,
    of_head: Digest,
    /// Number, place and length of each tile, by number.
    pub(super) tiles: Vec<(u32, u64, u32)>,
}

/// Whether a file begins as a part or a checkpoint does.
pub fn is_part(path: &Path) -> bool {
    let mut mark = [0; MARK.len()];
    open(path).and_then(|mut file| file.read_exact(&mut mark)).is_ok() && mark == MARK
}

/// The name of the file that one of these pictures was made of and whose content a file on disk has. `None` if there is none, or the
/// file cannot be read: an image must not be written in its place, wherever the parts were rendered.
pub fn input_in_place_of<'a>(parts: &'a [PartFile], path: &Path) -> Option<&'a str> {
    let mut hasher = blake3::Hasher::new();
    hasher.update_reader(open(path).ok()?).ok()?;
    let hash = hasher.finalize().to_hex();
    parts.iter().find_map(|part| part.head.input_of_hash(&hash))
}

/// The name of a file that one of these pictures was made of, if a path ends with it: a file that was missing then, or has changed
/// since, has another content.
pub fn input_of_that_name<'a>(parts: &'a [PartFile], path: &Path) -> Option<&'a str> {
    let whole = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    let real = path.canonicalize().unwrap_or_else(|_| whole.clone());
    parts.iter().find_map(|part| [&whole, &real].into_iter().find_map(|path| part.head.input_of_name(path)))
}

impl PartFile {
    /// Opens a file and reads all of it.
    ///
    /// # Errors
    /// It cannot be read, is something else, is of another version, ends too early, or is damaged; cancelled.
    pub fn open(path: &Path, token: &CancelToken) -> Result<Self, PartError> {
        let unreadable = |source| PartError::Unreadable { path: path.to_owned(), source };
        let file = open(path).map_err(unreadable)?;
        let size = file.metadata().map_err(unreadable)?.len();
        let mut reader = Reader { path, file: BufReader::with_capacity(1 << 20, &file), at: 0, size };
        let (head, of_head) = reader.head()?;
        // The tiles, up to the end.
        let (mut tiles, mut records) = (Vec::<(u32, u64, u32)>::new(), blake3::Hasher::new());
        let mut bytes = Vec::new();
        let end = loop {
            token.check()?;
            let (number, place, digest) = reader.record(&of_head, &mut bytes)?;
            if number == END {
                break serde_json::from_slice::<End>(&bytes);
            }
            if tiles.last().is_some_and(|(last, ..)| *last >= number) {
                return Err(reader.damaged("its tiles are out of order"));
            }
            records.update(&digest);
            tiles.push((number, place, bytes.len() as u32));
        };
        let end = end.map_err(|_| reader.damaged("its end makes no sense"))?;
        let is_whole = end.tiles == tiles.len() as u64 && end.records == records.finalize().to_hex().as_str();
        if !is_whole {
            return Err(reader.damaged("some of its tiles are missing"));
        }
        if reader.at != size {
            return Err(reader.damaged(&format!("{} bytes follow its end", size - reader.at)));
        }
        let End { non_finite, state, .. } = end;
        Ok(Self { path: path.to_owned(), head, state, non_finite, file, of_head, tiles })
    }

    /// The head of a file alone, without a look at the rest.
    ///
    /// # Errors
    /// As [`Self::open`].
    pub fn head(path: &Path) -> Result<Head, PartError> {
        let unreadable = |source| PartError::Unreadable { path: path.to_owned(), source };
        let file = open(path).map_err(unreadable)?;
        let size = file.metadata().map_err(unreadable)?.len();
        Reader { path, file: BufReader::new(&file), at: 0, size }.head().map(|(head, _)| head)
    }

    /// Fails if it is of another kind.
    ///
    /// # Errors
    /// [`PartError::Kind`].
    pub fn check_kind(&self, wanted: Kind) -> Result<(), PartError> {
        let found = self.head.kind;
        if found == wanted {
            return Ok(());
        }
        Err(PartError::Kind { path: self.path.clone(), found: found.name(), wanted: wanted.name() })
    }

    /// Numbers of the tiles that it has.
    pub fn tiles(&self) -> impl Iterator<Item = usize> {
        self.tiles.iter().map(|(number, ..)| *number as usize)
    }

    /// One of its tiles, of so many pixels. `None` if it does not have it.
    ///
    /// # Errors
    /// The file is not what it was when it was opened.
    pub fn tile(&self, tile: usize, area: usize) -> Result<Option<StoredTile>, PartError> {
        let Ok(index) = self.tiles.binary_search_by_key(&tile, |(number, ..)| *number as usize) else {
            return Ok(None);
        };
        let (number, place, length) = self.tiles[index];
        let damaged = |why: &str| PartError::Damaged { path: self.path.clone(), why: why.to_owned() };
        let mut bytes = vec![0; length as usize + size_of::<Digest>()];
        let read = self.file.read_exact_at(&mut bytes, place);
        read.map_err(|source| PartError::Unreadable { path: self.path.clone(), source })?;
        let (bytes, found) = bytes.split_at(length as usize);
        let start = [number.to_le_bytes(), length.to_le_bytes()].concat();
        if digest(&self.of_head, &[&start, bytes]) != found {
            return Err(damaged(&format!("tile {number} changed while it was read")));
        }
        let read = StoredTile::read(bytes, area);
        read.map(Some).map_err(|_| damaged(&format!("tile {number} is none of this picture")))
    }

    /// Puts all its tiles into a film of the same picture.
    ///
    /// # Errors
    /// They are not tiles of the film.
    pub fn restore(&self, film: &Film) -> Result<(), PartError> {
        for tile in self.tiles() {
            let why = || format!("tile {tile} is none of this picture");
            let damaged = || PartError::Damaged { path: self.path.clone(), why: why() };
            let area = film.tile_rect(tile).ok_or_else(damaged)?.area();
            if let Some(stored) = self.tile(tile, area)? {
                film.restore(tile, stored).map_err(|_| damaged())?;
            }
        }
        film.add_non_finite(self.non_finite);
        Ok(())
    }
}

/// Opens a regular file. Where too many are open, the process may have more of them.
fn open(path: &Path) -> io::Result<File> {
    // A pipe or a device has no end.
    if !std::fs::metadata(path)?.is_file() {
        return Err(io::Error::new(ErrorKind::InvalidInput, "this is no file"));
    }
    match File::open(path) {
        Err(error) if error.raw_os_error() == Some(nix::errno::Errno::EMFILE as i32) => {
            let (_, most) = getrlimit(Resource::RLIMIT_NOFILE)?;
            setrlimit(Resource::RLIMIT_NOFILE, most, most)?;
            File::open(path)
        }
        opened => opened,
    }
}

/// A file from its beginning.
struct Reader<'a> {
    path: &'a Path,
    file: BufReader<&'a File>,
    at: u64,
    size: u64,
}

impl Reader<'_> {
    fn damaged(&self, why: &str) -> PartError {
        PartError::Damaged { path: self.path.to_owned(), why: why.to_owned() }
    }

    fn unfinished(&self) -> PartError {
        PartError::Unfinished { path: self.path.to_owned(), bytes: self.size }
    }

    /// Fills some bytes.
    fn fill(&mut self, bytes: &mut [u8]) -> Result<(), PartError> {
        match self.file.read_exact(bytes) {
            Ok(()) => {
                self.at += bytes.len() as u64;
                Ok(())
            }
            Err(error) if error.kind() == ErrorKind::UnexpectedEof => Err(self.unfinished()),
            Err(source) => Err(PartError::Unreadable { path: self.path.to_owned(), source }),
        }
    }

    fn word(&mut self) -> Result<u32, PartError> {
        let mut bytes = [0; 4];
        self.fill(&mut bytes)?;
        Ok(u32::from_le_bytes(bytes))
    }

    /// Reads as many bytes as a number in the file says; reserves none beyond the end of the file.
    fn bytes(&mut self, length: u32, into: &mut Vec<u8>) -> Result<(), PartError> {
        if u64::from(length) > self.size - self.at {
            return Err(self.unfinished());
        }
        into.resize(length as usize, 0);
        self.fill(into)
    }

    fn head(&mut self) -> Result<(Head, Digest), PartError> {
        let mut mark = Vec::new();
        self.bytes(self.size.min(MARK.len() as u64) as u32, &mut mark)?;
        match mark.len() < MARK.len() {
            true if MARK.starts_with(&mark) => return Err(self.unfinished()),
            false if mark == MARK => {}
            true | false => return Err(PartError::Foreign { path: self.path.to_owned() }),
        }
        let version = self.word()?;
        if version != VERSION {
            return Err(PartError::Version { path: self.path.to_owned(), found: version, known: VERSION });
        }
        let length = self.word()?;
        let mut text = Vec::new();
        self.bytes(length, &mut text)?;
        let start = [&MARK[..], &version.to_le_bytes(), &length.to_le_bytes(), &text].concat();
        let mut found = Digest::default();
        self.fill(&mut found)?;
        if digest(&Digest::default(), &[&start]) != found {
            return Err(self.damaged("its head is not what was written"));
        }
        let head: Head =
            serde_json::from_slice(&text).map_err(|_| self.damaged("its head makes no sense"))?;
        if !head.is_possible() {
            return Err(self.damaged("its head has impossible numbers"));
        }
        Ok((head, found))
    }

    /// The next record: its number, the place of its bytes, and its digest.
    fn record(&mut self, of_head: &Digest, bytes: &mut Vec<u8>) -> Result<(u32, u64, Digest), PartError> {
        let begin = self.at;
        let (number, length) = (self.word()?, self.word()?);
        let place = self.at;
        self.bytes(length, bytes)?;
        let mut found = Digest::default();
        self.fill(&mut found)?;
        let start = [number.to_le_bytes(), length.to_le_bytes()].concat();
        if digest(of_head, &[&start, bytes]) != found {
            return Err(
                self.damaged(&format!("the bytes from {begin} to {} are not what was written", self.at))
            );
        }
        Ok((number, place, found))
    }
}
