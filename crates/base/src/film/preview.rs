//! Screen-sized previews of a film, updated many times per second.

use std::borrow::Cow;
use std::ops::Range;
use std::time::Instant;

use rayon::prelude::*;

use super::resample::AxisPixelMapping;
use super::{Film, FilmQuantity, RadianceImage, is_in_thread_pool};
use crate::math::{DVec3, Vec3};

/// Resizes a film with an exact box filter. Each tile's contribution is cached, so an update processes only
/// the changed tiles. Pixels without samples have zero weight. Preview pixels that cover only pixels without
/// samples show the base image.
#[derive(Debug)]
pub struct Previewer {
    quantity: FilmQuantity,
    width: u32,
    height: u32,
    film_id: Option<u64>,
    shares: Vec<TileContribution>,
    /// Next tile to check.
    next: usize,
    /// Whether every tile of this film has been checked.
    is_whole: bool,
}

/// A tile's contribution to the preview pixels it covers.
#[derive(Clone, Debug, Default)]
struct TileContribution {
    revision: u64,
    /// First column and row.
    x: u32,
    y: u32,
    /// Number of columns.
    width: u32,
    /// Weighted sums in row-major order.
    cells: Vec<WeightedColor>,
}

/// A weighted sum and the sum of its weights: 16 bytes per preview pixel.
type WeightedColor = (Vec3, f32);

/// Like [`WeightedColor`], in double precision for summation.
type WeightedColorF64 = (DVec3, f64);

/// Number of rows summed at a time. Summing in bands avoids a second copy of the whole preview.
const BAND_ROWS: u32 = 32;

/// Number of tiles per thread between deadline checks: less than a millisecond of work.
const TILES_AT_ONCE: usize = 32;

impl Previewer {
    /// Creates a radiance previewer of this size. A width or height of 0 is treated as 1.
    pub fn new(width: u32, height: u32) -> Self {
        Self::for_quantity(FilmQuantity::Radiance, width, height)
    }

    /// Creates a previewer of this size that shows `quantity`.
    pub fn for_quantity(quantity: FilmQuantity, width: u32, height: u32) -> Self {
        let (width, height) = (width.max(1), height.max(1));
        Self { quantity, width, height, film_id: None, shares: Vec::new(), next: 0, is_whole: false }
    }

    /// Quantity shown in the previews.
    pub fn quantity(&self) -> FilmQuantity {
        self.quantity
    }

    /// Columns and rows of the previews.
    pub fn size(&self) -> (u32, u32) {
        (self.width, self.height)
    }

    /// Bytes used by the cache.
    pub fn memory_bytes(&self) -> u64 {
        let cells: usize = self.shares.iter().map(|share| share.cells.capacity()).sum();
        (cells * size_of::<WeightedColor>() + self.shares.capacity() * size_of::<TileContribution>()) as u64
    }

    /// Whether every tile of the film has been processed at least once. If so, the result of
    /// [`Previewer::build_radiance_image`] has no gaps but may be slightly outdated.
    pub fn has_processed_all_tiles(&self) -> bool {
        self.is_whole
    }

    /// Processes changed tiles until `deadline`, and returns whether all of them were processed. The next
    /// call continues with the remaining tiles. Without a deadline, processes all changes. Different calls
    /// may pass different films.
    pub fn refresh_changed_tiles(&mut self, film: &Film, deadline: Option<Instant>) -> bool {
        if self.film_id != Some(film.id()) {
            self.film_id = Some(film.id());
            self.shares = vec![TileContribution::default(); film.tile_count()];
            (self.next, self.is_whole) = (0, false);
        }
        let axes = [
            AxisPixelMapping::new(film.width(), self.width),
            AxisPixelMapping::new(film.height(), self.height),
        ];
        let at_once =
            if is_in_thread_pool() { TILES_AT_ONCE * rayon::current_num_threads() } else { TILES_AT_ONCE };
        let mut looked = 0;
        while looked < self.shares.len() {
            let end = (self.next + at_once).min(self.shares.len());
            refresh_tile_contributions(
                &mut self.shares[self.next..end],
                self.next,
                (film, self.quantity),
                axes,
            );
            looked += end - self.next;
            self.next = if end == self.shares.len() { 0 } else { end };
            self.is_whole |= self.next == 0;
            if looked < self.shares.len() && deadline.is_some_and(|deadline| Instant::now() >= deadline) {
                return false;
            }
        }
        true
    }

    /// Builds the preview from the processed tiles. Pixels without samples show `base` (a coarse image of any
    /// size), or black if there is no base.
    pub fn build_radiance_image(&self, base: Option<&RadianceImage>) -> RadianceImage {
        let width = self.width as usize;
        let mut pixels = Vec::with_capacity(width * self.height as usize);
        let mut base = base.map(Cow::Borrowed);
        for top in (0..self.height).step_by(BAND_ROWS as usize) {
            let rows = top..self.height.min(top + BAND_ROWS);
            let mut band: Vec<WeightedColorF64> = vec![(DVec3::ZERO, 0.0); width * rows.len()];
            for share in &self.shares {
                share.add_to(&mut band, rows.clone(), self.width);
            }
            // Enlarge the base only if some of it is visible.
            if band.iter().any(|(_, weight)| *weight <= 0.0) {
                base = base.map(|base| match (base.width, base.height) == (self.width, self.height) {
                    true => base,
                    false => Cow::Owned(base.resized(self.width, self.height)),
                });
            }
            let start = pixels.len();
            pixels.extend(band.into_iter().enumerate().map(|(i, (sum, weight))| match &base {
                _ if weight > 0.0 => (sum / weight).as_vec3(),
                Some(base) => base.pixels.get(start + i).copied().unwrap_or(Vec3::ZERO),
                None => Vec3::ZERO,
            }));
        }
        RadianceImage { width: self.width, height: self.height, pixels }
    }
}

/// Updates the contributions of consecutive tiles, starting with tile `first`.
fn refresh_tile_contributions(
    shares: &mut [TileContribution],
    first: usize,
    (film, quantity): (&Film, FilmQuantity),
    axes: [AxisPixelMapping; 2],
) {
    let refresh = |(i, share): (usize, &mut TileContribution)| {
        if film.lock_tile(first + i).revision != share.revision {
            share.refresh((film, quantity), first + i, axes);
        }
    };
    if is_in_thread_pool() && shares.len() > TILES_AT_ONCE {
        shares.par_iter_mut().enumerate().with_min_len(TILES_AT_ONCE / 4).for_each(refresh);
    } else {
        shares.iter_mut().enumerate().for_each(refresh);
    }
}

impl TileContribution {
    fn refresh(
        &mut self,
        (film, quantity): (&Film, FilmQuantity),
        tile: usize,
        [columns, rows]: [AxisPixelMapping; 2],
    ) {
        let Some(rect) = film.tile_rect(tile) else { return };
        let first = |axis: AxisPixelMapping, index| {
            axis.overlapping_target_pixels(index).next().map_or(0, |(new, _)| new)
        };
        let last = |axis: AxisPixelMapping, index| {
            axis.overlapping_target_pixels(index).last().map_or(0, |(new, _)| new)
        };
        (self.x, self.y) = (first(columns, rect.x), first(rows, rect.y));
        self.width = last(columns, rect.x + rect.width - 1) - self.x + 1;
        let height = last(rows, rect.y + rect.height - 1) - self.y + 1;
        let mut sums: Vec<WeightedColorF64> = vec![(DVec3::ZERO, 0.0); self.width as usize * height as usize];
        let across: Vec<Vec<_>> =
            (rect.x..rect.x + rect.width).map(|x| columns.overlapping_target_pixels(x).collect()).collect();
        let tile = film.lock_tile(tile);
        self.revision = tile.revision;
        for y in 0..rect.height {
            let down = rows.overlapping_target_pixels(rect.y + y);
            for (x, across) in across.iter().enumerate() {
                let index = y as usize * rect.width as usize + x;
                let place = (index, rect.width as usize);
                let Some(mean) = tile.value(quantity, place) else { continue };
                for (row, row_weight) in down.clone() {
                    let line = &mut sums[(row - self.y) as usize * self.width as usize..];
                    for &(column, column_weight) in across {
                        let (sum, weight) = &mut line[(column - self.x) as usize];
                        *sum += mean * (row_weight * column_weight);
                        *weight += row_weight * column_weight;
                    }
                }
            }
        }
        self.cells.clear();
        self.cells.extend(sums.into_iter().map(|(sum, weight)| (sum.as_vec3(), weight as f32)));
    }

    /// Adds this contribution to a range of preview rows.
    fn add_to(&self, band: &mut [WeightedColorF64], rows: Range<u32>, picture_width: u32) {
        let width = self.width.max(1) as usize;
        let first = rows.start.saturating_sub(self.y) as usize;
        let own = self.cells.chunks_exact(width).zip(self.y..).skip(first);
        for (cells, y) in own.take_while(|(_, y)| *y < rows.end) {
            let start = (y - rows.start) as usize * picture_width as usize + self.x as usize;
            for (pixel, cell) in band[start..].iter_mut().zip(cells) {
                pixel.0 += cell.0.as_dvec3();
                pixel.1 += f64::from(cell.1);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::{Rect, TileSamples};

    /// A film with one sample of `value` in pixel (x, y), or no sample if `value` is `None`.
    fn film(width: u32, height: u32, crop: Option<Rect>, value: impl Fn(u32, u32) -> Option<f32>) -> Film {
        let film = Film::new(width, height, crop).expect("a small film");
        for tile in 0..film.tile_count() {
            let rect = film.tile_rect(tile).expect("a tile");
            for (x, y) in (0..rect.area() as u32).map(|i| (rect.x + i % rect.width, rect.y + i / rect.width))
            {
                if let Some(value) = value(x, y) {
                    let rect = Rect { x, y, width: 1, height: 1 };
                    film.add_samples(
                        tile,
                        TileSamples {
                            pixels: rect.into(),
                            samples: 1,
                            radiance: vec![Vec3::splat(value)],
                            negative: None,
                            layers: Default::default(),
                        },
                    );
                }
            }
        }
        film
    }

    fn preview(film: &Film, width: u32, height: u32, base: Option<&RadianceImage>) -> RadianceImage {
        let mut previewer = Previewer::new(width, height);
        assert!(previewer.refresh_changed_tiles(film, None));
        previewer.build_radiance_image(base)
    }

    fn pattern(x: u32, y: u32) -> f32 {
        (x * 7 + y * 13 + x * y) as f32 % 11.0
    }

    fn mean(image: &RadianceImage) -> f64 {
        image.pixels.iter().map(|p| f64::from(p.x)).sum::<f64>() / image.pixels.len() as f64
    }

    #[test]
    fn preview_equals_the_resized_image() {
        let film = film(77, 45, None, |x, y| Some(pattern(x, y)));
        let whole = film.radiance_image();
        for (width, height) in [(1, 1), (2, 3), (13, 7), (40, 45), (77, 45), (100, 91)] {
            let picture = preview(&film, width, height, None);
            assert!((mean(&picture) - mean(&whole)).abs() < 1e-5, "{width}×{height}");
            for (a, b) in picture.pixels.iter().zip(&whole.resized(width, height).pixels) {
                assert!((a - b).abs().max_element() < 1e-5, "{width}×{height}: {a} {b}");
            }
        }
    }

    #[test]
    fn pixels_without_samples_show_the_base() {
        // Every other row of the left half is rendered.
        let film = film(64, 64, None, |x, y| (x < 32 && y % 2 == 0).then_some(5.0));
        let base = RadianceImage { width: 1, height: 1, pixels: vec![Vec3::splat(2.0)] };
        let picture = preview(&film, 8, 8, Some(&base));
        for (i, pixel) in picture.pixels.iter().enumerate() {
            assert_eq!(pixel.x, if i % 8 < 4 { 5.0 } else { 2.0 }, "pixel {i}");
        }
        assert_eq!(preview(&film, 8, 8, None).pixels[7], Vec3::ZERO);
    }

    #[test]
    fn previewed_crops_keep_their_position() {
        let film = film(100, 60, Some(Rect { x: 50, y: 30, width: 500, height: 500 }), |_, _| Some(1.0));
        let picture = preview(&film, 10, 6, None);
        for (i, pixel) in picture.pixels.iter().enumerate() {
            let inside = i % 10 >= 5 && i / 10 >= 3;
            assert_eq!(pixel.x, f32::from(u8::from(inside)), "pixel {i}");
        }
    }

    #[test]
    fn previewer_detects_changes_and_new_films() {
        let mut previewer = Previewer::new(9, 5);
        let first = film(70, 40, None, |x, _| (x < 20).then_some(1.0));
        let mut picture = |film: &Film| {
            previewer.refresh_changed_tiles(film, None);
            previewer.build_radiance_image(None)
        };
        assert_eq!(picture(&first), preview(&first, 9, 5, None));
        let rect = first.tile_rect(1).expect("a tile");
        let samples = TileSamples {
            pixels: rect.into(),
            samples: 2,
            radiance: vec![Vec3::Y; rect.area() * 2],
            negative: None,
            layers: Default::default(),
        };
        first.add_samples(1, samples);
        let changed = picture(&first);
        assert_eq!(changed, preview(&first, 9, 5, None));
        assert!(changed.pixels.iter().any(|p| p.x == 0.0 && p.y == 1.0), "the new tile should be visible");
        let second = film(30, 50, None, |x, y| Some(pattern(x, y)));
        assert_eq!(picture(&second), preview(&second, 9, 5, None));
    }

    /// A film of 46 × 46 tiles. Each tile's radiance is its index.
    fn tiled() -> Film {
        let film = Film::new(32 * 46, 32 * 46, None).expect("a film");
        for tile in 0..film.tile_count() {
            let rect = film.tile_rect(tile).expect("a tile");
            let value = Vec3::splat(tile as f32);
            film.add_samples(
                tile,
                TileSamples {
                    pixels: rect.into(),
                    samples: 1,
                    radiance: vec![value; rect.area()],
                    negative: None,
                    layers: Default::default(),
                },
            );
        }
        film
    }

    #[test]
    fn parallel_previews_are_identical() {
        let film = tiled();
        let alone = preview(&film, 23, 23, None);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().expect("a pool");
        assert_eq!(pool.install(|| preview(&film, 23, 23, None)), alone);
        // Each preview pixel covers 2×2 tiles: two consecutive indices in each of two rows.
        for (i, pixel) in alone.pixels.iter().enumerate() {
            let (column, row) = (2 * (i % 23), 2 * (i / 23));
            let expected = (row * 46 + column) as f32 + 23.5;
            assert!((pixel.x - expected).abs() < 1e-3, "{i}: {} {expected}", pixel.x);
        }
    }

    #[test]
    fn updates_stop_at_the_deadline_and_resume() {
        let film = tiled();
        let mut previewer = Previewer::new(23, 23);
        let past = Instant::now();
        let slices = film.tile_count().div_ceil(TILES_AT_ONCE);
        for slice in 1..=slices {
            assert!(!previewer.has_processed_all_tiles());
            assert!(!previewer.refresh_changed_tiles(&film, Some(past)), "slice {slice}");
        }
        assert!(previewer.has_processed_all_tiles());
        assert_eq!(previewer.build_radiance_image(None), preview(&film, 23, 23, None));
        // Changes to tiles before the current position are processed in the next pass.
        previewer.refresh_changed_tiles(&film, Some(past));
        let rect = film.tile_rect(0).expect("a tile");
        film.add_samples(
            0,
            TileSamples {
                pixels: rect.into(),
                samples: 1,
                radiance: vec![Vec3::splat(1e6); rect.area()],
                negative: None,
                layers: Default::default(),
            },
        );
        for _ in 0..slices {
            previewer.refresh_changed_tiles(&film, Some(past));
        }
        assert!(previewer.has_processed_all_tiles());
        assert_eq!(previewer.build_radiance_image(None), preview(&film, 23, 23, None));
        assert!(previewer.refresh_changed_tiles(&film, None));
    }
}
