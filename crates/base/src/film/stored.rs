//! Binary serialization of film tiles as arrays of little-endian numbers.

use std::sync::atomic::Ordering;

use super::convergence::SquaredMeanChanges;
use super::layer_sums::LayerSums;
use super::sums::{NegativeLobeSums, Tile};
use super::{CELLS, Film, PixelSubset};
use crate::math::DVec3;

/// Error for bytes that do not encode a valid tile of the film.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the data is not a valid tile of the image")]
pub struct MalformedTile;

/// A deserialized tile. Its blocks can be merged with blocks from other tiles.
#[derive(Debug, Default)]
pub struct StoredTile {
    tile: Tile,
}

impl StoredTile {
    /// Reads a tile of `area` pixels.
    ///
    /// # Errors
    /// [`MalformedTile`] if there are too few or too many bytes, or invalid counts.
    pub fn deserialize(bytes: &[u8], area: usize) -> Result<Self, MalformedTile> {
        let mut from = ByteReader(bytes);
        let (blocks, is_signed, levels) =
            (from.u32_as_usize()?, from.u32_as_usize()? == 1, from.u32_as_usize()?);
        let layers = from.u32_as_usize()?;
        // Check the length before reserving memory.
        let sums = blocks.checked_add(layers).and_then(|sums| sums.checked_mul(area * size_of::<DVec3>()));
        if sums.is_none_or(|all| all > bytes.len()) || levels > 32 {
            return Err(MalformedTile);
        }
        let mut tile = Tile { sums: from.vectors(area)?, ..Tile::default() };
        tile.earlier = (0..blocks).map(|_| from.vectors(area)).collect::<Result<_, _>>()?;
        tile.counts = from.counts(area)?;
        if is_signed {
            let weight = f64::from_bits(from.u64()?);
            let sums = from.vectors(area)?;
            let earlier = (0..blocks).map(|_| from.vectors(area)).collect::<Result<_, _>>()?;
            tile.negative = Some(NegativeLobeSums { weight, sums, counts: from.counts(area)?, earlier });
        }
        tile.steps = SquaredMeanChanges::from_words(area, levels, &mut || from.u32())?;
        let sums = from.vectors(area * layers)?;
        let negative = if is_signed { from.vectors(area * layers)? } else { Vec::new() };
        tile.layers = LayerSums { count: layers, sums, negative };
        if from.0.is_empty() { Ok(Self { tile }) } else { Err(MalformedTile) }
    }

    /// Number of block sums, including the sum in progress, which may be empty.
    pub fn sample_block_count(&self) -> usize {
        self.tile.earlier.len() + 1
    }

    /// Adds one block from another tile to the blocks accumulated in this tile.
    ///
    /// # Errors
    /// [`MalformedTile`] if the tiles differ in size or the block does not exist.
    pub fn add_block_sum_from(&mut self, of: &Self, block: usize) -> Result<(), MalformedTile> {
        let area = of.tile.sums.len();
        if self.tile.sums.is_empty() {
            self.tile.resize(area);
        }
        if self.tile.sums.len() != area {
            return Err(MalformedTile);
        }
        let sums = pixel_sums_of_block(&of.tile.earlier, &of.tile.sums, block).ok_or(MalformedTile)?;
        let is_first = self.tile.earlier.is_empty();
        if is_first {
            self.tile.earlier = vec![sums.to_vec()];
        } else {
            add_block_sums(&mut self.tile.earlier[0], sums);
        }
        if let Some(negative) = &of.tile.negative {
            let sums = pixel_sums_of_block(&negative.earlier, &negative.sums, block).ok_or(MalformedTile)?;
            let own =
                self.tile.negative.get_or_insert_with(|| NegativeLobeSums::new(negative.weight, area, 1));
            add_block_sums(&mut own.earlier[0], sums);
        }
        Ok(())
    }

    /// Adds a tile's sample counts after its blocks have been added.
    pub fn add_counts_from(&mut self, of: &Self) {
        self.tile.counts.iter_mut().zip(&of.tile.counts).for_each(|(own, other)| *own += other);
        if let (Some(own), Some(other)) = (&mut self.tile.negative, &of.tile.negative) {
            own.counts.iter_mut().zip(&other.counts).for_each(|(own, other)| *own += other);
        }
    }
}

/// Pixel sums for a single block, which may be the block in progress.
fn pixel_sums_of_block<'a>(
    earlier: &'a [Vec<DVec3>],
    sums: &'a [DVec3],
    block: usize,
) -> Option<&'a [DVec3]> {
    match block.cmp(&earlier.len()) {
        std::cmp::Ordering::Less => Some(&earlier[block]),
        std::cmp::Ordering::Equal => Some(sums),
        std::cmp::Ordering::Greater => None,
    }
}

fn add_block_sums(sums: &mut [DVec3], others: &[DVec3]) {
    sums.iter_mut().zip(others).for_each(|(sum, other)| *sum += *other);
}

impl Film {
    /// Appends the serialized tile to `bytes` and returns whether the tile has samples.
    pub fn serialize_tile(&self, tile: usize, bytes: &mut Vec<u8>) -> bool {
        let tile = self.lock_tile(tile);
        if tile.counts.is_empty() {
            return false;
        }
        let (signed, levels) = (tile.negative.is_some(), tile.steps.level_count());
        for count in [tile.earlier.len(), usize::from(signed), levels, tile.layers.count] {
            put_u32(bytes, count as u32);
        }
        put_sums(bytes, &tile.sums, &tile.earlier);
        append_numbers(bytes, tile.counts.iter().map(|count| count.to_le_bytes()));
        if let Some(negative) = &tile.negative {
            bytes.extend_from_slice(&negative.weight.to_bits().to_le_bytes());
            put_sums(bytes, &negative.sums, &negative.earlier);
            append_numbers(bytes, negative.counts.iter().map(|count| count.to_le_bytes()));
        }
        tile.steps.write_words(&mut |word| put_u32(bytes, word));
        put_sums(bytes, &tile.layers.sums, &[&tile.layers.negative]);
        true
    }

    /// Replaces a tile with a deserialized tile.
    ///
    /// # Errors
    /// [`MalformedTile`] if the tile does not fit this film.
    pub fn restore_tile(&self, tile: usize, stored: StoredTile) -> Result<(), MalformedTile> {
        let area = self.tile_rect(tile).ok_or(MalformedTile)?.area();
        let Tile { sums, earlier, counts, negative, steps, layers, .. } = stored.tile;
        let blocks = self.sum_order().block_sums_per_pixel();
        if sums.len() != area || earlier.len() != blocks || layers.count != self.layers {
            return Err(MalformedTile);
        }
        let mut own = self.lock_tile(tile);
        let revision = own.revision + 1;
        *own = Tile { sums, earlier, counts, negative, steps, layers, revision };
        own.resize(area);
        Ok(())
    }

    /// Samples per pixel in one half of a cell, or 0 if the half has no pixels.
    pub fn cell_half_samples_per_pixel(&self, cell: usize, half: usize) -> u32 {
        let (Some(tile), Some(rect)) = (self.tile_rect(cell / CELLS), self.noise_cell_rect(cell)) else {
            return 0;
        };
        if PixelSubset::Half(half).count(rect.area()) == 0 {
            return 0;
        }
        let index = PixelSubset::Half(half).nth_pixel_index_in_rect(0, rect);
        let (x, y) = (rect.x + index % rect.width - tile.x, rect.y + index / rect.width - tile.y);
        self.lock_tile(cell / CELLS).sample_count((y * tile.width + x) as usize)
    }

    /// Adds the number of non-finite samples in restored tiles to [`Film::non_finite_samples`].
    pub fn add_non_finite_count(&self, samples: u64) {
        self.non_finite_samples.fetch_add(samples, Ordering::Relaxed);
    }
}

fn put_u32(bytes: &mut Vec<u8>, word: u32) {
    bytes.extend_from_slice(&word.to_le_bytes());
}

fn put_sums(bytes: &mut Vec<u8>, sums: &[DVec3], earlier: &[impl AsRef<[DVec3]>]) {
    for sums in [sums].into_iter().chain(earlier.iter().map(AsRef::as_ref)) {
        append_numbers(
            bytes,
            sums.iter().map(|sum| {
                let mut number = [0; 24];
                let (x, rest) = number.split_at_mut(8);
                let (y, z) = rest.split_at_mut(8);
                x.copy_from_slice(&sum.x.to_bits().to_le_bytes());
                y.copy_from_slice(&sum.y.to_bits().to_le_bytes());
                z.copy_from_slice(&sum.z.to_bits().to_le_bytes());
                number
            }),
        );
    }
}

/// Appends numbers of `N` bytes each. Resizing once is much faster than appending them one at a time.
fn append_numbers<const N: usize>(bytes: &mut Vec<u8>, numbers: impl ExactSizeIterator<Item = [u8; N]>) {
    let start = bytes.len();
    bytes.resize(start + N * numbers.len(), 0);
    for (place, number) in bytes[start..].chunks_exact_mut(N).zip(numbers) {
        place.copy_from_slice(&number);
    }
}

/// Remaining input bytes.
struct ByteReader<'a>(&'a [u8]);

impl ByteReader<'_> {
    fn take<const N: usize>(&mut self) -> Result<[u8; N], MalformedTile> {
        let (head, rest) = self.0.split_first_chunk().ok_or(MalformedTile)?;
        self.0 = rest;
        Ok(*head)
    }

    fn u32(&mut self) -> Result<u32, MalformedTile> {
        self.take().map(u32::from_le_bytes)
    }

    fn u64(&mut self) -> Result<u64, MalformedTile> {
        self.take().map(u64::from_le_bytes)
    }

    fn u32_as_usize(&mut self) -> Result<usize, MalformedTile> {
        self.u32().map(|count| count as usize)
    }

    fn counts(&mut self, area: usize) -> Result<Vec<u32>, MalformedTile> {
        (0..area).map(|_| self.u32()).collect()
    }

    fn vectors(&mut self, area: usize) -> Result<Vec<DVec3>, MalformedTile> {
        let mut number = || self.u64().map(f64::from_bits);
        (0..area).map(|_| Ok(DVec3::new(number()?, number()?, number()?))).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::{BLOCK_SIZE, NegativeLobeSamples, Rect, SumOrder, TileSamples};
    use crate::math::Vec3;
    use crate::math::random::unit_generator;

    /// Adds samples `range` from a fixed random sequence to each pixel of a 40 × 33 film.
    fn add(film: &Film, range: std::ops::Range<u32>, is_signed: bool) {
        for tile in 0..film.tile_count() {
            let rect = film.tile_rect(tile).expect("a tile");
            let (mut radiance, mut is_negative) = (Vec::new(), Vec::new());
            for i in 0..rect.area() as u64 {
                let mut next = unit_generator(1 + i + 5000 * tile as u64);
                for sample in 0..range.end {
                    let value = Vec3::new(next(), next(), next() * 1e4);
                    if range.contains(&sample) {
                        is_negative.push(value.x > 0.8);
                        radiance.push(value);
                    }
                }
            }
            let negative = is_signed.then_some(NegativeLobeSamples { weight: 0.1, is_negative });
            let samples = range.end - range.start;
            film.add_samples(
                tile,
                TileSamples { pixels: rect.into(), samples, radiance, negative, layers: Default::default() },
            );
        }
    }

    fn film(blocks: SumOrder) -> Film {
        let crop = Some(Rect { x: 5, y: 2, width: 40, height: 33 });
        Film::new(64, 64, crop).and_then(|film| film.with_sum_order(blocks)).expect("a film")
    }

    fn stored(film: &Film, tile: usize) -> Vec<u8> {
        let mut bytes = Vec::new();
        assert!(film.serialize_tile(tile, &mut bytes));
        bytes
    }

    #[test]
    fn restored_films_continue_identically() {
        for (blocks, is_signed) in [
            (SumOrder::Sequential, false),
            (SumOrder::Sequential, true),
            (SumOrder::Blocked, true),
            (SumOrder::SeparateBlocks(2), true),
        ] {
            let (whole, first, second) = (film(blocks), film(blocks), film(blocks));
            add(&whole, 0..37, is_signed);
            add(&first, 0..21, is_signed);
            for tile in 0..first.tile_count() {
                let area = first.tile_rect(tile).expect("a tile").area();
                let read = StoredTile::deserialize(&stored(&first, tile), area).expect("a tile");
                second.restore_tile(tile, read).expect("the tile should fit the film");
            }
            assert_eq!(
                (second.cell_half_samples_per_pixel(0, 1), second.cell_half_samples_per_pixel(1, 0)),
                (21, 21)
            );
            add(&second, 21..37, is_signed);
            assert_eq!(second.radiance_image().pixels, whole.radiance_image().pixels);
            assert_eq!(second.noise_and_convergence(), whole.noise_and_convergence());
            for tile in 0..whole.tile_count() {
                assert_eq!(stored(&second, tile), stored(&whole, tile), "{blocks:?}");
            }
        }
    }

    #[test]
    fn merged_blocks_match_the_full_tile() {
        for is_signed in [false, true] {
            let whole = film(SumOrder::Blocked);
            add(&whole, 0..2 * BLOCK_SIZE + 5, is_signed);
            // One machine renders the first and last blocks, and another renders the middle block.
            let (outer, inner) = (film(SumOrder::SeparateBlocks(1)), film(SumOrder::SeparateBlocks(1)));
            add(&outer, 0..BLOCK_SIZE, is_signed);
            add(&outer, 2 * BLOCK_SIZE..2 * BLOCK_SIZE + 5, is_signed);
            add(&inner, BLOCK_SIZE..2 * BLOCK_SIZE, is_signed);
            let merged = film(SumOrder::Blocked);
            for tile in 0..whole.tile_count() {
                let area = whole.tile_rect(tile).expect("a tile").area();
                let [outer, inner] = [&outer, &inner]
                    .map(|of| StoredTile::deserialize(&stored(of, tile), area).expect("a tile"));
                let mut sum = StoredTile::default();
                for (of, block) in [(&outer, 0), (&inner, 0), (&outer, 1)] {
                    sum.add_block_sum_from(of, block).expect("a block");
                }
                [&outer, &inner].into_iter().for_each(|of| sum.add_counts_from(of));
                merged.restore_tile(tile, sum).expect("a tile");
            }
            assert_eq!(merged.radiance_image().pixels, whole.radiance_image().pixels);
            assert_eq!(merged.sample_count_stats(), whole.sample_count_stats());
        }
    }

    #[test]
    fn malformed_tiles_are_rejected() {
        let film = film(SumOrder::Blocked);
        add(&film, 0..9, true);
        let (bytes, area) = (stored(&film, 0), film.tile_rect(0).expect("a tile").area());
        for length in (0..bytes.len()).step_by(997).chain([bytes.len() - 1]) {
            assert_eq!(
                StoredTile::deserialize(&bytes[..length], area).err(),
                Some(MalformedTile),
                "{length}"
            );
        }
        assert!(StoredTile::deserialize(&[&bytes[..], &[0]].concat(), area).is_err());
        assert!(StoredTile::deserialize(&bytes, area + 1).is_err());
        let mut huge = bytes;
        huge[..4].fill(255);
        assert!(StoredTile::deserialize(&huge, area).is_err());
    }
}
