//! `[render]`.

use std::path::PathBuf;

use super::super::description::{Accel, Integrator, MOST_SCATTERINGS, PixelFilter, Render, Shadows, Tonemap};
use super::context::Issue;
use super::limits::Limits;
use super::table::Table;
use crate::math::Vec3;

const MAX_SIDE: i128 = 65_536;
const MAX_PIXELS: u64 = 1 << 30;
const MAX_U32: i128 = u32::MAX as i128;

/// Endings of pictures that can be written.
pub(super) const PICTURES: [&str; 6] = ["png", "exr", "ppm", "hdr", "jpg", "jpeg"];

/// The values of a scene that says nothing.
const DEFAULT: Render = Render {
    width: 640,
    height: 480,
    samples: 64,
    error: 0.0,
    shadow_samples: 1,
    max_depth: 8,
    integrator: Integrator::Whitted,
    shadows: Shadows::Soft,
    clamp: 0.0,
    ambient: Vec3::ZERO,
    background: Vec3::ZERO,
    filter: PixelFilter::Box,
    exposure: 0.0,
    tonemap: Tonemap::None,
    accel: Accel::Bvh,
    seed: 0,
};

/// The settings, and where the picture goes if the scene says so.
pub(super) fn read(root: &Table<'_>) -> (Option<Render>, Option<PathBuf>) {
    let Some(table) = root.table("render") else { return (Some(DEFAULT), None) };
    let key = |name| table.optional(name);
    let render = Render {
        width: key("width").whole(1..=MAX_SIDE).unwrap_or(DEFAULT.width),
        height: key("height").whole(1..=MAX_SIDE).unwrap_or(DEFAULT.height),
        samples: key("samples").whole(1..=MAX_U32).unwrap_or(DEFAULT.samples),
        error: key("error").number32(Limits::AtLeast(0.0)).unwrap_or(DEFAULT.error),
        shadow_samples: key("shadow_samples").whole(1..=4096).unwrap_or(DEFAULT.shadow_samples),
        max_depth: key("max_depth").whole(0..=i128::from(MOST_SCATTERINGS)).unwrap_or(DEFAULT.max_depth),
        integrator: key("integrator").choice().unwrap_or(DEFAULT.integrator),
        shadows: key("shadows").choice().unwrap_or(DEFAULT.shadows),
        clamp: key("clamp").number32(Limits::AtLeast(0.0)).unwrap_or(DEFAULT.clamp),
        ambient: key("ambient").color().unwrap_or(DEFAULT.ambient),
        background: key("background").color().unwrap_or(DEFAULT.background),
        filter: key("filter").choice().unwrap_or(DEFAULT.filter),
        exposure: key("exposure").number32(Limits::Between(-100.0, 100.0)).unwrap_or(DEFAULT.exposure),
        tonemap: key("tonemap").choice().unwrap_or(DEFAULT.tonemap),
        accel: key("accel").choice().unwrap_or(DEFAULT.accel),
        seed: key("seed").whole(0..=MAX_U32).unwrap_or(DEFAULT.seed),
    };
    let output = output(&table);
    check_size(&table, &render);
    table.finish();
    (Some(render), output)
}

fn output(table: &Table<'_>) -> Option<PathBuf> {
    let key = table.optional("output");
    let text = key.text("the path of a picture, such as \"picture.png\"")?;
    key.has_ending(text, &PICTURES, &["webp"]).then(|| table.context.resolve(text))
}

fn check_size(table: &Table<'_>, render: &Render) {
    let Render { width, height, .. } = *render;
    let spans = || table.optional("width").span().or(table.optional("height").span());
    if u64::from(width) * u64::from(height) > MAX_PIXELS {
        let issue =
            Issue::error(spans().unwrap_or_default(), format!("{width} × {height} pixels are too many"))
                .help(format!("a picture has at most {MAX_PIXELS} pixels"));
        table.context.report(issue);
    }
}
