//! Layers: further quantities of the image's samples, such as the albedo at the first hit.

use super::sums::{Film, FilmError, NegativeLobeSums, Tile, add_finite, can_allocate, tile_rect};
use super::{RadianceImage, Rect};
use crate::math::{DVec3, Vec3};
use crate::system::memory::try_reserve_exact;

/// Sums of a layer's values in one tile. The image's sample counts apply.
#[derive(Debug, Default)]
pub(super) struct LayerSums {
    pub(super) sums: Vec<DVec3>,
    /// Sums of the samples in the filter's negative lobes, which `sums` excludes. Empty until there is such a
    /// sample.
    pub(super) negative: Vec<DVec3>,
}

impl LayerSums {
    /// Resizes the sums to `area` pixels. Cannot fail because the film reserved the memory.
    pub(super) fn resize(&mut self, area: usize) {
        self.sums.resize(area, DVec3::ZERO);
    }

    /// Adds consecutive samples to a pixel. `is_negative` contains one flag per sample. Non-finite values are
    /// treated as black.
    pub(super) fn add(&mut self, index: usize, values: &[Vec3], is_negative: Option<&[bool]>) {
        let Some(is_negative) = is_negative else {
            add_finite(&mut self.sums[index], values);
            return;
        };
        self.negative.resize(self.sums.len(), DVec3::ZERO);
        for (value, &is_negative) in values.iter().zip(is_negative) {
            let sums = if is_negative { &mut self.negative } else { &mut self.sums };
            add_finite(&mut sums[index], std::slice::from_ref(value));
        }
    }
}

impl Tile {
    /// Mean of a pixel's values in a layer. `None` if the pixel has no samples or the layer does not exist.
    fn layer_mean(&self, layer: usize, index: usize) -> Option<DVec3> {
        let LayerSums { sums, negative } = self.layers.get(layer)?;
        self.signed_mean(
            index,
            || sums[index],
            |_: &NegativeLobeSums| negative.get(index).copied().unwrap_or_default(),
        )
    }
}

impl Film {
    /// Adds layers to an empty film.
    ///
    /// # Errors
    /// [`FilmError::Memory`] if there is not enough memory for the layers.
    pub fn with_layers(mut self, count: usize) -> Result<Self, FilmError> {
        let more = Self::layer_memory(self.crop(), count);
        let (width, height, bytes) = (self.width(), self.height(), self.memory_bytes() + more);
        let lacks = || FilmError::Memory { width, height, bytes, crop_helps: true };
        if !can_allocate(more) {
            return Err(lacks());
        }
        for tile in 0..self.tile_count() {
            let area = self.tile_rect(tile).map_or(0, |rect| rect.area());
            let mut layers = Vec::with_capacity(count);
            for _ in 0..count {
                let mut sums = Vec::new();
                try_reserve_exact(&mut sums, area).map_err(|_| lacks())?;
                layers.push(LayerSums { sums, negative: Vec::new() });
            }
            self.lock_tile(tile).layers = layers;
        }
        self.layers = count;
        Ok(self)
    }

    /// Memory in bytes for the sums of `count` layers of a crop.
    pub fn layer_memory(crop: Rect, count: usize) -> u64 {
        crop.area() as u64 * (count * size_of::<DVec3>()) as u64
    }

    /// Mean of a layer's values in every pixel, black outside the crop and in pixels without samples.
    pub fn layer_image(&self, layer: usize) -> RadianceImage {
        let mut image = RadianceImage::black(self.width(), self.height());
        for number in 0..self.tile_count() {
            let (rect, tile) = (tile_rect(self.crop(), number), self.lock_tile(number));
            let mean = |index: usize| tile.layer_mean(layer, index).map_or(Vec3::ZERO, DVec3::as_vec3);
            let pixels: Vec<Vec3> = (0..rect.area()).map(mean).collect();
            image.set_rect(rect, &pixels);
        }
        image
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::{NegativeLobeSamples, StoredTile, TileSamples};
    use crate::math::random::unit_generator;

    /// Samples of a 40 × 3 film whose two layers are 1 and 2 times the radiance. The filter has negative lobes
    /// if `is_signed`.
    fn samples(film: &Film, tile: usize, seed: u64, is_signed: bool) -> TileSamples {
        let rect = film.tile_rect(tile).expect("a tile");
        let mut next = unit_generator(seed);
        let radiance: Vec<Vec3> = (0..5 * rect.area()).map(|_| Vec3::new(next(), next(), next())).collect();
        let is_negative: Vec<bool> = radiance.iter().map(|value| value.x > 0.7).collect();
        let negative = is_signed.then_some(NegativeLobeSamples { weight: 0.1, is_negative });
        let layers = vec![radiance.clone(), radiance.iter().map(|value| value * 2.0).collect()];
        TileSamples { pixels: rect.into(), samples: 5, radiance, negative, layers }
    }

    fn film() -> Film {
        Film::new(40, 3, None).and_then(|film| film.with_layers(2)).expect("a film")
    }

    #[test]
    fn layer_means_equal_means_of_the_same_samples() {
        for is_signed in [false, true] {
            let film = film();
            for (seed, tile) in [(1, 0), (2, 1), (3, 0)] {
                film.add_samples(tile, &samples(&film, tile, seed, is_signed));
            }
            let image = film.radiance().pixels;
            assert_eq!(film.layer_image(0).pixels, image);
            for (double, pixel) in film.layer_image(1).pixels.iter().zip(&image) {
                assert!((*double - *pixel * 2.0).abs().max_element() < 1e-6, "{double} {pixel}");
            }
            assert_eq!(film.layer_image(2), RadianceImage::black(40, 3));
        }
    }

    #[test]
    fn restored_layers_continue_identically() {
        for is_signed in [false, true] {
            let (whole, restored) = (film(), film());
            for tile in 0..2 {
                whole.add_samples(tile, &samples(&whole, tile, 5, is_signed));
                let mut bytes = Vec::new();
                assert!(whole.serialize_tile(tile, &mut bytes));
                let area = whole.tile_rect(tile).expect("a tile").area();
                let read = || StoredTile::read(&bytes, area).expect("a tile");
                restored.restore_tile(tile, read()).expect("the tile should fit the film");
                // A film with other layers refuses the tile.
                assert!(Film::new(40, 3, None).expect("a film").restore_tile(tile, read()).is_err());
                for film in [&whole, &restored] {
                    film.add_samples(tile, &samples(film, tile, 6, is_signed));
                }
            }
            for layer in 0..2 {
                assert_eq!(whole.layer_image(layer), restored.layer_image(layer));
            }
        }
    }

    #[test]
    fn non_finite_layer_values_are_black() {
        let film = film();
        let mut samples = samples(&film, 1, 9, false);
        for values in &mut samples.layers {
            values.fill(Vec3::new(f32::NAN, 1.0, 1.0));
            values.iter_mut().step_by(5).for_each(|value| *value = Vec3::ONE);
        }
        film.add_samples(1, &samples);
        assert_eq!(film.non_finite_samples(), 0);
        assert!(film.layer_image(0).pixels.iter().skip(32).take(8).all(|pixel| *pixel == Vec3::splat(0.2)));
    }
}
