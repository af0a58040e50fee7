//! Slivers, needles, coplanar layers and a million spheres.

use std::fmt::Write as _;

use glimt::math::random::TestRandom;

use super::frames::mesh;
use super::{CAMERA, CaseSet, SceneFiles, StressRow, head};

pub(super) fn rows(extent: CaseSet) -> Vec<StressRow> {
    let mut rows = vec![slivers(), coplanar("[[quad]]"), coplanar("mesh"), needles("bvh"), needles("kdtree")];
    let counts: &[u32] = if extent == CaseSet::Short { &[1000] } else { &[1000, 1_000_000] };
    for &count in counts {
        rows.push(overlapping(count, "bvh"));
        rows.push(nested(count.min(MAX_NESTED), "bvh"));
        if extent == CaseSet::Long {
            rows.push(nested(count.min(MAX_NESTED), "kdtree"));
        }
    }
    rows
}

/// Maximum number of nested spheres.
const MAX_NESTED: u32 = 1_000_000;

const LAMP: &str = "[[light]]\nposition = [1, 2, 0]\nintensity = 9\n";

fn scene_with_mesh(text: String, render: &str) -> SceneFiles {
    let scene = head(16, render)
        + CAMERA
        + "[materials]\nm = { diffuse = 0.6 }\n[[mesh]]\nfile = \"a.obj\"\nmaterial = \"m\"\nsmooth = false\n"
        + LAMP;
    SceneFiles::new(scene).with("a.obj", text)
}

fn point(x: f64, y: f64, z: f64) -> String {
    format!("{x:?} {y:?} {z:?}")
}

/// A wall of 32,768 triangles: full-height slivers with an aspect ratio of 1 : 12,288, compared with 128 ×
/// 128 squares.
fn slivers() -> StressRow {
    let wall = |columns: usize, lines: usize| {
        let at = |column: usize, line: usize| {
            point(8.0 * column as f64 / columns as f64 - 4.0, 6.0 * line as f64 / lines as f64 - 3.0, -5.0)
        };
        let points: Vec<String> =
            (0..=lines).flat_map(|line| (0..=columns).map(move |column| at(column, line))).collect();
        let squares =
            (0..lines).flat_map(|line| (0..columns).map(move |column| line * (columns + 1) + column));
        let faces =
            squares.flat_map(|a| [[a, a + 1, a + columns + 2], [a, a + columns + 2, a + columns + 1]]);
        scene_with_mesh(mesh("obj", &points, &faces.collect::<Vec<_>>()), "")
    };
    let pairs = vec![(wall(16_384, 1), wall(128, 128))];
    StressRow::matching("wall of 32,768 slivers with aspect ratio 1 : 12,000", pairs, 1e-3).timed()
}

/// Sixteen coplanar surfaces with the same material, compared with a single surface.
fn coplanar(kind: &str) -> StressRow {
    let layers = |count: usize| match kind {
        "mesh" => {
            let points = [(-4.0, -3.0), (4.0, -3.0), (4.0, 3.0), (-4.0, 3.0)].map(|(x, y)| point(x, y, -5.0));
            scene_with_mesh(mesh("obj", &points, &[[0, 1, 2], [0, 2, 3]].repeat(count)), "")
        }
        _ => {
            let layer = "[[quad]]\ncorner = [-4, -3, -5]\nu = [8, 0, 0]\nv = [0, 6, 0]\nmaterial = \"m\"\n";
            SceneFiles::new(
                head(16, "") + CAMERA + "[materials]\nm = { diffuse = 0.6 }\n" + LAMP + &layer.repeat(count),
            )
        }
    };
    let what = if kind == "mesh" { "mesh layers" } else { "quads" };
    StressRow::matching(format!("16 coplanar {what} vs. one"), vec![(layers(16), layers(1))], 0.0)
}

/// Needles as long as the scene and a thousandth as thick. Compares the two acceleration structures.
fn needles(accel: &str) -> StressRow {
    let mut random = TestRandom::new(5);
    let (mut points, mut faces) = (Vec::new(), Vec::new());
    for number in 0..20_000 {
        let mut inside = || [random.signed() * 3.0, random.signed() * 2.0, random.signed() * 2.0 - 6.0];
        let (a, b) = (inside(), inside());
        points.extend([a, b, [b[0] + 0.003, b[1] + 0.002, b[2]]].map(|[x, y, z]| point(x, y, z)));
        faces.push([3 * number, 3 * number + 1, 3 * number + 2]);
    }
    let text = mesh("obj", &points, &faces);
    let by = |accel: &str| scene_with_mesh(text.clone(), &format!("accel = \"{accel}\""));
    let other = if accel == "bvh" { "kdtree" } else { "bvh" };
    StressRow::matching(
        format!("20,000 needles with aspect ratio 1 : 1000, {accel} vs. {other}"),
        vec![(by(accel), by(other))],
        0.0,
    )
}

/// Spheres at pseudo-random positions, compared with spheres so small that hardly any overlap.
fn overlapping(count: u32, accel: &str) -> StressRow {
    let spheres = |radius: f64, accel: &str| {
        let mut random = TestRandom::new(9);
        let mut scene =
            head(1, &format!("accel = \"{accel}\"")) + CAMERA + "[materials]\nm = { diffuse = 0.6 }\n" + LAMP;
        for _ in 0..count {
            let (x, y, z) = (random.signed() * 4.0, random.signed() * 3.0, random.signed() * 3.0 - 8.0);
            let _ = write!(
                scene,
                "[[sphere]]\ncenter = [{x:.6}, {y:.6}, {z:.6}]\nradius = {radius:?}\nmaterial = \"m\"\n"
            );
        }
        SceneFiles::new(scene)
    };
    // Twice the mean spacing, so that every point is inside about 30 spheres.
    let spacing = (8.0 * 6.0 * 6.0 / f64::from(count)).cbrt();
    let (wide, narrow) = (2.0 * spacing, 0.25 * spacing);
    StressRow {
        figure: super::super::row::RowMeasure::Difference(0.0),
        ..StressRow::matching(
            format!("{count} overlapping spheres vs. mostly separate spheres"),
            vec![(spheres(wide, accel), spheres(narrow, accel))],
            1.0,
        )
    }
    .timed()
}

/// Concentric spheres, compared with only the outermost sphere.
fn nested(count: u32, accel: &str) -> StressRow {
    let spheres = |count: u32| {
        let (width, height) = if count > 10_000 { (4, 3) } else { (64, 48) };
        let render = head(1, &format!("accel = \"{accel}\""));
        let size = format!("width = {width}\nheight = {height}");
        let mut scene = render.replace("width = 64\nheight = 48", &size)
            + CAMERA
            + "[materials]\nm = { diffuse = 0.6 }\n"
            + LAMP;
        for number in 0..count {
            let radius = 1.5 * (1.0 - 0.9 * f64::from(number) / f64::from(count));
            let _ = write!(scene, "[[sphere]]\ncenter = [0, 0, -5]\nradius = {radius:?}\nmaterial = \"m\"\n");
        }
        scene
    };
    let outermost = |scene: String| {
        let mut parts = scene.match_indices("[[sphere]]").skip(1);
        let end = parts.next().map_or(scene.len(), |(at, _)| at);
        scene[..end].to_owned()
    };
    let all = spheres(count);
    let pairs = vec![(SceneFiles::new(all.clone()), SceneFiles::new(outermost(all)))];
    StressRow::matching(format!("{count} nested spheres vs. only the outermost, {accel}"), pairs, 0.0)
}
