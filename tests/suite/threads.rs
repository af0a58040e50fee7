//! Commands that run out of threads, memory or file descriptors.

use std::fs;
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::os::unix::process::CommandExt;
use std::process::{Command as Process, Stdio};

use super::test_dir::{PROGRAM, SCENE, TestDir, assert_mentions};

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

/// A glTF file without a buffer.
const EMPTY: &str =
    r#"{"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"name": "a"}]}"#;

/// Every command that starts threads fails with exit code 1 and a message. Root has no thread limit, so the
/// commands run as another user.
#[test]
#[cfg(target_os = "linux")]
fn commands_without_threads_fail_with_message() {
    let dir = TestDir::new();
    dir.write("a.obj", TRIANGLE);
    dir.write("a.gltf", EMPTY);
    for (seed, name) in [(1, "a.exr"), (2, "b.exr")] {
        dir.expect(&format!("ball.toml --once --progress none --seed {seed} -o {name}"), 0);
    }
    for part in [1, 2] {
        dir.expect(&format!("ball.toml --once --progress none --shard {part}/2 -o {part}.part"), 0);
    }
    let program = dir.program();
    let is_root = fs::metadata(dir.0.path()).expect("a folder").uid() == 0;
    fs::set_permissions(dir.0.path(), fs::Permissions::from_mode(0o777)).expect("permitted");
    for line in [
        "ball.toml --once -o new.png",
        "ball.toml --once --shard 1/2 -o new.part",
        "a.obj --once -o new.png",
        "check ball.toml",
        "import a.gltf -o new.toml",
        "merge new.exr 1.part 2.part",
        "compare a.exr b.exr",
        "bench ball.toml --samples 1 --seeds 2 --no-cache",
    ] {
        let mut process = Process::new("bash");
        process.args(["-c", &format!("ulimit -u 1 && exec \"$0\" {line}")]).arg(&program);
        process.current_dir(dir.0.path()).stdin(Stdio::null());
        if is_root {
            process.uid(65534).gid(65534);
        }
        let output = process.output().expect("it runs");
        let stderr = String::from_utf8(output.stderr).expect("UTF-8");
        assert_eq!(output.status.code(), Some(1), "{line}: {stderr}");
        let errors = stderr.lines().filter(|line| line.starts_with("error: ")).count();
        assert_eq!((errors, stderr.contains("panicked")), (1, false), "{line}: {stderr}");
        assert!(stderr.contains("ulimit -u"), "{line}: {stderr}");
        let is_new = |name: &str| dir.path(name).exists();
        assert!(!["new.png", "new.part", "new.toml", "new.exr"].into_iter().any(is_new), "{line}");
    }
}

/// If memory runs out, at startup or later, the only message is one sentence that says so.
#[test]
#[cfg(target_os = "linux")]
fn too_little_memory_is_one_message() {
    let dir = TestDir::new();
    let render = "ball.toml --once --threads 2 --progress none";
    let mut messages = Vec::new();
    for kilobytes in (8_000..200_000).step_by(250) {
        let mut process = Process::new("bash");
        process.args(["-c", &format!("ulimit -v {kilobytes} && exec \"$0\" {render}"), PROGRAM]);
        process.env("RUST_BACKTRACE", "1").current_dir(dir.0.path()).stdin(Stdio::null());
        let output = process.output().expect("it runs");
        match output.status.code() {
            Some(0) => break,
            Some(1) => messages.push(String::from_utf8(output.stderr).expect("UTF-8")),
            // The system could not load the program.
            _ => {}
        }
    }
    for start in ["out of memory: cannot start a thread; ", "out of memory: cannot allocate "] {
        assert!(messages.iter().any(|said| said.starts_with(&format!("error: {start}"))), "{messages:?}");
    }
    for said in &messages {
        let is_sentence = said.starts_with("error: ") && said.lines().count() == 1;
        assert!(is_sentence && said.contains("memory") && !said.contains("ulimit -u"), "{said}");
    }
}

/// `glimt check` subdivides meshes, so it must respect the memory limit.
#[test]
#[cfg(target_os = "linux")]
fn check_does_not_subdivide_beyond_the_memory_limit() {
    let dir = TestDir::new();
    let faces: String = (0..3000).map(|_| "f 1 2 3\n").collect();
    dir.write("a.obj", format!("v 0 0 0\nv 1 0 0\nv 0 1 0\n{faces}"));
    let mesh = "\n[[mesh]]\nfile = \"a.obj\"\nmaterial = \"ball\"\nsubdivide = 6\n";
    dir.write("big.toml", format!("{SCENE}{mesh}"));
    let mut process = Process::new("bash");
    process.args(["-c", "ulimit -v 900000 && exec \"$0\" check big.toml", PROGRAM]);
    let output = process.current_dir(dir.0.path()).output().expect("it runs");
    let stderr = String::from_utf8(output.stderr).expect("UTF-8");
    assert_eq!(output.status.code(), Some(1), "{stderr}");
    assert_mentions(&stderr, &["`subdivide = 6` needs about 938 MiB", "a.obj"]);
}

/// A part is recognized even if it cannot be opened twice at the same time.
#[test]
fn info_reads_parts_with_one_descriptor() {
    let dir = TestDir::new();
    dir.expect("ball.toml --once --progress none --shard 1/2 -o 1.part", 0);
    let mut process = Process::new("bash");
    process.args(["-c", "ulimit -n 4 && exec \"$0\" info 1.part", PROGRAM]).current_dir(dir.0.path());
    let output = process.output().expect("it runs");
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
}

/// Runs a command with a limit on open files. Returns the exit code and stderr.
fn run_with_descriptor_limit(dir: &TestDir, limit: u32, line: &str) -> (Option<i32>, String) {
    let mut process = Process::new("bash");
    process.args(["-c", &format!("ulimit -n {limit} && exec \"$0\" {line}"), PROGRAM]);
    process.current_dir(dir.0.path()).stdin(Stdio::null());
    let output = process.output().expect("it runs");
    (output.status.code(), String::from_utf8(output.stderr).expect("UTF-8"))
}

/// A scene with 100 meshes and 100 textures, which are read in parallel.
fn write_scene_with_many_files(dir: &TestDir) {
    let mut text = SCENE.to_owned();
    for i in 0..100 {
        dir.write(&format!("{i}.obj"), format!("v {i} 0 0\nv {i} 1 0\nv {i} 0 1\nf 1 2 3\n"));
        dir.write(&format!("{i}.ppm"), format!("P3 1 1 255 {i} 0 0\n"));
        let material = format!(
            "[textures.t{i}]\nfile = \"{i}.ppm\"\n[materials.m{i}]\ndiffuse = {{ texture = \"t{i}\" }}\n"
        );
        text += &format!("{material}[[mesh]]\nfile = \"{i}.obj\"\nmaterial = \"m{i}\"\n");
    }
    dir.write("many.toml", text);
}

/// With any limit on open files, a command succeeds, or it fails with one error that names the limit.
#[test]
fn too_few_descriptors_are_one_message() {
    let dir = TestDir::new();
    write_scene_with_many_files(&dir);
    for part in [1, 2] {
        dir.expect(&format!("ball.toml --once --progress none --shard {part}/2 -o {part}.part"), 0);
    }
    for line in [
        "ball.toml --once --progress none -o new.png",
        "many.toml --once --progress none --threads 8 -o new.png",
        "merge new.png 1.part 2.part --progress none",
    ] {
        for limit in 4.. {
            let (code, said) = run_with_descriptor_limit(&dir, limit, line);
            if code == Some(0) {
                assert!(limit > 4 && dir.path("new.png").exists(), "{line} with {limit}");
                break;
            }
            // The exit code for an unreadable scene file is 2.
            assert!(matches!(code, Some(1 | 2)), "{line} with {limit}: {code:?} {said}");
            let errors = said.matches("error: ").count();
            assert!(errors == 1 && said.lines().count() <= 6, "{line} with {limit}: {said}");
            assert!(said.contains("ulimit -n"), "{line} with {limit}: {said}");
            assert!(!dir.path("new.png").exists(), "{line} with {limit}");
        }
        fs::remove_file(dir.path("new.png")).expect("written with enough descriptors");
    }
}

#[test]
fn merging_too_many_parts_is_one_message() {
    let dir = TestDir::new();
    dir.expect("ball.toml --once --progress none --shard 1/2 -o 1.part", 0);
    let parts = "1.part ".repeat(200);
    for options in ["", "--watch", "--partial"] {
        let line = format!("merge new.png {parts} --progress none {options}");
        let (code, said) = run_with_descriptor_limit(&dir, 64, &line);
        assert_eq!((code, said.lines().count()), (Some(1), 1), "{options}: {said}");
        assert!(said.starts_with("error: ") && said.contains("200") && said.contains("ulimit -n"), "{said}");
        assert!(!dir.path("new.png").exists(), "{options}");
    }
}

/// A control group (version 1) that limits memory. Removed when this value is dropped.
#[cfg(target_os = "linux")]
struct MemoryGroup(std::path::PathBuf);

#[cfg(target_os = "linux")]
impl MemoryGroup {
    /// Creates a group. `None` if this system or user cannot create one.
    fn new(bytes: u64) -> Option<Self> {
        let group = Self(format!("/sys/fs/cgroup/memory/glimt-test-{}", std::process::id()).into());
        std::fs::create_dir(&group.0).ok()?;
        std::fs::write(group.0.join("memory.limit_in_bytes"), bytes.to_string()).ok()?;
        Some(group)
    }
}

#[cfg(target_os = "linux")]
impl Drop for MemoryGroup {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir(&self.0);
    }
}

#[test]
#[cfg(target_os = "linux")]
fn control_groups_limit_memory_with_a_message() {
    let Some(group) = MemoryGroup::new(16 << 20) else { return };
    let dir = TestDir::new();
    let vertices = "v 0.123456 0.234567 0.345678\n".repeat(400_000);
    dir.write("big.obj", vertices + "f 1 2 3\n");
    let script = format!("echo $$ > {}/cgroup.procs && exec \"$0\" check big.obj", group.0.display());
    let mut process = Process::new("sh");
    let output = process.args(["-c", &script, PROGRAM]).current_dir(dir.0.path()).output().expect("it runs");
    let said = String::from_utf8_lossy(&output.stderr);
    // Without a limit of its own, the program would be killed.
    assert!(output.status.code() == Some(1) && said.contains("memory"), "{:?}: {said}", output.status);
}
