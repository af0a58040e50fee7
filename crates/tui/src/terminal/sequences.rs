//! Escape sequences that set up and restore the screen, and the changes that must be undone.

use std::io::{self, Write};
use std::sync::atomic::{AtomicBool, Ordering};

use crossterm::cursor::{Hide, Show};
use crossterm::event::{DisableBracketedPaste, EnableBracketedPaste};
use crossterm::execute;
use crossterm::style::{Print, ResetColor};
use crossterm::terminal::{
    Clear, ClearType, EndSynchronizedUpdate, EnterAlternateScreen, LeaveAlternateScreen,
};

use crate::graphics;
use crate::paint::LINK_OFF;
use crate::window_title::{KEEP_TITLE, PROGRESS_OFF, TITLE_BACK};

/// Whether mouse reporting is enabled.
pub(super) static MOUSE_REPORTING_ENABLED: AtomicBool = AtomicBool::new(true);
/// Whether focus reporting is enabled.
static FOCUS_REPORTING_ENABLED: AtomicBool = AtomicBool::new(false);
/// Whether the window title has been changed.
static HAS_TITLE: AtomicBool = AtomicBool::new(false);
/// Whether a progress bar may be shown.
static HAS_PROGRESS: AtomicBool = AtomicBool::new(false);
/// Whether a hyperlink may still be open.
static HAS_LINKS: AtomicBool = AtomicBool::new(false);
/// Whether the terminal stores images that must be deleted.
pub(super) static HAS_IMAGES: AtomicBool = AtomicBool::new(false);

/// Enables reports of button events and drags, in SGR format. (crossterm's command would report all mouse
/// movements.)
pub(super) const MOUSE_ON: &str = "\x1b[?1000h\x1b[?1002h\x1b[?1006h";
pub(super) const MOUSE_OFF: &str = "\x1b[?1006l\x1b[?1002l\x1b[?1000l";

/// Enables focus reporting (mode 1004).
pub(super) const FOCUS_ON: &str = "\x1b[?1004h";
const FOCUS_OFF: &str = "\x1b[?1004l";

/// Other terminal changes that glimt may have made, each with the bytes that undo it.
static CHANGES: [(&AtomicBool, &[u8]); 4] = [
    (&HAS_LINKS, LINK_OFF),
    (&HAS_TITLE, TITLE_BACK),
    (&HAS_PROGRESS, PROGRESS_OFF),
    (&FOCUS_REPORTING_ENABLED, FOCUS_OFF.as_bytes()),
];
/// Terminates a control string that may have been cut off. Otherwise, the terminal would treat the following
/// text as part of the string.
pub(super) const STRING_END: &[u8] = b"\x1b\\";

/// Records that kitty images may be stored and that control strings may be cut off.
pub(crate) fn mark_images_used() {
    HAS_IMAGES.store(true, Ordering::Release);
}

/// Enables focus reporting each time the terminal is set up.
pub(crate) fn enable_focus_reports_on_setup() {
    FOCUS_REPORTING_ENABLED.store(true, Ordering::Release);
}

/// Bytes to send before setting a window title. The first call returns the sequence that saves the original
/// title. Later calls return nothing.
pub(crate) fn take_title_save_sequence() -> &'static [u8] {
    if HAS_TITLE.swap(true, Ordering::AcqRel) { b"" } else { KEEP_TITLE }
}

/// Records that a progress bar may be shown.
pub(crate) fn mark_progress_bar_used() {
    HAS_PROGRESS.store(true, Ordering::Release);
}

/// Records that a hyperlink may be open.
pub(crate) fn mark_links_used() {
    HAS_LINKS.store(true, Ordering::Release);
}

/// Bytes that undo the changes listed in [`CHANGES`]. Each change is undone only once, except for modes,
/// which are enabled again when the terminal is set up.
pub(super) fn take_undo_bytes() -> impl Iterator<Item = &'static [u8]> {
    let mut is_first = true;
    CHANGES.iter().flat_map(move |(flag, bytes)| {
        let is_mode = std::ptr::eq(*flag, &FOCUS_REPORTING_ENABLED);
        let is_due = if is_mode { flag.load(Ordering::Acquire) } else { flag.swap(false, Ordering::AcqRel) };
        let end = (is_due && std::mem::replace(&mut is_first, false)).then_some(STRING_END);
        end.into_iter().chain(is_due.then_some(*bytes))
    })
}

/// Writes the bytes that set up the screen.
pub(super) fn write_setup(out: &mut impl Write) -> io::Result<()> {
    let mouse = if MOUSE_REPORTING_ENABLED.load(Ordering::Acquire) { MOUSE_ON } else { MOUSE_OFF };
    let focus = if FOCUS_REPORTING_ENABLED.load(Ordering::Acquire) { FOCUS_ON } else { "" };
    execute!(
        out,
        EnterAlternateScreen,
        Hide,
        EnableBracketedPaste,
        Print(mouse),
        Print(focus),
        Clear(ClearType::All)
    )
}

/// Writes the bytes that restore the screen, even if a frame was cut off at any point.
pub(super) fn write_restore(out: &mut impl Write) -> io::Result<()> {
    if HAS_IMAGES.load(Ordering::Acquire) {
        write_image_deletion(out)?;
    }
    take_undo_bytes().try_for_each(|bytes| out.write_all(bytes))?;
    write_frame_end_and_leave(out)
}

/// Writes the bytes that delete stored images.
pub(super) fn write_image_deletion(out: &mut impl Write) -> io::Result<()> {
    out.write_all(STRING_END)?;
    out.write_all(&graphics::delete_all_commands())
}

/// Writes the bytes that end an unfinished frame and switch back to the shell's screen.
pub(super) fn write_frame_end_and_leave(out: &mut impl Write) -> io::Result<()> {
    execute!(
        out,
        EndSynchronizedUpdate,
        ResetColor,
        Print(MOUSE_OFF),
        DisableBracketedPaste,
        LeaveAlternateScreen,
        Show
    )
}
