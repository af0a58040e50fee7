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
fn save(desk: &mut Desk, text: &str) {
    desk.event(Event::Changed(Changed { noticed: desk.now }));
    let generation = desk.state.request.generation;
    desk.worker(protocol::Event::Text { generation, text: text.into() });
}

/// A save that breaks the scene.
fn typo(desk: &mut Desk) {
    desk.event(Event::Changed(Changed { noticed: desk.now }));
    desk.fail(vec![diagnostic(Severity::Error, "unknown key `radus`")]);
    desk.event(Event::Settled);
}

/// Preview of an image, all samples of which are there or only some.
fn preview(desk: &mut Desk, name: &str, color: [u8; 3], is_finished: bool) {
    let generation = desk.state.request.generation;
    let source = Some(PreviewSource { image: Fingerprint::new(name).finish(), is_finished });
    let picture = plain_picture(50, 38, color);
    let (range, section, lacks_photons) = (None, None, false);
    desk.event(Event::Picture { generation, picture, range, section, lacks_photons, source });
}

/// The scene could be read.
fn read(desk: &mut Desk) {
    let generation = desk.state.request.generation;
    desk.worker(protocol::Event::Started { generation });
    let (settings, camera) = (Box::new(settings()), camera());
    desk.worker(protocol::Event::Settings { generation, settings, camera, exposure: 0.0, own: own() });
}

/// The end of a request: its render stage took so many seconds, and its image all these.
fn end(desk: &mut Desk, unchanged: bool, seconds: f64, of_image: f64) {
    let generation = desk.state.request.generation;
    let mut event = done(generation, Vec::new(), unchanged);
    if let protocol::Event::Done { report, .. } = &mut event {
        let render = &mut report.stages[Stage::Render as usize];
        render.status = if unchanged { Status::Reused } else { Status::Done };
        (render.seconds, report.image.render_seconds, report.seconds) = (seconds, of_image, seconds);
    }
    desk.worker(event);
}

#[test]
fn a_typo_and_its_mend_are_no_edit_to_look_back_over() {
    let mut desk = Desk::with(state(120, 40));
    save(&mut desk, "shininess = 60");
    desk.finish(RED);
    save(&mut desk, "shininess = 6");
    read(&mut desk);
    preview(&mut desk, "dull", BLUE, true);
    end(&mut desk, false, 1.0, 1.0);
    typo(&mut desk);
    // The last good scene is shown again, where colours are mixed by other cells.
    preview(&mut desk, "dull", GREEN, true);
    save(&mut desk, "shininess = 6");
    read(&mut desk);
    preview(&mut desk, "dull", GREEN, true);
    end(&mut desk, true, 0.0, 1.0);
    assert!(desk.text().contains("unchanged · run 2"), "{}", desk.text());
    assert!(
        desk.text().contains("▸2 shininess") && !desk.text().contains("rendered again"),
        "{}",
        desk.text()
    );
    desk.press('b');
    assert!(cells_of(&mut desk, RED) > 500, "{}", desk.text());
    let text = desk.text();
    assert!(text.contains("picture 1 of 2, 0 s ago"), "{text}");
    assert!(text.contains("\nbefore the last edit, shininess 60 → 6  "), "{text}");
    assert!(text.contains("b newest") && !text.contains("b shows"), "{text}");
}

#[test]
fn an_edit_of_a_comment_adds_no_picture_and_no_run() {
    let mut desk = Desk::with(state(120, 40));
    save(&mut desk, "a = 1 # one");
    read(&mut desk);
    preview(&mut desk, "first", RED, true);
    end(&mut desk, false, 1.0, 1.0);
    save(&mut desk, "a = 1 # two");
    read(&mut desk);
    preview(&mut desk, "first", BLUE, true);
    end(&mut desk, true, 0.0, 1.0);
    assert_eq!((desk.state.picture.history.len(), desk.state.work.renders), (1, 1));
    desk.press('b');
    assert!(desk.text().contains("there is no picture from before an edit"), "{}", desk.text());
}

#[test]
fn a_save_that_only_writes_another_file_adds_no_picture() {
    let mut desk = Desk::with(state(120, 40));
    save(&mut desk, "camera.fov = 40");
    read(&mut desk);
    shown(&mut desk, "narrow", RED, true);
    end(&mut desk, false, 1.0, 1.0);
    save(&mut desk, "camera.fov = 44");
    read(&mut desk);
    shown(&mut desk, "wide", BLUE, true);
    end(&mut desk, false, 1.0, 1.0);
    save(&mut desk, "camera.fov = 44\nrender.output = \"other.png\"");
    read(&mut desk);
    shown(&mut desk, "wide", BLUE, true);
    let generation = desk.state.request.generation;
    let mut event = done(generation, Vec::new(), false);
    if let protocol::Event::Done { report, .. } = &mut event {
        report.stages[Stage::Render as usize].status = Status::Reused;
    }
    desk.worker(event);
    let text = desk.text();
    // It is written by another run, and made by the same edit.
    assert!(text.contains("· run 3") && text.contains("▸3 camera.fov"), "{text}");
    assert!(!text.contains("render.output"), "{text}");
    assert_eq!(desk.state.picture.history.len(), 2);
    desk.press('b');
    assert!(desk.text().contains("before the last edit, camera.fov 40 → 44  "), "{}", desk.text());
}

#[test]
fn a_render_that_goes_on_counts_all_seconds_of_its_samples_and_is_one_picture() {
    let mut desk = Desk::with(state(120, 40));
    save(&mut desk, "a = 1");
    read(&mut desk);
    preview(&mut desk, "first", RED, true);
    end(&mut desk, false, 5.8, 5.8);
    desk.press('r');
    read(&mut desk);
    preview(&mut desk, "first", BLUE, false);
    typo(&mut desk);
    preview(&mut desk, "first", GREEN, false);
    save(&mut desk, "a = 1");
    read(&mut desk);
    preview(&mut desk, "first", GREEN, false);
    let generation = desk.state.request.generation;
    let progress = protocol::RenderProgress { earlier_seconds: 4.5, ..progress(0.5, None) };
    desk.worker(protocol::Event::Progress { generation, progress });
    assert!(desk.text().contains("32/64 samples · 4.5 s"), "the clock goes on: {}", desk.text());
    preview(&mut desk, "first", BLUE, true);
    end(&mut desk, false, 4.23, 8.73);
    let text = desk.text();
    assert!(text.contains("render 8.73 s +2.9 s"), "{text}");
    assert!(text.contains("8.73 s · run 2"), "{text}");
    assert_eq!(desk.state.picture.history.len(), 1, "{text}");
}

/// The request under way has a picture, which the terminal gets.
fn shown(desk: &mut Desk, name: &str, color: [u8; 3], is_finished: bool) {
    preview(desk, name, color, is_finished);
    let generation = desk.state.request.generation;
    desk.event(Event::Shown { generation });
}

/// The last good scene, which is rendered while the newest is broken, comes to an end.
fn last_good(desk: &mut Desk, end: LastGoodEnd) {
    let generation = desk.state.request.generation;
    desk.worker(protocol::Event::LastGoodEnded { generation, end });
}

const FINISHED: LastGoodEnd = LastGoodEnd::Finished { unchanged: false };

/// A finished picture, and an edit that a typo follows during its render.
fn typo_during_a_render() -> Desk {
    let mut desk = Desk::with(state(120, 40));
    save(&mut desk, "shininess = 60");
    desk.finish(RED);
    save(&mut desk, "shininess = 6");
    read(&mut desk);
    shown(&mut desk, "dull", BLUE, false);
    typo(&mut desk);
    shown(&mut desk, "dull", GREEN, false);
    desk
}

#[test]
fn the_last_good_scene_is_the_picture_under_way_and_its_end_is_a_run() {
    let mut desk = typo_during_a_render();
    let newest = |desk: &mut Desk| {
        let text = desk.text();
        assert!(text.contains("▸2 shininess") && text.contains(" 1 first"), "{text}");
        assert!(!text.contains("unfinished"), "{text}");
    };
    newest(&mut desk);
    last_good(&mut desk, FINISHED);
    assert_eq!(desk.state.work.renders, 2);
    // The last picture of the render comes after its end.
    shown(&mut desk, "dull", BLUE, true);
    newest(&mut desk);
    for key in ['n', 'N'] {
        desk.press(key);
    }
    newest(&mut desk);
    save(&mut desk, "shininess = 6");
    read(&mut desk);
    shown(&mut desk, "dull", BLUE, true);
    end(&mut desk, true, 0.0, 1.0);
    newest(&mut desk);
    assert!(desk.text().contains("unchanged · run 2"), "{}", desk.text());
    save(&mut desk, "shininess = 5");
    read(&mut desk);
    shown(&mut desk, "duller", RED, true);
    end(&mut desk, false, 1.0, 1.0);
    desk.press('n');
    assert!(desk.text().contains("picture 2 of 3, 0 s ago"), "{}", desk.text());
}

#[test]
fn a_last_good_scene_that_is_stopped_is_unfinished() {
    let mut desk = typo_during_a_render();
    last_good(&mut desk, LastGoodEnd::Stopped);
    assert!(desk.text().contains("▸– unfinished;"), "{}", desk.text());
    assert_eq!(desk.state.work.renders, 1);
}

#[test]
fn what_a_key_changes_of_the_last_good_scene_is_a_picture_with_a_number() {
    let mut desk = Desk::with(state(120, 40));
    save(&mut desk, "shininess = 60");
    read(&mut desk);
    shown(&mut desk, "bright", RED, true);
    end(&mut desk, false, 1.0, 1.0);
    typo(&mut desk);
    shown(&mut desk, "bright", RED, true);
    last_good(&mut desk, LastGoodEnd::Finished { unchanged: true });
    assert_eq!((desk.state.picture.history.len(), desk.state.work.renders), (1, 1));
    for (run, name, words) in [(2, "hard", "shadows"), (3, "off", "shadows off")] {
        desk.press('s');
        desk.fail(vec![diagnostic(Severity::Error, "unknown key `radus`")]);
        for is_finished in [false, true] {
            shown(&mut desk, name, [7, run, u8::from(is_finished)], is_finished);
            assert!(desk.text().contains(&format!("▸{run} {words}")), "{}", desk.text());
            assert!(desk.text().contains(" 1 first"), "{}", desk.text());
        }
        last_good(&mut desk, FINISHED);
        assert_eq!(desk.state.work.renders, u64::from(run));
        assert!(desk.text().contains(&format!("▸{run} {words}")), "{}", desk.text());
    }
    desk.press('n');
    assert!(desk.text().contains("picture 2 of 3, 0 s ago"), "{}", desk.text());
}

#[test]
fn a_finished_picture_whose_run_is_not_known_is_not_called_unfinished() {
    let mut desk = Desk::with(state(120, 40));
    desk.finish(RED);
    desk.press('s');
    read(&mut desk);
    // All samples are there, but the next key comes before the end of the request.
    shown(&mut desk, "hard", GREEN, true);
    desk.press('s');
    desk.finish(BLUE);
    desk.press('n');
    let text = desk.text();
    assert!(text.contains("older picture, 0 s ago") && !text.contains("unfinished"), "{text}");
}

#[test]
fn the_number_of_a_picture_is_that_of_its_run() {
    let mut desk = Desk::with(state(120, 40));
    desk.finish(RED);
    // A render that is stopped is no run.
    desk.press('s');
    read(&mut desk);
    preview(&mut desk, "hard", GREEN, false);
    desk.press('s');
    desk.finish(BLUE);
    let text = desk.text();
    assert!(text.contains("· run 2") && text.contains("▸2 shadows off"), "{text}");
    assert!(text.contains("– unfinished;") && text.contains(" 1 first"), "{text}");
    desk.press('n');
    assert!(desk.text().contains("unfinished picture, 0 s ago"), "{}", desk.text());
    assert!(desk.text().contains("unfinished; after shadows hard · n older · N newer"), "{}", desk.text());
    desk.press('n');
    assert!(desk.text().contains("picture 1 of 2, 0 s ago"), "{}", desk.text());
}

#[test]
fn the_age_of_a_picture_counts_from_the_time_at_which_it_was_last_improved() {
    let mut desk = Desk::with(state(120, 40));
    save(&mut desk, "shininess = 60");
    read(&mut desk);
    shown(&mut desk, "bright", RED, false);
    desk.wait(8000);
    end(&mut desk, false, 8.0, 8.0);
    desk.wait(3000);
    // Shown once more, such as in another size, it is as old as it was.
    shown(&mut desk, "bright", GREEN, true);
    save(&mut desk, "shininess = 6");
    read(&mut desk);
    shown(&mut desk, "dull", BLUE, false);
    desk.wait(2000);
    desk.press('n');
    assert!(desk.text().contains("picture 1 of 2, 5 s ago"), "{}", desk.text());
    // So is one whose render was stopped.
    desk.press('N');
    shown(&mut desk, "dull", GREEN, false);
    desk.wait(4000);
    desk.press('s');
    desk.wait(1000);
    desk.finish(RED);
    desk.press('n');
    assert!(desk.text().contains("unfinished picture, 5 s ago"), "{}", desk.text());
}

#[test]
fn settings_of_the_scene_again_stand_together() {
    let mut desk = Desk::with(state(120, 40));
    desk.finish(RED);
    desk.press('s');
    desk.press('p');
    desk.finish(BLUE);
    desk.press('0');
    desk.finish(GREEN);
    desk.press('s');
    desk.finish(RED);
    desk.press('n');
    let words = "after shadows and photons reset · n older · N newer";
    assert!(!desk.text().contains("of the scene") && desk.text().contains(words), "{}", desk.text());
}

#[test]
fn what_is_said_of_a_pinhole_is_true_with_and_without_its_key() {
    for text in ["[camera]\nfov = 40", "[camera]\naperture = 0.0"] {
        let mut desk = Desk::new();
        save(&mut desk, text);
        read(&mut desk);
        desk.state.request.effective = Some(Effective { dof: false, ..settings() });
        desk.state.request.camera.as_mut().expect("a camera").aperture = 0.0;
        desk.press('d');
        assert!(desk.text().contains("no depth of field: the camera's `aperture` is 0"), "{}", desk.text());
        desk.press('f');
        assert!(
            desk.text().contains("everything is in focus: the camera's `aperture` is 0"),
            "{}",
            desk.text()
        );
    }
}

#[test]
fn a_scene_that_c_wrote_beside_a_model_stays() {
    let mut desk = Desk::new();
    desk.finish(RED);
    let (path, edit) = ("assets/knot.toml".into(), None);
    let kept = Kept { path, is_new: true, is_own: false, of_model: true, edit };
    desk.worker(protocol::Event::CameraKept { generation: 1, outcome: Ok(kept) });
    desk.press('u');
    let words = "the scene that c wrote beside the model stays: there is nothing in it to undo";
    assert!(desk.text().contains(words), "{}", desk.text());
}

#[test]
fn nobody_is_asked_to_save_what_is_no_text() {
    let mut desk = Desk::new();
    let folder = Diagnostic { place: None, ..diagnostic(Severity::Error, "this is a folder") };
    desk.fail(vec![folder]);
    assert!(!desk.text().contains("save "), "{}", desk.text());
    desk.event(Event::Settled);
    assert!(desk.text().contains("this is a folder") && !desk.text().contains("save "), "{}", desk.text());
    let mut desk = Desk::new();
    desk.fail(vec![diagnostic(Severity::Error, "unknown key `radus`")]);
    desk.event(Event::Settled);
    assert!(desk.text().contains("save cornell.toml"), "{}", desk.text());
}

#[test]
fn the_end_is_never_no_time_away() {
    for (seconds, words) in [(0.0, "ETA under 1 s"), (0.04, "ETA under 1 s"), (0.06, "ETA 0.1 s")] {
        let mut desk = Desk::new();
        desk.worker(protocol::Event::Progress { generation: 1, progress: progress(0.5, Some(seconds)) });
        assert!(desk.text().contains(words), "{seconds}: {}", desk.text());
    }
}

#[test]
fn facts_of_the_folded_line_are_apart() {
    let mut desk = Desk::with(state(80, 24));
    desk.finish(RED);
    desk.press('l');
    desk.finish(BLUE);
    let settings = desk.state.request.effective.as_mut().expect("settings");
    (settings.width, settings.height) = (320, 180);
    let reused = |name| stage(name, Status::Reused, 0.0, "");
    for name in [Stage::Parse, Stage::Meshes, Stage::Lights] {
        desk.state.work.stages[name as usize] = Some(reused(name));
    }
    for name in [Stage::Textures, Stage::Accel, Stage::Photons, Stage::Write] {
        desk.state.work.stages[name as usize] = None;
    }
    desk.state.display.frame = Some(FrameReport { bytes: 131_000, round_trip: None });
    desk.press('m');
    desk.state.overlays.message = None;
    assert!(desk.text().contains("3 stages reused, not saved · w saves it"), "{}", desk.text());
}
