//! glimt in the user's shell: completions, the manual page, running without arguments, environment variables,
//! `glimt doctor`.

use std::collections::BTreeSet;
use std::fs;
use std::process::Command;

use glimt::cli::environment::VARIABLES;

use crate::test_dir::{PROGRAM, TestDir, assert_mentions, mentions};

/// Bash's completions for the last word of a line.
fn in_bash(dir: &TestDir, line: &str) -> Vec<String> {
    // Split words as bash does when Tab is pressed. `=` is a separate word.
    let script = r#"
        source <(glimt completions bash)
        COMP_LINE=$1 COMP_POINT=${#1} COMP_TYPE=9 COMP_WORDBREAKS=$' \t\n"\'><=;|&(:'
        COMP_WORDS=($1); [[ $1 == *' ' ]] && COMP_WORDS+=("")
        COMP_CWORD=$((${#COMP_WORDS[@]} - 1))
        _glimt_complete glimt "${COMP_WORDS[COMP_CWORD]}" "${COMP_WORDS[COMP_CWORD - 1]}"
        printf '%s\n' "${COMPREPLY[@]}"
    "#;
    let program = dir.glimt("").get_program().to_owned();
    let folder = std::path::Path::new(&program).parent().expect("a folder").to_owned();
    let path = std::env::join_paths(
        [folder].into_iter().chain(std::env::split_paths(&std::env::var_os("PATH").unwrap_or_default())),
    );
    let mut bash = Command::new("bash");
    bash.args(["--norc", "-c", script, "bash", line]).current_dir(dir.0.path());
    let output = bash.env("PATH", path.expect("a path")).output().expect("bash");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).expect("UTF-8");
    text.lines().filter(|line| !line.is_empty()).map(str::to_owned).collect()
}

#[test]
fn bash_completes_commands_files_and_keys() {
    let dir = TestDir::new();
    for name in ["knot.obj", "notes.txt", "view.png"] {
        dir.write(name, "");
    }
    fs::create_dir(dir.path("more")).expect("a folder");
    let first = in_bash(&dir, "glimt ");
    for wanted in ["check", "doctor", "ball.toml", "knot.obj", "more/"] {
        assert!(first.iter().any(|word| word == wanted), "{wanted}: {first:?}");
    }
    assert!(!first.iter().any(|word| ["notes.txt", "view.png"].contains(&word.as_str())), "{first:?}");
    assert_eq!(in_bash(&dir, "glimt check k"), [""; 0], "only scenes must be offered");
    assert_eq!(in_bash(&dir, "glimt compl"), ["completions"]);
    assert_eq!(in_bash(&dir, "glimt ball.toml --integrator "), ["whitted", "path"]);
    assert_eq!(in_bash(&dir, "glimt ball.toml --set materials.ball.sh"), ["materials.ball.shininess="]);
    assert_eq!(in_bash(&dir, "glimt check ball.toml --set light.1.f"), ["light.1.falloff="]);
    assert_eq!(in_bash(&dir, "glimt ball.toml --set photons.e"), ["photons.enabled="]);
}

#[test]
fn completions_work_in_installed_shells() {
    let script = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(".ci/shells.py");
    let output = Command::new("python3").arg(script).arg(TestDir::new().glimt("").get_program()).output();
    let output = output.expect("python3");
    let said = String::from_utf8(output.stdout).expect("UTF-8");
    println!("{said}");
    assert!(output.status.success() && mentions(&said, "bash: 32 of 32"), "{said}");
}

#[test]
fn every_shell_has_a_completion_script() {
    let dir = TestDir::new();
    for (shell, mark) in [
        ("bash", "complete -o nospace"),
        ("zsh", "#compdef glimt"),
        ("fish", "complete --keep-order"),
        ("powershell", "Register-ArgumentCompleter"),
        ("elvish", "edit:completion:arg-completer[glimt]"),
    ] {
        let output = dir.run(&format!("completions {shell}"));
        let script = String::from_utf8(output.stdout).expect("UTF-8");
        assert!(output.status.success() && script.contains(mark), "{shell}: {script}");
        assert!(script.contains("GLIMT_COMPLETE"), "{shell}: {script}");
    }
    assert_mentions(&dir.expect("completions tcsh", 2), &["bash, zsh, fish, powershell, elvish"]);
}

#[test]
fn man_page_lists_commands_options_variables() {
    let dir = TestDir::new();
    let page = |line: &str| String::from_utf8(dir.run(line).stdout).expect("UTF-8").replace("\\-", "-");
    let whole = page("man");
    for part in [
        ".TH glimt 1",
        ".SH EXAMPLES",
        ".SH \"EXIT STATUS\"",
        ".SH ENVIRONMENT",
        "--checkpoint",
        "glimt-check(1)",
    ] {
        assert!(whole.contains(part), "{part}: {whole}");
    }
    for (names, _) in VARIABLES {
        assert!(whole.contains(names), "{names}");
    }
    let check = page("man check");
    assert!(check.contains(".TH glimt-check 1") && check.contains("--set"), "{check}");
    assert!(!check.contains("--checkpoint"));
    assert_mentions(&dir.expect("man chekc", 2), &["`check`"]);
}

#[test]
fn no_arguments_suggests_a_scene() {
    let dir = TestDir::new();
    let said = dir.expect("", 2);
    assert_mentions(&said, &["glimt new ball.toml", "glimt -h"]);
    assert!(said.lines().count() < 10, "{said}");
    // A command line with only options lacks a scene.
    assert!(dir.expect("--once", 2).contains("<SCENE>"));
}

#[test]
fn only_long_help_lists_environment_variables() {
    let dir = TestDir::new();
    let help = |option: &str| String::from_utf8(dir.run(option).stdout).expect("UTF-8");
    let (long, short) = (help("--help"), help("-h"));
    for (names, _) in VARIABLES {
        assert!(long.contains(names), "{names}");
    }
    assert!(!short.contains("SSH_TTY") && short.contains("--help"), "{short}");
}

/// Names of the environment variables that a source file reads.
fn environment_variables_in(text: &str) -> BTreeSet<String> {
    let code = text.split("#[cfg(test)]").next().unwrap_or_default();
    let is_name = |word: &&str| {
        word.len() > 2
            && word.chars().all(|c| c.is_ascii_uppercase() || c == '_')
            && word.starts_with(char::is_alphabetic)
    };
    code.split('"').skip(1).step_by(2).filter(is_name).map(str::to_owned).collect()
}

#[test]
fn variable_list_matches_source_code() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    let listed: BTreeSet<String> =
        VARIABLES.iter().flat_map(|(names, _)| names.split(", ")).map(str::to_owned).collect();
    let mut asked = BTreeSet::new();
    let mut folders = vec![root.join("crates"), root.join("src")];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).expect("a folder") {
            let path = entry.expect("an entry").path();
            let text = if path.is_dir() {
                let is_test = path.ends_with("tests") || path.ends_with("target");
                folders.extend(Some(path.clone()).filter(|_| !is_test));
                continue;
            } else {
                fs::read_to_string(&path).unwrap_or_default()
            };
            let asks =
                ["env::var", "variable(", "Fn(&str) -> Option<String>"].iter().any(|way| text.contains(way));
            let is_source = path.extension().is_some_and(|ending| ending == "rs");
            if asks && is_source && !path.ends_with("manual_test.rs") {
                asked.extend(environment_variables_in(&text));
            }
        }
    }
    asked.remove("CARGO_PKG_VERSION");
    // These are read by libraries for arguments, help and progress bars.
    let of_libraries = ["CLICOLOR", "CLICOLOR_FORCE", "COLUMNS", "LANG"].map(str::to_owned);
    asked.extend(of_libraries);
    // This name contains lowercase letters.
    asked.insert("ConEmuANSI".to_owned());
    assert_eq!(asked, listed);
}

#[test]
fn doctor_works_without_a_terminal() {
    let dir = TestDir::new();
    let mut glimt = dir.glimt("doctor");
    glimt.env("GLIMT_SIMD", "portable").env("XDG_CACHE_HOME", dir.path("cache")).env("VISUAL", "hx");
    let output = glimt.output().expect("it runs");
    let text = String::from_utf8(output.stdout).expect("UTF-8");
    assert!(output.status.success(), "{text}");
    for part in [
        "GLIMT_SIMD=portable",
        "terminal    none",
        "hx (from VISUAL)",
        "cache/glimt/references: does not exist yet",
    ] {
        assert!(text.contains(part), "{part}: {text}");
    }
}

#[test]
fn doctor_reports_terminal_replies() {
    let folder = TestDir::with_board();
    let program = PROGRAM;
    let mut terminal = folder.terminal_with(&[program, "doctor"], &[]);
    terminal.press("\x1b[0n\x1bP>|foot(1.20.2)\x1b\\\x1b_Gi=4211;OK\x1b\\\x1b[?2026;2$y\x1b[?62;4;22c");
    terminal.wait_for("cache");
    let text = terminal.text();
    for part in [
        "foot(1.20.2) (xterm-256color), 80 × 24 cells",
        "24 bits",
        "octants; pixels with --preview kitty or sixel",
        "synchronized output",
    ] {
        assert!(text.contains(part), "{part}: {text}");
    }
    assert_eq!(terminal.end(), 0);
}
