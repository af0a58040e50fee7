//! `glimt check` as a process.

use std::process::{Command, Output, Stdio};
use std::sync::mpsc::channel;

use super::worker::{CASE_TIME_LIMIT, CaseDir, MAX_ATTEMPTS, first_terminal_control};
use super::{Case, Corpus, FuzzInput};
use crate::test_dir::PROGRAM;

/// The failed cases for a kind of file, each with the reason.
pub(super) fn check_all(kind: FuzzInput, seed: u64, count: u64) -> Vec<(Case, String)> {
    let dir = CaseDir::new();
    let material = Corpus::new();
    let cases = (0..count).map(|number| Case { kind, seed, number });
    let check = |case: Case| {
        let scene = dir.place_case(case, &material.make(case));
        let run = || run(Command::new(PROGRAM).arg("check").arg(&scene));
        let Some(output) = (0..MAX_ATTEMPTS).find_map(|_| run()) else {
            return Some((case, "took more than 2 s".to_owned()));
        };
        check_output(&output).err().map(|reason| (case, reason))
    };
    cases.filter_map(check).collect()
}

/// Runs a command. `None` if it takes too long.
fn run(command: &mut Command) -> Option<Output> {
    let child =
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("it runs");
    let process = nix::unistd::Pid::from_raw(child.id() as i32);
    let (send, output) = channel();
    let waiting = std::thread::spawn(move || send.send(child.wait_with_output()));
    let output = output.recv_timeout(CASE_TIME_LIMIT).ok().map(|output| output.expect("its output"));
    if output.is_none() {
        // The child has not been reaped, so its process ID cannot have been reused.
        let _ = nix::sys::signal::kill(process, nix::sys::signal::Signal::SIGKILL);
    }
    let _ = waiting.join();
    output
}

fn check_output(output: &Output) -> Result<(), String> {
    let code = output.status.code();
    let stderr = String::from_utf8(output.stderr.clone()).map_err(|_| "stderr is not UTF-8".to_owned())?;
    if code != Some(0) && code != Some(2) {
        return Err(format!("{}: {stderr}", output.status));
    }
    if code == Some(2) && !stderr.contains("error") {
        return Err(format!("rejected without a reason: {stderr}"));
    }
    let said = String::from_utf8_lossy(&output.stdout).into_owned() + &stderr;
    first_terminal_control(&said).map_or(Ok(()), |harmful| Err(format!("the message contains {harmful:?}")))
}
