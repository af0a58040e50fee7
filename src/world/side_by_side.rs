//! A shape and the rays of a packet: side by side where the shape has a loop for that, else one by one.

use super::shape::{MeshInstance, Shape};
use crate::accel::{Ends, PACKET};
use crate::geometry::Ray;
use crate::geometry::rows::{HitRows, RayRows};
use crate::math::transform::Transform;

/// Rays of a packet whose bits are set.
fn lanes(mut bits: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let lane = bits.trailing_zeros() as usize;
        (bits != 0).then(|| {
            bits &= bits - 1;
            lane
        })
    })
}

/// The nearest hits of the rays in `met`; the others end below 0. `found` holds none before.
#[inline(always)]
pub fn closest(shape: &Shape, rays: &[Ray], rows: &RayRows, met: u32, ends: &Ends, found: &mut HitRows) {
    match shape {
        Shape::Plane(plane) => plane.intersect_rows(rows, ends, found),
        Shape::Quad(quad) => quad.intersect_rows(rows, ends, found),
        Shape::Sphere(sphere) => sphere.intersect_rows(rows, ends, found),
        Shape::Box(cuboid) => cuboid.intersect_rows(rows, ends, found),
        Shape::Triangle(triangle) => triangle.intersect_rows(rows, ends, found),
        Shape::Disk(disk) => disk.intersect_rows(rows, ends, found),
        Shape::Mesh(mesh) => mesh_closest(mesh, rays, met, ends, found),
        Shape::Cylinder(_) | Shape::Cone(_) | Shape::Torus(_) => one_by_one(shape, rays, met, ends, found),
    }
}

/// A bit for each ray in `met` that hits anything of it; the others end below 0. `except` holds the bits of the rays that may hit
/// one of its primitives each, and the primitives.
#[inline(always)]
pub fn any(
    shape: &Shape,
    rays: &[Ray],
    rows: &RayRows,
    met: u32,
    ends: &Ends,
    except: Option<(u32, &[u32; PACKET])>,
) -> u32 {
    if let Shape::Mesh(mesh) = shape {
        return mesh_any(mesh, rays, met, ends, except);
    }
    let mut found = HitRows::none();
    closest(shape, rays, rows, met, ends, &mut found);
    let mut hit = 0;
    for lane in 0..PACKET {
        let bit = 1 << lane;
        hit |= if found.t[lane].is_nan() { 0 } else { bit };
    }
    if let Some((own, parts)) = except {
        for (lane, &part) in parts.iter().enumerate() {
            let bit = own & 1 << lane;
            hit &= if found.primitive[lane] == part { !bit } else { !0 };
        }
    }
    hit
}

#[inline(never)]
fn one_by_one(shape: &Shape, rays: &[Ray], met: u32, ends: &Ends, found: &mut HitRows) {
    for lane in lanes(met) {
        let ray = Ray { t_max: ends[lane], ..rays[lane] };
        if let Some(hit) = shape.closest(&ray, &ray.to_f64()) {
            found.put(lane, &hit);
        }
    }
}

#[inline(never)]
fn mesh_closest(mesh: &MeshInstance, rays: &[Ray], met: u32, ends: &Ends, found: &mut HitRows) {
    let mut hits = [None; PACKET];
    let hits = &mut hits[..rays.len()];
    in_mesh(mesh, rays, met, |local| mesh.tree.closest_packet(local, ends, hits));
    for (lane, hit) in hits.iter().enumerate() {
        if let Some(hit) = hit {
            found.put(lane, hit);
        }
    }
}

#[inline(never)]
fn mesh_any(
    mesh: &MeshInstance,
    rays: &[Ray],
    met: u32,
    ends: &Ends,
    except: Option<(u32, &[u32; PACKET])>,
) -> u32 {
    let mut parts = [None; PACKET];
    let mut found = 0;
    let except = match except {
        Some((own, numbers)) => {
            lanes(own).for_each(|lane| parts[lane] = Some(numbers[lane]));
            &parts[..rays.len()]
        }
        None => &[],
    };
    in_mesh(mesh, rays, met, |local| found = mesh.tree.any_packet(local, ends, except));
    found
}

/// Those rays of a packet that are in `met` in a mesh's coordinates, the others as they are.
#[inline]
fn in_mesh(mesh: &MeshInstance, rays: &[Ray], met: u32, trace: impl FnOnce(&[Ray])) {
    if mesh.transform == Transform::IDENTITY {
        return trace(rays);
    }
    let mut local = [rays[0]; PACKET];
    for lane in lanes(met) {
        local[lane] = mesh.local_ray(&rays[lane]);
    }
    trace(&local[..rays.len()]);
}

#[cfg(test)]
#[path = "side_by_side_tests.rs"]
mod tests;
