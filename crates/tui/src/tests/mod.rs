//! The front end driven by scripted events, on a screen without a terminal.

mod camera;
mod edits;
mod flow;
mod following;
mod keys;
mod layout;
mod manual;
mod noise;
mod notices;
mod older;
mod overlay;
mod pointer;
mod screen;
mod spare;
mod warnings;
mod words;

use ratatui::style::Color;

use super::fixtures::Desk;

pub(super) const RED: [u8; 3] = [200, 20, 10];
pub(super) const BLUE: [u8; 3] = [10, 20, 200];

fn cells_of(desk: &mut Desk, rgb: [u8; 3]) -> usize {
    let color = Color::Rgb(rgb[0], rgb[1], rgb[2]);
    desk.screen().content.iter().filter(|cell| cell.symbol() == "▀" && cell.fg == color).count()
}
