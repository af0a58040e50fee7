//! Writes shapes.

use std::ops::Range;

use super::lexer::{PbrtError, PbrtResult};
use super::parameters::Parameters;
use super::scene::{LoweredMaterial, PbrtConverter};
use super::state::ShapeEntity;
use crate::formats::foreign::meshes::MeshData;
use crate::formats::foreign::transform::{is_invertible_affine, matrix_value, similarity_scale};
use crate::formats::rounding::shorten_number;
use crate::math::{DMat4, DVec2, DVec3};
use crate::scene::nearest::nearest_name;
use crate::scene::sanitize::escape_and_truncate;

/// Number of cells around a round shape that is converted to a mesh.
const ROUND_CELLS: u32 = 128;

/// Shapes of pbrt-v4.
const SHAPES: [&str; 8] =
    ["sphere", "disk", "cylinder", "trianglemesh", "plymesh", "loopsubdiv", "bilinearmesh", "curve"];

/// Shapes that exist only in pbrt-v3.
const OLD_SHAPES: [&str; 5] = ["cone", "paraboloid", "hyperboloid", "heightfield", "nurbs"];

/// A shape's material and placement.
pub(super) struct MaterialAndPlacement<'a> {
    pub(super) material: String,
    /// Whether the material uses texture coordinates or tangents.
    pub(super) needs_uv: bool,
    /// Whether the shape is a light.
    pub(super) emits: bool,
    pub(super) is_reversed: bool,
    pub(super) matrix: DMat4,
    /// The group that contains the shape.
    pub(super) group: Option<&'a str>,
    pub(super) span: Range<usize>,
}

/// A sphere, disk or cylinder around the z axis.
struct RoundShape {
    radius: f64,
    z: [f64; 2],
    inner_radius: f64,
    /// Azimuth at which the surface ends, in radians.
    azimuth: f64,
}

impl PbrtConverter<'_> {
    /// Writes a shape. `group` is the group that contains it.
    pub(super) fn convert_shape(&mut self, shape: &ShapeEntity, group: Option<&str>) {
        let written = self.try_convert_shape(shape, group);
        self.value_or_record_error(written);
    }

    fn try_convert_shape(&mut self, shape: &ShapeEntity, group: Option<&str>) -> PbrtResult<()> {
        let entity = &shape.placed.entity;
        let (kind, span) = (&*entity.kind.text, entity.span());
        if kind == "curve" {
            self.notes.note_lighting_substitution("shape `curve`", "skipped", span);
            return Ok(());
        }
        if !SHAPES.contains(&kind) {
            return Err(unknown_shape(kind, entity.kind.span.clone()));
        }
        let matrix = self.still_transform(shape.placed.transform, span.clone());
        if !is_invertible_affine(&matrix) {
            if matrix.is_finite() && matrix.determinant() == 0.0 {
                self.notes.note("a shape with a singular transform", "skipped", span);
                return Ok(());
            }
            return Err(PbrtError::new(span, "the transform of this shape is not invertible"));
        }
        let data = match kind {
            "trianglemesh" | "loopsubdiv" => Some(triangle_mesh(&entity.parameters)?),
            "bilinearmesh" => Some(bilinear_mesh(&entity.parameters)?),
            _ => None,
        };
        let properties = self.shape_properties(shape, data.as_ref(), &matrix, group.is_some())?;
        let Some(properties) = properties else { return Ok(()) };
        let material = self.find_or_add_material(&shape.material, &shape.material_span, &properties);
        let (material, needs_uv, has_inside) = match material {
            LoweredMaterial::Table { name, needs_uv, has_inside } => (name, needs_uv, has_inside),
            LoweredMaterial::Invisible => {
                self.mark_shape_parameters_used(&entity.parameters);
                return Ok(());
            }
            LoweredMaterial::Invalid => return Ok(()),
        };
        if has_inside && shape.is_reversed {
            let text = "a closed surface has glass inside, whatever its orientation";
            self.notes.note("`ReverseOrientation` of a dielectric", text, span.clone());
        }
        let placement = MaterialAndPlacement {
            material,
            needs_uv,
            emits: properties.emission.is_some(),
            // All surfaces scatter light on both sides, so their orientation matters only for lights.
            is_reversed: shape.is_reversed && properties.emission.is_some(),
            matrix,
            group,
            span,
        };
        match (kind, data) {
            ("loopsubdiv", Some(data)) => self.convert_subdivided(data, &entity.parameters, &placement)?,
            (_, Some(data)) => self.convert_mesh_data(data, kind, &placement),
            ("plymesh", None) => self.convert_mesh_file(&entity.parameters, &placement)?,
            (_, None) => self.convert_round_shape(kind, &entity.parameters, &placement)?,
        }
        entity.parameters.check_all_used()
    }

    /// Marks the parameters of a shape without a surface as used, since their values do not matter.
    fn mark_shape_parameters_used(&self, parameters: &Parameters) {
        parameters.ignore(&["alpha", "P", "N", "uv", "indices"]);
    }

    fn start_shape_table(&mut self, table: &'static str, placement: &MaterialAndPlacement<'_>) {
        self.document.set_span_for_next_values(placement.span.clone());
        match placement.group {
            Some(group) => self.document.start_group_list_table(group, table),
            None => self.document.start_list_table(table),
        }
        self.document.set("material", placement.material.clone());
    }

    fn set_matrix(&mut self, matrix: &DMat4) {
        if *matrix != DMat4::IDENTITY {
            self.document.set("matrix", matrix_value(matrix));
        }
    }

    /// Writes a mesh that exists only in memory.
    pub(super) fn convert_mesh_data(
        &mut self,
        mut data: MeshData,
        stem: &str,
        placement: &MaterialAndPlacement<'_>,
    ) {
        data.drop_degenerate_triangles();
        if data.triangles.is_empty() {
            self.notes.note("a mesh without area", "skipped", placement.span.clone());
            return;
        }
        data.orient_triangles_like_pbrt(placement.is_reversed);
        if placement.needs_uv {
            data.add_default_uvs();
        }
        let name = self.add_generated_file(stem, "ply", data.encode_ply());
        self.start_shape_table("mesh", placement);
        self.document.set("file", name);
        if data.normals.is_empty() {
            self.document.set("smooth", false);
        }
        self.set_matrix(&placement.matrix);
    }

    fn convert_subdivided(
        &mut self,
        mut data: MeshData,
        parameters: &Parameters,
        placement: &MaterialAndPlacement<'_>,
    ) -> PbrtResult<()> {
        let levels = parameters.integer("levels", 3, 0..=i64::from(i32::MAX))?;
        parameters.ignore(&["scheme"]);
        /// Maximum number of triangles after subdivision.
        const MAX_TRIANGLES: usize = 16 << 20;
        let fits = |level: &i64| data.triangles.len() << (2 * level) <= MAX_TRIANGLES;
        let most = (0..=6).rev().find(fits).unwrap_or(0);
        if levels > most {
            let text = format!("{most} levels are used");
            self.notes.note("many levels of `loopsubdiv`", &text, parameters.span_of("levels"));
        }
        let text =
            "Loop's weights are used; pbrt's move vertices with few edges up to 1/8 of an edge farther";
        self.notes.note("the weights of `loopsubdiv`", text, placement.span.clone());
        // The normals of the control mesh have no effect.
        data.normals.clear();
        data.drop_degenerate_triangles();
        if data.triangles.is_empty() {
            self.notes.note("a mesh without area", "skipped", placement.span.clone());
            return Ok(());
        }
        data.orient_triangles_like_pbrt(placement.is_reversed);
        let name = self.add_generated_file("loopsubdiv", "ply", data.encode_ply());
        self.start_shape_table("mesh", placement);
        self.document.set("file", name);
        self.document.set("subdivide", levels.min(most) as f64);
        self.set_matrix(&placement.matrix);
        Ok(())
    }

    /// Writes a sphere, a disk or a cylinder.
    fn convert_round_shape(
        &mut self,
        kind: &str,
        parameters: &Parameters,
        placement: &MaterialAndPlacement<'_>,
    ) -> PbrtResult<()> {
        let round = read_round_shape(kind, parameters)?;
        let is_whole = match kind {
            "sphere" => round.z == [-round.radius, round.radius],
            _ => round.inner_radius == 0.0,
        } && round.azimuth >= std::f64::consts::TAU - 1e-6;
        // glimt's round shapes face outward, and only its spheres can match pbrt's texture coordinates.
        let is_plain = is_whole
            && (!placement.is_reversed || kind == "disk")
            && (kind == "sphere" || !placement.needs_uv);
        if !is_plain {
            let mesh = tessellate_round_shape(kind, &round);
            if !is_whole {
                let text = "a mesh with 128 cells around the axis is used";
                self.notes.note(&format!("a partial `{kind}`"), text, placement.span.clone());
            }
            self.convert_mesh_data(mesh, kind, placement);
            return Ok(());
        }
        match kind {
            "sphere" => self.convert_sphere(round.radius, placement),
            "disk" => {
                self.start_shape_table("disk", placement);
                self.document.set("center", [0.0, 0.0, round.z[0]]);
                let normal = if placement.is_reversed { -1.0 } else { 1.0 };
                self.document.set("normal", [0.0, 0.0, normal]);
                self.document.set("radius", round.radius);
                self.set_matrix(&placement.matrix);
            }
            _ => {
                self.start_shape_table("cylinder", placement);
                self.document.set("a", [0.0, 0.0, round.z[0]]);
                self.document.set("b", [0.0, 0.0, round.z[1]]);
                self.document.set("radius", round.radius);
                self.document.set("caps", false);
                self.set_matrix(&placement.matrix);
            }
        }
        Ok(())
    }

    fn convert_sphere(&mut self, radius: f64, placement: &MaterialAndPlacement<'_>) {
        self.start_shape_table("sphere", placement);
        match similarity_scale(&placement.matrix).filter(|_| !placement.needs_uv) {
            Some(scale) => {
                self.document.set("center", placement.matrix.w_axis.truncate());
                self.document.set("radius", shorten_number(radius * scale));
            }
            None => {
                self.document.set("center", DVec3::ZERO);
                self.document.set("radius", radius);
                // The poles of glimt's spheres are on the y axis, and u starts at −x.
                let axes = DMat4::from_cols(
                    DVec3::NEG_X.extend(0.0),
                    DVec3::Z.extend(0.0),
                    DVec3::NEG_Y.extend(0.0),
                    crate::math::DVec4::W,
                );
                self.set_matrix(&(placement.matrix * axes));
            }
        }
    }
}

fn unknown_shape(kind: &str, span: Range<usize>) -> Box<PbrtError> {
    let shown = escape_and_truncate(kind, 40);
    if OLD_SHAPES.contains(&kind) {
        let error = PbrtError::new(span, format!("\"{shown}\" is a pbrt-v3 shape"));
        return error.with_help(super::parameters::V3_HELP);
    }
    let error = PbrtError::new(span, format!("unknown shape \"{shown}\""));
    error.with_suggestion(nearest_name(kind, SHAPES))
}

/// Reads the indices of a mesh, checks them, and returns them in groups of `N`.
fn vertex_indices<const N: usize>(parameters: &Parameters, vertices: usize) -> PbrtResult<Vec<[u32; N]>> {
    let indices = parameters.integers("indices")?;
    let span = || parameters.span_of("indices");
    if indices.is_empty() && vertices == N {
        return Ok(vec![std::array::from_fn(|index| index as u32)]);
    }
    if let Some(wrong) = indices.iter().find(|index| !(0..vertices as i64).contains(*index)) {
        let message = format!("vertex {wrong} is out of range: the mesh has {vertices}, numbered from 0");
        return Err(PbrtError::new(span(), message));
    }
    let (groups, rest) = indices.as_chunks::<N>();
    if !rest.is_empty() || groups.is_empty() {
        let message = format!("`indices` must have groups of {N} numbers, but has {}", indices.len());
        return Err(PbrtError::new(span(), message));
    }
    Ok(groups.iter().map(|group| group.map(|index| index as u32)).collect())
}

/// Checks that a list is empty or has one entry per vertex.
fn per_vertex<T>(
    parameters: &Parameters,
    name: &'static str,
    values: Vec<T>,
    vertices: usize,
) -> PbrtResult<Vec<T>> {
    if values.is_empty() || values.len() == vertices {
        return Ok(values);
    }
    let message = format!("`{name}` has {} entries, but there are {vertices} vertices", values.len());
    Err(PbrtError::new(parameters.span_of(name), message))
}

/// Reads a `trianglemesh`, or the control mesh of a `loopsubdiv`.
fn triangle_mesh(parameters: &Parameters) -> PbrtResult<MeshData> {
    let positions = parameters.point3s("P")?;
    if positions.is_empty() {
        return Err(PbrtError::new(parameters.span.clone(), "this mesh has no vertices `P`"));
    }
    let count = positions.len();
    let triangles = vertex_indices::<3>(parameters, count)?;
    let normals = per_vertex(parameters, "N", parameters.normals("N")?, count)?;
    let uvs = per_vertex(parameters, "uv", parameters.point2s("uv")?, count)?;
    parameters.ignore(&["S", "faceIndices"]);
    Ok(MeshData { positions, normals, uvs, triangles, ..MeshData::default() })
}

/// Reads a `bilinearmesh` and tessellates its patches, whose corners are (0, 0), (1, 0), (0, 1) and (1, 1).
fn bilinear_mesh(parameters: &Parameters) -> PbrtResult<MeshData> {
    /// Number of cells along each side of a curved patch.
    const CELLS: u32 = 16;
    let positions = parameters.point3s("P")?;
    if positions.is_empty() {
        return Err(PbrtError::new(parameters.span.clone(), "this mesh has no vertices `P`"));
    }
    let count = positions.len();
    let patches = vertex_indices::<4>(parameters, count)?;
    let normals = per_vertex(parameters, "N", parameters.normals("N")?, count)?;
    let uvs = per_vertex(parameters, "uv", parameters.point2s("uv")?, count)?;
    parameters.ignore(&["faceIndices"]);
    let mut all = MeshData::default();
    for patch in patches {
        let at = patch.map(|vertex| vertex as usize);
        let corners = at.map(|vertex| positions[vertex]);
        let [p00, p10, p01, p11] = corners;
        let is_flat =
            (p10 + p01 - p00 - p11).length() <= 1e-6 * (p11 - p00).length().max((p10 - p01).length());
        let cells = if is_flat { 1 } else { CELLS };
        let mut mesh = MeshData::tessellate_surface([cells, cells], |uv| {
            let along_u = (p10 - p00).lerp(p11 - p01, uv.y);
            let along_v = (p01 - p00).lerp(p11 - p10, uv.x);
            let normal = match normals.is_empty() {
                true => along_u.cross(along_v),
                false => interpolate_bilinearly(at.map(|vertex| normals[vertex]), uv),
            };
            (interpolate_bilinearly(corners, uv), normal.normalize_or_zero())
        });
        if !uvs.is_empty() {
            let corners = at.map(|vertex| uvs[vertex]);
            mesh.uvs.iter_mut().for_each(|uv| *uv = interpolate_bilinearly(corners, *uv));
        }
        let start = all.positions.len() as u32;
        all.positions.extend(mesh.positions);
        all.normals.extend(mesh.normals);
        all.uvs.extend(mesh.uvs);
        all.triangles.extend(mesh.triangles.iter().map(|triangle| triangle.map(|vertex| vertex + start)));
    }
    Ok(all)
}

/// Interpolates the values at the corners (0, 0), (1, 0), (0, 1) and (1, 1).
fn interpolate_bilinearly<T>([a, b, c, d]: [T; 4], uv: DVec2) -> T
where
    T: std::ops::Mul<f64, Output = T> + std::ops::Add<Output = T>,
{
    (a * (1.0 - uv.x) + b * uv.x) * (1.0 - uv.y) + (c * (1.0 - uv.x) + d * uv.x) * uv.y
}

/// Returns the area of a sphere, disk or cylinder before its transform.
pub(super) fn round_shape_area(kind: &str, parameters: &Parameters) -> PbrtResult<f64> {
    let RoundShape { radius, z: [low, high], inner_radius, azimuth } = read_round_shape(kind, parameters)?;
    Ok(match kind {
        "disk" => 0.5 * azimuth * (radius * radius - inner_radius * inner_radius),
        _ => azimuth * radius * (high - low),
    })
}

fn read_round_shape(kind: &str, parameters: &Parameters) -> PbrtResult<RoundShape> {
    let radius = parameters.positive_float("radius", 1.0)?;
    let azimuth = parameters.float("phimax", 360.0)?.clamp(0.0, 360.0).to_radians();
    let z = match kind {
        "sphere" => {
            let z = [parameters.float("zmin", -radius)?, parameters.float("zmax", radius)?];
            [z[0].min(z[1]), z[0].max(z[1])].map(|z| z.clamp(-radius, radius))
        }
        "disk" => [parameters.float("height", 0.0)?; 2],
        _ => {
            let z = [parameters.float("zmin", -1.0)?, parameters.float("zmax", 1.0)?];
            [z[0].min(z[1]), z[0].max(z[1])]
        }
    };
    let inner_radius = if kind == "disk" { parameters.float("innerradius", 0.0)? } else { 0.0 };
    if azimuth == 0.0 || kind != "disk" && z[0] == z[1] || inner_radius >= radius {
        return Err(PbrtError::new(parameters.span.clone(), "these parameters leave nothing of the shape"));
    }
    Ok(RoundShape { radius, z, inner_radius: inner_radius.max(0.0), azimuth })
}

/// Tessellates a round shape, with pbrt's texture coordinates.
fn tessellate_round_shape(kind: &str, round: &RoundShape) -> MeshData {
    let circle = |u: f64| {
        let (sine, cosine) = libm::sincos(u * round.azimuth);
        DVec3::new(cosine, sine, 0.0)
    };
    match kind {
        "sphere" => {
            let [low, high] = round.z.map(|z| libm::acos((z / round.radius).clamp(-1.0, 1.0)));
            MeshData::tessellate_surface([ROUND_CELLS, ROUND_CELLS / 2], |uv| {
                let (sine, cosine) = libm::sincos(low + (high - low) * uv.y);
                let normal = circle(uv.x) * sine + DVec3::Z * cosine;
                (normal * round.radius, normal)
            })
        }
        "disk" => MeshData::tessellate_surface([ROUND_CELLS, 1], |uv| {
            let radius = round.radius + (round.inner_radius - round.radius) * uv.y;
            (circle(uv.x) * radius + DVec3::Z * round.z[0], DVec3::Z)
        }),
        _ => MeshData::tessellate_surface([ROUND_CELLS, 1], |uv| {
            let normal = circle(uv.x);
            (normal * round.radius + DVec3::Z * (round.z[0] + (round.z[1] - round.z[0]) * uv.y), normal)
        }),
    }
}
