//! How the program exits, and the state it leaves behind.

use glimt::tui::messages;
use nix::sys::signal::Signal;

use super::pty::SCENE;
use crate::test_dir::{PROGRAM, TestDir};

#[test]
fn keys_and_signals_restore_the_terminal() {
    let folder = TestDir::with_board();
    for (key, code) in [("q", 0), ("\x03", 130)] {
        let mut terminal = folder.terminal();
        terminal.wait_for_color("red");
        terminal.press(key);
        assert_eq!(terminal.end(), code, "{key:?}");
    }
    let known =
        [(Signal::SIGTERM, 143), (Signal::SIGINT, 130), (Signal::SIGHUP, 129), (Signal::SIGQUIT, 131)];
    let others = [
        Signal::SIGUSR1,
        Signal::SIGUSR2,
        Signal::SIGALRM,
        Signal::SIGVTALRM,
        Signal::SIGPROF,
        Signal::SIGXCPU,
        Signal::SIGIO,
        Signal::SIGSYS,
        Signal::SIGTRAP,
        #[cfg(target_os = "linux")]
        Signal::SIGPWR,
        #[cfg(target_os = "linux")]
        Signal::SIGSTKFLT,
    ];
    let others = others.map(|signal| (signal, 128 + signal as u32));
    for (signal, code) in known.into_iter().chain(others) {
        let terminal = folder.terminal();
        terminal.wait_for_color("red");
        terminal.signal(signal);
        assert_eq!(terminal.end(), code, "{signal}");
    }
}

#[test]
fn terminal_is_restored_without_free_descriptors() {
    let folder = TestDir::with_board();
    for limit in 4..=16 {
        let script = format!("ulimit -n {limit} && exec \"$0\" scene.toml");
        let mut terminal = folder.terminal_with(&["sh", "-c", &script, PROGRAM], &[]);
        // The program either cannot start or, with more descriptors, runs until it reads this key.
        while !terminal.has_ended() {
            terminal.press("q");
            std::thread::sleep(std::time::Duration::from_millis(50));
        }
        let code = terminal.end();
        assert!(code <= 2 || code == 127, "ulimit -n {limit}: exit code {code}");
    }
}

#[test]
fn abort_restores_the_terminal_and_is_reported() {
    let folder = TestDir::with_board();
    let terminal = folder.terminal();
    terminal.wait_for_color("red");
    terminal.signal(Signal::SIGABRT);
    assert_eq!(terminal.end_showing("(SIGABRT)"), 1);
}

#[test]
fn quit_while_rendering_keeps_the_last_image() {
    let folder = TestDir::with_board();
    let mut terminal = folder.terminal();
    terminal.wait_for_render(1);
    let before = folder.bytes("scene.png");
    folder.write("scene.toml", SCENE.replace("samples = 4", "samples = 10000000"));
    terminal.wait_for("rendering");
    terminal.press("q");
    assert_eq!(terminal.end(), 0);
    assert_eq!(folder.bytes("scene.png"), before);
}

#[test]
fn quit_after_save_writes_or_explains_why_not() {
    let folder = TestDir::with_board();
    let slow = SCENE.replace("samples = 4", "samples = 10000000");
    folder.write("scene.toml", &slow);
    let mut terminal = folder.terminal();
    terminal.wait_for_coverage();
    terminal.press("wq");
    assert_eq!(terminal.end_showing("scene.png"), 0);
    assert!(folder.path("scene.png").is_file());

    // Nothing can be written, because most pixels have no sample yet.
    std::fs::remove_file(folder.path("scene.png")).expect("removed");
    folder.write(
        "scene.toml",
        slow.replace("width = 64", "width = 2000").replace("height = 48", "height = 2000"),
    );
    let mut terminal = folder.terminal();
    terminal.wait_for("rendering");
    terminal.press("wq");
    assert_eq!(terminal.code(), 0);
    assert!(!terminal.last_lines().is_empty(), "the reason must be printed");
    terminal.end();
    assert!(!folder.path("scene.png").exists());
}

/// The write may or may not have started, but the image must not be lost.
#[test]
fn keys_during_a_write_never_lose_the_image() {
    let folder = TestDir::with_board();
    let large = SCENE
        .replace("samples = 4", "samples = 1")
        .replace("width = 64", "width = 3000")
        .replace("height = 48", "height = 2000");
    folder.write("scene.toml", &large);
    for key in ["q", "v", " "] {
        let mut terminal = folder.terminal();
        terminal.wait("the last stage", |screen| {
            let text = screen.contents();
            text.lines().any(|line| line.starts_with("write "))
                || text.contains("> write")
                || text.lines().next().is_some_and(|line| line.contains("✓ done"))
        });
        terminal.press(key);
        if key != "q" {
            terminal.wait("the image", |_| folder.path("scene.png").is_file());
            terminal.press("q");
        }
        assert_eq!(terminal.end(), 0, "{key:?}");
        std::fs::remove_file(folder.path("scene.png")).expect(key);
    }
    // Request a write, then quit immediately.
    folder.write("scene.toml", large.replace("samples = 1", "samples = 100000"));
    let mut terminal = folder.terminal();
    terminal.wait_for("ETA");
    terminal.press("w");
    terminal.press("q");
    assert_eq!(terminal.code(), 0);
    assert!(!terminal.last_lines().is_empty(), "the outcome must be printed");
    terminal.end();
}

#[test]
fn render_resumes_after_a_dropped_connection() {
    let folder = TestDir::with_board();
    let slow = SCENE.replace("samples = 4", "samples = 4000");
    folder.write("scene.toml", &slow);
    let terminal = folder.terminal();
    terminal.wait_for("ETA");
    // The system sends the signal, and a shell may forward it to its jobs at any time.
    for _ in 0..100 {
        terminal.signal(Signal::SIGHUP);
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    assert_eq!(terminal.end(), 129);
    let checkpoint = folder.path("scene.png.checkpoint");
    assert!(checkpoint.is_file(), "the samples must be saved");
    // A different scene starts over and does not touch the checkpoint.
    folder.write("scene.toml", SCENE.replace("samples = 4", "samples = 4000\nseed = 7"));
    let mut terminal = folder.terminal();
    terminal.wait_for("ETA");
    terminal.press("q");
    assert_eq!(terminal.end(), 0);
    assert!(checkpoint.is_file());
    // A render of the same scene resumes, produces the same pixels, and removes the checkpoint.
    folder.write("scene.toml", &slow);
    let terminal = folder.terminal();
    terminal.wait_for(messages::RESUMING);
    terminal.wait_for_render(1);
    assert_eq!(folder.bytes("scene.png"), folder.once(&[]));
    terminal.wait("removal of the checkpoint", |_| !checkpoint.exists());
}

#[test]
fn ctrl_z_suspends_and_fg_resumes() {
    let folder = TestDir::with_board();
    let mut terminal = folder.terminal_with(&["/bin/sh", "-i"], &[("PS1", "shell> ")]);
    terminal.wait_for("shell> ");
    terminal.press(&format!("{} scene.toml\n", PROGRAM));
    terminal.wait_for_color("red");
    terminal.press("\x1a");
    let is_shell = |screen: &vt100::Screen| {
        let is_asked = screen.contents().trim_end().ends_with("shell>");
        !screen.alternate_screen() && !screen.hide_cursor() && is_asked
    };
    terminal.wait("the shell", is_shell);
    // The shell prints the result only if the terminal modes are restored. The typed text does not contain
    // the sum.
    terminal.press("echo $((40 + 2))th\n");
    terminal.wait_for("42th");
    terminal.press("fg\n");
    terminal.wait("the image", |screen| screen.alternate_screen());
    terminal.wait_for_color("red");
    terminal.press("q");
    // Wait, because the program receives keys until it exits.
    terminal.wait("the shell", is_shell);
    terminal.press("exit\n");
    assert_eq!(terminal.end(), 0);
}

#[test]
fn ctrl_z_without_a_shell_is_reported() {
    let folder = TestDir::with_board();
    let mut terminal = folder.terminal();
    terminal.wait_for_color("red");
    terminal.press("\x1a");
    terminal.wait_for(messages::NO_SHELL);
}
