//! The line that stays when the screen is given back.

use super::event::{Unwritten, Written};
use super::state::{Activity, State};
use crate::choice::Choice;
use crate::pipeline::protocol::Report;
use crate::pipeline::settings::View;
use crate::pipeline::words::seconds;
use crate::scene::sanitize::visible;

/// The files written, with their samples and seconds; events after them; and changes that are discarded.
pub(super) fn words(state: &State) -> String {
    let files = match &state.saving.write_failed {
        Some(failed) => unwritten(state, failed),
        None => files(&state.saving.written) + &since(state),
    };
    let is_kept =
        state.saving.camera_of_model.is_some() && state.saving.camera_of_model == state.request.viewpoint();
    let is_discarded = state.request.toggles.camera.is_any() && !is_kept;
    let not_kept = if is_discarded { "; camera changes discarded" } else { "" };
    files + not_kept
}

/// Events after the files were written.
fn since(state: &State) -> String {
    let is_after = state.saving.written.iter().any(|written| written.generation != state.request.generation);
    let next = if is_after { "the render after it" } else { "the render" };
    match (state.work.activity, &state.work.progress) {
        // Views and moved cameras are shown, not written.
        (Activity::Done, _) if is_saved_since(state) => "; that was before the last save".to_owned(),
        (Activity::Done, _) => String::new(),
        (Activity::Running { .. } | Activity::Cancelled, Some(progress)) => {
            format!("; {next} was stopped at {:.0} %", (progress.fraction * 100.0).floor())
        }
        (Activity::Running { .. } | Activity::Cancelled, None) => format!("; {next} was stopped"),
        (Activity::Waiting | Activity::Broken, _) => {
            let name = state.request.scene.file_name().unwrap_or_default().to_string_lossy();
            let since = if state.saving.written.is_empty() { "" } else { " since" };
            format!("; {} has errors{since}", visible(&name))
        }
    }
}

/// Whether the scene has changed since the files were written.
fn is_saved_since(state: &State) -> bool {
    let newest = state.saving.written.iter().map(|written| written.generation).max();
    !state.request.is_written()
        && newest.zip(state.saving.last_visible_edit).is_some_and(|(newest, saved)| newest < saved)
}

/// The files written and their descriptions; files of the same picture stand together.
fn files(written: &[Written]) -> String {
    let alike = written.chunk_by(|one, next| one.made == next.made);
    let said: Vec<String> = alike
        .map(|files| {
            let names: Vec<_> =
                files.iter().map(|it| visible(&it.path.to_string_lossy()).into_owned()).collect();
            let made = files.first().map_or("", |it| &it.made);
            let colon = if made.is_empty() { "" } else { ": " };
            format!("wrote {}{colon}{made}", names.join(", "))
        })
        .collect();
    if said.is_empty() { "nothing is written".to_owned() } else { said.join("; ") }
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
pub(super) fn made(report: &Report) -> String {
    let image = &report.image;
    let time = seconds(report.seconds.max(image.render_seconds));
    let view = view(report.settings.view);
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
    use crate::pipeline::protocol::{Event, Stage, Status};
    use crate::scene::diagnostic::Severity;
    use crate::tui::Changed;
    use crate::tui::fixtures::{Desk, diagnostic, done, progress};

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
        desk.press('l');
        desk.worker(Event::Written { generation: begun, path: "big.png".into(), bytes: 1 });
        assert!(
            words(&desk.state).starts_with("wrote big.png; the render after it"),
            "{}",
            words(&desk.state)
        );
        desk.worker(done(begun, Vec::new(), false));
        desk.finish([30, 30, 200]);
        let made = "wrote big.png: 640×480, 64 samples, 1.93 s";
        assert_eq!(words(&desk.state), format!("{made}; camera changes discarded"));
        assert!(desk.text().contains("unwritten: w writes it"), "of the one at hand: {}", desk.text());
    }

    #[test]
    fn the_seconds_are_those_of_the_picture_in_the_file() {
        let mut desk = Desk::new();
        let write = |desk: &mut Desk, seconds: f64, rendered: f64| {
            let generation = desk.state.request.generation;
            desk.worker(Event::Started { generation });
            desk.worker(Event::Written { generation, path: "dof.png".into(), bytes: 1 });
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
        desk.worker(Event::Written { generation: 1, path: "a.png".into(), bytes: 1 });
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
        desk.worker(Event::Written { generation, path: "a.png".into(), bytes: 1 });
        assert_eq!(words(&desk.state), "wrote a.png: view normal, 640×480, 64 samples, 500 ms");
    }

    #[test]
    fn a_save_that_is_only_shown_is_not_said_to_be_in_the_file() {
        let made = "wrote a.png: 640×480, 64 samples, 1.93 s";
        for key in ['v', 'l'] {
            let mut desk = Desk::new();
            desk.worker(Event::Written { generation: 1, path: "a.png".into(), bytes: 1 });
            desk.finish([200, 30, 30]);
            desk.press(key);
            desk.finish([200, 30, 30]);
            let before = words(&desk.state);
            assert!(before.starts_with(made) && !before.contains("save"), "{key}: {before}");
            desk.event(crate::tui::event::Event::Changed(Changed { noticed: desk.now }));
            desk.finish([30, 30, 200]);
            let after = words(&desk.state);
            assert!(after.starts_with(&format!("{made}; that was before the last save")), "{key}: {after}");
            assert_eq!(after.contains("camera changes discarded"), key == 'l', "{after}");
            // A save that changes nothing does not make it newer.
            desk.event(crate::tui::event::Event::Changed(Changed { noticed: desk.now }));
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
        assert_eq!(words(&desk.state), "nothing is written; the render was stopped");
        desk.worker(Event::Progress { generation: 1, progress: progress(0.388, None) });
        assert_eq!(words(&desk.state), "nothing is written; the render was stopped at 38 %");
        desk.worker(Event::Written { generation: 1, path: "cornell.png".into(), bytes: 1 });
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
        desk.worker(Event::Written { generation: 3, path: "a.png".into(), bytes: 1 });
        desk.worker(done(3, Vec::new(), false));
        let failed =
            "not written: cannot write b.exr: no space; wrote an earlier one to cornell.png; wrote a.png";
        assert_eq!(words(&desk.state), failed);
        desk.press('r');
        desk.worker(Event::Started { generation: 4 });
        desk.worker(Event::Written { generation: 4, path: "a.png".into(), bytes: 1 });
        desk.worker(done(4, Vec::new(), false));
        let made = "wrote cornell.png, a.png: 640×480, 64 samples, 1.93 s";
        assert_eq!(words(&desk.state), made);
        desk.fail(vec![diagnostic(Severity::Error, "wrong")]);
        assert_eq!(words(&desk.state), format!("{made}; cornell.toml has errors since"));
    }
}
