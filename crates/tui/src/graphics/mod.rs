//! The picture in pixels, where the terminal has a protocol for it.
//!
//! A picture is one large update: the next one is encoded when the one before has gone out, and then it is the newest.
//! It goes out in pieces that other bytes may come between, through the flow control of all others.

pub(super) mod base64;
mod iterm;
mod kitty;
mod palette;
mod pixel_screen;
mod png;
mod sixel;

use std::collections::VecDeque;
use std::sync::Arc;

use ratatui::layout::Rect;

use self::palette::Palette;
use crate::film::Picture;

pub(super) use self::kitty::delete_all;
pub use self::pixel_screen::PixelScreen;

/// Protocols for pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Protocol {
    /// kitty's: kitty, Ghostty, Konsole, WezTerm.
    Kitty,
    /// DEC's: foot, xterm with `-ti vt340`, mlterm, tmux.
    Sixel,
    /// iTerm2's, for the terminals that [`Brand`](super::terminals::Brand) tells.
    Iterm,
}

/// A picture in its place.
#[derive(Clone, Debug)]
pub(super) struct PixelPlacement {
    pub(super) picture: Arc<Picture>,
    pub(super) cells: Rect,
    /// Width and height of a cell in pixels.
    pub(super) cell: (u16, u16),
}

impl PartialEq for PixelPlacement {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.picture, &other.picture) && (self.cells, self.cell) == (other.cells, other.cell)
    }
}

/// Bytes that a pixel takes, about: noise hardly shrinks.
const PIXEL_BYTES: f64 = 2.0;
/// The largest picture. What passes through tmux must stay below a megabyte.
const MOST_BYTES: f64 = 600_000.0;
/// Longest time on the way, of a picture that others follow and of one that stays.
const MOVING_SECONDS: f64 = 0.4;
const STILL_SECONDS: f64 = 1.5;

/// The pictures on the screen and on their way.
#[derive(Debug)]
pub(super) struct Images {
    protocol: Protocol,
    /// Inside tmux, which passes on what is wrapped.
    is_wrapped: bool,
    wanted: Option<PixelPlacement>,
    /// The picture on the screen once all pieces have arrived.
    shown: Option<PixelPlacement>,
    is_still: bool,
    /// Whether what is shown was made coarser than the picture, to be shorter.
    is_coarse: bool,
    pieces: VecDeque<Vec<u8>>,
    /// Whether kitty's second image is shown: the two take turns, so that one goes when the next is there.
    turn: bool,
    /// Palette of the last sixels.
    palette: Option<Palette>,
}

impl Images {
    /// None yet. `is_wrapped`: inside tmux.
    pub(super) fn new(protocol: Protocol, is_wrapped: bool) -> Self {
        // tmux draws sixels itself.
        let is_wrapped = is_wrapped && protocol != Protocol::Sixel;
        Self {
            protocol,
            is_wrapped,
            wanted: None,
            shown: None,
            is_still: false,
            is_coarse: false,
            pieces: VecDeque::new(),
            turn: false,
            palette: None,
        }
    }

    /// Show this from now on; `is_still`: no other one will follow soon. What is returned is to be drawn again, since a picture no
    /// longer lies over it.
    pub(super) fn aim(&mut self, wanted: Option<PixelPlacement>, is_still: bool) -> Option<Rect> {
        (self.wanted, self.is_still) = (wanted, is_still);
        let shown = self.shown.as_ref()?.cells;
        if self.wanted.as_ref().is_some_and(|wanted| wanted.cells == shown) {
            return None;
        }
        self.shown = None;
        match self.protocol {
            Protocol::Kitty => self.pieces.push_back(self.passed(kitty::delete_all())),
            Protocol::Sixel | Protocol::Iterm => {}
        }
        Some(shown)
    }

    /// The screen has been cleared.
    pub(super) fn forget(&mut self) {
        self.shown = None;
    }

    /// Whether all that is wanted has been sent.
    pub(super) fn is_complete(&self) -> bool {
        self.pieces.is_empty()
            && (self.wanted.is_none() || (self.shown == self.wanted && !(self.is_coarse && self.is_still)))
    }

    /// Next bytes to send: at most `most`, unless a piece is longer. `None` if everything has been sent. `rate`: bytes per second
    /// of the line, if known.
    pub(super) fn slice(&mut self, most: usize, rate: Option<f64>) -> Option<Vec<u8>> {
        if self.pieces.is_empty() && !self.is_complete() {
            self.encode(rate);
        }
        let mut slice = self.pieces.pop_front()?;
        while let Some(piece) = self.pieces.pop_front_if(|piece| slice.len() + piece.len() <= most) {
            slice.extend(piece);
        }
        Some(slice)
    }

    fn encode(&mut self, rate: Option<f64>) {
        let Some(wanted) = self.wanted.clone() else { return };
        let seconds = if self.is_still { STILL_SECONDS } else { MOVING_SECONDS };
        let most = rate.map_or(MOST_BYTES, |rate| (rate * seconds).min(MOST_BYTES));
        let pixels = f64::from(wanted.picture.width) * f64::from(wanted.picture.height);
        let scale = (most / (PIXEL_BYTES * pixels).max(1.0)).sqrt().min(1.0);
        let side = |length: u32| ((f64::from(length) * scale) as u32).max(1);
        let picture = match self.protocol {
            Protocol::Sixel => wanted.picture.clone(),
            Protocol::Kitty | Protocol::Iterm => {
                let (width, height) = (side(wanted.picture.width), side(wanted.picture.height));
                Arc::new(super::rescale::resized(&wanted.picture, width, height))
            }
        };
        self.is_coarse = scale < 1.0 && !self.is_still;
        let bodies = match self.protocol {
            Protocol::Kitty => {
                self.turn = !self.turn;
                kitty::encode(&picture, wanted.cells, self.turn)
            }
            Protocol::Sixel => vec![sixel::encode(&picture, wanted.cells, wanted.cell, &mut self.palette)],
            Protocol::Iterm => vec![iterm::encode(&picture, wanted.cells)],
        };
        let last = bodies.len().saturating_sub(1);
        for (i, body) in bodies.into_iter().enumerate() {
            let piece = if i == last { self.placed(wanted.cells, body) } else { self.passed(body) };
            self.pieces.push_back(piece);
        }
        self.shown = Some(wanted);
    }

    /// With the cursor at the top left cell; it is where it was afterwards.
    fn placed(&self, cells: Rect, body: Vec<u8>) -> Vec<u8> {
        let mut bytes = format!("\x1b7\x1b[{};{}H", cells.y + 1, cells.x + 1).into_bytes();
        if self.is_wrapped {
            // tmux moves the cursor of the terminal when it draws there: a blank, and back.
            bytes.extend_from_slice(b"\x1b[0m ");
            bytes.extend(self.passed([b"\x1b[D".to_vec(), body].concat()));
        } else {
            bytes.extend(body);
        }
        bytes.extend_from_slice(b"\x1b8");
        bytes
    }

    fn passed(&self, body: Vec<u8>) -> Vec<u8> {
        if self.is_wrapped { wrapped(&body) } else { body }
    }
}

/// Passed on by tmux, where `allow-passthrough` is on.
pub(super) fn wrapped(body: &[u8]) -> Vec<u8> {
    let mut bytes = b"\x1bPtmux;".to_vec();
    for &byte in body {
        if byte == 0x1b {
            bytes.push(byte);
        }
        bytes.push(byte);
    }
    bytes.extend_from_slice(b"\x1b\\");
    bytes
}

#[cfg(test)]
mod tests;
