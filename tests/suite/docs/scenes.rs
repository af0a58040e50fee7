//! Checks the scenes on the pages. Whole scenes are checked unchanged. Fragments are first completed with the
//! elements that they refer to.

use std::collections::BTreeSet;

use glimt::scene::parse;

use super::{Block, pages, root};
use crate::contract::errors;

const CAMERA: &str = "\n[camera]\nposition = [0, 1, 4]\nlook_at = [0, 1, 0]\n";

/// The names after a key, such as the material in `material = "clay"`.
fn names(text: &str, before: &str) -> BTreeSet<String> {
    let rests = text.split(before).skip(1);
    rests.filter_map(|rest| rest.split('"').next()).map(str::to_owned).collect()
}

/// Completes a fragment with a camera, and with the materials and textures that it uses but does not define.
fn completed(fragment: &str) -> String {
    let mut text = format!("{fragment}{CAMERA}");
    let has = |kind: &str, name: &str| {
        let short = fragment.contains(&format!("[{kind}]\n")) && fragment.contains(&format!("\n{name} = {{"));
        short || fragment.contains(&format!("[{kind}.{name}]"))
    };
    for name in names(fragment, "material = \"").iter().filter(|name| !has("materials", name)) {
        text.push_str(&format!("\n[materials.{name}]\n"));
    }
    for name in names(fragment, "texture = \"").iter().filter(|name| !has("textures", name)) {
        text.push_str(&format!("\n[textures.{name}]\nfile = \"../assets/textures/checker.png\"\n"));
    }
    text
}

#[test]
fn page_scenes_are_valid() {
    let mut count = 0;
    for page in pages() {
        for Block { line, text } in page.blocks("toml") {
            let is_whole = text.contains("[camera]\n");
            let text = if is_whole { text } else { completed(&text) };
            let outcome = parse(text.as_str().into(), &root().join("scenes/page.toml"));
            assert_eq!(errors(&outcome.diagnostics), [""; 0], "{}:{line}\n{text}", page.name);
            let said: Vec<_> = outcome.diagnostics.iter().map(|one| &one.message).collect();
            assert!(!is_whole || said.is_empty(), "{}:{line}: {said:?}", page.name);
            count += 1;
        }
    }
    assert!(count >= 6, "{count} scenes");
}
