//! Thread priorities.
//!
//! A nice value determines how much a thread yields to others: a value 10 higher leaves about a tenth of the
//! share when both want the processor.

/// Raises the nice value of this thread and the threads it starts from now on, or of the whole process
/// outside Linux (nice(2), sched(7)). Does nothing for 0 or if the system refuses.
pub fn lower_priority(steps: u8) {
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
        lower_priority(steps);
    }
}
