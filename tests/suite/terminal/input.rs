//! Bursts of keys, pasted text and terminal replies. glimt loses no key and does not mistake other input for
//! keys.

use std::time::Duration;

use glimt::tui::messages;

use super::pty::SCENE;
use crate::test_dir::TestDir;

/// An unbound key.
const UNBOUND: &str = "Y";

fn pause(milliseconds: u64) {
    std::thread::sleep(Duration::from_millis(milliseconds));
}

#[test]
fn key_after_a_burst_is_handled() {
    let folder = TestDir::with_board();
    let mut terminal = folder.terminal();
    terminal.wait_for_render(1);
    // The last key must be handled without waiting for more input.
    terminal.burst(UNBOUND.repeat(60_000) + "?");
    terminal.wait_for_message(messages::HELP_TOGGLE);
    terminal.burst(UNBOUND.repeat(60_000) + "q");
    assert_eq!(terminal.end(), 0);
}

#[test]
fn pasted_text_is_not_keys() {
    let folder = TestDir::with_board();
    let mut terminal = folder.terminal();
    terminal.wait_for_render(1);
    assert!(terminal.look(vt100::Screen::bracketed_paste));
    terminal.press("\x1b[200~quit: q?\x03\x1b[20");
    pause(300);
    terminal.press("1~");
    terminal.wait_for_render(1);
    terminal.burst(format!("\x1b[200~{}\x1b[201~?", "q?".repeat(30_000)));
    terminal.wait_for_message(messages::HELP_TOGGLE);
    terminal.press("q");
    assert_eq!(terminal.end(), 0);
}

#[test]
fn long_paste_is_not_keys() {
    let folder = TestDir::with_board();
    let mut terminal = folder.terminal();
    terminal.wait_for_render(1);
    // Each of these keys has an effect. The last two write the camera to the scene and quit.
    terminal.burst(format!("\x1b[200~{}\x1b[201~?", "h?vcq".repeat(300_000)));
    terminal.wait_for_message(messages::HELP_TOGGLE);
    assert_eq!(folder.bytes("scene.toml"), SCENE.as_bytes());
    terminal.press("q");
    assert_eq!(terminal.end(), 0);
}

#[test]
fn unterminated_paste_ends_after_a_second() {
    let folder = TestDir::with_board();
    let mut terminal = folder.terminal();
    terminal.wait_for_render(1);
    terminal.burst(format!("\x1b[200~{}", "q".repeat(9_000)));
    pause(1500);
    terminal.wait_for_render(1);
    terminal.press("q");
    assert_eq!(terminal.end(), 0);
}

#[test]
fn split_terminal_replies_are_not_keys() {
    let folder = TestDir::with_board();
    let mut terminal = folder.terminal();
    terminal.wait_for_render(1);
    for answer in
        ["\x1b[0n", "\x1b[?62;1;22;0c", "\x1b[24;80R", "\x1b[?2026;0$y", "\x1b]11;rgb:0000/0000/0000\x1b\\"]
    {
        terminal.press(answer);
        // Skip the string reply: when split, it looks like keys, and glimt never requests it.
        for byte in answer.chars().filter(|_| !answer.starts_with("\x1b]")) {
            terminal.press(&byte.to_string());
            pause(90);
        }
        // Each reply contains a `0`, which would show a message if it were a key.
        assert!(!terminal.text().contains(messages::NOTHING_TO_RESET), "{answer:?}");
    }
    terminal.press("e");
    terminal.wait_for(messages::NO_DIAGNOSTICS);
    terminal.press("0");
    terminal.wait_for(messages::NOTHING_TO_RESET);
    terminal.press("?");
    terminal.wait_for_message(messages::HELP_TOGGLE);
    // A single escape character is the Escape key.
    terminal.press("\x1b");
    terminal.wait("no help", |screen| !screen.contents().contains(messages::HELP_TOGGLE));
    terminal.press("q");
    assert_eq!(terminal.end(), 0);
}

#[test]
fn unterminated_sequences_do_not_block_keys() {
    // Use a separate terminal for each sequence, because the test mostly waits.
    let terminals = ["\x1b]0;", "\x1bP", "\x1b[", "\x1bO", "\x1b[1;", "\x1bX", "\u{e9}\x1b"].map(|begun| {
        let folder = TestDir::with_board();
        let mut terminal = folder.terminal();
        terminal.wait_for_render(1);
        terminal.press(begun);
        (folder, terminal)
    });
    pause(2500);
    for (_folder, mut terminal) in terminals {
        terminal.press("?");
        terminal.wait_for_message(messages::HELP_TOGGLE);
        terminal.press("q");
        assert_eq!(terminal.end(), 0);
    }
}
