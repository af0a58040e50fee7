//! `[camera]`, `[photons]` and `[environment]`.

use super::endings::MAPS;
use super::key::Default::{Absent, By, Is, Required};
use super::key::Kind::{Color, File, Flag, Number, Numbers, Whole};
use super::key::{Form, KeyInfo, TableInfo, key};
use super::limits::Limits::{Any, AtLeast, Inside, Length, LengthOrZero};

pub(super) const CAMERA: TableInfo = single(
    "camera",
    "The eye and its lens: `position` and `look_at`, or an `orbiter` file",
    &[
        key("position", Numbers(3, "point", Any), "length", Required("[0, 1, 4]"), "The eye"),
        key(
            "look_at",
            Numbers(3, "point", Any),
            "length",
            Required("[0, 1, 0]"),
            "The point in the middle of the image",
        ),
        key(
            "up",
            Numbers(3, "direction", Any),
            "",
            Is("[0, 1, 0]"),
            "What is up in the image; not parallel to the view",
        ),
        key(
            "fov",
            Number(Inside(0.0, 180.0)),
            "degrees",
            Is("40.0"),
            "Field of view from the bottom of the image to its top",
        ),
        key(
            "aperture",
            Number(LengthOrZero),
            "length",
            Is("0.0"),
            "Lens radius; 0 is a pinhole, without depth of field",
        ),
        key(
            "focus",
            Number(Length),
            "length",
            By("the distance to `look_at`"),
            "Focus distance, along the view axis",
        ),
        key(
            "orbiter",
            File(&[]),
            "",
            Absent,
            "A gKit orbiter file, in place of `position`, `look_at` and `up`; `fov` is then the file's",
        ),
    ],
);

pub(super) const PHOTONS: TableInfo = single(
    "photons",
    "Photon maps: caustics and all other indirect light, in `whitted`",
    &[
        key("enabled", Flag, "", Is("false"), "Photons on; the key `p` switches them"),
        key(
            "count",
            Whole(0, 1_000_000_000_000),
            "per pass",
            Is("0"),
            "Photons sent out with each sample of the image; 0: as many as the image has pixels, between 8,192 and 200,000. More than 4 million are cut to that, with a warning",
        ),
        key(
            "radius",
            Number(LengthOrZero),
            "length",
            Is("0.0"),
            "Radius of the first pass's kernels; 0: by how dense the photons are",
        ),
        key("bounces", Whole(0, 4_294_967_295), "scatterings", Is("16"), "Most scatterings of one photon"),
    ],
);

pub(super) const ENVIRONMENT: TableInfo = single(
    "environment",
    "Light from all around, a colour or a map; it takes the place of `background`",
    &[
        key(
            "color",
            Color(AtLeast(0.0)),
            "radiance",
            By("black; `[1, 1, 1]` with a `file`"),
            "Radiance; with a `file` a factor of it",
        ),
        key(
            "file",
            File(MAPS),
            "",
            Absent,
            "An equirectangular map: its middle is seen towards −z, its right quarter towards +x, its top row at +y",
        ),
        key(
            "rotate",
            Number(Any),
            "degrees",
            Is("0.0"),
            "Turns the map about +y, counterclockwise seen from above",
        ),
    ],
);

const fn single(name: &'static str, doc: &'static str, keys: &'static [KeyInfo]) -> TableInfo {
    TableInfo { name, form: Form::Single, doc, keys, types: &[] }
}
