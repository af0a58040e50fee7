//! Eviction of values cached for earlier scenes.

use super::Engine;
use crate::cache::first_with_room;

/// Memory limit for files and trees that the current scene does not need.
const MAX_SPARE_BYTES: usize = 256 << 20;

impl Engine {
    /// Ends a request. If it succeeded, values that it did not use become eviction candidates.
    pub(super) fn end(&mut self, success: bool) {
        self.requests += 1;
        self.meshes.end(success, self.requests);
        self.textures.end(success, self.requests);
        self.accel.end(success, self.requests);
        let meshes = self.meshes.eviction_candidates();
        let candidates =
            meshes.chain(self.textures.eviction_candidates()).chain(self.accel.eviction_candidates());
        let first = first_with_room(candidates, MAX_SPARE_BYTES);
        self.meshes.drop_before(first);
        self.textures.drop_before(first);
        self.accel.drop_before(first);
    }
}
