//! Test data: meshes and rays, generated or read from files.

use std::io;
use std::path::Path;

use glimt::accel::WideBvh;
use glimt::assets::mesh;
use glimt::control::{CancelToken, ignore_progress};
use glimt::geometry::mesh::TriangleMesh;
use glimt::geometry::ray::offset_origin;
use glimt::geometry::{Aabb, Ray};
use glimt::math::frame::Frame;
use glimt::math::{Vec2, Vec3};
use glimt::sampling::{CAMERA_PATH, Dimension, PixelSampler, warp};

/// Image width and height, for a million rays.
const SIDE: u32 = 1000;

/// A closed bumpy ball of `rings` × `rings` quads, each split into two triangles. At the poles, one of the
/// two is degenerate.
pub fn rippled_ball(rings: u32) -> TriangleMesh {
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

/// Reads a mesh file in any supported format, or a `.mesh` file of raw counts, positions and indices.
pub fn load(path: &Path) -> Result<TriangleMesh, String> {
    if path.extension().is_some_and(|ending| ending == "mesh") {
        return raw_mesh(&std::fs::read(path).map_err(|error| error.to_string())?)
            .map_err(|error| error.to_string());
    }
    let loaded =
        mesh::load(path, &ignore_progress, &CancelToken::new()).map_err(|error| error.to_string())?;
    Ok(loaded.mesh)
}

/// Parses a little-endian `.mesh` file: `u32` vertex count, `u32` triangle count, `f32` positions, `u32`
/// indices.
fn raw_mesh(bytes: &[u8]) -> io::Result<TriangleMesh> {
    let words: Vec<[u8; 4]> = bytes.as_chunks().0.to_vec();
    let short = || io::Error::new(io::ErrorKind::UnexpectedEof, "file too short for its counts");
    let count = |i: usize| words.get(i).map(|&word| u32::from_le_bytes(word) as usize).ok_or_else(short);
    let (vertices, triangles) = (count(0)?, count(1)?);
    let positions = words.get(2..2 + 3 * vertices).ok_or_else(short)?;
    let indices = words.get(2 + 3 * vertices..2 + 3 * (vertices + triangles)).ok_or_else(short)?;
    let positions =
        positions.as_chunks().0.iter().map(|&[x, y, z]| Vec3::from([x, y, z].map(f32::from_le_bytes)));
    let triangles = indices.as_chunks().0.iter().map(|corners| corners.map(u32::from_le_bytes));
    Ok(TriangleMesh {
        positions: positions.collect(),
        triangles: triangles.collect(),
        ..TriangleMesh::default()
    })
}

/// Primary, diffuse and shadow rays.
pub struct Rays {
    /// Primary rays from outside the mesh, in pixel order.
    pub primary: Vec<Ray>,
    /// Cosine-distributed rays from the primary hits.
    pub diffuse: Vec<Ray>,
    /// Shadow rays from the primary hits to a point light.
    pub shadow: Vec<Ray>,
}

/// Generates primary rays in blocks of 4 × 4 pixels, then a diffuse bounce and a shadow ray from each hit.
pub fn rays(tree: &WideBvh, mesh: &TriangleMesh) -> Rays {
    let Aabb { min, max } = tree.bounds();
    let (center, size) = ((min + max) * 0.5, (max - min).length());
    let eye = center + Vec3::new(0.4, 0.3, 1.0).normalize() * size;
    let frame = Frame::from_normal((center - eye).normalize());
    let light = center + Vec3::new(-1.0, 2.0, 1.0) * size;
    let mut rays = Rays { primary: Vec::new(), diffuse: Vec::new(), shadow: Vec::new() };
    for i in 0..SIDE * SIDE {
        let (square, inside) = (i / 16, i % 16);
        let (x, y) = (square % (SIDE / 4) * 4 + inside % 4, square / (SIDE / 4) * 4 + inside / 4);
        let place = Vec2::new(x as f32, y as f32) / SIDE as f32 - Vec2::splat(0.5);
        let ray = Ray::new(eye, (frame.n + frame.s * place.x + frame.t * place.y).normalize());
        rays.primary.push(ray);
        let Some(hit) = tree.closest_hit(&ray) else { continue };
        let [a, b, c] = mesh.corners(hit.primitive);
        let normal = (b - a).cross(c - a).normalize();
        let normal = if normal.dot(ray.direction) < 0.0 { normal } else { -normal };
        let point = a * (1.0 - hit.u - hit.v) + b * hit.u + c * hit.v;
        let origin = offset_origin(point, point.abs() * 1e-6 + Vec3::splat(size * 1e-7), normal, normal);
        let [x, y] = PixelSampler::new(0, i, 0, 0).pair(CAMERA_PATH, Dimension::Pixel).to_array();
        let disk = warp::disk(Vec2::new(x, y));
        let up = (1.0 - disk.length_squared()).max(0.0).sqrt();
        rays.diffuse.push(Ray::new(origin, Frame::from_normal(normal).to_world(disk.extend(up))));
        rays.shadow.push(Ray::segment_ending_before_point(origin, light));
    }
    rays
}

/// Reads rays from a file: origin, direction, minimum and maximum t, as little-endian `f32`.
pub fn ray_file(path: &Path) -> io::Result<Vec<Ray>> {
    let bytes = std::fs::read(path)?;
    let rows = bytes.as_chunks::<32>().0.iter().map(|row| {
        let word =
            |i: usize| f32::from_le_bytes([row[4 * i], row[4 * i + 1], row[4 * i + 2], row[4 * i + 3]]);
        Ray {
            origin: Vec3::new(word(0), word(1), word(2)),
            direction: Vec3::new(word(3), word(4), word(5)),
            t_max: word(7),
            start: Ray::NO_TRIANGLE,
        }
    });
    Ok(rows.collect())
}

/// Reads hits from a file: t (`f32`), primitive (`u32`), and the barycentric coordinates of the second and
/// third vertices.
pub fn hit_file(path: &Path) -> io::Result<Vec<Option<(f32, u32)>>> {
    let bytes = std::fs::read(path)?;
    let rows = bytes.as_chunks::<16>().0.iter().map(|row| {
        let word = |i: usize| [row[4 * i], row[4 * i + 1], row[4 * i + 2], row[4 * i + 3]];
        let primitive = u32::from_le_bytes(word(1));
        (primitive != u32::MAX).then(|| (f32::from_le_bytes(word(0)), primitive))
    });
    Ok(rows.collect())
}
