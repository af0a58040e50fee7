//! Overlay that draws the acceleration structures' bounding boxes as lines.

use super::transport::scratch::TraceBuffers;
use super::transport::tile::TileContext;
use crate::control::Canceled;
use crate::geometry::{Aabb, Ray};
use crate::math::Vec3;
use crate::math::elementary::exp2;
use crate::world::{PixelFootprint, RayBoxInterval, VisitedNode};

/// Line width in pixels.
const LINE_WIDTH: f32 = 1.25;

/// Minimum size of a drawn box on screen, in pixels.
const MIN_BOX_SIZE: f32 = 40.0;

/// Opacity of lines behind surfaces.
const HIDDEN_OPACITY: f32 = 0.3;

/// Linear colors of the tree levels, starting at the root and repeating cyclically.
const COLORS: [Vec3; 6] = [
    Vec3::new(1.0, 0.85, 0.1),
    Vec3::new(0.1, 0.8, 1.0),
    Vec3::new(1.0, 0.25, 0.1),
    Vec3::new(0.2, 1.0, 0.2),
    Vec3::new(0.9, 0.2, 1.0),
    Vec3::new(1.0, 1.0, 1.0),
];

/// A box edge close to a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
struct BoxEdgeToDraw {
    is_behind: bool,
    depth: u32,
}

/// Draws a line wherever a camera ray in the queue passes close to the edge of a box.
pub fn draw_box_edges(
    tile: &TileContext<'_>,
    scratch: &mut TraceBuffers,
    radiance: &mut [Vec3],
) -> Result<(), Canceled> {
    let render = &tile.settings.render;
    let footprint = tile.world.camera.pixel_footprint(render.height);
    let brightness = exp2(-render.exposure);
    tile.closest_hits_of_queue(&scratch.rays, &mut scratch.hits)?;
    for (path, hit) in scratch.rays.iter().zip(&scratch.hits) {
        let end = hit.map_or(f32::INFINITY, |hit| hit.shape.t);
        if let Some(BoxEdgeToDraw { is_behind, depth }) = find_edge_to_draw(tile, &path.ray, end, footprint) {
            let color = COLORS[depth as usize % COLORS.len()] * brightness;
            let own = &mut radiance[path.slot as usize];
            *own = own.lerp(color, if is_behind { HIDDEN_OPACITY } else { 1.0 });
        }
    }
    Ok(())
}

/// The box edge to draw for a ray. Edges in front of the surface at `end` take priority over edges behind it.
/// Otherwise, larger boxes take priority over smaller boxes.
fn find_edge_to_draw(
    tile: &TileContext<'_>,
    ray: &Ray,
    end: f32,
    footprint: PixelFootprint,
) -> Option<BoxEdgeToDraw> {
    let mut best: Option<BoxEdgeToDraw> = None;
    tile.world.geometry.visit_nodes_hit_by_ray(ray, |local, VisitedNode { bounds, depth, .. }, stretch| {
        let unit = local.direction.length();
        let pixel = |t: f32| (footprint.width + t * footprint.spread) * unit;
        let RayBoxInterval { enter, leave } = *stretch;
        let size = bounds.extent().length();
        if size < MIN_BOX_SIZE * pixel(enter.0.max(0.0)) {
            return false;
        }
        for (t, side) in [enter, leave].into_iter().filter(|(t, _)| *t > 0.0) {
            let line = BoxEdgeToDraw { is_behind: t > end, depth: *depth };
            let is_first =
                best.is_none_or(|best| (line.is_behind, line.depth) < (best.is_behind, best.depth));
            if is_first
                && distance_from_ray_to_face_edge(bounds, local, (t, side)) < 0.5 * LINE_WIDTH * pixel(t)
            {
                best = Some(line);
            }
        }
        true
    });
    best
}

/// Distance from a ray to the nearest edge of the box face that the ray crosses at t.
fn distance_from_ray_to_face_edge(bounds: &Aabb, ray: &Ray, (t, side): (f32, usize)) -> f32 {
    let (point, d) = (ray.at(t), ray.direction);
    let to_edge = |axis: usize| {
        let from_edge = (point[axis] - bounds.min[axis]).min(bounds.max[axis] - point[axis]).max(0.0);
        // The edge is parallel to the third axis. Project along it, and measure the 2D distance to the ray.
        from_edge * d[side].abs() / (d[side] * d[side] + d[axis] * d[axis]).sqrt()
    };
    to_edge((side + 1) % 3).min(to_edge((side + 2) % 3))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edge_distance_equals_the_distance_between_lines() {
        let cube = Aabb { min: Vec3::ZERO, max: Vec3::ONE };
        let distance = |origin: Vec3, direction: Vec3| {
            let ray = Ray::new(origin, direction);
            let stretch = RayBoxInterval::new(&cube, &ray).expect("the ray should hit the cube");
            distance_from_ray_to_face_edge(&cube, &ray, stretch.enter)
        };
        assert!((distance(Vec3::new(0.2, 0.7, -3.0), Vec3::Z) - 0.2).abs() < 1e-6);
        // A ray along (0, 1, 1) through (½, 0.9, 0) is 0.1·cos 45° from the upper edge.
        let diagonal = distance(Vec3::new(0.5, -0.1, -1.0), Vec3::new(0.0, 1.0, 1.0));
        assert!((diagonal - 0.1 * 0.5_f32.sqrt()).abs() < 1e-6, "{diagonal}");
    }
}
