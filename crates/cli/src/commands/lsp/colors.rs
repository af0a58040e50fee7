//! Color swatches in the editor, with linear numbers converted to sRGB.

use lsp_types::{Color, ColorInformation, ColorPresentation};
use serde_json::{Value, json};

use super::document::OpenDocument;
use crate::math::color::{linear_to_srgb, srgb8_color_to_linear};
use crate::scene::keys::key::ValueKind;
use crate::scene::keys::parse_hex_or_named_srgb8;
use crate::scene::outline::OutlineKey;

/// Returns all colors in a document.
pub(super) fn document_colors(document: &OpenDocument) -> Value {
    let mut found = Vec::new();
    for table in &document.tables {
        let known = table.keys_allowed_for_type();
        for key in &table.keys {
            let kind = known.iter().find(|info| info.name == key.name.text).map(|info| info.kind);
            let is_color = matches!(
                kind,
                Some(ValueKind::Color(_) | ValueKind::ColorOrTexture(_) | ValueKind::Emission(_))
            );
            if let Some(color) = parse_color(&document.text, key).filter(|_| is_color) {
                found.push(ColorInformation { range: document.to_lsp_range(&key.value), color });
            }
        }
    }
    json!(found)
}

/// Parses a value as a color. Numbers are clamped to [0, 1].
fn parse_color(text: &str, key: &OutlineKey) -> Option<Color> {
    let bytes = match &key.text {
        Some(text) => parse_hex_or_named_srgb8(text)?,
        None => {
            let list = text.get(key.value.clone())?.strip_prefix('[')?.strip_suffix(']')?;
            let numbers: Vec<f32> =
                list.split(',').map(|number| number.trim().parse().ok()).collect::<Option<_>>()?;
            let &[red, green, blue] = numbers.as_slice() else { return None };
            if !numbers.iter().all(|number| number.is_finite()) {
                return None;
            }
            let [red, green, blue] = [red, green, blue].map(|linear| linear_to_srgb(linear.clamp(0.0, 1.0)));
            return Some(Color { red, green, blue, alpha: 1.0 });
        }
    };
    let [red, green, blue] = bytes.map(|byte| f32::from(byte) / 255.0);
    Some(Color { red, green, blue, alpha: 1.0 })
}

/// Formats a color picked in the editor, both as `#rrggbb` and as linear numbers.
pub(super) fn color_presentations(params: &Value) -> Option<Value> {
    let color: Color = serde_json::from_value(params["color"].clone()).ok()?;
    let bytes = [color.red, color.green, color.blue].map(|part| (part.clamp(0.0, 1.0) * 255.0).round() as u8);
    let [red, green, blue] = bytes;
    let linear = srgb8_color_to_linear(bytes).to_array().map(|part| format!("{part:.3}"));
    let labels = [format!("\"#{red:02x}{green:02x}{blue:02x}\""), format!("[{}]", linear.join(", "))];
    let presentation = |label: String| ColorPresentation { label, ..ColorPresentation::default() };
    Some(json!(labels.map(presentation)))
}
