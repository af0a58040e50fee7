//! `glimt import`: a scene of a file of another program.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use super::args::ImportArgs;
use super::check::count;
use super::console::Console;
use super::exit::Exit;
use crate::output::{OutputError, write};
use crate::pipeline::{Imported, import};
use crate::scene::diagnostic::{Diagnostic, Severity};

pub(super) fn run(args: &ImportArgs, console: &Console) -> Exit {
    let scene = match &args.output {
        Some(output) => output.clone(),
        None => PathBuf::from(args.file.with_extension("toml").file_name().unwrap_or_default()),
    };
    let Some(name) = scene.file_stem().filter(|_| has_ending(&scene)) else {
        let shown = scene.display();
        return console.fail(Exit::WRONG, &format!("{shown} is no name of a scene: it must end in .toml"));
    };
    // Files that are there stay: look before the work.
    let folder = format!("{}_files", name.to_string_lossy());
    let beside = scene.with_file_name(&folder);
    if let Some(there) = [&scene, &beside].into_iter().find(|path| path.symlink_metadata().is_ok()) {
        return console
            .fail(Exit::WRONG, &format!("{} exists already, and is left as it is", there.display()));
    }
    let imported = match import(&args.file, &folder) {
        Ok(imported) => imported,
        Err(message) => return console.fail(Exit::WRONG, &message),
    };
    tell_notes(&args.file, &imported.notes, console);
    if args.strict && !imported.notes.is_empty() {
        let what = count(imported.notes.len() as u64, "approximation");
        return console.fail(Exit::FAILED, &format!("{what} with --strict: nothing is written"));
    }
    match write_all(&scene, &imported) {
        Ok(()) => {
            let files = count(imported.files.len() as u64, "file");
            console.say(&format!("wrote {}, and {files} in {}", scene.display(), beside.display()));
            Exit::DONE
        }
        Err(error) => console.fail(Exit::FAILED, &error.to_string()),
    }
}

/// Whether a scene would be found by its name.
fn has_ending(scene: &Path) -> bool {
    scene.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("toml"))
}

/// Names each approximation, then counts them.
fn tell_notes(file: &Path, notes: &[String], console: &Console) {
    let warning = |note: &String| Diagnostic {
        severity: Severity::Warning,
        message: note.clone(),
        path: file.to_owned(),
        place: None,
        help: None,
    };
    console.diagnostics(&notes.iter().map(warning).collect::<Vec<_>>());
    if !notes.is_empty() {
        console.say(&format!("{} in all", count(notes.len() as u64, "approximation")));
    }
}

/// Writes the other files, then the scene, none of them over a file.
fn write_all(scene: &Path, imported: &Imported) -> Result<(), OutputError> {
    let folder = scene.parent().unwrap_or(Path::new(""));
    let at = |path: PathBuf| move |source| OutputError::File { path, source };
    for (name, bytes) in &imported.files {
        let path = folder.join(name);
        let inside = path.parent().unwrap_or(folder);
        match std::fs::create_dir(inside) {
            Err(error) if error.kind() != ErrorKind::AlreadyExists => {
                return Err(at(inside.to_owned())(error));
            }
            Ok(()) | Err(_) => {}
        }
        write::new_file(&path, bytes).map_err(at(path.clone()))?;
    }
    write::new_file(scene, imported.text.as_bytes()).map_err(at(scene.to_owned()))
}
