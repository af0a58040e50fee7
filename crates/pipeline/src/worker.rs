//! The thread that owns the engine, and the handle that front ends hold.
//!
//! The mailbox holds one request: a newer one replaces it and cancels the one under way. Token and mailbox change
//! under one lock, so that no cancel is lost between two requests.

use std::any::Any;
use std::collections::VecDeque;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{self, Receiver, Sender};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use super::engine::{Engine, Interruption, Means, Meanwhile, Orders};
use super::errands::Errand;
use super::protocol::{Command, Event, Failure, PreviewSize, PreviewSlot, Request, Writing};
use super::settings::Overrides;
use super::sink::Sink;
use super::watch::content::Contents;
use crate::control::CancelToken;

/// Starts a worker with its thread. On Linux the nice value of its render threads is `nice` above that of this thread, so that
/// the front end and everything else on the machine can go first.
///
/// # Errors
/// The system has no thread left.
pub fn start(nice: u8) -> std::io::Result<Handle> {
    start_with(Means { nice, ..Means::default() })
}

/// A worker with other means.
pub(super) fn start_with(means: Means) -> std::io::Result<Handle> {
    let (sender, events) = mpsc::channel();
    let remote = Remote { mailbox: Arc::default(), events: sender };
    let previews = PreviewSlot::default();
    let contents = Arc::<Contents>::default();
    let worker =
        Worker { remote: remote.clone(), previews: previews.clone(), means, contents: contents.clone() };
    let thread = std::thread::Builder::new().name("glimt-worker".to_owned()).spawn(move || worker.work())?;
    Ok(Handle { events, previews, remote, contents, thread: Some(thread) })
}

/// A running worker. Dropping it ends the worker, which may take as long as a file takes to be written.
#[derive(Debug)]
pub struct Handle {
    /// Events of the worker.
    pub events: Receiver<Event>,
    /// Slot for preview pictures.
    pub previews: PreviewSlot,
    remote: Remote,
    contents: Arc<Contents>,
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

    /// The worker's knowledge of files, for a watcher of the same files.
    pub fn contents(&self) -> Arc<Contents> {
        Arc::clone(&self.contents)
    }

    /// Tell the worker to end and wait for it at most this long; true: it has ended. A picture that is being written is written.
    pub fn end_within(&self, patience: Duration) -> bool {
        self.send(Command::Quit);
        let deadline = Instant::now().checked_add(patience);
        while !self.has_ended() && deadline.is_none_or(|deadline| Instant::now() < deadline) {
            std::thread::sleep(Duration::from_millis(2));
        }
        self.has_ended()
    }

    /// The same for the last time: a worker that does not end is left to the end of the process.
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
            // An event has reported a panic of the thread.
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
    /// The order to write came too early: it is for the request that waits.
    is_write_postponed: bool,
    /// The order to write came when the request that waits was there: it is meant.
    is_write_of_waiting: bool,
    /// Settings of the request under way that keys change.
    shown: Overrides,
    /// Another size of the previews.
    preview: Option<Option<PreviewSize>>,
    errands: VecDeque<Errand>,
    /// Whether the newest request is held.
    paused: bool,
    /// Whether the render under way is stopped to be gone on with later.
    suspended: bool,
    quit: bool,
    /// Token of the request under way.
    token: CancelToken,
    /// Token of the write stage: a whole picture is not lost to a pause, to the end of the program or to a request that writes
    /// nothing.
    writing: CancelToken,
    /// Generation of the newest request.
    newest: u64,
}

/// Settings of a request that keys change.
fn shown(request: &Request) -> Overrides {
    let Overrides { shadows, integrator, dof, photons, view, camera, exposure, .. } = request.overrides;
    Overrides { shadows, integrator, dof, photons, view, camera, exposure, ..Overrides::default() }
}

/// Next task of the worker.
enum Task {
    /// With the tokens of the work and of the writing at its end.
    Render(Box<Request>, CancelToken, CancelToken),
    Write,
    Preview(Option<PreviewSize>, CancelToken),
    Errand(Errand),
    Quit,
}

impl Remote {
    /// Give an order; never blocks.
    pub fn send(&self, command: Command) {
        let mut mailbox = self.lock();
        match command {
            Command::Render(request) => self.replace(&mut mailbox, request),
            Command::Write => {
                mailbox.write = true;
                mailbox.is_write_of_waiting = mailbox.request.is_some();
            }
            Command::Preview(size) => mailbox.preview = Some(size),
            Command::KeepCamera(camera) => mailbox.errands.push_back(Errand::KeepCamera(camera)),
            Command::UndoCamera(edit) => mailbox.errands.push_back(Errand::UndoCamera(edit)),
            Command::Pick(spot) => {
                mailbox.errands.retain(|errand| !matches!(errand, Errand::Pick(_)));
                mailbox.errands.push_back(Errand::Pick(spot));
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

    /// The newest request wins, whatever the order in which they come.
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
            // A front end that is gone needs no events.
            let _ = self.events.send(Event::Cancelled { generation: request.generation });
        }
    }

    fn lock(&self) -> MutexGuard<'_, Mailbox> {
        self.mailbox.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Keeps an order to write for the waiting request, if it is meant, or if it has the settings of the current picture and that
    /// has holes. Returns whether the order is kept.
    fn postpone_write(&self, can_write: bool) -> bool {
        let mut mailbox = self.lock();
        let is_meant = mailbox.is_write_of_waiting;
        let postponed =
            mailbox.request.as_ref().is_some_and(|one| is_meant || !can_write && shown(one) == mailbox.shown);
        (mailbox.write, mailbox.is_write_postponed) = (postponed, postponed);
        postponed
    }

    fn next(&self) -> Task {
        let mut mailbox = self.lock();
        loop {
            // An order to write that came before the end is carried out.
            if mailbox.write && !(mailbox.is_write_postponed && mailbox.request.is_some()) {
                mailbox.write = false;
                return Task::Write;
            }
            if mailbox.quit {
                return Task::Quit;
            }
            if let Some(errand) = mailbox.errands.pop_front() {
                return Task::Errand(errand);
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

    fn take_errand(&self) -> Option<Errand> {
        self.lock().errands.pop_front()
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
    means: Means,
}

impl Worker {
    fn work(self) {
        let _last_words = LastWords(&self.remote);
        let mut engine = Engine::new(self.means, self.contents.clone());
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
                Task::Errand(errand) => catch_unwind(AssertUnwindSafe(|| engine.errand(&errand, &sink))),
                Task::Render(request, token, writing) => {
                    sink.generation = request.generation;
                    let meanwhile = Meanwhile::new(&token, &writing, &self.remote);
                    catch_unwind(AssertUnwindSafe(|| engine.request(&request, &sink, &meanwhile)))
                }
            };
            if let Err(payload) = outcome {
                // What was half done when it broke is not to be trusted.
                engine = Engine::new(self.means, self.contents.clone());
                let failure = Failure::Work(format!("internal error: {}", reason(payload.as_ref())));
                sink.send(Event::Failed { generation: sink.generation, failure });
            }
        }
    }
}

/// Reports the newest request as failed if the thread itself gives up: its front end waits for an end.
struct LastWords<'a>(&'a Remote);

impl Drop for LastWords<'_> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            let generation = self.0.lock().newest;
            let failure = Failure::Work("internal error: the renderer gave up".to_owned());
            // A front end that is gone needs no events.
            let _ = self.0.events.send(Event::Failed { generation, failure });
        }
    }
}

fn reason(payload: &(dyn Any + Send)) -> &str {
    let text = payload.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| payload.downcast_ref::<&str>().copied()).unwrap_or("a part of the renderer gave up")
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
    fn a_worker_that_gives_up_ends_its_request() {
        let (events, received) = mpsc::channel();
        let remote = Remote { mailbox: Arc::default(), events };
        remote.send(render(7));
        let gives_up = remote;
        let thread = std::thread::spawn(move || {
            let _last_words = LastWords(&gives_up);
            panic!("outside of a request");
        });
        assert!(thread.join().is_err());
        assert!(matches!(received.try_recv(), Ok(Event::Failed { generation: 7, .. })));
    }

    #[test]
    fn a_hold_is_for_the_newest_request_whether_it_has_begun_or_not() {
        let remote = Remote { mailbox: Arc::default(), events: mpsc::channel().0 };
        remote.send(render(1));
        let ending = token(&remote);
        remote.send(render(2));
        // The first is still ending when the person presses the key.
        remote.send(Command::Pause(true));
        assert!(ending.is_cancelled());
        let second = token(&remote);
        assert!(second.is_paused());
        remote.send(Command::Pause(false));
        assert!(!second.is_paused());
        remote.send(Command::Pause(true));
        remote.send(render(3));
        assert!(!token(&remote).is_paused(), "a request that comes later is not held");
    }

    #[test]
    fn a_write_that_was_asked_for_before_the_end_is_carried_out() {
        let remote = Remote { mailbox: Arc::default(), events: mpsc::channel().0 };
        remote.send(render(1));
        let token = token(&remote);
        remote.send(render(2));
        remote.send(Command::Write);
        remote.send(Command::Quit);
        assert!(token.is_cancelled());
        assert!(matches!(remote.next(), Task::Write));
        assert!(!remote.postpone_write(false), "there is no request left that it could wait for");
        assert!(matches!(remote.next(), Task::Quit));
    }

    #[test]
    fn the_writing_at_the_end_outlives_a_hold_the_end_and_a_view_but_no_newer_picture() {
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
        assert!(token.is_cancelled() && !writing.is_cancelled(), "the second is for looking at alone");
        let Command::Render(request) = render(3) else { panic!("a request") };
        remote.send(Command::Render(Box::new(Request { write: Writing::Try, ..*request })));
        assert!(writing.is_cancelled());
        let (token, writing) = begin(4);
        remote.send(Command::Quit);
        assert!(token.is_cancelled() && !writing.is_cancelled());
    }

    #[test]
    fn a_picture_for_looking_at_is_not_what_was_asked_for_before_it() {
        let remote = Remote { mailbox: Arc::default(), events: mpsc::channel().0 };
        remote.send(render(1));
        let _ = token(&remote);
        remote.send(Command::Write);
        let Command::Render(view) = render(2) else { panic!("a request") };
        let overrides = Overrides { view: Some(View::Normal), ..view.overrides.clone() };
        remote.send(Command::Render(Box::new(Request { overrides, ..*view })));
        assert!(matches!(remote.next(), Task::Write));
        assert!(!remote.postpone_write(false), "the first picture is lost, and the person is told");
        // Asked for when the view waits, it is the view that is meant, also where the first picture has no holes.
        remote.send(Command::Write);
        assert!(!remote.wants_write() && !remote.take_write(), "the request that is ending leaves it alone");
        assert!(matches!(remote.next(), Task::Write));
        assert!(remote.postpone_write(true));
    }

    #[test]
    fn what_waits_goes_in_its_order() {
        let remote = Remote { mailbox: Arc::default(), events: mpsc::channel().0 };
        remote.send(render(1));
        remote.send(Command::Write);
        remote.send(Command::Preview(None));
        assert!(matches!(remote.next(), Task::Write), "the picture that the person sees");
        assert!(remote.postpone_write(false), "it had holes");
        assert!(matches!(remote.next(), Task::Render(..)));
        assert!(remote.take_write(), "the request does it");
        assert!(!remote.take_write());
        assert!(matches!(remote.next(), Task::Preview(None, _)));
        assert!(!remote.postpone_write(false), "no request waits that could do it");
    }
}
