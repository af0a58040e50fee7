//! The key line: toggles with their values, keys that are currently useful, and the key that opens the help.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;

use super::header::state_symbol_word_and_role;
use super::layout::Layout;
use super::message;
use super::text::{TextRole, put_text, remaining_row_area, text_columns};
use crate::action::Action;
use crate::choice::Choice;
use crate::keymap::{self, KEYMAP, KeyBinding, OVERLAY, OverlayAction};
use crate::preview_style::PreviewStyle;
use crate::scene::report::summarize_diagnostic_counts;
use crate::state::{KeyboardOverrides, RequestStatus, State, ViewModeList};

/// A hint in the key line: a key with long and short descriptions.
struct KeyHint {
    key: &'static str,
    words: String,
    short: String,
    tone: TextRole,
}

impl KeyHint {
    fn new(key: &'static str, words: impl Into<String>) -> Self {
        let words = words.into();
        Self { key, short: words.clone(), words, tone: TextRole::Faint }
    }

    fn for_action(action: Action) -> Option<Self> {
        keymap::binding_for_action(action).map(|it| Self::new(it.label, it.hint))
    }

    fn width(&self, is_long: bool) -> u16 {
        text_columns(self.key) + 1 + text_columns(self.description(is_long)) + HINT_GAP
    }

    fn description(&self, is_long: bool) -> &str {
        if is_long { &self.words } else { &self.short }
    }
}

/// Number of columns between hints.
const HINT_GAP: u16 = 2;
/// Columns reserved for currently useful keys when deciding whether to show toggles in their long form.
const OF_USE: u16 = 26;

pub(super) fn draw(state: &State, layout: &Layout, buffer: &mut Buffer) {
    let area = layout.keys;
    if layout.under.is_empty() && message::has_message_to_show(state, layout) {
        return;
    }
    let ways = [KeyHint::for_action(Action::Quit), KeyHint::for_action(Action::ToggleHelp)];
    let ways: Vec<KeyHint> = ways.into_iter().flatten().collect();
    let width = |hints: &[KeyHint], is_long| hints.iter().map(|hint| hint.width(is_long)).sum::<u16>();
    // The help key is always shown, even if `q` does not fit.
    let skipped = usize::from(area.width < 44 && ways.len() > 1);
    let ways = &ways[skipped..];
    let toggles = if state.overlays.help.open { Vec::new() } else { hints_for_toggles(state) };
    let room = area.width.saturating_sub(width(ways, true).saturating_sub(HINT_GAP));
    let is_long = width(&toggles, true) + OF_USE <= room;
    let mut left = Rect { width: room, ..area };
    let (urgent, useful) = urgent_and_other_hints(state);
    for hint in fit_hints(urgent, useful, toggles, room, is_long) {
        left = remaining_row_area(left, draw_single_hint(&hint, left, is_long, state, buffer));
    }
    let mut right = remaining_row_area(area, room);
    for hint in ways {
        right = remaining_row_area(right, draw_single_hint(hint, right, true, state, buffer));
    }
}

/// Combines toggles and other hints. Space goes to urgent hints first, then to toggles, then to the others.
fn fit_hints(
    urgent: Vec<KeyHint>,
    useful: Vec<KeyHint>,
    toggles: Vec<KeyHint>,
    room: u16,
    is_long: bool,
) -> Vec<KeyHint> {
    let mut left = room;
    let mut take = |hints: Vec<KeyHint>| -> Vec<KeyHint> {
        let fits = |hint: &KeyHint| {
            let width = hint.width(is_long);
            let fits = width <= left;
            left -= if fits { width } else { 0 };
            fits
        };
        hints.into_iter().filter(fits).collect()
    };
    let urgent = take(urgent);
    let toggles = take(toggles);
    toggles.into_iter().chain(urgent).chain(take(useful)).collect()
}

fn draw_single_hint(hint: &KeyHint, area: Rect, is_long: bool, state: &State, buffer: &mut Buffer) -> u16 {
    let pieces =
        [(hint.key, TextRole::Strong), (" ", TextRole::Plain), (hint.description(is_long), hint.tone)];
    put_text(buffer, area, &pieces, state.display.depth);
    hint.width(is_long)
}

/// Hints for the toggles and their values. Toggles that were changed with keys are bold.
fn hints_for_toggles(state: &State) -> Vec<KeyHint> {
    // The values belong to the newest render, not to the one being viewed.
    if state.preview.history.is_viewing_older() {
        return Vec::new();
    }
    let honors_shadows = state.request.integrator().properties().honors_shadows;
    let shadows = if honors_shadows { state.request.shadow_mode().name() } else { "–" };
    let on_off = |on| if on { "on" } else { "off" };
    let photons = on_off(state.request.effective.as_ref().is_some_and(|it| it.photons));
    let keys = &state.request.toggles;
    let all = [
        (Action::CycleShadows, "shadows", shadows.to_owned(), keys.shadows.is_some()),
        (Action::TogglePhotons, "photons", photons.to_owned(), keys.photons.is_some()),
        (
            Action::ToggleDepthOfField,
            "dof",
            on_off(is_depth_of_field_on(state)).to_owned(),
            keys.dof.is_some(),
        ),
        (Action::NextView, "view", state.request.view_mode().name().to_owned(), keys.view.is_some()),
        (
            Action::CycleIntegrator,
            "",
            state.request.integrator().name().to_owned(),
            keys.integrator.is_some(),
        ),
    ];
    let hint = |(action, name, value, is_changed): (Action, &str, String, bool)| {
        let key = keymap::binding_for_action(action)?.label.split(' ').next()?;
        let words = format!("{name} {value}").trim_start().to_owned();
        Some(KeyHint {
            key,
            words,
            short: value,
            tone: if is_changed { TextRole::Strong } else { TextRole::Faint },
        })
    };
    all.into_iter().filter_map(hint).collect()
}

/// Currently useful hints, divided into urgent hints and other hints.
fn urgent_and_other_hints(state: &State) -> (Vec<KeyHint>, Vec<KeyHint>) {
    let overlay = |wanted: &[OverlayAction]| -> Vec<KeyHint> {
        let of = OVERLAY.iter().filter(|it| wanted.contains(&it.action) && !it.hint.is_empty());
        of.map(|it| KeyHint::new(it.label, it.hint)).collect()
    };
    let closing = || overlay(&[OverlayAction::Close]);
    // Show scroll keys if some lines are not visible.
    let scrolling = |last: usize, keys: &[OverlayAction]| if last > 0 { overlay(keys) } else { Vec::new() };
    if state.overlays.help.open {
        let (_, last) = super::help::page_height_and_max_scroll(state);
        let lines = scrolling(last, &[OverlayAction::LineDown]).into_iter().chain(closing());
        return (lines.chain(scrolling(last, &[OverlayAction::PageDown])).collect(), Vec::new());
    }
    let mut urgent = Vec::new();
    if let Some(views) = &state.overlays.views {
        urgent.extend(view_mode_list_hints(views).into_iter().chain(closing()));
    } else if state.overlays.diagnostics.open {
        let (_, last) = super::diagnostics::page_height_and_max_scroll(state);
        urgent.extend(scrolling(last, &[OverlayAction::LineDown]).into_iter().chain(closing()));
    }
    urgent.extend(hidden_diagnostics_hint(state));
    let named = |action, words| keymap::binding_for_action(action).map(|it| KeyHint::new(it.label, words));
    let has_place = state.overlays.problems.is_some() || state.selection.picked.is_some();
    if has_place && !state.request.is_model() {
        urgent.extend(named(Action::Edit, "edit"));
    }
    if state.preview.history.is_viewing_older() {
        urgent.extend(named(Action::CompareLastEdit, "newest"));
        let both = if state.preview.history.is_viewing_oldest() {
            named(Action::NewerRender, "newer")
        } else {
            named(Action::OlderRender, "older, newer")
        };
        urgent.extend(both);
        // All other keys affect the newest render.
        return (urgent, KeyHint::for_action(Action::ShowImageOnly).into_iter().collect());
    }
    if state.request.toggles.camera.has_changes() && !state.saving.has_scene_of_model {
        urgent.extend(named(Action::KeepCamera, "keep"));
    }
    if state.preview.close_up.is_some() {
        urgent.extend(named(Action::ActualPixels, "back"));
    }
    if state.request.first_section.is_some() {
        let first = named(Action::RenderRegionFirst, "region first");
        urgent.extend(first.map(|hint| KeyHint { tone: TextRole::Strong, ..hint }));
    }
    let reset = keymap::binding_for_action(Action::ResetSettings).map_or("", |it| it.label);
    let changed = |words| KeyHint { tone: TextRole::Strong, ..KeyHint::new(reset, words) };
    let changes = state.request.describe_camera_and_exposure_changes().join(", ");
    urgent.extend((!changes.is_empty()).then(|| changed(format!("reset {changes}"))));
    let now: &[Action] = match state.work.activity {
        _ if state.work.paused => &[Action::TogglePause, Action::WriteImage],
        RequestStatus::Running { .. } => &[Action::TogglePause],
        RequestStatus::Done | RequestStatus::Waiting | RequestStatus::Broken | RequestStatus::Canceled => &[],
    };
    let first = now
        .iter()
        .filter_map(|action| KeyHint::for_action(*action))
        .map(|hint| relabel_pause_hint(hint, state));
    let (held, first): (Vec<KeyHint>, Vec<KeyHint>) = first.partition(|_| state.work.paused);
    urgent.extend(held);
    let is_other = |it: &&KeyBinding| {
        !it.hint.is_empty() && !now.contains(&it.action) && !ELSEWHERE.contains(&it.action)
    };
    let has_preview = state.display.kind != PreviewStyle::None;
    let is_shown = |it: &&KeyBinding| it.action != Action::ShowImageOnly || has_preview;
    let is_idle = |it: &&KeyBinding| it.action != Action::TogglePause || state.work.is_request_running();
    // If there are changes to list, a hint added above already shows them next to this key.
    let has_unlisted_changes = state.request.toggles != KeyboardOverrides::default()
        && state.request.describe_camera_and_exposure_changes().is_empty();
    let is_useful = |it: &&KeyBinding| it.action != Action::ResetSettings || has_unlisted_changes;
    let others = KEYMAP
        .iter()
        .filter(is_other)
        .filter(is_shown)
        .filter(is_idle)
        .filter(is_useful)
        .map(|it| KeyHint::new(it.label, it.hint));
    (urgent, first.into_iter().chain(others).collect())
}

/// Keys for the view list, or the search text.
fn view_mode_list_hints(views: &ViewModeList) -> Vec<KeyHint> {
    match &views.name {
        Some(name) => vec![KeyHint { tone: TextRole::Strong, ..KeyHint::new("/", format!("{name}▏")) }],
        None => [("1-9", "choose"), ("j k", "move"), ("/", "find")]
            .map(|(key, words)| KeyHint::new(key, words))
            .into(),
    }
}

/// Actions shown elsewhere in the key line.
const ELSEWHERE: [Action; 8] = [
    Action::Quit,
    Action::ToggleHelp,
    Action::ToggleDiagnostics,
    Action::CycleShadows,
    Action::TogglePhotons,
    Action::ToggleDepthOfField,
    Action::NextView,
    Action::CycleIntegrator,
];

fn relabel_pause_hint(hint: KeyHint, state: &State) -> KeyHint {
    let is_pause = keymap::binding_for_action(Action::TogglePause).is_some_and(|it| it.label == hint.key);
    if is_pause && state.work.paused { KeyHint::new(hint.key, "resume") } else { hint }
}

/// Hint with the number of errors and warnings, or `None` if there are none or the pane is open.
fn hidden_diagnostics_hint(state: &State) -> Option<KeyHint> {
    let key = keymap::binding_for_action(Action::ToggleDiagnostics)?.label;
    let (words, tone) = match &state.overlays.problems {
        _ if state.overlays.diagnostics.open => return None,
        Some(_) => (super::header::format_problem_count(state), state_symbol_word_and_role(state).2),
        None => match state.warnings_and_write_failure() {
            none if none.is_empty() => return None,
            reported => (summarize_diagnostic_counts(&reported), TextRole::Warning),
        },
    };
    Some(KeyHint { tone, ..KeyHint::new(key, words) })
}

fn is_depth_of_field_on(state: &State) -> bool {
    state.request.effective.as_ref().is_some_and(|it| it.dof)
        && state.request.combined_overrides().dof != Some(false)
}
