//! Flow control: how many bytes may be sent to the terminal now.
//!
//! Buffers between glimt and the screen could hold several seconds' worth of outdated previews. To prevent
//! this, every slice ends with a status report request, and the number of bytes in flight is limited to what
//! the connection carries in one round trip plus [`MAX_QUEUE`], up to [`MAX_WINDOW`]. This bounds the delay
//! between a key press and its effect on the screen. The window is adjusted using round-trip times, as in TCP
//! Vegas (Brakmo and Peterson, 1995): the minimum is taken as the latency of the idle connection, and
//! anything above it as queueing delay.
//!
//! If the terminal does not reply within [`REPLY_TIMEOUT`], output is paced by time. The same applies behind
//! a multiplexer, which replies itself regardless of the outer connection.
//!
//! A terminal that usually replies to slices within [`FAST_REPLY`] is considered fast enough to show the
//! render as it progresses.

mod bucket;
#[cfg(test)]
mod tests;

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use self::bucket::TokenBucket;

/// Maximum number of unacknowledged bytes: 24 kB minus the bytes that set up the screen, which are not
/// counted.
const MAX_WINDOW: usize = 23_800;
/// Initial and minimum window size in bytes.
const INITIAL_WINDOW: f64 = 8_000.0;
const MIN_WINDOW: f64 = 1_500.0;
/// Maximum queueing delay on the connection.
const MAX_QUEUE: Duration = Duration::from_millis(60);
/// Timeout for the terminal's first reply.
const REPLY_TIMEOUT: Duration = Duration::from_secs(1);
/// Outstanding replies are considered lost after this time or `LOST_REPLY_ROUND_TRIPS` round trips, whichever
/// is longer.
const LOST_REPLY_TIMEOUT: Duration = Duration::from_secs(1);
const LOST_REPLY_ROUND_TRIPS: u32 = 4;
/// A terminal is fast if it replied to most of the last `RECENT_SLICES` slices within this time.
const FAST_REPLY: Duration = Duration::from_millis(20);
const RECENT_SLICES: usize = 8;
/// Length of the periods over which the minimum round-trip time is tracked. The minimum covers the current
/// period and the previous one.
const ROUND_TRIP_AGE: Duration = Duration::from_secs(15);
/// Maximum and minimum slice size in bytes.
const MAX_SLICE: usize = 8_000;
const MIN_SLICE: usize = 400;

/// Queries to which the terminal replies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum QueryKind {
    /// Primary device attributes, sent last in the first batch. Queries still unanswered when this reply
    /// arrives are not supported.
    Attributes,
    /// A request for a status report (DSR).
    Status,
}

/// A slice of output that ends with a query and awaits its reply.
#[derive(Clone, Copy, Debug)]
struct SentSlice {
    question: QueryKind,
    bytes: usize,
    sent: Instant,
    /// Whether the window limited the number of bytes sent.
    is_limited: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ReplySupport {
    /// It is not yet known whether the terminal replies.
    Asked {
        until: Instant,
    },
    Answering,
    Silent,
}

/// Flow control for output to the terminal.
#[derive(Debug)]
pub(super) struct TerminalFlowControl {
    replies: ReplySupport,
    is_multiplexed: bool,
    flight: VecDeque<SentSlice>,
    in_flight: usize,
    /// Maximum number of bytes in flight.
    window: f64,
    /// Time at which the window last shrank. Slices sent before that do not shrink it again.
    shrunk: Option<Instant>,
    round_trips: MinRoundTripTracker,
    /// Round-trip times of the last slices, including small ones: after a slowdown, only small slices are
    /// sent, so only their replies can show that the connection has recovered.
    recent: VecDeque<Duration>,
    /// Time when the last reply arrived or the oldest pending query was sent, whichever is later.
    waiting_since: Instant,
    bucket: TokenBucket,
    /// Bytes that the operating system has not accepted yet.
    unwritten: usize,
}

impl TerminalFlowControl {
    /// Creates a connection whose speed is unknown. `is_multiplexed` means that a multiplexer replies instead
    /// of the terminal.
    pub(super) fn new(is_multiplexed: bool, now: Instant) -> Self {
        Self {
            replies: ReplySupport::Asked { until: now + REPLY_TIMEOUT },
            is_multiplexed,
            flight: VecDeque::new(),
            in_flight: 0,
            window: INITIAL_WINDOW,
            shrunk: None,
            round_trips: MinRoundTripTracker::default(),
            recent: VecDeque::with_capacity(RECENT_SLICES),
            waiting_since: now,
            bucket: TokenBucket::new_full(now),
            unwritten: 0,
        }
    }

    /// Returns the maximum size of the next slice, excluding its query, or 0 if sending has to wait.
    pub(super) fn max_sendable_bytes(&mut self, now: Instant) -> usize {
        self.check_timeouts(now);
        let window = self.window_bytes().saturating_sub(self.in_flight);
        let tokens = self.bucket.available_tokens(now);
        let room = match self.replies {
            ReplySupport::Answering if !self.is_multiplexed => window,
            ReplySupport::Answering => window.min(tokens),
            ReplySupport::Asked { .. } => (MAX_WINDOW - self.in_flight.min(MAX_WINDOW)).min(tokens),
            ReplySupport::Silent if self.unwritten > 0 => 0,
            ReplySupport::Silent => tokens,
        };
        // Split the window into several slices so that the connection stays busy while replies are in flight.
        let slice = (self.window_bytes() / 3).clamp(MIN_SLICE, MAX_SLICE);
        let room = room.saturating_sub(QUERY_BYTES).min(slice);
        if room < MIN_SLICE { 0 } else { room }
    }

    /// The query to append to the next slice.
    pub(super) fn next_query(&self) -> Option<QueryKind> {
        (self.replies != ReplySupport::Silent).then_some(QueryKind::Status)
    }

    /// Records a sent slice. `bytes` includes its query.
    pub(super) fn record_sent(&mut self, bytes: usize, question: Option<QueryKind>, now: Instant) {
        self.unwritten += bytes;
        self.bucket.deduct(bytes, now);
        let Some(question) = question else { return };
        if self.flight.is_empty() {
            self.waiting_since = now;
        }
        self.in_flight += bytes;
        let is_limited =
            self.in_flight + MIN_SLICE + MAX_SLICE.min(self.window_bytes() / 3) > self.window_bytes();
        self.flight.push_back(SentSlice { question, bytes, sent: now, is_limited });
    }

    /// Records that the operating system has accepted bytes.
    pub(super) fn record_accepted_bytes(&mut self, bytes: usize) {
        self.unwritten = self.unwritten.saturating_sub(bytes);
    }

    /// Records a reply from the terminal.
    pub(super) fn handle_reply(&mut self, question: QueryKind, now: Instant) {
        self.replies = ReplySupport::Answering;
        self.waiting_since = now;
        let Some(place) = self.flight.iter().position(|slice| slice.question == question) else { return };
        // Replies arrive in order, so replies to earlier slices have been lost.
        let passed: Vec<SentSlice> = self.flight.drain(..=place).collect();
        for slice in passed {
            self.in_flight -= slice.bytes;
            // A slice that exceeds the maximum window holds an entire image, so its round-trip time is mostly
            // transmission time.
            if slice.question == question && slice.bytes <= MAX_WINDOW {
                let round_trip = now.saturating_duration_since(slice.sent);
                self.round_trips.add(round_trip, now);
                self.push_recent_round_trip(round_trip);
                self.adjust_window(&slice, round_trip, now);
            }
        }
    }

    /// Returns the earliest time at which more may be sent if no reply arrives.
    pub(super) fn next_send_time(&self, now: Instant) -> Option<Instant> {
        let filled = self.bucket.time_when_available(MIN_SLICE + QUERY_BYTES, now);
        match self.replies {
            ReplySupport::Answering => {
                let lost =
                    (!self.flight.is_empty()).then_some(self.waiting_since + self.lost_reply_timeout());
                let filled = self.is_multiplexed.then_some(filled).filter(|filled| *filled > now);
                [lost, filled].into_iter().flatten().min()
            }
            ReplySupport::Asked { until } if filled <= now => Some(until),
            ReplySupport::Asked { until } => Some(filled.min(until)),
            ReplySupport::Silent => (self.unwritten == 0).then_some(filled),
        }
    }

    /// Whether a reply is pending.
    pub(super) fn awaits_reply(&self) -> bool {
        !self.flight.is_empty()
    }

    /// Round-trip time excluding queueing, or `None` if the terminal does not reply.
    pub(super) fn min_round_trip_time(&self) -> Option<Duration> {
        self.round_trips.minimum().filter(|_| self.replies == ReplySupport::Answering)
    }

    /// Estimated bandwidth in bytes per second, or `None` if it is unknown or too high to matter.
    pub(super) fn estimated_bytes_per_second(&self) -> Option<f64> {
        /// At this rate, sending a preview takes no noticeable time.
        const FAST: f64 = 2e6;
        let window_rate = || {
            let round_trip = self.round_trips.minimum()?.as_secs_f64();
            Some(self.window / round_trip.max(1e-6))
        };
        let rate = match self.replies {
            ReplySupport::Answering if !self.is_multiplexed => window_rate(),
            ReplySupport::Answering | ReplySupport::Silent => Some(bucket::BYTES_PER_SECOND),
            ReplySupport::Asked { .. } => None,
        };
        rate.filter(|rate| *rate < FAST)
    }

    /// Whether the terminal is fast enough to follow the render, meaning that it replied to more than half of
    /// the last slices within [`FAST_REPLY`].
    pub(super) fn is_fast(&self) -> bool {
        let quick = self.recent.iter().filter(|round_trip| **round_trip <= FAST_REPLY).count();
        self.replies == ReplySupport::Answering && !self.is_multiplexed && 2 * quick > self.recent.len()
    }

    fn push_recent_round_trip(&mut self, round_trip: Duration) {
        if self.recent.len() == RECENT_SLICES {
            self.recent.pop_front();
        }
        self.recent.push_back(round_trip);
    }

    fn window_bytes(&self) -> usize {
        (self.window as usize).min(MAX_WINDOW)
    }

    fn check_timeouts(&mut self, now: Instant) {
        match self.replies {
            ReplySupport::Asked { until } if now >= until => {
                self.replies = ReplySupport::Silent;
                self.clear_in_flight();
            }
            ReplySupport::Answering
                if self.awaits_reply() && now >= self.waiting_since + self.lost_reply_timeout() =>
            {
                // The connection is stalled or a reply was lost. Send little until the next reply.
                self.clear_in_flight();
                self.window = MIN_WINDOW;
            }
            ReplySupport::Asked { .. } | ReplySupport::Answering | ReplySupport::Silent => {}
        }
    }

    /// How long to wait before considering missing replies lost.
    fn lost_reply_timeout(&self) -> Duration {
        LOST_REPLY_TIMEOUT.max(self.round_trips.minimum().unwrap_or_default() * LOST_REPLY_ROUND_TRIPS)
    }

    fn clear_in_flight(&mut self) {
        self.flight.clear();
        self.in_flight = 0;
    }

    /// Adjusts the window based on a slice's queueing delay.
    fn adjust_window(&mut self, slice: &SentSlice, round_trip: Duration, now: Instant) {
        let Some(least) = self.round_trips.minimum() else { return };
        let queue = round_trip.saturating_sub(least);
        if queue <= MAX_QUEUE {
            if slice.is_limited {
                self.window += slice.bytes as f64 * (1.0 - queue.div_duration_f64(MAX_QUEUE));
            }
        } else if self.shrunk.is_none_or(|shrunk| slice.sent >= shrunk) {
            self.window *= (least + MAX_QUEUE).div_duration_f64(round_trip);
            self.shrunk = Some(now);
        }
        self.window = self.window.clamp(MIN_WINDOW, MAX_WINDOW as f64);
    }
}

/// Length in bytes of the query that ends a slice.
const QUERY_BYTES: usize = 4;

/// Tracks the minimum of recent round-trip times.
#[derive(Debug, Default)]
struct MinRoundTripTracker {
    current: Option<(Instant, Duration)>,
    before: Option<Duration>,
}

impl MinRoundTripTracker {
    fn add(&mut self, round_trip: Duration, now: Instant) {
        self.current = match self.current {
            Some((since, least)) if now < since + ROUND_TRIP_AGE => Some((since, least.min(round_trip))),
            last => {
                self.before = last.map(|(_, least)| least);
                Some((now, round_trip))
            }
        };
    }

    fn minimum(&self) -> Option<Duration> {
        let current = self.current.map(|(_, least)| least);
        current.into_iter().chain(self.before).min()
    }
}
