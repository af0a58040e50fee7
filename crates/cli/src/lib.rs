//! The command line: arguments, the headless front end, and the setup of the terminal UI.
//!
//! Arguments ([`args`]) are validated and converted to a request (`lower`) before any work starts.

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

// Modules of lower-level crates, under the names used throughout the workspace.
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
use crate::scene::nearest::nearest_name;
use crate::scene::sanitize::escape_invisible_chars;

/// Makes any use of rayon's global thread pool panic in debug builds, because that pool ignores `--threads`
/// and panics if the system is out of threads. The initialization here fails, and rayon does not retry it.
#[cfg(debug_assertions)]
fn forbid_global_pool() {
    let refuse = |_| Err(std::io::Error::other("the global pool is not used"));
    let _ = rayon::ThreadPoolBuilder::new().num_threads(1).spawn_handler(refuse).build_global();
}

/// Runs a command line and returns its exit code.
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> Exit {
    #[cfg(debug_assertions)]
    forbid_global_pool();
    crate::output::write::ignore_file_size_signal();
    // Without the handler, an abort ends the process as usual.
    let _ = crate::system::abort::install_abort_handler();
    let arguments: Vec<OsString> = arguments.into_iter().collect();
    if let Some(exit) = commands::completions::answer_completion_request(&arguments) {
        return exit;
    }
    if arguments.len() <= 1 {
        return print_getting_started();
    }
    let args = match Args::try_parse_from(&arguments) {
        Ok(args) => args,
        Err(error) => return report_parse_error(&error, &arguments),
    };
    let console = Console::new(args.color_depth_choice());
    let exit = match args.command {
        Some(Subcommand::Check { scene, sets, json, foreign, .. }) => {
            commands::check::run(&scene, &sets, &foreign.options(), json, &console)
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
        None => match lower::lower_args(args.render) {
            Ok(request) => match message_if_mistyped_command(&request.scene) {
                Some(message) => console.print_error(Exit::WRONG, &message),
                None => render(request, &console),
            },
            Err(message) => console.print_error(Exit::WRONG, &message),
        },
    };
    console.final_exit_code(exit)
}

fn render(request: lower::RenderRequest, console: &Console) -> Exit {
    match commands::info::report_image_instead_of_scene(
        &request.scene,
        request.reports_json_errors(),
        console,
    ) {
        Some(exit) => exit,
        None if request.is_once => once::run(&request, console),
        None => live::run(request, console),
    }
}

/// Text printed if there are no arguments.
const GETTING_STARTED: &str = "\
glimt renders a scene file in the terminal and updates it on every save.

  glimt new ball.toml     write a scene to start from
  glimt ball.toml         render it; edit and save it to update the image
  glimt helmet.glb        view a model

Run `glimt -h` for all commands and options.";

/// Handles an invocation without arguments.
fn print_getting_started() -> Exit {
    Console::new(crate::tui::ColorDepthChoice::Auto).print_lines_to_stderr(GETTING_STARTED);
    Exit::WRONG
}

/// Prints the help, the version or an error.
fn report_parse_error(error: &clap::Error, arguments: &[OsString]) -> Exit {
    let console = Console::new(crate::tui::ColorDepthChoice::Auto);
    if !error.use_stderr() {
        console.record_stdout_error(error.print().and_then(|()| io::stdout().flush()));
        return console.final_exit_code(Exit::DONE);
    }
    if let Some(message) =
        find_extra_argument(error).and_then(|_| message_if_first_argument_mistyped(arguments))
    {
        return console.print_error(Exit::WRONG, &message);
    }
    if let Some(second) = find_extra_argument(error) {
        let message = format!("glimt takes one scene; got a second: {second:?}");
        return console.print_error(Exit::WRONG, &message);
    }
    // clap's message contains the arguments. Parse sanitized arguments to get a message that is safe to
    // print.
    let shown =
        arguments.iter().map(|argument| escape_invisible_chars(&argument.to_string_lossy()).into_owned());
    match Args::try_parse_from(shown) {
        Err(error) if error.use_stderr() => {
            let _ = error.print();
        }
        _ => console.print_lines_to_stderr(&error.render().to_string()),
    }
    Exit::WRONG
}

/// Returns an error message if the first argument looks like a mistyped command.
fn message_if_first_argument_mistyped(arguments: &[OsString]) -> Option<String> {
    // A later argument may be the value of an option.
    message_if_mistyped_command(Path::new(arguments.get(1)?))
}

/// Returns an error message if the scene argument looks like a mistyped command.
fn message_if_mistyped_command(word: &Path) -> Option<String> {
    let first = word.to_string_lossy();
    if first.contains(['.', '/']) || first.starts_with('-') || word.symlink_metadata().is_ok() {
        return None;
    }
    let commands = <Args as clap::CommandFactory>::command();
    let names: Vec<&str> = commands.get_subcommands().map(clap::Command::get_name).collect();
    let help = match nearest_name(&first, names.iter().copied()) {
        Some(near) => format!("did you mean `{near}`?"),
        None => format!("expected one of {}", names.join(", ")),
    };
    Some(format!("no such command or scene: {:?}; {help}", escape_invisible_chars(&first)))
}

/// Returns an extra argument after the scene that is neither an option nor a command.
fn find_extra_argument(error: &clap::Error) -> Option<&str> {
    use clap::error::{ContextKind, ContextValue, ErrorKind};
    let word = match error.get(ContextKind::InvalidSubcommand).or(error.get(ContextKind::InvalidArg)) {
        Some(ContextValue::String(word)) if error.kind() == ErrorKind::ArgumentConflict => word,
        _ => return None,
    };
    let is_command = <Args as clap::CommandFactory>::command().find_subcommand(word).is_some();
    (!is_command && !word.starts_with(['-', '<'])).then_some(word)
}
