//! Cache for recent films. Switching back to an earlier setting reuses its film.

use super::film_state::FilmState;
use crate::scene::fingerprint::Fingerprint;
use crate::stages::AbortReason;

/// Memory limit for all films except the current one.
const MAX_KEPT_BYTES: u64 = 256 << 20;

/// The current film and the cached films.
#[derive(Debug)]
pub(crate) struct FilmCache {
    current: Option<FilmState>,
    /// Cached films, least recently used first.
    kept: Vec<FilmState>,
    /// Key of the pinned film, which is kept regardless of its size.
    pinned: Option<Fingerprint>,
    max_kept_bytes: u64,
    /// Number of films created so far.
    made: u64,
}

impl Default for FilmCache {
    fn default() -> Self {
        Self { current: None, kept: Vec::new(), pinned: None, max_kept_bytes: MAX_KEPT_BYTES, made: 0 }
    }
}

impl FilmCache {
    pub(crate) fn current(&self) -> Option<&FilmState> {
        self.current.as_ref()
    }

    /// Returns the current film.
    ///
    /// # Errors
    /// There is no film.
    pub(crate) fn current_or_error(&self) -> Result<&FilmState, AbortReason> {
        self.current().ok_or_else(|| AbortReason::from_work_error("the film is missing"))
    }

    pub(crate) fn current_mut(&mut self) -> Option<&mut FilmState> {
        self.current.as_mut()
    }

    /// Returns the film with this key.
    pub(crate) fn get(&self, key: Fingerprint) -> Option<&FilmState> {
        self.kept.iter().chain(&self.current).find(|state| state.key == key)
    }

    /// Pins the film with this key, replacing any previous pin.
    pub(crate) fn pin(&mut self, key: Fingerprint) {
        self.pinned = Some(key);
    }

    /// Unpins the pinned film.
    pub(crate) fn unpin(&mut self) {
        self.pinned = None;
    }

    /// Limits the total size of the cached films, not counting the current and the pinned film. Evicts films
    /// to stay within the limit.
    pub(crate) fn set_byte_limit(&mut self, bytes: u64) {
        self.max_kept_bytes = bytes.min(MAX_KEPT_BYTES);
        self.make_room(0);
    }

    /// Makes the film with this key current if it is cached and usable. Otherwise, leaves no film current.
    /// Caches the previous film if there is room.
    pub(crate) fn switch_to_cached(&mut self, key: Fingerprint, is_usable: impl FnOnce(&FilmState) -> bool) {
        if self.current.as_ref().is_none_or(|current| current.key != key) {
            let kept = self.kept.iter().position(|state| state.key == key);
            let found = kept.map(|index| self.kept.remove(index));
            if let Some(before) = std::mem::replace(&mut self.current, found) {
                self.insert_if_worth_keeping(before);
            }
        }
        self.current.take_if(|current| !is_usable(current));
    }

    /// Replaces the current film. If `make` fails, drops the cached films to free memory and tries again.
    ///
    /// # Errors
    /// Returns the error from `make`.
    pub(crate) fn replace_current_with_retry<E>(
        &mut self,
        make: impl Fn() -> Result<FilmState, E>,
    ) -> Result<&mut FilmState, E> {
        self.current = None;
        let mut state = match make() {
            Err(_) if !self.kept.is_empty() => {
                let pinned = self.pinned;
                self.kept.retain(|state| pinned == Some(state.key));
                make()
            }
            made => made,
        }?;
        self.made += 1;
        state.number = self.made;
        Ok(self.current.insert(state))
    }

    /// Returns the number of films in memory.
    pub(crate) fn count(&self) -> usize {
        self.kept.len() + usize::from(self.current.is_some())
    }

    /// Returns the memory used by all films, in bytes.
    pub(crate) fn memory_bytes(&self) -> u64 {
        self.kept.iter().chain(&self.current).map(FilmState::memory_bytes).sum()
    }

    /// Caches a film, evicting others to make room. A film larger than the limit is dropped instead.
    fn insert_if_worth_keeping(&mut self, state: FilmState) {
        let size = state.memory_bytes();
        // Drop incomplete films from a moving camera, which would fill the cache but are never reused.
        let is_left_behind = state.is_passing && !state.has_sampled_all_pixels();
        if !state.has_samples() {
            return;
        }
        if !self.is_pinned(&state) {
            if size > self.max_kept_bytes || is_left_behind {
                return;
            }
            self.make_room(size);
        }
        self.kept.push(state);
    }

    fn is_pinned(&self, state: &FilmState) -> bool {
        self.pinned == Some(state.key)
    }

    /// Drops the least recently used films until `size` fits.
    fn make_room(&mut self, size: u64) {
        let is_counted = |state: &&FilmState| !self.is_pinned(state);
        let mut used: u64 = self.kept.iter().filter(is_counted).map(FilmState::memory_bytes).sum();
        let (pinned, most) = (self.pinned, self.max_kept_bytes);
        self.kept.retain(|state| {
            let is_dropped = used + size > most && pinned != Some(state.key);
            used -= if is_dropped { state.memory_bytes() } else { 0 };
            !is_dropped
        });
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::film::ConvergenceModel;
    use crate::plan::resolve_plan;
    use crate::scene::fingerprint::FingerprintHasher;
    use crate::tests::loaded_of;

    fn key(name: &str) -> Fingerprint {
        FingerprintHasher::new(name).finish()
    }

    /// Creates a film with 64×32 pixels and some samples.
    fn state(name: &str) -> FilmState {
        let scene = loaded_of("[render]\nwidth = 64\nheight = 32\n").scene;
        let plan = resolve_plan(&scene, Path::new("a.toml"), &Default::default()).expect("a plan");
        let mut state =
            FilmState::new(key(name), &plan, u64::MAX, ConvergenceModel::Stratified, None).expect("a film");
        state.done.fill([1; 2]);
        state
    }

    fn films(names: &[&str], max_kept_bytes: u64) -> FilmCache {
        let mut films = FilmCache { max_kept_bytes, ..FilmCache::default() };
        for name in names {
            films.switch_to_cached(key(name), |_| true);
            films.replace_current_with_retry(|| Ok::<_, ()>(state(name))).expect("a film");
        }
        films
    }

    fn finds(films: &mut FilmCache, name: &str) -> bool {
        films.switch_to_cached(key(name), |_| true);
        films.current().is_some_and(|current| current.key == key(name))
    }

    #[test]
    fn least_recently_used_film_is_dropped_first() {
        let room_for_two = 2 * state("a").memory_bytes();
        let mut films = films(&["a", "b", "c"], room_for_two);
        assert_eq!(films.count(), 3);
        assert_eq!(films.memory_bytes(), 3 * state("a").memory_bytes());
        assert!(finds(&mut films, "a"), "the oldest film should still be cached");
        assert!(!finds(&mut films, "d"), "d should not be cached");
        assert!(finds(&mut films, "a") && finds(&mut films, "c"));
        assert!(!finds(&mut films, "b"));
    }

    #[test]
    fn oversized_film_does_not_evict_others() {
        let mut films = films(&["a", "b"], state("a").memory_bytes());
        films
            .replace_current_with_retry(|| {
                let mut large = state("large");
                large.base = Some(crate::film::RadianceImage::black(100, 100));
                Ok::<_, ()>(large)
            })
            .expect("a film");
        assert!(finds(&mut films, "a"));
        assert!(!finds(&mut films, "large"));
    }

    #[test]
    fn pinned_film_is_kept_regardless_of_size() {
        let mut films = films(&["own"], state("a").memory_bytes());
        films.pin(key("own"));
        films.max_kept_bytes -= 1;
        for name in ["a", "b", "c"] {
            films.switch_to_cached(key(name), |_| true);
            films.replace_current_with_retry(|| Ok::<_, ()>(state(name))).expect("a film");
        }
        assert_eq!(films.count(), 2, "only the pinned and the current film should remain");
        let tries = std::cell::Cell::new(0);
        let made = films.replace_current_with_retry(|| {
            tries.set(tries.get() + 1);
            if tries.get() == 1 { Err("no memory") } else { Ok(state("d")) }
        });
        assert!(made.is_ok() && finds(&mut films, "own"));
        // Once another film is pinned, the first film is treated like any other.
        films.pin(key("other"));
        assert!(!finds(&mut films, "d"));
        assert!(!finds(&mut films, "own"));
    }

    #[test]
    fn moving_camera_keeps_only_complete_films() {
        for is_whole in [false, true] {
            let mut films = films(&["a"], u64::MAX);
            films.switch_to_cached(key("b"), |_| true);
            let passing = || {
                let mut passing = state("b");
                passing.is_passing = true;
                passing.done[0] = [u32::from(is_whole); 2];
                Ok::<_, ()>(passing)
            };
            films.replace_current_with_retry(passing).expect("a film");
            films.switch_to_cached(key("c"), |_| true);
            assert_eq!(finds(&mut films, "b"), is_whole);
            assert!(finds(&mut films, "a"));
        }
    }

    #[test]
    fn cached_films_are_dropped_when_out_of_memory() {
        let mut films = films(&["a", "b"], u64::MAX);
        films.switch_to_cached(key("a"), |_| false);
        assert!(films.current().is_none() && !finds(&mut films, "a") && finds(&mut films, "b"));
        films.switch_to_cached(key("c"), |_| true);
        let tries = std::cell::Cell::new(0);
        let made = films.replace_current_with_retry(|| {
            tries.set(tries.get() + 1);
            if tries.get() == 1 { Err("no memory") } else { Ok(state("c")) }
        });
        assert!(made.is_ok());
        assert_eq!(films.count(), 1);
    }
}
