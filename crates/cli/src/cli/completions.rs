//! `glimt completions`: the script that makes a shell complete, and the calls that the script makes.
//!
//! The script asks the program at each press of the key, so that it knows the tables, names and keys of the scene in the line.

use std::ffi::OsString;

use clap::CommandFactory;
use clap_complete::CompleteEnv;
use clap_complete::env::{Bash, Elvish, EnvCompleter, Fish, Powershell, Zsh};

use super::args::{Args, Shell};
use super::console::Console;
use super::exit::Exit;

/// The variable that a script sets to the name of its shell.
const VARIABLE: &str = "GLIMT_COMPLETE";

/// Prints the script of a shell.
pub(super) fn run(shell: Shell, console: &Console) -> Exit {
    let completer: &dyn EnvCompleter = match shell {
        Shell::Bash => &Bash,
        Shell::Zsh => &Zsh,
        Shell::Fish => &Fish,
        Shell::Powershell => &Powershell,
        Shell::Elvish => &Elvish,
    };
    let mut script = Vec::new();
    match completer.write_registration(VARIABLE, "glimt", "glimt", "glimt", &mut script) {
        Ok(()) => {
            console.text(&String::from_utf8_lossy(&script));
            Exit::DONE
        }
        Err(error) => console.fail(Exit::FAILED, &format!("cannot make the script: {error}")),
    }
}

/// Answers a call of a shell's script. `None` if the call is not one.
pub(super) fn answer(arguments: &[OsString]) -> Option<Exit> {
    std::env::var_os(VARIABLE)?;
    let folder = std::env::current_dir().ok();
    let complete = CompleteEnv::with_factory(Args::command).var(VARIABLE).bin("glimt").completer("glimt");
    match complete.try_complete(arguments, folder.as_deref()) {
        Ok(true) => Some(Exit::DONE),
        Ok(false) => None,
        // The shell shows nothing of it.
        Err(_) => Some(Exit::FAILED),
    }
}
