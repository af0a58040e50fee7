//! Restores the terminal when the process aborts, without locks or allocations.

use std::io;
use std::os::fd::AsFd;
use std::sync::OnceLock;
use std::sync::atomic::Ordering;

use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use nix::sys::termios::{FlushArg, SetArg, tcflush, tcgetattr, tcsetattr};

use super::sequences::{HAS_IMAGES, take_undo_bytes, write_frame_end_and_leave, write_image_deletion};
use super::{ALTERNATE_SCREEN_ACTIVE, RAW_MODE_ACTIVE, RESTORATION_TIMEOUT};
use crate::system::abort;

/// Data needed to restore the terminal on abort without allocating memory.
static LAST_WORDS: OnceLock<RestoreData> = OnceLock::new();

struct RestoreData {
    /// Terminal modes before setup.
    modes: Option<nix::libc::termios>,
    /// Bytes that delete images.
    delete_images: Vec<u8>,
    /// Bytes that restore the screen.
    leave: Vec<u8>,
}

/// Prepares to restore the terminal on abort, for example after a failed allocation.
pub(super) fn prepare_restore_on_abort() {
    LAST_WORDS.get_or_init(|| {
        let (mut delete_images, mut leave) = (Vec::new(), Vec::new());
        // Writing to a vector cannot fail.
        let _ = write_image_deletion(&mut delete_images).and_then(|()| write_frame_end_and_leave(&mut leave));
        RestoreData { modes: tcgetattr(io::stdin()).ok().map(Into::into), delete_images, leave }
    });
    abort::set_terminal_restore_hook(restore_terminal_while_aborting);
}

/// Restores the terminal using only async-signal-safe calls, without locks or allocations. If the terminal
/// does not accept output, waits no longer than [`RESTORATION_TIMEOUT`].
fn restore_terminal_while_aborting() {
    let Some(words) = LAST_WORDS.get() else { return };
    if ALTERNATE_SCREEN_ACTIVE.swap(false, Ordering::AcqRel) {
        let out = io::stdout();
        let _ = tcflush(&out, FlushArg::TCOFLUSH);
        let mut room = [PollFd::new(out.as_fd(), PollFlags::POLLOUT)];
        if poll(&mut room, PollTimeout::try_from(RESTORATION_TIMEOUT).unwrap_or(PollTimeout::ZERO))
            .is_ok_and(|ready| ready > 0)
        {
            if HAS_IMAGES.load(Ordering::Acquire) {
                let _ = nix::unistd::write(&out, &words.delete_images);
            }
            for bytes in take_undo_bytes() {
                let _ = nix::unistd::write(&out, bytes);
            }
            let _ = nix::unistd::write(&out, &words.leave);
        }
    }
    if let Some(modes) = words.modes
        && RAW_MODE_ACTIVE.swap(false, Ordering::AcqRel)
    {
        let _ = tcsetattr(io::stdin(), SetArg::TCSANOW, &modes.into());
    }
}
