//! Handles terminal replies that report capabilities.

use super::notices::show_until_key;
use super::request::request_resized_preview;
use crate::color::{ColorDepth, ColorMapper};
use crate::event::Effect;
use crate::graphics::ImageProtocol;
use crate::pixel_request::UnconfirmedImageProtocol;
use crate::preview_style::PreviewStyle;
use crate::state::State;
use crate::terminal_replies::FinestNativeBlocks;
use crate::terminal_replies::TerminalReply;
use crate::terminals::TerminalId;
use crate::view::ramp;

/// Enables the capability that a reply confirms, if it was queried.
pub(super) fn handle_reply(state: &mut State, answer: TerminalReply) -> Vec<Effect> {
    let mut effects = enable_pixels_if_supported(state, answer);
    match answer {
        TerminalReply::Name(terminal) => effects.extend(handle_terminal_name(state, terminal)),
        TerminalReply::Focus { is_here } => state.display.has_focus = is_here,
        TerminalReply::TrueColor if state.display.ask.true_color => {
            set_color_depth(state, ColorDepth::TrueColor);
        }
        TerminalReply::Ink { index, rgb } if state.display.ask.palette => {
            if let Some(ink) = state.display.ansi.get_mut(usize::from(index)).filter(|ink| **ink != rgb) {
                *ink = rgb;
                set_color_depth(state, state.display.depth);
            }
        }
        TerminalReply::Background(rgb) if state.display.ask.background => {
            let is_light = ramp::is_light_color(rgb);
            state.dirty |= std::mem::replace(&mut state.display.is_light, is_light) != is_light;
        }
        TerminalReply::Images(_)
        | TerminalReply::TrueColor
        | TerminalReply::Ink { .. }
        | TerminalReply::Background(_)
        | TerminalReply::Ready
        | TerminalReply::Attributes
        | TerminalReply::Synchronized { .. }
        | TerminalReply::Other => {}
    }
    effects
}

/// Whether the requested pixel protocol is supported, according to a reply.
enum RequestedProtocolSupport {
    Nothing,
    Has,
    Lacks,
}

fn requested_protocol_support(
    request: UnconfirmedImageProtocol,
    answer: TerminalReply,
) -> RequestedProtocolSupport {
    match answer {
        TerminalReply::Images(protocol) if protocol == request.protocol => RequestedProtocolSupport::Has,
        TerminalReply::Name(terminal)
            if request.protocol == ImageProtocol::Iterm && terminal.brand.has_iterm_images() =>
        {
            RequestedProtocolSupport::Has
        }
        TerminalReply::Attributes if request.is_attributes_reply_last() => RequestedProtocolSupport::Lacks,
        TerminalReply::Images(_)
        | TerminalReply::Name(_)
        | TerminalReply::Attributes
        | TerminalReply::Ready
        | TerminalReply::Synchronized { .. }
        | TerminalReply::Focus { .. }
        | TerminalReply::TrueColor
        | TerminalReply::Background(_)
        | TerminalReply::Ink { .. }
        | TerminalReply::Other => RequestedProtocolSupport::Nothing,
    }
}

/// Switches to pixels if a reply confirms that the terminal supports them.
fn enable_pixels_if_supported(state: &mut State, answer: TerminalReply) -> Vec<Effect> {
    let Some(request) = state.display.pixels else { return Vec::new() };
    match requested_protocol_support(request, answer) {
        RequestedProtocolSupport::Nothing => Vec::new(),
        RequestedProtocolSupport::Lacks => {
            report_unsupported_graphics(state);
            Vec::new()
        }
        RequestedProtocolSupport::Has => {
            (state.display.pixels, state.display.pixels_until) = (None, None);
            state.overlays.message.take_if(|message| message.words == request.unsupported_message());
            state.display.kind = PreviewStyle::Pixels(request.protocol);
            state.dirty = true;
            request_resized_preview(state)
        }
    }
}

/// Reports once that the terminal does not support pixels. If support is confirmed later, pixels are still
/// used.
pub(super) fn report_unsupported_graphics(state: &mut State) {
    let asked = state.display.pixels_until.take().and(state.display.pixels);
    if let Some(request) = asked {
        show_until_key(state, request.unsupported_message());
    }
}

fn set_color_depth(state: &mut State, depth: ColorDepth) {
    state.display.depth = depth;
    state.display.shades = ColorMapper::new(depth, &state.display.ansi);
    state.dirty = true;
}

/// If the terminal's name was queried, uses it to determine block characters and other capabilities.
fn handle_terminal_name(state: &mut State, terminal: TerminalId) -> Vec<Effect> {
    let ask = state.display.ask;
    let mut effects = Vec::new();
    if ask.name {
        let had_focus = std::mem::replace(&mut state.display.capabilities, terminal.terminal_extras()).focus;
        effects.extend((state.display.capabilities.focus && !had_focus).then_some(Effect::ReportFocus));
        state.dirty = true;
    }
    if ask.blocks {
        effects.extend(switch_to_finer_blocks(state, FinestNativeBlocks::supported_by(terminal)));
    }
    effects
}

fn switch_to_finer_blocks(state: &mut State, blocks: FinestNativeBlocks) -> Vec<Effect> {
    let kind = match blocks {
        FinestNativeBlocks::Unknown => return Vec::new(),
        FinestNativeBlocks::Sextants => PreviewStyle::Sextant,
        FinestNativeBlocks::Octants => PreviewStyle::Octant,
    };
    if state.display.kind == PreviewStyle::HalfBlock {
        state.display.kind = kind;
        state.dirty = true;
    }
    request_resized_preview(state)
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::color::XTERM;
    use crate::event::Event;
    use crate::fixtures::{TestUi, state, state_with};
    use crate::pipeline::protocol::Command;
    use crate::pixel_request::MultiplexerPassthrough;
    use crate::terminal_replies::TerminalQueries;
    use crate::terminals::{TerminalBrand, TerminalExtras};
    use crate::update::request_first_render;

    /// A UI whose user has requested kitty images.
    fn ui_requesting_pixels(route: MultiplexerPassthrough) -> TestUi {
        let mut state = state(80, 24);
        let request = UnconfirmedImageProtocol { protocol: ImageProtocol::Kitty, route, is_known: false };
        state.display.pixels = Some(request);
        state.display.pixels_until = Some(request.reply_deadline(state.now));
        TestUi::from_state(state)
    }

    #[test]
    fn pixels_are_drawn_once_confirmed() {
        let mut ui = ui_requesting_pixels(MultiplexerPassthrough::Direct);
        assert_eq!(ui.state.display.kind, PreviewStyle::HalfBlock);
        let effects = ui.handle_event(Event::TerminalReply(TerminalReply::Images(ImageProtocol::Kitty)));
        assert!(matches!(&effects[..], [Effect::Send(Command::Preview(Some(_)))]), "{effects:?}");
        ui.handle_event(Event::TerminalReply(TerminalReply::Attributes));
        ui.advance_clock(2000);
        assert_eq!(ui.state.display.kind, PreviewStyle::Pixels(ImageProtocol::Kitty));
        assert_eq!(ui.state.overlays.message, None);
    }

    #[test]
    fn missing_pixel_support_is_reported_once() {
        let mut ui = ui_requesting_pixels(MultiplexerPassthrough::Direct);
        ui.handle_event(Event::TerminalReply(TerminalReply::Attributes));
        assert!(ui.screen_text().contains("kitty images"), "{}", ui.screen_text());
        let refusal = ui.state.display.pixels.map(UnconfirmedImageProtocol::unsupported_message);
        assert_eq!(ui.state.overlays.message.as_ref().map(|message| message.words.clone()), refusal);
        assert_eq!(ui.state.display.kind, PreviewStyle::HalfBlock);
        ui.press_character('s');
        ui.handle_event(Event::TerminalReply(TerminalReply::Attributes));
        ui.advance_clock(2000);
        assert!(
            !ui.screen_text().contains("kitty images"),
            "should be reported only once: {}",
            ui.screen_text()
        );
    }

    #[test]
    fn tmux_without_passthrough_is_reported() {
        let mut ui = ui_requesting_pixels(MultiplexerPassthrough::Tmux);
        ui.handle_event(Event::TerminalReply(TerminalReply::Attributes));
        ui.advance_clock(900);
        assert_eq!(ui.state.overlays.message, None);
        assert!(ui.state.next_tick().is_some_and(|tick| tick <= ui.now + Duration::from_millis(100)));
        ui.advance_clock(100);
        assert!(ui.screen_text().contains("allow-passthrough on"), "{}", ui.screen_text());
        ui.handle_event(Event::TerminalReply(TerminalReply::Images(ImageProtocol::Kitty)));
        assert_eq!(ui.state.display.kind, PreviewStyle::Pixels(ImageProtocol::Kitty));
        assert!(!ui.screen_text().contains("allow-passthrough"), "{}", ui.screen_text());
    }

    #[test]
    fn octants_increase_the_preview_resolution() {
        let mut state = state(80, 24);
        request_first_render(&mut state);
        let before = state.request.preview_size.expect("a size");
        let foot = TerminalReply::Name(TerminalId { brand: TerminalBrand::Foot, version: [1, 20] });
        assert!(handle_reply(&mut state, foot).is_empty(), "the name was not queried");
        assert_eq!(state.display.capabilities, TerminalExtras::default());
        state.display.ask = TerminalQueries { blocks: true, ..TerminalQueries::default() };
        let effects = handle_reply(&mut state, foot);
        let [Effect::Send(Command::Preview(Some(size)))] = &effects[..] else { panic!("{effects:?}") };
        assert_eq!((size.width, size.height), (2 * before.width, 2 * before.height));
        assert_eq!(state.display.kind, PreviewStyle::Octant);
    }

    #[test]
    fn terminal_name_determines_capabilities() {
        let mut state = state(80, 24);
        state.display.ask = TerminalQueries { name: true, ..TerminalQueries::default() };
        let ghostty = TerminalId { brand: TerminalBrand::Ghostty, version: [1, 2] };
        assert!(matches!(handle_reply(&mut state, TerminalReply::Name(ghostty))[..], [Effect::ReportFocus]));
        assert_eq!(state.display.capabilities, ghostty.terminal_extras());
        assert!(
            handle_reply(&mut state, TerminalReply::Name(ghostty)).is_empty(),
            "focus reporting is already enabled"
        );
    }

    #[test]
    fn only_queried_colors_are_used() {
        let mut state = state_with(80, 24, PreviewStyle::HalfBlock, ColorDepth::Ansi16, Default::default());
        let answers = [
            TerminalReply::Ink { index: 1, rgb: [180, 30, 30] },
            TerminalReply::Ink { index: 200, rgb: [180, 30, 30] },
            TerminalReply::Background([255; 3]),
            TerminalReply::TrueColor,
        ];
        for answer in answers {
            handle_reply(&mut state, answer);
        }
        assert_eq!(
            (state.display.ansi, state.display.is_light, state.display.depth),
            (XTERM, false, ColorDepth::Ansi16)
        );
        state.display.ask = TerminalQueries {
            true_color: true,
            background: true,
            palette: true,
            ..TerminalQueries::default()
        };
        for answer in answers {
            handle_reply(&mut state, answer);
        }
        assert_eq!(state.display.ansi[1], [180, 30, 30]);
        assert_eq!((state.display.is_light, state.display.depth), (true, ColorDepth::TrueColor));
    }
}
