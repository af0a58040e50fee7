//! Procedural textures: two colors, mixed by a pattern that is computed instead of stored.

use super::mapping::TextureMapping;
use super::noise::{FilteredNoiseValue, Noise};
use super::stripes::{Bands, Checker};
use crate::materials::footprint::{ObjectPoint, TexturePoint};
use crate::math::lanes::{PACKET_SIZE, Vec3x16, set_lane};
use crate::math::{DVec2, Vec2, Vec3};

/// A texture that mixes two colors.
#[derive(Clone, Debug, PartialEq)]
pub struct PatternTexture {
    /// Where each color is.
    pub pattern: Pattern,
    /// The colors. Numbers use the same value in every channel.
    pub colors: [Vec3; 2],
    /// Whether lookups average over the footprint.
    pub is_filtered: bool,
}

/// A function of the position with values from 0 (the first color) to 1 (the second color).
#[derive(Clone, Debug, PartialEq)]
pub enum Pattern {
    /// A checkerboard.
    Checker(Checker),
    /// Stripes.
    Bands(Bands),
    /// Gradient noise.
    Noise(Noise),
}

/// Slopes of a height.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum HeightGradient {
    /// Derivatives along u and v.
    AlongUv(Vec2),
    /// The gradient in world coordinates. Its component along the normal has no meaning.
    World(Vec3),
}

impl Pattern {
    /// The pattern at a point, or its mean over the footprint if `is_filtered` is true.
    fn second_color_share(&self, at: &TexturePoint, is_filtered: bool) -> f32 {
        match self {
            Self::Checker(checker) => checker.second_color_share(at, is_filtered),
            Self::Bands(bands) => bands.second_color_share(at, is_filtered),
            Self::Noise(noise) => share_from_noise(noise.evaluate(at, is_filtered).value),
        }
    }

    /// Fraction of the footprint in which a mix of two values is at least `cutoff`.
    fn coverage_above_cutoff(
        &self,
        at: &TexturePoint,
        is_filtered: bool,
        [first, second]: [f32; 2],
        cutoff: f32,
    ) -> f32 {
        let cut = |value: f32| f32::from(u8::from(value >= cutoff));
        match self {
            Self::Checker(_) | Self::Bands(_) => {
                mix(cut(first), cut(second), self.second_color_share(at, is_filtered))
            }
            Self::Noise(noise) => {
                let FilteredNoiseValue { value, removed_variance } = noise.evaluate(at, is_filtered);
                let mean = mix(first, second, share_from_noise(value));
                // Approximate the distribution of the faded octaves by a parabola with the same variance,
                // which is a fifth of its squared half width.
                let half_width = 0.5 * (second - first).abs() * (5.0 * removed_variance).sqrt();
                if half_width > 0.0 {
                    let x = ((mean - cutoff) / half_width).clamp(-1.0, 1.0);
                    0.5 + x * (0.75 - 0.25 * x * x)
                } else {
                    cut(mean)
                }
            }
        }
    }

    /// Slopes of the pattern.
    fn slopes(&self, at: &TexturePoint, is_filtered: bool) -> HeightGradient {
        match self {
            Self::Checker(checker) => HeightGradient::AlongUv(checker.slopes(at, is_filtered)),
            Self::Bands(bands) => HeightGradient::AlongUv(bands.slopes(at, is_filtered)),
            Self::Noise(noise) => {
                let gradient = noise.value_gradient(at, is_filtered).as_dvec3() * 0.5;
                let to_world = |object: &ObjectPoint| (object.from_world.transpose() * gradient).as_vec3();
                HeightGradient::World(at.object_point().map_or(Vec3::ZERO, to_world))
            }
        }
    }

    /// Maps texture coordinates to the pattern, or `None` if the pattern does not use them.
    #[inline]
    pub fn mapping(&self) -> Option<&TextureMapping> {
        match self {
            Self::Checker(Checker { mapping }) | Self::Bands(Bands { mapping }) => Some(mapping),
            Self::Noise(_) => None,
        }
    }

    /// Whether the pattern is a function of the point in the shape's own coordinates instead of the texture
    /// coordinates.
    #[inline]
    pub fn uses_object_point(&self) -> bool {
        match self {
            Self::Checker(_) | Self::Bands(_) => false,
            Self::Noise(_) => true,
        }
    }

    /// Number of cells per unit of u and v for sampling the pattern as a light. The cells of noise do not
    /// follow u and v, so the number is arbitrary.
    fn cells_per_uv_unit(&self) -> [f64; 2] {
        match self {
            Self::Checker(checker) => checker.cells_per_uv_unit(),
            Self::Bands(bands) => bands.cells_per_uv_unit(),
            Self::Noise(_) => [64.0; 2],
        }
    }
}

impl PatternTexture {
    /// The color at a point.
    pub fn lookup(&self, at: &TexturePoint) -> Vec3 {
        let share = self.pattern.second_color_share(at, self.is_filtered);
        self.colors[0] * (1.0 - share) + self.colors[1] * share
    }

    /// Packet version of [`PatternTexture::lookup`], for unfiltered patterns of the texture coordinates.
    pub fn lookup_packet(&self, uv: &[[f64; PACKET_SIZE]; 2]) -> Vec3x16 {
        let mut colors = [[0.0; PACKET_SIZE]; 3];
        for i in 0..PACKET_SIZE {
            set_lane(&mut colors, i, self.lookup(&TexturePoint::from_uv(DVec2::new(uv[0][i], uv[1][i]))));
        }
        colors
    }

    /// Fraction of the footprint where the red channel is at least `cutoff`. Without a filter, the fraction
    /// is 0 or 1.
    pub fn coverage_above_cutoff(&self, at: &TexturePoint, cutoff: f32) -> f32 {
        let values = self.colors.map(|color| color.x);
        self.pattern.coverage_above_cutoff(at, self.is_filtered, values, cutoff)
    }

    /// Slopes of the red channel.
    pub fn slopes(&self, at: &TexturePoint) -> HeightGradient {
        let height = self.colors[1].x - self.colors[0].x;
        match self.pattern.slopes(at, self.is_filtered) {
            HeightGradient::AlongUv(slopes) => HeightGradient::AlongUv(slopes * height),
            HeightGradient::World(gradient) => HeightGradient::World(gradient * height),
        }
    }

    /// Whether the texture is 0 everywhere.
    pub fn is_black(&self) -> bool {
        self.colors == [Vec3::ZERO; 2]
    }

    /// Mean over a large area.
    pub fn mean(&self) -> Vec3 {
        (self.colors[0] + self.colors[1]) * 0.5
    }

    /// Number of cells per unit of u and v.
    pub fn cells_per_uv_unit(&self) -> [f64; 2] {
        self.pattern.cells_per_uv_unit()
    }
}

/// Maps noise from [−1, 1] to [0, 1].
fn share_from_noise(noise: f32) -> f32 {
    0.5 + 0.5 * noise
}

/// Interpolates linearly. The ends are exact.
fn mix(first: f32, second: f32, share: f32) -> f32 {
    first * (1.0 - share) + second * share
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::materials::footprint::{ExtraCoordinates, Footprint};
    use crate::math::lanes::lane;
    use crate::math::random::TestRandom;
    use crate::math::{DMat3, DVec3};

    const COLORS: [Vec3; 2] = [Vec3::new(0.2, 0.3, 0.7), Vec3::new(0.9, 0.1, 0.6)];

    fn checker(colors: [Vec3; 2], is_filtered: bool) -> PatternTexture {
        let mapping = TextureMapping { repeat: Vec2::new(3.0, 2.0), moved: None };
        PatternTexture { pattern: Pattern::Checker(Checker { mapping }), colors, is_filtered }
    }

    fn noise(colors: [Vec3; 2], is_filtered: bool) -> PatternTexture {
        let pattern = Pattern::Noise(Noise { size: 1.0, octaves: 3, seed: 1 });
        PatternTexture { pattern, colors, is_filtered }
    }

    fn object_point(position: DVec3, width: f32, from_world: DMat3) -> TexturePoint {
        let object = Some(ObjectPoint { position, width, from_world });
        let extra = Some(Box::new(ExtraCoordinates { second: None, object }));
        TexturePoint { extra, ..TexturePoint::from_uv(DVec2::ZERO) }
    }

    #[test]
    fn patterns_show_exactly_their_colors() {
        let texture = checker(COLORS, false);
        let at = |u: f64, v: f64| texture.lookup(&TexturePoint::from_uv(DVec2::new(u, v)));
        assert_eq!([at(0.0, 0.0), at(0.2, 0.0), at(0.2, 0.3)], [COLORS[0], COLORS[1], COLORS[0]]);
        assert_eq!(texture.mean(), (COLORS[0] + COLORS[1]) * 0.5);
        assert!(!texture.is_black() && checker([Vec3::ZERO; 2], false).is_black());
    }

    #[test]
    fn packet_lookups_match_single_lookups() {
        let texture = checker(COLORS, false);
        let mut random = TestRandom::new(1);
        let hostile = [f64::NAN, f64::INFINITY, -1e300, 0.0, -0.0, 1.0_f64.next_down(), -1e-20, 0.25];
        for _ in 0..200 {
            let mut uv = [[0.0; PACKET_SIZE]; 2];
            for (i, number) in uv.as_flattened_mut().iter_mut().enumerate() {
                *number = if i % 3 == 0 { *random.pick(&hostile) } else { random.signed() * 3.0 };
            }
            let row = texture.lookup_packet(&uv);
            for i in 0..PACKET_SIZE {
                let alone = texture.lookup(&TexturePoint::from_uv(DVec2::new(uv[0][i], uv[1][i])));
                assert_eq!(lane(&row, i), alone, "{} {}", uv[0][i], uv[1][i]);
            }
        }
    }

    #[test]
    fn coverage_of_tones_is_their_share() {
        let texture = checker([Vec3::splat(0.8), Vec3::splat(0.1)], true);
        let tangents = [Vec3::X * 20.0, Vec3::Y * 50.0];
        let footprint = Footprint::from_ray_cone(1.0, Vec3::NEG_Z, Vec3::Z, tangents);
        for u in [0.0, 0.05, 0.15, 0.16, 0.2] {
            let at = TexturePoint { footprint, ..TexturePoint::from_uv(DVec2::new(u, 0.1)) };
            let share = texture.pattern.second_color_share(&at, true);
            assert_eq!(texture.coverage_above_cutoff(&at, 0.5), 1.0 - share, "{u}");
            let all = [0.05, 0.1, 0.8, 0.9].map(|cutoff| texture.coverage_above_cutoff(&at, cutoff));
            assert_eq!(all, [1.0, 1.0, 1.0 - share, 0.0], "{u}");
        }
    }

    #[test]
    fn coverage_of_noise_survives_the_filter() {
        let texture = noise([Vec3::ZERO, Vec3::ONE], true);
        let mean = |width: f32, cutoff: f32| {
            let mut random = TestRandom::new(5);
            let mut sum = 0.0;
            for _ in 0..20_000 {
                let at = object_point(random.in_cube() * 50.0, width, DMat3::IDENTITY);
                sum += f64::from(texture.coverage_above_cutoff(&at, cutoff));
            }
            sum / 20_000.0
        };
        for cutoff in [0.4, 0.5, 0.6] {
            let near = mean(0.0, cutoff);
            assert!((0.1..0.9).contains(&near), "{cutoff}: {near}");
            for width in [0.2, 0.4, 0.8, 5.0] {
                let far = mean(width, cutoff);
                assert!((far - near).abs() < 0.03, "{cutoff} {width}: {far} instead of {near}");
            }
        }
    }

    #[test]
    fn noise_gradients_follow_the_transform() {
        let texture = noise([Vec3::splat(0.25), Vec3::splat(0.75)], false);
        let from_world = DMat3::from_cols(
            DVec3::new(2.0, 0.0, 1.0),
            DVec3::new(0.0, -1.0, 0.5),
            DVec3::new(0.3, 0.0, 1.0),
        );
        let world = DVec3::new(0.3, 1.7, -0.4);
        let at = |world: DVec3| object_point(from_world * world, 0.0, from_world);
        let HeightGradient::World(gradient) = texture.slopes(&at(world)) else { panic!("a gradient") };
        let step = 1e-3;
        let change = |axis: DVec3| {
            let [a, b] = [-step, step].map(|step| texture.lookup(&at(world + axis * step)).x);
            (b - a) / (2.0 * step) as f32
        };
        let expected = Vec3::new(change(DVec3::X), change(DVec3::Y), change(DVec3::Z));
        assert!((gradient - expected).length() < 2e-3, "{gradient} {expected}");
    }
}
