//! Window title, progress, notifications, links and the clipboard. Only terminals that support a feature
//! receive its sequences, and all lasting changes are undone.

use glimt::tui::messages;
use nix::sys::signal::Signal;

use super::pty::{SCENE, Terminal, cells, upper};
use super::relay::Responder;
use crate::test_dir::{PROGRAM, TestDir};

/// Environment variables that identify terminals, with the terminals' features: title, progress, a
/// notification protocol, links, clipboard.
const TERMINALS: [(&[(&str, &str)], TerminalFeatures); 5] = [
    (
        &[("TERM", "xterm-kitty")],
        TerminalFeatures { progress: false, notice: b"\x1b]99;;glimt: scene.toml: done after ", ..ALL },
    ),
    (
        &[("TERM", "foot")],
        TerminalFeatures { progress: false, notice: b"\x1b]777;notify;glimt;scene.toml: done after ", ..ALL },
    ),
    (
        &[("TERM_PROGRAM", "ghostty"), ("TERM_PROGRAM_VERSION", "1.2.3")],
        TerminalFeatures { notice: b"\x1b]777;notify;glimt;scene.toml: done after ", ..ALL },
    ),
    (&[("WT_SESSION", "1-2-3")], TerminalFeatures { notice: b"\x07", ..ALL }),
    (
        &[("VTE_VERSION", "7600")],
        TerminalFeatures { progress: false, notice: b"\x07", clipboard: false, ..ALL },
    ),
];

/// Terminals not known to support any of these features.
const OTHERS: [&[(&str, &str)]; 6] = [
    &[],
    &[("TERM", "dumb"), ("WT_SESSION", "1-2-3")],
    &[("TERM", "linux"), ("VTE_VERSION", "8000")],
    &[("TERM", "screen-256color"), ("STY", "1.pts-0"), ("TERM_PROGRAM", "ghostty")],
    &[("TERM", "tmux-256color"), ("TMUX", "/tmp/tmux-0/default,1,0"), ("TERM_PROGRAM", "tmux")],
    &[("TMUX", "/tmp/tmux-0/default,1,0"), ("WT_SESSION", "1-2-3")],
];

#[derive(Clone, Copy)]
struct TerminalFeatures {
    progress: bool,
    notice: &'static [u8],
    links: bool,
    clipboard: bool,
}

const ALL: TerminalFeatures = TerminalFeatures { progress: true, notice: b"", links: true, clipboard: true };

/// Whether a byte string contains another.
fn has(bytes: &[u8], part: &[u8]) -> bool {
    find_bytes(bytes, part).is_some()
}

fn find_bytes(bytes: &[u8], part: &[u8]) -> Option<usize> {
    bytes.windows(part.len()).position(|window| window == part)
}

/// Whether the last occurrence of one byte string precedes the last occurrence of another.
fn is_last(bytes: &[u8], before: &[u8], after: &[u8]) -> bool {
    let last = |part: &[u8]| bytes.windows(part.len()).rposition(|window| window == part);
    last(after).is_some_and(|after| last(before).is_none_or(|before| before < after))
}

/// A scene that keeps rendering until it is saved again.
fn endless() -> String {
    SCENE.replace("samples = 4", "samples = 10000000")
}

/// Starts the program with a notification for every finished render.
fn open(folder: &TestDir, variables: &[(&str, &str)]) -> Terminal {
    folder.terminal_with(&[PROGRAM, "scene.toml", "--notify-after", "0.001"], variables)
}

/// Makes the program send every kind of sequence: a render with a title, the end of a render without focus, a
/// click and a copy. Returns all output until the program exits.
fn session_output(variables: &[(&str, &str)], has_title: bool) -> Vec<u8> {
    let folder = TestDir::with_board();
    folder.write("scene.toml", endless());
    let mut terminal = open(&folder, variables);
    terminal.wait_for("ETA");
    if has_title {
        terminal.wait("a title", |_| has(&terminal.bytes(), b"\x1b]2;scene.toml: rendering 0 %"));
    }
    // Report the loss of focus. Then open the help, which shows that the program has read the event, and save
    // the scene.
    terminal.press("\x1b[O?");
    terminal.wait_for_message(messages::HELP_TOGGLE);
    terminal.press("?");
    terminal.wait("no help", |screen| !screen.contents().contains(messages::HELP_TOGGLE));
    folder.write("scene.toml", SCENE);
    terminal.wait_for_render(1);
    if has_title {
        terminal.wait("the last title", |_| has(&terminal.bytes(), b"\x1b]2;scene.toml: done"));
    }
    // Restore the focus, click on the board, and copy the inspected values.
    terminal.press("\x1b[I");
    terminal.press("\x1b[<0;20;10M\x1b[<0;20;10m");
    terminal.wait_for("radiance (");
    terminal.press("y");
    terminal.wait("an answer", |screen| {
        let text: String = screen.contents().split_whitespace().collect::<Vec<_>>().join(" ");
        text.contains(messages::COPIED) || text.contains(messages::SELECT_TO_COPY)
    });
    terminal.settled(vt100::Screen::contents);
    terminal.press("q");
    terminal.code();
    terminal.wait("the restored terminal", |screen| !screen.alternate_screen() && !screen.hide_cursor());
    terminal.bytes()
}

#[test]
fn known_terminals_get_and_reset_features() {
    for (variables, has_what) in TERMINALS {
        let bytes = session_output(variables, true);
        let check = |part: &[u8], is_there: bool| {
            assert_eq!(has(&bytes, part), is_there, "{variables:?}: {}", String::from_utf8_lossy(part));
        };
        check(b"\x1b[22;2t", true);
        check(b"\x1b]2;scene.toml: rendering ", true);
        check(b"\x1b]2;scene.toml: done", true);
        check(b"\x1b[?1004h", true);
        check(b"\x1b]9;4;1;", has_what.progress);
        check(has_what.notice, true);
        check(b"\x1b]8;;file://", has_what.links);
        // The address, an optional color, and the name.
        let address = b"/scene.png\x1b\\";
        let name = find_bytes(&bytes, address).map(|start| &bytes[start + address.len()..][..24]);
        assert_eq!(name.is_some_and(|name| has(name, b"scene.png")), has_what.links, "{variables:?}: a link");
        check(b"\x1b]52;c;", has_what.clipboard);
        assert!(
            is_last(&bytes, b"\x1b]2;scene.toml", b"\x1b[23;2t"),
            "{variables:?}: the title must be restored"
        );
        assert!(
            is_last(&bytes, b"\x1b[?1004h", b"\x1b[?1004l"),
            "{variables:?}: focus reporting must be disabled"
        );
        if has_what.progress {
            assert!(
                is_last(&bytes, b"\x1b]9;4;1;", b"\x1b]9;4;0;0\x1b\\"),
                "{variables:?}: the progress bar must be removed"
            );
        }
    }
}

#[test]
fn unknown_terminals_get_no_extra_sequences() {
    for variables in OTHERS {
        let bytes = session_output(variables, false);
        for part in [
            &b"\x1b]2;"[..],
            b"\x1b]0;",
            b"\x1b[22;2t",
            b"\x1b[23;2t",
            b"\x1b[?1004",
            b"\x1b]9;",
            b"\x1b]99;",
            b"\x1b]777;",
            b"\x1b]8;",
            b"\x1b]52;",
            b"\x1bPtmux;",
            b"\x07",
        ] {
            assert!(!has(&bytes, part), "{variables:?}: {:?}", String::from_utf8_lossy(part));
        }
    }
}

#[test]
fn signals_clear_title_and_progress() {
    let folder = TestDir::with_board();
    folder.write("scene.toml", SCENE.replace("samples = 4", "samples = 10000000"));
    for (signal, code) in
        [(Signal::SIGTERM, 143), (Signal::SIGHUP, 129), (Signal::SIGINT, 130), (Signal::SIGABRT, 1)]
    {
        let mut terminal = open(&folder, &[("WT_SESSION", "1-2-3")]);
        terminal.wait_for("ETA");
        terminal.wait("a title and a bar", |_| {
            let bytes = terminal.bytes();
            has(&bytes, b"\x1b]2;scene.toml: rendering") && has(&bytes, b"\x1b]9;4;")
        });
        terminal.signal(signal);
        assert_eq!(terminal.code(), code, "{signal}");
        terminal.wait("the restored terminal", |screen| !screen.alternate_screen() && !screen.hide_cursor());
        let bytes = terminal.bytes();
        assert!(is_last(&bytes, b"\x1b]2;scene.toml", b"\x1b[23;2t"), "{signal}");
        assert!(is_last(&bytes, b"\x1b]9;4;1;", b"\x1b]9;4;0;0\x1b\\"), "{signal}");
        assert!(is_last(&bytes, b"\x1b[?1004h", b"\x1b[?1004l"), "{signal}");
    }
}

/// No notification for a focused window or a short render.
#[test]
fn only_unfocused_long_renders_notify() {
    for (focus, after) in
        [("\x1b[I", "0.001"), ("\x1b[O\x1b[I", "0.001"), ("\x1b[O", "3600"), ("\x1b[O", "0")]
    {
        let folder = TestDir::with_board();
        folder.write("scene.toml", endless());
        let command = [PROGRAM, "scene.toml", "--notify-after", after];
        let mut terminal = folder.terminal_with(&command, &[("TERM", "xterm-kitty")]);
        terminal.wait_for("ETA");
        terminal.press(focus);
        folder.write("scene.toml", SCENE);
        terminal.wait_for_render(1);
        terminal.settled(vt100::Screen::contents);
        assert!(!has(&terminal.bytes(), b"\x1b]99;"), "{focus:?} {after}");
    }
}

/// Title and progress are sent after the preview, and do not increase the number of queued bytes.
#[test]
fn slow_connection_sends_the_preview_first() {
    let folder = TestDir::with_board();
    folder.write("scene.toml", endless());
    let terminal = folder.thin_line_in(Responder::Terminal, &[("WT_SESSION", "1-2-3")]);
    terminal.wait("a title", |_| has(&terminal.bytes(), b"\x1b]2;scene.toml: rendering"));
    folder.write("scene.toml", SCENE);
    terminal.wait_for_render(1);
    terminal.wait("a title", |_| has(&terminal.bytes(), b"\x1b]2;scene.toml: done"));
    let bytes = terminal.bytes();
    let title = find_bytes(&bytes, b"\x1b]2;").expect("a title");
    let side = |length| std::num::NonZero::new(length).expect("not zero");
    let mut before = vt100::Parser::new(side(40), side(120), 0);
    before.process(&bytes[..title]);
    let mut after = vt100::Parser::new(side(40), side(120), 0);
    after.process(&bytes);
    // A few cells of the image are blank, and not always the same ones.
    let image_cells = |screen: &vt100::Screen| {
        let is_colored = |cell| matches!(upper(cell), Some(vt100::Color::Rgb(..)));
        cells(screen).enumerate().filter(|(i, cell)| i % 120 < 96 && is_colored(cell)).count()
    };
    let (preview, image) = (image_cells(before.screen()), image_cells(after.screen()));
    assert!(
        image > 3000 && preview > image - image / 100,
        "{preview} of {image} cells of the preview before the first title"
    );
    assert!(terminal.line(|seen| seen.max_unanswered) <= 24_000);
}

#[test]
fn late_terminal_reply_enables_features() {
    let folder = TestDir::with_board();
    let mut terminal = folder.terminal();
    terminal.wait_for_render(1);
    assert!(!has(&terminal.bytes(), b"\x1b]2;"));
    terminal.press("\x1bP>|ghostty 1.2.0\x1b\\");
    terminal.wait("a title", |_| has(&terminal.bytes(), b"\x1b]2;scene.toml: done"));
    terminal.wait("focus reporting", |_| has(&terminal.bytes(), b"\x1b[?1004h"));
    terminal.press("q");
    terminal.code();
    terminal.wait("the restored terminal", |screen| !screen.alternate_screen() && !screen.hide_cursor());
    let bytes = terminal.bytes();
    assert!(
        is_last(&bytes, b"\x1b]2;scene.toml", b"\x1b[23;2t")
            && is_last(&bytes, b"\x1b[?1004h", b"\x1b[?1004l")
    );
}
