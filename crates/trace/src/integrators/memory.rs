//! Per-thread buffers, reused for successive batches.

use std::cell::RefCell;

use super::direct::queue::DirectLightVertexQueue;
use super::layers::SampleBatchLayerValues;
use super::transport::accumulator::PathDiffuseFractions;
use super::transport::scratch::TraceBuffers;

/// Buffers that a thread reuses for all of its batches.
#[derive(Default)]
pub struct ThreadMemory {
    /// Queues of rays and hits.
    pub scratch: TraceBuffers,
    /// Vertices of the current bounce that await direct lighting.
    pub direct: DirectLightVertexQueue,
    /// Diffuse fractions of the paths, if layers are recorded.
    pub fractions: PathDiffuseFractions,
    /// Values of the layers, if there are any.
    pub layers: SampleBatchLayerValues,
}

impl ThreadMemory {
    /// Takes the buffers used for this thread's previous tile. Use [`ThreadMemory::return_to_thread`] to
    /// return them.
    pub fn take_from_thread() -> Self {
        MEMORY.take()
    }

    /// Stores the buffers for this thread's next tile.
    pub fn return_to_thread(self) {
        MEMORY.set(self);
    }
}

thread_local! {
    static MEMORY: RefCell<ThreadMemory> = RefCell::default();
}
