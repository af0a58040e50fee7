//! Merges parts tile by tile. Only the image and one tile of each part are in memory.

use std::collections::BTreeMap;

use super::head::{PartFileKind, PartHeader, render_input_differences};
use super::{PartError, PartFile};
use crate::control::CancelToken;
use crate::film::{Film, StoredTile};

/// The result of merging parts.
#[derive(Debug)]
pub struct MergedParts {
    /// Sum of all parts.
    pub film: Film,
    /// Indices of the missing parts.
    pub missing: Vec<u32>,
    /// Number of parts.
    pub count: u32,
}

/// Checks that parts belong to the same image. Returns the indices of missing parts.
///
/// # Errors
/// A file is not a part, belongs to another image, or contains the same part as another file. The error names
/// the first file with a problem.
pub fn check_and_list_missing(parts: &[PartFile]) -> Result<Vec<u32>, PartError> {
    let Some(first) = parts.first() else { return Ok(Vec::new()) };
    let mut found = BTreeMap::new();
    for part in parts {
        part.check_kind(PartFileKind::Part)?;
        let name = first.path.display().to_string();
        let differences = head_differences(&part.head, &first.head);
        if !differences.is_empty() {
            return Err(PartError::Other { path: part.path.clone(), other: name, differences });
        }
        let (index, count) = (part.head.share.index, part.head.share.count);
        if let Some(twin) = found.insert(index, part) {
            let (first, second) = (twin.path.clone(), part.path.clone());
            return Err(PartError::Doubled { first, second, index, count });
        }
    }
    let count = first.head.share.count;
    Ok((1..=count).filter(|index| !found.contains_key(index)).collect())
}

/// Describes how two headers differ in the image or in its division into parts.
fn head_differences(a: &PartHeader, b: &PartHeader) -> Vec<String> {
    let mut found = render_input_differences(&a.identity, &b.identity, "here", "there");
    let counts = (a.share.count, b.share.count);
    if counts.0 != counts.1 {
        found.push(format!("the image has {} parts here and {} there", counts.0, counts.1));
    }
    let (picture, there) = (&a.picture, &b.picture);
    if found.is_empty() {
        found.extend(metadata_differences(&picture.metadata, &there.metadata));
    }
    if found.is_empty() && (picture != there || a.share.block_count != b.share.block_count) {
        found.push("the output settings differ".to_owned());
    }
    found
}

/// Describes the differences between two images' metadata.
fn metadata_differences(a: &[(String, String)], b: &[(String, String)]) -> Vec<String> {
    let value = |all: &[(String, String)], name: &str| all.iter().find(|(known, _)| known == name).cloned();
    let names = a.iter().chain(b.iter().filter(|(name, _)| value(a, name).is_none()));
    let words = |(name, _): &(String, String)| {
        let [here, there] = [a, b].map(|all| value(all, name).map(|(_, value)| value));
        let shown = |value: Option<String>| value.unwrap_or_else(|| "missing".to_owned());
        let label = name.strip_prefix("glimt:").unwrap_or(name);
        (here != there).then(|| format!("its {label} is {} here and {} there", shown(here), shown(there)))
    };
    names.filter_map(words).collect()
}

/// Merges parts in any order. Parts may be missing only if `is_partial` is true; their tiles are then black
/// or have fewer samples. `on_tile_finished` is called with the number of finished tiles and the film.
///
/// # Errors
/// Same as [`check_and_list_missing`]. Also fails if parts are missing, a part is inconsistent, or the work
/// is canceled.
pub fn merge_parts(
    parts: &[PartFile],
    is_partial: bool,
    token: &CancelToken,
    mut on_tile_finished: impl FnMut(usize, &Film),
) -> Result<MergedParts, PartError> {
    let missing = check_and_list_missing(parts)?;
    let Some(first) = parts.first() else { return Err(PartError::Missing { missing, count: 0 }) };
    let count = first.head.share.count;
    if !missing.is_empty() && !is_partial {
        return Err(PartError::Missing { missing, count });
    }
    let film = first.head.picture.create_film()?;
    for tile in 0..film.tile_count() {
        token.check_pause_and_cancel()?;
        let area = film.tile_rect(tile).map_or(0, |rect| rect.area());
        let stored = match first.head.share.block_count {
            0 => find_tile_in_parts(parts, tile, area)?,
            blocks => sum_sample_blocks_of_tile(parts, blocks, tile, area)?,
        };
        let is_complete = stored.as_ref().is_some_and(|(_, is_complete)| *is_complete);
        if missing.is_empty() && !is_complete {
            let why = format!("no part has all samples of tile {tile}");
            return Err(PartError::Damaged { path: first.path.clone(), why });
        }
        if let Some((stored, _)) = stored {
            let why = format!("tile {tile} does not belong to this image");
            let damaged = |_| PartError::Damaged { path: first.path.clone(), why };
            film.restore_tile(tile, stored).map_err(damaged)?;
        }
        on_tile_finished(tile + 1, &film);
    }
    film.add_non_finite_count(parts.iter().map(|part| part.non_finite).sum());
    Ok(MergedParts { film, missing, count })
}

/// Returns a tile, which only one part may contain, and whether it has all of its samples.
fn find_tile_in_parts(
    parts: &[PartFile],
    tile: usize,
    area: usize,
) -> Result<Option<(StoredTile, bool)>, PartError> {
    let mut found: Option<(StoredTile, &PartFile)> = None;
    for part in parts {
        let Some(stored) = part.read_tile(tile, area)? else { continue };
        if let Some((_, twin)) = &found {
            let why = format!("it contains tile {tile}, which is also in {}", twin.path.display());
            return Err(PartError::Damaged { path: part.path.clone(), why });
        }
        found = Some((stored, part));
    }
    Ok(found.map(|(stored, _)| (stored, true)))
}

/// Sums a tile's blocks in ascending order. Also returns whether all blocks are present.
fn sum_sample_blocks_of_tile(
    parts: &[PartFile],
    block_count: u32,
    tile: usize,
    area: usize,
) -> Result<Option<(StoredTile, bool)>, PartError> {
    let damaged = |part: &PartFile, why: String| PartError::Damaged { path: part.path.clone(), why };
    let mut tiles = Vec::new();
    for part in parts {
        if let Some(stored) = part.read_tile(tile, area)? {
            tiles.push((part, stored));
        }
    }
    // Map each block to its part.
    let mut order: BTreeMap<u32, (usize, usize)> = BTreeMap::new();
    for (index, (part, _)) in tiles.iter().enumerate() {
        for (position, block) in part.head.share.blocks.iter().enumerate() {
            if *block >= block_count {
                return Err(damaged(
                    part,
                    format!("it contains block {block}, but there are only {block_count}"),
                ));
            }
            if let Some((twin, _)) = order.insert(*block, (index, position)) {
                let why = format!(
                    "it contains block {block} of tile {tile}, which is also in {}",
                    tiles[twin].0.path.display()
                );
                return Err(damaged(part, why));
            }
        }
    }
    if order.is_empty() {
        return Ok(None);
    }
    // Sum the blocks in ascending order.
    let mut sum = StoredTile::default();
    for (index, position) in order.values() {
        let (part, stored) = &tiles[*index];
        let added = sum.add_block_sum_from(stored, *position);
        added.map_err(|_| damaged(part, format!("a block of tile {tile} is missing")))?;
    }
    tiles.iter().for_each(|(_, stored)| sum.add_counts_from(stored));
    Ok(Some((sum, order.len() == block_count as usize)))
}
