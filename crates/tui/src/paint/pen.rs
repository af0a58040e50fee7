//! Colors and modifiers of the terminal's pen.

use ratatui::style::Modifier;

use super::terminal_color::{ColorLayer, TerminalColor, push_number};

/// Colors and modifiers for the next character.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Pen {
    pub(super) fg: TerminalColor,
    pub(super) bg: TerminalColor,
    pub(super) modifier: Modifier,
    /// Number of the character's hyperlink, or 0 if there is none.
    pub(super) link: u16,
}

/// Requirements that a pen must meet.
#[derive(Clone, Copy, Debug)]
pub(super) struct PenRequirements {
    /// Required foreground color, or `None` if any color is acceptable.
    pub(super) fg: Option<TerminalColor>,
    /// Required background color, or `None` if any color is acceptable.
    pub(super) bg: Option<TerminalColor>,
    /// Required state of the modifiers in `matters`.
    pub(super) modifier: Modifier,
    /// The modifiers that matter. Others may be on or off.
    pub(super) matters: Modifier,
    /// Number of the hyperlink, or 0 if there is none.
    pub(super) link: u16,
}

/// Modifiers and the SGR parameters that turn them on and off.
const MODIFIERS: [(Modifier, u16, u16); 9] = [
    (Modifier::BOLD, 1, 22),
    (Modifier::DIM, 2, 22),
    (Modifier::ITALIC, 3, 23),
    (Modifier::UNDERLINED, 4, 24),
    (Modifier::SLOW_BLINK, 5, 25),
    (Modifier::RAPID_BLINK, 6, 25),
    (Modifier::REVERSED, 7, 27),
    (Modifier::HIDDEN, 8, 28),
    (Modifier::CROSSED_OUT, 9, 29),
];

impl Pen {
    /// The pen's state after SGR 0.
    pub(super) const RESET: Self = Self {
        fg: TerminalColor::DefaultForeground,
        bg: TerminalColor::DefaultBackground,
        modifier: Modifier::empty(),
        link: 0,
    };

    /// Requirements met only by this pen.
    pub(super) fn exact_requirements(self) -> PenRequirements {
        PenRequirements {
            fg: Some(self.fg),
            bg: Some(self.bg),
            modifier: self.modifier,
            matters: Modifier::all(),
            link: self.link,
        }
    }

    /// Makes this pen meet the requirements, appending the shortest SGR sequence that does so. The screen
    /// model handles hyperlinks.
    pub(super) fn switch_to(&mut self, requirements: &PenRequirements, out: &mut Vec<u8>) {
        let mut list = Vec::new();
        let changed = self.push_changes(requirements, &mut list);
        if list.is_empty() {
            return;
        }
        let mut afresh = b"0".to_vec();
        let reset = Self { link: self.link, ..Self::RESET }.push_changes(requirements, &mut afresh);
        let is_shorter = afresh.len() < list.len();
        out.extend_from_slice(b"\x1b[");
        out.extend_from_slice(if is_shorter { &afresh } else { &list });
        out.push(b'm');
        *self = if is_shorter { reset } else { changed };
    }

    /// Appends SGR parameters that make this pen meet the requirements. Returns the new pen.
    fn push_changes(mut self, requirements: &PenRequirements, list: &mut Vec<u8>) -> Self {
        let surplus = (self.modifier - requirements.modifier) & requirements.matters;
        for (modifier, _, off) in MODIFIERS {
            if surplus.contains(modifier) && self.modifier.contains(modifier) {
                push_parameter(off, list);
                // One parameter may turn off two modifiers.
                for (other, _, other_off) in MODIFIERS {
                    self.modifier.set(other, self.modifier.contains(other) && other_off != off);
                }
            }
        }
        let missing = (requirements.modifier & requirements.matters) - self.modifier;
        for (modifier, on, _) in MODIFIERS {
            if missing.contains(modifier) {
                push_parameter(on, list);
            }
        }
        self.modifier |= missing;
        for (own, wished, layer) in [
            (&mut self.fg, requirements.fg, ColorLayer::Foreground),
            (&mut self.bg, requirements.bg, ColorLayer::Background),
        ] {
            if let Some(shade) = wished.filter(|shade| shade != own) {
                push_separator(list);
                shade.push_sgr(layer, list);
                *own = shade;
            }
        }
        self
    }
}

fn push_parameter(number: u16, list: &mut Vec<u8>) {
    push_separator(list);
    push_number(number, list);
}

fn push_separator(list: &mut Vec<u8>) {
    if !list.is_empty() {
        list.push(b';');
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn bytes_of_switch(from: Pen, to: Pen) -> String {
        let (mut pen, mut out) = (from, Vec::new());
        pen.switch_to(&to.exact_requirements(), &mut out);
        assert_eq!(pen, to);
        String::from_utf8(out).expect("ASCII")
    }

    #[test]
    fn unchanged_attributes_are_not_sent() {
        let bold = Pen { modifier: Modifier::BOLD, ..Pen::RESET };
        let red = Pen { fg: TerminalColor::Palette(1), ..bold };
        assert_eq!(bytes_of_switch(red, red), "");
        assert_eq!(bytes_of_switch(Pen::RESET, red), "\x1b[1;31m");
        assert_eq!(bytes_of_switch(red, bold), "\x1b[39m");
        assert_eq!(bytes_of_switch(red, Pen::RESET), "\x1b[0m");
        let dim = Pen { modifier: Modifier::DIM, ..red };
        assert_eq!(bytes_of_switch(red, dim), "\x1b[22;2m");
        let colors =
            Pen { fg: TerminalColor::Rgb([1, 2, 3]), bg: TerminalColor::Rgb([4, 5, 6]), ..Pen::RESET };
        assert_eq!(bytes_of_switch(red, colors), "\x1b[0;38;2;1;2;3;48;2;4;5;6m");
    }

    fn pen() -> impl Strategy<Value = Pen> {
        let shade = |own| {
            prop_oneof![
                Just(own),
                any::<u8>().prop_map(TerminalColor::Palette),
                any::<[u8; 3]>().prop_map(TerminalColor::Rgb)
            ]
        };
        (shade(TerminalColor::DefaultForeground), shade(TerminalColor::DefaultBackground), any::<u16>())
            .prop_map(|(fg, bg, bits)| {
                Pen {
                    fg,
                    bg,
                    // Some terminals cannot combine bold and dim.
                    modifier: Modifier::from_bits_truncate(if bits & 3 == 3 { bits & !1 } else { bits }),
                    link: 0,
                }
            })
    }

    proptest! {
        #[test]
        fn terminal_gets_the_required_pen(pens in proptest::collection::vec(pen(), 1..8)) {
            let side = |length| std::num::NonZero::new(length).expect("not zero");
            let mut parser = vt100::Parser::new(side(1), side(80), 0);
            let mut current = Pen::RESET;
            for pen in pens {
                let mut out = Vec::new();
                current.switch_to(&pen.exact_requirements(), &mut out);
                parser.process(&out);
                let screen = parser.screen();
                let modifiers = [
                    (Modifier::BOLD, screen.bold()),
                    (Modifier::DIM, screen.dim()),
                    (Modifier::ITALIC, screen.italic()),
                    (Modifier::UNDERLINED, screen.underline()),
                    (Modifier::REVERSED, screen.inverse()),
                ];
                for (modifier, is_on) in modifiers {
                    prop_assert_eq!(pen.modifier.contains(modifier), is_on, "{:?} {:?}", modifier, pen);
                }
                let shade = |color, own| match color {
                    vt100::Color::Default => own,
                    vt100::Color::Idx(index) => TerminalColor::Palette(index),
                    vt100::Color::Rgb(r, g, b) => TerminalColor::Rgb([r, g, b]),
                };
                prop_assert_eq!(shade(screen.fgcolor(), TerminalColor::DefaultForeground), pen.fg);
                prop_assert_eq!(shade(screen.bgcolor(), TerminalColor::DefaultBackground), pen.bg);
            }
        }
    }
}
