//! The history with the changes of each edit, the noise curve, and undoing `c` with `u`.

use std::fs;

use glimt::tui::messages;

use super::pty::{BLUE, Colors, GREEN, RED, SCENE, Terminal, cells, upper};
use super::relay::Responder;
use crate::test_dir::{PROGRAM, TestDir};

/// The text on the screen as a single line.
fn words(screen: &vt100::Screen) -> String {
    screen.contents().split_whitespace().collect::<Vec<_>>().join(" ")
}

/// The text to the right of `column` as a single line, without thumbnails.
fn text_right_of(screen: &vt100::Screen, column: usize) -> String {
    let text = screen.contents();
    let is_word = |c: &char| !('▀'..='▟').contains(c);
    let rows = text.lines().map(|line| line.chars().skip(column).filter(is_word).collect::<String>());
    rows.collect::<Vec<_>>().join(" ").split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Number of cells of each color, starting at the specified column.
fn colors_from(screen: &vt100::Screen, column: u16) -> [usize; 3] {
    let (_, columns) = screen.size();
    let mut count = [0; 3];
    for (index, cell) in cells(screen).enumerate() {
        if index % usize::from(columns.get()) < usize::from(column) {
            continue;
        }
        if let Some(vt100::Color::Rgb(r, g, b)) = upper(cell) {
            let rgb = [r, g, b];
            for channel in 0..3 {
                let others = (0..3).filter(|other| *other != channel).map(|other| rgb[other]).max();
                count[channel] += usize::from(rgb[channel] > 50 && rgb[channel] / 2 > others.unwrap_or(0));
            }
        }
    }
    count
}

/// Saves the scene three times with different colors.
fn edited(folder: &TestDir, terminal: &Terminal) {
    terminal.wait_for_render(1);
    for (render, (color, value)) in (2..).zip([("green", GREEN), ("blue", BLUE)]) {
        folder.write("scene.toml", SCENE.replace(RED, value));
        terminal.wait(color, |screen| Colors::of(screen).is_dominant(color) || render == 3);
        terminal.wait_for_render(render);
    }
}

/// First column of the panel next to a 64 × 48 image in a window of 120 × 40 cells.
const PANEL: u16 = 97;

#[test]
fn history_shows_images_and_their_changes() {
    let folder = TestDir::with_board();
    let mut terminal = folder.terminal_of(120, 40);
    terminal.wait_for_render(1);
    assert!(!terminal.text().contains(messages::HISTORY), "no history with a single render");
    edited(&folder, &terminal);
    let oldest_entry = format!("1 {}", messages::OPENED);
    terminal.wait("the history", |screen| {
        let text = text_right_of(screen, PANEL.into());
        text.contains(&format!("{} (n / N)", messages::HISTORY))
            && text.contains("▸3 materials. board.diffuse → [0.02, 0.02, 0.8]")
            && text.contains(&oldest_entry)
    });
    // A thumbnail for each color, newest at the top.
    let colors = terminal.settled(|screen| colors_from(screen, PANEL));
    assert!(colors.iter().all(|count| *count >= 3), "{colors:?}");
    let row_of = |text: &str| {
        let screen = terminal.text();
        let row = screen
            .lines()
            .position(|line| line.chars().skip(PANEL.into()).collect::<String>().contains(text));
        row.unwrap_or_else(|| panic!("no {text}\n{screen}"))
    };
    let (newest, oldest) = (row_of("▸3 mat"), row_of(&oldest_entry));
    assert!(newest < oldest);
    // A click shows a render, and `n` continues from there.
    let click = |row: usize| format!("\x1b[<0;{0};{1}M\x1b[<0;{0};{1}m", PANEL + 4, row + 1);
    terminal.press(&click(oldest));
    terminal.wait("the red image", |screen| colors_from(screen, 0)[0] > 500);
    terminal.wait_for(&messages::render_number_of_count(1, 3));
    terminal.wait("its mark", |screen| text_right_of(screen, PANEL.into()).contains("▸1"));
    terminal.press("N");
    terminal.wait_for(&messages::render_number_of_count(2, 3));
    terminal.wait("its change", |screen| {
        words(screen).contains("materials.board.diffuse [0.8, 0.02, 0.02] → [0.02, 0.8, 0.02]")
    });
    terminal.press(&click(newest));
    terminal.wait_for(messages::NEWEST_RENDER);
    terminal.wait("the blue image", |screen| colors_from(screen, 0)[2] > 500);
    // A narrower window does not show the history.
    terminal.resize(119, 40);
    terminal.wait("no strip", |screen| !screen.contents().contains(messages::HISTORY));
}

/// `c` does not add an entry for the moved camera, and a broken save does not change the next entry.
#[test]
fn history_entry_shows_only_its_own_change() {
    let folder = TestDir::with_board();
    let mut terminal = folder.terminal_of(120, 40);
    terminal.wait_for_render(1);
    let is_told = |screen: &vt100::Screen, words: &str| {
        // The first line reports that a save did not change the image.
        let text = text_right_of(screen, PANEL.into()).replace("unchanged · ", "");
        text.contains(words) && !text.contains("changed") && !text.contains(messages::AGAIN)
    };
    terminal.press("+");
    terminal.wait("a moved camera", |screen| is_told(screen, "▸2 camera moved"));
    terminal.wait_for("done");
    terminal.press("c");
    terminal.wait("the camera written by c", |screen| {
        is_told(screen, " camera. position → [") && screen.contents().contains("✓ done")
    });
    let kept = fs::read_to_string(folder.path("scene.toml")).expect("a scene");
    folder.write("scene.toml", "[render");
    terminal.wait_for("broken");
    folder.write("scene.toml", kept.replace(RED, BLUE));
    terminal.wait("the edit", |screen| is_told(screen, " materials. board.diffuse"));
}

/// Checks that the history does not increase the number of queued bytes on a slow connection. (The painter's
/// tests check that it is sent after the image.)
#[test]
fn history_is_sent_over_slow_connections() {
    let folder = TestDir::with_board();
    let terminal = folder.thin_line(Responder::Terminal);
    edited(&folder, &terminal);
    terminal.wait_for(messages::HISTORY);
    assert!(terminal.line(|seen| seen.max_unanswered) <= 24_000);
}

#[test]
fn noise_curve_shows_the_target() {
    let folder = TestDir::with_board();
    let noisy = SCENE.replace("samples = 4", "samples = 10000000\nerror = 0.0001\nintegrator = \"path\"");
    folder.write("scene.toml", &noisy);
    let command = [PROGRAM, "scene.toml", "--time", "5"];
    let mut terminal = folder.terminal_with(&command, &[]);
    terminal.resize(120, 40);
    terminal.wait_for_render(1);
    let is_braille =
        |cell: &vt100::Cell| cell.contents().chars().any(|c| ('\u{2801}'..='\u{28ff}').contains(&c));
    terminal.wait("a curve", |screen| {
        let text = text_right_of(screen, PANEL.into());
        text.contains(messages::NOISE_OVER_TIME)
            && text.contains(&messages::noise_target_line_label("0.01 %"))
            && cells(screen).filter(|cell| is_braille(cell)).count() >= 10
    });
    // Changing the exposure does not start a new render.
    terminal.press("[");
    terminal.wait_for("exposure −0.25");
    terminal.wait_for_render(1);
    terminal.wait_for(messages::NOISE_OVER_TIME);
    terminal.press("r");
    terminal.wait_for("ETA");
    terminal
        .wait("no curve while rendering", |screen| !screen.contents().contains(messages::NOISE_OVER_TIME));
}

#[test]
fn undo_reverts_only_the_saved_camera() {
    let folder = TestDir::with_board();
    let text = || fs::read_to_string(folder.path("scene.toml")).expect("a scene");
    let mut terminal = folder.terminal_of(120, 40);
    terminal.wait_for_render(1);
    let own = folder.bytes("scene.png");
    terminal.press("u");
    terminal.wait_for(messages::NOTHING_TO_UNDO);
    terminal.press("+");
    terminal.wait_for_message(messages::CAMERA_MOVED);
    terminal.press("c");
    terminal.wait_for(&messages::camera_saved("scene.toml"));
    let kept = text();
    assert_ne!(kept, SCENE);
    // If the user has edited the file, undo does not change it.
    let edited = kept.replace(RED, GREEN);
    folder.write("scene.toml", &edited);
    terminal.wait("the edit", |screen| Colors::of(screen).is_dominant("green"));
    terminal.wait_for("done");
    terminal.press("u");
    terminal.wait("a refusal", |screen| {
        words(screen).contains(&format!("scene.toml {}", glimt::pipeline::messages::NOT_UNDONE))
    });
    assert_eq!(text(), edited);
    // After the edit is reverted by hand, `u` works again.
    folder.write("scene.toml", &kept);
    terminal.wait("the saved camera", |screen| Colors::of(screen).is_dominant("red"));
    terminal.wait_for("done");
    terminal.press("u");
    terminal.wait_for(&messages::camera_save_undone("scene.toml"));
    assert_eq!(text(), SCENE);
    terminal
        .wait("the image on disk", |_| fs::read(folder.path("scene.png")).is_ok_and(|bytes| bytes == own));
    terminal.press("u");
    terminal.wait_for(messages::NOTHING_TO_UNDO);
    assert_eq!(text(), SCENE);
}
