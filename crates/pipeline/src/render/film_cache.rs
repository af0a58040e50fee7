//! The films of the last settings: a toggle that is switched back finds its film again.

use super::film_state::FilmState;
use crate::scene::fingerprint::Key;

/// Memory for films that are not the current one.
const MOST_KEPT_BYTES: u64 = 256 << 20;

/// The current film and those before it.
#[derive(Debug)]
pub(crate) struct FilmCache {
    current: Option<FilmState>,
    /// The least recently used first.
    kept: Vec<FilmState>,
    /// Key of a film that stays whatever room it takes.
    pinned: Option<Key>,
    most_kept_bytes: u64,
    /// Films that were made so far.
    made: u64,
}

impl Default for FilmCache {
    fn default() -> Self {
        Self { current: None, kept: Vec::new(), pinned: None, most_kept_bytes: MOST_KEPT_BYTES, made: 0 }
    }
}

impl FilmCache {
    pub(crate) fn current(&self) -> Option<&FilmState> {
        self.current.as_ref()
    }

    pub(crate) fn current_mut(&mut self) -> Option<&mut FilmState> {
        self.current.as_mut()
    }

    /// The film of this key.
    pub(crate) fn of(&self, key: Key) -> Option<&FilmState> {
        self.kept.iter().chain(&self.current).find(|canvas| canvas.key == key)
    }

    /// Keeps the film of this key from now on, and no longer the one that was pinned before.
    pub(crate) fn pin(&mut self, key: Key) {
        self.pinned = Some(key);
    }

    /// Pins no film from now on.
    pub(crate) fn unpin(&mut self) {
        self.pinned = None;
    }

    /// Drops films until the others fit into so many bytes, as films that are kept from now on must. The current film and the pinned
    /// one do not count.
    pub(crate) fn limit(&mut self, bytes: u64) {
        self.most_kept_bytes = bytes.min(MOST_KEPT_BYTES);
        self.make_room(0);
    }

    /// Makes the film of this key the current one, if it is kept and of use; else there is no current film. Keeps the film
    /// before, if there is room.
    pub(crate) fn select(&mut self, key: Key, is_usable: impl FnOnce(&FilmState) -> bool) {
        if self.current.as_ref().is_none_or(|current| current.key != key) {
            let kept = self.kept.iter().position(|canvas| canvas.key == key);
            let found = kept.map(|index| self.kept.remove(index));
            if let Some(before) = std::mem::replace(&mut self.current, found) {
                self.keep(before);
            }
        }
        self.current.take_if(|current| !is_usable(current));
    }

    /// A film in the place of the current one. Where there is no memory for it beside those that are kept, they go.
    ///
    /// # Errors
    /// Those of `make`.
    pub(crate) fn put<E>(&mut self, make: impl Fn() -> Result<FilmState, E>) -> Result<&mut FilmState, E> {
        self.current = None;
        let mut canvas = match make() {
            Err(_) if !self.kept.is_empty() => {
                let pinned = self.pinned;
                self.kept.retain(|canvas| pinned == Some(canvas.key));
                make()
            }
            made => made,
        }?;
        self.made += 1;
        canvas.number = self.made;
        Ok(self.current.insert(canvas))
    }

    /// Number of films.
    pub(crate) fn count(&self) -> usize {
        self.kept.len() + usize::from(self.current.is_some())
    }

    /// Bytes that all of them take.
    pub(crate) fn memory_bytes(&self) -> u64 {
        self.kept.iter().chain(&self.current).map(FilmState::memory_bytes).sum()
    }

    /// One too large for the budget is dropped alone; the others make room for one that is not.
    fn keep(&mut self, canvas: FilmState) {
        let size = canvas.memory_bytes();
        // A camera on its way would fill the memory with what nobody comes back to.
        let is_left_behind = canvas.is_passing && !canvas.is_covered();
        if !canvas.is_begun() {
            return;
        }
        if !self.is_pinned(&canvas) {
            if size > self.most_kept_bytes || is_left_behind {
                return;
            }
            self.make_room(size);
        }
        self.kept.push(canvas);
    }

    fn is_pinned(&self, canvas: &FilmState) -> bool {
        self.pinned == Some(canvas.key)
    }

    /// Drops the least recently used films until one of this size fits.
    fn make_room(&mut self, size: u64) {
        let is_counted = |canvas: &&FilmState| !self.is_pinned(canvas);
        let mut used: u64 = self.kept.iter().filter(is_counted).map(FilmState::memory_bytes).sum();
        let (pinned, most) = (self.pinned, self.most_kept_bytes);
        self.kept.retain(|canvas| {
            let is_dropped = used + size > most && pinned != Some(canvas.key);
            used -= if is_dropped { canvas.memory_bytes() } else { 0 };
            !is_dropped
        });
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::film::Convergence;
    use crate::plan::plan;
    use crate::scene::fingerprint::Fingerprint;
    use crate::tests::loaded_of;

    fn key(name: &str) -> Key {
        Fingerprint::new(name).finish()
    }

    /// A film of 64×32 pixels, with samples.
    fn canvas(name: &str) -> FilmState {
        let scene = loaded_of("[render]\nwidth = 64\nheight = 32\n").scene;
        let plan = plan(&scene, Path::new("a.toml"), &Default::default()).expect("a plan");
        let mut canvas =
            FilmState::new(key(name), &plan, u64::MAX, Convergence::Stratified, None).expect("a film");
        canvas.done.fill([1; 2]);
        canvas
    }

    fn films(names: &[&str], most_kept_bytes: u64) -> FilmCache {
        let mut films = FilmCache { most_kept_bytes, ..FilmCache::default() };
        for name in names {
            films.select(key(name), |_| true);
            films.put(|| Ok::<_, ()>(canvas(name))).expect("a film");
        }
        films
    }

    fn finds(films: &mut FilmCache, name: &str) -> bool {
        films.select(key(name), |_| true);
        films.current().is_some_and(|current| current.key == key(name))
    }

    #[test]
    fn the_least_recently_used_go_first() {
        let room_for_two = 2 * canvas("a").memory_bytes();
        let mut films = films(&["a", "b", "c"], room_for_two);
        assert_eq!(films.count(), 3);
        assert_eq!(films.memory_bytes(), 3 * canvas("a").memory_bytes());
        assert!(finds(&mut films, "a"), "the oldest is there, and is now the newest");
        assert!(!finds(&mut films, "d"), "never seen; a, b and c do not all fit beside it");
        assert!(finds(&mut films, "a") && finds(&mut films, "c"));
        assert!(!finds(&mut films, "b"));
    }

    #[test]
    fn a_film_beyond_the_budget_is_dropped_and_costs_the_others_nothing() {
        let mut films = films(&["a", "b"], canvas("a").memory_bytes());
        films
            .put(|| {
                let mut large = canvas("large");
                large.base = Some(crate::film::RadianceImage::black(100, 100));
                Ok::<_, ()>(large)
            })
            .expect("a film");
        assert!(finds(&mut films, "a"));
        assert!(!finds(&mut films, "large"));
    }

    #[test]
    fn the_pinned_film_stays_whatever_room_it_takes() {
        let mut films = films(&["own"], canvas("a").memory_bytes());
        films.pin(key("own"));
        films.most_kept_bytes -= 1;
        for name in ["a", "b", "c"] {
            films.select(key(name), |_| true);
            films.put(|| Ok::<_, ()>(canvas(name))).expect("a film");
        }
        assert_eq!(films.count(), 2, "the pinned one and the current one");
        let tries = std::cell::Cell::new(0);
        let made = films.put(|| {
            tries.set(tries.get() + 1);
            if tries.get() == 1 { Err("no memory") } else { Ok(canvas("d")) }
        });
        assert!(made.is_ok() && finds(&mut films, "own"));
        // Another film is pinned: this one is as good as any.
        films.pin(key("other"));
        assert!(!finds(&mut films, "d"));
        assert!(!finds(&mut films, "own"));
    }

    #[test]
    fn of_a_camera_on_its_way_only_whole_pictures_are_kept() {
        for is_whole in [false, true] {
            let mut films = films(&["a"], u64::MAX);
            films.select(key("b"), |_| true);
            let passing = || {
                let mut passing = canvas("b");
                passing.is_passing = true;
                passing.done[0] = [u32::from(is_whole); 2];
                Ok::<_, ()>(passing)
            };
            films.put(passing).expect("a film");
            films.select(key("c"), |_| true);
            assert_eq!(finds(&mut films, "b"), is_whole);
            assert!(finds(&mut films, "a"));
        }
    }

    #[test]
    fn what_is_of_no_use_is_dropped_and_kept_films_make_room_for_a_new_one() {
        let mut films = films(&["a", "b"], u64::MAX);
        films.select(key("a"), |_| false);
        assert!(films.current().is_none() && !finds(&mut films, "a") && finds(&mut films, "b"));
        films.select(key("c"), |_| true);
        let tries = std::cell::Cell::new(0);
        let made = films.put(|| {
            tries.set(tries.get() + 1);
            if tries.get() == 1 { Err("no memory") } else { Ok(canvas("c")) }
        });
        assert!(made.is_ok());
        assert_eq!(films.count(), 1);
    }
}
