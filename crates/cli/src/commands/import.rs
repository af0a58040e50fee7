//! `glimt import`: converts a foreign file to a scene.

use std::path::{Path, PathBuf};

use crate::args::ImportArgs;
use crate::commands::check::format_count;
use crate::console::Console;
use crate::control::CancelToken;
use crate::exit::Exit;
use crate::output::OutputError;
use crate::output::staged::create_files_atomically;
use crate::pipeline::protocol::Failure;
use crate::pipeline::{
    ImportError, ImportedScene, check_scene_with_options, has_foreign_extension, has_model_extension,
    import_scene,
};
use crate::scene::diagnostic::Diagnostic;
use crate::scene::has_toml_extension;
use crate::signals;

pub(crate) fn run(args: &ImportArgs, console: &Console) -> Exit {
    signals::run_cancelable_by_signals(console, |token| convert_and_write(args, console, token))
}

/// Converts the file. Does not report an error if the token is canceled.
fn convert_and_write(args: &ImportArgs, console: &Console, token: &CancelToken) -> Exit {
    let scene = match &args.output {
        Some(output) => output.clone(),
        None => PathBuf::from(args.file.with_extension("toml").file_name().unwrap_or_default()),
    };
    let Some(name) = scene.file_stem().filter(|_| has_toml_extension(&scene)) else {
        let shown = scene.display();
        return console
            .print_error(Exit::WRONG, &format!("{shown} is not a scene file name: it must end in .toml"));
    };
    // Never overwrite files, so check before converting.
    let folder = format!("{}_files", name.to_string_lossy());
    let beside = scene.with_file_name(&folder);
    if let Some(there) = [&scene, &beside].into_iter().find(|path| path.symlink_metadata().is_ok()) {
        return console.print_error(
            Exit::WRONG,
            &format!("{} already exists; choose another scene with -o", there.display()),
        );
    }
    let options = args.foreign.options();
    // A scene may come from a stranger. Its files are copied only if they are meshes and images, so that it
    // cannot obtain private files.
    if !has_model_extension(&args.file) && has_foreign_extension(&args.file) {
        match check_scene_with_options(&args.file, &[], &options, token) {
            Ok(_) => {}
            Err(_) if token.is_canceled() => return Exit::FAILED,
            Err(Failure::Scene(diagnostics)) => {
                console.print_diagnostics(&diagnostics);
                return Exit::WRONG;
            }
            Err(Failure::Work(message)) => return console.print_error(Exit::FAILED, &message),
        }
    }
    let imported = match import_scene(&args.file, &folder, &options, token) {
        Ok(imported) => imported,
        Err(_) if token.is_canceled() => return Exit::FAILED,
        Err(ImportError::Scene(diagnostics)) => {
            console.print_diagnostics(&diagnostics);
            return Exit::WRONG;
        }
        Err(ImportError::File(message)) => return console.print_error(Exit::WRONG, &message),
        Err(ImportError::Work(message)) => return console.print_error(Exit::FAILED, &message),
    };
    report_approximations(&imported.substitutions, console);
    console.print_diagnostics(&imported.notes);
    if args.foreign.strict && !imported.substitutions.is_empty() {
        let what = format_count(imported.substitutions.len() as u64, "approximation");
        return console.print_error(Exit::WRONG, &format!("{what} with --strict: nothing was written"));
    }
    match write_all(&scene, &imported, token) {
        Ok(()) => {
            let files = format_count(imported.files.len() as u64, "file");
            console.print_line_to_stderr(&format!(
                "wrote {} and {files} in {}",
                scene.display(),
                beside.display()
            ));
            Exit::DONE
        }
        Err(OutputError::Canceled(_)) => Exit::FAILED,
        Err(error) => console.print_error(Exit::FAILED, &error.to_string()),
    }
}

/// Prints all approximations and their number.
fn report_approximations(substitutions: &[Diagnostic], console: &Console) {
    console.print_diagnostics(substitutions);
    if !substitutions.is_empty() {
        let count = format_count(substitutions.len() as u64, "approximation");
        console.print_line_to_stderr(&format!("{count} in total"));
    }
}

/// Writes all files or none. The scene is written last.
fn write_all(scene: &Path, imported: &ImportedScene, token: &CancelToken) -> Result<(), OutputError> {
    let name = PathBuf::from(scene.file_name().unwrap_or_default());
    let text = imported.document.to_toml();
    let others = imported.files.iter().map(|(name, bytes)| (name.clone(), bytes.as_slice()));
    let files: Vec<_> = others.chain([(name, text.as_bytes())]).collect();
    create_files_atomically(scene.parent().unwrap_or(Path::new("")), &files, token)
}
