//! Converts curves (`bsplinecurve`, `linearcurve`) to meshes of tubes.

use std::f64::consts::{PI, TAU};

use super::graph::PluginInstance;
use super::material_key::UvFlips;
use super::reader::SceneReader;
use super::shapes::ShapeTarget;
use crate::formats::foreign::meshes::MeshData;
use crate::math::{DMat4, DVec2, DVec3, DVec4};

/// Maximum size of a file of curves.
const MAX_BYTES: u64 = 64 << 20;
/// Maximum number of segments of all curves of a shape.
const MAX_SEGMENTS: usize = 20_000;
/// Sides of a tube.
const SIDES: u32 = 32;
/// Rings per segment of a spline.
const RINGS: u32 = 16;
/// Rings of the spherical end of a linear segment.
const CAP_RINGS: u32 = 8;

/// A point of a curve: center and radius.
type ControlPoint = DVec4;

/// A point on the center line of a tube.
struct SplinePoint {
    center: DVec3,
    radius: f64,
    /// First and second derivative of the center, and the first one of the radius.
    tangent: DVec3,
    curvature: DVec3,
    slope: f64,
}

/// Parses curves, which empty lines separate. The radii are not transformed.
fn parse_curves(text: &str, matrix: &DMat4) -> Option<Vec<Vec<ControlPoint>>> {
    let mut curves = vec![Vec::new()];
    for line in text.lines() {
        let numbers: Option<Vec<f64>> = line
            .split_whitespace()
            .map(|word| word.parse().ok().filter(|number: &f64| number.is_finite()))
            .collect();
        match numbers?[..] {
            [] => curves.push(Vec::new()),
            [x, y, z, radius, ..] => {
                let center = matrix.transform_point3(DVec3::new(x, y, z));
                curves.last_mut()?.push(center.extend(radius));
            }
            _ => return None,
        }
    }
    curves.retain(|curve| !curve.is_empty());
    Some(curves)
}

/// Evaluates a segment of a uniform cubic B-spline.
fn spline_point(points: &[ControlPoint; 4], t: f64) -> SplinePoint {
    let sum = |weights: [f64; 4]| -> DVec4 {
        weights.iter().zip(points).map(|(weight, point)| *weight * *point).sum()
    };
    let (t2, t3, s) = (t * t, t * t * t, 1.0 - t);
    let value = sum([s * s * s, 3.0 * t3 - 6.0 * t2 + 4.0, -3.0 * t3 + 3.0 * t2 + 3.0 * t + 1.0, t3]) / 6.0;
    let first = sum([-s * s, 3.0 * t2 - 4.0 * t, -3.0 * t2 + 2.0 * t + 1.0, t2]) / 2.0;
    let second = sum([s, 3.0 * t - 2.0, 1.0 - 3.0 * t, t]);
    SplinePoint {
        center: value.truncate(),
        radius: value.w,
        tangent: first.truncate(),
        curvature: second.truncate(),
        slope: first.w,
    }
}

/// Mitsuba's frame around a tangent: the directions at a quarter turn and at 0.
fn frame_around_tangent(tangent: DVec3) -> [DVec3; 2] {
    let guide = DVec3::Z - tangent * tangent.z;
    let quarter = guide.try_normalize().unwrap_or(DVec3::Y);
    [quarter, quarter.cross(tangent)]
}

/// Factor on the radius of a regular polygon that has the mean width of a circle.
fn mean_width_radius_factor() -> f64 {
    let half = PI / f64::from(SIDES);
    half / libm::sin(half)
}

/// The direction around a tube at a texture coordinate.
fn direction_around(tangent: DVec3, u: f64) -> DVec3 {
    let [quarter, first] = frame_around_tangent(tangent);
    first * libm::cos(TAU * u) + quarter * libm::sin(TAU * u)
}

/// The tube of one segment of a spline.
fn spline_segment_tube(points: &[ControlPoint; 4]) -> MeshData {
    MeshData::tessellate_surface([SIDES, RINGS], |uv| {
        let at = spline_point(points, uv.y);
        let out = direction_around(at.tangent.normalize_or(DVec3::Z), uv.x) * at.radius;
        let bend = at.tangent.length_squared() - out.dot(at.curvature);
        let normal = out * bend - at.tangent * (at.slope * at.radius);
        (at.center + out * mean_width_radius_factor(), normal.normalize_or(DVec3::Z))
    })
}

/// One segment of a linear curve: a cone that touches the spheres at its ends.
fn linear_segment_tube([start, end]: [ControlPoint; 2]) -> MeshData {
    let between = end.truncate() - start.truncate();
    let axis = between.normalize_or(DVec3::Z);
    let lift = ((start.w - end.w) / between.length().max(1e-300)).clamp(-1.0, 1.0);
    // Angle between the normal on the cone and the plane across the axis.
    let tilt = libm::asin(lift);
    let rows = 2 * CAP_RINGS + 1;
    MeshData::tessellate_surface([SIDES, rows], |uv| {
        let row = (uv.y * f64::from(rows)).round();
        let cap = f64::from(CAP_RINGS);
        let (sphere, angle) = if row <= cap {
            (start, -PI / 2.0 + (tilt + PI / 2.0) * row / cap)
        } else {
            (end, tilt + (PI / 2.0 - tilt) * (row - cap - 1.0) / cap)
        };
        let around = direction_around(axis, uv.x) * libm::cos(angle);
        let along = axis * libm::sin(angle);
        let point = sphere.truncate() + (around * mean_width_radius_factor() + along) * sphere.w;
        (point, (around + along).normalize_or(DVec3::Z))
    })
}

/// The end of a linear segment to which a row of its mesh belongs: 0 for the first sphere, 1 for the second
/// one.
fn snap_to_segment_end(v: f64) -> f64 {
    if v < 0.5 { 0.0 } else { 1.0 }
}

/// The tubes of all curves. `None` if a curve has too few points.
fn tubes(curves: &[Vec<ControlPoint>], is_spline: bool) -> Option<MeshData> {
    let points = if is_spline { 4 } else { 2 };
    if curves.iter().any(|curve| curve.len() < points) {
        return None;
    }
    let segments: usize = curves.iter().map(|curve| curve.len() + 1 - points).sum();
    let mut tubes = MeshData::default();
    let windows = curves.iter().flat_map(|curve| curve.windows(points).enumerate());
    for (index, (number, window)) in windows.enumerate() {
        let mut segment = match *window {
            [a, b, c, d] => spline_segment_tube(&[a, b, c, d]),
            [a, b] => linear_segment_tube([a, b]),
            _ => return None,
        };
        if !is_spline && number > 0 {
            // The previous segment ends with this sphere.
            let is_start = |vertex: u32| snap_to_segment_end(segment.uvs[vertex as usize].y) == 0.0;
            segment.triangles.retain(|triangle| !triangle.iter().all(|vertex| is_start(*vertex)));
        }
        let along =
            |v: f64| (index as f64 + if is_spline { v } else { snap_to_segment_end(v) }) / segments as f64;
        segment.uvs.iter_mut().for_each(|uv| *uv = DVec2::new(uv.x, along(uv.y)));
        tubes.append(segment);
    }
    tubes.orient_triangles_like_pbrt(false);
    Some(tubes)
}

impl<'a> SceneReader<'a> {
    /// Adds curves as a mesh. Returns whether anything was added.
    pub(super) fn add_curves(&mut self, object: &'a PluginInstance, target: ShapeTarget<'_>) -> bool {
        let Some(matrix) = self.shape_transform(object) else { return false };
        let Some((name, span)) = self.text(object, "filename") else {
            self.report_error(object.span.clone(), "the curves need `filename`", None);
            return false;
        };
        let Some(path) = self.asset_path(name, &span, "curves") else { return false };
        let Some(material) = self.shape_material(object, UvFlips::default()) else { return false };
        let bytes = self.read_watched_file(&path, MAX_BYTES);
        let text = bytes.and_then(|bytes| String::from_utf8(bytes).ok());
        let Some(curves) = text.and_then(|text| parse_curves(&text, &matrix)) else {
            let help = "a line has four numbers: x, y, z and the radius".to_owned();
            self.report_error(span, "the curves cannot be read", Some(help));
            return false;
        };
        if curves.iter().map(Vec::len).sum::<usize>() > MAX_SEGMENTS {
            self.refuse(object, &format!("more than {MAX_SEGMENTS} segments of curves"));
            return false;
        }
        let Some(mesh) = tubes(&curves, object.plugin == "bsplinecurve") else {
            let message = "a curve has too few points: a B-spline needs four, a linear curve two";
            self.report_error(span, message, None);
            return false;
        };
        let text = "tubes of 32 sides; their ends are open, and Mitsuba does not show their inside";
        self.notes.note("curves", text, object.span.clone());
        self.add_generated_mesh(mesh, object, target, material, &DMat4::IDENTITY)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn splines_interpolate_lines_and_radii() {
        let points = [0.0, 1.0, 2.0, 3.0].map(|x| DVec4::new(x, 0.0, 0.0, 0.1 * x));
        for t in [0.0, 0.25, 1.0] {
            let at = spline_point(&points, t);
            assert!((at.center - DVec3::X * (1.0 + t)).length() < 1e-12);
            assert!((at.radius - 0.1 * (1.0 + t)).abs() < 1e-12);
            assert!((at.tangent - DVec3::X).length() < 1e-12 && (at.slope - 0.1).abs() < 1e-12);
            assert!(at.curvature.length() < 1e-12);
        }
        // At a corner, (p0 + 4 p1 + p2) / 6.
        let corner = [DVec4::X, DVec4::ZERO, DVec4::Y, DVec4::Y];
        assert!((spline_point(&corner, 0.0).center - DVec3::new(1.0, 1.0, 0.0) / 6.0).length() < 1e-12);
    }

    #[test]
    fn normals_of_tubes_are_perpendicular() {
        let points = [[0.0, 0.0, 0.0, 0.2], [1.0, 2.0, 0.0, 0.5], [3.0, 1.0, 1.0, 0.1], [4.0, 0.0, 3.0, 0.4]]
            .map(DVec4::from);
        let mesh = spline_segment_tube(&points);
        for triangle in &mesh.triangles {
            let [a, b, c] = triangle.map(|vertex| mesh.positions[vertex as usize]);
            let face = (b - a).cross(c - a).normalize();
            let mean: DVec3 = triangle.iter().map(|vertex| mesh.normals[*vertex as usize]).sum();
            assert!(face.dot(mean.normalize()).abs() > 0.99, "{triangle:?}");
        }
    }

    #[test]
    fn linear_segments_touch_their_spheres() {
        let mesh = linear_segment_tube([DVec4::new(0.0, 0.0, 0.0, 1.0), DVec4::new(0.0, 0.0, 4.0, 0.5)]);
        let (low, high) = mesh
            .positions
            .iter()
            .fold((DVec3::MAX, DVec3::MIN), |(low, high), at| (low.min(*at), high.max(*at)));
        assert!((low.z + 1.0).abs() < 1e-12 && (high.z - 4.5).abs() < 1e-12);
        // The cone's normal has the sine (1 − 0.5) / 4 along the axis.
        let first = (CAP_RINGS * (SIDES + 1)) as usize;
        for row in [first, first + SIDES as usize + 1] {
            assert!((mesh.normals[row].z - 0.125).abs() < 1e-3, "{}", mesh.normals[row]);
        }
    }

    #[test]
    fn joints_belong_to_the_previous_segment() {
        let points = [0.0, 1.0, 3.0].map(|x| DVec4::new(x, 0.0, 0.0, 0.25));
        let one = linear_segment_tube([points[0], points[1]]);
        let is_start = |vertex: &u32| one.uvs[*vertex as usize].y < 0.5;
        let cap = one.triangles.iter().filter(|triangle| triangle.iter().all(is_start)).count();
        assert!(cap > 0);
        let both = tubes(&[points.to_vec()], false).expect("a mesh");
        assert_eq!(both.triangles.len(), 2 * one.triangles.len() - cap);
    }

    #[test]
    fn empty_lines_separate_curves() {
        let curves =
            parse_curves("0 0 0 1\n1 0 0 1\n\n\n5 0 0 2\n6 0 0 2\n", &DMat4::from_scale(DVec3::splat(2.0)));
        let curves = curves.expect("curves");
        assert_eq!(curves.iter().map(Vec::len).collect::<Vec<_>>(), [2, 2]);
        // Radii are not scaled.
        assert_eq!(curves[1][0], DVec4::new(10.0, 0.0, 0.0, 2.0));
        assert!(parse_curves("0 0 0\n", &DMat4::IDENTITY).is_none());
    }
}
