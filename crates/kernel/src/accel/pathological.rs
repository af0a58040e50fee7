//! Difficult meshes for testing trees, and brute-force reference hits.

use crate::geometry::watertight::ShearedRay;
use crate::geometry::{Ray, ShapeHit};
use crate::math::Vec3;
use crate::math::random::signed_number_generator as random;

/// Difficult meshes: noise, slivers, grids with coplanar and duplicate faces, identical triangles, a single
/// triangle, an empty mesh, and a mesh with NaN coordinates.
pub fn difficult_meshes() -> Vec<Vec<[Vec3; 3]>> {
    let mut next = random(5);
    let mut point = |size: f32| Vec3::new(next(), next(), next()) * size;
    let noise = (0..700).map(|_| {
        let at = point(10.0);
        [at, at + point(1.0), at + point(1.0)]
    });
    let noise: Vec<_> = noise.collect();
    let slivers = (0..300).map(|_| {
        let (at, along) = (point(5.0), point(8.0));
        [at, at + along, at + along * 0.5 + point(1e-5)]
    });
    let slivers: Vec<_> = slivers.collect();
    let grid = (0..400).flat_map(|i| {
        let at = Vec3::new((i % 20) as f32 - 10.0, 0.0, (i / 20) as f32 - 10.0);
        let square = [at, at + Vec3::X, at + Vec3::X + Vec3::Z, at + Vec3::Z];
        let halves = [[square[0], square[1], square[2]], [square[0], square[2], square[3]]];
        [halves[0], halves[1], halves[0]]
    });
    let stairs = (0..200).map(|i| {
        let (x, y) = ((i / 2) as f32 * 0.1, (i % 2) as f32);
        [Vec3::new(x, y, -5.0), Vec3::new(x, y, 5.0), Vec3::new(x + 0.1, y + 0.1, 0.0)]
    });
    let alike = vec![[Vec3::ZERO, Vec3::X * 3.0, Vec3::Y * 3.0]; 333];
    let mut with_nan = noise[..50].to_vec();
    with_nan[7][1].y = f32::NAN;
    with_nan[30][0] = Vec3::INFINITY;
    vec![
        noise.clone(),
        slivers,
        grid.collect(),
        stairs.collect(),
        alike,
        noise[..1].to_vec(),
        Vec::new(),
        with_nan,
    ]
}

/// Finds the nearest hit by testing every triangle except the ray's start triangle.
pub fn closest_by_brute_force(mesh: &[[Vec3; 3]], ray: &Ray) -> Option<ShapeHit> {
    let sheared = ShearedRay::new(ray.origin, ray.direction);
    let others = (0..).zip(mesh).filter(|&(id, _)| id != ray.start);
    let hits = others.filter_map(|(id, corners)| {
        sheared.intersect(corners, ray.t_max).map(|hit| ShapeHit { primitive: id, ..hit })
    });
    hits.min_by(|a, b| a.t.total_cmp(&b.t).then(a.primitive.cmp(&b.primitive)))
}

/// Rays in random directions, toward corners and edges, and along axes (with positive and negative zeros).
/// Some start at corners or on triangles.
pub fn difficult_rays(mesh: &[[Vec3; 3]]) -> Vec<Ray> {
    let mut next = random(11);
    let mut rays = Vec::new();
    for i in 0..2000 {
        let origin = Vec3::new(next(), next(), next()) * 15.0;
        let triangle = mesh.get(i % mesh.len().max(1)).copied().unwrap_or([Vec3::ZERO; 3]);
        let target = match i % 5 {
            0 => triangle[0],
            1 => (triangle[0] + triangle[1]) * 0.5,
            2 => (triangle[0] + triangle[1] + triangle[2]) / 3.0,
            _ => Vec3::new(next(), next(), next()) * 5.0,
        };
        let zero = if i % 2 == 0 { 0.0 } else { -0.0 };
        rays.push(Ray::new(origin, target - origin));
        rays.push(Ray { t_max: 0.9, ..Ray::new(origin, target - origin) });
        rays.push(Ray::new(Vec3::new(target.x, 20.0, target.z), Vec3::new(zero, -1.0, zero)));
        rays.push(Ray::new(triangle[2], Vec3::new(next(), next(), next())));
        // Exclude the start triangle from a ray that passes through it and from one that starts on it.
        let start = (i % mesh.len().max(1)) as u32;
        rays.push(Ray::new(origin, target - origin).with_start_triangle(start));
        rays.push(Ray::new(target, Vec3::new(next(), next(), next())).with_start_triangle(start));
    }
    rays.push(Ray::new(Vec3::NAN, Vec3::X));
    rays.push(Ray::new(Vec3::ZERO, Vec3::new(f32::INFINITY, 0.0, f32::NAN)));
    rays.push(Ray::new(Vec3::ZERO, Vec3::ZERO));
    rays
}

/// Bit patterns of a hit, for exact comparison.
pub fn hit_bits(hit: Option<ShapeHit>) -> Option<(u32, u32, u32, u32)> {
    hit.map(|hit| (hit.t.to_bits(), hit.primitive, hit.u.to_bits(), hit.v.to_bits()))
}
