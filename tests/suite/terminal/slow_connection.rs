//! Over a slow connection, glimt responds to keys and quits immediately, regardless of queued output.

use std::time::{Duration, Instant};

use glimt::tui::messages;

use super::pty::{GREEN, RED, SCENE, Terminal};
use super::relay::Responder;
use crate::test_dir::TestDir;

/// Limit on bytes that the terminal has not acknowledged.
const MAX_UNACKNOWLEDGED: usize = 24_000;
/// Time limit from a key press to the first changed cells, and from `q` to the shell.
const RESPONSE_LIMIT: Duration = Duration::from_millis(400);

const ALL_RESPONDERS: [Responder; 3] = [Responder::Terminal, Responder::Multiplexer, Responder::Nothing];

/// Starts a render that does not finish.
fn endless(answers: Responder) -> (TestDir, Terminal) {
    let folder = TestDir::with_board();
    folder.write("scene.toml", SCENE.replace("samples = 4", "samples = 10000000"));
    let terminal = folder.thin_line(answers);
    terminal.wait_for("ETA");
    terminal.wait("an image", |screen| super::Colors::of(screen).red > 500);
    (folder, terminal)
}

/// Time until a key has a visible effect.
fn response_time(
    terminal: &mut Terminal,
    key: &str,
    what: &str,
    holds: impl Fn(&vt100::Screen) -> bool,
) -> Duration {
    let begin = Instant::now();
    terminal.press(key);
    terminal.wait(what, holds);
    begin.elapsed()
}

/// Checks that the fastest of several attempts is within [`RESPONSE_LIMIT`]. Only the fastest attempt is
/// meaningful, because other tests may occupy the processors.
#[track_caller]
fn assert_at_once(what: &str, mut once: impl FnMut() -> Duration) {
    const ATTEMPTS: u32 = 12;
    let mut least = Duration::MAX;
    for _ in 0..ATTEMPTS {
        least = least.min(once());
        if least <= RESPONSE_LIMIT {
            break;
        }
    }
    assert!(least <= RESPONSE_LIMIT, "{what} after {least:?}");
}

#[test]
fn keys_respond_quickly_with_short_queue() {
    /// Number of attempts, because the simulated connection stalls while other tests occupy the processors.
    const ATTEMPTS: u32 = 4;
    for answers in ALL_RESPONDERS {
        let mut least = usize::MAX;
        for _ in 0..ATTEMPTS {
            least = least.min(max_bytes_in_flight(answers));
            if least <= MAX_UNACKNOWLEDGED {
                break;
            }
        }
        assert!(least <= MAX_UNACKNOWLEDGED, "{answers:?}: {least} B queued or unacknowledged");
    }
}

/// Maximum number of queued or unacknowledged bytes while keys are pressed and the scene is saved.
fn max_bytes_in_flight(answers: Responder) -> usize {
    let (folder, mut terminal) = endless(answers);
    let mut words = ["shadows hard", "shadows off", "shadows soft"].into_iter().cycle();
    for _ in 0..3 {
        assert_at_once(&format!("{answers:?}: shadows"), || {
            std::thread::sleep(Duration::from_millis(700));
            let words = words.next().expect("without end");
            response_time(&mut terminal, "s", words, |screen| screen.contents().contains(words))
        });
    }
    // After an edit while the connection is busy, only the newest image is sent.
    folder.write("scene.toml", SCENE.replace(RED, GREEN).replace("samples = 4", "samples = 10000000"));
    terminal.wait_for_color("green");
    let (unanswered, waiting) = terminal.line(|seen| (seen.max_unanswered, seen.max_waiting));
    if answers == Responder::Terminal { unanswered } else { waiting }
}

#[test]
fn quit_returns_quickly() {
    for answers in ALL_RESPONDERS {
        assert_at_once(&format!("{answers:?}: the shell's screen"), || {
            let (_folder, mut terminal) = endless(answers);
            let taken =
                response_time(&mut terminal, "q", "the shell's screen", |screen| !screen.alternate_screen());
            assert_eq!(terminal.end(), 0);
            taken
        });
    }
}

#[test]
fn idle_program_sends_nothing() {
    // Test all connections concurrently, because the test mostly waits.
    let terminals = ALL_RESPONDERS.map(|answers| {
        let folder = TestDir::with_board();
        let terminal = folder.thin_line(answers);
        terminal.wait_for_render(1);
        (folder, terminal)
    });
    // The last exact preview may still be in transit.
    std::thread::sleep(Duration::from_secs(3));
    let sent = || terminals.each_ref().map(|(_, terminal)| terminal.line(|seen| seen.sent));
    let before = sent();
    std::thread::sleep(Duration::from_secs(1));
    assert_eq!(sent(), before, "{ALL_RESPONDERS:?}");
}

#[test]
fn connection_is_measured_and_shown() {
    /// Kilobytes sent and the round-trip time in milliseconds, from the line above the keys.
    fn measured(screen: &vt100::Screen) -> Option<(u32, u32)> {
        let text = screen.contents();
        let words: Vec<&str> = text.lines().nth_back(1)?.split_whitespace().collect();
        // The frame arrives in pieces, so match the whole line to avoid other numbers.
        let &[size, "kB", "sent", "·", time, "ms", "round", "trip"] = words.last_chunk()? else {
            return None;
        };
        Some((size.parse().ok()?, time.parse().ok()?))
    }
    // A busy machine can only delay replies.
    assert_at_once("the round trip on the screen", || {
        let folder = TestDir::with_board();
        let mut terminal = folder.thin_line(Responder::Terminal);
        terminal.wait_for_render(1);
        // If the machine stalls for a second, the first reply is too late to be measured, so request another
        // preview.
        let mut seen = terminal.settled(measured);
        for _ in 0..20 {
            if seen.is_some() {
                break;
            }
            terminal.press("s");
            seen = terminal.settled(measured);
        }
        let (size, time) = seen.expect("bytes and time of the last preview");
        assert!((1..200).contains(&size) && time >= 150, "{size} kB, {time} ms");
        terminal.press("?");
        terminal.wait_for(messages::HELP_BYTES);
        Duration::from_millis(u64::from(time))
    });
}

#[test]
fn stalled_terminal_does_not_block_quitting() {
    assert_at_once("the end", || {
        let folder = TestDir::with_board();
        folder.write("scene.toml", SCENE.replace("samples = 4", "samples = 10000000"));
        let mut terminal = folder.terminal();
        terminal.wait_for("ETA");
        terminal.set_reading(false);
        // Switch views until the terminal's buffer is full.
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

/// Checks that the window is redrawn. A terminal truncates text that does not fit, and the program may see
/// only the last size.
#[test]
fn quick_shrink_and_grow_redraws_the_window() {
    let folder = TestDir::with_board();
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
