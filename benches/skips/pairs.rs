//! Pairs of scenes with and without a feature that has no effect.

use glimt::pipeline::protocol::reasons;

use super::row::SceneFiles;

/// A scene without and with a feature that has no effect.
pub(crate) struct FeaturePair {
    pub(crate) name: &'static str,
    pub(crate) off: SceneFiles,
    pub(crate) on: SceneFiles,
    /// A stage that `on` must skip, and part of the reason in the report.
    pub(crate) skipped: Option<(&'static str, &'static str)>,
}

/// A small room with placeholders for `RENDER` keys, `CAMERA` keys and other elements.
const ROOM: &str = r#"
[render]
width = WIDTH
height = HEIGHT
samples = SAMPLES
RENDER
[camera]
position = [0, 1.2, 4]
look_at = [0, 0.6, 0]
CAMERA
[materials]
floor = { diffuse = 0.6 }
ball = { diffuse = [0.7, 0.3, 0.2] BALL }
[[quad]]
corner = [-4, 0, 4]
u = [8, 0, 0]
v = [0, 0, -8]
material = "floor"
[[sphere]]
center = [0, 0.6, 0]
radius = 0.6
material = "ball"
[[box]]
center = [1.4, 0.4, -0.5]
size = [0.7, 0.8, 0.7]
rotate = [0, 30, 0]
material = "ball"
"#;

const POINT: &str = "[[light]]\nposition = [1, 3, 2]\nintensity = 20\n";

const LAMP: &str = "[materials.lamp]\nemission = 5\n[[quad]]\ncorner = [-0.5, 3, -0.5]\nu = [1, 0, 0]\nv = [0, 0, 1]\nmaterial = \"lamp\"\n";

const IMAGE: &str = "P3 2 2 255 90 120 200 20 30 40 255 250 200 70 70 80";

/// Returns all pairs, rendered with this image size and number of samples per pixel.
pub(crate) fn pairs([width, height, samples]: [u32; 3]) -> Vec<FeaturePair> {
    let scene = |render: &str, camera: &str, ball: &str, rest: &str| {
        let size = [("WIDTH", width), ("HEIGHT", height), ("SAMPLES", samples)];
        let sized =
            size.iter().fold(ROOM.to_owned(), |text, (key, value)| text.replace(key, &value.to_string()));
        let filled = sized.replace("RENDER", render).replace("CAMERA", camera).replace("BALL", ball);
        SceneFiles::new(filled + rest).with("a.ppm", IMAGE.to_owned())
    };
    let plain = || scene("", "", "", POINT);
    let lit = || scene("", "", "", LAMP);
    let path = || scene("integrator = \"path\"", "", "", LAMP);
    let with = |rest: &str| scene("", "", "", &(POINT.to_owned() + rest));
    let lens = |options| scene("", "aperture = 0.1", "", POINT).with_options(options);
    let pair = |name, off, on| FeaturePair { name, off, on, skipped: None };
    let texture = "[textures.t]\nfile = \"a.ppm\"\n";
    let unused = "[textures.t]\nfile = \"a.ppm\"\nfilter = \"mipmap\"\n[materials.unused]\ndiffuse = { texture = \"t\" }\nnormal_map = \"t\"\n";
    vec![
        FeaturePair {
            skipped: Some(("photons", reasons::NOT_USED_BY_PATH)),
            ..pair("photons with path", path(), path().with_options("--photons on"))
        },
        FeaturePair {
            skipped: Some(("photons", reasons::TOO_FEW_BOUNCES)),
            ..pair(
                "photons, direct light only",
                scene("max_depth = 1", "", "", POINT),
                scene("max_depth = 1", "", "", POINT).with_options("--photons on"),
            )
        },
        FeaturePair {
            skipped: Some(("photons", reasons::PHOTONS_OFF)),
            ..pair("photons not enabled", plain(), with("[photons]\ncount = 4000000\nradius = 0.5\n"))
        },
        pair(
            "depth of field without an aperture",
            plain().with_options("--dof off"),
            plain().with_options("--dof on"),
        ),
        pair("aperture with depth of field off", plain(), lens("--dof off")),
        pair(
            "soft shadows from point lights",
            plain().with_options("--shadows hard"),
            plain().with_options("--shadows soft"),
        ),
        pair("shadow samples for point lights", plain(), scene("shadow_samples = 8", "", "", POINT)),
        pair(
            "shadows with path",
            path().with_options("--shadows off"),
            path().with_options("--shadows soft"),
        ),
        FeaturePair {
            skipped: Some(("textures", reasons::NO_TEXTURES)),
            ..pair("unused texture", plain(), with(texture))
        },
        FeaturePair {
            skipped: Some(("textures", reasons::NO_TEXTURES)),
            ..pair("unused textured material", plain(), with(unused))
        },
        pair(
            "unused glass and mirror",
            plain(),
            with("[materials.g]\ntype = \"glass\"\ntint = 0.5\n[materials.r]\ntype = \"mirror\"\n"),
        ),
        pair("highlight strength 0", plain(), scene("", "", ", specular = 0, shininess = 1e5", POINT)),
        pair("emission 0", plain(), scene("", "", ", emission = 0", POINT)),
        pair("adaptive sampling without an error target", lit(), lit().with_options("--error 0")),
        pair("clamp 0", lit(), scene("clamp = 0", "", "", LAMP)),
        pair("ambient light with path", path(), scene("integrator = \"path\"\nambient = 0.5", "", "", LAMP)),
        pair("light with intensity 0", plain(), with("[[light]]\nposition = [2, 3, 2]\nintensity = 0\n")),
        pair("a black sky", plain(), with("[environment]\ncolor = 0\n")),
    ]
}
