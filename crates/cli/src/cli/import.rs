//! `glimt import`: a scene of a file of another program.

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
        return console.fail(
            Exit::WRONG,
            &format!("{} exists already, and is left as it is; name another scene with -o", there.display()),
        );
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

/// Writes the other files, then the scene, none of them over a file. After an error, nothing of this is left.
fn write_all(scene: &Path, imported: &Imported) -> Result<(), OutputError> {
    let mut made = Vec::new();
    let written = write_each(scene, imported, &mut made);
    if written.is_err() {
        // Folders stay if somebody else has put a file there. The caller reports the error in any case.
        for path in made.iter().rev() {
            let _ = if path.is_dir() { std::fs::remove_dir(path) } else { std::fs::remove_file(path) };
        }
    }
    written
}

/// Writes the files; adds to `made` what is new, folders before their files.
fn write_each(scene: &Path, imported: &Imported, made: &mut Vec<PathBuf>) -> Result<(), OutputError> {
    let folder = scene.parent().unwrap_or(Path::new(""));
    let at = |path: &Path| {
        let path = path.to_owned();
        move |source| OutputError::File { path, source }
    };
    let files = imported.files.iter().map(|(name, bytes)| (folder.join(name), bytes.as_slice()));
    for (path, bytes) in files.chain([(scene.to_owned(), imported.text.as_bytes())]) {
        let inside = path.parent().unwrap_or(folder);
        if inside != folder && !made.iter().any(|known| known == inside) {
            std::fs::create_dir(inside).map_err(at(inside))?;
            made.push(inside.to_owned());
        }
        write::new_file(&path, bytes).map_err(at(&path))?;
        made.push(path);
    }
    Ok(())
}
