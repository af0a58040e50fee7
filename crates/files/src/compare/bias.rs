//! Bias: the brightness difference between an image and its reference, compared with their noise.

use super::ErrorMetrics;

/// Excess brightness of an image, relative to the reference's mean luminance.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Bias {
    /// mean (a − b) / mean b. `None` if the reference is black.
    pub value: Option<f64>,
    /// Standard error of the bias, caused by the noise in both images. `None` if either image's noise is
    /// unknown.
    pub standard_error: Option<f64>,
    /// Bias divided by its standard error. `None` if the standard error is unknown or zero.
    pub z: Option<f64>,
}

impl Bias {
    /// Computes the bias from the errors and the standard error of each image's mean luminance, if known.
    /// The noise of the two images must be independent.
    pub fn new(errors: &ErrorMetrics, standard_errors: [Option<f64>; 2]) -> Self {
        let [a, b] = errors.luminances;
        let error = match standard_errors {
            [Some(a), Some(b)] => Some((a * a + b * b).sqrt()),
            [_, None] | [None, Some(_)] => None,
        };
        let finite = |value: f64| Some(value).filter(|value| value.is_finite());
        Self {
            value: finite((a - b) / b),
            standard_error: error.and_then(|error| finite(error / b.abs())),
            z: error.and_then(|error| finite((a - b) / error)),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::compare::{ImagePair, measure};
    use crate::film::RadianceImage;
    use crate::math::Vec3;

    fn errors(a: f32, b: f32) -> ErrorMetrics {
        let image =
            |value| RadianceImage { width: 2, height: 1, pixels: vec![Vec3::ZERO, Vec3::splat(value)] };
        measure(&ImagePair::new([Path::new("a"), Path::new("b")], image(a), image(b)).expect("a pair")).errors
    }

    #[test]
    fn bias_is_relative_to_reference_and_noise() {
        let bias = Bias::new(&errors(3.0, 2.0), [Some(0.3), Some(0.4)]);
        let near = |value: Option<f64>, expected: f64| (value.expect("known") - expected).abs() < 1e-6;
        assert!(near(bias.value, 0.5) && near(bias.standard_error, 0.5) && near(bias.z, 1.0), "{bias:?}");
        assert!(near(Bias::new(&errors(1.0, 2.0), [Some(0.0), Some(0.1)]).z, -5.0));
    }

    #[test]
    fn unknown_values_are_none() {
        let bias = Bias::new(&errors(3.0, 2.0), [Some(0.3), None]);
        assert_eq!((bias.standard_error, bias.z, bias.value.is_some()), (None, None, true));
        assert_eq!(Bias::new(&errors(3.0, 3.0), [Some(0.0); 2]).z, None, "no noise and no difference");
        assert_eq!(Bias::new(&errors(1.0, 0.0), [None; 2]).value, None, "a black reference");
    }
}
