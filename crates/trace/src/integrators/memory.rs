//! Memory of a thread's batches.

use std::cell::RefCell;

use super::direct::queue::DirectLightQueue;
use super::transport::scratch::Scratch;

/// Memory that each batch of a thread uses again.
#[derive(Default)]
pub struct Memory {
    /// Queues of rays and hits.
    pub scratch: Scratch,
    /// Vertices of a round that wait for direct light.
    pub direct: DirectLightQueue,
}

impl Memory {
    /// The memory that this thread left after its last tile; [`Memory::leave`] keeps it for the next.
    pub fn of_thread() -> Self {
        MEMORY.take()
    }

    /// Keeps the memory for the next tile of this thread.
    pub fn leave(self) {
        MEMORY.set(self);
    }
}

thread_local! {
    static MEMORY: RefCell<Memory> = RefCell::default();
}
