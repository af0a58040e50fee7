//! Render threads have the nice value specified by the options.

use super::super::niceness::{of_render_threads, raised_niceness};
use crate::test_dir::{PROGRAM, TestDir};

#[test]
fn nice_option_applies_to_render_threads() {
    for (option, steps) in [(None, 10), (Some("0"), 0), (Some("3"), 3)] {
        let folder = TestDir::with_board();
        let mut call = vec![PROGRAM, "scene.toml", "--threads", "2"];
        call.extend(option.into_iter().flat_map(|nice| ["--nice", nice]));
        let terminal = folder.terminal_with(&call, &[]);
        terminal.wait_for_render(1);
        // Each thread lowers its priority when it starts.
        terminal.wait(&format!("nice {steps}"), |_| {
            of_render_threads(terminal.id()) == [raised_niceness(steps); 2]
        });
    }
}
