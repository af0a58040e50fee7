//! The mouse, saving the camera to the scene file, the editor, and previous renders.

use std::fs;
use std::os::unix::fs::PermissionsExt;

use glimt::tui::messages;
use nix::errno::Errno;
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

use super::pty::{Colors, GREEN, RED, SCENE, Terminal};
use crate::test_dir::{PROGRAM, TestDir};

/// The terminal sequence for pressing the left button over a cell, numbered from 1.
fn press(column: u16, row: u16) -> String {
    format!("\x1b[<0;{column};{row}M")
}

fn drag(column: u16, row: u16) -> String {
    format!("\x1b[<32;{column};{row}M")
}

fn release(column: u16, row: u16) -> String {
    format!("\x1b[<0;{column};{row}m")
}

fn red(terminal: &Terminal) -> usize {
    terminal.settled(|screen| Colors::of(screen).red)
}

#[test]
fn mouse_orbits_zooms_and_inspects() {
    let folder = TestDir::with_board();
    let mut terminal = folder.terminal();
    terminal.wait_for_render(1);
    let before = red(&terminal);
    terminal.press(&(press(20, 10) + &drag(26, 10) + &drag(32, 10) + &release(32, 10)));
    terminal.wait_for_message(messages::CAMERA_MOVED);
    terminal.wait("a narrower board", |screen| Colors::of(screen).red + 20 < before);
    terminal.press("0");
    terminal.wait("the original board", |screen| Colors::of(screen).red == before);
    terminal.press("\x1b[<64;20;10M\x1b[<64;20;10M");
    terminal.wait("a larger board", |screen| Colors::of(screen).red > before + 20);
    terminal.press("0");
    terminal.wait_for(messages::RESET);
    terminal.press(&(press(20, 16) + &release(20, 16)));
    let line = SCENE.lines().position(|line| line == "[[quad]]").expect("a quad") + 1;
    let place = format!("scene.toml:{line}");
    for words in ["quad", &place, "phong board", "distance"] {
        terminal.wait_for(words);
    }
    terminal.wait("the mark", |screen| screen.cell(15, 19).is_some_and(|cell| cell.contents() == "┼"));
}

#[test]
fn mouse_mode_is_restored() {
    use vt100::MouseProtocolMode::{ButtonMotion, None};
    let folder = TestDir::with_board();
    let mut terminal = folder.terminal();
    terminal.wait_for_render(1);
    let is_on = |screen: &vt100::Screen| screen.mouse_protocol_mode() == ButtonMotion;
    terminal.wait("the mouse", is_on);
    terminal.press("m");
    terminal.wait_for("mouse off");
    terminal.wait("no mouse", |screen| screen.mouse_protocol_mode() == None);
    terminal.press("m");
    terminal.wait("the mouse", is_on);
    terminal.press("q");
    terminal.wait("no mouse", |screen| screen.mouse_protocol_mode() == None);
    terminal.end();
}

#[test]
fn saved_camera_becomes_the_scene_camera() {
    let folder = TestDir::with_board();
    let text = SCENE.replace("[camera]", "# the eye\n[camera]");
    folder.write("scene.toml", &text);
    let mut terminal = folder.terminal();
    terminal.wait_for_render(1);
    terminal.press("c");
    terminal.wait_for(messages::NOTHING_TO_KEEP);
    terminal.press(">");
    terminal.wait_for_render(2);
    terminal.press("c");
    terminal.wait_for_message(&messages::camera_saved("scene.toml"));
    let kept = fs::read_to_string(folder.path("scene.toml")).expect("a scene");
    assert_eq!(kept, text.replace("focus = 4.0\n", "focus = 4.0\nfov = 42\n"));
    terminal.wait("no moved camera", |screen| !screen.contents().contains("camera moved"));
    terminal.wait("the image on disk", |_| folder.bytes("scene.png") == folder.once(&[]));
    // glimt's own write does not count as an edit, so the stage table still shows the reused stages. Press a
    // key without other effects to close the message that covers the table.
    terminal.press("??");
    terminal.wait("no new render", |screen| screen.contents().contains(messages::CACHED));
    folder.write("scene.toml", kept.replace(RED, GREEN));
    terminal.wait_for_color("green");
}

#[test]
fn click_sets_the_focus() {
    let folder = TestDir::with_board();
    folder.write("scene.toml", SCENE.replace("focus = 4.0", "focus = 3.0"));
    let mut terminal = folder.terminal();
    terminal.wait_for_render(1);
    terminal.press("f");
    terminal.wait_for(messages::CLICK_TO_FOCUS);
    terminal.press(&(press(20, 16) + &release(20, 16)));
    terminal.wait_for_message(&messages::focus_moved(4.0));
    terminal.press("ff");
    terminal.wait_for_message(&messages::focus_moved(4.0));
}

/// An editor that prints its arguments, reads a line of keys, and changes the scene.
pub(super) const EDITOR: &str =
    "#!/bin/sh\nprintf 'editing %s at %s\\r\\n' \"$2\" \"$1\"\nread -r line\necho \"# $line\" >> \"$2\"\n";

/// The output of [`EDITOR`] when it opens the scene at a line.
pub(super) fn editing(line: usize) -> String {
    ["editing", "scene.toml", "at", &format!("+{line}")].join(" ")
}

#[test]
fn editor_uses_the_terminal() {
    let folder = TestDir::with_board();
    folder.write("vi", EDITOR);
    fs::set_permissions(folder.path("vi"), fs::Permissions::from_mode(0o755)).expect("permitted");
    let editor = folder.path("vi");
    let variables = [("VISUAL", ""), ("EDITOR", editor.to_str().expect("a name"))];
    let mut terminal = folder.terminal_with(&[PROGRAM, "scene.toml"], &variables);
    terminal.wait_for_render(1);
    folder.write("scene.toml", SCENE.replace("samples = 4", "samples = \"four\""));
    terminal.wait_for("scene.toml:4:11");
    terminal.press("o");
    terminal.wait_for(&editing(4));
    terminal.wait("the shell's screen", |screen| !screen.alternate_screen());
    terminal.press("hello q\n");
    terminal.wait("glimt's screen", vt100::Screen::alternate_screen);
    terminal.wait_for("scene.toml:4:11");
    let text = fs::read_to_string(folder.path("scene.toml")).expect("a scene");
    assert!(text.ends_with("# hello q\n"), "keys must go to the editor: {text}");
    terminal.press("q");
    terminal.end();
}

#[test]
fn echo_is_restored_after_killed_editor() {
    let folder = TestDir::with_board();
    folder.write("vi", "#!/bin/sh\nstty raw -echo\nkill -9 $$\n");
    fs::set_permissions(folder.path("vi"), fs::Permissions::from_mode(0o755)).expect("permitted");
    let editor = folder.path("vi");
    let variables = [("VISUAL", ""), ("EDITOR", editor.to_str().expect("a name"))];
    let mut terminal = folder.terminal_with(&[PROGRAM, "scene.toml"], &variables);
    terminal.wait_for_render(1);
    terminal.press("o");
    terminal.wait_for("killed by");
    terminal.press("q");
    assert_eq!(terminal.end(), 0);
}

/// The program after it has opened a shell script as its editor, which now controls the terminal.
fn in_editor(folder: &TestDir, command: &[&str], script: &str, options: &str) -> Terminal {
    folder.write("vi", format!("#!/bin/sh\necho $PPID > parent\necho $$ > id\n{script}\n"));
    fs::set_permissions(folder.path("vi"), fs::Permissions::from_mode(0o755)).expect("permitted");
    let editor = format!("{}{options}", folder.path("vi").to_str().expect("a name"));
    let mut terminal = folder.terminal_with(command, &[("VISUAL", ""), ("EDITOR", &editor)]);
    terminal.wait_for_render(1);
    terminal.press("o");
    terminal.wait_for("at-work");
    terminal
}

/// The process with the ID stored in a file.
fn process(folder: &TestDir, file: &str) -> Pid {
    let number = String::from_utf8(folder.bytes(file)).expect("a number");
    Pid::from_raw(number.trim().parse().expect("a number"))
}

/// A shell that runs glimt. The terminal outlives glimt, so its modes are not reset by closing it.
const FROM_SHELL: &str = "modes=$(stty -g); \"$0\" scene.toml; code=$?; test \"$modes\" = \"$(stty -g)\" && echo as before; exit $code";

#[test]
fn signal_ends_editor_and_restores_modes() {
    for (signal, code) in [(Signal::SIGTERM, 143), (Signal::SIGHUP, 129), (Signal::SIGUSR1, 138)] {
        let folder = TestDir::with_board();
        let command = ["/bin/sh", "-c", FROM_SHELL, PROGRAM];
        let script = "stty raw -echo\nprintf at-work\nexec sleep 1000";
        let terminal = in_editor(&folder, &command, script, "");
        kill(process(&folder, "parent"), signal).expect("sent");
        let editor = process(&folder, "id");
        terminal.wait("the editor to exit", |_| kill(editor, None) == Err(Errno::ESRCH));
        assert_eq!(terminal.end_showing("as before"), code, "{signal}");
    }
}

#[test]
fn raw_mode_ends_if_editor_ignores_signals() {
    let folder = TestDir::with_board();
    let command = ["/bin/sh", "-c", FROM_SHELL, PROGRAM];
    // The editor exits when the terminal closes.
    let script = "trap '' TERM HUP\nstty raw -echo\nprintf at-work\nread -r line";
    let terminal = in_editor(&folder, &command, script, "");
    kill(process(&folder, "parent"), Signal::SIGTERM).expect("sent");
    assert_eq!(terminal.end_showing("as before"), 143);
}

#[test]
fn signal_reaches_editor_through_a_shell() {
    let folder = TestDir::with_board();
    // A shell with job control, whose terminal stays open.
    let jobs = format!("set -m; {FROM_SHELL}");
    let command = ["/bin/sh", "-c", &jobs, PROGRAM];
    let script = "ps -o ppid= -p $PPID > parent\nprintf at-work\nexec sleep 1000";
    let terminal = in_editor(&folder, &command, script, " #");
    kill(process(&folder, "parent"), Signal::SIGTERM).expect("sent");
    let editor = process(&folder, "id");
    terminal.wait("the editor to exit", |_| kill(editor, None) == Err(Errno::ESRCH));
    assert_eq!(terminal.end_showing("as before"), 143);
}

#[test]
fn ctrl_c_in_the_editor_does_not_end_glimt() {
    let folder = TestDir::with_board();
    let command = [PROGRAM, "scene.toml"];
    let mut terminal = in_editor(&folder, &command, "printf at-work\nexec sleep 1000", "");
    for _ in 0..20 {
        terminal
            .wait("the editor", |screen| !screen.alternate_screen() && screen.contents().contains("at-work"));
        terminal.scribble("\x1b[2J\x1b[H");
        terminal.press("\x03");
        terminal.wait("glimt's screen", vt100::Screen::alternate_screen);
        terminal.press("o");
    }
    terminal.wait_for("at-work");
    terminal.press("\x03");
    terminal.wait("glimt's screen", vt100::Screen::alternate_screen);
    terminal.press("q");
    assert_eq!(terminal.end(), 0);
}

#[test]
fn missing_editor_is_reported() {
    let folder = TestDir::with_board();
    let variables = [("VISUAL", "no-such-editor")];
    let mut terminal = folder.terminal_with(&[PROGRAM, "scene.toml"], &variables);
    terminal.wait_for_render(1);
    terminal.press("o");
    terminal.wait_for("`no-such-editor`");
    terminal.wait("glimt's screen", vt100::Screen::alternate_screen);
}

#[test]
fn earlier_renders_can_be_browsed() {
    let folder = TestDir::with_board();
    let mut terminal = folder.terminal();
    terminal.wait_for_render(1);
    folder.write("scene.toml", SCENE.replace(RED, GREEN));
    terminal.wait_for_color("green");
    terminal.wait_for_render(2);
    terminal.press("b");
    terminal.wait_for_color("red");
    terminal.wait_for(messages::BEFORE_EDIT);
    terminal.press("b");
    terminal.wait_for_color("green");
    terminal.press("n");
    terminal.wait_for_color("red");
    terminal.wait_for(&messages::render_number_of_count(1, 2));
    terminal.press("n");
    terminal.wait_for(messages::OLDEST_RENDER);
    terminal.press("N");
    terminal.wait_for_color("green");
}

#[test]
fn zoom_shows_actual_pixels() {
    let folder = TestDir::with_board();
    folder.write(
        "scene.toml",
        SCENE.replace("width = 64", "width = 320").replace("height = 48", "height = 240"),
    );
    let mut terminal = folder.terminal();
    terminal.wait_for_render(1);
    let before = red(&terminal);
    terminal.press("x");
    terminal.wait_for("1:1");
    // The center of the board fills the preview.
    terminal.wait("a larger board", |screen| Colors::of(screen).red > before + 100);
    terminal.press("x");
    terminal.wait("the original preview", |screen| {
        Colors::of(screen).red == before && !screen.contents().contains("1:1")
    });
}

#[test]
fn region_first_does_not_change_the_image() {
    let folder = TestDir::with_board();
    let mut terminal = folder.terminal();
    terminal.wait_for_render(1);
    terminal.press("z");
    terminal.wait_for(messages::DRAG_REGION);
    terminal.press(&(press(5, 4) + &drag(12, 8) + &drag(20, 10)));
    let corner = |column, row, symbol: &'static str| {
        move |screen: &vt100::Screen| screen.cell(row, column).is_some_and(|cell| cell.contents() == symbol)
    };
    terminal.wait("a corner", corner(4, 3, "┌"));
    terminal.wait("a corner", corner(19, 9, "┘"));
    terminal.press(&release(20, 10));
    terminal.wait_for(messages::REGION_NEXT);
    folder.write("scene.toml", SCENE.replace(RED, GREEN).replace("samples = 4", "samples = 64"));
    terminal.wait_for_color("green");
    terminal.wait_for_render(2);
    assert_eq!(folder.bytes("scene.png"), folder.once(&[]));
    terminal.press("z");
    terminal.wait_for(messages::REGION_CLEARED);
}
