//! Priorities of threads.
//!
//! A nice value says how much a thread yields to others: with 10 more, it gets a tenth of the share when both want a
//! processor.

/// Raises the nice value of this thread and of those that it starts from now on; outside Linux that of the whole process
/// (nice(2), sched(7)). With 0, or if the system refuses, nothing changes.
pub fn give_way(steps: u8) {
    #[cfg(unix)]
    if steps > 0 {
        let _ = rustix::process::nice(i32::from(steps));
    }
    #[cfg(not(unix))]
    let _ = steps;
}

/// Raises the nice value of this thread, if threads have one of their own; else nothing changes.
pub fn give_way_alone(steps: u8) {
    if cfg!(target_os = "linux") {
        give_way(steps);
    }
}
