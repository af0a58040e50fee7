//! The worker thread, which owns the session, and its handle for front ends.

mod mailbox;

use std::any::Any;
use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::mpsc::{self, Receiver};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use super::protocol::{Command, Event, Failure, PreviewSlot};
use super::render::commands::PendingCommands;
use super::session::{RequestContext, Session, SessionConfig};
use super::sink::{EventListener, EventSink};
use super::watch::content::FileHashCache;
use crate::system::threads::spawn;
pub use mailbox::CommandSender;
use mailbox::Task;

/// Starts a worker thread. On Linux, its render threads have the current thread's niceness plus `nice`, so
/// that the front end and other programs have priority. A watcher of the same files can share `contents`.
///
/// The worker passes its events to `listener`, from any of its threads. `listener` must neither block nor
/// send commands.
///
/// # Errors
/// The system cannot start a thread.
pub fn start_worker(
    nice: u8,
    contents: Arc<FileHashCache>,
    listener: impl Fn(Event) + Send + Sync + 'static,
) -> std::io::Result<WorkerHandle> {
    start_worker_with_config(SessionConfig { nice, ..SessionConfig::default() }, contents, Arc::new(listener))
}

/// Starts a worker thread, and returns a channel that receives its events.
///
/// # Errors
/// The system cannot start a thread.
pub fn start_worker_with_channel(nice: u8) -> std::io::Result<(WorkerHandle, Receiver<Event>)> {
    let (sender, events) = mpsc::channel();
    // Ignore a disconnected front end.
    Ok((start_worker(nice, Arc::default(), move |event| drop(sender.send(event)))?, events))
}

/// Starts a worker with this configuration.
pub(super) fn start_worker_with_config(
    config: SessionConfig,
    contents: Arc<FileHashCache>,
    listener: EventListener,
) -> std::io::Result<WorkerHandle> {
    let remote = CommandSender::new(listener);
    let previews = PreviewSlot::default();
    let worker = Worker { remote: remote.clone(), previews: previews.clone(), config, contents };
    let thread = spawn("glimt-worker", move || worker.run_loop())?;
    Ok(WorkerHandle { previews, remote, thread: Some(thread) })
}

/// A handle to a running worker. Dropping it stops the worker and blocks while a file is being written.
pub struct WorkerHandle {
    /// Slot for the latest preview.
    pub previews: PreviewSlot,
    remote: CommandSender,
    thread: Option<JoinHandle<()>>,
}

impl WorkerHandle {
    /// Sends a command without blocking.
    pub fn send(&self, command: Command) {
        self.remote.send(command);
    }

    /// Returns a handle for sending commands from other threads.
    pub fn command_sender(&self) -> CommandSender {
        self.remote.clone()
    }

    /// Stops the worker and waits at most `patience` for it to stop. Returns whether it has stopped. If an
    /// image is being written, the worker finishes writing it.
    pub fn stop_within(&self, patience: Duration) -> bool {
        self.send(Command::Quit);
        let deadline = Instant::now().checked_add(patience);
        while !self.has_ended() && deadline.is_none_or(|deadline| Instant::now() < deadline) {
            std::thread::sleep(Duration::from_millis(2));
        }
        self.has_ended()
    }

    /// Like [`Self::stop_within`], but abandons a worker that does not stop.
    pub fn stop_or_abandon(mut self, patience: Duration) -> bool {
        let has_ended = self.stop_within(patience);
        if !has_ended {
            self.thread = None;
        }
        has_ended
    }

    fn has_ended(&self) -> bool {
        self.thread.as_ref().is_none_or(JoinHandle::is_finished)
    }
}

impl Drop for WorkerHandle {
    fn drop(&mut self) {
        self.send(Command::Quit);
        if let Some(thread) = self.thread.take() {
            // If the thread panicked, an event has already reported it.
            let _ = thread.join();
        }
    }
}

struct Worker {
    remote: CommandSender,
    contents: Arc<FileHashCache>,
    previews: PreviewSlot,
    config: SessionConfig,
}

impl Worker {
    fn run_loop(self) {
        let _last_words = PanicReporter(&self.remote);
        let mut session = Session::new(self.config, self.contents.clone());
        let listener = self.remote.listener.clone();
        let mut sink = EventSink { generation: 0, listener, previews: self.previews.clone() };
        loop {
            let outcome = match self.remote.wait_for_next_task() {
                Task::Quit => {
                    session.save_scene_image_checkpoint(&sink, self.remote.interruption());
                    break;
                }
                Task::Write
                    if self.remote.try_postpone_write_to_pending(session.has_sample_in_every_pixel()) =>
                {
                    continue;
                }
                Task::Write => catch_unwind(AssertUnwindSafe(|| session.write_current_image(&sink))),
                Task::Preview(size, token) => {
                    catch_unwind(AssertUnwindSafe(|| session.send_resized_preview(size, &sink, &token)))
                }
                Task::Query(query) => catch_unwind(AssertUnwindSafe(|| session.answer_query(&query, &sink))),
                Task::Render(request, token, writing) => {
                    sink.generation = request.generation;
                    let context = RequestContext {
                        request: &request,
                        sink: &sink,
                        token: &token,
                        writing: &writing,
                        commands: &self.remote,
                        is_postponed: Cell::default(),
                    };
                    catch_unwind(AssertUnwindSafe(|| session.handle_request(&context)))
                }
            };
            if let Err(payload) = outcome {
                // Discard the session's state, which may be inconsistent after a panic.
                session = Session::new(self.config, self.contents.clone());
                let failure = Failure::Work(format!("internal error: {}", panic_reason(payload.as_ref())));
                sink.send(Event::Failed { generation: sink.generation, failure });
            }
        }
    }
}

/// If the worker thread panics, reports the newest request as failed, because the front end is waiting for
/// the request to end.
struct PanicReporter<'a>(&'a CommandSender);

impl Drop for PanicReporter<'_> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            let failure = Failure::Work("internal error: the worker thread panicked".to_owned());
            self.0.report_newest_failed(failure);
        }
    }
}

fn panic_reason(payload: &(dyn Any + Send)) -> &str {
    let text = payload.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| payload.downcast_ref::<&str>().copied()).unwrap_or("unknown panic")
}

#[cfg(test)]
mod tests;
