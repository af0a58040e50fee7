//! Terminal state: window, colors and preview drawing.

use std::time::{Duration, Instant};

use super::InitialState;
use crate::color::{AnsiColors, ColorDepth, ColorMapper};
use crate::event::{PreviewSendReport, WindowSize};
use crate::graphics::ImageProtocol;
use crate::mosaic::CellGrid;
use crate::pixel_request::UnconfirmedImageProtocol;
use crate::preview_style::PreviewStyle;
use crate::terminal_replies::TerminalQueries;
use crate::terminals::TerminalExtras;

/// Window size, terminal capabilities and preview settings.
pub(crate) struct TerminalDisplayState {
    pub window: WindowSize,
    pub kind: PreviewStyle,
    pub depth: ColorDepth,
    pub shades: ColorMapper,
    /// The terminal's 16 ANSI colors, as reported or assumed.
    pub ansi: AnsiColors,
    /// Terminal queries that have been sent.
    pub ask: TerminalQueries,
    /// Terminal capabilities beyond text.
    pub capabilities: TerminalExtras,
    /// How long a render must run for its end to trigger a notification. `None` disables notifications.
    pub notify_after: Option<Duration>,
    /// Whether the window is focused, according to the terminal.
    pub has_focus: bool,
    /// Whether the terminal's background is light.
    pub is_light: bool,
    /// The user's request to draw pixels, while the terminal has not confirmed it.
    pub pixels: Option<UnconfirmedImageProtocol>,
    /// Time at which a missing confirmation is reported.
    pub pixels_until: Option<Instant>,
    /// Bytes and round-trip time for sending the last preview.
    pub frame: Option<PreviewSendReport>,
}

impl TerminalDisplayState {
    pub(super) fn new(setup: &InitialState, now: Instant) -> Self {
        let pixels = setup.ask.pixels.filter(|request| !request.is_known);
        Self {
            pixels,
            pixels_until: pixels.map(|request| request.reply_deadline(now)),
            window: setup.window,
            kind: setup.preview,
            depth: setup.depth,
            shades: ColorMapper::new(setup.depth, &setup.ansi),
            ansi: setup.ansi,
            ask: setup.ask,
            capabilities: setup.capabilities,
            notify_after: setup.notify_after,
            has_focus: true,
            is_light: setup.is_light,
            frame: None,
        }
    }

    /// Preview pixels per cell, horizontally.
    pub(crate) fn horizontal_pixels_per_cell(&self) -> u32 {
        /// Maximum horizontal preview pixels per cell. A higher resolution is not worth the bytes.
        const MAX_PIXELS_PER_CELL: u32 = 10;
        /// Maximum number of pixels in the window. Accumulating, developing and encoding a preview takes
        /// about 45 bytes of memory per pixel.
        const MAX_PIXELS: f32 = 2_400_000.0;
        /// Maximum number of pixels in the window for Sixel, which needs twice as much memory.
        const MAX_IN_SIXELS: f32 = 1_600_000.0;
        match self.kind {
            PreviewStyle::Pixels(protocol) => {
                let most = match protocol {
                    ImageProtocol::Sixel => MAX_IN_SIXELS,
                    ImageProtocol::Kitty | ImageProtocol::Iterm => MAX_PIXELS,
                };
                let window = &self.window;
                let squares = f32::from(window.columns) * f32::from(window.rows) * window.cell_aspect;
                let affordable = (most / squares.max(1.0)).sqrt() as u32;
                u32::from(window.cell_pixels.0).min(affordable).clamp(1, MAX_PIXELS_PER_CELL)
            }
            kind => kind.grid().map_or(1, CellGrid::columns_per_cell),
        }
    }

    /// Whether the preview's colors are dithered.
    pub(crate) fn dithers_colors(&self) -> bool {
        matches!(self.depth, ColorDepth::Indexed256 | ColorDepth::Ansi16)
            || self.kind == PreviewStyle::Pixels(ImageProtocol::Sixel)
    }
}
