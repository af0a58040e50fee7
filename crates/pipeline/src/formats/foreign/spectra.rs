//! Converts spectra to linear Rec. 709 with the CIE 1931 color matching functions.

use super::cie::{FIRST, LAST, OBSERVER_AND_D65, STEP};
use crate::math::DVec3;

/// Integration step in nanometers.
const INTEGRATION_STEP: f64 = 0.5;

/// A spectrum sampled at increasing wavelengths, with linear interpolation.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct SampledSpectrum {
    /// Wavelengths in nanometers, and values.
    points: Vec<[f64; 2]>,
}

impl SampledSpectrum {
    /// Creates a spectrum from pairs of a wavelength in nanometers and a value. It is 0 outside their range.
    ///
    /// # Errors
    /// Returns the reason if there are no points, a number is not finite, or the wavelengths do not increase.
    pub(crate) fn new(points: Vec<[f64; 2]>) -> Result<Self, String> {
        if points.is_empty() {
            return Err("the spectrum is empty".to_owned());
        }
        if points.iter().flatten().any(|number| !number.is_finite()) {
            return Err("the spectrum contains a number that is not finite".to_owned());
        }
        if let Some(two) = points.windows(2).find(|two| two[1][0] <= two[0][0]) {
            return Err(format!("wavelengths must increase: {} follows {}", two[1][0], two[0][0]));
        }
        Ok(Self { points })
    }

    /// Parses an `.spd` file. Each line has a wavelength and a value; `#` starts a comment.
    ///
    /// # Errors
    /// Returns the 1-based line number and the reason.
    pub(crate) fn parse_spd(text: &str) -> Result<Self, (usize, String)> {
        let mut points = Vec::new();
        for (index, line) in text.lines().enumerate() {
            let line = line.split('#').next().unwrap_or_default();
            let mut words =
                line.split(|c: char| c.is_whitespace() || c == ',').filter(|word| !word.is_empty());
            let Some(first) = words.next() else { continue };
            let number = |word: Option<&str>| {
                let parsed = word.and_then(|word| word.parse::<f64>().ok()).filter(|value| value.is_finite());
                parsed.ok_or((index + 1, "expected a wavelength and a value".to_owned()))
            };
            points.push([number(Some(first))?, number(words.next())?]);
            if words.next().is_some() {
                return Err((index + 1, "expected a wavelength and a value".to_owned()));
            }
        }
        let last = text.lines().count().max(1);
        Self::new(points).map_err(|reason| (last, reason))
    }

    /// Evaluates the spectrum at a wavelength in nanometers.
    pub(crate) fn at(&self, wavelength: f64) -> f64 {
        let after = self.points.partition_point(|point| point[0] <= wavelength);
        match (after.checked_sub(1).map(|index| self.points[index]), self.points.get(after)) {
            (Some([x0, y0]), Some(&[x1, y1])) => y0 + (y1 - y0) * (wavelength - x0) / (x1 - x0),
            (Some([x0, y0]), None) if wavelength == x0 => y0,
            (Some(_) | None, _) => 0.0,
        }
    }
}

/// Interpolates x̄, ȳ, z̄ and the relative power of D65 at a wavelength in nanometers.
fn interpolate_observer_and_d65(wavelength: f64) -> [f64; 4] {
    let position = (wavelength - FIRST) / STEP;
    let index = (position as usize).min(OBSERVER_AND_D65.len() - 2);
    let (before, after) = (OBSERVER_AND_D65[index], OBSERVER_AND_D65[index + 1]);
    std::array::from_fn(|column| {
        before[column] + (after[column] - before[column]) * (position - index as f64)
    })
}

/// Converts CIE XYZ to linear Rec. 709.
pub(crate) fn xyz_to_linear_rgb(xyz: DVec3) -> DVec3 {
    DVec3::new(
        xyz.dot(DVec3::new(3.240_479, -1.537_15, -0.498_535)),
        xyz.dot(DVec3::new(-0.969_256, 1.875_991, 0.041_556)),
        xyz.dot(DVec3::new(0.055_648, -0.204_043, 1.057_311)),
    )
}

/// Integrates a spectrum to CIE XYZ. A spectrum that is 1 everywhere has luminance 1.
pub(crate) fn spectrum_to_xyz(spectrum: impl Fn(f64) -> f64) -> DVec3 {
    integrate_to_xyz(|wavelength, _| spectrum(wavelength), 1.0)
}

/// Integrates a reflectance under D65 to CIE XYZ. A reflectance of 1 has luminance 1.
pub(crate) fn reflectance_to_xyz(spectrum: impl Fn(f64) -> f64) -> DVec3 {
    let white = integrate_to_xyz(|_, d65| d65, 1.0).y;
    integrate_to_xyz(|wavelength, d65| spectrum(wavelength) * d65, white)
}

/// Integrates a function of the wavelength and the power of D65 to CIE XYZ. A constant function with the
/// value `norm` has luminance 1.
fn integrate_to_xyz(value: impl Fn(f64, f64) -> f64, norm: f64) -> DVec3 {
    let steps = ((LAST - FIRST) / INTEGRATION_STEP) as usize;
    let (mut sum, mut luminance) = (DVec3::ZERO, 0.0);
    for step in 0..steps {
        let wavelength = FIRST + (step as f64 + 0.5) * INTEGRATION_STEP;
        let [x, y, z, d65] = interpolate_observer_and_d65(wavelength);
        sum += DVec3::new(x, y, z) * value(wavelength, d65);
        luminance += y;
    }
    sum / (luminance * norm)
}

/// Converts an emission spectrum to linear Rec. 709, with negative components set to 0. A spectrum that is 1
/// everywhere has luminance 1 and a purple tint, because the white point of Rec. 709 is D65.
pub(crate) fn emission_color(spectrum: &SampledSpectrum) -> DVec3 {
    xyz_to_linear_rgb(spectrum_to_xyz(|wavelength| spectrum.at(wavelength))).max(DVec3::ZERO)
}

/// Converts a reflectance spectrum under D65 to linear Rec. 709, clamped to 0 … 1.
pub(crate) fn reflectance_color(spectrum: &SampledSpectrum) -> DVec3 {
    unbounded_color(spectrum).clamp(DVec3::ZERO, DVec3::ONE)
}

/// Converts an unbounded spectrum such as η or k to linear Rec. 709, weighted with D65 and with negative
/// components set to 0.
pub(crate) fn unbounded_color(spectrum: &SampledSpectrum) -> DVec3 {
    xyz_to_linear_rgb(reflectance_to_xyz(|wavelength| spectrum.at(wavelength))).max(DVec3::ZERO)
}

/// Linear Rec. 709 color of an emission spectrum that is 1 everywhere: about (1.205, 0.948, 0.909).
pub(crate) fn equal_energy_emission_color() -> DVec3 {
    xyz_to_linear_rgb(DVec3::ONE)
}

/// Spectral radiance of a blackbody (Planck's law), in W·sr⁻¹·m⁻² per nanometer.
pub(crate) fn blackbody_radiance(wavelength: f64, kelvin: f64) -> f64 {
    const LIGHT_SPEED: f64 = 299_792_458.0;
    const PLANCK: f64 = 6.626_070_15e-34;
    const BOLTZMANN: f64 = 1.380_649e-23;
    if !(kelvin > 0.0) {
        return 0.0;
    }
    let meters = wavelength * 1e-9;
    let exponent = PLANCK * LIGHT_SPEED / (meters * BOLTZMANN * kelvin);
    2.0 * PLANCK * LIGHT_SPEED * LIGHT_SPEED / (libm::pow(meters, 5.0) * libm::expm1(exponent)) * 1e-9
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: DVec3, b: [f64; 3], tolerance: f64) {
        assert!((a - DVec3::from(b)).abs().max_element() < tolerance, "{a} is not {b:?}");
    }

    #[test]
    fn flat_spectra_have_known_colors() {
        let flat = SampledSpectrum::new(vec![[300.0, 1.0], [900.0, 1.0]]).expect("a spectrum");
        close(emission_color(&flat), [1.2048, 0.9483, 0.9089], 1e-3);
        close(equal_energy_emission_color(), [1.2048, 0.9483, 0.9089], 1e-3);
        close(reflectance_color(&flat), [1.0, 1.0, 1.0], 2e-3);
    }

    #[test]
    fn spectra_are_zero_outside_their_range() {
        let spectrum = SampledSpectrum::new(vec![[500.0, 2.0], [600.0, 4.0]]).expect("a spectrum");
        let at = |spectrum: &SampledSpectrum| [499.0, 500.0, 550.0, 600.0, 601.0].map(|nm| spectrum.at(nm));
        assert_eq!(at(&spectrum), [0.0, 2.0, 3.0, 4.0, 0.0]);
    }

    #[test]
    fn spd_errors_have_lines() {
        let spectrum = SampledSpectrum::parse_spd("# nm\n400 1 # start\n\n500\t2\n").expect("a spectrum");
        assert_eq!(spectrum.points, [[400.0, 1.0], [500.0, 2.0]]);
        for (text, line) in [("400 1\n500", 2), ("a 1", 1), ("400 1\n300 1", 2), ("", 1), ("400 1 2", 1)] {
            assert_eq!(SampledSpectrum::parse_spd(text).map_err(|(line, _)| line), Err(line), "{text:?}");
        }
    }

    #[test]
    fn blackbody_follows_wiens_law() {
        // The radiance peaks at 2.897771955e-3 m·K / T.
        let peak = 2_897_771.955 / 5000.0;
        let at = |nm| blackbody_radiance(nm, 5000.0);
        assert!(at(peak) > at(peak - 1.0) && at(peak) > at(peak + 1.0));
        let white = xyz_to_linear_rgb(spectrum_to_xyz(|nm| blackbody_radiance(nm, 6504.0)));
        assert!((white.x / white.y - 1.0).abs() < 0.08 && (white.z / white.y - 1.0).abs() < 0.08, "{white}");
    }
}
