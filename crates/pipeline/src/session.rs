//! Requests one after another on the thread of the caller, whose pictures stay in memory: for programs that measure.

use std::path::Path;
use std::sync::Arc;
use std::sync::mpsc;

use super::engine::{Engine, Interruption, Means, Meanwhile, Orders};
pub use super::engine::{Rendered, Unrendered};
use super::errands::Errand;
use super::protocol::{PreviewSize, PreviewSlot, Request, Writing};
use super::settings::Overrides;
use super::sink::Sink;
use crate::control::CancelToken;

/// An engine with what it keeps from picture to picture.
pub struct Session {
    engine: Engine,
    generation: u64,
}

impl Default for Session {
    fn default() -> Self {
        Self { engine: Engine::new(Means::default(), Arc::default()), generation: 0 }
    }
}

impl Session {
    /// Render from an empty film and write nothing.
    ///
    /// # Errors
    /// Why there is no picture.
    pub fn render(
        &mut self,
        scene: &Path,
        overrides: &Overrides,
        token: &CancelToken,
    ) -> Result<Rendered, Unrendered> {
        self.generation += 1;
        let request = Request {
            generation: self.generation,
            scene: scene.to_owned(),
            overrides: overrides.clone(),
            preview: None,
            first: None,
            write: Writing::No,
            own: None,
            force: true,
        };
        // Nobody listens: what came of it is given back.
        let (events, _) = mpsc::channel();
        let sink =
            Sink { generation: self.generation, events, previews: PreviewSlot::default(), within: None };
        let meanwhile = Meanwhile::new(token, token, &NoOrders);
        self.engine.rendered(&request, &sink, &meanwhile)
    }

    /// Whether a path leads to a file that the last picture is made of.
    pub fn reads(&self, path: &Path) -> bool {
        self.engine.reads(path)
    }
}

/// Nobody gives any.
pub(super) struct NoOrders;

impl Orders for NoOrders {
    fn wants_write(&self) -> bool {
        false
    }

    fn take_write(&self) -> bool {
        false
    }

    fn take_preview(&self) -> Option<Option<PreviewSize>> {
        None
    }

    fn take_errand(&self) -> Option<Errand> {
        None
    }

    fn interruption(&self) -> Interruption {
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
    fn pictures_come_back_with_what_they_are_made_of() {
        let folder = tempfile::tempdir().expect("a folder");
        let scene = folder.path().join("a.toml");
        std::fs::write(&scene, SCENE).expect("written");
        let mut session = Session::default();
        let mut render = |seed, samples| {
            let overrides = Overrides { seed: Some(seed), samples: Some(samples), ..Overrides::default() };
            session.render(&scene, &overrides, &CancelToken::new()).expect("a picture")
        };
        let (one, again, other, more) = (render(1, 2), render(1, 2), render(2, 2), render(1, 4));
        assert_eq!((one.image.width, one.image.height), (8, 6));
        assert_eq!((&one.image.pixels, one.key), (&again.image.pixels, again.key));
        assert_ne!(one.image.pixels, other.image.pixels);
        assert!(one.key != other.key && one.key == more.key);
        assert_eq!(again.report.counters.camera_rays, 8 * 6 * 2, "rendered again");
        assert!(session.reads(&scene) && !session.reads(&folder.path().join("b.toml")));
        assert!(!folder.path().join("a.png").exists());
    }

    #[test]
    fn what_is_wrong_and_what_is_cancelled_gives_no_picture() {
        let token = CancelToken::new();
        let missing = Session::default().render(Path::new("none.toml"), &Overrides::default(), &token);
        assert!(matches!(missing, Err(Unrendered::Failed(Failure::Scene(_)))));
        let folder = tempfile::tempdir().expect("a folder");
        let scene = folder.path().join("a.toml");
        std::fs::write(&scene, SCENE).expect("written");
        token.cancel();
        let cancelled = Session::default().render(&scene, &Overrides::default(), &token);
        assert!(matches!(cancelled, Err(Unrendered::Cancelled)));
    }
}
