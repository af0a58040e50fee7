//! The one table of keys: what they do and what the help says of them.

use crossterm::event::{KeyCode, KeyModifiers};

use super::action::Action;
use super::event::KeyPress;

/// One line of a table.
pub(super) struct Binding<A = Action> {
    /// The keys that do it.
    pub keys: &'static [KeyPress],
    /// Labels of the keys in the help; empty if the line before has them.
    pub label: &'static str,
    pub action: A,
    /// Effect of the keys, for the help; empty if the line before tells it.
    pub help: &'static str,
    /// One word for the line of keys; empty: not there.
    pub hint: &'static str,
}

const fn binding<A: Copy>(
    keys: &'static [KeyPress],
    label: &'static str,
    action: A,
    help: &'static str,
    hint: &'static str,
) -> Binding<A> {
    Binding { keys, label, action, help, hint }
}

const LEFT: KeyPress = KeyPress::special(KeyCode::Left);
const RIGHT: KeyPress = KeyPress::special(KeyCode::Right);
const UP: KeyPress = KeyPress::special(KeyCode::Up);
const DOWN: KeyPress = KeyPress::special(KeyCode::Down);

/// Every key, in the order of the help.
pub(super) const KEYMAP: &[Binding] = &[
    binding(&[KeyPress::plain('?')], "?", Action::ToggleHelp, "show or hide this help", "help"),
    binding(&[KeyPress::plain('q')], "q", Action::Quit, "quit", "quit"),
    binding(&[KeyPress::plain('s')], "s", Action::CycleShadows, "shadows: soft, hard, off", ""),
    binding(&[KeyPress::plain('d')], "d", Action::ToggleDepthOfField, "depth of field on or off", ""),
    binding(&[KeyPress::plain('p')], "p", Action::TogglePhotons, "photons on, off", ""),
    binding(&[KeyPress::plain('i')], "i", Action::CycleIntegrator, "integrator: whitted, path", ""),
    binding(
        &[KeyPress::plain('v')],
        "v",
        Action::NextView,
        "next view, and a list of them: 1-9 choose; V: previous view",
        "",
    ),
    binding(&[KeyPress::special(KeyCode::Tab)], "tab", Action::PictureAlone, "the picture alone", "picture"),
    binding(&[KeyPress::plain('V')], "", Action::PreviousView, "", ""),
    binding(&[KeyPress::plain('x')], "x", Action::CloseUp, "pixels 1:1 around the crosshair, and back", ""),
    binding(
        &[KeyPress::plain('z')],
        "z",
        Action::RectangleFirst,
        "drag what to render first; z z: at the crosshair; z: end",
        "",
    ),
    binding(
        &[LEFT, KeyPress::plain('h')],
        "arrows hjkl",
        Action::OrbitLeft,
        "orbit the camera; a drag too",
        "",
    ),
    binding(&[DOWN, KeyPress::plain('j')], "", Action::OrbitDown, "", ""),
    binding(&[UP, KeyPress::plain('k')], "", Action::OrbitUp, "", ""),
    binding(&[RIGHT, KeyPress::plain('l')], "", Action::OrbitRight, "", ""),
    binding(
        &[KeyPress::plain('+'), KeyPress::plain('=')],
        "+ -",
        Action::DollyIn,
        "the camera nearer, farther; the wheel too",
        "",
    ),
    binding(&[KeyPress::plain('-')], "", Action::DollyOut, "", ""),
    binding(&[KeyPress::plain('<')], "< >", Action::NarrowField, "field of view narrower, wider", ""),
    binding(&[KeyPress::plain('>')], "", Action::WidenField, "", ""),
    binding(&[KeyPress::plain('[')], "[ ]", Action::Darken, "exposure: darker, brighter", ""),
    binding(&[KeyPress::plain(']')], "", Action::Brighten, "", ""),
    binding(&[KeyPress::plain('f')], "f", Action::Focus, "click to focus there; f f: at the crosshair", ""),
    binding(&[KeyPress::plain('c')], "c", Action::KeepCamera, "write the camera into the scene file", ""),
    binding(
        &[KeyPress::plain('u')],
        "u",
        Action::UndoCamera,
        "undo c, if the file is still as c left it",
        "",
    ),
    binding(
        &[KeyPress::special(KeyCode::Enter)],
        "Enter, click",
        Action::Inspect,
        "inspect the object there",
        "",
    ),
    binding(
        &[KeyPress::plain('y')],
        "y",
        Action::Copy,
        "copy what a click said: radiance too, and the pixel's place",
        "",
    ),
    binding(
        &[KeyPress::plain('o')],
        "o",
        Action::Edit,
        "open the editor at the error or the clicked object",
        "",
    ),
    binding(&[KeyPress::plain('m')], "m", Action::ToggleMouse, "mouse on, off (to select text)", ""),
    binding(
        &[KeyPress::plain('b')],
        "b",
        Action::BeforeAfter,
        "switch between before and after the last edit",
        "",
    ),
    binding(
        &[KeyPress::plain('n')],
        "n N",
        Action::OlderPicture,
        "older, newer pictures; a click in the strip too",
        "",
    ),
    binding(&[KeyPress::plain('N')], "N", Action::NewerPicture, "", ""),
    binding(&[KeyPress::plain(' ')], "space", Action::TogglePause, "pause the render, or go on", "pause"),
    binding(&[KeyPress::plain('r')], "r", Action::RenderAgain, "render again", "again"),
    binding(&[KeyPress::plain('w')], "w", Action::WriteNow, "write the newest image as it is now", "write"),
    binding(&[KeyPress::plain('0')], "0", Action::SceneSettings, "reset to the scene's settings", "reset"),
    binding(&[KeyPress::plain('e')], "e", Action::ToggleDiagnostics, "show or hide errors and warnings", ""),
    binding(&[KeyPress::ctrl('l')], "ctrl-l", Action::Redraw, "draw the screen anew", ""),
    binding(&[KeyPress::ctrl('z')], "ctrl-z", Action::Suspend, "stop and go back to the shell", ""),
    binding(&[KeyPress::ctrl('c')], "ctrl-c", Action::Interrupt, "interrupt, exit code 130", ""),
];

/// Actions of keys while the help, the errors or the list of views are open; they come before the usual actions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Overlay {
    LineUp,
    LineDown,
    PageUp,
    PageDown,
    ColumnLeft,
    ColumnRight,
    Take,
    Find,
    Close,
}

/// The keys of what lies over the picture.
pub(super) const OVERLAY: &[Binding<Overlay>] = &[
    binding(
        &[KeyPress::plain('j'), KeyPress::special(KeyCode::Down)],
        "j k",
        Overlay::LineDown,
        "or down, up: scroll help, errors; choose a view",
        "scroll",
    ),
    binding(&[KeyPress::plain('k'), KeyPress::special(KeyCode::Up)], "", Overlay::LineUp, "", ""),
    binding(
        &[KeyPress::special(KeyCode::PageDown)],
        "PgDn PgUp",
        Overlay::PageDown,
        "scroll them by a page",
        "page",
    ),
    binding(&[KeyPress::special(KeyCode::PageUp)], "", Overlay::PageUp, "", ""),
    binding(&[LEFT, KeyPress::plain('h')], "", Overlay::ColumnLeft, "", ""),
    binding(&[RIGHT, KeyPress::plain('l')], "", Overlay::ColumnRight, "", ""),
    binding(
        &[KeyPress::special(KeyCode::Enter)],
        "Enter /",
        Overlay::Take,
        "the list of views: close it; find a name",
        "",
    ),
    binding(&[KeyPress::plain('/')], "", Overlay::Find, "", ""),
    binding(
        &[KeyPress::special(KeyCode::Esc)],
        "esc",
        Overlay::Close,
        "close what is open; back to the newest picture",
        "close",
    ),
];

/// The action of a key on an overlay, if it has one.
pub(super) fn overlay(key: KeyPress) -> Option<Overlay> {
    OVERLAY.iter().find(|binding| binding.keys.contains(&key)).map(|binding| binding.action)
}

/// The action of a key, if it has one. Terminals differ in whether they report shift beside a capital or `?`, so shift does not
/// count for characters.
pub(super) fn action(key: KeyPress) -> Option<Action> {
    let modifiers = match key.code {
        KeyCode::Char(_) => key.modifiers - KeyModifiers::SHIFT,
        _ => key.modifiers,
    };
    let key = KeyPress { modifiers, ..key };
    KEYMAP.iter().find(|binding| binding.keys.contains(&key)).map(|binding| binding.action)
}

/// The line of an action; every action has one.
pub(super) fn of(action: Action) -> Option<&'static Binding> {
    KEYMAP.iter().find(|binding| binding.action == action)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_key_means_two_things() {
        let keys: Vec<_> = KEYMAP.iter().flat_map(|binding| binding.keys).collect();
        let overlay: Vec<_> = OVERLAY.iter().flat_map(|binding| binding.keys).collect();
        for keys in [keys, overlay] {
            for (i, key) in keys.iter().enumerate() {
                assert!(!keys[..i].contains(key), "{key:?} is bound twice");
            }
        }
    }

    #[test]
    fn shift_beside_a_character_does_not_count_and_ctrl_does() {
        let shifted = KeyPress { code: KeyCode::Char('?'), modifiers: KeyModifiers::SHIFT };
        assert_eq!(action(shifted), Some(Action::ToggleHelp));
        assert_eq!(action(KeyPress::plain('V')), Some(Action::PreviousView));
        assert_eq!(action(KeyPress::ctrl('q')), None);
        assert_eq!(action(KeyPress::plain('g')), None);
    }

    #[test]
    fn the_fixed_keys_are_there() {
        for key in "?qsdpiv rw0hjkl+-<>[]fcombnNxzeuy".chars() {
            assert!(action(KeyPress::plain(key)).is_some(), "{key:?}");
        }
    }
}
