//! The scene's own image, which is the saved scene rendered with the command-line overrides. While the user
//! changes settings with keys to view other images, its film, checkpoint and files are kept.

use std::cell::RefCell;
use std::sync::Arc;

use crate::identity::ImageDependencies;
use crate::inputs::ProtectedInputs;
use crate::keys;
use crate::plan::RenderPlan;
use crate::prepare::{ReadyScene, RequestCamera, SceneAssets};
use crate::render::checkpointer::{CheckpointContext, Checkpointer, ProcessCheckpointState};
use crate::render::film_cache::FilmCache;
use crate::render::share::Shard;
use crate::scene::description::CameraOverrides;
use crate::scene::fingerprint::{Fingerprint, FingerprintHasher};
use crate::settings::{CheckpointSettings, ResumeMode};
use crate::sink::EventSink;
use crate::stages::write::image_encoding_settings;

/// The inputs of the scene's own image, for one version of the scene.
pub(super) struct SavedSceneImageInputs {
    /// Key of the film.
    pub(super) film: Fingerprint,
    /// Key for the finished image and its output files.
    pub(super) image: Fingerprint,
    assets: Arc<SceneAssets>,
    pub(super) plan: RenderPlan,
    camera: CameraOverrides,
    /// Share of the image that this process renders, or `None` for the whole image.
    pub(super) share: Option<Shard>,
}

impl SavedSceneImageInputs {
    /// Computes the keys for the scene's own image. `scene` is the prepared scene of the request, and `plan`
    /// contains the settings of the scene's own image.
    fn new(scene: &ReadyScene, plan: RenderPlan, camera: CameraOverrides) -> Self {
        let assets = Arc::clone(&scene.assets);
        let eye =
            RequestCamera::new(&plan.scene, assets.parsed.orbiter, &camera).rotated_for_turntable(plan.turn);
        let (meshes, orbiter) = (assets.mesh_keys(), eye.orbiter_fingerprint_text());
        let of = keys::scene_fingerprint_references(&plan.scene, &meshes, orbiter.as_deref());
        let world = keys::world_key(&scene.surfaces, &eye.camera, &of);
        let film = keys::film_sums_key(world, &plan.settings, plan.crop);
        let image = image_with_outputs_key(film, &plan);
        Self { film, image, assets, plan, camera, share: None }
    }

    /// Returns everything that affects the image.
    pub(super) fn dependencies(&self) -> ImageDependencies<'_> {
        let Self { assets, plan, camera, share, .. } = self;
        let divided = share.as_ref().map(|share| share.samples);
        ImageDependencies { parsed: &assets.parsed, plan, camera, files: &assets.files, divided }
    }
}

/// Returns the key for a finished image and its output files.
fn image_with_outputs_key(film: Fingerprint, plan: &RenderPlan) -> Fingerprint {
    let mut key = FingerprintHasher::new("own image");
    key.add_fingerprint(&keys::developed_image_key(film, plan, 0)).add_u64(plan.bit_depth.into());
    plan.layers.iter().for_each(|layer| {
        key.add_choice_name(*layer);
    });
    plan.outputs.images.iter().for_each(|path| {
        key.add_path_bytes(path);
    });
    key.finish()
}

/// The scene's own image across requests.
#[derive(Default)]
pub(super) struct SceneImage {
    /// The image for the newest request with a valid scene.
    pub(super) current: Option<SavedSceneImageInputs>,
    /// Whether the film may be dropped while other images are rendered.
    pub(super) is_film_expendable: bool,
    /// Lock on the checkpoint file, and the checkpoints already reported.
    checkpoint_state: RefCell<ProcessCheckpointState>,
}

impl SceneImage {
    /// Sets the image for a request and keeps its film while other images are rendered. See
    /// [`SavedSceneImageInputs::new`].
    pub(super) fn set_for_request(
        &mut self,
        scene: &ReadyScene,
        plan: RenderPlan,
        camera: CameraOverrides,
        films: &mut FilmCache,
    ) {
        let mut image = SavedSceneImageInputs::new(scene, plan, camera);
        if !self.is_film_expendable {
            films.pin(image.film);
        }
        if let Some(before) = self.current.take().filter(|before| before.film == image.film) {
            image.share = before.share;
        }
        self.current = Some(image);
    }

    /// Returns a checkpointer if `film` belongs to this image and the image uses checkpoints.
    pub(super) fn checkpointer<'a>(
        &'a self,
        film: Fingerprint,
        inputs: &'a ProtectedInputs,
        sink: &'a EventSink,
    ) -> Option<Checkpointer<'a>> {
        let own = self.current.as_ref().filter(|own| film == own.film && uses_checkpoints(&own.plan))?;
        let (output, finish) = (own.plan.outputs.images.first()?, image_encoding_settings(&own.plan));
        let lock = &self.checkpoint_state;
        let around = CheckpointContext { finish, dependencies: own.dependencies(), inputs, sink, lock };
        Some(Checkpointer::new(output, own.plan.checkpoints, around))
    }
}

/// Whether a plan's render uses checkpoints. The output must be a regular file or not exist yet, and
/// checkpoints must be enabled unless the render was explicitly resumed.
fn uses_checkpoints(plan: &RenderPlan) -> bool {
    let is_file =
        plan.outputs.images.first().is_some_and(|path| path.metadata().map_or(true, |found| found.is_file()));
    let CheckpointSettings { seconds, resume, .. } = plan.checkpoints;
    (seconds > 0.0 || resume == ResumeMode::Asked) && is_file
}
