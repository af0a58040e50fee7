//! Parts of glass solids: objects that do not enclose a volume individually, and the open rims of their
//! surfaces.

use std::collections::HashMap;

use super::super::file_materials::file_material_glass_properties;
use crate::assets::{FileMaterial, LoadedMesh};
use crate::control::{CancelToken, Canceled};
use crate::geometry::mesh::TriangleMesh;
use crate::math::DVec3;
use crate::math::transform::Transform;
use crate::scene::description::{
    MaterialKind, MeshReference, MicrofacetDistribution, NumberSource, Object, OpenSurface, Scene, Shape,
};

/// Chords per circular rim. All rims on one circle use the same points.
const CHORDS: usize = 32;

/// Relative rounding error of coordinates in a file with single precision or six decimal digits.
pub(super) const ROUNDING: f64 = 16.0 * f32::EPSILON as f64;

/// A glass object that does not enclose a volume on its own.
#[derive(Clone, Debug)]
pub(super) struct GlassPart {
    /// Object id.
    pub object: u32,
    /// Surface area.
    pub area: f64,
    /// Integral of x·n/3 over the surface, which is the volume if the surface is closed and its front faces
    /// outward.
    pub volume: f64,
    /// Position tolerance of the part's points.
    pub tolerance: f64,
    /// Type of glass.
    pub substance: GlassMediumKey,
}

/// Type of glass, identified by the bit patterns of the index of refraction and transmittance, or `None` for
/// a mesh with several types of glass.
pub(super) type GlassMediumKey = Option<[u64; 4]>;

/// A straight edge of a part's boundary, directed so that the surface is on its left as seen from the front.
#[derive(Clone, Copy, Debug)]
pub(super) struct RimEdge {
    /// Index of the part.
    pub part: u32,
    /// Start and end points.
    pub ends: [DVec3; 2],
    /// A point on the surface near the edge.
    pub inner: DVec3,
}

/// All glass parts in a scene, in coordinates relative to a point near them.
#[derive(Debug, Default)]
pub(super) struct GlassParts {
    pub list: Vec<GlassPart>,
    pub rims: Vec<RimEdge>,
    /// Origin of the coordinates.
    pub origin: DVec3,
}

impl GlassParts {
    /// Finds all parts in a scene.
    pub fn find_in_scene(
        scene: &Scene,
        meshes: &[&LoadedMesh],
        token: &CancelToken,
    ) -> Result<Self, Canceled> {
        let mut parts = Self::default();
        let mut open_of_file: HashMap<usize, Vec<[u32; 2]>> = HashMap::new();
        for (number, object) in (0_u32..).zip(&scene.objects) {
            let Some(glass) = all_or_some_triangles_are_glass(scene, meshes, object) else { continue };
            token.check_pause_and_cancel()?;
            if parts.list.is_empty() {
                parts.origin = point_on_or_inside_shape(&object.shape, meshes);
            }
            let first = parts.list.len();
            if let Some(mesh) = object.shape.as_mesh() {
                let loaded = meshes[mesh.file];
                let open = open_of_file.entry(mesh.file).or_insert_with(|| open_edges(&loaded.mesh));
                parts.add_mesh(number, mesh, loaded, glass, open);
            } else if let Some(sheet) = object.shape.untransformed_open_surface() {
                let first = parts.rims.len();
                parts.add_open_surface(number, &sheet);
                if let (_, Some(matrix)) = object.shape.shape_and_matrix() {
                    parts.transform_last_part(first, &matrix.to_transform());
                }
            }
            for part in &mut parts.list[first..] {
                part.substance = glass_medium_key_of_object(scene, meshes, object);
            }
        }
        Ok(parts)
    }

    /// Adds an open shape.
    fn add_open_surface(&mut self, number: u32, sheet: &OpenSurface) {
        match *sheet {
            OpenSurface::Quad(corners) => self.add_polygon_part(number, &corners),
            OpenSurface::Triangle(corners) => self.add_polygon_part(number, &corners),
            OpenSurface::Disk { center, normal, radius } => {
                let normal = normal.normalize();
                let area = std::f64::consts::PI * radius * radius;
                let volume = area * (center - self.origin).dot(normal) / 3.0;
                self.begin_part(number, (area, volume), radius);
                self.add_circular_rim(center, normal, radius, center);
            }
            OpenSurface::Cylinder { a, b, radius } => {
                let axis = (b - a).normalize();
                let area = std::f64::consts::TAU * radius * a.distance(b);
                self.begin_part(number, (area, area * radius / 3.0), radius.max(a.distance(b)));
                self.add_circular_rim(b, -axis, radius, a);
                self.add_circular_rim(a, axis, radius, b);
            }
            OpenSurface::Cone { base, tip, radius } => {
                let axis = (tip - base).normalize();
                let area =
                    std::f64::consts::PI * radius * (radius * radius + tip.distance_squared(base)).sqrt();
                let shown = axis * (std::f64::consts::PI * radius * radius);
                let volume = (tip - self.origin).dot(shown) / 3.0;
                self.begin_part(number, (area, volume), radius.max(tip.distance(base)));
                self.add_circular_rim(base, axis, radius, tip);
            }
        }
    }

    /// Transforms the last part, whose rims start at index `first`, preserving which side is the front.
    fn transform_last_part(&mut self, first: usize, to_scene: &Transform) {
        let map = to_scene.relative_to_origins(self.origin, self.origin);
        // The area vector, the integral of the normal, depends only on the boundary.
        let mut area_vector = DVec3::ZERO;
        for rim in &mut self.rims[first..] {
            let [from, to] = rim.ends;
            area_vector += from.cross(to) * 0.5;
            (rim.ends, rim.inner) = ([from, to].map(|end| map.point(end)), map.point(rim.inner));
            if map.flips_handedness() {
                rim.ends.reverse();
            }
        }
        let volume_scale = map.linear.determinant().abs();
        let Some(part) = self.list.last_mut() else { return };
        part.volume = volume_scale * (part.volume + map.normal(area_vector).dot(map.translation) / 3.0);
        // Scale the area like the area vector, which is exact for flat parts. If that vector is zero, use the
        // mean scale.
        let flat = map.normal(area_vector.normalize_or_zero()).length() * volume_scale;
        part.area *= if flat > 0.0 { flat } else { libm::pow(volume_scale, 2.0 / 3.0) };
        part.tolerance *= map.transform_abs_bound(DVec3::ONE).max_element();
    }

    fn begin_part(&mut self, object: u32, (area, volume): (f64, f64), reach: f64) -> u32 {
        self.list.push(GlassPart { object, area, volume, tolerance: ROUNDING * reach, substance: None });
        self.list.len() as u32 - 1
    }

    /// Adds a planar polygon with corners in counterclockwise order as seen from the front.
    fn add_polygon_part(&mut self, object: u32, corners: &[DVec3]) {
        let own: Vec<DVec3> = corners.iter().map(|&corner| corner - self.origin).collect();
        let halves = (1..own.len() - 1).map(|i| (own[i] - own[0]).cross(own[i + 1] - own[0]) * 0.5);
        let normal: DVec3 = halves.sum();
        let reach = own.iter().map(|corner| corner.distance(own[0])).fold(0.0, f64::max);
        let part = self.begin_part(object, (normal.length(), normal.dot(own[0]) / 3.0), reach);
        let middle = own.iter().sum::<DVec3>() / own.len() as f64;
        for i in 0..own.len() {
            self.rims.push(RimEdge { part, ends: [own[i], own[(i + 1) % own.len()]], inner: middle });
        }
    }

    /// Adds a circular rim to the last part, counterclockwise about a unit axis.
    fn add_circular_rim(&mut self, center: DVec3, axis: DVec3, radius: f64, inner: DVec3) {
        let part = self.list.len() as u32 - 1;
        // Rims on the same circle must have the same points in either direction.
        let lead = axis.to_array().into_iter().find(|part| part.abs() > 1e-9).unwrap_or(1.0);
        let up = if lead < 0.0 { -axis } else { axis };
        let away = if up.x.abs() < 0.9 { DVec3::X } else { DVec3::Y };
        let first = up.cross(away).normalize();
        let second = up.cross(first);
        let middle = center - self.origin;
        let point = |i: usize| {
            let angle = std::f64::consts::TAU * (i % CHORDS) as f64 / CHORDS as f64;
            middle + (first * libm::cos(angle) + second * libm::sin(angle)) * radius
        };
        for i in 0..CHORDS {
            let (from, to) = (point(i), point(i + 1));
            let ends = if lead < 0.0 { [to, from] } else { [from, to] };
            self.rims.push(RimEdge { part, ends, inner: inner - self.origin });
        }
    }

    fn add_mesh(
        &mut self,
        object: u32,
        placed: &MeshReference,
        loaded: &LoadedMesh,
        glass: GlassTriangleSelection,
        open: &[[u32; 2]],
    ) {
        let mesh = &loaded.mesh;
        let place = placed.placed.to_transform().relative_to_origins(mesh.origin, self.origin);
        let mirrors = place.flips_handedness();
        let is_glass = |triangle: usize| match glass {
            GlassTriangleSelection::All => true,
            GlassTriangleSelection::Some => mesh
                .materials
                .get(triangle)
                .is_some_and(|&own| loaded.materials.get(own as usize).is_some_and(FileMaterial::is_glass)),
        };
        // Sum area and volume over the triangles in world coordinates.
        let (mut area, mut volume, mut reach) = (0.0, 0.0, DVec3::ZERO);
        for (_, triangle) in mesh.triangles.iter().enumerate().filter(|&(i, _)| is_glass(i)) {
            let [a, b, c] = triangle.map(|vertex| {
                let own = mesh.positions[vertex as usize].as_dvec3();
                reach = reach.max(own.abs());
                place.point(own)
            });
            let normal = (b - a).cross(c - a) * 0.5;
            area += normal.length();
            volume += normal.dot(a) / 3.0;
        }
        if area == 0.0 {
            return;
        }
        let volume = if mirrors { -volume } else { volume };
        let part = self.begin_part(object, (area, volume), place.transform_abs_bound(reach).max_element());
        for &[triangle, edge] in open.iter().filter(|open| is_glass(open[0] as usize)) {
            let corner = |i: u32| {
                let vertex = mesh.triangles[triangle as usize][(i % 3) as usize];
                place.point(mesh.positions[vertex as usize].as_dvec3())
            };
            let (from, to) = (corner(edge), corner(edge + 1));
            let ends = if mirrors { [to, from] } else { [from, to] };
            self.rims.push(RimEdge { part, ends, inner: corner(edge + 2) });
        }
    }
}

/// Returns a point on or inside a shape.
fn point_on_or_inside_shape(shape: &Shape, meshes: &[&LoadedMesh]) -> DVec3 {
    let of_mesh = |placed: &MeshReference| {
        let mesh = &meshes[placed.file].mesh;
        let first = mesh.positions.first().map_or(DVec3::ZERO, |first| first.as_dvec3());
        placed.placed.to_transform().point(mesh.origin + first)
    };
    shape.representative_point().or_else(|| shape.as_mesh().map(of_mesh)).unwrap_or(DVec3::ZERO)
}

/// Which of an object's triangles are glass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum GlassTriangleSelection {
    /// All triangles, or the whole object if it is not a mesh.
    All,
    /// Triangles whose material in the mesh file is glass.
    Some,
}

/// Returns which triangles of an object are glass, or `None` if the object contains no glass.
pub(super) fn all_or_some_triangles_are_glass(
    scene: &Scene,
    meshes: &[&LoadedMesh],
    object: &Object,
) -> Option<GlassTriangleSelection> {
    match (object.material, object.shape.as_mesh()) {
        (Some(index), _) => {
            scene.materials[index].kind.is_solid_glass().then_some(GlassTriangleSelection::All)
        }
        (None, Some(mesh)) => meshes[mesh.file]
            .materials
            .iter()
            .any(FileMaterial::is_glass)
            .then_some(GlassTriangleSelection::Some),
        (None, None) => None,
    }
}

/// The type of glass that an object is made of.
fn glass_medium_key_of_object(scene: &Scene, meshes: &[&LoadedMesh], object: &Object) -> GlassMediumKey {
    match (object.material, object.shape.as_mesh()) {
        (Some(index), _) => scene.materials[index].kind.glass_medium_identity(),
        (None, Some(mesh)) => {
            let roughness = NumberSource::Constant(0.0);
            let distribution = MicrofacetDistribution::Ggx;
            let of = |(ior, tint)| {
                MaterialKind::Glass { ior, tint, roughness, distribution }.glass_medium_identity()
            };
            let mut each =
                meshes[mesh.file].materials.iter().filter_map(file_material_glass_properties).filter_map(of);
            let first = each.next()?;
            each.all(|other| other == first).then_some(first)
        }
        (None, None) => None,
    }
}

/// Returns the mesh's open edges as (triangle, edge number) pairs. Two edges with equal endpoints and
/// opposite directions are not open.
fn open_edges(mesh: &TriangleMesh) -> Vec<[u32; 2]> {
    let all = (0..mesh.triangles.len() as u32).flat_map(|triangle| (0..3).map(move |edge| [triangle, edge]));
    let open = edges_without_opposite(mesh, all, |vertex| vertex);
    if open.is_empty() {
        return open;
    }
    // At UV seams, several vertices have the same position.
    let bits = |vertex: u32| mesh.positions[vertex as usize].to_array().map(|part| (part + 0.0).to_bits());
    let mut order: Vec<u32> =
        open.iter().flat_map(|&[triangle, _]| mesh.triangles[triangle as usize]).collect();
    order.sort_unstable();
    order.dedup();
    order.sort_by_key(|&vertex| (bits(vertex), vertex));
    let mut first = HashMap::with_capacity(order.len());
    let mut last = None;
    for vertex in order {
        let own = match last {
            Some((place, own)) if place == bits(vertex) => own,
            Some(_) | None => vertex,
        };
        last = Some((bits(vertex), own));
        first.insert(vertex, own);
    }
    edges_without_opposite(mesh, open.into_iter(), |vertex| first.get(&vertex).copied().unwrap_or(vertex))
}

/// Returns the edges in `edges` that have no matching edge in the opposite direction. `place` maps coincident
/// vertices to one representative.
fn edges_without_opposite(
    mesh: &TriangleMesh,
    edges: impl Iterator<Item = [u32; 2]> + Clone,
    place: impl Fn(u32) -> u32,
) -> Vec<[u32; 2]> {
    let ends = |[triangle, edge]: [u32; 2]| {
        let corners = mesh.triangles[triangle as usize];
        [corners[edge as usize], corners[(edge as usize + 1) % 3]].map(&place)
    };
    // Sort the edges by their lower endpoint (counting sort).
    let mut starts = vec![0_u32; mesh.positions.len() + 1];
    for edge in edges.clone() {
        let [a, b] = ends(edge);
        starts[a.min(b) as usize + 1] += 1;
    }
    for vertex in 0..mesh.positions.len() {
        starts[vertex + 1] += starts[vertex];
    }
    let count = starts[mesh.positions.len()] as usize;
    let mut next = starts.clone();
    let mut sorted = vec![(0_u32, false, [0_u32; 2]); count];
    for edge in edges {
        let [a, b] = ends(edge);
        let place = &mut next[a.min(b) as usize];
        sorted[*place as usize] = (a.max(b), a > b, edge);
        *place += 1;
    }
    // Cancel pairs of edges with equal endpoints and opposite directions.
    let mut open = Vec::new();
    for range in starts.windows(2).filter(|range| range[0] < range[1]) {
        let own = &mut sorted[range[0] as usize..range[1] as usize];
        own.sort_unstable();
        for same in own.chunk_by(|one, other| one.0 == other.0) {
            let down = same.iter().filter(|half| half.1).count();
            let up = same.len() - down;
            let both = up.min(down);
            let of_up = same[..up].iter().skip(both);
            let of_down = same[up..].iter().skip(both);
            open.extend(of_up.chain(of_down).map(|half| half.2));
        }
    }
    open
}
