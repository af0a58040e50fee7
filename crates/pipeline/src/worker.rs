//! The worker thread, which owns the engine, and its handle for front ends.
//!
//! The mailbox holds one request: a newer one replaces it and cancels the current one. Token and mailbox change under
//! one lock, so that no cancellation is lost between two requests.

use std::any::Any;
use std::collections::VecDeque;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{self, Receiver, Sender};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use super::engine::{Engine, EngineConfig, Interruption, Orders, RequestContext};
use super::protocol::{Command, Event, Failure, PreviewSize, PreviewSlot, Request, Writing};
use super::queries::Query;
use super::settings::Overrides;
use super::sink::Sink;
use super::watch::content::Contents;
use crate::control::CancelToken;

/// Starts a worker thread. On Linux the niceness of its render threads is `nice` above this thread's, so that the front
/// end and other programs take precedence.
///
/// # Errors
/// The system cannot start a thread.
pub fn start(nice: u8) -> std::io::Result<Handle> {
    start_with(EngineConfig { nice, ..EngineConfig::default() })
}

/// Starts a worker with this configuration.
pub(super) fn start_with(config: EngineConfig) -> std::io::Result<Handle> {
    let (sender, events) = mpsc::channel();
    let remote = Remote { mailbox: Arc::default(), events: sender };
    let previews = PreviewSlot::default();
    let contents = Arc::<Contents>::default();
    let worker =
        Worker { remote: remote.clone(), previews: previews.clone(), config, contents: contents.clone() };
    let thread = std::thread::Builder::new().name("glimt-worker".to_owned()).spawn(move || worker.work())?;
    Ok(Handle { events, previews, remote, contents, thread: Some(thread) })
}

/// A running worker. Dropping it stops the worker, which may take as long as writing a file.
#[derive(Debug)]
pub struct Handle {
    /// Events of the worker.
    pub events: Receiver<Event>,
    /// Slot for previews.
    pub previews: PreviewSlot,
    remote: Remote,
    contents: Arc<Contents>,
    thread: Option<JoinHandle<()>>,
}

impl Handle {
    /// Sends a command without blocking.
    pub fn send(&self, command: Command) {
        self.remote.send(command);
    }

    /// Returns a handle for sending commands from other threads.
    pub fn remote(&self) -> Remote {
        self.remote.clone()
    }

    /// Returns the worker's file contents, for a watcher of the same files.
    pub fn contents(&self) -> Arc<Contents> {
        Arc::clone(&self.contents)
    }

    /// Stops the worker and waits for at most `patience`. Returns whether it has stopped. An image that is being
    /// written is completed.
    pub fn end_within(&self, patience: Duration) -> bool {
        self.send(Command::Quit);
        let deadline = Instant::now().checked_add(patience);
        while !self.has_ended() && deadline.is_none_or(|deadline| Instant::now() < deadline) {
            std::thread::sleep(Duration::from_millis(2));
        }
        self.has_ended()
    }

    /// Like [`Self::end_within`], but abandons a worker that does not stop.
    pub fn finish(mut self, patience: Duration) -> bool {
        let has_ended = self.end_within(patience);
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
            // If the thread panicked, an event has reported it.
            let _ = thread.join();
        }
    }
}

/// Sends commands to a worker.
#[derive(Clone, Debug)]
pub struct Remote {
    mailbox: Arc<(Mutex<Mailbox>, Condvar)>,
    events: Sender<Event>,
}

#[derive(Debug, Default)]
struct Mailbox {
    request: Option<Box<Request>>,
    write: bool,
    /// The write order came too early and is meant for the pending request.
    is_write_postponed: bool,
    /// The write order came after the pending request and is meant for it.
    is_write_of_waiting: bool,
    /// Settings of the current request that keys change.
    shown: Overrides,
    /// New size of previews.
    preview: Option<Option<PreviewSize>>,
    queries: VecDeque<Query>,
    /// Whether the newest request is paused.
    paused: bool,
    /// Whether the current render is stopped to be resumed later.
    suspended: bool,
    quit: bool,
    /// Token of the current request.
    token: CancelToken,
    /// Token of the write stage: a pause, the end of the program or a request without output must not interrupt the
    /// writing of a finished image.
    writing: CancelToken,
    /// Generation of the newest request.
    newest: u64,
}

/// Returns the settings of a request that keys change.
fn shown(request: &Request) -> Overrides {
    let Overrides { shadows, integrator, dof, photons, view, camera, exposure, .. } = request.overrides;
    Overrides { shadows, integrator, dof, photons, view, camera, exposure, ..Overrides::default() }
}

/// Next task of the worker.
enum Task {
    /// A request, with the tokens of the render and of the write stage.
    Render(Box<Request>, CancelToken, CancelToken),
    Write,
    Preview(Option<PreviewSize>, CancelToken),
    Query(Query),
    Quit,
}

impl Remote {
    /// Sends a command without blocking.
    pub fn send(&self, command: Command) {
        let mut mailbox = self.lock();
        match command {
            Command::Render(request) => self.replace(&mut mailbox, request),
            Command::Write => {
                mailbox.write = true;
                mailbox.is_write_of_waiting = mailbox.request.is_some();
            }
            Command::Preview(size) => mailbox.preview = Some(size),
            Command::KeepCamera(camera) => mailbox.queries.push_back(Query::KeepCamera(camera)),
            Command::UndoCamera(edit) => mailbox.queries.push_back(Query::UndoCamera(edit)),
            Command::Pick(position) => {
                mailbox.queries.retain(|query| !matches!(query, Query::Pick(_)));
                mailbox.queries.push_back(Query::Pick(position));
            }
            Command::Cancel => {
                mailbox.token.cancel();
                mailbox.writing.cancel();
                let dropped = mailbox.request.take();
                self.say_cancelled(dropped);
            }
            Command::Suspend => {
                mailbox.suspended = true;
                mailbox.token.cancel();
                let dropped = mailbox.request.take();
                self.say_cancelled(dropped);
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

    /// Replaces the pending request unless it is newer. Requests may arrive in any order.
    fn replace(&self, mailbox: &mut Mailbox, request: Box<Request>) {
        if request.generation < mailbox.newest {
            return self.say_cancelled(Some(request));
        }
        mailbox.newest = request.generation;
        mailbox.token.cancel();
        if request.write != Writing::No {
            mailbox.writing.cancel();
        }
        (mailbox.paused, mailbox.preview) = (false, None);
        let replaced = mailbox.request.replace(request);
        self.say_cancelled(replaced);
    }

    fn say_cancelled(&self, request: Option<Box<Request>>) {
        if let Some(request) = request {
            // Ignore a front end that has gone.
            let _ = self.events.send(Event::Cancelled { generation: request.generation });
        }
    }

    fn lock(&self) -> MutexGuard<'_, Mailbox> {
        self.mailbox.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Keeps a write order for the pending request, if it was meant for it, or if it has the settings of the current
    /// image and that is incomplete. Returns whether the order is kept.
    fn postpone_write(&self, can_write: bool) -> bool {
        let mut mailbox = self.lock();
        let is_meant = mailbox.is_write_of_waiting;
        let postponed = mailbox
            .request
            .as_ref()
            .is_some_and(|request| is_meant || !can_write && shown(request) == mailbox.shown);
        (mailbox.write, mailbox.is_write_postponed) = (postponed, postponed);
        postponed
    }

    fn next(&self) -> Task {
        let mut mailbox = self.lock();
        loop {
            // Carry out a write order that came before the end.
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
                mailbox.shown = shown(&request);
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

impl Orders for Remote {
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

    fn take_preview(&self) -> Option<Option<PreviewSize>> {
        self.lock().preview.take()
    }

    fn take_query(&self) -> Option<Query> {
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
    remote: Remote,
    contents: Arc<Contents>,
    previews: PreviewSlot,
    config: EngineConfig,
}

impl Worker {
    fn work(self) {
        let _last_words = LastWords(&self.remote);
        let mut engine = Engine::new(self.config, self.contents.clone());
        let mut sink = Sink {
            generation: 0,
            events: self.remote.events.clone(),
            previews: self.previews.clone(),
            within: None,
        };
        loop {
            let outcome = match self.remote.next() {
                Task::Quit => {
                    engine.keep_own(&sink, self.remote.interruption());
                    break;
                }
                Task::Write if self.remote.postpone_write(engine.can_write()) => continue,
                Task::Write => catch_unwind(AssertUnwindSafe(|| engine.write_now(&sink))),
                Task::Preview(size, token) => {
                    catch_unwind(AssertUnwindSafe(|| engine.show_now(size, &sink, &token)))
                }
                Task::Query(query) => catch_unwind(AssertUnwindSafe(|| engine.query(&query, &sink))),
                Task::Render(request, token, writing) => {
                    sink.generation = request.generation;
                    let context = RequestContext::new(&token, &writing, &self.remote);
                    catch_unwind(AssertUnwindSafe(|| engine.request(&request, &sink, &context)))
                }
            };
            if let Err(payload) = outcome {
                // Do not trust the state left by a panic.
                engine = Engine::new(self.config, self.contents.clone());
                let failure = Failure::Work(format!("internal error: {}", reason(payload.as_ref())));
                sink.send(Event::Failed { generation: sink.generation, failure });
            }
        }
    }
}

/// Reports the newest request as failed if the thread itself panics, because the front end waits for its end.
struct LastWords<'a>(&'a Remote);

impl Drop for LastWords<'_> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            let generation = self.0.lock().newest;
            let failure = Failure::Work("internal error: the worker thread panicked".to_owned());
            // Ignore a front end that has gone.
            let _ = self.0.events.send(Event::Failed { generation, failure });
        }
    }
}

fn reason(payload: &(dyn Any + Send)) -> &str {
    let text = payload.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| payload.downcast_ref::<&str>().copied()).unwrap_or("unknown panic")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::View;

    fn render(generation: u64) -> Command {
        Command::Render(Box::new(Request {
            generation,
            scene: "a.toml".into(),
            overrides: Default::default(),
            preview: None,
            write: Writing::No,
            own: None,
            force: false,
            first: None,
        }))
    }

    fn token(remote: &Remote) -> CancelToken {
        match remote.next() {
            Task::Render(_, token, _) => token,
            _ => panic!("a request waits"),
        }
    }

    #[test]
    fn panicking_worker_ends_its_request() {
        let (events, received) = mpsc::channel();
        let remote = Remote { mailbox: Arc::default(), events };
        remote.send(render(7));
        let panicking = remote;
        let thread = std::thread::spawn(move || {
            let _last_words = LastWords(&panicking);
            panic!("outside of a request");
        });
        assert!(thread.join().is_err());
        assert!(matches!(received.try_recv(), Ok(Event::Failed { generation: 7, .. })));
    }

    #[test]
    fn pause_applies_to_the_newest_request() {
        let remote = Remote { mailbox: Arc::default(), events: mpsc::channel().0 };
        remote.send(render(1));
        let ending = token(&remote);
        remote.send(render(2));
        // The first request is still ending when the user presses the key.
        remote.send(Command::Pause(true));
        assert!(ending.is_cancelled());
        let second = token(&remote);
        assert!(second.is_paused());
        remote.send(Command::Pause(false));
        assert!(!second.is_paused());
        remote.send(Command::Pause(true));
        remote.send(render(3));
        assert!(!token(&remote).is_paused(), "a later request is not paused");
    }

    #[test]
    fn write_before_quit_is_carried_out() {
        let remote = Remote { mailbox: Arc::default(), events: mpsc::channel().0 };
        remote.send(render(1));
        let token = token(&remote);
        remote.send(render(2));
        remote.send(Command::Write);
        remote.send(Command::Quit);
        assert!(token.is_cancelled());
        assert!(matches!(remote.next(), Task::Write));
        assert!(!remote.postpone_write(false), "no request is pending");
        assert!(matches!(remote.next(), Task::Quit));
    }

    #[test]
    fn only_a_newer_image_cancels_the_write_stage() {
        let remote = Remote { mailbox: Arc::default(), events: mpsc::channel().0 };
        let begin = |number| {
            remote.send(render(number));
            match remote.next() {
                Task::Render(_, token, writing) => (token, writing),
                _ => panic!("a request waits"),
            }
        };
        let (token, writing) = begin(1);
        remote.send(Command::Pause(true));
        assert!(token.is_paused() && !writing.is_paused());
        remote.send(render(2));
        assert!(token.is_cancelled() && !writing.is_cancelled(), "the second request does not write");
        let Command::Render(request) = render(3) else { panic!("a request") };
        remote.send(Command::Render(Box::new(Request { write: Writing::Try, ..*request })));
        assert!(writing.is_cancelled());
        let (token, writing) = begin(4);
        remote.send(Command::Quit);
        assert!(token.is_cancelled() && !writing.is_cancelled());
    }

    #[test]
    fn write_order_is_not_moved_to_another_view() {
        let remote = Remote { mailbox: Arc::default(), events: mpsc::channel().0 };
        remote.send(render(1));
        let _ = token(&remote);
        remote.send(Command::Write);
        let Command::Render(view) = render(2) else { panic!("a request") };
        let overrides = Overrides { view: Some(View::Normal), ..view.overrides.clone() };
        remote.send(Command::Render(Box::new(Request { overrides, ..*view })));
        assert!(matches!(remote.next(), Task::Write));
        assert!(!remote.postpone_write(false), "the first image is lost, and an error is reported");
        // After the view is requested, the order is meant for it, even if the first image is complete.
        remote.send(Command::Write);
        assert!(!remote.wants_write() && !remote.take_write(), "the ending request ignores the order");
        assert!(matches!(remote.next(), Task::Write));
        assert!(remote.postpone_write(true));
    }

    #[test]
    fn pending_orders_keep_their_order() {
        let remote = Remote { mailbox: Arc::default(), events: mpsc::channel().0 };
        remote.send(render(1));
        remote.send(Command::Write);
        remote.send(Command::Preview(None));
        assert!(matches!(remote.next(), Task::Write), "the image on the screen");
        assert!(remote.postpone_write(false), "the image is incomplete");
        assert!(matches!(remote.next(), Task::Render(..)));
        assert!(remote.take_write(), "the request takes it");
        assert!(!remote.take_write());
        assert!(matches!(remote.next(), Task::Preview(None, _)));
        assert!(!remote.postpone_write(false), "no request is pending");
    }
}
