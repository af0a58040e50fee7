//! Range mapping, which converts data without an inherent brightness (distances, counts) to brightness, based
//! on the range of values in view.

use super::RadianceImage;
use crate::math::Vec3;

/// Mapping from data values to brightness.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum DataBrightnessMap {
    /// Leaves the values unchanged.
    #[default]
    None,
    /// A mapping whose range is unknown until [`DataBrightnessMap::with_image_range`] sets it. Maps
    /// everything to black.
    Unresolved(DataKind),
    /// A mapping for values in this range.
    Resolved(DataKind, DataRange),
}

/// Kind of data, which determines how its values map to brightness.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DataKind {
    /// Distances: the nearest is white, the farthest is dark, and 0 (no hit) is black.
    Distances,
    /// Amounts: 0 is black, and the largest is white.
    Amounts,
}

/// Range of the values in view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DataRange {
    /// Smallest distance in view, or 0 for amounts.
    pub min: f32,
    /// Largest value in view.
    pub max: f32,
    /// Bias b of the curve between `min` and `max`; see [`DataRange::biased_range_position`].
    bias: f32,
}

/// Brightness of the largest distance.
const FARTHEST_BRIGHTNESS: f32 = 0.1;

/// Minimum brightness of the median value.
const MIN_MEDIAN_BRIGHTNESS: f32 = 0.25;

/// Minimum bias, which limits the steepness of the curve.
const MIN_BIAS: f32 = 1e-3;

impl DataBrightnessMap {
    /// Sets the range from the values in an image.
    pub fn with_image_range(self, image: &RadianceImage) -> Self {
        match self {
            Self::None | Self::Resolved(..) => self,
            Self::Unresolved(kind) => Self::Resolved(kind, DataRange::from_image(kind, image)),
        }
    }

    /// Range of the mapping, or `None` if it is unknown or values are not mapped.
    pub fn range(&self) -> Option<DataRange> {
        match self {
            Self::None | Self::Unresolved(_) => None,
            Self::Resolved(_, range) => Some(*range).filter(|range| range.min <= range.max),
        }
    }

    /// Maps the values of a pixel to brightness.
    pub fn map_to_brightness(&self, numbers: Vec3) -> Vec3 {
        let each = |of: &dyn Fn(f32) -> f32| Vec3::from_array(numbers.to_array().map(of));
        match self {
            Self::None => numbers,
            Self::Unresolved(_) => Vec3::ZERO,
            Self::Resolved(DataKind::Distances, range) => each(&|x| range.distance_brightness(x)),
            Self::Resolved(DataKind::Amounts, range) => each(&|x| range.biased_range_position(x)),
        }
    }
}

impl DataRange {
    fn from_image(kind: DataKind, image: &RadianceImage) -> Self {
        let mut seen = match kind {
            DataKind::Distances => depths_excluding_edges(image),
            DataKind::Amounts => image.pixels.iter().map(|pixel| pixel.x).filter(|x| *x > 0.0).collect(),
        };
        let max = seen.iter().copied().fold(0.0, f32::max);
        let min = match kind {
            DataKind::Distances => seen.iter().copied().fold(f32::INFINITY, f32::min),
            DataKind::Amounts => 0.0,
        };
        let linear = Self { min, max, bias: 1.0 };
        if seen.is_empty() {
            return linear;
        }
        let middle = seen.len() / 2;
        let (_, &mut median, _) = seen.select_nth_unstable_by(middle, f32::total_cmp);
        let place = linear.biased_range_position(median);
        let bias = (1.0 - MIN_MEDIAN_BRIGHTNESS) / MIN_MEDIAN_BRIGHTNESS * place
            / (1.0 - place).max(f32::MIN_POSITIVE);
        Self { bias: bias.clamp(MIN_BIAS, 1.0), ..linear }
    }

    /// Minimum and maximum of the range.
    pub fn limits(&self) -> [f32; 2] {
        [self.min, self.max]
    }

    /// Position of a value in the range, from 0 to 1. The mapping is linear if the median value in view is
    /// above the first quarter of the range. Otherwise it is the curve x/(x + b(1 − x)), which maps the
    /// median to ¼ (Schlick, *Fast Alternatives to Perlin's Bias and Gain Functions*, Graphics Gems IV,
    /// 1994). Objects therefore keep distinct shades in front of a plane that extends to the horizon.
    fn biased_range_position(&self, number: f32) -> f32 {
        let range = self.max - self.min;
        let x = if range > 0.0 { ((number - self.min) / range).clamp(0.0, 1.0) } else { 0.0 };
        if self.bias < 1.0 { x / (x + self.bias * (1.0 - x)) } else { x }
    }

    /// Brightness of a distance. Distances below the range occur in partly empty pixels.
    fn distance_brightness(&self, distance: f32) -> f32 {
        if distance < self.min {
            return if self.min.is_finite() { distance / self.min } else { distance.min(1.0) };
        }
        1.0 - (1.0 - FARTHEST_BRIGHTNESS) * self.biased_range_position(distance)
    }
}

/// Depths of the visible surfaces. Pixels at the edge of empty space mix depths with zeros, so they are used
/// only if there are no other pixels.
fn depths_excluding_edges(image: &RadianceImage) -> Vec<f32> {
    let (width, height) = (image.width as usize, image.height as usize);
    let at = |x: usize, y: usize| image.pixels[y * width + x].x;
    let is_whole = |x: usize, y: usize| {
        let around = |i: usize, end: usize| i.saturating_sub(1)..(i + 2).min(end);
        around(y, height).all(|y| around(x, width).all(|x| at(x, y) > 0.0))
    };
    let places = || (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let whole: Vec<f32> = places().filter(|&(x, y)| is_whole(x, y)).map(|(x, y)| at(x, y)).collect();
    if whole.is_empty() { places().map(|(x, y)| at(x, y)).filter(|x| *x > 0.0).collect() } else { whole }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(numbers: &[f32]) -> RadianceImage {
        let pixels = numbers.iter().map(|x| Vec3::splat(*x)).collect();
        RadianceImage { width: numbers.len() as u32, height: 1, pixels }
    }

    fn shown(kind: DataKind, numbers: &[f32]) -> Vec<f32> {
        let map = DataBrightnessMap::Unresolved(kind).with_image_range(&picture(numbers));
        numbers.iter().map(|x| map.map_to_brightness(Vec3::splat(*x)).x).collect()
    }

    fn assert_near(values: &[f32], expected: &[f32]) {
        let off = values.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(off < 1e-6, "got {values:?}, expected {expected:?}");
    }

    #[test]
    fn near_is_bright_and_far_is_dark() {
        assert_near(&shown(DataKind::Distances, &[2.0, 4.0, 6.0]), &[1.0, 0.55, 0.1]);
        assert_near(&shown(DataKind::Distances, &[3.0; 4]), &[1.0; 4]);
        assert_near(&shown(DataKind::Distances, &[0.0; 4]), &[0.0; 4]);
        let range = DataBrightnessMap::Unresolved(DataKind::Distances)
            .with_image_range(&picture(&[2.0, 4.0, 6.0]))
            .range();
        assert_eq!(range.map(|range| (range.min, range.max)), Some((2.0, 6.0)));
        let nothing =
            DataBrightnessMap::Unresolved(DataKind::Distances).with_image_range(&picture(&[0.0; 4]));
        assert_eq!(nothing.range(), None);
    }

    #[test]
    fn subpixel_objects_determine_the_range() {
        let range = DataBrightnessMap::Unresolved(DataKind::Distances)
            .with_image_range(&picture(&[0.0, 2.0, 0.0, 6.0, 0.0]))
            .range();
        assert_eq!(range.map(|range| range.limits()), Some([2.0, 6.0]));
    }

    #[test]
    fn objects_in_front_of_a_horizon_stay_distinct() {
        // A floor seen from a height of 1: the distance of each row is 200/row, and the last rows are far
        // away.
        let numbers: Vec<f32> = (1..=200).map(|row| 200.0 / row as f32).collect();
        let shown = shown(DataKind::Distances, &numbers);
        assert!(
            shown[199] == 1.0 && (shown[0] - 0.1).abs() < 1e-6,
            "the full brightness range should be used"
        );
        // Half of the rows are at distances 1 … 2. A linear mapping over 1 … 200 would make all of them
        // white.
        assert!((shown[99] - (1.0 - 0.9 * 0.25)).abs() < 0.01, "{}", shown[99]);
        assert!(shown.windows(2).all(|pair| pair[0] < pair[1]), "all shades differ");
    }

    #[test]
    fn amounts_range_from_black_to_white() {
        assert_near(&shown(DataKind::Amounts, &[0.0, 1.0, 2.0, 4.0]), &[0.0, 0.25, 0.5, 1.0]);
        assert_near(&shown(DataKind::Amounts, &[16.0; 3]), &[1.0; 3]);
        assert_near(&shown(DataKind::Amounts, &[0.0; 3]), &[0.0; 3]);
        // One very large value does not make the others black.
        let shown = shown(DataKind::Amounts, &[1.0, 1.0, 1.0, 1000.0]);
        assert!((shown[0] - 0.25).abs() < 0.01 && shown[3] == 1.0, "{shown:?}");
    }
}
