use super::*;
use crate::control::CancelToken;
use crate::protocol::{Request, WriteRequirement};
use crate::settings::{Overrides, ViewMode};

fn render(generation: u64) -> Command {
    Command::Render(Box::new(Request::new(generation, "a.toml".into(), Overrides::default())))
}

fn silent_sender() -> CommandSender {
    CommandSender::new(EventSink::silent(0).listener)
}

fn token(remote: &CommandSender) -> CancelToken {
    let Task::Render(_, token, _) = remote.wait_for_next_task() else { panic!("expected a pending request") };
    token
}

#[test]
fn panicking_worker_reports_failure() {
    let (sink, received) = crate::tests::sink_with_channel(0);
    let remote = CommandSender::new(sink.listener);
    remote.send(render(7));
    let panicking = remote;
    let thread = std::thread::spawn(move || {
        let _last_words = PanicReporter(&panicking);
        panic!("outside of a request");
    });
    assert!(thread.join().is_err());
    assert!(matches!(received.try_recv(), Ok(Event::Failed { generation: 7, .. })));
}

#[test]
fn pause_applies_to_newest_request() {
    let remote = silent_sender();
    remote.send(render(1));
    let ending = token(&remote);
    remote.send(render(2));
    // The user presses the key while the first request is still ending.
    remote.send(Command::Pause(true));
    assert!(ending.is_canceled());
    let second = token(&remote);
    assert!(second.is_paused());
    remote.send(Command::Pause(false));
    assert!(!second.is_paused());
    remote.send(Command::Pause(true));
    remote.send(render(3));
    assert!(!token(&remote).is_paused(), "a later request should not be paused");
}

#[test]
fn write_before_quit_is_carried_out() {
    let remote = silent_sender();
    remote.send(render(1));
    let token = token(&remote);
    remote.send(render(2));
    remote.send(Command::Write);
    remote.send(Command::Quit);
    assert!(token.is_canceled());
    assert!(matches!(remote.wait_for_next_task(), Task::Write));
    assert!(!remote.try_postpone_write_to_pending(false), "no request should be pending");
    assert!(matches!(remote.wait_for_next_task(), Task::Quit));
}

#[test]
fn write_stage_is_canceled_only_by_newer_image() {
    let remote = silent_sender();
    let begin = |number| {
        remote.send(render(number));
        let Task::Render(_, token, writing) = remote.wait_for_next_task() else {
            panic!("expected a pending request")
        };
        (token, writing)
    };
    let (token, writing) = begin(1);
    remote.send(Command::Pause(true));
    assert!(token.is_paused() && !writing.is_paused());
    remote.send(render(2));
    assert!(
        token.is_canceled() && !writing.is_canceled(),
        "a request without output should not cancel writing"
    );
    let Command::Render(request) = render(3) else { panic!("a request") };
    remote.send(Command::Render(Box::new(Request { write: WriteRequirement::Try, ..*request })));
    assert!(writing.is_canceled());
    let (token, writing) = begin(4);
    remote.send(Command::Quit);
    assert!(token.is_canceled() && !writing.is_canceled());
}

#[test]
fn write_command_does_not_apply_to_another_view() {
    let remote = silent_sender();
    remote.send(render(1));
    let _ = token(&remote);
    remote.send(Command::Write);
    let Command::Render(view) = render(2) else { panic!("a request") };
    let overrides = Overrides { view: Some(ViewMode::Normal), ..view.overrides.clone() };
    remote.send(Command::Render(Box::new(Request { overrides, ..*view })));
    assert!(matches!(remote.wait_for_next_task(), Task::Write));
    assert!(
        !remote.try_postpone_write_to_pending(false),
        "the command should not be postponed, so that an error is reported"
    );
    // A command sent after the view was requested applies to the view, even if the first image is
    // complete.
    remote.send(Command::Write);
    assert!(!remote.wants_write() && !remote.take_write(), "the ending request should ignore the command");
    assert!(matches!(remote.wait_for_next_task(), Task::Write));
    assert!(remote.try_postpone_write_to_pending(true));
}

#[test]
fn pending_commands_are_handled_in_sequence() {
    let remote = silent_sender();
    remote.send(render(1));
    remote.send(Command::Write);
    remote.send(Command::Preview(None));
    assert!(
        matches!(remote.wait_for_next_task(), Task::Write),
        "the command should apply to the shown image first"
    );
    assert!(
        remote.try_postpone_write_to_pending(false),
        "the command should be postponed while the image is incomplete"
    );
    assert!(matches!(remote.wait_for_next_task(), Task::Render(..)));
    assert!(remote.take_write(), "the request should take the command");
    assert!(!remote.take_write());
    assert!(matches!(remote.wait_for_next_task(), Task::Preview(None, _)));
    assert!(!remote.try_postpone_write_to_pending(false), "no request should be pending");
}
