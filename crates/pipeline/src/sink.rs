//! Sends a request's events, tagged with the request's generation.

use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, PoisonError};

use super::protocol::{
    AssetProgress, Event, NormalizedRect, PreviewSlot, PreviewUpdate, PreviewedImageState, SampleCounts,
};
use crate::film::Srgb8Image;
use crate::scene::diagnostic::Diagnostic;

/// The front end's function for receiving events. It is called from any of the worker's threads.
pub(super) type EventListener = Arc<dyn Fn(Event) + Send + Sync>;

/// Sends the events of one request.
#[derive(Clone)]
pub(super) struct EventSink {
    pub(super) generation: u64,
    pub(super) listener: EventListener,
    pub(super) previews: PreviewSlot,
}

impl EventSink {
    /// Creates a sink that ignores all events.
    pub(super) fn silent(generation: u64) -> Self {
        Self { generation, listener: Arc::new(drop), previews: PreviewSlot::default() }
    }

    pub(super) fn send(&self, event: Event) {
        (self.listener)(event);
    }

    pub(super) fn send_image_written(
        &self,
        path: &Path,
        bytes: u64,
        is_own: bool,
        unfinished: Option<SampleCounts>,
    ) {
        let (generation, path) = (self.generation, path.to_owned());
        self.send(Event::Written { generation, path, bytes, is_own, unfinished });
    }

    pub(super) fn send_write_failed(&self, path: Option<&Path>, message: String) {
        let path = path.map(Path::to_owned);
        self.send(Event::WriteFailed { generation: self.generation, path, message });
    }

    pub(super) fn send_write_refused(&self, conflicts: Vec<Diagnostic>) {
        self.send(Event::Refused { generation: self.generation, conflicts });
    }

    pub(super) fn send_preview(
        &self,
        picture: Srgb8Image,
        range: Option<[f32; 2]>,
        section: Option<NormalizedRect>,
        source: PreviewedImageState,
    ) {
        let (generation, picture, source) = (self.generation, Arc::new(picture), Some(source));
        let lacks_photons = false;
        let update = PreviewUpdate { generation, picture, range, section, lacks_photons, source };
        self.replace_preview_and_notify(update);
    }

    /// Sends a preview without light from photons, before the photons are traced.
    pub(super) fn send_preview_without_photons(&self, picture: Srgb8Image) {
        let (generation, picture, lacks_photons) = (self.generation, Arc::new(picture), true);
        let (range, section, source) = (None, None, None);
        let update = PreviewUpdate { generation, picture, range, section, lacks_photons, source };
        self.replace_preview_and_notify(update);
    }

    fn replace_preview_and_notify(&self, latest: PreviewUpdate) {
        *self.previews.lock().unwrap_or_else(PoisonError::into_inner) = Some(latest);
        self.send(Event::Preview { generation: self.generation });
    }

    /// Loads an asset and reports the progress that `load` passes to its callback. If loading succeeds,
    /// always reports completion.
    pub(super) fn load_asset_with_progress<T, E>(
        &self,
        name: &str,
        load: impl FnOnce(&(dyn Fn(u64, u64) + Sync)) -> Result<T, E>,
    ) -> Result<T, E> {
        let shown = AtomicU64::new(0);
        let say = |done, total| {
            let progress = AssetProgress { name: name.to_owned(), done, total };
            self.send(Event::Asset { generation: self.generation, progress });
        };
        say(0, PARTS);
        let result = load(&|done: u64, total: u64| {
            let part = u128::from(done.min(total)) * u128::from(PARTS) / u128::from(total.max(1));
            let part = part as u64;
            if part < PARTS && shown.fetch_max(part, Ordering::Relaxed) < part {
                say(part, PARTS);
            }
        });
        if result.is_ok() {
            say(PARTS, PARTS);
        }
        result
    }
}

/// Number of progress steps per loaded asset.
const PARTS: u64 = 100;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::sink_with_channel;

    #[test]
    fn asset_progress_is_throttled_and_completes() {
        let (sink, received) = sink_with_channel(3);
        let load = |progress: &(dyn Fn(u64, u64) + Sync)| -> Result<(), ()> {
            for done in 0..10_000 {
                progress(done, 10_000);
            }
            Ok(())
        };
        sink.load_asset_with_progress("bricks", load).expect("loaded");
        drop(sink);
        let seen: Vec<(u64, u64)> = received
            .into_iter()
            .map(|event| match event {
                Event::Asset { generation: 3, progress } if progress.name == "bricks" => {
                    (progress.done, progress.total)
                }
                other => panic!("{other:?}"),
            })
            .collect();
        assert_eq!(seen.len(), 101);
        assert!(seen.windows(2).all(|pair| pair[0].0 < pair[1].0));
        assert_eq!(seen.last(), Some(&(100, 100)));
    }

    #[test]
    fn failed_asset_does_not_report_completion() {
        let (sink, received) = sink_with_channel(3);
        sink.load_asset_with_progress("bricks", |_| -> Result<(), ()> { Err(()) }).expect_err("failed");
        drop(sink);
        let ends = received.into_iter().filter(
            |event| matches!(event, Event::Asset { progress, .. } if progress.done == progress.total),
        );
        assert_eq!(ends.count(), 0);
    }
}
