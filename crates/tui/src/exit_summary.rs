//! The summary printed after the terminal is restored.

use super::event::WriteFailure;
use super::messages;
use super::state::{KeyboardOverrides, RequestStatus, SceneImageRenderProgress, State, WrittenImageFile};
use super::view::text::format_count_with_noun;
use crate::choice::Choice;
use crate::pipeline::protocol::{Report, SampleCounts, SavedSceneRenderStatus};
use crate::pipeline::settings::{CameraOverrides, ViewMode};
use crate::pipeline::words::format_seconds;
use crate::scene::sanitize::escape_invisible_chars;

/// Lists the written files with their sample counts and render times, followed by later events.
pub(super) fn summary_text(state: &State) -> String {
    match &state.saving.write_failed {
        Some(failed) => describe_write_failure(state, failed),
        None if state.saving.written.is_empty() => reason_no_image_was_written(state),
        None => describe_files(&state.saving.written) + &describe_events_since_writing(state),
    }
}

/// Whether the summary claims that the scene's own image is up to date.
pub(super) fn is_saved_scene_image_current(state: &State) -> bool {
    let is_written = state.saving.own.state == SavedSceneRenderStatus::Written;
    is_written && state.saving.write_failed.is_none() && !state.is_scene_broken()
}

/// Changes that were made with keys and saved neither to the scene nor in an image, formatted as command-line
/// options.
pub(super) fn unsaved_changes_as_options(state: &State) -> Option<String> {
    let shown = state.request.toggles;
    let is_in_file = state.saving.written.iter().any(|written| written.shows == Some(shown));
    let is_in_scene = state.saving.camera_of_model.is_some()
        && state.saving.camera_of_model == state.request.current_camera();
    let camera = if is_in_scene { CameraOverrides::default() } else { shown.camera };
    let has_orbiter = state.request.text.as_ref().is_some_and(|text| text.contains("orbiter"));
    let options = KeyboardOverrides { camera, ..shown }
        .as_command_line_options(state.request.current_camera().filter(|_| has_orbiter));
    (!options.is_empty() && !is_in_file).then(|| format!("not kept: {}", options.join(" ")))
}

/// Names of the image's output files, or `None` until the scene has been read.
pub(super) fn output_file_names(state: &State) -> Option<String> {
    let outputs = &state.request.effective.as_ref()?.outputs;
    let names: Vec<_> =
        outputs.iter().map(|path| escape_invisible_chars(&path.to_string_lossy()).into_owned()).collect();
    (!names.is_empty()).then(|| names.join(", "))
}

/// Explains why this run has not written an image.
fn reason_no_image_was_written(state: &State) -> String {
    if state.is_scene_broken() {
        return format!("no image written; {} has errors", scene_name(state));
    }
    let Some(name) = output_file_names(state) else { return "no image written".to_owned() };
    match state.saving.own {
        SceneImageRenderProgress { state: SavedSceneRenderStatus::Written, .. } => {
            format!("{name} is up to date")
        }
        SceneImageRenderProgress { fraction, .. } if fraction > 0.0 => {
            format!("{name} not finished ({} %)", (fraction * 100.0).floor())
        }
        SceneImageRenderProgress { .. } => format!("{name} not finished"),
    }
}

/// Name for the render that started after the files were written.
const NEXT_RENDER: &str = "the next render";

/// Describes what has happened since the files were written.
fn describe_events_since_writing(state: &State) -> String {
    if state.is_scene_broken() {
        return format!("; {} has errors since", scene_name(state));
    }
    let written = &state.saving.written;
    if state.saving.own.state == SavedSceneRenderStatus::Written {
        return String::new();
    }
    if !state.request.has_no_keyboard_overrides() {
        let is_user_written = written.iter().any(|written| written.shows.is_some());
        return match state.saving.own {
            SceneImageRenderProgress { .. } if state.saving.are_images_older_than_scene() => {
                messages::OLDER_THAN_EDIT.to_owned()
            }
            SceneImageRenderProgress { .. } if is_user_written => String::new(),
            SceneImageRenderProgress { fraction, .. } => {
                format!("; {NEXT_RENDER} is not finished ({:.0} %)", (fraction * 100.0).floor())
            }
        };
    }
    let is_after = written.iter().any(|written| written.generation != state.request.generation);
    let next = if is_after { NEXT_RENDER } else { "the render" };
    match (state.work.activity, &state.work.progress) {
        (RequestStatus::Running { .. } | RequestStatus::Canceled, Some(progress)) => {
            format!("; {next} was stopped at {:.0} %", (progress.fraction * 100.0).floor())
        }
        (RequestStatus::Running { .. } | RequestStatus::Canceled, None) => format!("; {next} was stopped"),
        (RequestStatus::Done | RequestStatus::Waiting | RequestStatus::Broken, _) => String::new(),
    }
}

fn scene_name(state: &State) -> String {
    let name = state.request.scene.file_name().unwrap_or_default().to_string_lossy();
    escape_invisible_chars(&name).into_owned()
}

/// Lists the written files and their descriptions, grouped by image.
fn describe_files(written: &[WrittenImageFile]) -> String {
    let alike = written.chunk_by(|one, next| one.made == next.made && one.shows == next.shows);
    let said: Vec<String> = alike
        .map(|files| {
            let names: Vec<_> = files.iter().map(WrittenImageFile::escaped_path).collect();
            let made = files.first().map_or("", |it| &it.made);
            let colon = if made.is_empty() { "" } else { ": " };
            let shows = files.first().and_then(|it| it.shows).unwrap_or_default();
            let changes = KeyboardOverrides { view: None, ..shows }
                .describe_changes_since(&KeyboardOverrides::default(), false)
                .join(", ");
            let with = if changes.is_empty() { String::new() } else { format!(", with {changes}") };
            format!("wrote {}{colon}{made}{with}", names.join(", "))
        })
        .collect();
    said.join("; ")
}

/// Explains why an image could not be written, and lists other files written for this and earlier images.
fn describe_write_failure(state: &State, failed: &WriteFailure) -> String {
    let mut words = format!("not written: {}", escape_invisible_chars(&failed.why));
    for written in &state.saving.written {
        let is_new = written.generation >= failed.generation;
        words += match (is_new, written.is_stale) {
            (true, false) => "; wrote ",
            (true, true) => "; before that, wrote ",
            (false, _) => "; wrote an earlier image to ",
        };
        words += &written.escaped_path();
    }
    words
}

/// Describes an image and its render time. If the samples were reused, the time is the original render's.
pub(super) fn describe_image(report: &Report, shown: ViewMode) -> String {
    let image = &report.image;
    let time = format_seconds(report.seconds.max(image.render_seconds));
    let samples = format_sample_count_or_range(image.samples);
    format!("{}{}×{}, {samples}, {time}", view_mode_prefix(shown), image.width, image.height)
}

/// Describes an image that was written before its render finished.
pub(super) fn describe_unfinished_image(samples: SampleCounts, shown: ViewMode) -> String {
    format!("{}unfinished ({})", view_mode_prefix(shown), format_sample_count_or_range(samples))
}

/// Formats a sample count as in `64 samples`, or a range as in `16 to 32 samples`.
fn format_sample_count_or_range(SampleCounts { min, max, .. }: SampleCounts) -> String {
    let most = format_count_with_noun(max as usize, "sample");
    if min == max { most } else { format!("{min} to {most}") }
}

fn view_mode_prefix(view: ViewMode) -> String {
    let view = view_name_unless_beauty(view);
    if view.is_empty() { view } else { format!("{view}, ") }
}

/// The view's name, or an empty string for the beauty view.
pub(super) fn view_name_unless_beauty(view: ViewMode) -> String {
    if view == ViewMode::Beauty { String::new() } else { format!("view {}", view.name()) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ContentChangeTime;
    use crate::fixtures::{TestUi, diagnostic, done_event, render_progress, written_event};
    use crate::pipeline::protocol::{Event, Failure, Stage, StageStatus};
    use crate::scene::description::Camera;
    use crate::scene::diagnostic::Severity;

    /// Creates the event for a finished request with a modified report.
    fn done_with(generation: u64, change: impl FnOnce(&mut Report)) -> Event {
        let Event::Done { mut report, warnings, unchanged, .. } = done_event(generation, Vec::new(), false)
        else {
            panic!("a finished request")
        };
        change(&mut report);
        Event::Done { generation, report, warnings, unchanged }
    }

    #[test]
    fn file_written_during_newer_request_is_listed() {
        let mut ui = TestUi::new();
        ui.finish_render([200, 30, 30]);
        ui.press_character('r');
        let begun = ui.state.request.generation;
        ui.worker_event(Event::Started { generation: begun });
        ui.worker_event(Event::Progress { generation: begun, progress: render_progress(0.5, None) });
        ui.press_character('l');
        ui.worker_event(written_event(begun, "big.png", true));
        assert!(
            summary_text(&ui.state).starts_with(&format!("wrote big.png; {NEXT_RENDER}")),
            "{}",
            summary_text(&ui.state)
        );
        ui.worker_event(done_event(begun, Vec::new(), false));
        ui.finish_render([30, 30, 200]);
        let made = "wrote big.png: 640×480, 64 samples, 1.93 s";
        assert_eq!(summary_text(&ui.state), format!("{made}; {NEXT_RENDER} is not finished (50 %)"));
        assert!(
            ui.screen_text().contains(messages::NOT_SAVED),
            "expected an unsaved image: {}",
            ui.screen_text()
        );
    }

    #[test]
    fn summary_shows_the_written_images_render_time() {
        let mut ui = TestUi::new();
        let write = |ui: &mut TestUi, seconds: f64, rendered: f64| {
            let generation = ui.state.request.generation;
            ui.worker_event(Event::Started { generation });
            ui.worker_event(written_event(generation, "dof.png", true));
            ui.worker_event(done_with(generation, |report| {
                (report.seconds, report.image.render_seconds) = (seconds, rendered);
            }));
        };
        write(&mut ui, 2.02, 2.0);
        ui.press_character('r');
        write(&mut ui, 1.02, 1.0);
        ui.press_character('r');
        write(&mut ui, 0.05, 2.0);
        assert_eq!(summary_text(&ui.state), "wrote dof.png: 640×480, 64 samples, 2.00 s");
    }

    #[test]
    fn written_view_is_named() {
        let mut ui = TestUi::new();
        ui.worker_event(written_event(1, "a.png", true));
        ui.finish_render([200, 30, 30]);
        let own = summary_text(&ui.state);
        ui.press_character('v');
        let generation = ui.state.request.generation;
        ui.worker_event(Event::Started { generation });
        ui.worker_event(done_with(generation, |report| {
            (report.settings.view, report.seconds, report.image.render_seconds) =
                (ViewMode::Normal, 0.5, 0.4);
            report.stages[Stage::Render as usize].seconds = 0.4;
            (report.image.path, report.image.paths) = (None, Vec::new());
        }));
        assert_eq!(summary_text(&ui.state), own, "the file should not be written again");
        ui.press_character('w');
        ui.worker_event(written_event(generation, "a.png", false));
        assert_eq!(summary_text(&ui.state), "wrote a.png: view normal, 640×480, 64 samples, 500 ms");
    }

    #[test]
    fn unwritten_edit_is_not_reported_as_written() {
        let made = "wrote a.png: 640×480, 64 samples, 1.93 s";
        for key in ['v', 'l'] {
            let mut ui = TestUi::new();
            ui.worker_event(written_event(1, "a.png", true));
            ui.finish_render([200, 30, 30]);
            ui.press_character(key);
            ui.finish_render([200, 30, 30]);
            let before = summary_text(&ui.state);
            assert!(before.starts_with(made) && !before.contains("save"), "{key}: {before}");
            ui.handle_event(crate::event::Event::FileChanged(ContentChangeTime { noticed: ui.now }));
            ui.finish_render([30, 30, 200]);
            let after = summary_text(&ui.state);
            assert_eq!(after, format!("{made}{}", messages::OLDER_THAN_EDIT), "{key}");
            assert_eq!(
                unsaved_changes_as_options(&ui.state).is_some_and(|it| it.contains("camera.position")),
                key == 'l'
            );
            // Saving the file without changing the image does not make the image newer.
            ui.handle_event(crate::event::Event::FileChanged(ContentChangeTime { noticed: ui.now }));
            let generation = ui.state.request.generation;
            ui.worker_event(Event::Started { generation });
            ui.worker_event(done_event(generation, Vec::new(), true));
            assert_eq!(summary_text(&ui.state), after);
        }
    }

    #[test]
    fn write_failure_is_reported_until_fixed() {
        let mut ui = TestUi::new();
        let fail = |ui: &mut TestUi| {
            let generation = ui.state.request.generation;
            ui.worker_event(Event::Started { generation });
            ui.worker_event(Event::WriteFailed {
                path: None,
                generation,
                message: "cannot write a.png: no space".to_owned(),
            });
            ui.worker_event(finished(generation, StageStatus::Skipped));
        };
        fail(&mut ui);
        let failed = "not written: cannot write a.png: no space";
        for key in ['l', 'v', '?'] {
            ui.press_character(key);
            let generation = ui.state.request.generation;
            ui.worker_event(Event::Started { generation });
            assert!(summary_text(&ui.state).starts_with(failed), "{key}");
            ui.worker_event(finished(generation, StageStatus::Skipped));
            assert!(summary_text(&ui.state).starts_with(failed), "{key}");
        }
        // Return to the scene's own image after freeing disk space or writing the image.
        ui.press_character('0');
        for status in [StageStatus::Done, StageStatus::Reused] {
            fail(&mut ui);
            assert_eq!(summary_text(&ui.state), failed);
            ui.press_character('r');
            let generation = ui.state.request.generation;
            ui.worker_event(Event::Started { generation });
            ui.worker_event(finished(generation, status));
            assert!(ui.state.saving.write_failed.is_none(), "{status:?}");
        }
    }

    /// A finished request whose write stage has this status.
    fn finished(generation: u64, write: StageStatus) -> Event {
        let mut event = done_event(generation, Vec::new(), false);
        if let Event::Done { report, .. } = &mut event {
            report.stages[Stage::Write as usize].status = write;
        }
        event
    }

    #[test]
    fn summary_lists_written_and_missing_images() {
        let mut ui = TestUi::new();
        assert_eq!(summary_text(&ui.state), "no image written");
        ui.report_scene_read();
        assert_eq!(summary_text(&ui.state), "cornell.png not finished");
        ui.worker_event(Event::Progress { generation: 1, progress: render_progress(0.388, None) });
        assert_eq!(summary_text(&ui.state), "cornell.png not finished (38 %)");
        ui.worker_event(written_event(1, "cornell.png", true));
        ui.worker_event(done_event(1, Vec::new(), false));
        let made = "wrote cornell.png: 640×480, 64 samples, 1.93 s";
        assert_eq!(summary_text(&ui.state), made);
        ui.press_character('r');
        ui.worker_event(Event::Started { generation: 2 });
        ui.worker_event(done_event(2, Vec::new(), true));
        assert_eq!(summary_text(&ui.state), made, "no new render was started");
        ui.press_character('r');
        ui.worker_event(Event::Started { generation: 3 });
        ui.worker_event(Event::Progress { generation: 3, progress: render_progress(0.5, None) });
        assert_eq!(summary_text(&ui.state), format!("{made}; {NEXT_RENDER} was stopped at 50 %"));
        ui.worker_event(Event::WriteFailed {
            generation: 3,
            path: None,
            message: "cannot write b.exr: no space".to_owned(),
        });
        ui.worker_event(written_event(3, "a.png", true));
        ui.worker_event(done_event(3, Vec::new(), false));
        let failed =
            "not written: cannot write b.exr: no space; wrote an earlier image to cornell.png; wrote a.png";
        assert_eq!(summary_text(&ui.state), failed);
        ui.press_character('r');
        ui.worker_event(Event::Started { generation: 4 });
        ui.worker_event(written_event(4, "a.png", true));
        ui.worker_event(done_event(4, Vec::new(), false));
        let made = "wrote cornell.png, a.png: 640×480, 64 samples, 1.93 s";
        assert_eq!(summary_text(&ui.state), made);
        ui.report_scene_errors(vec![diagnostic(Severity::Error, "wrong")]);
        assert_eq!(summary_text(&ui.state), format!("{made}; cornell.toml has errors since"));
    }

    #[test]
    fn failed_render_does_not_blame_the_scene() {
        let mut ui = TestUi::new();
        let failure = Failure::Work("no memory".to_owned());
        ui.worker_event(Event::Failed { generation: 1, failure });
        let summary = summary_text(&ui.state);
        assert!(!summary.contains("has errors"), "{summary}");
        ui.report_scene_errors(vec![diagnostic(Severity::Error, "wrong")]);
        assert_eq!(summary_text(&ui.state), "no image written; cornell.toml has errors");
    }

    #[test]
    fn unsaved_changes_are_listed_as_options() {
        let mut ui = TestUi::new();
        ui.finish_render([200, 30, 30]);
        assert_eq!(unsaved_changes_as_options(&ui.state), None);
        for key in ['s', 'i', 'd', ']', '<', 'v'] {
            ui.press_character(key);
            ui.finish_render([200, 30, 30]);
        }
        let options = "not kept: --integrator path --shadows hard --dof off --view normal \
                       --set render.exposure=0.25 --set camera.fov=38.1";
        assert_eq!(unsaved_changes_as_options(&ui.state).as_deref(), Some(options));
        ui.press_character('w');
        let generation = ui.state.request.generation;
        ui.worker_event(written_event(generation, "a.png", false));
        assert_eq!(unsaved_changes_as_options(&ui.state), None, "the written image includes the changes");
        ui.press_key(crate::event::KeyPress::special(crossterm::event::KeyCode::Esc));
        ui.press_character('l');
        ui.finish_render([200, 30, 30]);
        let words = unsaved_changes_as_options(&ui.state).expect("the camera moved");
        assert!(words.contains("--set 'camera.position=["), "{words}");
        ui.press_character('0');
        assert_eq!(unsaved_changes_as_options(&ui.state), None);
    }

    #[test]
    fn orbited_camera_is_listed_as_options() {
        let text = "[camera]\norbiter = 'a.txt'\naperture = 0.1\n";
        let mut ui = TestUi::new();
        ui.finish_render([200, 30, 30]);
        ui.state.request.text = Some(text.into());
        ui.state.request.own.as_mut().expect("a scene").camera.aperture = 0.1;
        ui.press_character('l');
        let moved = ui.state.request.current_camera().expect("a camera");
        let words = unsaved_changes_as_options(&ui.state).expect("moved");
        let sets = words.split("--set ").skip(1).map(|set| set.trim().replace('\'', ""));
        let sets: Vec<String> = sets.collect();
        let camera = crate::scene::LoadedScene::parse_camera_from_text(text, &sets);
        let Some(Camera::LookAt { position, look_at, projection, focus, .. }) = camera else {
            panic!("{words}")
        };
        assert_eq!((position, look_at), (moved.pose.position, moved.pose.look_at));
        assert_eq!((projection, focus), (moved.projection, moved.focus));
    }

    #[test]
    fn revisited_scene_image_stays_finished() {
        let made = "wrote cornell.png: 640×480, 64 samples, 1.93 s";
        let mut ui = TestUi::new();
        ui.worker_event(Event::Started { generation: 1 });
        ui.worker_event(written_event(1, "cornell.png", true));
        ui.finish_render([200, 30, 30]);
        ui.press_character('s');
        ui.finish_render([30, 200, 30]);
        // The next key is pressed before the request is done.
        ui.press_character('0');
        ui.worker_event(Event::Started { generation: ui.state.request.generation });
        assert_eq!(summary_text(&ui.state), made);
        ui.press_character(']');
        assert_eq!(summary_text(&ui.state), made);
        // A new version of the image is being rendered.
        ui.press_character('0');
        let generation = ui.state.request.generation;
        ui.worker_event(Event::Started { generation });
        ui.worker_event(Event::Progress { generation, progress: render_progress(0.2, None) });
        assert_eq!(summary_text(&ui.state), format!("{made}; {NEXT_RENDER} was stopped at 20 %"));
        ui.press_character(']');
        assert_eq!(summary_text(&ui.state), format!("{made}; {NEXT_RENDER} is not finished (20 %)"));
    }

    #[test]
    fn scene_image_state_survives_key_changes() {
        let mut ui = TestUi::new();
        let own = |ui: &mut TestUi, state| {
            let generation = ui.state.request.generation;
            ui.worker_event(Event::OwnImage { generation, state });
        };
        ui.report_scene_read();
        ui.worker_event(Event::Progress { generation: 1, progress: render_progress(0.108, None) });
        ui.press_character('s');
        own(&mut ui, SavedSceneRenderStatus::Begun { is_rendering: false });
        ui.finish_render([200, 30, 30]);
        assert_eq!(summary_text(&ui.state), "cornell.png not finished (10 %)");
        let said = crate::view::status_line::unsaved_image_messages(&ui.state);
        assert_eq!(
            said,
            [messages::NOT_SAVED.to_owned(), messages::scene_image_render_interrupted("cornell.png", 10)]
        );
        assert!(ui.screen_text().contains(messages::NOT_SAVED), "{}", ui.screen_text());
        // `w` writes the displayed image.
        ui.press_character('w');
        let generation = ui.state.request.generation;
        ui.worker_event(written_event(generation, "cornell.png", false));
        let made = "wrote cornell.png: 640×480, 64 samples, 1.93 s, with shadows hard";
        assert_eq!(summary_text(&ui.state), made);
        assert!(ui.screen_text().contains("→ cornell.png"), "{}", ui.screen_text());
        // Return to the scene's own image, which has not been written yet.
        ui.press_character('0');
        ui.worker_event(Event::Started { generation: ui.state.request.generation });
        assert!(summary_text(&ui.state).starts_with(&format!("{made}; {NEXT_RENDER}")));
        let generation = ui.state.request.generation;
        ui.worker_event(written_event(generation, "cornell.png", true));
        ui.finish_render([30, 200, 30]);
        assert_eq!(summary_text(&ui.state), "wrote cornell.png: 640×480, 64 samples, 1.93 s");
        ui.press_character('s');
        own(&mut ui, SavedSceneRenderStatus::Written);
        assert_eq!(summary_text(&ui.state), "wrote cornell.png: 640×480, 64 samples, 1.93 s");
        ui.handle_event(crate::event::Event::FileChanged(ContentChangeTime { noticed: ui.now }));
        assert!(summary_text(&ui.state).ends_with(messages::OLDER_THAN_EDIT), "{}", summary_text(&ui.state));
    }
}
