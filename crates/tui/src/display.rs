//! The display: leads the screen to the requested cells, slice by slice as the line has room.

use std::time::{Duration, Instant};

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;

use super::color::ColorDepth;
use super::connection::{Connection, QueryKind};
use super::event::FrameReport;
use super::graphics::{Images, PixelPlacement};
use super::paint::{Fidelity, FrameExtras, Painter};
use super::preview_kind::PreviewKind;
use super::terminal;
use super::terminal_replies::TerminalQueries;
use super::terminal_replies::TerminalReply;
use super::window_title::WindowTitle;

/// Whether the terminal draws what lies between two marks at once (mode 2026).
pub(super) const SYNCHRONIZED: &[u8] = b"\x1b[?2026$p";
/// Question for the device attributes (DA1): the last of the first questions.
pub(super) const ATTRIBUTES: &[u8] = b"\x1b[c";
/// A status report (DSR).
pub(super) const STATUS: &[u8] = b"\x1b[5n";
const BEGIN: &[u8] = b"\x1b[?2026h";
const END: &[u8] = b"\x1b[?2026l";
/// Smaller slices do not flicker.
const LARGE: usize = 2_000;

/// The way to the terminal, as far as it is known before anything was sent.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct TerminalLink {
    /// Inside tmux or screen, which answer themselves and draw when they like.
    pub(super) is_multiplexed: bool,
    /// Inside tmux.
    pub(super) is_in_tmux: bool,
    /// Over a network.
    pub(super) is_remote: bool,
    /// Whether the terminal knows REP.
    pub(super) can_repeat: bool,
    /// Questions to the terminal.
    pub(super) ask: TerminalQueries,
}

impl TerminalLink {
    /// Nothing is known of the line yet. What answers inside a multiplexer says nothing of a network behind it.
    fn line(self, now: Instant) -> Connection {
        Connection::new(self.is_multiplexed && self.is_remote, now)
    }
}

/// A writer to the terminal that does not wait until the bytes are written.
pub(super) type TerminalWriter = Box<dyn FnMut(Vec<u8>)>;

/// The screen as the loop sees it.
pub(super) struct Display {
    painter: Painter,
    /// The picture, if it is drawn in pixels.
    images: Option<Images>,
    line: Connection,
    way: TerminalLink,
    /// Takes bytes for the terminal.
    out: TerminalWriter,
    /// Whether the terminal knows mode 2026.
    is_synchronized: bool,
    /// Whether all that is wanted has been sent.
    is_complete: bool,
    /// The frame of the window as it is wanted, and as it was sent.
    chrome: [WindowTitle; 2],
    /// Notifications and texts for the clipboard, not sent yet.
    asides: Vec<u8>,
    /// Bytes that were sent since the render of the newest picture began.
    sent: usize,
    /// Whether a picture is under way.
    is_picture_due: bool,
    /// Cost of the last picture.
    report: Option<FrameReport>,
    /// Whether that is news.
    is_reported: bool,
}

impl Display {
    /// A screen of which nothing is known.
    pub(super) fn new(
        depth: ColorDepth,
        way: TerminalLink,
        images: Option<Images>,
        out: TerminalWriter,
        now: Instant,
    ) -> Self {
        let mut display = Self {
            painter: Painter::new(depth).repeating(way.can_repeat),
            images,
            line: way.line(now),
            way,
            out,
            is_synchronized: false,
            is_complete: true,
            chrome: Default::default(),
            asides: Vec::new(),
            sent: 0,
            is_picture_due: false,
            report: None,
            is_reported: true,
        };
        display.restart(now);
        display
    }

    /// Somebody else used the terminal: its content is unknown, and so is the line.
    pub(super) fn restart(&mut self, now: Instant) {
        self.forget();
        self.chrome[1] = WindowTitle::default();
        self.line = self.way.line(now);
        let questions = [SYNCHRONIZED, &self.way.ask.questions(), ATTRIBUTES].concat();
        self.send(questions, Some(QueryKind::Attributes), now);
    }

    /// The content of the screen is unknown; the line is the same.
    pub(super) fn forget(&mut self) {
        self.painter.forget();
        if let Some(images) = &mut self.images {
            images.forget();
        }
        self.is_complete = false;
    }

    /// Draws the picture in pixels from now on, if that is its kind.
    pub(super) fn draw_as(&mut self, kind: PreviewKind) {
        if let (PreviewKind::Pixels(protocol), None) = (kind, &self.images) {
            terminal::will_have_images();
            self.images = Some(Images::new(protocol, self.way.is_in_tmux));
        }
    }

    /// Whether the picture is drawn in pixels.
    pub(super) fn draws_pixels(&self) -> bool {
        self.images.is_some()
    }

    /// Places the picture in pixels. `None` if cells take its place.
    pub(super) fn place(&mut self, wanted: Option<PixelPlacement>, is_still: bool) {
        if let Some(uncovered) = self.images.as_mut().and_then(|images| images.aim(wanted, is_still)) {
            self.painter.damage(uncovered);
        }
    }

    /// Leads to this from now on. `is_new`: with a picture that was not wanted before.
    pub(super) fn aim(
        &mut self,
        wanted: &Buffer,
        picture: Rect,
        fidelity: Fidelity,
        (is_new, besides): (bool, &FrameExtras),
    ) {
        if !besides.links.is_empty() {
            terminal::will_have_links();
        }
        self.painter.aim_with(wanted, picture, fidelity, besides);
        self.is_complete = false;
        self.is_picture_due |= is_new;
    }

    /// The first picture of a render is the next one: bytes are counted from here on.
    pub(super) fn begin_count(&mut self) {
        self.sent = 0;
    }

    /// Gives the window this frame, behind the picture.
    pub(super) fn dress(&mut self, chrome: WindowTitle) {
        self.chrome[0] = chrome;
    }

    /// Sends these bytes behind the picture.
    pub(super) fn send_aside(&mut self, bytes: Vec<u8>) {
        self.asides.extend(bytes);
    }

    /// Whether there is anything to send when the picture is there.
    fn has_more(&self) -> bool {
        !self.asides.is_empty() || self.chrome[0] != self.chrome[1]
    }

    /// Sends what waits for the picture.
    fn send_more(&mut self, now: Instant) {
        let [wanted, sent] = &self.chrome;
        let mut bytes = Vec::new();
        if wanted.title != sent.title {
            bytes.extend_from_slice(terminal::before_title());
        }
        if wanted.bar.is_some() {
            terminal::will_have_progress();
        }
        bytes.extend(sent.changes(wanted));
        bytes.append(&mut self.asides);
        self.chrome[1] = self.chrome[0].clone();
        if !bytes.is_empty() {
            self.send_slice(bytes, now);
        }
    }

    /// Sends a slice of what the line has room for, and what there is of it once `is_late` says so; whether that was anything.
    pub(super) fn pump(&mut self, now: Instant, is_late: impl Fn() -> bool) -> bool {
        let is_idle = self.is_complete && !self.has_more();
        let room = if is_idle { 0 } else { self.line.room(now) };
        if room == 0 {
            return false;
        }
        if self.is_complete {
            self.send_more(now);
            return false;
        }
        let room = room.saturating_sub(BEGIN.len() + END.len());
        let cells = self.painter.slice_until(room, is_late);
        if !cells.is_empty() {
            self.send_slice(self.synchronized(cells), now);
            return true;
        }
        // Without marks: kitty 0.26 loses chunks of a picture that come between them. It is shown by its last one.
        let rate = self.line.bytes_per_second();
        let pixels = self.images.as_mut().and_then(|images| images.slice(room, rate));
        match pixels {
            Some(pixels) => self.send_slice(pixels, now),
            None => self.complete(),
        }
        !self.is_complete
    }

    /// The same between marks, if the terminal knows them and it is large enough to flicker.
    fn synchronized(&self, mut cells: Vec<u8>) -> Vec<u8> {
        if self.is_synchronized && !self.way.is_multiplexed && cells.len() >= LARGE {
            cells.splice(0..0, BEGIN.iter().copied());
            cells.extend_from_slice(END);
        }
        cells
    }

    fn complete(&mut self) {
        self.is_complete = true;
        if std::mem::take(&mut self.is_picture_due) {
            self.report = Some(FrameReport { bytes: self.sent, round_trip: self.line.round_trip() });
            self.is_reported = false;
        }
    }

    fn send_slice(&mut self, mut slice: Vec<u8>, now: Instant) {
        let question = self.line.question();
        if question.is_some() {
            slice.extend_from_slice(STATUS);
        }
        self.sent += slice.len();
        self.send(slice, question, now);
    }

    fn send(&mut self, bytes: Vec<u8>, question: Option<QueryKind>, now: Instant) {
        self.line.send(bytes.len(), question, now);
        (self.out)(bytes);
    }

    /// The terminal answered.
    pub(super) fn answered(&mut self, answer: TerminalReply, now: Instant) {
        match answer {
            TerminalReply::Ready => self.line.answered(QueryKind::Status, now),
            TerminalReply::Attributes => self.line.answered(QueryKind::Attributes, now),
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

    /// The system took so many bytes.
    pub(super) fn written(&mut self, bytes: usize) {
        self.line.written(bytes);
    }

    /// Whether all that is wanted has been sent.
    pub(super) fn is_complete(&self) -> bool {
        self.is_complete
    }

    /// Whether the terminal can follow the render.
    pub(super) fn is_quick(&self) -> bool {
        self.line.is_quick()
    }

    /// Whether the terminal has answered for all that is wanted.
    pub(super) fn is_answered(&self) -> bool {
        self.is_complete && !self.line.owes()
    }

    /// Rate of the line, as far as it shows. `None` if it is faster than anybody would notice.
    pub(super) fn bytes_per_second(&self) -> Option<f64> {
        self.line.bytes_per_second()
    }

    /// When there may be room for what is left, without an answer.
    pub(super) fn wake(&mut self, now: Instant) -> Option<Instant> {
        match () {
            () if self.is_complete && !self.has_more() => None,
            () if self.line.room(now) > 0 => Some(now),
            () => self.line.wake(now),
        }
    }

    /// The report on the last picture, once, and again when the terminal's first answer came after it.
    pub(super) fn take_report(&mut self) -> Option<FrameReport> {
        let report = self.report.as_mut()?;
        if report.round_trip.is_none() && self.line.round_trip().is_some() {
            report.round_trip = self.line.round_trip();
            self.is_reported = false;
        }
        (!std::mem::replace(&mut self.is_reported, true)).then_some(*report)
    }

    /// Time to wait for answers that would otherwise be typed into the shell. `None` if no answer is due.
    pub(super) fn patience(&self) -> Option<Duration> {
        const LEAST: Duration = Duration::from_millis(200);
        const MOST: Duration = Duration::from_secs(1);
        let round_trip = self.line.round_trip().unwrap_or_default();
        self.line.owes().then(|| (round_trip * 3 / 2).clamp(LEAST, MOST))
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;
    use std::rc::Rc;

    use ratatui::style::Color;

    use super::*;

    /// A small difference of a picture does not stand for the picture.
    #[test]
    fn the_bytes_of_a_picture_are_those_since_its_render_began() {
        let now = Instant::now();
        let all = Rc::new(Cell::new(0));
        let count = all.clone();
        let out: TerminalWriter = Box::new(move |bytes: Vec<u8>| count.set(count.get() + bytes.len()));
        let mut display = Display::new(ColorDepth::TrueColor, TerminalLink::default(), None, out, now);
        let area = Rect::new(0, 0, 40, 20);
        let mut buffer = Buffer::empty(area);
        for (number, cell) in (0_u32..).zip(&mut buffer.content) {
            let code = |times: u32| (number * times % 251) as u8;
            cell.set_symbol("▀").set_fg(Color::Rgb(code(7), code(13), code(29)));
        }
        let show = |display: &mut Display, buffer: &Buffer| {
            let before = all.get();
            display.aim(buffer, area, Fidelity::Still, (true, &FrameExtras::default()));
            for second in 1..100 {
                let (now, sent) = (now + Duration::from_millis(second), all.get());
                display.pump(now, || false);
                display.written(all.get() - sent);
                display.answered(TerminalReply::Attributes, now);
                display.answered(TerminalReply::Ready, now);
            }
            assert!(display.is_complete());
            (display.take_report().expect("a report").bytes, all.get() - before)
        };
        display.begin_count();
        let (told, whole) = show(&mut display, &buffer);
        assert_eq!(told, whole);
        assert!(whole > 5_000, "{whole}");
        buffer.content[7].set_fg(Color::Rgb(255, 255, 255));
        let (told, difference) = show(&mut display, &buffer);
        assert!(difference < 200 && told == whole + difference, "{told}: {whole} and {difference}");
        display.begin_count();
        buffer.content[9].set_fg(Color::Rgb(255, 255, 255));
        let (told, difference) = show(&mut display, &buffer);
        assert_eq!(told, difference, "of another render");
    }
}
