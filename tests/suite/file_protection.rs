//! Protection of files that glimt did not write, and of the attributes of files that it replaces.

use std::fs;
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::path::Path;

use super::test_dir::{SCENE, TestDir, assert_mentions, mentions};

/// An unrelated file with a report's extension.
const PACKAGE: &str = "{\n  \"name\": \"somebody\",\n  \"glimt\": \"0.1.0\"\n}\n";
/// A file about a render, written by hand.
const HANDWRITTEN: &str = "{\n  \"glimt\": \"0.1.0\",\n  \"scene\": \"a.toml\",\n  \"seconds\": 3.5\n}\n";
/// Options for a render that never ends.
const ENDLESS: &str = "--once --samples 4000000 --width 4000";
/// Options for a measurement that never ends.
const LONG: &str = "--samples 4000000 --reference-samples 4000000 --progress none";
/// Options for a short measurement.
const SHORT: &str =
    "--samples 1 --reference-samples 8 --seeds 1 --integrator path --width 8 --no-cache --progress none";

#[test]
fn report_never_replaces_unrelated_file() {
    let dir = TestDir::new();
    let refused = |foreign: &[u8]| {
        dir.write("package.json", foreign);
        let stderr = dir.expect(&format!("ball.toml {ENDLESS} --report package.json"), 2);
        assert_mentions(&stderr, &["package.json", "report", "--force"]);
        assert_eq!(dir.bytes("package.json"), foreign);
    };
    for foreign in [PACKAGE, HANDWRITTEN, "[1, 2]", "{}", "{\"glimt\": \"0.1.0\", \"scene\": \"a\"", "text"] {
        refused(foreign.as_bytes());
    }
    dir.run(&format!("bench ball.toml {SHORT} --json results.json"));
    refused(&dir.bytes("results.json"));
    dir.expect("ball.toml --once --report package.json --force", 0);
    let mut report: serde_json::Value = serde_json::from_slice(&dir.bytes("package.json")).expect("JSON");
    // glimt replaces its own reports without `--force`: an unchanged report, a report from another version
    // with only the guaranteed keys on one line, and an empty file.
    let as_it_is = report.to_string();
    let keys = report.as_object_mut().expect("an object");
    let fixed = ["glimt", "scene", "image", "settings", "stages", "counters", "seconds", "peak_memory_bytes"];
    keys.retain(|key, _| fixed.contains(&key.as_str()));
    assert_eq!(keys.len(), fixed.len());
    keys.insert("glimt".to_owned(), "0.0.1".into());
    let all = [as_it_is, report.to_string(), String::new()];
    for own in all {
        dir.write("package.json", own);
        dir.expect("ball.toml --once --report package.json", 0);
    }
    dir.expect("ball.toml --once --report /dev/null", 0);
    let output = dir.run("ball.toml --once --report -");
    serde_json::from_slice::<serde_json::Value>(&output.stdout).expect("a report on stdout");
}

#[test]
fn force_never_replaces_an_input() {
    let dir = TestDir::new();
    let stderr = dir.expect(&format!("ball.toml {ENDLESS} --report ball.toml --force"), 2);
    assert!(mentions(&stderr, "ball.toml") && !mentions(&stderr, "--force"), "{stderr}");
    dir.write("ball.png", "a photograph");
    let stderr = dir.expect(&format!("ball.toml {ENDLESS}"), 2);
    assert_mentions(&stderr, &["ball.png", "--force"]);
    dir.expect("ball.toml --once --force", 0);
    assert!(dir.bytes("ball.png").starts_with(b"\x89PNG"));
}

#[test]
fn bench_never_replaces_unrelated_file() {
    let dir = TestDir::new();
    let bench = |line: &str, code: i32| {
        let output = dir.run(&format!("bench ball.toml {line}"));
        let stderr = String::from_utf8(output.stderr).expect("UTF-8");
        assert_eq!(output.status.code(), Some(code), "{line}: {stderr}");
        stderr
    };
    let refused = |option: &str, name: &str, foreign: &str| {
        dir.write(name, foreign);
        let stderr = bench(&format!("{LONG} {option} {name}"), 2);
        let what = match option {
            "--json" => "a results file",
            "--csv" => "a table",
            _ => "a plot",
        };
        assert_mentions(&stderr, &[name, what, option, "--force"]);
        assert_eq!(dir.bytes(name), foreign.as_bytes());
    };
    dir.expect("ball.toml --once --report report.json", 0);
    let report = String::from_utf8(dir.bytes("report.json")).expect("UTF-8");
    let described = "<svg width=\"8\" height=\"8\" xmlns=\"http://www.w3.org/2000/svg\">\n<desc>glimt ";
    for (option, name, foreign) in [
        ("--json", "a.json", PACKAGE),
        ("--json", "a.json", HANDWRITTEN),
        ("--json", "a.json", &report),
        ("--json", "a.json", "{ \"glimt\": \"0.1.0\", \"threads\": 2, \"seconds\": 3.5, \"scenes\": [] }"),
        ("--csv", "a.csv", "name,age\nsomebody,3\n"),
        ("--plot", "a.svg", "<svg width=\"8\" height=\"8\" xmlns=\"http://www.w3.org/2000/svg\"/>\n"),
        ("--plot", "a.svg", &format!("{described}in the wind</desc>\n</svg>\n")),
    ] {
        refused(option, name, foreign);
    }
    let all = "--json a.json --csv a.csv --plot a.svg";
    bench(&format!("{SHORT} {all} --force"), 0);
    // A table with an extra column or different line endings.
    let table = String::from_utf8(dir.bytes("a.csv")).expect("UTF-8");
    let (head, lines) = table.split_once("\r\n").expect("a first line");
    refused("--csv", "b.csv", &format!("{head},note\r\n{lines}"));
    refused("--csv", "b.csv", &format!("{head}\n{lines}"));
    // A plot with a different description before glimt's.
    let plot = String::from_utf8(dir.bytes("a.svg")).expect("UTF-8");
    refused("--plot", "b.svg", &plot.replacen("<desc>", "<desc>somebody, with </desc>\n<desc>", 1));
    bench(&format!("{SHORT} {all}"), 0);
    // A plot from a version that did not write a description.
    let plot = String::from_utf8(dir.bytes("a.svg")).expect("UTF-8");
    let (start, rest) = plot.split_once("<desc>").expect("a signature");
    let (_, end) = rest.split_once("</desc>").expect("its end");
    dir.write("a.svg", format!("{start}{end}"));
    dir.write("a.csv", "");
    bench(&format!("{SHORT} {all}"), 0);
}

/// Requires root, because the program runs as another user.
#[test]
fn lost_ownership_is_reported() {
    use std::os::unix::process::CommandExt;
    let dir = TestDir::new();
    if fs::metadata(dir.0.path()).expect("a folder").uid() != 0 {
        return eprintln!("skipped: requires root to run as another user");
    }
    let program = dir.program();
    fs::set_permissions(dir.0.path(), fs::Permissions::from_mode(0o777)).expect("permitted");
    for (name, mode) in [("a.png", 0o666), ("b.png", 0o666)] {
        dir.write(name, "");
        fs::set_permissions(dir.path(name), fs::Permissions::from_mode(mode)).expect("permitted");
    }
    let run = |line: &str| {
        let mut process = std::process::Command::new(&program);
        process.current_dir(dir.0.path()).args(line.split_whitespace()).uid(65534).gid(65534);
        let output = process.output().expect("it runs");
        assert!(output.status.success(), "{output:?}");
        String::from_utf8(output.stderr).expect("UTF-8")
    };
    let stderr = run("ball.toml --once -o a.png");
    assert_mentions(&stderr, &["warning: a.png", "owner", "group"]);
    assert_eq!(fs::metadata(dir.path("a.png")).expect("a file").uid(), 65534);
    assert!(
        !mentions(&run("ball.toml --once -o a.png"), "warning"),
        "a file owned by the user must not cause a warning"
    );
    let events = run("ball.toml --once -o b.png --progress json");
    let done = events.lines().last().expect("the end");
    let done: serde_json::Value = serde_json::from_str(done).expect("JSON");
    assert_mentions(done["diagnostics"][0]["message"].as_str().expect("text"), &["b.png", "owner", "group"]);
}

/// An access control list in the kernel's format (posix_acl_xattr.h), with permissions of the owner, user
/// 4321, the group, the mask and others.
fn access_list(named: u8, group: u8, mask: u8) -> Vec<u8> {
    const NOBODY: u32 = u32::MAX;
    let entries =
        [(1_u16, 6, NOBODY), (2, named, 4321), (4, group, NOBODY), (16, mask, NOBODY), (32, 0, NOBODY)];
    let entries = entries.into_iter().flat_map(|(tag, rights, id)| {
        [tag.to_le_bytes().to_vec(), u16::from(rights).to_le_bytes().to_vec(), id.to_le_bytes().to_vec()]
            .concat()
    });
    2_u32.to_le_bytes().into_iter().chain(entries).collect()
}

const ACCESS: &str = "system.posix_acl_access";

fn attribute(path: &Path, name: &str) -> Option<Vec<u8>> {
    xattr::get(path, name).expect("attributes")
}

#[test]
fn image_keeps_acl_and_attributes() {
    let dir = TestDir::new();
    dir.expect("ball.toml --once -o a.png --report a.json", 0);
    for name in ["a.png", "a.json"] {
        let path = dir.path(name);
        // Skip file systems without extended attributes.
        if xattr::set(&path, "user.note", b"mine").is_err() {
            return;
        }
        fs::set_permissions(&path, fs::Permissions::from_mode(0o600)).expect("permitted");
        xattr::set(&path, ACCESS, &access_list(6, 0, 6)).expect("a list");
    }
    dir.expect("ball.toml --once -o a.png --report a.json --seed 3", 0);
    for name in ["a.png", "a.json"] {
        let path = dir.path(name);
        assert_eq!(attribute(&path, "user.note").as_deref(), Some(b"mine".as_slice()), "{name}");
        assert_eq!(attribute(&path, ACCESS), Some(access_list(6, 0, 6)), "{name}");
        // With an access control list, these bits are the mask. Without one, they would be group permissions.
        assert_eq!(fs::metadata(&path).expect("a file").mode() & 0o777, 0o660, "{name}");
    }
}

#[test]
fn default_acl_never_widens_permissions() {
    let dir = TestDir::new();
    dir.expect("ball.toml --once -o a.png", 0);
    fs::set_permissions(dir.path("a.png"), fs::Permissions::from_mode(0o640)).expect("permitted");
    if xattr::set(dir.0.path(), "system.posix_acl_default", &access_list(6, 4, 6)).is_err() {
        return;
    }
    dir.expect("ball.toml --once -o a.png --seed 3", 0);
    assert_eq!(attribute(&dir.path("a.png"), ACCESS), None);
    assert_eq!(fs::metadata(dir.path("a.png")).expect("a file").mode() & 0o777, 0o640);
    dir.expect("ball.toml --once -o new.png", 0);
    assert!(attribute(&dir.path("new.png"), ACCESS).is_some(), "a new file inherits the folder's list");
}

#[test]
fn scenes_with_the_same_name_keep_their_images() {
    let dir = TestDir::new();
    for folder in ["a", "b"] {
        std::fs::create_dir(dir.path(folder)).expect("made");
        dir.write(&format!("{folder}/scene.toml"), SCENE);
    }
    dir.expect("a/scene.toml --once --samples 1", 0);
    let first = dir.bytes("scene.png");
    let said = dir.expect("b/scene.toml --once --samples 1", 2);
    assert_mentions(&said, &["scene.png", "a/scene.toml", "-o", "--force"]);
    assert_eq!(dir.bytes("scene.png"), first);
    // The same scene through another relative path and through its absolute path.
    dir.expect("./b/../a/scene.toml --once --samples 2", 0);
    let absolute = dir.path("a/scene.toml");
    dir.expect(&format!("{} --once --samples 1", absolute.display()), 0);
    assert_eq!(dir.bytes("scene.png"), first);
    for advice in ["-o b.png", "--force", "-o scene.png"] {
        dir.expect(&format!("b/scene.toml --once --samples 1 {advice}"), 0);
    }
    // Turntable files are also checked.
    dir.expect("a/scene.toml --once --samples 1 --turntable 2", 0);
    let said = dir.expect("b/scene.toml --once --samples 1 --turntable 2", 2);
    assert_mentions(&said, &["a/scene.toml"]);
    // The scene and its image are moved together.
    std::fs::create_dir(dir.path("moved")).expect("made");
    dir.expect("a/scene.toml --once --samples 1 --force", 0);
    for name in ["a", "scene.png"] {
        std::fs::rename(dir.path(name), dir.path(&format!("moved/{name}"))).expect("moved");
    }
    let moved = dir.glimt("a/scene.toml --once --samples 2").current_dir(dir.path("moved")).output();
    assert_eq!(moved.expect("it runs").status.code(), Some(0));
}
