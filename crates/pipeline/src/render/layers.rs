//! EXR layers: additional channels for the finished image.
//!
//! Each light or first-hit layer is rendered to its own film with the same number of samples per pixel as the
//! image. This way, the light components add up to the image even if a noise target determined the number of
//! samples.

use super::film_state::FilmState;
use super::scheduler::{RenderStageInputs, Scheduler};
use crate::film::{ConvergenceModel, FilmQuantity, RadianceImage};
use crate::integrators::ViewMode;
use crate::keys;
use crate::math::Vec3;
use crate::output::LayerImage;
use crate::scene::fingerprint::FingerprintHasher;
use crate::settings::OutputLayer;
use crate::stages::AbortReason;
use crate::stages::photons::PhotonStore;
use crate::trace::Tracer;

/// Channel names that compositing programs expect for colors, directions and scalars.
const COLOR: &[&str] = &["R", "G", "B"];
const DIRECTION: &[&str] = &["X", "Y", "Z"];
const DISTANCE: &[&str] = &["Z"];
const NUMBER: &[&str] = &["X"];

/// Source of a layer's values.
enum LayerSource {
    /// Samples rendered with a view.
    View(ViewMode),
    /// Values from the image's film.
    Film(fn(&FilmState) -> RadianceImage),
}

impl OutputLayer {
    fn source_and_channels(self) -> (LayerSource, &'static [&'static str]) {
        match self {
            Self::Albedo => (LayerSource::View(ViewMode::Albedo), COLOR),
            Self::Normal => (LayerSource::View(ViewMode::Normal), DIRECTION),
            Self::Depth => (LayerSource::View(ViewMode::Depth), DISTANCE),
            Self::Variance => (LayerSource::Film(squared_standard_error_image), NUMBER),
            Self::Samples => (LayerSource::Film(|state| state.film.image(FilmQuantity::Samples)), NUMBER),
            Self::Ambient => (LayerSource::View(ViewMode::Ambient), COLOR),
            Self::Diffuse => (LayerSource::View(ViewMode::Diffuse), COLOR),
            Self::Specular => (LayerSource::View(ViewMode::Specular), COLOR),
            Self::Emission => (LayerSource::View(ViewMode::Emission), COLOR),
        }
    }

    /// Returns the layer's render cost relative to the image.
    fn relative_cost(self) -> f64 {
        match self {
            Self::Albedo | Self::Normal | Self::Depth => 0.1,
            Self::Variance | Self::Samples => 0.0,
            Self::Ambient | Self::Diffuse | Self::Specular | Self::Emission => 1.0,
        }
    }
}

/// Returns the squared standard error of each pixel's mean luminance.
fn squared_standard_error_image(state: &FilmState) -> RadianceImage {
    let mut image = state.film.image(FilmQuantity::Error);
    image.pixels.iter_mut().for_each(|error| *error *= *error);
    image
}

/// Returns the progress fractions at the start and end of a layer. `None` means the image, which
/// precedes layer 0.
pub(crate) fn progress_range(layers: &[OutputLayer], number: Option<usize>) -> [f64; 2] {
    let work = |layers: &[OutputLayer]| layers.iter().map(|layer| layer.relative_cost()).sum::<f64>();
    let all = 1.0 + work(layers);
    match number {
        None => [0.0, 1.0 / all],
        Some(number) => [number, number + 1].map(|end| (1.0 + work(&layers[..end])) / all),
    }
}

/// Renders a finished film's layers in order.
///
/// # Errors
/// The token is cancelled, or there is not enough memory for a film.
pub(crate) fn render_layers(
    state: &FilmState,
    rendering: &RenderStageInputs<'_>,
    layers: &[OutputLayer],
) -> Result<Vec<LayerImage>, AbortReason> {
    let mut images = Vec::with_capacity(layers.len());
    for (number, layer) in layers.iter().enumerate() {
        let (source, channels) = layer.source_and_channels();
        let image = match source {
            LayerSource::Film(image) => image(state),
            LayerSource::View(view) => {
                render_view_at_image_samples(view, state, rendering, progress_range(layers, Some(number)))?
            }
        };
        images.push(LayerImage { name: crate::choice::Choice::name(*layer), channels, image });
    }
    Ok(images)
}

/// Renders a view with the same number of samples in each pixel as the image.
fn render_view_at_image_samples(
    view: ViewMode,
    picture: &FilmState,
    rendering: &RenderStageInputs<'_>,
    progress: [f64; 2],
) -> Result<RadianceImage, AbortReason> {
    let mut plan = rendering.plan.clone();
    plan.settings.view = view;
    // Use the image's sample counts, no matter what ended its render.
    plan.settings.render.error = 0.0;
    plan.settings.render.samples = picture.film.sample_count_stats().max;
    plan.time_seconds = None;
    let photons = rendering.photons.filter(|_| plan.settings.gathers_photons());
    let convergence = match photons.is_some_and(PhotonStore::has_lit_caustic_casters) {
        true => ConvergenceModel::Photons,
        false => ConvergenceModel::Stratified,
    };
    let key = keys::film_sums_key(
        FingerprintHasher::new("layer").add_fingerprint(&picture.key).finish(),
        &plan.settings,
        plan.crop,
    );
    let mut state = FilmState::new(key, &plan, rendering.most_film_bytes, convergence, None)
        .map_err(AbortReason::work_failure)?;
    state.goals = picture.goals_from_current_samples();
    let sink = rendering.sink.for_progress_range(progress);
    let rendering = RenderStageInputs {
        tracer: Tracer { settings: &plan.settings, ..rendering.tracer },
        plan: &plan,
        photons,
        preview: None,
        first: None,
        sink: &sink,
        // Orders received during this render apply to the image.
        pulse: &|_, _| (),
        take_preview: &|| None,
        share: None,
        checkpointer: None,
        ..*rendering
    };
    let signed = |normal: Vec3| if normal == Vec3::ZERO { normal } else { normal * 2.0 - Vec3::ONE };
    let mut scheduler = Scheduler::new(&mut state, &rendering);
    scheduler.changed = if view == ViewMode::Normal { Some(&signed) } else { None };
    scheduler.run()?;
    Ok(state.film.image(FilmQuantity::Radiance))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn progress_covers_image_and_all_layers() {
        let all = [OutputLayer::Depth, OutputLayer::Samples, OutputLayer::Diffuse, OutputLayer::Specular];
        let ends: Vec<_> =
            [None, Some(0), Some(1), Some(2), Some(3)].map(|at| progress_range(&all, at)).to_vec();
        assert_eq!((ends[0][0], ends[4][1]), (0.0, 1.0));
        assert!(ends.windows(2).all(|two| two[0][1] == two[1][0]), "{ends:?}");
        assert_eq!(progress_range(&[], None), [0.0, 1.0]);
    }
}
