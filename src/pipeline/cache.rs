//! Values kept from request to request.

use std::collections::HashMap;
use std::hash::Hash;
use std::sync::Arc;

use crate::scene::fingerprint::Key;

/// The last value of a stage that makes one value.
#[derive(Debug)]
pub(super) struct Memo<T> {
    last: Option<(Key, T)>,
}

impl<T> Default for Memo<T> {
    fn default() -> Self {
        Self { last: None }
    }
}

impl<T> Memo<T> {
    /// The last value, if it was made of these inputs.
    pub(super) fn get(&self, key: Key) -> Option<&T> {
        self.last.as_ref().filter(|(of, _)| *of == key).map(|(_, value)| value)
    }

    /// The last value, whatever it was made of.
    #[cfg(test)]
    pub(super) fn latest(&self) -> Option<&T> {
        self.last.as_ref().map(|(_, value)| value)
    }

    /// Remember the value and what it was made of, in place of the last one.
    pub(super) fn set(&mut self, key: Key, value: T) {
        self.last = Some((key, value));
    }
}

/// Values by name, each valid for one key: loaded files and what is built from them.
#[derive(Debug)]
pub(super) struct Pool<N, T> {
    entries: HashMap<N, Entry<T>>,
}

#[derive(Debug)]
struct Entry<T> {
    key: Key,
    value: Arc<T>,
    /// Asked for since the last sweep.
    used: bool,
    /// Needed by the last request that succeeded.
    proven: bool,
}

impl<N, T> Default for Pool<N, T> {
    fn default() -> Self {
        Self { entries: HashMap::new() }
    }
}

impl<N: Hash + Eq, T> Pool<N, T> {
    /// The value of this name, if it was made of these inputs.
    pub(super) fn get(&mut self, name: &N, key: Key) -> Option<Arc<T>> {
        let entry = self.entries.get_mut(name).filter(|entry| entry.key == key)?;
        entry.used = true;
        Some(entry.value.clone())
    }

    /// The value of this name, whatever it was made of.
    pub(super) fn latest(&self, name: &N) -> Option<&Arc<T>> {
        self.entries.get(name).map(|entry| &entry.value)
    }

    /// Keep this value in place of an older one.
    pub(super) fn insert(&mut self, name: N, key: Key, value: Arc<T>) {
        self.entries.insert(name, Entry { key, value, used: true, proven: false });
    }

    /// End of a request: drop what nobody asked for. After a request that failed, what the last good one needed
    /// stays too, so that mending a typing error loads nothing again.
    pub(super) fn sweep(&mut self, success: bool) {
        self.entries.retain(|_, entry| entry.used || (!success && entry.proven));
        for entry in self.entries.values_mut() {
            entry.proven = if success { entry.used } else { entry.proven };
            entry.used = false;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::fingerprint::Fingerprint;

    fn key(name: &str) -> Key {
        Fingerprint::new(name).finish()
    }

    #[test]
    fn a_memo_knows_one_key() {
        let mut memo = Memo::default();
        memo.set(key("a"), 1);
        assert_eq!(memo.get(key("a")), Some(&1));
        assert_eq!(memo.get(key("b")), None);
        assert_eq!(memo.latest(), Some(&1));
    }

    #[test]
    fn what_a_good_request_did_not_use_is_dropped() {
        let mut pool = Pool::default();
        pool.insert("x", key("1"), Arc::new(1));
        pool.insert("y", key("1"), Arc::new(2));
        pool.sweep(true);
        assert!(pool.get(&"x", key("1")).is_some());
        assert!(pool.get(&"x", key("2")).is_none(), "another content");
        pool.sweep(true);
        assert!(pool.get(&"y", key("1")).is_none());
        assert!(pool.get(&"x", key("1")).is_some());
    }

    #[test]
    fn a_failed_request_keeps_what_the_last_good_one_used_and_bounds_the_rest() {
        let mut pool = Pool::default();
        pool.insert("good", key("1"), Arc::new(1));
        pool.sweep(true);
        pool.insert("wrong", key("1"), Arc::new(2));
        pool.sweep(false);
        pool.sweep(false);
        assert!(pool.get(&"good", key("1")).is_some());
        assert!(pool.get(&"wrong", key("1")).is_none());
    }
}
