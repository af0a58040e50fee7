//! Keys for photons, integrator and views: effects on the screen, in the file and in the report.

use std::fs;

use glimt::tui::messages;

use super::pty::{SCENE, Terminal};
use crate::test_dir::{PROGRAM, TestDir};

/// The scene with a glass ball in front of the board, so that photons are emitted.
fn glassy() -> String {
    let ball = "ball = { type = \"glass\" }";
    SCENE.replace("ball = { diffuse = [0.02, 0.02, 0.02] }", ball) + "[photons]\ncount = 2000\n"
}

fn setting(folder: &TestDir, name: &str) -> serde_json::Value {
    let report: serde_json::Value = serde_json::from_slice(&folder.bytes("report.json")).expect("JSON");
    report["settings"][name].clone()
}

#[test]
fn keys_override_photons_and_integrator() {
    let folder = TestDir::with_board();
    folder.write("scene.toml", glassy());
    let call = [PROGRAM, "scene.toml", "--report", "report.json"];
    let mut terminal = folder.terminal_with(&call, &[]);
    terminal.wait_for_render(1);
    terminal.wait_for("p off");
    let own = folder.bytes("scene.png");
    let is_written = |bytes: &[u8]| fs::read(folder.path("scene.png")).is_ok_and(|there| there == bytes);
    let rounds = [
        ("p", "p on", ["--photons", "on"], ("photons", serde_json::json!(true))),
        ("p", "p off", ["--photons", "off"], ("photons", serde_json::json!(false))),
        ("i", "i path", ["--integrator", "path"], ("integrator", serde_json::json!("path"))),
        ("i", "i whitted", ["--integrator", "whitted"], ("integrator", serde_json::json!("whitted"))),
    ];
    for (number, (key, words, options, (name, value))) in (2..).zip(rounds) {
        terminal.press(key);
        terminal.wait_for(words);
        terminal.wait_for_render(number);
        let expected = folder.once(&options);
        let is_own = matches!(words, "p off" | "i whitted");
        assert_eq!(expected == own, is_own, "{words} shows");
        assert!(!is_written(&expected), "{words}: must not be written");
        assert_ne!(setting(&folder, name), value, "the report must describe the image on disk");
        terminal.press("w");
        terminal.wait(words, |_| is_written(&expected));
        terminal.wait(name, |_| setting(&folder, name) == value);
    }
    let text = fs::read_to_string(folder.path("scene.toml")).expect("a scene");
    assert_eq!(text, glassy(), "the scene file must not change");
}

#[test]
fn keys_ignored_by_path_are_explained() {
    let folder = TestDir::with_board();
    folder.write("scene.toml", glassy());
    let mut terminal = folder.terminal();
    terminal.wait_for_render(1);
    terminal.press("i");
    terminal.wait_for_render(2);
    terminal.wait_for("s –");
    terminal.press("s");
    terminal.wait_for(&messages::hard_shadows_unsupported("path", "whitted"));
    terminal.press("p");
    terminal.wait_for(&messages::photons_unsupported("whitted"));
    terminal.wait_for_render(2);
}

/// Waits until the key line shows a view.
fn wait_for_view(terminal: &Terminal, name: &str) {
    terminal.wait(name, |screen| {
        let text = screen.contents();
        text.lines().last().is_some_and(|line| line.contains(&format!("v {name}")))
    });
}

#[test]
fn digits_choose_views_in_the_open_list() {
    let folder = TestDir::with_board();
    let mut terminal = folder.terminal();
    terminal.wait_for_render(1);
    let views =
        ["beauty", "normal", "depth", "barycentric", "uv", "albedo", "ambient", "diffuse", "specular"];
    for (digit, view) in (1..).zip(views) {
        // Press both together, so that the list does not close in between.
        terminal.press(&format!("v{digit}"));
        terminal.wait_for(&format!("▸{digit} {view}"));
        // Close the list, which covers the key line.
        terminal.press("\r");
        wait_for_view(&terminal, view);
    }
    terminal.wait("a complete image of the view", |screen| {
        let text = screen.contents();
        text.lines().any(|line| line.contains("✓ done") && line.contains("view specular"))
    });
    terminal.press("w");
    terminal.wait_for_message(&messages::files_written("scene.png"));
    assert_eq!(folder.bytes("scene.png"), folder.once(&["--view", "specular"]));
    terminal.wait("no list", |screen| !screen.contents().contains("barycentric"));
    terminal.press("2e");
    terminal.wait_for(messages::NO_DIAGNOSTICS);
    wait_for_view(&terminal, "specular");
}

#[test]
fn views_wrap_around() {
    let folder = TestDir::with_board();
    let mut terminal = folder.terminal();
    terminal.wait_for_render(1);
    // Enter closes the list, so that the last line shows the keys again.
    terminal.press("V\r");
    wait_for_view(&terminal, "error");
    terminal.wait_for_render(2);
    terminal.press("v\r");
    wait_for_view(&terminal, "beauty");
}

#[test]
fn render_again_retraces_every_sample() {
    let folder = TestDir::with_board();
    let call = [PROGRAM, "scene.toml", "--report", "report.json"];
    let mut terminal = folder.terminal_with(&call, &[]);
    terminal.wait_for_render(1);
    let own = folder.bytes("scene.png");
    fs::remove_file(folder.path("report.json")).expect("removed");
    terminal.press("r");
    terminal.wait_for_render(2);
    let report: serde_json::Value = serde_json::from_slice(&folder.bytes("report.json")).expect("JSON");
    let statuses = report["stages"].as_array().expect("stages").iter().map(|it| it["status"].clone());
    let statuses: Vec<_> = statuses.collect();
    assert_eq!((&statuses[0], &statuses[6]), (&"reused".into(), &"done".into()), "{statuses:?}");
    assert_eq!(report["counters"]["camera_rays"], 64 * 48 * 4);
    assert_eq!(folder.bytes("scene.png"), own);
}
