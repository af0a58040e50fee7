//! `glimt man`: manual pages as roff.

use clap::CommandFactory;
use clap_mangen::Man;
use clap_mangen::roff::{Roff, bold, roman};

use crate::args::{Args, EXAMPLES, EXIT_CODES};
use crate::console::Console;
use crate::environment::VARIABLES;
use crate::exit::Exit;
use crate::scene::nearest::nearest_name;

/// Prints the manual page for a command or for the whole program.
pub(crate) fn run(command: Option<&str>, console: &Console) -> Exit {
    let mut all = Args::command();
    all.build();
    let found = match command {
        None => Some(&all),
        Some(name) => all.find_subcommand(name),
    };
    let Some(found) = found else {
        let name = command.unwrap_or_default();
        let names: Vec<&str> = all.get_subcommands().map(clap::Command::get_name).collect();
        let help = match nearest_name(name, names.iter().copied()) {
            Some(near) => format!("did you mean `{near}`?"),
            None => format!("expected one of {}", names.join(", ")),
        };
        return console.print_error(Exit::WRONG, &format!("unknown command {name:?}: {help}"));
    };
    match render_page(found, command.is_none()) {
        Ok(text) => {
            console.print_trusted_text(&text);
            Exit::DONE
        }
        Err(error) => console.print_error(Exit::FAILED, &format!("cannot create the manual page: {error}")),
    }
}

/// Renders a page. The program's page also contains the sections that apply to all commands.
fn render_page(command: &clap::Command, is_whole: bool) -> std::io::Result<String> {
    let name = command.get_display_name().unwrap_or("glimt").to_owned();
    let notes = command.get_after_long_help().map(ToString::to_string);
    let usage = command.clone().render_usage().to_string();
    let man = Man::new(command.clone().display_name(name).version(env!("CARGO_PKG_VERSION")));
    let mut bytes = Vec::new();
    man.render_title(&mut bytes)?;
    man.render_name_section(&mut bytes)?;
    // clap_mangen's synopsis lists every option and takes half a page.
    preformatted_section("SYNOPSIS", usage.trim_start_matches("Usage:").trim()).to_writer(&mut bytes)?;
    man.render_description_section(&mut bytes)?;
    man.render_options_section(&mut bytes)?;
    if is_whole {
        man.render_subcommands_section(&mut bytes)?;
        preformatted_section("EXAMPLES", EXAMPLES).to_writer(&mut bytes)?;
        preformatted_section("EXIT STATUS", EXIT_CODES).to_writer(&mut bytes)?;
        environment_section().to_writer(&mut bytes)?;
    } else if let Some(notes) = notes {
        preformatted_section("NOTES", &notes).to_writer(&mut bytes)?;
    }
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

/// A section with preformatted lines.
fn preformatted_section(heading: &str, lines: &str) -> Roff {
    let mut roff = Roff::default();
    roff.control("SH", [heading]);
    roff.control("nf", []);
    for line in lines.lines() {
        roff.text([roman(line)]);
    }
    roff.control("fi", []);
    roff
}

fn environment_section() -> Roff {
    let mut roff = Roff::default();
    roff.control("SH", ["ENVIRONMENT"]);
    for (names, effect) in VARIABLES {
        roff.control("TP", []);
        roff.text([bold(names)]);
        roff.text([roman(effect.replace('`', ""))]);
    }
    roff
}
