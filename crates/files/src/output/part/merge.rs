//! Joining parts: tile after tile, so that the picture and one tile of each part are in memory.

use std::collections::BTreeMap;

use super::head::{Head, Kind, differences};
use super::{PartError, PartFile};
use crate::control::CancelToken;
use crate::film::{Film, StoredTile};

/// Parts that were joined.
#[derive(Debug)]
pub struct Merged {
    /// The sums of all parts.
    pub film: Film,
    /// Numbers of the parts that are not there.
    pub missing: Vec<u32>,
    /// Number of parts.
    pub count: u32,
}

/// Checks that parts belong together; returns the numbers of the missing parts.
///
/// # Errors
/// The first that is something else, is of another picture, or is there twice.
pub fn check(parts: &[PartFile]) -> Result<Vec<u32>, PartError> {
    let Some(first) = parts.first() else { return Ok(Vec::new()) };
    let mut found = BTreeMap::new();
    for part in parts {
        part.check_kind(Kind::Part)?;
        let name = first.path.display().to_string();
        let unlike = unlike(&part.head, &first.head);
        if !unlike.is_empty() {
            return Err(PartError::Other { path: part.path.clone(), other: name, differences: unlike });
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

/// Differences between the pictures of two heads, or between their cuts of one picture.
fn unlike(own: &Head, other: &Head) -> Vec<String> {
    let mut unlike = differences(&own.identity, &other.identity, ("here", "there"));
    let counts = (own.share.count, other.share.count);
    if counts.0 != counts.1 {
        unlike.push(format!("it is one of {} parts here and of {} there", counts.0, counts.1));
    }
    let (picture, there) = (&own.picture, &other.picture);
    if unlike.is_empty() {
        unlike.extend(metadata_differences(&picture.metadata, &there.metadata));
    }
    if unlike.is_empty() && (picture != there || own.share.block_count != other.share.block_count) {
        unlike.push("the image is finished in another way".to_owned());
    }
    unlike
}

/// Differences between the names and values that two images get, a phrase for each.
fn metadata_differences(own: &[(String, String)], other: &[(String, String)]) -> Vec<String> {
    let value = |all: &[(String, String)], name: &str| all.iter().find(|(known, _)| known == name).cloned();
    let names = own.iter().chain(other.iter().filter(|(name, _)| value(own, name).is_none()));
    let words = |(name, _): &(String, String)| {
        let [here, there] = [own, other].map(|all| value(all, name).map(|(_, value)| value));
        let shown = |value: Option<String>| value.unwrap_or_else(|| "missing".to_owned());
        let label = name.strip_prefix("glimt:").unwrap_or(name);
        (here != there).then(|| format!("its {label} is {} here and {} there", shown(here), shown(there)))
    };
    names.filter_map(words).collect()
}

/// Joins parts, whatever their order. If some are missing, `is_partial` joins the others: what is missing stays black, or has fewer
/// samples. `tell` hears how many of all tiles are done, and may look at the film.
///
/// # Errors
/// As [`check`]; parts are missing; a part does not hold what its number says; cancelled.
pub fn merge(
    parts: &[PartFile],
    is_partial: bool,
    token: &CancelToken,
    mut tell: impl FnMut(usize, &Film),
) -> Result<Merged, PartError> {
    let missing = check(parts)?;
    let Some(first) = parts.first() else { return Err(PartError::Missing { missing, count: 0 }) };
    let count = first.head.share.count;
    if !missing.is_empty() && !is_partial {
        return Err(PartError::Missing { missing, count });
    }
    let film = first.head.picture.film()?;
    for tile in 0..film.tile_count() {
        token.check()?;
        let area = film.tile_rect(tile).map_or(0, |rect| rect.area());
        let stored = match first.head.share.block_count {
            0 => whole(parts, tile, area)?,
            blocks => by_blocks(parts, blocks, tile, area)?,
        };
        let is_complete = stored.as_ref().is_some_and(|(_, is_complete)| *is_complete);
        if missing.is_empty() && !is_complete {
            let why = format!("no part has all samples of tile {tile}");
            return Err(PartError::Damaged { path: first.path.clone(), why });
        }
        if let Some((stored, _)) = stored {
            let why = format!("tile {tile} is none of this picture");
            let damaged = |_| PartError::Damaged { path: first.path.clone(), why };
            film.restore(tile, stored).map_err(damaged)?;
        }
        tell(tile + 1, &film);
    }
    film.add_non_finite(parts.iter().map(|part| part.non_finite).sum());
    Ok(Merged { film, missing, count })
}

/// A tile that one part has, and whether it has all its samples.
fn whole(parts: &[PartFile], tile: usize, area: usize) -> Result<Option<(StoredTile, bool)>, PartError> {
    let mut found: Option<(StoredTile, &PartFile)> = None;
    for part in parts {
        let Some(stored) = part.tile(tile, area)? else { continue };
        if let Some((_, twin)) = &found {
            let why = format!("it holds tile {tile}, as does {}", twin.path.display());
            return Err(PartError::Damaged { path: part.path.clone(), why });
        }
        found = Some((stored, part));
    }
    Ok(found.map(|(stored, _)| (stored, true)))
}

/// The sum of the blocks of a tile in their order, and whether they are all there.
fn by_blocks(
    parts: &[PartFile],
    block_count: u32,
    tile: usize,
    area: usize,
) -> Result<Option<(StoredTile, bool)>, PartError> {
    let damaged = |part: &PartFile, why: String| PartError::Damaged { path: part.path.clone(), why };
    let mut tiles = Vec::new();
    for part in parts {
        if let Some(stored) = part.tile(tile, area)? {
            tiles.push((part, stored));
        }
    }
    // Find out which part has each block.
    let mut order: BTreeMap<u32, (usize, usize)> = BTreeMap::new();
    for (index, (part, _)) in tiles.iter().enumerate() {
        for (place, block) in part.head.share.blocks.iter().enumerate() {
            if *block >= block_count {
                return Err(damaged(part, format!("it holds block {block} of {block_count}")));
            }
            if let Some((twin, _)) = order.insert(*block, (index, place)) {
                let why = format!(
                    "it holds block {block} of tile {tile}, as does {}",
                    tiles[twin].0.path.display()
                );
                return Err(damaged(part, why));
            }
        }
    }
    if order.is_empty() {
        return Ok(None);
    }
    // Add them up by their numbers.
    let mut sum = StoredTile::default();
    for (index, place) in order.values() {
        let (part, stored) = &tiles[*index];
        let added = sum.add_block(stored, *place);
        added.map_err(|_| damaged(part, format!("a block of tile {tile} is missing")))?;
    }
    tiles.iter().for_each(|(_, stored)| sum.add_counts(stored));
    Ok(Some((sum, order.len() == block_count as usize)))
}
