//! Which threads go first.

/// Less urgent by this: the front end gets ten times the share of a processor that both want.
#[cfg(target_os = "linux")]
const STEPS: i32 = 10;

/// Lets all other threads go before this one from now on, those of the terminal and of the shell behind it as well. Where the
/// system knows no such thing, nothing changes.
pub fn lower() {
    // On Linux the nice value belongs to the thread, elsewhere to the whole process (nice(2), sched(7)).
    #[cfg(target_os = "linux")]
    // A refusal leaves it as it was.
    let _ = rustix::process::nice(STEPS);
}
