//! A session renders requests one after another. It keeps films, photons and written images between them.
//!
//! | file | contents |
//! | --- | --- |
//! | [`request`] | the steps of a request, in order |
//! | [`preparation`] | reads the scene, and checks memory and output files |
//! | [`render`] | traces photons and renders the film |
//! | [`outputs`] | writes images and reports |
//! | [`last_valid`] | renders the last valid scene while the scene file is broken |
//! | [`between_requests`] | commands that arrive while no request is running |
//! | [`files`], [`own_image`] | the scene's files, and the image to write while another one is shown |

mod between_requests;
mod files;
mod last_valid;
mod outputs;
mod own_image;
mod preparation;
mod render;
mod request;

use std::cell::Cell;
use std::path::Path;
use std::sync::Arc;

use self::files::SceneFileTracker;
use self::own_image::SceneImage;
pub(super) use self::request::CompletedRequest;
use crate::control::CancelToken;
use crate::plan::RenderPlan;
use crate::prepare::SceneCache;
use crate::protocol::{Report, Request};
use crate::queries::QueryContext;
use crate::render::commands::PendingCommands;
use crate::render::film_cache::FilmCache;
use crate::render::film_state::FilmState;
use crate::sink::EventSink;
use crate::stages::AbortReason;
use crate::stages::photons::PhotonCache;
use crate::stages::write::WriteState;
use crate::threads::RenderThreads;
use crate::trace::TileKernel;
use crate::watch::content::FileHashCache;

/// Configuration of a session. Only tests change the defaults.
#[derive(Clone, Copy)]
pub(super) struct SessionConfig {
    pub(super) kernel: TileKernel,
    /// Maximum film size in bytes.
    pub(super) max_film_bytes: u64,
    /// Niceness of the render threads relative to the thread that starts them.
    pub(super) nice: u8,
}

impl Default for SessionConfig {
    fn default() -> Self {
        Self { kernel: crate::integrators::render_tile_with_photons, max_film_bytes: u64::MAX, nice: 0 }
    }
}

/// A running request, with its cancel tokens and the front end.
pub(crate) struct RequestContext<'a> {
    pub(crate) request: &'a Request,
    pub(crate) sink: &'a EventSink,
    pub(crate) token: &'a CancelToken,
    /// Cancels the write stage, which runs last.
    pub(crate) writing: &'a CancelToken,
    pub(crate) commands: &'a dyn PendingCommands,
    /// Whether the postponement of a write command has already been reported to the front end.
    pub(crate) is_postponed: Cell<bool>,
}

/// Runs requests and keeps state between them.
#[derive(Default)]
pub(super) struct Session {
    config: SessionConfig,
    contents: Arc<FileHashCache>,
    threads: RenderThreads,
    scenes: SceneCache,
    files: SceneFileTracker,
    photons: PhotonCache,
    films: FilmCache,
    /// The image of the current film, or `None` before the first image.
    current: Option<CurrentImage>,
    own: SceneImage,
    written: WriteState,
    /// Speed at which the most recent first image was rendered, in pixels per second.
    coarse_rate: Cell<Option<f64>>,
}

/// The image of the current film.
struct CurrentImage {
    plan: RenderPlan,
    queries: QueryContext,
    /// Whether this is the scene's own image.
    is_own: bool,
    /// Report of the image's request, if it has finished.
    report: Option<Report>,
}

impl Session {
    pub(super) fn new(config: SessionConfig, contents: Arc<FileHashCache>) -> Self {
        Self { config, contents, threads: RenderThreads::new(config.nice), ..Self::default() }
    }

    /// Whether the last request read the file at a path.
    pub(super) fn has_read_file(&self, path: &Path) -> bool {
        self.files.protected.contains_path(path)
    }

    /// Returns the current film.
    pub(super) fn film(&self) -> Result<&FilmState, AbortReason> {
        self.films.current_or_error()
    }
}
