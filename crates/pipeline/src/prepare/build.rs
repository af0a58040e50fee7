//! Builds the world from a loaded scene.

use std::sync::Arc;

use rayon::ThreadPool;

use super::{RequestCamera, SceneAssets, SceneCache};
use crate::keys;
use crate::math::DVec3;
use crate::plan::RenderPlan;
use crate::protocol::Stage;
use crate::scene::description::CameraOverrides;
use crate::scene::fingerprint::Fingerprint;
use crate::stages::AbortReason;
use crate::stages::accel::build_accel_structures;
use crate::stages::lights::collect_lights;
use crate::table::StageRecorder;
use crate::world::{World, WorldInputs};

/// A scene that is ready to be rendered.
pub(crate) struct ReadyScene {
    pub(crate) assets: Arc<SceneAssets>,
    pub(crate) plan: RenderPlan,
    pub(crate) world: Arc<World>,
    /// Key for everything in the world that affects images.
    pub(crate) world_key: Fingerprint,
    /// Key for all surfaces, lights and textures. It does not depend on `origin`.
    pub(crate) surfaces: Fingerprint,
    /// Coordinate origin of the world.
    pub(crate) origin: DVec3,
}

impl SceneCache {
    /// Builds the trees, lights and world for a scene. `change` contains the camera changes of the request.
    ///
    /// # Errors
    /// Returns [`AbortReason::Canceled`] if the token is canceled.
    pub(crate) fn build_ready_scene(
        &mut self,
        assets: Arc<SceneAssets>,
        plan: RenderPlan,
        change: &CameraOverrides,
        table: &mut StageRecorder<'_>,
        pool: &ThreadPool,
    ) -> Result<ReadyScene, AbortReason> {
        let (scene, token) = (&plan.scene, table.token);
        let camera =
            RequestCamera::new(scene, assets.parsed.orbiter, change).rotated_for_turntable(plan.turn);
        let (mesh_keys, orbiter) = (assets.mesh_keys(), camera.orbiter_fingerprint_text());
        let of = keys::scene_fingerprint_references(scene, &mesh_keys, orbiter.as_deref());
        let origin = camera.origin_near_camera();
        let stage = table.start(Stage::Accel);
        let (meshes, cache) = (&assets.meshes, &mut self.accel);
        let trees = stage.finish(build_accel_structures(scene, &of, origin, meshes, cache, pool, token)?);
        let stage = table.start(Stage::Lights);
        let (geometry, textures, cache) = (&trees.geometry, &assets.textures, &mut self.lights);
        let lights = stage.finish(collect_lights(scene, &of, geometry, textures, cache, token)?);
        let surfaces = keys::surfaces_and_lights_key(scene, &of, &assets.textures.keys);
        let world_key = keys::world_key(&surfaces, &camera.camera, &of);
        // Assemble the world, unless its key is unchanged.
        let key = keys::key_with_tree_kind(&world_key, scene.render.accel);
        let world = self.world.get(key).cloned().unwrap_or_else(|| {
            let parts = WorldInputs {
                meshes: trees.meshes,
                images: assets.textures.images.clone(),
                orbiter: camera.orbiter,
                camera: Some(camera.camera),
                glass_solids: Some(Arc::clone(&assets.glass)),
            };
            Arc::new(World::new(scene, &parts, trees.geometry, lights))
        });
        self.world.set(key, Arc::clone(&world));
        Ok(ReadyScene { assets, plan, world, world_key, surfaces, origin })
    }
}
