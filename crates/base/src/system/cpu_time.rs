//! CPU time used by threads and processes.

use nix::time::{ClockId, clock_gettime};

/// CPU time used by this thread in seconds, or 0 if the system does not measure it. Excludes waiting time and
/// other threads.
pub fn thread_cpu_seconds() -> f64 {
    clock_seconds(ClockId::CLOCK_THREAD_CPUTIME_ID)
}

/// CPU time used by all threads of this process in seconds, or 0 if the system does not measure it.
pub fn process_cpu_seconds() -> f64 {
    clock_seconds(ClockId::CLOCK_PROCESS_CPUTIME_ID)
}

fn clock_seconds(clock: ClockId) -> f64 {
    let Ok(time) = clock_gettime(clock) else { return 0.0 };
    time.tv_sec() as f64 + 1e-9 * time.tv_nsec() as f64
}

#[cfg(test)]
mod tests {
    use std::time::{Duration, Instant};

    use super::*;

    #[test]
    fn sleeping_uses_no_cpu_time() {
        let (begin, before) = (Instant::now(), thread_cpu_seconds());
        std::thread::sleep(Duration::from_millis(30));
        let slept = thread_cpu_seconds() - before;
        // Limit the number of iterations because the system may lack this clock.
        let worked = (0..10_000_000).any(|_| thread_cpu_seconds() - before > slept + 0.01);
        assert!(worked || before == 0.0, "{slept}");
        assert!(begin.elapsed().as_secs_f64() >= slept + 0.03, "{slept}");
        assert!(process_cpu_seconds() >= thread_cpu_seconds() - 0.01, "it should include all threads");
    }
}
