//! `glimt new`: writes a starter scene to a file or stdout.

use std::borrow::Cow;
use std::io::ErrorKind;
use std::path::Path;

use crate::args::SchemaDraft;
use crate::commands::schema;
use crate::console::Console;
use crate::exit::Exit;
use crate::output::{self, Format, OutputError, write};
use crate::pipeline::has_model_extension;
use crate::scene::sanitize::escape_invisible_chars;
use crate::scene::starter_scene;

pub(crate) fn run(file: &Path, with_schema: bool, console: &Console) -> Exit {
    let text =
        if with_schema { format!("{}{}", schema::LINE, starter_scene()) } else { starter_scene().to_owned() };
    if file == Path::new("-") {
        if with_schema {
            let name = schema::FILE;
            console.print_line_to_stderr(&format!(
                "note: to create {name} next to the scene, run: glimt schema > {name}"
            ));
        }
        console.print_trusted_text(&text);
        return Exit::DONE;
    }
    if let Some(message) = message_if_image_or_mesh_extension(file) {
        return console.print_error(Exit::WRONG, &message);
    }
    // Do not write the schema if the scene cannot be written.
    let is_free = file.symlink_metadata().is_err();
    let schema = file.with_file_name(schema::FILE);
    if with_schema && is_free {
        match write_schema(&schema) {
            Ok(true) => console.print_line_to_stderr(&format!("wrote {}", schema.display())),
            Ok(false) => {}
            Err((exit, message)) => return console.print_error(exit, &message),
        }
    }
    let name = file.display();
    match write::write_new_file(file, text.as_bytes()) {
        Ok(()) => {
            console.print_line_to_stderr(&format!("wrote {name}"));
            if let Some(file) = quote_file_name_for_shell(file) {
                console.print_line_to_stderr(&format!(
                    "now: glimt {file}    (edit and save it to update the image; ? for help)"
                ));
            }
            Exit::DONE
        }
        Err(error) if error.kind() == ErrorKind::AlreadyExists || file.is_dir() => {
            let dangles = !file.exists();
            let what =
                if dangles { "is a symbolic link to a file that does not exist" } else { "already exists" };
            console.print_error(Exit::WRONG, &format!("{name} {what}"))
        }
        Err(source) => {
            // Prefer the more specific error about the folder.
            let of_place = output::check_output_is_writable(file).err();
            let error = of_place.unwrap_or_else(|| OutputError::File { path: file.to_owned(), source });
            console.print_error(Exit::FAILED, &error.to_string())
        }
    }
}

/// Writes the schema next to a scene. Returns `false` if an identical file exists.
///
/// # Errors
/// Returns an error if a different file with this name exists, or if the file cannot be written.
fn write_schema(path: &Path) -> Result<bool, (Exit, String)> {
    let text = schema::schema_text(SchemaDraft::Four);
    match write::write_new_file(path, text.as_bytes()) {
        Ok(()) => Ok(true),
        Err(error) if error.kind() == ErrorKind::AlreadyExists => match std::fs::read(path) {
            Ok(there) if there == text.as_bytes() => Ok(false),
            Ok(_) | Err(_) => {
                let name = path.display();
                Err((
                    Exit::WRONG,
                    format!("{name} differs from the schema of this version: remove it, or omit --schema"),
                ))
            }
        },
        Err(source) => Err((Exit::FAILED, OutputError::File { path: path.to_owned(), source }.to_string())),
    }
}

/// Returns the error message for a scene file with an image or mesh extension.
fn message_if_image_or_mesh_extension(file: &Path) -> Option<String> {
    let what = if has_model_extension(file) {
        "a mesh"
    } else if Format::from_path(file).is_ok() {
        "an image"
    } else {
        return None;
    };
    let command =
        quote_file_name_for_shell(&file.with_extension("toml")).map(|scene| format!(": glimt new {scene}"));
    Some(format!(
        "{} has the extension of {what}; use .toml for scenes{}",
        file.display(),
        command.unwrap_or_default()
    ))
}

/// Quotes a file name for a shell and ensures that glimt does not mistake it for an option or a command.
/// Returns `None` if the name is not safe to print.
fn quote_file_name_for_shell(file: &Path) -> Option<String> {
    let name = file.to_str().filter(|name| escape_invisible_chars(name) == *name)?;
    let is_bare = !name.contains(['/', '.']) || name.starts_with('-');
    let name = if is_bare { format!("./{name}") } else { name.to_owned() };
    shlex::try_quote(&name).ok().map(Cow::into_owned)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_quoted_for_the_shell() {
        for name in
            ["ball.toml", "my scene.toml", "it's.toml", "a \"b\" $HOME `c`.toml", "a;b.toml", "tilde~.toml"]
        {
            let words = quote_file_name_for_shell(Path::new(name)).and_then(|word| shlex::split(&word));
            assert_eq!(words, Some(vec![name.to_owned()]), "{name}");
        }
        for (name, word) in [
            ("ball.toml", Some("ball.toml")),
            ("-b.toml", Some("./-b.toml")),
            ("check", Some("./check")),
            ("new\nline.toml", None),
        ] {
            assert_eq!(quote_file_name_for_shell(Path::new(name)).as_deref(), word);
        }
    }
}
