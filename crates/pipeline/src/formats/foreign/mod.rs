//! Code shared by the readers for scenes from other renderers.

mod cie;
pub(crate) mod import;
pub(crate) mod ior;
pub(crate) mod meshes;
pub(crate) mod notes;
pub(crate) mod options;
pub(crate) mod pixels;
pub(crate) mod sources;
pub(crate) mod spectra;
pub(crate) mod transform;

pub use options::{ForeignOptions, MissingAssetMode};

use crate::assets::{AssetError, Companion};
use crate::scene::diagnostic::Diagnostic;

/// Reasons why a foreign file cannot be used.
#[derive(Debug)]
pub(crate) enum ForeignError {
    /// An error without a position in the text.
    Asset(AssetError),
    /// Errors, usually with positions in the text, and warnings.
    Scene {
        /// The errors and warnings.
        diagnostics: Vec<Diagnostic>,
        /// Files other than the scene that were read, or that are missing.
        companions: Vec<Companion>,
    },
}

impl From<AssetError> for ForeignError {
    fn from(error: AssetError) -> Self {
        Self::Asset(error)
    }
}

impl From<crate::control::Canceled> for ForeignError {
    fn from(canceled: crate::control::Canceled) -> Self {
        Self::Asset(canceled.into())
    }
}
