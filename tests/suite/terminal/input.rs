//! Bursts, pasted text and the terminal's own answers: glimt loses no key, and takes nothing else for one.

use std::time::Duration;

use super::pty::{Folder, SCENE};

/// A key without a binding.
const UNBOUND: &str = "Y";

fn pause(milliseconds: u64) {
    std::thread::sleep(Duration::from_millis(milliseconds));
}

#[test]
fn a_key_after_a_burst_is_seen() {
    let folder = Folder::new();
    let mut terminal = folder.terminal();
    terminal.wait_for_render(1);
    // Nothing more comes after it: its last key must not wait for more.
    terminal.burst(UNBOUND.repeat(60_000) + "?");
    terminal.wait_for("show or hide this help");
    terminal.burst(UNBOUND.repeat(60_000) + "q");
    assert_eq!(terminal.end(), 0);
}

#[test]
fn pasted_text_is_no_keys() {
    let folder = Folder::new();
    let mut terminal = folder.terminal();
    terminal.wait_for_render(1);
    assert!(terminal.look(vt100::Screen::bracketed_paste));
    terminal.press("\x1b[200~quit: q?\x03\x1b[20");
    pause(300);
    terminal.press("1~");
    terminal.wait_for_render(1);
    terminal.burst(format!("\x1b[200~{}\x1b[201~?", "q?".repeat(30_000)));
    terminal.wait_for("show or hide this help");
    terminal.press("q");
    assert_eq!(terminal.end(), 0);
}

#[test]
fn nothing_of_a_long_paste_is_a_key() {
    let folder = Folder::new();
    let mut terminal = folder.terminal();
    terminal.wait_for_render(1);
    // Each of these keys does something, the last two write the camera into the scene and end the program.
    terminal.burst(format!("\x1b[200~{}\x1b[201~?", "h?vcq".repeat(300_000)));
    terminal.wait_for("show or hide this help");
    assert_eq!(folder.bytes("scene.toml"), SCENE.as_bytes());
    terminal.press("q");
    assert_eq!(terminal.end(), 0);
}

#[test]
fn a_paste_that_does_not_end_holds_the_keyboard_for_a_second() {
    let folder = Folder::new();
    let mut terminal = folder.terminal();
    terminal.wait_for_render(1);
    terminal.burst(format!("\x1b[200~{}", "q".repeat(9_000)));
    pause(1500);
    terminal.wait_for_render(1);
    terminal.press("q");
    assert_eq!(terminal.end(), 0);
}

#[test]
fn answers_of_the_terminal_are_no_keys_however_they_are_split() {
    let folder = Folder::new();
    let mut terminal = folder.terminal();
    terminal.wait_for_render(1);
    for answer in
        ["\x1b[0n", "\x1b[?62;1;22;0c", "\x1b[24;80R", "\x1b[?2026;0$y", "\x1b]11;rgb:0000/0000/0000\x1b\\"]
    {
        terminal.press(answer);
        // A string in pieces looks like keys, and glimt never requests one.
        for byte in answer.chars().filter(|_| !answer.starts_with("\x1b]")) {
            terminal.press(&byte.to_string());
            pause(90);
        }
        // Each of the answers has a `0` in it, which would say something if it were a key.
        assert!(!terminal.text().contains("nothing to reset"), "{answer:?}");
    }
    terminal.press("e");
    terminal.wait_for("no errors and no warnings");
    terminal.press("0");
    terminal.wait_for("nothing to reset");
    terminal.press("?");
    terminal.wait_for("show or hide this help");
    // An escape character that nothing follows is the key.
    terminal.press("\x1b");
    terminal.wait("no help", |screen| !screen.contents().contains("show or hide this help"));
    terminal.press("q");
    assert_eq!(terminal.end(), 0);
}

#[test]
fn strings_and_sequences_that_do_not_end_hold_nothing() {
    // A terminal for each, as the time goes by in waiting.
    let terminals = ["\x1b]0;", "\x1bP", "\x1b[", "\x1bO", "\x1b[1;", "\x1bX", "\u{e9}\x1b"].map(|begun| {
        let folder = Folder::new();
        let mut terminal = folder.terminal();
        terminal.wait_for_render(1);
        terminal.press(begun);
        (folder, terminal)
    });
    pause(2500);
    for (_folder, mut terminal) in terminals {
        terminal.press("?");
        terminal.wait_for("show or hide this help");
        terminal.press("q");
        assert_eq!(terminal.end(), 0);
    }
}
