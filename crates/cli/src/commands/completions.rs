//! `glimt completions`: prints shell completion scripts and responds to their requests.
//!
//! The scripts call glimt for every completion, because tables, names and keys depend on the scene on the
//! command line.

mod bash;
mod powershell;

use std::ffi::OsString;

use clap::CommandFactory;
use clap_complete::CompleteEnv;
use clap_complete::env::{Elvish, EnvCompleter, Fish, Shells, Zsh};

use self::bash::BashCompletionAdapter;
use self::powershell::PowershellCompleter;

use crate::args::{Args, Shell};
use crate::console::Console;
use crate::exit::Exit;

/// Environment variable that scripts set to the shell's name.
const VARIABLE: &str = "GLIMT_COMPLETE";

/// The zsh script. `clap_complete`'s own script adds a space after `KEY=`.
const ZSH: &str = r#"#compdef glimt
_glimt_complete() {
    local answer=("${(@f)$(
        _CLAP_IFS=$'\n' _CLAP_COMPLETE_INDEX=$((CURRENT - 1)) GLIMT_COMPLETE=zsh glimt -- "${words[@]}" 2> /dev/null
    )}")
    local -a folders=() begun=() whole=()
    local line value
    # The description follows the first colon.
    for line in $answer; do
        value=${line%%:*}
        case $value in
            */) folders+=("${value%/}${line#"$value"}") ;;
            *=) begun+=("$line") ;;
            *) whole+=("$line") ;;
        esac
    done
    (($#folders)) && _describe -V values folders -S / -r /
    (($#begun)) && _describe -V values begun -S ''
    (($#whole)) && _describe -V values whole
}
compdef _glimt_complete glimt
# If the script is in a folder of `fpath`, zsh loads it on the first completion, as a function named like the file.
if [[ $funcstack[1] == _glimt ]]; then
    _glimt_complete "$@"
fi
"#;

/// Prints the script for a shell.
pub(crate) fn run(shell: Shell, console: &Console) -> Exit {
    let completer: &dyn EnvCompleter = match shell {
        Shell::Bash => &BashCompletionAdapter,
        Shell::Zsh => {
            console.print_trusted_text(ZSH);
            return Exit::DONE;
        }
        Shell::Fish => &Fish,
        Shell::Powershell => &PowershellCompleter,
        Shell::Elvish => &Elvish,
    };
    let mut script = Vec::new();
    match completer.write_registration(VARIABLE, "glimt", "glimt", "glimt", &mut script) {
        Ok(()) => {
            console.print_trusted_text(&String::from_utf8_lossy(&script));
            Exit::DONE
        }
        Err(error) => console.print_error(Exit::FAILED, &format!("cannot create the script: {error}")),
    }
}

/// Responds to a call from a completion script, or returns `None` for any other call.
pub(crate) fn answer_completion_request(arguments: &[OsString]) -> Option<Exit> {
    std::env::var_os(VARIABLE)?;
    let folder = std::env::current_dir().ok();
    let shells = Shells(&[&BashCompletionAdapter, &Elvish, &Fish, &PowershellCompleter, &Zsh]);
    let complete = CompleteEnv::with_factory(Args::command).var(VARIABLE).shells(shells);
    let complete = complete.bin("glimt").completer("glimt");
    match complete.try_complete(arguments, folder.as_deref()) {
        Ok(true) => Some(Exit::DONE),
        Ok(false) => None,
        // The script discards stderr.
        Err(_) => Some(Exit::FAILED),
    }
}
