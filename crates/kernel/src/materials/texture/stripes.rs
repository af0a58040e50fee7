//! Checkerboards and bands: patterns of two tones along the texture coordinates.
//!
//! Both are products of square waves, so their mean over a box is a closed form: the mean of a square wave
//! over an interval is the difference of two values of its integral, a triangle wave (Heckbert, *Survey of
//! Texture Mapping*, 1986, section on direct filtering). The box is the bounding box of the footprint.

use super::mapping::TextureMapping;
use super::wrap::finite_or_zero;
use crate::materials::footprint::TexturePoint;
use crate::math::{DVec2, Vec2};

/// A checkerboard with 2 × 2 cells per repetition. The first tone is at the corner (0, 0).
#[derive(Clone, Debug, PartialEq)]
pub struct Checker {
    /// Maps texture coordinates to repetitions.
    pub mapping: TextureMapping,
}

/// Stripes of equal width, two per repetition along u. The first tone is at the edge u = 0.
#[derive(Clone, Debug, PartialEq)]
pub struct Bands {
    /// Maps texture coordinates to repetitions.
    pub mapping: TextureMapping,
}

/// Distance over which slopes of heights are computed, in repetitions, unless the footprint is larger.
const SLOPE_STEP: f64 = 1.0 / 64.0;

impl Checker {
    /// Fraction of the second tone in the footprint, or at the point if `is_filtered` is false.
    pub fn second_color_share(&self, at: &TexturePoint, is_filtered: bool) -> f32 {
        let (point, extents) = point_and_extents(&self.mapping, at, is_filtered);
        share_from_wave(square_wave(point.x, extents.x) * square_wave(point.y, extents.y))
    }

    /// Slopes of [`Checker::second_color_share`] along u and v.
    pub fn slopes(&self, at: &TexturePoint, is_filtered: bool) -> Vec2 {
        let (point, extents) = point_and_extents(&self.mapping, at, is_filtered);
        let [x, y] = [square_wave(point.x, extents.x), square_wave(point.y, extents.y)];
        let slopes = DVec2::new(wave_slope(point.x, extents.x) * y, wave_slope(point.y, extents.y) * x);
        self.mapping.texture_slopes_to_uv(slopes * -0.5)
    }

    /// Number of cells per unit of u and v.
    pub fn cells_per_uv_unit(&self) -> [f64; 2] {
        self.mapping.cells_per_uv_unit(DVec2::splat(2.0))
    }
}

impl Bands {
    /// Fraction of the second tone in the footprint, or at the point if `is_filtered` is false.
    pub fn second_color_share(&self, at: &TexturePoint, is_filtered: bool) -> f32 {
        let (point, extents) = point_and_extents(&self.mapping, at, is_filtered);
        share_from_wave(square_wave(point.x, extents.x))
    }

    /// Slopes of [`Bands::second_color_share`] along u and v.
    pub fn slopes(&self, at: &TexturePoint, is_filtered: bool) -> Vec2 {
        let (point, extents) = point_and_extents(&self.mapping, at, is_filtered);
        self.mapping.texture_slopes_to_uv(DVec2::new(wave_slope(point.x, extents.x) * -0.5, 0.0))
    }

    /// Number of bands per unit of u and v.
    pub fn cells_per_uv_unit(&self) -> [f64; 2] {
        self.mapping.cells_per_uv_unit(DVec2::new(2.0, 0.0)).map(|count| count.max(1.0))
    }
}

/// The point in repetitions, and the extents of the box to average over.
fn point_and_extents(mapping: &TextureMapping, at: &TexturePoint, is_filtered: bool) -> (DVec2, DVec2) {
    let extents = if is_filtered { mapping.footprint_extents(at) } else { DVec2::ZERO };
    (mapping.map_point(at), extents)
}

/// Converts a wave between 1 (the first tone) and −1 (the second) to the fraction of the second tone.
fn share_from_wave(wave: f64) -> f32 {
    (0.5 - 0.5 * wave) as f32
}

/// Mean over an interval of this width around `x` of a square wave that is 1 in [0, ½) and −1 in [½, 1), with
/// period 1.
fn square_wave(x: f64, width: f64) -> f64 {
    let x = finite_or_zero(x);
    let x = x - x.floor();
    // Narrower intervals would lose all digits in the difference of the integrals.
    if !(width > 1e-9) {
        return if x < 0.5 { 1.0 } else { -1.0 };
    }
    let width = width.min(1e9);
    let integral = |x: f64| {
        let x = x - x.floor();
        x.min(1.0 - x)
    };
    ((integral(x + 0.5 * width) - integral(x - 0.5 * width)) / width).clamp(-1.0, 1.0)
}

/// Slope of [`square_wave`]: the difference of the wave at the ends of the interval, divided by its width.
/// The width is at least [`SLOPE_STEP`].
fn wave_slope(x: f64, width: f64) -> f64 {
    let step = width.max(SLOPE_STEP);
    (square_wave(x + 0.5 * step, 0.0) - square_wave(x - 0.5 * step, 0.0)) / step
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::materials::footprint::{Footprint, UvSet};
    use crate::materials::texture::mapping::UvTransform;
    use crate::math::Vec3;

    /// A point whose footprint has these extents along u and v.
    fn point(u: f64, v: f64, [du, dv]: [f32; 2]) -> TexturePoint {
        // The cone is one unit wide. The tangents are the reciprocals of the extents.
        let tangents = [Vec3::X / du, Vec3::Y / dv];
        let footprint = Footprint::from_ray_cone(1.0, Vec3::NEG_Z, Vec3::Z, tangents);
        TexturePoint { footprint, ..TexturePoint::from_uv(DVec2::new(u, v)) }
    }

    fn mapping(repeat: Vec2, degrees: f64, offset: DVec2) -> TextureMapping {
        TextureMapping { repeat, moved: UvTransform::new(UvSet::First, degrees, offset).map(Box::new) }
    }

    /// Mean of unfiltered lookups over a box around a point, with the midpoint rule.
    fn mean(share: impl Fn(DVec2) -> f32, center: DVec2, extents: DVec2, count: u32) -> f64 {
        let at = |i: u32, center: f64, extent: f64| {
            center + extent * ((f64::from(i) + 0.5) / f64::from(count) - 0.5)
        };
        let mut sum = 0.0;
        for j in 0..count {
            for i in 0..count {
                let uv = DVec2::new(at(i, center.x, extents.x), at(j, center.y, extents.y));
                sum += f64::from(share(uv));
            }
        }
        sum / f64::from(count).powi(2)
    }

    #[test]
    fn first_tone_is_at_the_corner() {
        let checker = Checker { mapping: mapping(Vec2::new(2.0, 1.0), 0.0, DVec2::ZERO) };
        let share =
            |u: f64, v: f64| checker.second_color_share(&TexturePoint::from_uv(DVec2::new(u, v)), false);
        // Cells are a quarter wide and half a unit high.
        for (u, v, expected) in [
            (0.0, 0.0, 0.0),
            (0.249, 0.499, 0.0),
            (0.25, 0.0, 1.0),
            (0.0, 0.5, 1.0),
            (0.25, 0.5, 0.0),
            (-0.01, 0.0, 1.0),
            (-0.01, -0.01, 0.0),
            (f64::NAN, f64::INFINITY, 0.0),
        ] {
            assert_eq!(share(u, v), expected, "{u}, {v}");
        }
    }

    #[test]
    fn bands_alternate_along_u() {
        let bands = Bands { mapping: mapping(Vec2::new(3.0, 5.0), 0.0, DVec2::ZERO) };
        let share =
            |u: f64, v: f64| bands.second_color_share(&TexturePoint::from_uv(DVec2::new(u, v)), false);
        for i in 0..12 {
            let expected = (i % 2) as f32;
            // Just inside both edges of the band.
            for u in [f64::from(i) / 6.0 + 1e-12, f64::from(i + 1) / 6.0 - 1e-12] {
                assert_eq!([share(u, 0.0), share(u, 0.37)], [expected; 2], "{u}");
            }
        }
        assert_eq!(bands.cells_per_uv_unit(), [6.0, 1.0]);
    }

    #[test]
    fn filtered_tones_equal_the_integral() {
        // Edges fall between the samples of the midpoint rule, so it is exact.
        let checker = Checker { mapping: mapping(Vec2::ONE, 0.0, DVec2::ZERO) };
        let bands = Bands { mapping: mapping(Vec2::ONE, 0.0, DVec2::ZERO) };
        let count = 96;
        for extents in [[0.125, 0.25], [0.5, 1.0], [0.75, 0.375], [1.5, 0.5], [6.0, 3.0]] {
            for (i, j) in (0..8).flat_map(|j| (0..8).map(move |i| (i, j))) {
                let center = DVec2::new(f64::from(i), f64::from(j)) / 8.0;
                let at = point(center.x, center.y, extents);
                let extents = DVec2::new(f64::from(extents[0]), f64::from(extents[1]));
                let sharp = |uv: DVec2| checker.second_color_share(&TexturePoint::from_uv(uv), true);
                let expected = mean(sharp, center, extents, count);
                let share = f64::from(checker.second_color_share(&at, true));
                assert!((share - expected).abs() < 1e-6, "{center} {extents}: {share} {expected}");
                let sharp = |uv: DVec2| bands.second_color_share(&TexturePoint::from_uv(uv), true);
                let expected = mean(sharp, center, DVec2::new(extents.x, 0.0), count);
                let share = f64::from(bands.second_color_share(&at, true));
                assert!((share - expected).abs() < 1e-6, "{center} {extents}: {share} {expected}");
            }
        }
    }

    #[test]
    fn filter_preserves_the_mean_over_an_area() {
        let checker = Checker { mapping: mapping(Vec2::new(2.0, 3.0), 30.0, DVec2::new(0.3, 0.1)) };
        let bands = Bands { mapping: mapping(Vec2::new(2.0, 3.0), 0.0, DVec2::new(0.3, 0.0)) };
        for extents in [[1e-6, 1e-6], [0.01, 0.07], [0.2, 0.3], [3.0, 0.1]] {
            let of_bands = |uv: DVec2| bands.second_color_share(&point(uv.x, uv.y, extents), true);
            let found = mean(of_bands, DVec2::splat(0.5), DVec2::ONE, 600);
            assert!((found - 0.5).abs() < 1e-6, "{extents:?}: {found}");
            // The rotated board repeats only approximately, so average over many cells.
            let of_checker = |uv: DVec2| checker.second_color_share(&point(uv.x, uv.y, extents), true);
            let found = mean(of_checker, DVec2::splat(0.5), DVec2::splat(200.0), 700);
            assert!((found - 0.5).abs() < 3e-3, "{extents:?}: {found}");
        }
    }

    #[test]
    fn filter_ignores_footprints_unless_asked() {
        let checker = Checker { mapping: TextureMapping::IDENTITY };
        let wide = point(0.3, 0.3, [5.0, 5.0]);
        assert_eq!(checker.second_color_share(&wide, false), 0.0);
        assert!((checker.second_color_share(&wide, true) - 0.5).abs() < 0.01);
        let endless = TexturePoint { footprint: Footprint::POINT, ..wide };
        assert_eq!(checker.second_color_share(&endless, true), 0.0);
    }

    #[test]
    fn rotated_footprints_filter_along_the_pattern() {
        // After a quarter turn, the bands run along u and the footprint along v blurs them.
        let turned = Bands { mapping: mapping(Vec2::ONE, 90.0, DVec2::ZERO) };
        let along_u = turned.second_color_share(&point(0.2, 0.2, [9.0, 1e-4]), true);
        let along_v = turned.second_color_share(&point(0.2, 0.2, [1e-4, 1.0]), true);
        // (u, v) is mapped to (−v, u), and −0.2 is in the second band.
        assert_eq!(along_u, 1.0);
        assert!((along_v - 0.5).abs() < 1e-6, "{along_v}");
    }

    #[test]
    fn slopes_are_derivatives_of_the_filtered_tone() {
        let step = 1e-3;
        let checker = Checker { mapping: mapping(Vec2::new(2.0, -1.0), 25.0, DVec2::new(0.1, 0.2)) };
        let bands = Bands { mapping: mapping(Vec2::new(2.0, -1.0), 25.0, DVec2::new(0.1, 0.2)) };
        for (u, v) in [(0.0, 0.1), (0.13, 0.4), (0.37, 0.77), (0.6, 0.2)] {
            let at = |du: f64, dv: f64| point(u + du, v + dv, [0.11, 0.13]);
            for (slopes, share) in [
                (
                    checker.slopes(&at(0.0, 0.0), true),
                    &(|at: &TexturePoint| checker.second_color_share(at, true))
                        as &dyn Fn(&TexturePoint) -> f32,
                ),
                (bands.slopes(&at(0.0, 0.0), true), &|at: &TexturePoint| bands.second_color_share(at, true)),
            ] {
                // A difference over a step averages the derivative, which is piecewise linear.
                let change = |du: f64, dv: f64| {
                    (share(&at(du, dv)) - share(&at(-du, -dv))) / (2.0 * du.max(dv)) as f32
                };
                let expected = Vec2::new(change(step, 0.0), change(0.0, step));
                assert!((slopes - expected).abs().max_element() < 0.05, "{u} {v}: {slopes} {expected}");
            }
        }
        // Without a footprint, only the neighborhood of an edge has slopes.
        let sharp = |u: f64| bands_along_u().slopes(&TexturePoint::from_uv(DVec2::new(u, 0.0)), false);
        assert_eq!([sharp(0.25), sharp(0.5)], [Vec2::ZERO, Vec2::new(64.0, 0.0)]);
    }

    fn bands_along_u() -> Bands {
        Bands { mapping: TextureMapping::IDENTITY }
    }
}
