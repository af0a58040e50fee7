//! The `[camera]` table.

use super::super::description::Camera;
use super::super::keys::key::DefaultValue::{Absent, By, Is, Required};
use super::super::keys::key::ValueKind::{File, Number};
use super::super::keys::key::{DIRECTION, POINT, TableInfo, TableSyntax, keys};
use super::context::Issue;
use super::limits::Limits::{Inside, Length, LengthOrZero};
use super::table::TableReader;
use crate::math::DVec3;

pub(crate) static CAMERA: TableInfo = TableInfo::new(
    "camera",
    TableSyntax::Single,
    "The camera: `position` and `look_at`, or an `orbiter` file",
    keys! {
        /// Position of the camera.
        position: POINT, Required("[0, 1, 4]"), "length";
        /// The point at the center of the image.
        look_at: POINT, Required("[0, 1, 0]"), "length";
        /// Up direction in the image; not parallel to the view direction.
        up: DIRECTION, Is("[0, 1, 0]");
        /// Vertical field of view.
        fov: Number(Inside(0.0, 180.0)), Is("40.0"), "degrees";
        /// Lens radius; 0 is a pinhole without depth of field.
        aperture: Number(LengthOrZero), Is("0.0"), "length";
        /// Focus distance along the view axis.
        focus: Number(Length), By("the distance to `look_at`"), "length";
        /// A gKit orbiter file, instead of `position`, `look_at` and `up`; its field of view is the default
        /// for `fov`.
        orbiter: File(&[]), Absent;
    },
);

/// `up` and the view direction count as parallel if the sine of the angle between them is below this.
const MIN_SINE: f64 = 1e-6;

pub(super) fn read_camera(root: &TableReader<'_>) -> Option<Camera> {
    if root.entry("camera").is_none() {
        // `report_unknown_and_missing_keys` reports the misspelled table.
        if root.has_misspelled_table("camera") {
            return None;
        }
        let examples: Vec<String> =
            CAMERA.keys[..2].iter().map(|key| format!("`{}`", key.example_line())).collect();
        let issue = Issue::error(0..0, "the scene has no [camera]").with_help(format!(
            "add a table [camera] with {}, or with `orbiter = \"FILE\"`",
            examples.join(" and ")
        ));
        root.context.report(issue.with_missing_value_cause());
        return None;
    }
    let table = root.table(&CAMERA)?;
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
    let is_set =
        |name| table.entry(name).is_some_and(|entry| table.context.is_span_in_set_arg(&entry.value.span()));
    let is_replaced = is_set("position") && is_set("look_at") && !is_set("orbiter");
    table.entry("orbiter").is_some() && !is_replaced
}

fn read_look_at_camera(table: &TableReader<'_>) -> Option<Camera> {
    let (position_key, look_at_key) = (table.key("position"), table.key("look_at"));
    let (position, look_at) = (position_key.vector(), look_at_key.vector());
    let up_vector = table.key("up").vector();
    let [fov, aperture, focus] = ["fov", "aperture", "focus"].map(|name| table.key(name));
    let (fov, aperture) = (fov.number(), aperture.number());
    let focus = focus.number();

    let (position, look_at) = (position?, look_at?);
    if !position_key.check_points_equal_or_far_apart(position, &look_at_key, look_at) {
        return None;
    }
    let view = look_at - position;
    let Some(direction) = view.try_normalize() else {
        let span = look_at_key.value_span()?;
        let issue = Issue::error(span, "the camera has no direction")
            .with_label("this is the same point as `position`")
            .with_help("`look_at` is the point at the center of the image");
        table.context.report(issue);
        return None;
    };
    let up = check_up_vector(table, direction, up_vector?)?;
    let focus = focus.unwrap_or(view.length());
    Some(Camera::LookAt { position, look_at, up, fov: fov?, aperture: aperture?, focus })
}

/// Returns `up` if it is long enough and not parallel to `view`.
fn check_up_vector(table: &TableReader<'_>, view: DVec3, up: DVec3) -> Option<DVec3> {
    let key = table.key("up");
    let span = key.value_span().or(table.key("look_at").value_span())?;
    if !key.check_vector_zero_or_long_enough(up) {
        return None;
    }
    let default = key.info.default_or_example();
    let Some(direction) = up.try_normalize() else {
        let issue = Issue::error(span, "`up` has no direction").with_label("its length is 0");
        table.context.report(issue.with_help(format!("the default is {default}")));
        return None;
    };
    if view.cross(direction).length() < MIN_SINE {
        let label = if key.is_present() {
            "parallel to the view".to_owned()
        } else {
            format!("the view is parallel to the default {default}")
        };
        let issue = Issue::error(span, "`up` must not be parallel to the view")
            .with_label(label)
            .with_help("for a view straight up or down, use `up = [0, 0, -1]`");
        table.context.report(issue);
        return None;
    }
    Some(up)
}

fn read_orbiter_camera(table: &TableReader<'_>) -> Option<Camera> {
    let file = table.key("orbiter").existing_file();
    let fov = table.key("fov");
    // Without this key, the file's field of view applies.
    let fov = if fov.is_present() { fov.number().map(Some) } else { Some(None) };
    let (aperture, focus) = (table.key("aperture").number(), table.key("focus").number());
    for name in ["position", "look_at", "up"] {
        let message = format!("`{name}` conflicts with `orbiter`");
        let help = "the orbiter file already sets the camera position; remove one of the two";
        table.reject_key(name, &message, Some(help));
    }
    Some(Camera::Orbiter { file: file?, fov: fov?, aperture: aperture?, focus })
}
