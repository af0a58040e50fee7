//! Previews drawn as pixels, for terminals with an image protocol.
//!
//! Each image is a single large update. Once an image has been sent, the newest one is encoded next. Images
//! are sent in pieces that are subject to flow control, and other output may be sent between pieces.

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
use crate::film::Srgb8Image;

pub(super) use self::kitty::delete_all_commands;
pub use self::pixel_screen::TestImageTerminal;

/// Image protocols.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ImageProtocol {
    /// kitty's protocol, supported by kitty, Ghostty, Konsole and WezTerm.
    Kitty,
    /// DEC's Sixel format, supported by foot, xterm with `-ti vt340`, mlterm and tmux.
    Sixel,
    /// iTerm2's protocol. See [`TerminalBrand`](super::terminals::TerminalBrand) for terminals that support
    /// it.
    Iterm,
}

/// An image and the cells it covers.
#[derive(Clone, Debug)]
pub(super) struct PlacedImage {
    pub(super) picture: Arc<Srgb8Image>,
    pub(super) cells: Rect,
    /// Width and height of a cell in pixels.
    pub(super) cell: (u16, u16),
}

impl PartialEq for PlacedImage {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.picture, &other.picture) && (self.cells, self.cell) == (other.cells, other.cell)
    }
}

/// Approximate encoded bytes per pixel. Noise hardly compresses.
const PIXEL_BYTES: f64 = 2.0;
/// Maximum image size in bytes. tmux does not pass on images of a megabyte or more.
const MAX_BYTES: f64 = 600_000.0;
/// Maximum time for sending an intermediate or a final image, in seconds.
const MOVING_SECONDS: f64 = 0.4;
const STILL_SECONDS: f64 = 1.5;

/// The images on the screen and in flight.
#[derive(Debug)]
pub(super) struct TerminalImages {
    protocol: ImageProtocol,
    /// Whether escape sequences are wrapped for tmux.
    is_wrapped: bool,
    wanted: Option<PlacedImage>,
    /// The image that is shown once all pieces have arrived.
    shown: Option<PlacedImage>,
    is_still: bool,
    /// Whether the displayed image was downscaled to save bytes.
    is_coarse: bool,
    pieces: VecDeque<Vec<u8>>,
    /// Whether kitty's second image is shown. Two images alternate so that the old one can be deleted after
    /// the new one has appeared.
    turn: bool,
    /// Palette of the last Sixel image.
    palette: Option<Palette>,
}

impl TerminalImages {
    /// Creates an empty state. `is_wrapped` must be true inside tmux.
    pub(super) fn new(protocol: ImageProtocol, is_wrapped: bool) -> Self {
        // tmux draws Sixel images itself.
        let is_wrapped = is_wrapped && protocol != ImageProtocol::Sixel;
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

    /// Sets the image to show. `is_still` marks a final image. Returns the cells that no image covers
    /// anymore, which must be redrawn.
    pub(super) fn set_target(&mut self, wanted: Option<PlacedImage>, is_still: bool) -> Option<Rect> {
        (self.wanted, self.is_still) = (wanted, is_still);
        let shown = self.shown.as_ref()?.cells;
        if self.wanted.as_ref().is_some_and(|wanted| wanted.cells == shown) {
            return None;
        }
        self.shown = None;
        match self.protocol {
            ImageProtocol::Kitty => self.pieces.push_back(self.wrap_if_in_tmux(kitty::delete_all_commands())),
            ImageProtocol::Sixel | ImageProtocol::Iterm => {}
        }
        Some(shown)
    }

    /// Records that the screen has been cleared.
    pub(super) fn invalidate(&mut self) {
        self.shown = None;
    }

    /// Whether the image has been sent completely.
    pub(super) fn is_complete(&self) -> bool {
        self.pieces.is_empty()
            && (self.wanted.is_none() || (self.shown == self.wanted && !(self.is_coarse && self.is_still)))
    }

    /// Returns the next bytes to send, or `None` if everything has been sent. There are at most `most` bytes
    /// unless a single piece is longer. `rate` is the bandwidth in bytes per second, if known.
    pub(super) fn next_slice(&mut self, most: usize, rate: Option<f64>) -> Option<Vec<u8>> {
        if self.pieces.is_empty() && !self.is_complete() {
            self.encode_and_queue_image(rate);
        }
        let mut slice = self.pieces.pop_front()?;
        while let Some(piece) = self.pieces.pop_front_if(|piece| slice.len() + piece.len() <= most) {
            slice.extend(piece);
        }
        Some(slice)
    }

    fn encode_and_queue_image(&mut self, rate: Option<f64>) {
        let Some(wanted) = self.wanted.clone() else { return };
        let seconds = if self.is_still { STILL_SECONDS } else { MOVING_SECONDS };
        let most = rate.map_or(MAX_BYTES, |rate| (rate * seconds).min(MAX_BYTES));
        let pixels = f64::from(wanted.picture.width) * f64::from(wanted.picture.height);
        let scale = (most / (PIXEL_BYTES * pixels).max(1.0)).sqrt().min(1.0);
        let side = |length: u32| ((f64::from(length) * scale) as u32).max(1);
        let picture = match self.protocol {
            ImageProtocol::Sixel => wanted.picture.clone(),
            ImageProtocol::Kitty | ImageProtocol::Iterm => {
                let (width, height) = (side(wanted.picture.width), side(wanted.picture.height));
                Arc::new(super::rescale::resized(&wanted.picture, width, height))
            }
        };
        self.is_coarse = scale < 1.0 && !self.is_still;
        let bodies = match self.protocol {
            ImageProtocol::Kitty => {
                self.turn = !self.turn;
                kitty::encode(&picture, wanted.cells, self.turn)
            }
            ImageProtocol::Sixel => {
                vec![sixel::encode(&picture, wanted.cells, wanted.cell, &mut self.palette)]
            }
            ImageProtocol::Iterm => vec![iterm::encode(&picture, wanted.cells)],
        };
        let last = bodies.len().saturating_sub(1);
        for (i, body) in bodies.into_iter().enumerate() {
            let piece =
                if i == last { self.wrap_at_cell(wanted.cells, body) } else { self.wrap_if_in_tmux(body) };
            self.pieces.push_back(piece);
        }
        self.shown = Some(wanted);
    }

    /// Wraps `body` so that it is drawn from the top-left cell and the cursor is restored afterwards.
    fn wrap_at_cell(&self, cells: Rect, body: Vec<u8>) -> Vec<u8> {
        let mut bytes = format!("\x1b7\x1b[{};{}H", cells.y + 1, cells.x + 1).into_bytes();
        if self.is_wrapped {
            // tmux moves the real cursor only when it draws, so print a blank at that cell and move back.
            bytes.extend_from_slice(b"\x1b[0m ");
            bytes.extend(self.wrap_if_in_tmux([b"\x1b[D".to_vec(), body].concat()));
        } else {
            bytes.extend(body);
        }
        bytes.extend_from_slice(b"\x1b8");
        bytes
    }

    fn wrap_if_in_tmux(&self, body: Vec<u8>) -> Vec<u8> {
        if self.is_wrapped { tmux_passthrough(&body) } else { body }
    }
}

/// Wraps an escape sequence so that tmux passes it on. This requires `allow-passthrough`.
pub(super) fn tmux_passthrough(body: &[u8]) -> Vec<u8> {
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
