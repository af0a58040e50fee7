//! `glimt doctor`: reports the detected environment.

use std::env::consts::{ARCH, OS};

use crate::accel::wide_bvh::InstructionSet;
use crate::bench::cache;
use crate::commands::check::format_count;
use crate::console::Console;
use crate::exit::Exit;
use crate::system::folder::entry_names;
use crate::tui::{self, ColorDepth, ReportedTerminalFeatures, TerminalProbeResult, probe_terminal};

/// Prints one line per finding.
pub(crate) fn run(console: &Console) -> Exit {
    let mut lines = vec![("glimt", format!("{}, {}-{}", crate::pipeline::BUILD, ARCH, OS))];
    lines.extend([("processor", describe_simd_instructions()), ("threads", describe_threads())]);
    match probe_terminal() {
        Some(probe) => lines.extend(describe_terminal_as_rows(&probe)),
        None => lines.push(("terminal", "none (not a tty); use --once".to_owned())),
    }
    lines.extend([("editor", describe_editor()), ("cache", describe_cache_folder())]);
    for (name, finding) in lines {
        console.print_line(&format!("{name:<12}{finding}"));
    }
    Exit::DONE
}

fn nonempty_environment_variable(name: &str) -> Option<String> {
    std::env::var(name).ok().filter(|value| !value.is_empty())
}

fn describe_simd_instructions() -> String {
    let words = |instructions| match instructions {
        InstructionSet::Portable => "no supported SIMD instructions",
        InstructionSet::Avx2 => "AVX2",
        InstructionSet::Avx512 => "AVX-512",
    };
    let (used, best) =
        (InstructionSet::from_environment_or_best(), InstructionSet::Avx512.or_best_if_unsupported());
    match nonempty_environment_variable("GLIMT_SIMD") {
        Some(asked) => format!("{} (GLIMT_SIMD={asked}); available: {}", words(used), words(best)),
        None => words(used).to_owned(),
    }
}

fn describe_threads() -> String {
    match std::thread::available_parallelism() {
        Ok(threads) => format!("{threads}, the default for renders"),
        Err(error) => format!("unknown ({error}); the default is 1"),
    }
}

/// Describes the terminal as a list of property names and values.
fn describe_terminal_as_rows(probe: &TerminalProbeResult) -> Vec<(&'static str, String)> {
    let term = nonempty_environment_variable("TERM").unwrap_or_else(|| "TERM is not set".to_owned());
    let name = probe.answers.as_ref().and_then(|answers| answers.name.clone());
    let ((columns, rows), (width, height)) = (probe.cells, probe.cell_pixels);
    let size = match (columns, rows) {
        (0, _) | (_, 0) => "unknown size".to_owned(),
        _ => format!("{columns} × {rows} cells of {width} × {height} pixels"),
    };
    let way = match (probe.is_multiplexed, probe.is_remote) {
        (true, true) => ", in tmux or screen, over SSH",
        (true, false) => ", in tmux or screen",
        (false, true) => ", over SSH",
        (false, false) => "",
    };
    let terminal = format!("{}, {size}{way}", name.map_or(term.clone(), |name| format!("{name} ({term})")));
    let mut lines = vec![
        ("terminal", terminal),
        ("colors", describe_colors(probe)),
        ("preview", describe_preview(probe)),
    ];
    lines.push(("round trip", describe_round_trip(probe.answers.as_ref())));
    lines
}

fn describe_colors(probe: &TerminalProbeResult) -> String {
    let depth = match probe.depth {
        ColorDepth::TrueColor => "24 bits",
        ColorDepth::Indexed256 => "256",
        ColorDepth::Ansi16 => "16",
        ColorDepth::None => "none",
    };
    let says_more = probe.answers.as_ref().is_some_and(|answers| answers.has_true_color);
    let asked =
        if says_more && probe.depth != ColorDepth::TrueColor { "; the terminal reports 24 bits" } else { "" };
    let background = probe.answers.as_ref().and_then(|answers| answers.background);
    let background = background
        .map_or(String::new(), |[red, green, blue]| format!("; background #{red:02x}{green:02x}{blue:02x}"));
    format!("{depth} according to the environment{asked}{background}")
}

fn describe_preview(probe: &TerminalProbeResult) -> String {
    let protocol = |name, is_there| if is_there { Some(name) } else { None };
    let answers = probe.answers.clone().unwrap_or_default();
    let pixels = [
        protocol("kitty", answers.has_kitty),
        protocol("sixel", answers.has_sixel),
        protocol("iterm2", probe.has_iterm),
    ];
    let pixels: Vec<&str> = pixels.into_iter().flatten().collect();
    let more = match pixels.as_slice() {
        [] => "no pixel protocol".to_owned(),
        some => format!("pixels with --preview {}", some.join(" or ")),
    };
    format!("{}; {more}", probe.auto_preview_style_name())
}

fn describe_round_trip(answers: Option<&ReportedTerminalFeatures>) -> String {
    let Some(answers) = answers else { return "the terminal does not respond".to_owned() };
    let whole = if answers.is_synchronized { "; synchronized output" } else { "" };
    format!("{:.1} ms{whole}", answers.round_trip.as_secs_f64() * 1e3)
}

fn describe_editor() -> String {
    match tui::editor_and_variable(|name| std::env::var(name).ok()) {
        (editor, Some(variable)) => format!("{editor} (from {variable})"),
        (editor, None) => format!("{editor} (neither VISUAL nor EDITOR is set)"),
    }
}

fn describe_cache_folder() -> String {
    let Some(folder) = cache::cache_folder() else {
        return "none (neither XDG_CACHE_HOME nor HOME is set)".to_owned();
    };
    let name = folder.display();
    match entry_names(&folder) {
        Ok(names) => {
            let sizes: Vec<u64> =
                names.filter_map(|name| Some(folder.join(name).symlink_metadata().ok()?.len())).collect();
            let bytes = sizes.iter().sum::<u64>();
            format!("{name}: {}, {:.1} MB", format_count(sizes.len() as u64, "file"), bytes as f64 / 1e6)
        }
        Err(_) if folder.symlink_metadata().is_err() => {
            format!("{name}: does not exist yet; created by `bench`")
        }
        Err(error) => format!("{name}: cannot be read: {error}"),
    }
}
