//! The line that stays when the screen is given back.

use super::event::Unwritten;
use super::state::{Activity, OwnImage, State, Toggles, Written};
use crate::choice::Choice;
use crate::pipeline::protocol::{OwnState, Report};
use crate::pipeline::settings::{CameraChange, View};
use crate::pipeline::words::seconds;
use crate::scene::sanitize::visible;

/// The files written, with their samples and seconds, and what happened after that.
pub(super) fn words(state: &State) -> String {
    match &state.saving.write_failed {
        Some(failed) => unwritten(state, failed),
        None if state.saving.written.is_empty() => unfinished(state),
        None => files(&state.saving.written) + &since(state),
    }
}

/// Changes by keys that are neither in the scene nor in an image, as options of the next call.
pub(super) fn not_kept(state: &State) -> Option<String> {
    let shown = state.request.toggles;
    let is_in_file = state.saving.written.iter().any(|written| written.shows == Some(shown));
    let is_in_scene =
        state.saving.camera_of_model.is_some() && state.saving.camera_of_model == state.request.viewpoint();
    let camera = if is_in_scene { CameraChange::default() } else { shown.camera };
    let has_orbiter = state.request.text.as_ref().is_some_and(|text| text.contains("orbiter"));
    let options = Toggles { camera, ..shown }.options(has_orbiter);
    (!options.is_empty() && !is_in_file).then(|| format!("not kept: {}", options.join(" ")))
}

/// Names of the image's files. `None` until the scene has been read.
pub(super) fn image_name(state: &State) -> Option<String> {
    let outputs = &state.request.effective.as_ref()?.outputs;
    let names: Vec<_> = outputs.iter().map(|path| visible(&path.to_string_lossy()).into_owned()).collect();
    (!names.is_empty()).then(|| names.join(", "))
}

/// Why this run has written no image.
fn unfinished(state: &State) -> String {
    if is_broken(state) {
        return format!("no image written; {} has errors", scene_name(state));
    }
    let Some(name) = image_name(state) else { return "no image written".to_owned() };
    match state.saving.own {
        OwnImage { state: OwnState::Written, .. } => format!("{name} is up to date"),
        OwnImage { fraction, .. } if fraction > 0.0 => {
            format!("{name} not finished ({} %)", (fraction * 100.0).floor())
        }
        OwnImage { .. } => format!("{name} not finished"),
    }
}

/// Events after the files were written.
fn since(state: &State) -> String {
    if is_broken(state) {
        return format!("; {} has errors since", scene_name(state));
    }
    let written = &state.saving.written;
    let is_older = written.iter().all(|written| written.generation < state.saving.saved_at);
    if state.saving.own.state == OwnState::Written {
        return String::new();
    }
    if !state.request.is_own() {
        let is_by_hand = written.iter().any(|written| written.shows.is_some());
        return match state.saving.own {
            OwnImage { .. } if is_older => " (older than your last edit)".to_owned(),
            OwnImage { .. } if is_by_hand => String::new(),
            OwnImage { fraction, .. } => {
                format!("; the render after it is not finished ({:.0} %)", (fraction * 100.0).floor())
            }
        };
    }
    let is_after = written.iter().any(|written| written.generation != state.request.generation);
    let next = if is_after { "the render after it" } else { "the render" };
    match (state.work.activity, &state.work.progress) {
        (Activity::Running { .. } | Activity::Cancelled, Some(progress)) => {
            format!("; {next} was stopped at {:.0} %", (progress.fraction * 100.0).floor())
        }
        (Activity::Running { .. } | Activity::Cancelled, None) => format!("; {next} was stopped"),
        (Activity::Done | Activity::Waiting | Activity::Broken, _) => String::new(),
    }
}

fn is_broken(state: &State) -> bool {
    matches!(state.work.activity, Activity::Waiting | Activity::Broken)
}

fn scene_name(state: &State) -> String {
    let name = state.request.scene.file_name().unwrap_or_default().to_string_lossy();
    visible(&name).into_owned()
}

/// The files written and their descriptions, grouped by image.
fn files(written: &[Written]) -> String {
    let alike = written.chunk_by(|one, next| one.made == next.made && one.shows == next.shows);
    let said: Vec<String> = alike
        .map(|files| {
            let names: Vec<_> =
                files.iter().map(|it| visible(&it.path.to_string_lossy()).into_owned()).collect();
            let made = files.first().map_or("", |it| &it.made);
            let colon = if made.is_empty() { "" } else { ": " };
            let shows = files.first().and_then(|it| it.shows).unwrap_or_default();
            let changes = Toggles { view: None, ..shows }.differences(&Toggles::default(), false).join(", ");
            let with = if changes.is_empty() { String::new() } else { format!(", with {changes}") };
            format!("wrote {}{colon}{made}{with}", names.join(", "))
        })
        .collect();
    said.join("; ")
}

/// The picture that is not on disk, and why; and the other files written, of the same picture and of earlier ones.
fn unwritten(state: &State, failed: &Unwritten) -> String {
    let mut words = format!("not written: {}", visible(&failed.why));
    for written in &state.saving.written {
        let name = visible(&written.path.to_string_lossy()).into_owned();
        let is_new = written.generation >= failed.generation;
        words += match (is_new, written.is_stale) {
            (true, false) => "; wrote ",
            (true, true) => "; before that, wrote ",
            (false, _) => "; wrote an earlier one to ",
        };
        words += &name;
    }
    words
}

/// A picture and its cost, in words. A picture whose samples were there already had its cost before.
pub(super) fn made(report: &Report, shown: View) -> String {
    let image = &report.image;
    let time = seconds(report.seconds.max(image.render_seconds));
    let view = view(shown);
    let comma = if view.is_empty() { "" } else { ", " };
    let samples = if image.samples.min == image.samples.max {
        image.samples.max.to_string()
    } else {
        format!("{} to {}", image.samples.min, image.samples.max)
    };
    format!("{view}{comma}{}×{}, {samples} samples, {time}", image.width, image.height)
}

/// The view, unless it is beauty.
pub(super) fn view(view: View) -> String {
    if view == View::Beauty { String::new() } else { format!("view {}", view.name()) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Changed;
    use crate::fixtures::{Desk, diagnostic, done, progress};
    use crate::pipeline::protocol::{Event, Stage, Status};
    use crate::scene::diagnostic::Severity;

    /// The report of a request, changed.
    fn done_as(generation: u64, change: impl FnOnce(&mut Report)) -> Event {
        let Event::Done { mut report, warnings, unchanged, .. } = done(generation, Vec::new(), false) else {
            panic!("it is done")
        };
        change(&mut report);
        Event::Done { generation, report, warnings, unchanged }
    }

    #[test]
    fn a_picture_that_is_written_while_a_newer_one_is_asked_for_is_named() {
        let mut desk = Desk::new();
        desk.finish([200, 30, 30]);
        desk.press('r');
        let begun = desk.state.request.generation;
        desk.worker(Event::Started { generation: begun });
        desk.worker(Event::Progress { generation: begun, progress: progress(0.5, None) });
        desk.press('l');
        desk.worker(Event::Written { generation: begun, path: "big.png".into(), bytes: 1, is_own: true });
        assert!(
            words(&desk.state).starts_with("wrote big.png; the render after it"),
            "{}",
            words(&desk.state)
        );
        desk.worker(done(begun, Vec::new(), false));
        desk.finish([30, 30, 200]);
        let made = "wrote big.png: 640×480, 64 samples, 1.93 s";
        assert_eq!(words(&desk.state), format!("{made}; the render after it is not finished (50 %)"));
        assert!(desk.text().contains("not saved · w saves it"), "of the one at hand: {}", desk.text());
    }

    #[test]
    fn the_seconds_are_those_of_the_picture_in_the_file() {
        let mut desk = Desk::new();
        let write = |desk: &mut Desk, seconds: f64, rendered: f64| {
            let generation = desk.state.request.generation;
            desk.worker(Event::Started { generation });
            desk.worker(Event::Written { generation, path: "dof.png".into(), bytes: 1, is_own: true });
            desk.worker(done_as(generation, |report| {
                (report.seconds, report.image.render_seconds) = (seconds, rendered);
            }));
        };
        write(&mut desk, 2.02, 2.0);
        desk.press('r');
        write(&mut desk, 1.02, 1.0);
        desk.press('r');
        write(&mut desk, 0.05, 2.0);
        assert_eq!(words(&desk.state), "wrote dof.png: 640×480, 64 samples, 2.00 s");
    }

    #[test]
    fn a_view_that_was_written_is_said_to_be_one() {
        let mut desk = Desk::new();
        desk.worker(Event::Written { generation: 1, path: "a.png".into(), bytes: 1, is_own: true });
        desk.finish([200, 30, 30]);
        let own = words(&desk.state);
        desk.press('v');
        let generation = desk.state.request.generation;
        desk.worker(Event::Started { generation });
        desk.worker(done_as(generation, |report| {
            (report.settings.view, report.seconds, report.image.render_seconds) = (View::Normal, 0.5, 0.4);
            report.stages[Stage::Render as usize].seconds = 0.4;
            (report.image.path, report.image.paths) = (None, Vec::new());
        }));
        assert_eq!(words(&desk.state), own, "that is what is written");
        desk.press('w');
        desk.worker(Event::Written { generation, path: "a.png".into(), bytes: 1, is_own: false });
        assert_eq!(words(&desk.state), "wrote a.png: view normal, 640×480, 64 samples, 500 ms");
    }

    #[test]
    fn a_save_that_is_only_shown_is_not_said_to_be_in_the_file() {
        let made = "wrote a.png: 640×480, 64 samples, 1.93 s";
        for key in ['v', 'l'] {
            let mut desk = Desk::new();
            desk.worker(Event::Written { generation: 1, path: "a.png".into(), bytes: 1, is_own: true });
            desk.finish([200, 30, 30]);
            desk.press(key);
            desk.finish([200, 30, 30]);
            let before = words(&desk.state);
            assert!(before.starts_with(made) && !before.contains("save"), "{key}: {before}");
            desk.event(crate::event::Event::Changed(Changed { noticed: desk.now }));
            desk.finish([30, 30, 200]);
            let after = words(&desk.state);
            assert_eq!(after, format!("{made} (older than your last edit)"), "{key}");
            assert_eq!(not_kept(&desk.state).is_some_and(|it| it.contains("camera.position")), key == 'l');
            // A save that changes nothing does not make it newer.
            desk.event(crate::event::Event::Changed(Changed { noticed: desk.now }));
            let generation = desk.state.request.generation;
            desk.worker(Event::Started { generation });
            desk.worker(done(generation, Vec::new(), true));
            assert_eq!(words(&desk.state), after);
        }
    }

    #[test]
    fn what_could_not_be_written_is_told_whatever_is_shown_since() {
        let mut desk = Desk::new();
        let fail = |desk: &mut Desk| {
            let generation = desk.state.request.generation;
            desk.worker(Event::Started { generation });
            desk.worker(Event::WriteFailed {
                path: None,
                generation,
                message: "cannot write a.png: no space".to_owned(),
            });
            desk.worker(finished(generation, Status::Skipped));
        };
        fail(&mut desk);
        let failed = "not written: cannot write a.png: no space";
        for key in ['l', 'v', '?'] {
            desk.press(key);
            let generation = desk.state.request.generation;
            desk.worker(Event::Started { generation });
            assert!(words(&desk.state).starts_with(failed), "{key}");
            desk.worker(finished(generation, Status::Skipped));
            assert!(words(&desk.state).starts_with(failed), "{key}");
        }
        // Back at the scene's own, where the disk has room or the picture of before.
        desk.press('0');
        for status in [Status::Done, Status::Reused] {
            fail(&mut desk);
            assert_eq!(words(&desk.state), failed);
            desk.press('r');
            let generation = desk.state.request.generation;
            desk.worker(Event::Started { generation });
            desk.worker(finished(generation, status));
            assert!(desk.state.saving.write_failed.is_none(), "{status:?}");
        }
    }

    /// A request that ends, with its last stage like this.
    fn finished(generation: u64, write: Status) -> Event {
        let mut event = done(generation, Vec::new(), false);
        if let Event::Done { report, .. } = &mut event {
            report.stages[Stage::Write as usize].status = write;
        }
        event
    }

    #[test]
    fn it_tells_what_was_written_and_what_was_not() {
        let mut desk = Desk::new();
        assert_eq!(words(&desk.state), "no image written");
        let settings = Box::new(crate::fixtures::settings());
        let (camera, own) = (crate::fixtures::camera(), crate::fixtures::own());
        desk.worker(Event::Settings { generation: 1, settings, camera, exposure: 0.0, own });
        assert_eq!(words(&desk.state), "cornell.png not finished");
        desk.worker(Event::Progress { generation: 1, progress: progress(0.388, None) });
        assert_eq!(words(&desk.state), "cornell.png not finished (38 %)");
        desk.worker(Event::Written { generation: 1, path: "cornell.png".into(), bytes: 1, is_own: true });
        desk.worker(done(1, Vec::new(), false));
        let made = "wrote cornell.png: 640×480, 64 samples, 1.93 s";
        assert_eq!(words(&desk.state), made);
        desk.press('r');
        desk.worker(Event::Started { generation: 2 });
        desk.worker(done(2, Vec::new(), true));
        assert_eq!(words(&desk.state), made, "nothing was rendered");
        desk.press('r');
        desk.worker(Event::Started { generation: 3 });
        desk.worker(Event::Progress { generation: 3, progress: progress(0.5, None) });
        assert_eq!(words(&desk.state), format!("{made}; the render after it was stopped at 50 %"));
        desk.worker(Event::WriteFailed {
            generation: 3,
            path: None,
            message: "cannot write b.exr: no space".to_owned(),
        });
        desk.worker(Event::Written { generation: 3, path: "a.png".into(), bytes: 1, is_own: true });
        desk.worker(done(3, Vec::new(), false));
        let failed =
            "not written: cannot write b.exr: no space; wrote an earlier one to cornell.png; wrote a.png";
        assert_eq!(words(&desk.state), failed);
        desk.press('r');
        desk.worker(Event::Started { generation: 4 });
        desk.worker(Event::Written { generation: 4, path: "a.png".into(), bytes: 1, is_own: true });
        desk.worker(done(4, Vec::new(), false));
        let made = "wrote cornell.png, a.png: 640×480, 64 samples, 1.93 s";
        assert_eq!(words(&desk.state), made);
        desk.fail(vec![diagnostic(Severity::Error, "wrong")]);
        assert_eq!(words(&desk.state), format!("{made}; cornell.toml has errors since"));
    }

    #[test]
    fn changes_by_keys_are_listed_as_options_until_they_are_kept_or_written() {
        let mut desk = Desk::new();
        desk.finish([200, 30, 30]);
        assert_eq!(not_kept(&desk.state), None);
        for key in ['s', 'i', 'd', ']', '<', 'v'] {
            desk.press(key);
            desk.finish([200, 30, 30]);
        }
        let options = "not kept: --integrator path --shadows hard --dof off --view normal \
                       --set render.exposure=0.25 --set camera.fov=38.1";
        assert_eq!(not_kept(&desk.state).as_deref(), Some(options));
        desk.press('w');
        let generation = desk.state.request.generation;
        desk.worker(Event::Written { generation, path: "a.png".into(), bytes: 1, is_own: false });
        assert_eq!(not_kept(&desk.state), None, "the image shows them");
        desk.key(crate::event::KeyPress::special(crossterm::event::KeyCode::Esc));
        desk.press('l');
        desk.finish([200, 30, 30]);
        let words = not_kept(&desk.state).expect("moved since");
        assert!(words.contains("--set 'camera.position=["), "{words}");
        desk.press('0');
        assert_eq!(not_kept(&desk.state), None);
    }

    #[test]
    fn passing_by_the_own_image_leaves_its_file_finished() {
        let made = "wrote cornell.png: 640×480, 64 samples, 1.93 s";
        let mut desk = Desk::new();
        desk.worker(Event::Started { generation: 1 });
        desk.worker(Event::Written { generation: 1, path: "cornell.png".into(), bytes: 1, is_own: true });
        desk.finish([200, 30, 30]);
        desk.press('s');
        desk.finish([30, 200, 30]);
        // The next key comes before the request of the own image ends.
        desk.press('0');
        desk.worker(Event::Started { generation: desk.state.request.generation });
        assert_eq!(words(&desk.state), made);
        desk.press(']');
        assert_eq!(words(&desk.state), made);
        // Samples of another own image.
        desk.press('0');
        let generation = desk.state.request.generation;
        desk.worker(Event::Started { generation });
        desk.worker(Event::Progress { generation, progress: progress(0.2, None) });
        assert_eq!(words(&desk.state), format!("{made}; the render after it was stopped at 20 %"));
        desk.press(']');
        assert_eq!(words(&desk.state), format!("{made}; the render after it is not finished (20 %)"));
    }

    #[test]
    fn the_own_image_is_told_while_keys_show_something_else() {
        let mut desk = Desk::new();
        let own = |desk: &mut Desk, state| {
            let generation = desk.state.request.generation;
            desk.worker(Event::OwnImage { generation, state });
        };
        desk.worker(Event::Started { generation: 1 });
        let settings = Box::new(crate::fixtures::settings());
        let (camera, own_settings) = (crate::fixtures::camera(), crate::fixtures::own());
        desk.worker(Event::Settings { generation: 1, settings, camera, exposure: 0.0, own: own_settings });
        desk.worker(Event::Progress { generation: 1, progress: progress(0.108, None) });
        desk.press('s');
        own(&mut desk, OwnState::Begun { is_rendering: false });
        desk.finish([200, 30, 30]);
        assert_eq!(words(&desk.state), "cornell.png not finished (10 %)");
        let said = crate::view::under::not_saved(&desk.state);
        assert_eq!(said, ["not saved · w saves it", "cornell.png at 10 %: 0 continues it"]);
        assert!(desk.text().contains("not saved · w saves it"), "{}", desk.text());
        // `w` writes what is shown.
        desk.press('w');
        let generation = desk.state.request.generation;
        desk.worker(Event::Written { generation, path: "cornell.png".into(), bytes: 1, is_own: false });
        let made = "wrote cornell.png: 640×480, 64 samples, 1.93 s, with shadows hard";
        assert_eq!(words(&desk.state), made);
        assert!(desk.text().contains("→ cornell.png"), "{}", desk.text());
        // Back at the scene's own image, the file does not show it yet.
        desk.press('0');
        desk.worker(Event::Started { generation: desk.state.request.generation });
        assert!(words(&desk.state).starts_with(&format!("{made}; the render after it was stopped")));
        let generation = desk.state.request.generation;
        desk.worker(Event::Written { generation, path: "cornell.png".into(), bytes: 1, is_own: true });
        desk.finish([30, 200, 30]);
        assert_eq!(words(&desk.state), "wrote cornell.png: 640×480, 64 samples, 1.93 s");
        desk.press('s');
        own(&mut desk, OwnState::Written);
        assert_eq!(words(&desk.state), "wrote cornell.png: 640×480, 64 samples, 1.93 s");
        desk.event(crate::event::Event::Changed(Changed { noticed: desk.now }));
        assert!(words(&desk.state).ends_with(" (older than your last edit)"), "{}", words(&desk.state));
    }
}
