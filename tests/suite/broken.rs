//! Exact diagnostics for invalid scene files, with their positions.

use std::fs;
use std::path::{Path, PathBuf};

use glimt::scene::diagnostic::{Diagnostic, Severity};
use glimt::scene::report::{ReportStyle, line_and_column, render_diagnostics, summarize_diagnostic_counts};

use super::test_dir::assert_mentions;

/// Line, column, and `message; label`.
type ExpectedDiagnostic = (usize, usize, &'static str);

/// Every file in `tests/broken` with all its diagnostics, in order.
const BROKEN: &[(&str, &[ExpectedDiagnostic])] = &[
    ("away", &[(15, 1, "warning: this light shines away from everything; all shapes are behind it")]),
    (
        "blends",
        &[
            (14, 1, "[materials.lonely] needs `materials`; `materials` is missing"),
            (16, 10, "`weight` must be between 0 and 1; found 2"),
            (
                20,
                13,
                "`materials` must be an array with the names of two materials; found an array of 3 values",
            ),
            (24, 23, r#"there is no material "pant"; did you mean "paint"?"#),
            (29, 1, "a blend cannot have `emission`"),
            (30, 1, "a blend cannot have `opacity`"),
            (31, 1, "a blend cannot have `normal_map`"),
            (35, 13, "solid glass cannot be blended"),
            (43, 13, r#"the blend "egg" contains itself"#),
        ],
    ),
    (
        "brackets",
        &[
            (2, 1, "[render] must be a table; found an array of tables"),
            (12, 2, "`sphere` must be a list of tables; found a table"),
            (18, 8, "[materials.wall] must be a table; found 1"),
            (20, 2, "`light` must be a list of tables; found a table"),
        ],
    ),
    (
        "camera_both",
        &[(4, 1, "`position` conflicts with `orbiter`"), (5, 1, "`look_at` conflicts with `orbiter`")],
    ),
    ("camera_direction", &[(4, 11, "the camera has no direction; this is the same point as `position`")]),
    (
        "camera_up",
        &[(4, 11, "`up` must not be parallel to the view; the view is parallel to the default [0, 1, 0]")],
    ),
    ("camera_up_zero", &[(5, 6, "`up` has no direction; its length is 0")]),
    (
        "choices",
        &[
            (3, 14, r#"`integrator` cannot be "whited"; did you mean "whitted"?"#),
            (4, 11, r#"`shadows` cannot be "softer"; did you mean "soft"?"#),
            (5, 10, r#"`filter` cannot be "gauss""#),
            (6, 11, r#"`tonemap` must be one of "none", "reinhard", "aces", "agx"; found 1"#),
            (7, 9, r#"`accel` cannot be "octree"; did you mean "kdtree"?"#),
            (22, 8, r#"`type` cannot be "area""#),
            (27, 11, r#"`falloff` cannot be "cube""#),
        ],
    ),
    (
        "coats",
        &[
            (10, 8, "`coat` must be between 0 and 1; found 1.5"),
            (11, 18, "`coat_roughness` must be between 0 and 1; found -1"),
            (12, 12, "`coat_ior` must be between 1 and 10; found 0.9"),
            (13, 13, "`coat_tint` must be between 0 and 1; found 2"),
            (17, 1, "the coat of this material is specified twice"),
            (22, 1, "glass cannot have `coat`"),
            (26, 1, "warning: `coat_tint` has no effect without `coat`"),
        ],
    ),
    (
        "colours",
        &[
            (3, 15, "`ambient` must be at least 0; found -0.1"),
            (
                4,
                14,
                r##"`background` must be a color: [r, g, b], a number, "#rrggbb" or a name; not of the form #rrggbb"##,
            ),
            (
                11,
                11,
                r##"`diffuse` must be a color: [r, g, b], a number, "#rrggbb" or a name; not of the form #rrggbb"##,
            ),
            (
                12,
                12,
                r##"`specular` must be a color, [r, g, b], a number, "#rrggbb" or a name, or { texture = "name" }; found an array of 2 values"##,
            ),
            (
                13,
                12,
                r##"`emission` must be a color: [r, g, b], a number, "#rrggbb" or a name; did you mean "white"?"##,
            ),
            (17, 21, "`reflectance` must be between 0 and 1; found 1.1"),
            (21, 7, "`ior` must be between 0.1 and 10; found 0.09"),
            (22, 15, "`tint` must be between 0 and 1; found 2"),
        ],
    ),
    ("comment_only", &[(1, 1, "the scene has no [camera]")]),
    (
        "crlf_tabs",
        &[
            (4, 19, r#"`look_at` must be three numbers, [x, y, z]; found the string "ä""#),
            (5, 8, "`fov` must be greater than 0 and at most 360; found 0"),
        ],
    ),
    ("dark", &[(1, 1, "warning: nothing lights this scene")]),
    ("deep_key", &[(16, 1, "arrays or tables are nested too deeply")]),
    (
        "duplicates",
        &[
            (14, 2, "`camera` is defined twice; second definition"),
            (17, 12, "`red` is defined twice; second definition"),
        ],
    ),
    ("emissive_plane", &[(10, 12, "an infinite plane cannot emit light; this material has `emission`")]),
    ("empty_list", &[(10, 12, "`material` must be the name of a material; found 7")]),
    (
        "encodings",
        &[(6, 11, r#"the texture "leaf" is used for colors and for numbers; it needs `encoding`"#)],
    ),
    (
        "endings",
        &[
            (3, 10, "`output`: unknown file extension .tiff"),
            (10, 8, "`file`: unknown file extension .gif"),
            (13, 8, "`file` needs a file extension"),
            (20, 8, "`file`: unknown file extension .fbx"),
            (24, 8, "`file`: unknown file extension .obi; did you mean .obj?"),
        ],
    ),
    (
        "environment",
        &[
            (7, 13, "`color` must be at least 0; found -1"),
            (8, 8, "file not found: …/files/brick.ppm"),
            (9, 10, r#"`rotate` must be a number; found the string "left""#),
            (10, 1, "unknown key `rotation` in [environment]"),
        ],
    ),
    (
        "environment_sky",
        &[
            (7, 1, "`color` cannot be combined with `sky`"),
            (10, 7, "the sun is not above the horizon"),
            (11, 13, "`turbidity` must be between 1 and 10; found 11"),
            (12, 16, "`ground` must be between 0 and 1; found 1.5"),
            (13, 13, "`sun_angle` must be between 0.001 and 90; found 0"),
            (14, 13, "`sky_scale` must be at least 0; found -1"),
            (15, 1, "unknown key `sun_scales` in `sky`; did you mean `sun_scale`?"),
        ],
    ),
    (
        "environment_warnings",
        &[
            (1, 1, "warning: nothing lights this scene"),
            (9, 2, "warning: [environment] replaces `background`, which has no effect"),
            (10, 9, "warning: `color` is black, so the environment is black; this scales the map in `file`"),
        ],
    ),
    (
        "escapes",
        &[
            (11, 11, "`radius` must be greater than 0; found -1"),
            (12, 12, r#"there is no material "␛[31m␊red""#),
        ],
    ),
    (
        "fisheye",
        &[
            (6, 7, "`fov` must be greater than 0 and at most 360; found 361"),
            (7, 1, r#"`aperture` conflicts with `projection = "fisheye"`"#),
            (11, 10, "`matrix` must be a rotation; the last row and the last column must be 0, 0, 0, 1"),
        ],
    ),
    ("group_cycle", &[(10, 1, r#"the group "shelf" contains itself; shelf → rack → shelf"#)]),
    (
        "groups",
        &[
            (11, 10, "`radius` must be greater than 0; found 0"),
            (14, 16, "unknown key `bx` in [groups.stool]; did you mean `box`?"),
            (17, 16, "a group cannot contain lights without a shape"),
            (21, 1, "`sphere` must be a list of tables; found a table"),
            (24, 9, r#"there is no group "stol"; did you mean "stool"?"#),
            (26, 1, "[[instance]] needs `group`; `group` is missing"),
            (27, 13, "`translate` must be three numbers, [x, y, z]; found an array of 2 values"),
            (31, 9, "`scale` must not be 0; found 0"),
            (32, 8, "`name` must not be a number"),
            (36, 1, "`rotate` conflicts with `matrix`"),
            (38, 1, "unknown key `material` in [[instance]]"),
            (40, 2, "unknown table `instances`; did you mean `instance`?"),
        ],
    ),
    (
        "huge_numbers",
        &[
            (3, 9, "40000 × 40000 pixels are too many"),
            (
                5,
                11,
                "`samples` must be a whole number between 1 and 4294967295; found 99999999999999999999999",
            ),
            (12, 11, "`center` must be at most 1e18 in magnitude; found 1e19"),
            (12, 20, "`center` must be at most 1e18 in magnitude; found 1e999"),
            (13, 10, "`radius` must be at most 1e18 in magnitude; found 1701411834604692317316873037158…"),
        ],
    ),
    (
        "lengths",
        &[
            (5, 6, "`up` must be more than 1e-18 long; its length is 1e-30"),
            (6, 12, "`aperture` must be 0, or at least 1e-18; found 1e-30"),
            (7, 9, "`focus` must be more than 1e-18 in magnitude; found 1e-30"),
            (13, 10, "`radius` must be more than 1e-18 in magnitude; found 1e-30"),
            (17, 5, "`u` must be more than 1e-18 long; its length is 1e-30"),
            (18, 5, "`v` must be more than 1e-18 long; its length is 1e-200"),
            (22, 10, "`normal` must be more than 1e-18 long; its length is 1e-19"),
            (26, 12, "`size` must be more than 1e-18 in magnitude; found 1e-30"),
            (31, 5, "`a` and `b` must be more than 1e-18 apart; they are 1e-30 apart"),
            (35, 10, "`normal` must be more than 1e-18 long; its length is 1e-20"),
            (36, 10, "`radius` must be more than 1e-18 in magnitude; found 1e-20"),
            (41, 5, "`a` and `b` must be more than 1e-18 apart; they are 1e-25 apart"),
            (46, 7, "`base` and `tip` must be more than 1e-18 apart; they are 1e-19 apart"),
            (50, 8, "`axis` must be more than 1e-18 long; its length is 1e-40"),
            (51, 10, "`radius` must be more than 1e-18 in magnitude; found 1e-40"),
            (52, 8, "`tube` must be more than 1e-18 in magnitude; found 1e-41"),
            (56, 10, "`radius` must be 0, or at least 1e-18; found 1e-30"),
        ],
    ),
    (
        "lights",
        &[
            (8, 11, "the spotlight has no direction; `position` and `look_at` are the same point"),
            (12, 9, "`angle` must be greater than 0 and less than 360; found 360"),
            (13, 9, "`blend` must be between 0 and 1; found 1.5"),
            (16, 8, r#"`type` cannot be "spott"; did you mean "spot"?"#),
            (20, 13, "the light has no direction; `direction` has length 0"),
            (24, 9, "`angle` must be 0, or at least 1e-3"),
            (25, 1, "unknown key `intensity` in [[light]]"),
            (29, 9, "`angle` must be between 0 and 180; found 181"),
            (32, 1, "unknown key `angle` in [[light]]"),
        ],
    ),
    (
        "materials",
        &[
            (8, 10, r#"`filter` cannot be "linear"; did you mean "bilinear"?"#),
            (9, 8, r#"`wrap` cannot be "mirrored"; did you mean "mirror"?"#),
            (10, 11, "`repeat` must not be 0; found 0"),
            (11, 12, r#"`encoding` cannot be "gamma""#),
            (14, 8, r#"`type` cannot be "fong""#),
            (18, 1, "unknown key `diffuse` in [materials.steel]"),
            (
                21,
                11,
                r##"`diffuse` must be a color, [r, g, b], a number, "#rrggbb" or a name, or { texture = "name" }; found the name of a texture"##,
            ),
            (22, 13, "`shininess` must be between 0 and 1000000; found -1"),
            (23, 14, "`normal_map` must be the name of a texture; found a table"),
            (24, 19, "`normal_strength` must be at least 0; found -2"),
            (25, 24, r#"there is no texture "brikcs"; did you mean "bricks"?"#),
            (25, 42, "`scale` must be at least 0; found -1"),
            (25, 46, "unknown key `sclae` in `emission`; did you mean `scale`?"),
            (26, 8, r#"`bump` must be the name of a texture, or { texture = "name" }; found 0.5"#),
            (27, 14, r#"`bump_scale` must be a number; found the string "high""#),
            (30, 13, "unknown key `textur` in `diffuse`; did you mean `texture`?"),
            (31, 40, r#"`channel` cannot be "height""#),
        ],
    ),
    (
        "microfacets",
        &[
            (9, 1, "[materials.none] needs `color`; `color` is missing"),
            (11, 13, "`roughness` must be between 0 and 1; found 1.5"),
            (16, 1, "the reflectance of this metal is specified twice"),
            (17, 14, "`anisotropy` must be between -1 and 1; found -2"),
            (19, 1, "[materials.half] needs `k`; `k` is missing"),
            (25, 11, r#"`element` cannot be "alumminium"; did you mean "aluminium"?"#),
            (29, 12, "`diffuse` must be between 0 and 1; found 2"),
            (30, 7, "`ior` must be between 1 and 10; found 0.5"),
            (31, 1, "unknown key `shininess` in [materials.coat]"),
            (37, 12, r#"`metallic` must be a number, or { texture = "name" }; found the name of a texture"#),
            (42, 13, "thin panes cannot be rough"),
            (46, 13, "`roughness` must be between 0 and 1; found -1"),
            (50, 16, "`transmission` must be between 0 and 1; found 2"),
        ],
    ),
    (
        "missing_files",
        &[
            (3, 11, "file not found: …/files/orbiter.txt"),
            (6, 8, "file not found: …/files/brick.ppm"),
            (9, 8, "…/files/folder.ppm is a folder, not a file"),
            (12, 8, "`file` is empty; expected a file path"),
            (20, 8, "file not found: …/files/knots.obj"),
        ],
    ),
    (
        "missing_keys",
        &[
            (2, 1, "[camera] needs `position`; `position` is missing"),
            (2, 1, "[camera] needs `look_at`; `look_at` is missing"),
            (8, 1, "[[sphere]] needs `center`; `center` is missing"),
            (8, 1, "[[sphere]] needs `radius`; `radius` is missing"),
            (11, 1, "[[quad]] needs `material`; `material` is missing"),
        ],
    ),
    ("nesting", &[(2, 85, "arrays or tables are nested too deeply")]),
    (
        "no_area",
        &[
            (12, 5, "the quad has no area; `u` and `v` are parallel, or one of them is 0"),
            (18, 5, "the triangle has no area; `a`, `b` and `c` are collinear"),
            (22, 10, "the plane has no direction; `normal` has length 0"),
            (29, 5, "the quad has no area; `u` and `v` are parallel, or one of them is 0"),
        ],
    ),
    ("no_camera", &[(1, 1, "the scene has no [camera]")]),
    ("no_shapes", &[(1, 1, "warning: the scene has no shapes")]),
    (
        "not_finite",
        &[
            (3, 18, "`background` must be a finite number; found inf"),
            (6, 13, "`position` must be a finite number; found nan"),
            (7, 18, "`look_at` must be a finite number; found -inf"),
            (14, 10, "`radius` must be a finite number; found +nan"),
        ],
    ),
    (
        "open_header",
        &[
            (2, 8, "this header is not closed"),
            (7, 15, "`diffuse` must be at least 0; found -1"),
            (9, 10, "this header is not closed"),
            (13, 12, "`position` must be three numbers, [x, y, z]; found an array of 2 values"),
        ],
    ),
    (
        "open_list",
        &[
            (3, 22, "digits are missing in this number"),
            (4, 23, "digits are missing in this number"),
            (5, 16, "this string is not closed"),
            (6, 12, "unexpected text after the value"),
            (9, 10, "this key has no value"),
            (10, 11, "`[` opened here is not closed"),
        ],
    ),
    (
        "other_names",
        &[
            (3, 15, "commas are missing: write [0, 0, 0]"),
            (4, 17, "a comma is missing: write [0.1, 0.1, 0.1]"),
            (6, 2, "unknown table `camra`; did you mean `camera`?"),
            (11, 1, "unknown key `color` in [materials.wall]; did you mean `diffuse`?"),
            (12, 1, "unknown key `roughness` in [materials.wall]; did you mean `shininess`?"),
            (
                19,
                15,
                r##"`reflectance` must be a color: [r, g, b], a number, "#rrggbb" or a name; this looks like 0–255"##,
            ),
            (21, 3, "unknown table `cube`; did you mean `box`?"),
            (32, 1, "unknown key `strength` in [[light]]; did you mean `intensity`?"),
            (35, 8, r#"`type` cannot be "sun"; did you mean "directional"?"#),
        ],
    ),
    ("output_ending", &[(3, 10, "`output`: unknown file extension .tiff")]),
    (
        "panorama",
        &[
            (6, 1, r#"`fov` conflicts with `projection = "panorama"`"#),
            (7, 1, r#"`view_height` conflicts with `projection = "panorama"`"#),
            (8, 1, r#"`aperture` conflicts with `projection = "panorama"`"#),
            (9, 1, r#"`focus` conflicts with `projection = "panorama"`"#),
            (13, 10, "`matrix` must be a rotation; it is a reflection: its determinant is -1"),
        ],
    ),
    (
        "partners",
        &[
            (10, 1, "warning: `normal_strength` has no effect without `normal_map`"),
            (11, 1, "warning: `bump_scale` has no effect without `bump`"),
            (12, 1, "warning: `opacity_cutoff` has no effect without `opacity`"),
            (13, 1, "warning: `emission_sides` has no effect without `emission`"),
            (17, 1, "warning: `clearcoat_roughness` has no effect without `clearcoat`"),
            (33, 1, "warning: `distribution` has no effect on a smooth surface"),
            (
                37,
                24,
                "warning: `diffuse_transmission` is limited to 1 − `color`; color + diffuse_transmission is 1.200 in green",
            ),
        ],
    ),
    ("pattern_normals", &[(12, 14, "a normal map must be an image; this texture is a pattern")]),
    (
        "patterns",
        &[
            (8, 1, "unknown key `file` in [textures.tiles]; did you mean `filter`?"),
            (9, 1, "unknown key `size` in [textures.tiles]"),
            (13, 8, "`size` must be greater than 0; found 0"),
            (14, 11, "`octaves` must be a whole number between 1 and 16; found 17"),
            (15, 10, "`colors` must be an array of two colors; found an array of 1 value"),
            (16, 1, "unknown key `repeat` in [textures.grain]"),
            (
                20,
                20,
                r##"`colors` must be a color: [r, g, b], a number, "#rrggbb" or a name; did you mean "black"?"##,
            ),
            (21, 11, "`repeat` must not be 0; found 0"),
            (24, 1, "unknown key `colors` in [textures.forgotten]"),
            (28, 8, r#"`type` cannot be "chequer"; did you mean "checker"?"#),
            (32, 18, "`colors` must be at least 0; found -1"),
            (
                32,
                23,
                r##"`colors` must be a color: [r, g, b], a number, "#rrggbb" or a name; found a table"##,
            ),
        ],
    ),
    (
        "photons",
        &[
            (3, 11, r#"`enabled` must be true or false; found the string "yes""#),
            (4, 9, "`count` must be a whole number between 0 and 1000000000000; found -1"),
            (5, 10, "`radius` must be at least 0; found -1"),
            (6, 11, "`bounces` must be a whole number; found 1e3"),
        ],
    ),
    (
        "projections",
        &[
            (2, 1, "[camera] needs `view_height`; `view_height` is missing"),
            (6, 1, r#"`fov` conflicts with `projection = "orthographic"`"#),
            (7, 9, "`shift` must be two numbers, [right, up]; found an array of 3 values"),
            (8, 10, r#"`mirror` must be true or false; found the string "yes""#),
            (11, 8, "`gain` must be at least 0; found -1"),
            (15, 1, "`rotate` conflicts with `matrix`"),
            (
                16,
                10,
                "`matrix` must be a rotation; the rows must have length 1 and be perpendicular to each other",
            ),
        ],
    ),
    (
        "ranges",
        &[
            (3, 9, "`width` must be a whole number between 1 and 65536; found 0"),
            (4, 10, "`height` must be a whole number between 1 and 65536; found 65537"),
            (5, 11, "`samples` must be a whole number between 1 and 4294967295; found 0"),
            (6, 13, "`max_depth` must be a whole number between 0 and 10000; found -1"),
            (7, 12, "`exposure` must be between -100 and 100; found 101"),
            (8, 18, "`shadow_samples` must be a whole number between 1 and 4096; found 5000"),
            (9, 8, "`seed` must be a whole number between 0 and 4294967295; found 4294967296"),
            (10, 9, "`error` must be at least 0; found -0.5"),
            (15, 7, "`fov` of a perspective must be less than 180; found 180"),
            (16, 12, "`aperture` must be at least 0; found -0.1"),
            (17, 9, "`focus` must be greater than 0; found 0"),
        ],
    ),
    (
        "round_shapes",
        &[
            (10, 10, "the disk has no direction; `normal` has length 0"),
            (11, 10, "`radius` must be greater than 0; found 0"),
            (16, 5, "the cylinder has no length; `a` and `b` are the same point"),
            (17, 8, "`caps` must be true or false; found 1"),
            (21, 5, "the cylinder has no length; `a` and `b` are the same point"),
            (27, 7, "`tip` must be three numbers, [x, y, z]; found an array of 2 values"),
            (28, 10, "`radius` must be greater than 0; found -2"),
            (29, 1, "unknown key `caps` in [[cone]]; did you mean `cap`?"),
            (34, 8, "the torus intersects itself; `tube` must be less than `radius` = 0.5"),
            (37, 1, "[[torus]] needs `material`; `material` is missing"),
            (39, 8, "the torus has no direction; `axis` has length 0"),
            (40, 8, "`tube` must be greater than 0; found 0"),
        ],
    ),
    (
        "shape_sizes",
        &[
            (11, 10, "`radius` must be greater than 0; found -0.5"),
            (16, 12, "`size` must be greater than 0; found 0"),
            (16, 15, "`size` must be greater than 0; found -2"),
            (21, 13, "`scale` must not be 0; found 0"),
            (26, 9, "`scale` must not be 0; found 0.0"),
            (27, 10, "`smooth` must be true or false; found 1"),
        ],
    ),
    (
        "surfaces",
        &[
            (8, 10, r#"`rotate` must be a number; found the string "half""#),
            (9, 10, "`offset` must be two numbers, [u, v]; found an array of 1 value"),
            (10, 6, "`uv` must be a whole number between 0 and 1; found 2"),
            (17, 1, "warning: `emission_sides` has no effect without `emission`"),
            (17, 18, r#"`emission_sides` cannot be "back""#),
            (18, 11, r#"`opacity` must be a number, or { texture = "name" }; found the name of a texture"#),
            (19, 18, "`opacity_cutoff` must be between 0 and 1; found 2"),
            (22, 43, r#"`channel` cannot be "alpha""#),
            (26, 1, "solid glass cannot have `opacity`"),
            (30, 8, "`thin` must be true or false; found 1"),
            (31, 11, "`opacity` must be between 0 and 1; found -1"),
            (36, 1, "`scale` conflicts with `matrix`"),
            (42, 10, "the last row of `matrix` must be 0, 0, 0, 1; it is 0, 0, 0, 2"),
            (47, 10, "`matrix` is not invertible; its determinant is 0"),
            (52, 41, "`matrix` must be a finite number; found nan"),
            (57, 10, "`matrix` must be 16 numbers, row by row; found an array of 9 values"),
            (58, 17, r#"`vertex_colors` must be true or false; found the string "red""#),
            (64, 10, "`matrix` is not invertible; its determinant is 0"),
            (68, 10, "the last row of `matrix` must be 0, 0, 0, 1; it is 0, 0, 1, 1"),
            (75, 7, "`ior` must be a number; found a table"),
            (78, 25, "`diffuse_transmission` must be at least 0; found -1"),
            (79, 9, r#"`sides` cannot be "back""#),
            (83, 9, "warning: `sides` has no effect on a material that transmits light"),
            (88, 16, r#"`distribution` cannot be "gauss""#),
            (89, 9, "warning: `sides` has no effect on a material that transmits light"),
            (94, 13, "`subdivide` must be a whole number between 0 and 6; found 7"),
        ],
    ),
    (
        "syntax",
        &[
            (3, 9, "a value is missing"),
            (4, 10, "`100 200` is not a number"),
            (5, 11, r#"strings must be quoted; write "aces""#),
            (6, 11, "`samples` must be a whole number between 1 and 4294967295; found 0"),
            (8, 8, "this header is not closed"),
            (18, 1, "`radius` is defined twice; second definition"),
            (19, 16, "this string is not closed"),
        ],
    ),
    (
        "undefined_names",
        &[
            (7, 23, r#"there is no texture "briks"; did you mean "bricks"?"#),
            (8, 14, r#"there is no texture "bumps""#),
            (16, 12, r#"there is no material "rot""#),
            (21, 12, r#"there is no material "rad"; did you mean "red"?"#),
        ],
    ),
    (
        "unknown_keys",
        &[
            (2, 1, "unknown key `colour` outside of any table"),
            (5, 1, "unknown key `widht` in [render]; did you mean `width`?"),
            (6, 1, "unknown key `zebra` in [render]"),
            (17, 1, "unknown key `raduis` in [[sphere]]; did you mean `radius`?"),
            (20, 3, "unknown table `sphre`; did you mean `sphere`?"),
        ],
    ),
    (
        "warnings",
        &[
            (1, 1, "warning: nothing lights this scene"),
            (9, 11, r#"warning: the texture "bricks" is not used"#),
            (
                14,
                12,
                "warning: this material reflects more light than it receives; diffuse + specular is 1.100 in red",
            ),
            (16, 12, r#"warning: the material "blue" is not used"#),
        ],
    ),
    (
        "wrong_types",
        &[
            (3, 9, r#"`width` must be a whole number; found the string "wide""#),
            (4, 11, "`samples` must be a whole number; found 1.5"),
            (5, 11, r##"`ambient` must be a color: [r, g, b], a number, "#rrggbb" or a name; found true"##),
            (6, 8, "`seed` must be a whole number; found true"),
            (9, 12, "`position` must be three numbers, [x, y, z]; found an array of 2 values"),
            (10, 15, r#"`look_at` must be three numbers, [x, y, z]; found the string "1""#),
            (10, 20, "`look_at` must be three numbers, [x, y, z]; found false"),
            (11, 7, "`fov` must be a number; found the date 1979-05-27"),
        ],
    ),
];

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/broken")
}

fn diagnostics(path: &Path) -> Vec<Diagnostic> {
    match glimt::scene::load(path, &[]) {
        Ok(loaded) => loaded.warnings,
        Err(diagnostics) => diagnostics,
    }
}

fn position_and_message(diagnostic: &Diagnostic) -> (usize, usize, String) {
    let place = diagnostic.place.as_ref().expect("a place");
    let (line, column) = line_and_column(&place.source, place.span.start);
    let kind = if diagnostic.severity == Severity::Warning { "warning: " } else { "" };
    let label = if place.label.is_empty() { String::new() } else { format!("; {}", place.label) };
    (
        line,
        column,
        format!("{kind}{}{label}", diagnostic.message).replace(folder().to_str().expect("UTF-8"), "…"),
    )
}

#[test]
fn broken_scenes_have_expected_diagnostics() {
    for (name, expected) in BROKEN {
        let found: Vec<_> = diagnostics(&folder().join(name).with_extension("toml"))
            .iter()
            .map(position_and_message)
            .collect();
        let found: Vec<_> =
            found.iter().map(|(line, column, text)| (*line, *column, text.as_str())).collect();
        assert_eq!(&found, expected, "{name}");
    }
}

#[test]
fn every_broken_scene_is_listed() {
    let files = fs::read_dir(folder()).expect("the folder").map(|entry| entry.expect("an entry").path());
    let mut names: Vec<String> = files
        .filter(|path| path.is_file())
        .map(|path| path.file_stem().expect("a name").to_str().expect("UTF-8").to_owned())
        .collect();
    names.sort();
    let listed: Vec<&str> = BROKEN.iter().map(|(name, _)| *name).collect();
    assert_eq!(names, listed);
    assert!(names.len() >= 24);
}

#[test]
fn reports_show_positions_and_escape_controls() {
    for (name, expected) in BROKEN {
        let path = folder().join(name).with_extension("toml");
        let text = fs::read_to_string(&path).expect("text");
        let diagnostics = diagnostics(&path);
        let report = render_diagnostics(&diagnostics, 100, ReportStyle::Plain);
        for (line, column, _) in *expected {
            let place = format!("--> {}:{line}:{column}\n", path.display());
            assert!(report.contains(&place), "{place} not found in\n{report}");
            let source = text.lines().nth(line - 1).unwrap_or_default().trim_start_matches('\u{feff}');
            let start: String = source.trim().chars().take_while(|c| !c.is_control()).take(20).collect();
            assert!(report.contains(&start), "{start} not found in\n{report}");
        }
        assert!(report.ends_with(&format!("\n{}\n", summarize_diagnostic_counts(&diagnostics))), "{report}");
        let is_safe = |c: char| c == '\n' || !(c.is_control() || "\u{202e}\u{feff}".contains(c));
        assert!(report.chars().all(is_safe), "{report:?}");
        assert_eq!(report.matches("^").count() > 0, !diagnostics.is_empty());
    }
}

/// The only diagnostic for a file with the given contents.
fn diagnostic_for_bytes(bytes: &[u8]) -> Diagnostic {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("scene.toml");
    fs::write(&path, bytes).expect("written");
    let [diagnostic] = diagnostics(&path).try_into().expect("one diagnostic");
    assert_eq!(diagnostic.path, path);
    diagnostic
}

#[test]
fn non_text_files_are_rejected() {
    let latin = position_and_message(&diagnostic_for_bytes(b"[camera]\n# caf\xe9\n"));
    assert_eq!((latin.0, latin.1), (2, 6));
    assert_mentions(&latin.2, &["line 2", "UTF-8", "0xe9", "offset 14"]);
    assert!(diagnostic_for_bytes(b"\x7fELF\x02\x01\0\0").message.contains("binary"));
    assert_mentions(&diagnostic_for_bytes(b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR").message, &["(PNG)"]);
    let model = diagnostic_for_bytes(b"# by hand\nv 0 0 0\n");
    assert!(model.message.contains("a model (OBJ)"), "{}", model.message);
    assert_mentions(&model.help.expect("help"), &["scene.obj"]);
    assert!(
        diagnostic_for_bytes(
            "[camera]".encode_utf16().flat_map(u16::to_le_bytes).collect::<Vec<_>>().as_slice()
        )
        .message
        .contains("binary")
    );
    for nothing in ["", " \n\t\r\n", "\u{feff}\n"] {
        assert_eq!(
            position_and_message(&diagnostic_for_bytes(nothing.as_bytes())),
            (1, 1, "the scene file is empty".to_owned())
        );
    }
}

#[test]
fn keys_of_other_types_are_named() {
    let said = diagnostics(&folder().join("patterns.toml"));
    let helps: Vec<&str> = said.iter().filter_map(|one| one.help.as_deref()).collect();
    for start in [
        "`file` is for type \"image\"; expected one of `type`, `colors`, `repeat`",
        "`size` is for type \"noise\"; expected",
        "`colors` is for type \"checker\" or \"noise\" or \"bands\"; expected one of `type`, `file`",
    ] {
        assert!(helps.iter().any(|help| help.starts_with(start)), "{start}: {helps:#?}");
    }
}

#[test]
fn deep_nesting_does_not_overflow_the_stack() {
    for (open, close) in [("[", "]"), ("{a=", "}"), ("a.", "a=1")] {
        let text = format!("x = {}{close}\n", open.repeat(200_000));
        assert_eq!(position_and_message(&diagnostic_for_bytes(text.as_bytes())).0, 1);
        let header = format!("[{}a]\nb = 1\n", "a.".repeat(200_000));
        assert_eq!(position_and_message(&diagnostic_for_bytes(header.as_bytes())).0, 1);
    }
}

#[test]
fn eight_bit_colors_get_a_hex_suggestion() {
    let scene = |kind: &str, key: &str| {
        format!(
            "[camera]\nposition = [0, 1, 4]\nlook_at = [0, 1, 0]\n[[light]]\n[[sphere]]\ncenter = [0, 0, 0]\nradius = 1\nmaterial = \"a\"\n\
             [materials.a]\ntype = \"{kind}\"\n{key} = [160, 15, 12]\n"
        )
    };
    for (kind, key, severity) in [
        ("phong", "diffuse", Severity::Warning),
        ("phong", "specular", Severity::Warning),
        ("phong", "ambient", Severity::Warning),
        ("mirror", "reflectance", Severity::Error),
        ("glass", "tint", Severity::Error),
    ] {
        let found = diagnostic_for_bytes(scene(kind, key).as_bytes());
        assert_eq!(found.severity, severity, "{key}");
        assert!(
            found.place.as_ref().is_some_and(|place| place.label == "this looks like 0–255"),
            "{found:?}"
        );
        assert!(found.help.as_ref().is_some_and(|help| help.starts_with("write \"#a00f0c\"")), "{found:?}");
    }
    for (kind, key) in [("phong", "diffuse"), ("mirror", "reflectance")] {
        let found = diagnostic_for_bytes(scene(kind, key).replace("[160, 15, 12]", "160").as_bytes());
        assert!(found.help.as_ref().is_some_and(|help| help.starts_with("write \"#a0a0a0\"")), "{found:?}");
    }
    let text = scene("phong", "emission").replace("[160", "[16");
    assert!(!text.is_empty() && diagnostics_of(&text).is_empty(), "radiance may exceed 1");
    let text = scene("phong", "diffuse").replace("[160, 15, 12]", "[2, 0, 0]");
    let reported = diagnostics_of(&text);
    assert!(reported.len() == 1 && reported[0].severity == Severity::Warning, "{reported:?}");
    assert!(!reported[0].place.as_ref().is_some_and(|place| place.label.contains("255")));
}

#[test]
fn lists_in_other_syntax_get_a_suggestion() {
    let open = "`[` opened here is not closed";
    let brackets = "lists use square brackets: write [0, 3, 3]";
    let write = Some("write [0, 3, 3]");
    let close = Some("expected `]`");
    // Values for `position`, each with the expected message, column and help.
    for (value, message, column, help) in [
        ("(0, 3, 3)", brackets, 12, None),
        ("(0 3 3) # where", brackets, 12, None),
        ("{0, 3, 3}", brackets, 12, None),
        ("<0; 3; 3>", brackets, 12, None),
        ("vec3(0, 3, 3)", brackets, 12, None),
        ("[0; 3; 3]", "commas are missing: write [0, 3, 3]", 13, None),
        ("[0 3 3", open, 12, write),
        ("[0, 3, 3", open, 12, write),
        ("[0, 3, 3) # where", open, 12, write),
        ("[0, 3, \"3]\"", open, 12, close),
        ("[0, 3, 3 # ]", open, 12, write),
        ("[[0, 3], [3, 3", open, 21, Some("write [3, 3]")),
        ("[[0, 3], [3, 3]", open, 12, close),
        ("[\n[0, 3],\n[3, 3]", open, 12, close),
    ] {
        let camera = "[camera]\nlook_at = [0, 1, 0]\nposition = ";
        for rest in ["", "\n", "\nfov = 30\n", "\n\n[render]\nwidth = 3\n", "\n[[sphere]]\n"] {
            let reported = diagnostics_of(&format!("{camera}{value}{rest}"));
            let first = &reported[0];
            let place = first.place.as_ref().expect("a place");
            let found =
                (&*first.message, line_and_column(&place.source, place.span.start), first.help.as_deref());
            assert_eq!(found, (message, (3, column), help), "{value}{rest}: {reported:?}");
            let others = reported[1..].iter().filter(|one| one.message != "the scene has no shapes");
            assert_eq!(others.count(), 0, "{value}{rest}: {reported:?}");
        }
    }
}

/// All diagnostics for a scene.
fn diagnostics_of(text: &str) -> Vec<Diagnostic> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("scene.toml");
    fs::write(&path, text).expect("written");
    diagnostics(&path)
}

#[test]
fn unclosed_bracket_is_reported_first() {
    for rest in ["fov = 30\nup = [0, 1, 0]\n", "[render]\nwidth = 3\n", "", "[[sphere]]\nradius = 1\n"] {
        let reported = diagnostics_of(&format!("[camera]\nposition = [0, 1, 4]\nlook_at = [0, 1, 0\n{rest}"));
        assert_eq!(reported[0].message, "`[` opened here is not closed", "{rest:?}: {reported:?}");
        let place = reported[0].place.as_ref().expect("a place");
        assert_eq!(line_and_column(&place.source, place.span.start), (3, 11), "{rest:?}");
    }
}
