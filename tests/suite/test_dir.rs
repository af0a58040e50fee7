//! Helpers for tests that run the program as a process.

use std::fs;
use std::path::PathBuf;
use std::process::{Child, Command as Process, Output, Stdio};
use std::time::{Duration, Instant};

use nix::errno::Errno;

/// Path of the program built with these tests.
pub(crate) const PROGRAM: &str = env!("CARGO_BIN_EXE_glimt");

/// A scene with a sphere under a point light.
pub(crate) const SCENE: &str = r#"[render]
width = 32
height = 24
samples = 2

[camera]
position = [0, 1, 4]
look_at = [0, 1, 0]

[materials.ball]
type = "phong"
diffuse = [0.8, 0.2, 0.1]

[[sphere]]
center = [0, 1, 0]
radius = 0.5
material = "ball"

[[light]]
type = "point"
position = [1, 3, 2]
intensity = [10, 10, 10]
"#;

/// A temporary working directory for the program, with a scene in it.
pub(crate) struct TestDir(pub(crate) tempfile::TempDir);

impl TestDir {
    pub(crate) fn new() -> Self {
        let dir = Self(tempfile::tempdir().expect("a temporary folder"));
        dir.write("ball.toml", SCENE);
        dir
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub(crate) fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        fs::write(self.path(name), content).expect("written");
    }

    /// Copies the program, so that a user without access to the build directory can run it. Uses `cp`: a copy
    /// written by this process might still be open for writing in a child forked by another test, which would
    /// prevent running it.
    pub(crate) fn program(&self) -> PathBuf {
        let copy = self.path("program");
        let made = Process::new("cp").arg(PROGRAM).arg(&copy).status();
        assert!(made.expect("cp runs").success(), "failed to copy the program");
        copy
    }

    pub(crate) fn glimt(&self, line: &str) -> Process {
        let mut process = Process::new(PROGRAM);
        process.current_dir(self.0.path()).args(line.split_whitespace()).stdin(Stdio::null());
        process.env_remove("NO_COLOR").env("TERM", "xterm");
        process
    }

    pub(crate) fn run(&self, line: &str) -> Output {
        self.glimt(line).output().expect("it runs")
    }

    /// Runs `line` and checks that it exits with `code` and prints nothing to stdout. Returns stderr.
    #[track_caller]
    pub(crate) fn expect(&self, line: &str, code: i32) -> String {
        let output = self.run(line);
        let stderr = String::from_utf8(output.stderr).expect("UTF-8");
        assert_eq!(output.status.code(), Some(code), "{line}\n{stderr}");
        assert!(output.stdout.is_empty(), "{line}: stdout is not empty");
        assert!(!stderr.contains('\u{1b}'), "{line}: escape sequence without a terminal");
        stderr
    }

    /// Runs `line` like [`Self::expect`], expecting exit code 0. Returns the report.
    #[track_caller]
    pub(crate) fn report(&self, line: &str) -> serde_json::Value {
        self.expect(&format!("{line} --once --report report.json"), 0);
        let text = fs::read_to_string(self.path("report.json")).expect("a report");
        serde_json::from_str(&text).expect("JSON")
    }

    /// Waits until `child` creates a file. Fails if the child ends first.
    #[track_caller]
    pub(crate) fn await_file(&self, name: &str, child: &mut Child) {
        let deadline = Instant::now() + Duration::from_secs(60);
        while !self.path(name).exists() {
            let ended = child.try_wait().expect("a child");
            // The child may have created the file just before it ended.
            assert!(ended.is_none() || self.path(name).exists(), "ended without {name}: {ended:?}");
            let is_late = Instant::now() > deadline;
            if is_late {
                child.kill().expect("a running child");
            }
            assert!(!is_late, "{name} was not written");
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    #[track_caller]
    pub(crate) fn bytes(&self, name: &str) -> Vec<u8> {
        fs::read(self.path(name)).expect("a file")
    }
}

/// Whether a message mentions a fact (a file, option, key or number) as a separate word.
pub(crate) fn mentions(message: &str, fact: &str) -> bool {
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    let is_inside = |c: char| fact.starts_with(is_word) && is_word(c);
    let continues = |c: char| fact.ends_with(is_word) && is_word(c);
    message.match_indices(fact).any(|(at, _)| {
        !message[..at].ends_with(is_inside) && !message[at + fact.len()..].starts_with(continues)
    })
}

/// Checks that a message contains all expected facts, regardless of its wording.
#[track_caller]
pub(crate) fn assert_mentions(message: &str, facts: &[&str]) {
    for fact in facts {
        assert!(mentions(message, fact), "`{fact}` not found in: {message}");
    }
}

/// The text for an operating system error, as it appears in messages.
pub(crate) fn system_error(error: Errno) -> String {
    glimt::system::describe_io_error(&std::io::Error::from_raw_os_error(error as i32))
}
