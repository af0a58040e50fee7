//! `[materials.NAME]`.

use super::key::Default::{Absent, By, Is};
use super::key::Kind::{ColorOrTexture, Emission, Flag, Heights, Number, NumberOrTexture, Texture, Words};
use super::key::{Form, TableInfo, TypeInfo, key, words};
use super::limits::Limits::{Any, AtLeast, Between};
use crate::description::EmissionSides;
use crate::materials::metal::elements::Element;

pub(super) const MATERIALS: TableInfo = TableInfo {
    name: "materials",
    form: Form::Named,
    doc: "A material, which shapes use by its name",
    keys: &[
        key(
            "emission",
            Emission(AtLeast(0.0)),
            "radiance",
            Is("[0, 0, 0]"),
            "Emitted radiance; above 0, each shape of this material is an area light",
        ),
        key("emission_sides", Words(words::<EmissionSides>), "", Is("\"front\""), "The sides that emit"),
        key("normal_map", Texture, "", Absent, "Tangent-space normal map"),
        key("normal_strength", Number(AtLeast(0.0)), "", Is("1.0"), "How far the map bends the normals"),
        key("bump", Heights, "", Absent, "Heights that bend the normals"),
        key(
            "bump_scale",
            Number(Any),
            "length",
            Is("0.01"),
            "Length of a height of 1; below 0, what stood out is sunk",
        ),
        key(
            "opacity",
            NumberOrTexture(Between(0.0, 1.0)),
            "",
            Is("1.0"),
            "The chance that the surface is there",
        ),
        key(
            "opacity_cutoff",
            Number(Between(0.0, 1.0)),
            "",
            Is("0.0"),
            "Above 0: the surface exists where its opacity is at least this, and nowhere else. With `filter = \"mipmap\"`, distant surfaces keep their coverage",
        ),
    ],
    types: &[
        TypeInfo {
            name: "phong",
            doc: "A diffuse surface with a glossy highlight",
            keys: &[
                key(
                    "diffuse",
                    ColorOrTexture(AtLeast(0.0)),
                    "reflectance",
                    Is("[0.7, 0.7, 0.7]"),
                    "Diffuse reflectance, kd",
                ),
                key(
                    "specular",
                    ColorOrTexture(AtLeast(0.0)),
                    "reflectance",
                    Is("[0, 0, 0]"),
                    "Glossy reflectance, ks; `diffuse` + `specular` is at most 1 in nature, and more is a warning",
                ),
                key(
                    "shininess",
                    Number(Between(0.0, 1000000.0)),
                    "",
                    Is("32.0"),
                    "Phong exponent: the larger, the smaller the highlight",
                ),
                key(
                    "ambient",
                    ColorOrTexture(AtLeast(0.0)),
                    "",
                    By("as `diffuse`"),
                    "How much of `[render] ambient` it reflects",
                ),
            ],
        },
        TypeInfo {
            name: "mirror",
            doc: "A perfect mirror",
            keys: &[key(
                "reflectance",
                ColorOrTexture(Between(0.0, 1.0)),
                "reflectance",
                Is("[0.9, 0.9, 0.9]"),
                "Share of the light that a smooth conductor reflects",
            )],
        },
        TypeInfo {
            name: "glass",
            doc: "A smooth or rough dielectric, or a thin pane",
            keys: &[
                key(
                    "ior",
                    Number(Between(0.1, 10.0)),
                    "",
                    Is("1.5"),
                    "Index of refraction of a dielectric; outside is 1",
                ),
                key(
                    "roughness",
                    NumberOrTexture(Between(0.0, 1.0)),
                    "",
                    Is("0.0"),
                    "The root of α of its surface; 0 is smooth, and a thin pane is always smooth",
                ),
                key(
                    "tint",
                    ColorOrTexture(Between(0.0, 1.0)),
                    "per unit of length",
                    Is("[1, 1, 1]"),
                    "Transmittance of one unit of length inside (Beer's law); that of a thin pane at any angle, which may be a texture",
                ),
                key("thin", Flag, "", Is("false"), "Whether it is a pane without thickness"),
            ],
        },
        TypeInfo {
            name: "metal",
            doc: "A rough or smooth conductor, by exactly one of `color`, `eta` with `k`, and `element`",
            keys: &[
                key(
                    "color",
                    ColorOrTexture(Between(0.0, 1.0)),
                    "reflectance",
                    Absent,
                    "Reflectance at normal incidence; at other angles by Schlick's approximation",
                ),
                key(
                    "eta",
                    ColorOrTexture(AtLeast(0.0)),
                    "",
                    Absent,
                    "Index of refraction for red, green and blue: exact reflectance",
                ),
                key(
                    "k",
                    ColorOrTexture(AtLeast(0.0)),
                    "",
                    Absent,
                    "Extinction coefficient for red, green and blue",
                ),
                key("element", Words(words::<Element>), "", Absent, "`eta` and `k` as measured"),
                key(
                    "roughness",
                    NumberOrTexture(Between(0.0, 1.0)),
                    "",
                    Is("0.2"),
                    "The root of α of GGX; 0 is a mirror",
                ),
                key(
                    "anisotropy",
                    NumberOrTexture(Between(-1.0, 1.0)),
                    "",
                    Is("0.0"),
                    "Stretches the lobe along u, or along v if it is negative",
                ),
            ],
        },
        TypeInfo {
            name: "plastic",
            doc: "A diffuse base under a rough or smooth coat",
            keys: &[
                key(
                    "diffuse",
                    ColorOrTexture(Between(0.0, 1.0)),
                    "reflectance",
                    Is("[0.7, 0.7, 0.7]"),
                    "Reflectance of the base",
                ),
                key(
                    "specular",
                    ColorOrTexture(Between(0.0, 1.0)),
                    "",
                    Is("[1, 1, 1]"),
                    "Factor on what the coat reflects",
                ),
                key("ior", Number(Between(1.0, 10.0)), "", Is("1.5"), "Index of refraction of the coat"),
                key(
                    "roughness",
                    NumberOrTexture(Between(0.0, 1.0)),
                    "",
                    Is("0.1"),
                    "The root of α of the coat; 0 is a smooth coat",
                ),
            ],
        },
        TypeInfo {
            name: "principled",
            doc: "The inputs of glTF",
            keys: &[
                key(
                    "color",
                    ColorOrTexture(Between(0.0, 1.0)),
                    "reflectance",
                    Is("[0.8, 0.8, 0.8]"),
                    "Diffuse reflectance, or that of the metal at normal incidence",
                ),
                key("metallic", NumberOrTexture(Between(0.0, 1.0)), "", Is("0.0"), "How far it is a metal"),
                key(
                    "roughness",
                    NumberOrTexture(Between(0.0, 1.0)),
                    "",
                    Is("0.5"),
                    "The root of α of the specular lobe",
                ),
                key(
                    "ior",
                    Number(Between(1.0, 10.0)),
                    "",
                    Is("1.5"),
                    "Index of refraction of what is no metal",
                ),
                key(
                    "specular",
                    NumberOrTexture(Between(0.0, 1.0)),
                    "",
                    Is("1.0"),
                    "Factor on the specular reflectance of what is no metal",
                ),
                key(
                    "specular_color",
                    ColorOrTexture(AtLeast(0.0)),
                    "",
                    Is("[1, 1, 1]"),
                    "Factor on that reflectance at normal incidence",
                ),
                key(
                    "transmission",
                    NumberOrTexture(Between(0.0, 1.0)),
                    "",
                    Is("0.0"),
                    "How much of the light goes through in place of being scattered, as through a thin sheet",
                ),
                key(
                    "clearcoat",
                    NumberOrTexture(Between(0.0, 1.0)),
                    "",
                    Is("0.0"),
                    "Weight of a clear coat over everything",
                ),
                key(
                    "clearcoat_roughness",
                    NumberOrTexture(Between(0.0, 1.0)),
                    "",
                    Is("0.0"),
                    "The root of α of the clear coat",
                ),
            ],
        },
    ],
};
