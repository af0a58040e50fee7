//! Shows the images and their difference in the terminal, above the table.

use std::io::IsTerminal;
use std::path::Path;

use super::figure;
use crate::args::{CompareArgs, Pictures};
use crate::compare::{self, Measured, Pair};
use crate::console::Console;
use crate::film::RadianceImage;
use crate::film::tone::{ToneMapping, develop};
use crate::scene::sanitize::visible;
use crate::tui::{NamedImage, images_as_text};

/// FLIP below this value is hard to see in false color.
const MIN_VISIBLE_FLIP: f32 = 0.1;

/// Renders the images as text. Empty if the terminal is too small.
pub(super) fn lines(args: &CompareArgs, pair: &Pair, measured: &Measured) -> String {
    let is_terminal = std::io::stdout().is_terminal();
    let is_wanted = match args.pictures {
        Pictures::Auto => is_terminal,
        Pictures::On => true,
        Pictures::Off => false,
    };
    if !is_wanted {
        return String::new();
    }
    let (difference, description) = difference(pair, measured);
    let pictures = [
        named(&name(&args.a), pair.a()),
        named(&format!("{}, the reference", name(&args.b)), pair.b()),
        named(&description, &difference),
    ];
    images_as_text(&pictures, args.color, is_terminal)
}

pub(super) fn show(lines: &str, console: &Console) {
    if !lines.is_empty() {
        console.text(&format!("{lines}\n"));
    }
}

fn name(path: &Path) -> String {
    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}

/// Tone maps an image for display.
fn named(name: &str, image: &RadianceImage) -> NamedImage {
    NamedImage { name: visible(name).into_owned(), picture: develop(image, &ToneMapping::default()) }
}

/// FLIP in false color, or |a - b| scaled to its maximum if FLIP is too small to see.
fn difference(pair: &Pair, measured: &Measured) -> (RadianceImage, String) {
    let errors = &measured.errors;
    if errors.max == 0.0 || measured.flip.iter().any(|error| *error >= MIN_VISIBLE_FLIP) {
        return (compare::heat(pair, &measured.flip), "FLIP".to_owned());
    }
    let mut image = compare::absolute(pair);
    let scale = (1.0 / errors.max) as f32;
    image.pixels.iter_mut().for_each(|pixel| *pixel *= scale);
    (image, format!("|a - b|, white is {}", figure(errors.max)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vec3;

    fn shown(b: f32) -> (RadianceImage, String) {
        let image =
            |value| RadianceImage { width: 2, height: 1, pixels: vec![Vec3::splat(0.5), Vec3::splat(value)] };
        let pair = Pair::new([Path::new("a"), Path::new("b")], image(0.5), image(b)).expect("a pair");
        difference(&pair, &compare::measure(&pair))
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
