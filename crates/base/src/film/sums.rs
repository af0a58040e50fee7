//! The film: f64 sums of every pixel's samples, in independently locked tiles.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};

use super::convergence::{ConvergenceModel, SquaredMeanChanges, luminance};
use super::layer_sums::LayerSums;
use super::pixel_subset::PixelSubset;
use super::sum_order::{SumOrder, add_finite_and_count_non_finite, pixel_sum_over_sample_blocks};
use super::{CELL_SIZE, CELLS, CELLS_ACROSS, Rect, TILE_SIZE, TileSamples};
use crate::math::{DVec3, Vec3};
use crate::system::memory::try_reserve_exact;

/// Reason why a film could not be created.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum FilmCreationError {
    /// There is not enough memory.
    #[error(
        "a {width}×{height} image needs {} of memory, more than is available; make it smaller{}",
        describe_byte_size(*.bytes),
        crop_advice(*.crop_helps)
    )]
    Memory {
        /// Image width in pixels.
        width: u32,
        /// Image height in pixels.
        height: u32,
        /// Bytes for the sums and the finished image.
        bytes: u64,
        /// Whether a crop would help. True if there is no crop yet and the finished image, whose size does
        /// not depend on the crop, fits in memory.
        crop_helps: bool,
    },
    /// The image would have no pixels.
    #[error("there are no pixels to render: the crop is outside the {width}×{height} image")]
    Empty {
        /// Image width in pixels.
        width: u32,
        /// Image height in pixels.
        height: u32,
    },
}

fn describe_byte_size(bytes: u64) -> String {
    match bytes {
        0..1_000_000_000 => format!("{} MB", bytes.div_ceil(1_000_000)),
        1_000_000_000.. => format!("{:.1} GB", bytes as f64 / 1e9),
    }
}

fn crop_advice(crop_helps: bool) -> &'static str {
    if crop_helps {
        ", or render only part of it with a crop"
    } else {
        "; a crop would not help because the finished image is as large"
    }
}

/// Range and mean of the sample counts per pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampleCountStats {
    /// Minimum over all pixels.
    pub min: u32,
    /// Mean over all pixels.
    pub mean: f64,
    /// Maximum over all pixels.
    pub max: u32,
}

/// Per-pixel sums of the samples in an image or crop. Tiles are numbered in row-major order from the top left
/// of the crop. Any thread may add to any tile and read the film at any time. A tile's sums have the same
/// bits for samples added in the same order, regardless of how they are grouped.
#[derive(Debug)]
pub struct Film {
    width: u32,
    height: u32,
    crop: Rect,
    tiles: Vec<Mutex<Tile>>,
    order: OnceLock<Vec<usize>>,
    pub(super) non_finite_samples: AtomicU64,
    id: u64,
    pub(super) convergence: ConvergenceModel,
    pub(super) blocks: SumOrder,
    /// Number of layers.
    pub(super) layers: usize,
    /// Memory of replaced layer sums, for reuse by [`Film::tile_layer_sums`].
    pub(super) spare_layers: Mutex<Vec<LayerSums>>,
}

/// Sums of one tile in row-major order. Empty until the first samples are added, so that the thread rendering
/// the tile is the first to touch its memory.
#[derive(Debug, Default)]
pub(super) struct Tile {
    pub(super) sums: Vec<DVec3>,
    pub(super) counts: Vec<u32>,
    /// Sums of finished sample blocks: none, one for all blocks, or one per block; see [`SumOrder`].
    pub(super) earlier: Vec<Vec<DVec3>>,
    /// Sums of the samples in the filter's negative lobes. `None` until the first such sample.
    pub(super) negative: Option<NegativeLobeSums>,
    pub(super) steps: SquaredMeanChanges,
    pub(super) layers: LayerSums,
    /// Incremented whenever the tile changes.
    pub(super) revision: u64,
}

/// Sums of the samples in a filter's negative lobes, which are excluded from all other sums.
#[derive(Debug)]
pub(super) struct NegativeLobeSums {
    pub(super) weight: f64,
    pub(super) sums: Vec<DVec3>,
    pub(super) counts: Vec<u32>,
    /// Sums of finished blocks, as in [`Tile`].
    pub(super) earlier: Vec<Vec<DVec3>>,
}

impl NegativeLobeSums {
    /// Creates zero sums for a tile with `blocks` separate block sums.
    pub(super) fn new(weight: f64, area: usize, blocks: usize) -> Self {
        let (sums, counts) = (vec![DVec3::ZERO; area], vec![0; area]);
        Self { weight, earlier: vec![sums.clone(); blocks], sums, counts }
    }
}

impl Tile {
    /// Mean of a pixel's samples, or `None` if the pixel has no samples.
    #[inline]
    pub(super) fn mean(&self, index: usize) -> Option<DVec3> {
        self.mean_from_filter_lobe_sums(
            index,
            || self.positive_lobe_sample_sum(index),
            |negative| pixel_sum_over_sample_blocks(&negative.earlier, &negative.sums, index),
        )
    }

    /// Combines a pixel's sums into its mean: `sum` over the samples outside the filter's negative lobes, and
    /// `negative_sum` over the samples inside them. Returns `None` if the pixel has no samples.
    /// Inlined because noise estimates call it for every pixel.
    #[inline(always)]
    pub(super) fn mean_from_filter_lobe_sums(
        &self,
        index: usize,
        sum: impl Fn() -> DVec3,
        negative_sum: impl Fn(&NegativeLobeSums) -> DVec3,
    ) -> Option<DVec3> {
        let count = self.sample_count(index);
        let negative = self.negative.as_ref().filter(|negative| negative.counts[index] > 0);
        let Some(negative) = negative else {
            return (count > 0).then(|| sum() / f64::from(count));
        };
        let below = negative_sum(negative) / f64::from(negative.counts[index]);
        let positive_count = count - negative.counts[index];
        if positive_count == 0 {
            return Some(below);
        }
        let above = sum() / f64::from(positive_count);
        Some(above + (above - below) * negative.weight)
    }

    pub(super) fn sample_count(&self, index: usize) -> u32 {
        self.counts.get(index).copied().unwrap_or(0)
    }

    /// Sum of a pixel's samples outside negative lobes.
    #[inline(always)]
    fn positive_lobe_sample_sum(&self, index: usize) -> DVec3 {
        if self.earlier.is_empty() {
            self.sums[index]
        } else {
            pixel_sum_over_sample_blocks(&self.earlier, &self.sums, index)
        }
    }

    /// Resizes the sums to `area` pixels. Cannot fail because the film reserved the memory.
    pub(super) fn resize(&mut self, area: usize) {
        self.sums.resize(area, DVec3::ZERO);
        self.earlier.iter_mut().for_each(|sums| sums.resize(area, DVec3::ZERO));
        self.counts.resize(area, 0);
        self.steps.resize(area);
        self.layers.resize(area);
    }

    /// Adds consecutive samples to a pixel in the specified cell and half. Returns the number of non-finite
    /// samples. `lobes` contains the weight of the negative lobes and one flag per sample.
    fn add_pixel_samples(
        &mut self,
        (index, cell, half): (usize, usize, usize),
        radiances: &[Vec3],
        lobes: Option<(f64, &[bool])>,
        blocks: SumOrder,
    ) -> u64 {
        let mut non_finite = 0;
        let mut rest = 0..radiances.len();
        while !rest.is_empty() {
            // Stop at the next count where the mean is recorded or a block ends.
            let to_note = SquaredMeanChanges::samples_to_next_record(self.counts[index]);
            let left = match blocks {
                SumOrder::Sequential => to_note,
                SumOrder::Blocked | SumOrder::SeparateBlocks(_) => {
                    to_note.min(blocks.samples_to_block_end(self.counts[index]))
                }
            };
            let part = rest.start..rest.end.min(rest.start + left);
            non_finite += match lobes {
                None => add_finite_and_count_non_finite(&mut self.sums[index], &radiances[part.clone()]),
                Some((weight, signs)) => self.add_pixel_samples_by_lobe(
                    index,
                    weight,
                    &radiances[part.clone()],
                    &signs[part.clone()],
                ),
            };
            self.counts[index] += part.len() as u32;
            rest.start = part.end;
            if part.len() == to_note
                && let Some(mean) = self.mean(index)
            {
                self.steps.record_luminance_at_count(
                    (index, cell, half),
                    self.counts[index],
                    luminance(mean),
                );
            }
            if blocks != SumOrder::Sequential {
                self.close_pixel_block_if_complete(index, blocks);
            }
        }
        non_finite
    }

    fn add_pixel_samples_by_lobe(
        &mut self,
        index: usize,
        weight: f64,
        radiances: &[Vec3],
        is_negative: &[bool],
    ) -> u64 {
        let (area, blocks) = (self.sums.len(), self.earlier.len());
        let negative = self.negative.get_or_insert_with(|| NegativeLobeSums::new(weight, area, blocks));
        let mut non_finite = 0;
        for (radiance, &is_negative) in radiances.iter().zip(is_negative) {
            let sum = if is_negative { &mut negative.sums[index] } else { &mut self.sums[index] };
            non_finite += add_finite_and_count_non_finite(sum, std::slice::from_ref(radiance));
            negative.counts[index] += u32::from(is_negative);
        }
        non_finite
    }
}

impl Film {
    /// Creates an empty film for an image of this size, or for the part covered by `crop`.
    ///
    /// # Errors
    /// [`FilmCreationError`] if the crop is outside the image, or if there is not enough memory for the sums
    /// and the finished image.
    pub fn new(width: u32, height: u32, crop: Option<Rect>) -> Result<Self, FilmCreationError> {
        Self::with_memory_limit(u64::MAX, width, height, crop)
    }

    /// Like [`Film::new`], but uses at most `max_bytes` bytes of memory.
    ///
    /// # Errors
    /// [`FilmCreationError`] as in [`Film::new`].
    pub fn with_memory_limit(
        max_bytes: u64,
        width: u32,
        height: u32,
        crop: Option<Rect>,
    ) -> Result<Self, FilmCreationError> {
        let whole = Rect { x: 0, y: 0, width, height };
        let crop =
            crop.unwrap_or(whole).intersection(&whole).ok_or(FilmCreationError::Empty { width, height })?;
        let bytes = film_and_image_bytes(width, height, crop);
        let tiles = if bytes <= max_bytes { allocate_tiles(width, height, crop) } else { None };
        let tiles = tiles.ok_or_else(|| {
            let least = film_and_image_bytes(width, height, Rect { width: 0, height: 0, ..crop });
            let crop_helps = crop == whole && least <= max_bytes && can_allocate(least);
            FilmCreationError::Memory { width, height, bytes, crop_helps }
        })?;
        static IDS: AtomicU64 = AtomicU64::new(0);
        Ok(Self {
            width,
            height,
            crop,
            tiles,
            order: OnceLock::new(),
            non_finite_samples: AtomicU64::new(0),
            id: IDS.fetch_add(1, Ordering::Relaxed),
            convergence: ConvergenceModel::default(),
            blocks: SumOrder::default(),
            layers: 0,
            spare_layers: Mutex::default(),
        })
    }

    /// Sets the convergence model for noise estimates.
    pub fn with_convergence_model(self, convergence: ConvergenceModel) -> Self {
        Self { convergence, ..self }
    }

    /// Width of the full image, in pixels.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Height of the full image, in pixels.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// Rectangle of pixels to render.
    pub fn crop_rect(&self) -> Rect {
        self.crop
    }

    /// Number of tiles in the crop.
    pub fn tile_count(&self) -> usize {
        self.tiles.len()
    }

    /// Rectangle that a tile covers in the full image, or `None` beyond the last tile.
    pub fn tile_rect(&self, tile: usize) -> Option<Rect> {
        (tile < self.tiles.len()).then(|| tile_rect(self.crop, tile))
    }

    /// Number of cells: [`CELLS`] per tile. Some cells of the last tiles may have no pixels.
    pub fn noise_cell_count(&self) -> usize {
        CELLS * self.tiles.len()
    }

    /// Rectangle that a cell covers in the full image, or `None` if the cell has no pixels.
    pub fn noise_cell_rect(&self, cell: usize) -> Option<Rect> {
        noise_cell_rect(self.tile_rect(cell / CELLS)?, cell % CELLS)
    }

    /// Indices of all tiles, in rings from the crop's center outward. Computed on the first call.
    pub fn tiles_center_outward(&self) -> &[usize] {
        self.order.get_or_init(|| tiles_in_rings(self.crop))
    }

    /// Bytes used by the sums.
    pub fn memory_bytes(&self) -> u64 {
        let tile = size_of::<Mutex<Tile>>() + size_of::<usize>();
        let pixel = SUM_BYTES + (self.blocks.block_sums_per_pixel() + self.layers) * size_of::<DVec3>();
        (self.crop.area() * pixel + self.tiles.len() * tile) as u64
    }

    /// Adds samples to a tile one by one, in order. A sample with a NaN or an infinity is treated as black
    /// and counted in [`Film::non_finite_samples`]. Pixels outside the tile are ignored.
    pub fn add_samples(&self, tile: usize, samples: TileSamples) {
        let Some(rect) = self.tile_rect(tile) else { return };
        if samples.samples == 0 || samples.pixels.rect.width == 0 {
            return;
        }
        let mut non_finite = 0;
        let mut guard = self.lock_tile(tile);
        let tile = &mut *guard;
        tile.resize(rect.area());
        let count = samples.samples as usize;
        let is_whole = samples.pixels == rect.into();
        for (i, pixel) in samples.radiance.chunks_exact(count).enumerate() {
            let (x, y) = samples.pixels.image_position(i as u32);
            let Some(index) = pixel_index_in_rect(rect, x, y) else { continue };
            let (cell, inside) = cell_and_rect_of_pixel(rect, x, y);
            let lobes = samples.negative.as_ref();
            let lobes = lobes.map(|lobes| (lobes.weight, &lobes.is_negative[i * count..][..count]));
            let half = pixel_index_in_rect(inside, x, y)
                .map_or(0, |index| PixelSubset::half_containing(index as u32, inside));
            non_finite += tile.add_pixel_samples((index, cell, half), pixel, lobes, self.blocks);
            if !is_whole {
                tile.layers.replace_pixel(index, &samples.layers, i);
            }
        }
        let replaced = is_whole.then(|| tile.layers.replace_if_same_size(samples.layers));
        tile.revision += 1;
        drop(guard);
        if let Some(replaced) = replaced.filter(|_| self.layers > 0) {
            lock(&self.spare_layers).push(replaced);
        }
        self.non_finite_samples.fetch_add(non_finite, Ordering::Relaxed);
    }

    /// Minimum, mean and maximum number of samples per pixel in the crop.
    pub fn sample_count_stats(&self) -> SampleCountStats {
        let (mut min, mut max, mut total) = (u32::MAX, 0, 0_u64);
        for tile in &self.tiles {
            let tile = lock(tile);
            if tile.counts.is_empty() {
                min = 0;
            }
            for &count in &tile.counts {
                min = min.min(count);
                max = max.max(count);
                total += u64::from(count);
            }
        }
        SampleCountStats { min, mean: total as f64 / self.crop.area() as f64, max }
    }

    /// Number of samples with a NaN or an infinity, which were treated as black.
    pub fn non_finite_samples(&self) -> u64 {
        self.non_finite_samples.load(Ordering::Relaxed)
    }

    /// Unique identifier of this film.
    pub(super) fn id(&self) -> u64 {
        self.id
    }

    /// Locks a tile. Ignores poisoning because a panicking thread leaves the sums in a consistent state.
    pub(super) fn lock_tile(&self, tile: usize) -> MutexGuard<'_, Tile> {
        lock(&self.tiles[tile])
    }
}

pub(super) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

pub(super) fn pixel_index_in_rect(rect: Rect, x: u32, y: u32) -> Option<usize> {
    let (x, y) = (x.checked_sub(rect.x)?, y.checked_sub(rect.y)?);
    (x < rect.width && y < rect.height).then(|| y as usize * rect.width as usize + x as usize)
}

/// Cell that contains a pixel in a tile, and the cell's rectangle.
fn cell_and_rect_of_pixel(tile: Rect, x: u32, y: u32) -> (usize, Rect) {
    let (column, row) = ((x - tile.x) / CELL_SIZE, (y - tile.y) / CELL_SIZE);
    let cell = row as usize * CELLS_ACROSS + column as usize;
    (cell, noise_cell_rect(tile, cell).unwrap_or(tile))
}

fn noise_cell_rect(tile: Rect, cell: usize) -> Option<Rect> {
    let (column, row) = ((cell % CELLS_ACROSS) as u32, (cell / CELLS_ACROSS) as u32);
    let (x, y) = (tile.x + column * CELL_SIZE, tile.y + row * CELL_SIZE);
    Rect { x, y, width: CELL_SIZE, height: CELL_SIZE }.intersection(&tile)
}

pub(super) fn tile_grid(crop: Rect) -> (usize, usize) {
    (crop.width.div_ceil(TILE_SIZE) as usize, crop.height.div_ceil(TILE_SIZE) as usize)
}

pub(super) fn tile_rect(crop: Rect, tile: usize) -> Rect {
    let columns = tile_grid(crop).0;
    let (x, y) = ((tile % columns) as u32 * TILE_SIZE, (tile / columns) as u32 * TILE_SIZE);
    let side = |start: u32, length: u32| TILE_SIZE.min(length - start);
    Rect { x: crop.x + x, y: crop.y + y, width: side(x, crop.width), height: side(y, crop.height) }
}

fn tiles_in_rings(crop: Rect) -> Vec<usize> {
    let (columns, rows) = tile_grid(crop);
    // Use twice the distance from the center, which is an integer.
    let offset = |index: usize, length: usize| 2 * index as i64 - (length as i64 - 1);
    let place = |tile: usize| {
        let (x, y) = (offset(tile % columns, columns), offset(tile / columns, rows));
        (x.abs().max(y.abs()) / 2, libm::atan2(y as f64, x as f64), tile)
    };
    let mut places: Vec<_> = (0..columns * rows).map(place).collect();
    places.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2)));
    places.into_iter().map(|(_, _, tile)| tile).collect()
}

/// Bytes per pixel for the sum, the count, two recorded means and the change at the last doubling.
const SUM_BYTES: usize = size_of::<DVec3>() + 3 * size_of::<f32>() + size_of::<u32>();

/// Bytes needed for the crop's sums and for the full image as both radiance and sRGB.
pub(super) fn film_and_image_bytes(width: u32, height: u32, crop: Rect) -> u64 {
    let pixel = size_of::<Vec3>() + size_of::<[u8; 3]>();
    let whole = u64::from(width) * u64::from(height);
    (crop.area() as u64).saturating_mul(SUM_BYTES as u64).saturating_add(whole.saturating_mul(pixel as u64))
}

/// Whether an allocation of this size succeeds.
pub(super) fn can_allocate(bytes: u64) -> bool {
    usize::try_from(bytes).is_ok_and(|bytes| try_reserve_exact(&mut Vec::<u8>::new(), bytes).is_ok())
}

/// Allocates the tiles. First tries to allocate all the memory at once, because a system that overcommits
/// memory refuses only a single huge allocation.
fn allocate_tiles(width: u32, height: u32, crop: Rect) -> Option<Vec<Mutex<Tile>>> {
    if !can_allocate(film_and_image_bytes(width, height, crop)) {
        return None;
    }
    let (columns, rows) = tile_grid(crop);
    let mut tiles = Vec::new();
    try_reserve_exact(&mut tiles, columns * rows).ok()?;
    for tile in 0..columns * rows {
        let area = tile_rect(crop, tile).area();
        let mut sums = Vec::new();
        let mut counts = Vec::new();
        try_reserve_exact(&mut sums, area).ok()?;
        let steps = SquaredMeanChanges::try_with_capacity(area)?;
        try_reserve_exact(&mut counts, area).ok()?;
        tiles.push(Mutex::new(Tile { sums, counts, steps, ..Tile::default() }));
    }
    Some(tiles)
}

#[cfg(test)]
#[path = "sums_tests.rs"]
mod tests;
