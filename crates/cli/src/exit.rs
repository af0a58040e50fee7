//! Exit codes.

use std::process::ExitCode;

/// Exit code of the program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Exit(pub u8);

impl Exit {
    /// The work is done.
    pub const DONE: Self = Self(0);
    /// The work failed.
    pub const FAILED: Self = Self(1);
    /// The call or the scene is wrong.
    pub const WRONG: Self = Self(2);

    /// Ended by a signal of this number.
    pub fn signal(number: i32) -> Self {
        Self(u8::try_from(128 + number).unwrap_or(1))
    }
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> Self {
        Self::from(exit.0)
    }
}
