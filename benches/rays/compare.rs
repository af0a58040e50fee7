//! Compares traced hits with expected hits from a file.

use std::path::Path;

use glimt::accel::WideBvh;
use glimt::geometry::Ray;
use glimt::geometry::mesh::TriangleMesh;
use glimt::math::DVec3;

use crate::meshes;

/// Traces the rays in one file and counts differences from the expected results in another. These are either
/// hits (`.hits`) or one byte per ray, which is nonzero if the ray is occluded.
pub fn compare(tree: &WideBvh, mesh: &TriangleMesh, rays: &Path, answers: &Path) -> std::io::Result<()> {
    let rays_read = meshes::ray_file(rays)?;
    let name =
        |path: &Path| path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    println!("  {} vs. {}: {} rays", name(rays), name(answers), rays_read.len());
    if answers.extension().is_some_and(|ending| ending == "hits") {
        closest(tree, mesh, &rays_read, &meshes::hit_file(answers)?);
    } else {
        let occluded: Vec<bool> = std::fs::read(answers)?.iter().map(|&byte| byte != 0).collect();
        let pairs = rays_read.iter().zip(&occluded);
        report(
            mesh,
            pairs.filter(|(ray, occluded)| tree.any_hit(ray, None) != **occluded).map(|(ray, _)| ray),
        );
    }
    Ok(())
}

fn closest(tree: &WideBvh, mesh: &TriangleMesh, rays: &[Ray], answers: &[Option<(f32, u32)>]) {
    let found: Vec<_> = rays.iter().map(|ray| tree.closest_hit(ray)).collect();
    let pairs = || rays.iter().zip(&found).zip(answers);
    report(
        mesh,
        pairs().filter(|((_, own), other)| own.is_some() != other.is_some()).map(|((ray, _), _)| ray),
    );
    let both = || pairs().filter_map(|((_, own), other)| own.zip(*other));
    let ids = both().filter(|(own, other)| own.primitive != other.1);
    let ties = ids.clone().filter(|(own, other)| (own.t - other.0).abs() <= 1e-6 * other.0.abs()).count();
    let far = both().filter(|(own, other)| (own.t - other.0).abs() > 1e-4 * other.0.abs()).count();
    println!(
        "    different primitive {} ({ties} of them equally close within 1e-6), t off by more than 1e-4 {far}",
        ids.count()
    );
}

/// Prints how many rays differ, and how many of them pass within rounding error of an edge.
fn report<'a>(mesh: &TriangleMesh, differing: impl Iterator<Item = &'a Ray>) {
    let differing: Vec<_> = differing.collect();
    let on_edge = differing.iter().filter(|ray| passes_edge(mesh, ray)).count();
    println!(
        "    {} rays hit in only one of the two, {on_edge} of these within 4 ulp of an edge",
        differing.len()
    );
}

/// Returns whether the ray passes within 4 ulp of a triangle edge, measured in the edge test's coordinates.
fn passes_edge(mesh: &TriangleMesh, ray: &Ray) -> bool {
    let (origin, direction) = (ray.origin.as_dvec3(), ray.direction.as_dvec3().normalize());
    (0..mesh.triangles.len() as u32).any(|id| {
        let corners = mesh.corners(id).map(|corner| corner.as_dvec3());
        let size = corners
            .iter()
            .map(|corner| corner.abs().max_element())
            .fold(origin.abs().max_element(), f64::max);
        (0..3).any(|i| {
            distance(origin, direction, corners[i], corners[(i + 1) % 3])
                <= 4.0 * f64::from(f32::EPSILON) * size
        })
    })
}

/// Distance between a line and a segment.
fn distance(origin: DVec3, direction: DVec3, a: DVec3, b: DVec3) -> f64 {
    // Project onto the plane perpendicular to the line.
    let flat = |p: DVec3| (p - origin) - direction * (p - origin).dot(direction);
    let (a, b) = (flat(a), flat(b));
    let along = b - a;
    let s = (-a.dot(along) / along.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
    (a + along * s).length()
}
