//! Values of earlier scenes, kept while there is room.

use super::Engine;
use crate::cache::first_with_room;

/// Memory for files and trees that the scene at hand does not need.
const MOST_SPARE_BYTES: usize = 256 << 20;

impl Engine {
    /// End of a request: what it did not ask for is spare if it succeeded.
    pub(super) fn end(&mut self, success: bool) {
        self.requests += 1;
        self.meshes.end(success, self.requests);
        self.textures.end(success, self.requests);
        self.accel.end(success, self.requests);
        let spares = self.meshes.spares().chain(self.textures.spares()).chain(self.accel.spares());
        let first = first_with_room(spares, MOST_SPARE_BYTES);
        self.meshes.drop_before(first);
        self.textures.drop_before(first);
        self.accel.drop_before(first);
    }
}
