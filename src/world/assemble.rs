//! Putting a world together.

use std::sync::Arc;

use super::shape::MeshInstance;
use super::{Camera, Geometry, MeshTree, ObjectMaterial, Parts, Shape, World, emitters, lower};
use crate::control::{CancelToken, Cancelled};
use crate::geometry::cone::Cone;
use crate::geometry::cuboid::Cuboid;
use crate::geometry::cylinder::Cylinder;
use crate::geometry::disk::Disk;
use crate::geometry::parallelogram::Parallelogram;
use crate::geometry::plane::Plane;
use crate::geometry::sphere::Sphere;
use crate::geometry::torus::Torus;
use crate::geometry::triangle::Triangle;
use crate::lights::{Light, PointLight};
use crate::materials::Material;
use crate::math::transform::Transform;
use crate::scene::description::{self, Scene};

impl World {
    /// Put the parts together. The tree over all objects is taken from `reuse` where the same shapes stand under it.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn assemble(
        scene: &Scene,
        parts: &Parts,
        reuse: Option<&Self>,
        token: &CancelToken,
    ) -> Result<Self, Cancelled> {
        let described: Vec<_> = scene.objects.iter().map(|object| object.shape.clone()).collect();
        let geometry = match reuse.filter(|old| old.geometry.serves(&described, &parts.meshes)) {
            Some(old) => Arc::clone(&old.geometry),
            None => {
                let shapes = described.iter().map(|shape| lower_shape(shape, &parts.meshes, token));
                Arc::new(Geometry::build(shapes.collect::<Result<_, _>>()?, described, token)?)
            }
        };
        let (materials, object_materials) = lower_materials(scene, parts);
        let lights = gather_lights(scene, &geometry, &object_materials, &materials);
        Ok(Self {
            camera: Camera::new(&scene.camera, parts.orbiter.as_ref()),
            geometry,
            materials,
            object_materials,
            lights,
        })
    }
}

fn lower_shape(
    shape: &description::Shape,
    meshes: &[Arc<MeshTree>],
    token: &CancelToken,
) -> Result<Shape, Cancelled> {
    Ok(match *shape {
        description::Shape::Sphere { center, radius } => Shape::Sphere(Sphere { center, radius }),
        description::Shape::Quad { corner, u, v } => Shape::Quad(Parallelogram::new(corner, u, v)),
        description::Shape::Plane { point, normal } => Shape::Plane(Plane::new(point, normal)),
        description::Shape::Box { center, size, rotate } => Shape::Box(Cuboid::new(center, size, rotate)),
        description::Shape::Triangle { a, b, c } => Shape::Triangle(Triangle { a, b, c }),
        description::Shape::Disk { center, normal, radius } => Shape::Disk(Disk::new(center, normal, radius)),
        description::Shape::Cylinder { a, b, radius, caps } => {
            Shape::Cylinder(Cylinder::new(a, b, radius, caps))
        }
        description::Shape::Cone { base, tip, radius, cap } => Shape::Cone(Cone::new(base, tip, radius, cap)),
        description::Shape::Torus { center, axis, radius, tube } => {
            Shape::Torus(Torus::new(center, axis, radius, tube))
        }
        description::Shape::Mesh { file, scale, rotate, translate, smooth } => {
            let instance = MeshInstance {
                tree: Arc::clone(&meshes[file]),
                transform: Transform::scale_rotate_translate(scale, rotate, translate),
                smooth,
            };
            if smooth {
                instance.tree.prepare_normals(token)?;
            }
            Shape::Mesh(Box::new(instance))
        }
    })
}

/// The scene's materials, then each mesh file's, then the one for triangles without any.
fn lower_materials(scene: &Scene, parts: &Parts) -> (Vec<Material>, Vec<ObjectMaterial>) {
    let mut materials: Vec<_> =
        scene.materials.iter().map(|material| lower::material(scene, parts, &material.kind)).collect();
    let mut first_of_file = Vec::new();
    for mesh in &parts.meshes {
        first_of_file.push(materials.len() as u32);
        materials.extend(mesh.loaded().materials.iter().map(|own| lower::file_material(parts, own)));
    }
    let fallback = materials.len() as u32;
    materials.push(lower::fallback_material());
    let of_object = |object: &description::Object| match (object.material, object.shape.mesh_file()) {
        (Some(index), _) => ObjectMaterial::One(index as u32),
        (None, Some(file)) => ObjectMaterial::OfFile { first: first_of_file[file], fallback },
        (None, None) => ObjectMaterial::One(fallback),
    };
    let of_objects = scene.objects.iter().map(of_object).collect();
    (materials, of_objects)
}

/// Point lights first, then shapes that emit.
fn gather_lights(
    scene: &Scene,
    geometry: &Geometry,
    object_materials: &[ObjectMaterial],
    materials: &[Material],
) -> Vec<Light> {
    let points = scene.lights.iter().map(|light| {
        Light::Point(PointLight {
            position: light.position,
            intensity: light.intensity,
            falloff: light.falloff,
        })
    });
    let shapes = (0_u32..).zip(geometry.shapes()).zip(object_materials);
    let areas =
        shapes.flat_map(|((id, shape), &material)| emitters::area_lights(id, shape, material, materials));
    points.chain(areas).collect()
}
