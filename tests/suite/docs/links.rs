//! Checks links, images and file names on the pages.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use super::{codes, page, pages, root};

/// Link targets, except web links.
fn targets(text: &str) -> Vec<String> {
    let ends = text.split("](").skip(1).filter_map(|rest| rest.split(')').next());
    ends.filter(|target| !target.starts_with("https://")).map(str::to_owned).collect()
}

/// The anchor of a heading, as GitHub generates it.
fn anchor(heading: &str) -> String {
    let kept = heading.to_lowercase().replace(' ', "-");
    kept.chars().filter(|c| c.is_alphanumeric() || matches!(c, '-' | '_')).collect()
}

#[test]
fn links_have_targets() {
    for from in pages() {
        let folder = Path::new(&from.name).parent().expect("a folder");
        for target in from.prose().flat_map(targets) {
            let (file, place) = target.split_once('#').unwrap_or((&target, ""));
            let path =
                if file.is_empty() { from.name.clone() } else { folder.join(file).display().to_string() };
            assert!(root().join(&path).exists(), "{}: {target}", from.name);
            if !place.is_empty() {
                let to = page(&path);
                let mut headings = to.prose().filter(|line| line.starts_with('#'));
                let is_there = headings.any(|line| anchor(line.trim_start_matches('#').trim()) == place);
                assert!(is_there, "{}: {target}", from.name);
            }
        }
    }
}

#[test]
fn files_mentioned_on_pages_exist() {
    let folders = ["crates/", "src/", "tests/", "scenes/", "assets/", "benches/", "docs/", ".ci/"];
    // Generated files, which are not in the repository.
    let made = ["assets/million.ply", "assets/figure.ply"];
    for page in pages() {
        let names = page.prose().flat_map(codes).collect::<BTreeSet<_>>();
        let words = names.iter().flat_map(|name| name.split_whitespace());
        for word in words.filter(|word| folders.iter().any(|folder| word.starts_with(folder))) {
            assert!(made.contains(&word) || root().join(word).exists(), "{}: {word}", page.name);
        }
    }
}

#[test]
fn every_picture_is_shown() {
    let shown: BTreeSet<String> = pages()
        .iter()
        .flat_map(|page| page.prose().flat_map(targets).collect::<Vec<_>>())
        .filter_map(|target| Some(target.split_once("pictures/")?.1.to_owned()))
        .collect();
    let folder = fs::read_dir(root().join("assets/pictures")).expect("the pictures folder");
    let there = folder.map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned());
    let there: BTreeSet<String> = there.filter(|name| name.contains('.') && !name.ends_with(".py")).collect();
    let other: Vec<_> = there.difference(&shown).collect();
    assert!(other.is_empty(), "pictures not shown on any page: {other:?}");
}

#[test]
fn anchors_match_github() {
    assert_eq!(anchor("Files, streams, and exit codes"), "files-streams-and-exit-codes");
    assert_eq!(anchor("Compared with Mitsuba 3.9"), "compared-with-mitsuba-39");
    assert_eq!(anchor("`[[mesh]]`"), "mesh");
}
