//! Definitions of the `[camera]`, `[photons]` and `[environment]` keys.

use super::endings::MAPS;
use super::key::DefaultValue::{Absent, By, Is, Required};
use super::key::ValueKind::{Color, File, Flag, Number, Numbers, Whole};
use super::key::{KeyInfo, TableInfo, TableSyntax, define_key};
use super::limits::Limits::{Any, AtLeast, Inside, Length, LengthOrZero};

pub(super) const CAMERA: TableInfo = single_table_info(
    "camera",
    "The camera: `position` and `look_at`, or an `orbiter` file",
    &[
        define_key(
            "position",
            Numbers(3, "point", Any),
            "length",
            Required("[0, 1, 4]"),
            "Position of the camera",
        ),
        define_key(
            "look_at",
            Numbers(3, "point", Any),
            "length",
            Required("[0, 1, 0]"),
            "The point at the center of the image",
        ),
        define_key(
            "up",
            Numbers(3, "direction", Any),
            "",
            Is("[0, 1, 0]"),
            "Up direction in the image; not parallel to the view direction",
        ),
        define_key("fov", Number(Inside(0.0, 180.0)), "degrees", Is("40.0"), "Vertical field of view"),
        define_key(
            "aperture",
            Number(LengthOrZero),
            "length",
            Is("0.0"),
            "Lens radius; 0 is a pinhole without depth of field",
        ),
        define_key(
            "focus",
            Number(Length),
            "length",
            By("the distance to `look_at`"),
            "Focus distance along the view axis",
        ),
        define_key(
            "orbiter",
            File(&[]),
            "",
            Absent,
            "A gKit orbiter file, instead of `position`, `look_at` and `up`; its field of view is the default for `fov`",
        ),
    ],
);

pub(super) const PHOTONS: TableInfo = single_table_info(
    "photons",
    "Photon mapping in `whitted`: caustics and all other indirect light",
    &[
        define_key("enabled", Flag, "", Is("false"), "Enables photon mapping; the key `p` toggles it"),
        define_key(
            "count",
            Whole(0, 1_000_000_000_000),
            "per pass",
            Is("0"),
            "Photons emitted per sample of the image. 0 means one per pixel, clamped to between 8,192 and 200,000. Values above 4 million are reduced to 4 million, with a warning",
        ),
        define_key(
            "radius",
            Number(LengthOrZero),
            "length",
            Is("0.0"),
            "Kernel radius of the first pass; 0 chooses a radius based on the photon density",
        ),
        define_key(
            "bounces",
            Whole(0, 4_294_967_295),
            "bounces",
            Is("16"),
            "Maximum number of bounces per photon",
        ),
    ],
);

pub(super) const ENVIRONMENT: TableInfo = single_table_info(
    "environment",
    "Light from all directions, a color or a map; replaces `background`",
    &[
        define_key(
            "color",
            Color(AtLeast(0.0)),
            "radiance",
            By("black; `[1, 1, 1]` with a `file`"),
            "Radiance; with a `file`, a scale factor for the map",
        ),
        define_key(
            "file",
            File(MAPS),
            "",
            Absent,
            "An equirectangular map. Its center is seen towards −z, its right quarter towards +x, and its top row at +y",
        ),
        define_key(
            "rotate",
            Number(Any),
            "degrees",
            Is("0.0"),
            "Rotation of the map about +y, counterclockwise seen from above",
        ),
    ],
);

const fn single_table_info(name: &'static str, doc: &'static str, keys: &'static [KeyInfo]) -> TableInfo {
    TableInfo { name, form: TableSyntax::Single, doc, keys, types: &[] }
}
