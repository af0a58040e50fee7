//! A shrub whose leaves are alpha-textured squares.

use std::f64::consts::SQRT_2;

use super::noise::{lattice_random, value_noise};
use super::surface::PolygonMesh;
use super::vector::{Vector, add, cross, dot, mix, scale, sin_cos_turns, smoothstep, subtract, unit};

/// Width and height of the leaf texture.
const SIDE: u32 = 256;

/// Number of leaves.
const LEAVES: i64 = 700;

/// An upright leaf with alpha, as an sRGB PNG.
pub(crate) fn leaf_png() -> Vec<u8> {
    let mut pixels = Vec::new();
    for row in 0..SIDE {
        for column in 0..SIDE {
            let at = |index: u32| (f64::from(index) + 0.5) / f64::from(SIDE);
            let [red, green, blue] = leaf_texture_color(at(column), 1.0 - at(row));
            let alpha = leaf_coverage(at(column), 1.0 - at(row));
            pixels.extend([red, green, blue, alpha].map(|part| (part * 255.0 + 0.5) as u8));
        }
    }
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, SIDE, SIDE);
    encoder.set_color(png::ColorType::Rgba);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::High);
    let written = encoder.write_header().and_then(|mut writer| writer.write_image_data(&pixels));
    written.expect("encoding a fixed-size image in memory cannot fail");
    file
}

/// Half the leaf's width at height `v`.
fn leaf_half_width(v: f64) -> f64 {
    let t = ((v - 0.1) / 0.88).clamp(0.0, 1.0);
    0.62 * t.sqrt() * (1.0 - t)
}

/// Coverage of a point by the leaf or its stalk, with a soft border about a pixel wide.
fn leaf_coverage(u: f64, v: f64) -> f64 {
    let (side, teeth) = ((u - 0.5).abs(), 0.012 * ((v * 26.0).fract() - 0.5));
    let blade = smoothstep(-0.004, 0.004, leaf_half_width(v - 0.01) + teeth - side);
    let stalk = if v < 0.3 { smoothstep(-0.004, 0.004, 0.012 - side) } else { 0.0 };
    let is_inside = (0.1..0.98).contains(&v);
    stalk.max(if is_inside { blade } else { 0.0 })
}

/// Green with light veins. The color extends past the border so that no other color bleeds in.
fn leaf_texture_color(u: f64, v: f64) -> Vector {
    let side = (u - 0.5).abs();
    let along = (v * 9.0 - side * 7.0).rem_euclid(1.0);
    let vein = (1.0 - smoothstep(0.0, 0.10, along.min(1.0 - along))).max(1.0 - smoothstep(0.006, 0.02, side));
    let cloud = (value_noise([u * 12.0, v * 12.0, 0.5], 12, 71) * 12.0).round() / 12.0;
    let green = mix([0.20, 0.42, 0.13], [0.34, 0.56, 0.20], cloud);
    mix(green, [0.60, 0.72, 0.38], 0.6 * vein)
}

/// Leaves around a ball. Each leaf is a square whose stalk starts at the ball.
pub(crate) fn shrub() -> PolygonMesh {
    let mut surface = PolygonMesh::default();
    for number in 0..LEAVES {
        let chance = |place: i64| lattice_random([number, place, 0], 83);
        // Choose where on the ball the stalk starts, and the direction of the leaf.
        let height = 2.0 * chance(0) - 1.0;
        let (sin, cos) = sin_cos_turns(chance(1));
        let flat = (1.0 - height * height).sqrt();
        let outwards = [flat * cos, height, flat * sin];
        let start = scale(outwards, 0.45 + 0.5 * chance(2));
        let sway = [chance(3) - 0.5, 0.2 - 0.9 * chance(4), chance(5) - 0.5];
        let up = unit(add(outwards, sway));
        // Rotate the leaf about its stalk so that it mostly faces the sky.
        let face = add([0.0, 1.0, 0.0], scale([chance(6) - 0.5, 0.0, chance(7) - 0.5], SQRT_2));
        let normal = unit(subtract(face, scale(up, dot(face, up))));
        let across = cross(up, normal);
        let size = 0.28 + 0.16 * chance(8);
        let first = surface.positions.len() as u32;
        for (u, v) in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
            let place = add(scale(across, (u - 0.5) * size), scale(up, v * size));
            surface.positions.push(add(start, place));
            surface.normals.push(normal);
            surface.uvs.push([u, v]);
        }
        surface.faces.push((first..first + 4).collect());
    }
    surface
}
