//! The thread pool that reads files, builds trees and renders tiles.

use std::fmt::Display;
use std::sync::Arc;

use rayon::{ThreadPool, ThreadPoolBuilder};

use super::stages::AbortReason;
use crate::system::priority;
use crate::system::threads::{check_thread_stack_memory, describe_thread_start_failure};

/// The worker's thread pool.
#[derive(Default)]
pub(super) struct RenderThreads {
    pool: Option<Arc<ThreadPool>>,
    /// Niceness of the threads relative to the thread that starts them.
    nice: u8,
}

impl RenderThreads {
    pub(super) fn new(nice: u8) -> Self {
        Self { pool: None, nice }
    }

    /// Returns the current pool, or `None` before the first request.
    pub(super) fn current_pool(&self) -> Option<&Arc<ThreadPool>> {
        self.pool.as_ref()
    }

    /// Returns a pool with `count` threads, reusing the current pool if it already has that many.
    /// `has_threads_option` states whether an error may suggest `--threads`.
    ///
    /// # Errors
    /// The system cannot start the threads.
    pub(super) fn get_or_create_pool(
        &mut self,
        count: usize,
        has_threads_option: bool,
    ) -> Result<Arc<ThreadPool>, AbortReason> {
        if let Some(pool) = self.pool.as_ref().filter(|pool| pool.current_num_threads() == count) {
            return Ok(pool.clone());
        }
        self.pool = None;
        let name = |index| format!("glimt-{index}");
        let nice = self.nice;
        let begin = move |_| priority::lower_thread_priority(nice);
        let failed = |error: &dyn Display| {
            AbortReason::from_work_error(describe_thread_start_failure(count, has_threads_option, &error))
        };
        check_thread_stack_memory(count).map_err(|error| failed(&error))?;
        let builder = ThreadPoolBuilder::new().num_threads(count).thread_name(name).start_handler(begin);
        let pool = builder.build().map_err(|error| failed(&error))?;
        Ok(self.pool.insert(Arc::new(pool)).clone())
    }
}
