//! Values kept from request to request.

use std::collections::{BTreeMap, HashMap};
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
    pub(super) fn latest(&self) -> Option<&T> {
        self.last.as_ref().map(|(_, value)| value)
    }

    /// Remember the value and what it was made of, in place of the last one.
    pub(super) fn set(&mut self, key: Key, value: T) {
        self.last = Some((key, value));
    }
}

/// Values by name, each valid for one key: loaded files and what is built from them. What no request needs any more stays while there
/// is room, so that a scene that is switched back to finds it.
#[derive(Debug)]
pub(super) struct Pool<N, T> {
    entries: HashMap<N, Entry<T>>,
}

#[derive(Debug)]
struct Entry<T> {
    key: Key,
    value: Arc<T>,
    bytes: usize,
    /// Asked for since the last sweep.
    used: bool,
    /// Needed by the last request that succeeded.
    proven: bool,
    /// The number of the last request that asked for it.
    request: u64,
}

/// Something that no request needs any more: the number of the last one that did, and its bytes.
pub(super) type Spare = (u64, usize);

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

    /// Keep this value, which takes so many bytes, in place of an older one.
    pub(super) fn insert(&mut self, name: N, key: Key, (value, bytes): (Arc<T>, usize)) {
        self.entries.insert(name, Entry { key, value, bytes, used: true, proven: false, request: 0 });
    }

    /// End of the request of this number. After one that failed, what the last good one needed is no spare, so that mending a
    /// typing error loads nothing again.
    pub(super) fn end(&mut self, success: bool, request: u64) {
        for entry in self.entries.values_mut() {
            entry.request = if entry.used { request } else { entry.request };
            entry.proven = if success { entry.used } else { entry.proven };
            entry.used = false;
        }
    }

    /// Values that no request needs any more.
    pub(super) fn spares(&self) -> impl Iterator<Item = Spare> {
        self.entries.values().filter(|entry| !entry.proven).map(|entry| (entry.request, entry.bytes))
    }

    /// Drop the spares that no request from this number on asked for.
    pub(super) fn drop_before(&mut self, request: u64) {
        self.entries.retain(|_, entry| entry.proven || entry.request >= request);
    }
}

/// The number of the first request whose spares have room, together with those of all later ones. What a request made goes as a
/// whole: half of a scene is of little use, and a tree holds those that it is over.
pub(super) fn first_with_room(spares: impl Iterator<Item = Spare>, most_bytes: usize) -> u64 {
    let mut bytes_of = BTreeMap::<u64, usize>::new();
    for (request, bytes) in spares {
        *bytes_of.entry(request).or_default() += bytes;
    }
    let mut total = 0;
    let has_room = |(_, bytes): &(&u64, &usize)| {
        total += **bytes;
        total <= most_bytes
    };
    bytes_of.iter().rev().take_while(has_room).last().map_or(u64::MAX, |(request, _)| *request)
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

    const NOTHING: usize = 0;

    /// End of a request; spares may take so many bytes.
    fn end(pool: &mut Pool<&str, i32>, success: bool, request: u64, most_bytes: usize) {
        pool.end(success, request);
        pool.drop_before(first_with_room(pool.spares(), most_bytes));
    }

    #[test]
    fn what_a_good_request_did_not_use_is_dropped_where_there_is_no_room() {
        let mut pool = Pool::default();
        pool.insert("x", key("1"), (Arc::new(1), 10));
        pool.insert("y", key("1"), (Arc::new(2), 10));
        end(&mut pool, true, 1, NOTHING);
        assert!(pool.get(&"x", key("1")).is_some());
        assert!(pool.get(&"x", key("2")).is_none(), "another content");
        end(&mut pool, true, 2, NOTHING);
        assert!(pool.get(&"y", key("1")).is_none());
        assert!(pool.get(&"x", key("1")).is_some());
    }

    #[test]
    fn a_failed_request_keeps_what_the_last_good_one_used_and_bounds_the_rest() {
        let mut pool = Pool::default();
        pool.insert("good", key("1"), (Arc::new(1), 10));
        end(&mut pool, true, 1, NOTHING);
        pool.insert("wrong", key("1"), (Arc::new(2), 10));
        end(&mut pool, false, 2, NOTHING);
        end(&mut pool, false, 3, NOTHING);
        assert!(pool.get(&"good", key("1")).is_some());
        assert!(pool.get(&"wrong", key("1")).is_none());
    }

    #[test]
    fn spares_stay_while_there_is_room_and_the_oldest_scene_goes_as_a_whole() {
        let mut pool = Pool::default();
        for (request, names) in [(1, ["a", "b"]), (2, ["c", "d"]), (3, ["e", "f"])] {
            for name in names {
                pool.insert(name, key("1"), (Arc::new(1), 10));
            }
            end(&mut pool, true, request, 30);
        }
        let mut there = |name| pool.get(&name, key("1")).is_some();
        assert!(!there("a") && !there("b"), "20 bytes of 30 are taken by a newer one");
        assert!(there("c") && there("d") && there("e"));
        // The second request makes a value the newest one; the value that it replaces is then the oldest.
        end(&mut pool, true, 4, 30);
        pool.insert("g", key("1"), (Arc::new(1), 30));
        end(&mut pool, true, 5, 30);
        let mut there = |name| pool.get(&name, key("1")).is_some();
        assert!(there("c") && there("d") && there("e") && there("g") && !there("f"));
    }
}
