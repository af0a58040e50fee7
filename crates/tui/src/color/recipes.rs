//! Dithering recipes, which approximate a color by mixing palette colors ("inks").
//!
//! A recipe is a list of [`PARTS`] inks whose mean in linear light approximates the color. Inks close to that
//! color are preferred. Each ink's error is carried over to the next ink, in an Oklab space linearized at the
//! color (after J. Yliluoma and T. Knoll, "pattern dithering"). The list is sorted by lightness and the
//! dither threshold selects an entry, so the result depends only on the color and the pixel position.

use std::collections::HashMap;

use super::oklab::{OklabDerivative, linear_to_oklab};
use crate::math::Vec3;
use crate::math::color::srgb8_color_to_linear;

/// Number of inks in a dithering recipe.
pub(super) const PARTS: usize = 16;
/// Number of candidate inks per recipe. The inks nearest to the color are used.
const NEAREST: usize = 32;
/// Maximum number of cached recipes.
const MAX_RECIPES: usize = 1 << 16;

/// A solid color or a fine pattern of two colors.
#[derive(Clone, Copy, Debug)]
pub(super) struct SolidOrPatternColor {
    linear: Vec3,
    lab: Vec3,
    /// Mean squared distance from a pattern's two colors to their mean. Zero for solid colors.
    texture: f32,
}

impl SolidOrPatternColor {
    /// Creates an ink with a solid color.
    pub(super) fn solid(rgb: [u8; 3]) -> Self {
        let linear = srgb8_color_to_linear(rgb);
        Self { linear, lab: linear_to_oklab(linear), texture: 0.0 }
    }

    /// Creates a color from a fine pattern of `front` over `back`. `share` is the fraction of the area
    /// covered by `front`.
    pub(super) fn from_two_color_pattern(front: &Self, back: &Self, share: f32) -> Self {
        /// Texture weight for patterns inside a cell, which are less visible than patterns made of whole
        /// cells.
        const FINENESS: f32 = 0.25;
        let linear = front.linear * share + back.linear * (1.0 - share);
        let lab = linear_to_oklab(linear);
        let texture =
            share * front.lab.distance_squared(lab) + (1.0 - share) * back.lab.distance_squared(lab);
        Self { linear, lab, texture: texture * FINENESS }
    }
}

/// Cached dithering recipes for a set of inks.
#[derive(Debug, Default)]
pub(super) struct DitherRecipeCache {
    inks: Vec<SolidOrPatternColor>,
    /// Weight given to an ink's distance from the color, relative to the error in the recipe's mean.
    calm: f32,
    recipes: HashMap<[u8; 3], [u16; PARTS]>,
}

impl DitherRecipeCache {
    /// Creates a ditherer for these inks. With `calm` = 0, only the mean matters. Larger values favor inks
    /// near the color.
    pub(super) fn new(inks: Vec<SolidOrPatternColor>, calm: f32) -> Self {
        Self { inks, calm, recipes: HashMap::new() }
    }

    /// Returns the index of the ink that a color and a dither threshold in (0, 1) select.
    pub(super) fn select_color_index(&mut self, rgb: [u8; 3], threshold: f32) -> usize {
        let part = ((threshold * PARTS as f32) as usize).min(PARTS - 1);
        let recipe = match self.recipes.get(&rgb) {
            Some(recipe) => *recipe,
            None => self.compute_and_cache_recipe(rgb),
        };
        usize::from(recipe[part])
    }

    fn compute_and_cache_recipe(&mut self, rgb: [u8; 3]) -> [u16; PARTS] {
        if self.recipes.len() >= MAX_RECIPES {
            self.recipes.clear();
        }
        let recipe = self.compute_recipe(rgb);
        self.recipes.insert(rgb, recipe);
        recipe
    }

    fn compute_recipe(&self, rgb: [u8; 3]) -> [u16; PARTS] {
        let linear = srgb8_color_to_linear(rgb);
        let lab = linear_to_oklab(linear);
        let slope = OklabDerivative::at(linear);
        let mut near: Vec<(f32, usize)> = self
            .inks
            .iter()
            .enumerate()
            .map(|(index, ink)| (ink.lab.distance_squared(lab) + ink.texture, index))
            .collect();
        let most = NEAREST.min(near.len());
        if most < near.len() {
            near.select_nth_unstable_by(most, |a, b| a.0.total_cmp(&b.0));
        }
        near.truncate(most);
        // Break ties by index.
        near.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let off: Vec<Vec3> =
            near.iter().map(|(_, index)| slope.apply(self.inks[*index].linear - linear)).collect();
        let mut parts = [0_u16; PARTS];
        let mut rest = Vec3::ZERO;
        for part in &mut parts {
            let cost = |i: usize| (rest + off[i]).length_squared() + self.calm * near[i].0;
            let best = (0..near.len()).min_by(|a, b| cost(*a).total_cmp(&cost(*b))).unwrap_or(0);
            rest += off.get(best).copied().unwrap_or_default();
            *part = near.get(best).map_or(0, |(_, index)| *index as u16);
        }
        let lightness = |index: &u16| self.inks.get(usize::from(*index)).map_or(0.0, |ink| ink.lab.x);
        parts.sort_by(|a, b| lightness(a).total_cmp(&lightness(b)).then(a.cmp(b)));
        parts
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::color::palette;

    fn cube() -> DitherRecipeCache {
        DitherRecipeCache::new(
            (16..=255).filter_map(palette::fixed_palette_color).map(SolidOrPatternColor::solid).collect(),
            0.1,
        )
    }

    #[test]
    fn ink_colors_are_not_dithered() {
        let mut mixer = cube();
        for index in [0, 5, 100, 215, 230] {
            let rgb = palette::fixed_palette_color(16 + index).expect("a fixed color");
            for part in 0..PARTS {
                let ink = mixer.select_color_index(rgb, (part as f32 + 0.5) / PARTS as f32);
                assert_eq!(palette::fixed_palette_color(16 + ink as u8), Some(rgb));
            }
        }
    }

    #[test]
    fn recipe_mean_matches_the_color() {
        let mut mixer = cube();
        for rgb in [[150, 75, 50], [101, 67, 33], [30, 60, 90], [200, 190, 180], [115, 115, 110]] {
            let parts: Vec<usize> = (0..PARTS)
                .map(|part| mixer.select_color_index(rgb, (part as f32 + 0.5) / PARTS as f32))
                .collect();
            let mean = parts.iter().map(|ink| mixer.inks[*ink].linear).sum::<Vec3>() / PARTS as f32;
            let off = linear_to_oklab(mean).distance(linear_to_oklab(srgb8_color_to_linear(rgb)));
            assert!(off < 0.02, "{rgb:?}: {off}");
        }
    }

    #[test]
    fn recipe_inks_are_similar() {
        let mut mixer = cube();
        let lab = linear_to_oklab(srgb8_color_to_linear([150, 75, 50]));
        for part in 0..PARTS {
            let ink = mixer.select_color_index([150, 75, 50], (part as f32 + 0.5) / PARTS as f32);
            assert!(mixer.inks[ink].lab.distance(lab) < 0.15);
        }
    }
}
