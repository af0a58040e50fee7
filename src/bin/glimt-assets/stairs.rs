//! Parts of the stair hall in `scenes/stairs.toml`. Units are meters. Treads and balusters are at the origin
//! and placed by the scene. Flights and rails are at their final positions.

use super::parts::{
    ball, beveled_box, hexahedron, join, round_bar_along_path, solid_of_revolution, translate_mesh,
};
use super::surface::PolygonMesh;
use super::vector::{Vector, add, sin_cos_turns};

/// Height and depth of a step, and width of a flight.
const RISE: f64 = 0.17;
const GO: f64 = 0.28;
const WIDTH: f64 = 1.1;

/// The open corner at the foot of the first flight, and the corner at the landing.
const FOOT: Vector = [-1.9, 0.0, 1.14];
const LANDING: Vector = [-1.9, 1.53, -1.1];
/// End of the second flight.
const GALLERY: Vector = [0.62, 3.23, -1.1];
const LEFT_WALL: f64 = -3.0;
const RIGHT_WALL: f64 = 3.0;
const BACK_WALL: f64 = -2.2;
const TREAD: f64 = 0.035;

/// All parts and their file names.
pub(crate) fn stair_meshes() -> Vec<(&'static str, PolygonMesh)> {
    vec![
        ("stairs/tread.ply", tread()),
        ("stairs/flight1.ply", first_flight()),
        ("stairs/flight2.ply", second_flight()),
        ("stairs/gallery.ply", gallery_floor()),
        ("stairs/baluster.ply", baluster()),
        ("stairs/newel.ply", newel_post()),
        ("stairs/rail1.ply", handrail(FOOT, LANDING)),
        ("stairs/rail2.ply", handrail(LANDING, GALLERY)),
        ("stairs/rail3.ply", handrail(GALLERY, [RIGHT_WALL, GALLERY[1], GALLERY[2]])),
        ("stairs/candle.ply", candle_bulb()),
        ("stairs/bowl.ply", wall_lamp()),
        ("stairs/shade.ply", lampshade()),
        ("stairs/stand.ply", table_lamp_foot()),
        ("stairs/chandelier.ply", chandelier()),
        ("stairs/door.ply", door()),
        ("stairs/frame.ply", picture_frame()),
        ("stairs/console.ply", console_table()),
    ]
}

/// A board whose nosing faces +z. One end extends past the open side of the flight.
fn tread() -> PolygonMesh {
    beveled_box([0.0, -TREAD, -GO], [WIDTH + 0.03, 0.0, 0.03], 0.008)
}

/// The steps up to the landing, and the landing itself, solid down to the floor.
fn first_flight() -> PolygonMesh {
    let step = |index: u32| {
        let (front, top) = (FOOT[2] - f64::from(index) * GO, f64::from(index + 1) * RISE - TREAD);
        sharp_block([LEFT_WALL, 0.0, front - GO], [FOOT[0], top, front])
    };
    let landing = sharp_block([LEFT_WALL, 0.0, BACK_WALL], [LANDING[0], LANDING[1], LANDING[2]]);
    join((0..8).map(step).chain([landing]))
}

/// The steps from the landing to the gallery, with a sloping soffit.
fn second_flight() -> PolygonMesh {
    let soffit = |x: f64| LANDING[1] - 0.14 + (x - LANDING[0]) * RISE / GO;
    join((0..9).map(|index| {
        let (from, to) = (LANDING[0] + f64::from(index) * GO, LANDING[0] + f64::from(index + 1) * GO);
        let top = LANDING[1] + f64::from(index + 1) * RISE - TREAD;
        let corner = |x: f64, y: f64, z: f64| [x, y, z];
        let (far, near) = (BACK_WALL, LANDING[2]);
        let (low, high) = (soffit(from), soffit(to));
        hexahedron([
            corner(from, low, far),
            corner(to, high, far),
            corner(to, high, near),
            corner(from, low, near),
            corner(from, top, far),
            corner(to, top, far),
            corner(to, top, near),
            corner(from, top, near),
        ])
    }))
}

/// The floor at the top, with a molding along its edge.
fn gallery_floor() -> PolygonMesh {
    let [x, y, z] = GALLERY;
    join([
        beveled_box([x, y - 0.25, BACK_WALL], [RIGHT_WALL, y, z], 0.004),
        beveled_box([x, y - 0.035, z], [RIGHT_WALL, y, z + 0.03], 0.008),
        beveled_box([x, y - 0.25, z], [RIGHT_WALL, y - 0.2, z + 0.02], 0.006),
    ])
}

/// A block with sharp edges.
fn sharp_block(from: Vector, to: Vector) -> PolygonMesh {
    let corner = |x: Vector, y: Vector, z: Vector| [x[0], y[1], z[2]];
    let floor = |y| [corner(from, y, from), corner(to, y, from), corner(to, y, to), corner(from, y, to)];
    let [a, b, c, d] = floor(from);
    let [e, f, g, h] = floor(to);
    hexahedron([a, b, c, d, e, f, g, h])
}

/// A turned post of height 1.05, with its foot sunk into the tread.
fn baluster() -> PolygonMesh {
    let outline = [
        [0.0, 0.0],
        [0.02, 0.0],
        [0.02, 0.2],
        [0.02, 0.2],
        [0.026, 0.22],
        [0.016, 0.25],
        [0.021, 0.33],
        [0.022, 0.4],
        [0.013, 0.62],
        [0.012, 0.78],
        [0.02, 0.8],
        [0.014, 0.83],
        [0.014, 1.05],
        [0.0, 1.05],
    ];
    solid_of_revolution(&outline, 8)
}

/// A square newel post topped with a ball.
fn newel_post() -> PolygonMesh {
    join([
        beveled_box([-0.05, 0.0, -0.05], [0.05, 1.12, 0.05], 0.008),
        beveled_box([-0.065, 1.12, -0.065], [0.065, 1.16, 0.065], 0.012),
        ball(2, [0.0, 1.205, 0.0], 0.055),
    ])
}

/// The handrail along the open side of a flight, above the nosings and slightly inside.
fn handrail(from: Vector, to: Vector) -> PolygonMesh {
    let above = if from[0] == to[0] { [-0.05, 1.0, 0.0] } else { [0.0, 1.0, -0.05] };
    round_bar_along_path(&[add(from, above), add(to, above)], 0.032, 12)
}

/// A flame-shaped bulb, 0.1 high.
fn candle_bulb() -> PolygonMesh {
    let outline =
        [[0.0, 0.0], [0.012, 0.004], [0.02, 0.02], [0.022, 0.036], [0.016, 0.058], [0.007, 0.08], [0.0, 0.1]];
    solid_of_revolution(&outline, 8)
}

/// A thick-walled wall lamp, open at the top.
fn wall_lamp() -> PolygonMesh {
    let outer = [[0.0, -0.09], [0.05, -0.085], [0.09, -0.06], [0.12, -0.02], [0.135, 0.03], [0.135, 0.03]];
    let inner =
        [[0.128, 0.03], [0.128, 0.03], [0.113, -0.018], [0.085, -0.055], [0.047, -0.078], [0.0, -0.082]];
    solid_of_revolution(&[outer, inner].concat(), 24)
}

/// A conical lampshade, open at both ends.
fn lampshade() -> PolygonMesh {
    let outline = [
        [0.14, 0.0],
        [0.14, 0.0],
        [0.09, 0.2],
        [0.09, 0.2],
        [0.088, 0.2],
        [0.088, 0.2],
        [0.138, 0.0],
        [0.138, 0.0],
        [0.14, 0.0],
    ];
    solid_of_revolution(&outline, 24)
}

/// The foot of a table lamp.
fn table_lamp_foot() -> PolygonMesh {
    let outline = [
        [0.0, 0.0],
        [0.07, 0.0],
        [0.07, 0.012],
        [0.03, 0.02],
        [0.015, 0.04],
        [0.04, 0.09],
        [0.055, 0.14],
        [0.04, 0.2],
        [0.012, 0.24],
        [0.008, 0.3],
        [0.0, 0.3],
    ];
    solid_of_revolution(&outline, 20)
}

/// A chandelier: a ring of five arms under a rod, without bulbs.
fn chandelier() -> PolygonMesh {
    let rod = round_bar_along_path(&[[0.0, 0.0, 0.0], [0.0, 2.0, 0.0]], 0.012, 8);
    let hub = solid_of_revolution(
        &[[0.0, -0.08], [0.03, -0.06], [0.05, 0.0], [0.03, 0.06], [0.012, 0.1], [0.0, 0.1]],
        16,
    );
    let arm = |index: u32| {
        let (sin, cos) = sin_cos_turns(f64::from(index) / 5.0);
        let path: Vec<Vector> = (0..=10)
            .map(|step| {
                let along = f64::from(step) / 10.0;
                let (bend, _) = sin_cos_turns(0.5 * along);
                [0.42 * along * cos, 0.06 * along - 0.12 * bend, 0.42 * along * sin]
            })
            .collect();
        let holder =
            [[0.0, 0.05], [0.02, 0.05], [0.05, 0.07], [0.05, 0.075], [0.02, 0.08], [0.02, 0.12], [0.0, 0.12]];
        join([
            round_bar_along_path(&path, 0.01, 6),
            translate_mesh(solid_of_revolution(&holder, 12), [0.42 * cos, 0.0, 0.42 * sin]),
        ])
    };
    join([rod, hub].into_iter().chain((0..5).map(arm)))
}

/// A 0.9 by 2.05 door with four panels and a frame, on a wall that faces +z.
fn door() -> PolygonMesh {
    let panel = |x: f64, y: f64, height: f64| beveled_box([x, y, 0.0], [x + 0.3, y + height, 0.035], 0.015);
    join([
        beveled_box([-0.45, 0.0, 0.0], [0.45, 2.05, 0.02], 0.004),
        panel(-0.36, 0.15, 0.7),
        panel(0.06, 0.15, 0.7),
        panel(-0.36, 1.02, 0.85),
        panel(0.06, 1.02, 0.85),
        beveled_box([-0.57, 0.0, 0.0], [-0.45, 2.05, 0.06], 0.01),
        beveled_box([0.45, 0.0, 0.0], [0.57, 2.05, 0.06], 0.01),
        beveled_box([-0.6, 2.05, 0.0], [0.6, 2.18, 0.07], 0.01),
    ])
}

/// A 1 by 1 picture frame on a wall that faces +z.
fn picture_frame() -> PolygonMesh {
    let (inside, outside) = (0.5, 0.57);
    join([
        beveled_box([-outside, -outside, 0.0], [outside, -inside, 0.03], 0.01),
        beveled_box([-outside, inside, 0.0], [outside, outside, 0.03], 0.01),
        beveled_box([-outside, -inside, 0.0], [-inside, inside, 0.03], 0.01),
        beveled_box([inside, -inside, 0.0], [outside, inside, 0.03], 0.01),
    ])
}

/// A narrow 1.1 by 0.36 table, 0.78 high.
fn console_table() -> PolygonMesh {
    let leg = |x: f64, z: f64| {
        let outline = [[0.0, 0.0], [0.015, 0.0], [0.02, 0.3], [0.024, 0.6], [0.024, 0.7], [0.0, 0.7]];
        translate_mesh(solid_of_revolution(&outline, 10), [x, 0.0, z])
    };
    join([
        beveled_box([-0.55, 0.75, -0.18], [0.55, 0.78, 0.18], 0.008),
        beveled_box([-0.5, 0.65, -0.14], [0.5, 0.75, 0.14], 0.004),
        leg(-0.47, -0.11),
        leg(0.47, -0.11),
        leg(-0.47, 0.11),
        leg(0.47, 0.11),
    ])
}
