//! Tests that drive the front end with scripted events, without a terminal.

mod camera;
mod documented_keys;
mod edits;
mod flow;
mod following;
mod history;
mod keys;
mod layout;
mod noise;
mod notices;
mod overlay;
mod pointer;
mod screen;
mod side_panel;
mod warnings;
mod words;
mod writing;

use ratatui::style::Color;

use super::fixtures::TestUi;

pub(super) const RED: [u8; 3] = [200, 20, 10];
pub(super) const BLUE: [u8; 3] = [10, 20, 200];

fn cells_of(ui: &mut TestUi, rgb: [u8; 3]) -> usize {
    let color = Color::Rgb(rgb[0], rgb[1], rgb[2]);
    ui.draw_screen().content.iter().filter(|cell| cell.symbol() == "▀" && cell.fg == color).count()
}
