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
    let light = |shape, radiance| Light::Area(AreaLight { shape, radiance, object });
    let of_one =
        |index: u32| Some(materials[index as usize].emission()).filter(|&radiance| radiance != Vec3::ZERO);
    let radiance = match material {
        ObjectMaterial::One(index) => of_one(index),
        ObjectMaterial::OfFile { .. } => None,
    };
    let round = |shape, radiance| {
        let emitter = RoundEmitter::new(shape);
        emitter.map(|emitter| light(Emitter::Round(emitter), radiance)).into_iter().collect()
    };
    match (shape, radiance) {
        (Shape::Disk(disk), Some(radiance)) => round(Round::Disk(*disk), radiance),
        (Shape::Cylinder(cylinder), Some(radiance)) => round(Round::Cylinder(*cylinder), radiance),
        (Shape::Cone(cone), Some(radiance)) => round(Round::Cone(*cone), radiance),
        (Shape::Torus(torus), Some(radiance)) => round(Round::Torus(*torus), radiance),
        (Shape::Sphere(sphere), Some(radiance)) => {
            vec![light(
                Emitter::Sphere(SphereEmitter { center: sphere.center, radius: sphere.radius }),
                radiance,
            )]
        }
        (Shape::Quad(quad), Some(radiance)) => {
            vec![light(Emitter::Quad(QuadEmitter::new(quad.corner, quad.u, quad.v)), radiance)]
        }
        (Shape::Box(cuboid), Some(radiance)) => {
            box_faces(cuboid).map(|face| light(Emitter::Quad(face), radiance)).collect()
        }
        (Shape::Triangle(triangle), Some(radiance)) => {
            let corners = [triangle.a, triangle.b, triangle.c];
            let emitter = TriangleEmitter::new(vec![(corners, 0)]);
            emitter.map(|emitter| light(Emitter::Triangles(emitter), radiance)).into_iter().collect()
        }
        (Shape::Mesh(mesh), _) => mesh_materials(&mesh.tree, material)
            .into_iter()
            .filter_map(|(index, wanted)| {
                let radiance = of_one(index)?;
                let triangles = triangles_of(&mesh.tree, wanted);
                let corners = triangles.into_iter().map(|id| (mesh.world_corners(id), id)).collect();
                Some(light(Emitter::Triangles(TriangleEmitter::new(corners)?), radiance))
            })
            .collect(),
        _ => Vec::new(),
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
