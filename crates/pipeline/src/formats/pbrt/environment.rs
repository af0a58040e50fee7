//! Combines pbrt's infinite lights into one environment map.

use std::f64::consts::{FRAC_2_PI, PI, TAU};
use std::ops::Range;

use rayon::prelude::*;

use super::lexer::{PbrtError, PbrtResult};
use super::memo;
use super::parameters::Text;
use super::scene::PbrtConverter;
use crate::assets::image::{ColorEncoding, ImageLimits, load_and_hash};
use crate::assets::{Companion, FileHash};
use crate::control::ignore_progress;
use crate::formats::foreign::pixels::Pixels;
use crate::formats::rounding::shorten_color;
use crate::math::color::luminance;
use crate::math::{DMat4, DVec2, DVec3, Vec3};
use crate::system::file::FileStamp;

/// Samples per texel along each axis.
const SUBSAMPLES: usize = 2;
/// Samples per texel along each axis where the radiance varies by more than [`CONTRAST`].
const FINE_SUBSAMPLES: usize = 8;
/// Ratio of the largest to the smallest sample in a texel and its neighbors above which the texel gets
/// [`FINE_SUBSAMPLES`], so that small bright sources keep their power.
const CONTRAST: f32 = 3.0;
/// Smallest and largest number of rows of an environment map.
const ROWS: [usize; 2] = [64, 2048];

/// The infinite lights of a scene.
#[derive(Default)]
pub(super) struct InfiniteLights {
    /// Sum of all constant infinite lights.
    pub(super) color: DVec3,
    pub(super) images: Vec<InfiniteImage>,
}

/// An infinite light with an image.
pub(super) struct InfiniteImage {
    pub(super) file: Text,
    pub(super) scale: f64,
    /// Illuminance from the upper hemisphere to which the image is normalized, before `scale` is applied.
    pub(super) illuminance: Option<f64>,
    /// Light-to-world transform.
    pub(super) matrix: DMat4,
    pub(super) span: Range<usize>,
}

/// A decoded image of an infinite light.
struct InfiniteLightMap {
    pixels: Pixels,
    scale: f64,
    /// World-to-light transform.
    to_light: DMat4,
    /// Hash of the file.
    hash: FileHash,
}

impl PbrtConverter<'_> {
    /// Writes the `[environment]` table.
    pub(super) fn convert_infinite_lights(&mut self, lights: &InfiniteLights) -> PbrtResult<()> {
        if lights.images.is_empty() {
            if lights.color != DVec3::ZERO {
                self.document.start_table("environment");
                self.document.set("color", shorten_color(lights.color));
            }
            return Ok(());
        }
        let mut maps = Vec::new();
        for image in &lights.images {
            maps.push(self.load_map(image)?);
        }
        // Cache the result by everything it depends on.
        let mut key = format!("{:?}", lights.color);
        for (image, map) in lights.images.iter().zip(&maps) {
            key.push_str(&format!("{:?} {:?} {:?}", map.hash, map.scale, image.matrix));
        }
        let rows = maps.iter().map(|map| map.pixels.height).max().unwrap_or(ROWS[0]);
        let rows = rows.clamp(ROWS[0], ROWS[1]);
        let bytes = memo::memoized_environment_map(key, || {
            combine_as_equirectangular(&maps, lights.color, rows).encode_pfm(false)
        });
        let span = lights.images[0].file.span.clone();
        let name = self.add_generated_file("environment", "pfm", bytes);
        self.document.set_span_for_next_values(span);
        self.document.start_table("environment");
        self.document.set("file", name);
        Ok(())
    }

    fn load_map(&mut self, image: &InfiniteImage) -> PbrtResult<InfiniteLightMap> {
        let path = self.asset_path(&image.file.text);
        let (limits, encoding) = (ImageLimits::default(), ColorEncoding::Color);
        let stamp = FileStamp::from_path(&path);
        let loaded = load_and_hash(&path, encoding, limits, &ignore_progress, self.token);
        let hash = loaded.as_ref().ok().map(|(_, hash)| *hash);
        self.companions.push(Companion { path, hash, stamp });
        let (decoded, hash) =
            loaded.map_err(|error| PbrtError::new(image.file.span.clone(), error.to_string()))?;
        let (width, height) = (decoded.texels.width as usize, decoded.texels.height as usize);
        let pixels = Pixels { width, height, values: decoded.texels.into_linear_colors() };
        if width != height {
            let text = "it is treated as an equirectangular map, as in pbrt-v3";
            self.notes.note("a non-square image of an infinite light", text, image.span.clone());
        }
        let scale = match image.illuminance {
            Some(goal) => image.scale * goal / upper_illuminance(&pixels).max(1e-12),
            None => image.scale,
        };
        Ok(InfiniteLightMap { pixels, scale, to_light: image.matrix.inverse(), hash })
    }
}

/// Illuminance from the upper hemisphere, as pbrt computes it: with a weight of 2π/n for each of n texels.
fn upper_illuminance(pixels: &Pixels) -> f64 {
    let of_texel = |index: usize| {
        let (column, row) = (index % pixels.width, index / pixels.width);
        let at = DVec2::new(column as f64 + 0.5, row as f64 + 0.5)
            / DVec2::new(pixels.width as f64, pixels.height as f64);
        f64::from(luminance(pixels.values[index])) * direction_of_square(at).z.max(0.0)
    };
    let sum: f64 = (0..pixels.values.len()).map(of_texel).sum();
    sum * TAU / pixels.values.len() as f64
}

impl InfiniteLightMap {
    /// Radiance from a direction in world coordinates.
    fn radiance(&self, direction: DVec3) -> DVec3 {
        let local = self.to_light.transform_vector3(direction).normalize_or_zero();
        let (width, height) = (self.pixels.width, self.pixels.height);
        let at = if width == height {
            square_of_direction(local)
        } else {
            let azimuth = libm::atan2(local.y, local.x);
            let azimuth = if azimuth < 0.0 { azimuth + TAU } else { azimuth };
            DVec2::new(azimuth / TAU, libm::acos(local.z.clamp(-1.0, 1.0)) / PI)
        };
        let texel = |part: f64, count: usize| ((part * count as f64) as usize).min(count - 1);
        self.pixels.get(texel(at.x, width), texel(at.y, height)) * self.scale
    }
}

/// Statistics of the samples in a texel.
#[derive(Clone, Copy)]
struct TexelSampleStats {
    mean: Vec3,
    /// Smallest and largest sample, measured by the largest color component.
    least: f32,
    most: f32,
}

/// Takes `count`² samples in a texel of the environment map.
fn supersample_texel(
    maps: &[InfiniteLightMap],
    rows: usize,
    column: usize,
    row: usize,
    count: usize,
) -> TexelSampleStats {
    let (mut sum, mut least, mut most) = (DVec3::ZERO, f64::INFINITY, 0.0_f64);
    for index in 0..count * count {
        let offset = |index: usize| (index as f64 + 0.5) / count as f64;
        let u = (column as f64 + offset(index % count)) / (2 * rows) as f64;
        let v = (row as f64 + offset(index / count)) / rows as f64;
        let direction = glimt_map_direction(u, v);
        let radiance: DVec3 = maps.iter().map(|map| map.radiance(direction)).sum();
        (least, most) = (least.min(radiance.max_element()), most.max(radiance.max_element()));
        sum += radiance;
    }
    let mean = (sum / (count * count) as f64).as_vec3();
    TexelSampleStats { mean, least: least as f32, most: most as f32 }
}

/// Resamples the sum of all maps and a constant as an equirectangular map. Takes more samples where
/// neighboring texels differ strongly.
fn combine_as_equirectangular(maps: &[InfiniteLightMap], color: DVec3, rows: usize) -> Pixels {
    let columns = 2 * rows;
    let coarse: Vec<TexelSampleStats> = (0..rows * columns)
        .into_par_iter()
        .map(|index| supersample_texel(maps, rows, index % columns, index / columns, SUBSAMPLES))
        .collect();
    let has_contrast = |column: usize, row: usize| {
        let (mut least, mut most) = (f32::INFINITY, 0.0_f32);
        for near in row.saturating_sub(1)..(row + 2).min(rows) {
            for offset in [columns - 1, 0, 1] {
                let texel = coarse[near * columns + (column + offset) % columns];
                (least, most) = (least.min(texel.least), most.max(texel.most));
            }
        }
        most > CONTRAST * least
    };
    let value = |index: usize| {
        let (column, row) = (index % columns, index / columns);
        let radiance = if has_contrast(column, row) {
            supersample_texel(maps, rows, column, row, FINE_SUBSAMPLES).mean
        } else {
            coarse[index].mean
        };
        (radiance + color.as_vec3()).max(Vec3::ZERO)
    };
    let values = (0..rows * columns).into_par_iter().map(value).collect();
    Pixels { width: columns, height: rows, values }
}

/// Direction of a point in glimt's environment maps. v = 0 is +y, and the center is −z.
fn glimt_map_direction(u: f64, v: f64) -> DVec3 {
    let (sine, cosine) = libm::sincos(PI * v);
    let (across, along) = libm::sincos(TAU * (u - 0.5));
    DVec3::new(sine * across, cosine, -sine * along)
}

/// Maps a unit vector to the square of an equal-area octahedral map (Clarberg, *Fast Equal-Area Mapping of
/// the (Hemi)Sphere using SIMD*, 2008). (0, 0) is the top left corner, and the center is +z.
fn square_of_direction(direction: DVec3) -> DVec2 {
    let [x, y, z] = direction.abs().to_array();
    let radius = (1.0 - z).max(0.0).sqrt();
    let angle = FRAC_2_PI * libm::atan2(y, x);
    let (mut u, mut v) = (radius * (1.0 - angle), radius * angle);
    if direction.z < 0.0 {
        (u, v) = (1.0 - v, 1.0 - u);
    }
    DVec2::new(0.5 * (1.0 + u.copysign(direction.x)), 0.5 * (1.0 + v.copysign(direction.y)))
}

/// The inverse of [`square_of_direction`].
fn direction_of_square(at: DVec2) -> DVec3 {
    let plane = at * 2.0 - 1.0;
    let (u, v) = (plane.x.abs(), plane.y.abs());
    let distance = 1.0 - (u + v);
    let radius = 1.0 - distance.abs();
    let angle = if radius == 0.0 { 0.0 } else { PI / 4.0 * ((v - u) / radius + 1.0) };
    let z = (1.0 - radius * radius).copysign(distance);
    let (sine, cosine) = libm::sincos(angle);
    let horizontal = radius * (2.0 - radius * radius).max(0.0).sqrt();
    DVec3::new((cosine * horizontal).copysign(plane.x), (sine * horizontal).copysign(plane.y), z)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn square_mapping_is_inverted() {
        for index in 0..900 {
            let at = DVec2::new(f64::from(index % 30) + 0.5, f64::from(index / 30) + 0.5) / 30.0;
            let direction = direction_of_square(at);
            assert!((direction.length() - 1.0).abs() < 1e-12);
            assert!((square_of_direction(direction) - at).length() < 1e-9, "{at} {direction}");
        }
        assert!((direction_of_square(DVec2::splat(0.5)) - DVec3::Z).length() < 1e-12);
    }

    #[test]
    fn square_mapping_preserves_areas() {
        // Over uniformly distributed directions, z² and x² have a mean of 1/3.
        let count = 256;
        let directions: Vec<DVec3> = (0..count * count)
            .map(|index| {
                DVec2::new(f64::from(index % count) + 0.5, f64::from(index / count) + 0.5) / f64::from(count)
            })
            .map(direction_of_square)
            .collect();
        let mean = directions.iter().map(|direction| direction.z * direction.z).sum::<f64>()
            / directions.len() as f64;
        assert!((mean - 1.0 / 3.0).abs() < 1e-3, "{mean}");
        let mean = directions.iter().map(|direction| direction.x * direction.x).sum::<f64>()
            / directions.len() as f64;
        assert!((mean - 1.0 / 3.0).abs() < 1e-3, "{mean}");
    }

    #[test]
    fn small_sources_keep_their_power() {
        let size = 64;
        let mut values = vec![Vec3::splat(0.01); size * size];
        values[20 * size + 37] = Vec3::splat(1000.0);
        let exact = 4.0 * PI * (1000.0 + 0.01 * (size * size - 1) as f64) / (size * size) as f64;
        let map = InfiniteLightMap {
            pixels: Pixels { width: size, height: size, values },
            scale: 1.0,
            to_light: DMat4::IDENTITY,
            hash: [0; 32],
        };
        let resampled = combine_as_equirectangular(&[map], DVec3::ZERO, size);
        let row_angle = PI / resampled.height as f64;
        let power: f64 = (0..resampled.height)
            .flat_map(|row| (0..resampled.width).map(move |column| (column, row)))
            .map(|(column, row)| {
                let sine = ((row as f64 + 0.5) * row_angle).sin();
                resampled.get(column, row).x * sine * row_angle * TAU / resampled.width as f64
            })
            .sum();
        assert!((power / exact - 1.0).abs() < 0.02, "{power} {exact}");
    }

    #[test]
    fn resampled_map_has_the_radiance_of_its_light() {
        // The light is red around its +z axis, which is the world's +y axis.
        let values = (0..64 * 64)
            .map(|index| DVec2::new(f64::from(index % 64) + 0.5, f64::from(index / 64) + 0.5) / 64.0)
            .map(|at| if direction_of_square(at).z > 0.0 { Vec3::X } else { Vec3::Z })
            .collect();
        let pixels = Pixels { width: 64, height: 64, values };
        let matrix = DMat4::from_cols(
            DVec3::Z.extend(0.0),
            DVec3::X.extend(0.0),
            DVec3::Y.extend(0.0),
            crate::math::DVec4::W,
        );
        let map = InfiniteLightMap { pixels, scale: 2.0, to_light: matrix.inverse(), hash: [0; 32] };
        let resampled = combine_as_equirectangular(&[map], DVec3::new(0.0, 0.5, 0.0), 64);
        assert_eq!(resampled.get(17, 10), DVec3::new(2.0, 0.5, 0.0), "upper half");
        assert_eq!(resampled.get(90, 50), DVec3::new(0.0, 0.5, 2.0), "lower half");
    }
}
