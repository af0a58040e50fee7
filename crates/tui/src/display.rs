//! Sends the target screen to the terminal in slices, as bandwidth permits.

use std::time::{Duration, Instant};

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;

use super::color::ColorDepth;
use super::connection::{QueryKind, TerminalFlowControl};
use super::event::PreviewSendReport;
use super::graphics::{PlacedImage, TerminalImages};
use super::paint::{LinksAndDelayedText, Painter, PreviewFidelity};
use super::preview_style::PreviewStyle;
use super::terminal;
use super::terminal_replies::TerminalQueries;
use super::terminal_replies::TerminalReply;
use super::window_title::TitleAndProgress;

/// Query for synchronized output (mode 2026).
pub(super) const SYNCHRONIZED: &[u8] = b"\x1b[?2026$p";
/// Query for the primary device attributes (DA1), sent last in the first batch.
pub(super) const ATTRIBUTES: &[u8] = b"\x1b[c";
/// Request for a status report (DSR).
pub(super) const STATUS: &[u8] = b"\x1b[5n";
const BEGIN_SYNCHRONIZED: &[u8] = b"\x1b[?2026h";
const END_SYNCHRONIZED: &[u8] = b"\x1b[?2026l";
/// Minimum size of a slice that needs synchronized output, in bytes. Smaller slices do not flicker.
const MIN_SYNCHRONIZED_BYTES: usize = 2_000;

/// Properties of the terminal and its connection, as detected from environment variables.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct TerminalEnvironment {
    /// Whether glimt is running inside tmux or screen, which reply to queries themselves and delay drawing.
    pub(super) is_multiplexed: bool,
    /// Whether glimt is running inside tmux.
    pub(super) is_in_tmux: bool,
    /// Whether the terminal is reached over a network.
    pub(super) is_remote: bool,
    /// Whether the terminal supports REP (repeat character).
    pub(super) can_repeat: bool,
    /// Queries to send to the terminal.
    pub(super) ask: TerminalQueries,
}

impl TerminalEnvironment {
    /// Creates a connection whose speed is unknown. A local multiplexer's replies do not reflect the network
    /// behind it.
    fn new_flow_control(self, now: Instant) -> TerminalFlowControl {
        TerminalFlowControl::new(self.is_multiplexed && self.is_remote, now)
    }
}

/// Passes output to the terminal without blocking.
pub(super) type TerminalOutputCallback = Box<dyn FnMut(Vec<u8>)>;

/// The event loop's interface to the terminal's screen.
pub(super) struct Display {
    painter: Painter,
    /// The preview, if it is drawn as pixels.
    images: Option<TerminalImages>,
    connection: TerminalFlowControl,
    link: TerminalEnvironment,
    /// Writer that sends bytes to the terminal.
    out: TerminalOutputCallback,
    /// Whether the terminal supports synchronized output (mode 2026).
    is_synchronized: bool,
    /// Whether the target has been sent completely.
    is_complete: bool,
    /// The current window title and the one sent last.
    window_titles: [TitleAndProgress; 2],
    /// Notifications and clipboard text to send.
    asides: Vec<u8>,
    /// Bytes sent since the newest preview's render began.
    sent: usize,
    /// Whether a preview is being sent.
    is_preview_due: bool,
    /// Bytes and round-trip time for sending the last preview.
    report: Option<PreviewSendReport>,
    /// Whether the last preview's report has been returned.
    is_reported: bool,
}

impl Display {
    /// Creates a display whose content is unknown.
    pub(super) fn new(
        depth: ColorDepth,
        link: TerminalEnvironment,
        images: Option<TerminalImages>,
        out: TerminalOutputCallback,
        now: Instant,
    ) -> Self {
        let mut display = Self {
            painter: Painter::new(depth).with_repeat_support(link.can_repeat),
            images,
            connection: link.new_flow_control(now),
            link,
            out,
            is_synchronized: false,
            is_complete: true,
            window_titles: Default::default(),
            asides: Vec::new(),
            sent: 0,
            is_preview_due: false,
            report: None,
            is_reported: true,
        };
        display.restart(now);
        display
    }

    /// Resets the screen and connection after another program has used the terminal.
    pub(super) fn restart(&mut self, now: Instant) {
        self.invalidate();
        self.window_titles[1] = TitleAndProgress::default();
        self.connection = self.link.new_flow_control(now);
        let questions = [SYNCHRONIZED, &self.link.ask.requested_query_bytes(), ATTRIBUTES].concat();
        self.send(questions, Some(QueryKind::Attributes), now);
    }

    /// Marks the screen content as unknown.
    pub(super) fn invalidate(&mut self) {
        self.painter.invalidate();
        if let Some(images) = &mut self.images {
            images.invalidate();
        }
        self.is_complete = false;
    }

    /// Switches to drawing the preview as pixels if `kind` requires it.
    pub(super) fn enable_pixel_preview_if_required(&mut self, kind: PreviewStyle) {
        if let (PreviewStyle::Pixels(protocol), None) = (kind, &self.images) {
            terminal::mark_images_used();
            self.images = Some(TerminalImages::new(protocol, self.link.is_in_tmux));
        }
    }

    /// Whether the preview is drawn as pixels.
    pub(super) fn draws_pixels(&self) -> bool {
        self.images.is_some()
    }

    /// Sets the preview that is drawn as pixels. Pass `None` if the preview is drawn as cells.
    pub(super) fn set_pixel_preview(&mut self, wanted: Option<PlacedImage>, is_still: bool) {
        if let Some(uncovered) = self.images.as_mut().and_then(|images| images.set_target(wanted, is_still)) {
            self.painter.damage(uncovered);
        }
    }

    /// Sets a new target. `is_new` means that it contains a new preview.
    pub(super) fn set_target(
        &mut self,
        wanted: &Buffer,
        picture: Rect,
        fidelity: PreviewFidelity,
        is_new: bool,
        extras: &LinksAndDelayedText,
    ) {
        if !extras.links.is_empty() {
            terminal::mark_links_used();
        }
        self.painter.set_target_with_links(wanted, picture, fidelity, extras);
        self.is_complete = false;
        self.is_preview_due |= is_new;
    }

    /// Starts counting bytes for a new render.
    pub(super) fn reset_byte_count(&mut self) {
        self.sent = 0;
    }

    /// Sets the window title, which is sent after the preview.
    pub(super) fn set_title_and_progress(&mut self, title: TitleAndProgress) {
        self.window_titles[0] = title;
    }

    /// Queues bytes to send after the preview.
    pub(super) fn queue_after_preview(&mut self, bytes: Vec<u8>) {
        self.asides.extend(bytes);
    }

    /// Whether anything is queued to be sent after the preview.
    fn has_bytes_queued_after_preview(&self) -> bool {
        !self.asides.is_empty() || self.window_titles[0] != self.window_titles[1]
    }

    /// Sends everything queued to be sent after the preview.
    fn flush_deferred_output(&mut self, now: Instant) {
        let [wanted, sent] = &self.window_titles;
        let mut bytes = Vec::new();
        if wanted.title != sent.title {
            bytes.extend_from_slice(terminal::take_title_save_sequence());
        }
        if wanted.bar.is_some() {
            terminal::mark_progress_bar_used();
        }
        bytes.extend(sent.escape_sequence_to_change_to(wanted));
        bytes.append(&mut self.asides);
        self.window_titles[1] = self.window_titles[0].clone();
        if !bytes.is_empty() {
            self.send_slice_with_query(bytes, now);
        }
    }

    /// Sends one slice, ending it early if `is_late` returns true. Returns whether part of the target was
    /// sent.
    pub(super) fn send_next_slice(&mut self, now: Instant, is_late: impl Fn() -> bool) -> bool {
        let is_idle = self.is_complete && !self.has_bytes_queued_after_preview();
        let room = if is_idle { 0 } else { self.connection.max_sendable_bytes(now) };
        if room == 0 {
            return false;
        }
        if self.is_complete {
            self.flush_deferred_output(now);
            return false;
        }
        let room = room.saturating_sub(BEGIN_SYNCHRONIZED.len() + END_SYNCHRONIZED.len());
        let cells = self.painter.next_slice_before_deadline(room, is_late);
        if !cells.is_empty() {
            self.send_slice_with_query(self.wrap_synchronized(cells), now);
            return true;
        }
        // Do not use synchronized output for images: kitty 0.26 loses chunks inside it. It is not needed,
        // because an image appears only once its last chunk has arrived.
        let rate = self.connection.estimated_bytes_per_second();
        let pixels = self.images.as_mut().and_then(|images| images.next_slice(room, rate));
        match pixels {
            Some(pixels) => self.send_slice_with_query(pixels, now),
            None => self.mark_target_complete(),
        }
        !self.is_complete
    }

    /// Wraps a slice in synchronized output if it is large enough to flicker and the terminal supports it.
    fn wrap_synchronized(&self, mut cells: Vec<u8>) -> Vec<u8> {
        if self.is_synchronized && !self.link.is_multiplexed && cells.len() >= MIN_SYNCHRONIZED_BYTES {
            cells.splice(0..0, BEGIN_SYNCHRONIZED.iter().copied());
            cells.extend_from_slice(END_SYNCHRONIZED);
        }
        cells
    }

    fn mark_target_complete(&mut self) {
        self.is_complete = true;
        if std::mem::take(&mut self.is_preview_due) {
            self.report = Some(PreviewSendReport {
                bytes: self.sent,
                round_trip: self.connection.min_round_trip_time(),
            });
            self.is_reported = false;
        }
    }

    fn send_slice_with_query(&mut self, mut slice: Vec<u8>, now: Instant) {
        let question = self.connection.next_query();
        if question.is_some() {
            slice.extend_from_slice(STATUS);
        }
        self.sent += slice.len();
        self.send(slice, question, now);
    }

    fn send(&mut self, bytes: Vec<u8>, question: Option<QueryKind>, now: Instant) {
        self.connection.record_sent(bytes.len(), question, now);
        (self.out)(bytes);
    }

    /// Handles a terminal reply.
    pub(super) fn handle_reply(&mut self, answer: TerminalReply, now: Instant) {
        match answer {
            TerminalReply::Ready => self.connection.handle_reply(QueryKind::Status, now),
            TerminalReply::Attributes => self.connection.handle_reply(QueryKind::Attributes, now),
            TerminalReply::Synchronized { is_known } => self.is_synchronized = is_known,
            TerminalReply::Name(_)
            | TerminalReply::Focus { .. }
            | TerminalReply::TrueColor
            | TerminalReply::Background(_)
            | TerminalReply::Ink { .. }
            | TerminalReply::Images(_)
            | TerminalReply::Other => {}
        }
    }

    /// Records that the operating system has accepted bytes.
    pub(super) fn record_accepted_bytes(&mut self, bytes: usize) {
        self.connection.record_accepted_bytes(bytes);
    }

    /// Whether the target has been sent completely.
    pub(super) fn is_target_sent(&self) -> bool {
        self.is_complete
    }

    /// Whether the terminal is fast enough to follow the render.
    pub(super) fn is_fast(&self) -> bool {
        self.connection.is_fast()
    }

    /// Whether the terminal has acknowledged the complete target.
    pub(super) fn is_acknowledged(&self) -> bool {
        self.is_complete && !self.connection.awaits_reply()
    }

    /// Estimated bandwidth in bytes per second, or `None` if it is unknown or too high to matter.
    pub(super) fn estimated_bytes_per_second(&self) -> Option<f64> {
        self.connection.estimated_bytes_per_second()
    }

    /// Earliest time at which more can be sent if no reply arrives.
    pub(super) fn next_send_time(&mut self, now: Instant) -> Option<Instant> {
        match () {
            () if self.is_complete && !self.has_bytes_queued_after_preview() => None,
            () if self.connection.max_sendable_bytes(now) > 0 => Some(now),
            () => self.connection.next_send_time(now),
        }
    }

    /// Returns the report on the last preview once, and again when the first round-trip time is known.
    pub(super) fn take_send_report(&mut self) -> Option<PreviewSendReport> {
        let report = self.report.as_mut()?;
        if report.round_trip.is_none() && self.connection.min_round_trip_time().is_some() {
            report.round_trip = self.connection.min_round_trip_time();
            self.is_reported = false;
        }
        (!std::mem::replace(&mut self.is_reported, true)).then_some(*report)
    }

    /// How long to wait before exiting for pending replies, so that the shell does not receive them as input,
    /// or `None` if no replies are pending.
    pub(super) fn reply_wait_before_exit(&self) -> Option<Duration> {
        const MIN: Duration = Duration::from_millis(200);
        const MAX: Duration = Duration::from_secs(1);
        let round_trip = self.connection.min_round_trip_time().unwrap_or_default();
        self.connection.awaits_reply().then(|| (round_trip * 3 / 2).clamp(MIN, MAX))
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;
    use std::rc::Rc;

    use ratatui::style::Color;

    use super::*;

    /// A small update adds its bytes to the preview's count instead of replacing the count.
    #[test]
    fn report_counts_bytes_since_the_render_began() {
        let now = Instant::now();
        let all = Rc::new(Cell::new(0));
        let count = all.clone();
        let out: TerminalOutputCallback =
            Box::new(move |bytes: Vec<u8>| count.set(count.get() + bytes.len()));
        let mut display = Display::new(ColorDepth::TrueColor, TerminalEnvironment::default(), None, out, now);
        let area = Rect::new(0, 0, 40, 20);
        let mut buffer = Buffer::empty(area);
        for (number, cell) in (0_u32..).zip(&mut buffer.content) {
            let code = |times: u32| (number * times % 251) as u8;
            cell.set_symbol("▀").set_fg(Color::Rgb(code(7), code(13), code(29)));
        }
        let show = |display: &mut Display, buffer: &Buffer| {
            let before = all.get();
            display.set_target(buffer, area, PreviewFidelity::Still, true, &LinksAndDelayedText::default());
            for second in 1..100 {
                let (now, sent) = (now + Duration::from_millis(second), all.get());
                display.send_next_slice(now, || false);
                display.record_accepted_bytes(all.get() - sent);
                display.handle_reply(TerminalReply::Attributes, now);
                display.handle_reply(TerminalReply::Ready, now);
            }
            assert!(display.is_target_sent());
            (display.take_send_report().expect("a report").bytes, all.get() - before)
        };
        display.reset_byte_count();
        let (told, whole) = show(&mut display, &buffer);
        assert_eq!(told, whole);
        assert!(whole > 5_000, "{whole}");
        buffer.content[7].set_fg(Color::Rgb(255, 255, 255));
        let (told, difference) = show(&mut display, &buffer);
        assert!(difference < 200 && told == whole + difference, "{told}: {whole} and {difference}");
        display.reset_byte_count();
        buffer.content[9].set_fg(Color::Rgb(255, 255, 255));
        let (told, difference) = show(&mut display, &buffer);
        assert_eq!(told, difference, "only the next render should be counted");
    }
}
