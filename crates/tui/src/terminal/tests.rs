use super::sequences::{STRING_END, take_undo_bytes};
use super::*;
use crate::paint::LINK_OFF;
use crate::window_title::{KEEP_TITLE, PROGRESS_OFF, TITLE_BACK};

/// Serializes tests because they share process-wide state.
static ALONE: Mutex<()> = Mutex::new(());

fn exclusive_access() -> std::sync::MutexGuard<'static, ()> {
    ALONE.lock().unwrap_or_else(PoisonError::into_inner)
}

fn bytes(write: impl Fn(&mut Vec<u8>) -> io::Result<()>) -> String {
    let mut out = Vec::new();
    write(&mut out).expect("writing to a vector");
    String::from_utf8(out).expect("ASCII")
}

#[test]
fn restore_undoes_setup() {
    let _alone = exclusive_access();
    let enter = bytes(write_setup);
    let leave = bytes(write_restore);
    for mode in ["?1049", "?25", "?2004", "?1000", "?1002", "?1006"] {
        assert!(enter.contains(mode) && leave.contains(mode), "{mode}: {enter:?} {leave:?}");
    }
    assert!(enter.contains("\x1b[?1049h") && enter.contains("\x1b[?25l"), "{enter:?}");
    assert!(leave.contains("\x1b[0m"), "{leave:?}");
    assert!(leave.ends_with("\x1b[?1049l\x1b[?25h"), "{leave:?}");
}

#[test]
fn title_progress_and_links_are_undone_once() {
    let _alone = exclusive_access();
    let all = || take_undo_bytes().collect::<Vec<_>>();
    assert!(all().is_empty());
    assert_eq!((take_title_save_sequence(), take_title_save_sequence()), (KEEP_TITLE, &b""[..]));
    mark_progress_bar_used();
    mark_links_used();
    assert_eq!(all(), [STRING_END, LINK_OFF, TITLE_BACK, PROGRESS_OFF]);
    assert!(all().is_empty());
    assert_eq!(take_title_save_sequence(), KEEP_TITLE, "the new title should be saved again");
    assert_eq!(all(), [STRING_END, TITLE_BACK]);
}

#[test]
fn vt100_screen_is_restored() {
    let _alone = exclusive_access();
    let side = |length| std::num::NonZero::new(length).expect("not zero");
    let mut screen = vt100::Parser::new(side(5), side(20), 0);
    screen.process(b"shell$ ");
    screen.process(bytes(write_setup).as_bytes());
    screen.process(b"picture");
    assert!(screen.screen().alternate_screen() && screen.screen().hide_cursor());
    screen.process(bytes(write_restore).as_bytes());
    assert!(!screen.screen().alternate_screen() && !screen.screen().hide_cursor());
    assert!(screen.screen().contents().starts_with("shell$ "));
}

#[test]
fn restoring_unused_terminal_does_nothing() {
    let _alone = exclusive_access();
    assert!(!ALTERNATE_SCREEN_ACTIVE.load(Ordering::Acquire));
    restore_terminal();
    restore_from_other_thread();
    assert!(!ALTERNATE_SCREEN_ACTIVE.load(Ordering::Acquire));
}
