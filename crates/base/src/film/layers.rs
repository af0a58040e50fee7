//! Layers: additional quantities recorded with the image's samples, such as the albedo at the first hit.

use super::layer_sums::LayerSums;
use super::sums::{
    Film, FilmCreationError, NegativeLobeSums, Tile, can_allocate, lock, pixel_index_in_rect, tile_rect,
};
use super::{RadianceImage, Rect, SelectedPixels};
use crate::math::{DVec3, Vec3};
use crate::system::memory::try_reserve_exact;

impl Tile {
    /// Mean of a pixel's values in a layer, or `None` if the pixel has no samples or the layer does not
    /// exist.
    fn layer_mean(&self, layer: usize, index: usize) -> Option<DVec3> {
        let LayerSums { count, sums, negative } = &self.layers;
        let place = index * count + layer;
        let below = |_: &NegativeLobeSums| negative.get(place).copied().unwrap_or_default();
        if layer < *count { self.mean_from_filter_lobe_sums(index, || sums[place], below) } else { None }
    }
}

impl Film {
    /// Layer sums of the selected pixels of a tile, to which more samples can be added.
    pub fn tile_layer_sums(&self, tile: usize, pixels: SelectedPixels) -> LayerSums {
        let mut sums = lock(&self.spare_layers).pop().unwrap_or_default();
        let Some(rect) = self.tile_rect(tile) else {
            sums.reset(self.layers, pixels.count());
            return sums;
        };
        let tile = self.lock_tile(tile);
        if pixels == rect.into() && !tile.counts.is_empty() {
            sums.copy_from(&tile.layers);
            return sums;
        }
        sums.reset(self.layers, pixels.count());
        for i in 0..pixels.count() {
            let (x, y) = pixels.image_position(i as u32);
            if let Some(index) = pixel_index_in_rect(rect, x, y) {
                sums.replace_pixel(i, &tile.layers, index);
            }
        }
        sums
    }

    /// Adds layers to an empty film.
    ///
    /// # Errors
    /// [`FilmCreationError::Memory`] if there is not enough memory for the layers.
    pub fn with_layer_count(mut self, count: usize) -> Result<Self, FilmCreationError> {
        let more = Self::layer_bytes_for_crop(self.crop_rect(), count);
        let (width, height, bytes) = (self.width(), self.height(), self.memory_bytes() + more);
        let out_of_memory = || FilmCreationError::Memory { width, height, bytes, crop_helps: true };
        if !can_allocate(more) {
            return Err(out_of_memory());
        }
        for tile in 0..self.tile_count() {
            let area = self.tile_rect(tile).map_or(0, |rect| rect.area());
            let mut sums = Vec::new();
            try_reserve_exact(&mut sums, area * count).map_err(|_| out_of_memory())?;
            self.lock_tile(tile).layers = LayerSums { count, sums, negative: Vec::new() };
        }
        self.layers = count;
        Ok(self)
    }

    /// Memory in bytes for the sums of `count` layers of a crop.
    pub fn layer_bytes_for_crop(crop: Rect, count: usize) -> u64 {
        crop.area() as u64 * (count * size_of::<DVec3>()) as u64
    }

    /// One image per layer, with the mean of the layer's values in each pixel. Pixels outside the crop or
    /// without samples are black.
    pub fn layer_images(&self) -> Vec<RadianceImage> {
        let mut images = vec![RadianceImage::black(self.width(), self.height()); self.layers];
        for number in 0..self.tile_count() {
            let (rect, tile) = (tile_rect(self.crop_rect(), number), self.lock_tile(number));
            for index in 0..rect.area() {
                let (x, y) = (index % rect.width as usize, index / rect.width as usize);
                let place = (rect.y as usize + y) * self.width() as usize + rect.x as usize + x;
                for (layer, image) in images.iter_mut().enumerate() {
                    image.pixels[place] = tile.layer_mean(layer, index).map_or(Vec3::ZERO, DVec3::as_vec3);
                }
            }
        }
        images
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::{NegativeLobeSamples, StoredTile, TileSamples};
    use crate::math::random::unit_generator;

    /// Five samples per pixel of a 40 × 3 film whose two layers are 1 and 2 times the radiance. The filter
    /// has negative lobes if `is_signed`.
    fn samples(film: &Film, tile: usize, seed: u64, is_signed: bool) -> TileSamples {
        let pixels = SelectedPixels::from(film.tile_rect(tile).expect("a tile"));
        let mut next = unit_generator(seed);
        let radiance: Vec<Vec3> =
            (0..5 * pixels.count()).map(|_| Vec3::new(next(), next(), next())).collect();
        let is_negative: Vec<bool> = radiance.iter().map(|value| value.x > 0.7).collect();
        let mut layers = film.tile_layer_sums(tile, pixels);
        for (pixel, (values, signs)) in radiance.chunks(5).zip(is_negative.chunks(5)).enumerate() {
            let sample = |value: &Vec3| {
                let Vec3 { x, y, z } = *value;
                [x, y, z, 2.0 * x, 2.0 * y, 2.0 * z]
            };
            let values: Vec<f32> = values.iter().flat_map(sample).collect();
            layers.add_pixel_samples(pixel, &values, is_signed.then_some(signs));
        }
        let negative = is_signed.then_some(NegativeLobeSamples { weight: 0.1, is_negative });
        TileSamples { pixels, samples: 5, radiance, negative, layers }
    }

    fn film() -> Film {
        Film::new(40, 3, None).and_then(|film| film.with_layer_count(2)).expect("a film")
    }

    #[test]
    fn layer_means_equal_means_of_the_same_samples() {
        for is_signed in [false, true] {
            let film = film();
            for (seed, tile) in [(1, 0), (2, 1), (3, 0)] {
                film.add_samples(tile, samples(&film, tile, seed, is_signed));
            }
            let image = film.radiance_image().pixels;
            let layers = film.layer_images();
            assert_eq!((layers.len(), &layers[0].pixels), (2, &image));
            for (double, pixel) in layers[1].pixels.iter().zip(&image) {
                assert!((*double - *pixel * 2.0).abs().max_element() < 1e-6, "{double} {pixel}");
            }
        }
    }

    #[test]
    fn restored_layers_continue_identically() {
        for is_signed in [false, true] {
            let (whole, restored) = (film(), film());
            for tile in 0..2 {
                whole.add_samples(tile, samples(&whole, tile, 5, is_signed));
                let mut bytes = Vec::new();
                assert!(whole.serialize_tile(tile, &mut bytes));
                let area = whole.tile_rect(tile).expect("a tile").area();
                let read = || StoredTile::deserialize(&bytes, area).expect("a tile");
                restored.restore_tile(tile, read()).expect("the tile should fit the film");
                // A film with different layers rejects the tile.
                assert!(Film::new(40, 3, None).expect("a film").restore_tile(tile, read()).is_err());
                for film in [&whole, &restored] {
                    film.add_samples(tile, samples(film, tile, 6, is_signed));
                }
            }
            assert_eq!(whole.layer_images(), restored.layer_images());
        }
    }
}
