//! Window title, progress bar, desktop notifications and clipboard.
//!
//! All of these are sent after the preview, and only to terminals known to support them (see `terminals`).

use std::time::Duration;

use super::graphics::base64;
use super::state::{RequestStatus, State};
use super::terminals::NotificationProtocol;
use super::view;
use crate::scene::sanitize::escape_invisible_chars;

/// How long a render must run before the title and progress bar show it. This delay prevents flicker while
/// the camera moves.
const MIN_RENDER_TIME: Duration = Duration::from_millis(500);
/// Percentage step on slow connections.
const SLOW_PERCENT_STEP: u32 = 10;

/// Escape sequence that saves the window title for [`TITLE_BACK`].
pub(super) const KEEP_TITLE: &[u8] = b"\x1b[22;2t";
/// Escape sequence that restores the saved window title, or the default title if none was saved.
pub(super) const TITLE_BACK: &[u8] = b"\x1b]2;\x1b\\\x1b[23;2t";
/// Escape sequence that removes the progress bar.
pub(super) const PROGRESS_OFF: &[u8] = b"\x1b]9;4;0;0\x1b\\";

/// State of the progress bar.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum TaskbarProgress {
    #[default]
    None,
    /// A render is running with unknown progress.
    Busy,
    Percent(u32),
    Paused(u32),
    Broken,
}

impl TaskbarProgress {
    fn to_escape_sequence(self) -> Vec<u8> {
        let bar = |state: u8, percent: u32| format!("\x1b]9;4;{state};{percent}\x1b\\").into_bytes();
        match self {
            Self::None => PROGRESS_OFF.to_vec(),
            Self::Percent(percent) => bar(1, percent),
            Self::Broken => bar(2, 100),
            Self::Busy => bar(3, 0),
            Self::Paused(percent) => bar(4, percent),
        }
    }
}

/// Window title and progress bar, if supported by the terminal.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct TitleAndProgress {
    pub(super) title: Option<String>,
    pub(super) bar: Option<TaskbarProgress>,
}

impl TitleAndProgress {
    /// Determines the title and progress bar for the state. If `is_slow`, the percentage changes in larger
    /// steps. Returns `None` if they should stay unchanged for now.
    pub(super) fn for_state(state: &State, is_slow: bool) -> Option<Self> {
        let capabilities = state.display.capabilities;
        if state.work.running_time(state.now).is_some_and(|time| time < MIN_RENDER_TIME) && !state.work.paused
        {
            return None;
        }
        let progress = state.work.progress.as_ref().filter(|_| state.work.is_request_running());
        let step = if is_slow { SLOW_PERCENT_STEP } else { 1 };
        let percent = progress.map(|progress| view::text::floor_percent(progress.fraction) / step * step);
        Some(Self {
            title: capabilities.title.then(|| title_text(state, percent)),
            bar: capabilities.progress.then(|| progress_bar_state(state, percent)),
        })
    }

    /// Returns the bytes that change the title and progress bar from `self` to `to`.
    pub(super) fn escape_sequence_to_change_to(&self, to: &Self) -> Vec<u8> {
        let mut bytes = Vec::new();
        if let Some(title) = to.title.as_ref().filter(|_| self.title != to.title) {
            bytes.extend_from_slice(format!("\x1b]2;{}\x1b\\", escape_invisible_chars(title)).as_bytes());
        }
        if let Some(bar) = to.bar.filter(|_| self.bar.unwrap_or_default() != to.bar.unwrap_or_default()) {
            bytes.extend(bar.to_escape_sequence());
        }
        bytes
    }
}

/// The window title, such as `cornell.toml: rendering 38 % · glimt`.
fn title_text(state: &State, percent: Option<u32>) -> String {
    let word = view::worker_activity_word(state);
    let percent = percent.map_or(String::new(), |percent| format!(" {percent} %"));
    format!("{}: {word}{percent} · glimt", scene_file_name(state))
}

/// The scene's file name.
fn scene_file_name(state: &State) -> String {
    let name = state.request.scene.file_name().unwrap_or(state.request.scene.as_os_str());
    escape_invisible_chars(&name.to_string_lossy()).into_owned()
}

fn progress_bar_state(state: &State, percent: Option<u32>) -> TaskbarProgress {
    match state.work.activity {
        RequestStatus::Running { .. } if state.work.paused => TaskbarProgress::Paused(percent.unwrap_or(0)),
        RequestStatus::Running { .. } => percent.map_or(TaskbarProgress::Busy, TaskbarProgress::Percent),
        RequestStatus::Broken => TaskbarProgress::Broken,
        RequestStatus::Done | RequestStatus::Waiting | RequestStatus::Canceled => TaskbarProgress::None,
    }
}

/// Escape sequence for a desktop notification about a render that ended after `time`.
pub(super) fn notification_bytes(state: &State, notice: NotificationProtocol, time: Duration) -> Vec<u8> {
    let words = format!(
        "{}: {} after {}",
        scene_file_name(state),
        view::worker_activity_word(state),
        view::text::format_duration(time)
    );
    match notice {
        NotificationProtocol::Osc9 => format!("\x1b]9;glimt: {words}\x1b\\").into_bytes(),
        NotificationProtocol::Osc99 => format!("\x1b]99;;glimt: {words}\x1b\\").into_bytes(),
        NotificationProtocol::Osc777 => format!("\x1b]777;notify;glimt;{words}\x1b\\").into_bytes(),
        NotificationProtocol::Bell => b"\x07".to_vec(),
    }
}

/// Escape sequence that copies text to the clipboard.
pub(super) fn clipboard_bytes(text: &str) -> Vec<u8> {
    [b"\x1b]52;c;", &*base64::encode_base64(text.as_bytes()), b"\x1b\\"].concat()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{TestUi, render_progress};
    use crate::pipeline::protocol::Event;
    use crate::terminals::{TerminalBrand, TerminalExtras, TerminalId};

    fn ui() -> TestUi {
        let mut ui = TestUi::new();
        ui.state.display.capabilities =
            TerminalId { brand: TerminalBrand::Ghostty, version: [1, 2] }.terminal_extras();
        ui
    }

    fn sent(before: &mut TitleAndProgress, ui: &TestUi, is_slow: bool) -> String {
        let now = TitleAndProgress::for_state(&ui.state, is_slow).unwrap_or_else(|| before.clone());
        let bytes = before.escape_sequence_to_change_to(&now);
        *before = now;
        String::from_utf8(bytes).expect("UTF-8")
    }

    #[test]
    fn title_and_progress_bar_show_the_render() {
        let (mut ui, mut shown_title) = (ui(), TitleAndProgress::default());
        assert_eq!(sent(&mut shown_title, &ui, false), "", "short renders should not be shown");
        ui.advance_clock(600);
        let busy = "\x1b]2;cornell.toml: rendering · glimt\x1b\\\x1b]9;4;3;0\x1b\\";
        assert_eq!(sent(&mut shown_title, &ui, false), busy);
        ui.worker_event(Event::Progress { generation: 1, progress: render_progress(0.389, None) });
        let part = "\x1b]2;cornell.toml: rendering 38 % · glimt\x1b\\\x1b]9;4;1;38\x1b\\";
        assert_eq!(sent(&mut shown_title, &ui, false), part);
        let coarse = "\x1b]2;cornell.toml: rendering 30 % · glimt\x1b\\\x1b]9;4;1;30\x1b\\";
        assert_eq!(sent(&mut shown_title, &ui, true), coarse);
        ui.press_character(' ');
        let held = "\x1b]2;cornell.toml: paused 30 % · glimt\x1b\\\x1b]9;4;4;30\x1b\\";
        assert_eq!(sent(&mut shown_title, &ui, true), held);
        ui.press_character(' ');
        ui.finish_render([200, 30, 30]);
        let done = "\x1b]2;cornell.toml: done · glimt\x1b\\\x1b]9;4;0;0\x1b\\";
        assert_eq!(sent(&mut shown_title, &ui, false), done);
        assert_eq!(sent(&mut shown_title, &ui, false), "", "unchanged state should send no bytes");
        ui.report_scene_errors(Vec::new());
        ui.handle_event(crate::event::Event::Settled);
        assert!(sent(&mut shown_title, &ui, false).contains("\x1b]9;4;2;100\x1b\\"));
    }

    #[test]
    fn unsupported_terminals_get_no_title() {
        let (mut ui, mut shown_title) = (TestUi::new(), TitleAndProgress::default());
        assert_eq!(ui.state.display.capabilities, TerminalExtras::default());
        ui.finish_render([200, 30, 30]);
        assert_eq!(sent(&mut shown_title, &ui, false), "");
    }

    #[test]
    fn control_characters_in_file_names_are_escaped() {
        let mut ui = ui();
        ui.state.request.scene = "a\x1b\\\x07b.toml".into();
        ui.finish_render([200, 30, 30]);
        let title = sent(&mut TitleAndProgress::default(), &ui, false);
        assert_eq!(title, "\x1b]2;a␛\\␇b.toml: done · glimt\x1b\\");
        let bytes = notification_bytes(&ui.state, NotificationProtocol::Osc777, Duration::from_secs(95));
        let words = String::from_utf8(bytes).expect("UTF-8");
        assert_eq!(words, "\x1b]777;notify;glimt;a␛\\␇b.toml: done after 1 min 35 s\x1b\\");
        assert_eq!(clipboard_bytes("a b"), b"\x1b]52;c;YSBi\x1b\\");
    }
}
