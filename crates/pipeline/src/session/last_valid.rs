//! Renders the last valid scene while the scene file is broken.

use std::path::PathBuf;
use std::sync::Arc;

use super::outputs::remove_outdated_report;
use super::own::{saved_scene_plan, texture_needs_with_saved_scene};
use super::{Engine, RequestContext};
use crate::control::Cancelled;
use crate::memory::MemoryEstimate;
use crate::plan::resolve_plan;
use crate::protocol::{Event, LastValidSceneRenderOutcome, Request, Status};
use crate::sink::EventSink;
use crate::stages::containers::GltfContainers;
use crate::stages::meshes::MeshesByFileIndex;
use crate::stages::parse::ParsedScene;
use crate::stages::textures::{NeededTextures, Textures, find_textures_needed_for_view, load_textures};
use crate::stages::{AbortReason, FileReadContext, Findings};
use crate::table::StageRunner;
use crate::watch::content::{FilePathAndContentId, FilesSeenByRequest};
use crate::world::{GlassSolids, TextureRolesNeededByRender};

/// A valid scene and all files needed for its image.
#[derive(Clone)]
pub(super) struct LastValidScene {
    /// Generation of the request that read the scene.
    pub(super) generation: u64,
    pub(super) parsed: Arc<ParsedScene>,
    pub(super) meshes: MeshesByFileIndex,
    pub(super) bodies: Arc<GlassSolids>,
    pub(super) textures: Arc<Textures>,
    /// Textures that were needed when `textures` was loaded.
    pub(super) needed: NeededTextures,
    /// All files that were read for the scene, with their contents.
    pub(super) files: Vec<FilePathAndContentId>,
}

impl LastValidScene {
    /// Whether a file other than the scene file has changed since it was read.
    fn have_asset_files_changed(&self, reading: &FileReadContext<'_>) -> Result<bool, Cancelled> {
        let loaded = &self.parsed.loaded;
        let is_mesh = |path: &PathBuf| loaded.scene.mesh_files.iter().any(|file| file.value == *path);
        for FilePathAndContentId { path, content } in &self.files {
            let is_scene_file = *path == loaded.path && !is_mesh(path);
            if !is_scene_file && reading.contents.first_seen_content_id(path, reading.token)? != *content {
                return Ok(true);
            }
        }
        Ok(false)
    }
}

impl Engine {
    /// Renders and writes the last valid scene with the overrides from the newest request, whose own scene
    /// cannot be loaded. Does not overwrite files that the broken scene might reference.
    pub(super) fn render_and_write_last_valid_scene(
        &mut self,
        newest: &Request,
        sink: &EventSink,
        context: &RequestContext<'_>,
    ) {
        let before = self.current_image_key_and_view();
        // Drop errors from this render, because the failed request has already reported its own.
        let end = match self.run_last_valid_scene_stages(newest, sink, context) {
            Ok(Some(is_reused)) => LastValidSceneRenderOutcome::Finished {
                unchanged: is_reused && self.current_image_key_and_view() == before,
            },
            Ok(None) | Err(_) => LastValidSceneRenderOutcome::Stopped,
        };
        sink.send(Event::LastGoodEnded { generation: newest.generation, end });
    }

    /// Renders and writes the last valid scene. Returns whether the existing image and files were reused, or
    /// `None` if there is no valid scene or its files have changed.
    fn run_last_valid_scene_stages(
        &mut self,
        newest: &Request,
        sink: &EventSink,
        context: &RequestContext<'_>,
    ) -> Result<Option<bool>, AbortReason> {
        let is_it = |good: &&LastValidScene| good.parsed.loaded.path == newest.scene;
        let Some(good) = self.good.as_ref().filter(is_it).cloned() else { return Ok(None) };
        let request = Request { force: false, ..newest.clone() };
        // Plan the request for the last valid scene.
        let (loaded, path) = (&good.parsed.loaded, &request.scene);
        let Ok(plan) = resolve_plan(&loaded.scene, path, &request.overrides) else { return Ok(None) };
        let own = saved_scene_plan(&request, &good.parsed)?;
        // Load the textures needed for another view if their files are still valid.
        let pool = self.render_thread_pool(plan.threads)?;
        let snapshot = FilesSeenByRequest::new(Arc::clone(&self.contents));
        let containers = GltfContainers::default();
        let token = context.token;
        let reading =
            FileReadContext { sink, token, contents: &snapshot, pool: &pool, containers: &containers };
        let lookups = texture_needs_with_saved_scene(&plan, own.as_ref());
        let Some(good) = self.load_missing_textures(good, lookups, &reading)? else { return Ok(None) };
        let (meshes, texture_bytes) = (&good.meshes, good.textures.memory_bytes);
        let estimate = MemoryEstimate::for_image_and_scene(&plan, &plan.scene, meshes, texture_bytes);
        self.check_memory(&estimate, &request, (&plan, own.as_ref()))?;
        // Prepare the scene, reusing unchanged values.
        let mut table = StageRunner { sink, token: context.token, stages: Vec::new(), is_silent: true };
        let ready = self.build_world(&request, &good, (plan, own), &mut table, &reading)?;
        let photons = self.make_current_and_trace_photons(&request, &ready, &mut table, sink, context)?;
        // Render and write.
        let rendered = self.render(&request, &ready, photons, sink, context)?;
        let mut is_written_now = false;
        if self.written.first_foreign_file(&ready.plan.outputs, &self.contents).is_none() {
            // The write stage reports files that cannot be written.
            let written =
                self.run_write_stage(&request, &ready.plan, &Findings::default(), sink, context.writing);
            is_written_now = written.is_ok_and(|staged| staged.status == Status::Done);
            if is_written_now {
                // Remove the existing report, because it does not describe this image.
                remove_outdated_report(&ready.plan, &self.inputs, sink);
            }
        }
        Ok(Some(rendered.status == Status::Reused && !is_written_now))
    }

    /// Loads any additional textures that this view needs. Returns `None` if the scene's files have changed
    /// on disk, because they may no longer match the data in memory.
    fn load_missing_textures(
        &mut self,
        good: LastValidScene,
        lookups: TextureRolesNeededByRender,
        reading: &FileReadContext<'_>,
    ) -> Result<Option<LastValidScene>, AbortReason> {
        let loaded = &good.parsed.loaded;
        let needed = find_textures_needed_for_view(loaded, &good.meshes, lookups, &self.textures);
        let is_there = |one| good.needed.textures.contains(one);
        if needed.textures.iter().all(is_there) {
            return Ok(Some(good));
        }
        if good.have_asset_files_changed(reading)? {
            return Ok(None);
        }
        let mut findings = Findings::default();
        let found = load_textures(loaded, &needed, &mut self.textures, &mut findings, reading)?;
        reading.contents.recheck_seen_files(reading.token)?;
        if reading.contents.changed_file().is_some() {
            return Ok(None);
        }
        // A texture is missing here if its file has since become invalid.
        let files = [good.files, findings.files].concat();
        let good = LastValidScene { textures: Arc::new(found.value), needed, files, ..good };
        self.good = Some(good.clone());
        Ok(Some(good))
    }
}
