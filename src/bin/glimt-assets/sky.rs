//! An evening sky as an equirectangular radiance map.

use super::noise::fractal_noise;
use super::vector::{Vector, add, dot, mix, scale, sin_cos_turns, smoothstep, unit};

const WIDTH: u32 = 256;
const HEIGHT: u32 = 128;

/// The sky as a Radiance HDR file, uncompressed because noise does not compress well.
pub(crate) fn evening_sky_hdr() -> Vec<u8> {
    let mut file =
        format!("#?RADIANCE\nSOFTWARE=glimt-assets\nFORMAT=32-bit_rle_rgbe\n\n-Y {HEIGHT} +X {WIDTH}\n")
            .into_bytes();
    for (row, column) in (0..HEIGHT).flat_map(|row| (0..WIDTH).map(move |column| (row, column))) {
        file.extend(encode_rgbe(sky_radiance(pixel_direction(column, row))));
    }
    file
}

/// Direction of a pixel. The center of the map faces −z, and the point a quarter of the width to its right
/// faces +x.
fn pixel_direction(column: u32, row: u32) -> Vector {
    let (sin, cos) = sin_cos_turns((f64::from(column) + 0.5) / f64::from(WIDTH) - 0.5);
    let (across, y) = sin_cos_turns((f64::from(row) + 0.5) / f64::from(HEIGHT) * 0.5);
    [across * sin, y, -across * cos]
}

fn sky_radiance(d: Vector) -> Vector {
    let sun = unit([0.62, 0.36, -0.70]);
    let to_sun = dot(d, sun).max(0.0);
    let haze = to_sun.powi(6);
    if d[1] < 0.0 {
        let far = smoothstep(-0.25, 0.0, d[1]);
        return mix([0.05, 0.045, 0.04], mix([0.16, 0.15, 0.15], [0.55, 0.38, 0.24], haze), far);
    }
    let height = 1.0 - (1.0 - d[1]).powi(4);
    let low = mix([0.62, 0.62, 0.66], [1.7, 1.05, 0.55], haze);
    let sky = mix(low, [0.09, 0.19, 0.46], height);
    // Clouds are on a plane high above and thin out toward the horizon.
    let reach = 1.0 / (d[1] + 0.12);
    let cover = fractal_noise([d[0] * reach * 1.6 + 9.0, d[2] * reach * 1.6 + 5.0, 0.5], 5, 0, 23);
    let thick = smoothstep(0.50, 0.68, cover) * smoothstep(0.02, 0.2, d[1]);
    let cloud = mix([0.62, 0.60, 0.64], [2.6, 1.7, 1.0], to_sun.powi(12));
    let clear = mix(sky, cloud, 0.85 * thick);
    let glow = scale([9.0, 5.5, 2.4], to_sun.powi(400));
    let disc = scale([640.0, 430.0, 230.0], smoothstep(0.9988, 0.9992, to_sun));
    add(clear, scale(add(glow, disc), 1.0 - 0.5 * thick))
}

/// RGBE encoding: three mantissas and a shared exponent (Ward, *Real Pixels*, Graphics Gems II, 1991).
fn encode_rgbe(color: Vector) -> [u8; 4] {
    let brightest = color[0].max(color[1]).max(color[2]);
    let (_, exponent) = libm::frexp(brightest);
    let mantissa = |component: f64| (libm::ldexp(component, 8 - exponent)).floor().min(255.0) as u8;
    [mantissa(color[0]), mantissa(color[1]), mantissa(color[2]), (exponent + 128) as u8]
}
