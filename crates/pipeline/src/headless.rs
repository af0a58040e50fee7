//! Synchronous in-memory rendering, for benchmarks.

use std::path::Path;
use std::sync::Arc;

use super::engine::{Engine, EngineConfig, Interruption, PendingCommands, RequestContext};
pub use super::engine::{RenderFailure, RenderedImage};
use super::protocol::{MaxPreviewSize, Request, WriteRequirement};
use super::queries::QueryOrEdit;
use super::settings::Overrides;
use super::sink::EventSink;
use crate::control::CancelToken;

/// Renders images in memory and keeps caches between renders.
pub struct HeadlessSession {
    engine: Engine,
    generation: u64,
}

impl Default for HeadlessSession {
    fn default() -> Self {
        Self { engine: Engine::new(EngineConfig::default(), Arc::default()), generation: 0 }
    }
}

impl HeadlessSession {
    /// Renders an image, starting with an empty film. Does not write any files.
    ///
    /// # Errors
    /// Returns the reason if no image was rendered.
    pub fn render_in_memory(
        &mut self,
        scene: &Path,
        overrides: &Overrides,
        token: &CancelToken,
    ) -> Result<RenderedImage, RenderFailure> {
        self.generation += 1;
        let request = Request {
            generation: self.generation,
            scene: scene.to_owned(),
            overrides: overrides.clone(),
            preview: None,
            first: None,
            write: WriteRequirement::No,
            own: None,
            saves: 0,
            force: true,
        };
        // Events are not needed, because the result is returned.
        let sink = EventSink::silent(self.generation);
        let context = RequestContext::new(token, token, &NoPendingCommands);
        self.engine.render_radiance_image(&request, &sink, &context)
    }

    /// Whether the last image depends on the file at a path.
    pub fn depends_on_file(&self, path: &Path) -> bool {
        self.engine.has_read_file(path)
    }
}

/// Commands for a request without a front end: none ever arrive.
pub(super) struct NoPendingCommands;

impl PendingCommands for NoPendingCommands {
    fn wants_write(&self) -> bool {
        false
    }

    fn take_write(&self) -> bool {
        false
    }

    fn take_preview_resize(&self) -> Option<Option<MaxPreviewSize>> {
        None
    }

    fn take_query(&self) -> Option<QueryOrEdit> {
        None
    }

    fn cancellation_cause(&self) -> Interruption {
        Interruption::Replaced
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::Failure;

    const SCENE: &str = "[render]\nwidth = 8\nheight = 6\n[camera]\nposition = [0, 1, 4]\nlook_at = [0, 1, 0]\n\
        [materials.m]\n[[sphere]]\ncenter = [0, 1, 0]\nradius = 0.5\nmaterial = \"m\"\n[[light]]\n";

    #[test]
    fn image_includes_key_and_report() {
        let folder = tempfile::tempdir().expect("a folder");
        let scene = folder.path().join("a.toml");
        std::fs::write(&scene, SCENE).expect("written");
        let mut session = HeadlessSession::default();
        let mut render = |seed, samples| {
            let overrides = Overrides { seed: Some(seed), samples: Some(samples), ..Overrides::default() };
            session.render_in_memory(&scene, &overrides, &CancelToken::new()).expect("an image")
        };
        let (one, again, other, more) = (render(1, 2), render(1, 2), render(2, 2), render(1, 4));
        assert_eq!((one.image.width, one.image.height), (8, 6));
        assert_eq!((&one.image.pixels, one.key), (&again.image.pixels, again.key));
        assert_ne!(one.image.pixels, other.image.pixels);
        assert!(one.key != other.key && one.key == more.key);
        assert_eq!(again.report.counters.camera_rays, 8 * 6 * 2, "rendered again");
        assert!(session.depends_on_file(&scene) && !session.depends_on_file(&folder.path().join("b.toml")));
        assert!(!folder.path().join("a.png").exists());
    }

    #[test]
    fn failed_or_cancelled_render_returns_no_image() {
        let token = CancelToken::new();
        let missing = HeadlessSession::default().render_in_memory(
            Path::new("none.toml"),
            &Overrides::default(),
            &token,
        );
        assert!(matches!(missing, Err(RenderFailure::Failed(Failure::Scene(_)))));
        let folder = tempfile::tempdir().expect("a folder");
        let scene = folder.path().join("a.toml");
        std::fs::write(&scene, SCENE).expect("written");
        token.cancel();
        let cancelled = HeadlessSession::default().render_in_memory(&scene, &Overrides::default(), &token);
        assert!(matches!(cancelled, Err(RenderFailure::Cancelled)));
    }
}
