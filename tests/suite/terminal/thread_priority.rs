//! Render threads yield to the front end and to other programs, as the options specify.

use super::super::niceness::{of_render_threads, raised};
use super::pty::Folder;

#[test]
fn render_threads_use_niceness_ten_or_the_option() {
    for (option, steps) in [(None, 10), (Some("0"), 0), (Some("3"), 3)] {
        let folder = Folder::new();
        let mut call = vec![folder.program(), "scene.toml", "--threads", "2"];
        call.extend(option.into_iter().flat_map(|nice| ["--nice", nice]));
        let terminal = folder.terminal_with(&call, &[]);
        terminal.wait_for_render(1);
        // Threads lower their priority one by one when they start.
        terminal.wait(&format!("nice {steps}"), |_| of_render_threads(terminal.id()) == [raised(steps); 2]);
    }
}
