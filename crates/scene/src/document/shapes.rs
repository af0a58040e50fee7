//! The tables of shapes, such as `[[sphere]]`, except meshes.

use super::super::description::{Object, ObjectTransform, Shape};
use super::super::keys::key::DefaultValue::{By, Is, Required};
use super::super::keys::key::ValueKind::{Flag, Number, Numbers};
use super::super::keys::key::{ANGLES, DIRECTION, POINT};
use super::super::toml::TableId;
use super::NO_AREA;
use super::context::Issue;
use super::key::KeyInTable;
use super::limits::Limits::{Any, Length};
use super::materials::MaterialList;
use super::mesh::MESH;
use super::shape_table::{MeshFileRegistry, ShapeTableDefinition, shape_table};
use super::table::TableReader;
use super::transform::read_affine_matrix;
use crate::math::DVec3;

/// All shapes.
pub(crate) static SHAPES: [ShapeTableDefinition; 10] =
    [SPHERE, QUAD, PLANE, BOX, TRIANGLE, DISK, CYLINDER, CONE, TORUS, MESH];

shape_table! {
    /// A sphere.
    const SPHERE = "sphere", |table, _| read_sphere(table);
    /// The center.
    center: POINT, Required("[0, 0.5, 0]"), "length";
    /// The radius.
    radius: Number(Length), Required("0.5"), "length";
}

fn read_sphere(table: &TableReader<'_>) -> Option<Shape> {
    let (center, radius) = (table.key("center").vector(), table.key("radius").number());
    Some(Shape::Sphere { center: center?, radius: radius? })
}

shape_table! {
    /// A parallelogram: `corner` + s·`u` + t·`v` with s and t from 0 to 1. The front faces along `u` ×
    /// `v`.
    const QUAD = "quad", |table, _| read_quad(table);
    /// The corner.
    corner: POINT, Is("[-1, 0, 1]"), "length";
    /// The first edge.
    u: Numbers(3, "edge", Any), Is("[2, 0, 0]"), "length";
    /// The second edge, not parallel to the first.
    v: Numbers(3, "edge", Any), Is("[0, 0, -2]"), "length";
}

fn read_quad(table: &TableReader<'_>) -> Option<Shape> {
    let (u_key, v_key) = (table.key("u"), table.key("v"));
    let corner = table.key("corner").vector();
    let (u, v) = (u_key.vector(), v_key.vector());
    let (corner, u, v) = (corner?, u?, v?);
    if !(u_key.check_vector_zero_or_long_enough(u) & v_key.check_vector_zero_or_long_enough(v)) {
        return None;
    }
    if !edges_span_area(u, v) {
        let wrong = if u == DVec3::ZERO { u_key.value_span() } else { v_key.value_span() };
        let span = wrong.or(u_key.value_span())?;
        let issue = Issue::error(span, format!("the quad {NO_AREA}"))
            .with_label("`u` and `v` are parallel, or one of them is 0")
            .with_help("use two edges in different directions");
        table.context.report(issue);
        return None;
    }
    Some(Shape::Quad { corner, u, v })
}

shape_table! {
    /// An infinite plane; it cannot be an area light.
    const PLANE = "plane", |table, _| read_plane(table);
    /// A point on the plane.
    point: POINT, Is("[0, 0, 0]"), "length";
    /// Direction that the front faces.
    normal: DIRECTION, Is("[0, 1, 0]");
}

fn read_plane(table: &TableReader<'_>) -> Option<Shape> {
    let (point, normal) = (table.key("point").vector(), table.key("normal").nonzero_direction("plane"));
    Some(Shape::Plane { point: point?, normal: normal? })
}

shape_table! {
    /// A box, rotated about its center by `rotate`.
    const BOX = "box", |table, _| read_box(table);
    /// The center.
    center: POINT, Is("[0, 0.5, 0]"), "length";
    /// Edge lengths.
    size: Numbers(3, "three numbers", Length), Is("[1, 1, 1]"), "length";
    /// Rotation about x, then y, then z.
    rotate: ANGLES, Is("[0, 0, 0]"), "degrees";
}

fn read_box(table: &TableReader<'_>) -> Option<Shape> {
    let [center, size, rotate] = ["center", "size", "rotate"].map(|name| table.key(name).vector());
    Some(Shape::Box { center: center?, size: size?, rotate: rotate? })
}

shape_table! {
    /// A triangle. The front faces along (`b` − `a`) × (`c` − `a`).
    const TRIANGLE = "triangle", |table, _| read_triangle(table);
    /// The first corner.
    a: POINT, Is("[0, 0, 0]"), "length";
    /// The second corner.
    b: POINT, Is("[1, 0, 0]"), "length";
    /// The third corner, not collinear with the others.
    c: POINT, Is("[0, 1, 0]"), "length";
}

fn read_triangle(table: &TableReader<'_>) -> Option<Shape> {
    let keys = ["a", "b", "c"].map(|name| table.key(name));
    let [a_key, b_key, c_key] = &keys;
    let (a, b, c) = (a_key.vector(), b_key.vector(), c_key.vector());
    let (a, b, c) = (a?, b?, c?);
    if !(a_key.check_points_equal_or_far_apart(a, b_key, b)
        && a_key.check_points_equal_or_far_apart(a, c_key, c)
        && b_key.check_points_equal_or_far_apart(b, c_key, c))
    {
        return None;
    }
    if !edges_span_area(b - a, c - a) {
        let span = keys.iter().rev().find_map(KeyInTable::value_span)?;
        let issue = Issue::error(span, format!("the triangle {NO_AREA}"))
            .with_label("`a`, `b` and `c` are collinear")
            .with_help("use three points that are not collinear");
        table.context.report(issue);
        return None;
    }
    Some(Shape::Triangle { a, b, c })
}

shape_table! {
    /// A disk.
    const DISK = "disk", |table, _| read_disk(table);
    /// The center.
    center: POINT, Is("[0, 0, 0]"), "length";
    /// Direction that the front faces.
    normal: DIRECTION, Is("[0, 1, 0]");
    /// The radius.
    radius: Number(Length), Is("0.5"), "length";
}

fn read_disk(table: &TableReader<'_>) -> Option<Shape> {
    let center = table.key("center").vector();
    let normal = table.key("normal").nonzero_direction("disk");
    let radius = table.key("radius").number();
    Some(Shape::Disk { center: center?, normal: normal?, radius: radius? })
}

shape_table! {
    /// A cylinder.
    const CYLINDER = "cylinder", |table, _| read_cylinder(table);
    /// Center of one end.
    a: POINT, Is("[0, 0, 0]"), "length";
    /// Center of the other end.
    b: POINT, Is("[0, 1, 0]"), "length";
    /// The radius.
    radius: Number(Length), Is("0.5"), "length";
    /// Whether the ends are closed.
    caps: Flag, Is("true");
}

fn read_cylinder(table: &TableReader<'_>) -> Option<Shape> {
    let ends = read_axis_ends(table, ["a", "b"], "cylinder");
    let (radius, caps) = (table.key("radius").number(), table.key("caps").boolean());
    let [a, b] = ends?;
    Some(Shape::Cylinder { a, b, radius: radius?, caps: caps? })
}

shape_table! {
    /// A cone.
    const CONE = "cone", |table, _| read_cone(table);
    /// Center of the base.
    base: POINT, Is("[0, 0, 0]"), "length";
    /// The tip.
    tip: POINT, Is("[0, 1, 0]"), "length";
    /// The radius of the base.
    radius: Number(Length), Is("0.5"), "length";
    /// Whether the base is closed.
    cap: Flag, Is("true");
}

fn read_cone(table: &TableReader<'_>) -> Option<Shape> {
    let ends = read_axis_ends(table, ["base", "tip"], "cone");
    let (radius, cap) = (table.key("radius").number(), table.key("cap").boolean());
    let [base, tip] = ends?;
    Some(Shape::Cone { base, tip, radius: radius?, cap: cap? })
}

shape_table! {
    /// A torus.
    const TORUS = "torus", |table, _| read_torus(table);
    /// The center.
    center: POINT, Is("[0, 0, 0]"), "length";
    /// The axis of symmetry.
    axis: DIRECTION, Is("[0, 1, 0]");
    /// Distance from the center to the middle of the tube.
    radius: Number(Length), Is("0.5"), "length";
    /// The radius of the tube, less than `radius`.
    tube: Number(Length), By("a quarter of `radius`"), "length";
}

/// Reads a torus. Rejects self-intersecting tori, whose surface has no consistent front side.
fn read_torus(table: &TableReader<'_>) -> Option<Shape> {
    let center = table.key("center").vector();
    let axis = table.key("axis").nonzero_direction("torus");
    let radius = table.key("radius").number();
    let tube_key = table.key("tube");
    let tube = if tube_key.is_present() { tube_key.number() } else { radius.map(|radius| radius / 4.0) };
    let (radius, tube) = (radius?, tube?);
    if tube >= radius {
        let issue = Issue::error(tube_key.value_span()?, "the torus intersects itself")
            .with_label(format!("`tube` must be less than `radius` = {radius}"))
            .with_help(
                "`radius` is measured to the middle of the tube, and `tube` from there to the surface",
            );
        table.context.report(issue);
        return None;
    }
    Some(Shape::Torus { center: center?, axis: axis?, radius, tube })
}

/// Reads the shapes of a scene or a group, and passes them to `add` with the IDs of their tables. Returns
/// whether all are valid.
pub(super) fn read_shape_objects(
    parent: &TableReader<'_>,
    materials: &MaterialList,
    files: &mut MeshFileRegistry,
    mut add: impl FnMut(TableId, Object),
) -> bool {
    let mut is_valid = true;
    for shape in &SHAPES {
        for table in parent.tables(&shape.info) {
            match read_object(shape, &table, materials, files) {
                Some(object) => add(table.table_id(), object),
                None => is_valid = false,
            }
        }
    }
    is_valid
}

/// Reads an object. Its matrix is not yet applied to its shape; see [`Object::with_outer_transform`].
fn read_object(
    kind: &ShapeTableDefinition,
    table: &TableReader<'_>,
    materials: &MaterialList,
    files: &mut MeshFileRegistry,
) -> Option<Object> {
    let shape = (kind.read)(table, files);
    let (is_mesh, is_plane) = (kind.info.name == "mesh", kind.info.name == "plane");
    // The mesh reader has already read the matrix.
    let matrix = Some(table.key("matrix")).filter(|matrix| !is_mesh && matrix.is_present());
    let matrix = matrix.map(|matrix| read_affine_matrix(&matrix));
    let key = table.key("material");
    let material = key.index_by_name(&materials.names);
    let name = table.key("name").optional_shape_name();
    table.report_unknown_and_missing_keys();
    if is_plane && material.is_some_and(|index| materials.is_emissive(index)) {
        let issue = Issue::error(key.value_span()?, "an infinite plane cannot emit light")
            .with_label("this material has `emission`")
            .with_help("use a [[quad]] or a material without emission");
        table.context.report(issue);
        return None;
    }
    if key.is_present() && material.is_none() || !is_mesh && material.is_none() {
        return None;
    }
    let shape = match matrix {
        Some(matrix) => Shape::Transformed { shape: Box::new(shape?), matrix: matrix? },
        None => shape?,
    };
    let uses_object_point = material.is_some_and(|index| materials.uses_object_point(index));
    let placement = uses_object_point.then(|| Box::new(ObjectTransform::IDENTITY.to_affine_map()));
    Some(Object { shape, material, placement, name: name?, span: table.span.clone() })
}

/// Reads both ends of an axis.
fn read_axis_ends(table: &TableReader<'_>, names: [&str; 2], what: &str) -> Option<[DVec3; 2]> {
    let [from, to] = names.map(|name| table.key(name));
    let (first, second) = (from.vector(), to.vector());
    let (first, second) = (first?, second?);
    if !from.check_points_equal_or_far_apart(first, &to, second) {
        return None;
    }
    if first == second {
        let span = to.value_span().or_else(|| from.value_span())?;
        let [from, to] = [from.info, to.info];
        let issue = Issue::error(span, format!("the {what} has no length"))
            .with_label(format!("`{}` and `{}` are the same point", from.name, to.name))
            .with_help(format!("the defaults are `{}` and `{}`", from.example_line(), to.example_line()));
        table.context.report(issue);
        return None;
    }
    Some([first, second])
}

/// Whether two edges span an area: both are nonzero, and the sine of the angle between them is larger than
/// rounding errors.
fn edges_span_area(u: DVec3, v: DVec3) -> bool {
    const MIN_SINE: f64 = 1e-10;
    match (u.try_normalize(), v.try_normalize()) {
        (Some(u), Some(v)) => u.cross(v).length() > MIN_SINE,
        _ => false,
    }
}
