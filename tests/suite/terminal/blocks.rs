//! Characters used for the preview, depending on the terminal's name.

use super::pty::SCENE;
use crate::test_dir::{PROGRAM, TestDir};

/// A board viewed from the side, with oblique edges.
fn oblique() -> String {
    SCENE.replace("[camera]", "[camera]\nup = [0.3, 1, 0]")
}

fn has_finer_blocks(screen: &vt100::Screen) -> bool {
    screen
        .contents()
        .chars()
        .any(|symbol| matches!(symbol, '▖'..='▟' | '▌' | '▐' | '\u{1CD00}'..='\u{1CEAB}'))
}

#[test]
fn known_terminal_gets_finest_blocks() {
    let folder = TestDir::with_board();
    folder.write("scene.toml", oblique());
    let mut terminal = folder.terminal();
    terminal.wait_for_render(1);
    terminal.wait_for_color("red");
    assert!(!terminal.settled(has_finer_blocks), "unknown terminals must get half blocks");
    terminal.press("\x1bP>|kitty(0.40.1)\x1b\\");
    terminal.wait("finer blocks", has_finer_blocks);
    terminal.press("q");
    assert_eq!(terminal.end(), 0);
}

#[test]
fn preview_option_overrides_the_terminal() {
    let folder = TestDir::with_board();
    folder.write("scene.toml", oblique());
    let mut terminal = folder.terminal_with(&[PROGRAM, "scene.toml", "--preview", "halfblock"], &[]);
    terminal.wait_for_render(1);
    terminal.press("\x1bP>|kitty(0.40.1)\x1b\\");
    assert!(!terminal.settled(has_finer_blocks));
    terminal.press("q");
    assert_eq!(terminal.end(), 0);
}

#[test]
fn pixel_preview_does_not_cover_text() {
    let answers = [
        ("kitty", "\x1b_Gi=4211;OK\x1b\\"),
        ("sixel", "\x1b[?62;4c"),
        ("iterm2", "\x1bP>|iTerm2 3.5.0\x1b\\"),
    ];
    for (protocol, answer) in answers {
        let folder = TestDir::with_board();
        let call = [PROGRAM, "scene.toml", "--preview", protocol];
        let mut terminal = folder.terminal_with(&call, &[]);
        terminal.wait_for_render(1);
        terminal.press(answer);
        terminal.resize(120, 24);
        // The help overlay leaves the first column of the preview visible.
        let has_blocks = |screen: &vt100::Screen| {
            let own = vt100::Color::Default;
            screen.cell(10, 0).is_some_and(|cell| cell.fgcolor() != own || cell.bgcolor() != own)
        };
        terminal.wait("pixels", |screen| !has_blocks(screen));
        terminal.press("?");
        terminal.wait("half blocks next to the help", has_blocks);
        terminal.press("?");
        terminal.wait("pixels again", |screen| !has_blocks(screen));
        terminal.press("q");
        assert_eq!(terminal.end(), 0);
    }
}

#[test]
fn unsupported_pixels_fall_back_to_half_blocks() {
    for (protocol, variables, words) in [
        ("kitty", &[][..], "kitty images"),
        ("sixel", &[], "sixel images"),
        ("iterm2", &[], "iTerm2 images"),
        ("kitty", &[("TMUX", "/tmp/tmux-0/default,1,0")], "allow-passthrough on"),
    ] {
        let folder = TestDir::with_board();
        let call = [PROGRAM, "scene.toml", "--preview", protocol];
        let mut terminal = folder.terminal_with(&call, variables);
        // The terminal replied to all queries except those about images.
        terminal.press("\x1b[?62;22c");
        terminal.wait_for(words);
        terminal.wait_for_render(1);
        terminal.press("s");
        terminal.wait_for("s hard");
        terminal.press("q");
        assert_eq!(terminal.end(), 0);
    }
}
