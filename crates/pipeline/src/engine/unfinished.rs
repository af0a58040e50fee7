//! The last scene that could be read: it is rendered while the file is broken.

use std::sync::Arc;

use super::outputs::drop_report;
use super::own::{lookups, own_plan};
use super::{Engine, Meanwhile};
use crate::memory::Foretold;
use crate::plan::plan;
use crate::protocol::{Event, LastGoodEnd, Request, Status};
use crate::sink::Sink;
use crate::stages::containers::Containers;
use crate::stages::meshes::Meshes;
use crate::stages::parse::Parsed;
use crate::stages::textures::{Needed, Textures, needed, textures};
use crate::stages::{Findings, Reading, Stop};
use crate::table::StageTable;
use crate::watch::content::Snapshot;
use crate::world::{GlassSolids, TextureNeeds};

/// A scene with all files that its picture needs.
#[derive(Clone)]
pub(super) struct Good {
    /// The request that read it.
    pub(super) generation: u64,
    pub(super) parsed: Arc<Parsed>,
    pub(super) meshes: Meshes,
    pub(super) bodies: Arc<GlassSolids>,
    pub(super) textures: Arc<Textures>,
    /// Purposes that the textures were loaded for.
    pub(super) needed: Needed,
}

impl Engine {
    /// Shows and writes the last good scene with what the newest request changes of it, as that request is of a scene that
    /// cannot be read. Files that the scene might name by now are not written.
    pub(super) fn go_on(&mut self, newest: &Request, sink: &Sink, meanwhile: &Meanwhile<'_>) {
        let before = self.shown();
        // A newer request asks again; the request that failed has reported its errors.
        let end = match self.render_last_good(newest, sink, meanwhile) {
            Ok(Some(is_reused)) => LastGoodEnd::Finished { unchanged: is_reused && self.shown() == before },
            Ok(None) | Err(_) => LastGoodEnd::Stopped,
        };
        sink.send(Event::LastGoodEnded { generation: newest.generation, end });
    }

    /// Renders and writes the last good scene. Returns whether both were done before. `None` if there is no such scene.
    fn render_last_good(
        &mut self,
        newest: &Request,
        sink: &Sink,
        meanwhile: &Meanwhile<'_>,
    ) -> Result<Option<bool>, Stop> {
        let is_it = |good: &&Good| good.parsed.loaded.path == newest.scene;
        let Some(good) = self.good.as_ref().filter(is_it).cloned() else { return Ok(None) };
        let request = Request { force: false, ..newest.clone() };
        // Put the scene and the request together.
        let (loaded, path) = (&good.parsed.loaded, &request.scene);
        let Ok(plan) = plan(&loaded.scene, path, &request.overrides) else { return Ok(None) };
        let own = own_plan(&request, &good.parsed)?;
        // Load what another view needs, if the files still hold it.
        let pool = self.pool(plan.threads)?;
        let snapshot = Snapshot::of(Arc::clone(&self.contents));
        let containers = Containers::default();
        let token = meanwhile.token;
        let reading = Reading { sink, token, contents: &snapshot, pool: &pool, containers: &containers };
        let lookups = lookups(&plan, own.as_ref());
        let good = self.with_textures(good, lookups, &reading)?;
        let foretold = Foretold::of_scene(&plan, &plan.scene, &good.meshes, good.textures.memory_bytes);
        self.check_memory(&foretold, &request, (&plan, own.as_ref()))?;
        // Make it ready: all that did not change is kept from before.
        let mut table = StageTable { sink, token: meanwhile.token, stages: Vec::new(), is_silent: true };
        let ready = self.build(&request, &good, (plan, own), &mut table, &reading)?;
        let photons = self.light(&request, &ready, &mut table, sink, meanwhile)?;
        // Render and write.
        let rendered = self.render(&request, &ready, photons, sink, meanwhile)?;
        let mut is_written_now = false;
        if self.written.not_ours(&ready.plan.outputs, &self.contents).is_none() {
            // The stage reports files that cannot be written.
            let written = self.write(&request, &ready.plan, &Findings::default(), sink, meanwhile.writing);
            is_written_now = written.is_ok_and(|staged| staged.status == Status::Done);
            if is_written_now {
                // A report has stages that read the scene as it is.
                drop_report(&ready.plan, &self.inputs, sink);
            }
        }
        Ok(Some(rendered.status == Status::Reused && !is_written_now))
    }

    /// Loads what this picture looks up, where the scene was read for another one.
    fn with_textures(
        &mut self,
        good: Good,
        lookups: TextureNeeds,
        reading: &Reading<'_>,
    ) -> Result<Good, Stop> {
        let loaded = &good.parsed.loaded;
        let needed = needed(loaded, &good.meshes, lookups, &self.textures);
        let is_there = |one| good.needed.textures.contains(one);
        if needed.textures.iter().all(is_there) {
            return Ok(good);
        }
        let mut findings = Findings::default();
        let found = textures(loaded, &needed, &mut self.textures, &mut findings, reading)?;
        // A file that is broken by now leaves its texture out.
        let good = Good { textures: Arc::new(found.value), needed, ..good };
        self.good = Some(good.clone());
        Ok(good)
    }
}
