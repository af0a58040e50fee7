//! Checks the documented keys of reports and JSON progress against an actual render.

use std::collections::BTreeSet;

use serde_json::Value;

use super::{codes, page};
use crate::test_dir::TestDir;

/// A directory with a scene whose glass ball causes photons to be emitted.
fn dir() -> TestDir {
    let dir = TestDir::new();
    let scene =
        crate::test_dir::SCENE.replace("type = \"phong\"\ndiffuse = [0.8, 0.2, 0.1]", "type = \"glass\"");
    let floor =
        "[materials.floor]\n[[plane]]\nmaterial = \"floor\"\n[photons]\nenabled = true\ncount = 1000\n";
    dir.write("glass.toml", format!("{scene}{floor}"));
    dir
}

/// The dotted paths of all values, and the dotted paths of all tables.
fn paths(value: &Value, path: &str, ends: &mut BTreeSet<String>, tables: &mut BTreeSet<String>) {
    let inner: Vec<(String, &Value)> = match value {
        Value::Object(map) => {
            let dot = if path.is_empty() { "" } else { "." };
            map.iter().map(|(key, value)| (format!("{path}{dot}{key}"), value)).collect()
        }
        Value::Array(list) if list.iter().any(Value::is_object) => {
            list.iter().map(|value| (path.to_owned(), value)).collect()
        }
        _ => Vec::new(),
    };
    if inner.is_empty() {
        ends.insert(path.to_owned());
    } else {
        tables.insert(path.to_owned());
    }
    inner.into_iter().for_each(|(path, value)| paths(value, &path, ends, tables));
}

#[test]
fn report_keys_are_documented() {
    let (mut ends, mut tables) = (BTreeSet::new(), BTreeSet::new());
    paths(&dir().report("glass.toml"), "", &mut ends, &mut tables);
    let rows = page("docs/report.md").rows("The report");
    let documented: BTreeSet<String> = rows.iter().flat_map(|row| codes(&row[0])).collect();
    let missing: Vec<_> = ends.difference(&documented).collect();
    assert!(missing.is_empty(), "not documented: {missing:?}");
    let known = ends.union(&tables).cloned().collect();
    let unknown: Vec<_> = documented.difference(&known).collect();
    assert!(unknown.is_empty(), "not in the report: {unknown:?}");
}

#[test]
fn progress_keys_are_documented() {
    let rows = page("docs/report.md").rows("Progress as JSON");
    let dir = dir();
    dir.write("broken.toml", "[render]\nheigth = 1\n");
    let mut events = BTreeSet::new();
    for scene in ["glass.toml", "broken.toml"] {
        let output = dir.run(&format!("{scene} --once --progress json"));
        for line in String::from_utf8(output.stderr).expect("UTF-8").lines() {
            let event: Value = serde_json::from_str(line).expect("JSON");
            let name = event["event"].as_str().expect("a name").to_owned();
            let row = rows.iter().find(|row| codes(&row[0]).contains(&name));
            let keys = codes(&row.unwrap_or_else(|| panic!("{name} is not documented"))[1]);
            for key in event.as_object().expect("an object").keys().filter(|key| *key != "event") {
                assert!(keys.contains(key), "{name}: {key}");
            }
            events.insert(name);
        }
    }
    let expected = ["asset", "done", "failed", "progress", "stage", "written"].map(str::to_owned);
    assert_eq!(events, BTreeSet::from(expected));
}
