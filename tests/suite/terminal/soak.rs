//! Soak test: random edits, keys, resizes, broken scenes and dropped terminals, from a fixed seed, for any
//! duration.
//!
//!     GLIMT_SOAK_MINUTES=60 cargo test --profile quick --test suite soak -- --ignored --nocapture
//!
//! One process runs from start to end. In a separate folder, other processes are ended in every possible way
//! and restarted from a checkpoint. `GLIMT_SOAK_SEED` selects different events.

use std::collections::BTreeSet;
use std::fs;
use std::time::{Duration, Instant};

use glimt::math::random::TestRandom;
use nix::sys::signal::Signal;

use super::pty::Terminal;
use crate::test_dir::{PROGRAM, TestDir};

/// Interval between checks.
const PAUSE: Duration = Duration::from_secs(20);
/// Time limit for an image.
const LIMIT: Duration = Duration::from_secs(300);
/// Maximum memory growth, in KiB, from the middle to the end of the test.
const SLACK: u64 = 16 << 10;

/// A scene with a mesh and a texture.
fn scene(random: &mut TestRandom, samples: u32, number: u32) -> String {
    let (width, height) = (32 + random.below(48), 24 + random.below(32));
    let photons = *random.pick(&["", "", "[photons]\nenabled = true\ncount = 2000\n"]);
    let radius = 0.2 + random.below(8) as f32 / 20.0;
    let floor = *random.pick(&["{ texture = \"tiles\" }", "[0.7, 0.5, 0.3]", "\"#8090a0\""]);
    let ball = *random.pick(&["type = \"glass\"", "type = \"mirror\"", "diffuse = [0.8, 0.1, 0.1]"]);
    format!(
        "# {number}\n[render]\nwidth = {width}\nheight = {height}\nsamples = {samples}\nseed = {number}\n{photons}\
        [camera]\nposition = [0, 1.2, 4]\nlook_at = [0, 0.7, 0]\naperture = 0.05\n\
        [textures.tiles]\nfile = \"tiles.ppm\"\n[materials.floor]\ndiffuse = {floor}\n[materials.ball]\n{ball}\n\
        [materials.lamp]\nemission = [6, 5, 4]\n\
        [[plane]]\npoint = [0, 0, 0]\nnormal = [0, 1, 0]\nmaterial = \"floor\"\n\
        [[sphere]]\ncenter = [0.4, 0.5, 0]\nradius = {radius}\nmaterial = \"ball\"\n\
        [[quad]]\ncorner = [-0.6, 2.2, -0.4]\nu = [1.2, 0, 0]\nv = [0, 0, 1.2]\nmaterial = \"lamp\"\n\
        [[mesh]]\nfile = \"step.obj\"\nmaterial = \"floor\"\n"
    )
}

/// Writes a file like a randomly chosen editor.
fn save(folder: &TestDir, random: &mut TestRandom, name: &str, text: &str) {
    let new = folder.path("new~");
    match random.below(4) {
        0 => folder.write(name, text),
        1 => {
            fs::write(&new, text).expect("written");
            fs::rename(&new, folder.path(name)).expect("renamed");
        }
        2 => {
            // Remove the file briefly.
            let _ = fs::remove_file(folder.path(name));
            fs::write(&new, text).expect("written");
            fs::rename(&new, folder.path(name)).expect("renamed");
        }
        _ => {
            // Write the file in two pieces.
            folder.write(name, &text[..text.len() / 2]);
            std::thread::sleep(Duration::from_millis(20));
            folder.write(name, text);
        }
    }
}

/// Writes slightly changed versions of the mesh and the texture.
fn save_assets(folder: &TestDir, random: &mut TestRandom) {
    let top = 0.5 + random.below(8) as f32 / 10.0;
    let gray = 100 + random.below(100);
    save(folder, random, "step.obj", &format!("v -1.5 0 0\nv -0.6 0 0\nv -1 {top} -0.2\nf 1 2 3\n"));
    let tiles = format!("P3\n2 2\n255\n{gray} 200 200 40 40 60\n40 40 60 {gray} 200 200\n");
    save(folder, random, "tiles.ppm", &tiles);
}

/// Metrics of a process.
#[derive(Clone, Copy, Debug)]
struct ProcessMetrics {
    minutes: f32,
    memory_kib: u64,
    handles: usize,
    threads: usize,
    temporary: usize,
}

impl ProcessMetrics {
    fn of(terminal: &Terminal, folder: &TestDir, begin: Instant) -> Self {
        let process = format!("/proc/{}", terminal.id());
        let status = fs::read_to_string(format!("{process}/status")).expect("a process");
        let field = |name: &str| {
            let line = status.lines().find(|line| line.starts_with(name)).expect(name);
            line.split_whitespace().nth(1).and_then(|word| word.parse::<u64>().ok()).expect("a number")
        };
        let names = fs::read_dir(folder.path("")).expect("a folder").flatten().map(|entry| entry.file_name());
        Self {
            minutes: begin.elapsed().as_secs_f32() / 60.0,
            memory_kib: field("VmRSS:"),
            handles: fs::read_dir(format!("{process}/fd")).expect("handles").count(),
            threads: field("Threads:") as usize,
            temporary: names.filter(|name| name.to_string_lossy().ends_with(".tmp")).count(),
        }
    }

    fn words(&self, when: &str) -> String {
        let Self { minutes, memory_kib, handles, threads, temporary } = self;
        let memory = *memory_kib as f32 / 1024.0;
        format!(
            "{when}: {minutes:.1} min, memory {memory:.1} MiB, {handles} handles, {threads} threads, {temporary} temporary files"
        )
    }
}

/// Saves a final scene, and waits until its image equals that of `--once`.
fn assert_image(terminal: &mut Terminal, folder: &TestDir, text: &str, options: &[&str]) {
    folder.write("scene.toml", text);
    let once = folder.once(options);
    let (begin, mut next) = (Instant::now(), Instant::now());
    while fs::read(folder.path("scene.png")).ok().as_ref() != Some(&once) {
        assert!(begin.elapsed() < LIMIT, "the image differs from --once\n{text}\n{}", terminal.text());
        // Close any overlay and reset the settings. On a busy machine, both keys may arrive together as a
        // different key.
        if Instant::now() >= next {
            terminal.press("\x1b");
            std::thread::sleep(Duration::from_millis(400));
            terminal.press("0");
            next = Instant::now() + Duration::from_secs(5);
        }
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// Keys that change only the preview or the screen. Excludes keys that quit, start an editor or change the
/// file.
const KEYS: [&str; 34] = [
    "s", "d", "p", "i", "v", "V", "\t", "x", "z", "h", "j", "k", "l", "+", "-", "<", ">", "[", "]", "f",
    "\r", "m", "b", "n", "N", " ", "r", "w", "0", "e", "?", "\x1b", "3", "\x1b[A",
];

#[test]
#[ignore = "runs for GLIMT_SOAK_MINUTES"]
fn soak() {
    let number =
        |name: &str, default: u64| std::env::var(name).map_or(default, |text| text.parse().expect(name));
    let minutes = number("GLIMT_SOAK_MINUTES", 3);
    let mut random = TestRandom::new(number("GLIMT_SOAK_SEED", 1));
    let begin = Instant::now();
    let end = begin + Duration::from_secs(60 * minutes);
    let folders = [TestDir::with_board(), TestDir::with_board()];
    let [own, other] = &folders;
    for folder in &folders {
        save_assets(folder, &mut random);
        folder.write("scene.toml", scene(&mut random, 4, 0));
    }
    let long = ["--checkpoint", "0.3"];
    let begin_other = || other.terminal_with(&[&[PROGRAM, "scene.toml"], long.as_slice()].concat(), &[]);
    let (mut lives, mut falls) = (own.terminal(), begin_other());
    let (mut events, mut images, mut ends) = (0_u32, 0_u32, BTreeSet::new());
    let mut figures: Vec<ProcessMetrics> = Vec::new();
    let mut next = begin + PAUSE;
    while Instant::now() < end {
        events += 1;
        match random.below(14) {
            0..=3 => {
                let text = scene(&mut random, 1 + events % 8, events);
                save(own, &mut random, "scene.toml", &text);
            }
            4 => {
                let text = scene(&mut random, 4, events);
                let broken =
                    *random.pick(&["samples = ", "material = \"ball\"", "[camera]", "file = \"tiles.ppm\""]);
                let with = *random.pick(&[
                    "samples = -",
                    "material = \"bell\"",
                    "[[",
                    "file = \"none.ppm\"",
                    "\u{0}",
                ]);
                save(own, &mut random, "scene.toml", &text.replace(broken, with));
            }
            5 => save_assets(own, &mut random),
            6..=9 => {
                for _ in 0..1 + random.below(6) {
                    let key = *random.pick(&KEYS);
                    lives.press(key);
                }
            }
            10 => lives.resize(20 + random.below(140) as u16, 6 + random.below(50) as u16),
            11 => {
                // Drop the connection.
                lives.set_reading(false);
                std::thread::sleep(Duration::from_millis(300));
                lives.set_reading(true);
            }
            12 => {
                let text = scene(&mut random, 2000, events % 5);
                save(other, &mut random, "scene.toml", &text);
                let key = *random.pick(&["s", "0", "r", "h", "i"]);
                falls.press(key);
            }
            _ => {
                let signal = *random.pick(&[
                    Signal::SIGHUP,
                    Signal::SIGHUP,
                    Signal::SIGKILL,
                    Signal::SIGTERM,
                    Signal::SIGINT,
                ]);
                let sent = Instant::now();
                falls.signal(signal);
                let code = falls.code();
                assert!(sent.elapsed() < Duration::from_secs(20), "exit after {signal}");
                ends.insert((signal as i32, code));
                falls = begin_other();
            }
        }
        std::thread::sleep(Duration::from_millis(random.below(250) as u64));
        if Instant::now() < next {
            continue;
        }
        // Check the images of both programs, then the metrics of the long-running program.
        let text = scene(&mut random, 8, events);
        assert_image(&mut lives, own, &text, &[]);
        let text = scene(&mut random, 64, events % 5);
        assert_image(&mut falls, other, &text, &[]);
        images += 2;
        figures.push(ProcessMetrics::of(&lives, own, begin));
        if images % 20 == 2 {
            eprintln!("{}", figures[figures.len() - 1].words("now"));
        }
        next = Instant::now() + PAUSE;
    }
    // Print a summary.
    assert!(figures.len() >= 3, "GLIMT_SOAK_MINUTES is too short");
    let (first, middle, last) = (figures[0], figures[figures.len() / 2], figures[figures.len() - 1]);
    eprintln!("{events} events, {images} images equal to --once; exits (signal, code): {ends:?}");
    for (when, figures) in [("start", first), ("middle", middle), ("end", last)] {
        eprintln!("{}", figures.words(when));
    }
    let most = figures.iter().map(|figures| figures.memory_kib).max().unwrap_or_default();
    eprintln!("peak memory: {:.1} MiB", most as f32 / 1024.0);
    lives.press("q");
    assert_eq!(lives.code(), 0);
    drop(falls);
    for folder in &folders {
        let names = fs::read_dir(folder.path("")).expect("a folder").flatten().map(|entry| entry.file_name());
        eprintln!("left: {:?}", names.collect::<Vec<_>>());
    }
    assert_eq!(last.temporary, 0);
    assert!(last.handles <= first.handles + 2, "leaked file descriptors");
    assert!(last.threads <= first.threads + 2, "leaked threads");
    assert!(last.memory_kib <= middle.memory_kib + SLACK, "memory growth");
}
