//! Nice values of render threads, as reported by the system (proc(5)).

use std::fs;
use std::io::{BufRead, BufReader};
use std::process::{Command as Process, Stdio};
use std::time::{Duration, Instant};

use super::test_dir::{SCENE, TestDir};

/// Time limit for any wait, long enough for a busy machine.
const LIMIT: Duration = Duration::from_secs(60);

/// Name and nice value of a thread, from its `stat` line in /proc.
fn of_thread(stat: &str) -> Option<(String, i32)> {
    let (name, after) = stat.split_once('(')?.1.rsplit_once(')')?;
    // The state, which follows the name, is the third field. The nice value is the 19th.
    Some((name.to_owned(), after.split_whitespace().nth(16)?.parse().ok()?))
}

/// The nice value that child processes inherit.
fn inherited_niceness() -> i32 {
    let stat = fs::read_to_string("/proc/thread-self/stat").expect("the stat line of this thread");
    of_thread(&stat).expect("a nice value").1
}

/// The inherited nice value plus `steps`, up to the system's limit.
pub(crate) fn raised_niceness(steps: i32) -> i32 {
    (inherited_niceness() + steps).min(19)
}

/// Nice values of a process's render threads.
pub(crate) fn of_render_threads(id: u32) -> Vec<i32> {
    let tasks = fs::read_dir(format!("/proc/{id}/task")).expect("its threads");
    let stats = tasks.filter_map(|task| fs::read_to_string(task.ok()?.path().join("stat")).ok());
    let is_render = |name: &str| name.strip_prefix("glimt-").is_some_and(|rest| rest.parse::<u32>().is_ok());
    stats
        .filter_map(|stat| of_thread(&stat))
        .filter(|(name, _)| is_render(name))
        .map(|(_, nice)| nice)
        .collect()
}

/// The distinct nice values of at least two render threads. The program prints `sign` to stderr when it
/// starts to render.
fn of_program(mut process: Process, sign: &str) -> Vec<i32> {
    let mut child = process.stderr(Stdio::piped()).stdout(Stdio::null()).spawn().expect("it runs");
    let mut said = BufReader::new(child.stderr.take().expect("stderr"));
    let mut line = String::new();
    while !line.contains(sign) {
        line.clear();
        assert!(said.read_line(&mut line).expect("a line") > 0, "exited early");
    }
    let deadline = Instant::now() + LIMIT;
    let mut found = of_render_threads(child.id());
    while found.len() < 2 && Instant::now() < deadline {
        std::thread::sleep(Duration::from_millis(5));
        found = of_render_threads(child.id());
    }
    child.kill().expect("killed");
    child.wait().expect("it ends");
    assert!(found.len() >= 2, "{found:?}");
    found.sort_unstable();
    found.dedup();
    found
}

#[test]
fn once_and_bench_keep_priority_by_default() {
    let dir = TestDir::new();
    // More samples than the test can render.
    dir.write("long.toml", SCENE.replace("samples = 2", "samples = 4000000000"));
    let calls = [
        ("long.toml --once --threads 2 --progress json", "\"event\":\"progress\""),
        (
            "bench ball.toml --threads 2 --reference-samples 4000000000 --no-cache --progress json",
            "reference 1 of 2",
        ),
    ];
    for (call, sign) in calls {
        assert_eq!(of_program(dir.glimt(call), sign), [raised_niceness(0)], "{call}");
        assert_eq!(
            of_program(dir.glimt(&format!("{call} --nice 7")), sign),
            [raised_niceness(7)],
            "{call} --nice 7"
        );
    }
}
