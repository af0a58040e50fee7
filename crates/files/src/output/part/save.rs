//! Writes parts tile by tile. Only the film and one encoded tile are in memory.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;
use std::sync::mpsc::{self, SyncSender};

use serde_json::Value;

use super::super::OutputError;
use super::super::write::{Durability, ExistingFilePolicy, write_atomically_from_callback};
use super::{Digest, FOOTER, Footer, MAGIC, PartHeader, VERSION, digest};
use crate::control::CancelToken;
use crate::film::Film;

/// Writes a film with its header atomically. `state` is opaque data for resuming the render. Other threads
/// may keep adding samples to the film. Each tile is written with the samples it has at that moment. Returns
/// the file, like [`write_atomically_from_callback`].
///
/// # Errors
/// The file cannot be written.
pub fn save(
    path: &Path,
    head: &PartHeader,
    film: &Film,
    state: &Value,
    guard: &ExistingFilePolicy<'_>,
    token: &CancelToken,
    durability: Durability,
) -> Result<Option<File>, OutputError> {
    write_atomically_from_callback(
        path,
        &|file| encode_and_write(file, head, film, state, token),
        guard,
        token,
        durability,
    )
}

/// Size of the chunks passed to the writing thread.
const CHUNK_BYTES: usize = 1 << 20;

/// Encodes on a separate thread and writes on the current thread.
fn encode_and_write(
    file: &mut dyn Write,
    head: &PartHeader,
    film: &Film,
    state: &Value,
    token: &CancelToken,
) -> io::Result<()> {
    let (sender, chunks) = mpsc::sync_channel(4);
    std::thread::scope(|scope| {
        let named = std::thread::Builder::new().name("glimt-part".to_owned());
        let make_chunks = move || {
            encode_part(
                &mut ChunkSender { sender, bytes: Vec::with_capacity(CHUNK_BYTES) },
                head,
                film,
                state,
                token,
            )
        };
        let Ok(making) = named.spawn_scoped(scope, make_chunks) else {
            // Encode on this thread. This is slower, but avoids losing hours of work.
            return encode_part(&mut BufWriter::with_capacity(CHUNK_BYTES, file), head, film, state, token);
        };
        // If writing fails, the channel is closed and the encoding thread stops.
        for chunk in chunks {
            file.write_all(&chunk)?;
        }
        making.join().map_err(|_| io::Error::other("the encoding thread panicked"))?
    })
}

/// Collects bytes in chunks and sends them to the writing thread.
struct ChunkSender {
    sender: SyncSender<Vec<u8>>,
    bytes: Vec<u8>,
}

impl Write for ChunkSender {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.bytes.extend_from_slice(bytes);
        if self.bytes.len() >= CHUNK_BYTES {
            self.flush()?;
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        let chunk = std::mem::replace(&mut self.bytes, Vec::with_capacity(CHUNK_BYTES));
        self.sender.send(chunk).map_err(|_| io::ErrorKind::BrokenPipe.into())
    }
}

fn encode_part(
    file: &mut impl Write,
    head: &PartHeader,
    film: &Film,
    state: &Value,
    token: &CancelToken,
) -> io::Result<()> {
    // Write the header and its digest.
    let text = serde_json::to_vec(head)?;
    let length = (text.len() as u32).to_le_bytes();
    let start = [&MAGIC[..], &VERSION.to_le_bytes(), &length, &text].concat();
    let header_digest = digest(&Digest::default(), &[&start]);
    file.write_all(&start)?;
    file.write_all(&header_digest)?;
    // Write the tiles.
    let (mut tiles, mut records, mut bytes) = (0, blake3::Hasher::new(), Vec::new());
    for tile in 0..film.tile_count() {
        token.check_pause_and_cancel().map_err(io::Error::other)?;
        bytes.clear();
        if film.serialize_tile(tile, &mut bytes) {
            records.update(&write_record(file, &header_digest, tile as u32, &bytes)?);
            tiles += 1;
        }
    }
    // Write the footer.
    let records = records.finalize().to_hex().to_string();
    let end = Footer { tiles, non_finite: film.non_finite_samples(), records, state: state.clone() };
    write_record(file, &header_digest, FOOTER, &serde_json::to_vec(&end)?)?;
    file.flush()
}

/// Writes a record and returns its digest.
fn write_record(
    file: &mut impl Write,
    header_digest: &Digest,
    number: u32,
    bytes: &[u8],
) -> io::Result<Digest> {
    let length = u32::try_from(bytes.len()).map_err(io::Error::other)?;
    let start = [number.to_le_bytes(), length.to_le_bytes()].concat();
    let digest = digest(header_digest, &[&start, bytes]);
    file.write_all(&start)?;
    file.write_all(bytes)?;
    file.write_all(&digest)?;
    Ok(digest)
}
