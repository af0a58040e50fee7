//! The command line: arguments, the headless front end, and the wiring of the terminal's.
//!
//! What was typed ([`args`]) is turned into what it means (`lower`) before anything is done.

pub mod args;
mod check;
mod console;
mod exit;
mod live;
mod lower;
mod new;
mod once;
mod progress;
mod report;
mod signals;

use std::ffi::OsString;

use clap::Parser;

use self::args::{Args, Subcommand};
use self::console::Console;
pub use self::exit::Exit;

/// Do what the command line says; gives the exit code.
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> Exit {
    crate::output::write::prepare_process();
    let args = match Args::try_parse_from(arguments) {
        Ok(args) => args,
        Err(error) => {
            // A closed pipe: nobody reads the help.
            let _ = error.print();
            return if error.use_stderr() { Exit::WRONG } else { Exit::DONE };
        }
    };
    let console = Console::new(args.color());
    match args.command {
        Some(Subcommand::Check { scene, .. }) => check::run(&scene, &console),
        Some(Subcommand::New { file }) => new::run(&file, &console),
        None => match lower::lower(args.render) {
            Ok(order) if order.is_once => once::run(&order, &console),
            Ok(order) => live::run(order, &console),
            Err(message) => console.fail(Exit::WRONG, &message),
        },
    }
}
