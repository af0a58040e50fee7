//! Caches for values that outlive a request.

use std::collections::{BTreeMap, HashMap};
use std::hash::Hash;
use std::sync::Arc;

use crate::scene::fingerprint::Fingerprint;

/// Cache for a single value.
#[derive(Debug)]
pub(super) struct Memo<T> {
    last: Option<(Fingerprint, T)>,
}

impl<T> Default for Memo<T> {
    fn default() -> Self {
        Self { last: None }
    }
}

impl<T> Memo<T> {
    /// Returns the value if its key matches.
    pub(super) fn get(&self, key: Fingerprint) -> Option<&T> {
        self.last.as_ref().filter(|(of, _)| *of == key).map(|(_, value)| value)
    }

    /// Returns the value, regardless of its key.
    pub(super) fn latest(&self) -> Option<&T> {
        self.last.as_ref().map(|(_, value)| value)
    }

    /// Replaces the cached value.
    pub(super) fn set(&mut self, key: Fingerprint, value: T) {
        self.last = Some((key, value));
    }
}

/// Cache for named values, such as loaded files and data built from them. Each value is valid for one key.
/// Unused values are kept while there is room, which makes switching back to a scene fast.
#[derive(Debug)]
pub(super) struct CacheOfNamedValues<N, T> {
    entries: HashMap<N, CacheEntry<T>>,
}

#[derive(Debug)]
struct CacheEntry<T> {
    key: Fingerprint,
    value: Arc<T>,
    bytes: usize,
    /// Whether the current request has used the value.
    used: bool,
    /// Whether the last successful request used the value.
    proven: bool,
    /// Number of the most recent request that used the value.
    request: u64,
}

/// Number of the request that last used a now unused value, and the value's size in bytes.
pub(super) type EvictionCandidate = (u64, usize);

impl<N, T> Default for CacheOfNamedValues<N, T> {
    fn default() -> Self {
        Self { entries: HashMap::new() }
    }
}

/// A cache that evicts the values that recent requests did not use.
pub(super) trait EvictableCache {
    /// Ends a request. If it failed, the values used by the last successful request stay protected, so that
    /// fixing a typo does not reload anything.
    fn record_request_usage(&mut self, success: bool, request: u64);
    /// Returns the values not used by the last successful request.
    fn eviction_candidates(&self) -> Vec<EvictionCandidate>;
    /// Drops unused values that were last used before request number `request`.
    fn evict_unused_before(&mut self, request: u64);
}

impl<N: Hash + Eq, T> CacheOfNamedValues<N, T> {
    /// Returns the value with this name if its key matches.
    pub(super) fn get(&mut self, name: &N, key: Fingerprint) -> Option<Arc<T>> {
        let entry = self.entries.get_mut(name).filter(|entry| entry.key == key)?;
        entry.used = true;
        Some(entry.value.clone())
    }

    /// Returns the value with this name, regardless of its key.
    pub(super) fn get_even_if_stale(&self, name: &N) -> Option<&Arc<T>> {
        self.entries.get(name).map(|entry| &entry.value)
    }

    /// Inserts or replaces the value with this name. `bytes` is its size.
    pub(super) fn insert(&mut self, name: N, key: Fingerprint, value: Arc<T>, bytes: usize) {
        self.entries.insert(name, CacheEntry { key, value, bytes, used: true, proven: false, request: 0 });
    }
}

impl<N: Hash + Eq, T> EvictableCache for CacheOfNamedValues<N, T> {
    fn record_request_usage(&mut self, success: bool, request: u64) {
        for entry in self.entries.values_mut() {
            entry.request = if entry.used { request } else { entry.request };
            entry.proven = if success { entry.used } else { entry.proven };
            entry.used = false;
        }
    }

    fn eviction_candidates(&self) -> Vec<EvictionCandidate> {
        let unused = self.entries.values().filter(|entry| !entry.proven);
        unused.map(|entry| (entry.request, entry.bytes)).collect()
    }

    fn evict_unused_before(&mut self, request: u64) {
        self.entries.retain(|_, entry| entry.proven || entry.request >= request);
    }
}

/// Returns the earliest request whose unused values fit into `max_bytes` together with the unused values of
/// all later requests. A request's values are all evicted together, because half a scene is of little use and
/// trees keep their meshes alive.
pub(super) fn oldest_request_to_keep(
    eviction_candidates: impl IntoIterator<Item = EvictionCandidate>,
    max_bytes: usize,
) -> u64 {
    let mut bytes_of = BTreeMap::<u64, usize>::new();
    for (request, bytes) in eviction_candidates {
        *bytes_of.entry(request).or_default() += bytes;
    }
    let mut total = 0;
    let has_room = |(_, bytes): &(&u64, &usize)| {
        total += **bytes;
        total <= max_bytes
    };
    bytes_of.iter().rev().take_while(has_room).last().map_or(u64::MAX, |(request, _)| *request)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::fingerprint::FingerprintHasher;

    fn key(name: &str) -> Fingerprint {
        FingerprintHasher::new(name).finish()
    }

    #[test]
    fn memo_has_one_key() {
        let mut memo = Memo::default();
        memo.set(key("a"), 1);
        assert_eq!(memo.get(key("a")), Some(&1));
        assert_eq!(memo.get(key("b")), None);
        assert_eq!(memo.latest(), Some(&1));
    }

    const NOTHING: usize = 0;

    /// Ends a request and evicts unused values until the remaining unused values fit into `max_bytes`.
    fn end_request(pool: &mut CacheOfNamedValues<&str, i32>, success: bool, request: u64, max_bytes: usize) {
        pool.record_request_usage(success, request);
        pool.evict_unused_before(oldest_request_to_keep(pool.eviction_candidates(), max_bytes));
    }

    #[test]
    fn unused_values_are_evicted_when_out_of_room() {
        let mut pool = CacheOfNamedValues::default();
        pool.insert("x", key("1"), Arc::new(1), 10);
        pool.insert("y", key("1"), Arc::new(2), 10);
        end_request(&mut pool, true, 1, NOTHING);
        assert!(pool.get(&"x", key("1")).is_some());
        assert!(pool.get(&"x", key("2")).is_none(), "different content");
        end_request(&mut pool, true, 2, NOTHING);
        assert!(pool.get(&"y", key("1")).is_none());
        assert!(pool.get(&"x", key("1")).is_some());
    }

    #[test]
    fn failed_request_keeps_last_valid_values() {
        let mut pool = CacheOfNamedValues::default();
        pool.insert("good", key("1"), Arc::new(1), 10);
        end_request(&mut pool, true, 1, NOTHING);
        pool.insert("wrong", key("1"), Arc::new(2), 10);
        end_request(&mut pool, false, 2, NOTHING);
        end_request(&mut pool, false, 3, NOTHING);
        assert!(pool.get(&"good", key("1")).is_some());
        assert!(pool.get(&"wrong", key("1")).is_none());
    }

    #[test]
    fn oldest_scene_is_evicted_entirely() {
        let mut pool = CacheOfNamedValues::default();
        for (request, names) in [(1, ["a", "b"]), (2, ["c", "d"]), (3, ["e", "f"])] {
            for name in names {
                pool.insert(name, key("1"), Arc::new(1), 10);
            }
            end_request(&mut pool, true, request, 30);
        }
        let mut is_kept = |name| pool.get(&name, key("1")).is_some();
        assert!(!is_kept("a") && !is_kept("b"), "newer values take 20 of 30 bytes");
        assert!(is_kept("c") && is_kept("d") && is_kept("e"));
        // Reuse the second request's values, so that the third request's unused value is now the oldest.
        end_request(&mut pool, true, 4, 30);
        pool.insert("g", key("1"), Arc::new(1), 30);
        end_request(&mut pool, true, 5, 30);
        let mut is_kept = |name| pool.get(&name, key("1")).is_some();
        assert!(is_kept("c") && is_kept("d") && is_kept("e") && is_kept("g") && !is_kept("f"));
    }
}
