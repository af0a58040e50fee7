//! Unscaled sections of a film.

use super::{Film, FilmQuantity, RadianceImage, Rect};
use crate::math::Vec3;

impl Film {
    /// Copies a rectangle of pixels without scaling. Pixels without samples show `base` (a full image of any
    /// size), or black if there is no base.
    pub fn image_in_rect(
        &self,
        quantity: FilmQuantity,
        rect: Rect,
        base: Option<&RadianceImage>,
    ) -> RadianceImage {
        let mut image = RadianceImage::black(rect.width, rect.height);
        if let Some(base) = base {
            self.fill_image_from_base(base, rect, &mut image);
        }
        for index in 0..self.tile_count() {
            let Some(place) = self.tile_rect(index) else { continue };
            let Some(part) = place.intersection(&rect) else { continue };
            let tile = self.lock_tile(index);
            for y in part.y..part.y + part.height {
                for x in part.x..part.x + part.width {
                    let columns = place.width as usize;
                    let at = (y - place.y) as usize * columns + (x - place.x) as usize;
                    let value = tile.value(quantity, (at, columns));
                    if let Some(value) = value {
                        image.pixels[pixel_index_in_rect(rect, x, y)] = value.as_vec3();
                    }
                }
            }
        }
        image
    }

    fn fill_image_from_base(&self, base: &RadianceImage, rect: Rect, image: &mut RadianceImage) {
        let at = |pixel: u32, from: u32, to: u32| u64::from(pixel) * u64::from(to) / u64::from(from);
        for y in rect.y..rect.y + rect.height {
            let row = at(y, self.height(), base.height) as usize * base.width as usize;
            for x in rect.x..rect.x + rect.width {
                let pixel = base.pixels.get(row + at(x, self.width(), base.width) as usize);
                image.pixels[pixel_index_in_rect(rect, x, y)] = pixel.copied().unwrap_or(Vec3::ZERO);
            }
        }
    }
}

fn pixel_index_in_rect(rect: Rect, x: u32, y: u32) -> usize {
    (y - rect.y) as usize * rect.width as usize + (x - rect.x) as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::TileSamples;

    #[test]
    fn sections_match_the_image_and_show_the_base() {
        let film = Film::new(100, 70, None).expect("a film");
        for tile in (0..film.tile_count()).filter(|tile| tile % 2 == 0) {
            let rect = film.tile_rect(tile).expect("a tile");
            let radiance = (0..rect.area()).map(|i| Vec3::splat((tile * 10_000 + i) as f32)).collect();
            film.add_samples(
                tile,
                TileSamples {
                    pixels: rect.into(),
                    samples: 1,
                    radiance,
                    negative: None,
                    layers: Default::default(),
                },
            );
        }
        let base = RadianceImage { width: 2, height: 1, pixels: vec![Vec3::X, Vec3::Y] };
        let rect = Rect { x: 20, y: 11, width: 60, height: 50 };
        let section = film.image_in_rect(FilmQuantity::Radiance, rect, Some(&base));
        for (i, pixel) in (0..).zip(&section.pixels) {
            let (x, y) = (rect.x + i % rect.width, rect.y + i / rect.width);
            let below = if x < 50 { Vec3::X } else { Vec3::Y };
            assert_eq!(*pixel, film.pixel(FilmQuantity::Radiance, x, y).unwrap_or(below), "{x}, {y}");
        }
        assert!(section.pixels.contains(&Vec3::X) && section.pixels.contains(&Vec3::Y));
    }
}
