//! Stages rerun by each kind of edit, according to the screen and the report.

use glimt::tui::messages;

use super::pty::{SCENE, Terminal};
use crate::test_dir::{PROGRAM, TestDir};
use glimt::pipeline::protocol::reasons;

/// A triangle next to the board.
const OBJ: &str = "v 1.2 0 0\nv 1.4 0 0\nv 1.2 0.5 0\nf 1 2 3\n";

fn paint(color: &str) -> String {
    format!("P3\n1 1\n255\n{color}\n")
}

/// The scene with two additional textures and a mesh.
fn scene() -> String {
    let balls = "[[sphere]]\ncenter = [-0.5, 0.5, 0.5]\nradius = 0.2\nmaterial = \"skin\"\n\n\
                 [[sphere]]\ncenter = [-0.5, -0.5, 0.5]\nradius = 0.2\nmaterial = \"bark\"\n";
    let mesh = "[[mesh]]\nfile = \"one.obj\"\nmaterial = \"ball\"\n";
    let materials = "[materials]\nskin = { diffuse = { texture = \"skin\" } }\nbark = { diffuse = { texture = \"bark\" } }";
    let textures = "[textures.skin]\nfile = \"skin.ppm\"\n[textures.bark]\nfile = \"bark.ppm\"\n\n"
        .to_owned()
        + materials;
    SCENE.replace("samples = 4", "samples = 4\nexposure = 0").replace("[materials]", &textures) + balls + mesh
}

fn folder(text: &str) -> TestDir {
    let folder = TestDir::with_board();
    folder.write("one.obj", OBJ);
    folder.write("two.obj", OBJ.replace("0.5", "0.6"));
    folder.write("skin.ppm", paint("200 150 100"));
    folder.write("bark.ppm", paint("100 150 50"));
    folder.write("scene.toml", text);
    folder
}

/// The program rendering the scene, in a terminal large enough for every line.
fn terminal(folder: &TestDir) -> Terminal {
    let call = [PROGRAM, "scene.toml", "--report", "report.json"];
    let mut terminal = folder.terminal_with(&call, &[]);
    terminal.resize(160, 40);
    terminal
}

/// `d`one, `r`eused or `s`kipped for each stage in order, and the message from stage `name`.
fn stages(folder: &TestDir, name: &str) -> (String, String) {
    let report: serde_json::Value = serde_json::from_slice(&folder.bytes("report.json")).expect("JSON");
    let stages = report["stages"].as_array().expect("stages");
    let text = |stage: &serde_json::Value, key: &str| stage[key].as_str().expect(key).to_owned();
    let why = stages.iter().find(|stage| stage["name"] == name).map(|stage| text(stage, "why"));
    (stages.iter().map(|stage| text(stage, "status")[..1].to_owned()).collect(), why.expect("a stage"))
}

#[test]
fn edits_rerun_only_dependent_stages() {
    let own = scene();
    let folder = folder(&own);
    let terminal = terminal(&folder);
    terminal.wait_for_render(1);
    assert_eq!(stages(&folder, "photons"), ("dddddsdd".to_owned(), reasons::PHOTONS_OFF.to_owned()));

    folder.write("scene.toml", own.replace("[camera]", "# the eye\n\n[camera]"));
    terminal.wait_for(&format!("unchanged · {}", messages::numbered_render(1)));
    terminal.wait_for(&messages::cached_stage_count("6 stages"));
    assert_eq!(stages(&folder, "render").0, "drrrrsrr");

    let edits = [
        ("exposure = 0", "exposure = 1", "drrrrsrd", "render", reasons::UNCHANGED),
        ("exposure = 0", "exposure = 0\ntonemap = \"agx\"", "drrrrsrd", "render", reasons::UNCHANGED),
        ("[0.8, 0.02, 0.02]", "[0.7, 0.02, 0.02]", "drrrrsdd", "accel", reasons::UNCHANGED),
        ("samples = 4", "samples = 4\nbackground = [0, 0, 1]", "drrrrsdd", "lights", reasons::UNCHANGED),
        ("[20, 20, 20]", "[10, 20, 20]", "drrrdsdd", "lights", "1 light"),
        ("position = [0, 0, 4]", "position = [0, 0, 5]", "drrrrsdd", "meshes", reasons::UNCHANGED),
        ("center = [0.5, 0.2", "center = [0.4, 0.2", "drrdrsdd", "accel", "1 kept"),
        ("one.obj", "two.obj", "ddrdrsdd", "meshes", "1 loaded"),
    ];
    let mut renders = 1;
    for (from, to, expected, stage, why) in edits {
        for (text, expected, why) in [(own.replace(from, to), Some(expected), why), (own.clone(), None, "")] {
            folder.write("scene.toml", &text);
            renders += 1;
            terminal.wait_for_render(renders);
            let (statuses, said) = stages(&folder, stage);
            // Undoing the edit reuses the previous trees and image.
            let is_of_light = expected.is_none() && from == "[20, 20, 20]";
            let back = if is_of_light { "drrrdsrd" } else { "drrrrsrd" };
            assert_eq!(statuses, expected.unwrap_or(back), "{to}");
            assert!(said.contains(why), "{to}: {said}");
            // The full text, or the short text if the line is too narrow.
            let count = statuses.matches('r').count();
            let words = [count.to_string(), format!("{count} stages"), "1 stage".to_owned()]
                .map(|it| messages::cached_stage_count(&it));
            terminal.wait("reused stages", |screen| {
                let text = screen.contents();
                words[..2 + usize::from(count == 1)].iter().any(|words| text.contains(words))
            });
        }
    }
    folder.write("bark.ppm", paint("50 150 100"));
    terminal.wait_for_render(renders + 1);
    terminal.wait("reused stages", |screen| {
        ["4 stages", "4"].iter().any(|count| screen.contents().contains(&messages::cached_stage_count(count)))
    });
    assert_eq!(stages(&folder, "textures"), ("rrdrrsdd".to_owned(), "1 loaded, 1 cached".to_owned()));
}

/// Waits until all expected stage lines appear.
#[track_caller]
fn wait_for_stages(terminal: &Terminal, lines: &[(&str, &str, &str)]) {
    for (sign, name, status) in lines {
        terminal.wait(&format!("{sign} {name} {status}"), |screen| {
            let text = screen.contents();
            let is_it = |line: &str| line.contains(&format!("{sign} {name} ")) && line.contains(status);
            text.lines().any(is_it)
        });
    }
}

#[test]
fn stages_report_their_state_while_rendering() {
    let own = scene().replace("samples = 4", "samples = 10000000");
    let folder = folder(&own);
    let terminal = terminal(&folder);
    let rendering = (">", "render", "…");
    let begin = [("✓", "meshes", " "), ("✓", "lights", " "), ("-", "photons", "skipped"), rendering];
    wait_for_stages(&terminal, &begin);
    let kept = ("=", "meshes", "reused");
    let other_light = own.replace("[20, 20, 20]", "[10, 20, 20]");
    folder.write("scene.toml", &other_light);
    wait_for_stages(&terminal, &[kept, ("=", "accel", "reused"), ("✓", "lights", " "), rendering]);
    let moved = other_light.replace("center = [0.5, 0.2", "center = [0.4, 0.2");
    folder.write("scene.toml", &moved);
    wait_for_stages(&terminal, &[kept, ("✓", "accel", " "), ("=", "lights", "reused"), rendering]);
    folder.write("skin.ppm", paint("50 150 100"));
    let saved = [("=", "parse", "reused"), kept, ("✓", "textures", " "), ("=", "accel", "reused"), rendering];
    wait_for_stages(&terminal, &saved);

    // Break the scene during the render, then restore the first version.
    folder.write("scene.toml", "[render");
    terminal.wait_for(messages::LAST_GOOD_SCENE);
    folder.write("scene.toml", &own);
    let back = [kept, ("=", "textures", "reused"), ("=", "accel", "reused"), ("✓", "lights", " "), rendering];
    wait_for_stages(&terminal, &back);
    terminal.wait("no error", |screen| !screen.contents().contains("broken"));
}
