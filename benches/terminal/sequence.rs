//! Previews of a render as the front end receives them.

use std::error::Error;
use std::path::Path;
use std::sync::PoisonError;
use std::sync::mpsc::Receiver;
use std::time::Instant;

use glimt::film::Srgb8Image;
use glimt::pipeline::WorkerHandle;
use glimt::pipeline::protocol::{Command, Event, PreviewBounds, Request};
use glimt::pipeline::settings::Overrides;

/// A preview of an image, which may still be rendering.
pub(crate) struct RecordedPreview {
    /// Seconds since the request.
    pub(crate) seconds: f64,
    /// Mean samples per pixel; 0 for the coarse first image.
    pub(crate) samples: f64,
    pub(crate) picture: Srgb8Image,
    pub(crate) is_final: bool,
}

/// Renders the scene and records every preview that the front end receives, including the final image.
pub(crate) fn render(
    (handle, events): &(WorkerHandle, Receiver<Event>),
    generation: u64,
    scene: &Path,
    size: PreviewBounds,
) -> Result<Vec<RecordedPreview>, Box<dyn Error>> {
    let request = Request::new(generation, scene.to_owned(), Overrides::default());
    let request = Request { preview: Some(size), ..request };
    let start = Instant::now();
    handle.send(Command::Render(Box::new(request)));
    let (mut shots, mut samples) = (Vec::<RecordedPreview>::new(), 0.0);
    for event in events {
        match event {
            Event::Progress { progress, .. } => {
                samples = progress.fraction * f64::from(progress.total_samples);
            }
            Event::Preview { .. } => {
                let latest = handle.previews.lock().unwrap_or_else(PoisonError::into_inner).take();
                if let Some(latest) = latest {
                    let seconds = start.elapsed().as_secs_f64();
                    let picture = latest.picture.as_ref().clone();
                    shots.push(RecordedPreview { seconds, samples, picture, is_final: false });
                }
            }
            Event::Done { .. } => break,
            Event::Failed { failure, .. } => return Err(format!("{}: {failure:?}", scene.display()).into()),
            Event::Started { .. }
            | Event::Stage { .. }
            | Event::Files { .. }
            | Event::Asset { .. }
            | Event::Settings { .. }
            | Event::Written { .. }
            | Event::WriteFailed { .. }
            | Event::WriteWarning { .. }
            | Event::Checkpoint { .. }
            | Event::OwnImage { .. }
            | Event::WritePostponed { .. }
            | Event::WriteDone { .. }
            | Event::LastGoodEnded { .. }
            | Event::Text { .. }
            | Event::Warnings { .. }
            | Event::Refused { .. }
            | Event::CameraKept { .. }
            | Event::CameraUndone { .. }
            | Event::Picked { .. }
            | Event::Canceled { .. } => {}
        }
    }
    shots.last_mut().ok_or("no preview arrived")?.is_final = true;
    Ok(shots)
}
