//! Gradient noise in the coordinates of the shape.
//!
//! An octave is Perlin's noise (*Improving Noise*, SIGGRAPH 2002): a lattice point has a random gradient, one
//! of the twelve directions toward the edges of a cube, and the linear functions of the eight lattice points
//! around a point are blended with the quintic 6t⁵ − 15t⁴ + 10t³. The gradients come from an integer hash of
//! the lattice point, so the noise has no period. It is 0 at every lattice point.

use crate::materials::footprint::TexturePoint;
use crate::math::random::hash;
use crate::math::{DVec3, Vec3};

/// A sum of octaves of gradient noise. Each octave has half the size and half the weight of the previous one.
#[derive(Clone, Debug, PartialEq)]
pub struct Noise {
    /// Distance between the lattice points of the first octave, in scene units.
    pub size: f64,
    /// Number of octaves, at least 1.
    pub octaves: u32,
    /// Selects the gradients.
    pub seed: u32,
}

/// The gradients.
const GRADIENTS: [Vec3; 12] = [
    Vec3::new(1.0, 1.0, 0.0),
    Vec3::new(-1.0, 1.0, 0.0),
    Vec3::new(1.0, -1.0, 0.0),
    Vec3::new(-1.0, -1.0, 0.0),
    Vec3::new(1.0, 0.0, 1.0),
    Vec3::new(-1.0, 0.0, 1.0),
    Vec3::new(1.0, 0.0, -1.0),
    Vec3::new(-1.0, 0.0, -1.0),
    Vec3::new(0.0, 1.0, 1.0),
    Vec3::new(0.0, -1.0, 1.0),
    Vec3::new(0.0, 1.0, -1.0),
    Vec3::new(0.0, -1.0, -1.0),
];

/// Scales an octave to [−1, 1]. Without it, the maximum is 1.0364.
const SCALE: f32 = 0.964;

/// Variance of an octave: the mean over a cell of Σ w²·|d|²·2/3, where w is the weight of a lattice point, d
/// the offset from it, and 2/3 the mean square of a component of a gradient; times [`SCALE`]².
const VARIANCE: f32 = 0.067_76;

/// Value of the noise, and the variance that the filter has removed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilteredNoiseValue {
    /// The value, in [−1, 1].
    pub value: f32,
    /// Variance of the faded octaves.
    pub removed_variance: f32,
}

impl Noise {
    /// Noise at a point, without the octaves that are smaller than the footprint if `is_filtered` is true.
    ///
    /// An octave of size s fades with smoothstep(s/w − 1), where w is the length of the footprint's longer
    /// axis: it is complete for s ≥ 2w, where it is sampled at least twice per lattice cell, and gone for s ≤
    /// w. This clamps the number of octaves, as `FBm` of pbrt-v4 does, but also fades the first octave.
    pub fn evaluate(&self, at: &TexturePoint, is_filtered: bool) -> FilteredNoiseValue {
        let (position, width) = object_position_and_width(at, is_filtered);
        let (mut value, mut removed_variance) = (0.0, 0.0);
        for octave in self.weighted_octaves(width) {
            removed_variance += octave.weight * octave.weight * (1.0 - octave.fade * octave.fade) * VARIANCE;
            if octave.fade > 0.0 {
                value += octave.weight * octave.fade * octave.cell(position).value();
            }
        }
        FilteredNoiseValue { value, removed_variance }
    }

    /// Gradient of the noise in the shape's own coordinates, filtered like the value.
    pub fn value_gradient(&self, at: &TexturePoint, is_filtered: bool) -> Vec3 {
        let (position, width) = object_position_and_width(at, is_filtered);
        let mut gradient = Vec3::ZERO;
        for octave in self.weighted_octaves(width).filter(|octave| octave.fade > 0.0) {
            let slope = octave.weight * octave.fade * (1.0 / octave.size) as f32;
            gradient += octave.cell(position).gradient() * slope;
        }
        gradient
    }

    /// The octaves with their weights, for a footprint of this width.
    fn weighted_octaves(&self, width: f64) -> impl Iterator<Item = Octave> {
        let total = 2.0 - 1.0 / f64::from(1_u32 << (self.octaves - 1));
        let seed = u64::from(self.seed) << 8;
        let size = self.size;
        (0..self.octaves).map(move |number| {
            let scale = 1.0 / f64::from(1_u32 << number);
            let size = size * scale;
            let above = (size / width - 1.0).clamp(0.0, 1.0) as f32;
            let fade = if width > 0.0 { above * above * (3.0 - 2.0 * above) } else { 1.0 };
            let key = hash(seed | u64::from(number));
            Octave { size, weight: (scale / total) as f32, fade, key }
        })
    }
}

/// The point in the shape's own coordinates, and the width of the footprint, or 0 if it is ignored.
fn object_position_and_width(at: &TexturePoint, is_filtered: bool) -> (DVec3, f64) {
    match at.object_point() {
        Some(object) => (object.position, if is_filtered { f64::from(object.width) } else { 0.0 }),
        None => (DVec3::ZERO, 0.0),
    }
}

/// An octave of the noise.
struct Octave {
    /// Distance between lattice points.
    size: f64,
    /// Weight in the sum. All weights add up to 1.
    weight: f32,
    /// Factor from the filter, in [0, 1].
    fade: f32,
    /// Selects the gradients.
    key: u64,
}

/// A lattice cell, and a point in it.
struct LatticeCell {
    /// The point, in [0, 1]³.
    at: Vec3,
    /// Gradients at the corners. Bits 0, 1 and 2 of the index are the offsets along x, y and z.
    gradients: [Vec3; 8],
}

impl Octave {
    /// The cell around a point. Non-finite points are treated as 0.
    fn cell(&self, position: DVec3) -> LatticeCell {
        // Odd factors make neighboring lattice points differ in many bits.
        const FACTORS: [u64; 3] = [0x9e37_79b9_7f4a_7c15, 0xc2b2_ae3d_27d4_eb4f, 0x1656_67b1_9e37_79f9];
        let position = position / self.size;
        let position = if position.is_finite() { position } else { DVec3::ZERO };
        let low = position.floor();
        let term = |axis: usize| (low[axis] as i64 as u64).wrapping_mul(FACTORS[axis]);
        let key = self.key.wrapping_add(term(0)).wrapping_add(term(1)).wrapping_add(term(2));
        let gradient = |corner: usize| {
            let step = |axis: usize| if corner >> axis & 1 == 1 { FACTORS[axis] } else { 0 };
            let bits = hash(key.wrapping_add(step(0)).wrapping_add(step(1)).wrapping_add(step(2)));
            GRADIENTS[(((bits >> 32) * GRADIENTS.len() as u64) >> 32) as usize]
        };
        LatticeCell { at: (position - low).as_vec3(), gradients: std::array::from_fn(gradient) }
    }
}

impl LatticeCell {
    /// Values of the corners' linear functions.
    fn corner_dot_products(&self) -> [f32; 8] {
        std::array::from_fn(|corner| {
            let axis = |axis: usize| (corner >> axis & 1) as f32;
            self.gradients[corner].dot(self.at - Vec3::new(axis(0), axis(1), axis(2)))
        })
    }

    /// The noise, in [−1, 1].
    fn value(&self) -> f32 {
        SCALE * interpolate_trilinearly(self.corner_dot_products(), self.at.to_array().map(quintic))
    }

    /// Derivatives of the noise with respect to the coordinates in the cell.
    fn gradient(&self) -> Vec3 {
        let (products, weights) = (self.corner_dot_products(), self.at.to_array().map(quintic));
        // The blended gradients, and the dot products times the derivatives of their weights.
        let derivative = |axis: usize| {
            let blended = interpolate_trilinearly(self.gradients.map(|gradient| gradient[axis]), weights);
            let at_end = |end: f32| {
                let mut weights = weights;
                weights[axis] = end;
                interpolate_trilinearly(products, weights)
            };
            blended + quintic_derivative(self.at[axis]) * (at_end(1.0) - at_end(0.0))
        };
        Vec3::new(derivative(0), derivative(1), derivative(2)) * SCALE
    }
}

/// Interpolates between the corners of a cell. The weights apply to the upper corners along each axis.
fn interpolate_trilinearly(corners: [f32; 8], [x, y, z]: [f32; 3]) -> f32 {
    let mix = |a: f32, b: f32, t: f32| a + (b - a) * t;
    let along_x: [f32; 4] = std::array::from_fn(|i| mix(corners[2 * i], corners[2 * i + 1], x));
    mix(mix(along_x[0], along_x[1], y), mix(along_x[2], along_x[3], y), z)
}

fn quintic(t: f32) -> f32 {
    t * t * t * (t * (t * 6.0 - 15.0) + 10.0)
}

fn quintic_derivative(t: f32) -> f32 {
    30.0 * t * t * (t * (t - 2.0) + 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::materials::footprint::{ExtraCoordinates, ObjectPoint};
    use crate::math::random::TestRandom;
    use crate::math::{DMat3, DVec2};

    fn point(position: DVec3, width: f32) -> TexturePoint {
        let object = ObjectPoint { position, width, from_world: DMat3::IDENTITY };
        let extra = Some(Box::new(ExtraCoordinates { second: None, object: Some(object) }));
        TexturePoint { extra, ..TexturePoint::from_uv(DVec2::ZERO) }
    }

    fn value(noise: &Noise, position: DVec3) -> f32 {
        noise.evaluate(&point(position, 0.0), false).value
    }

    /// Random points in a cube with an edge length of 100 around 0.
    fn points(count: usize) -> impl Iterator<Item = DVec3> {
        let mut random = TestRandom::new(7);
        (0..count).map(move |_| random.in_cube() * 50.0)
    }

    fn octaves(octaves: u32) -> Noise {
        Noise { size: 1.0, octaves, seed: 3 }
    }

    #[test]
    fn noise_is_zero_at_lattice_points() {
        for octave in 0..4 {
            let noise = Noise { size: 0.5, octaves: 1, seed: octave };
            for i in 0..200_u32 {
                let lattice = DVec3::new(f64::from(i % 7), f64::from(i % 5), f64::from(i)) - 3.0;
                assert_eq!(value(&noise, lattice * 0.5), 0.0, "{lattice}");
            }
        }
        // All octaves share the lattice points of the first.
        assert_eq!(value(&octaves(4), DVec3::new(-3.0, 5.0, 8.0)), 0.0);
        assert_ne!(value(&octaves(1), DVec3::new(0.5, 0.25, 0.25)), 0.0);
    }

    #[test]
    fn octaves_have_half_the_size_and_weight() {
        // Each octave equals one of half the size with its own gradients, so measure the variances: the
        // weights 1, ½, ¼ and ⅛ are divided by their sum.
        let variance = |count: u32| {
            let squares = points(20_000).map(|at| f64::from(value(&octaves(count), at)).powi(2));
            squares.sum::<f64>() / 20_000.0
        };
        let single = f64::from(VARIANCE);
        for count in 1..=4_u32 {
            let weights = (0..count).map(|i| 0.5_f64.powi(i as i32));
            let (sum, squares) = weights.fold((0.0, 0.0), |(sum, squares), w| (sum + w, squares + w * w));
            let expected = single * squares / (sum * sum);
            // The standard error of the variance is below 1.5 % for 20,000 points.
            assert!(
                (variance(count) / expected - 1.0).abs() < 0.06,
                "{count}: {} {expected}",
                variance(count)
            );
        }
    }

    #[test]
    fn values_stay_in_range_with_a_mean_of_zero() {
        for count in [1, 4] {
            let noise = octaves(count);
            let values: Vec<f64> = points(40_000).map(|at| f64::from(value(&noise, at))).collect();
            let (least, most) =
                values.iter().fold((1.0, -1.0), |(a, b): (f64, f64), x| (a.min(*x), b.max(*x)));
            assert!(least >= -1.0 && most <= 1.0 && most - least > 0.9, "{least} {most}");
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            let error = (f64::from(VARIANCE) / values.len() as f64).sqrt();
            assert!(mean.abs() < 4.0 * error, "{mean} ± {error}");
        }
    }

    #[test]
    fn the_largest_value_is_at_most_one() {
        // At each point, choose the gradients that maximize the noise.
        let mut most: f32 = 0.0;
        for i in 0..30 * 30 * 30_u32 {
            let at = Vec3::new((i % 30) as f32, (i / 30 % 30) as f32, (i / 900) as f32) / 58.0;
            let gradients = std::array::from_fn(|corner: usize| {
                let offset =
                    at - Vec3::new((corner & 1) as f32, (corner >> 1 & 1) as f32, (corner >> 2) as f32);
                let by_ramp = |a: &Vec3, b: &Vec3| a.dot(offset).total_cmp(&b.dot(offset));
                GRADIENTS.into_iter().max_by(by_ramp).expect("gradients")
            });
            most = most.max(LatticeCell { at, gradients }.value());
        }
        assert!((0.995..=1.0).contains(&most), "{most}");
    }

    #[test]
    fn gradient_is_the_derivative() {
        let step = 1e-3;
        let noise = Noise { size: 0.7, octaves: 3, seed: 9 };
        for at in points(300) {
            let gradient = noise.value_gradient(&point(at, 0.0), true);
            let change = |axis: DVec3| {
                (value(&noise, at + axis * step) - value(&noise, at - axis * step)) / (2.0 * step) as f32
            };
            let expected = Vec3::new(change(DVec3::X), change(DVec3::Y), change(DVec3::Z));
            assert!((gradient - expected).abs().max_element() < 5e-3, "{at}: {gradient} {expected}");
        }
    }

    #[test]
    fn gradient_is_continuous_across_cells() {
        let noise = octaves(2);
        for at in points(300) {
            let face = DVec3::new(at.x.round() * 0.5, at.y, at.z);
            let [before, beyond] = [-1e-7, 1e-7].map(|step| {
                let at = face + DVec3::X * step;
                (noise.value_gradient(&point(at, 0.0), false), value(&noise, at))
            });
            assert!((before.0 - beyond.0).length() < 1e-4, "{face}: {before:?} {beyond:?}");
            assert!((before.1 - beyond.1).abs() < 1e-5, "{face}: {before:?} {beyond:?}");
        }
    }

    #[test]
    fn octaves_fade_below_the_footprint() {
        // With sizes of 1, ½ and ¼ and a footprint of 0.3, only the last octave is gone, and the second
        // fades.
        let noise = octaves(3);
        let at = DVec3::new(0.3, 0.4, 0.7);
        let octave = |number: usize, fade: f64| {
            let octave = noise.weighted_octaves(0.0).nth(number).expect("an octave");
            f64::from(octave.weight * octave.cell(at).value()) * fade
        };
        let above: f64 = 0.5 / 0.3 - 1.0;
        let expected = octave(0, 1.0) + octave(1, above * above * (3.0 - 2.0 * above));
        let found = noise.evaluate(&point(at, 0.3), true);
        assert!((f64::from(found.value) - expected).abs() < 1e-6, "{found:?} {expected}");
        let all = octave(0, 1.0) + octave(1, 1.0) + octave(2, 1.0);
        for (width, is_filtered, expected) in [(0.1, true, all), (0.3, false, all), (1.0, true, 0.0)] {
            let found = f64::from(noise.evaluate(&point(at, width), is_filtered).value);
            assert!((found - expected).abs() < 1e-6, "{width}: {found} {expected}");
        }
    }

    #[test]
    fn seeds_and_octaves_are_independent() {
        let product = |a: &dyn Fn(DVec3) -> f32, b: &dyn Fn(DVec3) -> f32| {
            points(20_000).map(|at| f64::from(a(at) * b(at))).sum::<f64>() / 20_000.0 / f64::from(VARIANCE)
        };
        let seed = |seed: u32| move |at: DVec3| value(&Noise { size: 1.0, octaves: 1, seed }, at);
        let second = |at: DVec3| {
            let octave = octaves(2).weighted_octaves(0.0).nth(1).expect("an octave");
            octave.cell(at * 0.5).value()
        };
        // The standard error of a correlation of 0 is 1/√20,000 = 0.007.
        assert!(product(&seed(3), &seed(4)).abs() < 0.03);
        assert!(product(&seed(3), &seed(256 + 3)).abs() < 0.03);
        assert!(product(&seed(3), &second).abs() < 0.03);
    }

    #[test]
    fn extreme_points_have_finite_values() {
        for bad in [f64::NAN, f64::INFINITY, -1e300, 1e18, -0.0] {
            let at = DVec3::new(bad, 0.25, bad);
            assert!(value(&octaves(4), at).abs() <= 1.0, "{bad}");
            assert!(octaves(4).value_gradient(&point(at, 0.0), false).is_finite(), "{bad}");
        }
    }
}
