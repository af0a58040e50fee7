//! Flow control: how much may be sent to the terminal now.
//!
//! Between glimt and the eye lie buffers that would hold seconds of old pictures. So glimt asks the terminal after every slice
//! whether it has come so far (a status report). Only as much is on its way as the line carries in its round trip and [`QUEUE`]
//! more, at most [`MOST`]: the next bytes, the answer to a key, wait no longer than that. The window follows the round trips as
//! in TCP Vegas (Brakmo and Peterson, 1995): the least round trip is the line's own, and the rest is queue.
//!
//! A terminal that answers nothing within [`PATIENCE`] is paced by time, and so is one inside a multiplexer, which
//! answers itself and says nothing of the line behind it.
//!
//! A terminal that takes slices and answers within [`QUICK`] is quick: it can follow the render.

mod bucket;
#[cfg(test)]
mod tests;

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use self::bucket::TokenBucket;

/// Most bytes on their way that the terminal has not answered for: 24 kB with those that take the screen, which are not
/// counted.
const MOST: usize = 23_800;
/// The window at the beginning, and the least one.
const START: f64 = 8_000.0;
const LEAST: f64 = 1_500.0;
/// Longest time in the line's queue.
const QUEUE: Duration = Duration::from_millis(60);
/// Time for a terminal's first answer.
const PATIENCE: Duration = Duration::from_secs(1);
/// After this silence, or after so many round trips, answers are taken for lost.
const SILENCE: Duration = Duration::from_secs(1);
const SILENT_TRIPS: u32 = 4;
/// A terminal that usually answers a slice within this time is quick; so many slices tell what is usual.
const QUICK: Duration = Duration::from_millis(20);
const USUAL_OF: usize = 8;
/// The least round trip is that of the last one or two of these.
const AGE: Duration = Duration::from_secs(15);
/// Slices are this large at most, and no smaller ones than this are begun.
const SLICE: usize = 8_000;
const LEAST_SLICE: usize = 400;

/// Questions that a terminal answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum QueryKind {
    /// Primary device attributes: the last of the first questions. What has not answered before it never will.
    Attributes,
    /// A status report.
    Status,
}

/// Bytes on their way, with the question at their end.
#[derive(Clone, Copy, Debug)]
struct SentSlice {
    question: QueryKind,
    bytes: usize,
    sent: Instant,
    /// Whether the window was what kept more from being sent.
    is_limited: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum SendRate {
    /// Whether the terminal answers is not known until then.
    Asked {
        until: Instant,
    },
    ProbeReplies,
    Silent,
}

/// The line to the terminal.
#[derive(Debug)]
pub(super) struct Connection {
    pace: SendRate,
    is_multiplexed: bool,
    flight: VecDeque<SentSlice>,
    in_flight: usize,
    /// Bytes that may be in flight.
    window: f64,
    /// When the window last shrank: slices from before say nothing new.
    shrunk: Option<Instant>,
    round_trips: RoundTrips,
    /// Round trips of the last slices, small ones too: otherwise a line that was slow for a moment would get no more slices that
    /// could show it to be quick again.
    recent: VecDeque<Duration>,
    /// When an answer last came, or one began to be owed.
    heard: Instant,
    bucket: TokenBucket,
    /// Bytes that the system has not taken yet.
    unwritten: usize,
}

impl Connection {
    /// A line of which nothing is known. `is_multiplexed`: what answers is not the terminal itself.
    pub(super) fn new(is_multiplexed: bool, now: Instant) -> Self {
        Self {
            pace: SendRate::Asked { until: now + PATIENCE },
            is_multiplexed,
            flight: VecDeque::new(),
            in_flight: 0,
            window: START,
            shrunk: None,
            round_trips: RoundTrips::default(),
            recent: VecDeque::with_capacity(USUAL_OF),
            heard: now,
            bucket: TokenBucket::full(now),
            unwritten: 0,
        }
    }

    /// Bytes that the next slice may have, beside its question; 0 if it has to wait.
    pub(super) fn room(&mut self, now: Instant) -> usize {
        self.lose_patience(now);
        let window = self.window_bytes().saturating_sub(self.in_flight);
        let tokens = self.bucket.tokens(now);
        let room = match self.pace {
            SendRate::ProbeReplies if !self.is_multiplexed => window,
            SendRate::ProbeReplies => window.min(tokens),
            SendRate::Asked { .. } => (MOST - self.in_flight.min(MOST)).min(tokens),
            SendRate::Silent if self.unwritten > 0 => 0,
            SendRate::Silent => tokens,
        };
        // Several slices fill a window, so that the line does not run dry while an answer is under way.
        let slice = (self.window_bytes() / 3).clamp(LEAST_SLICE, SLICE);
        let room = room.saturating_sub(ASKED_BYTES).min(slice);
        if room < LEAST_SLICE { 0 } else { room }
    }

    /// The question after the next slice.
    pub(super) fn question(&self) -> Option<QueryKind> {
        (self.pace != SendRate::Silent).then_some(QueryKind::Status)
    }

    /// A slice goes out; its bytes with those of the question.
    pub(super) fn send(&mut self, bytes: usize, question: Option<QueryKind>, now: Instant) {
        self.unwritten += bytes;
        self.bucket.take(bytes, now);
        let Some(question) = question else { return };
        if self.flight.is_empty() {
            self.heard = now;
        }
        self.in_flight += bytes;
        let is_limited =
            self.in_flight + LEAST_SLICE + SLICE.min(self.window_bytes() / 3) > self.window_bytes();
        self.flight.push_back(SentSlice { question, bytes, sent: now, is_limited });
    }

    /// The system took so many bytes.
    pub(super) fn written(&mut self, bytes: usize) {
        self.unwritten = self.unwritten.saturating_sub(bytes);
    }

    /// The terminal answered.
    pub(super) fn answered(&mut self, question: QueryKind, now: Instant) {
        self.pace = SendRate::ProbeReplies;
        self.heard = now;
        let Some(place) = self.flight.iter().position(|slice| slice.question == question) else { return };
        // Answers come in order: those before it are lost.
        let passed: Vec<SentSlice> = self.flight.drain(..=place).collect();
        for slice in passed {
            self.in_flight -= slice.bytes;
            // One larger than any window was a picture, and waited for itself.
            if slice.question == question && slice.bytes <= MOST {
                let round_trip = now.saturating_duration_since(slice.sent);
                self.round_trips.add(round_trip, now);
                self.note_recent(round_trip);
                self.fit(&slice, round_trip, now);
            }
        }
    }

    /// When there may be room without an answer, for who waits for it.
    pub(super) fn wake(&self, now: Instant) -> Option<Instant> {
        let filled = self.bucket.when(LEAST_SLICE + ASKED_BYTES, now);
        match self.pace {
            SendRate::ProbeReplies => {
                let lost = (!self.flight.is_empty()).then_some(self.heard + self.silence());
                let filled = self.is_multiplexed.then_some(filled).filter(|filled| *filled > now);
                [lost, filled].into_iter().flatten().min()
            }
            SendRate::Asked { until } if filled <= now => Some(until),
            SendRate::Asked { until } => Some(filled.min(until)),
            SendRate::Silent => (self.unwritten == 0).then_some(filled),
        }
    }

    /// Whether the terminal owes an answer.
    pub(super) fn owes(&self) -> bool {
        !self.flight.is_empty()
    }

    /// Time until the terminal answers when the line is free. `None` if it does not answer.
    pub(super) fn round_trip(&self) -> Option<Duration> {
        self.round_trips.least().filter(|_| self.pace == SendRate::ProbeReplies)
    }

    /// Rate of the line, as far as it shows. `None` if it is faster than anybody would notice.
    pub(super) fn bytes_per_second(&self) -> Option<f64> {
        /// Pictures take no time on such a line.
        const FAST: f64 = 2e6;
        let by_window = || {
            let round_trip = self.round_trips.least()?.as_secs_f64();
            Some(self.window / round_trip.max(1e-6))
        };
        let rate = match self.pace {
            SendRate::ProbeReplies if !self.is_multiplexed => by_window(),
            SendRate::ProbeReplies | SendRate::Silent => Some(bucket::RATE),
            SendRate::Asked { .. } => None,
        };
        rate.filter(|rate| *rate < FAST)
    }

    /// Whether the terminal takes a slice and answers so soon that it can follow the render: of the last slices, more than
    /// half were answered within [`QUICK`].
    pub(super) fn is_quick(&self) -> bool {
        let quick = self.recent.iter().filter(|round_trip| **round_trip <= QUICK).count();
        self.pace == SendRate::ProbeReplies && !self.is_multiplexed && 2 * quick > self.recent.len()
    }

    fn note_recent(&mut self, round_trip: Duration) {
        if self.recent.len() == USUAL_OF {
            self.recent.pop_front();
        }
        self.recent.push_back(round_trip);
    }

    fn window_bytes(&self) -> usize {
        (self.window as usize).min(MOST)
    }

    fn lose_patience(&mut self, now: Instant) {
        match self.pace {
            SendRate::Asked { until } if now >= until => {
                self.pace = SendRate::Silent;
                self.forget_flight();
            }
            SendRate::ProbeReplies if self.owes() && now >= self.heard + self.silence() => {
                // The line stands still, or an answer was lost. Little is sent until one comes.
                self.forget_flight();
                self.window = LEAST;
            }
            SendRate::Asked { .. } | SendRate::ProbeReplies | SendRate::Silent => {}
        }
    }

    /// Time after which missing answers count as lost.
    fn silence(&self) -> Duration {
        SILENCE.max(self.round_trips.least().unwrap_or_default() * SILENT_TRIPS)
    }

    fn forget_flight(&mut self) {
        self.flight.clear();
        self.in_flight = 0;
    }

    /// Fits the window to the queue that a slice met.
    fn fit(&mut self, slice: &SentSlice, round_trip: Duration, now: Instant) {
        let Some(least) = self.round_trips.least() else { return };
        let queue = round_trip.saturating_sub(least);
        if queue <= QUEUE {
            if slice.is_limited {
                self.window += slice.bytes as f64 * (1.0 - queue.div_duration_f64(QUEUE));
            }
        } else if self.shrunk.is_none_or(|shrunk| slice.sent >= shrunk) {
            self.window *= (least + QUEUE).div_duration_f64(round_trip);
            self.shrunk = Some(now);
        }
        self.window = self.window.clamp(LEAST, MOST as f64);
    }
}

/// Bytes of a question.
const ASKED_BYTES: usize = 4;

/// The least round trip of late.
#[derive(Debug, Default)]
struct RoundTrips {
    current: Option<(Instant, Duration)>,
    before: Option<Duration>,
}

impl RoundTrips {
    fn add(&mut self, round_trip: Duration, now: Instant) {
        self.current = match self.current {
            Some((since, least)) if now < since + AGE => Some((since, least.min(round_trip))),
            last => {
                self.before = last.map(|(_, least)| least);
                Some((now, round_trip))
            }
        };
    }

    fn least(&self) -> Option<Duration> {
        let current = self.current.map(|(_, least)| least);
        current.into_iter().chain(self.before).min()
    }
}
