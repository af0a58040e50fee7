//! The line that stays when the screen is given back.

use super::event::Unwritten;
use super::state::{Activity, State};
use crate::pipeline::protocol::Report;
use crate::pipeline::words::seconds;
use crate::scene::sanitize::visible;

/// What was written, its samples and its seconds, and what came after it.
pub(super) fn words(state: &State) -> String {
    let files: Vec<_> =
        state.written.iter().map(|it| visible(&it.path.to_string_lossy()).into_owned()).collect();
    let files = if files.is_empty() {
        "nothing is written".to_owned()
    } else {
        format!("wrote {}", files.join(", "))
    };
    if let Some(failed) = &state.write_failed {
        return unwritten(state, failed);
    }
    let made = state.rendered.as_ref().map_or(String::new(), |report| format!(": {}", made(report)));
    let next = if state.rendered.is_some() { "the render after it" } else { "the render" };
    let since = match (state.activity, &state.progress) {
        (Activity::Done, _) => String::new(),
        (Activity::Running { .. } | Activity::Cancelled, Some(progress)) => {
            format!("; {next} was stopped at {:.0} %", (progress.fraction * 100.0).floor())
        }
        (Activity::Running { .. } | Activity::Cancelled, None) => format!("; {next} was stopped"),
        (Activity::Waiting | Activity::Broken, _) => {
            let name = state.scene.file_name().unwrap_or_default().to_string_lossy();
            format!("; {} has errors since", visible(&name))
        }
    };
    files + &made + &since
}

/// That the last picture is not on disk, and why; what is there is of before, but for what was written of it.
fn unwritten(state: &State, failed: &Unwritten) -> String {
    let mut words = format!("the last picture is not written: {}", visible(&failed.why));
    for written in &state.written {
        let name = visible(&written.path.to_string_lossy()).into_owned();
        let is_new = written.generation >= failed.generation;
        words += &if is_new { format!("; wrote {name}") } else { format!("; {name} is an earlier one") };
    }
    words
}

fn made(report: &Report) -> String {
    let image = &report.image;
    let samples = if image.samples.min == image.samples.max {
        image.samples.max.to_string()
    } else {
        format!("{} to {}", image.samples.min, image.samples.max)
    };
    format!("{}×{}, {samples} samples, {}", image.width, image.height, seconds(report.seconds))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipeline::protocol::{Event, Stage, Status};
    use crate::scene::diagnostic::Severity;
    use crate::tui::fixtures::{Desk, diagnostic, done, progress};

    #[test]
    fn what_could_not_be_written_is_told_whatever_is_shown_since() {
        let mut desk = Desk::new();
        let fail = |desk: &mut Desk| {
            let generation = desk.state.generation;
            desk.worker(Event::Started { generation });
            desk.worker(Event::WriteFailed {
                generation,
                message: "cannot write a.png: no space".to_owned(),
            });
            desk.worker(finished(generation, Status::Skipped));
        };
        fail(&mut desk);
        let failed = "the last picture is not written: cannot write a.png: no space";
        for key in ['l', 'v', '?'] {
            desk.press(key);
            let generation = desk.state.generation;
            desk.worker(Event::Started { generation });
            assert_eq!(words(&desk.state), failed, "{key}");
            desk.worker(finished(generation, Status::Skipped));
            assert_eq!(words(&desk.state), failed, "{key}");
        }
        // Back at the scene's own, where the disk has room or the picture of before.
        desk.press('0');
        for status in [Status::Done, Status::Reused] {
            fail(&mut desk);
            assert_eq!(words(&desk.state), failed);
            desk.press('r');
            let generation = desk.state.generation;
            desk.worker(Event::Started { generation });
            desk.worker(finished(generation, status));
            assert!(desk.state.write_failed.is_none(), "{status:?}");
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
        desk.worker(Event::WriteFailed { generation: 3, message: "cannot write b.exr: no space".to_owned() });
        desk.worker(Event::Written { generation: 3, path: "a.png".into(), bytes: 1 });
        desk.worker(done(3, Vec::new(), false));
        let failed = "the last picture is not written: cannot write b.exr: no space; cornell.png is an earlier one; wrote a.png";
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
