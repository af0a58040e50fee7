//! Shapes.

use std::ops::Range;

use super::super::fingerprint::{Fingerprint, Fingerprinted, Referents};
use crate::geometry;
use crate::geometry::cone::Cone;
use crate::geometry::cuboid::Cuboid;
use crate::geometry::cylinder::Cylinder;
use crate::geometry::disk::Disk;
use crate::geometry::parallelogram::Parallelogram;
use crate::geometry::plane::Plane;
use crate::geometry::sphere::Sphere;
use crate::geometry::torus::Torus;
use crate::geometry::triangle::Triangle;
use crate::math::DVec3;

/// A shape with its material.
#[derive(Clone, Debug, PartialEq)]
pub struct Object {
    /// The geometry.
    pub shape: Shape,
    /// Index into [`Scene::materials`](super::Scene::materials). `None` for the mesh file's own materials.
    pub material: Option<usize>,
    /// Name in the file.
    pub name: Option<Box<str>>,
    /// The table in the file.
    pub span: Range<usize>,
}

/// The geometry of an object.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// All points at `radius` > 0 from `center`.
    Sphere {
        /// Centre.
        center: DVec3,
        /// Radius.
        radius: f64,
    },
    /// corner + s·u + t·v, s and t in [0, 1]; u × v ≠ 0, front along it.
    Quad {
        /// Corner.
        corner: DVec3,
        /// First edge.
        u: DVec3,
        /// Second edge.
        v: DVec3,
    },
    /// Infinite.
    Plane {
        /// A point of it.
        point: DVec3,
        /// Its front; not 0, any length.
        normal: DVec3,
    },
    /// An oriented box.
    Box {
        /// Centre.
        center: DVec3,
        /// Edge lengths, > 0.
        size: DVec3,
        /// Degrees about x, then y, then z.
        rotate: DVec3,
    },
    /// Front along (b − a) × (c − a) ≠ 0.
    Triangle {
        /// Corner.
        a: DVec3,
        /// Corner.
        b: DVec3,
        /// Corner.
        c: DVec3,
    },
    /// Flat and round.
    Disk {
        /// Centre.
        center: DVec3,
        /// Its front; not 0, any length.
        normal: DVec3,
        /// Radius > 0.
        radius: f64,
    },
    /// A round bar, or a tube.
    Cylinder {
        /// An end of its axis.
        a: DVec3,
        /// The other end, elsewhere.
        b: DVec3,
        /// Radius > 0.
        radius: f64,
        /// Whether the ends are closed.
        caps: bool,
    },
    /// Round, with a tip.
    Cone {
        /// Middle of its base.
        base: DVec3,
        /// Its tip, elsewhere.
        tip: DVec3,
        /// Radius > 0 of the base.
        radius: f64,
        /// Whether the base is closed.
        cap: bool,
    },
    /// A ring of a round tube.
    Torus {
        /// Centre.
        center: DVec3,
        /// The axis that it goes around; not 0, any length.
        axis: DVec3,
        /// Radius of the circle in the middle of the tube, > `tube`.
        radius: f64,
        /// Radius of the tube, > 0.
        tube: f64,
    },
    /// An instance of a mesh file.
    Mesh(Mesh),
}

/// An instance of a mesh file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mesh {
    /// Index into [`Scene::mesh_files`](super::Scene::mesh_files).
    pub file: usize,
    /// Applied first; no component 0.
    pub scale: DVec3,
    /// Then this, degrees about x, then y, then z.
    pub rotate: DVec3,
    /// Then this.
    pub translate: DVec3,
    /// Interpolate vertex normals.
    pub smooth: bool,
}

/// Forms that shapes have when they are traced.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Lowered<'a> {
    /// One that is computed from its numbers alone.
    Shape(geometry::Shape),
    /// One whose triangles are in a file.
    Mesh(&'a Mesh),
}

impl Shape {
    /// Made ready, in coordinates that start at `origin`.
    pub fn lowered(&self, origin: DVec3) -> Lowered<'_> {
        let at = |place: DVec3| place - origin;
        Lowered::Shape(match *self {
            Self::Sphere { center, radius } => geometry::Shape::Sphere(Sphere { center: at(center), radius }),
            Self::Quad { corner, u, v } => geometry::Shape::Quad(Parallelogram::new(at(corner), u, v)),
            Self::Plane { point, normal } => geometry::Shape::Plane(Plane::new(at(point), normal)),
            Self::Box { center, size, rotate } => geometry::Shape::Box(Cuboid::new(at(center), size, rotate)),
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
            Self::Mesh(ref mesh) => return Lowered::Mesh(mesh),
        })
    }

    /// Name of the shape's table in a scene file.
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
        }
    }

    /// The instance of a mesh file that it is, if it is one.
    pub fn mesh(&self) -> Option<&Mesh> {
        match self {
            Self::Mesh(mesh) => Some(mesh),
            Self::Sphere { .. }
            | Self::Quad { .. }
            | Self::Plane { .. }
            | Self::Box { .. }
            | Self::Triangle { .. }
            | Self::Disk { .. }
            | Self::Cylinder { .. }
            | Self::Cone { .. }
            | Self::Torus { .. } => None,
        }
    }
}

impl Fingerprinted for Shape {
    fn add_to(&self, key: &mut Fingerprint, of: &Referents<'_>) {
        match self {
            Self::Sphere { center, radius } => key.index(0).dvec3(*center).f64(*radius),
            Self::Quad { corner, u, v } => key.index(1).dvec3(*corner).dvec3(*u).dvec3(*v),
            Self::Plane { point, normal } => key.index(2).dvec3(*point).dvec3(*normal),
            Self::Box { center, size, rotate } => key.index(3).dvec3(*center).dvec3(*size).dvec3(*rotate),
            Self::Triangle { a, b, c } => key.index(4).dvec3(*a).dvec3(*b).dvec3(*c),
            Self::Disk { center, normal, radius } => key.index(5).dvec3(*center).dvec3(*normal).f64(*radius),
            Self::Cylinder { a, b, radius, caps } => {
                key.index(6).dvec3(*a).dvec3(*b).f64(*radius).flag(*caps)
            }
            Self::Cone { base, tip, radius, cap } => {
                key.index(7).dvec3(*base).dvec3(*tip).f64(*radius).flag(*cap)
            }
            Self::Torus { center, axis, radius, tube } => {
                key.index(8).dvec3(*center).dvec3(*axis).f64(*radius).f64(*tube)
            }
            Self::Mesh(mesh) => key.index(9).add(mesh, of),
        };
    }
}

impl Fingerprinted for Mesh {
    fn add_to(&self, key: &mut Fingerprint, of: &Referents<'_>) {
        let Self { file, scale, rotate, translate, smooth } = *self;
        key.key(&of.meshes[file]).dvec3(scale).dvec3(rotate).dvec3(translate).flag(smooth);
    }
}
