//! The worker thread, which owns the session, and its handle for front ends.
//!
//! The mailbox has room for one pending request. A newer request replaces it and cancels the current request.
//! A single lock protects the token and the mailbox, so that no cancellation is lost between requests.

use std::any::Any;
use std::cell::Cell;
use std::collections::VecDeque;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{self, Receiver};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use super::key_overrides::KeyboardOverrides;
use super::protocol::{Command, Event, Failure, MaxPreviewSize, PreviewSlot, Request, WriteRequirement};
use super::queries::QueryOrEdit;
use super::render::checkpointer::Interruption;
use super::render::commands::PendingCommands;
use super::session::{RequestContext, Session, SessionConfig};
use super::sink::{EventListener, EventSink};
use super::watch::content::FileHashCache;
use crate::control::CancelToken;
use crate::system::threads::spawn;

/// Starts a worker thread. On Linux, its render threads have the current thread's niceness plus `nice`, so
/// that the front end and other programs have priority. A watcher of the same files can share `contents`.
///
/// The worker passes its events to `listener`, from any of its threads. `listener` must neither block nor send
/// commands.
///
/// # Errors
/// The system cannot start a thread.
pub fn start(
    nice: u8,
    contents: Arc<FileHashCache>,
    listener: impl Fn(Event) + Send + Sync + 'static,
) -> std::io::Result<Handle> {
    start_with_config(SessionConfig { nice, ..SessionConfig::default() }, contents, Arc::new(listener))
}

/// Starts a worker thread, and returns a channel that receives its events.
///
/// # Errors
/// The system cannot start a thread.
pub fn start_with_new_channel(nice: u8) -> std::io::Result<(Handle, Receiver<Event>)> {
    let (sender, events) = mpsc::channel();
    // Ignore a disconnected front end.
    Ok((start(nice, Arc::default(), move |event| drop(sender.send(event)))?, events))
}

/// Starts a worker with this configuration.
pub(super) fn start_with_config(
    config: SessionConfig,
    contents: Arc<FileHashCache>,
    listener: EventListener,
) -> std::io::Result<Handle> {
    let remote = CommandSender { mailbox: Arc::default(), listener };
    let previews = PreviewSlot::default();
    let worker = Worker { remote: remote.clone(), previews: previews.clone(), config, contents };
    let thread = spawn("glimt-worker", move || worker.run_loop())?;
    Ok(Handle { previews, remote, thread: Some(thread) })
}

/// A handle to a running worker. Dropping it stops the worker and blocks while a file is being written.
pub struct Handle {
    /// Slot for the latest preview.
    pub previews: PreviewSlot,
    remote: CommandSender,
    thread: Option<JoinHandle<()>>,
}

impl Handle {
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

impl Drop for Handle {
    fn drop(&mut self) {
        self.send(Command::Quit);
        if let Some(thread) = self.thread.take() {
            // If the thread panicked, an event has already reported it.
            let _ = thread.join();
        }
    }
}

/// Sends commands to a worker.
#[derive(Clone)]
pub struct CommandSender {
    mailbox: Arc<(Mutex<Mailbox>, Condvar)>,
    listener: EventListener,
}

#[derive(Debug, Default)]
struct Mailbox {
    request: Option<Box<Request>>,
    write: bool,
    /// Whether a write command is postponed until the pending request runs.
    is_write_postponed: bool,
    /// Whether a write command arrived after the pending request and therefore applies to it.
    is_write_of_waiting: bool,
    /// The current request's overrides that the user can change with keys.
    shown: KeyboardOverrides,
    /// Pending preview size change.
    preview: Option<Option<MaxPreviewSize>>,
    queries: VecDeque<QueryOrEdit>,
    /// Whether the newest request is paused.
    paused: bool,
    /// Whether the current render is being stopped so that it can be resumed later.
    suspended: bool,
    quit: bool,
    /// Cancels or pauses the current request.
    token: CancelToken,
    /// Cancels the write stage. It is separate because a finished image must be written even if the user
    /// pauses or quits, or a request without output arrives.
    writing: CancelToken,
    /// Generation of the newest request.
    newest: u64,
}

/// The next task for the worker.
enum Task {
    /// A request, with the tokens for the render and the write stage.
    Render(Box<Request>, CancelToken, CancelToken),
    Write,
    Preview(Option<MaxPreviewSize>, CancelToken),
    Query(QueryOrEdit),
    Quit,
}

impl CommandSender {
    /// Sends a command without blocking.
    pub fn send(&self, command: Command) {
        let mut mailbox = self.lock();
        match command {
            Command::Render(request) => self.replace_older_pending_request(&mut mailbox, request),
            Command::Write => {
                mailbox.write = true;
                mailbox.is_write_of_waiting = mailbox.request.is_some();
            }
            Command::Preview(size) => mailbox.preview = Some(size),
            Command::KeepCamera(camera) => mailbox.queries.push_back(QueryOrEdit::KeepCamera(camera)),
            Command::UndoCamera(edit) => mailbox.queries.push_back(QueryOrEdit::UndoCamera(edit)),
            Command::Pick(position) => {
                mailbox.queries.retain(|query| !matches!(query, QueryOrEdit::Pick(_)));
                mailbox.queries.push_back(QueryOrEdit::Pick(position));
            }
            Command::Cancel => {
                mailbox.token.cancel();
                mailbox.writing.cancel();
                let dropped = mailbox.request.take();
                self.report_request_canceled(dropped);
            }
            Command::Suspend => {
                mailbox.suspended = true;
                mailbox.token.cancel();
                let dropped = mailbox.request.take();
                self.report_request_canceled(dropped);
            }
            Command::Pause(paused) => {
                mailbox.paused = paused;
                mailbox.token.set_paused(paused);
            }
            Command::Quit => {
                mailbox.token.cancel();
                mailbox.request = None;
                mailbox.quit = true;
            }
        }
        drop(mailbox);
        self.mailbox.1.notify_all();
    }

    /// Replaces the pending request unless the pending one is newer. Requests may arrive in any order.
    fn replace_older_pending_request(&self, mailbox: &mut Mailbox, request: Box<Request>) {
        if request.generation < mailbox.newest {
            return self.report_request_canceled(Some(request));
        }
        mailbox.newest = request.generation;
        mailbox.token.cancel();
        if request.write != WriteRequirement::No {
            mailbox.writing.cancel();
        }
        (mailbox.paused, mailbox.preview) = (false, None);
        let replaced = mailbox.request.replace(request);
        self.report_request_canceled(replaced);
    }

    fn report_request_canceled(&self, request: Option<Box<Request>>) {
        if let Some(request) = request {
            (self.listener)(Event::Canceled { generation: request.generation });
        }
    }

    fn lock(&self) -> MutexGuard<'_, Mailbox> {
        self.mailbox.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Postpones a write command until the pending request runs if the command was meant for that request, or
    /// if the current image is incomplete and the pending request has the same settings. Returns whether the
    /// command was postponed.
    fn try_postpone_write_to_pending(&self, can_write: bool) -> bool {
        let mut mailbox = self.lock();
        let is_meant = mailbox.is_write_of_waiting;
        let postponed = mailbox.request.as_ref().is_some_and(|request| {
            is_meant || !can_write && KeyboardOverrides::from_overrides(&request.overrides) == mailbox.shown
        });
        (mailbox.write, mailbox.is_write_postponed) = (postponed, postponed);
        postponed
    }

    fn wait_for_next_task(&self) -> Task {
        let mut mailbox = self.lock();
        loop {
            // Carry out a write command that arrived before the quit command.
            if mailbox.write && !(mailbox.is_write_postponed && mailbox.request.is_some()) {
                mailbox.write = false;
                return Task::Write;
            }
            if mailbox.quit {
                return Task::Quit;
            }
            if let Some(query) = mailbox.queries.pop_front() {
                return Task::Query(query);
            }
            mailbox.is_write_postponed = false;
            if let Some(request) = mailbox.request.take() {
                (mailbox.token, mailbox.writing) = (CancelToken::new(), CancelToken::new());
                mailbox.is_write_of_waiting = false;
                mailbox.shown = KeyboardOverrides::from_overrides(&request.overrides);
                mailbox.token.set_paused(mailbox.paused);
                return Task::Render(request, mailbox.token.clone(), mailbox.writing.clone());
            }
            if let Some(size) = mailbox.preview.take() {
                mailbox.token = CancelToken::new();
                return Task::Preview(size, mailbox.token.clone());
            }
            mailbox = self.mailbox.1.wait(mailbox).unwrap_or_else(PoisonError::into_inner);
        }
    }
}

impl PendingCommands for CommandSender {
    fn wants_write(&self) -> bool {
        let mailbox = self.lock();
        mailbox.write && !mailbox.is_write_of_waiting
    }

    fn take_write(&self) -> bool {
        let mut mailbox = self.lock();
        let is_taken = mailbox.write && !mailbox.is_write_of_waiting;
        mailbox.write &= !is_taken;
        is_taken
    }

    fn take_preview_resize(&self) -> Option<Option<MaxPreviewSize>> {
        self.lock().preview.take()
    }

    fn take_query(&self) -> Option<QueryOrEdit> {
        self.lock().queries.pop_front()
    }

    fn interruption(&self) -> Interruption {
        let mailbox = self.lock();
        match (mailbox.suspended, mailbox.quit) {
            (true, _) => Interruption::Ended,
            (false, true) => Interruption::Left,
            (false, false) => Interruption::Replaced,
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
                    session.checkpoint_own_image(&sink, self.remote.interruption());
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
            let generation = self.0.lock().newest;
            let failure = Failure::Work("internal error: the worker thread panicked".to_owned());
            (self.0.listener)(Event::Failed { generation, failure });
        }
    }
}

fn panic_reason(payload: &(dyn Any + Send)) -> &str {
    let text = payload.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| payload.downcast_ref::<&str>().copied()).unwrap_or("unknown panic")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::{Overrides, ViewMode};

    fn render(generation: u64) -> Command {
        Command::Render(Box::new(Request::new(generation, "a.toml".into(), Overrides::default())))
    }

    fn silent_sender() -> CommandSender {
        CommandSender { mailbox: Arc::default(), listener: EventSink::silent(0).listener }
    }

    fn token(remote: &CommandSender) -> CancelToken {
        let Task::Render(_, token, _) = remote.wait_for_next_task() else {
            panic!("expected a pending request")
        };
        token
    }

    #[test]
    fn panicking_worker_reports_failure() {
        let (sink, received) = crate::tests::sink_with_channel(0);
        let remote = CommandSender { mailbox: Arc::default(), listener: sink.listener };
        remote.send(render(7));
        let panicking = remote;
        let thread = std::thread::spawn(move || {
            let _last_words = PanicReporter(&panicking);
            panic!("outside of a request");
        });
        assert!(thread.join().is_err());
        assert!(matches!(received.try_recv(), Ok(Event::Failed { generation: 7, .. })));
    }

    #[test]
    fn pause_applies_to_newest_request() {
        let remote = silent_sender();
        remote.send(render(1));
        let ending = token(&remote);
        remote.send(render(2));
        // The user presses the key while the first request is still ending.
        remote.send(Command::Pause(true));
        assert!(ending.is_canceled());
        let second = token(&remote);
        assert!(second.is_paused());
        remote.send(Command::Pause(false));
        assert!(!second.is_paused());
        remote.send(Command::Pause(true));
        remote.send(render(3));
        assert!(!token(&remote).is_paused(), "a later request should not be paused");
    }

    #[test]
    fn write_before_quit_is_carried_out() {
        let remote = silent_sender();
        remote.send(render(1));
        let token = token(&remote);
        remote.send(render(2));
        remote.send(Command::Write);
        remote.send(Command::Quit);
        assert!(token.is_canceled());
        assert!(matches!(remote.wait_for_next_task(), Task::Write));
        assert!(!remote.try_postpone_write_to_pending(false), "no request should be pending");
        assert!(matches!(remote.wait_for_next_task(), Task::Quit));
    }

    #[test]
    fn write_stage_is_canceled_only_by_newer_image() {
        let remote = silent_sender();
        let begin = |number| {
            remote.send(render(number));
            let Task::Render(_, token, writing) = remote.wait_for_next_task() else {
                panic!("expected a pending request")
            };
            (token, writing)
        };
        let (token, writing) = begin(1);
        remote.send(Command::Pause(true));
        assert!(token.is_paused() && !writing.is_paused());
        remote.send(render(2));
        assert!(
            token.is_canceled() && !writing.is_canceled(),
            "a request without output should not cancel writing"
        );
        let Command::Render(request) = render(3) else { panic!("a request") };
        remote.send(Command::Render(Box::new(Request { write: WriteRequirement::Try, ..*request })));
        assert!(writing.is_canceled());
        let (token, writing) = begin(4);
        remote.send(Command::Quit);
        assert!(token.is_canceled() && !writing.is_canceled());
    }

    #[test]
    fn write_command_does_not_apply_to_another_view() {
        let remote = silent_sender();
        remote.send(render(1));
        let _ = token(&remote);
        remote.send(Command::Write);
        let Command::Render(view) = render(2) else { panic!("a request") };
        let overrides = Overrides { view: Some(ViewMode::Normal), ..view.overrides.clone() };
        remote.send(Command::Render(Box::new(Request { overrides, ..*view })));
        assert!(matches!(remote.wait_for_next_task(), Task::Write));
        assert!(
            !remote.try_postpone_write_to_pending(false),
            "the command should not be postponed, so that an error is reported"
        );
        // A command sent after the view was requested applies to the view, even if the first image is
        // complete.
        remote.send(Command::Write);
        assert!(
            !remote.wants_write() && !remote.take_write(),
            "the ending request should ignore the command"
        );
        assert!(matches!(remote.wait_for_next_task(), Task::Write));
        assert!(remote.try_postpone_write_to_pending(true));
    }

    #[test]
    fn pending_commands_are_handled_in_sequence() {
        let remote = silent_sender();
        remote.send(render(1));
        remote.send(Command::Write);
        remote.send(Command::Preview(None));
        assert!(
            matches!(remote.wait_for_next_task(), Task::Write),
            "the command should apply to the shown image first"
        );
        assert!(
            remote.try_postpone_write_to_pending(false),
            "the command should be postponed while the image is incomplete"
        );
        assert!(matches!(remote.wait_for_next_task(), Task::Render(..)));
        assert!(remote.take_write(), "the request should take the command");
        assert!(!remote.take_write());
        assert!(matches!(remote.wait_for_next_task(), Task::Preview(None, _)));
        assert!(!remote.try_postpone_write_to_pending(false), "no request should be pending");
    }
}
