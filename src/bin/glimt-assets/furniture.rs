//! Furniture for `scenes/furnished.toml` and `scenes/ajar.toml`. Units are meters. Each piece stands at the
//! origin and faces +z.

use super::parts::{ball, beveled_box, join, round_bar_along_path, solid_of_revolution, translate_mesh};
use super::surface::PolygonMesh;
use super::vector::{Vector, sin_cos_turns};

/// All pieces and their file names.
pub(crate) fn furniture_meshes() -> Vec<(&'static str, PolygonMesh)> {
    vec![
        ("furniture/cushion.ply", cushion()),
        ("furniture/armrest.ply", beveled_box([-0.1, 0.1, -0.42], [0.1, 0.62, 0.42], 0.045)),
        ("furniture/base.ply", beveled_box([-0.5, 0.1, -0.42], [0.5, 0.3, 0.4], 0.02)),
        ("furniture/foot.ply", furniture_foot()),
        ("furniture/leg.ply", table_leg()),
        ("furniture/board.ply", beveled_box([-0.5, 0.0, -0.5], [0.5, 0.03, 0.5], 0.006)),
        ("furniture/plate.ply", round_glass_tabletop()),
        ("furniture/shelf.ply", shelf()),
        ("furniture/cover.ply", book_cover()),
        ("furniture/pages.ply", book_pages()),
        ("furniture/chair.ply", chair()),
        ("furniture/stand.ply", floor_lamp_stand()),
        ("furniture/shade.ply", lampshade()),
        ("furniture/decanter.ply", decanter()),
        ("furniture/tumbler.ply", drinking_glass()),
        ("furniture/bowl.ply", bowl()),
        ("furniture/pot.ply", flower_pot()),
        ("furniture/leaf.ply", plant_leaf()),
        ("furniture/curtain.ply", curtain()),
        ("furniture/window.ply", window_frame()),
        ("furniture/frame.ply", picture_frame()),
        ("furniture/door.ply", door()),
        ("furniture/jamb.ply", door_frame()),
        ("furniture/bed.ply", bed()),
    ]
}

/// A 1 × 0.2 × 1 cushion, thinner toward its edges.
fn cushion() -> PolygonMesh {
    let (rings, sides) = (9, 32);
    let outline = |ring: u32| {
        let (sin, cos) = sin_cos_turns(0.5 * f64::from(ring) / f64::from(rings - 1) - 0.25);
        (0.1 + 0.1 * sin.signum() * sin.abs().sqrt(), cos.max(0.0).sqrt())
    };
    let mut surface = PolygonMesh::default();
    for ring in 0..rings {
        let (height, reach) = outline(ring);
        let count = if ring == 0 || ring == rings - 1 { 1 } else { sides };
        surface.positions.extend((0..count).map(|side| {
            let (sin, cos) = sin_cos_turns(f64::from(side) / f64::from(sides));
            // A square with rounded corners.
            let round = |along: f64| 0.5 * along.signum() * along.abs().sqrt();
            [reach * round(cos), height, reach * round(sin)]
        }));
    }
    let vertex = |ring: u32, side: u32| match ring {
        0 => 0,
        _ if ring == rings - 1 => 1 + (rings - 2) * sides,
        _ => 1 + (ring - 1) * sides + side % sides,
    };
    for (ring, side) in (0..rings - 1).flat_map(|ring| (0..sides).map(move |side| (ring, side))) {
        let mut face = vec![
            vertex(ring, side),
            vertex(ring + 1, side),
            vertex(ring + 1, side + 1),
            vertex(ring, side + 1),
        ];
        face.dedup();
        if face.first() == face.last() {
            face.pop();
        }
        surface.faces.push(face);
    }
    surface
}

fn furniture_foot() -> PolygonMesh {
    solid_of_revolution(&[[0.0, 0.0], [0.018, 0.0], [0.018, 0.0], [0.03, 0.1], [0.0, 0.1]], 10)
}

/// A table leg of height 1, scaled by the scene.
fn table_leg() -> PolygonMesh {
    solid_of_revolution(&[[0.0, 0.0], [0.016, 0.0], [0.016, 0.0], [0.026, 1.0], [0.026, 1.0], [0.0, 1.0]], 12)
}

/// A round glass plate of radius 0.5 with a rounded edge.
fn round_glass_tabletop() -> PolygonMesh {
    let outline =
        [[0.0, 0.0], [0.494, 0.0], [0.498, 0.002], [0.5, 0.006], [0.498, 0.01], [0.494, 0.012], [0.0, 0.012]];
    solid_of_revolution(&outline, 64)
}

/// A 1.2 by 2.0 shelf, 0.3 deep, with four boards between its sides.
fn shelf() -> PolygonMesh {
    let side = |x: f64| beveled_box([x, 0.0, -0.15], [x + 0.03, 2.0, 0.15], 0.003);
    let boards = (0..5).map(|index| {
        let y = 0.06 + 0.47 * f64::from(index);
        beveled_box([-0.57, y, -0.148], [0.57, y + 0.028, 0.145], 0.003)
    });
    join(
        [side(-0.6), side(0.57), beveled_box([-0.57, 0.05, -0.15], [0.57, 1.98, -0.14], 0.002)]
            .into_iter()
            .chain(boards),
    )
}

/// The cover of a 1 by 1 by 1 book, scaled by the scene. The spine is at +z.
fn book_cover() -> PolygonMesh {
    join([
        beveled_box([-0.5, 0.0, -0.5], [-0.42, 1.0, 0.5], 0.01),
        beveled_box([0.42, 0.0, -0.5], [0.5, 1.0, 0.5], 0.01),
        beveled_box([-0.43, 0.0, 0.44], [0.43, 1.0, 0.5], 0.01),
    ])
}

/// The pages inside a book's cover.
fn book_pages() -> PolygonMesh {
    beveled_box([-0.425, 0.01, -0.48], [0.425, 0.985, 0.445], 0.005)
}

/// A 0.44 by 0.92 by 0.46 wooden chair.
fn chair() -> PolygonMesh {
    let post = |x: f64| round_bar_along_path(&[[x, 0.0, -0.26], [x, 0.45, -0.2], [x, 0.92, -0.26]], 0.018, 8);
    let rung = |from: Vector, to: Vector| round_bar_along_path(&[from, to], 0.01, 6);
    let slat = |y: f64, z: f64| beveled_box([-0.2, y, z - 0.01], [0.2, y + 0.07, z + 0.01], 0.004);
    join([
        beveled_box([-0.22, 0.44, -0.22], [0.22, 0.475, 0.23], 0.01),
        round_bar_along_path(&[[-0.19, 0.0, 0.19], [-0.19, 0.45, 0.19]], 0.018, 8),
        round_bar_along_path(&[[0.19, 0.0, 0.19], [0.19, 0.45, 0.19]], 0.018, 8),
        post(-0.19),
        post(0.19),
        rung([-0.19, 0.2, 0.19], [-0.19, 0.2, -0.22]),
        rung([0.19, 0.2, 0.19], [0.19, 0.2, -0.22]),
        rung([-0.19, 0.25, 0.0], [0.19, 0.25, 0.0]),
        slat(0.6, -0.22),
        slat(0.72, -0.235),
        slat(0.84, -0.25),
    ])
}

/// The stand of a floor lamp, 1.5 high.
fn floor_lamp_stand() -> PolygonMesh {
    let outline = [
        [0.0, 0.0],
        [0.14, 0.0],
        [0.14, 0.0],
        [0.14, 0.015],
        [0.02, 0.03],
        [0.011, 0.05],
        [0.011, 1.5],
        [0.0, 1.5],
    ];
    solid_of_revolution(&outline, 24)
}

/// A conical lampshade, open at both ends, 0.26 high.
fn lampshade() -> PolygonMesh {
    let outline = [
        [0.22, 0.0],
        [0.22, 0.0],
        [0.14, 0.26],
        [0.14, 0.26],
        [0.137, 0.26],
        [0.137, 0.26],
        [0.217, 0.0],
        [0.217, 0.0],
        [0.22, 0.0],
    ];
    solid_of_revolution(&outline, 32)
}

/// A hollow glass decanter with a round belly, 0.27 high.
fn decanter() -> PolygonMesh {
    let outside = [
        [0.0, 0.0],
        [0.07, 0.0],
        [0.085, 0.008],
        [0.095, 0.03],
        [0.095, 0.06],
        [0.08, 0.1],
        [0.05, 0.135],
        [0.028, 0.165],
        [0.023, 0.2],
        [0.025, 0.235],
        [0.036, 0.262],
        [0.034, 0.27],
    ];
    let inside = [
        [0.03, 0.262],
        [0.02, 0.235],
        [0.018, 0.2],
        [0.023, 0.166],
        [0.044, 0.132],
        [0.074, 0.097],
        [0.089, 0.06],
        [0.089, 0.032],
        [0.078, 0.016],
        [0.06, 0.012],
        [0.0, 0.014],
    ];
    solid_of_revolution(&[&outside[..], &inside[..]].concat(), 40)
}

/// A drinking glass, 0.095 high.
fn drinking_glass() -> PolygonMesh {
    let outside = [[0.0, 0.0], [0.03, 0.0], [0.034, 0.004], [0.036, 0.02], [0.04, 0.092], [0.039, 0.095]];
    let inside = [[0.0375, 0.092], [0.0335, 0.024], [0.03, 0.016], [0.0, 0.014]];
    solid_of_revolution(&[&outside[..], &inside[..]].concat(), 32)
}

/// A wide bowl, 0.09 high.
fn bowl() -> PolygonMesh {
    let outside =
        [[0.0, 0.0], [0.05, 0.0], [0.05, 0.0], [0.055, 0.01], [0.11, 0.04], [0.145, 0.085], [0.142, 0.09]];
    let inside = [[0.137, 0.085], [0.104, 0.044], [0.05, 0.018], [0.0, 0.014]];
    solid_of_revolution(&[&outside[..], &inside[..]].concat(), 32)
}

/// A flower pot with soil.
fn flower_pot() -> PolygonMesh {
    let outline = [
        [0.0, 0.0],
        [0.12, 0.0],
        [0.12, 0.0],
        [0.17, 0.3],
        [0.17, 0.3],
        [0.155, 0.3],
        [0.155, 0.3],
        [0.15, 0.26],
        [0.15, 0.26],
        [0.0, 0.27],
    ];
    solid_of_revolution(&outline, 28)
}

/// A two-sided leaf of length 1 along z, bent downward.
fn plant_leaf() -> PolygonMesh {
    let steps = 8;
    let place = |step: u32, across: f64| {
        let along = f64::from(step) / f64::from(steps);
        let half = 0.16 * (4.0 * along * (1.0 - along)).max(0.0).sqrt() * (1.0 - 0.35 * along);
        [half * across, 0.75 * along - 0.62 * along * along + 0.05 * across.abs(), along]
    };
    let mut surface = PolygonMesh::default();
    for step in 0..=steps {
        surface.positions.extend([-1.0, 0.0, 1.0].map(|across| place(step, across)));
    }
    for step in 0..steps {
        let base = 3 * step;
        for column in 0..2 {
            surface.faces.push(vec![base + column, base + column + 3, base + column + 4, base + column + 1]);
        }
    }
    surface
}

/// A pleated curtain, 0.5 wide and 1 high, in the plane z = 0.
fn curtain() -> PolygonMesh {
    let columns = 48;
    let mut surface = PolygonMesh::default();
    for column in 0..=columns {
        let along = f64::from(column) / f64::from(columns);
        let (fold, _) = sin_cos_turns(6.0 * along);
        let (uneven, _) = sin_cos_turns(1.7 * along + 0.1);
        for (height, depth) in [(0.0, 0.04), (0.5, 0.034), (1.0, 0.022)] {
            surface.positions.push([0.5 * along, height, depth * (fold + 0.4 * uneven)]);
        }
    }
    for column in 0..columns {
        for row in 0..2 {
            let base = 3 * column + row;
            surface.faces.push(vec![base, base + 3, base + 4, base + 1]);
        }
    }
    surface
}

/// A 1.8 by 1.6 window frame with two bars, centered on its sill.
fn window_frame() -> PolygonMesh {
    let upright = |x: f64, half: f64| beveled_box([x - half, 0.0, -0.04], [x + half, 1.6, 0.04], 0.006);
    join([
        upright(-0.87, 0.03),
        upright(0.87, 0.03),
        upright(0.0, 0.025),
        beveled_box([-0.9, 0.0, -0.04], [0.9, 0.06, 0.04], 0.006),
        beveled_box([-0.9, 1.54, -0.04], [0.9, 1.6, 0.04], 0.006),
        beveled_box([-0.9, 1.05, -0.025], [0.9, 1.09, 0.025], 0.006),
        beveled_box([-0.96, -0.04, -0.04], [0.96, 0.0, 0.16], 0.01),
    ])
}

/// A 1 by 1 picture frame on a wall that faces +z.
fn picture_frame() -> PolygonMesh {
    let (inside, outside) = (0.5, 0.55);
    join([
        beveled_box([-outside, -outside, 0.0], [outside, -inside, 0.03], 0.008),
        beveled_box([-outside, inside, 0.0], [outside, outside, 0.03], 0.008),
        beveled_box([-outside, -inside, 0.0], [-inside, inside, 0.03], 0.008),
        beveled_box([inside, -inside, 0.0], [outside, inside, 0.03], 0.008),
    ])
}

/// A 0.9 by 2.05 door with panels on both sides. The hinges are at the origin.
fn door() -> PolygonMesh {
    let panel =
        |x: f64, y: f64, height: f64| beveled_box([x, y, -0.005], [x + 0.3, y + height, 0.045], 0.012);
    let knob = |z: f64| ball(2, [0.83, 1.02, z], 0.028);
    join([
        beveled_box([0.0, 0.0, 0.0], [0.9, 2.05, 0.04], 0.004),
        panel(0.1, 0.15, 0.7),
        panel(0.5, 0.15, 0.7),
        panel(0.1, 1.05, 0.85),
        panel(0.5, 1.05, 0.85),
        knob(0.08),
        knob(-0.04),
        round_bar_along_path(&[[0.83, 1.02, -0.04], [0.83, 1.02, 0.08]], 0.01, 8),
    ])
}

/// The door frame, for a wall 0.12 thick behind the origin.
fn door_frame() -> PolygonMesh {
    join([
        beveled_box([-0.09, 0.0, -0.14], [0.0, 2.06, 0.02], 0.006),
        beveled_box([0.9, 0.0, -0.14], [0.99, 2.06, 0.02], 0.006),
        beveled_box([-0.09, 2.05, -0.14], [0.99, 2.15, 0.025], 0.006),
    ])
}

/// A 1.0 by 2.0 bed without cushions. The head is at −z.
fn bed() -> PolygonMesh {
    let post = |x: f64, z: f64, height: f64| {
        beveled_box([x - 0.03, 0.0, z - 0.03], [x + 0.03, height, z + 0.03], 0.008)
    };
    join([
        post(-0.5, -1.0, 0.95),
        post(0.5, -1.0, 0.95),
        post(-0.5, 1.0, 0.5),
        post(0.5, 1.0, 0.5),
        beveled_box([-0.47, 0.35, -1.02], [0.47, 0.88, -0.98], 0.008),
        beveled_box([-0.47, 0.25, 0.98], [0.47, 0.45, 1.02], 0.008),
        beveled_box([-0.52, 0.24, -0.97], [-0.48, 0.34, 0.97], 0.006),
        beveled_box([0.48, 0.24, -0.97], [0.52, 0.34, 0.97], 0.006),
        translate_mesh(beveled_box([-0.48, 0.0, -0.97], [0.48, 0.2, 0.97], 0.05), [0.0, 0.3, 0.0]),
    ])
}
