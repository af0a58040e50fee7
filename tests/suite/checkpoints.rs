//! Checkpoints: however a render ended, resuming it with --resume gives the same pixels as an uninterrupted
//! render.

use std::fs;

use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

use glimt::math::random::TestRandom;
use nix::errno::Errno;
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

use crate::parts::{METHODS, ROOM, room_dir};
use crate::test_dir::{TestDir, assert_mentions, mentions, system_error};

fn begin(dir: &TestDir, line: &str) -> Child {
    dir.glimt(line).stderr(Stdio::null()).spawn().expect("it runs")
}

/// Runs glimt and checks the exit code. Returns stderr with line breaks removed, because messages are
/// wrapped.
#[track_caller]
fn stderr_of(dir: &TestDir, line: &str, code: i32) -> String {
    dir.expect(line, code).split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Sends a signal and returns the exit code. On a busy machine, the program may not have installed its signal
/// handlers yet, so this waits for them first.
fn end(mut child: Child, signal: Signal) -> Option<i32> {
    if signal != Signal::SIGKILL {
        wait_for_handler(&mut child, signal);
    }
    kill(Pid::from_raw(child.id() as i32), signal).expect("failed to signal the process");
    child.wait().expect("a child").code()
}

/// Waits until a process handles a signal, or until it has ended.
fn wait_for_handler(child: &mut Child, signal: Signal) {
    let handles_signal = |status: String| {
        let mask = status.lines().find_map(|line| line.strip_prefix("SigCgt:"))?;
        let mask = u64::from_str_radix(mask.trim(), 16).ok()?;
        Some(mask >> (signal as i32 - 1) & 1 == 1)
    };
    let status = format!("/proc/{}/status", child.id());
    while fs::read_to_string(&status).ok().and_then(handles_signal) == Some(false)
        && child.try_wait().expect("a child").is_none()
    {
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Checks that no temporary files from killed processes remain after the next write.
fn assert_no_leftovers(dir: &TestDir) {
    let names =
        fs::read_dir(dir.0.path()).expect("a folder").map(|entry| entry.expect("an entry").file_name());
    let left: Vec<_> = names.filter(|name| name.to_string_lossy().ends_with(".tmp")).collect();
    assert!(left.is_empty(), "{left:?}");
}

/// Methods, each with options for a render that takes about a second.
const LONG: [(&str, &str); 4] = [
    ("whitted", "--samples 2048"),
    ("path", "--integrator path --samples 512"),
    ("error", "--integrator path --samples 1024 --error 0.04"),
    ("photons", "--photons on --samples 128 --set photons.count=20000"),
];

#[test]
fn killed_render_resumes_with_same_pixels() {
    kill_at_any_time(4);
}

#[test]
#[ignore = "twenty seconds: cargo test --release --test suite killed_20_times -- --ignored"]
fn render_killed_20_times_resumes_identically() {
    kill_at_any_time(20);
}

/// Kills renders of each method at random times.
fn kill_at_any_time(times: u32) {
    let dir = room_dir();
    let mut random = TestRandom::new(3);
    for (method, options) in LONG {
        dir.expect(&format!("room.toml --once --progress none -o one.exr --checkpoint 0 {options}"), 0);
        dir.write("out.exr", "the image before");
        let line =
            format!("room.toml --once --progress none -o out.exr --resume --checkpoint 0.02 {options}");
        let mut kills = 0;
        while kills < times {
            let child = begin(&dir, &line);
            std::thread::sleep(Duration::from_secs_f64(0.03 + 0.2 * random.unit()));
            end(child, Signal::SIGKILL);
            if dir.bytes("out.exr") == b"the image before" {
                kills += 1;
                continue;
            }
            // The render finished before the kill, so start over.
            assert!(
                dir.bytes("out.exr") == dir.bytes("one.exr"),
                "{method}: neither the old nor the finished image"
            );
            dir.write("out.exr", "the image before");
            let _ = fs::remove_file(dir.path("out.exr.checkpoint"));
        }
        dir.expect(&line, 0);
        assert!(dir.bytes("out.exr") == dir.bytes("one.exr"), "{method}");
        assert!(!dir.path("out.exr.checkpoint").exists(), "{method}: the checkpoint must be removed");
        assert_no_leftovers(&dir);
    }
}

#[test]
fn kill_during_write_keeps_valid_checkpoint() {
    kill_while_it_writes(50);
}

#[test]
#[ignore = "sixteen seconds: cargo test --release --test suite killed_200_times -- --ignored"]
fn writer_killed_200_times_keeps_checkpoint() {
    kill_while_it_writes(200);
}

/// Kills a render that writes checkpoints continuously.
fn kill_while_it_writes(times: u32) {
    let dir = room_dir();
    let mut random = TestRandom::new(5);
    let line = "room.toml --once --progress none -o out.exr --checkpoint 0.000001 --samples 100000 --resume";
    for round in 0..times {
        let mut child = begin(&dir, line);
        if round == 0 {
            // On a busy machine, the process may be killed before its first checkpoint.
            dir.await_file("out.exr.checkpoint", &mut child);
        }
        std::thread::sleep(Duration::from_secs_f64(0.02 + 0.1 * random.unit()));
        end(child, Signal::SIGKILL);
        if dir.path("out.exr.checkpoint").exists() {
            // The error mentions the seed only if the checkpoint is intact.
            let stderr = stderr_of(&dir, "room.toml --once -o out.exr --seed 9 --resume", 2);
            assert_mentions(&stderr, &["seed", "0", "9"]);
        }
    }
    assert!(dir.path("out.exr.checkpoint").exists());
}

/// Ignored by default because the result depends on the machine's speed.
#[test]
#[ignore = "measures time, 84 s: cargo test --release --test suite hangup -- --ignored"]
fn hangup_writes_a_checkpoint_within_two_seconds() {
    let dir = room_dir();
    let is_over = std::sync::Arc::new(std::sync::atomic::AtomicBool::new(false));
    let load = std::thread::available_parallelism().map_or(2, usize::from);
    let busy = (0..load).map(|_| {
        let is_over = std::sync::Arc::clone(&is_over);
        std::thread::spawn(move || {
            while !is_over.load(std::sync::atomic::Ordering::Relaxed) {
                std::hint::spin_loop();
            }
        })
    });
    let busy: Vec<_> = busy.collect();
    for options in ["", "--integrator path", "--photons on --set photons.count=10000", "--error 0.001"] {
        let size = format!("--width 3840 --height 2160 --samples 100000 {options}");
        let child = begin(&dir, &format!("room.toml --once --progress none -o out.exr {size}"));
        // Wait until every pixel has a sample.
        std::thread::sleep(Duration::from_secs(20));
        let sent = Instant::now();
        assert_eq!(end(child, Signal::SIGHUP), Some(129));
        let seconds = sent.elapsed().as_secs_f64();
        let bytes = fs::metadata(dir.path("out.exr.checkpoint")).expect("a checkpoint").len();
        eprintln!("{options:?}: exited after {seconds:.2} s with a {} MB checkpoint", bytes / 1_000_000);
        assert!(seconds < 2.0, "{options}: {seconds} s");
        // The error mentions the seed only if the checkpoint's digest is valid.
        let stderr = stderr_of(&dir, &format!("room.toml --once -o out.exr {size} --seed 9 --resume"), 2);
        assert_mentions(&stderr, &["seed", "0", "9"]);
        fs::remove_file(dir.path("out.exr.checkpoint")).expect("removed");
    }
    is_over.store(true, std::sync::atomic::Ordering::Relaxed);
    busy.into_iter().for_each(|thread| thread.join().expect("no panic"));
}

#[test]
fn signal_leaves_a_resumable_checkpoint() {
    let dir = room_dir();
    for ((method, options), (signal, code)) in LONG.into_iter().zip([
        (Signal::SIGTERM, 143),
        (Signal::SIGHUP, 129),
        (Signal::SIGINT, 130),
        (Signal::SIGTERM, 143),
    ]) {
        dir.expect(&format!("room.toml --once --progress none -o one.exr --checkpoint 0 {options}"), 0);
        let line = format!("room.toml --once --progress none -o out.exr {options}");
        let child = begin(&dir, &line);
        // Wait until there are samples to save. A signal before the first sample leaves no checkpoint.
        std::thread::sleep(Duration::from_millis(300));
        let ended = end(child, signal);
        if dir.path("out.exr").exists() {
            // The render finished first.
            assert_eq!(ended, Some(code).filter(|code| ended == Some(*code)).or(Some(0)));
        } else {
            assert_eq!(ended, Some(code), "{method}");
        }
        dir.expect(&format!("{line} --resume"), 0);
        assert!(dir.bytes("out.exr") == dir.bytes("one.exr"), "{method}");
        fs::remove_file(dir.path("out.exr")).expect("removed");
    }
}

/// Completes a render and keeps its checkpoint.
fn finish_and_keep_checkpoint(dir: &TestDir, options: &str) {
    dir.expect(&format!("room.toml --once --progress none -o out.exr --keep-checkpoint {options}"), 0);
    assert!(dir.path("out.exr.checkpoint").exists());
}

#[test]
fn finished_render_can_add_samples() {
    let dir = room_dir();
    for (method, options) in METHODS {
        let (head, samples) = options.split_once("--samples ").expect("samples");
        let (samples, rest) = samples.split_once(' ').unwrap_or((samples, ""));
        let samples: u32 = samples.parse().expect("a number");
        for before in [1, samples / 2, samples - 1].into_iter().filter(|before| *before > 0) {
            finish_and_keep_checkpoint(&dir, &format!("{head} --samples {before} {rest}"));
            dir.expect(&format!("room.toml --once --progress none -o out.exr --resume {options}"), 0);
            dir.expect(&format!("room.toml --once --progress none -o one.exr {options}"), 0);
            assert!(dir.bytes("out.exr") == dir.bytes("one.exr"), "{method} after {before}");
            assert!(!dir.path("out.exr.checkpoint").exists());
        }
    }
    finish_and_keep_checkpoint(&dir, "--samples 8");
    let stderr = stderr_of(&dir, "room.toml --once -o out.exr --resume --samples 4", 2);
    assert_mentions(&stderr, &["out.exr.checkpoint", "samples", "4"]);
}

#[test]
fn checkpoint_for_another_image_is_rejected() {
    let dir = room_dir();
    finish_and_keep_checkpoint(&dir, "");
    let (image, checkpoint) = (dir.bytes("out.exr"), dir.bytes("out.exr.checkpoint"));
    let refused = |options: &str, facts: &[&str]| {
        let stderr = stderr_of(&dir, &format!("room.toml --once -o out.exr --resume {options}"), 2);
        assert_mentions(&stderr, facts);
        assert_mentions(&stderr, &["out.exr.checkpoint"]);
        assert!(dir.bytes("out.exr") == image);
    };
    refused("--seed 4", &["seed", "0", "4"]);
    refused("--width 60", &["width", "70", "60"]);
    refused("--crop 1,1,5,5", &["crop", "1,1,5,5"]);
    refused("--photons on", &["photons", "off", "on"]);
    refused("--set sphere.1.radius=0.3", &["shapes", "materials", "lights", "camera"]);
    for (name, text) in [
        ("room.toml", ROOM),
        ("step.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
        ("tiles.ppm", "P3\n1 1\n255\n9 9 9\n"),
    ] {
        let before = dir.bytes(name);
        let changed =
            if name == "room.toml" { text.replace("[6, 5, 4]", "[6, 5, 5]") } else { text.to_owned() };
        dir.write(name, changed);
        refused("", &[if name == "room.toml" { "materials" } else { name }]);
        dir.write(name, before);
    }
    assert!(dir.bytes("out.exr.checkpoint") == checkpoint);
    // Edits that do not affect the image keep the checkpoint valid.
    dir.write("room.toml", format!("# a comment\n{ROOM}\n[materials.unused]\n"));
    dir.expect("room.toml --once --progress none -o out.exr --resume --threads 1 --keep-checkpoint", 0);
    assert!(dir.bytes("out.exr") == image);
    let report = dir.report("room.toml -o out.exr --resume --progress none --set render.exposure=2");
    let stages = report["stages"].as_array().expect("stages");
    let render = stages.iter().find(|stage| stage["name"] == "render").expect("a stage");
    assert_eq!(render["status"], "reused", "the checkpoint has all samples");
}

#[test]
fn damaged_checkpoint_is_rejected() {
    let dir = room_dir();
    finish_and_keep_checkpoint(&dir, "");
    let (image, checkpoint) = (dir.bytes("out.exr"), dir.bytes("out.exr.checkpoint"));
    let mut random = TestRandom::new(8);
    for number in 0..40 {
        let index = (random.unit() * checkpoint.len() as f64) as usize;
        let mut bytes = checkpoint.clone();
        if number % 2 == 0 {
            bytes.truncate(index);
        } else {
            bytes[index] ^= 1 << (number / 2 % 8);
        }
        dir.write("out.exr.checkpoint", bytes);
        let stderr = stderr_of(&dir, "room.toml --once -o out.exr --resume", 2);
        assert_mentions(&stderr, &["out.exr.checkpoint"]);
        assert!(dir.bytes("out.exr") == image);
    }
}

#[test]
fn checkpoints_are_used_only_with_resume() {
    let dir = room_dir();
    let stderr = stderr_of(&dir, "room.toml --once -o out.exr --resume", 0);
    assert!(mentions(&stderr, "out.exr.checkpoint") && !mentions(&stderr, "--resume"), "{stderr}");
    finish_and_keep_checkpoint(&dir, "");
    let stderr = stderr_of(&dir, "room.toml --once -o out.exr", 0);
    assert_mentions(&stderr, &["warning", "out.exr.checkpoint", "--resume"]);
    assert!(!dir.path("out.exr.checkpoint").exists(), "a finished image must remove its checkpoint");
    // A longer render's checkpoint survives a new render without --resume.
    let line = "room.toml --once --progress none -o out.exr --samples 100000";
    let child = begin(&dir, line);
    std::thread::sleep(Duration::from_millis(2500));
    assert_eq!(end(child, Signal::SIGTERM), Some(143));
    let longer = dir.bytes("out.exr.checkpoint");
    let child = begin(&dir, line);
    std::thread::sleep(Duration::from_millis(300));
    assert_eq!(end(child, Signal::SIGTERM), Some(143));
    assert!(dir.bytes("out.exr.checkpoint.before") == longer);
    // It also survives a shorter render with another seed.
    let child = begin(&dir, &format!("{line} --seed 5"));
    std::thread::sleep(Duration::from_millis(300));
    assert_eq!(end(child, Signal::SIGTERM), Some(143));
    assert!(dir.bytes("out.exr.checkpoint.before") == longer);
    fs::rename(dir.path("out.exr.checkpoint.before"), dir.path("out.exr.checkpoint")).expect("moved");
    // It also survives a finished draft render.
    dir.expect("room.toml --once --progress none -o out.exr --samples 1", 0);
    assert!(dir.bytes("out.exr.checkpoint") == longer);
    fs::remove_file(dir.path("out.exr.checkpoint")).expect("removed");
    // A checkpoint for another image survives, and so does a file that is not a checkpoint.
    finish_and_keep_checkpoint(&dir, "");
    dir.expect("room.toml --once --progress none -o out.exr --seed 3", 0);
    assert!(dir.path("out.exr.checkpoint").exists());
    dir.write("out.exr.checkpoint", "the user's notes");
    let stderr = stderr_of(&dir, "room.toml --once -o out.exr --keep-checkpoint", 0);
    assert_mentions(&stderr, &["warning", "out.exr.checkpoint", "--checkpoint 0"]);
    assert_eq!(dir.bytes("out.exr.checkpoint"), b"the user's notes");
    let child = begin(&dir, "room.toml --once --progress none -o other.exr --samples 100000 --checkpoint 0");
    std::thread::sleep(Duration::from_millis(300));
    assert_eq!(end(child, Signal::SIGTERM), Some(143));
    assert!(!dir.path("other.exr.checkpoint").exists(), "0 must disable checkpoints");
}

#[test]
fn running_process_keeps_its_checkpoint() {
    let dir = room_dir();
    let line = "room.toml --once -o out.exr --samples 1000000 --checkpoint 0.05";
    let seed_is = |seed: u32| {
        let stderr = stderr_of(&dir, "room.toml --once -o out.exr --seed 9 --resume", 2);
        assert_mentions(&stderr, &["seed", &seed.to_string(), "9"]);
    };
    let mut first = begin(&dir, &format!("{line} --seed 1"));
    dir.await_file("out.exr.checkpoint", &mut first);
    // A second process that renders to the same file, even with the same settings, writes no checkpoint and
    // reports this once.
    for options in ["--seed 2", "--seed 1 --resume"] {
        let mut second = dir.glimt(&format!("{line} {options}"));
        let second = second.stderr(Stdio::piped()).spawn().expect("it runs");
        std::thread::sleep(Duration::from_millis(800));
        kill(Pid::from_raw(second.id() as i32), Signal::SIGTERM).expect("it runs");
        let output = second.wait_with_output().expect("a child");
        let text = String::from_utf8(output.stderr).expect("UTF-8");
        let words: Vec<_> = text.split_whitespace().collect();
        let stderr = words.join(" ");
        assert!(mentions(&stderr, "out.exr.checkpoint"), "{stderr}");
        assert!(!dir.path("out.exr").exists(), "{stderr}");
        seed_is(1);
    }
    // Finishing another render to the same file does not remove the running process's checkpoint.
    dir.expect("room.toml --once --progress none -o out.exr --samples 1 --seed 1", 0);
    seed_is(1);
    assert!(!dir.path("out.exr.checkpoint.before").exists());
    // After the process has ended, its checkpoint can be replaced.
    end(first, Signal::SIGKILL);
    let mut child = begin(&dir, &format!("{line} --seed 2"));
    dir.await_file("out.exr.checkpoint.before", &mut child);
    dir.await_file("out.exr.checkpoint", &mut child);
    end(child, Signal::SIGTERM);
    seed_is(2);
}

#[test]
fn full_disk_reports_the_checkpoint_once() {
    let dir = room_dir();
    // `ulimit -f` counts 512-byte blocks. A checkpoint takes 150 kB, the image 8 kB.
    let limited = |blocks: u32, line: &str| {
        let program = dir.glimt("").get_program().to_owned();
        let mut shell = std::process::Command::new("sh");
        shell.current_dir(dir.0.path());
        shell.arg("-c").arg(format!("ulimit -f {blocks}; exec \"$0\" {line}")).arg(program);
        let output = shell.output().expect("a shell");
        let text = String::from_utf8(output.stderr).expect("UTF-8");
        (output.status.code(), text.split_whitespace().collect::<Vec<_>>().join(" "))
    };
    let line = "room.toml --once --samples 2000 --checkpoint 0.02";
    let too_large = system_error(Errno::EFBIG);
    let (code, stderr) = limited(100, &format!("{line} -o out.png"));
    assert_eq!(code, Some(0), "{stderr}");
    assert_eq!(stderr.to_lowercase().matches(&too_large).count(), 1, "{stderr}");
    assert_mentions(&stderr, &["out.png.checkpoint", "out.png"]);
    assert!(dir.bytes("out.png").starts_with(b"\x89PNG"), "{stderr}");
    // The limit also prevents writing the image.
    dir.write("out.png", "the image before");
    let (code, stderr) = limited(2, &format!("{line} -o out.png"));
    assert_eq!(code, Some(1), "{stderr}");
    assert_eq!(stderr.to_lowercase().matches(&too_large).count(), 2, "{stderr}");
    assert_mentions(&stderr, &["out.png.checkpoint", "error", "out.png"]);
    assert_eq!(dir.bytes("out.png"), b"the image before");
    assert_no_leftovers(&dir);
}

#[test]
fn render_without_checkpoints_can_resume() {
    let dir = room_dir();
    finish_and_keep_checkpoint(&dir, "--samples 2");
    dir.expect("room.toml --once --progress none -o one.exr --samples 5", 0);
    let stderr = stderr_of(&dir, "room.toml --once -o out.exr --samples 5 --resume --checkpoint 0", 0);
    assert_mentions(&stderr, &["out.exr.checkpoint", "2 samples"]);
    assert!(dir.bytes("out.exr") == dir.bytes("one.exr"));
    assert!(!dir.path("out.exr.checkpoint").exists());
}

#[test]
fn pipe_as_checkpoint_does_not_block() {
    let dir = room_dir();
    for name in ["out.exr.checkpoint", "a.part"] {
        nix::unistd::mkfifo(&dir.path(name), nix::sys::stat::Mode::S_IRWXU).expect("a pipe");
    }
    let stderr = stderr_of(&dir, "room.toml --once -o out.exr --keep-checkpoint", 0);
    assert_mentions(&stderr, &["warning", "out.exr.checkpoint", "--checkpoint 0"]);
    stderr_of(&dir, "room.toml --once -o a.part --shard 1/2 --resume", 1);
    stderr_of(&dir, "merge joined.exr a.part", 2);
}

#[test]
fn newer_checkpoint_is_moved_not_replaced() {
    let dir = room_dir();
    finish_and_keep_checkpoint(&dir, "");
    let mut newer = dir.bytes("out.exr.checkpoint");
    newer[12] = 9;
    dir.write("out.exr.checkpoint", &newer);
    let mut child = begin(&dir, "room.toml --once -o out.exr --samples 1000000 --checkpoint 0.05");
    dir.await_file("out.exr.checkpoint.before", &mut child);
    end(child, Signal::SIGKILL);
    assert!(dir.bytes("out.exr.checkpoint.before") == newer);
}

#[test]
fn resume_keeps_finished_and_unrelated_parts() {
    let dir = room_dir();
    for options in
        ["--samples 5", "--photons on --samples 40 --set photons.count=500", "--samples 64 --error 0.2"]
    {
        let line = format!("room.toml --once -o a.part --shard 1/2 {options}");
        dir.expect(&format!("{line} --progress none"), 0);
        let part = dir.bytes("a.part");
        let report = dir.report(&format!("{} --resume --progress none", line.replace(" --once", "")));
        assert!(dir.bytes("a.part") == part, "{options}");
        assert_eq!(
            report["counters"]["camera_rays"], 0,
            "{options}: a finished part must not be rendered again"
        );
        let stderr = stderr_of(&dir, &format!("{line} --resume"), 0);
        assert_mentions(&stderr, &["a.part", "finished"]);
        for (other, facts) in [
            ("--seed 4", &["seed", "0", "4"][..]),
            ("--set render.exposure=1", &["exposure", "0", "1"]),
            ("--shard 1/3", &["1/2"]),
        ] {
            let line =
                line.replace("--shard 1/2", if other.starts_with("--shard") { "" } else { "--shard 1/2" });
            let stderr = stderr_of(&dir, &format!("{line} --resume {other}"), 2);
            assert_mentions(&stderr, facts);
            assert_mentions(&stderr, &["--resume", "-o"]);
            assert!(dir.bytes("a.part") == part, "{options} {other}");
        }
        // A truncated part is rendered again.
        dir.write("a.part", &part[..part.len() / 2]);
        let stderr = stderr_of(&dir, &format!("{line} --resume"), 0);
        assert_mentions(&stderr, &["a.part", &format!("byte {}", part.len() / 2)]);
        assert!(dir.bytes("a.part") == part, "{options}");
        fs::remove_file(dir.path("a.part")).expect("removed");
    }
}

#[test]
fn part_resumes_from_its_own_checkpoint() {
    let dir = room_dir();
    let options = "--photons on --samples 100 --set photons.count=2000";
    dir.expect(&format!("room.toml --once --progress none -o one.exr {options}"), 0);
    for index in 1..=2 {
        let line =
            format!("room.toml --once --progress none -o {index}.part --shard {index}/2 --resume {options}");
        for _ in 0..3 {
            let child = begin(&dir, &format!("{line} --checkpoint 0.02"));
            std::thread::sleep(Duration::from_millis(150));
            end(child, Signal::SIGKILL);
        }
        dir.expect(&line, 0);
    }
    dir.expect("merge joined.exr 1.part 2.part --progress none", 0);
    assert!(dir.bytes("joined.exr") == dir.bytes("one.exr"));
    // A part's checkpoint is not used for another part.
    let child = begin(&dir, "room.toml --once --progress none -o a.part --shard 1/2 --samples 100000");
    std::thread::sleep(Duration::from_millis(300));
    assert_eq!(end(child, Signal::SIGTERM), Some(143));
    let stderr = stderr_of(&dir, "room.toml --once -o a.part --shard 2/2 --samples 100000 --resume", 2);
    assert_mentions(&stderr, &["1/2", "2/2"]);
}
