//! EXR layers: additional channels for the finished image.
//!
//! The film sums the light and first-hit layers from the image's own samples, so the light components add up to
//! the image.

use super::film_state::FilmState;
use crate::choice::Choice;
use crate::film::{Quantity, RadianceImage};
use crate::integrators::{LayerSet, SampleLayer};
use crate::output::LayerImage;
use crate::plan::RenderPlan;
use crate::settings::OutputLayer;

/// Channel names that compositing programs expect for colors, directions and scalars.
const COLOR: &[&str] = &["R", "G", "B"];
const DIRECTION: &[&str] = &["X", "Y", "Z"];
const DISTANCE: &[&str] = &["Z"];
const NUMBER: &[&str] = &["X"];

/// Source of a layer's values.
enum LayerSource {
    /// A layer of the film.
    Samples(SampleLayer),
    /// A statistic of the image's samples.
    Statistic(fn(&FilmState) -> RadianceImage),
}

impl OutputLayer {
    fn source_and_channels(self) -> (LayerSource, &'static [&'static str]) {
        match self {
            Self::Albedo => (LayerSource::Samples(SampleLayer::Albedo), COLOR),
            Self::Normal => (LayerSource::Samples(SampleLayer::Normal), DIRECTION),
            Self::Depth => (LayerSource::Samples(SampleLayer::Depth), DISTANCE),
            Self::Variance => (LayerSource::Statistic(luminance_variance_image), NUMBER),
            Self::Samples => (LayerSource::Statistic(|state| state.film.image(Quantity::Samples)), NUMBER),
            Self::Ambient => (LayerSource::Samples(SampleLayer::Ambient), COLOR),
            Self::Diffuse => (LayerSource::Samples(SampleLayer::Diffuse), COLOR),
            Self::Specular => (LayerSource::Samples(SampleLayer::Specular), COLOR),
            Self::Emission => (LayerSource::Samples(SampleLayer::Emission), COLOR),
        }
    }
}

/// Returns the squared standard error of each pixel's mean luminance.
fn luminance_variance_image(state: &FilmState) -> RadianceImage {
    let mut image = state.film.image(Quantity::Error);
    image.pixels.iter_mut().for_each(|error| *error *= *error);
    image
}

/// Returns the layers that must be recorded with the image's samples.
pub(crate) fn sample_layers(layers: &[OutputLayer]) -> LayerSet {
    let recorded = |layer: &OutputLayer| match layer.source_and_channels().0 {
        LayerSource::Samples(layer) => Some(layer),
        LayerSource::Statistic(_) => None,
    };
    layers.iter().filter_map(recorded).collect()
}

/// Returns the images of a plan's layers.
pub(crate) fn layer_images(state: &FilmState, plan: &RenderPlan) -> Vec<LayerImage> {
    let mut recorded: Vec<_> = plan.settings.layers.iter().zip(state.film.layer_images()).collect();
    let mut take = |layer: SampleLayer| {
        let place = recorded.iter().position(|(own, _)| *own == layer)?;
        Some(recorded.swap_remove(place).1)
    };
    let of = |layer: &OutputLayer| {
        let (source, channels) = layer.source_and_channels();
        let image = match source {
            LayerSource::Samples(layer) => take(layer)?,
            LayerSource::Statistic(image) => image(state),
        };
        Some(LayerImage { name: layer.name(), channels, image })
    };
    plan.layers.iter().filter_map(of).collect()
}
