//! The `[camera]` table.

use super::super::description::{Camera, ImageShiftAndMirror, Projection, ProjectionKind};
use super::super::keys::key::DefaultValue::{Absent, Alternative, By, Is, Required};
use super::super::keys::key::ValueKind::{File, Flag, Number, Numbers, Words};
use super::super::keys::key::{DIRECTION, POINT, TableInfo, TableSyntax, choice_values, keys};
use super::context::Issue;
use super::key::KeyInTable;
use super::limits::Limits::{Between, Length, LengthOrZero, UpTo};
use super::table::TableReader;
use crate::choice::Choice;
use crate::math::{DVec2, DVec3};

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
        /// How the camera maps the scene to the image.
        projection: Words(choice_values::<ProjectionKind>), Is("\"perspective\"");
        /// Vertical field of view of a perspective camera, less than 180, or of a fisheye.
        fov: Number(UpTo(0.0, 360.0)), Is("40.0"), "degrees";
        /// Height of the view of an orthographic camera, which requires this key instead of `fov`.
        view_height: Number(Length), Alternative("4.0"), "length";
        /// Offset of the view to the right and up, as with a shift lens; keeps the verticals of buildings
        /// parallel.
        shift: Numbers(2, "two numbers", Between(-1000.0, 1000.0)), Is("[0, 0]"), "image heights";
        /// Flips the image horizontally.
        mirror: Flag, Is("false");
        /// Lens radius of a perspective or orthographic camera; 0 is a pinhole without depth of field.
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
    let (projection, window) = (read_projection(table), read_shift_and_mirror(table));
    let [aperture, focus] = read_lens(table, projection.map(Projection::kind));

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
    Some(Camera::LookAt {
        position,
        look_at,
        up,
        projection: projection?,
        window: window?,
        aperture: aperture?,
        focus,
    })
}

/// Reads the projection and its field of view or height.
fn read_projection(table: &TableReader<'_>) -> Option<Projection> {
    let [projection, fov, view_height] = ["projection", "fov", "view_height"].map(|name| table.key(name));
    let kind = projection.choice()?;
    reject_unused_keys(table, kind);
    match kind {
        ProjectionKind::Perspective => {
            let degrees = fov.number()?;
            let span = fov.value_span().filter(|_| degrees >= 180.0);
            if let Some(span) = span {
                let issue = Issue::error(span, "`fov` of a perspective must be less than 180");
                let issue = issue.with_label(format!("found {degrees}"));
                table.context.report(issue.with_help("for a wider view, use `projection = \"fisheye\"`"));
                return None;
            }
            Some(Projection::Perspective { fov: degrees })
        }
        ProjectionKind::Orthographic => {
            table.key_required_without_alternative(view_height.info.name);
            Some(Projection::Orthographic { view_height: view_height.number()? })
        }
        ProjectionKind::Panorama => Some(Projection::Spherical),
        ProjectionKind::Fisheye => Some(Projection::Fisheye { fov: fov.number()? }),
    }
}

/// Reports keys that the projection does not use. If `--set` chooses the projection, the scene file may
/// contain such keys.
fn reject_unused_keys(table: &TableReader<'_>, kind: ProjectionKind) {
    const NO_LENS: &str = "this projection has no lens, so everything is sharp; remove the key";
    let unused: &[(&'static str, &str)] = match kind {
        ProjectionKind::Perspective => {
            &[("view_height", "use `fov`, or add `projection = \"orthographic\"`")]
        }
        ProjectionKind::Orthographic => &[("fov", "`view_height` is the height of the view; remove `fov`")],
        ProjectionKind::Panorama => &[
            ("fov", "a panorama shows all directions; remove the key"),
            ("view_height", "a panorama shows all directions; remove the key"),
            ("aperture", NO_LENS),
            ("focus", NO_LENS),
        ],
        ProjectionKind::Fisheye => &[("view_height", "use `fov`"), ("aperture", NO_LENS), ("focus", NO_LENS)],
    };
    let is_set =
        |key: &KeyInTable<'_>| key.value_span().is_some_and(|span| table.context.is_span_in_set_arg(&span));
    let is_chosen = is_set(&table.key("projection"));
    for &(name, help) in unused {
        let key = table.key(name);
        if key.is_present() && (!is_chosen || is_set(&key)) {
            let message = format!("`{name}` conflicts with `projection = \"{}\"`", kind.name());
            table.reject_key(name, &message, Some(help));
        }
    }
}

fn read_shift_and_mirror(table: &TableReader<'_>) -> Option<ImageShiftAndMirror> {
    let shift = table.key("shift").numbers("two numbers, [right, up]").map(DVec2::from_array);
    let mirror = table.key("mirror").boolean();
    Some(ImageShiftAndMirror { shift: shift?, mirror: mirror? })
}

/// Reads aperture and focus. Returns the defaults for projections without a lens.
fn read_lens(table: &TableReader<'_>, kind: Option<ProjectionKind>) -> [Option<f64>; 2] {
    let [aperture, focus] = ["aperture", "focus"].map(|name| table.key(name));
    match kind {
        Some(ProjectionKind::Panorama | ProjectionKind::Fisheye) => {
            [Some(aperture.default(KeyInTable::number)), None]
        }
        Some(ProjectionKind::Perspective | ProjectionKind::Orthographic) | None => {
            [aperture.number(), focus.number()]
        }
    }
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
    let (projection, window) = (read_projection(table), read_shift_and_mirror(table));
    let [aperture, focus] = read_lens(table, projection.map(Projection::kind));
    // Without `fov`, the file's field of view applies.
    let is_of_file = |projection: &Projection| {
        projection.kind() == ProjectionKind::Perspective && !table.key("fov").is_present()
    };
    for name in ["position", "look_at", "up"] {
        let message = format!("`{name}` conflicts with `orbiter`");
        let help = "the orbiter file already sets the camera position; remove one of the two";
        table.reject_key(name, &message, Some(help));
    }
    let projection = Some(projection?).filter(|projection| !is_of_file(projection));
    Some(Camera::Orbiter { file: file?, projection, window: window?, aperture: aperture?, focus })
}
