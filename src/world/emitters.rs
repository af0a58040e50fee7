//! Which objects are lights.

use super::{MeshTree, ObjectMaterial, Shape};
use crate::geometry::cuboid::Cuboid;
use crate::lights::emitter::Emitter;
use crate::lights::rectangle::QuadEmitter;
use crate::lights::round::{Round, RoundEmitter};
use crate::lights::sphere::SphereEmitter;
use crate::lights::triangles::TriangleEmitter;
use crate::lights::{AreaLight, Light};
use crate::materials::Material;
use crate::math::Vec3;

/// The lights that an object is; a box is one for each face, a mesh one for each of its emitting materials.
pub fn area_lights(
    object: u32,
    shape: &Shape,
    material: ObjectMaterial,
    materials: &[Material],
) -> Vec<Light> {
    let emission =
        |index: u32| Some(materials[index as usize].emission()).filter(|&radiance| radiance != Vec3::ZERO);
    let light = |shape, radiance| Light::Area(AreaLight { shape, radiance, object });
    // The radiance of a shape that is all of one material.
    let radiance = match material {
        ObjectMaterial::One(index) => emission(index),
        ObjectMaterial::OfFile { .. } => None,
    };
    let one = |shape: Option<Emitter>| shape.zip(radiance).map(|(shape, radiance)| light(shape, radiance));
    let round = |shape| one(RoundEmitter::new(shape).map(Emitter::Round)).into_iter().collect();
    match shape {
        Shape::Disk(disk) => round(Round::Disk(*disk)),
        Shape::Cylinder(cylinder) => round(Round::Cylinder(*cylinder)),
        Shape::Cone(cone) => round(Round::Cone(*cone)),
        Shape::Torus(torus) => round(Round::Torus(*torus)),
        Shape::Sphere(sphere) => {
            let emitter = SphereEmitter { center: sphere.center, radius: sphere.radius };
            one(Some(Emitter::Sphere(emitter))).into_iter().collect()
        }
        Shape::Quad(quad) => {
            let emitter = QuadEmitter::new(quad.corner, quad.u, quad.v);
            one(Some(Emitter::Quad(emitter))).into_iter().collect()
        }
        Shape::Box(cuboid) => box_faces(cuboid).filter_map(|face| one(Some(Emitter::Quad(face)))).collect(),
        Shape::Triangle(triangle) => {
            let corners = [triangle.a, triangle.b, triangle.c];
            one(TriangleEmitter::new(vec![(corners, 0)]).map(Emitter::Triangles)).into_iter().collect()
        }
        // No part of the sky is without it: such a scene is refused where it is read.
        Shape::Plane(_) => Vec::new(),
        Shape::Mesh(mesh) => mesh_materials(&mesh.tree, material)
            .into_iter()
            .filter_map(|(index, wanted)| {
                let radiance = emission(index)?;
                let triangles = triangles_of(&mesh.tree, wanted);
                let corners = triangles.into_iter().map(|id| (mesh.world_corners(id), id)).collect();
                Some(light(Emitter::Triangles(TriangleEmitter::new(corners)?), radiance))
            })
            .collect(),
    }
}

fn box_faces(cuboid: &Cuboid) -> impl Iterator<Item = QuadEmitter> {
    (0..6).map(|face| {
        let (corner, u, v) = cuboid.face(face);
        QuadEmitter::new(corner, u, v)
    })
}

/// The materials of a mesh instance, each with the number by which its triangles name it; none: all triangles.
fn mesh_materials(tree: &MeshTree, material: ObjectMaterial) -> Vec<(u32, Option<u32>)> {
    match material {
        ObjectMaterial::One(index) => vec![(index, None)],
        ObjectMaterial::OfFile { first, .. } => {
            (0..tree.loaded().materials.len() as u32).map(|own| (first + own, Some(own))).collect()
        }
    }
}

fn triangles_of(tree: &MeshTree, wanted: Option<u32>) -> Vec<u32> {
    let mesh = &tree.loaded().mesh;
    let all = 0..mesh.triangles.len() as u32;
    match wanted {
        None => all.collect(),
        Some(own) => all.filter(|&id| mesh.materials.get(id as usize) == Some(&own)).collect(),
    }
}
