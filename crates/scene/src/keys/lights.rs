//! Definitions of the `[[light]]` keys.

use super::key::DefaultValue::Is;
use super::key::ValueKind::{Color, Number, Numbers, Words};
use super::key::{TableInfo, TableSyntax, TableTypeInfo, choice_values, define_key};
use super::limits::Limits::{Any, AtLeast, Between, Inside};
use crate::description::light::Falloff;

pub(super) const LIGHT: TableInfo = TableInfo {
    name: "light",
    form: TableSyntax::List,
    doc: "A light without a shape",
    keys: &[],
    types: &[
        TableTypeInfo {
            name: "point",
            doc: "A point light",
            keys: &[
                define_key("position", Numbers(3, "point", Any), "length", Is("[0, 3, 0]"), "Position"),
                define_key(
                    "intensity",
                    Color(AtLeast(0.0)),
                    "W/sr",
                    Is("[10, 10, 10]"),
                    "Radiant intensity, the same in all directions",
                ),
                define_key(
                    "falloff",
                    Words(choice_values::<Falloff>),
                    "",
                    Is("\"square\""),
                    "`\"square\"`: inverse-square falloff, physically correct; `\"none\"`: `intensity` is the irradiance at normal incidence, at any distance",
                ),
            ],
        },
        TableTypeInfo {
            name: "spot",
            doc: "A point light that shines only within a cone",
            keys: &[
                define_key("position", Numbers(3, "point", Any), "length", Is("[0, 3, 0]"), "Position"),
                define_key(
                    "look_at",
                    Numbers(3, "point", Any),
                    "length",
                    Is("[0, 0, 0]"),
                    "A point on the cone's axis",
                ),
                define_key(
                    "intensity",
                    Color(AtLeast(0.0)),
                    "W/sr",
                    Is("[10, 10, 10]"),
                    "Radiant intensity on the axis",
                ),
                define_key(
                    "angle",
                    Number(Inside(0.0, 360.0)),
                    "degrees",
                    Is("45"),
                    "Full apex angle of the cone",
                ),
                define_key(
                    "blend",
                    Number(Between(0.0, 1.0)),
                    "fraction of the half angle",
                    Is("0.2"),
                    "Outer part of the cone where the light fades out",
                ),
                define_key(
                    "falloff",
                    Words(choice_values::<Falloff>),
                    "",
                    Is("\"square\""),
                    "As for a point light",
                ),
            ],
        },
        TableTypeInfo {
            name: "directional",
            doc: "Light from a distant source, such as the sun",
            keys: &[
                define_key(
                    "direction",
                    Numbers(3, "direction", Any),
                    "",
                    Is("[0, -1, 0]"),
                    "Direction in which the light travels",
                ),
                define_key(
                    "irradiance",
                    Color(AtLeast(0.0)),
                    "W/m²",
                    Is("[1, 1, 1]"),
                    "Irradiance at normal incidence",
                ),
                define_key(
                    "angle",
                    Number(Between(0.0, 180.0)),
                    "degrees",
                    Is("0"),
                    "Apparent diameter, 0 or at least 0.001; use 0.53 for the sun. Above 0, shadows are soft and the disk is visible",
                ),
            ],
        },
    ],
};
