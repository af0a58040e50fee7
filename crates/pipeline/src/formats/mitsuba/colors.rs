//! Converts colors, spectra and numbers.

use std::ops::Range;

use super::graph::{Child, ObjectKind, PluginInstance};
use super::property::{PropertyValue, SpectrumValue};
use super::reader::{ColorRole, ColorSource, NumberSource, SceneReader, luminance};
use super::settings::span_of;
use super::xml::truncate_for_message;
use crate::assets::Companion;
use crate::formats::foreign::spectra::{
    SampledSpectrum, blackbody_radiance, emission_color, equal_energy_emission_color, reflectance_color,
    spectrum_to_xyz, unbounded_color, xyz_to_linear_rgb,
};
use crate::math::DVec3;

impl<'a> SceneReader<'a> {
    /// Returns a color or texture. `default` is a gray level.
    pub(super) fn color_or_texture(
        &mut self,
        object: &'a PluginInstance,
        name: &str,
        role: ColorRole,
        default: f64,
    ) -> ColorSource {
        if let Some(child) = object.named_child(name) {
            return self.color_or_texture_of_child(child, role);
        }
        let Some(property) = object.property(name) else {
            return ColorSource::Constant(DVec3::splat(default));
        };
        let color = match &property.value {
            PropertyValue::Float(number) => Some(DVec3::splat(*number)),
            PropertyValue::Integer(number) => Some(DVec3::splat(*number as f64)),
            PropertyValue::Rgb(color) => Some(*color),
            PropertyValue::Spectrum(spectrum) => self.spectrum_color(spectrum, role, &property.span),
            other => {
                self.report_wrong_type(&property.span, name, "a color", other);
                None
            }
        };
        let color = color.unwrap_or(DVec3::splat(default));
        if color.min_element() < 0.0 {
            let subject = format!("a negative `{}`", truncate_for_message(name));
            self.notes.note_lighting_substitution(&subject, "replaced by 0", property.span.clone());
        }
        ColorSource::Constant(color.max(DVec3::ZERO))
    }

    fn color_or_texture_of_child(&mut self, child: &Child, role: ColorRole) -> ColorSource {
        let object = self.object_by_index(child.target);
        match object.kind {
            ObjectKind::Texture
                if matches!(object.plugin.as_str(), "rawconstant" | "constant" | "srgb" | "uniform") =>
            {
                ColorSource::Constant(self.constant_texture_color(object))
            }
            ObjectKind::Texture => ColorSource::Texture(child.target),
            ObjectKind::Spectrum => ColorSource::Constant(self.spectrum_plugin_color(object, role)),
            ObjectKind::Scene
            | ObjectKind::Bsdf
            | ObjectKind::Emitter
            | ObjectKind::Film
            | ObjectKind::Filter
            | ObjectKind::Integrator
            | ObjectKind::Medium
            | ObjectKind::Phase
            | ObjectKind::Sampler
            | ObjectKind::Sensor
            | ObjectKind::Shape
            | ObjectKind::Subsurface
            | ObjectKind::Volume => {
                self.report_error(child.span.clone(), "expected a texture", None);
                ColorSource::Constant(DVec3::splat(0.5))
            }
        }
    }

    /// Returns the color of a constant texture.
    fn constant_texture_color(&mut self, object: &'a PluginInstance) -> DVec3 {
        let name = if object.property("color").is_some() { "color" } else { "value" };
        match object.property(name).map(|property| &property.value) {
            Some(PropertyValue::Vector(vector)) => *vector,
            Some(_) | None => match self.color_or_texture(object, name, ColorRole::Unbounded, 0.5) {
                ColorSource::Constant(color) => color,
                ColorSource::Texture(_) => DVec3::splat(0.5),
            },
        }
    }

    /// Returns the color of a `<spectrum type="…">`.
    pub(super) fn spectrum_plugin_color(&mut self, object: &'a PluginInstance, role: ColorRole) -> DVec3 {
        let constant = |source: ColorSource| match source {
            ColorSource::Constant(color) => color,
            ColorSource::Texture(_) => DVec3::splat(0.5),
        };
        match object.plugin.as_str() {
            "uniform" => {
                let value = self.float(object, "value").unwrap_or(1.0);
                // In Mitsuba's RGB mode, an explicit `uniform` plugin is gray.
                DVec3::splat(value)
            }
            "srgb" | "rgb" => constant(self.color_or_texture(
                object,
                if object.property("color").is_some() { "color" } else { "value" },
                role,
                1.0,
            )),
            "d65" => {
                let scale = self.float(object, "scale").unwrap_or(1.0);
                let color = constant(self.color_or_texture(object, "color", ColorRole::Reflectance, 1.0));
                color * scale
            }
            "blackbody" => {
                let kelvin = self.float(object, "temperature").unwrap_or(5000.0);
                let scale = self.float(object, "scale").unwrap_or(1.0);
                blackbody_color(kelvin) * scale
            }
            "regular" | "irregular" => self.tabulated_spectrum(object, role),
            _ => {
                self.report_unknown_plugin(
                    object,
                    "spectrum",
                    &["uniform", "srgb", "d65", "blackbody", "regular", "irregular"],
                );
                DVec3::splat(0.5)
            }
        }
    }

    fn tabulated_spectrum(&mut self, object: &'a PluginInstance, role: ColorRole) -> DVec3 {
        let numbers = |text: Option<(&str, Range<usize>)>| -> Vec<f64> {
            let words = text.map_or("", |(text, _)| text).split(|c: char| c.is_whitespace() || c == ',');
            words.filter_map(|word| word.parse().ok()).collect()
        };
        if let Some(property) = object.property("value")
            && let PropertyValue::Spectrum(spectrum) = &property.value
        {
            return self.spectrum_color(spectrum, role, &property.span).unwrap_or(DVec3::splat(0.5));
        }
        let values =
            numbers(self.text(object, if object.property("values").is_some() { "values" } else { "value" }));
        let wavelengths = match object.plugin.as_str() {
            "irregular" => numbers(self.text(object, "wavelengths")),
            _ => {
                let first = self.float(object, "wavelength_min").unwrap_or(360.0);
                let last = self.float(object, "wavelength_max").unwrap_or(830.0);
                let steps = (values.len().max(2) - 1) as f64;
                (0..values.len()).map(|index| first + (last - first) * index as f64 / steps).collect()
            }
        };
        let points =
            wavelengths.into_iter().zip(values).map(|(wavelength, value)| [wavelength, value]).collect();
        match SampledSpectrum::new(points) {
            Ok(spectrum) => sampled_color(&spectrum, role),
            Err(reason) => {
                self.report_error(object.span.clone(), reason, None);
                DVec3::splat(0.5)
            }
        }
    }

    fn spectrum_color(
        &mut self,
        spectrum: &SpectrumValue,
        role: ColorRole,
        span: &Range<usize>,
    ) -> Option<DVec3> {
        match spectrum {
            SpectrumValue::Uniform(value) => Some(match role {
                ColorRole::Emission => equal_energy_emission_color() * *value,
                ColorRole::Reflectance | ColorRole::Unbounded => DVec3::splat(*value),
            }),
            SpectrumValue::Sampled(spectrum) => Some(sampled_color(spectrum, role)),
            SpectrumValue::Blackbody(kelvin, scale) => Some(blackbody_color(*kelvin) * *scale),
            SpectrumValue::File(name) => {
                let path = self.asset_path(name, span, "spectrum")?;
                let read = crate::assets::read_text_file(&path, 16 << 20, self.token);
                let text = match read {
                    Ok(file) => {
                        let (hash, stamp) = (Some(file.hash), file.stamp);
                        self.companions.push(Companion { path: path.clone(), hash, stamp });
                        file.text
                    }
                    Err(error) => {
                        self.companions.push(Companion { path, hash: None, stamp: None });
                        self.report_error(span.clone(), format!("cannot read the spectrum: {error}"), None);
                        return None;
                    }
                };
                match SampledSpectrum::parse_spd(&text) {
                    Ok(spectrum) => Some(sampled_color(&spectrum, role)),
                    Err((line, reason)) => {
                        let message = format!("{}:{line}: {reason}", path.display());
                        self.report_error(span.clone(), message, None);
                        None
                    }
                }
            }
        }
    }

    /// Returns a number from 0 to 1, or a texture. Limits other numbers and reports them.
    pub(super) fn fraction(&mut self, object: &'a PluginInstance, name: &str, default: f64) -> NumberSource {
        match self.number_or_texture(object, name, default) {
            NumberSource::Constant(number) if !(0.0..=1.0).contains(&number) => {
                let subject = format!(
                    "`{}` of `{}` outside of 0 to 1",
                    truncate_for_message(name),
                    truncate_for_message(&object.plugin)
                );
                let limited = number.clamp(0.0, 1.0);
                self.notes.note_lighting_substitution(
                    &subject,
                    &format!("replaced by {limited}"),
                    span_of(object, name),
                );
                NumberSource::Constant(limited)
            }
            source @ (NumberSource::Constant(_) | NumberSource::Texture(_)) => source,
        }
    }

    /// Returns a number or texture.
    pub(super) fn number_or_texture(
        &mut self,
        object: &'a PluginInstance,
        name: &str,
        default: f64,
    ) -> NumberSource {
        if let Some(child) = object.named_child(name) {
            return match self.color_or_texture_of_child(child, ColorRole::Reflectance) {
                ColorSource::Constant(color) => NumberSource::Constant(luminance(color)),
                ColorSource::Texture(texture) => NumberSource::Texture(texture),
            };
        }
        let Some(property) = object.property(name) else { return NumberSource::Constant(default) };
        NumberSource::Constant(match &property.value {
            PropertyValue::Float(number) => *number,
            PropertyValue::Integer(number) => *number as f64,
            PropertyValue::Spectrum(SpectrumValue::Uniform(number)) => *number,
            PropertyValue::Rgb(color) => luminance(*color),
            other => {
                self.report_wrong_type(&property.span, name, "a number or a texture", other);
                default
            }
        })
    }
}

/// Color of a sampled spectrum.
fn sampled_color(spectrum: &SampledSpectrum, role: ColorRole) -> DVec3 {
    match role {
        ColorRole::Reflectance => reflectance_color(spectrum),
        ColorRole::Emission => emission_color(spectrum),
        ColorRole::Unbounded => unbounded_color(spectrum),
    }
}

/// Radiance of a blackbody, in linear Rec. 709 and Mitsuba's units: W·sr⁻¹·m⁻² per nanometer.
fn blackbody_color(kelvin: f64) -> DVec3 {
    xyz_to_linear_rgb(spectrum_to_xyz(|wavelength| blackbody_radiance(wavelength, kelvin))).max(DVec3::ZERO)
}
