//! One request from the scene file to pictures on disk: the stages in their order, and all that is kept between
//! requests.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use rayon::{ThreadPool, ThreadPoolBuilder};

use super::cache::{Memo, Pool};
use super::plan::{Plan, plan};
use super::protocol::{Event, Failure, Report, Request, Stage, Status};
use super::report::{Outcome, report};
use super::sink::Sink;
use super::stages::accel::{AccelCache, Ingredients, Keyed, accel, needed};
use super::stages::meshes::{KeptMesh, Meshes, meshes};
use super::stages::parse::{Parsed, parse};
use super::stages::render::{Canvas, Order, render};
use super::stages::textures::{TextureCache, Textures, add_declared, textures};
use super::stages::write::{Written, check_targets, write};
use super::stages::{Findings, Reading, Staged, Stop, keys, lights::lights, photons::photons};
use super::table::Table;
use super::trace::{Kernel, Tracer};
use super::watch::content::{Contents, FileRead};
use crate::control::CancelToken;
use crate::integrators::RayCounters;
use crate::scene::diagnostic::Diagnostic;

/// All that is kept from request to request.
pub(super) struct Engine {
    kernel: Kernel,
    contents: Contents,
    parsed: Memo<Arc<Parsed>>,
    meshes: Pool<PathBuf, KeptMesh>,
    textures: TextureCache,
    accel: AccelCache,
    lights: Memo<()>,
    canvas: Option<Canvas>,
    written: Written,
    /// What the canvas is rendered by.
    plan: Option<Plan>,
    pool: Option<Arc<ThreadPool>>,
    /// The assets of the last scene that could be read: they stay watched while it is broken.
    assets: Vec<FileRead>,
}

/// Orders that come while a request is under way.
pub(super) struct Meanwhile<'a> {
    pub(super) token: &'a CancelToken,
    /// Takes an order to write the picture as it is.
    pub(super) take_write: &'a dyn Fn() -> bool,
}

/// Everything that is ready to be rendered.
struct Ready {
    parsed: Arc<Parsed>,
    plan: Plan,
    world: Keyed,
    texels_loaded: u64,
}

impl Engine {
    pub(super) fn new(kernel: Kernel) -> Self {
        Self {
            kernel,
            contents: Contents::default(),
            parsed: Memo::default(),
            meshes: Pool::default(),
            textures: TextureCache::default(),
            accel: AccelCache::default(),
            lights: Memo::default(),
            canvas: None,
            written: Written::default(),
            plan: None,
            pool: None,
            assets: Vec::new(),
        }
    }

    /// Do what is asked for and say what came of it.
    pub(super) fn request(&mut self, request: &Request, sink: &Sink, meanwhile: &Meanwhile<'_>) {
        let generation = request.generation;
        sink.send(Event::Started { generation });
        let mut findings = Findings::default();
        let outcome = self.run(request, sink, meanwhile, &mut findings);
        if let Err(Stop::Failed(Failure::Scene(diagnostics))) = &outcome {
            self.find_named(diagnostics, &request.scene, &mut findings, meanwhile.token);
        }
        self.say_files(&findings, sink);
        self.sweep(outcome.is_ok());
        sink.send(match outcome {
            Ok(report) => {
                let settled = |stage: Stage| report.stages[stage as usize].status != Status::Done;
                let unchanged = settled(Stage::Render) && settled(Stage::Write);
                Event::Done { generation, report: Box::new(report), warnings: findings.warnings, unchanged }
            }
            Err(Stop::Cancelled) => Event::Cancelled { generation },
            Err(Stop::Failed(failure)) => Event::Failed { generation, failure },
        });
    }

    /// Write the picture as it is, outside of a request.
    pub(super) fn write_now(&mut self, sink: &Sink) {
        let (Some(canvas), Some(plan)) = (&self.canvas, &self.plan) else {
            return say_write_failed(sink, "there is no picture yet".to_owned());
        };
        self.written.forget();
        // A token that nobody cancels: this picture was asked for by hand.
        let token = CancelToken::new();
        say_if_failed(sink, write(canvas, plan, &mut self.written, &self.contents, sink, &token));
    }

    fn run(
        &mut self,
        request: &Request,
        sink: &Sink,
        meanwhile: &Meanwhile<'_>,
        findings: &mut Findings,
    ) -> Result<Report, Stop> {
        let begin = Instant::now();
        let mut table = Table { sink, stages: Vec::new() };
        let ready = self.prepare(request, &mut table, meanwhile.token, findings)?;
        table.run(Stage::Photons, || {
            Ok(photons(ready.plan.scene.photons.enabled, request.overrides.photons))
        })?;
        self.plan = Some(ready.plan.clone());
        let rays = table.run(Stage::Render, || self.render(request, &ready, sink, meanwhile))?;
        table.run(Stage::Write, || self.write(request, &ready.plan, sink, meanwhile.token))?;
        let Some(canvas) = &self.canvas else { return Err(Stop::work("the film is gone")) };
        let outcome = Outcome {
            scene: &ready.parsed.loaded.path,
            plan: &ready.plan,
            world: &ready.world.1,
            canvas,
            rays,
            texels_loaded: ready.texels_loaded,
            is_written: request.write,
        };
        Ok(report(&outcome, table.stages, begin.elapsed().as_secs_f64()))
    }

    /// All stages before photons and light.
    fn prepare(
        &mut self,
        request: &Request,
        table: &mut Table<'_>,
        token: &CancelToken,
        findings: &mut Findings,
    ) -> Result<Ready, Stop> {
        let parsed = table
            .run(Stage::Parse, || parse(&request.scene, &self.contents, &mut self.parsed, findings, token))?;
        let plan = plan(parsed.loaded.scene.clone(), &request.scene, &request.overrides)
            .map_err(|error| Stop::Failed(Failure::Scene(vec![*error])))?;
        let settings = Box::new(plan.effective.clone());
        table.sink.send(Event::Settings { generation: request.generation, settings });
        if request.write {
            check_targets(&plan)?;
        }
        let pool = self.pool(plan.threads)?;
        let (meshes, textures) = self.load(&parsed, findings, table, token, &pool)?;
        let reading = Reading { sink: table.sink, token, contents: &self.contents, pool: &pool };
        let scene = &plan.scene;
        let from = Ingredients { scene, parsed: &parsed, meshes: &meshes, textures: &textures };
        let world = table.run(Stage::Accel, || accel(&from, &mut self.accel, &reading))?;
        table.run(Stage::Lights, || Ok(lights(&from, &world.1, &mut self.lights)))?;
        let texels_loaded = textures.texels_loaded;
        Ok(Ready { parsed, plan, world, texels_loaded })
    }

    /// All files that the scene names; every one is tried before the first error ends it.
    fn load(
        &mut self,
        parsed: &Parsed,
        findings: &mut Findings,
        table: &mut Table<'_>,
        token: &CancelToken,
        pool: &ThreadPool,
    ) -> Result<(Meshes, Textures), Stop> {
        let reading = Reading { sink: table.sink, token, contents: &self.contents, pool };
        let loaded = &parsed.loaded;
        let (cache, mesh_cache) = (&mut self.textures, &mut self.meshes);
        let found = table.run(Stage::Meshes, || meshes(loaded, mesh_cache, findings, &reading))?;
        let needed = needed(loaded, &found);
        let texels = table.run(Stage::Textures, || textures(loaded, &needed, cache, findings, &reading))?;
        self.assets = findings.files.clone();
        if findings.errors.is_empty() {
            self.say_files(findings, table.sink);
            Ok((found, texels))
        } else {
            Err(Stop::Failed(findings.take_failure()))
        }
    }

    fn render(
        &mut self,
        request: &Request,
        ready: &Ready,
        sink: &Sink,
        meanwhile: &Meanwhile<'_>,
    ) -> Result<Staged<RayCounters>, Stop> {
        let pool = self.pool(ready.plan.threads)?;
        let (plan, contents) = (&ready.plan, &self.contents);
        let written = std::cell::RefCell::new(&mut self.written);
        let pulse = |canvas: &Canvas| {
            if (meanwhile.take_write)() {
                let mut written = written.borrow_mut();
                written.forget();
                say_if_failed(sink, write(canvas, plan, &mut written, contents, sink, &CancelToken::new()));
            }
        };
        let order = Order {
            tracer: Tracer {
                kernel: self.kernel,
                pool: &pool,
                world: &ready.world.1,
                settings: &plan.settings,
                token: meanwhile.token,
            },
            plan,
            preview: request.preview,
            force: request.force,
            sink,
            pulse: &pulse,
        };
        let key = keys::render(ready.world.0, &plan.settings, plan.crop);
        render(key, &mut self.canvas, &order)
    }

    fn write(
        &mut self,
        request: &Request,
        plan: &Plan,
        sink: &Sink,
        token: &CancelToken,
    ) -> Result<Staged<()>, Stop> {
        match &self.canvas {
            Some(canvas) if request.write => {
                write(canvas, plan, &mut self.written, &self.contents, sink, token)
            }
            _ => Ok(Staged::skipped((), "nothing is to be written")),
        }
    }

    /// The pool of this many threads; kept while the number stays.
    fn pool(&mut self, threads: usize) -> Result<Arc<ThreadPool>, Stop> {
        if let Some(pool) = self.pool.as_ref().filter(|pool| pool.current_num_threads() == threads) {
            return Ok(pool.clone());
        }
        self.pool = None;
        let name = |index| format!("glimt-{index}");
        let pool = ThreadPoolBuilder::new()
            .num_threads(threads)
            .thread_name(name)
            .build()
            .map_err(|error| Stop::work(format!("cannot start {threads} threads: {error}")))?;
        Ok(self.pool.insert(Arc::new(pool)).clone())
    }

    fn say_files(&self, findings: &Findings, sink: &Sink) {
        let mut files = findings.files.clone();
        for asset in &self.assets {
            if files.iter().all(|file| file.path != asset.path) {
                files.push(asset.clone());
            }
        }
        sink.files(files);
    }

    /// A scene may be broken because it names a file that is not there: what the errors underline is watched as
    /// if it were a file's name, so that its coming is noticed.
    fn find_named(
        &self,
        diagnostics: &[Diagnostic],
        scene: &Path,
        findings: &mut Findings,
        token: &CancelToken,
    ) {
        let folder = scene.parent().unwrap_or(Path::new(""));
        for place in diagnostics.iter().filter_map(|one| one.place.as_ref()) {
            let text = place.source.get(place.span.clone()).unwrap_or("").trim_matches(['"', '\'']);
            if text.is_empty() || text.len() > 255 || text.contains(['\n', '\0']) {
                continue;
            }
            let path = folder.join(text);
            if let Ok(content) = self.contents.read(&path, token) {
                findings.read(FileRead { path, content });
            }
        }
    }

    fn sweep(&mut self, success: bool) {
        self.meshes.sweep(success);
        self.textures.sweep(success);
        self.accel.sweep(success);
    }

    /// For `check`: the scene and all files that it names, needed or not.
    pub(super) fn read_all(
        &mut self,
        path: &Path,
        sink: &Sink,
    ) -> Result<(Arc<Parsed>, Meshes, Textures, Vec<Diagnostic>), Failure> {
        let token = CancelToken::new();
        let mut findings = Findings::default();
        let mut all = || {
            let parsed = parse(path, &self.contents, &mut self.parsed, &mut findings, &token)?.value;
            let pool = self.pool(std::thread::available_parallelism().map_or(1, std::num::NonZero::get))?;
            let reading = Reading { sink, token: &token, contents: &self.contents, pool: &pool };
            let loaded = &parsed.loaded;
            let found = meshes(loaded, &mut self.meshes, &mut findings, &reading)?.value;
            let mut wanted = needed(loaded, &found);
            add_declared(loaded, &mut wanted);
            let texels = textures(loaded, &wanted, &mut self.textures, &mut findings, &reading)?.value;
            Ok((parsed, found, texels))
        };
        match all() {
            Ok((parsed, found, texels)) if findings.errors.is_empty() => {
                Ok((parsed, found, texels, findings.warnings))
            }
            Ok(_) => Err(findings.take_failure()),
            Err(Stop::Failed(failure)) => Err(failure),
            Err(Stop::Cancelled) => Err(Failure::Work("cancelled".to_owned())),
        }
    }
}

fn say_if_failed(sink: &Sink, written: Result<Staged<()>, Stop>) {
    if let Err(Stop::Failed(Failure::Work(message))) = written {
        say_write_failed(sink, message);
    }
}

fn say_write_failed(sink: &Sink, message: String) {
    sink.send(Event::WriteFailed { generation: sink.generation, message });
}
