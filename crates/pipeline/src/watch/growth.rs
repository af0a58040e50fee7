//! When it is time for a look at the files, and when they are settled, by the hints of what happens to them.

use std::collections::HashSet;
use std::ffi::OsString;
use std::time::Instant;

use super::folders::Hint;
use super::{BETWEEN_CHANGES, Waits};

/// Files that may be in motion.
#[derive(Debug)]
pub(super) struct Growth {
    waits: Waits,
    signs: Option<Signs>,
    /// Names that were written to and not closed since.
    open: HashSet<OsString>,
    unsettled: Option<Unsettled>,
    /// Earliest time of the next report of a change.
    not_before: Option<Instant>,
}

/// Signs of a change that nothing was made of yet.
#[derive(Clone, Copy, Debug)]
struct Signs {
    first: Instant,
    /// Time for a look.
    due: Instant,
    /// Whether the last thing that happened ended a save.
    is_whole: bool,
}

/// A change that was reported and may not be the last.
#[derive(Clone, Copy, Debug)]
struct Unsettled {
    since: Instant,
    /// When the last thing happened.
    latest: Instant,
}

impl Growth {
    pub(super) fn new(waits: Waits) -> Self {
        Self { waits, signs: None, open: HashSet::new(), unsettled: None, not_before: None }
    }

    /// Something happened to a watched name.
    pub(super) fn hint(&mut self, hint: Hint, now: Instant) {
        let first = self.signs.map_or(now, |signs| signs.first);
        let was_whole = self.signs.is_some_and(|signs| signs.is_whole);
        let is_whole = match hint {
            Hint::Whole(name) => {
                self.open.remove(&name);
                true
            }
            Hint::Written(name) => {
                self.open.insert(name);
                false
            }
            Hint::Gone(name) => {
                self.open.remove(&name);
                false
            }
            // The backup goes, the time stamp is set: what follows a save does not undo it.
            Hint::Touched => was_whole,
        };
        let due = if is_whole { now } else { (now + self.waits.quiet).min(first + self.waits.longest) };
        let due = self.not_before.map_or(due, |earliest| due.max(earliest));
        self.signs = Some(Signs { first, due, is_whole });
        if let Some(unsettled) = &mut self.unsettled {
            unsettled.latest = now;
        }
    }

    /// Time of the next look. `None` if no hint asks for one.
    pub(super) fn due(&self) -> Option<Instant> {
        let look = self.signs.map(|signs| signs.due);
        [look, self.unsettled.map(|unsettled| self.settled_at(unsettled))].into_iter().flatten().min()
    }

    /// Whether there were signs since something was last made of them.
    pub(super) fn is_signed(&self) -> bool {
        self.signs.is_some()
    }

    /// A look found no difference.
    pub(super) fn saw_nothing(&mut self) {
        self.signs = None;
    }

    /// A look found a difference after signs of it. Whether it is too early to say so: `is_missing`, a file is missing or
    /// empty; `moves`, the look before found another difference.
    pub(super) fn is_early(&mut self, is_missing: bool, moves: bool, now: Instant) -> bool {
        let Some(signs) = &mut self.signs else { return false };
        let due = if is_missing {
            signs.first + self.waits.quiet_missing
        } else if moves && !signs.is_whole {
            (now + self.waits.quiet).min(signs.first + self.waits.longest)
        } else {
            return false;
        };
        let is_early = now < due;
        if is_early {
            *signs = Signs { due, is_whole: false, ..*signs };
        }
        is_early
    }

    /// Notes that the change is reported; returns the time of its first sign.
    pub(super) fn said(&mut self, now: Instant) -> Instant {
        let noticed = self.signs.take().map_or(now, |signs| signs.first);
        self.not_before = Some(now + BETWEEN_CHANGES);
        let since = self.unsettled.map_or(now, |unsettled| unsettled.since);
        self.unsettled = Some(Unsettled { since, latest: now });
        noticed
    }

    /// Whether the reported change is settled now; true only once.
    pub(super) fn settles(&mut self, now: Instant) -> bool {
        let settles = self.unsettled.is_some_and(|unsettled| self.settled_at(unsettled) <= now);
        self.unsettled = self.unsettled.filter(|_| !settles);
        settles
    }

    fn settled_at(&self, unsettled: Unsettled) -> Instant {
        let wait = if self.open.is_empty() { self.waits.settle } else { self.waits.settle_open };
        (unsettled.latest + wait).min(unsettled.since + self.waits.settle_longest)
    }
}
