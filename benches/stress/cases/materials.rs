//! Glass with weak and strong refraction, wide and narrow highlights.

use super::{CAMERA, CaseSet, SceneFiles, StressRow, furnace, head, signs};

pub(super) fn rows(_: CaseSet) -> Vec<StressRow> {
    let ball = |ior: &str| {
        format!(
            "[materials.g]\ntype = \"glass\"\nior = {ior}\n[[sphere]]\ncenter = [0, 0, -4]\nradius = 1\nmaterial = \"g\"\n"
        )
    };
    let clear = |ior: &str| (signs("", CAMERA, &ball(ior)), signs("", CAMERA, ""));
    let white = |ior: &str| (furnace(64, CAMERA, &ball(ior)), furnace(64, CAMERA, &ball("1.5")));
    vec![
        StressRow::matching("ball with IOR 1 vs. no ball", vec![clear("1")], 1e-3),
        StressRow::matching("ball with IOR 1.000001 vs. no ball", vec![clear("1.000001")], 1e-3),
        StressRow::mean("ball with IOR 3 under uniform light", white("3"), 1.0, 1e-3).timed(),
        StressRow::mean("ball with IOR 1 under uniform light", white("1"), 1.0, 1e-3).timed(),
        StressRow::mean("ball with IOR 1.000001 under uniform light", white("1.000001"), 1.0, 1e-3).timed(),
        wide_highlight(),
        narrow_highlight("whitted"),
        narrow_highlight("path"),
    ]
}

/// With exponent 0, the Phong lobe is 2/2π everywhere on the side of the reflected ray. Compared with a
/// diffuse surface lit from the camera.
fn wide_highlight() -> StressRow {
    let picture = |material: &str| {
        let floor = format!(
            "[materials.m]\n{material}\n[[quad]]\ncorner = [-3, -3, -5]\nu = [6, 0, 0]\nv = [0, 6, 0]\nmaterial = \"m\"\n"
        );
        SceneFiles::new(head(64, "") + CAMERA + &floor + "[[light]]\nposition = [0, 0, 0]\nintensity = 9\n")
    };
    let pair = (picture("diffuse = 0\nspecular = 0.6\nshininess = 0"), picture("diffuse = 0.6"));
    StressRow::matching("Phong exponent 0 vs. diffuse", vec![pair], 1e-5).timed()
}

/// With exponent 1e5, reflection is within 0.3° of the mirror direction. Compared with a mirror under uniform
/// light; the results differ by a cosine that is nearly 1 here.
fn narrow_highlight(integrator: &str) -> StressRow {
    let picture = |material: &str| {
        let wall = format!(
            "[materials.m]\n{material}\n[[quad]]\ncorner = [-3, -3, -5]\nu = [6, 0, 0]\nv = [0, 6, 0]\nmaterial = \"m\"\n"
        );
        let render = head(64, &format!("integrator = \"{integrator}\""));
        SceneFiles::new(render + CAMERA + "fov = 2\n[environment]\ncolor = 1\n" + &wall)
    };
    let pair = (
        picture("diffuse = 0\nspecular = 0.9\nshininess = 1e5"),
        picture("type = \"mirror\"\nreflectance = 0.9"),
    );
    StressRow::mean(format!("Phong exponent 1e5 vs. mirror, {integrator}"), pair, 0.9, 1e-3).timed()
}
