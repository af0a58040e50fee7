//! Shapes.

use std::ops::Range;

use super::super::fingerprint::{FingerprintContext, FingerprintHasher, Fingerprinted};
use super::transform::{AffineMap, ObjectTransform};
use crate::geometry;
use crate::geometry::cone::Cone;
use crate::geometry::cuboid::OrientedBox;
use crate::geometry::cylinder::Cylinder;
use crate::geometry::disk::Disk;
use crate::geometry::parallelogram::Parallelogram;
use crate::geometry::plane::Plane;
use crate::geometry::sphere::Sphere;
use crate::geometry::torus::Torus;
use crate::geometry::transformed::TransformedShape;
use crate::geometry::triangle::Triangle;
use crate::math::DVec3;
use crate::math::transform::Transform;

/// A shape and its material.
#[derive(Clone, Debug, PartialEq)]
pub struct Object {
    /// The geometry.
    pub shape: Shape,
    /// Index into [`Scene::materials`](super::Scene::materials). `None` for the mesh file's own materials.
    pub material: Option<usize>,
    /// The map from the shape's own coordinates, before its matrix and the transforms of groups, to scene
    /// coordinates. `None` unless the material has a texture that uses these coordinates. [`Object::shape`]
    /// already includes the map.
    pub placement: Option<Box<AffineMap>>,
    /// Value of the key `name`, if any.
    pub name: Option<Box<str>>,
    /// Byte range of the table header in the file.
    pub span: Range<usize>,
}

impl Object {
    /// Applies a transform after the matrix of a shape or the transform of a mesh.
    #[must_use]
    pub fn with_outer_transform(self, outer: &ObjectTransform) -> Self {
        let own = self.shape.transform();
        let transform = own.then(outer);
        // The keys `scale`, `rotate` and `translate` are a mesh's own.
        let has_own_steps = match own {
            ObjectTransform::Steps { .. } => self.shape.as_mesh().is_some(),
            ObjectTransform::Matrix(_) => false,
        };
        let placement = if has_own_steps { outer } else { &transform };
        Self {
            placement: self.placement.map(|_| Box::new(placement.to_affine_map())),
            shape: self.shape.with_replaced_transform(transform),
            ..self
        }
    }

    /// Returns the map from the shape's own coordinates to world coordinates relative to `origin`.
    pub fn object_frame(&self, origin: DVec3) -> Transform {
        let placed = self.placement.as_ref().map_or(Transform::IDENTITY, |placed| placed.to_transform());
        placed.relative_to_origins(DVec3::ZERO, origin)
    }
}

/// The geometry of an object.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// A sphere.
    Sphere {
        /// Center.
        center: DVec3,
        /// Radius, > 0.
        radius: f64,
    },
    /// A parallelogram: corner + s·u + t·v with s and t in [0, 1]. The front side faces in the direction
    /// u × v, which must be nonzero.
    Quad {
        /// The corner at s = t = 0.
        corner: DVec3,
        /// First edge.
        u: DVec3,
        /// Second edge.
        v: DVec3,
    },
    /// An infinite plane.
    Plane {
        /// A point on the plane.
        point: DVec3,
        /// Direction that the front side faces. Any nonzero length.
        normal: DVec3,
    },
    /// An oriented box.
    Box {
        /// Center.
        center: DVec3,
        /// Edge lengths, > 0.
        size: DVec3,
        /// Rotation in degrees about x, then y, then z.
        rotate: DVec3,
    },
    /// A triangle. The front faces along (b − a) × (c − a) ≠ 0.
    Triangle {
        /// First corner.
        a: DVec3,
        /// Second corner.
        b: DVec3,
        /// Third corner.
        c: DVec3,
    },
    /// A disk.
    Disk {
        /// Center.
        center: DVec3,
        /// Direction that the front side faces. Any nonzero length.
        normal: DVec3,
        /// Radius, > 0.
        radius: f64,
    },
    /// A cylinder.
    Cylinder {
        /// Start of the axis.
        a: DVec3,
        /// End of the axis, different from `a`.
        b: DVec3,
        /// Radius, > 0.
        radius: f64,
        /// Whether disks close the ends.
        caps: bool,
    },
    /// A cone.
    Cone {
        /// Center of the base.
        base: DVec3,
        /// The tip, different from `base`.
        tip: DVec3,
        /// Radius of the base, > 0.
        radius: f64,
        /// Whether a disk closes the base.
        cap: bool,
    },
    /// A torus.
    Torus {
        /// Center.
        center: DVec3,
        /// Axis of symmetry. Any nonzero length.
        axis: DVec3,
        /// Distance from the center of the torus to the middle of the tube, > `tube`.
        radius: f64,
        /// Radius of the tube, > 0.
        tube: f64,
    },
    /// An instance of a mesh file.
    Mesh(MeshReference),
    /// Another shape, but not a mesh, under an affine map. See [`Shape::transformed`].
    Transformed {
        /// The shape before the map.
        shape: Box<Self>,
        /// The map, applied after the shape's own keys.
        matrix: AffineMap,
    },
}

/// An open surface, which does not enclose a volume on its own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum OpenSurface {
    /// The corners of a parallelogram, counterclockwise when seen from the front.
    Quad([DVec3; 4]),
    /// The corners of a triangle, counterclockwise when seen from the front.
    Triangle([DVec3; 3]),
    /// A disk.
    Disk {
        /// Center.
        center: DVec3,
        /// Normal of the front side. Any length.
        normal: DVec3,
        /// Radius.
        radius: f64,
    },
    /// The lateral surface of a cylinder.
    Cylinder {
        /// Center of one end.
        a: DVec3,
        /// Center of the other end.
        b: DVec3,
        /// Radius.
        radius: f64,
    },
    /// The lateral surface of a cone.
    Cone {
        /// Center of the base.
        base: DVec3,
        /// The tip.
        tip: DVec3,
        /// Radius of the base.
        radius: f64,
    },
}

/// An instance of a mesh file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeshReference {
    /// Index into [`Scene::mesh_files`](super::Scene::mesh_files).
    pub file: usize,
    /// Transform from file coordinates to scene coordinates.
    pub placed: ObjectTransform,
    /// Whether vertex normals are interpolated.
    pub smooth: bool,
    /// Whether vertex colors multiply the material's color.
    pub vertex_colors: bool,
}

/// A shape in the representation used for tracing.
#[derive(Clone, Debug, PartialEq)]
pub enum LoweredShape<'a> {
    /// An analytic shape.
    Shape(geometry::Shape),
    /// A triangle mesh from a file.
    Mesh(&'a MeshReference),
}

impl Shape {
    /// Applies an affine map. The front side remains the front side. If the result is a shape of the same
    /// kind with the same texture coordinates, returns it as such rather than as [`Self::Transformed`],
    /// because it is faster to trace.
    #[must_use]
    pub fn transformed(self, matrix: AffineMap) -> Self {
        let map = matrix.to_transform();
        let (at, along) = (|point: DVec3| map.point(point), |vector: DVec3| map.vector(vector));
        let flips = map.flips_handedness();
        match (self, matrix.unrotated_uniform_scale()) {
            (Self::Quad { corner, u, v }, _) if !flips => {
                Self::Quad { corner: at(corner), u: along(u), v: along(v) }
            }
            (Self::Triangle { a, b, c }, _) if !flips => Self::Triangle { a: at(a), b: at(b), c: at(c) },
            (Self::Sphere { center, radius }, Some(scale)) => {
                Self::Sphere { center: at(center), radius: radius * scale }
            }
            (Self::Box { center, size, rotate }, Some(scale)) => {
                Self::Box { center: at(center), size: size * scale, rotate }
            }
            (Self::Disk { center, normal, radius }, Some(scale)) => {
                Self::Disk { center: at(center), normal, radius: radius * scale }
            }
            (Self::Cylinder { a, b, radius, caps }, Some(scale)) => {
                Self::Cylinder { a: at(a), b: at(b), radius: radius * scale, caps }
            }
            (Self::Cone { base, tip, radius, cap }, Some(scale)) => {
                Self::Cone { base: at(base), tip: at(tip), radius: radius * scale, cap }
            }
            (Self::Torus { center, axis, radius, tube }, Some(scale)) => {
                Self::Torus { center: at(center), axis, radius: radius * scale, tube: tube * scale }
            }
            // Texture tiles on a plane have an edge length of 1.
            (Self::Plane { point, normal }, Some(1.0)) => Self::Plane { point: at(point), normal },
            (shape, _) => Self::Transformed { shape: Box::new(shape), matrix },
        }
    }

    /// Replaces the transform of a mesh, or the matrix of another shape; see [`Shape::transformed`].
    #[must_use]
    pub fn with_replaced_transform(self, transform: ObjectTransform) -> Self {
        match self {
            Self::Mesh(mesh) => Self::Mesh(MeshReference { placed: transform, ..mesh }),
            Self::Transformed { shape, matrix: _ } => shape.transformed(transform.to_affine_map()),
            shape if transform == ObjectTransform::IDENTITY => shape,
            shape => shape.transformed(transform.to_affine_map()),
        }
    }

    /// Returns the transform of a mesh, or the matrix of another shape. Without a matrix, returns the
    /// identity.
    pub fn transform(&self) -> ObjectTransform {
        match self {
            Self::Mesh(mesh) => mesh.placed,
            Self::Transformed { matrix, .. } => ObjectTransform::Matrix(*matrix),
            Self::Sphere { .. }
            | Self::Quad { .. }
            | Self::Plane { .. }
            | Self::Box { .. }
            | Self::Triangle { .. }
            | Self::Disk { .. }
            | Self::Cylinder { .. }
            | Self::Cone { .. }
            | Self::Torus { .. } => ObjectTransform::IDENTITY,
        }
    }

    /// Lowers the shape for tracing, with coordinates relative to `origin`.
    pub fn to_traced_shape_relative_to(&self, origin: DVec3) -> LoweredShape<'_> {
        let at = |place: DVec3| place - origin;
        LoweredShape::Shape(match *self {
            Self::Sphere { center, radius } => geometry::Shape::Sphere(Sphere { center: at(center), radius }),
            Self::Quad { corner, u, v } => geometry::Shape::Quad(Parallelogram::new(at(corner), u, v)),
            Self::Plane { point, normal } => geometry::Shape::Plane(Plane::new(at(point), normal)),
            Self::Box { center, size, rotate } => {
                geometry::Shape::Box(OrientedBox::new(at(center), size, rotate))
            }
            Self::Triangle { a, b, c } => {
                geometry::Shape::Triangle(Triangle { a: at(a), b: at(b), c: at(c) })
            }
            Self::Disk { center, normal, radius } => {
                geometry::Shape::Disk(Disk::new(at(center), normal, radius))
            }
            Self::Cylinder { a, b, radius, caps } => {
                geometry::Shape::Cylinder(Cylinder::new(at(a), at(b), radius, caps))
            }
            Self::Cone { base, tip, radius, cap } => {
                geometry::Shape::Cone(Cone::new(at(base), at(tip), radius, cap))
            }
            Self::Torus { center, axis, radius, tube } => {
                geometry::Shape::Torus(Torus::new(at(center), axis, radius, tube))
            }
            Self::Mesh(ref mesh) => return LoweredShape::Mesh(mesh),
            Self::Transformed { ref shape, ref matrix } => {
                // The shape's own coordinates are relative to a point near it.
                let near = shape.representative_point().unwrap_or_default();
                match shape.to_traced_shape_relative_to(near) {
                    LoweredShape::Shape(own) => geometry::Shape::Transformed(Box::new(
                        TransformedShape::new(own, matrix.to_transform().relative_to_origins(near, origin)),
                    )),
                    mesh @ LoweredShape::Mesh(_) => return mesh,
                }
            }
        })
    }

    /// Returns the name of the shape's table, such as `sphere`.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Sphere { .. } => "sphere",
            Self::Quad { .. } => "quad",
            Self::Plane { .. } => "plane",
            Self::Box { .. } => "box",
            Self::Triangle { .. } => "triangle",
            Self::Disk { .. } => "disk",
            Self::Cylinder { .. } => "cylinder",
            Self::Cone { .. } => "cone",
            Self::Torus { .. } => "torus",
            Self::Mesh(_) => "mesh",
            Self::Transformed { shape, .. } => shape.kind(),
        }
    }

    /// Returns the mesh instance, or `None` for other shapes.
    pub fn as_mesh(&self) -> Option<&MeshReference> {
        if let Self::Mesh(mesh) = self { Some(mesh) } else { None }
    }

    /// Returns the shape without its matrix, and the matrix if it has one.
    pub fn shape_and_matrix(&self) -> (&Self, Option<&AffineMap>) {
        if let Self::Transformed { shape, matrix } = self { (shape, Some(matrix)) } else { (self, None) }
    }

    /// Returns the untransformed shape if it is a bounded open surface, or `None` for closed shapes, planes
    /// and meshes.
    pub fn untransformed_open_surface(&self) -> Option<OpenSurface> {
        match *self.shape_and_matrix().0 {
            Self::Quad { corner, u, v } => {
                Some(OpenSurface::Quad([corner, corner + u, corner + u + v, corner + v]))
            }
            Self::Triangle { a, b, c } => Some(OpenSurface::Triangle([a, b, c])),
            Self::Disk { center, normal, radius } => Some(OpenSurface::Disk { center, normal, radius }),
            Self::Cylinder { a, b, radius, caps: false } => Some(OpenSurface::Cylinder { a, b, radius }),
            Self::Cone { base, tip, radius, cap: false } => Some(OpenSurface::Cone { base, tip, radius }),
            Self::Sphere { .. }
            | Self::Plane { .. }
            | Self::Box { .. }
            | Self::Torus { .. }
            | Self::Cylinder { caps: true, .. }
            | Self::Cone { cap: true, .. }
            | Self::Mesh(_)
            | Self::Transformed { .. } => None,
        }
    }

    /// Returns a point on or inside the shape, or `None` for a mesh.
    pub fn representative_point(&self) -> Option<DVec3> {
        match *self {
            Self::Sphere { center, .. }
            | Self::Box { center, .. }
            | Self::Disk { center, .. }
            | Self::Torus { center, .. } => Some(center),
            Self::Quad { corner, .. } => Some(corner),
            Self::Plane { point, .. } => Some(point),
            Self::Triangle { a, .. } | Self::Cylinder { a, .. } => Some(a),
            Self::Cone { base, .. } => Some(base),
            Self::Mesh(_) => None,
            Self::Transformed { ref shape, ref matrix } => {
                Some(matrix.to_transform().point(shape.representative_point()?))
            }
        }
    }

    /// Returns an upper bound on the projection of the shape's points onto a unit direction, or `None` for a
    /// mesh. The bound is infinite for planes that are not perpendicular to the direction.
    pub fn upper_bound_along(&self, direction: DVec3) -> Option<f64> {
        let along = |place: DVec3| direction.dot(place);
        // The projected extent of a circle around an axis.
        let round = |axis: DVec3, radius: f64| {
            let cosine = axis.try_normalize().map_or(0.0, along);
            radius * (1.0 - cosine * cosine).max(0.0).sqrt()
        };
        Some(match *self {
            Self::Sphere { center, radius } => along(center) + radius,
            Self::Quad { corner, u, v } => {
                max_projection(direction, &[corner, corner + u, corner + v, corner + u + v])
            }
            Self::Triangle { a, b, c } => max_projection(direction, &[a, b, c]),
            Self::Plane { point, normal } => {
                let is_parallel =
                    normal.try_normalize().is_some_and(|normal| along(normal).abs() > 1.0 - 1e-9);
                if is_parallel { along(point) } else { f64::INFINITY }
            }
            Self::Box { center, size, rotate: DVec3::ZERO } => {
                along(center) + 0.5 * direction.abs().dot(size)
            }
            Self::Box { center, size, rotate: _ } => along(center) + 0.5 * size.length(),
            Self::Disk { center, normal, radius } => along(center) + round(normal, radius),
            Self::Cylinder { a, b, radius, caps: _ } => {
                max_projection(direction, &[a, b]) + round(b - a, radius)
            }
            Self::Cone { base, tip, radius, cap: _ } => {
                max_projection(direction, &[base + direction * round(tip - base, radius), tip])
            }
            Self::Torus { center, axis, radius, tube } => along(center) + round(axis, radius) + tube,
            Self::Mesh(_) => return None,
            Self::Transformed { ref shape, ref matrix } => {
                let own = DVec3::from_array(matrix.linear.map(along));
                let length = own.length();
                along(matrix.translate) + length * shape.upper_bound_along(own / length)?
            }
        })
    }
}

/// Returns the largest projection of the points onto a unit direction.
pub fn max_projection(direction: DVec3, points: &[DVec3]) -> f64 {
    points.iter().map(|point| direction.dot(*point)).fold(f64::NEG_INFINITY, f64::max)
}

impl Fingerprinted for Shape {
    fn add_to_fingerprint(&self, key: &mut FingerprintHasher, of: &FingerprintContext<'_>) {
        match self {
            Self::Sphere { center, radius } => key.add_usize(0).add_dvec3(*center).add_f64(*radius),
            Self::Quad { corner, u, v } => key.add_usize(1).add_dvec3(*corner).add_dvec3(*u).add_dvec3(*v),
            Self::Plane { point, normal } => key.add_usize(2).add_dvec3(*point).add_dvec3(*normal),
            Self::Box { center, size, rotate } => {
                key.add_usize(3).add_dvec3(*center).add_dvec3(*size).add_dvec3(*rotate)
            }
            Self::Triangle { a, b, c } => key.add_usize(4).add_dvec3(*a).add_dvec3(*b).add_dvec3(*c),
            Self::Disk { center, normal, radius } => {
                key.add_usize(5).add_dvec3(*center).add_dvec3(*normal).add_f64(*radius)
            }
            Self::Cylinder { a, b, radius, caps } => {
                key.add_usize(6).add_dvec3(*a).add_dvec3(*b).add_f64(*radius).add_bool(*caps)
            }
            Self::Cone { base, tip, radius, cap } => {
                key.add_usize(7).add_dvec3(*base).add_dvec3(*tip).add_f64(*radius).add_bool(*cap)
            }
            Self::Torus { center, axis, radius, tube } => {
                key.add_usize(8).add_dvec3(*center).add_dvec3(*axis).add_f64(*radius).add_f64(*tube)
            }
            Self::Mesh(mesh) => key.add_usize(9).add_with_references(mesh, of),
            Self::Transformed { shape, matrix } => {
                key.add_usize(10).add_with_references(matrix, of).add_with_references(&**shape, of)
            }
        };
    }
}

impl Fingerprinted for MeshReference {
    fn add_to_fingerprint(&self, key: &mut FingerprintHasher, of: &FingerprintContext<'_>) {
        // Vertex colors do not affect the geometry.
        let Self { file, placed, smooth, vertex_colors: _ } = *self;
        key.add_fingerprint(&of.meshes[file]).add_bool(smooth).add_with_references(&placed, of);
    }
}
