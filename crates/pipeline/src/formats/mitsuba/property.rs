//! Values of the properties of Mitsuba objects.

use crate::formats::foreign::spectra::SampledSpectrum;
use crate::math::{DMat4, DVec3};

/// The value of a property.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum PropertyValue {
    Boolean(bool),
    Integer(i64),
    Float(f64),
    Text(String),
    Vector(DVec3),
    /// Linear Rec. 709.
    Rgb(DVec3),
    Spectrum(SpectrumValue),
    Transform(TransformValue),
}

/// A spectrum.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum SpectrumValue {
    /// The same value at all wavelengths.
    Uniform(f64),
    /// Values sampled at wavelengths.
    Sampled(SampledSpectrum),
    /// The name of a file with wavelengths and values.
    File(String),
    /// Temperature of a blackbody in kelvin, and a scale factor.
    Blackbody(f64, f64),
}

/// A transform.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct TransformValue {
    pub(super) matrix: DMat4,
    /// The target of the last `lookat`, moved by the steps after it.
    pub(super) target: Option<DVec3>,
}

impl PropertyValue {
    /// Name of the value's type for messages, with an article.
    pub(super) fn type_name(&self) -> &'static str {
        match self {
            Self::Boolean(_) => "a boolean",
            Self::Integer(_) => "an integer",
            Self::Float(_) => "a float",
            Self::Text(_) => "a string",
            Self::Vector(_) => "a vector",
            Self::Rgb(_) => "an RGB color",
            Self::Spectrum(_) => "a spectrum",
            Self::Transform(_) => "a transform",
        }
    }
}
