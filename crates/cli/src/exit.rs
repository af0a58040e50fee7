//! Exit codes.

use std::process::ExitCode;

/// An exit code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Exit(pub u8);

impl Exit {
    /// Success.
    pub const DONE: Self = Self(0);
    /// Rendering or another task failed.
    pub const FAILED: Self = Self(1);
    /// The arguments or the scene are invalid.
    pub const WRONG: Self = Self(2);

    /// Exit code of a process terminated by signal `number`.
    pub fn from_signal(number: i32) -> Self {
        Self(u8::try_from(128 + number).unwrap_or(1))
    }
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> Self {
        Self::from(exit.0)
    }
}
