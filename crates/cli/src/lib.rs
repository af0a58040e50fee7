//! The command line: arguments, the headless front end, and the wiring of the terminal's.
//!
//! Arguments ([`args`]) are turned into their meaning (`lower`) before anything is done.

pub mod args;
pub mod bench;
pub mod commands;
mod console;
mod diagnostic_json;
pub mod environment;
mod exit;
mod live;
mod lower;
mod merge_block;
mod once;
mod progress;
mod signals;

// Modules of lower crates, under the names used throughout the workspace.
use glimt_base::{choice, control, film, math, system};
use glimt_files::{compare, output};
use glimt_kernel::accel;
use glimt_pipeline as pipeline;
use glimt_scene as scene;
use glimt_tui as tui;

use std::ffi::OsString;
use std::io::{self, Write};
use std::path::Path;

use clap::Parser;

use self::args::{Args, Subcommand};
use self::console::Console;
pub use self::exit::Exit;
use crate::scene::nearest::nearest;
use crate::scene::sanitize::visible;

/// Do what the command line says; gives the exit code.
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> Exit {
    crate::output::write::prepare_process();
    // Without the handler an abort ends the process as it always did.
    let _ = crate::system::abort::catch();
    let arguments: Vec<OsString> = arguments.into_iter().collect();
    if let Some(exit) = commands::completions::answer(&arguments) {
        return exit;
    }
    if arguments.len() <= 1 {
        return bare();
    }
    let args = match Args::try_parse_from(&arguments) {
        Ok(args) => args,
        Err(error) => return misunderstood(&error, &arguments),
    };
    let console = Console::new(args.color());
    let exit = match args.command {
        Some(Subcommand::Check { scene, sets, json, .. }) => {
            commands::check::run(&scene, &sets, json, &console)
        }
        Some(Subcommand::New { file, schema }) => commands::new::run(&file, schema, &console),
        Some(Subcommand::Import(args)) => commands::import::run(&args, &console),
        Some(Subcommand::Info(args)) => commands::info::run(&args, &console),
        Some(Subcommand::Compare(args)) => commands::compare::run(&args, &console),
        Some(Subcommand::Bench(args)) => commands::bench::run(&args, &console),
        Some(Subcommand::Merge(args)) => commands::merge::run(&args, &console),
        Some(Subcommand::Farm(args)) => commands::farm::run(&args, &console),
        Some(Subcommand::Completions { shell }) => commands::completions::run(shell, &console),
        Some(Subcommand::Man { command }) => commands::man::run(command.as_deref(), &console),
        Some(Subcommand::Explain { key }) => commands::explain::run(key.as_deref(), &console),
        Some(Subcommand::Schema { draft }) => commands::schema::run(draft, &console),
        Some(Subcommand::Lsp { .. }) => commands::lsp::run(&console),
        Some(Subcommand::Doctor) => commands::doctor::run(&console),
        None => match lower::lower(args.render) {
            Ok(order) => match no_command(&order.scene) {
                Some(message) => console.fail(Exit::WRONG, &message),
                None => render(order, &console),
            },
            Err(message) => console.fail(Exit::WRONG, &message),
        },
    };
    console.end(exit)
}

fn render(order: lower::Order, console: &Console) -> Exit {
    // JSON lines have their own form of the same error.
    let refused = (!order.is_in_json()).then(|| commands::info::instead_of_scene(&order.scene, console));
    match refused.flatten() {
        Some(exit) => exit,
        None if order.is_once => once::run(&order, console),
        None => live::run(order, console),
    }
}

/// The way to begin, for a call without a word.
const BEGIN: &str = "\
glimt renders a scene file here in the terminal, again on every save.

  glimt new ball.toml     write a scene to start from
  glimt ball.toml         see it; edit it in an editor, save, and see it again
  glimt helmet.glb        see a model

`glimt -h` lists commands and options.";

/// A call without a word: no scene is given, which is wrong, and the way to one is shown.
fn bare() -> Exit {
    Console::new(crate::tui::ColorChoice::Auto).say_lines(BEGIN);
    Exit::WRONG
}

/// Help and the version are answers; everything else is a wrong call.
fn misunderstood(error: &clap::Error, arguments: &[OsString]) -> Exit {
    let console = Console::new(crate::tui::ColorChoice::Auto);
    if !error.use_stderr() {
        console.note(error.print().and_then(|()| io::stdout().flush()));
        return console.end(Exit::DONE);
    }
    if let Some(message) = second_scene(error).and_then(|_| unknown_command(arguments)) {
        return console.fail(Exit::WRONG, &message);
    }
    if let Some(second) = second_scene(error) {
        let message = format!("{second:?} is one scene too many: glimt renders one at a time");
        return console.fail(Exit::WRONG, &message);
    }
    // The message has the arguments in it: made again of what may be shown of them.
    let shown = arguments.iter().map(|argument| visible(&argument.to_string_lossy()).into_owned());
    match Args::try_parse_from(shown) {
        Err(error) if error.use_stderr() => {
            let _ = error.print();
        }
        _ => console.say_lines(&error.render().to_string()),
    }
    Exit::WRONG
}

/// Message about a first word that is neither a file nor looks like one: a command was meant.
fn unknown_command(arguments: &[OsString]) -> Option<String> {
    // A later word may be the value of an option.
    no_command(Path::new(arguments.get(1)?))
}

/// The same of a word where a scene stands.
fn no_command(word: &Path) -> Option<String> {
    let first = word.to_string_lossy();
    if first.contains(['.', '/']) || first.starts_with('-') || word.symlink_metadata().is_ok() {
        return None;
    }
    let commands = <Args as clap::CommandFactory>::command();
    let names: Vec<&str> = commands.get_subcommands().map(clap::Command::get_name).collect();
    let help = match nearest(&first, names.iter().copied()) {
        Some(near) => format!("did you mean `{near}`?"),
        None => format!("there are {}", names.join(", ")),
    };
    Some(format!("there is no command {:?}, nor a scene of that name: {help}", visible(&first)))
}

/// The word behind the scene, where a command could stand, that is no command.
fn second_scene(error: &clap::Error) -> Option<&str> {
    use clap::error::{ContextKind, ContextValue, ErrorKind};
    let word = match error.get(ContextKind::InvalidSubcommand).or(error.get(ContextKind::InvalidArg)) {
        Some(ContextValue::String(word)) if error.kind() == ErrorKind::ArgumentConflict => word,
        _ => return None,
    };
    let is_command = <Args as clap::CommandFactory>::command().find_subcommand(word).is_some();
    (!is_command && !word.starts_with(['-', '<'])).then_some(word)
}
