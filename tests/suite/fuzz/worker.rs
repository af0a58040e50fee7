//! Runs `check` in worker processes to detect stack overflows, hangs and excessive memory use.

use std::io::{BufRead, BufReader, Write};
use std::panic::{self, AssertUnwindSafe};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::Mutex;
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::Duration;

use glimt::pipeline::check_scene;
use glimt::pipeline::protocol::Failure;
use glimt::scene::report::{ReportStyle, render_diagnostics};
use nix::sys::resource::{Resource, setrlimit};

use super::seeds::{Seed, root};
use super::{Case, Corpus, FuzzInput};

/// Time limit per case.
pub(super) const CASE_TIME_LIMIT: Duration = Duration::from_secs(2);

/// Time limit for generating a case, which only a stalled machine exceeds.
const GENERATION_TIME_LIMIT: Duration = Duration::from_secs(120);

/// Maximum number of attempts at a slow case. A case may be slow only because the machine is busy.
pub(super) const MAX_ATTEMPTS: usize = 3;

/// Limit on resident memory, including the worker's own memory. The worst small file is an image whose pixels
/// are allocated before the file turns out to be too short.
const MEMORY_BYTES: u64 = 768 << 20;

/// Limit on virtual memory.
const ADDRESS_BYTES: u64 = 16 << 30;

/// Number of worker processes.
const WORKERS: u64 = 2;

/// Environment variable that turns a test process into a worker and specifies its cases.
const WORKER_CASES: &str = "GLIMT_FUZZ_WORKER";

/// The failed cases for a kind of file, each with the reason.
pub(super) fn check_all(kind: FuzzInput, seed: u64, count: u64) -> Vec<(Case, String)> {
    let failures = Mutex::new(Vec::new());
    std::thread::scope(|scope| {
        for worker in 0..WORKERS {
            let failures = &failures;
            scope.spawn(move || {
                let numbers = count * worker / WORKERS..count * (worker + 1) / WORKERS;
                let mut next = numbers.start;
                while next < numbers.end {
                    let first = Case { kind, seed, number: next };
                    match run_cases_in_worker(first, numbers.end) {
                        Ok(()) => return,
                        Err((case, reason)) => {
                            let is_slow = reason == TIMED_OUT;
                            if !is_slow
                                || (1..MAX_ATTEMPTS)
                                    .all(|_| run_cases_in_worker(case, case.number + 1).is_err())
                            {
                                failures.lock().expect("no panic").push((case, reason));
                            }
                            next = case.number + 1;
                        }
                    }
                }
            });
        }
    });
    failures.into_inner().expect("no panic")
}

/// Message for a case that takes too long.
const TIMED_OUT: &str = "took more than 2 s";

/// Runs the cases from `first` up to number `end` in a worker process. Returns the first failure as an error.
fn run_cases_in_worker(first: Case, end: u64) -> Result<(), (Case, String)> {
    let Case { kind, seed, number } = first;
    let mut worker = Command::new(std::env::current_exe().expect("this program"))
        .args(["fuzz::worker::worker", "--exact", "--nocapture"])
        .env(WORKER_CASES, format!("{kind:?} {seed} {number} {end}"))
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .expect("a worker");
    let lines = lines_of(&mut worker);
    let mut result = Ok(());
    for number in number..end {
        let case = Case { number, ..first };
        if let Err(reason) = next_result(&lines) {
            result = Err((case, reason));
            break;
        }
    }
    // The worker may have already exited.
    let _ = worker.kill();
    let status = worker.wait().expect("its end");
    result.map_err(|(case, reason)| {
        if reason == WORKER_EXITED { (case, format!("{reason}: {status}")) } else { (case, reason) }
    })
}

/// Message for a worker that exited during a case.
const WORKER_EXITED: &str = "the process exited";

fn lines_of(worker: &mut Child) -> Receiver<String> {
    let (send, lines) = channel();
    let output = BufReader::new(worker.stdout.take().expect("its stdout"));
    std::thread::spawn(move || {
        for line in output.lines().map_while(Result::ok) {
            // Skip the test harness's lines, which have no marker.
            if let Some(line) = line.strip_prefix("@ ")
                && send.send(line.to_owned()).is_err()
            {
                return;
            }
        }
    });
    lines
}

/// Waits for a result. The time limit starts when the worker has generated the case.
fn next_result(lines: &Receiver<String>) -> Result<(), String> {
    let next = |at_most: Duration| match lines.recv_timeout(at_most) {
        Ok(line) => Ok(line),
        Err(RecvTimeoutError::Timeout) => Err(TIMED_OUT.to_owned()),
        Err(RecvTimeoutError::Disconnected) => Err(WORKER_EXITED.to_owned()),
    };
    next(GENERATION_TIME_LIMIT)?;
    let said = next(CASE_TIME_LIMIT)?;
    if said == "right" { Ok(()) } else { Err(said) }
}

/// Runs the requested cases. Does nothing unless this process is a worker.
#[test]
fn worker() {
    let Ok(order) = std::env::var(WORKER_CASES) else { return };
    let words: Vec<&str> = order.split(' ').collect();
    let kind = if words[0] == "Scene" { FuzzInput::Scene } else { FuzzInput::Asset };
    let [seed, from, to] = [1, 2, 3].map(|word| words[word].parse().expect("a number"));
    setrlimit(Resource::RLIMIT_AS, ADDRESS_BYTES, ADDRESS_BYTES).expect("a limit");
    let dir = CaseDir::new();
    let material = Corpus::new();
    record_panics(&dir);
    for number in from..to {
        let case = Case { kind, seed, number };
        let scene = dir.place_case(case, &material.make(case));
        send_line("begin");
        let said =
            check_case(&scene).map_or_else(|reason| reason.replace('\n', " "), |()| "right".to_owned());
        send_line(&said);
    }
}

/// Sends a line to the process that started this worker.
fn send_line(text: &str) {
    writeln!(std::io::stdout(), "\n@ {text}").expect("the parent process is listening");
}

/// The last panic, even if it was caught.
static LAST_PANIC: Mutex<Option<String>> = Mutex::new(None);

/// Installs a hook that records all panics. Calls the library first, because it installs its own hook on
/// first use.
fn record_panics(dir: &CaseDir) {
    let _ = check_scene(
        &dir.place_case(
            Case { kind: FuzzInput::Asset, seed: 0, number: 0 },
            &Seed { file: "case.obj".to_owned(), bytes: b"v".to_vec() },
        ),
        &[],
    );
    panic::set_hook(Box::new(|info| {
        let place = info.location().map_or(String::new(), ToString::to_string);
        *LAST_PANIC.lock().expect("no panic") = Some(format!("{info} at {place}"));
    }));
}

fn check_case(scene: &Path) -> Result<(), String> {
    let checked = panic::catch_unwind(AssertUnwindSafe(|| check_scene(scene, &[])));
    if let Some(panic) = LAST_PANIC.lock().expect("no panic").take() {
        // Decoders in other crates may panic. The library turns such panics into errors about the file.
        let is_foreign = panic.contains("/.cargo/registry/") || panic.contains("/registry/src/");
        if checked.is_err() || !is_foreign {
            return Err(format!("panic: {panic}"));
        }
    }
    let diagnostics = match checked {
        Ok(Ok(checked)) => checked.warnings,
        Ok(Err(Failure::Scene(diagnostics))) if diagnostics.is_empty() => {
            return Err("rejected without a reason".to_owned());
        }
        Ok(Err(Failure::Scene(diagnostics))) => diagnostics,
        Ok(Err(Failure::Work(message))) => return Err(format!("exit code 1: {message}")),
        Err(_) => return Err("panic without a message".to_owned()),
    };
    let text = render_diagnostics(&diagnostics, 60, ReportStyle::Plain);
    if let Some(harmful) = first_terminal_control(&text) {
        return Err(format!("the message contains {harmful:?}"));
    }
    let used = peak_memory_bytes();
    if used > MEMORY_BYTES { Err(format!("used {} MiB of memory", used >> 20)) } else { Ok(()) }
}

/// Peak memory of this process. getrusage(2) would include the parent's memory before exec.
fn peak_memory_bytes() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:")?.trim().strip_suffix("kB"));
    peak.and_then(|kibibytes| kibibytes.trim().parse::<u64>().ok()).map_or(0, |kibibytes| kibibytes * 1024)
}

/// The first character that a terminal would interpret, if there is one.
pub(super) fn first_terminal_control(text: &str) -> Option<char> {
    text.chars().find(|c| (c.is_control() && *c != '\n') || ('\u{202a}'..='\u{202e}').contains(c))
}

const MTL: &str = "newmtl red\nKd 1 0 0\n";

/// A folder with all files that the scenes may refer to.
pub(super) struct CaseDir(tempfile::TempDir);

impl CaseDir {
    pub(super) fn new() -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let scenes = folder.path().join("scenes");
        std::fs::create_dir(&scenes).expect("a folder");
        let link =
            |from: &str, to: PathBuf| std::os::unix::fs::symlink(root().join(from), to).expect("a link");
        link("assets", folder.path().join("assets"));
        link("tests/broken/files", scenes.join("files"));
        std::fs::copy(root().join("assets/textures/checker.png"), scenes.join("small.png")).expect("copied");
        std::fs::write(scenes.join("case.mtl"), MTL).expect("written");
        Self(folder)
    }

    /// Writes a case's file to the path that scenes expect. Returns the scene to check.
    pub(super) fn place_case(&self, case: Case, made: &Seed) -> PathBuf {
        let folder = self.0.path().join("scenes");
        let scene = folder.join("case.toml");
        if ["case.glb", "case.gltf"].contains(&made.file.as_str()) {
            // Check a model directly, because this reads more of it than loading a scene does.
            std::fs::write(folder.join(&made.file), &made.bytes).expect("written");
            return folder.join(&made.file);
        }
        std::fs::write(folder.join(&made.file), &made.bytes).expect("written");
        if case.kind == FuzzInput::Asset {
            if made.file != "case.mtl" {
                std::fs::write(folder.join("case.mtl"), MTL).expect("written");
            }
            std::fs::write(&scene, scene_of(&made.file)).expect("written");
            if made.file == "case.mtl" {
                let obj = "mtllib case.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl red\nf 1 2 3\n";
                std::fs::write(folder.join("case.obj"), obj).expect("written");
            }
        }
        scene
    }
}

/// A scene that refers to an asset.
fn scene_of(file: &str) -> String {
    let camera = "[camera]\nposition = [0, 1, 4]\nlook_at = [0, 1, 0]\n";
    let ball = "[[sphere]]\ncenter = [0, 1, 0]\nradius = 0.5\nmaterial = \"m\"\n";
    match file.rsplit_once('.').map_or("", |(_, ending)| ending) {
        "txt" => format!("[camera]\norbiter = \"{file}\"\n[materials.m]\ntype = \"phong\"\n{ball}"),
        "obj" | "off" | "ply" | "stl" => format!(
            "{camera}[[mesh]]\nfile = \"{file}\"\nmaterial = \"m\"\n[materials.m]\ntype = \"phong\"\n"
        ),
        "mtl" => format!("{camera}[[mesh]]\nfile = \"case.obj\"\n"),
        _ => format!(
            "{camera}[textures.t]\nfile = \"{file}\"\n[materials.m]\ntype = \"phong\"\ndiffuse = {{ texture = \"t\" }}\n{ball}"
        ),
    }
}
