//! Millions of rays a second through the tree of a mesh, one thread: primary rays in the order of pixels, one
//! cosine-distributed bounce, any hit towards a point light; with what building took and holds.
//!
//! `cargo bench --bench rays` runs on generated meshes, `cargo bench --bench rays -- a.ply b.obj` on files.

#![allow(clippy::print_stdout)]

use std::path::Path;
use std::time::Instant;

use glimt::accel::WideBvh;
use glimt::accel::wide_bvh::Instructions;
use glimt::assets::mesh;
use glimt::control::{CancelToken, unwatched};
use glimt::geometry::mesh::TriangleMesh;
use glimt::geometry::ray::offset_origin;
use glimt::geometry::{Aabb, Ray};
use glimt::math::frame::Frame;
use glimt::math::{Vec2, Vec3};
use glimt::sampling::{PixelSampler, Purpose, warp};

/// Pixels of a side: a million rays.
const SIDE: u32 = 1000;

/// Each figure is the best of this many runs.
const RUNS: usize = 3;

fn main() {
    let files: Vec<String> =
        std::env::args().skip(1).filter(|argument| !argument.starts_with("--")).collect();
    println!(
        "{:<24} {:>9} {:>8} {:>8}  {:<9} {:>8} {:>8} {:>8}",
        "mesh", "triangles", "build s", "MB", "by", "primary", "diffuse", "shadow"
    );
    for file in &files {
        match mesh::load(Path::new(file), &unwatched, &CancelToken::new()) {
            Ok(loaded) => measure(file, &loaded.mesh),
            Err(error) => println!("{file}: {error}"),
        }
    }
    if files.is_empty() {
        for (name, rings) in [("ball 10k", 71), ("ball 100k", 224), ("ball 1M", 708)] {
            measure(name, &rippled_ball(rings));
        }
    }
}

/// A closed ball with bumps: `rings` rings of twice as many squares of two triangles, less the poles' halves.
fn rippled_ball(rings: u32) -> TriangleMesh {
    let columns = rings;
    let point = |ring: u32, column: u32| {
        let height = std::f32::consts::PI * ring as f32 / rings as f32;
        let around = 2.0 * std::f32::consts::PI * (column % columns) as f32 / columns as f32;
        let radius = 1.0 + 0.05 * (9.0 * height).sin() * (11.0 * around).cos();
        Vec3::new(height.sin() * around.cos(), height.cos(), height.sin() * around.sin()) * radius
    };
    let index = |ring: u32, column: u32| ring * columns + column % columns;
    let mut mesh = TriangleMesh::default();
    for ring in 0..=rings {
        mesh.positions.extend((0..columns).map(|column| point(ring, column)));
    }
    for ring in 0..rings {
        for column in 0..columns {
            let (a, b) = (index(ring, column), index(ring, column + 1));
            let (c, d) = (index(ring + 1, column), index(ring + 1, column + 1));
            mesh.triangles.extend([[a, b, c], [b, d, c]]);
        }
    }
    mesh
}

fn measure(name: &str, mesh: &TriangleMesh) {
    let count = mesh.triangles.len() as u32;
    let begin = Instant::now();
    let Ok(tree) = WideBvh::build(count, |id| mesh.corners(id), &CancelToken::new()) else { return };
    let build_seconds = begin.elapsed().as_secs_f64();
    let (primary, diffuse, shadow) = rays(&tree, mesh);
    for instructions in Instructions::ALL {
        let tree = tree.clone().with(instructions);
        let closest = |rays: &[Ray]| rate(rays, |ray| tree.closest(ray).is_some());
        println!(
            "{name:<24} {count:>9} {build_seconds:>8.3} {:>8.1}  {:<9} {:>8.2} {:>8.2} {:>8.2}",
            tree.memory_bytes() as f64 / 1e6,
            format!("{instructions:?}"),
            closest(&primary),
            closest(&diffuse),
            rate(&shadow, |ray| tree.any(ray, None)),
        );
    }
}

/// Primary rays from outside, and from their hits a bounce and a segment to a light.
fn rays(tree: &WideBvh, mesh: &TriangleMesh) -> (Vec<Ray>, Vec<Ray>, Vec<Ray>) {
    let Aabb { min, max } = tree.bounds();
    let (center, size) = ((min + max) * 0.5, (max - min).length());
    let eye = center + Vec3::new(0.4, 0.3, 1.0).normalize() * size;
    let frame = Frame::from_normal((center - eye).normalize());
    let light = center + Vec3::new(-1.0, 2.0, 1.0) * size;
    let (mut primary, mut diffuse, mut shadow) = (Vec::new(), Vec::new(), Vec::new());
    for pixel in 0..SIDE * SIDE {
        let place = Vec2::new((pixel % SIDE) as f32, (pixel / SIDE) as f32) / SIDE as f32 - Vec2::splat(0.5);
        let ray = Ray::new(eye, (frame.n + frame.s * place.x + frame.t * place.y).normalize());
        primary.push(ray);
        let Some(hit) = tree.closest(&ray) else { continue };
        let [a, b, c] = mesh.corners(hit.primitive);
        let normal = (b - a).cross(c - a).normalize();
        let normal = if normal.dot(ray.direction) < 0.0 { normal } else { -normal };
        let point = a * (1.0 - hit.u - hit.v) + b * hit.u + c * hit.v;
        let origin = offset_origin(point, point.abs() * 1e-6 + Vec3::splat(size * 1e-7), normal, normal);
        let disk = warp::disk(PixelSampler::new(0, pixel, 0, 0).get2(Purpose::CAMERA));
        let up = (1.0 - disk.length_squared()).max(0.0).sqrt();
        diffuse.push(Ray::new(origin, Frame::from_normal(normal).to_world(disk.extend(up))));
        shadow.push(Ray::segment(origin, light));
    }
    (primary, diffuse, shadow)
}

/// Millions of rays a second.
fn rate(rays: &[Ray], mut hits: impl FnMut(&Ray) -> bool) -> f64 {
    let mut best = f64::INFINITY;
    for _ in 0..RUNS {
        let begin = Instant::now();
        let count = rays.iter().filter(|ray| hits(ray)).count();
        std::hint::black_box(count);
        best = best.min(begin.elapsed().as_secs_f64());
    }
    rays.len() as f64 / best / 1e6
}
