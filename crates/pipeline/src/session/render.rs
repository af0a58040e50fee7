//! Renders the image of a request: photons, then the film.

use std::cell::RefCell;

use rayon::ThreadPool;

use super::{CurrentImage, RequestContext, Session};
use crate::control::CancelToken;
use crate::integrators::RayCounters;
use crate::keys;
use crate::prepare::ReadyScene;
use crate::protocol::{Request, Stage, StageStatus};
use crate::queries::QueryContext;
use crate::render::coarse_image::CoarseImageRenderer;
use crate::render::commands::PendingCommandRunner;
use crate::render::preview::PreviewSender;
use crate::render::scheduler::{FilmToRender, PreviewOptions, RenderStageInputs};
use crate::render::share::Shard;
use crate::scene::fingerprint::Fingerprint;
use crate::stages::photons::{PhotonContext, PhotonStore, SkipReuseOrTracePhotons, trace_first_photons};
use crate::stages::render::render;
use crate::stages::write::ImageWriteContext;
use crate::stages::{AbortReason, StageResult};
use crate::stopwatch::PausableStopwatch;
use crate::table::StageRecorder;
use crate::trace::{TileKernel, Tracer};

/// The inputs of the image of a request.
pub(super) struct RequestImageInputs {
    pub(super) scene: ReadyScene,
    /// Key of the film.
    pub(super) film: Fingerprint,
    /// Key of the photons, if the image uses them.
    pub(super) photons: Option<Fingerprint>,
    /// Share of the image that this process renders, or `None` for the whole image.
    pub(super) share: Option<Shard>,
}

impl Session {
    /// Makes a prepared scene the current image and traces its first photons.
    pub(super) fn make_current_and_trace_photons(
        &mut self,
        context: &RequestContext<'_>,
        scene: ReadyScene,
        table: &mut StageRecorder<'_>,
        pool: &ThreadPool,
    ) -> Result<RequestImageInputs, AbortReason> {
        let RequestContext { request, sink, token, .. } = *context;
        let plan = &scene.plan;
        let film = keys::film_sums_key(scene.world_key, &plan.settings, plan.crop);
        let queries = QueryContext::new(&scene, &request.overrides.sets);
        let is_own = request.own.is_none();
        let (photons, inputs, contents) = (&mut self.photons, &self.files.protected, &*self.contents);
        let commands = PendingCommandRunner {
            pending: context.commands,
            queries: &queries,
            to: ImageWriteContext { plan, inputs, contents, is_own, sink },
            written: RefCell::new(&mut self.written),
            is_postponed: &context.is_postponed,
        };
        let tick = || commands.run_pending(None, false);
        let is_new = request.force || self.films.get(film).is_none();
        let screen = PreviewSender { bounds: request.preview, plan, sink };
        let coarse = CoarseImageRenderer {
            tracer: create_tracer(self.config.kernel, pool, &scene, token),
            plan,
            is_moved: has_moved_camera(request),
            rate: &self.coarse_rate,
        };
        let stage = table.start(Stage::Photons);
        let task = SkipReuseOrTracePhotons::new(&scene, request.overrides.photons, photons);
        // Show the scene while the first photons are traced.
        if is_new && matches!(task, SkipReuseOrTracePhotons::Trace(..)) {
            coarse.show_without_photons(screen, tick)?;
        }
        let sending = PhotonContext { world: &scene.world, plan, pool, token, sink };
        let photons = stage.finish(trace_first_photons(task, photons, sending, tick)?);
        let plan = plan.clone();
        self.current = Some(CurrentImage { plan, queries, is_own, report: None });
        Ok(RequestImageInputs { scene, film, photons, share: None })
    }

    /// Determines which share of the image this process renders.
    pub(super) fn assign_share(&mut self, context: &RequestContext<'_>, image: &mut RequestImageInputs) {
        let photons = image.photons.and_then(|key| self.photons.get(key));
        let emits_photons = photons.is_some_and(PhotonStore::has_lit_caustic_casters);
        let plan = &mut image.scene.plan;
        let samples = plan.settings.render.samples;
        image.share = plan.shard.map(|(index, count)| Shard::new(index, count, emits_photons, samples));
        // A share may render fewer samples than the whole image.
        if let Some(share) = &image.share {
            plan.settings.render.samples = share.samples_per_pixel();
        }
        if let Some(own) = self.own.current.as_mut().filter(|_| context.request.own.is_none()) {
            own.share.clone_from(&image.share);
        }
    }

    /// Renders the image.
    pub(super) fn render(
        &mut self,
        context: &RequestContext<'_>,
        image: &RequestImageInputs,
        pool: &ThreadPool,
    ) -> Result<StageResult<RayCounters>, AbortReason> {
        let RequestContext { request, sink, token, .. } = *context;
        let plan = &image.scene.plan;
        let watch = PausableStopwatch::start(token);
        let Some(current) = &self.current else {
            return Err(AbortReason::from_work_error("the image is missing"));
        };
        let (inputs, contents) = (&self.files.protected, &*self.contents);
        let commands = PendingCommandRunner {
            pending: context.commands,
            queries: &current.queries,
            to: ImageWriteContext { plan, inputs, contents, is_own: current.is_own, sink },
            written: RefCell::new(&mut self.written),
            is_postponed: &context.is_postponed,
        };
        let checkpointer = request
            .should_write_scene_image()
            .then(|| self.own.checkpointer(image.film, inputs, sink))
            .flatten();
        let rendering = RenderStageInputs {
            film: FilmToRender {
                key: image.film,
                share: image.share.clone(),
                force: request.force,
                max_bytes: self.config.max_film_bytes,
            },
            tracer: create_tracer(self.config.kernel, pool, &image.scene, token),
            plan,
            photons: image.photons.and_then(|key| self.photons.get(key)),
            display: PreviewOptions {
                screen: PreviewSender { bounds: request.preview, plan, sink },
                first: request.first,
                is_moved: has_moved_camera(request),
                coarse_rate: &self.coarse_rate,
            },
            commands: &commands,
            checkpointer: checkpointer.as_ref(),
        };
        let rendered = render(&mut self.films, &rendering);
        let is_reused = rendered.as_ref().is_ok_and(|staged| staged.status == StageStatus::Reused);
        if let Some(state) = self.films.current_mut() {
            if image.share.is_some() {
                let own = self.own.current.as_ref();
                state.identity = own.map(|own| own.dependencies().names_and_values());
            }
            if state.key == image.film && !is_reused {
                state.render_seconds += watch.seconds();
            }
        }
        rendered
    }
}

fn has_moved_camera(request: &Request) -> bool {
    request.overrides.camera.has_changes()
}

/// Creates a tracer for a scene, without photons.
fn create_tracer<'a>(
    kernel: TileKernel,
    pool: &'a ThreadPool,
    scene: &'a ReadyScene,
    token: &'a CancelToken,
) -> Tracer<'a> {
    let (world, settings) = (&*scene.world, &scene.plan.settings);
    Tracer { kernel, pool, world, settings, token, photons: None, first: 0, layers: None }
}
