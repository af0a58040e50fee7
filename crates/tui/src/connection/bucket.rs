//! A token bucket that limits the rate of output.

use std::time::{Duration, Instant};

/// Slightly less than 1 Mbit/s (125 kB/s), so the queue of a 1 Mbit/s connection drains.
pub(super) const BYTES_PER_SECOND: f64 = 100_000.0;
/// Capacity in bytes: about 100 ms at 1 Mbit/s.
const CAPACITY: f64 = 12_000.0;

/// A token bucket in which each token is one byte.
#[derive(Debug)]
pub(super) struct TokenBucket {
    tokens: f64,
    at: Instant,
}

impl TokenBucket {
    pub(super) fn new_full(now: Instant) -> Self {
        Self { tokens: CAPACITY, at: now }
    }

    /// Current number of tokens.
    pub(super) fn available_tokens(&self, now: Instant) -> usize {
        self.tokens_at(now).max(0.0) as usize
    }

    pub(super) fn deduct(&mut self, bytes: usize, now: Instant) {
        (self.tokens, self.at) = (self.tokens_at(now) - bytes as f64, now);
    }

    /// Returns the time at which there will be enough tokens to send `bytes`.
    pub(super) fn time_when_available(&self, bytes: usize, now: Instant) -> Instant {
        if self.available_tokens(now) >= bytes {
            return now;
        }
        // One extra byte to compensate for rounding.
        let missing = (bytes + 1) as f64 - self.tokens_at(now);
        now + Duration::from_secs_f64(missing / BYTES_PER_SECOND)
    }

    fn tokens_at(&self, now: Instant) -> f64 {
        let filled = now.saturating_duration_since(self.at).as_secs_f64() * BYTES_PER_SECOND;
        (self.tokens + filled).min(CAPACITY)
    }
}
