//! The loop: the one owner of the terminal and the one place where effects happen.

use std::collections::VecDeque;
use std::io;
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender};
use std::sync::{Arc, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;

use super::color::{self, ColorDepth};
use super::display::{Display, Way};
use super::editor::{self, FilePlace};
use super::environment::{ask, way};
use super::event::{Effect, Event, Source};
use super::graphics::Images;
use super::input;
use super::options::{Ended, ExitStatus, Options, TuiError};
use super::paint::{Advice, Fidelity, Moment, advise};
use super::parting;
use super::preview_kind::PreviewKind;
use super::signals::{self, Listener};
use super::state::{Setup, State};
use super::terminal::{self, Screen};
use super::update::{start, update};
use super::view;
use super::view::layout::Layout;
use super::writer;
use crate::film::Picture;
use crate::pipeline::protocol::{self, Command, LatestPreview, PreviewSlot};

/// At most 20 frames a second, keys aside.
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
    let variable = |name: &str| std::env::var(name).ok();
    let way = Way { ask: ask(options.preview, options.color, depth, variable), ..way(variable) };
    let setup = Setup {
        scene: options.scene,
        overrides: options.overrides,
        window: terminal::window(options.cell_aspect),
        preview: PreviewKind::of(options.preview, depth),
        depth,
        is_light: color::has_light_background(variable),
        ansi: *color::ansi(&variable("TERM").unwrap_or_default()),
        ask: way.ask,
    };
    forward("worker-events", options.events, &sender, Event::Worker, Source::Worker)?;
    forward("news", options.news, &sender, Event::of_watcher, Source::Watcher)?;
    input::start(&sender).map_err(failed("read keys from"))?;
    writer::start(&sender).map_err(failed("write to"))?;

    let images = match setup.preview {
        PreviewKind::Pixels(protocol) => {
            terminal::will_have_images();
            Some(Images::new(protocol, !variable("TMUX").unwrap_or_default().is_empty()))
        }
        PreviewKind::HalfBlock
        | PreviewKind::Quadrant
        | PreviewKind::Sextant
        | PreviewKind::Octant
        | PreviewKind::Ascii
        | PreviewKind::None => None,
    };
    let ui = Ui {
        screen,
        display: Display::new(depth, way, images, Instant::now()),
        drawn: Drawn::default(),
        events,
        postponed: VecDeque::new(),
        state: State::new(setup, Instant::now()),
        commands: options.commands,
        previews: options.previews,
        cell_aspect: options.cell_aspect,
        next_frame: Instant::now(),
    };
    let outcome = ui.run();
    drop(listener);
    outcome
}

fn failed(action: &'static str) -> impl Fn(io::Error) -> TuiError {
    move |source| TuiError::Terminal { action, source }
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
    display: Display,
    drawn: Drawn,
    events: Receiver<Event>,
    /// What came while answers were waited for.
    postponed: VecDeque<Event>,
    state: State,
    commands: Box<dyn FnMut(Command)>,
    previews: PreviewSlot,
    cell_aspect: Option<f32>,
    /// No frame before this.
    next_frame: Instant,
}

/// The picture that was drawn last.
#[derive(Default)]
struct Drawn {
    picture: Option<Arc<Picture>>,
    generation: u64,
    /// Samples of a pixel, in the mean.
    samples: f64,
    /// When it was aimed at.
    at: Option<Instant>,
    /// Whether there is a newer one of the same request in the slot, which was not worth its bytes yet.
    is_old: bool,
    /// Whether it is the first one of its request.
    is_first: bool,
    /// Whether anything of it may have been sent.
    is_shown: bool,
}

/// How the loop ends.
enum End {
    Quit(ExitStatus),
    Error(TuiError),
}

impl Ui {
    fn run(mut self) -> Result<Ended, TuiError> {
        let effects = start(&mut self.state);
        let mut end = self.perform(effects);
        while end.is_none() {
            end = self.draw_if_due().or_else(|| self.pump()).or_else(|| self.wait());
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
            Some(End::Quit(status)) => {
                self.leave();
                status
            }
            None => ExitStatus::QUIT,
        };
        let (summary, is_unwritten) = (parting::words(&self.state), self.state.write_failed.is_some());
        Ok(Ended { status, is_write_unanswered: self.state.asked_to_write, summary, is_unwritten })
    }

    /// Gives the screen back and waits a little for the answers that the terminal owes: a shell would take them for
    /// something typed.
    fn leave(&mut self) {
        self.screen.leave();
        let deadline = self.display.patience().map(|patience| Instant::now() + patience);
        while let Some(deadline) = deadline.filter(|_| self.display.patience().is_some()) {
            match self.events.recv_timeout(deadline.saturating_duration_since(Instant::now())) {
                Ok(Event::Answer(answer)) => self.display.answered(answer, Instant::now()),
                Ok(event) => self.postponed.push_back(event),
                Err(_) => return,
            }
        }
    }

    /// Everything that has happened, or the next thing that does.
    fn wait(&mut self) -> Option<End> {
        let now = Instant::now();
        let wake = next_wake(&self.state, self.next_frame).into_iter().chain(self.display.wake(now)).min();
        let first = match (self.postponed.pop_front(), wake) {
            (Some(event), _) => Ok(event),
            (None, Some(wake)) => self.events.recv_timeout(wake.saturating_duration_since(now)),
            (None, None) => self.events.recv().map_err(RecvTimeoutError::from),
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
            next = self.postponed.pop_front().or_else(|| self.events.try_recv().ok());
        }
        None
    }

    fn handle(&mut self, event: Event) -> Option<End> {
        match event {
            Event::Worker(protocol::Event::Preview { generation }) => return self.preview(generation),
            Event::Answer(answer) => {
                self.display.answered(answer, Instant::now());
                return self.apply(event);
            }
            Event::Written { bytes } => self.display.written(bytes),
            Event::Unwritable(kind) => return Some(unwritable(kind.into())),
            Event::Key(_) | Event::Mouse(_) => {
                let end = self.apply(event);
                // A step of the camera is drawn with its picture, which comes at once and has need of the processor.
                self.state.urgent |= self.state.dirty && !self.state.awaits_step();
                return end;
            }
            event => return self.apply(event),
        }
        None
    }

    /// There is a newer picture. Until it is worth its bytes it stays in the slot, where a still newer one takes its place:
    /// the line carries whole pictures, and never a queue of them.
    fn preview(&mut self, generation: u64) -> Option<End> {
        if generation == self.drawn.generation && !self.is_resized() && self.advice() == Advice::Wait {
            self.drawn.is_old = true;
            return None;
        }
        self.take_preview()
    }

    /// Whether the newest picture has another size than the one that is drawn, or is of another part.
    fn is_resized(&self) -> bool {
        let latest = self.previews.lock().unwrap_or_else(PoisonError::into_inner);
        let what = |picture: &Picture, section| (picture.width, picture.height, section);
        let both = latest.as_ref().zip(self.state.picture.as_ref());
        both.is_some_and(|(new, old)| what(&new.picture, new.section) != what(&old.picture, old.section))
    }

    /// What to do with a picture of the same request as the one that is drawn.
    fn advice(&self) -> Advice {
        let now = Instant::now();
        let progress = self.state.progress.as_ref();
        let picture = self.drawn.picture.as_ref();
        advise(&Moment {
            bytes_per_second: self.display.bytes_per_second(),
            cells: picture.map_or(0, |picture| self.cells(picture)),
            samples: self.samples(),
            aimed_samples: picture.map(|_| self.drawn.samples),
            since_aim: self.drawn.at.map_or(Duration::MAX, |at| now.saturating_duration_since(at)),
            is_shown: self.display.is_complete(),
            is_final: self.is_still(),
            final_in: progress
                .and_then(|progress| progress.eta_seconds)
                .and_then(|seconds| Duration::try_from_secs_f64(seconds).ok()),
        })
    }

    /// Cells that a picture takes, or that would take as many bytes.
    fn cells(&self, picture: &Picture) -> u32 {
        if self.display.draws_pixels() {
            return picture.width * picture.height / 4;
        }
        let across = self.state.pixels_across();
        let pixels = (across * across) as f32 * self.state.window.cell_aspect;
        (f64::from(picture.width) * f64::from(picture.height) / f64::from(pixels)) as u32
    }

    /// Samples that a pixel has by now, in the mean.
    fn samples(&self) -> f64 {
        self.state
            .progress
            .as_ref()
            .map_or(0.0, |progress| progress.fraction * f64::from(progress.total_samples))
    }

    /// Whether the newest picture stays as it is.
    fn is_still(&self) -> bool {
        self.state.paused || !self.state.is_running() && view::under::goes_on(&self.state).is_none()
    }

    fn take_preview(&mut self) -> Option<End> {
        self.drawn.is_old = false;
        let latest = self.previews.lock().unwrap_or_else(PoisonError::into_inner).take()?;
        let LatestPreview { generation, picture, range, section } = latest;
        self.apply(Event::Picture { generation, picture, range, section })
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
                self.leave();
                self.screen.suspend();
                // Stopped here; SIGCONT then asks for a redraw.
                signals::stop();
            }
            Effect::Suspend => {}
            Effect::Mouse(is_on) => self.screen.set_mouse(is_on),
            Effect::Edit(place) => return self.edit(&place),
            Effect::Redraw => return self.redraw(),
            Effect::Measure => {
                // It may have shrunk and grown again, and cut what was shown.
                self.display.forget();
                return self.measure();
            }
        }
        None
    }

    /// The terminal is the editor's until it ends.
    fn edit(&mut self, place: &FilePlace) -> Option<End> {
        self.leave();
        input::hold(true);
        self.screen.suspend();
        // Until keys come raw again they send signals.
        let keys_of_child = signals::leave_keys_to_child();
        terminal::lend();
        let outcome = editor::run(&editor::name(|name| std::env::var(name).ok()), place);
        terminal::take_back();
        input::hold(false);
        let end = self.apply(Event::Back).or_else(|| self.redraw());
        drop(keys_of_child);
        end.or_else(|| outcome.err().and_then(|why| self.apply(Event::NoEditor(why))))
    }

    fn redraw(&mut self) -> Option<End> {
        if let Err(error) = self.screen.resume() {
            return Some(unwritable(error));
        }
        self.display.restart(Instant::now());
        self.measure()
    }

    fn measure(&mut self) -> Option<End> {
        self.apply(Event::Resize(terminal::window(self.cell_aspect)))
    }

    /// Aims the screen at the state as it is now.
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
        let window = self.state.window;
        let mut buffer = Buffer::empty(Rect::new(0, 0, window.columns, window.rows));
        view::draw(&self.state, &mut buffer);
        let is_new = self.note_picture();
        // It is all there, and no better one has come since.
        self.drawn.is_first &= is_new || !self.display.is_complete();
        let area = Layout::of(&self.state).preview;
        self.display.place(view::preview::placement(&self.state, area), self.is_still());
        self.display.aim(&buffer, area, self.fidelity(), is_new);
        None
    }

    /// Keeps which picture is drawn; whether it is another one than before.
    fn note_picture(&mut self) -> bool {
        let Some(shown) = &self.state.picture else { return false };
        if self.drawn.picture.as_ref().is_some_and(|drawn| Arc::ptr_eq(drawn, &shown.picture)) {
            return false;
        }
        let is_first = self.drawn.generation != shown.generation;
        let (picture, samples, at) = (Some(shown.picture.clone()), self.samples(), Some(Instant::now()));
        let generation = shown.generation;
        self.drawn = Drawn { picture, generation, samples, at, is_first, ..Drawn::default() };
        true
    }

    fn fidelity(&self) -> Fidelity {
        match () {
            () if self.is_still() => Fidelity::Still,
            () if self.drawn.is_first => Fidelity::First,
            () => Fidelity::Moving,
        }
    }

    /// Sends what the line has room for.
    fn pump(&mut self) -> Option<End> {
        if !self.screen.is_taken() {
            return None;
        }
        let has_sent = self.display.pump(Instant::now());
        if let Some(report) = self.display.take_report() {
            let end = self.apply(Event::Frame(report));
            if end.is_some() {
                return end;
            }
        }
        if self.drawn.is_old && self.advice() != Advice::Wait {
            let end = self.take_preview();
            if end.is_some() {
                return end;
            }
        }
        if self.drawn.picture.is_none() || !has_sent || std::mem::replace(&mut self.drawn.is_shown, true) {
            return None;
        }
        self.apply(Event::Shown { generation: self.drawn.generation })
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
#[path = "run_tests.rs"]
mod tests;
