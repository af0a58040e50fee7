//! Worlds for tests, built from the text of a scene file.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::assets::LoadedMesh;
use crate::control::CancelToken;
use crate::geometry::mesh::TriangleMesh;
use crate::materials::texels::Texels;
use crate::math::{DVec3, Vec3};
use crate::scene::description::{
    Accel, Environment, MapOrientation, MapRowPlacement, MeshFile, MeshReference, Object, ObjectTransform,
    Scene, Shape, Spanned,
};
use crate::world::{
    EnvironmentSource, Geometry, Images, MeshTree, World, WorldInputs, build_environment_map, build_lights,
    build_sky,
};

/// A world under construction.
pub struct TestWorldBuilder {
    pub scene: Scene,
    meshes: Vec<Arc<MeshTree>>,
    sky: Option<Arc<Texels>>,
}

impl TestWorldBuilder {
    /// Parses a scene file, which must not refer to other files.
    pub fn from_text(text: &str) -> Self {
        let outcome = crate::scene::parse(Arc::from(text), Path::new("scene.toml"));
        let scene = outcome.scene.expect("a valid scene");
        Self { scene, meshes: Vec::new(), sky: None }
    }

    /// Index of the material with this name.
    pub fn material(&self, name: &str) -> usize {
        self.scene.materials.iter().position(|material| material.name == name).expect("a material")
    }

    /// Adds a shape with the material at this index.
    pub fn shape(mut self, shape: Shape, material: usize) -> Self {
        let material = Some(material);
        self.scene.objects.push(Object { shape, material, placement: None, name: None, span: 0..0 });
        self
    }

    /// Adds a flat-shaded mesh, which is scaled, rotated and translated.
    pub fn mesh(
        mut self,
        mesh: TriangleMesh,
        [scale, rotate, translate]: [DVec3; 3],
        material: usize,
    ) -> Self {
        let loaded = Arc::new(LoadedMesh { mesh, ..LoadedMesh::default() });
        let tree = MeshTree::build(loaded, Accel::Bvh, &CancelToken::new()).expect("never canceled");
        self.meshes.push(Arc::new(tree));
        self.scene.mesh_files.push(MeshFile { value: PathBuf::new(), span: 0..0, part: None, subdivide: 0 });
        let file = self.meshes.len() - 1;
        let placed = ObjectTransform::Steps { scale, rotate, translate };
        self.shape(Shape::Mesh(MeshReference { file, placed, smooth: false, vertex_colors: false }), material)
    }

    /// Adds an environment map.
    pub fn sky(mut self, texels: &Arc<Texels>) -> Self {
        let file = Some(Spanned { value: PathBuf::from("sky.exr"), span: 0..0 });
        let (orientation, rows) = (MapOrientation::Turn(0.0), MapRowPlacement::Centers);
        self.scene.environment = Some(Environment { color: Vec3::ONE, file, sky: None, orientation, rows });
        self.sky = Some(Arc::clone(texels));
        self
    }

    /// Builds the world. Its coordinates are the scene's.
    pub fn world(self) -> World {
        let (token, scene) = (CancelToken::new(), &self.scene);
        let geometry = Geometry::from_scene(scene, &self.meshes, DVec3::ZERO, &token);
        let geometry = Arc::new(geometry.expect("never canceled"));
        let sky = scene.environment.as_ref().and_then(|environment| environment.sky.as_ref());
        let map = || {
            self.sky
                .as_ref()
                .and_then(|texels| build_environment_map(texels, MapRowPlacement::Centers))
                .map(EnvironmentSource::Map)
        };
        let sky = sky.map(|sky| EnvironmentSource::Sky(build_sky(sky))).or_else(map);
        let lights = build_lights(scene, &geometry, &Images::new(), sky, &token).expect("never canceled");
        World::new(scene, &WorldInputs { meshes: self.meshes, ..WorldInputs::default() }, geometry, lights)
    }
}
