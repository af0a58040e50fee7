//! Writing a part: tile after tile, so that no more than a tile is in memory beside the film.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;
use std::sync::mpsc::{self, SyncSender};

use serde_json::Value;

use super::super::OutputError;
use super::super::write::{Durability, Guard, atomic_by};
use super::{Digest, END, End, Head, MARK, VERSION, digest};
use crate::control::CancelToken;
use crate::film::Film;

/// Writes a film with its head, as a whole or not at all. `state` is what the render needs to go on. Other threads may add to the
/// film: each tile is written as it is at a moment of its own. Returns the file, as [`atomic_by`] does.
///
/// # Errors
/// Those of writing.
pub fn save(
    path: &Path,
    head: &Head,
    film: &Film,
    state: &Value,
    guard: &Guard<'_>,
    (token, durability): (&CancelToken, Durability),
) -> Result<Option<File>, OutputError> {
    atomic_by(path, &|file| write(file, head, film, state, token), guard, (token, durability))
}

/// Bytes that are put together before they are written.
const TOGETHER: usize = 1 << 20;

/// Makes the bytes on a thread of their own while this one writes those before them.
fn write(
    file: &mut dyn Write,
    head: &Head,
    film: &Film,
    state: &Value,
    token: &CancelToken,
) -> io::Result<()> {
    let (sender, chunks) = mpsc::sync_channel(4);
    std::thread::scope(|scope| {
        let named = std::thread::Builder::new().name("glimt-part".to_owned());
        let make_chunks = move || {
            make(&mut Chunks { sender, bytes: Vec::with_capacity(TOGETHER) }, head, film, state, token)
        };
        let Ok(making) = named.spawn_scoped(scope, make_chunks) else {
            // Without a thread it takes longer, but hours of work are not lost.
            return make(&mut BufWriter::with_capacity(TOGETHER, file), head, film, state, token);
        };
        // If this fails, nobody takes further bytes, and the other thread ends.
        for chunk in chunks {
            file.write_all(&chunk)?;
        }
        making.join().map_err(|_| io::Error::other("the thread that makes the bytes gave up"))?
    })
}

/// Collects bytes and hands them to the thread that writes.
struct Chunks {
    sender: SyncSender<Vec<u8>>,
    bytes: Vec<u8>,
}

impl Write for Chunks {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.bytes.extend_from_slice(bytes);
        if self.bytes.len() >= TOGETHER {
            self.flush()?;
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        let chunk = std::mem::replace(&mut self.bytes, Vec::with_capacity(TOGETHER));
        self.sender.send(chunk).map_err(|_| io::ErrorKind::BrokenPipe.into())
    }
}

fn make(
    file: &mut impl Write,
    head: &Head,
    film: &Film,
    state: &Value,
    token: &CancelToken,
) -> io::Result<()> {
    // The head, with its digest.
    let text = serde_json::to_vec(head)?;
    let length = (text.len() as u32).to_le_bytes();
    let start = [&MARK[..], &VERSION.to_le_bytes(), &length, &text].concat();
    let of_head = digest(&Digest::default(), &[&start]);
    file.write_all(&start)?;
    file.write_all(&of_head)?;
    // The tiles.
    let (mut tiles, mut records, mut bytes) = (0, blake3::Hasher::new(), Vec::new());
    for tile in 0..film.tile_count() {
        token.check().map_err(io::Error::other)?;
        bytes.clear();
        if film.store(tile, &mut bytes) {
            records.update(&record(file, &of_head, tile as u32, &bytes)?);
            tiles += 1;
        }
    }
    // The end.
    let records = records.finalize().to_hex().to_string();
    let end = End { tiles, non_finite: film.non_finite_samples(), records, state: state.clone() };
    record(file, &of_head, END, &serde_json::to_vec(&end)?)?;
    file.flush()
}

/// Writes a record; returns its digest.
fn record(file: &mut impl Write, of_head: &Digest, number: u32, bytes: &[u8]) -> io::Result<Digest> {
    let length = u32::try_from(bytes.len()).map_err(io::Error::other)?;
    let start = [number.to_le_bytes(), length.to_le_bytes()].concat();
    let digest = digest(of_head, &[&start, bytes]);
    file.write_all(&start)?;
    file.write_all(bytes)?;
    file.write_all(&digest)?;
    Ok(digest)
}
