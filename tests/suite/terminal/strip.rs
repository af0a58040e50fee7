//! The last pictures beside the newest one, with what each edit changed; the curve of noise; and `u`, which takes `c` back.

use std::fs;

use super::pty::{BLUE, Colors, Folder, GREEN, RED, SCENE, Terminal, cells, upper};
use super::relay::Answers;

/// The words of the screen, in one line.
fn words(screen: &vt100::Screen) -> String {
    screen.contents().split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Words beside the picture, in one line, without the blocks of small pictures.
fn beside(screen: &vt100::Screen, column: usize) -> String {
    let text = screen.contents();
    let is_word = |c: &char| !('▀'..='▟').contains(c);
    let rows = text.lines().map(|line| line.chars().skip(column).filter(is_word).collect::<String>());
    rows.collect::<Vec<_>>().join(" ").split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Cells of each color from a column on.
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

/// Three saves, each in another color.
fn edited(folder: &Folder, terminal: &Terminal) {
    terminal.wait_for_render(1);
    for (render, (color, value)) in (2..).zip([("green", GREEN), ("blue", BLUE)]) {
        folder.write("scene.toml", &SCENE.replace(RED, value));
        terminal.wait(color, |screen| Colors::of(screen).is_most(color) || render == 3);
        terminal.wait_for_render(render);
    }
}

/// Column at which the panel begins beside a picture of 64 × 48 pixels in 120 × 40 cells.
const PANEL: u16 = 97;

#[test]
fn the_last_pictures_stand_beside_the_newest_with_what_changed() {
    let folder = Folder::new();
    let mut terminal = folder.terminal_of(120, 40);
    terminal.wait_for_render(1);
    assert!(!terminal.text().contains("the last pictures"), "there is one alone");
    edited(&folder, &terminal);
    terminal.wait("a strip", |screen| {
        let beside = beside(screen, PANEL.into());
        beside.contains("the last pictures n N")
            && beside.contains("▸3 materials. board.diffuse → [0.02, 0.02, 0.8]")
            && beside.contains("1 first")
    });
    // A picture of each color, the newest at the top.
    let colors = terminal.settled(|screen| colors_from(screen, PANEL));
    assert!(colors.iter().all(|count| *count >= 3), "{colors:?}");
    let row_of = |text: &str| {
        let screen = terminal.text();
        let row = screen
            .lines()
            .position(|line| line.chars().skip(PANEL.into()).collect::<String>().contains(text));
        row.unwrap_or_else(|| panic!("no {text}\n{screen}"))
    };
    let (newest, oldest) = (row_of("▸3 mat"), row_of("1 first"));
    assert!(newest < oldest);
    // A click shows it, and `n` what it shows.
    let click = |row: usize| format!("\x1b[<0;{0};{1}M\x1b[<0;{0};{1}m", PANEL + 4, row + 1);
    terminal.press(&click(oldest));
    terminal.wait("the red picture", |screen| colors_from(screen, 0)[0] > 500);
    terminal.wait_for("picture 1 of 3");
    terminal.wait("its mark", |screen| beside(screen, PANEL.into()).contains("▸1"));
    terminal.press("N");
    terminal.wait_for("picture 2 of 3");
    terminal.wait("its change", |screen| {
        words(screen).contains("after materials.board.diffuse [0.8, 0.02, 0.02] → [0.02, 0.8, 0.02]")
    });
    terminal.press(&click(newest));
    terminal.wait_for("this is the newest picture");
    terminal.wait("the blue picture", |screen| colors_from(screen, 0)[2] > 500);
    // A narrower window has no room for it.
    terminal.resize(119, 40);
    terminal.wait("no strip", |screen| !screen.contents().contains("the last pictures"));
}

/// Several saves and a broken one are one edit in words, and so are `c` and `u`.
#[test]
fn an_entry_tells_what_changed_since_the_picture_before_it_and_nothing_else() {
    let folder = Folder::new();
    let mut terminal = folder.terminal_of(120, 40);
    terminal.wait_for_render(1);
    let is_told = |screen: &vt100::Screen, words: &str| {
        // The first line says of a run that it left the picture unchanged.
        let beside = beside(screen, PANEL.into()).replace("unchanged · run", "run");
        beside.contains(words) && !beside.contains("changed") && !beside.contains("rendered again")
    };
    terminal.press("+");
    terminal.wait("a moved camera", |screen| is_told(screen, "▸2 camera moved"));
    terminal.wait_for("done");
    terminal.press("c");
    terminal.wait("what c wrote", |screen| {
        is_told(screen, " camera. position → [") && screen.contents().contains("✓ done")
    });
    let kept = fs::read_to_string(folder.path("scene.toml")).expect("a scene");
    folder.write("scene.toml", "[render");
    terminal.wait_for("broken");
    folder.write("scene.toml", &kept.replace(RED, BLUE));
    terminal.wait("the edit", |screen| is_told(screen, " materials. board.diffuse"));
}

/// Over a thin line no more is on the way than without a strip. (That it comes behind the picture is a test of the painter.)
#[test]
fn the_strip_comes_over_a_thin_line_too() {
    let folder = Folder::new();
    let terminal = folder.thin_line(Answers::Terminal);
    edited(&folder, &terminal);
    terminal.wait_for("the last pictures");
    assert!(terminal.line(|seen| seen.most_unanswered) <= 24_000);
}

#[test]
fn noise_against_time_is_a_curve_with_its_target() {
    let folder = Folder::new();
    let noisy = SCENE.replace("samples = 4", "samples = 10000000\nerror = 0.0001\nintegrator = \"path\"");
    folder.write("scene.toml", &noisy);
    let command = [folder.program(), "scene.toml", "--time", "5"];
    let mut terminal = folder.terminal_with(&command, &[]);
    terminal.resize(120, 40);
    terminal.wait_for_render(1);
    let is_braille =
        |cell: &vt100::Cell| cell.contents().chars().any(|c| ('\u{2801}'..='\u{28ff}').contains(&c));
    terminal.wait("a curve", |screen| {
        let beside = beside(screen, PANEL.into());
        beside.contains("noise while it rendered")
            && beside.contains("the line is the 0.01 % asked of each tile")
            && cells(screen).filter(|cell| is_braille(cell)).count() >= 10
    });
    // Another exposure is the same render.
    terminal.press("[");
    terminal.wait_for("exposure −0.25");
    terminal.wait_for_render(1);
    terminal.wait_for("noise while it rendered");
    terminal.press("r");
    terminal.wait_for("ETA");
    terminal
        .wait("no curve while it renders", |screen| !screen.contents().contains("noise while it rendered"));
}

#[test]
fn u_takes_back_what_c_wrote_and_no_edit_of_a_person() {
    let folder = Folder::new();
    let text = || fs::read_to_string(folder.path("scene.toml")).expect("a scene");
    let mut terminal = folder.terminal_of(120, 40);
    terminal.wait_for_render(1);
    let own = folder.bytes("scene.png");
    terminal.press("u");
    terminal.wait_for("nothing to undo");
    terminal.press("+");
    terminal.wait_for("camera moved (preview only)");
    terminal.press("c");
    terminal.wait_for("camera saved to scene.toml · u: undo");
    let kept = text();
    assert_ne!(kept, SCENE);
    // Somebody edits it: it stays as it is.
    let edited = kept.replace(RED, GREEN);
    folder.write("scene.toml", &edited);
    terminal.wait("the edit", |screen| Colors::of(screen).is_most("green"));
    terminal.wait_for("done");
    terminal.press("u");
    terminal
        .wait("a refusal", |screen| words(screen).contains("error: scene.toml has changed since c wrote it"));
    assert_eq!(text(), edited);
    // The edit is taken back by hand; then `u` has something to take back.
    folder.write("scene.toml", &kept);
    terminal.wait("the camera that was kept", |screen| Colors::of(screen).is_most("red"));
    terminal.wait_for("done");
    terminal.press("u");
    terminal.wait_for("undone: scene.toml restored");
    assert_eq!(text(), SCENE);
    terminal
        .wait("the picture on disk", |_| fs::read(folder.path("scene.png")).is_ok_and(|bytes| bytes == own));
    terminal.press("u");
    terminal.wait_for("nothing to undo");
    assert_eq!(text(), SCENE);
}
