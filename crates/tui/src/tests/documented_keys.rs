//! Compares the key tables in `docs/terminal.md` with the key bindings.

use std::collections::BTreeSet;
use std::fs;

use crate::event::KeyPress;
use crate::keymap::{KEYMAP, OVERLAY, action_for_key, overlay_action_for_key};

/// Returns the keys in the first column of the documentation's key tables.
fn documented() -> BTreeSet<String> {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/terminal.md");
    let page = fs::read_to_string(path).expect("the page");
    let chapter = page.split("\n## ").find(|chapter| chapter.starts_with("Keys\n")).expect("a chapter");
    let cells = chapter.lines().filter_map(|line| line.strip_prefix("| ")?.split(" | ").next());
    cells.flat_map(|cell| cell.split('`').skip(1).step_by(2)).map(str::to_owned).collect()
}

/// The keys listed in the help.
fn written() -> BTreeSet<String> {
    let labels = KEYMAP.iter().map(|one| one.label).chain(OVERLAY.iter().map(|one| one.label));
    labels
        .flat_map(|label| label.split([' ', ',']))
        .filter(|key| !key.is_empty())
        .map(str::to_owned)
        .collect()
}

#[test]
fn documented_keys_match_key_bindings() {
    let (documented, written) = (documented(), written());
    let missing: Vec<_> = written.difference(&documented).collect();
    assert!(missing.is_empty(), "not documented: {missing:?}");
    for key in documented.difference(&written) {
        let press = key.chars().next().filter(|_| key.chars().count() == 1).map(KeyPress::plain);
        let is_bound =
            press.is_some_and(|key| action_for_key(key).is_some() || overlay_action_for_key(key).is_some());
        assert!(is_bound, "not bound: {key}");
    }
}
