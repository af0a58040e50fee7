//! EXR layers: additional channels for the finished image.
//!
//! The film sums the light and first-hit layers from the image's own samples, so the light components add up
//! to the image.

use super::film_state::FilmState;
use crate::choice::Choice;
use crate::film::{FilmQuantity, RadianceImage};
use crate::integrators::SampleLayer;
use crate::output::LayerImage;
use crate::plan::RenderPlan;
use crate::settings::{LayerValueSource, OutputLayer};

/// Channel names that compositing programs expect for colors, directions and scalars.
const COLOR: &[&str] = &["R", "G", "B"];
const DIRECTION: &[&str] = &["X", "Y", "Z"];
const DISTANCE: &[&str] = &["Z"];
const NUMBER: &[&str] = &["X"];

impl OutputLayer {
    fn channel_names(self) -> &'static [&'static str] {
        match self {
            Self::Albedo | Self::Ambient | Self::Diffuse | Self::Specular | Self::Emission => COLOR,
            Self::Normal => DIRECTION,
            Self::Depth => DISTANCE,
            Self::Variance | Self::Samples => NUMBER,
        }
    }
}

/// Returns the squared standard error of each pixel's mean luminance.
fn squared_standard_error_image(state: &FilmState) -> RadianceImage {
    let mut image = state.film.image(FilmQuantity::Error);
    image.pixels.iter_mut().for_each(|error| *error *= *error);
    image
}

/// Returns the images of a plan's layers.
pub(crate) fn layer_images(state: &FilmState, plan: &RenderPlan) -> Vec<LayerImage> {
    let mut recorded: Vec<_> = plan.settings.layers.iter().zip(state.film.layer_images()).collect();
    let mut take = |layer: SampleLayer| {
        let place = recorded.iter().position(|(own, _)| *own == layer)?;
        Some(recorded.swap_remove(place).1)
    };
    let of = |layer: &OutputLayer| {
        let image = match layer.source() {
            LayerValueSource::Samples(layer) => take(layer)?,
            LayerValueSource::Variance => squared_standard_error_image(state),
            LayerValueSource::SampleCount => state.film.image(FilmQuantity::Samples),
        };
        Some(LayerImage { name: layer.name(), channels: layer.channel_names(), image })
    };
    plan.layers.iter().filter_map(of).collect()
}
