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
    if !root.optional("camera").is_present() {
        // The misspelled table has already been reported.
        if root.has_misspelled("camera") {
            return None;
        }
        let issue = Issue::error(0..0, "the scene has no [camera]")
            .help("add a table [camera] with `position = [0, 1, 4]` and `look_at = [0, 1, 0]`, or with `orbiter = \"FILE\"`");
        root.context.report(issue.caused_by_absence());
        return None;
    }
    let table = root.table("camera")?;
    let camera = if has_orbiter(&table) { read_orbiter(&table) } else { read_look_at(&table) };
    table.finish();
    camera
}

/// Whether the orbiter file defines the camera. It does not if `--set` sets both `position` and `look_at`.
fn has_orbiter(table: &TableReader<'_>) -> bool {
    let is_set = |name| table.optional(name).span().is_some_and(|span| table.context.is_in_set_value(&span));
    let is_replaced = is_set("position") && is_set("look_at") && !is_set("orbiter");
    table.optional("orbiter").is_present() && !is_replaced
}

fn read_aperture(table: &TableReader<'_>) -> f64 {
    table.optional("aperture").number(table.limits("aperture")).unwrap_or(0.0)
}

fn read_fov(table: &TableReader<'_>) -> Option<f64> {
    table.optional("fov").number(table.limits("fov"))
}

fn read_look_at(table: &TableReader<'_>) -> Option<Camera> {
    let position = table.required("position", "[0, 1, 4]");
    let look_at = table.required("look_at", "[0, 1, 0]");
    let (eye, target) = (position.vector(Limits::Any), look_at.vector(Limits::Any));
    let up_vector = table.optional("up").vector_or(Limits::Any, DVec3::Y);
    let fov = read_fov(table).unwrap_or(FOV_DEGREES);
    let aperture = read_aperture(table);
    let focus = table.optional("focus").number(table.limits("focus"));

    let (position_key, look_at_key) = (position, look_at);
    let (position, look_at) = (eye?, target?);
    if !position_key.check_distance(position, &look_at_key, look_at) {
        return None;
    }
    let view = look_at - position;
    let Some(direction) = view.try_normalize() else {
        let span = table.optional("look_at").span()?;
        let issue = Issue::error(span, "the camera has no direction")
            .label("this is the same point as `position`")
            .help("`look_at` is the point at the center of the image");
        table.context.report(issue);
        return None;
    };
    let up = check_up_vector(table, direction, up_vector?)?;
    Some(Camera::LookAt { position, look_at, up, fov, aperture, focus: focus.unwrap_or(view.length()) })
}

/// Returns `up` if it is long enough and not parallel to `view`.
fn check_up_vector(table: &TableReader<'_>, view: DVec3, up: DVec3) -> Option<DVec3> {
    let span = table.optional("up").span().or(table.optional("look_at").span())?;
    if !table.optional("up").check_vector_length(up) {
        return None;
    }
    let Some(direction) = up.try_normalize() else {
        let issue = Issue::error(span, "`up` has no direction").label("its length is 0");
        table.context.report(issue.help("the default is [0, 1, 0]"));
        return None;
    };
    if view.cross(direction).length() < MIN_SINE {
        let given = table.optional("up").is_present();
        let label =
            if given { "parallel to the view" } else { "the view is parallel to the default [0, 1, 0]" };
        let issue = Issue::error(span, "`up` must not be parallel to the view")
            .label(label)
            .help("for a view straight up or down, use `up = [0, 0, -1]`");
        table.context.report(issue);
        return None;
    }
    Some(up)
}

fn read_orbiter(table: &TableReader<'_>) -> Option<Camera> {
    let file = table.optional("orbiter").file(&[]);
    let (fov, aperture) = (read_fov(table), read_aperture(table));
    let focus = table.optional("focus").number(table.limits("focus"));
    for name in ["position", "look_at", "up"] {
        let message = format!("`{name}` conflicts with `orbiter`");
        let help = "the orbiter file already sets the camera position; remove one of the two";
        table.reject_key(name, &message, Some(help));
    }
    Some(Camera::Orbiter { file: file?, fov, aperture, focus })
}
