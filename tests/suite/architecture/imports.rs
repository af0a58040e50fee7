//! Imports of each source file.
//!
//! Each import is resolved to the file that defines the item, through `pub use`. Tests are skipped.

use std::collections::{BTreeMap, BTreeSet};
use std::slice;

/// A module path: `["tui", "view", "layout"]`.
pub(super) type Module = Vec<String>;

/// An imported item, with its path and its name in the importing file.
struct Import {
    path: Vec<String>,
    name: String,
}

/// Modules and their code, without tests.
pub(super) struct Modules {
    texts: BTreeMap<Module, String>,
    imports: BTreeMap<Module, Vec<Import>>,
}

impl Modules {
    /// Parses `(path, source)` pairs. Paths look like `tui/view/layout.rs` or `tui/view/mod.rs`.
    pub(super) fn new(sources: impl Iterator<Item = (String, String)>) -> Self {
        let mut tests = BTreeSet::new();
        let mut texts = BTreeMap::new();
        for (path, source) in sources {
            let module = module(&path);
            let (text, test_modules) = production(&source);
            tests.extend(test_modules.into_iter().map(|name| [module.clone(), vec![name]].concat()));
            texts.insert(module, text);
        }
        texts.retain(|module, _| {
            let is_tests = module.last().is_some_and(|name| name.ends_with("tests"));
            !is_tests && (1..=module.len()).all(|end| !tests.contains(&module[..end]))
        });
        let imports = texts.iter().map(|(module, text)| (module.clone(), imports(text))).collect();
        Self { texts, imports }
    }

    pub(super) fn all(&self) -> impl Iterator<Item = &Module> {
        self.texts.keys()
    }

    /// Whether a file, given as a path like in [`Modules::new`], is compiled without tests.
    pub(super) fn is_production(&self, path: &str) -> bool {
        self.texts.contains_key(&module(path))
    }

    /// Modules that a module imports or names in its code, except its ancestors, whose items it may always
    /// use.
    pub(super) fn used_by(&self, module: &Module) -> BTreeSet<Module> {
        let mut paths: Vec<Vec<String>> = self.imports[module].iter().map(|one| one.path.clone()).collect();
        paths.extend(paths_in(&self.texts[module]).into_iter().map(|path| self.unabbreviated(module, path)));
        let files = paths.iter().filter_map(|path| self.defining(module, path, 0));
        files.filter(|file| !module.starts_with(file)).collect()
    }

    /// Expands the first name in a path used in `module` if that name is imported.
    fn unabbreviated(&self, module: &Module, path: Vec<String>) -> Vec<String> {
        match self.imports[module].iter().find(|one| one.name == path[0]) {
            Some(import) => [import.path.clone(), path[1..].to_vec()].concat(),
            None => path,
        }
    }

    /// The module that defines the item at a path used in `module`. `None` for paths into other packages.
    fn defining(&self, module: &Module, path: &[String], depth: u32) -> Option<Module> {
        assert!(depth < 20, "cyclic re-export of {path:?} in {module:?}");
        let whole = self.absolute(module, path)?;
        let length = (1..=whole.len()).take_while(|end| self.texts.contains_key(&whole[..*end])).last()?;
        let (file, rest) = (whole[..length].to_vec(), &whole[length..]);
        let Some(name) = rest.first() else { return Some(file) };
        let exported = self.imports[&file].iter().find(|one| one.name == *name);
        let further = exported.map(|one| [one.path.clone(), rest[1..].to_vec()].concat());
        further.and_then(|path| self.defining(&file, &path, depth + 1)).or(Some(file))
    }

    /// Makes a path in `module` absolute.
    fn absolute(&self, module: &Module, path: &[String]) -> Option<Vec<String>> {
        let supers = path.iter().take_while(|name| *name == "super").count();
        match path[0].as_str() {
            // In a single-module crate, `crate::` also refers to the module's children.
            "crate" if path.get(1).is_some_and(|name| self.texts.contains_key(slice::from_ref(name))) => {
                Some(path[1..].to_vec())
            }
            "crate" => Some([&module[..1], &path[1..]].concat()),
            "self" => Some([module, &path[1..]].concat()),
            "super" => Some([&module[..module.len().checked_sub(supers)?], &path[supers..]].concat()),
            _ => {
                let child = [&module[..], &path[..1]].concat();
                self.texts.contains_key(&child).then(|| [module, path].concat())
            }
        }
    }
}

fn module(path: &str) -> Module {
    let path = path.trim_end_matches(".rs");
    let path = path.strip_suffix("/mod").or(path.strip_suffix("/lib")).unwrap_or(path);
    path.split('/').map(str::to_owned).collect()
}

/// The source without comments and tests, and the names of its test modules.
fn production(source: &str) -> (String, Vec<String>) {
    let (mut text, mut tests) = (String::new(), Vec::new());
    let mut lines = source.lines();
    while let Some(line) = lines.next() {
        if line.trim() != "#[cfg(test)]" {
            // A visibility such as `pub(in path)` is not a use of the module.
            let code = line.split("//").next().unwrap_or_default();
            let code = code.split("(in crate::").enumerate().map(|(index, part)| match index {
                0 => part,
                _ => part.split_once(')').map_or("", |(_, rest)| rest),
            });
            text.extend(code.chain(["\n"]));
            continue;
        }
        let indent = &line[..line.len() - line.trim_start().len()];
        let Some(item) = lines.find(|line| !line.trim_start().starts_with("#[")) else { break };
        let name = item.trim().trim_end_matches(';').rsplit_once("mod ").map(|(_, name)| name.to_owned());
        tests.extend(name.filter(|_| item.ends_with(';')));
        if !item.ends_with([';', ',', '}']) {
            lines.find(|line| line.strip_prefix(indent).is_some_and(|rest| rest.starts_with(['}', ')'])));
        }
    }
    (text, tests)
}

/// All items that `use` statements import.
fn imports(text: &str) -> Vec<Import> {
    let mut found = Vec::new();
    for (start, _) in text.match_indices("use ") {
        let line = text[..start].rsplit('\n').next().unwrap_or_default().trim();
        let is_use = line.is_empty() || line == "pub" || line.starts_with("pub(") && line.ends_with(')');
        let tree = text[start + 4..].split(';').next().filter(|_| is_use);
        found.extend(tree.into_iter().flat_map(|tree| expanded(&[], tree)));
    }
    found
}

/// The imports of a use tree such as `a::{b, c::{self, d as e}}`.
fn expanded(prefix: &[String], tree: &str) -> Vec<Import> {
    let tree = tree.trim();
    if let Some((head, rest)) = tree.split_once('{') {
        let prefix = [prefix.to_vec(), names(head)].concat();
        let inside = &rest[..rest.rfind('}').expect("a closing brace")];
        return branches(inside).into_iter().flat_map(|branch| expanded(&prefix, branch)).collect();
    }
    let (path, alias) = tree.split_once(" as ").map_or((tree, None), |(path, alias)| (path, Some(alias)));
    let mut path = [prefix.to_vec(), names(path)].concat();
    if path.len() > 1 && path.last().is_some_and(|name| name == "self") {
        path.pop();
    }
    let name = alias.map(str::to_owned).or_else(|| path.last().cloned());
    name.map(|name| Import { path, name }).into_iter().collect()
}

/// Splits a string at commas outside braces.
fn branches(text: &str) -> Vec<&str> {
    let mut depth = 0;
    let parts = text.split(|c: char| {
        depth += i32::from(c == '{') - i32::from(c == '}');
        c == ',' && depth == 0
    });
    parts.filter(|part| !part.trim().is_empty()).collect()
}

fn names(path: &str) -> Vec<String> {
    path.split("::").map(str::trim).filter(|name| !name.is_empty()).map(str::to_owned).collect()
}

/// Paths in the code that have at least two components.
fn paths_in(text: &str) -> Vec<Vec<String>> {
    let words = text.split(|c: char| !(c.is_alphanumeric() || c == '_' || c == ':'));
    words
        .filter(|word| word.contains("::") && !word.starts_with(':'))
        .map(names)
        .filter(|path| path.len() > 1)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn modules(sources: &[(&str, &str)]) -> Modules {
        Modules::new(sources.iter().map(|(path, text)| ((*path).to_owned(), (*text).to_owned())))
    }

    fn used(modules: &Modules, of: &str) -> Vec<String> {
        modules.used_by(&module(of)).iter().map(|module| module.join("/")).collect()
    }

    #[test]
    fn imports_resolve_to_the_defining_file() {
        let modules = modules(&[
            ("a/mod.rs", "mod b;\nmod c;\npub use b::{Thing, other as another};\n"),
            ("a/b.rs", "pub struct Thing;\n"),
            ("a/c.rs", "use crate::a::{self, Thing};\nuse std::fmt;\n"),
            ("a/d.rs", "fn f() { super::another(); crate::a::own() }\n"),
            ("e.rs", "use crate::a::{\n    c::{self},\n    own,\n};\n"),
        ]);
        assert_eq!(used(&modules, "a/c.rs"), ["a/b"], "its parent `a` is skipped");
        assert_eq!(used(&modules, "a/d.rs"), ["a/b"]);
        assert_eq!(used(&modules, "a/mod.rs"), ["a/b"]);
        assert_eq!(used(&modules, "e.rs"), ["a", "a/c"]);
    }

    #[test]
    fn crate_path_may_name_a_child_or_top_module() {
        let modules = modules(&[
            ("a/lib.rs", "mod b;\nmod c;\n"),
            ("a/b.rs", "use crate::c::Thing;\n"),
            ("a/c.rs", "use crate::e::Other;\npub struct Thing;\n"),
            ("e.rs", "pub struct Other;\n"),
        ]);
        assert_eq!(used(&modules, "a/b.rs"), ["a/c"]);
        assert_eq!(used(&modules, "a/c.rs"), ["e"]);
    }

    #[test]
    fn tests_comments_and_visibilities_are_skipped() {
        let modules = modules(&[
            ("a/mod.rs", "mod b;\n#[cfg(test)]\nmod c;\n#[cfg(test)]\nmod tests {\n    use super::b;\n}\n"),
            ("a/b.rs", "// crate::d::x\npub(in crate::d) fn f() {}\n#[cfg(test)]\nuse crate::d::g;\n"),
            ("a/c.rs", "use crate::d::g;\n"),
            ("d.rs", "use crate::a::b::f;\n"),
        ]);
        assert_eq!(modules.all().count(), 3);
        assert_eq!(used(&modules, "a/mod.rs"), [""; 0]);
        assert_eq!(used(&modules, "a/b.rs"), [""; 0]);
        assert_eq!(used(&modules, "d.rs"), ["a/b"]);
    }
}
