//! Tests of edits, typos among them: which pictures are before them, how they are numbered, and what a render took.

use super::{BLUE, RED, cells_of};
use crate::Changed;
use crate::event::{Event, FrameReport};
use crate::fixtures::*;
use crate::pipeline::protocol::{self, Kept, LastGoodEnd, PreviewSource, Stage, Status};
use crate::pipeline::settings::Effective;
use crate::scene::diagnostic::{Diagnostic, Severity};
use crate::scene::fingerprint::Fingerprint;

const GREEN: [u8; 3] = [10, 200, 20];

/// A save of this text, which is being read.
fn save(ui: &mut TestUi, text: &str) {
    ui.event(Event::Changed(Changed { noticed: ui.now }));
    let generation = ui.state.request.generation;
    ui.worker(protocol::Event::Text { generation, text: text.into() });
}

/// A save that breaks the scene.
fn typo(ui: &mut TestUi) {
    ui.event(Event::Changed(Changed { noticed: ui.now }));
    ui.fail(vec![diagnostic(Severity::Error, "unknown key `radus`")]);
    ui.event(Event::Settled);
}

/// Preview of an image, all samples of which are there or only some.
fn preview(ui: &mut TestUi, name: &str, color: [u8; 3], is_finished: bool) {
    let generation = ui.state.request.generation;
    let source = Some(PreviewSource { image: Fingerprint::new(name).finish(), is_finished });
    let picture = plain_picture(50, 38, color);
    let (range, section, lacks_photons) = (None, None, false);
    ui.event(Event::Picture { generation, picture, range, section, lacks_photons, source });
}

/// The scene could be read.
fn read(ui: &mut TestUi) {
    let generation = ui.state.request.generation;
    ui.worker(protocol::Event::Started { generation });
    let (settings, camera) = (Box::new(settings()), camera());
    ui.worker(protocol::Event::Settings { generation, settings, camera, exposure: 0.0, own: own() });
}

/// The end of a request: its render stage took so many seconds, and its image all these.
fn end(ui: &mut TestUi, unchanged: bool, seconds: f64, of_image: f64) {
    let generation = ui.state.request.generation;
    let mut event = done(generation, Vec::new(), unchanged);
    if let protocol::Event::Done { report, .. } = &mut event {
        let render = &mut report.stages[Stage::Render as usize];
        render.status = if unchanged { Status::Reused } else { Status::Done };
        (render.seconds, report.image.render_seconds, report.seconds) = (seconds, of_image, seconds);
    }
    ui.worker(event);
}

#[test]
fn a_typo_and_its_mend_are_no_edit_to_look_back_over() {
    let mut ui = TestUi::with(state(120, 40));
    save(&mut ui, "shininess = 60");
    ui.finish(RED);
    save(&mut ui, "shininess = 6");
    read(&mut ui);
    preview(&mut ui, "dull", BLUE, true);
    end(&mut ui, false, 1.0, 1.0);
    typo(&mut ui);
    // The last good scene is shown again, where colors are mixed by other cells.
    preview(&mut ui, "dull", GREEN, true);
    save(&mut ui, "shininess = 6");
    read(&mut ui);
    preview(&mut ui, "dull", GREEN, true);
    end(&mut ui, true, 0.0, 1.0);
    assert!(ui.text().contains("unchanged · run 2"), "{}", ui.text());
    assert!(ui.text().contains("▸2 shininess") && !ui.text().contains("rendered again"), "{}", ui.text());
    ui.press('b');
    assert!(cells_of(&mut ui, RED) > 500, "{}", ui.text());
    let text = ui.text();
    assert!(text.contains("picture 1 of 2, 0 s ago"), "{text}");
    assert!(text.contains("\nbefore the last edit, shininess 60 → 6  "), "{text}");
    assert!(text.contains("b newest") && !text.contains("b shows"), "{text}");
}

#[test]
fn an_edit_of_a_comment_adds_no_picture_and_no_run() {
    let mut ui = TestUi::with(state(120, 40));
    save(&mut ui, "a = 1 # one");
    read(&mut ui);
    preview(&mut ui, "first", RED, true);
    end(&mut ui, false, 1.0, 1.0);
    save(&mut ui, "a = 1 # two");
    read(&mut ui);
    preview(&mut ui, "first", BLUE, true);
    end(&mut ui, true, 0.0, 1.0);
    assert_eq!((ui.state.picture.history.len(), ui.state.work.renders), (1, 1));
    ui.press('b');
    assert!(ui.text().contains("there is no picture from before an edit"), "{}", ui.text());
}

#[test]
fn a_save_that_only_writes_another_file_adds_no_picture() {
    let mut ui = TestUi::with(state(120, 40));
    save(&mut ui, "camera.fov = 40");
    read(&mut ui);
    shown(&mut ui, "narrow", RED, true);
    end(&mut ui, false, 1.0, 1.0);
    save(&mut ui, "camera.fov = 44");
    read(&mut ui);
    shown(&mut ui, "wide", BLUE, true);
    end(&mut ui, false, 1.0, 1.0);
    save(&mut ui, "camera.fov = 44\nrender.output = \"other.png\"");
    read(&mut ui);
    shown(&mut ui, "wide", BLUE, true);
    let generation = ui.state.request.generation;
    let mut event = done(generation, Vec::new(), false);
    if let protocol::Event::Done { report, .. } = &mut event {
        report.stages[Stage::Render as usize].status = Status::Reused;
    }
    ui.worker(event);
    let text = ui.text();
    // It is written by another run, and made by the same edit.
    assert!(text.contains("· run 3") && text.contains("▸3 camera.fov"), "{text}");
    assert!(!text.contains("render.output"), "{text}");
    assert_eq!(ui.state.picture.history.len(), 2);
    ui.press('b');
    assert!(ui.text().contains("before the last edit, camera.fov 40 → 44  "), "{}", ui.text());
}

#[test]
fn a_render_that_goes_on_counts_all_seconds_of_its_samples_and_is_one_picture() {
    let mut ui = TestUi::with(state(120, 40));
    save(&mut ui, "a = 1");
    read(&mut ui);
    preview(&mut ui, "first", RED, true);
    end(&mut ui, false, 5.8, 5.8);
    ui.press('r');
    read(&mut ui);
    preview(&mut ui, "first", BLUE, false);
    typo(&mut ui);
    preview(&mut ui, "first", GREEN, false);
    save(&mut ui, "a = 1");
    read(&mut ui);
    preview(&mut ui, "first", GREEN, false);
    let generation = ui.state.request.generation;
    let progress = protocol::RenderProgress { earlier_seconds: 4.5, ..progress(0.5, None) };
    ui.worker(protocol::Event::Progress { generation, progress });
    assert!(ui.text().contains("32/64 samples · 4.5 s"), "the clock goes on: {}", ui.text());
    preview(&mut ui, "first", BLUE, true);
    end(&mut ui, false, 4.23, 8.73);
    let text = ui.text();
    assert!(text.contains("render 8.73 s +2.9 s"), "{text}");
    assert!(text.contains("8.73 s · run 2"), "{text}");
    assert_eq!(ui.state.picture.history.len(), 1, "{text}");
}

/// The request under way has a picture, which the terminal gets.
fn shown(ui: &mut TestUi, name: &str, color: [u8; 3], is_finished: bool) {
    preview(ui, name, color, is_finished);
    let generation = ui.state.request.generation;
    ui.event(Event::Shown { generation });
}

/// The last good scene, which is rendered while the newest is broken, comes to an end.
fn last_good(ui: &mut TestUi, end: LastGoodEnd) {
    let generation = ui.state.request.generation;
    ui.worker(protocol::Event::LastGoodEnded { generation, end });
}

const FINISHED: LastGoodEnd = LastGoodEnd::Finished { unchanged: false };

/// A finished picture, and an edit that a typo follows during its render.
fn typo_during_a_render() -> TestUi {
    let mut ui = TestUi::with(state(120, 40));
    save(&mut ui, "shininess = 60");
    ui.finish(RED);
    save(&mut ui, "shininess = 6");
    read(&mut ui);
    shown(&mut ui, "dull", BLUE, false);
    typo(&mut ui);
    shown(&mut ui, "dull", GREEN, false);
    ui
}

#[test]
fn the_last_good_scene_is_the_picture_under_way_and_its_end_is_a_run() {
    let mut ui = typo_during_a_render();
    let newest = |ui: &mut TestUi| {
        let text = ui.text();
        assert!(text.contains("▸2 shininess") && text.contains(" 1 first"), "{text}");
        assert!(!text.contains("unfinished"), "{text}");
    };
    newest(&mut ui);
    last_good(&mut ui, FINISHED);
    assert_eq!(ui.state.work.renders, 2);
    // The last picture of the render comes after its end.
    shown(&mut ui, "dull", BLUE, true);
    newest(&mut ui);
    for key in ['n', 'N'] {
        ui.press(key);
    }
    newest(&mut ui);
    save(&mut ui, "shininess = 6");
    read(&mut ui);
    shown(&mut ui, "dull", BLUE, true);
    end(&mut ui, true, 0.0, 1.0);
    newest(&mut ui);
    assert!(ui.text().contains("unchanged · run 2"), "{}", ui.text());
    save(&mut ui, "shininess = 5");
    read(&mut ui);
    shown(&mut ui, "duller", RED, true);
    end(&mut ui, false, 1.0, 1.0);
    ui.press('n');
    assert!(ui.text().contains("picture 2 of 3, 0 s ago"), "{}", ui.text());
}

#[test]
fn a_last_good_scene_that_is_stopped_is_unfinished() {
    let mut ui = typo_during_a_render();
    last_good(&mut ui, LastGoodEnd::Stopped);
    assert!(ui.text().contains("▸– unfinished;"), "{}", ui.text());
    assert_eq!(ui.state.work.renders, 1);
}

#[test]
fn what_a_key_changes_of_the_last_good_scene_is_a_picture_with_a_number() {
    let mut ui = TestUi::with(state(120, 40));
    save(&mut ui, "shininess = 60");
    read(&mut ui);
    shown(&mut ui, "bright", RED, true);
    end(&mut ui, false, 1.0, 1.0);
    typo(&mut ui);
    shown(&mut ui, "bright", RED, true);
    last_good(&mut ui, LastGoodEnd::Finished { unchanged: true });
    assert_eq!((ui.state.picture.history.len(), ui.state.work.renders), (1, 1));
    for (run, name, words) in [(2, "hard", "shadows"), (3, "off", "shadows off")] {
        ui.press('s');
        ui.fail(vec![diagnostic(Severity::Error, "unknown key `radus`")]);
        for is_finished in [false, true] {
            shown(&mut ui, name, [7, run, u8::from(is_finished)], is_finished);
            assert!(ui.text().contains(&format!("▸{run} {words}")), "{}", ui.text());
            assert!(ui.text().contains(" 1 first"), "{}", ui.text());
        }
        last_good(&mut ui, FINISHED);
        assert_eq!(ui.state.work.renders, u64::from(run));
        assert!(ui.text().contains(&format!("▸{run} {words}")), "{}", ui.text());
    }
    ui.press('n');
    assert!(ui.text().contains("picture 2 of 3, 0 s ago"), "{}", ui.text());
}

#[test]
fn a_finished_picture_whose_run_is_not_known_is_not_called_unfinished() {
    let mut ui = TestUi::with(state(120, 40));
    ui.finish(RED);
    ui.press('s');
    read(&mut ui);
    // All samples are there, but the next key comes before the end of the request.
    shown(&mut ui, "hard", GREEN, true);
    ui.press('s');
    ui.finish(BLUE);
    ui.press('n');
    let text = ui.text();
    assert!(text.contains("older picture, 0 s ago") && !text.contains("unfinished"), "{text}");
}

#[test]
fn the_number_of_a_picture_is_that_of_its_run() {
    let mut ui = TestUi::with(state(120, 40));
    ui.finish(RED);
    // A render that is stopped is no run.
    ui.press('s');
    read(&mut ui);
    preview(&mut ui, "hard", GREEN, false);
    ui.press('s');
    ui.finish(BLUE);
    let text = ui.text();
    assert!(text.contains("· run 2") && text.contains("▸2 shadows off"), "{text}");
    assert!(text.contains("– unfinished;") && text.contains(" 1 first"), "{text}");
    ui.press('n');
    assert!(ui.text().contains("unfinished picture, 0 s ago"), "{}", ui.text());
    assert!(ui.text().contains("unfinished; after shadows hard · n older · N newer"), "{}", ui.text());
    ui.press('n');
    assert!(ui.text().contains("picture 1 of 2, 0 s ago"), "{}", ui.text());
}

#[test]
fn the_age_of_a_picture_counts_from_the_time_at_which_it_was_last_improved() {
    let mut ui = TestUi::with(state(120, 40));
    save(&mut ui, "shininess = 60");
    read(&mut ui);
    shown(&mut ui, "bright", RED, false);
    ui.wait(8000);
    end(&mut ui, false, 8.0, 8.0);
    ui.wait(3000);
    // Shown once more, such as in another size, it is as old as it was.
    shown(&mut ui, "bright", GREEN, true);
    save(&mut ui, "shininess = 6");
    read(&mut ui);
    shown(&mut ui, "dull", BLUE, false);
    ui.wait(2000);
    ui.press('n');
    assert!(ui.text().contains("picture 1 of 2, 5 s ago"), "{}", ui.text());
    // So is one whose render was stopped.
    ui.press('N');
    shown(&mut ui, "dull", GREEN, false);
    ui.wait(4000);
    ui.press('s');
    ui.wait(1000);
    ui.finish(RED);
    ui.press('n');
    assert!(ui.text().contains("unfinished picture, 5 s ago"), "{}", ui.text());
}

#[test]
fn settings_of_the_scene_again_stand_together() {
    let mut ui = TestUi::with(state(120, 40));
    ui.finish(RED);
    ui.press('s');
    ui.press('p');
    ui.finish(BLUE);
    ui.press('0');
    ui.finish(GREEN);
    ui.press('s');
    ui.finish(RED);
    ui.press('n');
    let words = "after shadows and photons reset · n older · N newer";
    assert!(!ui.text().contains("of the scene") && ui.text().contains(words), "{}", ui.text());
}

#[test]
fn what_is_said_of_a_pinhole_is_true_with_and_without_its_key() {
    for text in ["[camera]\nfov = 40", "[camera]\naperture = 0.0"] {
        let mut ui = TestUi::new();
        save(&mut ui, text);
        read(&mut ui);
        ui.state.request.effective = Some(Effective { dof: false, ..settings() });
        ui.state.request.camera.as_mut().expect("a camera").aperture = 0.0;
        ui.press('d');
        assert!(ui.text().contains("no depth of field: the camera's `aperture` is 0"), "{}", ui.text());
        ui.press('f');
        assert!(ui.text().contains("everything is in focus: the camera's `aperture` is 0"), "{}", ui.text());
    }
}

#[test]
fn a_scene_that_c_wrote_beside_a_model_stays() {
    let mut ui = TestUi::new();
    ui.finish(RED);
    let (path, edit) = ("assets/knot.toml".into(), None);
    let kept = Kept { path, is_new: true, is_own: false, of_model: true, edit };
    ui.worker(protocol::Event::CameraKept { generation: 1, outcome: Ok(kept) });
    ui.press('u');
    let words = "the scene that c wrote beside the model stays: there is nothing in it to undo";
    assert!(ui.text().contains(words), "{}", ui.text());
}

#[test]
fn nobody_is_asked_to_save_what_is_no_text() {
    let mut ui = TestUi::new();
    let folder = Diagnostic { place: None, ..diagnostic(Severity::Error, "this is a folder") };
    ui.fail(vec![folder]);
    assert!(!ui.text().contains("save "), "{}", ui.text());
    ui.event(Event::Settled);
    assert!(ui.text().contains("this is a folder") && !ui.text().contains("save "), "{}", ui.text());
    let mut ui = TestUi::new();
    ui.fail(vec![diagnostic(Severity::Error, "unknown key `radus`")]);
    ui.event(Event::Settled);
    assert!(ui.text().contains("save cornell.toml"), "{}", ui.text());
}

#[test]
fn the_end_is_never_no_time_away() {
    for (seconds, words) in [(0.0, "ETA under 1 s"), (0.04, "ETA under 1 s"), (0.06, "ETA 0.1 s")] {
        let mut ui = TestUi::new();
        ui.worker(protocol::Event::Progress { generation: 1, progress: progress(0.5, Some(seconds)) });
        assert!(ui.text().contains(words), "{seconds}: {}", ui.text());
    }
}

#[test]
fn facts_of_the_folded_line_are_apart() {
    let mut ui = TestUi::with(state(80, 24));
    ui.finish(RED);
    ui.press('l');
    ui.finish(BLUE);
    let settings = ui.state.request.effective.as_mut().expect("settings");
    (settings.width, settings.height) = (320, 180);
    let reused = |name| stage(name, Status::Reused, 0.0, "");
    for name in [Stage::Parse, Stage::Meshes, Stage::Lights] {
        ui.state.work.stages[name as usize] = Some(reused(name));
    }
    for name in [Stage::Textures, Stage::Accel, Stage::Photons, Stage::Write] {
        ui.state.work.stages[name as usize] = None;
    }
    ui.state.display.frame = Some(FrameReport { bytes: 131_000, round_trip: None });
    ui.press('m');
    ui.state.overlays.message = None;
    assert!(ui.text().contains("3 stages reused, not saved · w saves it"), "{}", ui.text());
}
