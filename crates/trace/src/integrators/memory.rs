//! Buffers that each thread reuses for its batches.

use std::cell::RefCell;

use super::direct::queue::DirectLightQueue;
use super::transport::scratch::TraceBuffers;

/// Buffers that all batches of a thread share.
#[derive(Default)]
pub struct ThreadMemory {
    /// Queues of rays and hits.
    pub scratch: TraceBuffers,
    /// Vertices of the current bounce that await direct lighting.
    pub direct: DirectLightQueue,
}

impl ThreadMemory {
    /// Takes the buffers of this thread's previous tile; [`ThreadMemory::return_to_thread`] gives them back.
    pub fn take_from_thread() -> Self {
        MEMORY.take()
    }

    /// Keeps the buffers for this thread's next tile.
    pub fn return_to_thread(self) {
        MEMORY.set(self);
    }
}

thread_local! {
    static MEMORY: RefCell<ThreadMemory> = RefCell::default();
}
