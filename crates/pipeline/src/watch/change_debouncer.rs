//! Decides, based on hints, when to check files and when they have settled.

use std::collections::HashSet;
use std::ffi::OsString;
use std::time::Instant;

use super::folders::ChangeHint;
use super::{BETWEEN_CHANGES, WatchDelays};

/// Tracks files that may be changing.
#[derive(Debug)]
pub(super) struct ChangeDebouncer {
    delays: WatchDelays,
    pending: Option<PendingHints>,
    /// Files that were written to but have not been closed.
    open: HashSet<OsString>,
    unsettled: Option<ReportedUnsettledChange>,
    /// Earliest time at which to report the next change.
    not_before: Option<Instant>,
}

/// Hints that have not yet been acted on.
#[derive(Clone, Copy, Debug)]
struct PendingHints {
    first: Instant,
    /// Time of the next check.
    due: Instant,
    /// Whether the last hint completed a save.
    is_complete: bool,
}

/// A reported change that further changes may follow.
#[derive(Clone, Copy, Debug)]
struct ReportedUnsettledChange {
    since: Instant,
    /// Time of the last hint.
    latest: Instant,
}

impl ChangeDebouncer {
    pub(super) fn new(delays: WatchDelays) -> Self {
        Self { delays, pending: None, open: HashSet::new(), unsettled: None, not_before: None }
    }

    /// Adds a hint about a watched file.
    pub(super) fn add_hint(&mut self, hint: ChangeHint, now: Instant) {
        let first = self.pending.map_or(now, |pending| pending.first);
        let was_complete = self.pending.is_some_and(|pending| pending.is_complete);
        let is_complete = match hint {
            ChangeHint::Complete(name) => {
                self.open.remove(&name);
                true
            }
            ChangeHint::Written(name) => {
                self.open.insert(name);
                false
            }
            ChangeHint::Gone(name) => {
                self.open.remove(&name);
                false
            }
            // Removing a backup or setting a timestamp afterwards does not make a save incomplete.
            ChangeHint::Touched => was_complete,
        };
        let due = if is_complete { now } else { (now + self.delays.quiet).min(first + self.delays.longest) };
        let due = self.not_before.map_or(due, |earliest| due.max(earliest));
        self.pending = Some(PendingHints { first, due, is_complete });
        if let Some(unsettled) = &mut self.unsettled {
            unsettled.latest = now;
        }
    }

    /// Returns the time of the next check, or `None` if no check is due.
    pub(super) fn next_check_time(&self) -> Option<Instant> {
        let look = self.pending.map(|pending| pending.due);
        [look, self.unsettled.map(|unsettled| self.settled_at(unsettled))].into_iter().flatten().min()
    }

    /// Whether there are pending hints.
    pub(super) fn has_hints(&self) -> bool {
        self.pending.is_some()
    }

    /// Discards the hints after a check that found no change.
    pub(super) fn discard_hints(&mut self) {
        self.pending = None;
    }

    /// Whether it is too early to report a change that was found because of a hint. `is_missing` is true if a
    /// file is missing or empty, and `moves` is true if the previous check found a different change.
    pub(super) fn should_delay_report(&mut self, is_missing: bool, moves: bool, now: Instant) -> bool {
        let Some(pending) = &mut self.pending else { return false };
        let due = if is_missing {
            pending.first + self.delays.quiet_missing
        } else if moves && !pending.is_complete {
            (now + self.delays.quiet).min(pending.first + self.delays.longest)
        } else {
            return false;
        };
        let is_early = now < due;
        if is_early {
            *pending = PendingHints { due, is_complete: false, ..*pending };
        }
        is_early
    }

    /// Records that a change is being reported. Returns the time of its first hint.
    pub(super) fn mark_reported(&mut self, now: Instant) -> Instant {
        let noticed = self.pending.take().map_or(now, |pending| pending.first);
        self.not_before = Some(now + BETWEEN_CHANGES);
        let since = self.unsettled.map_or(now, |unsettled| unsettled.since);
        self.unsettled = Some(ReportedUnsettledChange { since, latest: now });
        noticed
    }

    /// Whether the reported change has settled. Returns true only once per change.
    pub(super) fn clear_if_settled(&mut self, now: Instant) -> bool {
        let settles = self.unsettled.is_some_and(|unsettled| self.settled_at(unsettled) <= now);
        self.unsettled = self.unsettled.filter(|_| !settles);
        settles
    }

    fn settled_at(&self, unsettled: ReportedUnsettledChange) -> Instant {
        let wait = if self.open.is_empty() { self.delays.settle } else { self.delays.settle_open };
        (unsettled.latest + wait).min(unsettled.since + self.delays.settle_longest)
    }
}
