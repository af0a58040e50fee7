//! Lights with extreme sizes and powers.

use std::f64::consts::PI;

use super::super::row::RowMeasure;
use super::{CAMERA, CaseSet, SceneFiles, StressRow, head};

pub(super) fn rows(_: CaseSet) -> Vec<StressRow> {
    let mut rows = vec![tiny("sphere"), tiny("quad"), tiny("disk"), huge()];
    for (name, light) in POWERS {
        for times in [1e-9, 1e9] {
            rows.push(
                StressRow {
                    figure: RowMeasure::Difference(1.0 / times),
                    ..StressRow::matching(
                        format!("{name} with {times:e} times the power"),
                        vec![(powered(light, times), powered(light, 1.0))],
                        1e-6,
                    )
                }
                .timed(),
            );
        }
    }
    rows
}

const POWERS: [(&str, &str); 6] = [
    ("point light", "[[light]]\nposition = [1, 2, -3]\nintensity = POWER\n"),
    ("spot", "[[light]]\ntype = \"spot\"\nposition = [1, 2, -3]\nlook_at = [0, -1, -5]\nintensity = POWER\n"),
    ("sun", "[[light]]\ntype = \"directional\"\ndirection = [0, -1, -1]\nangle = 1\nirradiance = POWER\n"),
    ("sky", "[environment]\ncolor = POWER\n"),
    (
        "quad light",
        "[materials.lamp]\nemission = POWER\n[[quad]]\ncorner = [-1, 2, -5]\nu = [2, 0, 0]\nv = [0, 0, 1]\nmaterial = \"lamp\"\n",
    ),
    (
        "sphere light",
        "[materials.lamp]\nemission = POWER\n[[sphere]]\ncenter = [1, 1, -5]\nradius = 0.3\nmaterial = \"lamp\"\n",
    ),
];

/// A floor and a ball.
const FLOOR_AND_BALL: &str = r#"
[materials.floor]
diffuse = 0.6
[[quad]]
corner = [-4, -1, 0]
u = [8, 0, 0]
v = [0, 0, -9]
material = "floor"
[[sphere]]
center = [0, -0.4, -5]
radius = 0.6
material = "floor"
"#;

fn powered(light: &str, power: f64) -> SceneFiles {
    SceneFiles::new(head(64, "") + CAMERA + FLOOR_AND_BALL + &light.replace("POWER", &format!("{power:?}")))
}

/// A light of size 1e-9 above the scene, compared with a point light with intensity radiance × projected
/// area. The lit area is directly below the light, so that the cosine at a flat light is nearly 1.
fn tiny(kind: &str) -> StressRow {
    let size = 1e-9;
    // The radiance must stay finite.
    let (radiance, area) = (1e16, if kind == "quad" { size * size } else { PI * size * size });
    let lamp = match kind {
        "sphere" => format!("[[sphere]]\ncenter = [0, 2, -5]\nradius = {size:?}\nmaterial = \"lamp\"\n"),
        "quad" => format!(
            "[[quad]]\ncorner = [0, 2, -5]\nu = [{size:?}, 0, 0]\nv = [0, 0, {size:?}]\nmaterial = \"lamp\"\n"
        ),
        _ => format!(
            "[[disk]]\ncenter = [0, 2, -5]\nnormal = [0, -1, 0]\nradius = {size:?}\nmaterial = \"lamp\"\n"
        ),
    };
    let receiver = "[materials.floor]\ndiffuse = 0.6\n[[quad]]\ncorner = [-0.04, 0, -4.96]\nu = [0.08, 0, 0]\nv = [0, 0, -0.08]\nmaterial = \"floor\"\n";
    let camera = "[camera]\nposition = [0, 1, -4.9]\nlook_at = [0, 0, -5]\nfov = 3\n";
    let picture = |light: String| SceneFiles::new(head(64, "") + camera + receiver + &light);
    let case = picture(format!("[materials.lamp]\ndiffuse = 0\nemission = {radiance:?}\n{lamp}"));
    let twin = picture(format!("[[light]]\nposition = [0, 2, -5]\nintensity = {:?}\n", radiance * area));
    StressRow::matching(format!("{kind} light of size 1e-9 vs. point light"), vec![(case, twin)], 1e-3)
        .timed()
}

/// A quad of size 2e9 fills the hemisphere above the floor, so E = πL, and a floor with reflectance 0.6 has
/// radiance 0.6 L.
fn huge() -> StressRow {
    let picture = |size: f64| {
        let lamp = format!(
            "[materials.lamp]\ndiffuse = 0\nemission = 1\n[[quad]]\ncorner = [{:?}, 2, {:?}]\nu = [{size:?}, 0, 0]\nv = [0, 0, {size:?}]\nmaterial = \"lamp\"\n",
            -0.5 * size,
            -0.5 * size
        );
        let floor = "[materials.floor]\ndiffuse = 0.6\n[[quad]]\ncorner = [-9, -1, 9]\nu = [18, 0, 0]\nv = [0, 0, -18]\nmaterial = \"floor\"\n";
        let camera = "[camera]\nposition = [0, 0, 0]\nlook_at = [0, -1, -1]\n";
        SceneFiles::new(head(64, "") + camera + floor + &lamp)
    };
    StressRow::mean("floor under a quad light of size 2e9", (picture(2e9), picture(2e3)), 0.6, 1e-2).timed()
}
