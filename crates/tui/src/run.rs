//! The event loop, which owns the terminal and performs all side effects.

use std::collections::VecDeque;
use std::io;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

use super::color::{self, ColorDepth};
use super::display::{Display, TerminalEnvironment};
use super::editor;
use super::environment::{select_terminal_queries, terminal_environment_from_variables};
use super::event::FileLineColumn;
use super::event::{Effect, Event};
use super::event_queue::EventQueue;
use super::exit_summary;
use super::input;
use super::options::{ExitStatus, TuiError, TuiOptions, TuiOutcome};
use super::presenter::FramePresenter;
use super::preview_style::PreviewStyle;
use super::signals::{self, SignalListener};
use super::state::{InitialState, State};
use super::terminal::{self, TerminalSession};
use super::terminals::TerminalId;
use super::update::{request_first_render, update};
use super::writer;
use crate::pipeline::protocol::{self, Command};

/// Maximum time to plan a slice before sending it and handling keys.
const MAX_PLANNING_TIME: Duration = Duration::from_millis(3);

/// Runs the front end until a key or signal ends it, then restores the terminal and sends [`Command::Quit`]
/// to the worker. `queue` receives the events of the worker and the file watcher. Must not be called more
/// than once per process.
///
/// # Errors
/// Returns a [`TuiError`] if there is no terminal, if writing to it fails, or if the worker has ended.
pub fn run(options: TuiOptions, queue: EventQueue) -> Result<TuiOutcome, TuiError> {
    terminal::require_terminal()?;
    let depth = color::resolve_color_depth(options.color, |name| std::env::var(name).ok());
    // Prevent crossterm from dropping named colors when NO_COLOR is set.
    crossterm::style::force_color_output(depth != ColorDepth::None);

    let EventQueue { sender, events } = queue;
    let listener = SignalListener::start(&sender).map_err(io_error_to_tui_error("handle signals for"))?;
    let variable = |name: &str| std::env::var(name).ok();
    let capabilities =
        TerminalId::from_environment(variable).map(TerminalId::terminal_extras).unwrap_or_default();
    if capabilities.focus {
        terminal::enable_focus_reports_on_setup();
    }
    let screen = TerminalSession::open()?;
    let link = TerminalEnvironment {
        ask: select_terminal_queries(options.preview, options.color, depth, variable),
        ..terminal_environment_from_variables(variable)
    };
    let setup = InitialState {
        scene: options.scene,
        overrides: options.overrides,
        window: terminal::query_window_size(options.cell_aspect),
        preview: PreviewStyle::initial(options.preview, depth, link.ask.pixels),
        depth,
        is_light: color::colorfgbg_indicates_light_background(variable),
        ansi: *color::assumed_ansi_colors(&variable("TERM").unwrap_or_default()),
        ask: link.ask,
        capabilities,
        notify_after: options.notify_after,
    };
    input::start_reader(&sender).map_err(io_error_to_tui_error("read keys from"))?;
    writer::start_writer(&sender).map_err(io_error_to_tui_error("write to"))?;

    let now = Instant::now();
    let display = Display::new(depth, link, None, Box::new(writer::queue_slice), now);
    let ui = EventLoop {
        screen,
        presenter: FramePresenter::new(display, options.previews, now),
        events,
        postponed: VecDeque::new(),
        state: State::new(setup, now),
        commands: options.commands,
        cell_aspect: options.cell_aspect,
    };
    let outcome = ui.run_and_shut_down();
    drop(listener);
    outcome
}

fn io_error_to_tui_error(action: &'static str) -> impl Fn(io::Error) -> TuiError {
    move |source| TuiError::Terminal { action, source }
}

struct EventLoop {
    screen: TerminalSession,
    presenter: FramePresenter,
    events: Receiver<Event>,
    /// Events that arrived while waiting for replies.
    postponed: VecDeque<Event>,
    state: State,
    commands: Box<dyn FnMut(Command)>,
    cell_aspect: Option<f32>,
}

/// Why the event loop ended.
enum LoopEnd {
    Quit(ExitStatus),
    Error(TuiError),
}

impl EventLoop {
    fn run_and_shut_down(mut self) -> Result<TuiOutcome, TuiError> {
        let effects = request_first_render(&mut self.state);
        let mut end = self.perform_effects(effects);
        while end.is_none() {
            end = self.draw_and_send().or_else(|| self.wait_and_handle_events());
        }
        // Keep the checkpoint if a signal arrived, or if the terminal was closed or failed.
        if !matches!(&end, Some(LoopEnd::Quit(ExitStatus::QUIT))) {
            (self.commands)(Command::Suspend);
        }
        (self.commands)(Command::Quit);
        let status = match end {
            // If the user sent SIGHUP, the terminal still exists and must be restored.
            Some(LoopEnd::Quit(ExitStatus::HANGUP)) => {
                if !terminal::terminal_exists() {
                    self.screen.abandon();
                }
                ExitStatus::HANGUP
            }
            Some(LoopEnd::Error(error)) => return Err(error),
            Some(LoopEnd::Quit(status)) => {
                self.leave_screen_and_await_replies();
                status
            }
            None => ExitStatus::QUIT,
        };
        let saving = &self.state.saving;
        Ok(TuiOutcome {
            status,
            is_write_unanswered: saving.is_write_requested,
            summary: exit_summary::summary_text(&self.state),
            is_current: exit_summary::is_saved_scene_image_current(&self.state),
            write_results: saving.write_results,
            has_written: !saving.written.is_empty(),
            is_unwritten: saving.write_failed.is_some(),
            not_kept: exit_summary::unsaved_changes_as_options(&self.state),
        })
    }

    /// Leaves the screen and waits briefly for pending replies, which the shell would otherwise read as typed
    /// text.
    fn leave_screen_and_await_replies(&mut self) {
        self.screen.leave_screen_in_raw_mode();
        let deadline =
            self.presenter.display.reply_wait_before_exit().map(|patience| Instant::now() + patience);
        while let Some(deadline) =
            deadline.filter(|_| self.presenter.display.reply_wait_before_exit().is_some())
        {
            match self.events.recv_timeout(deadline.saturating_duration_since(Instant::now())) {
                Ok(Event::TerminalReply(answer)) => {
                    self.presenter.display.handle_reply(answer, Instant::now());
                }
                Ok(event) => self.postponed.push_back(event),
                Err(_) => return,
            }
        }
    }

    /// Waits for events and handles all that have arrived.
    fn wait_and_handle_events(&mut self) -> Option<LoopEnd> {
        let now = Instant::now();
        let wake = self.presenter.next_action_time(&self.state, now);
        let first = match (self.postponed.pop_front(), wake) {
            (Some(event), _) => Ok(event),
            (None, Some(wake)) => self.events.recv_timeout(wake.saturating_duration_since(now)),
            (None, None) => self.events.recv().map_err(RecvTimeoutError::from),
        };
        let first = match first {
            Ok(event) => event,
            Err(RecvTimeoutError::Timeout) => Event::Tick,
            Err(RecvTimeoutError::Disconnected) => return Some(LoopEnd::Quit(ExitStatus::HANGUP)),
        };
        let mut next = Some(first);
        while let Some(event) = next {
            if let Some(end) = self.handle_event(event) {
                return Some(end);
            }
            next = self.postponed.pop_front().or_else(|| self.events.try_recv().ok());
        }
        None
    }

    fn handle_event(&mut self, event: Event) -> Option<LoopEnd> {
        match event {
            Event::Worker(protocol::Event::Preview { generation }) => {
                let taken = self.presenter.take_preview_event_if_due(generation, &self.state, Instant::now());
                return taken.and_then(|picture| self.apply_event(picture));
            }
            Event::TerminalReply(answer) => {
                self.presenter.display.handle_reply(answer, Instant::now());
                return self.apply_event(event);
            }
            Event::Written { bytes } => self.presenter.display.record_accepted_bytes(bytes),
            Event::Unwritable(kind) => return Some(loop_end_for_write_error(kind.into())),
            Event::Key(_) | Event::Mouse(_) => {
                let end = self.apply_event(event);
                // A camera step is drawn together with its first preview, which arrives immediately and needs
                // the CPU.
                self.state.urgent |= self.state.dirty && !self.state.awaits_camera_step_preview();
                return end;
            }
            event => return self.apply_event(event),
        }
        None
    }

    fn apply_event(&mut self, event: Event) -> Option<LoopEnd> {
        let effects = update(&mut self.state, event, Instant::now());
        self.perform_effects(effects)
    }

    fn perform_effects(&mut self, effects: Vec<Effect>) -> Option<LoopEnd> {
        effects.into_iter().find_map(|effect| self.perform_effect(effect))
    }

    fn perform_effect(&mut self, effect: Effect) -> Option<LoopEnd> {
        match effect {
            Effect::Send(command) => (self.commands)(command),
            Effect::Quit(status) => return Some(LoopEnd::Quit(status)),
            Effect::GiveUp => {
                return Some(LoopEnd::Error(TuiError::WorkerGone { reason: terminal::last_panic_message() }));
            }
            Effect::StopJob if !signals::can_shell_resume_process() => {
                return self.apply_event(Event::SuspendFailed);
            }
            Effect::StopJob => {
                return signals::suspend_job()
                    .err()
                    .map(io_error_to_tui_error("stop the job of"))
                    .map(LoopEnd::Error);
            }
            Effect::Suspend if signals::can_shell_resume_process() => {
                self.leave_screen_and_await_replies();
                self.screen.restore_terminal_temporarily();
                // The process stops here. After it continues, SIGCONT requests a redraw.
                signals::suspend_process();
            }
            Effect::Suspend => {}
            Effect::Mouse(is_on) => self.screen.set_mouse_reporting(is_on),
            Effect::Edit(place) => return self.run_editor(&place),
            Effect::Aside(bytes) => self.presenter.display.queue_after_preview(bytes),
            Effect::ReportFocus => self.screen.request_focus_reports(),
            Effect::Redraw => return self.resume_and_redraw(),
            Effect::Measure => {
                // The window may have shrunk and grown back, which cuts off its content.
                self.presenter.display.invalidate();
                return self.update_window_size();
            }
        }
        None
    }

    /// Lets the editor use the terminal until it exits.
    fn run_editor(&mut self, place: &FileLineColumn) -> Option<LoopEnd> {
        self.leave_screen_and_await_replies();
        input::set_input_paused(true);
        self.screen.restore_terminal_temporarily();
        // Outside raw mode, keys send signals.
        let child_signals = signals::leave_signals_to_child();
        terminal::save_terminal_modes();
        let outcome = editor::run(&editor::editor_from_environment(|name| std::env::var(name).ok()), place);
        terminal::restore_saved_terminal_modes();
        input::set_input_paused(false);
        let end = self.apply_event(Event::EditorExited).or_else(|| self.resume_and_redraw());
        drop(child_signals);
        end.or_else(|| outcome.err().and_then(|why| self.apply_event(Event::EditorFailed(why))))
    }

    fn resume_and_redraw(&mut self) -> Option<LoopEnd> {
        if let Err(error) = self.screen.resume() {
            return Some(loop_end_for_write_error(error));
        }
        self.presenter.display.restart(Instant::now());
        self.update_window_size()
    }

    fn update_window_size(&mut self) -> Option<LoopEnd> {
        self.apply_event(Event::Resize(terminal::query_window_size(self.cell_aspect)))
    }

    /// Draws a frame if one is due and sends as much as the connection allows.
    fn draw_and_send(&mut self) -> Option<LoopEnd> {
        if !self.screen.is_screen_active() {
            self.presenter.postpone_next_frame(&mut self.state, Instant::now());
            return None;
        }
        self.presenter.draw_if_due(&mut self.state, Instant::now());
        let begin = Instant::now();
        let events = self.presenter.send_pending(&self.state, begin, || begin.elapsed() >= MAX_PLANNING_TIME);
        events.into_iter().find_map(|event| self.apply_event(event))
    }
}

/// How the event loop ends after a write error. If the terminal no longer exists, this is a hangup, even if
/// SIGHUP has not arrived.
fn loop_end_for_write_error(error: io::Error) -> LoopEnd {
    if terminal::terminal_exists() {
        LoopEnd::Error(TuiError::Terminal { action: "write to", source: error })
    } else {
        LoopEnd::Quit(ExitStatus::HANGUP)
    }
}
