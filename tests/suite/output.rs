//! Output files are written completely or not at all.

use std::fs;
use std::io::ErrorKind;
use std::os::unix::fs::{MetadataExt, PermissionsExt, symlink};
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::Duration;

use glimt::output::{OutputError, check_image_target, write::write_atomically};
use nix::errno::Errno;

use super::test_dir::{assert_mentions, system_error};

/// Environment variable that contains a path and makes a test act as the child process.
const CHILD: &str = "GLIMT_TEST_CHILD";

fn child_path() -> Option<PathBuf> {
    std::env::var_os(CHILD).map(PathBuf::from)
}

/// A command that runs one test from this binary in a child process.
fn child(program: &Path, test: &str, path: &Path) -> Command {
    let mut command = Command::new(program);
    command.args(["--exact", test, "--nocapture"]).env(CHILD, path);
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped());
    command
}

fn this_binary() -> PathBuf {
    std::env::current_exe().expect("this binary")
}

fn scratch() -> tempfile::TempDir {
    tempfile::tempdir().expect("a directory")
}

/// File names in a directory, sorted.
fn names(directory: &Path) -> Vec<String> {
    let entries = fs::read_dir(directory).expect("a directory");
    let mut names: Vec<_> =
        entries.map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

fn refusal(path: &Path) -> String {
    let before = check_image_target(path).expect_err("rejection before rendering").to_string();
    let after = write_atomically(path, b"new").expect_err("refused at the end").to_string();
    assert_eq!(before, after);
    after
}

#[test]
fn file_is_created_and_then_replaced() {
    let directory = scratch();
    let path = directory.path().join("out.png");
    write_atomically(&path, b"first").expect("written");
    assert_eq!(fs::read(&path).expect("a file"), b"first");
    write_atomically(&path, b"").expect("written");
    assert_eq!(fs::read(&path).expect("a file"), b"");
    assert_eq!(names(directory.path()), ["out.png"]);
}

#[test]
fn permissions_are_kept() {
    let directory = scratch();
    let path = directory.path().join("out.png");
    fs::write(&path, "old").expect("a file");
    for mode in [0o600, 0o664, 0o777] {
        fs::set_permissions(&path, fs::Permissions::from_mode(mode)).expect("a mode");
        write_atomically(&path, b"new").expect("written");
        assert_eq!(fs::metadata(&path).expect("a file").mode() & 0o7777, mode);
    }
}

#[test]
fn link_is_kept_and_its_target_replaced() {
    let directory = scratch();
    let elsewhere = scratch();
    let target = elsewhere.path().join("real.png");
    // The first link is relative, the second absolute. The target does not exist yet.
    symlink("middle.png", directory.path().join("out.png")).expect("a link");
    symlink(&target, directory.path().join("middle.png")).expect("a link");
    let path = directory.path().join("out.png");
    for bytes in [b"one", b"two"] {
        check_image_target(&path).expect("a valid target");
        write_atomically(&path, bytes).expect("written");
        assert_eq!(fs::read(&target).expect("a file"), bytes);
    }
    assert!(fs::symlink_metadata(&path).expect("a link").is_symlink());
    assert_eq!(names(directory.path()), ["middle.png", "out.png"]);
    assert_eq!(names(elsewhere.path()), ["real.png"]);
}

#[test]
fn link_loop_is_an_error() {
    let directory = scratch();
    symlink("b.png", directory.path().join("a.png")).expect("a link");
    symlink("a.png", directory.path().join("b.png")).expect("a link");
    let message = refusal(&directory.path().join("a.png"));
    assert_mentions(&message, &["a.png", &system_error(Errno::ELOOP)]);
}

#[test]
fn full_disk_is_an_error() {
    let directory = scratch();
    let path = directory.path().join("x.png");
    symlink("/dev/full", &path).expect("a link");
    check_image_target(&path).expect("only the write must fail");
    let message = write_atomically(&path, b"picture").expect_err("nothing fits").to_string();
    assert_mentions(&message, &[&path.display().to_string(), &system_error(Errno::ENOSPC)]);
    assert!(fs::symlink_metadata("/dev/full").is_ok(), "the device must still exist");
}

#[test]
fn devices_are_written_in_place() {
    let directory = scratch();
    let path = directory.path().join("x.png");
    symlink("/dev/null", &path).expect("a link");
    write_atomically(&path, b"picture").expect("written");
    write_atomically(Path::new("/dev/null"), b"report").expect("written");
    assert!(!fs::metadata("/dev/null").expect("a device").is_file());
}

#[test]
fn pipe_needs_a_reader() {
    let directory = scratch();
    let path = directory.path().join("pipe.png");
    nix::unistd::mkfifo(&path, nix::sys::stat::Mode::S_IRWXU).expect("a pipe");
    let error = write_atomically(&path, b"picture").expect_err("without a reader");
    let is_unconnected =
        matches!(&error, OutputError::File { source, .. } if source.kind() == ErrorKind::NotConnected);
    assert!(is_unconnected, "{error:?}");
    // Write more bytes than fit into a pipe. Once the pipe can be opened for writing, `cat` has started.
    let bytes: Vec<u8> = (0..1_000_000_u32).map(|i| (i * 7 % 251) as u8).collect();
    let reader = Command::new("cat").arg(&path).stdout(Stdio::piped()).spawn().expect("cat");
    let holder = fs::OpenOptions::new().write(true).open(&path).expect("a pipe with a reader");
    let collector = std::thread::spawn(move || reader.wait_with_output().expect("output of cat").stdout);
    write_atomically(&path, &bytes).expect("written");
    drop(holder);
    assert!(collector.join().expect("no panic") == bytes);
}

#[test]
fn stdout_is_written_in_place() {
    if let Some(path) = child_path() {
        write_atomically(&path, b"report").expect("written");
        return;
    }
    let run = |stdout: Stdio| {
        let mut command =
            child(&this_binary(), "output::stdout_is_written_in_place", Path::new("/dev/stdout"));
        command.stdout(stdout).output().expect("a child")
    };
    let piped = run(Stdio::piped());
    assert!(piped.status.success());
    assert!(String::from_utf8_lossy(&piped.stdout).contains("report"));
    let directory = scratch();
    let path = directory.path().join("redirected");
    let file = fs::OpenOptions::new().create(true).append(true).open(&path).expect("a file");
    assert!(run(file.into()).status.success());
    let text = fs::read_to_string(&path).expect("a file");
    assert!(text.contains("running 1 test") && text.contains("report"), "{text}");
}

#[test]
fn impossible_targets_are_reported() {
    let directory = scratch();
    let inside = |name: &str| directory.path().join(name);
    fs::create_dir(inside("dir.png")).expect("a directory");
    fs::write(inside("file"), "").expect("a file");
    let message = refusal(&inside("missing/out.png"));
    assert_mentions(&message, &[&format!("directory {}", inside("missing").display())]);
    for name in ["dir.png", "dir.png/", "new.png/"] {
        let message = refusal(&inside(name));
        assert_mentions(&message, &[&inside(name).display().to_string(), "a directory"]);
    }
    let message = refusal(&inside("file/out.png"));
    assert_mentions(&message, &[&system_error(Errno::ENOTDIR)]);
    let message = refusal(&inside(&format!("{}.png", "n".repeat(300))));
    assert_mentions(&message, &[&system_error(Errno::ENAMETOOLONG)]);
    assert_eq!(names(directory.path()), ["dir.png", "file"]);
}

#[test]
fn longest_possible_name_is_written() {
    let directory = scratch();
    let path = directory.path().join(format!("{}.png", "n".repeat(251)));
    write_atomically(&path, b"picture").expect("written");
    assert_eq!(fs::read(&path).expect("a file"), b"picture");
}

/// Runs as an unprivileged user, because root may write to any file.
#[test]
fn missing_permission_is_an_error() {
    if let Some(directory) = child_path() {
        let message = refusal(&directory.join("closed/out.png"));
        assert_mentions(&message, &[&system_error(Errno::EACCES)]);
        let message = refusal(&directory.join("open/protected.png"));
        assert_mentions(&message, &["protected.png", &system_error(Errno::EACCES)]);
        write_atomically(&directory.join("open/other.png"), b"new").expect("written");
        return;
    }
    let directory = scratch();
    let mode = |name: &str, mode| {
        let path = directory.path().join(name);
        fs::set_permissions(path, fs::Permissions::from_mode(mode)).expect("a mode");
    };
    for name in ["closed", "open"] {
        fs::create_dir(directory.path().join(name)).expect("a directory");
    }
    fs::write(directory.path().join("open/protected.png"), "old").expect("a file");
    // Copy the binary, because an unprivileged user may not have access to this one.
    let program = directory.path().join("program");
    fs::copy(this_binary(), &program).expect("a copy");
    mode("open/protected.png", 0o444);
    mode("closed", 0o555);
    mode("open", 0o777);
    mode("", 0o755);
    let mut command = child(&program, "output::missing_permission_is_an_error", directory.path());
    if fs::metadata(directory.path()).expect("a directory").uid() == 0 {
        command.uid(65534).gid(65534);
    }
    command.current_dir("/");
    // A child of another test may briefly hold the copy open between fork and exec.
    let output = loop {
        match command.output() {
            Err(error) if error.kind() == std::io::ErrorKind::ExecutableFileBusy => std::thread::yield_now(),
            other => break other.expect("a child"),
        }
    };
    assert_success(&output);
    mode("closed", 0o755);
    assert_eq!(names(&directory.path().join("closed")), [""; 0]);
    assert_eq!(names(&directory.path().join("open")), ["other.png", "protected.png"]);
    assert_eq!(fs::read(directory.path().join("open/protected.png")).expect("a file"), b"old");
}

fn assert_success(output: &Output) {
    assert!(output.status.success(), "{}: {}", output.status, String::from_utf8_lossy(&output.stderr));
}

#[test]
fn file_size_limit_is_an_error() {
    if let Some(path) = child_path() {
        let error = write_atomically(&path, &vec![1; 1 << 20]).expect_err("larger than the limit");
        assert!(matches!(&error, OutputError::File { .. }));
        assert_mentions(&error.to_string(), &[&system_error(Errno::EFBIG), "ulimit -f"]);
        return;
    }
    let directory = scratch();
    let path = directory.path().join("out.png");
    fs::write(&path, "old").expect("a file");
    let script = "ulimit -f 64; exec \"$0\" --exact \"$1\"";
    let test = "output::file_size_limit_is_an_error";
    let mut command = Command::new("sh");
    command.args(["-c", script]).arg(this_binary()).arg(test).env(CHILD, &path);
    assert_success(&command.output().expect("a child"));
    assert_eq!(fs::read(&path).expect("a file"), b"old");
    assert_eq!(names(directory.path()), ["out.png"]);
}

#[test]
fn concurrent_writers_leave_a_complete_file() {
    let directory = scratch();
    let path = directory.path().join("out.png");
    let contents: Vec<Vec<u8>> = (0..4).map(|i| vec![i; 10_000 + usize::from(i)]).collect();
    std::thread::scope(|scope| {
        for bytes in &contents {
            let path = &path;
            scope.spawn(move || (0..25).for_each(|_| write_atomically(path, bytes).expect("written")));
        }
    });
    assert!(contents.contains(&fs::read(&path).expect("a file")));
    assert_eq!(names(directory.path()), ["out.png"]);
}

/// Two images whose contents would reveal a torn write.
fn two_images() -> [Vec<u8>; 2] {
    [vec![0xaa; 3_000_000], vec![0x55; 2_000_001]]
}

#[test]
fn kill_leaves_a_whole_file_and_cleans_up() {
    let test = "output::kill_leaves_a_whole_file_and_cleans_up";
    let pictures = two_images();
    if let Some(path) = child_path() {
        for bytes in pictures.iter().cycle() {
            write_atomically(&path, bytes).expect("written");
        }
    }
    let directory = scratch();
    let path = directory.path().join("out.png");
    write_atomically(&path, &pictures[0]).expect("written");
    let mut left_behind = 0;
    for round in 0..50_u64 {
        let mut writer = child(&this_binary(), test, &path).spawn().expect("a child");
        // Once the file changes, the child has started writing. Wait for this round's delay, then kill it.
        let state = || fs::metadata(&path).map(|file| (file.ino(), file.mtime(), file.mtime_nsec()));
        let before = state().expect("a file");
        while state().expect("a file") == before {
            assert!(writer.try_wait().expect("a child").is_none(), "the writer exited on its own");
            std::thread::sleep(Duration::from_millis(1));
        }
        std::thread::sleep(Duration::from_micros(round * 7919 % 10_000));
        writer.kill().expect("killed");
        assert_eq!(writer.wait().expect("a child").signal(), Some(9));
        let found = fs::read(&path).expect("a file");
        assert!(pictures.contains(&found), "round {round}: torn file with {} bytes", found.len());
        left_behind = left_behind.max(names(directory.path()).len() - 1);
    }
    assert!(
        left_behind <= 1,
        "each write must remove temporary files of previous writes, but {left_behind} were left"
    );
    write_atomically(&path, b"done").expect("written");
    assert_eq!(names(directory.path()), ["out.png"]);
}
