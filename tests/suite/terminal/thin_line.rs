//! Over a thin line, glimt answers a key at once, whatever is on the way, and the shell returns at once.

use std::time::{Duration, Instant};

use super::pty::{Folder, GREEN, RED, SCENE, Terminal};
use super::relay::Answers;

/// Most bytes on their way without an answer from the terminal.
const MOST: usize = 24_000;
/// Longest time from a key to its first changed cells, and from `q` to the shell.
const SEEN: Duration = Duration::from_millis(400);

const ALL: [Answers; 3] = [Answers::Terminal, Answers::Multiplexer, Answers::Nothing];

/// A render that does not end.
fn endless(answers: Answers) -> (Folder, Terminal) {
    let folder = Folder::new();
    folder.write("scene.toml", &SCENE.replace("samples = 4", "samples = 10000000"));
    let terminal = folder.thin_line(answers);
    terminal.wait_for("ETA");
    terminal.wait("a picture", |screen| super::Colors::of(screen).red > 500);
    (folder, terminal)
}

/// Time until a key shows its effect.
fn time(terminal: &mut Terminal, key: &str, what: &str, holds: impl Fn(&vt100::Screen) -> bool) -> Duration {
    let begin = Instant::now();
    terminal.press(key);
    terminal.wait(what, holds);
    begin.elapsed()
}

/// Checks that something took no longer than [`SEEN`] at least once. Other tests may occupy the processors, so that the least of
/// several times is the program's own.
#[track_caller]
fn assert_at_once(what: &str, mut once: impl FnMut() -> Duration) {
    const TRIES: u32 = 12;
    let mut least = Duration::MAX;
    for _ in 0..TRIES {
        least = least.min(once());
        if least <= SEEN {
            break;
        }
    }
    assert!(least <= SEEN, "{what} after {least:?}");
}

#[test]
fn keys_are_seen_at_once_and_little_is_on_the_way() {
    /// Number of tries, as the line itself stalls while other tests occupy the processors.
    const TRIES: u32 = 4;
    for answers in ALL {
        let mut least = usize::MAX;
        for _ in 0..TRIES {
            least = least.min(most_on_the_way(answers));
            if least <= MOST {
                break;
            }
        }
        assert!(least <= MOST, "{answers:?}: {least} B in the line, or without an answer");
    }
}

/// Bytes in the line, or bytes without an answer from the terminal, while keys are pressed and the scene is saved.
fn most_on_the_way(answers: Answers) -> usize {
    let (folder, mut terminal) = endless(answers);
    let mut words = ["shadows hard", "shadows off", "shadows soft"].into_iter().cycle();
    for _ in 0..3 {
        assert_at_once(&format!("{answers:?}: shadows"), || {
            std::thread::sleep(Duration::from_millis(700));
            let words = words.next().expect("without end");
            time(&mut terminal, "s", words, |screen| screen.contents().contains(words))
        });
    }
    // An edit while the line is full: the newest picture only.
    folder.write("scene.toml", &SCENE.replace(RED, GREEN).replace("samples = 4", "samples = 10000000"));
    terminal.wait_for_color("green");
    let (unanswered, waiting) = terminal.line(|seen| (seen.most_unanswered, seen.most_waiting));
    if answers == Answers::Terminal { unanswered } else { waiting }
}

#[test]
fn the_shell_is_back_at_once() {
    for answers in ALL {
        assert_at_once(&format!("{answers:?}: the shell's screen"), || {
            let (_folder, mut terminal) = endless(answers);
            let taken = time(&mut terminal, "q", "the shell's screen", |screen| !screen.alternate_screen());
            assert_eq!(terminal.end(), 0);
            taken
        });
    }
}

#[test]
fn nothing_is_sent_when_nothing_happens() {
    // All lines at once, as the time goes by in waiting.
    let terminals = ALL.map(|answers| {
        let folder = Folder::new();
        let terminal = folder.thin_line(answers);
        terminal.wait_for_render(1);
        (folder, terminal)
    });
    // The last exact picture may still be on its way.
    std::thread::sleep(Duration::from_secs(3));
    let sent = || terminals.each_ref().map(|(_, terminal)| terminal.line(|seen| seen.sent));
    let before = sent();
    std::thread::sleep(Duration::from_secs(1));
    assert_eq!(sent(), before, "{ALL:?}");
}

#[test]
fn the_line_is_measured_and_shown() {
    /// kB sent, and the terminal's time to answer in ms, by the line above the keys.
    fn measured(screen: &vt100::Screen) -> Option<(u32, u32)> {
        let text = screen.contents();
        let words: Vec<&str> = text.lines().nth_back(1)?.split_whitespace().collect();
        // The frame arrives in pieces: other milliseconds of that line are not those of the answer.
        let &[size, "kB", "sent,", "answered", "in", time, "ms"] = words.last_chunk()? else { return None };
        Some((size.parse().ok()?, time.parse().ok()?))
    }
    // A busy machine makes an answer late, never early.
    assert_at_once("the answer by the screen", || {
        let folder = Folder::new();
        let mut terminal = folder.thin_line(Answers::Terminal);
        terminal.wait_for_render(1);
        // On a machine that stands still for a second, the first answer comes too late to be measured. Then another picture tells.
        let mut seen = terminal.settled(measured);
        for _ in 0..20 {
            if seen.is_some() {
                break;
            }
            terminal.press("s");
            seen = terminal.settled(measured);
        }
        let (size, time) = seen.expect("bytes and time of the last picture");
        assert!((1..200).contains(&size) && time >= 150, "{size} kB, {time} ms");
        terminal.press("?");
        terminal.wait_for("the terminal's time to answer");
        Duration::from_millis(u64::from(time))
    });
}

#[test]
fn a_terminal_that_takes_nothing_does_not_hold_up_the_end() {
    assert_at_once("the end", || {
        let folder = Folder::new();
        folder.write("scene.toml", &SCENE.replace("samples = 4", "samples = 10000000"));
        let mut terminal = folder.terminal();
        terminal.wait_for("ETA");
        terminal.set_reading(false);
        // Each view is another picture, until nothing more fits in.
        for _ in 0..40 {
            terminal.press("v");
            std::thread::sleep(Duration::from_millis(100));
        }
        let begin = Instant::now();
        terminal.press("q");
        assert_eq!(terminal.code(), 0);
        let taken = begin.elapsed();
        terminal.set_reading(true);
        assert_eq!(terminal.end(), 0);
        taken
    });
}

/// Checks the redraw: a terminal cuts what does not fit, and the program may see only the last size.
#[test]
fn a_window_that_shrinks_and_grows_at_once_is_drawn_anew() {
    let folder = Folder::new();
    let mut terminal = folder.terminal();
    terminal.wait_for_render(1);
    for _ in 0..8 {
        terminal.resize(10, 3);
        terminal.resize(80, 24);
        terminal.wait_for("whitted");
        terminal.wait_for_color("red");
    }
    terminal.press("q");
    assert_eq!(terminal.end(), 0);
}
