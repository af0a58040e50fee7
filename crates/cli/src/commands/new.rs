//! `glimt new`: a scene to start from, as a file or on stdout.

use std::borrow::Cow;
use std::io::ErrorKind;
use std::path::Path;

use crate::args::Draft;
use crate::commands::schema;
use crate::console::Console;
use crate::exit::Exit;
use crate::output::{self, Format, OutputError, write};
use crate::scene::sanitize::visible;
use crate::scene::{is_mesh, starter};

pub(crate) fn run(file: &Path, with_schema: bool, console: &Console) -> Exit {
    let text = if with_schema { format!("{}{}", schema::LINE, starter()) } else { starter().to_owned() };
    if file == Path::new("-") {
        if with_schema {
            let name = schema::FILE;
            console.say(&format!(
                "note: {name} is not written: glimt schema > {name} writes it beside the scene"
            ));
        }
        console.text(&text);
        return Exit::DONE;
    }
    if let Some(message) = misnamed(file) {
        return console.fail(Exit::WRONG, &message);
    }
    // A scene that is refused leaves no schema behind.
    let is_free = file.symlink_metadata().is_err();
    let schema = file.with_file_name(schema::FILE);
    if with_schema && is_free {
        match write_schema(&schema) {
            Ok(true) => console.say(&format!("wrote {}", schema.display())),
            Ok(false) => {}
            Err((exit, message)) => return console.fail(exit, &message),
        }
    }
    let name = file.display();
    match write::new_file(file, text.as_bytes()) {
        Ok(()) => {
            console.say(&format!("wrote {name}"));
            if let Some(file) = quoted(file) {
                console.say(&format!(
                    "now: glimt {file}    (see it, edit it, save it, see it again; ? for help)"
                ));
            }
            Exit::DONE
        }
        Err(error) if error.kind() == ErrorKind::AlreadyExists || file.is_dir() => {
            let dangles = !file.exists();
            let what =
                if dangles { "is a symbolic link to a file that does not exist" } else { "exists already" };
            console.fail(Exit::WRONG, &format!("{name} {what}, and is left as it is"))
        }
        Err(source) => {
            // Whoever can say more of the place comes first.
            let of_place = output::check_place(file).err();
            let error = of_place.unwrap_or_else(|| OutputError::File { path: file.to_owned(), source });
            console.fail(Exit::FAILED, &error.to_string())
        }
    }
}

/// Writes the schema beside a scene; returns whether it was not there. One that is there already will do if it is the same.
///
/// # Errors
/// Another file of that name, or no way to write one.
fn write_schema(path: &Path) -> Result<bool, (Exit, String)> {
    let text = schema::text(Draft::Four);
    match write::new_file(path, text.as_bytes()) {
        Ok(()) => Ok(true),
        Err(error) if error.kind() == ErrorKind::AlreadyExists => match std::fs::read(path) {
            Ok(there) if there == text.as_bytes() => Ok(false),
            Ok(_) | Err(_) => {
                let name = path.display();
                Err((
                    Exit::WRONG,
                    format!(
                        "{name} is not the schema of this glimt, and is left as it is: remove it, or leave out --schema"
                    ),
                ))
            }
        },
        Err(source) => Err((Exit::FAILED, OutputError::File { path: path.to_owned(), source }.to_string())),
    }
}

/// Message about a name of a picture or a mesh: nobody would find the scene there, and a render writes pictures.
fn misnamed(file: &Path) -> Option<String> {
    let what = if is_mesh(file) {
        "a mesh"
    } else if is_picture(file) {
        "a picture"
    } else {
        return None;
    };
    let command = quoted(&file.with_extension("toml")).map(|scene| format!(": glimt new {scene}"));
    Some(format!(
        "{} is the name of {what}; scenes end in .toml{}",
        file.display(),
        command.unwrap_or_default()
    ))
}

/// A file as a shell takes it for one word, and glimt for no option and no command. `None` if a terminal does not show the name as
/// it is.
fn quoted(file: &Path) -> Option<String> {
    let name = file.to_str().filter(|name| visible(name) == *name)?;
    let is_bare = !name.contains(['/', '.']) || name.starts_with('-');
    let name = if is_bare { format!("./{name}") } else { name.to_owned() };
    shlex::try_quote(&name).ok().map(Cow::into_owned)
}

/// Whether a name is that of a picture, of a format that glimt writes.
fn is_picture(file: &Path) -> bool {
    Format::of(file).is_ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_one_word_for_a_shell() {
        for name in
            ["ball.toml", "my scene.toml", "it's.toml", "a \"b\" $HOME `c`.toml", "a;b.toml", "tilde~.toml"]
        {
            let words = quoted(Path::new(name)).and_then(|word| shlex::split(&word));
            assert_eq!(words, Some(vec![name.to_owned()]), "{name}");
        }
        for (name, word) in [
            ("ball.toml", Some("ball.toml")),
            ("-b.toml", Some("./-b.toml")),
            ("check", Some("./check")),
            ("new\nline.toml", None),
        ] {
            assert_eq!(quoted(Path::new(name)).as_deref(), word);
        }
    }
}
