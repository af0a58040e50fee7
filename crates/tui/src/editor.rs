//! Runs the user's editor in the same terminal.

use std::ffi::{OsStr, OsString};
use std::io;
use std::path::Path;
use std::process::Command;

use nix::errno::Errno;
use nix::sys::signal::Signal;
use nix::sys::wait::{WaitPidFlag, WaitStatus, waitpid};
use nix::unistd::Pid;

use super::event::FileLineColumn;
use super::signals;

/// Editor used if the environment does not specify one.
const DEFAULT_EDITOR: &str = "vi";

/// The editor from the environment, as a shell command.
pub(super) fn editor_from_environment(variable: impl Fn(&str) -> Option<String>) -> String {
    editor_and_variable(variable).0
}

/// The editor from the environment as a shell command, with the variable that specifies it, or with `None`
/// for the default editor.
pub fn editor_and_variable(variable: impl Fn(&str) -> Option<String>) -> (String, Option<&'static str>) {
    let set = |name: &'static str| {
        let editor = variable(name).filter(|value| !value.trim().is_empty())?;
        Some((editor, Some(name)))
    };
    set("VISUAL").or_else(|| set("EDITOR")).unwrap_or_else(|| (DEFAULT_EDITOR.to_owned(), None))
}

/// Opens a file in the editor at a position and waits for the editor to exit. If the editor is stopped, this
/// process stops with it until both are continued. Terminating signals are forwarded.
///
/// # Errors
/// The editor could not be started or failed.
pub(super) fn run(editor: &str, place: &FileLineColumn) -> Result<(), String> {
    let failed = |error: io::Error| format!("cannot start the editor `{editor}`: {error}");
    let mut shell = Command::new("/bin/sh");
    shell
        .arg("-c")
        .arg(exec_prefixed_shell_command_line(editor))
        .arg(editor)
        .args(position_arguments(editor, place));
    let child = shell.spawn().map_err(failed)?;
    let id = i32::try_from(child.id()).map_err(|_| format!("lost track of the editor `{editor}`"))?;
    let id = Pid::from_raw(id);
    signals::set_foreground_child(Some(id));
    let end = wait_for_child(id);
    signals::set_foreground_child(None);
    match end {
        // Signals from the keyboard are a normal way to quit an editor.
        Ok(WaitStatus::Exited(_, 0) | WaitStatus::Signaled(_, Signal::SIGINT | Signal::SIGQUIT, _)) => Ok(()),
        Ok(WaitStatus::Exited(_, 127)) => Err(format!("editor `{editor}` not found: set VISUAL or EDITOR")),
        Ok(WaitStatus::Exited(_, code)) => Err(format!("the editor `{editor}` exited with code {code}")),
        Ok(WaitStatus::Signaled(_, signal, _)) => {
            Err(format!("the editor `{editor}` was killed by {signal}"))
        }
        Ok(_) => Ok(()),
        Err(error) => Err(failed(error.into())),
    }
}

/// Waits for the child to exit.
fn wait_for_child(id: Pid) -> Result<WaitStatus, Errno> {
    loop {
        match waitpid(id, Some(WaitPidFlag::WUNTRACED)) {
            Ok(WaitStatus::Stopped(..)) => signals::suspend_process(),
            Ok(end @ (WaitStatus::Exited(..) | WaitStatus::Signaled(..))) => return Ok(end),
            Ok(_) | Err(Errno::EINTR) => {}
            Err(error) => return Err(error),
        }
    }
}

/// Command line for the shell. Simple commands are run using `exec`, because an intermediate shell would
/// intercept signals.
fn exec_prefixed_shell_command_line(editor: &str) -> String {
    let is_plain = |character: char| character.is_alphanumeric() || " -_./+,:@%".contains(character);
    let is_of_shell = ["command", "eval", "exec", "time", "."].contains(&executable_name(editor));
    let exec = if editor.chars().all(is_plain) && !is_of_shell { "exec " } else { "" };
    format!("{exec}{editor} \"$@\"")
}

/// Arguments that open the file at a position.
fn position_arguments(editor: &str, place: &FileLineColumn) -> Vec<OsString> {
    let FileLineColumn { path, line, column } = place;
    // Prevent a file name with a leading dash from being parsed as an option.
    let path = if path.as_os_str().as_encoded_bytes().starts_with(b"-") {
        Path::new(".").join(path)
    } else {
        path.clone()
    };
    let with_place = || {
        let mut text = path.clone().into_os_string();
        text.push(format!(":{line}:{column}"));
        text
    };
    match executable_name(editor) {
        "vi" | "vim" | "nvim" | "view" | "gvim" | "ex" | "nano" | "emacs" | "emacsclient" | "kak"
        | "micro" | "joe" | "ne" | "mg" | "jed" | "pico" => vec![format!("+{line}").into(), path.into()],
        "hx" | "helix" | "subl" | "zed" => vec![with_place()],
        "code" | "codium" | "code-insiders" | "cursor" => {
            let wait = if editor.contains("-w") { None } else { Some(OsString::from("--wait")) };
            let goto =
                if editor.contains(" -g") || editor.contains("--goto") { None } else { Some("-g".into()) };
            wait.into_iter().chain(goto).chain([with_place()]).collect()
        }
        // The syntax of other editors is unknown.
        _ => vec![path.into()],
    }
}

/// File name of the editor's executable, without its directory.
fn executable_name(editor: &str) -> &str {
    let first = editor.split_whitespace().next().unwrap_or_default();
    Path::new(first).file_name().and_then(OsStr::to_str).unwrap_or(first)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn visual_takes_precedence_over_editor() {
        let of = |pairs: &[(&str, &str)]| {
            editor_from_environment(|name| {
                pairs.iter().find(|(key, _)| *key == name).map(|(_, value)| (*value).to_owned())
            })
        };
        assert_eq!(of(&[("VISUAL", "hx"), ("EDITOR", "ed")]), "hx");
        assert_eq!(of(&[("VISUAL", " "), ("EDITOR", "ed")]), "ed");
        assert_eq!(of(&[]), "vi");
        assert_eq!(
            editor_and_variable(|name| (name == "EDITOR").then(|| "ed".to_owned())),
            ("ed".to_owned(), Some("EDITOR"))
        );
        assert_eq!(editor_and_variable(|_| None), ("vi".to_owned(), None));
    }

    #[test]
    fn only_simple_commands_use_exec() {
        assert_eq!(
            exec_prefixed_shell_command_line("/usr/bin/nvim -u NONE"),
            "exec /usr/bin/nvim -u NONE \"$@\""
        );
        for editor in ["TERM=vt100 vi", "cd /; vi", "'my editor'", "vi #", "$HOME/vi", "command vi"] {
            assert_eq!(exec_prefixed_shell_command_line(editor), format!("{editor} \"$@\""));
        }
    }

    #[test]
    fn editors_open_the_line() {
        let place = FileLineColumn { path: "a b.toml".into(), line: 7, column: 3 };
        for (editor, expected) in [
            ("vi", "+7 a b.toml"),
            ("/usr/bin/nvim -u NONE", "+7 a b.toml"),
            ("emacs -nw", "+7 a b.toml"),
            ("hx", "a b.toml:7:3"),
            ("code", "--wait -g a b.toml:7:3"),
            ("code -g --wait", "a b.toml:7:3"),
            ("my-editor", "a b.toml"),
        ] {
            assert_eq!(position_arguments(editor, &place).join(OsStr::new(" ")), expected, "{editor}");
        }
        let dash = FileLineColumn { path: "-a.toml".into(), line: 1, column: 1 };
        assert_eq!(position_arguments("vi", &dash)[1], "./-a.toml");
    }
}
