//! Shows the images and their difference in the terminal, above the table.

use std::io::IsTerminal;
use std::path::Path;

use super::format_six_significant_digits;
use crate::args::{CompareArgs, CompareImageVisibility};
use crate::compare::{self, ImagePair, PairMeasurements};
use crate::console::Console;
use crate::film::RadianceImage;
use crate::film::tone::{ToneMapping, tone_map_to_8_bits};
use crate::scene::sanitize::escape_invisible_chars;
use crate::tui::{NamedImage, images_as_text};

/// FLIP below this value is hard to see in false color.
const MIN_VISIBLE_FLIP: f32 = 0.1;

/// Renders the images as text. Returns an empty string if no images are wanted or the terminal is too small.
pub(super) fn render_images_as_text(
    args: &CompareArgs,
    pair: &ImagePair,
    measured: &PairMeasurements,
) -> String {
    let is_terminal = std::io::stdout().is_terminal();
    let is_wanted = match args.pictures {
        CompareImageVisibility::Auto => is_terminal,
        CompareImageVisibility::On => true,
        CompareImageVisibility::Off => false,
    };
    if !is_wanted {
        return String::new();
    }
    let (difference, description) = flip_or_difference_image_and_label(pair, measured);
    let pictures = [
        tone_map_to_named_image(&file_name_or_path(&args.a), pair.measured_image()),
        tone_map_to_named_image(&format!("{}, the reference", file_name_or_path(&args.b)), pair.reference()),
        tone_map_to_named_image(&description, &difference),
    ];
    images_as_text(&pictures, args.color, is_terminal)
}

pub(super) fn print_images(lines: &str, console: &Console) {
    if !lines.is_empty() {
        console.print_trusted_text(&format!("{lines}\n"));
    }
}

fn file_name_or_path(path: &Path) -> String {
    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}

/// Tone maps an image for display.
fn tone_map_to_named_image(name: &str, image: &RadianceImage) -> NamedImage {
    NamedImage {
        name: escape_invisible_chars(name).into_owned(),
        picture: tone_map_to_8_bits(image, &ToneMapping::default()),
    }
}

/// Returns FLIP in false color, or |a - b| scaled to its maximum if FLIP is too small to see.
fn flip_or_difference_image_and_label(
    pair: &ImagePair,
    measured: &PairMeasurements,
) -> (RadianceImage, String) {
    let errors = &measured.errors;
    if errors.max == 0.0 || measured.flip.iter().any(|error| *error >= MIN_VISIBLE_FLIP) {
        return (compare::flip_heat_map(pair, &measured.flip), "FLIP".to_owned());
    }
    let mut image = compare::absolute_difference(pair);
    let scale = (1.0 / errors.max) as f32;
    image.pixels.iter_mut().for_each(|pixel| *pixel *= scale);
    (image, format!("|a - b|, white is {}", format_six_significant_digits(errors.max)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vec3;

    fn shown(b: f32) -> (RadianceImage, String) {
        let image =
            |value| RadianceImage { width: 2, height: 1, pixels: vec![Vec3::splat(0.5), Vec3::splat(value)] };
        let pair = ImagePair::new([Path::new("a"), Path::new("b")], image(0.5), image(b)).expect("a pair");
        flip_or_difference_image_and_label(&pair, &compare::measure(&pair))
    }

    #[test]
    fn difference_is_always_visible() {
        assert_eq!(shown(0.0).1, "FLIP");
        assert_eq!(shown(0.5).1, "FLIP", "large errors use FLIP");
        let (faint, name) = shown(0.501);
        assert!(name.contains("0.000999") || name.contains("0.00100"), "{name}");
        assert!(faint.pixels[0] == Vec3::ZERO && (faint.pixels[1].x - 1.0).abs() < 1e-5, "{faint:?}");
    }
}
