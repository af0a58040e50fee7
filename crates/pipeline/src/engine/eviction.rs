//! Evicts values cached for earlier scenes.

use super::Engine;
use crate::cache::oldest_request_to_keep;

/// Memory limit for cached files and trees that the current scene does not need.
const MAX_SPARE_BYTES: usize = 256 << 20;

impl Engine {
    /// Ends a request. If it succeeded, values that it did not use become eviction candidates.
    pub(super) fn record_request_usage(&mut self, success: bool) {
        self.requests += 1;
        self.meshes.record_request_usage(success, self.requests);
        self.textures.record_request_usage(success, self.requests);
        self.accel.record_request_usage(success, self.requests);
        let meshes = self.meshes.eviction_candidates();
        let candidates =
            meshes.chain(self.textures.eviction_candidates()).chain(self.accel.eviction_candidates());
        let first = oldest_request_to_keep(candidates, MAX_SPARE_BYTES);
        self.meshes.evict_unused_before(first);
        self.textures.evict_unused_before(first);
        self.accel.evict_unused_before(first);
    }
}
