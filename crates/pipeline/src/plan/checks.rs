//! Checks of options that contradict each other, the image or its file format.

use std::path::{Path, PathBuf};

use super::outputs::OutputFiles;
use super::{RenderPlan, argument_error};
use crate::choice::Choice;
use crate::film::{FilmQuantity, Rect};
use crate::integrators::{AovSource, RenderSettings};
use crate::output::{AnimationFormat, BitDepth, Format, OutputError};
use crate::scene::description::RenderOptions;
use crate::scene::diagnostic::{Diagnostic, Severity};
use crate::settings::{Overrides, ViewMode};

/// Checks that the requested layers can be written.
pub(super) fn check_layers(plan: &RenderPlan) -> Result<(), Box<Diagnostic>> {
    if plan.layers.is_empty() {
        return Ok(());
    }
    let refused = |message: String, help: &str| Err(argument_error(message, help));
    let is_exr = |path: &&PathBuf| Format::from_path(path).is_ok_and(|format| format == Format::Exr);
    let OutputFiles { images, animations, .. } = &plan.outputs;
    if let Some(other) = images.iter().find(|path| !is_exr(path)).or(animations.first()) {
        let message = format!("`--layers` needs EXR output; {} is not an EXR file", other.display());
        return refused(message, "write an EXR file, for example -o layers.exr");
    }
    let view = plan.settings.view;
    if view != ViewMode::Beauty {
        let message = format!("`--layers` needs the `beauty` view, not `{}`", view.name());
        return refused(message, "remove --view, or request it as a layer");
    }
    Ok(())
}

/// Checks that an animation format supports the image size and bit depth.
pub(super) fn check_animation_format(plan: &RenderPlan, path: &Path) -> Result<(), Box<Diagnostic>> {
    let Some(format) = AnimationFormat::from_path(path) else { return Ok(()) };
    let RenderOptions { width, height, .. } = plan.settings.render;
    let message = match format.check_size(width, height) {
        Err(error) => error.to_string(),
        Ok(()) if plan.bit_depth != 8 => format!("animated {format} files have 8 bits per channel"),
        Ok(()) => return Ok(()),
    };
    let error = argument_error(message, "use numbered files, for example a_####.png");
    Err(Box::new(Diagnostic { path: path.to_owned(), ..*error }))
}

pub(super) fn check_crop(crop: Option<Rect>, width: u32, height: u32) -> Result<(), Box<Diagnostic>> {
    let inside = |rect: Rect| {
        rect.area() > 0
            && rect.x.checked_add(rect.width).is_some_and(|right| right <= width)
            && rect.y.checked_add(rect.height).is_some_and(|bottom| bottom <= height)
    };
    match crop {
        Some(rect) if !inside(rect) => {
            let Rect { x, y, width: w, height: h } = rect;
            let message =
                format!("`--crop {x},{y},{w},{h}` is not inside the image of {width}×{height} pixels");
            let help = "X,Y,W,H are the left edge, top edge, width and height in pixels";
            Err(argument_error(message, help))
        }
        _ => Ok(()),
    }
}

/// Checks that an image with these settings can be rendered in parts and that exactly one output file is
/// specified.
pub(super) fn check_shardable(
    settings: &RenderSettings,
    overrides: &Overrides,
) -> Result<(), Box<Diagnostic>> {
    let refused = |message: &str, help: &str| Err(argument_error(message.to_owned(), help));
    if overrides.outputs.len() != 1 {
        return refused("`--shard` needs exactly one output file", "name it, for example -o night.1.part");
    }
    if overrides.time_seconds.is_some() {
        return refused(
            "`--shard` does not work with `--time`: machines differ in speed",
            "use --samples or --error",
        );
    }
    if settings.gathers_photons() && settings.render.error > 0.0 {
        let message =
            "`--shard` does not work with photons and a noise target: each pass needs the whole image";
        return refused(message, "use --error 0 with --samples, or --photons off");
    }
    if settings.gathers_photons() && settings.view.aov_source() == AovSource::Film(FilmQuantity::Error) {
        return refused(
            "`--shard` does not work with photons and the `error` view",
            "render it without --shard, or use --photons off",
        );
    }
    Ok(())
}

/// Checks that the file format supports the image size and bit depth.
pub(super) fn check_size_and_bit_depth(plan: &RenderPlan, path: &Path) -> Result<(), Box<Diagnostic>> {
    let RenderOptions { width, height, .. } = plan.settings.render;
    let check = || Format::from_path(path)?.check_image(width, height, BitDepth::try_from(plan.bit_depth)?);
    check().map_err(|error: OutputError| {
        Box::new(Diagnostic::about_file(path, Severity::Error, error.to_string()))
    })
}
