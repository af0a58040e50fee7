//! Key bindings and their help texts.

use crossterm::event::{KeyCode, KeyModifiers};

use super::action::Action;
use super::event::KeyPress;
use super::messages;

/// A row in a table of key bindings.
pub(super) struct KeyBinding<A = Action> {
    /// Keys that trigger the action.
    pub keys: &'static [KeyPress],
    /// Label in the help, or empty if the label in the previous row covers this key.
    pub label: &'static str,
    pub action: A,
    /// Description in the help, or empty if the previous row describes this key.
    pub help: &'static str,
    /// The word shown in the key line, or empty if the key is not listed there.
    pub hint: &'static str,
}

const fn define_binding<A: Copy>(
    keys: &'static [KeyPress],
    label: &'static str,
    action: A,
    help: &'static str,
    hint: &'static str,
) -> KeyBinding<A> {
    KeyBinding { keys, label, action, help, hint }
}

const LEFT: KeyPress = KeyPress::special(KeyCode::Left);
const RIGHT: KeyPress = KeyPress::special(KeyCode::Right);
const UP: KeyPress = KeyPress::special(KeyCode::Up);
const DOWN: KeyPress = KeyPress::special(KeyCode::Down);

/// All key bindings, in the order in which the help lists them.
pub(super) const KEYMAP: &[KeyBinding] = &[
    define_binding(&[KeyPress::plain('?')], "?", Action::ToggleHelp, messages::HELP_TOGGLE, "help"),
    define_binding(&[KeyPress::plain('q')], "q", Action::Quit, "quit", "quit"),
    define_binding(&[KeyPress::plain('s')], "s", Action::CycleShadows, "shadows: soft, hard, off", ""),
    define_binding(&[KeyPress::plain('d')], "d", Action::ToggleDepthOfField, "depth of field on or off", ""),
    define_binding(&[KeyPress::plain('p')], "p", Action::TogglePhotons, "photons on or off", ""),
    define_binding(&[KeyPress::plain('i')], "i", Action::CycleIntegrator, "integrator: whitted, path", ""),
    define_binding(
        &[KeyPress::plain('v')],
        "v",
        Action::NextView,
        "next view, with a list (1-9); V: previous view",
        "",
    ),
    define_binding(
        &[KeyPress::special(KeyCode::Tab)],
        "tab",
        Action::ShowImageOnly,
        "show only the image",
        "image",
    ),
    define_binding(&[KeyPress::plain('V')], "", Action::PreviousView, "", ""),
    define_binding(
        &[KeyPress::plain('x')],
        "x",
        Action::ActualPixels,
        "actual pixels (1:1) around the crosshair",
        "",
    ),
    define_binding(
        &[KeyPress::plain('z')],
        "z",
        Action::RenderRegionFirst,
        "render a region first (drag; z: at the crosshair)",
        "",
    ),
    define_binding(
        &[LEFT, KeyPress::plain('h')],
        "arrows hjkl",
        Action::OrbitLeft,
        "orbit the camera (or drag)",
        "",
    ),
    define_binding(&[DOWN, KeyPress::plain('j')], "", Action::OrbitDown, "", ""),
    define_binding(&[UP, KeyPress::plain('k')], "", Action::OrbitUp, "", ""),
    define_binding(&[RIGHT, KeyPress::plain('l')], "", Action::OrbitRight, "", ""),
    define_binding(
        &[KeyPress::plain('+'), KeyPress::plain('=')],
        "+ -",
        Action::DollyIn,
        "move closer / farther (or wheel)",
        "",
    ),
    define_binding(&[KeyPress::plain('-')], "", Action::DollyOut, "", ""),
    define_binding(&[KeyPress::plain('<')], "< >", Action::NarrowField, "narrower / wider field of view", ""),
    define_binding(&[KeyPress::plain('>')], "", Action::WidenField, "", ""),
    define_binding(&[KeyPress::plain('[')], "[ ]", Action::Darken, "darker / brighter exposure", ""),
    define_binding(&[KeyPress::plain(']')], "", Action::Brighten, "", ""),
    define_binding(
        &[KeyPress::plain('f')],
        "f",
        Action::Focus,
        "focus where you click; f again: at crosshair",
        "",
    ),
    define_binding(
        &[KeyPress::plain('c')],
        "c",
        Action::KeepCamera,
        "write the camera into the scene file",
        "",
    ),
    define_binding(&[KeyPress::plain('u')], "u", Action::UndoCamera, "undo the last c", ""),
    define_binding(
        &[KeyPress::special(KeyCode::Enter)],
        "Enter, click",
        Action::Inspect,
        "inspect the object at the crosshair or mouse",
        "",
    ),
    define_binding(&[KeyPress::plain('y')], "y", Action::Copy, "copy the inspected values", ""),
    define_binding(
        &[KeyPress::plain('o')],
        "o",
        Action::Edit,
        "open the editor at the error or clicked object",
        "",
    ),
    define_binding(
        &[KeyPress::plain('m')],
        "m",
        Action::ToggleMouse,
        "mouse on or off (off to select text)",
        "",
    ),
    define_binding(
        &[KeyPress::plain('b')],
        "b",
        Action::CompareLastEdit,
        "compare before and after the last edit",
        "",
    ),
    define_binding(
        &[KeyPress::plain('n')],
        "n N",
        Action::OlderRender,
        "older / newer render (or click in the history)",
        "",
    ),
    define_binding(&[KeyPress::plain('N')], "N", Action::NewerRender, "", ""),
    define_binding(
        &[KeyPress::plain(' ')],
        "space",
        Action::TogglePause,
        "pause or resume the render",
        "pause",
    ),
    define_binding(&[KeyPress::plain('r')], "r", Action::RenderAgain, "render again", "again"),
    define_binding(&[KeyPress::plain('w')], "w", Action::WriteImage, "write the newest image now", "write"),
    define_binding(
        &[KeyPress::plain('0')],
        "0",
        Action::ResetSettings,
        "reset to the scene's settings",
        "reset",
    ),
    define_binding(
        &[KeyPress::plain('e')],
        "e",
        Action::ToggleDiagnostics,
        "show or hide errors and warnings",
        "",
    ),
    define_binding(&[KeyPress::ctrl('l')], "ctrl-l", Action::Redraw, "redraw the screen", ""),
    define_binding(&[KeyPress::ctrl('z')], "ctrl-z", Action::Suspend, "suspend to the shell", ""),
    define_binding(&[KeyPress::ctrl('c')], "ctrl-c", Action::Interrupt, "interrupt, exit code 130", ""),
];

/// Key actions available while the help, the diagnostics or the view list is open. They take precedence over
/// other actions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum OverlayAction {
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

/// Key bindings for overlays.
pub(super) const OVERLAY: &[KeyBinding<OverlayAction>] = &[
    define_binding(
        &[KeyPress::plain('j'), KeyPress::special(KeyCode::Down)],
        "j k",
        OverlayAction::LineDown,
        "or down, up: scroll the text or choose a view",
        "scroll",
    ),
    define_binding(
        &[KeyPress::plain('k'), KeyPress::special(KeyCode::Up)],
        "",
        OverlayAction::LineUp,
        "",
        "",
    ),
    define_binding(
        &[KeyPress::special(KeyCode::PageDown)],
        "PgDn PgUp",
        OverlayAction::PageDown,
        "scroll by a page",
        "page",
    ),
    define_binding(&[KeyPress::special(KeyCode::PageUp)], "", OverlayAction::PageUp, "", ""),
    define_binding(&[LEFT, KeyPress::plain('h')], "", OverlayAction::ColumnLeft, "", ""),
    define_binding(&[RIGHT, KeyPress::plain('l')], "", OverlayAction::ColumnRight, "", ""),
    define_binding(
        &[KeyPress::special(KeyCode::Enter)],
        "Enter /",
        OverlayAction::Take,
        "in the view list: Enter close, / search",
        "",
    ),
    define_binding(&[KeyPress::plain('/')], "", OverlayAction::Find, "", ""),
    define_binding(
        &[KeyPress::special(KeyCode::Esc)],
        "esc",
        OverlayAction::Close,
        "close the overlay; back to the newest render",
        "close",
    ),
];

/// The overlay action for a key.
pub(super) fn overlay_action_for_key(key: KeyPress) -> Option<OverlayAction> {
    OVERLAY.iter().find(|binding| binding.keys.contains(&key)).map(|binding| binding.action)
}

/// Returns the action for a key. Shift is ignored for characters, because not all terminals report it with a
/// capital letter or `?`.
pub(super) fn action_for_key(key: KeyPress) -> Option<Action> {
    let modifiers = match key.code {
        KeyCode::Char(_) => key.modifiers - KeyModifiers::SHIFT,
        _ => key.modifiers,
    };
    let key = KeyPress { modifiers, ..key };
    KEYMAP.iter().find(|binding| binding.keys.contains(&key)).map(|binding| binding.action)
}

/// Returns the key binding for an action. Every action has one.
pub(super) fn binding_for_action(action: Action) -> Option<&'static KeyBinding> {
    KEYMAP.iter().find(|binding| binding.action == action)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_bound_once() {
        let keys: Vec<_> = KEYMAP.iter().flat_map(|binding| binding.keys).collect();
        let overlay: Vec<_> = OVERLAY.iter().flat_map(|binding| binding.keys).collect();
        for keys in [keys, overlay] {
            for (i, key) in keys.iter().enumerate() {
                assert!(!keys[..i].contains(key), "{key:?} is bound twice");
            }
        }
    }

    #[test]
    fn shift_is_ignored_for_characters() {
        let shifted = KeyPress { code: KeyCode::Char('?'), modifiers: KeyModifiers::SHIFT };
        assert_eq!(action_for_key(shifted), Some(Action::ToggleHelp));
        assert_eq!(action_for_key(KeyPress::plain('V')), Some(Action::PreviousView));
        assert_eq!(action_for_key(KeyPress::ctrl('q')), None);
        assert_eq!(action_for_key(KeyPress::plain('g')), None);
    }

    #[test]
    fn documented_keys_are_bound() {
        for key in "?qsdpiv rw0hjkl+-<>[]fcombnNxzeuy".chars() {
            assert!(action_for_key(KeyPress::plain(key)).is_some(), "{key:?}");
        }
    }
}
