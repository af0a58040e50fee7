//! Handles lights that are coplanar with other surfaces.
//!
//! If two surfaces are in one plane, rounding determines which surface a ray hits first. Path rays might hit
//! a coplanar light while shadow rays to the light are blocked, or the reverse, and the two estimates of the
//! light's contribution would disagree. Coplanar lights are therefore moved off the plane by a tiny distance,
//! toward the side to which they emit.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::MeshTree;
use crate::assets::{FileMaterial, LoadedMesh};
use crate::geometry::cuboid::OrientedBox;
use crate::materials::EmissionSides;
use crate::math::transform::Transform;
use crate::math::{DVec3, Vec2, Vec3};
use crate::scene::description::{Material, Scene, Shape};

/// Distance between a light and a plane, relative to the light's size, below which they are considered
/// coplanar.
const COINCIDENT: f64 = 1.0 / (1 << 20) as f64;
/// Lift relative to the size of the light and its surroundings: well above `f32` rounding errors, but too
/// small to be visible.
pub(super) const LIFT: f64 = 1.0 / (1 << 16) as f64;
/// Error of a mesh face's plane, relative to the face's coordinates: several times the `f32` rounding error
/// of the corners.
pub(super) const ROUNDING: f64 = 1.0 / (1 << 22) as f64;
/// Two lifts have the same direction if the cosine between them differs from 1 by at most this value.
const SAME_DIRECTION: f64 = 1e-5;
/// Maximum size of a light's surroundings, relative to the light's size.
pub(super) const SURROUNDINGS: f64 = 16.0;
/// Maximum number of light/face pairs to compare. Further pairs are ignored.
pub(super) const MAX_PAIRS: usize = 1 << 26;

/// A light that overlaps a coplanar surface or another light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CoplanarLight {
    /// The emitting object.
    pub light: usize,
    /// The overlapped object, equal to `light` if both faces belong to one mesh.
    pub surface: usize,
    /// Translation that moves the light off the surface, or `None` if the surface emits toward the same side,
    /// in which case the overlap remains and both surfaces emit.
    pub lift: Option<DVec3>,
}

/// A flat, convex part of an object.
#[derive(Clone, Debug)]
pub(super) struct FlatFace {
    pub(super) object: usize,
    /// Corners in counterclockwise order as seen from the front, or none for an infinite plane.
    pub(super) corners: Vec<DVec3>,
    point: DVec3,
    /// Unit normal on the front side.
    pub(super) normal: DVec3,
    emits: Option<EmissionSides>,
    /// Upper bound on the distance between the traced face and its plane.
    pub(super) rounding: f64,
}

impl FlatFace {
    pub(super) fn new(corners: Vec<DVec3>) -> Option<Self> {
        let [a, b, c] = *corners.first_chunk()?;
        let normal = (b - a).cross(c - a).try_normalize()?;
        Some(Self { object: 0, corners, point: a, normal, emits: None, rounding: 0.0 })
    }

    /// Applies an affine map, preserving which side is the front.
    fn transformed(self, map: &Transform) -> Self {
        let mut corners: Vec<DVec3> = self.corners.iter().map(|corner| map.point(*corner)).collect();
        if map.flips_handedness() {
            corners.reverse();
        }
        let (point, normal) = (map.point(self.point), map.normal(self.normal).normalize_or_zero());
        Self { corners, point, normal, ..self }
    }

    /// Bounding box of the corners, or `None` for an infinite plane.
    fn bounds(&self) -> Option<[DVec3; 2]> {
        let first = *self.corners.first()?;
        let grow = |[min, max]: [DVec3; 2], at: &DVec3| [min.min(*at), max.max(*at)];
        Some(self.corners.iter().fold([first; 2], grow))
    }

    pub(super) fn max_extent(&self) -> f64 {
        self.bounds().map_or(f64::INFINITY, |[min, max]| (max - min).max_element())
    }

    /// Whether two faces are the same face or duplicates within one mesh. Duplicate faces emit only once; see
    /// [`separate_coincident_emitters`](super::separate_coincident_emitters).
    fn is_duplicate_of(&self, other: &Self) -> bool {
        self.object == other.object
            && self.corners.iter().all(|corner| other.corners.contains(corner))
            && !self.has_opposite_normal(other)
    }

    /// Whether the fronts of two coplanar faces are on opposite sides.
    pub(super) fn has_opposite_normal(&self, other: &Self) -> bool {
        self.normal.dot(other.normal) < 0.0
    }

    /// Whether the face emits on the side toward which this normal points.
    fn emits_along(&self, normal: DVec3) -> bool {
        match self.emits {
            None => false,
            Some(EmissionSides::Both) => true,
            Some(EmissionSides::Front) => self.normal.dot(normal) > 0.0,
        }
    }
}

/// Emissive faces, sorted by minimum x.
pub(super) struct EmissiveFacesByMinX {
    pub(super) faces: Vec<FlatFace>,
    bounds: Vec<[DVec3; 2]>,
    /// Maximum extent along x.
    widest: f64,
    /// Bounding box of all faces, plus the margin.
    region: [DVec3; 2],
    /// Distance at which boxes are considered to touch.
    margin: f64,
}

impl EmissiveFacesByMinX {
    /// Sorts the faces. Returns `None` if there are no faces.
    pub(super) fn new(mut faces: Vec<FlatFace>) -> Option<Self> {
        let min_x = |face: &FlatFace| face.bounds().map_or(f64::NEG_INFINITY, |[min, _]| min.x);
        faces.sort_by(|a, b| min_x(a).total_cmp(&min_x(b)));
        let bounds: Vec<[DVec3; 2]> = faces.iter().filter_map(FlatFace::bounds).collect();
        let joined = |a: [DVec3; 2], b: &[DVec3; 2]| [a[0].min(b[0]), a[1].max(b[1])];
        let [min, max] = bounds.iter().fold(*bounds.first()?, joined);
        let rounding = faces.iter().map(|face| face.rounding).fold(0.0, f64::max);
        let margin = (max - min).max_element() * COINCIDENT + rounding;
        let widest = bounds.iter().map(|[min, max]| max.x - min.x).fold(0.0, f64::max);
        Some(Self { faces, bounds, widest, region: [min - margin, max + margin], margin })
    }

    /// Whether no light can be near a box.
    fn are_apart_from_box(&self, bounds: [DVec3; 2]) -> bool {
        are_boxes_disjoint(bounds, self.region)
    }

    /// Returns the lights whose bounding boxes touch a face's bounding box. Increases `pairs` by the number
    /// of compared lights.
    pub(super) fn lights_with_touching_bounds<'a>(
        &'a self,
        face: &FlatFace,
        pairs: &mut usize,
    ) -> impl Iterator<Item = &'a FlatFace> {
        let [min, max] = face.bounds().unwrap_or(self.region);
        let margin = self.margin + face.rounding;
        let bounds = [min - margin, max + margin];
        let start = self.bounds.partition_point(|light| light[0].x < bounds[0].x - self.widest);
        let end = self.bounds.partition_point(|light| light[0].x <= bounds[1].x);
        *pairs += end - start;
        let range = start..end;
        range
            .filter(move |index| !are_boxes_disjoint(self.bounds[*index], bounds))
            .map(|index| &self.faces[index])
    }
}

/// Finds lights that overlap a coplanar surface or another light. Coordinates are relative to `origin`.
/// `meshes` contains the scene's loaded mesh files.
pub fn find_coplanar_lights(scene: &Scene, meshes: &[&LoadedMesh], origin: DVec3) -> Vec<CoplanarLight> {
    let mut faces = Vec::new();
    for object in (0..scene.objects.len()).filter(|object| can_object_emit(scene, meshes, *object)) {
        visit_flat_faces_of_object(scene, meshes, (object, origin), None, |face| {
            if face.emits.is_some() && !face.corners.is_empty() {
                faces.push(face.clone());
            }
        });
    }
    let Some(lights) = EmissiveFacesByMinX::new(faces) else { return Vec::new() };
    let mut found = BTreeMap::new();
    let mut pairs = 0;
    // Lights that touch glass are not moved because the handling of coincident glass surfaces resolves this
    // case.
    let is_glass = |object: &usize| {
        scene.objects[*object].material.is_some_and(|own| scene.materials[own].kind.is_solid_glass())
    };
    for object in (0..scene.objects.len()).filter(|object| !is_glass(object)) {
        visit_flat_faces_of_object(scene, meshes, (object, origin), Some(&lights), |face| {
            if pairs > MAX_PAIRS {
                return;
            }
            for light in lights.lights_with_touching_bounds(face, &mut pairs) {
                let is_lifted = must_lift_light(light, face);
                // Report each overlap of two lights only once.
                let is_reported = is_lifted
                    || face.object <= light.object
                        && !must_lift_light(face, light)
                        && !light.is_duplicate_of(face);
                if is_reported && are_coplanar_and_overlap(light, face) {
                    record_coplanar_light_with_max_lift(&mut found, (light, face), is_lifted);
                }
            }
        });
    }
    found.into_values().flatten().collect()
}

/// Whether two boxes are disjoint. Boxes are pairs of minimum and maximum corners.
fn are_boxes_disjoint(a: [DVec3; 2], b: [DVec3; 2]) -> bool {
    a[0].cmpgt(b[1]).any() || a[1].cmplt(b[0]).any()
}

/// Translations that move lights off coplanar surfaces, one per object, or an empty list if no lights need to
/// be moved.
pub fn light_lifts(scene: &Scene, meshes: &[Arc<MeshTree>], origin: DVec3) -> Vec<DVec3> {
    let loaded: Vec<_> = meshes.iter().map(|mesh| mesh.loaded_mesh()).collect();
    let found = find_coplanar_lights(scene, &loaded, origin).into_iter();
    let lifted = found.filter(|pair| pair.light != pair.surface);
    let lifted: Vec<_> = lifted.filter_map(|pair| Some((pair.light, pair.lift?))).collect();
    if lifted.is_empty() {
        return Vec::new();
    }
    let mut lifts = vec![DVec3::ZERO; scene.objects.len()];
    let mut directions: Vec<(usize, DVec3)> = Vec::new();
    for (light, lift) in lifted {
        // Lift a light only once if it is coplanar with several surfaces.
        let direction = lift.normalize_or_zero();
        directions.retain(|(other, _)| *other == light);
        if !directions.iter().any(|(_, known)| known.dot(direction) > 1.0 - SAME_DIRECTION) {
            directions.push((light, direction));
            lifts[light] += lift;
        }
    }
    lifts
}

/// Adds a light and the surface that it overlaps. If the pair already exists, updates its lift in this
/// direction to the maximum over all faces. The lift is above the rounding error of both faces.
fn record_coplanar_light_with_max_lift(
    found: &mut BTreeMap<(usize, usize), Vec<CoplanarLight>>,
    (light, face): (&FlatFace, &FlatFace),
    is_lifted: bool,
) {
    let size = light.max_extent();
    let around = face.max_extent().max(light.point.abs().max_element()).min(SURROUNDINGS * size);
    let height = (LIFT * size.max(around)).max(2.0 * (light.rounding + face.rounding));
    let lift = is_lifted.then(|| light.normal * height);
    let is_same = |known: &&mut CoplanarLight| match (known.lift, lift) {
        (Some(known), Some(lift)) => known.dot(lift) > 0.0,
        (known, lift) => known == lift,
    };
    let length = |lift: Option<DVec3>| lift.map_or(0.0, DVec3::length_squared);
    let of_pair = found.entry((light.object, face.object)).or_default();
    match of_pair.iter_mut().find(is_same) {
        Some(known) if length(known.lift) < length(lift) => known.lift = lift,
        Some(_) => {}
        None => of_pair.push(CoplanarLight { light: light.object, surface: face.object, lift }),
    }
}

/// Whether to lift the light off the face along the light's normal, which hides the back of a two-sided
/// light. The light is not lifted if the face also emits on that side, unless the face is in the same mesh
/// and has the opposite normal. In that case, each face emits on its own side.
fn must_lift_light(light: &FlatFace, face: &FlatFace) -> bool {
    !face.emits_along(light.normal) || light.object == face.object && light.has_opposite_normal(face)
}

/// Whether two faces are coplanar and overlap.
pub(super) fn are_coplanar_and_overlap(light: &FlatFace, face: &FlatFace) -> bool {
    let apart = light.max_extent().min(face.max_extent()) * COINCIDENT + light.rounding + face.rounding;
    // The larger face determines the plane because rounding tilts it less.
    let (small, large) = if light.max_extent() <= face.max_extent() { (light, face) } else { (face, light) };
    let is_on_plane = |corner: &DVec3| (*corner - large.point).dot(large.normal).abs() <= apart;
    if !small.corners.iter().all(is_on_plane) {
        return false;
    }
    // Convex polygons overlap if no edge separates them.
    let is_separated = |a: &FlatFace, b: &FlatFace| {
        (0..a.corners.len()).any(|index| {
            let corner = a.corners[index];
            let edge = a.corners[(index + 1) % a.corners.len()] - corner;
            let outside = edge.cross(a.normal).normalize_or_zero();
            !b.corners.is_empty() && b.corners.iter().all(|other| (*other - corner).dot(outside) >= -apart)
        })
    };
    !is_separated(light, face) && !is_separated(face, light)
}

/// Whether an object may have emissive faces.
fn can_object_emit(scene: &Scene, meshes: &[&LoadedMesh], object: usize) -> bool {
    let object = &scene.objects[object];
    match (object.material, object.shape.as_mesh()) {
        (Some(material), _) => scene.materials[material].emits(),
        (None, Some(mesh)) => meshes[mesh.file].materials.iter().any(FileMaterial::emits),
        (None, None) => false,
    }
}

/// Visits an object's flat faces. If `near` is given, skips mesh faces that are not near these lights.
fn visit_flat_faces_of_object(
    scene: &Scene,
    meshes: &[&LoadedMesh],
    (number, origin): (usize, DVec3),
    near: Option<&EmissiveFacesByMinX>,
    mut visit: impl FnMut(&FlatFace),
) {
    let object = &scene.objects[number];
    let material = object.material.map(|index| &scene.materials[index]);
    let emits = material.filter(|material| material.emits()).map(Material::emission_sides);
    let (shape, matrix) = object.shape.shape_and_matrix();
    let map = matrix.map(|matrix| matrix.to_transform().relative_to_origins(DVec3::ZERO, origin));
    // The map also translates the origin.
    let origin = if map.is_some() { DVec3::ZERO } else { origin };
    let mut visit = |face: Option<FlatFace>, emits: Option<EmissionSides>| {
        let transformed = |face: FlatFace| if let Some(map) = &map { face.transformed(map) } else { face };
        if let Some(mut face) = face.map(transformed) {
            (face.object, face.emits) = (number, emits);
            visit(&face);
        }
    };
    let polygon = |corners: Vec<DVec3>| FlatFace::new(corners.into_iter().map(|at| at - origin).collect());
    match *shape {
        Shape::Quad { corner, u, v } => {
            visit(polygon(vec![corner, corner + u, corner + u + v, corner + v]), emits);
        }
        Shape::Triangle { a, b, c } => visit(polygon(vec![a, b, c]), emits),
        Shape::Box { center, size, rotate } => {
            let cuboid = OrientedBox::new(center, size, rotate);
            for face in 0..6 {
                let corners =
                    [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y].map(|u| cuboid.sample_point_on_part(face, u));
                let mut face = polygon(corners.map(|corner| corner.point).to_vec());
                if let Some(face) = &mut face {
                    face.normal = corners[0].normal;
                }
                visit(face, emits);
            }
        }
        Shape::Disk { center, normal, radius } => {
            visit(polygon(inscribed_octagon(center, normal, radius)), emits);
        }
        Shape::Cylinder { a, b, radius, caps: true } => {
            visit(polygon(inscribed_octagon(a, a - b, radius)), emits);
            visit(polygon(inscribed_octagon(b, b - a, radius)), emits);
        }
        Shape::Cone { base, tip, radius, cap: true } => {
            visit(polygon(inscribed_octagon(base, base - tip, radius)), emits);
        }
        Shape::Plane { point, normal } => {
            let normal = normal.normalize_or_zero();
            let face = FlatFace {
                object: number,
                corners: Vec::new(),
                point: point - origin,
                normal,
                emits,
                rounding: 0.0,
            };
            visit(Some(face), emits);
        }
        Shape::Mesh(ref mesh) => {
            let loaded = meshes[mesh.file];
            let transform = mesh.placed.to_transform();
            let own = |triangle: usize| {
                let material = *loaded.mesh.materials.get(triangle)? as usize;
                loaded.materials.get(material).filter(|own| own.emits()).map(|_| EmissionSides::Front)
            };
            for triangle in 0..loaded.mesh.triangles.len() {
                let corners = loaded.mesh.corners(triangle as u32);
                let local = corners.iter().fold(Vec3::ZERO, |most, at| most.max(at.abs()));
                let local = transform.transform_abs_bound(local.as_dvec3()).max_element();
                let [a, b, c] = corners.map(|at| transform.point(at.as_dvec3() + loaded.mesh.origin));
                let [min, max] = [a.min(b).min(c) - origin, a.max(b).max(c) - origin];
                let rounding = ROUNDING * local.max(min.abs().max(max.abs()).max_element());
                let bounds = [min - rounding, max + rounding];
                if near.is_some_and(|lights| lights.are_apart_from_box(bounds)) {
                    continue;
                }
                let corners = if transform.flips_handedness() { vec![a, c, b] } else { vec![a, b, c] };
                let face = polygon(corners).map(|face| FlatFace { rounding, ..face });
                visit(face, if material.is_some() { emits } else { own(triangle) });
            }
        }
        Shape::Sphere { .. }
        | Shape::Torus { .. }
        | Shape::Cylinder { .. }
        | Shape::Cone { .. }
        | Shape::Transformed { .. } => {}
    }
}

/// An octagon inscribed in a circle, counterclockwise about the normal.
fn inscribed_octagon(center: DVec3, normal: DVec3, radius: f64) -> Vec<DVec3> {
    let (x, y) = normal.normalize_or(DVec3::Y).any_orthonormal_pair();
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let turns = [(1.0, 0.0), (half, half), (0.0, 1.0), (-half, half)];
    let all = turns.into_iter().chain(turns.map(|(cos, sin)| (-cos, -sin)));
    all.map(|(cos, sin)| center + (x * cos + y * sin) * radius).collect()
}

#[cfg(test)]
#[path = "coplanar_tests.rs"]
mod tests;
