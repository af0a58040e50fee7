//! Lights coplanar with other surfaces.
//!
//! For two surfaces in one plane, rounding determines which surface a ray hits first. Path rays might hit a
//! coplanar light while shadow rays to the light are blocked, or the reverse, and the two estimates of its
//! contribution would disagree. Coplanar lights are therefore moved off the plane by a tiny distance, toward
//! the side to which they emit.

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

use super::MeshTree;
use crate::assets::{FileMaterial, LoadedMesh};
use crate::geometry::cuboid::Cuboid;
use crate::geometry::mesh::TriangleMesh;
use crate::materials::EmissionSides;
use crate::math::{DVec3, Vec2, Vec3};
use crate::scene::description::{Scene, Shape};

/// Distance between a light and a plane, relative to the light's size, below which they are considered
/// coplanar.
const COINCIDENT: f64 = 1.0 / (1 << 20) as f64;
/// Lift relative to the size of the light and its surroundings: well above `f32` rounding errors, but too
/// small to be visible.
const LIFT: f64 = 1.0 / (1 << 16) as f64;
/// Maximum sine of the angle between the normals of coplanar faces.
const PARALLEL: f64 = 1e-5;
/// Maximum size of a light's surroundings, relative to the light's size.
const SURROUNDINGS: f64 = 16.0;
/// Maximum number of light/face pairs to compare. Further pairs are ignored.
const MAX_PAIRS: usize = 1 << 26;

/// A light that overlaps a coplanar surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CoplanarLight {
    /// The emitting object.
    pub light: usize,
    /// The other object, which is the same object if both faces belong to one mesh.
    pub surface: usize,
    /// Translation that moves the light off the surface.
    pub lift: DVec3,
}

/// A flat, convex part of an object.
#[derive(Clone, Debug)]
struct FlatFace {
    object: usize,
    /// Corners in counterclockwise order as seen from the front. Empty for an infinite plane.
    corners: Vec<DVec3>,
    point: DVec3,
    /// Unit normal on the front side.
    normal: DVec3,
    emits: Option<EmissionSides>,
}

impl FlatFace {
    fn new(corners: Vec<DVec3>) -> Option<Self> {
        let [a, b, c] = *corners.first_chunk()?;
        let normal = (b - a).cross(c - a).try_normalize()?;
        Some(Self { object: 0, corners, point: a, normal, emits: None })
    }

    /// Bounding box of the corners. `None` for an infinite plane.
    fn bounds(&self) -> Option<[DVec3; 2]> {
        let first = *self.corners.first()?;
        let grow = |[least, greatest]: [DVec3; 2], at: &DVec3| [least.min(*at), greatest.max(*at)];
        Some(self.corners.iter().fold([first; 2], grow))
    }

    fn size(&self) -> f64 {
        self.bounds().map_or(f64::INFINITY, |[least, greatest]| (greatest - least).max_element())
    }

    /// Whether the face emits on the side facing along this normal.
    fn emits_along(&self, normal: DVec3) -> bool {
        match self.emits {
            None => false,
            Some(EmissionSides::Both) => true,
            Some(EmissionSides::Front) => self.normal.dot(normal) > 0.0,
        }
    }
}

/// Emissive faces, sorted by minimum x.
struct EmissiveFaces {
    faces: Vec<FlatFace>,
    bounds: Vec<[DVec3; 2]>,
    /// Maximum extent along x, plus a margin.
    widest: f64,
    /// Bounding box of all faces, plus a margin.
    region: [DVec3; 2],
}

impl EmissiveFaces {
    /// Sorts the faces. `None` if there are no faces.
    fn new(mut faces: Vec<FlatFace>) -> Option<Self> {
        let least_x = |face: &FlatFace| face.bounds().map_or(f64::NEG_INFINITY, |[least, _]| least.x);
        faces.sort_by(|a, b| least_x(a).total_cmp(&least_x(b)));
        let bounds: Vec<[DVec3; 2]> = faces.iter().filter_map(FlatFace::bounds).collect();
        let joined = |a: [DVec3; 2], b: &[DVec3; 2]| [a[0].min(b[0]), a[1].max(b[1])];
        let [least, greatest] = bounds.iter().fold(*bounds.first()?, joined);
        let margin = (greatest - least).max_element() * COINCIDENT;
        let widest = bounds.iter().map(|[least, greatest]| greatest.x - least.x).fold(0.0, f64::max) + margin;
        Some(Self { faces, bounds, widest, region: [least - margin, greatest + margin] })
    }

    /// Whether there cannot be any lights near a box.
    fn are_apart_from(&self, bounds: [DVec3; 2]) -> bool {
        are_boxes_apart(bounds, self.region)
    }

    /// Returns the lights whose bounding boxes touch a face's bounding box. Increases `pairs` by the number
    /// of compared lights.
    fn near<'a>(&'a self, face: &FlatFace, pairs: &mut usize) -> impl Iterator<Item = &'a FlatFace> {
        let [least, greatest] = face.bounds().unwrap_or(self.region);
        let margin = (self.region[1] - self.region[0]).max_element() * COINCIDENT;
        let bounds = [least - margin, greatest + margin];
        let start = self.bounds.partition_point(|light| light[0].x < bounds[0].x - self.widest);
        let end = self.bounds.partition_point(|light| light[0].x <= bounds[1].x);
        *pairs += end - start;
        let range = start..end;
        range
            .filter(move |index| !are_boxes_apart(self.bounds[*index], bounds))
            .map(|index| &self.faces[index])
    }
}

/// Finds lights that overlap a coplanar surface. Coordinates are relative to `origin`. `meshes` contains the
/// scene's loaded mesh files.
pub fn coplanar_lights(scene: &Scene, meshes: &[&LoadedMesh], origin: DVec3) -> Vec<CoplanarLight> {
    let mut faces = Vec::new();
    for object in (0..scene.objects.len()).filter(|object| may_emit(scene, meshes, *object)) {
        each_flat_face(scene, meshes, (object, origin), None, |face| {
            if face.emits.is_some() && !face.corners.is_empty() {
                faces.push(face.clone());
            }
        });
    }
    let Some(lights) = EmissiveFaces::new(faces) else { return Vec::new() };
    let mut found = BTreeMap::new();
    let mut pairs = 0;
    // Lights that touch glass are not moved because the handling of coincident glass surfaces resolves this
    // case.
    let is_glass = |object: &usize| {
        scene.objects[*object].material.is_some_and(|own| scene.materials[own].kind.is_glass())
    };
    for object in (0..scene.objects.len()).filter(|object| !is_glass(object)) {
        each_flat_face(scene, meshes, (object, origin), Some(&lights), |face| {
            if pairs > MAX_PAIRS {
                return;
            }
            for light in lights.near(face, &mut pairs) {
                if must_lift(light, face) && are_coplanar_and_overlap(light, face) {
                    add_coplanar_pair(&mut found, light, face);
                }
            }
        });
    }
    found.into_values().flatten().collect()
}

/// Whether two boxes, given as minimum and maximum corners, are disjoint.
fn are_boxes_apart(a: [DVec3; 2], b: [DVec3; 2]) -> bool {
    a[0].cmpgt(b[1]).any() || a[1].cmplt(b[0]).any()
}

/// Translation of each object, which moves lights off coplanar surfaces. Empty if no lights need to be moved.
pub fn light_lifts(scene: &Scene, meshes: &[Arc<MeshTree>], origin: DVec3) -> Vec<DVec3> {
    let loaded: Vec<_> = meshes.iter().map(|mesh| mesh.loaded()).collect();
    let found = coplanar_lights(scene, &loaded, origin);
    if found.is_empty() {
        return Vec::new();
    }
    let mut lifts = vec![DVec3::ZERO; scene.objects.len()];
    let mut directions: Vec<(usize, DVec3)> = Vec::new();
    for CoplanarLight { light, lift, .. } in found.into_iter().filter(|pair| pair.light != pair.surface) {
        // Lift a light only once if it is coplanar with several surfaces.
        let direction = lift.normalize_or_zero();
        directions.retain(|(other, _)| *other == light);
        if !directions.iter().any(|(_, known)| known.dot(direction) > 1.0 - PARALLEL) {
            directions.push((light, direction));
            lifts[light] += lift;
        }
    }
    lifts
}

/// Mesh in which emissive triangles coplanar with other faces of the mesh are moved off these faces. `None`
/// if there are no such triangles.
pub fn with_lifted_lights(loaded: &LoadedMesh) -> Option<LoadedMesh> {
    let mesh = &loaded.mesh;
    let emits = |triangle: u32| {
        let material =
            mesh.materials.get(triangle as usize).and_then(|own| loaded.materials.get(*own as usize));
        material.is_some_and(FileMaterial::emits)
    };
    if !loaded.materials.iter().any(FileMaterial::emits) {
        return None;
    }
    // Find the triangles to lift.
    let face = |triangle: u32| {
        let face = FlatFace::new(mesh.corners(triangle).map(|corner| corner.as_dvec3()).to_vec())?;
        Some(FlatFace { object: triangle as usize, ..face })
    };
    let all = 0..mesh.triangles.len() as u32;
    let lights = EmissiveFaces::new(all.clone().filter(|id| emits(*id)).filter_map(face).collect())?;
    let (mut found, mut pairs) = (BTreeMap::new(), 0);
    for other in all.filter(|id| !emits(*id)).filter_map(face) {
        if pairs > MAX_PAIRS {
            break;
        }
        let near = lights.near(&other, &mut pairs).filter(|light| are_coplanar_and_overlap(light, &other));
        found.extend(near.map(|light| (light.object, light.normal)));
    }
    let greatest =
        |face: &FlatFace| face.corners.iter().fold(face.size(), |most, at| most.max(at.abs().max_element()));
    let height = LIFT * lights.faces.iter().map(greatest).fold(0.0, f64::max);
    // Give the lifted triangles separate vertices.
    let mut lifted = loaded.clone();
    let mut known = HashMap::new();
    for (triangle, normal) in &found {
        let direction = (*normal * 1e4).round().to_array().map(|part| part as i32);
        let corners = mesh.triangles[*triangle].map(|corner| {
            *known.entry((corner, direction)).or_insert_with(|| {
                let at = mesh.positions[corner as usize].as_dvec3() + *normal * height;
                copy_vertex(&mut lifted.mesh, corner as usize, at.as_vec3())
            })
        });
        lifted.mesh.triangles[*triangle] = corners;
    }
    (!found.is_empty()).then_some(lifted)
}

/// Adds a copy of a vertex at position `at`.
fn copy_vertex(mesh: &mut TriangleMesh, vertex: usize, at: Vec3) -> u32 {
    fn copy<T: Copy>(values: &mut Vec<T>, vertex: usize) {
        values.extend(values.get(vertex).copied());
    }
    mesh.positions.push(at);
    copy(&mut mesh.normals, vertex);
    copy(&mut mesh.normal_groups, vertex);
    copy(&mut mesh.uvs, vertex);
    copy(&mut mesh.second_uvs, vertex);
    copy(&mut mesh.colors, vertex);
    (mesh.positions.len() - 1) as u32
}

/// Adds a light and the surface that it overlaps. If the pair exists, updates its lift in this direction to
/// the maximum over all faces.
fn add_coplanar_pair(
    found: &mut BTreeMap<(usize, usize), Vec<CoplanarLight>>,
    light: &FlatFace,
    face: &FlatFace,
) {
    let size = light.size();
    let around = face.size().max(light.point.abs().max_element()).min(SURROUNDINGS * size);
    let lift = light.normal * (LIFT * size.max(around));
    let of_pair = found.entry((light.object, face.object)).or_default();
    match of_pair.iter_mut().find(|known| known.lift.dot(lift) > 0.0) {
        Some(known) if known.lift.length_squared() < lift.length_squared() => known.lift = lift,
        Some(_) => {}
        None => of_pair.push(CoplanarLight { light: light.object, surface: face.object, lift }),
    }
}

/// Whether to lift the light off the face along the light's normal. This hides the back of a two-sided light.
/// The light is not lifted if the face also emits on that side.
fn must_lift(light: &FlatFace, face: &FlatFace) -> bool {
    !face.emits_along(light.normal)
}

/// Whether two faces are coplanar and overlap.
fn are_coplanar_and_overlap(light: &FlatFace, face: &FlatFace) -> bool {
    let apart = light.size().min(face.size()) * COINCIDENT;
    let is_on_plane = |corner: &DVec3| (*corner - face.point).dot(face.normal).abs() <= apart;
    let sine = light.normal.cross(face.normal).length_squared();
    if sine > PARALLEL * PARALLEL || !light.corners.iter().all(is_on_plane) {
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
fn may_emit(scene: &Scene, meshes: &[&LoadedMesh], object: usize) -> bool {
    let object = &scene.objects[object];
    match (object.material, object.shape.mesh()) {
        (Some(material), _) => scene.materials[material].emits(),
        (None, Some(mesh)) => meshes[mesh.file].materials.iter().any(FileMaterial::emits),
        (None, None) => false,
    }
}

/// Visits an object's flat faces. If `near` is given, skips mesh faces that are not near these lights.
fn each_flat_face(
    scene: &Scene,
    meshes: &[&LoadedMesh],
    (number, origin): (usize, DVec3),
    near: Option<&EmissiveFaces>,
    mut visit: impl FnMut(&FlatFace),
) {
    let object = &scene.objects[number];
    let material = object.material.map(|index| &scene.materials[index]);
    let emits = material.filter(|material| material.emits()).map(|material| material.emission.sides);
    let mut visit = |face: Option<FlatFace>, emits: Option<EmissionSides>| {
        if let Some(mut face) = face {
            (face.object, face.emits) = (number, emits);
            visit(&face);
        }
    };
    let polygon = |corners: Vec<DVec3>| FlatFace::new(corners.into_iter().map(|at| at - origin).collect());
    match object.shape {
        Shape::Quad { corner, u, v } => {
            visit(polygon(vec![corner, corner + u, corner + u + v, corner + v]), emits);
        }
        Shape::Triangle { a, b, c } => visit(polygon(vec![a, b, c]), emits),
        Shape::Box { center, size, rotate } => {
            let cuboid = Cuboid::new(center, size, rotate);
            for face in 0..6 {
                let corners = [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y].map(|u| cuboid.sample(face, u));
                let mut face = polygon(corners.map(|corner| corner.point).to_vec());
                if let Some(face) = &mut face {
                    face.normal = corners[0].normal;
                }
                visit(face, emits);
            }
        }
        Shape::Disk { center, normal, radius } => visit(polygon(octagon(center, normal, radius)), emits),
        Shape::Cylinder { a, b, radius, caps: true } => {
            visit(polygon(octagon(a, a - b, radius)), emits);
            visit(polygon(octagon(b, b - a, radius)), emits);
        }
        Shape::Cone { base, tip, radius, cap: true } => {
            visit(polygon(octagon(base, base - tip, radius)), emits);
        }
        Shape::Plane { point, normal } => {
            let normal = normal.normalize_or_zero();
            let face = FlatFace { object: number, corners: Vec::new(), point: point - origin, normal, emits };
            visit(Some(face), emits);
        }
        Shape::Mesh(ref mesh) => {
            let loaded = meshes[mesh.file];
            let transform = mesh.placed.transform();
            let own = |triangle: usize| {
                let material = *loaded.mesh.materials.get(triangle)? as usize;
                loaded.materials.get(material).filter(|own| own.emits()).map(|_| EmissionSides::Front)
            };
            for triangle in 0..loaded.mesh.triangles.len() {
                let corners = loaded.mesh.corners(triangle as u32);
                let [a, b, c] = corners.map(|at| transform.point(at.as_dvec3() + loaded.mesh.origin));
                let bounds = [a.min(b).min(c) - origin, a.max(b).max(c) - origin];
                if near.is_some_and(|lights| lights.are_apart_from(bounds)) {
                    continue;
                }
                let corners = if transform.flips_handedness() { vec![a, c, b] } else { vec![a, b, c] };
                visit(polygon(corners), if material.is_some() { emits } else { own(triangle) });
            }
        }
        Shape::Sphere { .. } | Shape::Torus { .. } | Shape::Cylinder { .. } | Shape::Cone { .. } => {}
    }
}

/// An octagon inscribed in a circle, counterclockwise about the normal.
fn octagon(center: DVec3, normal: DVec3, radius: f64) -> Vec<DVec3> {
    let (x, y) = normal.normalize_or(DVec3::Y).any_orthonormal_pair();
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let turns = [(1.0, 0.0), (half, half), (0.0, 1.0), (-half, half)];
    let all = turns.into_iter().chain(turns.map(|(cos, sin)| (-cos, -sin)));
    all.map(|(cos, sin)| center + (x * cos + y * sin) * radius).collect()
}

#[cfg(test)]
#[path = "coplanar_tests.rs"]
mod tests;
