//! Time until the worker starts on a newer request, whatever kind of work is in progress.

use std::path::Path;
use std::sync::mpsc::Receiver;
use std::time::{Duration, Instant};

use glimt::pipeline::protocol::{Command, Event, PreviewBounds, Request};
use glimt::pipeline::settings::Overrides;
use glimt::pipeline::{WorkerHandle, start_worker_with_channel};

use super::BenchResult;

const LIMIT: Duration = Duration::from_secs(20);

/// Measures cancellations after 0, 1, 2, … 60 ms, starting with nothing loaded. The first cancellations
/// interrupt scene loading, acceleration-structure builds, the first image and the first passes. Then
/// measures cancellations late in the render.
pub fn times(scene: &Path) -> BenchResult<Vec<Duration>> {
    let mut times = Vec::new();
    for step in 0..12 {
        let worker = start_worker_with_channel(0)?;
        let mut generation = 0;
        send(&worker.0, scene, &mut generation);
        times.push(cancel(&worker, scene, &mut generation, Duration::from_millis(step * step * 4))?);
    }
    let worker = start_worker_with_channel(0)?;
    let mut generation = 0;
    send(&worker.0, scene, &mut generation);
    while !matches!(worker.1.recv_timeout(LIMIT)?, Event::Preview { .. }) {}
    for after in (0..60).chain([200, 333, 500, 777]) {
        times.push(cancel(&worker, scene, &mut generation, Duration::from_millis(after))?);
    }
    Ok(times)
}

fn cancel(
    (worker, events): &(WorkerHandle, Receiver<Event>),
    scene: &Path,
    generation: &mut u64,
    after: Duration,
) -> BenchResult<Duration> {
    std::thread::sleep(after);
    let begin = Instant::now();
    send(worker, scene, generation);
    loop {
        match events.recv_timeout(LIMIT)? {
            Event::Started { generation: started } if started == *generation => return Ok(begin.elapsed()),
            Event::Failed { failure, .. } => return Err(format!("{failure:?}").into()),
            _ => {}
        }
    }
}

/// Requests a different image each time.
fn send(worker: &WorkerHandle, scene: &Path, generation: &mut u64) {
    *generation += 1;
    let overrides =
        Overrides { samples: Some(100_000), seed: u32::try_from(*generation).ok(), ..Overrides::default() };
    let preview = Some(PreviewBounds { width: 118, height: 74, around: None });
    let request = Request::new(*generation, scene.to_owned(), overrides);
    worker.send(Command::Render(Box::new(Request { preview, ..request })));
}
