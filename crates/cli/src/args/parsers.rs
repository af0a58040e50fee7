//! Parsers for the values of options.

use std::ops::RangeInclusive;

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};

use crate::choice::Choice;
use crate::film::Rect;
use crate::pipeline::settings::OutputLayer;
use crate::pipeline::turntable;
use crate::scene::keys::{ValueKind, find_key_in_table};

/// Maximum number of parts per image.
pub(super) const MAX_PARTS: u32 = 1 << 20;

/// Creates a parser that accepts the names of a choice's values.
pub(super) fn choice_parser<C: Choice>() -> impl TypedValueParser<Value = C> {
    let known = C::ALL.iter().map(|one| PossibleValue::new(one.name()).help(one.meaning()));
    let other = C::UNAVAILABLE.iter().map(|&name| PossibleValue::new(name).help(UNAVAILABLE));
    PossibleValuesParser::new(known.chain(other)).try_map(|name| {
        let names = || C::ALL.iter().map(|one| one.name()).collect::<Vec<_>>().join(", ");
        C::named(&name).ok_or_else(|| format!("{UNAVAILABLE}; use {}", names()))
    })
}

const UNAVAILABLE: &str = "not available in this version";

/// Returns long help that lists a choice's values, in clap's format.
pub(super) fn choice_long_help<C: Choice>(about: &str) -> String {
    let values: String = C::ALL.iter().map(|one| format!("\n- {}: {}", one.name(), one.meaning())).collect();
    format!("{about}\n\nPossible values:{values}")
}

pub(super) fn parse_bit_depth(text: &str) -> Result<u8, String> {
    match text {
        "8" => Ok(8),
        "16" => Ok(16),
        _ => Err("expected 8 or 16".to_owned()),
    }
}

pub(super) fn parse_u32(text: &str) -> Result<u32, String> {
    parse_integer_in_range(text, 0..=u32::MAX)
}

/// Parses an option that overrides an integer key in `[render]`.
pub(super) fn integer_override_parser(
    key: &'static str,
) -> impl Fn(&str) -> Result<u32, String> + Clone + Send + Sync + 'static {
    move |text| {
        let Some(ValueKind::Whole(least, most)) = find_key_in_table("render", key).map(|key| key.kind) else {
            return Err(format!("`{key}` is not an integer key of [render]"));
        };
        parse_integer_in_range(text, least as u32..=most as u32)
    }
}

/// Parses an option that overrides a number key in `[render]`. `expected` is the error message for an invalid
/// value.
pub(super) fn number_override_parser(
    key: &'static str,
    expected: &'static str,
) -> impl Fn(&str) -> Result<f32, String> + Clone + Send + Sync + 'static {
    move |text| {
        let limits = find_key_in_table("render", key).and_then(|key| key.kind.limits());
        let limits = limits.ok_or_else(|| format!("`{key}` is not a number key of [render]"))?;
        let number = text.parse::<f32>().ok();
        let number = number.filter(|number| limits.violation(f64::from(*number)).is_none());
        number.ok_or_else(|| expected.to_owned())
    }
}

/// Error message for `--error`.
pub(super) const ERROR: &str = "expected a relative error, such as 0.02, or 0 for no target";
/// Error message for `--clamp`.
pub(super) const CLAMP: &str = "expected a radiance from 0 to 1e18 (0 disables the limit)";

pub(super) fn parse_integer_in_range(text: &str, range: RangeInclusive<u32>) -> Result<u32, String> {
    let number = text.parse().ok().filter(|number| range.contains(number));
    number.ok_or_else(|| format!("expected a whole number from {} to {}", range.start(), range.end()))
}

fn parse_number(text: &str, accepts: impl Fn(f64) -> bool, expected: &str) -> Result<f64, String> {
    let number = text.parse().ok().filter(|number: &f64| number.is_finite() && accepts(*number));
    number.ok_or_else(|| expected.to_owned())
}

pub(super) fn parse_positive_seconds(text: &str) -> Result<f64, String> {
    parse_number(text, |seconds| seconds > 0.0, "expected a number of seconds above 0")
}

pub(super) fn parse_nonnegative_number(text: &str) -> Result<f64, String> {
    parse_number(text, |number| number >= 0.0, "expected a nonnegative number")
}

/// Parses a checkpoint interval.
pub(super) fn parse_checkpoint_interval(text: &str) -> Result<f64, String> {
    parse_number(text, |seconds| seconds >= 0.0, "expected a number of seconds, or 0 for no checkpoints")
}

/// Parses the minimum render time for notifications.
pub(super) fn parse_notification_time(text: &str) -> Result<f64, String> {
    parse_number(text, |seconds| seconds >= 0.0, "expected a number of seconds, or 0 for no notifications")
}

/// Parses a size in bytes, with an optional unit.
pub(super) fn parse_byte_size(text: &str) -> Result<u64, String> {
    let expected = || "expected a size, such as 8GiB, 500MB or 1000000".to_owned();
    let digits = text.trim_end_matches(|c: char| c.is_ascii_alphabetic());
    let number: f64 = digits.trim().parse().map_err(|_| expected())?;
    let unit: u64 = match text[digits.len()..].to_lowercase().as_str() {
        "" | "b" => 1,
        "k" | "kib" => 1 << 10,
        "kb" => 1000,
        "m" | "mib" => 1 << 20,
        "mb" => 1_000_000,
        "g" | "gib" => 1 << 30,
        "gb" => 1_000_000_000,
        "t" | "tib" => 1 << 40,
        "tb" => 1_000_000_000_000,
        _ => return Err(expected()),
    };
    let bytes = number * unit as f64;
    if (1.0..1e18).contains(&bytes) { Ok(bytes as u64) } else { Err(expected()) }
}

/// Parses `I/N`: the number of a part and the total number of parts.
pub(super) fn parse_shard(text: &str) -> Result<(u32, u32), String> {
    let numbers =
        text.split_once('/').and_then(|(index, count)| Some((index.parse().ok()?, count.parse().ok()?)));
    match numbers {
        Some((index, count)) if (1..=count).contains(&index) && count <= MAX_PARTS => Ok((index, count)),
        _ => Err(format!("expected I/N, such as 1/8 for the first of 8 parts, with N at most {}", MAX_PARTS)),
    }
}

/// Layers to write to EXR files, without duplicates.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OutputLayers(pub Vec<OutputLayer>);

pub(super) fn parse_layers(text: &str) -> Result<OutputLayers, String> {
    if text == "all" {
        return Ok(OutputLayers(OutputLayer::ALL.to_vec()));
    }
    let mut layers = Vec::new();
    for name in text.split(',').map(str::trim) {
        let layer = OutputLayer::named(name).ok_or_else(|| {
            let known: Vec<_> = OutputLayer::ALL.iter().map(|layer| layer.name()).collect();
            format!("unknown layer {name:?}; expected all, {}", known.join(", "))
        })?;
        if !layers.contains(&layer) {
            layers.push(layer);
        }
    }
    Ok(OutputLayers(layers))
}

pub(super) fn parse_turntable_frames(text: &str) -> Result<u32, String> {
    parse_integer_in_range(text, 1..=turntable::MAX_FRAMES)
}

pub(super) fn parse_thread_count(text: &str) -> Result<usize, String> {
    const MAX_THREADS: usize = 4096;
    match text.parse::<usize>() {
        Ok(count) if count <= MAX_THREADS => Ok(count),
        _ => Err(format!("expected a number from 0 to {MAX_THREADS}")),
    }
}

pub(super) fn parse_niceness(text: &str) -> Result<u8, String> {
    parse_integer_in_range(text, 0..=19).map(|steps| steps as u8)
}

pub(super) fn parse_crop(text: &str) -> Result<Rect, String> {
    let numbers: Vec<u32> = text.split(',').map_while(|part| part.trim().parse().ok()).collect();
    match (numbers.as_slice(), text.split(',').count()) {
        (&[x, y, width, height], 4) if width > 0 && height > 0 => Ok(Rect { x, y, width, height }),
        _ => Err("expected X,Y,W,H with W and H above 0, such as 100,50,64,64".to_owned()),
    }
}
