//! Synchronous in-memory rendering, for benchmarks.

use std::cell::Cell;
use std::path::Path;

use super::protocol::{Report, Request};
use super::render::commands::PendingCommands;
use super::session::{CompletedRequest, RequestContext, Session};
use super::settings::Overrides;
use super::sink::EventSink;
pub use super::stages::AbortReason;
use crate::control::CancelToken;
use crate::film::{FilmQuantity, RadianceImage};
use crate::scene::diagnostic::Diagnostic;
use crate::scene::fingerprint::Fingerprint;

/// Renders images in memory and keeps caches between renders.
#[derive(Default)]
pub struct HeadlessSession {
    session: Session,
    generation: u64,
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
    ) -> Result<RenderedImage, AbortReason> {
        self.generation += 1;
        let request = Request::new(self.generation, scene.to_owned(), overrides.clone());
        let request = Request { force: true, ..request };
        // Events are not needed, because the result is returned.
        let sink = EventSink::silent(self.generation);
        let (commands, is_postponed) = (&NoPendingCommands, Cell::default());
        let context =
            RequestContext { request: &request, sink: &sink, token, writing: token, commands, is_postponed };
        // An in-memory image is not written, so there are no conflicts.
        let CompletedRequest { report, warnings, conflicts: _, unchanged: _ } =
            self.session.run_request(&context)?;
        let state = self.session.film()?;
        let image = state.film.image(FilmQuantity::Radiance);
        Ok(RenderedImage { image, report: Box::new(report), warnings, key: state.key })
    }

    /// Whether the last image depends on the file at a path.
    pub fn depends_on_file(&self, path: &Path) -> bool {
        self.session.has_read_file(path)
    }
}

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

/// Commands for a request without a front end.
struct NoPendingCommands;

impl PendingCommands for NoPendingCommands {}

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
    fn failed_or_canceled_render_returns_no_image() {
        let token = CancelToken::new();
        let missing = HeadlessSession::default().render_in_memory(
            Path::new("none.toml"),
            &Overrides::default(),
            &token,
        );
        assert!(matches!(missing, Err(AbortReason::Failed(Failure::Scene(_)))));
        let folder = tempfile::tempdir().expect("a folder");
        let scene = folder.path().join("a.toml");
        std::fs::write(&scene, SCENE).expect("written");
        token.cancel();
        let canceled = HeadlessSession::default().render_in_memory(&scene, &Overrides::default(), &token);
        assert!(matches!(canceled, Err(AbortReason::Canceled)));
    }
}
