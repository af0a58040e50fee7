//! Reads the `[camera]` table.

use super::super::description::Camera;
use super::context::Issue;
use super::limits::Limits;
use super::table::TableReader;
use crate::math::DVec3;

/// Default vertical field of view in degrees.
pub(crate) const FOV_DEGREES: f64 = 40.0;

/// `up` and the view direction count as parallel if the sine of the angle between them is below this.
const MIN_SINE: f64 = 1e-6;

pub(super) fn read_camera(root: &TableReader<'_>) -> Option<Camera> {
    if !root.optional_key("camera").is_present() {
        // The misspelled table has already been reported.
        if root.has_misspelled_table("camera") {
            return None;
        }
        let issue = Issue::error(0..0, "the scene has no [camera]")
            .with_help("add a table [camera] with `position = [0, 1, 4]` and `look_at = [0, 1, 0]`, or with `orbiter = \"FILE\"`");
        root.context.report(issue.with_missing_value_cause());
        return None;
    }
    let table = root.table("camera")?;
    let camera = if is_orbiter_file_effective(&table) {
        read_orbiter_camera(&table)
    } else {
        read_look_at_camera(&table)
    };
    table.report_unknown_and_missing_keys();
    camera
}

/// Whether the orbiter file defines the camera. It does not if `--set` sets both `position` and `look_at`.
fn is_orbiter_file_effective(table: &TableReader<'_>) -> bool {
    let is_set = |name| {
        table.optional_key(name).value_span().is_some_and(|span| table.context.is_span_in_set_arg(&span))
    };
    let is_replaced = is_set("position") && is_set("look_at") && !is_set("orbiter");
    table.optional_key("orbiter").is_present() && !is_replaced
}

fn read_lens_radius(table: &TableReader<'_>) -> f64 {
    table.optional_key("aperture").number(table.key_limits("aperture")).unwrap_or(0.0)
}

fn read_fov(table: &TableReader<'_>) -> Option<f64> {
    table.optional_key("fov").number(table.key_limits("fov"))
}

fn read_look_at_camera(table: &TableReader<'_>) -> Option<Camera> {
    let position = table.required_key("position", "[0, 1, 4]");
    let look_at = table.required_key("look_at", "[0, 1, 0]");
    let (eye, target) = (position.vector(Limits::Any), look_at.vector(Limits::Any));
    let up_vector = table.optional_key("up").vector_or(Limits::Any, DVec3::Y);
    let fov = read_fov(table).unwrap_or(FOV_DEGREES);
    let aperture = read_lens_radius(table);
    let focus = table.optional_key("focus").number(table.key_limits("focus"));

    let (position_key, look_at_key) = (position, look_at);
    let (position, look_at) = (eye?, target?);
    if !position_key.check_points_equal_or_far_apart(position, &look_at_key, look_at) {
        return None;
    }
    let view = look_at - position;
    let Some(direction) = view.try_normalize() else {
        let span = table.optional_key("look_at").value_span()?;
        let issue = Issue::error(span, "the camera has no direction")
            .with_label("this is the same point as `position`")
            .with_help("`look_at` is the point at the center of the image");
        table.context.report(issue);
        return None;
    };
    let up = check_up_vector(table, direction, up_vector?)?;
    Some(Camera::LookAt { position, look_at, up, fov, aperture, focus: focus.unwrap_or(view.length()) })
}

/// Returns `up` if it is long enough and not parallel to `view`.
fn check_up_vector(table: &TableReader<'_>, view: DVec3, up: DVec3) -> Option<DVec3> {
    let span = table.optional_key("up").value_span().or(table.optional_key("look_at").value_span())?;
    if !table.optional_key("up").check_vector_zero_or_long_enough(up) {
        return None;
    }
    let Some(direction) = up.try_normalize() else {
        let issue = Issue::error(span, "`up` has no direction").with_label("its length is 0");
        table.context.report(issue.with_help("the default is [0, 1, 0]"));
        return None;
    };
    if view.cross(direction).length() < MIN_SINE {
        let given = table.optional_key("up").is_present();
        let label =
            if given { "parallel to the view" } else { "the view is parallel to the default [0, 1, 0]" };
        let issue = Issue::error(span, "`up` must not be parallel to the view")
            .with_label(label)
            .with_help("for a view straight up or down, use `up = [0, 0, -1]`");
        table.context.report(issue);
        return None;
    }
    Some(up)
}

fn read_orbiter_camera(table: &TableReader<'_>) -> Option<Camera> {
    let file = table.optional_key("orbiter").existing_file(&[]);
    let (fov, aperture) = (read_fov(table), read_lens_radius(table));
    let focus = table.optional_key("focus").number(table.key_limits("focus"));
    for name in ["position", "look_at", "up"] {
        let message = format!("`{name}` conflicts with `orbiter`");
        let help = "the orbiter file already sets the camera position; remove one of the two";
        table.reject_key(name, &message, Some(help));
    }
    Some(Camera::Orbiter { file: file?, fov, aperture, focus })
}
