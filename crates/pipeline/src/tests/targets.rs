//! Tests for files that must not be overwritten.

use std::ops::Range;
use std::os::unix::fs::symlink;
use std::sync::atomic::{AtomicBool, Ordering};

use super::*;
use crate::control::{CancelToken, Canceled};
use crate::film::{SelectedPixels, TileSamples};
use crate::integrators::{PhotonPassesBySample, RayCounters, RenderSettings};
use crate::output::FileIdentity;
use crate::protocol::CheckpointUpdate;
use crate::settings::CheckpointSettings;
use crate::turntable::TurntableFrame;
use crate::world::World;

/// Returns the first reported conflicts and the request's final event.
fn conflicts_and_end(events: &[Event]) -> (Vec<String>, Option<&Event>) {
    let conflicts = events.iter().find_map(|event| match event {
        Event::Refused { conflicts, .. } => Some(conflicts.iter().map(|one| one.message.clone()).collect()),
        _ => None,
    });
    (conflicts.unwrap_or_default(), events.last())
}

#[test]
fn image_is_shown_despite_conflict() {
    let mut bench = Bench::new(SCENE);
    let (good, report) = (bench.path("good.png"), bench.path("r.json"));
    bench.overrides.outputs = vec![good.clone(), bench.path("skin.ppm")];
    bench.overrides.report = Some(report.clone());
    bench.preview = Some(PreviewBounds { width: 12, height: 12, around: None });
    bench.writing = WriteRequirement::Try;
    let of = bench.send();
    let events = bench.until_end(of);
    let (conflicts, end) = conflicts_and_end(&events);
    assert!(conflicts.len() == 1 && conflicts[0].contains("texture `skin`"), "{conflicts:?}");
    let is_refusal = |event: &Event| matches!(event, Event::Refused { .. });
    let shown = events.iter().position(|event| matches!(event, Event::Preview { .. })).expect("a preview");
    assert!(
        events.iter().position(is_refusal).expect("a refusal") < shown,
        "the conflict should be reported before rendering"
    );
    assert_eq!(events.iter().filter(|event| is_refusal(event)).count(), 1, "once");
    let Some(Event::Done { report: made, warnings, .. }) = end else { panic!("{end:?}") };
    assert_eq!((made.image.path.as_deref(), made.image.complete), (None, true));
    assert_eq!(made.stages[Stage::Write as usize].status, StageStatus::Skipped);
    assert!(
        warnings.iter().any(|one| one.message == conflicts[0]),
        "the conflict should still be reported at the end"
    );
    bench.worker.send(Command::Write);
    assert!(matches!(bench.next(), Event::Refused { .. }), "a write order should also be refused");
    assert!(!good.exists() && !report.exists(), "nothing should be written");
    // An edit resolves the conflict.
    bench.edit("[textures.skin]\nfile = \"skin.ppm\"\n", "");
    bench.edit("{ texture = \"skin\" }", "[0.5, 0.5, 0.5]");
    let of = bench.send();
    let events = bench.until_end(of);
    assert!(conflicts_and_end(&events).0.is_empty());
    assert!(good.exists() && report.exists(), "{events:?}");
}

#[test]
fn material_files_are_checked_before_rendering() {
    let mut bench = Bench::new(SCENE);
    bench.write("mtl.json", "newmtl a\nmap_d alpha.ppm\n");
    bench.write("one.obj", &format!("mtllib mtl.json\n{OBJ}"));
    // The check applies even if files not written by glimt may be replaced.
    bench.overrides.replaces_foreign = true;
    for (name, role) in [("mtl.json", "a material file"), ("alpha.ppm", "an image")] {
        bench.overrides.report = Some(bench.path(name));
        let of = bench.send();
        let events = bench.until_end(of);
        let Some(Event::Failed { failure: Failure::Scene(errors), .. }) = events.last() else {
            panic!("{name}")
        };
        assert!(errors[0].message.contains(role), "{name}: {errors:?}");
        assert!(
            !events.iter().any(|event| matches!(event, Event::Progress { .. })),
            "nothing should be rendered"
        );
    }
    assert!(!bench.path("alpha.ppm").exists());
}

#[test]
fn watched_files_cannot_be_written() {
    let mut bench = Bench::new(SCENE);
    bench.write("one.obj", &format!("mtllib one.mtl gone.mtl\n{OBJ}"));
    bench.write("one.mtl", "newmtl a\n");
    let of = bench.send();
    let events = bench.until_end(of);
    let files = events.iter().rev().find_map(|event| match event {
        Event::Files { files, .. } => Some(files.clone()),
        _ => None,
    });
    let files = files.expect("files");
    assert_eq!(files.len(), 5, "{files:?}");
    for file in files {
        assert!(FileIdentity::from_existing_or_new_path(&file.path).is_some(), "{file:?}");
        bench.overrides.report = Some(file.path.clone());
        assert!(matches!(bench.failed(), Failure::Scene(_)), "{file:?}");
    }
    // Files referenced by a broken scene are watched, so the last valid scene must not be written to them.
    bench.overrides.report = None;
    bench.overrides.outputs = vec![bench.path("later.ppm")];
    bench.done();
    fs::remove_file(bench.path("later.ppm")).expect("removed");
    bench.edit("skin.ppm", "later.ppm");
    bench.failed();
    assert!(matches!(bench.next(), Event::LastGoodEnded { .. }));
    bench.worker.send(Command::Write);
    assert!(matches!(bench.next(), Event::Refused { .. }));
    assert!(!bench.path("later.ppm").exists());
}

static LINK: std::sync::Mutex<Option<PathBuf>> = std::sync::Mutex::new(None);
static IS_LINKED: AtomicBool = AtomicBool::new(false);

/// Replaces the link with a link to the texture during the first tile.
fn relinks(
    photons: Option<&PhotonPassesBySample>,
    world: &World,
    settings: &RenderSettings,
    pixels: SelectedPixels,
    samples: Range<u32>,
    token: &CancelToken,
) -> Result<(TileSamples, RayCounters), Canceled> {
    if let Some(link) = LINK.lock().expect("not poisoned").as_ref()
        && !IS_LINKED.swap(true, Ordering::SeqCst)
    {
        fs::remove_file(link).expect("removed");
        symlink("skin.ppm", link).expect("a link");
    }
    KERNEL(photons, world, settings, pixels, samples, token)
}

#[test]
fn link_change_during_render_is_detected() {
    let mut bench = Bench::with(SCENE, relinks);
    let link = bench.path("out.ppm");
    symlink("elsewhere.ppm", &link).expect("a link");
    *LINK.lock().expect("not poisoned") = Some(link);
    let before = fs::read(bench.path("skin.ppm")).expect("a texture");
    let Failure::Scene(errors) = bench.failed() else { panic!("expected a conflict") };
    assert!(errors[0].message.contains("texture `skin`"), "{errors:?}");
    assert!(IS_LINKED.load(Ordering::SeqCst), "the link should change during the render");
    assert_eq!(fs::read(bench.path("skin.ppm")).expect("a texture"), before);
    assert!(!bench.path("elsewhere.ppm").exists());
}

#[test]
fn broken_scene_only_replaces_own_outputs() {
    let mut bench = Bench::new(SCENE);
    let output = bench.path("out.ppm");
    bench.done();
    bench.edit("\"skin.ppm\"", "\"out.ppm\"\nbogus = 1");
    assert!(matches!(bench.failed(), Failure::Scene(_)));
    assert!(matches!(bench.next(), Event::LastGoodEnded { .. }));
    bench.worker.send(Command::Write);
    assert!(matches!(bench.next(), Event::Written { .. }), "glimt's own output should be replaced");
    assert!(matches!(bench.next(), Event::WriteDone { .. }));
    fs::write(&output, "another image").expect("written");
    bench.worker.send(Command::Write);
    let Event::WriteFailed { message, .. } = bench.next() else { panic!("expected a refusal") };
    assert!(message.contains("out.ppm") && message.contains(crate::messages::SCENE_HAS_ERRORS), "{message}");
    assert_eq!(fs::read(&output).expect("the output file"), b"another image");
    // A missing file may be written.
    fs::remove_file(&output).expect("removed");
    bench.worker.send(Command::Write);
    assert!(matches!(bench.next(), Event::Written { .. }));
}

#[test]
fn checkpoint_does_not_replace_finished_part() {
    let mut bench = Bench::new(SCENE);
    let (out, part) = (bench.path("out"), bench.path("out.checkpoint"));
    bench.overrides.shard = Some((2, 2));
    bench.overrides.outputs = vec![part.clone()];
    bench.done();
    let before = fs::read(&part).expect("a part");
    bench.overrides.shard = Some((1, 2));
    bench.overrides.outputs = vec![out.clone()];
    bench.overrides.checkpoints =
        CheckpointSettings { seconds: 1e-9, are_kept: true, ..CheckpointSettings::default() };
    let of = bench.send();
    let events = bench.until_end(of);
    assert_eq!(fs::read(&part).expect("a part"), before);
    assert!(matches!(events.last(), Some(Event::Done { .. })) && out.exists());
    let failed = events.iter().find_map(|event| match event {
        Event::Checkpoint { news: CheckpointUpdate::Failed { message }, .. } => Some(message),
        _ => None,
    });
    assert!(failed.is_some_and(|message| message.contains("out.checkpoint")), "{failed:?}");
}

#[test]
fn report_cannot_replace_a_checkpoint() {
    let mut bench = Bench::with(SCENE, unused);
    bench.overrides.report = Some(bench.path("out.ppm.checkpoint"));
    let Failure::Scene(errors) = bench.failed() else { panic!("expected a conflict") };
    assert!(errors[0].message.contains("out.ppm.checkpoint"), "{errors:?}");
}

#[test]
fn unwritable_later_frame_fails_before_rendering() {
    let mut bench = Bench::with(SCENE, unused);
    bench.overrides.outputs = vec![bench.path("a_##.ppm")];
    bench.overrides.turn = Some(TurntableFrame { number: 0, of: 12 });
    fs::create_dir(bench.path("a_09.ppm")).expect("a folder");
    let Failure::Work(message) = bench.failed() else { panic!("expected an output error") };
    assert!(message.contains("a_09.ppm") && message.contains("directory"), "{message}");
}

/// Panics when called. For tests that must not start rendering.
fn unused(
    _: Option<&PhotonPassesBySample>,
    _: &World,
    _: &RenderSettings,
    _: SelectedPixels,
    _: Range<u32>,
    _: &CancelToken,
) -> Result<(TileSamples, RayCounters), Canceled> {
    panic!("rendering should not start");
}
