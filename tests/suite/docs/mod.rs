//! Checks the user documentation against the program: commands run, scenes are valid, and tables are
//! complete.

mod commands;
mod links;
mod options;
mod reports;
mod scenes;
mod tables;

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// A Markdown page.
struct Page {
    /// Path relative to the repository root.
    name: String,
    text: String,
}

/// A fenced block on a page.
struct Block {
    /// Line number of the opening fence, from 1.
    line: usize,
    text: String,
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// README, other pages in the root folder, and the pages in `docs`.
fn pages() -> Vec<Page> {
    let beside = ["README.md", "CONTRIBUTING.md", "CHANGELOG.md"].map(PathBuf::from);
    let inside = fs::read_dir(root().join("docs")).expect("the docs folder");
    let inside = inside.map(|entry| Path::new("docs").join(entry.expect("an entry").file_name()));
    let is_page = |path: &PathBuf| path.extension().is_some_and(|ending| ending == "md");
    let mut names: Vec<PathBuf> = beside.into_iter().chain(inside.filter(is_page)).collect();
    names.sort();
    names.iter().map(|name| page(&name.to_string_lossy())).collect()
}

fn page(name: &str) -> Page {
    let path = root().join(name);
    assert!(path.is_file(), "page {name} not found");
    Page { name: name.to_owned(), text: fs::read_to_string(path).expect("a text") }
}

impl Page {
    /// The fenced blocks in the given language.
    fn blocks(&self, language: &str) -> Vec<Block> {
        let mut blocks = Vec::new();
        let mut open: Option<(usize, &str, String)> = None;
        for (index, line) in self.text.lines().enumerate() {
            match (&mut open, line.strip_prefix("```")) {
                (None, Some(language)) => open = Some((index + 1, language, String::new())),
                (Some(_), Some(_)) => {
                    let (line, of, text) = open.take().expect("it is open");
                    if of == language {
                        blocks.push(Block { line, text });
                    }
                }
                (Some((.., text)), None) => text.push_str(&format!("{line}\n")),
                (None, None) => {}
            }
        }
        assert!(open.is_none(), "{}: unclosed fence", self.name);
        blocks
    }

    /// Lines outside fenced blocks.
    fn prose(&self) -> impl Iterator<Item = &str> {
        let mut is_open = false;
        self.text.lines().filter(move |line| {
            let is_fence = line.starts_with("```");
            is_open ^= is_fence;
            !is_open && !is_fence
        })
    }

    /// Headings with the cells of the table rows below them, excluding header rows.
    fn tables(&self) -> Vec<(String, Vec<Vec<String>>)> {
        let mut tables = vec![(String::new(), Vec::new())];
        let mut was_row = false;
        for line in self.prose() {
            if line.starts_with('#') {
                tables.push((line.trim_start_matches('#').trim().to_owned(), Vec::new()));
            }
            let is_row = line.starts_with('|');
            if is_row && was_row && !line.starts_with("| ---") {
                let (_, rows) = tables.last_mut().expect("at least one heading");
                rows.push(cells(line));
            }
            was_row = is_row;
        }
        tables
    }

    /// The table rows below a heading.
    fn rows(&self, heading: &str) -> Vec<Vec<String>> {
        let found = self.tables().into_iter().find(|(name, _)| name == heading);
        let rows = found.map(|(_, rows)| rows).unwrap_or_default();
        assert!(!rows.is_empty(), "{}: no table below {heading:?}", self.name);
        rows
    }
}

/// The cells of a row. `\|` is an escaped bar.
fn cells(row: &str) -> Vec<String> {
    let row = row.replace("\\|", "\u{0}");
    let inner = row.trim().trim_start_matches('|').trim_end_matches('|');
    inner.split('|').map(|cell| cell.trim().replace('\u{0}', "|")).collect()
}

/// The strings in backquotes.
fn codes(text: &str) -> BTreeSet<String> {
    text.split('`').skip(1).step_by(2).map(str::to_owned).collect()
}

#[test]
fn readme_is_short() {
    assert!(page("README.md").text.lines().count() <= 160);
}
