//! A room, its materials and an orbiting camera that faces into the room.

use std::fmt::Write;

use super::vector::{Vector, add, cross, scale, sin_cos_turns, unit};

/// The room's half width, full height, and half depth.
const ROOM: Vector = [1.3, 2.0, 1.2];

struct ObjWriter {
    text: String,
    vertices: u32,
    quads: u32,
}

impl ObjWriter {
    /// Adds a quad that faces u × v. `repeat` is the number of texture repetitions along each edge.
    fn write_quad(&mut self, corner: Vector, u: Vector, v: Vector, repeat: [f64; 2]) {
        let points = [corner, add(corner, u), add(add(corner, u), v), add(corner, v)];
        for [x, y, z] in points {
            let _ = writeln!(self.text, "v {x:.4} {y:.4} {z:.4}");
        }
        for (s, t) in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
            let _ = writeln!(self.text, "vt {} {}", s * repeat[0], t * repeat[1]);
        }
        let [x, y, z] = unit(cross(u, v)).map(|component| component + 0.0);
        let _ = writeln!(self.text, "vn {x:.4} {y:.4} {z:.4}");
        self.quads += 1;
        self.text.push('f');
        for vertex in self.vertices + 1..=self.vertices + 4 {
            let _ = write!(self.text, " {vertex}/{vertex}/{}", self.quads);
        }
        self.text.push('\n');
        self.vertices += 4;
    }

    fn start_object(&mut self, object: &str, material: &str) {
        let _ = writeln!(self.text, "o {object}\nusemtl {material}");
    }

    /// Adds a box on the floor, rotated about y.
    fn write_block_on_floor(&mut self, center: [f64; 2], half: Vector, turns: f64) {
        let (sin, cos) = sin_cos_turns(turns);
        let right = [cos, 0.0, -sin];
        let front = [sin, 0.0, cos];
        let up = [0.0, 2.0 * half[1], 0.0];
        let middle = [center[0], 0.0, center[1]];
        let corner = |x: f64, z: f64| add(middle, add(scale(right, x * half[0]), scale(front, z * half[2])));
        let (wide, deep) = (scale(right, 2.0 * half[0]), scale(front, 2.0 * half[2]));
        self.write_quad(corner(-1.0, 1.0), wide, up, [1.0, 1.0]);
        self.write_quad(corner(1.0, 1.0), scale(deep, -1.0), up, [1.0, 1.0]);
        self.write_quad(corner(1.0, -1.0), scale(wide, -1.0), up, [1.0, 1.0]);
        self.write_quad(corner(-1.0, -1.0), deep, up, [1.0, 1.0]);
        self.write_quad(add(corner(-1.0, 1.0), up), wide, scale(deep, -1.0), [1.0, 1.0]);
    }
}

/// Floor, ceiling, three walls, three blocks, and a light.
pub(crate) fn room_obj() -> Vec<u8> {
    let [x, height, z] = ROOM;
    let (width, depth) = (2.0 * x, 2.0 * z);
    let text = "# A room that is open to the front. Made by glimt-assets.\nmtllib room.mtl\n".to_owned();
    let mut room = ObjWriter { text, vertices: 0, quads: 0 };
    room.start_object("floor", "planks");
    room.write_quad([-x, 0.0, z], [width, 0.0, 0.0], [0.0, 0.0, -depth], [2.0, 2.0]);
    room.start_object("ceiling", "plaster");
    room.write_quad([-x, height, -z], [width, 0.0, 0.0], [0.0, 0.0, depth], [1.0, 1.0]);
    room.start_object("back_wall", "plaster");
    room.write_quad([-x, 0.0, -z], [width, 0.0, 0.0], [0.0, height, 0.0], [1.0, 1.0]);
    room.start_object("left_wall", "teal");
    room.write_quad([-x, 0.0, z], [0.0, 0.0, -depth], [0.0, height, 0.0], [1.0, 1.0]);
    room.start_object("right_wall", "ochre");
    room.write_quad([x, 0.0, -z], [0.0, 0.0, depth], [0.0, height, 0.0], [1.0, 1.0]);
    room.start_object("plinth", "plaster");
    room.write_block_on_floor([-0.55, -0.45], [0.28, 0.62, 0.28], 0.06);
    room.start_object("chest", "lacquer");
    room.write_block_on_floor([0.5, -0.1], [0.36, 0.24, 0.28], -0.07);
    room.start_object("step", "tiles");
    room.write_block_on_floor([0.5, -0.1], [0.5, 0.06, 0.42], -0.07);
    room.start_object("lamp", "lamp");
    room.write_quad([-0.35, height - 0.02, -0.3], [0.7, 0.0, 0.0], [0.0, 0.0, 0.6], [1.0, 1.0]);
    room.text.into_bytes()
}

/// The room's materials.
pub(crate) fn room_mtl() -> Vec<u8> {
    let text = "\
# Materials of room.obj. Made by glimt-assets.
newmtl plaster
Ka 0.76 0.74 0.70
Kd 0.76 0.74 0.70

newmtl planks
Kd 1 1 1
Ks 0.20 0.20 0.20
Ns 40
map_Kd textures/planks.png

newmtl tiles
Kd 1 1 1
map_Kd textures/tiles.ppm

newmtl teal
Ka 0.10 0.42 0.44
Kd 0.10 0.42 0.44

newmtl ochre
Ka 0.72 0.44 0.12
Kd 0.72 0.44 0.12

newmtl lacquer
Ka 0.50 0.05 0.04
Kd 0.50 0.05 0.04
Ks 0.60 0.60 0.60
Ns 90

newmtl lamp
Kd 0.80 0.80 0.80
Ke 9.0 8.4 7.4
";
    text.as_bytes().to_vec()
}

/// A camera that looks through the open front from slightly above and to the left.
pub(crate) fn camera_in_orbiter_format() -> Vec<u8> {
    "c 0.0 0.95 0.0\np 0.05 0.02\nr 5.0 11.0\ns 4.6 2.0\nf 38.0 640.0 480.0\n".as_bytes().to_vec()
}
