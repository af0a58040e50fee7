//! Answers of the terminal about itself.

use super::request::resized_preview;
use super::say::say_until_key;
use crate::color::{ColorDepth, Shades};
use crate::event::Effect;
use crate::graphics::Protocol;
use crate::known::Answer;
use crate::known::Blocks;
use crate::pixels::PixelRequest;
use crate::preview_kind::PreviewKind;
use crate::state::State;
use crate::terminals::Terminal;
use crate::view::ramp;

/// Shows everything as well as the terminal can from now on, if the answer belongs to a question.
pub(super) fn learn(state: &mut State, answer: Answer) -> Vec<Effect> {
    let mut effects = judge(state, answer);
    match answer {
        Answer::Name(terminal) => effects.extend(name(state, terminal)),
        Answer::Focus { is_here } => state.display.has_focus = is_here,
        Answer::TrueColor if state.display.ask.true_color => show(state, ColorDepth::TrueColor),
        Answer::Ink { index, rgb } if state.display.ask.palette => {
            if let Some(ink) = state.display.ansi.get_mut(usize::from(index)).filter(|ink| **ink != rgb) {
                *ink = rgb;
                show(state, state.display.depth);
            }
        }
        Answer::Background(rgb) if state.display.ask.background => {
            let is_light = ramp::is_light(rgb);
            state.dirty |= std::mem::replace(&mut state.display.is_light, is_light) != is_light;
        }
        Answer::Images(_)
        | Answer::TrueColor
        | Answer::Ink { .. }
        | Answer::Background(_)
        | Answer::Ready
        | Answer::Attributes
        | Answer::Synchronized { .. }
        | Answer::Other => {}
    }
    effects
}

/// What an answer says about requested pixels.
enum Verdict {
    Nothing,
    Has,
    Lacks,
}

fn verdict(request: PixelRequest, answer: Answer) -> Verdict {
    match answer {
        Answer::Images(protocol) if protocol == request.protocol => Verdict::Has,
        Answer::Name(terminal)
            if request.protocol == Protocol::Iterm && terminal.brand.has_iterm_images() =>
        {
            Verdict::Has
        }
        Answer::Attributes if request.ends_with_attributes() => Verdict::Lacks,
        Answer::Images(_)
        | Answer::Name(_)
        | Answer::Attributes
        | Answer::Ready
        | Answer::Synchronized { .. }
        | Answer::Focus { .. }
        | Answer::TrueColor
        | Answer::Background(_)
        | Answer::Ink { .. }
        | Answer::Other => Verdict::Nothing,
    }
}

/// Draws in pixels from now on if the answer says that the terminal has them.
fn judge(state: &mut State, answer: Answer) -> Vec<Effect> {
    let Some(request) = state.display.pixels else { return Vec::new() };
    match verdict(request, answer) {
        Verdict::Nothing => Vec::new(),
        Verdict::Lacks => {
            lack_pixels(state);
            Vec::new()
        }
        Verdict::Has => {
            (state.display.pixels, state.display.pixels_until) = (None, None);
            state.overlays.message.take_if(|message| message.words == request.refusal());
            state.display.kind = PreviewKind::Pixels(request.protocol);
            state.dirty = true;
            resized_preview(state)
        }
    }
}

/// Says, once, that the terminal does not show pixels. A late answer is still heard.
pub(super) fn lack_pixels(state: &mut State) {
    let asked = state.display.pixels_until.take().and(state.display.pixels);
    if let Some(request) = asked {
        say_until_key(state, request.refusal());
    }
}

fn show(state: &mut State, depth: ColorDepth) {
    state.display.depth = depth;
    state.display.shades = Shades::new(depth, &state.display.ansi);
    state.dirty = true;
}

/// Takes the terminal's name: its blocks and its other abilities, if glimt asked for them.
fn name(state: &mut State, terminal: Terminal) -> Vec<Effect> {
    let ask = state.display.ask;
    let mut effects = Vec::new();
    if ask.name {
        let had_focus = std::mem::replace(&mut state.display.abilities, terminal.abilities()).focus;
        effects.extend((state.display.abilities.focus && !had_focus).then_some(Effect::ReportFocus));
        state.dirty = true;
    }
    if ask.blocks {
        effects.extend(draw_in(state, Blocks::of(terminal)));
    }
    effects
}

fn draw_in(state: &mut State, blocks: Blocks) -> Vec<Effect> {
    let kind = match blocks {
        Blocks::Unknown => return Vec::new(),
        Blocks::Sextants => PreviewKind::Sextant,
        Blocks::Octants => PreviewKind::Octant,
    };
    if state.display.kind == PreviewKind::HalfBlock {
        state.display.kind = kind;
        state.dirty = true;
    }
    resized_preview(state)
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::color::XTERM;
    use crate::event::Event;
    use crate::fixtures::{Desk, state, state_with};
    use crate::known::Ask;
    use crate::pipeline::protocol::Command;
    use crate::pixels::Passage;
    use crate::terminals::{Abilities, Brand};
    use crate::update::start;

    /// A desk of a user who wants kitty's images.
    fn wanting_pixels(passage: Passage) -> Desk {
        let mut state = state(80, 24);
        let request = PixelRequest { protocol: Protocol::Kitty, passage, is_known: false };
        state.display.pixels = Some(request);
        state.display.pixels_until = Some(request.deadline(state.now));
        Desk::with(state)
    }

    #[test]
    fn pixels_are_drawn_once_the_terminal_confirms_them() {
        let mut desk = wanting_pixels(Passage::Direct);
        assert_eq!(desk.state.display.kind, PreviewKind::HalfBlock);
        let effects = desk.event(Event::Answer(Answer::Images(Protocol::Kitty)));
        assert!(matches!(&effects[..], [Effect::Send(Command::Preview(Some(_)))]), "{effects:?}");
        desk.event(Event::Answer(Answer::Attributes));
        desk.wait(2000);
        assert_eq!(desk.state.display.kind, PreviewKind::Pixels(Protocol::Kitty));
        assert_eq!(desk.state.overlays.message, None);
    }

    #[test]
    fn a_terminal_without_pixels_is_told_of_and_gets_half_blocks() {
        let mut desk = wanting_pixels(Passage::Direct);
        desk.event(Event::Answer(Answer::Attributes));
        assert!(desk.text().contains("this terminal shows no kitty images"), "{}", desk.text());
        assert_eq!(desk.state.display.kind, PreviewKind::HalfBlock);
        desk.press('s');
        desk.event(Event::Answer(Answer::Attributes));
        desk.wait(2000);
        assert!(!desk.text().contains("kitty images"), "said once: {}", desk.text());
    }

    #[test]
    fn a_closed_tmux_is_told_of_after_a_second_and_a_late_answer_counts() {
        let mut desk = wanting_pixels(Passage::Tmux);
        desk.event(Event::Answer(Answer::Attributes));
        desk.wait(900);
        assert_eq!(desk.state.overlays.message, None);
        assert!(desk.state.next_tick().is_some_and(|tick| tick <= desk.now + Duration::from_millis(100)));
        desk.wait(100);
        assert!(desk.text().contains("allow-passthrough on"), "{}", desk.text());
        desk.event(Event::Answer(Answer::Images(Protocol::Kitty)));
        assert_eq!(desk.state.display.kind, PreviewKind::Pixels(Protocol::Kitty));
        assert!(!desk.text().contains("allow-passthrough"), "{}", desk.text());
    }

    #[test]
    fn a_terminal_that_draws_octants_gets_a_finer_picture() {
        let mut state = state(80, 24);
        start(&mut state);
        let before = state.request.preview_size.expect("a size");
        let foot = Answer::Name(Terminal { brand: Brand::Foot, version: [1, 20] });
        assert!(learn(&mut state, foot).is_empty(), "nobody asked");
        assert_eq!(state.display.abilities, Abilities::default());
        state.display.ask = Ask { blocks: true, ..Ask::default() };
        let effects = learn(&mut state, foot);
        let [Effect::Send(Command::Preview(Some(size)))] = &effects[..] else { panic!("{effects:?}") };
        assert_eq!((size.width, size.height), (2 * before.width, 2 * before.height));
        assert_eq!(state.display.kind, PreviewKind::Octant);
    }

    #[test]
    fn a_terminal_that_says_its_name_can_what_it_is_known_for() {
        let mut state = state(80, 24);
        state.display.ask = Ask { name: true, ..Ask::default() };
        let ghostty = Terminal { brand: Brand::Ghostty, version: [1, 2] };
        assert!(matches!(learn(&mut state, Answer::Name(ghostty))[..], [Effect::ReportFocus]));
        assert_eq!(state.display.abilities, ghostty.abilities());
        assert!(learn(&mut state, Answer::Name(ghostty)).is_empty(), "it reports the focus already");
    }

    #[test]
    fn colours_and_background_are_believed_when_they_were_asked() {
        let mut state = state_with(80, 24, PreviewKind::HalfBlock, ColorDepth::Ansi16, Default::default());
        let answers = [
            Answer::Ink { index: 1, rgb: [180, 30, 30] },
            Answer::Ink { index: 200, rgb: [180, 30, 30] },
            Answer::Background([255; 3]),
            Answer::TrueColor,
        ];
        for answer in answers {
            learn(&mut state, answer);
        }
        assert_eq!(
            (state.display.ansi, state.display.is_light, state.display.depth),
            (XTERM, false, ColorDepth::Ansi16)
        );
        state.display.ask = Ask { true_color: true, background: true, palette: true, ..Ask::default() };
        for answer in answers {
            learn(&mut state, answer);
        }
        assert_eq!(state.display.ansi[1], [180, 30, 30]);
        assert_eq!((state.display.is_light, state.display.depth), (true, ColorDepth::TrueColor));
    }
}
