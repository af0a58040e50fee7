//! Parses the values of Mitsuba scenes.

use std::ops::Range;

use super::property::{PropertyValue, SpectrumValue, TransformValue};
use super::xml::{Attribute, Element, truncate_for_message};
use crate::formats::foreign::spectra::SampledSpectrum;
use crate::formats::foreign::transform::{look_at_with_x_left, rotation_about_raw_axis};
use crate::math::color::srgb_to_linear;
use crate::math::{DMat4, DVec3};
use crate::scene::nearest::nearest_name;

/// An invalid value.
#[derive(Debug, PartialEq)]
pub(super) struct ValueError {
    pub(super) span: Range<usize>,
    pub(super) message: String,
    pub(super) help: Option<String>,
}

impl ValueError {
    fn new(span: &Range<usize>, message: impl Into<String>) -> Self {
        Self { span: span.clone(), message: message.into(), help: None }
    }
}

/// Largest magnitude of a number.
const MAX_NUMBER: f64 = 1e30;

pub(super) fn parse_float(text: &str, span: &Range<usize>) -> Result<f64, ValueError> {
    let parsed = text.trim().trim_start_matches('+').parse::<f64>().ok();
    match parsed {
        Some(number) if number.abs() <= MAX_NUMBER => Ok(number),
        Some(_) => {
            Err(ValueError::new(span, format!("the number must be finite and within ±{MAX_NUMBER:e}")))
        }
        None => {
            Err(ValueError::new(span, format!("expected a number, found `{}`", truncate_for_message(text))))
        }
    }
}

pub(super) fn parse_integer(text: &str, span: &Range<usize>) -> Result<i64, ValueError> {
    text.parse().map_err(|_| {
        ValueError::new(span, format!("expected an integer, found `{}`", truncate_for_message(text)))
    })
}

pub(super) fn parse_boolean(text: &str, span: &Range<usize>) -> Result<bool, ValueError> {
    match text.to_ascii_lowercase().as_str() {
        "true" => Ok(true),
        "false" => Ok(false),
        _ => Err(ValueError::new(
            span,
            format!("expected true or false, found `{}`", truncate_for_message(text)),
        )),
    }
}

/// Splits text at whitespace and commas.
fn words(text: &str) -> impl Iterator<Item = &str> {
    text.split(|c: char| c.is_whitespace() || c == ',').filter(|word| !word.is_empty())
}

/// Parses exactly `N` numbers.
pub(super) fn parse_numbers<const N: usize>(text: &str, span: &Range<usize>) -> Result<[f64; N], ValueError> {
    let mut numbers = [0.0; N];
    let mut count = 0;
    for word in words(text) {
        if let Some(slot) = numbers.get_mut(count) {
            *slot = parse_float(word, span)?;
        }
        count += 1;
    }
    if count == N {
        Ok(numbers)
    } else {
        Err(ValueError::new(span, format!("expected {N} numbers, found {count}")))
    }
}

/// Parses three numbers, or one number that is used for all three components.
fn parse_one_or_three(text: &str, span: &Range<usize>) -> Result<DVec3, ValueError> {
    match words(text).count() {
        1 => Ok(DVec3::splat(parse_float(words(text).next().unwrap_or_default(), span)?)),
        3 => Ok(parse_numbers::<3>(text, span)?.into()),
        count => Err(ValueError::new(span, format!("expected one or three numbers, found {count}"))),
    }
}

/// Parses a linear color. Hexadecimal colors, which version 0.6 allows, are sRGB.
pub(super) fn parse_rgb(text: &str, span: &Range<usize>) -> Result<DVec3, ValueError> {
    if text.starts_with('#') { parse_hexadecimal(text, span) } else { parse_one_or_three(text, span) }
}

/// Parses an sRGB color with components from 0 to 1.
pub(super) fn parse_srgb(text: &str, span: &Range<usize>) -> Result<DVec3, ValueError> {
    if text.starts_with('#') {
        return parse_hexadecimal(text, span);
    }
    let color = parse_one_or_three(text, span)?;
    Ok(DVec3::from(color.to_array().map(|part| f64::from(srgb_to_linear(part as f32)))))
}

fn parse_hexadecimal(text: &str, span: &Range<usize>) -> Result<DVec3, ValueError> {
    let digits = text.trim_start_matches('#');
    let is_valid = digits.len() == 6 && digits.bytes().all(|byte| byte.is_ascii_hexdigit());
    let number = u32::from_str_radix(digits, 16).ok().filter(|_| is_valid);
    let number = number.ok_or_else(|| ValueError::new(span, "expected a color such as #b5532e"))?;
    let part = |shift: u32| f64::from(srgb_to_linear(((number >> shift) & 255) as f32 / 255.0));
    Ok(DVec3::new(part(16), part(8), part(0)))
}

/// Parses a number, an RGB color, or pairs of wavelength and value.
pub(super) fn parse_spectrum_or_rgb(attribute: &Attribute) -> Result<PropertyValue, ValueError> {
    let (text, span) = (attribute.value.trim(), &attribute.span);
    if !text.contains(':') {
        if text.starts_with('#') {
            return parse_hexadecimal(text, span).map(PropertyValue::Rgb);
        }
        return match words(text).count() {
            1 => Ok(PropertyValue::Spectrum(SpectrumValue::Uniform(parse_float(
                words(text).next().unwrap_or_default(),
                span,
            )?))),
            3 => Ok(PropertyValue::Rgb(parse_numbers::<3>(text, span)?.into())),
            _ => Err(ValueError::new(span, "expected a number, or pairs such as 400:0.2, 700:0.8")),
        };
    }
    let pair = |word: &str| {
        let (wavelength, value) = word.split_once(':').ok_or_else(|| {
            ValueError::new(
                span,
                format!("expected WAVELENGTH:VALUE, found `{}`", truncate_for_message(word)),
            )
        })?;
        Ok([parse_float(wavelength, span)?, parse_float(value, span)?])
    };
    let points = words(text).map(pair).collect::<Result<Vec<_>, ValueError>>()?;
    let spectrum = SampledSpectrum::new(points).map_err(|reason| ValueError::new(span, reason))?;
    Ok(PropertyValue::Spectrum(SpectrumValue::Sampled(spectrum)))
}

/// Parses `x`, `y` and `z`, or `value` with one or three numbers. Missing components are `default`, or errors
/// if it is `None`.
pub(super) fn parse_point(element: &Element, default: Option<f64>) -> Result<DVec3, ValueError> {
    if let Some(value) = element.attribute("value") {
        return parse_one_or_three(&value.value, &value.span);
    }
    let component = |name: &str| match (element.attribute(name), default) {
        (Some(attribute), _) => parse_float(&attribute.value, &attribute.span),
        (None, Some(default)) => Ok(default),
        (None, None) => Err(ValueError::new(
            &element.span,
            format!("<{}> needs `{name}`", truncate_for_message(&element.tag)),
        )),
    };
    Ok(DVec3::new(component("x")?, component("y")?, component("z")?))
}

/// Names of the steps of a transform.
const STEPS: [&str; 5] = ["translate", "rotate", "scale", "lookat", "matrix"];

/// Parses a transform. Its steps apply in order, each to the result of the previous step.
pub(super) fn parse_transform(element: &Element) -> Result<TransformValue, ValueError> {
    let mut transform = TransformValue { matrix: DMat4::IDENTITY, target: None };
    for step in &element.children {
        let (matrix, target) = parse_transform_step(step)?;
        transform.matrix = matrix * transform.matrix;
        transform.target = match (target, transform.target) {
            (Some(target), _) => Some(target),
            (None, Some(earlier)) => Some(matrix.transform_point3(earlier)),
            (None, None) => None,
        };
        if !transform.matrix.is_finite() {
            return Err(ValueError::new(&step.span, "the transform overflows"));
        }
    }
    Ok(transform)
}

/// Rejects attributes that an element does not have.
pub(super) fn check_attributes(element: &Element, known: &[&str]) -> Result<(), ValueError> {
    let Some(unknown) = element.attributes.iter().find(|one| !known.contains(&one.name.as_str())) else {
        return Ok(());
    };
    let help = match nearest_name(&unknown.name, known.iter().copied()) {
        Some(near) => format!("did you mean `{near}`?"),
        None => format!("expected {}", known.join(", ")),
    };
    let message = format!(
        "<{}> has no attribute `{}`",
        truncate_for_message(&element.tag),
        truncate_for_message(&unknown.name)
    );
    Err(ValueError { help: Some(help), ..ValueError::new(&unknown.span, message) })
}

fn parse_transform_step(step: &Element) -> Result<(DMat4, Option<DVec3>), ValueError> {
    let known: &[&str] = match step.tag.to_ascii_lowercase().as_str() {
        "rotate" => &["x", "y", "z", "angle", "value"],
        "lookat" => &["origin", "target", "up"],
        "matrix" => &["value"],
        _ => &["x", "y", "z", "value"],
    };
    if STEPS.contains(&step.tag.to_ascii_lowercase().as_str()) {
        check_attributes(step, known)?;
    }
    let required = |name: &str| {
        let missing =
            || ValueError::new(&step.span, format!("<{}> needs `{name}`", truncate_for_message(&step.tag)));
        step.attribute(name).ok_or_else(missing)
    };
    let matrix = match step.tag.to_ascii_lowercase().as_str() {
        "translate" => DMat4::from_translation(parse_point(step, Some(0.0))?),
        "scale" => DMat4::from_scale(parse_point(step, Some(1.0))?),
        "rotate" => {
            let axis = parse_point(step, Some(0.0))?;
            let angle = required("angle")?;
            let angle = parse_float(&angle.value, &angle.span)?;
            if axis == DVec3::ZERO && angle != 0.0 {
                return Err(ValueError::new(&step.span, "the axis of the rotation is zero"));
            }
            rotation_about_raw_axis(axis, angle)
        }
        "lookat" => return parse_look_at(step),
        "matrix" => parse_matrix(required("value")?)?,
        other => {
            let help = nearest_name(other, STEPS).map(|near| format!("did you mean <{near}>?"));
            let message = format!("<{}> is not a step of a transform", truncate_for_message(other));
            return Err(ValueError { help, ..ValueError::new(&step.span, message) });
        }
    };
    Ok((matrix, None))
}

fn parse_look_at(step: &Element) -> Result<(DMat4, Option<DVec3>), ValueError> {
    let vector = |name: &str| match step.attribute(name) {
        Some(attribute) => Ok(DVec3::from(parse_numbers::<3>(&attribute.value, &attribute.span)?)),
        None if name == "up" => Ok(DVec3::ZERO),
        None => Err(ValueError::new(&step.span, format!("<lookat> needs `{name}`"))),
    };
    let (origin, target, up) = (vector("origin")?, vector("target")?, vector("up")?);
    let forward = (target - origin)
        .try_normalize()
        .ok_or_else(|| ValueError::new(&step.span, "`origin` and `target` are the same point"))?;
    let up = if up == DVec3::ZERO { perpendicular_up(forward) } else { up };
    match look_at_with_x_left(origin, target, up) {
        Some(matrix) => Ok((matrix, Some(target))),
        None => Err(ValueError::new(&step.span, "`up` is parallel to the viewing direction")),
    }
}

/// An up direction for a camera without one: the first tangent of Duff et al., Building an Orthonormal Basis,
/// Revisited, JCGT 6(1), 2017.
pub(super) fn perpendicular_up(n: DVec3) -> DVec3 {
    let sign = if n.z >= 0.0 { 1.0 } else { -1.0 };
    let a = -1.0 / (sign + n.z);
    DVec3::new(1.0 + sign * n.x * n.x * a, sign * n.x * n.y * a, -sign * n.x)
}

/// Parses a 3 × 3 or 4 × 4 matrix in row-major order.
fn parse_matrix(attribute: &Attribute) -> Result<DMat4, ValueError> {
    let (text, span) = (attribute.value.as_str(), &attribute.span);
    let rows = match words(text).count() {
        9 => {
            let [a, b, c, d, e, f, g, h, i] = parse_numbers::<9>(text, span)?;
            [a, b, c, 0.0, d, e, f, 0.0, g, h, i, 0.0, 0.0, 0.0, 0.0, 1.0]
        }
        16 => parse_numbers::<16>(text, span)?,
        count => return Err(ValueError::new(span, format!("expected 9 or 16 numbers, found {count}"))),
    };
    let matrix = DMat4::from_cols_array(&rows).transpose();
    if rows[12..] != [0.0, 0.0, 0.0, 1.0] {
        let message = "the last row of the matrix must be 0 0 0 1";
        let help = Some("glimt does not support perspective transforms".to_owned());
        return Err(ValueError { help, ..ValueError::new(span, message) });
    }
    Ok(matrix)
}

/// Returns a property's name, converted from camel case if it is from a version below 2.
pub(super) fn to_snake_case_if_old(name: &str, is_old: bool) -> String {
    if !is_old {
        return name.to_owned();
    }
    let mut result = String::new();
    let mut characters = name.chars().peekable();
    let mut is_after_lowercase = false;
    while let Some(character) = characters.next() {
        if is_after_lowercase && character.is_ascii_uppercase() {
            result.push('_');
            result.push(character.to_ascii_lowercase());
            while let Some(upper) = characters.next_if(char::is_ascii_uppercase) {
                result.push(upper.to_ascii_lowercase());
            }
            is_after_lowercase = false;
        } else {
            result.push(character);
            is_after_lowercase = character.is_ascii_lowercase();
        }
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spectra_are_numbers_colors_or_pairs() {
        let parse = |value: &str| {
            let attribute = Attribute { name: "value".to_owned(), value: value.to_owned(), span: 0..1 };
            parse_spectrum_or_rgb(&attribute)
        };
        assert_eq!(parse("0.5"), Ok(PropertyValue::Spectrum(SpectrumValue::Uniform(0.5))));
        assert_eq!(parse("1, 2, 3"), Ok(PropertyValue::Rgb(DVec3::new(1.0, 2.0, 3.0))));
        assert!(matches!(parse("400:1, 500:2"), Ok(PropertyValue::Spectrum(SpectrumValue::Sampled(_)))));
        for wrong in ["", "a", "1 2", "400:1 300:2", "400:1, 5", "nan", "1e999"] {
            assert!(parse(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn transforms_apply_in_written_order() {
        let element = |tag: &str, attributes: &[(&str, &str)], children| Element {
            tag: tag.to_owned(),
            attributes: attributes
                .iter()
                .map(|(name, value)| Attribute {
                    name: (*name).to_owned(),
                    value: (*value).to_owned(),
                    span: 0..0,
                })
                .collect(),
            children,
            span: 0..0,
            is_old: false,
        };
        let scale = || element("scale", &[("value", "2")], Vec::new());
        let moved = || element("translate", &[("x", "1")], Vec::new());
        let at = |children| {
            let transform = parse_transform(&element("transform", &[], children)).expect("a transform");
            transform.matrix.transform_point3(DVec3::X)
        };
        assert_eq!(at(vec![scale(), moved()]), DVec3::X * 3.0);
        assert_eq!(at(vec![moved(), scale()]), DVec3::X * 4.0);
    }

    #[test]
    fn camel_case_becomes_snake_case() {
        for (old, new) in [
            ("toWorld", "to_world"),
            ("intIOR", "int_ior"),
            ("fovAxis", "fov_axis"),
            ("alpha", "alpha"),
            ("flipTexCoords", "flip_tex_coords"),
            ("to_world", "to_world"),
            ("sigmaA", "sigma_a"),
        ] {
            assert_eq!(
                (to_snake_case_if_old(old, true), to_snake_case_if_old(old, false)),
                (new.to_owned(), old.to_owned())
            );
        }
    }
}
