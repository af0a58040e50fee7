//! Images and plots in the terminal output of commands that have no full-screen interface.

use nix::sys::signal::Signal;

use super::pty::{GREEN, RED, SCENE, Terminal, cells};
use crate::test_dir::{PROGRAM, TestDir};

fn run_compare(options: &[&str], variables: &[(&str, &str)]) -> (TestDir, Terminal) {
    let folder = TestDir::with_board();
    folder.once(&[]);
    std::fs::rename(folder.path("once.png"), folder.path("red.png")).expect("renamed");
    folder.write("scene.toml", SCENE.replace(RED, GREEN));
    folder.once(&[]);
    let mut command = vec![PROGRAM, "compare", "once.png", "red.png"];
    command.extend(options);
    let mut terminal = folder.terminal_with(&command, variables);
    assert_eq!(terminal.code(), 0);
    terminal.wait_for("SSIM");
    (folder, terminal)
}

#[test]
fn compare_shows_both_images_and_flip() {
    let (_folder, terminal) = run_compare(&[], &[]);
    terminal.look(|screen| {
        let text = screen.contents();
        let names = text.lines().find(|line| line.contains("once.png  ")).expect("names");
        assert!(names.contains("red.png") && names.contains("FLIP"), "{text}");
        let is = |cell: &vt100::Cell, channel: usize| match cell.fgcolor() {
            vt100::Color::Rgb(r, g, b) => {
                let most = [r, g, b][channel];
                cell.contents() == "▀"
                    && most > 50
                    && [r, g, b].iter().filter(|c| **c > most / 2).count() == 1
            }
            vt100::Color::Default | vt100::Color::Idx(_) => false,
        };
        for channel in [0, 1] {
            assert!(cells(screen).filter(|cell| is(cell, channel)).count() > 10, "{channel}: {text}");
        }
        assert!(!screen.alternate_screen() && !screen.hide_cursor());
    });
}

#[test]
fn compare_uses_the_terminal_color_depth() {
    let (_folder, terminal) = run_compare(&[], &[("COLORTERM", "")]);
    terminal.look(|screen| {
        assert!(cells(screen).any(|cell| matches!(cell.fgcolor(), vt100::Color::Idx(16..))));
        assert!(!cells(screen).any(|cell| matches!(cell.fgcolor(), vt100::Color::Rgb(..))));
    });
    let (_folder, terminal) = run_compare(&[], &[("NO_COLOR", "1")]);
    terminal.look(|screen| {
        assert!(screen.contents().contains("red.png"), "{}", screen.contents());
        assert!(cells(screen).all(|cell| cell.contents() != "▀" && cell.fgcolor() == vt100::Color::Default));
    });
    let (_folder, terminal) = run_compare(&["--pictures", "off"], &[]);
    terminal.look(|screen| {
        assert!(screen.contents().starts_with("once.png "), "{}", screen.contents());
        assert!(cells(screen).all(|cell| cell.contents() != "▀"));
    });
}

fn measured(folder: &TestDir, samples: &str) -> Terminal {
    let command =
        [PROGRAM, "bench", "scene.toml", "--samples", samples, "--reference-samples", "64", "--no-cache"];
    folder.terminal_with(&command, &[])
}

fn has_plot(screen: &vt100::Screen) -> bool {
    let text = screen.contents();
    let is_braille = |c: char| ('\u{2801}'..='\u{28ff}').contains(&c);
    text.contains("o path") && text.chars().any(is_braille)
}

#[test]
fn bench_removes_its_plot_when_interrupted() {
    let folder = TestDir::with_board();
    let mut terminal = measured(&folder, "1,4,16,64,65536");
    terminal.wait("the plot above the bar", |screen| has_plot(screen) && screen.contents().contains('%'));
    terminal.resize(60, 20);
    terminal.wait("the plot in a smaller terminal", has_plot);
    terminal.signal(Signal::SIGINT);
    assert_eq!(terminal.code(), 130);
    terminal.wait_for("SIGINT");
    terminal.look(|screen| {
        let last = screen.contents().lines().last().unwrap_or_default().to_owned();
        assert!(last.contains("SIGINT"), "{}", screen.contents());
        assert!(!screen.alternate_screen() && !screen.hide_cursor());
    });
}

#[test]
fn bench_keeps_its_plot_at_the_end() {
    let folder = TestDir::with_board();
    let mut terminal = measured(&folder, "1,4");
    assert_eq!(terminal.code(), 0);
    terminal.wait("the plot without the bar", |screen| has_plot(screen) && !screen.contents().contains('█'));
}
