//! The scene's own image, which is the saved scene rendered with the command-line overrides. While the user
//! changes settings with keys to view other images, its film, checkpoint and files are kept.

use std::sync::Arc;

use super::orders::Interruption;
use super::{Engine, ReadyScene};
use crate::assembly::RequestCamera;
use crate::control::CancelToken;
use crate::identity::ImageDependencies;
use crate::keys;
use crate::memory::MemoryEstimate;
use crate::output::part::NamedRenderInput;
use crate::plan::{RenderPlan, resolve_plan};
use crate::protocol::{Failure, Request, SavedSceneImageState, Status, WriteRequirement, reasons};
use crate::render::checkpointer::{CheckpointContext, Checkpointer};
use crate::render::film_state::FilmState;
use crate::render::share::Shard;
use crate::scene::description::CameraOverrides;
use crate::scene::fingerprint::{Fingerprint, FingerprintHasher};
use crate::settings::{CheckpointSettings, Overrides, ResumeMode};
use crate::sink::EventSink;
use crate::stages::parse::ParsedScene;
use crate::stages::write::{ImageWriteContext, image_encoding_settings, write_if_wanted};
use crate::stages::{AbortReason, StageResult};
use crate::watch::content::FilePathAndContentId;
use crate::world::TextureRolesNeededByRender;

/// The scene's own image for the newest request.
pub(super) struct SavedSceneImage {
    /// Key of the film.
    pub(super) film: Fingerprint,
    /// Key for the finished image and its output files.
    pub(super) image: Fingerprint,
    parsed: Arc<ParsedScene>,
    pub(super) plan: RenderPlan,
    camera: CameraOverrides,
    /// Files that the image depends on.
    files: Vec<FilePathAndContentId>,
    /// Share of the image that this process renders, or `None` for the whole image.
    pub(super) share: Option<Shard>,
}

impl SavedSceneImage {
    /// Computes the keys for the scene's own image. `eye` is the scene's camera. `surfaces` and `meshes` are
    /// the keys for the surfaces and meshes.
    pub(super) fn new(
        (parsed, plan, eye): (&Arc<ParsedScene>, RenderPlan, &RequestCamera),
        (surfaces, meshes): (&Fingerprint, &[Fingerprint]),
        (camera, files): (CameraOverrides, &[FilePathAndContentId]),
    ) -> Self {
        let orbiter = eye.orbiter.map(|camera| format!("{camera:?}"));
        let of = keys::scene_references_for_fingerprint(&plan.scene, meshes, orbiter.as_deref());
        let world = keys::world_key(surfaces, &eye.camera, &of);
        let film = keys::film_sums_key(world, &plan.settings, plan.crop);
        let image = image_with_outputs_key(film, &plan);
        Self { film, image, parsed: Arc::clone(parsed), plan, camera, files: files.to_vec(), share: None }
    }

    /// Returns the names and values of everything that affects the image.
    pub(super) fn dependencies(&self) -> Vec<NamedRenderInput> {
        let divided = self.share.as_ref().map(|share| share.samples);
        let Self { parsed, plan, camera, files, .. } = self;
        ImageDependencies { parsed, plan, camera, files, divided }.names_and_values()
    }
}

/// Returns the key for a finished image and its output files.
fn image_with_outputs_key(film: Fingerprint, plan: &RenderPlan) -> Fingerprint {
    let mut key = FingerprintHasher::new("own image");
    key.add_fingerprint(&keys::developed_image_key(film, plan, 0)).add_u64(plan.bit_depth.into());
    plan.layers.iter().for_each(|layer| {
        key.add_choice(*layer);
    });
    plan.outputs.iter().for_each(|path| {
        key.add_path_bytes(path);
    });
    key.finish()
}

impl Engine {
    /// Sets the scene's own image for a request and keeps its film while other images are rendered.
    pub(super) fn pin_saved_scene_image(&mut self, mut own: SavedSceneImage) {
        if self.pins_own {
            self.films.pin(own.film);
        }
        if let Some(before) = self.own.take().filter(|before| before.film == own.film) {
            own.share = before.share;
        }
        self.own = Some(own);
    }

    /// Checks whether a request fits in memory. If the request shows another image, the film of the scene's
    /// own image also counts. If the two films do not fit together, the film of the scene's own image may be
    /// dropped, but only if that image has been written.
    ///
    /// # Errors
    /// The request needs more memory than is available.
    pub(super) fn check_memory(
        &mut self,
        estimate: &MemoryEstimate,
        request: &Request,
        plans: (&RenderPlan, Option<&RenderPlan>),
    ) -> Result<(), AbortReason> {
        let (plan, bytes) = (plans.0, self.additional_scene_film_bytes(request, plans));
        let all = estimate.clone().with_saved_scene_film(bytes).check(plan);
        self.pins_own = all.is_ok() || !self.is_saved_scene_image_written();
        let room = if self.pins_own { all? } else { estimate.check(plan)? };
        if !self.pins_own {
            self.films.unpin();
        }
        self.films.set_byte_limit(room);
        Ok(())
    }

    /// Returns the size of the scene's own film in bytes if it is kept in addition to the request's film.
    fn additional_scene_film_bytes(
        &self,
        request: &Request,
        (plan, own_image_plan): (&RenderPlan, Option<&RenderPlan>),
    ) -> u64 {
        let (Some(own), Some(own_image_plan)) = (&self.own, own_image_plan) else { return 0 };
        let of = |plan: &RenderPlan| keys::film_sums_key(own.film, &plan.settings, plan.crop);
        let is_shared = of(plan) == of(own_image_plan)
            && request.overrides.camera == saved_scene_overrides(request).camera;
        let state = self.films.get(own.film).filter(|state| state.has_samples() && !is_shared);
        state.map_or(0, FilmState::memory_bytes)
    }

    /// If the scene has been saved since the last request, allows its own image to replace an image that was
    /// written with keyboard changes.
    pub(super) fn allow_replacing_after_scene_save(&mut self, saves: u64) {
        if std::mem::replace(&mut self.saves, saves) != saves {
            self.written.allow_replacing_user_written_image();
        }
    }

    /// If the scene's own image is being rendered, records which share of it this process renders.
    pub(super) fn record_scene_image_shard(&mut self, request: &Request, ready: &ReadyScene) {
        if let Some(own) = self.own.as_mut().filter(|_| request.own.is_none()) {
            own.share.clone_from(&ready.share);
        }
    }

    /// Reports the state of the scene's own image while another image is shown.
    pub(super) fn report_saved_scene_image_state(
        &self,
        request: &Request,
        film: Fingerprint,
        sink: &EventSink,
    ) {
        let Some(own) = self.own.as_ref().filter(|_| request.own.is_some()) else { return };
        sink.send_saved_scene_image_state(match self.films.get(own.film) {
            _ if self.is_saved_scene_image_written() => SavedSceneImageState::Written,
            Some(state) if state.has_samples() => {
                SavedSceneImageState::Begun { is_rendering: own.film == film }
            }
            Some(_) | None => SavedSceneImageState::NotBegun,
        });
    }

    /// Whether the output files contain the current version of the scene's own image.
    pub(super) fn is_saved_scene_image_written(&self) -> bool {
        self.own.as_ref().is_some_and(|own| self.written.own == Some(own.image))
    }

    /// Records whether the current plan's output files contain the finished image.
    pub(super) fn record_saved_scene_image_written(&mut self, is_written: bool) {
        let own = self.own.as_ref().filter(|_| is_written && self.is_own);
        self.written.own = own.map(|own| own.image);
    }

    /// Writes the scene's own image if the current view is based on its finished film.
    ///
    /// # Errors
    /// Returns [`AbortReason::Cancelled`] if the token is canceled.
    pub(super) fn write_image_without_overrides(
        &mut self,
        sink: &EventSink,
        token: &CancelToken,
    ) -> Result<StageResult<bool>, AbortReason> {
        let only_shown = || Ok(StageResult::skipped(false, reasons::PREVIEW_ONLY));
        if self.is_saved_scene_image_written() || self.written.has_user_written_image_on_disk(&self.contents)
        {
            return only_shown();
        }
        let (Some(own), Some(state), Some(pool)) = (&self.own, self.films.current(), &self.pool) else {
            return only_shown();
        };
        let is_simple = own.plan.layers.is_empty() && own.plan.turn.is_none() && !own.plan.outputs.is_empty();
        if state.key != own.film || !is_simple || !state.is_finished(&own.plan) {
            return only_shown();
        }
        let to = ImageWriteContext {
            plan: &own.plan,
            inputs: &self.inputs,
            contents: &self.contents,
            is_own: true,
            sink,
        };
        let written = &mut self.written;
        let wrote = pool.install(|| write_if_wanted(WriteRequirement::Try, state, to, written, token))?;
        written.own = wrote.value.then_some(own.image);
        Ok(StageResult { value: false, status: Status::Skipped, why: reasons::PREVIEW_ONLY.to_owned() })
    }

    /// Calls `work`, with a checkpointer if `film` belongs to the scene's own image and that image uses
    /// checkpoints.
    pub(super) fn with_checkpointer<T>(
        &self,
        film: Option<Fingerprint>,
        sink: &EventSink,
        interruption: &dyn Fn() -> Interruption,
        work: impl FnOnce(Option<&Checkpointer<'_>>, &Self) -> T,
    ) -> T {
        let own = self.own.as_ref().filter(|own| film == Some(own.film) && uses_checkpoints(&own.plan));
        let Some((own, output)) = own.and_then(|own| Some((own, own.plan.outputs.first()?))) else {
            return work(None, self);
        };
        let finish = image_encoding_settings(&own.plan);
        let name = || own.dependencies();
        let around = CheckpointContext {
            finish: &finish,
            inputs: &self.inputs,
            sink,
            name: &name,
            interruption,
            lock: &self.checkpoint_lock,
        };
        work(Some(&Checkpointer::new(output, own.plan.checkpoints, around)), self)
    }

    /// Removes the checkpoint of the scene's own image after that image has been written.
    pub(super) fn remove_saved_scene_checkpoint(&self, sink: &EventSink) {
        let Some(state) = self.own.as_ref().and_then(|own| self.films.get(own.film)) else { return };
        self.with_checkpointer(Some(state.key), sink, &|| Interruption::Replaced, |checkpointer, _| {
            if let Some(checkpointer) = checkpointer {
                checkpointer.detect_own_checkpoint(state);
                checkpointer.finish(state, state.traced, true);
            }
        });
    }

    /// Saves a checkpoint of the scene's own image if the worker stops while showing another image.
    pub(crate) fn checkpoint_saved_scene_image(&self, sink: &EventSink, interruption: Interruption) {
        let Some(own) = self.own.as_ref().filter(|_| !self.is_saved_scene_image_written()) else { return };
        let Some(state) = self.films.get(own.film).filter(|state| !state.is_kept) else { return };
        self.with_checkpointer(Some(own.film), sink, &|| interruption, |checkpointer, _| {
            if let Some(checkpointer) = checkpointer {
                checkpointer.detect_own_checkpoint(state);
                checkpointer.save_if_cancelled(state, state.traced, state.render_seconds);
            }
        });
    }
}

/// Whether a plan's render uses checkpoints. The output must be a regular file or not exist yet, and
/// checkpoints must be enabled unless the render was explicitly resumed.
fn uses_checkpoints(plan: &RenderPlan) -> bool {
    let is_file =
        plan.outputs.first().is_some_and(|path| path.metadata().map_or(true, |found| found.is_file()));
    let CheckpointSettings { seconds, resume, .. } = plan.checkpoints;
    (seconds > 0.0 || resume == ResumeMode::Asked) && is_file
}

/// Returns the plan for the scene's own image if the request shows another image.
///
/// # Errors
/// Returns the errors from [`resolve_plan`].
pub(super) fn saved_scene_plan(
    request: &Request,
    parsed: &ParsedScene,
) -> Result<Option<RenderPlan>, AbortReason> {
    let plan = |own: &Overrides| resolve_plan(&parsed.loaded.scene, &request.scene, own);
    let own = request.own.as_deref().map(plan).transpose();
    own.map_err(|error| AbortReason::Failed(Failure::Scene(vec![*error])))
}

/// Returns the textures that a request needs, including those for the scene's own image, because its film key
/// depends on them.
pub(super) fn texture_needs_with_saved_scene(
    plan: &RenderPlan,
    own: Option<&RenderPlan>,
) -> TextureRolesNeededByRender {
    let shown = plan.settings.texture_needs();
    own.map_or(shown, |own| shown.union(own.settings.texture_needs()))
}

/// Returns the overrides that apply to the scene's own image.
pub(super) fn saved_scene_overrides(request: &Request) -> &Overrides {
    request.own.as_deref().unwrap_or(&request.overrides)
}

/// Whether the scene's own image should be written.
pub(super) fn request_writes_saved_scene_image(request: &Request) -> bool {
    request.own.is_some() || request.write != WriteRequirement::No
}
