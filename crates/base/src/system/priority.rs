//! Thread priorities.
//!
//! A thread's nice value determines how much it yields to other threads. When two threads compete for a
//! processor, a thread whose nice value is 10 higher gets about a tenth of the other thread's share.

/// Raises the nice value of this thread and the threads it starts later, or of the whole process on systems
/// other than Linux (nice(2), sched(7)). Does nothing if the increment is 0 or if the system refuses.
pub fn lower_priority_including_spawned_threads(steps: u8) {
    #[cfg(unix)]
    if steps > 0 {
        let _ = rustix::process::nice(i32::from(steps));
    }
    #[cfg(not(unix))]
    let _ = steps;
}

/// Raises the nice value of this thread on systems with per-thread nice values. Does nothing elsewhere.
pub fn lower_thread_priority(steps: u8) {
    if cfg!(target_os = "linux") {
        lower_priority_including_spawned_threads(steps);
    }
}
