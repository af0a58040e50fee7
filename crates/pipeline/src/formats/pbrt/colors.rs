//! Converts color and spectrum parameters to linear Rec. 709.

use std::cell::RefCell;
use std::ops::Range;
use std::path::{Path, PathBuf};

use super::lexer::{PbrtError, PbrtResult};
use super::parameters::{Parameter, ParameterType, Parameters, Text, Values};
use super::state::ColorSpace;
use crate::assets::Companion;
use crate::assets::read_text_file;
use crate::choice::Choice;
use crate::control::CancelToken;
use crate::formats::foreign::spectra::{
    SampledSpectrum, blackbody_radiance, reflectance_color, spectrum_to_xyz, unbounded_color,
    xyz_to_linear_rgb,
};
use crate::materials::conductor::elements::NamedConductor;
use crate::math::DVec3;
use crate::scene::nearest::nearest_name;
use crate::scene::sanitize::escape_and_truncate;

/// How a spectrum is used, which determines its conversion to a color.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum SpectrumUse {
    /// A reflectance or transmittance under D65, from 0 to 1.
    Reflectance,
    /// An emission spectrum, which is divided by its luminance unless it is an `rgb` parameter.
    Emission,
    /// An unbounded quantity, such as an index of refraction.
    Unbounded,
}

/// pbrt's named glasses and their indices of refraction at 587.6 nm, from the manufacturers' catalogs.
const GLASSES: [(&str, f64); 7] = [
    ("glass-BK7", 1.5168),
    ("glass-BAF10", 1.67003),
    ("glass-FK51A", 1.48656),
    ("glass-LASF9", 1.85025),
    ("glass-F5", 1.67271),
    ("glass-F10", 1.72828),
    ("glass-F11", 1.78472),
];

/// pbrt's named illuminants and their CIE 1931 chromaticities (CIE 15).
const ILLUMINANTS: [(&str, [f64; 2]); 16] = [
    ("stdillum-A", [0.44757, 0.40745]),
    ("stdillum-D50", [0.34567, 0.35850]),
    ("stdillum-D65", [0.31272, 0.32903]),
    ("illum-acesD60", [0.32168, 0.33767]),
    ("stdillum-F1", [0.31310, 0.33727]),
    ("stdillum-F2", [0.37208, 0.37529]),
    ("stdillum-F3", [0.40910, 0.39430]),
    ("stdillum-F4", [0.44018, 0.40329]),
    ("stdillum-F5", [0.31379, 0.34531]),
    ("stdillum-F6", [0.37790, 0.38835]),
    ("stdillum-F7", [0.31292, 0.32933]),
    ("stdillum-F8", [0.34588, 0.35875]),
    ("stdillum-F9", [0.37417, 0.37281]),
    ("stdillum-F10", [0.34609, 0.35986]),
    ("stdillum-F11", [0.38052, 0.37713]),
    ("stdillum-F12", [0.43695, 0.40441]),
];

/// pbrt's named conductors.
const METALS: [&str; 7] = ["Ag", "Al", "Au", "Cu", "CuZn", "MgO", "TiO2"];

/// Converts color parameters, including spectra in files.
pub(super) struct ColorReader<'a> {
    /// Folder to which paths are relative.
    folder: PathBuf,
    token: &'a CancelToken,
    /// Spectrum files that have been read, to watch them.
    pub(super) companions: RefCell<Vec<Companion>>,
}

impl<'a> ColorReader<'a> {
    pub(super) fn new(folder: &Path, token: &'a CancelToken) -> Self {
        Self { folder: folder.to_owned(), token, companions: RefCell::default() }
    }

    /// Reads a color parameter. Returns `None` if it is absent.
    pub(super) fn color(
        &self,
        parameters: &Parameters,
        name: &'static str,
        space: ColorSpace,
        usage: SpectrumUse,
    ) -> PbrtResult<Option<DVec3>> {
        let Some(found) = parameters.find(name) else { return Ok(None) };
        self.color_from_parameter(found, space, usage).map(Some)
    }

    /// Converts the values of a parameter to a color.
    pub(super) fn color_from_parameter(
        &self,
        found: &Parameter,
        space: ColorSpace,
        usage: SpectrumUse,
    ) -> PbrtResult<DVec3> {
        let span = || found.values_span.clone();
        match found.kind {
            ParameterType::Rgb => {
                let Ok(rgb) = <[f64; 3]>::try_from(found.numbers()?) else {
                    return Err(PbrtError::new(span(), "an rgb value needs three numbers"));
                };
                if rgb.iter().any(|part| *part < 0.0) {
                    return Err(PbrtError::new(span(), "a color cannot be negative"));
                }
                let color = space.to_rec709(DVec3::from(rgb)).max(DVec3::ZERO);
                let is_bounded = usage == SpectrumUse::Reflectance;
                Ok(if is_bounded { color.min(DVec3::ONE) } else { color })
            }
            ParameterType::Blackbody => {
                let kelvin = *found.single(found.numbers()?)?;
                if !(100.0..=1e6).contains(&kelvin) {
                    return Err(PbrtError::new(span(), "a temperature must be between 100 and 1000000 K"));
                }
                Ok(unit_luminance_spectrum_color(|wavelength| blackbody_radiance(wavelength, kelvin)))
            }
            ParameterType::Spectrum => self.spectrum_color(found, usage),
            ParameterType::Float => Ok(DVec3::splat(*found.single(found.numbers()?)?)),
            ParameterType::Integer
            | ParameterType::Bool
            | ParameterType::String
            | ParameterType::Texture
            | ParameterType::Point2
            | ParameterType::Vector2
            | ParameterType::Point3
            | ParameterType::Vector3
            | ParameterType::Normal => {
                let error = PbrtError::new(found.span.clone(), "this parameter must be a color");
                Err(error.with_help("its type must be rgb, spectrum, blackbody or texture"))
            }
        }
    }

    fn spectrum_color(&self, found: &Parameter, usage: SpectrumUse) -> PbrtResult<DVec3> {
        let spectrum = match &found.values {
            Values::Numbers(numbers) => {
                let (pairs, rest) = numbers.as_chunks::<2>();
                let sampled = SampledSpectrum::new(pairs.to_vec());
                match sampled {
                    Ok(sampled) if rest.is_empty() => sampled,
                    Ok(_) => {
                        let message = "a spectrum needs pairs of a wavelength and a value";
                        return Err(PbrtError::new(found.values_span.clone(), message));
                    }
                    Err(reason) => return Err(PbrtError::new(found.values_span.clone(), reason)),
                }
            }
            Values::Texts(texts) => {
                let name = found.single(texts)?;
                if let Some(color) = named_spectrum_color(&name.text, usage) {
                    return Ok(color);
                }
                self.read_spectrum_file(name)?
            }
            Values::Flags(_) => {
                return Err(PbrtError::new(
                    found.values_span.clone(),
                    "a spectrum must be a name or a list of numbers",
                ));
            }
        };
        Ok(match usage {
            SpectrumUse::Reflectance => reflectance_color(&spectrum),
            SpectrumUse::Unbounded => unbounded_color(&spectrum),
            SpectrumUse::Emission => unit_luminance_spectrum_color(|wavelength| spectrum.at(wavelength)),
        })
    }

    /// Reads an `.spd` file.
    fn read_spectrum_file(&self, name: &Text) -> PbrtResult<SampledSpectrum> {
        /// Maximum size of a spectrum file.
        const MAX_BYTES: u64 = 16 << 20;
        let path = self.folder.join(&name.text);
        let span = name.span.clone();
        if !path.is_file() && !name.text.contains(['.', '/']) {
            return Err(unknown_spectrum(&name.text, span));
        }
        let read = read_text_file(&path, MAX_BYTES, self.token);
        let (hash, stamp) = read.as_ref().map_or((None, None), |file| (Some(file.hash), file.stamp));
        self.companions.borrow_mut().push(Companion { path: path.clone(), hash, stamp });
        let file = read.map_err(|error| PbrtError::new(span.clone(), error.to_string()))?;
        SampledSpectrum::parse_spd(&file.text).map_err(|(line, reason)| {
            PbrtError::new(span, format!("{}, line {line}: {reason}", path.display()))
        })
    }

    /// Reads the index of refraction of a dielectric. Also returns whether the dielectric is dispersive.
    pub(super) fn ior(
        &self,
        parameters: &Parameters,
        name: &'static str,
        default: f64,
    ) -> PbrtResult<(f64, bool)> {
        let Some(found) = parameters.find(name) else { return Ok((default, false)) };
        if found.kind == ParameterType::Float {
            return Ok((parameters.float(name, default)?, false));
        }
        if let Values::Texts(texts) = &found.values
            && let [text] = &texts[..]
            && let Some((_, ior)) = GLASSES.iter().find(|(known, _)| *known == text.text)
        {
            return Ok((*ior, true));
        }
        let color = self.color_from_parameter(found, ColorSpace::Srgb, SpectrumUse::Unbounded)?;
        Ok((color.element_sum() / 3.0, color.max_element() - color.min_element() > 1e-3 * color.y))
    }
}

/// Returns the color of a spectrum, scaled to unit luminance, or black for a spectrum without luminance.
fn unit_luminance_spectrum_color(spectrum: impl Fn(f64) -> f64) -> DVec3 {
    let xyz = spectrum_to_xyz(spectrum);
    if xyz.y > 0.0 { xyz_to_linear_rgb(xyz / xyz.y).max(DVec3::ZERO) } else { DVec3::ZERO }
}

/// Returns the color of one of pbrt's named spectra.
fn named_spectrum_color(name: &str, usage: SpectrumUse) -> Option<DVec3> {
    if let Some((_, [x, y])) = ILLUMINANTS.iter().find(|(known, _)| *known == name) {
        // D65 is the white point of Rec. 709.
        let is_white = name == "stdillum-D65" || usage != SpectrumUse::Emission;
        let xyz = DVec3::new(x / y, 1.0, (1.0 - x - y) / y);
        return Some(if is_white { DVec3::ONE } else { xyz_to_linear_rgb(xyz).max(DVec3::ZERO) });
    }
    if let Some((_, ior)) = GLASSES.iter().find(|(known, _)| *known == name) {
        return Some(DVec3::splat(*ior));
    }
    let (metal, part) = name.strip_prefix("metal-")?.rsplit_once('-')?;
    let [eta, k] = NamedConductor::named(METALS.iter().find(|known| **known == metal)?)?.complex_ior();
    match part {
        "eta" => Some(eta.as_dvec3()),
        "k" => Some(k.as_dvec3()),
        _ => None,
    }
}

fn unknown_spectrum(name: &str, span: Range<usize>) -> Box<PbrtError> {
    let metals = METALS.iter().flat_map(|metal| [format!("metal-{metal}-eta"), format!("metal-{metal}-k")]);
    let named = GLASSES.iter().map(|(name, _)| *name).chain(ILLUMINANTS.iter().map(|(name, _)| *name));
    let all: Vec<String> = metals.chain(named.map(str::to_owned)).collect();
    let near = nearest_name(name, all.iter().map(String::as_str));
    let message = format!("unknown spectrum `{}`", escape_and_truncate(name, 40));
    PbrtError::new(span, message).with_suggestion(near)
}

#[cfg(test)]
mod tests {
    use super::super::lexer::Lexer;
    use super::*;

    fn color(text: &str, usage: SpectrumUse) -> PbrtResult<DVec3> {
        let (token, mut lexer) = (CancelToken::new(), Lexer::new(text, 0));
        let parameters = Parameters::parse(&mut lexer, 0..0)?;
        let reader = ColorReader::new(Path::new(""), &token);
        reader.color(&parameters, "L", ColorSpace::Srgb, usage).map(Option::unwrap_or_default)
    }

    fn luminance(color: DVec3) -> f64 {
        color.dot(DVec3::new(0.2126, 0.7152, 0.0722))
    }

    #[test]
    fn emission_has_unit_luminance_unless_rgb() {
        for text in ["\"blackbody L\" 6500", "\"blackbody L\" 3000", "\"spectrum L\" [300 7 900 7]"] {
            let color = color(text, SpectrumUse::Emission).expect("a color");
            assert!((luminance(color) - 1.0).abs() < 2e-3, "{text}: {color}");
        }
        let warm = color("\"blackbody L\" 3000", SpectrumUse::Emission).expect("a color");
        assert!(warm.x > 1.5 && warm.z < 0.4, "{warm}");
        assert_eq!(color("\"rgb L\" [3 2 1]", SpectrumUse::Emission), Ok(DVec3::new(3.0, 2.0, 1.0)));
        assert_eq!(color("\"spectrum L\" \"stdillum-D65\"", SpectrumUse::Emission), Ok(DVec3::ONE));
    }

    #[test]
    fn illuminant_a_matches_a_blackbody() {
        let a = color("\"spectrum L\" \"stdillum-A\"", SpectrumUse::Emission).expect("a color");
        let blackbody = color("\"blackbody L\" 2856", SpectrumUse::Emission).expect("a color");
        assert!((a - blackbody).abs().max_element() < 0.01, "{a} {blackbody}");
    }

    #[test]
    fn conductors_are_found_by_name() {
        let eta = color("\"spectrum L\" \"metal-Cu-eta\"", SpectrumUse::Unbounded).expect("a color");
        assert!(eta.x < 0.4 && eta.z > 1.0, "{eta}");
        let error = color("\"spectrum L\" \"metal-Cu-etta\"", SpectrumUse::Unbounded).expect_err("an error");
        assert_eq!(error.label, "did you mean `metal-Cu-eta`?");
    }

    #[test]
    fn reflectance_is_clamped() {
        assert_eq!(color("\"rgb L\" [3 0.5 1]", SpectrumUse::Reflectance), Ok(DVec3::new(1.0, 0.5, 1.0)));
        let flat = color("\"spectrum L\" [300 0.5 900 0.5]", SpectrumUse::Reflectance).expect("a color");
        assert!((flat - 0.5).abs().max_element() < 2e-3, "{flat}");
        assert!(color("\"rgb L\" [-1 0 0]", SpectrumUse::Reflectance).is_err());
        assert!(color("\"spectrum L\" [500 1 400 1]", SpectrumUse::Reflectance).is_err());
    }
}
