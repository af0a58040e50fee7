//! A toy racing car: the control mesh of its body, which the scene subdivides.

use super::surface::PolygonMesh;
use super::vector::{Vector, sin_cos_turns};

/// Number of vertices around the body.
const RING: u32 = 12;

/// A cross section of the body: an ellipse with a flat bottom.
struct CrossSection {
    /// Position along the car, from the tail to the nose.
    x: f64,
    half_width: f64,
    /// Height of the center above the ground.
    height: f64,
    half_height: f64,
    /// Whether the top is lowered to form the cockpit.
    is_cockpit: bool,
}

const fn new_cross_section(x: f64, half_width: f64, height: f64, half_height: f64) -> CrossSection {
    CrossSection { x, half_width, height, half_height, is_cockpit: false }
}

const SECTIONS: [CrossSection; 11] = [
    new_cross_section(-1.02, 0.05, 0.47, 0.06),
    new_cross_section(-0.95, 0.13, 0.47, 0.13),
    new_cross_section(-0.70, 0.25, 0.46, 0.23),
    new_cross_section(-0.36, 0.335, 0.46, 0.31),
    CrossSection { is_cockpit: true, ..new_cross_section(-0.30, 0.34, 0.46, 0.30) },
    CrossSection { is_cockpit: true, ..new_cross_section(0.02, 0.35, 0.45, 0.27) },
    new_cross_section(0.08, 0.35, 0.45, 0.26),
    new_cross_section(0.50, 0.31, 0.42, 0.22),
    new_cross_section(0.85, 0.22, 0.39, 0.16),
    new_cross_section(1.00, 0.14, 0.38, 0.11),
    new_cross_section(1.04, 0.08, 0.38, 0.06),
];

impl CrossSection {
    /// A vertex of the section, counted from the top toward +z.
    fn vertex_position(&self, number: u32) -> Vector {
        let (sin, cos) = sin_cos_turns(f64::from(number) / f64::from(RING));
        let lowered = match number {
            0 if self.is_cockpit => 0.3,
            1 | 11 if self.is_cockpit => 0.26,
            _ => 0.0,
        };
        [self.x, self.height + self.half_height * cos.max(-0.75) - lowered, self.half_width * sin]
    }
}

/// The body, a closed triangle mesh that is symmetric about the plane z = 0.
pub(crate) fn car_body() -> PolygonMesh {
    let mut surface = PolygonMesh::default();
    for section in &SECTIONS {
        surface.positions.extend((0..RING).map(|number| section.vertex_position(number)));
    }
    for first in (0..SECTIONS.len() as u32 - 1).map(|ring| ring * RING) {
        for number in 0..RING {
            let (a, b) = (first + number, first + (number + 1) % RING);
            let (d, c) = (a + RING, b + RING);
            // The diagonals of the two sides mirror each other.
            surface.faces.extend(match number < RING / 2 {
                true => [vec![a, d, b], vec![b, d, c]],
                false => [vec![a, d, c], vec![a, c, b]],
            });
        }
    }
    let [tail, .., nose] = &SECTIONS;
    for (end, first, overhang) in [(tail, 0, -0.01), (nose, (SECTIONS.len() as u32 - 1) * RING, 0.01)] {
        let center = surface.positions.len() as u32;
        surface.positions.push([end.x + overhang, end.height, 0.0]);
        for number in 0..RING {
            let (a, b) = (first + number, first + (number + 1) % RING);
            surface.faces.push(if overhang < 0.0 { vec![center, a, b] } else { vec![center, b, a] });
        }
    }
    surface
}
