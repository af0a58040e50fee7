//! The textures, which all tile seamlessly. u points right and v points up, both in [0, 1).

use super::noise::{fractal_noise, lattice_random, value_noise};
use super::vector::{Vector, mix, scale, sin_cos_turns, smoothstep, unit};

/// Width and height of the larger textures.
const SIDE: u32 = 512;

/// Number of brick rows, and bricks per row.
const COURSES: f64 = 8.0;
const BRICKS: f64 = 4.0;

/// Renders a texture to sRGB bytes, starting with the top row.
fn render_srgb(side: u32, color: impl Fn(f64, f64) -> Vector) -> Vec<u8> {
    let middle = |index: u32| (f64::from(index) + 0.5) / f64::from(side);
    (0..side)
        .flat_map(|y| (0..side).map(move |x| (x, y)))
        .flat_map(|(x, y)| color(middle(x), 1.0 - middle(y)).map(|value| (value * 255.0 + 0.5) as u8))
        .collect()
}

fn encode_png(side: u32, pixels: &[u8]) -> Vec<u8> {
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, side, side);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::High);
    let written = encoder.write_header().and_then(|mut writer| writer.write_image_data(pixels));
    written.expect("encoding a fixed-size image in memory cannot fail");
    file
}

/// Noise, quantized because invisible detail would only make the file larger.
fn quantized_noise(u: f64, v: f64, seed: u64) -> f64 {
    let fine = fractal_noise([u * 32.0, v * 32.0, 0.5], 3, 32, seed);
    (fine * 24.0).round() / 24.0
}

/// Index of the brick at (u, v), and a measure of distance from the mortar (0 in the joint, 1 on the brick).
fn brick_index_and_mask(u: f64, v: f64) -> ([i64; 2], f64) {
    let course = (v * COURSES).floor();
    let shift = if course % 2.0 == 0.0 { 0.0 } else { 0.5 };
    let along = (u * BRICKS + shift).rem_euclid(BRICKS);
    let (x, y) = (along.fract() * COURSES / BRICKS, (v * COURSES).fract());
    let wide = COURSES / BRICKS;
    let wobble = 0.03 * (value_noise([u * 24.0, v * 24.0, 0.5], 24, 5) - 0.5);
    let border = x.min(wide - x).min(y).min(1.0 - y) + wobble;
    ([along.floor() as i64, course as i64], smoothstep(0.045, 0.11, border))
}

/// Red bricks in running bond.
pub(crate) fn bricks() -> Vec<u8> {
    let pixels = render_srgb(SIDE, |u, v| {
        let ([x, y], inside) = brick_index_and_mask(u, v);
        let tint = lattice_random([x, y, 0], 17);
        let clay = mix([0.52, 0.21, 0.15], [0.72, 0.37, 0.25], tint);
        let clay = scale(clay, 0.82 + 0.3 * quantized_noise(u, v, 31));
        let mortar = scale([0.70, 0.67, 0.62], 0.85 + 0.2 * quantized_noise(u, v, 47));
        mix(mortar, clay, inside).map(|value| value.min(1.0))
    });
    encode_png(SIDE, &pixels)
}

/// Height of the bricks above the joints, relative to the texture's width.
fn brick_height(u: f64, v: f64) -> f64 {
    let (_, inside) = brick_index_and_mask(u, v);
    0.006 * inside + 0.002 * fractal_noise([u * 16.0, v * 16.0, 0.5], 3, 16, 31)
}

/// Normal map of the bricks: red along u, green along v, blue out of the wall.
pub(crate) fn brick_normal_map() -> Vec<u8> {
    let step = 1.0 / f64::from(SIDE);
    let pixels = render_srgb(SIDE, |u, v| {
        let slope = |du: f64, dv: f64| {
            let at =
                |sign: f64| brick_height((u + sign * du).rem_euclid(1.0), (v + sign * dv).rem_euclid(1.0));
            (at(1.0) - at(-1.0)) / (2.0 * step)
        };
        let normal = unit([-slope(step, 0.0), -slope(0.0, step), 1.0]);
        normal.map(|component| ((component * 0.5 + 0.5) * 96.0).round() / 96.0)
    });
    encode_png(SIDE, &pixels)
}

/// An eight by eight checkerboard whose lower left square is dark.
pub(crate) fn checker() -> Vec<u8> {
    let pixels = render_srgb(64, |u, v| {
        let dark = ((u * 8.0).floor() + (v * 8.0).floor()) % 2.0 == 0.0;
        if dark { [0.12, 0.13, 0.16] } else { [0.93, 0.92, 0.88] }
    });
    encode_png(64, &pixels)
}

/// Planks along u with grain and butt joints.
pub(crate) fn planks() -> Vec<u8> {
    let pixels = render_srgb(SIDE, |u, v| {
        let board = (v * 8.0).floor();
        let joint = lattice_random([board as i64, 1, 0], 3);
        let along = (u + joint).rem_euclid(1.0);
        let tint = lattice_random([board as i64, 2, 0], 3);
        let stretched = value_noise([u * 6.0, v * 96.0, board + 0.5], 0, 9);
        let edge = value_noise([0.0, v * 96.0, board + 0.5], 0, 9);
        // Blend toward the value at the left edge so that the grain tiles.
        let blend = smoothstep(0.9, 1.0, u);
        let grain = ((stretched * (1.0 - blend) + edge * blend) * 24.0).round() / 24.0;
        let wood = mix([0.46, 0.30, 0.17], [0.70, 0.50, 0.31], 0.6 * tint + 0.4 * grain);
        let across = (v * 8.0).fract();
        let gap = across.min(1.0 - across).min(along.min(1.0 - along) * 8.0);
        scale(wood, 0.35 + 0.65 * smoothstep(0.0, 0.04, gap))
    });
    encode_png(SIDE, &pixels)
}

/// White marble with dark veins.
pub(crate) fn marble() -> Vec<u8> {
    let pixels = render_srgb(SIDE, |u, v| {
        let cloud = fractal_noise([u * 4.0, v * 4.0, 0.5], 5, 4, 61);
        let (wave, _) = sin_cos_turns(u + v + 1.4 * cloud);
        let vein = 1.0 - wave.abs();
        let vein = vein * vein * vein * vein;
        let color = mix([0.93, 0.92, 0.90], [0.36, 0.38, 0.42], 0.8 * vein + 0.25 * (cloud - 0.4).max(0.0));
        color.map(|value| (value * 64.0).round() / 64.0)
    });
    encode_png(SIDE, &pixels)
}

/// Four by four glazed tiles as a PPM file. The file contains a comment, like files written by paint
/// programs.
pub(crate) fn tiles_ppm() -> Vec<u8> {
    let side = 64;
    let mut file = format!("P6\n# made by glimt-assets\n{side} {side}\n255\n").into_bytes();
    file.extend(render_srgb(side, |u, v| {
        let (x, y) = ((u * 4.0).fract(), (v * 4.0).fract());
        let border = x.min(1.0 - x).min(y).min(1.0 - y);
        let (dx, dy) = (x - 0.5, y - 0.5);
        let ring = (dx * dx + dy * dy).sqrt();
        let glaze = mix([0.20, 0.36, 0.62], [0.90, 0.90, 0.86], smoothstep(0.02, 0.07, (ring - 0.3).abs()));
        mix([0.55, 0.53, 0.50], glaze, smoothstep(0.02, 0.08, border))
    }));
    file
}
