//! Writing a part: tile after tile, so that no more than a tile is in memory beside the film.

use std::io::{self, BufWriter, Write};
use std::path::Path;

use serde_json::Value;

use super::super::OutputError;
use super::super::write::{Durability, Guard, atomic_by};
use super::{Digest, END, End, Head, MARK, VERSION, digest};
use crate::control::CancelToken;
use crate::film::Film;

/// Writes a film with its head, as a whole or not at all. `state` is what the render needs to go on. Other threads may add to the
/// film: each tile is written as it is at a moment of its own.
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
) -> Result<(), OutputError> {
    atomic_by(path, &|file| write(file, head, film, state, token), guard, (token, durability))
}

/// Bytes that are put together before they are written.
const TOGETHER: usize = 1 << 20;

fn write(
    file: &mut dyn Write,
    head: &Head,
    film: &Film,
    state: &Value,
    token: &CancelToken,
) -> io::Result<()> {
    let mut file = BufWriter::with_capacity(TOGETHER, file);
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
            records.update(&record(&mut file, &of_head, tile as u32, &bytes)?);
            tiles += 1;
        }
    }
    // The end.
    let records = records.finalize().to_hex().to_string();
    let end = End { tiles, non_finite: film.non_finite_samples(), records, state: state.clone() };
    record(&mut file, &of_head, END, &serde_json::to_vec(&end)?)?;
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
