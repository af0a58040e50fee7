//! Request outcomes, for callers that render a single image synchronously.

use std::error::Error;
use std::fmt;
use std::path::Path;

use super::super::protocol::{Failure, Report, Request};
use super::super::sink::EventSink;
use super::super::stages::AbortReason;
use super::{Engine, RequestContext};
use crate::film::{FilmQuantity, RadianceImage};
use crate::scene::diagnostic::Diagnostic;
use crate::scene::fingerprint::Fingerprint;
use crate::scene::report::{ReportStyle, render_report};

/// A rendered image.
#[derive(Clone, Debug)]
pub struct RenderedImage {
    /// Linear radiance, before exposure.
    pub image: RadianceImage,
    /// Report of the request.
    pub report: Box<Report>,
    /// Likely mistakes in the scene.
    pub warnings: Vec<Diagnostic>,
    /// Key that covers everything that affects the image except the number of samples.
    pub key: Fingerprint,
}

/// Reasons why no image was rendered.
#[derive(Clone, Debug)]
pub enum RenderFailure {
    /// The scene is invalid, or the work failed.
    Failed(Failure),
    /// A cancel token stopped the work.
    Cancelled,
}

impl fmt::Display for RenderFailure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Failed(Failure::Scene(diagnostics)) => {
                f.write_str(render_report(diagnostics, COLUMNS, ReportStyle::Plain).trim_end())
            }
            Self::Failed(Failure::Work(message)) => f.write_str(message),
            Self::Cancelled => f.write_str("the render was cancelled"),
        }
    }
}

impl Error for RenderFailure {}

/// Line width for diagnostics in error messages.
const COLUMNS: usize = 120;

/// Outcome of a finished request.
pub(super) struct CompletedRequest {
    pub(super) report: Report,
    /// Reasons why the image is not written.
    pub(super) conflicts: Vec<Diagnostic>,
    /// Likely mistakes in the scene.
    pub(super) warnings: Vec<Diagnostic>,
    /// Whether the displayed image is unchanged.
    pub(super) unchanged: bool,
}

impl Engine {
    /// Runs a request and returns its image.
    ///
    /// # Errors
    /// Returns the reason if no image was rendered.
    pub(crate) fn render_radiance_image(
        &mut self,
        request: &Request,
        sink: &EventSink,
        context: &RequestContext<'_>,
    ) -> Result<RenderedImage, RenderFailure> {
        match self.run_request(request, sink, context) {
            // An in-memory image is not written, so there are no conflicts.
            Ok(CompletedRequest { report, conflicts: _, warnings, unchanged: _ }) => {
                let state = self.films.current();
                let gone = || RenderFailure::Failed(Failure::Work("the film is missing".to_owned()));
                let state = state.ok_or_else(gone)?;
                let image = state.film.image(FilmQuantity::Radiance);
                Ok(RenderedImage { image, report: Box::new(report), warnings, key: state.key })
            }
            Err(AbortReason::Failed(failure)) => Err(RenderFailure::Failed(failure)),
            Err(AbortReason::Cancelled) => Err(RenderFailure::Cancelled),
        }
    }

    /// Whether the last request read the file at a path.
    pub(crate) fn has_read_file(&self, path: &Path) -> bool {
        self.inputs.contains_path(path)
    }
}
