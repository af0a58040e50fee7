//! The thread that owns the engine, and the handle that front ends hold.
//!
//! The mailbox holds one request: a newer one replaces it and cancels the one under way. Token and mailbox change
//! under one lock, so that no cancel is lost between two requests.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{self, Receiver, Sender};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use super::engine::{Engine, Meanwhile};
use super::protocol::{Command, Event, Failure, PreviewSlot, Request};
use super::sink::Sink;
use super::trace::Kernel;
use crate::control::CancelToken;

/// What renders tiles.
pub(super) const KERNEL: Kernel = crate::integrators::render_tile;

/// Start a worker with its thread.
///
/// # Errors
/// The system has no thread left.
pub fn start() -> std::io::Result<Handle> {
    start_with(KERNEL)
}

/// A worker that renders tiles by another function.
pub(super) fn start_with(kernel: Kernel) -> std::io::Result<Handle> {
    let (sender, events) = mpsc::channel();
    let remote = Remote { mailbox: Arc::default(), events: sender };
    let previews = PreviewSlot::default();
    let worker = Worker { remote: remote.clone(), previews: previews.clone(), kernel };
    let thread = std::thread::Builder::new().name("glimt-worker".to_owned()).spawn(move || worker.work())?;
    Ok(Handle { events, previews, remote, thread: Some(thread) })
}

/// A running worker. Dropping it ends the worker, which may take as long as a file takes to be written.
#[derive(Debug)]
pub struct Handle {
    /// What the worker says.
    pub events: Receiver<Event>,
    /// Where it puts pictures.
    pub previews: PreviewSlot,
    remote: Remote,
    thread: Option<JoinHandle<()>>,
}

impl Handle {
    /// Give an order; never blocks.
    pub fn send(&self, command: Command) {
        self.remote.send(command);
    }

    /// A way to give orders from elsewhere.
    pub fn remote(&self) -> Remote {
        self.remote.clone()
    }

    /// End the worker and wait for it at most this long; true: it has ended.
    pub fn finish(mut self, patience: Duration) -> bool {
        self.send(Command::Quit);
        let deadline = Instant::now() + patience;
        let ended = |thread: &Option<JoinHandle<()>>| thread.as_ref().is_none_or(JoinHandle::is_finished);
        while !ended(&self.thread) && Instant::now() < deadline {
            std::thread::sleep(Duration::from_millis(2));
        }
        let has_ended = ended(&self.thread);
        if !has_ended {
            self.thread = None;
        }
        has_ended
    }
}

impl Drop for Handle {
    fn drop(&mut self) {
        self.send(Command::Quit);
        if let Some(thread) = self.thread.take() {
            // A panic of the thread was said as an event.
            let _ = thread.join();
        }
    }
}

/// Gives orders to a worker.
#[derive(Clone, Debug)]
pub struct Remote {
    mailbox: Arc<(Mutex<Mailbox>, Condvar)>,
    events: Sender<Event>,
}

#[derive(Debug, Default)]
struct Mailbox {
    request: Option<Box<Request>>,
    write: bool,
    quit: bool,
    /// Of the request under way.
    token: CancelToken,
    /// Generation of the newest request.
    newest: u64,
}

/// What the worker does next.
enum Task {
    Render(Box<Request>, CancelToken),
    Write,
    Quit,
}

impl Remote {
    /// Give an order; never blocks.
    pub fn send(&self, command: Command) {
        let mut mailbox = self.lock();
        match command {
            Command::Render(request) => self.replace(&mut mailbox, request),
            Command::Write => mailbox.write = true,
            Command::Cancel => {
                mailbox.token.cancel();
                let dropped = mailbox.request.take();
                self.say_cancelled(dropped);
            }
            Command::Pause(paused) => mailbox.token.set_paused(paused),
            Command::Quit => {
                mailbox.token.cancel();
                mailbox.quit = true;
            }
        }
        drop(mailbox);
        self.mailbox.1.notify_all();
    }

    /// The newest request wins, whatever the order in which they come.
    fn replace(&self, mailbox: &mut Mailbox, request: Box<Request>) {
        if request.generation < mailbox.newest {
            return self.say_cancelled(Some(request));
        }
        mailbox.newest = request.generation;
        mailbox.token.cancel();
        let replaced = mailbox.request.replace(request);
        self.say_cancelled(replaced);
    }

    fn say_cancelled(&self, request: Option<Box<Request>>) {
        if let Some(request) = request {
            // A front end that is gone need not be told.
            let _ = self.events.send(Event::Cancelled { generation: request.generation });
        }
    }

    fn lock(&self) -> MutexGuard<'_, Mailbox> {
        self.mailbox.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn take_write(&self) -> bool {
        std::mem::take(&mut self.lock().write)
    }

    fn next(&self) -> Task {
        let mut mailbox = self.lock();
        loop {
            if mailbox.quit {
                return Task::Quit;
            }
            if std::mem::take(&mut mailbox.write) {
                return Task::Write;
            }
            if let Some(request) = mailbox.request.take() {
                mailbox.token = CancelToken::new();
                return Task::Render(request, mailbox.token.clone());
            }
            mailbox = self.mailbox.1.wait(mailbox).unwrap_or_else(PoisonError::into_inner);
        }
    }
}

struct Worker {
    remote: Remote,
    previews: PreviewSlot,
    kernel: Kernel,
}

impl Worker {
    fn work(self) {
        let mut engine = Engine::new(self.kernel);
        let mut sink =
            Sink { generation: 0, events: self.remote.events.clone(), previews: self.previews.clone() };
        loop {
            let outcome = match self.remote.next() {
                Task::Quit => break,
                Task::Write => catch_unwind(AssertUnwindSafe(|| engine.write_now(&sink))),
                Task::Render(request, token) => {
                    sink.generation = request.generation;
                    let take_write = || self.remote.take_write();
                    let meanwhile = Meanwhile { token: &token, take_write: &take_write };
                    catch_unwind(AssertUnwindSafe(|| engine.request(&request, &sink, &meanwhile)))
                }
            };
            if let Err(payload) = outcome {
                // What was half done when it broke is not to be trusted.
                engine = Engine::new(self.kernel);
                let failure = Failure::Work(format!("internal error: {}", reason(payload.as_ref())));
                sink.send(Event::Failed { generation: sink.generation, failure });
            }
        }
    }
}

fn reason(payload: &(dyn Any + Send)) -> &str {
    let text = payload.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| payload.downcast_ref::<&str>().copied()).unwrap_or("a part of the renderer gave up")
}
