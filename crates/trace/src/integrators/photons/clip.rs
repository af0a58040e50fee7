//! The part of a kernel that lies on surface which receives photons together with its middle. It is told exactly where what is around is
//! flat and little, and by trials elsewhere.

use arrayvec::ArrayVec;

use super::kernel::weight_over;
use super::map::{LEAST_COSINE, Look, REACH};
use crate::geometry::{Shape, ShapeHit};
use crate::materials::{Bsdf, Material};
use crate::math::frame::Frame;
use crate::math::{DVec2, DVec3};
use crate::world::{Hit, MeshInstance, Object, World};

/// What edges and walls leave of a kernel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Clip {
    /// This part of its weight, all of it reached from the middle.
    Part(f32),
    /// A part that trials are to tell.
    Cut,
    /// A part that trials are to tell, which is all of it nearly everywhere.
    Crowded,
}

/// Distances in radii that tell one plane from another.
const FLAT: f64 = 4e-3;

/// Least cosine between the normals of two pieces of one plane.
const SAME_PLANE: f64 = 1.0 - 1e-6;

/// What walls may be off from the border of what they stand on, in radii.
const BORDER: f64 = 2e-3;

/// The largest cosine between a wall and the normal of what it stands on.
const UPRIGHT: f64 = 0.3;

/// What is farther from the middle than this, in radii, is not in the way: √(1 + REACH²) and some more.
const FAR: f64 = 1.05;

/// Spheres have as large a radius at least, in radii of the kernel, where it follows them all around its middle.
const WIDE: f64 = 2.0;

/// The least part that is told exactly.
const LEAST_PART: f64 = 1e-3;

/// Room for triangles of a mesh near a kernel, pieces of its plane, and walls.
const TRIANGLES: usize = 32;
const PIECES: usize = 8;
const WALLS: usize = 4;

/// The part of the kernel of a look that receives photons.
pub fn clip(world: &World, look: &Look, radius: f32) -> Clip {
    let mut around = Around::new(look, radius);
    let mut is_crowded = false;
    let is_told = world.geometry.around(&look.kernel_box(radius), |id, object| match object {
        Object::Shape(shape) => around.add_shape(shape, receives(material(world, id, 0))),
        Object::Mesh(mesh) => around.add_mesh((world, id), mesh, (look, radius), &mut is_crowded),
    });
    match around.part().filter(|_| is_told) {
        Some(part) => Clip::Part(part as f32),
        None if is_crowded => Clip::Crowded,
        None => Clip::Cut,
    }
}

/// The material of a part of an object.
pub fn material(world: &World, object: u32, primitive: u32) -> &Material {
    let shape = ShapeHit { primitive, ..ShapeHit::at(0.0) };
    &world.materials[world.material_index(&Hit { shape, object })]
}

/// Whether photons are kept on a material.
pub fn receives(material: &Material) -> bool {
    match &material.bsdf {
        Bsdf::Phong(phong) => phong.constant().is_none_or(|bsdf| !bsdf.is_black()),
        Bsdf::Mirror(_) | Bsdf::Glass(_) => false,
    }
}

/// A wall that stands on the plane of a kernel, before which its middle is: of points before it the product with the normal is at most
/// the distance.
struct Wall {
    normal: DVec2,
    distance: f64,
}

/// What is around the middle of a kernel, in a frame in which the kernel is the unit disc.
struct Around {
    point: DVec3,
    axes: [DVec3; 3],
    /// Pieces of its plane that receive photons.
    pieces: ArrayVec<ArrayVec<DVec2, 4>, PIECES>,
    /// Surfaces that hold all of the kernel.
    whole: u32,
    walls: ArrayVec<Wall, WALLS>,
}

impl Around {
    fn new(look: &Look, radius: f32) -> Self {
        let Frame { s, t, n } = Frame::from_normal(look.normal);
        let scale = 1.0 / f64::from(radius);
        Self {
            point: look.point.as_dvec3(),
            axes: [s, t, n].map(|axis| axis.as_dvec3() * scale),
            pieces: ArrayVec::new(),
            whole: 0,
            walls: ArrayVec::new(),
        }
    }

    /// A point in the frame.
    fn local(&self, point: DVec3) -> DVec3 {
        let from = point - self.point;
        DVec3::from_array(self.axes.map(|axis| axis.dot(from)))
    }

    /// Radius of the kernel.
    fn radius(&self) -> f64 {
        self.axes[2].length_recip()
    }

    /// The part of the kernel on the pieces; none where it is not told by them.
    fn part(&self) -> Option<f64> {
        if !self.walls.is_empty() && (self.whole > 0 || !self.are_before_walls()) {
            return None;
        }
        let part = f64::from(self.whole) + self.pieces.iter().map(|piece| weight_over(piece)).sum::<f64>();
        (LEAST_PART..=1.0 + FLAT).contains(&part).then_some(part.min(1.0))
    }

    /// Whether no wall stands between parts of the pieces.
    fn are_before_walls(&self) -> bool {
        let is_before = |wall: &Wall, corner: &DVec2| {
            wall.normal.dot(*corner) <= wall.distance + BORDER + 1e-6 * corner.length()
        };
        let corners = || self.pieces.iter().flatten();
        self.walls.iter().all(|wall| corners().all(|corner| is_before(wall, corner)))
    }

    /// Adds a shape; whether what is left of the kernel can still be told.
    fn add_shape(&mut self, shape: &Shape, receives: bool) -> bool {
        let (point, radius) = (self.point, self.radius());
        let is_far = |distance: f64| distance > FAR * radius;
        match shape {
            Shape::Quad(quad) => {
                let (c, u, v) = (quad.corner, quad.u, quad.v);
                self.add_piece(&[c, c + u, c + u + v, c + v], receives)
            }
            Shape::Triangle(triangle) => self.add_piece(&[triangle.a, triangle.b, triangle.c], receives),
            Shape::Box(cuboid) => (0..6).all(|face| {
                let (c, u, v) = cuboid.face(face);
                self.add_piece(&[c, c + u, c + u + v, c + v], receives)
            }),
            Shape::Plane(plane) => {
                let own = self.local(plane.point + plane.normal()) - self.local(plane.point);
                is_far(plane.distance(point))
                    || self.add_surface(own * radius, plane.distance(point) / radius, receives)
            }
            Shape::Disk(disk) => {
                let from_rim = disk.radius() - (point - disk.middle()).length();
                let own = self.local(disk.middle() + disk.normal()) - self.local(disk.middle());
                let height = (point - disk.middle()).dot(disk.normal()).abs() / radius;
                is_far(disk.distance(point))
                    || from_rim > FAR * radius && self.add_surface(own * radius, height, receives)
            }
            Shape::Sphere(sphere) => {
                let out = self.local(point + (point - sphere.center).normalize_or_zero()) * radius;
                is_far(sphere.distance(point))
                    || sphere.radius > WIDE * radius
                        && self.add_surface(out, sphere.distance(point) / radius, receives)
            }
            Shape::Cylinder(cylinder) => is_far(cylinder.distance(point)),
            Shape::Cone(cone) => is_far(cone.distance(point)),
            Shape::Torus(torus) => is_far(torus.distance(point)),
        }
    }

    /// Adds a surface that reaches over the kernel if it has its normal in the middle, at a height there.
    fn add_surface(&mut self, normal: DVec3, height: f64, receives: bool) -> bool {
        let is_own = normal.z.abs() > SAME_PLANE && height < FLAT;
        self.whole += u32::from(is_own && receives);
        is_own
    }

    /// Adds the triangles of a mesh.
    fn add_mesh(
        &mut self,
        (world, id): (&World, u32),
        mesh: &MeshInstance,
        (look, radius): (&Look, f32),
        is_crowded: &mut bool,
    ) -> bool {
        let mut near: ArrayVec<u32, TRIANGLES> = ArrayVec::new();
        let bounds = look.kernel_box(radius);
        if !mesh.around(&bounds, |triangle| near.try_push(triangle).is_ok()) {
            *is_crowded = true;
            return false;
        }
        // Some are visited more than once.
        near.sort_unstable();
        let mut last = None;
        near.iter().all(|&triangle| {
            let is_new = last.replace(triangle) != Some(triangle);
            let corners = mesh.world_corners(triangle);
            !is_new || self.add_piece(&corners, receives(material(world, id, triangle)))
        })
    }

    /// Adds a flat piece by its corners in order; whether what is left of the kernel can still be told.
    fn add_piece(&mut self, corners: &[DVec3], receives: bool) -> bool {
        let corners: ArrayVec<DVec3, 4> = corners.iter().map(|&corner| self.local(corner)).collect();
        let (u, v) = (corners[1] - corners[0], corners[2] - corners[0]);
        let normal = u.cross(v).normalize_or_zero();
        if normal == DVec3::ZERO {
            return true;
        }
        let over = || corners.iter().map(|corner| corner.truncate()).collect::<ArrayVec<DVec2, 4>>();
        let heights = corners.iter().map(|corner| corner.z);
        let (low, high) = heights.fold((f64::MAX, f64::MIN), |(low, high), z| (low.min(z), high.max(z)));
        let height = normal.dot(corners[0]) / normal.z;
        if normal.z.abs() > SAME_PLANE && height.abs() < FLAT {
            return !receives || self.pieces.try_push(over()).is_ok();
        }
        let reach = f64::from(REACH);
        let is_steep = normal.z.abs() <= f64::from(LEAST_COSINE);
        if high < -reach || low > reach || high < FLAT && (is_steep || !receives) || !meets_disc(&over()) {
            return true;
        }
        high >= FLAT && self.add_wall(normal, normal.dot(corners[0]))
    }

    /// Adds the plane of a wall, by its normal and its distance from the middle along that.
    fn add_wall(&mut self, normal: DVec3, distance: f64) -> bool {
        let (side, along) = (distance.signum(), normal.truncate());
        let length = along.length();
        let wall = Wall { normal: along * (side / length), distance: distance.abs() / length };
        normal.z.abs() < UPRIGHT && wall.distance > FLAT && self.walls.try_push(wall).is_ok()
    }
}

/// Whether a polygon has a point in the unit disc.
fn meets_disc(corners: &[DVec2]) -> bool {
    let edges = || corners.iter().zip(corners.iter().cycle().skip(1));
    let is_near = |a: DVec2, b: DVec2| {
        let way = b - a;
        let along = (-a.dot(way) / way.length_squared()).clamp(0.0, 1.0);
        (a + way * along).length_squared() < 1.0
    };
    let left = edges().filter(|(a, b)| a.perp_dot(**b) > 0.0).count();
    left == 0 || left == corners.len() || edges().any(|(&a, &b)| is_near(a, b))
}
