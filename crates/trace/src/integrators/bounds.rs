//! The boxes of the trees, as lines over the picture.

use super::transport::scratch::Scratch;
use super::transport::tile::TileContext;
use crate::control::Cancelled;
use crate::geometry::{Aabb, Ray};
use crate::math::Vec3;
use crate::math::elementary::exp2;
use crate::world::{Cell, Stretch};

/// Width of the lines in pixels.
const LINE: f32 = 1.25;

/// Least size of a drawn box, in pixels.
const LEAST_SIZE: f32 = 40.0;

/// Opacity of a line behind surfaces.
const FAINT: f32 = 0.3;

/// Linear colours of levels, from the root down and over again.
const COLORS: [Vec3; 6] = [
    Vec3::new(1.0, 0.85, 0.1),
    Vec3::new(0.1, 0.8, 1.0),
    Vec3::new(1.0, 0.25, 0.1),
    Vec3::new(0.2, 1.0, 0.2),
    Vec3::new(0.9, 0.2, 1.0),
    Vec3::new(1.0, 1.0, 1.0),
];

/// A line that a ray hits.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Line {
    is_behind: bool,
    depth: u32,
}

/// Draws lines where the camera rays in the queue come near the edges of boxes.
pub fn draw(tile: &TileContext<'_>, scratch: &mut Scratch, radiance: &mut [Vec3]) -> Result<(), Cancelled> {
    let render = &tile.settings.render;
    let spread = tile.world.camera.pixel_spread(render.height);
    let brightness = exp2(-render.exposure);
    tile.closest_hits(&scratch.rays, &mut scratch.hits)?;
    for (path, hit) in scratch.rays.iter().zip(&scratch.hits) {
        let end = hit.map_or(f32::INFINITY, |hit| hit.shape.t);
        if let Some(Line { is_behind, depth }) = nearest_line(tile, &path.ray, end, spread) {
            let color = COLORS[depth as usize % COLORS.len()] * brightness;
            let own = &mut radiance[path.slot as usize];
            *own = own.lerp(color, if is_behind { FAINT } else { 1.0 });
        }
    }
    Ok(())
}

/// The first of the lines that a ray hits: lines before the surface at `end` precede the others, and among these larger
/// boxes precede smaller ones.
fn nearest_line(tile: &TileContext<'_>, ray: &Ray, end: f32, spread: f32) -> Option<Line> {
    let mut best: Option<Line> = None;
    tile.world.geometry.along(ray, |local, Cell { bounds, depth, .. }, stretch| {
        let unit = local.direction.length();
        let pixel = |t: f32| t * spread * unit;
        let Stretch { enter, leave } = *stretch;
        let size = bounds.extent().length();
        if size < LEAST_SIZE * pixel(enter.0.max(0.0)) {
            return false;
        }
        for (t, side) in [enter, leave].into_iter().filter(|(t, _)| *t > 0.0) {
            let line = Line { is_behind: t > end, depth: *depth };
            let is_first =
                best.is_none_or(|best| (line.is_behind, line.depth) < (best.is_behind, best.depth));
            if is_first && edge_distance(bounds, local, (t, side)) < 0.5 * LINE * pixel(t) {
                best = Some(line);
            }
        }
        true
    });
    best
}

/// Distance of a ray from the nearest edge of the side of a box that it goes through at t.
fn edge_distance(bounds: &Aabb, ray: &Ray, (t, side): (f32, usize)) -> f32 {
    let (point, d) = (ray.at(t), ray.direction);
    let to_edge = |axis: usize| {
        let beside = (point[axis] - bounds.min[axis]).min(bounds.max[axis] - point[axis]).max(0.0);
        // The edge is along the third axis: measure the distance from the ray's plane along it.
        beside * d[side].abs() / (d[side] * d[side] + d[axis] * d[axis]).sqrt()
    };
    to_edge((side + 1) % 3).min(to_edge((side + 2) % 3))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_distance_to_an_edge_is_that_of_two_lines() {
        let cube = Aabb { min: Vec3::ZERO, max: Vec3::ONE };
        let distance = |origin: Vec3, direction: Vec3| {
            let ray = Ray::new(origin, direction);
            let stretch = Stretch::new(&cube, &ray).expect("the ray meets the cube");
            edge_distance(&cube, &ray, stretch.enter)
        };
        assert!((distance(Vec3::new(0.2, 0.7, -3.0), Vec3::Z) - 0.2).abs() < 1e-6);
        // Along (0, 1, 1) through (½, 0.9, 0): 0.1·cos 45° from the upper edge.
        let slanting = distance(Vec3::new(0.5, -0.1, -1.0), Vec3::new(0.0, 1.0, 1.0));
        assert!((slanting - 0.1 * 0.5_f32.sqrt()).abs() < 1e-6, "{slanting}");
    }
}
