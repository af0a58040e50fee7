//! Random keys, saves and ways to exit. Before `w` is pressed, the image on disk belongs to a saved scene.
//! The line printed after `q` must be true.

use std::collections::HashMap;
use std::path::Path;
use std::process::Command;
use std::time::Duration;

use glimt::math::random::TestRandom;
use glimt::tui::messages;
use nix::sys::signal::Signal;

use super::pty::{SCENE, Terminal};
use crate::test_dir::{PROGRAM, TestDir, assert_mentions, mentions};

/// Number of sequences in the regular test.
const SEQUENCES: u64 = 12;
/// Number of sequences in the long test, over all scenes.
const LONG: u64 = 300;
/// Bundled scenes for the long test.
const BUNDLED: [&str; 6] = ["dof", "path", "phong", "photons", "shadows", "textures"];
/// Keys that change only the preview.
const PREVIEW_KEYS: [&str; 12] = ["s", "s", "d", "p", "i", "[", "]", "v", "l", "<", "0", "0"];

/// A scene in a folder, the program rendering it, and all previous actions.
struct RandomSession<'a> {
    folder: TestDir,
    terminal: Terminal,
    options: &'a [&'a str],
    /// All versions of the scene file.
    saved: Vec<String>,
    /// Whether `w` was pressed.
    has_written: bool,
    log: Vec<String>,
}

impl<'a> RandomSession<'a> {
    fn new(text: &str, options: &'a [&'a str]) -> Self {
        let folder = TestDir::with_board();
        folder.write("scene.toml", text);
        let call = [&[PROGRAM, "scene.toml"], options].concat();
        let terminal = folder.wide_terminal_with(&call);
        Self { folder, terminal, options, saved: vec![text.to_owned()], has_written: false, log: Vec::new() }
    }

    fn save(&mut self, text: String) {
        self.folder.write("scene.new", &text);
        std::fs::rename(self.folder.path("scene.new"), self.folder.path("scene.toml")).expect("saved");
        self.saved.push(text);
    }

    /// Performs a random step.
    fn step(&mut self, random: &mut TestRandom) {
        let first = self.saved[0].clone();
        match random.below(12) {
            0 => {
                let seed = random.below(3);
                self.log.push(format!("save seed {seed}"));
                self.save(first.replacen("[render]\n", &format!("[render]\nseed = {seed}\n"), 1));
            }
            1 => {
                self.log.push("save a comment".to_owned());
                let last = self.saved.last().cloned().unwrap_or_default();
                self.save(format!("{last}# {}\n", self.saved.len()));
            }
            2 if random.below(3) == 0 => {
                self.log.push("w".to_owned());
                self.has_written = true;
                self.terminal.press("w");
            }
            2..=4 => {
                self.log.push("wait".to_owned());
                self.terminal.wait("an end", |screen| {
                    let first = screen.contents().lines().next().unwrap_or_default().to_owned();
                    first.contains("✓ done") || first.contains("! unwritten")
                });
            }
            5 => std::thread::sleep(Duration::from_millis(10 * random.below(20) as u64)),
            _ => {
                let key = *random.pick(&PREVIEW_KEYS);
                self.log.push(key.to_owned());
                self.terminal.press(key);
            }
        }
    }

    /// The image rendered with `--once` from the text of a scene.
    fn once(&self, known: &mut HashMap<String, Vec<u8>>, text: &str, options: &[&str]) -> Vec<u8> {
        let key = format!("{text}\0{options:?}");
        let image = known.entry(key).or_insert_with(|| {
            self.folder.write("once.toml", text);
            let mut process = Command::new(PROGRAM);
            process.current_dir(self.folder.path("")).args(["once.toml", "--once", "-o", "once.png"]);
            let output = process.args(self.options).args(options).output().expect("it runs");
            assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
            without_settings(&self.folder.path("once.png"))
        });
        image.clone()
    }
}

/// Pixels of a PNG. Excludes the stored settings, which contain the scene's file name.
fn without_settings(path: &Path) -> Vec<u8> {
    let file = std::io::BufReader::new(std::fs::File::open(path).expect("an image"));
    let mut reader = png::Decoder::new(file).read_info().expect("a PNG");
    let mut pixels = vec![0; reader.output_buffer_size().expect("a small image")];
    reader.next_frame(&mut pixels).expect("whole");
    pixels
}

/// How to end a sequence.
#[derive(Clone, Copy, Debug)]
enum SequenceEnd {
    Quit,
    Signal(Signal),
}

fn run(seed: u64, text: &str, options: &[&str], known: &mut HashMap<String, Vec<u8>>) {
    let mut random = TestRandom::new(seed);
    let mut run = RandomSession::new(text, options);
    run.terminal.wait("the screen", |screen| screen.contents().contains("scene.toml"));
    for _ in 0..3 + random.below(8) {
        run.step(&mut random);
    }
    let ends = [Signal::SIGTERM, Signal::SIGHUP, Signal::SIGKILL].map(SequenceEnd::Signal);
    let end = if random.below(3) > 0 { SequenceEnd::Quit } else { *random.pick(&ends) };
    match end {
        SequenceEnd::Quit => run.terminal.press("q"),
        SequenceEnd::Signal(signal) => run.terminal.signal(signal),
    }
    run.terminal.code();
    let said = match end {
        SequenceEnd::Quit => run.terminal.last_lines(),
        SequenceEnd::Signal(_) => String::new(),
    };
    run.log.push(format!("{end:?}: {said}"));
    check(&run, &said, known, seed);
}

/// Checks the image on disk and the last lines against the saved scenes.
fn check(run: &RandomSession<'_>, said: &str, known: &mut HashMap<String, Vec<u8>>, seed: u64) {
    let log = format!("seed {seed}: {}", run.log.join(", "));
    let path = run.folder.path("scene.png");
    let image = path.exists().then(|| without_settings(&path));
    let now = run.saved.last().expect("a scene").clone();
    let newest = run.once(known, &now, &[]);
    // The last save may have been too late for a render.
    let is_current = image.as_ref() == Some(&newest);
    if !run.has_written {
        let earlier = run.saved.clone();
        let is_one = |image: &Vec<u8>| earlier.iter().any(|text| run.once(known, text, &[]) == *image);
        assert!(image.as_ref().is_none_or(is_one), "the image matches no saved scene: {log}");
    }
    if said.is_empty() {
        return;
    }
    let first = said.lines().next().unwrap_or_default();
    let is_older = ["older than", "not finished", "was stopped", "no image written", "is not written"];
    if is_older.iter().any(|words| first.contains(words)) {
        // Saving a comment makes the image older than the scene without changing it.
        let before = run.saved.iter().rev().skip(1);
        let was_made_before = before.clone().any(|text| run.once(known, text, &[]) == newest);
        let is_true = run.has_written || !is_current || was_made_before || first.contains("was stopped");
        assert!(is_true, "reported as outdated, but the image is current: {log}");
    } else if first.starts_with("wrote ")
        && first.contains("samples")
        && !first.contains(", with ")
        && !first.contains("unfinished")
        && !first.contains("view ")
    {
        let was_seen = run.saved.iter().rev().take(2).any(|text| image == Some(run.once(known, text, &[])));
        assert!(is_current || was_seen, "the image belongs to a different scene: {log}");
    }
    if let Some(options) = said.lines().find_map(|line| line.strip_prefix("not kept: ")) {
        let options: Vec<String> = options.split(' ').map(|word| word.replace('\'', "")).collect();
        let options: Vec<&str> = options.iter().map(String::as_str).collect();
        run.once(known, &now, &options);
    }
}

#[test]
fn random_keys_never_write_wrong_image() {
    let mut known = HashMap::new();
    for seed in 0..SEQUENCES {
        run(seed, SCENE, &["--samples", "64"], &mut known);
    }
}

#[test]
#[ignore = "takes half an hour"]
fn random_keys_are_safe_in_bundled_scenes() {
    let mut known = HashMap::new();
    let options = ["--width", "48", "--height", "36", "--samples", "16"];
    for seed in 0..LONG {
        let name = BUNDLED[(seed % BUNDLED.len() as u64) as usize];
        let root = env!("CARGO_MANIFEST_DIR");
        let text = std::fs::read_to_string(format!("{root}/scenes/{name}.toml")).expect("a scene");
        let text = text.replace("\"../assets", &format!("\"{root}/assets"));
        run(seed, &text, &options, &mut known);
    }
}

#[test]
fn preview_keys_keep_the_finished_image() {
    let folder = TestDir::with_board();
    let mut terminal = folder.wide_terminal_with(&[PROGRAM, "scene.toml"]);
    terminal.wait_for_render(1);
    let image = folder.bytes("scene.png");
    terminal.press("s");
    terminal.wait_for_render(2);
    terminal.press("s");
    terminal.wait_for_render(3);
    terminal.wait_for(messages::NOT_SAVED);
    assert_eq!(folder.bytes("scene.png"), image);
    terminal.press("q");
    assert_eq!(terminal.code(), 0);
    let said = terminal.last_lines();
    assert_mentions(&said, &["scene.png", "64×48", "4 samples", "--shadows off"]);
    assert_eq!((folder.bytes("scene.png"), folder.once(&[])), (image.clone(), image));
}

#[test]
fn interrupted_image_resumes_in_the_next_run() {
    let folder = TestDir::with_board();
    let whole = {
        folder.write("scene.toml", SCENE.replace("samples = 4", "samples = 3000"));
        folder.once(&[])
    };
    let mut terminal = folder.wide_terminal_with(&[PROGRAM, "scene.toml", "--checkpoint", "0.01"]);
    terminal.wait_for_coverage();
    terminal.press("s");
    terminal.wait_for(messages::NOT_SAVED);
    assert!(!folder.path("scene.png").exists());
    terminal.press("q");
    assert_eq!(terminal.code(), 0);
    let said = terminal.last_lines();
    assert_mentions(&said, &["scene.png", "glimt scene.toml --checkpoint 0.01"]);
    let mut terminal = folder.terminal();
    terminal.wait("the finished image", |_| folder.path("scene.png").exists());
    terminal.press("q");
    assert_eq!((terminal.end(), folder.bytes("scene.png")), (0, whole));
}

#[test]
fn external_change_to_image_is_reported() {
    let folder = TestDir::with_board();
    let mut terminal = folder.wide_terminal_with(&[PROGRAM, "scene.toml"]);
    terminal.wait_for_render(1);
    let image = folder.bytes("scene.png");
    std::fs::remove_file(folder.path("scene.png")).expect("removed");
    terminal.wait_for(&messages::output_modified_externally("scene.png", "was removed"));
    terminal.press("w");
    terminal.wait_for_message(&messages::files_written("scene.png"));
    assert_eq!(folder.bytes("scene.png"), image);
    terminal
        .wait("no message that the image was removed", |screen| !screen.contents().contains("was removed"));
    // Another glimt process writes the image with other settings.
    let other = folder.once(&["--shadows", "off", "-o", "other.png"]);
    drop(other);
    std::fs::rename(folder.path("other.png"), folder.path("scene.png")).expect("moved");
    terminal.wait("a report of the change", |screen| {
        ["scene.png", "another program"].iter().all(|fact| mentions(&screen.contents(), fact))
    });
    terminal.press("q");
    assert_eq!(terminal.code(), 0);
    let said = terminal.last_lines();
    assert_mentions(&said, &["scene.png", "another program"]);
}
