//! Definitions of the `[materials.NAME]` keys.

use super::key::DefaultValue::{Absent, By, Is};
use super::key::ValueKind::{
    ColorOrTexture, Emission, Flag, Heights, Number, NumberOrTexture, Texture, Words,
};
use super::key::{KeyInfo, TableInfo, TableSyntax, TableTypeInfo, choice_values, define_key};
use super::limits::Limits::{Any, AtLeast, Between};
use crate::description::EmissionSides;
use crate::materials::conductor::elements::MetalElement;

pub(super) const MATERIALS: TableInfo = TableInfo {
    name: "materials",
    form: TableSyntax::Named,
    doc: "A material, which shapes refer to by name",
    keys: &[
        define_key(
            "emission",
            Emission(AtLeast(0.0)),
            "radiance",
            Is("[0, 0, 0]"),
            "Emitted radiance; if not black, every shape with this material is an area light",
        ),
        define_key(
            "emission_sides",
            Words(choice_values::<EmissionSides>),
            "",
            Is("\"front\""),
            "The sides that emit light",
        ),
        define_key("normal_map", Texture, "", Absent, "Tangent-space normal map"),
        define_key("normal_strength", Number(AtLeast(0.0)), "", Is("1.0"), "Strength of the normal map"),
        define_key("bump", Heights, "", Absent, "Height map that perturbs the normals"),
        define_key(
            "bump_scale",
            Number(Any),
            "length",
            Is("0.01"),
            "Displacement of white; negative values invert the relief",
        ),
        define_key(
            "opacity",
            NumberOrTexture(Between(0.0, 1.0)),
            "",
            Is("1.0"),
            "Probability that a ray hits the surface instead of passing through",
        ),
        define_key(
            "opacity_cutoff",
            Number(Between(0.0, 1.0)),
            "",
            Is("0.0"),
            "If above 0, alpha testing: opaque where the opacity is at least this, invisible elsewhere. With `filter = \"mipmap\"`, distant surfaces keep their coverage",
        ),
    ],
    types: &[
        TableTypeInfo { name: "phong", doc: "A diffuse surface with a glossy highlight", keys: PHONG_KEYS },
        TableTypeInfo {
            name: "mirror",
            doc: "A perfect mirror",
            keys: &[define_key(
                "reflectance",
                ColorOrTexture(Between(0.0, 1.0)),
                "reflectance",
                Is("[0.9, 0.9, 0.9]"),
                "Reflectance at every angle",
            )],
        },
        TableTypeInfo {
            name: "glass",
            doc: "A smooth or rough dielectric, or a thin pane",
            keys: &[
                define_key(
                    "ior",
                    Number(Between(0.1, 10.0)),
                    "",
                    Is("1.5"),
                    "Index of refraction, relative to air",
                ),
                define_key(
                    "roughness",
                    NumberOrTexture(Between(0.0, 1.0)),
                    "",
                    Is("0.0"),
                    "Square root of the GGX α; 0 is smooth. Thin panes are always smooth",
                ),
                define_key(
                    "tint",
                    ColorOrTexture(Between(0.0, 1.0)),
                    "per unit length",
                    Is("[1, 1, 1]"),
                    "Transmittance per unit length (Beer's law); for a thin pane, transmittance at any angle, which may be a texture",
                ),
                define_key("thin", Flag, "", Is("false"), "Whether the glass is an infinitely thin pane"),
            ],
        },
        TableTypeInfo {
            name: "metal",
            doc: "A rough or smooth conductor, defined by exactly one of `color`, `eta` with `k`, and `element`",
            keys: &[
                define_key(
                    "color",
                    ColorOrTexture(Between(0.0, 1.0)),
                    "reflectance",
                    Absent,
                    "Reflectance at normal incidence; other angles use Schlick's approximation",
                ),
                define_key(
                    "eta",
                    ColorOrTexture(AtLeast(0.0)),
                    "",
                    Absent,
                    "Index of refraction for red, green and blue, used in the exact Fresnel equations",
                ),
                define_key(
                    "k",
                    ColorOrTexture(AtLeast(0.0)),
                    "",
                    Absent,
                    "Extinction coefficient for red, green and blue",
                ),
                define_key(
                    "element",
                    Words(choice_values::<MetalElement>),
                    "",
                    Absent,
                    "Measured `eta` and `k` of a metal",
                ),
                define_key(
                    "roughness",
                    NumberOrTexture(Between(0.0, 1.0)),
                    "",
                    Is("0.2"),
                    "Square root of the GGX α; 0 is a mirror",
                ),
                define_key(
                    "anisotropy",
                    NumberOrTexture(Between(-1.0, 1.0)),
                    "",
                    Is("0.0"),
                    "Stretches the highlight along u, or along v if negative",
                ),
            ],
        },
        TableTypeInfo {
            name: "plastic",
            doc: "A diffuse base under a rough or smooth coat",
            keys: &[
                define_key(
                    "diffuse",
                    ColorOrTexture(Between(0.0, 1.0)),
                    "reflectance",
                    Is("[0.7, 0.7, 0.7]"),
                    "Reflectance of the base",
                ),
                define_key(
                    "specular",
                    ColorOrTexture(Between(0.0, 1.0)),
                    "",
                    Is("[1, 1, 1]"),
                    "Scale factor for the coat's reflectance",
                ),
                define_key(
                    "ior",
                    Number(Between(1.0, 10.0)),
                    "",
                    Is("1.5"),
                    "The coat's index of refraction",
                ),
                define_key(
                    "roughness",
                    NumberOrTexture(Between(0.0, 1.0)),
                    "",
                    Is("0.1"),
                    "Square root of the coat's GGX α; 0 is smooth",
                ),
            ],
        },
        TableTypeInfo {
            name: "principled",
            doc: "The glTF material model",
            keys: &[
                define_key(
                    "color",
                    ColorOrTexture(Between(0.0, 1.0)),
                    "reflectance",
                    Is("[0.8, 0.8, 0.8]"),
                    "Diffuse reflectance of the dielectric part, and the metal's reflectance at normal incidence",
                ),
                define_key(
                    "metallic",
                    NumberOrTexture(Between(0.0, 1.0)),
                    "",
                    Is("0.0"),
                    "Weight of the metal",
                ),
                define_key(
                    "roughness",
                    NumberOrTexture(Between(0.0, 1.0)),
                    "",
                    Is("0.5"),
                    "Square root of the specular lobe's GGX α",
                ),
                define_key(
                    "ior",
                    Number(Between(1.0, 10.0)),
                    "",
                    Is("1.5"),
                    "Index of refraction of the dielectric part",
                ),
                define_key(
                    "specular",
                    NumberOrTexture(Between(0.0, 1.0)),
                    "",
                    Is("1.0"),
                    "Scale factor for the dielectric part's specular reflectance",
                ),
                define_key(
                    "specular_color",
                    ColorOrTexture(AtLeast(0.0)),
                    "",
                    Is("[1, 1, 1]"),
                    "Scale factor for the dielectric part's specular reflectance at normal incidence",
                ),
                define_key(
                    "transmission",
                    NumberOrTexture(Between(0.0, 1.0)),
                    "",
                    Is("0.0"),
                    "Fraction of light that is transmitted straight through, as by a thin sheet, instead of scattered",
                ),
                define_key(
                    "clearcoat",
                    NumberOrTexture(Between(0.0, 1.0)),
                    "",
                    Is("0.0"),
                    "Weight of the clear coat on top",
                ),
                define_key(
                    "clearcoat_roughness",
                    NumberOrTexture(Between(0.0, 1.0)),
                    "",
                    Is("0.0"),
                    "Square root of the clear coat's GGX α",
                ),
            ],
        },
    ],
};

/// Keys of a Phong surface.
const PHONG_KEYS: &[KeyInfo] = &[
    define_key(
        "diffuse",
        ColorOrTexture(AtLeast(0.0)),
        "reflectance",
        Is("[0.7, 0.7, 0.7]"),
        "Diffuse reflectance, kd",
    ),
    define_key(
        "specular",
        ColorOrTexture(AtLeast(0.0)),
        "reflectance",
        Is("[0, 0, 0]"),
        "Glossy reflectance, ks; glimt warns if `diffuse` + `specular` exceeds 1, which is not energy conserving",
    ),
    define_key(
        "shininess",
        Number(Between(0.0, 1000000.0)),
        "",
        Is("32.0"),
        "Phong exponent; larger values make smaller highlights",
    ),
    define_key(
        "ambient",
        ColorOrTexture(AtLeast(0.0)),
        "",
        By("as `diffuse`"),
        "Reflectance for `[render] ambient`",
    ),
];
