//! The loop: the one owner of the terminal and the one place where effects happen.

use std::io;
use std::sync::PoisonError;
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender};
use std::thread;
use std::time::{Duration, Instant};

use super::color::{self, ColorDepth};
use super::event::{Effect, Event, Source};
use super::input;
use super::options::{Ended, ExitStatus, Options, PreviewChoice, TuiError};
use super::signals::{self, Listener};
use super::state::{PreviewKind, Setup, State};
use super::terminal::{self, Screen};
use super::update::{start, update};
use crate::pipeline::protocol::{self, Command, PreviewSlot};

/// At most 20 frames a second.
const FRAME: Duration = Duration::from_millis(50);

/// Runs the front end until it is quit, by a key or a signal, and gives the terminal back. The worker is sent
/// [`Command::Quit`] at the end. To be called once in a process.
///
/// # Errors
/// [`TuiError`] where there is no terminal, where it cannot be written to, and when the worker is gone.
pub fn run(options: Options) -> Result<Ended, TuiError> {
    terminal::require()?;
    let depth = color::depth(options.color, |name| std::env::var(name).ok());
    // Otherwise crossterm drops colours that were asked for by name where NO_COLOR is set.
    crossterm::style::force_color_output(depth != ColorDepth::None);

    let (sender, events) = mpsc::channel();
    let listener = Listener::start(&sender).map_err(failed("hear signals for"))?;
    let screen = Screen::open()?;
    let setup = Setup {
        scene: options.scene,
        overrides: options.overrides,
        window: terminal::window(options.cell_aspect),
        preview: preview_kind(options.preview, depth),
        depth,
    };
    forward("worker-events", options.events, &sender, Event::Worker, Source::Worker)?;
    forward("changes", options.changes, &sender, Event::Changed, Source::Watcher)?;
    input::start(&sender).map_err(failed("read keys from"))?;

    let ui = Ui {
        screen,
        state: State::new(setup, Instant::now()),
        commands: options.commands,
        previews: options.previews,
        cell_aspect: options.cell_aspect,
        next_frame: Instant::now(),
    };
    let outcome = ui.run(&events);
    drop(listener);
    outcome
}

fn failed(action: &'static str) -> impl Fn(io::Error) -> TuiError {
    move |source| TuiError::Terminal { action, source }
}

fn preview_kind(choice: PreviewChoice, depth: ColorDepth) -> PreviewKind {
    match choice {
        PreviewChoice::None => PreviewKind::None,
        // Without colours half blocks are a uniform wall.
        PreviewChoice::Ascii => PreviewKind::Ascii,
        _ if depth == ColorDepth::None => PreviewKind::Ascii,
        PreviewChoice::Auto | PreviewChoice::HalfBlock => PreviewKind::HalfBlock,
    }
}

/// Passes one channel on into the loop's, and says when it ends.
fn forward<T: Send + 'static>(
    name: &str,
    from: Receiver<T>,
    events: &Sender<Event>,
    wrap: impl Fn(T) -> Event + Send + 'static,
    source: Source,
) -> Result<(), TuiError> {
    let events = events.clone();
    let pass = move || {
        while let Ok(message) = from.recv() {
            if events.send(wrap(message)).is_err() {
                return;
            }
        }
        let _ = events.send(Event::Lost(source));
    };
    thread::Builder::new().name(name.to_owned()).spawn(pass).map_err(failed("start a thread for"))?;
    Ok(())
}

struct Ui {
    screen: Screen,
    state: State,
    commands: Box<dyn FnMut(Command)>,
    previews: PreviewSlot,
    cell_aspect: Option<f32>,
    /// No frame before this.
    next_frame: Instant,
}

/// How the loop ends.
enum End {
    Quit(ExitStatus),
    Error(TuiError),
}

impl Ui {
    fn run(mut self, events: &Receiver<Event>) -> Result<Ended, TuiError> {
        let effects = start(&mut self.state);
        let mut end = self.perform(effects);
        while end.is_none() {
            end = self.draw_if_due().or_else(|| self.wait(events));
        }
        (self.commands)(Command::Quit);
        let status = match end {
            // Whoever sends SIGHUP by hand still has the terminal and wants it back.
            Some(End::Quit(ExitStatus::HANGUP)) => {
                if !terminal::is_there() {
                    self.screen.abandon();
                }
                ExitStatus::HANGUP
            }
            Some(End::Error(error)) => return Err(error),
            Some(End::Quit(status)) => status,
            None => ExitStatus::QUIT,
        };
        Ok(Ended { status, is_write_unanswered: self.state.asked_to_write })
    }

    /// Everything that has happened, or the next thing that does.
    fn wait(&mut self, events: &Receiver<Event>) -> Option<End> {
        let first = match next_wake(&self.state, self.next_frame) {
            Some(wake) => events.recv_timeout(wake.saturating_duration_since(Instant::now())),
            None => events.recv().map_err(RecvTimeoutError::from),
        };
        let first = match first {
            Ok(event) => event,
            Err(RecvTimeoutError::Timeout) => Event::Tick,
            Err(RecvTimeoutError::Disconnected) => return Some(End::Quit(ExitStatus::HANGUP)),
        };
        let mut next = Some(first);
        while let Some(event) = next {
            if let Some(end) = self.handle(event) {
                return Some(end);
            }
            next = events.try_recv().ok();
        }
        None
    }

    fn handle(&mut self, event: Event) -> Option<End> {
        if let Event::Worker(protocol::Event::Preview { .. }) = event {
            let latest = self.previews.lock().unwrap_or_else(PoisonError::into_inner).take();
            let latest = latest?;
            return self.apply(Event::Picture { generation: latest.generation, picture: latest.picture });
        }
        self.apply(event)
    }

    fn apply(&mut self, event: Event) -> Option<End> {
        let effects = update(&mut self.state, event, Instant::now());
        self.perform(effects)
    }

    fn perform(&mut self, effects: Vec<Effect>) -> Option<End> {
        effects.into_iter().find_map(|effect| self.perform_one(effect))
    }

    fn perform_one(&mut self, effect: Effect) -> Option<End> {
        match effect {
            Effect::Send(command) => (self.commands)(command),
            Effect::Quit(status) => return Some(End::Quit(status)),
            Effect::GiveUp => {
                return Some(End::Error(TuiError::WorkerGone { reason: terminal::last_panic() }));
            }
            Effect::StopJob if !signals::has_shell() => return self.apply(Event::NoShell),
            Effect::StopJob => {
                return signals::stop_job().err().map(failed("stop the job of")).map(End::Error);
            }
            Effect::Suspend if signals::has_shell() => {
                self.screen.suspend();
                // Stopped here; SIGCONT then asks for a redraw.
                signals::stop();
            }
            Effect::Suspend => {}
            Effect::Redraw => return self.redraw(),
            Effect::Measure => return self.measure(),
        }
        None
    }

    fn redraw(&mut self) -> Option<End> {
        if let Err(error) = self.screen.resume() {
            return Some(unwritable(error));
        }
        self.measure()
    }

    fn measure(&mut self) -> Option<End> {
        self.apply(Event::Resize(terminal::window(self.cell_aspect)))
    }

    fn draw_if_due(&mut self) -> Option<End> {
        if !self.state.dirty || (!self.state.urgent && Instant::now() < self.next_frame) {
            return None;
        }
        self.state.urgent = false;
        self.next_frame = Instant::now() + FRAME;
        if !self.screen.is_taken() {
            return None;
        }
        self.state.dirty = false;
        if let Err(error) = self.screen.draw(&self.state) {
            return Some(unwritable(error));
        }
        self.next_frame = Instant::now() + FRAME;
        let generation = self.state.picture.as_ref()?.generation;
        self.apply(Event::Shown { generation })
    }
}

/// A terminal that is gone is a hangup, whether its signal has come or not.
fn unwritable(error: io::Error) -> End {
    if terminal::is_there() {
        End::Error(TuiError::Terminal { action: "write to", source: error })
    } else {
        End::Quit(ExitStatus::HANGUP)
    }
}

/// When to look again if nothing happens; none: not before something does.
fn next_wake(state: &State, next_frame: Instant) -> Option<Instant> {
    let frame = state.dirty.then_some(if state.urgent { state.now } else { next_frame });
    [frame, state.next_tick()].into_iter().flatten().min()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tui::fixtures::state;

    #[test]
    fn an_idle_state_is_not_woken() {
        let now = Instant::now();
        let mut state = state(80, 24);
        state.dirty = true;
        assert_eq!(next_wake(&state, now), Some(now));
        state.dirty = false;
        assert!(next_wake(&state, now).is_some(), "the clock of a render runs");
        state.activity = crate::tui::state::Activity::Done;
        assert_eq!(next_wake(&state, now), None);
    }

    #[test]
    fn without_colours_the_preview_is_a_ramp() {
        assert_eq!(preview_kind(PreviewChoice::Auto, ColorDepth::None), PreviewKind::Ascii);
        assert_eq!(preview_kind(PreviewChoice::HalfBlock, ColorDepth::None), PreviewKind::Ascii);
        assert_eq!(preview_kind(PreviewChoice::Auto, ColorDepth::Ansi16), PreviewKind::HalfBlock);
        assert_eq!(preview_kind(PreviewChoice::None, ColorDepth::TrueColor), PreviewKind::None);
    }

    #[test]
    fn a_source_that_ends_is_reported_after_its_messages() {
        let (from, receiver) = mpsc::channel();
        let (sender, events) = mpsc::channel();
        forward("test", receiver, &sender, Event::Changed, Source::Watcher).expect("a thread");
        from.send(super::super::Changed { noticed: Instant::now() }).expect("a receiver");
        drop(from);
        assert!(matches!(events.recv(), Ok(Event::Changed(_))));
        assert!(matches!(events.recv(), Ok(Event::Lost(Source::Watcher))));
    }
}
