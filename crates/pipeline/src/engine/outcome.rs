//! Outcome of a request, for callers who ask for one picture and wait for it.

use std::error::Error;
use std::fmt;
use std::path::Path;

use super::super::protocol::{Failure, Report, Request};
use super::super::sink::Sink;
use super::super::stages::Stop;
use super::{Engine, Meanwhile};
use crate::film::{Quantity, RadianceImage};
use crate::scene::diagnostic::Diagnostic;
use crate::scene::fingerprint::Key;
use crate::scene::report::{Style, render};

/// A picture in memory.
#[derive(Clone, Debug)]
pub struct Rendered {
    /// Linear light, unexposed.
    pub image: RadianceImage,
    /// Report of the request.
    pub report: Box<Report>,
    /// Likely mistakes in the scene.
    pub warnings: Vec<Diagnostic>,
    /// All that its sums depend on, apart from the number of samples.
    pub key: Key,
}

/// Why there is no picture.
#[derive(Clone, Debug)]
pub enum Unrendered {
    /// The scene is wrong, or the work failed.
    Failed(Failure),
    /// A cancel token stopped the work.
    Cancelled,
}

impl fmt::Display for Unrendered {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Failed(Failure::Scene(diagnostics)) => {
                f.write_str(render(diagnostics, COLUMNS, Style::Plain).trim_end())
            }
            Self::Failed(Failure::Work(message)) => f.write_str(message),
            Self::Cancelled => f.write_str("the render was cancelled"),
        }
    }
}

impl Error for Unrendered {}

/// Columns of a report of mistakes within an error.
const COLUMNS: usize = 120;

/// Outcome of a finished request.
pub(super) struct Outcome {
    pub(super) report: Report,
    /// Why nothing is written.
    pub(super) conflicts: Vec<Diagnostic>,
    /// Likely mistakes in the scene.
    pub(super) warnings: Vec<Diagnostic>,
    /// Whether neither the picture nor its view changed.
    pub(super) unchanged: bool,
}

impl Engine {
    /// Carries out a request; returns its picture too, with the key of all inputs.
    ///
    /// # Errors
    /// Why there is no picture.
    pub(crate) fn rendered(
        &mut self,
        request: &Request,
        sink: &Sink,
        meanwhile: &Meanwhile<'_>,
    ) -> Result<Rendered, Unrendered> {
        match self.outcome(request, sink, meanwhile) {
            // Who asks for a picture in memory writes none.
            Ok(Outcome { report, conflicts: _, warnings, unchanged: _ }) => {
                let canvas = self.films.current();
                let gone = || Unrendered::Failed(Failure::Work("the film is gone".to_owned()));
                let canvas = canvas.ok_or_else(gone)?;
                let image = canvas.film.image(Quantity::Radiance);
                Ok(Rendered { image, report: Box::new(report), warnings, key: canvas.key })
            }
            Err(Stop::Failed(failure)) => Err(Unrendered::Failed(failure)),
            Err(Stop::Cancelled) => Err(Unrendered::Cancelled),
        }
    }

    /// Whether a path leads to a file that the last request read.
    pub(crate) fn reads(&self, path: &Path) -> bool {
        self.inputs.contain(path)
    }
}
