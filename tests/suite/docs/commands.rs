//! Runs every page's commands in a temporary folder, with small images.

use std::collections::HashSet;
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::Command;

use super::{Block, Page, pages, root};
use crate::test_dir::PROGRAM;

/// Programs that appear on the pages but are not run by this test.
const OTHERS: [&str; 3] = ["cargo", "ssh", "tmux"];
/// Subcommands of glimt.
const COMMANDS: [&str; 15] = [
    "check",
    "new",
    "import",
    "info",
    "compare",
    "bench",
    "merge",
    "farm",
    "explain",
    "schema",
    "lsp",
    "completions",
    "man",
    "doctor",
    "help",
];

#[test]
fn page_commands_run() {
    let mut with_commands = HashSet::new();
    for page in pages() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        furnish(folder.path(), &page);
        for Block { line, text } in page.blocks("sh") {
            let (script, count) = script(&text);
            if count > 0 {
                with_commands.insert(page.name.clone());
            }
            run(folder.path(), &script)
                .unwrap_or_else(|said| panic!("{}:{line}\n{script}\n{said}", page.name));
        }
    }
    let names =
        ["README.md", "docs/tutorial.md", "docs/light.md", "docs/command-line.md", "docs/accuracy.md"];
    for name in names.into_iter().chain(["docs/long-renders.md"]) {
        assert!(with_commands.contains(name), "{name}: no command was run");
    }
}

/// Sets up a folder for running commands, with the bundled scenes, the program, and the files that the page
/// shows. The first line of each such file is a comment with its name.
fn furnish(folder: &Path, page: &Page) {
    for name in ["scenes", "assets"] {
        symlink(root().join(name), folder.join(name)).expect("linked");
    }
    std::fs::create_dir(folder.join("bin")).expect("a folder");
    symlink(PROGRAM, folder.join("bin/glimt")).expect("linked");
    for Block { text, .. } in page.blocks("toml") {
        let name = text.lines().next().and_then(|line| line.strip_prefix("# "));
        if let Some(name) = name.filter(|name| name.ends_with(".toml")) {
            std::fs::write(folder.join(name), &text).expect("written");
        }
    }
}

fn run(folder: &Path, script: &str) -> Result<(), String> {
    let path = std::env::var("PATH").unwrap_or_default();
    let mut shell = Command::new("sh");
    shell.current_dir(folder).args(["-e", "-c", script]).env("TERM", "xterm");
    shell.env("PATH", format!("{}:{path}", folder.join("bin").display())).env("XDG_CACHE_HOME", folder);
    let output = shell.output().expect("a shell");
    let said = [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
    if output.status.success() { Ok(()) } else { Err(said.concat()) }
}

/// The commands to run from a block, and how many of them call glimt.
fn script(text: &str) -> (String, usize) {
    let (mut script, mut count) = (String::new(), 0);
    let mut end: Option<&str> = None;
    for line in text.lines() {
        if end.is_some() {
            end = end.filter(|end| *end != line);
            script.push_str(&format!("{line}\n"));
            continue;
        }
        end = line.split_once("<<'").and_then(|(_, word)| word.strip_suffix('\''));
        let line = line.replace("cargo run --release -- ", "glimt ");
        let program = line.split_whitespace().next().unwrap_or_default();
        if OTHERS.contains(&program) {
            continue;
        }
        let is_glimt = program == "glimt";
        count += usize::from(is_glimt);
        script.push_str(&if is_glimt { call(&line) } else { line });
        script.push('\n');
    }
    (script, count)
}

/// Adapts a glimt command for this test: commands that would open the terminal interface become checks, and
/// images become small.
fn call(line: &str) -> String {
    let cut = ["2>", "|"].iter().filter_map(|mark| line.find(mark)).min().unwrap_or(line.len());
    let (call, rest) = line.split_at(cut);
    let words: Vec<&str> = call.split_whitespace().collect();
    let has = |option: &str| words.contains(&option);
    let more = match words[1] {
        "bench" => bench(&words),
        command if COMMANDS.contains(&command) => String::new(),
        scene if !has("--once") => return format!("glimt check {scene} {rest}"),
        _ => ["--width 40", "--height 30", "--samples 4"]
            .into_iter()
            .filter(|option| !has(option.split(' ').next().unwrap_or_default()))
            .collect::<Vec<_>>()
            .join(" "),
    };
    let mut small: Vec<&str> = Vec::new();
    for word in words {
        let size = match small.last() {
            Some(&"--width") => "40",
            Some(&"--height") => "30",
            Some(&"--time") => "0.2",
            Some(&"--samples") if !word.contains(',') => "4",
            _ => word,
        };
        small.push(size);
    }
    format!("{} {more} {rest}", small.join(" "))
}

fn bench(words: &[&str]) -> String {
    let samples = if words.contains(&"--samples") { "" } else { "--samples 1,4" };
    format!("--width 12 --height 12 --seeds 2 --reference-samples 8 --progress none {samples}")
}

#[test]
fn commands_are_adapted_for_the_test() {
    assert_eq!(call("glimt a.toml"), "glimt check a.toml ");
    assert_eq!(
        call("glimt a.toml --once --samples 4096 -o b.png | cat"),
        "glimt a.toml --once --samples 4 -o b.png --width 40 --height 30 | cat"
    );
    let (script, count) = script("tmux new\ncat > f <<'END'\nglimt\nEND\nglimt new f.toml\n");
    assert_eq!((script.as_str(), count), ("cat > f <<'END'\nglimt\nEND\nglimt new f.toml  \n", 1));
}
