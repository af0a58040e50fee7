//! JSON and XML written by glimt are valid, and contain no characters that a terminal would interpret or
//! hide.

use serde_json::Value;

use super::test_dir::{SCENE, TestDir, assert_mentions};

/// A C1 control, DEL, a bidirectional override, a joiner, a tag outside the basic multilingual plane, and an
/// umlaut.
const NAME: &str = "a\u{9b}31m\u{7f}\u{202e}b\u{200d}c\u{e0041}ä\u{1}.toml";

#[track_caller]
fn harmless(bytes: &[u8]) -> &str {
    let text = std::str::from_utf8(bytes).expect("UTF-8");
    let harmful =
        |c: &char| (c.is_control() && *c != '\n') || matches!(c, '\u{200d}' | '\u{202e}' | '\u{e0041}');
    assert_eq!(text.chars().find(harmful), None, "{text:?}");
    text
}

#[track_caller]
fn object(text: &str) -> Value {
    serde_json::from_str(text).expect(text)
}

fn run(dir: &TestDir, arguments: &[&str]) -> std::process::Output {
    let output = dir.glimt("").args(arguments).output().expect("it runs");
    assert!(output.status.success(), "{arguments:?}: {:?}", String::from_utf8_lossy(&output.stderr));
    output
}

#[test]
fn all_json_is_valid_and_escaped() {
    let dir = TestDir::new();
    dir.write(NAME, SCENE);
    let output = run(&dir, &[NAME, "--once", "--report", "-", "--progress", "json"]);
    let report = object(harmless(&output.stdout));
    assert_eq!(report["scene"], NAME);
    assert!(harmless(&output.stdout).contains('ä'), "harmless characters must be unchanged");
    let events: Vec<Value> = harmless(&output.stderr).lines().map(object).collect();
    let written = events.iter().find(|event| event["event"] == "written").expect("a picture");
    let picture = NAME.replace(".toml", ".png");
    assert_eq!(written["path"], picture);

    run(&dir, &[NAME, "--once", "--report", "r.json"]);
    assert_eq!(object(harmless(&dir.bytes("r.json")))["scene"], NAME);

    let output = run(&dir, &["check", "--json", NAME]);
    assert_eq!(object(harmless(&output.stdout))["scene"], NAME);

    let output = run(&dir, &["compare", "--json", &picture, &picture]);
    assert_eq!(object(harmless(&output.stdout))["a"], picture);
}

#[test]
fn bench_escapes_names_in_json_and_xml() {
    let dir = TestDir::new();
    dir.write(NAME, SCENE);
    let line = "--samples 1 --reference-samples 8 --seeds 1 --integrator path --width 8 --no-cache \
                --progress json --json a.json --plot a.svg";
    let arguments: Vec<&str> = ["bench", NAME].into_iter().chain(line.split_whitespace()).collect();
    let output = run(&dir, &arguments);
    harmless(&output.stderr).lines().for_each(|line| drop(object(line)));
    assert_eq!(object(harmless(&dir.bytes("a.json")))["scenes"][0]["scene"], NAME);
    let plot = dir.bytes("a.svg");
    let document = roxmltree::Document::parse(harmless(&plot)).expect("XML");
    let is_named =
        |node: roxmltree::Node<'_, '_>| node.text().is_some_and(|text| text.contains("ä␁.toml, 8×"));
    assert!(document.descendants().any(is_named), "the escaped name must appear");
}

#[test]
fn check_json_contains_all_diagnostics() {
    let dir = TestDir::new();
    let scene = SCENE.replace("width", "widht").replace("radius", "raduis");
    dir.write("ball.toml", format!("# ä\n{scene}"));
    let output = dir.run("check ball.toml --json --set render.samples=0");
    assert_eq!(output.status.code(), Some(2));
    assert!(output.stderr.is_empty(), "{}", String::from_utf8_lossy(&output.stderr));
    let report = object(harmless(&output.stdout));
    assert_eq!((&report["ok"], &report["scene"]), (&Value::Bool(false), &Value::from("ball.toml")));
    let all = report["diagnostics"].as_array().expect("a list");
    let of = |message: &str| {
        all.iter().find(|one| one["message"].as_str().expect("a text").starts_with(message)).expect(message)
    };
    let unknown = of("unknown key `widht`");
    let place = ["line", "column", "end_line", "end_column"].map(|name| unknown[name].as_u64());
    assert_eq!(place, [Some(3), Some(1), Some(3), Some(6)]);
    assert_eq!((&unknown["severity"], &unknown["file"]), (&Value::from("error"), &Value::from("ball.toml")));
    assert_eq!(unknown["label"], "did you mean `width`?");
    assert_mentions(unknown["help"].as_str().expect("help"), &["`width`"]);
    assert_eq!(of("unknown key `raduis`")["line"], 17);
    assert_eq!(of("`samples` must be")["file"], "--set");
}

#[test]
fn check_lists_warnings_and_succeeds() {
    let dir = TestDir::new();
    dir.write("ball.toml", format!("{SCENE}[materials.unused]\n"));
    let output = run(&dir, &["check", "--json", "ball.toml"]);
    let report = object(harmless(&output.stdout));
    assert_eq!(report["ok"], true);
    let [warning] = report["diagnostics"].as_array().expect("a list").as_slice() else { panic!("{report}") };
    assert_eq!(warning["severity"], "warning");
    assert_eq!(warning["message"], "the material \"unused\" is not used");
    assert_eq!(warning["line"], SCENE.lines().count() + 1);
}
