//! Handles the mouse and queries about image positions.

use super::notices::{
    show_keyboard_change_notice, show_notice, show_notice_only, show_until_key_without_effects,
};
use super::{camera, history, overlay, region};
use crate::event::FileLineColumn;
use crate::event::{Effect, MouseEvent, MouseEventKind};
use crate::keymap::OverlayAction;
use crate::math::decimal::{decimal_step_for_distance, round_to_step};
use crate::messages;
use crate::pipeline::protocol::{Command, PickedInstance, PickedObject, PickedPixel};
use crate::scene::sanitize::escape_invisible_chars;
use crate::state::{HeldMousePress, PickPurpose, State};
use crate::view;
use crate::view::layout::Layout;
use crate::view::preview::image_position_at;
use crate::window_title;

/// Rotation in degrees for a drag across the full width of the preview.
const TURN_ACROSS: f64 = 180.0;

/// Handles a mouse event.
pub(super) fn handle_mouse(state: &mut State, mouse: MouseEvent) -> Vec<Effect> {
    match mouse.kind {
        MouseEventKind::Press => {
            let is_on_preview = Layout::for_state(state).preview.contains((mouse.column, mouse.row).into());
            let MouseEvent { column, row, .. } = mouse;
            if let Some(at) = view::history_index_at(state, column, row) {
                return history::open_entry_at_index(state, at);
            }
            let from = image_position_at(state, column, row);
            state.selection.press =
                is_on_preview.then_some(HeldMousePress { column, row, has_moved: false, from });
            Vec::new()
        }
        MouseEventKind::Drag => drag_region_or_orbit(state, mouse),
        MouseEventKind::Release if state.selection.is_marking && state.selection.press.take().is_some() => {
            let spot = image_position_at(state, mouse.column, mouse.row);
            region::end_region_drag(state, spot)
        }
        MouseEventKind::Release => match state.selection.press.take() {
            Some(press) if !press.has_moved => pick_object_at_click(state, mouse),
            Some(_) | None => Vec::new(),
        },
        MouseEventKind::WheelUp | MouseEventKind::WheelDown if is_wheel_for_overlay(state, mouse) => {
            let line = if mouse.kind == MouseEventKind::WheelUp {
                OverlayAction::LineUp
            } else {
                OverlayAction::LineDown
            };
            overlay::perform_action(state, line);
            Vec::new()
        }
        MouseEventKind::WheelUp => camera::dolly(state, 1.0),
        MouseEventKind::WheelDown => camera::dolly(state, -1.0),
    }
}

fn is_wheel_for_overlay(state: &State, mouse: MouseEvent) -> bool {
    let is_on_errors = || Layout::for_state(state).pane.contains((mouse.column, mouse.row).into());
    state.overlays.help.open || state.overlays.diagnostics.open && is_on_errors()
}

/// Orbits the camera so that the scene follows the mouse.
fn drag_region_or_orbit(state: &mut State, mouse: MouseEvent) -> Vec<Effect> {
    let Some(press) = state.selection.press else { return Vec::new() };
    if state.selection.is_marking {
        if let Some((from, to)) = press.from.zip(image_position_at(state, mouse.column, mouse.row)) {
            region::update_dragged_region(state, from, to);
        }
        return Vec::new();
    }
    let cells = |now: u16, before: u16| f64::from(now) - f64::from(before);
    let (right, down) = (cells(mouse.column, press.column), cells(mouse.row, press.row));
    if right == 0.0 && down == 0.0 {
        return Vec::new();
    }
    state.selection.press =
        Some(HeldMousePress { column: mouse.column, row: mouse.row, has_moved: true, ..press });
    let degrees = TURN_ACROSS / f64::from(Layout::for_state(state).preview.width.max(1));
    camera::orbit_by_degrees(
        state,
        -right * degrees,
        down * f64::from(state.display.window.cell_aspect) * degrees,
    )
}

fn pick_object_at_click(state: &mut State, mouse: MouseEvent) -> Vec<Effect> {
    if state.preview.history.is_viewing_older() {
        return show_notice_only(state, messages::OLDER_RENDER);
    }
    let Some(spot) = image_position_at(state, mouse.column, mouse.row) else { return Vec::new() };
    state.selection.crosshair = spot;
    let purpose = if std::mem::take(&mut state.selection.is_focusing) {
        PickPurpose::Focus
    } else {
        PickPurpose::Inspect
    };
    send_pick_query(state, purpose)
}

/// Queries the object at the crosshair.
pub(super) fn inspect_at_crosshair(state: &mut State) -> Vec<Effect> {
    send_pick_query(state, PickPurpose::Inspect)
}

/// Waits for a click that sets the focus. If already waiting, focuses on the object at the crosshair.
pub(super) fn start_or_confirm_focus_pick(state: &mut State) -> Vec<Effect> {
    if state.preview.history.is_viewing_older() {
        return show_notice_only(state, messages::OLDER_RENDER);
    }
    if state.request.current_camera().is_some_and(|view| view.aperture == 0.0) {
        state.selection.is_focusing = false;
        return show_notice_only(state, messages::PINHOLE);
    }
    if state.selection.is_mouse_on && !state.selection.is_focusing {
        state.selection.is_focusing = true;
        return show_until_key_without_effects(state, messages::CLICK_TO_FOCUS);
    }
    state.selection.is_focusing = false;
    send_pick_query(state, PickPurpose::Focus)
}

fn send_pick_query(state: &mut State, purpose: PickPurpose) -> Vec<Effect> {
    if state.preview.history.is_viewing_older() {
        return show_notice_only(state, messages::OLDER_RENDER);
    }
    if state.request.own.is_none() {
        return show_notice_only(state, messages::NO_SCENE);
    }
    state.selection.purpose = purpose;
    vec![Effect::Send(Command::Pick(state.selection.crosshair))]
}

pub(super) fn toggle_mouse(state: &mut State) -> Vec<Effect> {
    state.selection.is_mouse_on = !state.selection.is_mouse_on;
    (state.selection.press, state.selection.is_focusing, state.selection.is_marking) = (None, false, false);
    let words = if state.selection.is_mouse_on { messages::MOUSE_ON } else { messages::MOUSE_OFF };
    show_notice(state, words);
    vec![Effect::Mouse(state.selection.is_mouse_on)]
}

/// Handles the reply to a pick query.
pub(super) fn handle_pick_reply(state: &mut State, picked: &PickedPixel) -> Vec<Effect> {
    // Ignore the reply if an older render was opened after the click.
    if state.preview.history.is_viewing_older() {
        return Vec::new();
    }
    state.selection.picked = picked
        .object
        .as_ref()
        .and_then(|object| Some(FileLineColumn { path: object.path.clone(), line: object.line?, column: 1 }));
    match (state.selection.purpose, &picked.object) {
        (PickPurpose::Inspect, _) => {
            state.overlays.message = None;
            let facts = format_inspected_values(picked);
            state.selection.clicked = Some(join_values_with_pixel_position(picked, &facts));
            state.selection.facts = Some(facts);
            state.dirty = true;
            Vec::new()
        }
        (PickPurpose::Focus, None) => show_notice_only(state, messages::NOTHING_TO_FOCUS),
        (PickPurpose::Focus, Some(object)) => focus_at_depth(state, object.depth),
    }
}

fn focus_at_depth(state: &mut State, depth: f64) -> Vec<Effect> {
    let distance = round_to_step(depth, decimal_step_for_distance(depth));
    if !(distance > 0.0) {
        return show_notice_only(state, messages::NOTHING_TO_FOCUS);
    }
    // The scene may have been edited after the click.
    if state.request.current_camera().is_none_or(|view| view.aperture == 0.0) {
        return show_notice_only(state, messages::PINHOLE);
    }
    state.request.toggles.camera.focus = Some(distance);
    let effects = camera::render_camera_step(state);
    if state.request.toggles.camera.focus.is_some() {
        show_keyboard_change_notice(state, messages::focus_moved(distance));
    }
    effects
}

/// Formats the inspected values and the pixel position on one line.
fn join_values_with_pixel_position(
    PickedPixel { object, pixel: [x, y], .. }: &PickedPixel,
    facts: &[String],
) -> String {
    let pixel = object.as_ref().map_or(String::new(), |_| format!(" · pixel {x}, {y}"));
    facts.join(" · ") + &pixel
}

/// Copies the inspected values if the terminal supports it.
pub(super) fn copy_inspected_values(state: &mut State) -> Vec<Effect> {
    if state.preview.history.is_viewing_older() {
        return show_notice_only(state, messages::OLDER_RENDER);
    }
    let Some(clicked) = state.selection.clicked.clone() else {
        return show_notice_only(state, messages::NOTHING_TO_COPY);
    };
    if !state.display.capabilities.clipboard {
        // The message contains the text so that the user can select it.
        return show_notice_only(state, &format!("{} {clicked}", messages::SELECT_TO_COPY));
    }
    show_notice(state, format!("{} {clicked}", messages::COPIED));
    vec![Effect::Aside(window_title::clipboard_bytes(&clicked))]
}

/// Formats the inspected values: shape and name, line, material, distance, position, radiance and normal.
fn format_inspected_values(PickedPixel { object, color, pixel: [x, y] }: &PickedPixel) -> Vec<String> {
    let light = color.map(|color| format!("radiance {}", format_vector(color.map(f64::from))));
    let Some(object) = object else {
        return [format!("nothing at pixel {x}, {y}")].into_iter().chain(light).collect();
    };
    let PickedObject { shape, name, path, line, instance, material, position, normal, is_front, .. } = object;
    let quoted = |name: &Option<String>| {
        name.as_ref().map_or(String::new(), |name| format!(" \"{}\"", escape_invisible_chars(name)))
    };
    let file = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
    let back = if *is_front { "" } else { " (back)" };
    let mut facts = vec![format!("{shape}{}", quoted(name))];
    facts.extend(line.map(|line| format!("{}:{line}", escape_invisible_chars(&file))));
    facts.extend(instance.as_ref().map(|PickedInstance { name, line }| {
        let line = line.map_or(String::new(), |line| format!(" on line {line}"));
        format!("instance{}{line}", quoted(name))
    }));
    facts.extend([
        escape_invisible_chars(material).into_owned(),
        format!("distance {}", format_three_significant_digits(object.distance)),
        format!("position {}", format_vector(*position)),
    ]);
    facts.extend(light);
    facts.push(format!("normal {}{back}", format_vector(normal.map(f64::from))));
    facts
}

fn format_vector(all: [f64; 3]) -> String {
    format!("({})", all.map(format_three_significant_digits).join(", "))
}

/// Formats a number with three significant digits, or more if it has more digits before the decimal point.
fn format_three_significant_digits(number: f64) -> String {
    let digits = if number == 0.0 { 0.0 } else { 2.0 - libm::floor(libm::log10(number.abs())) };
    round_to_step(number, libm::pow(10.0, -digits.clamp(0.0, 3.0))).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inspected_values_are_formatted_concisely() {
        let object = PickedObject {
            shape: "sphere",
            name: Some("ball".to_owned()),
            path: "scenes/still.toml".into(),
            line: Some(47),
            instance: None,
            material: "glass crystal".to_owned(),
            position: [0.214, 0.4996, -33.06],
            normal: [0.0, 1.0, -0.0],
            is_front: true,
            distance: 3.8167,
            depth: 3.5,
        };
        let picked = PickedPixel { pixel: [3, 4], object: Some(object), color: Some([0.61, 1234.56, 1e-6]) };
        assert_eq!(
            format_inspected_values(&picked),
            [
                "sphere \"ball\"",
                "still.toml:47",
                "glass crystal",
                "distance 3.82",
                "position (0.214, 0.5, -33.1)",
                "radiance (0.61, 1235, 0)",
                "normal (0, 1, 0)"
            ]
        );
        let instance = Some(PickedInstance { name: Some("left".to_owned()), line: Some(52) });
        let in_group = picked.object.clone().map(|object| PickedObject { instance, ..object });
        let in_group = format_inspected_values(&PickedPixel { object: in_group, ..picked });
        assert_eq!(in_group[1..3], ["still.toml:47", "instance \"left\" on line 52"]);
        let of_model = picked.object.clone().map(|object| PickedObject { line: None, ..object });
        let of_model = format_inspected_values(&PickedPixel { object: of_model, ..picked });
        assert_eq!(of_model[..2], ["sphere \"ball\"", "glass crystal"], "models should have no line numbers");
        assert_eq!(
            format_inspected_values(&PickedPixel { object: None, color: None, ..picked }),
            ["nothing at pixel 3, 4"]
        );
    }
}
